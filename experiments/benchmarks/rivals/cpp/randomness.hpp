// splitmix64 (Steele, Lea & Flood 2014), and what is drawn with it.
#pragma once

#include <cmath>
#include <cstdint>

class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}

    std::uint64_t bits() {
        std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
        return z ^ (z >> 31);
    }

    // Uniform in [0, 1).
    double unit() { return static_cast<double>(static_cast<std::int64_t>(bits() >> 11)) * 0x1p-53; }

    // Uniform in [0, n), for n < 2^32.
    std::int64_t below(std::int64_t n) { return scaled(bits() >> 32, n); }

    // 32 random bits as a number in [0, n).
    static std::int64_t scaled(std::uint64_t bits, std::int64_t n) {
        return static_cast<std::int64_t>((bits * static_cast<std::uint64_t>(n)) >> 32);
    }

    // Standard normal, by Marsaglia's polar method.
    double normal() {
        for (;;) {
            const double x = 2.0 * unit() - 1.0;
            const double y = 2.0 * unit() - 1.0;
            const double square = x * x + y * y;
            if (0.0 < square && square < 1.0) {
                return x * std::sqrt(-2.0 * std::log(square) / square);
            }
        }
    }

  private:
    std::uint64_t state_;
};
