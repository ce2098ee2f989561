// How the model of plan.hpp names its sources: by numbers that the compiler knows, or by strings.
#pragma once

#include <string_view>
#include <unordered_map>

// Each source is a number in the code.
struct Slots {
    static constexpr int COUNT = 6;
    static constexpr int more = 0, action = 1, wait = 2, walk = 3, turn = 4, posture = 5;

    int number(int source) const { return source; }
};

// Each choice is looked up by its tag, as [PRP16] §2 has it.
struct Tags {
    static constexpr int COUNT = 6;
    static constexpr std::string_view more = "more", action = "action", wait = "wait",
                                      walk = "walk", turn = "turn", posture = "posture";

    int number(std::string_view tag) const { return numbers.find(tag)->second; }

    const std::unordered_map<std::string_view, int> numbers = {
        {"more", 0}, {"action", 1}, {"wait", 2}, {"walk", 3}, {"turn", 4}, {"posture", 5},
    };
};
