// The model `plan` of planners/nao_plan.py, operation by operation. [PRP16] §3.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

enum Action { WAIT, WALK, TURN, POSTURE };
enum Posture { STAND_INIT, CROUCH, SIT, SIT_RELAX, STAND, STAND_ZERO };

struct World {
    double x, y, heading;
    std::int64_t posture;
    double goal_x, goal_y, elapsed, drift, effort;
    std::int64_t collision, obstacle_count;
    std::array<std::array<double, 3>, 8> obstacles;
    double speed, turn_rate, step_phase;
    std::array<std::array<double, 6>, 6> posture_seconds;
    double fall_seconds;
};

inline bool standing(std::int64_t posture) {
    return posture == STAND || posture == STAND_INIT || posture == STAND_ZERO;
}

struct Contact {
    double share;
    std::int64_t which;
};

// The share of the way by (dx, dy) after which the robot touches a disc, and which; (2, -1) if none.
inline Contact first_contact(double x, double y, double dx, double dy, const World& w) {
    Contact first{2.0, -1};
    const double way = dx * dx + dy * dy;
    if (way == 0.0) return first;
    for (std::int64_t i = 0; i < w.obstacle_count; ++i) {
        const auto& [cx, cy, r] = w.obstacles[i];
        const double fx = x - cx, fy = y - cy;
        const double along = fx * dx + fy * dy;
        if (along >= 0.0) continue;
        const double apart = fx * fx + fy * fy - r * r;
        if (apart <= 0.0) return {0.0, i};
        const double square = along * along - way * apart;
        if (square <= 0.0) continue;
        const double touch = (-along - std::sqrt(square)) / way;
        if (touch < first.share && touch < 1.0) first = {touch, i};
    }
    return first;
}

struct State {
    double x, y, heading;
    std::int64_t posture;
    double behind, seconds;
};

// One action: where it leads, and the seconds that it takes.
inline void perform(State& s, std::int64_t action, double ahead, double left, const World& w) {
    double dx = 0.0, dy = 0.0, angle = 0.0, takes = 0.0;
    std::int64_t target = s.posture;
    if (action == WAIT) {
        takes = ahead;
    } else if (action == WALK) {
        if (standing(s.posture)) {
            const double cosine = std::cos(s.heading), sine = std::sin(s.heading);
            dx = cosine * ahead - sine * left;
            dy = sine * ahead + cosine * left;
            takes = std::sqrt(dx * dx + dy * dy) / w.speed + w.step_phase;
        }
    } else if (action == TURN) {
        if (standing(s.posture)) {
            angle = ahead;
            takes = std::fabs(angle) / w.turn_rate + w.step_phase;
        }
    } else {
        target = static_cast<std::int64_t>(ahead);
        takes = w.posture_seconds[s.posture][target];
    }
    if (s.behind >= takes) {
        s.behind -= takes;
        return;
    }
    const double rest = 1.0 - s.behind / takes;
    dx *= rest, dy *= rest, angle *= rest;
    s.behind = 0.0;
    s.seconds += rest * takes;
    if (!standing(s.posture) && standing(target)) s.heading += w.drift;
    s.heading += angle;
    const Contact contact = first_contact(s.x, s.y, dx, dy, w);
    if (contact.which < 0) {
        s.x += dx, s.y += dy;
        s.posture = target;
        return;
    }
    s.posture = CROUCH;
    if (w.collision) {
        s.x = w.obstacles[contact.which][0], s.y = w.obstacles[contact.which][1];
        return;
    }
    s.seconds += w.fall_seconds;
    s.x += contact.share * dx, s.y += contact.share * dy;
}

// A plan of any length, and what it costs.
template <class Names, class Rng>
double plan(Rng& rng, const World& w) {
    State s{w.x, w.y, w.heading, w.posture, w.elapsed, 0.0};
    while (rng.flip(Names::more, 0.7)) {
        const std::int64_t action = rng.randint(Names::action, 4);
        double ahead = 0.0, left = 0.0;
        if (action == WAIT) {
            ahead = rng.randint(Names::wait, 1000) * 0.001;
        } else if (action == WALK) {
            ahead = rng.gaussian(Names::walk, 0.0, 1.0);
            left = rng.gaussian(Names::walk, 0.0, 1.0);
        } else if (action == TURN) {
            ahead = rng.gaussian(Names::turn, 0.0, 1.0);
        } else {
            ahead = rng.randint(Names::posture, 6);
        }
        perform(s, action, ahead, left, w);
    }
    const double ex = s.x - w.goal_x, ey = s.y - w.goal_y;
    return std::sqrt(ex * ex + ey * ey) + w.effort * s.seconds;
}
