// Which choice has which place in a genome, and two populations of genomes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

enum Kind : std::int32_t { FLIP, RANDINT, GAUSSIAN };

constexpr double NOT_CHOSEN = std::numeric_limits<double>::quiet_NaN();
constexpr double INVALID = std::numeric_limits<double>::infinity();

// Why a run asked for more than the tables hold.
enum Overflow : int { FEW_CELLS = 2, NARROW = 4, SHORT = 8 };

// A table grows no further than this.
constexpr std::int64_t LONGEST = 8192;

struct Home {
    std::int32_t source, index;
    Kind kind;
};

struct Population {
    Population(std::int64_t rows, std::int64_t most_cells, std::int64_t longest)
        : genomes(rows * most_cells, NOT_CHOSEN),
          logs(rows * longest),
          lengths(rows),
          values(rows, INVALID) {}

    std::vector<double> genomes;     // [rows, most_cells]; NOT_CHOSEN: no value
    std::vector<std::int32_t> logs;  // [rows, longest]: cells in the order of the calls
    std::vector<std::int32_t> lengths;
    std::vector<double> values;      // of the model
};

// The i-th call to a source is an address; each address ever used has a cell in every genome.
class Genomes {
  public:
    Genomes(std::int64_t sources, std::int64_t rows)
        : counts(sources),
          scales(sources, 1.0),
          sources_(sources),
          rows_(rows),
          cells_(sources * width, -1),
          homes_(most_cells),
          populations_{{rows, most_cells, longest}, {rows, most_cells, longest}} {}

    Population& parents() { return populations_[side_]; }
    Population& children() { return populations_[1 - side_]; }
    void swap() { side_ = 1 - side_; }

    const Home& home(std::int64_t cell) const { return homes_[cell]; }

    std::int32_t cell(std::int64_t source, std::int64_t index) const {
        return cells_[source * width + index];
    }

    // The cell of an address, a new one if need be; -1 if the tables are full.
    std::int32_t cell_of(std::int64_t source, std::int64_t index, Kind kind) {
        if (index >= width) return -1;
        std::int32_t& cell = cells_[source * width + index];
        if (cell >= 0) return cell;
        if (known + 1 >= most_cells) return -1;  // the last cell is scrap
        cell = static_cast<std::int32_t>(known++);
        homes_[cell] = {static_cast<std::int32_t>(source), static_cast<std::int32_t>(index), kind};
        for (Population& population : populations_) {
            for (std::int64_t row = 0; row < rows_; ++row) {
                population.genomes[row * most_cells + cell] = NOT_CHOSEN;
            }
        }
        return cell;
    }

    // Double what was too small.
    void grow(int reasons) {
        const std::int64_t had_cells = most_cells, had_width = width, had_longest = longest;
        if (reasons & FEW_CELLS) most_cells *= 2;
        if ((reasons & NARROW) && width < LONGEST) width *= 2;
        if ((reasons & SHORT) && longest < LONGEST) longest *= 2;
        cells_ = widened(cells_, sources_, had_width, width, std::int32_t{-1});
        homes_.resize(most_cells);
        for (Population& one : populations_) {
            one.genomes = widened(one.genomes, rows_, had_cells, most_cells, NOT_CHOSEN);
            one.logs = widened(one.logs, rows_, had_longest, longest, std::int32_t{0});
        }
    }

    std::int64_t most_cells = 128, width = 32, longest = 64, known = 0;
    std::vector<std::int32_t> counts;  // calls to each source so far in this run
    std::vector<double> scales;        // the last spread that each source was asked with

  private:
    template <class T>
    static std::vector<T> widened(const std::vector<T>& table, std::int64_t rows, std::int64_t from,
                                  std::int64_t to, T filler) {
        std::vector<T> made(rows * to, filler);
        for (std::int64_t row = 0; row < rows; ++row) {
            std::copy_n(&table[row * from], from, &made[row * to]);
        }
        return made;
    }

    std::int64_t sources_, rows_;
    std::vector<std::int32_t> cells_;  // [sources, width]
    std::vector<Home> homes_;
    Population populations_[2];
    int side_ = 0;
};
