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
    double goal_x, goal_y;
    std::int64_t done, current;
    double current_ahead, current_left;
    double elapsed, drift, effort;
    std::int64_t collision, obstacle_count;
    std::array<std::array<double, 3>, 8> obstacles;
    double speed, turn_rate, step_phase;
    std::array<std::array<double, 6>, 6> posture_seconds;
    double fall_seconds, command_seconds;
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
    double seconds;
};

// Seconds that an action takes from a posture; 0 for one that is refused.
inline double duration(std::int64_t posture, std::int64_t action, double ahead, double left,
                       const World& w) {
    if (action == WAIT) return ahead;
    if (action == POSTURE) return w.posture_seconds[posture][static_cast<std::int64_t>(ahead)];
    if (!standing(posture)) return 0.0;
    if (action == WALK) return std::sqrt(ahead * ahead + left * left) / w.speed + w.step_phase;
    return std::fabs(ahead) / w.turn_rate + w.step_phase;
}

// What is left of an action after `behind` of its seconds.
inline double share_left(std::int64_t action, double behind, double takes, const World& w) {
    if (behind <= 0.0) return 1.0;
    if (behind >= takes) return 0.0;
    if (action == WAIT || action == POSTURE) return 1.0 - behind / takes;
    const double way = takes - w.step_phase;
    if (way <= 0.0) return 0.0;
    const double gone = (behind - 0.5 * w.step_phase) / way;
    return 1.0 - (gone < 0.0 ? 0.0 : gone > 1.0 ? 1.0 : gone);
}

// One action: where it leads, and the seconds that it takes.
inline void perform(State& s, std::int64_t action, double ahead, double left, double behind,
                    const World& w) {
    const double takes = duration(s.posture, action, ahead, left, w);
    const double share = share_left(action, behind, takes, w);
    s.seconds += takes > behind ? takes - behind : 0.0;
    if (action == WAIT) return;
    if (action == POSTURE) {
        const auto target = static_cast<std::int64_t>(ahead);
        if (!standing(s.posture) && standing(target)) s.heading += share * w.drift;
        s.posture = target;
        return;
    }
    if (!standing(s.posture)) return;
    if (action == TURN) {
        s.heading += share * ahead;
        return;
    }
    const double cosine = share * std::cos(s.heading), sine = share * std::sin(s.heading);
    const double dx = cosine * ahead - sine * left, dy = sine * ahead + cosine * left;
    const Contact contact = first_contact(s.x, s.y, dx, dy, w);
    if (contact.which < 0) {
        s.x += dx, s.y += dy;
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
    State s{w.x, w.y, w.heading, w.posture, 0.0};
    std::int64_t made = 0;
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
        if (++made <= w.done) continue;
        const bool goes_on = made == w.done + 1 && action == w.current
                             && ahead == w.current_ahead && left == w.current_left;
        perform(s, action, ahead, left, goes_on ? w.elapsed : 0.0, w);
        s.seconds += w.command_seconds;
    }
    const double ex = s.x - w.goal_x, ey = s.y - w.goal_y;
    return std::sqrt(ex * ex + ey * ey) + w.effort * s.seconds;
}
