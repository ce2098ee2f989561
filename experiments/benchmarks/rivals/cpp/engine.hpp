// The genetic algorithm of planners/query/genetics.py over the choices of a model, as one writes it
// in C++: sources are numbers known to the compiler, the model is inlined into the loop.
//
// Same generator, same order of the draws, same operators: for one seed the populations are equal
// bit for bit. Left out is what a benchmark does not use: paths, constraints, other distributions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "genomes.hpp"
#include "randomness.hpp"

#define INLINED [[gnu::always_inline]] inline
#define OUTLINED [[gnu::noinline]]

struct Operators {
    double crossover, line, difference, cloud, pair, structure, immigrants;
    double mutations, smallest_step, largest_step, elites, scouts, exclusion;
    std::int64_t islands, restart;
    bool adaptive, dormant;
};

constexpr double REDRAW = 0.1;           // of the mutations draw anew, where a step could be taken
constexpr double CANCEL = 0.25;          // of the pair mutations move all of one value to another
constexpr double AFTER_CHANGE = 0.005;   // a cloud's step at least when the world has changed
constexpr double CALMING = 0.1;          // of the way back to the usual rate of mutation
constexpr std::int64_t RUNAWAY = 1'000'000;

// Names: how a model names its sources, and how a name becomes a number (names.hpp).
template <class Names>
class Query {
  public:
    Query(std::int64_t population, std::uint64_t seed, const Operators& operators)
        : op_(operators),
          random_(seed),
          main_(population),
          size_(population + rounded(population * operators.scouts)),
          kept_(std::max<std::int64_t>(
              1, rounded(population / operators.islands * operators.elites))),
          scouts_kept_(std::min(size_ - main_, std::max<std::int64_t>(
                                                   1, rounded((size_ - main_) * op_.elites)))),
          log_steps_(std::log(op_.smallest_step / op_.largest_step)),
          table_(Names::COUNT, size_),
          elites_(size_),
          steps_(op_.islands + 1, 0.4),
          begins_(op_.islands + 1) {}

    // --- What a model asks for.

    template <class Source>
    INLINED bool flip(Source source, double p) {
        const std::int64_t cell = asked(names_.number(source), FLIP);
        const double value = genome_[cell];
        if (value == value && !due()) return value != 0.0;
        return flip_anew(cell, value, p);
    }

    template <class Source>
    INLINED std::int64_t randint(Source source, std::int64_t n) {
        const std::int64_t cell = asked(names_.number(source), RANDINT);
        const double value = genome_[cell];
        if (0.0 <= value && value < n && !due()) return static_cast<std::int64_t>(value);
        return randint_anew(cell, value, n);
    }

    template <class Source>
    INLINED double gaussian(Source name, double mean, double sigma) {
        const std::int64_t source = names_.number(name);
        const std::int64_t cell = asked(source, GAUSSIAN);
        const double value = genome_[cell];
        if (value == value && !due()) return value;
        return gaussian_anew(source, cell, value, mean, sigma);
    }

    // --- What its user asks for.

    template <class Model>
    void evolve(const Model& model, std::int64_t generations) {
        for (std::int64_t done = 0; done < generations; ++done) {
            for (std::int64_t row = 0; row < size_; ++row) {
                breed(row);
                settle(row, model(*this));
            }
            close();
            if (grow_) table_.grow(std::exchange(grow_, 0));
        }
    }

    std::int64_t evaluations() const { return generation_ * size_; }

    double best_value() { return table_.parents().values[best_]; }

    // FNV-1a over the best individual's choices in the order of the calls.
    std::uint64_t best_hash() {
        std::uint64_t hash = 0xCBF29CE484222325u;
        const auto add = [&hash](const auto& value) {
            const auto* bytes = reinterpret_cast<const unsigned char*>(&value);
            for (std::size_t i = 0; i < sizeof value; ++i) hash = (hash ^ bytes[i]) * 0x100000001B3u;
        };
        const std::int32_t* log = log_of(table_.parents(), best_);
        for (std::int64_t at = 0; at < table_.parents().lengths[best_]; ++at) {
            const Home& home = table_.home(log[at]);
            add(home.source);
            add(home.index);
            add(genome_of(table_.parents(), best_)[log[at]]);
        }
        return hash;
    }

  private:
    struct Extent {
        std::int64_t first, size, kept;
    };

    static std::int64_t rounded(double x) { return static_cast<std::int64_t>(std::nearbyint(x)); }

    double* genome_of(Population& population, std::int64_t row) {
        return &population.genomes[row * table_.most_cells];
    }

    std::int32_t* log_of(Population& population, std::int64_t row) {
        return &population.logs[row * table_.longest];
    }

    // --- A run.

    // The cell of the next call to a source, written down in the log.
    INLINED std::int64_t asked(std::int64_t source, Kind kind) {
        const std::int64_t at = length_++;
        const std::int64_t index = table_.counts[source]++;
        if (index < table_.width && at < table_.longest) {
            const std::int64_t cell = table_.cell(source, index);
            if (cell >= 0) return log_[at] = static_cast<std::int32_t>(cell);
        }
        return asked_anew(at, source, index, kind);
    }

    // The same for an address without a cell, and where there is no room.
    OUTLINED std::int64_t asked_anew(std::int64_t at, std::int64_t source, std::int64_t index,
                                     Kind kind) {
        const std::int32_t cell = table_.cell_of(source, index, kind);
        if (cell < 0) return overflow(index < table_.width ? FEW_CELLS : NARROW);
        if (at >= table_.longest) return overflow(SHORT);
        return log_[at] = cell;
    }

    std::int64_t overflow(Overflow reason) {
        overflow_ |= reason;
        if (length_ > RUNAWAY) throw std::runtime_error("more than 1,000,000 choices in one run");
        const std::int64_t scrap = table_.most_cells - 1;
        genome_[scrap] = NOT_CHOSEN;
        return scrap;
    }

    // Whether this inherited value is to be mutated.
    INLINED bool due() {
        if (--countdown_ != 0) return false;
        countdown_ = 1 + random_.below(2 * gap_);
        return true;
    }

    // Values that are drawn or mutated: rarely, so beside the model.
    OUTLINED bool flip_anew(std::int64_t cell, double value, double p) {
        value = value == value ? 1.0 - value : random_.unit() < p ? 1.0 : 0.0;
        genome_[cell] = value;
        return value != 0.0;
    }

    OUTLINED std::int64_t randint_anew(std::int64_t cell, double value, std::int64_t n) {
        if (0.0 <= value && value < n && !(random_.unit() < 0.5)) {
            const double near = value + std::floor(step() * n + 0.5);
            value = 0.0 <= near && near < n ? near : random_.below(n);
        } else {
            value = random_.below(n);
        }
        genome_[cell] = value;
        return static_cast<std::int64_t>(value);
    }

    OUTLINED double gaussian_anew(std::int64_t source, std::int64_t cell, double value, double mean,
                                  double sigma) {
        if (value != value || random_.unit() < REDRAW) {
            value = mean + sigma * random_.normal();
        } else {
            value += sigma * step();
        }
        table_.scales[source] = sigma;
        genome_[cell] = value;
        return value;
    }

    // A normal step whose size is log-uniform, in units of the spread of what it changes.
    double step() {
        double size = op_.largest_step;
        if (op_.smallest_step < size) size *= std::exp(random_.unit() * log_steps_);
        return size * random_.normal();
    }

    // --- Making a generation.

    // The island of a row; the scouts are the last one.
    std::int64_t island_of(std::int64_t row) const {
        return row >= main_ ? op_.islands : row / (main_ / op_.islands);
    }

    Extent extent(std::int64_t island) const {
        if (island == op_.islands) return {main_, size_ - main_, scouts_kept_};
        const std::int64_t size = main_ / op_.islands;
        return {island * size, size, kept_};
    }

    // A parent: the better of two.
    std::int64_t better(const std::vector<double>& values, const Extent& island) {
        const std::uint64_t bits = random_.bits();
        const std::int64_t one = island.first + Random::scaled(bits >> 32, island.size);
        const std::int64_t two = island.first + Random::scaled(bits & 0xFFFFFFFFu, island.size);
        return values[one] <= values[two] ? one : two;
    }

    void prepare(std::int64_t row) {
        genome_ = genome_of(table_.children(), row);
        log_ = log_of(table_.children(), row);
        length_ = countdown_ = clouded_ = 0;
        overflow_ = 0;
        std::fill(table_.counts.begin(), table_.counts.end(), 0);
    }

    // Prepare the genome of an individual of the next generation.
    void breed(std::int64_t row) {
        prepare(row);
        Population& parents = table_.parents();
        const std::int64_t known = table_.known;
        const std::int64_t island = island_of(row);
        const Extent here = extent(island);
        double* const child = genome_;
        if (generation_ == 0 || begins_[island] ||
            (row - here.first >= here.kept && random_.unit() < op_.immigrants)) {
            std::fill_n(child, known, NOT_CHOSEN);
            return;
        }
        if (row - here.first < here.kept) {
            std::copy_n(genome_of(parents, elites_[row]), known, child);
            return;
        }
        double chosen = random_.unit();
        const bool clouded = chosen < op_.cloud;
        const std::int64_t a = clouded ? elites_[here.first] : better(parents.values, here);
        const std::int64_t length = parents.lengths[a];
        const std::int32_t* const log = log_of(parents, a);
        const double* const parent = genome_of(parents, a);
        chosen -= op_.cloud;
        if (clouded) {
            clouded_ = cloud(child, parent, log, length, steps_[island]);
            return;
        }
        if (chosen < op_.crossover) {
            mix(child, parent, genome_of(parents, better(parents.values, here)), known);
        } else if (chosen < op_.crossover + op_.line) {
            const double* other = genome_of(parents, better(parents.values, here));
            blend(child, parent, other, parent, 1.5 * random_.unit() - 0.25, log, length);
        } else if (chosen < op_.crossover + op_.line + op_.difference) {
            const double* b = genome_of(parents, here.first + random_.below(here.size));
            const double* c = genome_of(parents, here.first + random_.below(here.size));
            blend(child, parent, b, c, random_.unit(), log, length);
        } else {
            std::copy_n(parent, known, child);
        }
        if (length == 0) return;
        const bool shifted = random_.unit() < op_.pair && shift(child, log, length);
        if (random_.unit() < op_.structure) edit(child, log, length, known);
        if (!shifted) {
            const double hurry = op_.adaptive ? 1.0 + 2.0 * (1.0 - calm_) : 1.0;
            gap_ = std::max<std::int64_t>(
                1, static_cast<std::int64_t>(length / (op_.mutations * hurry)));
            countdown_ = 1 + random_.below(2 * gap_);
        }
    }

    // Each value from one parent or the other; what only one of them has is inherited.
    void mix(double* __restrict child, const double* a, const double* b, std::int64_t known) {
        for (std::int64_t begin = 0; begin < known; begin += 64) {
            const std::uint64_t bits = random_.bits();
            const std::int64_t many = std::min<std::int64_t>(64, known - begin);
            for (std::int64_t i = 0; i < many; ++i) {
                const double x = a[begin + i], y = b[begin + i];
                const bool from_a = (bits >> i) & 1;
                const double one = from_a ? x : y, two = from_a ? y : x;
                child[begin + i] = one == one ? one : two;
            }
        }
    }

    // a + share (b - c), in the continuous choices that a made and all three have.
    void blend(double* __restrict child, const double* a, const double* b, const double* c,
               double share, const std::int32_t* log, std::int64_t length) {
        std::copy_n(a, table_.known, child);
        for (std::int64_t at = 0; at < length; ++at) {
            const std::int32_t cell = log[at];
            if (table_.home(cell).kind != GAUSSIAN) continue;
            const double value = a[cell] + share * (b[cell] - c[cell]);
            if (value == value) child[cell] = value;
        }
    }

    // Move all continuous choices of an individual a little; how many there are.
    std::int64_t cloud(double* child, const double* a, const std::int32_t* log, std::int64_t length,
                       double step) {
        std::copy_n(a, table_.known, child);
        std::int64_t moved = 0;
        for (std::int64_t at = 0; at < length; ++at) {
            const Home& home = table_.home(log[at]);
            if (home.kind != GAUSSIAN) continue;
            child[log[at]] += table_.scales[home.source] * step * random_.normal();
            ++moved;
        }
        return moved;
    }

    // Move a bit of one value of a source to another of its values: their sum stays.
    bool shift(double* child, const std::int32_t* log, std::int64_t length) {
        const std::int64_t at = found(random_.below(length), length, [&](std::int64_t i) {
            return table_.home(log[i]).kind == GAUSSIAN;
        });
        if (at < 0) return false;
        const std::int32_t one = log[at], source = table_.home(one).source;
        const std::int64_t other = found(random_.below(length), length, [&](std::int64_t i) {
            return table_.home(log[i]).source == source && log[i] != one;
        });
        if (other < 0) return false;
        const double moved =
            random_.unit() < CANCEL ? -child[one] : table_.scales[source] * step();
        child[one] += moved;
        child[log[other]] -= moved;
        return true;
    }

    // The first place from `begin` on, around the end, that is as wanted; or -1.
    template <class Wanted>
    static std::int64_t found(std::int64_t begin, std::int64_t length, Wanted wanted) {
        for (std::int64_t at = begin; at < length; ++at) {
            if (wanted(at)) return at;
        }
        for (std::int64_t at = 0; at < begin; ++at) {
            if (wanted(at)) return at;
        }
        return -1;
    }

    // Delete, repeat, insert, split or merge one turn of the model's loop: what was chosen between
    // two successive calls to one source.
    void edit(double* child, const std::int32_t* log, std::int64_t length, std::int64_t known) {
        const std::int64_t picked = random_.unit() < 0.5 ? 0 : random_.below(length);
        const std::int32_t source = table_.home(log[picked]).source;
        const std::int64_t begin = found(random_.below(length), length, [&](std::int64_t i) {
            return table_.home(log[i]).source == source;
        });
        const std::int64_t end = turn_end(log, length, begin);
        if (end == length) return;
        switch (const std::int64_t edit = random_.below(5); edit) {
            case 0:
                remove(child, log, length, begin, end);
                break;
            case 4:
                merge(child, log, length, begin, end);
                break;
            default:
                repeat(child, log, length, begin, end, edit, random_.unit(), known);
        }
    }

    // Where the next turn begins, or `length`.
    std::int64_t turn_end(const std::int32_t* log, std::int64_t length, std::int64_t begin) const {
        const std::int32_t source = table_.home(log[begin]).source;
        std::int64_t end = begin + 1;
        while (end < length && table_.home(log[end]).source != source) ++end;
        return end;
    }

    // Make one turn of two that ask the same sources; normal variables keep their sum.
    void merge(double* child, const std::int32_t* log, std::int64_t length, std::int64_t begin,
               std::int64_t end) {
        const std::int64_t over = turn_end(log, length, end), turn = end - begin;
        if (over == length || over - end != turn) return;
        for (std::int64_t at = begin; at < end; ++at) {
            if (table_.home(log[at]).source != table_.home(log[at + turn]).source) return;
        }
        for (std::int64_t at = begin; at < end; ++at) {
            if (table_.home(log[at]).kind == GAUSSIAN) child[log[at]] += child[log[at + turn]];
        }
        remove(child, log, length, end, over);
    }

    void count(const std::int32_t* log, std::int64_t begin, std::int64_t end) {
        for (std::int64_t at = begin; at < end; ++at) ++table_.counts[table_.home(log[at]).source];
    }

    void uncount(const std::int32_t* log, std::int64_t begin, std::int64_t end) {
        for (std::int64_t at = begin; at < end; ++at) table_.counts[table_.home(log[at]).source] = 0;
    }

    // Move what comes after a turn to where the turn was, source by source.
    void remove(double* child, const std::int32_t* log, std::int64_t length, std::int64_t begin,
                std::int64_t end) {
        count(log, begin, end);
        for (std::int64_t at = end; at < length; ++at) {
            const Home& home = table_.home(log[at]);
            const std::int32_t moved = table_.counts[home.source];
            if (moved) child[table_.cell(home.source, home.index - moved)] = child[log[at]];
        }
        uncount(log, begin, end);
    }

    // Make room after a turn: for a copy (edit 1), a new one (2) or a share of it (3).
    void repeat(double* child, const std::int32_t* log, std::int64_t length, std::int64_t begin,
                std::int64_t end, std::int64_t edit, double share, std::int64_t known) {
        count(log, begin, end);
        for (std::int64_t at = length - 1; at >= begin; --at) {
            const std::int32_t source = log[at];
            const Home home = table_.home(source);
            const std::int32_t moved = table_.counts[home.source];
            if (!moved) continue;
            const std::int32_t target = table_.cell_of(home.source, home.index + moved, home.kind);
            if (target < 0 || target >= known) continue;
            child[target] = child[source];
            if (at >= end) continue;
            if (edit == 2 && at > begin) {
                child[target] = NOT_CHOSEN;
            } else if (edit == 3 && home.kind == GAUSSIAN) {
                child[target] = (1.0 - share) * child[source];
                child[source] *= share;
            }
        }
        uncount(log, begin, end);
    }

    // Write down what the run of an individual gave.
    void settle(std::int64_t row, double value) {
        Population& children = table_.children();
        grow_ |= overflow_;
        children.values[row] = value == value && !overflow_ ? value : INVALID;
        children.lengths[row] = overflow_ ? 0 : static_cast<std::int32_t>(length_);
        if (clouded_ > 0) {
            // One success in five: Rechenberg's rule, damped as in Igel, Suttorp & Hansen 2006.
            const std::int64_t island = island_of(row);
            const double gain =
                value < children.values[extent(island).first] ? 0.82 : -0.18;
            const double step = steps_[island] * std::exp(gain / (0.82 + 0.41 * clouded_));
            steps_[island] = std::min(op_.largest_step, std::max(1e-12, step));
        }
        if (!op_.dormant && !overflow_) forget();
    }

    // Keep in the genome what the run asked for, and nothing else.
    void forget() {
        spare_.assign(table_.most_cells, NOT_CHOSEN);
        for (std::int64_t at = 0; at < length_; ++at) spare_[log_[at]] = genome_[log_[at]];
        std::copy(spare_.begin(), spare_.end(), genome_);
    }

    // --- Ending a generation.

    void close() {
        const std::vector<double>& now = table_.children().values;
        if (generation_ > 0) {
            const std::int64_t first = extent(best_island_).first;
            const bool same = now[first] == table_.parents().values[elites_[first]] ||
                              begins_[best_island_];
            calm_ = same ? calm_ + CALMING * (1.0 - calm_) : 0.0;
            if (!same) {
                for (double& step : steps_) step = std::max(step, AFTER_CHANGE);
            }
        }
        table_.swap();
        ++generation_;
        for (std::int64_t island = 0; island <= op_.islands; ++island) {
            begins_[island] = false;
            choose_elites(now, extent(island));
        }
        if (size_ > main_) receive();
        if (op_.islands > 1 && op_.exclusion > 0.0) exclude();
        best_island_ = 0;
        for (std::int64_t island = 1; island < op_.islands; ++island) {
            if (now[best_of(island)] < now[best_of(best_island_)]) best_island_ = island;
        }
        best_ = best_of(best_island_);
    }

    std::int64_t best_of(std::int64_t island) const { return elites_[extent(island).first]; }

    // The rows of the best individuals of an island, best first, equal values once.
    void choose_elites(const std::vector<double>& values, const Extent& island) {
        std::int32_t* const elites = elites_.data() + island.first;
        std::int64_t found = 0;
        for (std::int64_t row = island.first; row < island.first + island.size; ++row) {
            const double value = values[row];
            if (found == island.kept && !(value < values[elites[found - 1]])) continue;
            std::int64_t place = found;
            while (place > 0 && value < values[elites[place - 1]]) --place;
            if (place > 0 && value == values[elites[place - 1]]) continue;
            found = std::min(island.kept, found + 1);
            for (std::int64_t i = found - 1; i > place; --i) elites[i] = elites[i - 1];
            elites[place] = static_cast<std::int32_t>(row);
        }
        for (std::int64_t i = found; i < island.kept; ++i) elites[i] = elites[0];
    }

    // Take the scouts' best into the population if it is the best of all, or if they begin anew.
    void receive() {
        const std::vector<double>& now = table_.parents().values;
        const std::int64_t scout = elites_[main_];
        std::int64_t worst = 0, near = -1;
        double leader = INVALID;
        for (std::int64_t island = 0; island < op_.islands; ++island) {
            const std::int64_t at = best_of(island);
            if (!(now[at] < now[best_of(worst)])) worst = island;
            leader = std::min(leader, now[at]);
            if (op_.islands > 1 && are_near(scout, at)) near = island;
        }
        const bool over = ++scouts_age_ >= op_.restart;
        if (over) {
            scouts_age_ = 0;
            begins_[op_.islands] = true;
        }
        if (!over && !(now[scout] < leader)) return;
        const std::int64_t target = near >= 0 ? near : worst;
        const Extent there = extent(target);
        if (op_.islands > 1 && !(now[scout] < now[elites_[there.first]])) return;
        if (op_.islands > 1 && near < 0) {  // the worst island settles where the scouts were
            for (std::int64_t row = 0; row < there.size; ++row) copy(scout, there.first + row);
            steps_[target] = AFTER_CHANGE;
        } else {
            const auto begin = now.begin() + there.first;
            copy(scout, std::max_element(begin, begin + there.size) - now.begin());
        }
        choose_elites(now, there);
    }

    // Of two islands whose best are near each other, the worse begins anew.
    void exclude() {
        const std::vector<double>& now = table_.parents().values;
        for (std::int64_t one = 0; one < op_.islands; ++one) {
            for (std::int64_t two = 0; two < one; ++two) {
                if (begins_[one] || begins_[two]) continue;
                const std::int64_t a = best_of(one), b = best_of(two);
                if (!are_near(a, b)) continue;
                const std::int64_t worse = now[b] <= now[a] ? one : two;
                begins_[worse] = true;
                steps_[worse] = op_.largest_step;
            }
        }
    }

    // Whether two parents made the same choices, up to a little in the continuous ones.
    bool are_near(std::int64_t one, std::int64_t two) {
        Population& parents = table_.parents();
        if (parents.lengths[one] != parents.lengths[two]) return false;
        const std::int32_t *log = log_of(parents, one), *other = log_of(parents, two);
        const double *x = genome_of(parents, one), *y = genome_of(parents, two);
        double square = 0.0;
        for (std::int64_t at = 0; at < parents.lengths[one]; ++at) {
            const std::int32_t cell = log[at];
            if (other[at] != cell) return false;
            double apart = x[cell] - y[cell];
            const Home& home = table_.home(cell);
            if (home.kind == GAUSSIAN) {
                apart /= table_.scales[home.source];
                square += apart * apart;
            } else if (apart != 0.0) {
                return false;
            }
        }
        return square < op_.exclusion * op_.exclusion;
    }

    void copy(std::int64_t source, std::int64_t target) {
        Population& parents = table_.parents();
        if (source == target) return;
        std::copy_n(genome_of(parents, source), table_.known, genome_of(parents, target));
        std::copy_n(log_of(parents, source), parents.lengths[source], log_of(parents, target));
        parents.lengths[target] = parents.lengths[source];
        parents.values[target] = parents.values[source];
    }

    const Operators op_;
    Random random_;
    Names names_;

    // The run in progress.
    double* genome_ = nullptr;
    std::int32_t* log_ = nullptr;
    std::int64_t length_ = 0;
    std::int64_t countdown_ = 0;  // choices until the next one is mutated; 0 and less: never
    std::int64_t gap_ = 1;        // mutations are gap choices apart on average
    std::int64_t clouded_ = 0;    // continuous choices of the best that it was moved from
    int overflow_ = 0;

    const std::int64_t main_, size_, kept_, scouts_kept_;
    const double log_steps_;
    Genomes table_;
    std::vector<std::int32_t> elites_;  // rows of the parents that are kept, best first, by island
    std::vector<double> steps_;         // step of each island's cloud; the last one: the scouts
    std::vector<char> begins_;          // whether the island begins anew
    std::vector<double> spare_;
    std::int64_t generation_ = 0, scouts_age_ = 0, best_ = 0, best_island_ = 0;
    double calm_ = 1.0;
    int grow_ = 0;
};
