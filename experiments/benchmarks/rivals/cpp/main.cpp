// Optimises plans for some generations and prints what that took and what came of it.
// Usage: PROGRAM SETTINGS, a file of lines "name number…" (cpp_program.py writes it).

#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine.hpp"
#include "names.hpp"
#include "plan.hpp"

#ifndef NAMES
#define NAMES Slots
#endif

class Settings {
  public:
    explicit Settings(const char* path) {
        std::ifstream file(path);
        for (std::string line; std::getline(file, line);) {
            std::istringstream words(line);
            std::string name, word;
            words >> name;
            while (words >> word) numbers_[name].push_back(std::strtod(word.c_str(), nullptr));
        }
    }

    double operator[](const char* name) const { return numbers_.at(name).at(0); }

    template <std::size_t N, std::size_t M>
    void read(const char* name, std::array<std::array<double, M>, N>& table) const {
        const std::vector<double>& numbers = numbers_.at(name);
        if (numbers.size() != N * M) throw std::runtime_error(name);
        for (std::size_t i = 0; i < N * M; ++i) table[i / M][i % M] = numbers[i];
    }

  private:
    std::map<std::string, std::vector<double>> numbers_;
};

static World world_of(const Settings& of) {
    World w{};
    w.x = of["x"], w.y = of["y"], w.heading = of["heading"];
    w.posture = static_cast<std::int64_t>(of["posture"]);
    w.goal_x = of["goal_x"], w.goal_y = of["goal_y"];
    w.current_ahead = of["current_ahead"], w.current_left = of["current_left"];
    w.command_seconds = of["command_seconds"];
    w.done = static_cast<std::int64_t>(of["done"]);
    w.current = static_cast<std::int64_t>(of["current"]);
    w.elapsed = of["elapsed"], w.drift = of["drift"], w.effort = of["effort"];
    w.collision = static_cast<std::int64_t>(of["collision"]);
    w.obstacle_count = static_cast<std::int64_t>(of["obstacle_count"]);
    w.speed = of["speed"], w.turn_rate = of["turn_rate"], w.step_phase = of["step_phase"];
    w.fall_seconds = of["fall_seconds"];
    of.read("obstacles", w.obstacles);
    of.read("posture_seconds", w.posture_seconds);
    return w;
}

static Operators operators_of(const Settings& of) {
    Operators op{};
    op.crossover = of["crossover"], op.line = of["line"], op.difference = of["difference"];
    op.cloud = of["cloud"], op.pair = of["pair"], op.structure = of["structure"];
    op.immigrants = of["immigrants"], op.mutations = of["mutations"];
    op.smallest_step = of["smallest_step"], op.largest_step = of["largest_step"];
    op.elites = of["elites"], op.scouts = of["scouts"], op.exclusion = of["exclusion"];
    op.islands = static_cast<std::int64_t>(of["islands"]);
    op.restart = static_cast<std::int64_t>(of["restart"]);
    op.adaptive = of["adaptive"] != 0.0, op.dormant = of["dormant"] != 0.0;
    return op;
}

static double cpu_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

int main(int count, char** words) {
    if (count != 2) {
        std::fprintf(stderr, "usage: %s SETTINGS\n", words[0]);
        return 2;
    }
    const Settings settings(words[1]);
    const World world = world_of(settings);
    Query<NAMES> query(static_cast<std::int64_t>(settings["population"]),
                       static_cast<std::uint64_t>(settings["seed"]), operators_of(settings));
    const auto model = [&world](auto& rng) { return plan<NAMES>(rng, world); };
    query.evolve(model, static_cast<std::int64_t>(settings["warm_up"]));
    const std::int64_t before = query.evaluations();
    const double begun = cpu_seconds();
    query.evolve(model, static_cast<std::int64_t>(settings["generations"]));
    const double seconds = cpu_seconds() - begun;
    std::printf("%lld %.9f %a %016llx\n", static_cast<long long>(query.evaluations() - before),
                seconds, query.best_value(), static_cast<unsigned long long>(query.best_hash()));
}
