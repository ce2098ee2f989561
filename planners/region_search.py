"""Best-first search over a map's regions, which are parted while it goes on.

What is left to the goal is expected to be a factor more than it is as the crow flies. Where walls
bend ways, they cost about the same in all directions, though a step does not: on floors of rooms
1.14 to 1.2 times the octile distance by direction, but 1.19 to 1.23 times the straight line, and
without diagonals 1.39 to 1.46 times. A multiple of the octile distance would hold the search to
the diagonal and make it go round there in every direction else.

Its labels and buckets are kept in a workspace: labels of earlier searches count as none, so that
nothing has to be cleared.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit
from planners.arrays import zeroed
from planners.blocks import EXPANDED, MOST, SIDE, TOUCHED, UNKNOWN, part, region_of
from planners.frontier import detour, flood, is_clear, least_way, next_base
from planners.search import DIAGONAL, NO_PATH, OUT_OF_BUDGET, SPAN, STRAIGHT

CALLED = "af596e9a0ace"

FOUND = 0
BUCKETS, NOTHING, FINE = 1 << 13, -1, 9
MARKS, UNIT = 8, 8
"""Landmarks of a map; their distances are in units of 1 << 8."""
_LEAN, _SLACK = 99, 4 * STRAIGHT
"""Per cent of a difference of distances that is relied upon, beyond the size of regions."""
OPENED, LAST_REGION, SHIFT, CURRENT, LOW, HIGH, FRESH, UNUSED = range(8)
"""State of a search over regions: entries in all buckets; the goal's region; width of a bucket, as
a shift; the bucket at work, the lowest and the highest used; the first entry never used, the first
given back."""


class RegionRun(NamedTuple):
    """Arrays of a search over regions: buckets, their entries and labels as in `improving`.

    Of each region, pin: the cell where it is entered. parent: the region from which. door: the
    cells that join the two, as bits along their border, and the side of the parent in the next
    byte. bend: the cell at which the way to the pin bends last.
    """

    clock: NDArray[np.int64]
    label: NDArray[np.int64]
    bucket: NDArray[np.int32]
    entry: NDArray[np.int32]
    behind: NDArray[np.int32]
    pin: NDArray[np.int32]
    parent: NDArray[np.int32]
    door: NDArray[np.int32]
    bend: NDArray[np.int32]
    cheapest: NDArray[np.int64]
    state: NDArray[np.int64]


def new_region_run(rows: int, columns: int) -> RegionRun:
    """Arrays for a map of that size."""
    regions = -(-rows // SIDE) * -(-columns // SIDE) * MOST
    run = RegionRun(
        **zeroed(
            clock=(1, np.int64),
            label=(regions, np.int64),
            bucket=(BUCKETS, np.int32),
            # Two blocks share at most 8 cells of a border, so this many joins at most.
            entry=(regions + 1, np.int32),
            behind=(regions + 1, np.int32),
            pin=(regions, np.int32),
            parent=(regions, np.int32),
            door=(regions, np.int32),
            bend=(regions, np.int32),
            cheapest=(regions, np.int64),
            state=(8, np.int64),
        )
    )
    run.bucket[:] = NOTHING
    return run


@njit(cache=True, nogil=True, error_model="numpy")
def _expected_way(rows, columns, scale):
    """So much of the straight line, which is 1 a cell, as a cost."""
    return int(np.sqrt(float(rows * rows + columns * columns)) * scale)


@njit(cache=True, nogil=True, error_model="numpy")
def likely_way(far, region, other):
    """How long the way between two regions is at least likely to be, by landmarks."""
    most = np.int64(0)
    for mark in range(MARKS):
        one, two = np.int64(far[region, mark]), np.int64(far[other, mark])
        if one > 0 and two > 0:
            most = max(most, abs(one - two))
    return (most << UNIT) * _LEAN // 100 - _SLACK


@njit(cache=True, nogil=True, error_model="numpy")
def begin_regions(cost, wall, dearest, columns, start, goal, percent, regions, run, far):
    """Begin a search from start to goal; return the work, in 1/256 expansions.

    percent: what is left of a way is expected to be, against the straight line. far: distances from
    landmarks, [regions, `MARKS`] or [0, `MARKS`].
    """
    rows, across = cost.size // columns, (columns + SIDE - 1) // SIDE
    state, work = run.state, 0
    for node in (start, goal):
        block = node // columns // SIDE * across + node % columns // SIDE
        if regions.count[block] == UNKNOWN:
            work += part(cost, wall, dearest, columns, block, regions)
    base = next_base(run)
    for place in range(state[LOW], min(state[HIGH] + 1, state[LOW] + BUCKETS)):
        run.bucket[place & (BUCKETS - 1)] = NOTHING
    first, last = region_of(columns, start, regions), region_of(columns, goal, regions)
    state[OPENED], state[LAST_REGION], state[LOW], state[HIGH] = 0, last, 0, -1
    if first < 0 or last < 0:
        return work
    down, along = start // columns - goal // columns, start % columns - goal % columns
    h = _expected_way(down, along, STRAIGHT * percent / 100)
    # All that is open at once should fit into the ring of buckets: f falls on the way to the goal
    # by what the weight adds, rises by what landmarks leave to be desired, and with one step by at
    # most two blocks each way and back.
    spread = max(percent - 100, 0) * (rows + columns) * DIAGONAL // 100 + 16 * SIDE * DIAGONAL
    if far.shape[0] > 0:
        h = max(h, likely_way(far, first, last))
        spread += (100 - _LEAN) * h // 100
    state[SHIFT] = FINE
    while spread >> state[SHIFT] >= BUCKETS:
        state[SHIFT] += 1
    run.label[first] = base
    run.pin[first] = start
    run.parent[first] = -1
    run.door[first] = 0
    run.bend[first] = start
    state[OPENED], state[FRESH], state[UNUSED] = 1, 1, NOTHING
    state[CURRENT] = state[LOW] = state[HIGH] = h >> state[SHIFT]
    run.entry[0], run.behind[0] = first, NOTHING
    run.bucket[state[CURRENT] & (BUCKETS - 1)] = 0
    return work


def _nearest() -> NDArray[np.uint8]:
    """By cells of a border (bits) and one of its eight places: the place of the nearest cell."""
    table = np.zeros((1 << SIDE, SIDE), np.uint8)
    for cells in range(1, 1 << SIDE):
        places = [place for place in range(SIDE) if cells >> place & 1]
        for wanted in range(SIDE):
            table[cells, wanted] = min(places, key=lambda place: abs(place - wanted))
    return table


NEAREST = _nearest()


@njit(cache=True, nogil=True, error_model="numpy")
def crossing(ahead, along, goal_ahead, goal_along, line):
    """Where the straight way from a place to a goal crosses a line `ahead`; if it does not, where a
    diagonal towards the goal would."""
    to_line, to_goal, aside = line - ahead, goal_ahead - ahead, goal_along - along
    if to_line * to_goal > 0 and abs(to_line) <= abs(to_goal):
        return along + int(np.floor(aside * to_line / to_goal + 0.5))
    return along + min(max(aside, -abs(to_line)), abs(to_line))


@njit(cache=True, nogil=True, error_model="numpy")
def _in_sight(cells, first, line, ahead, along, to_ahead, to_along):
    """Whether the straight way between two places crosses a line `ahead` in one of the cells, bits
    from `first` on."""
    if (line - ahead) * (to_ahead - line) < 0 or to_ahead == ahead:
        return False
    place = crossing(ahead, along, to_ahead, to_along, line) - first
    return 0 <= place < SIDE and (cells >> place) & 1 != 0


@njit(cache=True, nogil=True, error_model="numpy")
def search_regions(
    cost, wall, dearest, columns, goal, diagonals, percent, regions, run, far, budget
):
    """Go on with the search; return (FOUND or NO_PATH or OUT_OF_BUDGET, work in 1/256 expansions).

    A region is entered by one cell, its pin: of the cells that join it to the region
    before, the one nearest to the straight way to the goal from where the way bends last. It bends
    anew where what is straight from there does not lead through the door before.
    """
    across = (columns + SIDE - 1) // SIDE
    tall, count = regions.count.size // across, regions.count.size
    label, bucket, entry, behind = run.label, run.bucket, run.entry, run.behind
    counts, masks, edge = regions.count, regions.mask, regions.edge
    pins, bends, doors, parents = run.pin, run.bend, run.door, run.parent
    cheapest = run.cheapest
    state, base, work, found = run.state, run.clock[0], 0, NO_PATH
    shift, last, current, opened = state[SHIFT], state[LAST_REGION], state[CURRENT], state[OPENED]
    low, high, fresh, unused = state[LOW], state[HIGH], state[FRESH], state[UNUSED]
    goal_row, goal_column = goal // columns, goal % columns
    per_block, per_across, per_column = 1.0 / count, 1.0 / across, 1.0 / columns
    waves = np.empty(SIDE * SIDE + 1, np.uint64)
    # The regions beside the one at work that are not closed, at most one a cell of its border.
    beside, joins = np.empty(4 * SIDE, np.int64), np.empty(4 * SIDE, np.int64)
    sides = np.empty(4 * SIDE, np.int64)
    guided, stale, scale = far.shape[0] > 0, base - SPAN, STRAIGHT * percent / 100
    while opened > 0:
        if work >= budget:
            found = OUT_OF_BUDGET
            break
        place = np.int64(bucket[current & (BUCKETS - 1)])
        if place < 0:
            current += 1
            continue
        bucket[current & (BUCKETS - 1)] = behind[place]
        behind[place], unused = unused, place
        opened -= 1
        here = np.int64(entry[place])
        if label[here] & 1:  # closed
            continue
        work += EXPANDED
        pin_g = base - label[here]
        label[here] -= 1
        if here == last:
            found = FOUND
            break
        # Divisions of integers would take most of the time.
        block = here - int((here + 0.5) * per_block) * count
        block_row = int((block + 0.5) * per_across)
        block_column = block - block_row * across
        top, left = block_row * SIDE, block_column * SIDE
        pin, bend = np.int64(pins[here]), np.int64(bends[here])
        pin_row, bend_row = int((pin + 0.5) * per_column), int((bend + 0.5) * per_column)
        pin_column, bend_column = pin - pin_row * columns, bend - bend_row * columns
        door, upright = np.int64(doors[here]) & 0xFF, doors[here] >> SIDE < 2
        door_first, door_line, door_ahead, door_along = top, pin_column, bend_column, bend_row
        if upright:
            door_first, door_line, door_ahead, door_along = left, pin_row, bend_row, bend_column
        bend_g = pin_g - least_way(pin_row - bend_row, pin_column - bend_column, diagonals)
        inside, reached, mask = (pin_row - top) * SIDE + pin_column - left, np.int64(0), masks[here]
        edges, ways = np.int64(edge[here]), 0
        on_map = (block_row > 0, block_row + 1 < tall, block_column > 0, block_column + 1 < across)
        for side in range(4):
            mine = (edges >> (SIDE * side)) & 0xFF
            if mine == 0 or not on_map[side]:
                continue
            there = block + (-across, across, -1, 1)[side]
            if counts[there] == UNKNOWN:
                work += part(cost, wall, dearest, columns, there, regions)
            for number in range(np.int64(counts[there])):
                region = number * count + there
                join = mine & (np.int64(edge[region]) >> (SIDE * (side ^ 1)))
                if join == 0 or (label[region] > stale and label[region] & 1):
                    continue  # it is not beside, or closed
                beside[ways], joins[ways], sides[ways] = region, join, side
                ways += 1
        for way in range(ways):
            region, join, side = beside[way], joins[way], sides[way]
            # Ahead is across the border, along is on it.
            ahead_is_row = side < 2
            line = (top - 1, top + SIDE, left - 1, left + SIDE)[side]
            if ahead_is_row:
                first, pin_ahead, pin_along, bend_ahead = left, pin_row, pin_column, bend_row
                bend_along, goal_ahead, goal_along = bend_column, goal_row, goal_column
            else:
                first, pin_ahead, pin_along, bend_ahead = top, pin_column, pin_row, bend_column
                bend_along, goal_ahead, goal_along = bend_row, goal_column, goal_row
            place = crossing(bend_ahead, bend_along, goal_ahead, goal_along, line) - first
            place = np.int64(NEAREST[join, min(max(place, 0), SIDE - 1)])
            from_ahead, from_along, from_g, from_cell = bend_ahead, bend_along, bend_g, bend
            if bend != pin:
                to_ahead, to_along = line, first + place
                if upright != ahead_is_row:
                    to_ahead, to_along = to_along, to_ahead
                if not _in_sight(
                    door, door_first, door_line, door_ahead, door_along, to_ahead, to_along
                ):
                    place = crossing(pin_ahead, pin_along, goal_ahead, goal_along, line) - first
                    place = np.int64(NEAREST[join, min(max(place, 0), SIDE - 1)])
                    from_ahead, from_along, from_g, from_cell = pin_ahead, pin_along, pin_g, pin
            along = first + place
            g = from_g + least_way(line - from_ahead, along - from_along, diagonals)
            start, stride = (0, 56, 0, 7)[side], 1 if ahead_is_row else SIDE
            exit = start + place * stride
            if reached == 0 and not is_clear(mask, inside, exit):
                reached = flood(mask, inside, diagonals, waves)
                work += reached * TOUCHED
            if reached > 0 and detour(waves, reached, inside, exit, diagonals) > 0:
                # The way goes round something within the block, and may bend anywhere.
                least = SPAN
                for place in range(SIDE):
                    if (join >> place) & 1 == 0:
                        continue
                    more = detour(waves, reached, inside, start + place * stride, diagonals)
                    g = pin_g + STRAIGHT * more
                    g += least_way(line - pin_ahead, first + place - pin_along, diagonals)
                    h = least_way(line - goal_ahead, first + place - goal_along, diagonals)
                    if g + h < least:
                        least, along = g + h, first + place
                g = least - least_way(line - goal_ahead, along - goal_along, diagonals)
                from_cell = np.int64(NOTHING)
            h = _expected_way(line - goal_ahead, along - goal_along, scale)
            if guided:
                h = max(h, likely_way(far, region, last))
            f = g + h
            if label[region] > stale and f >= cheapest[region]:
                continue
            label[region], cheapest[region] = base - g, f
            cell = line * columns + along if ahead_is_row else along * columns + line
            pins[region] = cell
            bends[region] = cell if from_cell < 0 else from_cell
            doors[region] = join | (side ^ 1) << SIDE
            parents[region] = here
            if unused >= 0:
                place, unused = unused, np.int64(behind[unused])
            else:
                place = fresh
                fresh += 1
            number = min(max(f >> shift, high - BUCKETS + 1), current + BUCKETS - 1)
            entry[place], behind[place] = region, bucket[number & (BUCKETS - 1)]
            bucket[number & (BUCKETS - 1)] = place
            opened += 1
            current, low, high = min(current, number), min(low, number), max(high, number)
    state[CURRENT], state[OPENED] = current, opened
    state[LOW], state[HIGH], state[FRESH], state[UNUSED] = low, high, fresh, unused
    return found, work
