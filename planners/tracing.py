"""From a way over regions to a way over cells: pins where borders are crossed, lines between them.

Where no line goes from one pin to the next, both in a region of at most 64 cells, the way is found
there by waves of a word: all cells that can be reached in one step more, eight ways at a time,
which takes some forty operations.
"""

import numpy as np

from anytime.machine_code import njit
from planners.blocks import FIRST_COLUMN, FIRST_ROW, LAST_BIT, LAST_ROW, SIDE, ZERO
from planners.frontier import ONE, detour, flood, is_clear, least_way, step_cost, wave
from planners.region_search import LAST_REGION, NEAREST
from planners.search import DIAGONAL, SPAN, STRAIGHT

CALLED = "041089935185"

TAUT = 2
"""How often pins are drawn taut."""


@njit(cache=True, nogil=True, error_model="numpy")
def pins_of(columns, goal, diagonals, regions, run):
    """The cells over which the regions found lead: the start, each region's pin, the goal.

    Returns (pins, the regions that they enter, cells touched).
    """
    count, region = 2, run.state[LAST_REGION]
    while run.parent[region] >= 0:
        count += 1
        region = run.parent[region]
    pins, way = np.empty(count, np.int32), np.empty(count - 1, np.int64)
    bends = np.empty(count, np.int32)
    pins[count - 1] = goal
    region = run.state[LAST_REGION]
    for place in range(count - 2, -1, -1):
        pins[place], bends[place] = run.pin[region], run.bend[region]
        way[place] = region
        region = run.parent[region]
    return pins, way, _draw_taut(columns, pins, bends, way, diagonals, regions)


@njit(cache=True, nogil=True, error_model="numpy")
def pins_along(columns, start, goal, diagonals, regions, way):
    """The same for a way over regions of which nothing more is known.

    Returns (pins, cells touched).
    """
    across, blocks, pins = (columns + SIDE - 1) // SIDE, regions.count.size, np.empty(0, np.int32)
    pins = np.empty(way.size + 1, np.int32)
    pins[0], pins[way.size] = start, goal
    for place in range(1, way.size):
        # Straight ahead from the pin before, or as near to it as the border is open.
        here, behind = way[place], way[place - 1]
        block, before = here % blocks, np.int64(pins[place - 1])
        top = block // across * SIDE
        left = (block - top // SIDE * across) * SIDE
        side = block - behind % blocks
        side = 0 if side == across else 1 if side == -across else 2 if side == 1 else 3
        mine, other = np.int64(regions.edge[here]), np.int64(regions.edge[behind])
        join = (mine >> (SIDE * side)) & (other >> (SIDE * (side ^ 1))) & 0xFF
        if side < 2:
            along = np.int64(NEAREST[join, min(max(before % columns - left, 0), SIDE - 1)])
            pins[place] = (top + (side & 1) * (SIDE - 1)) * columns + left + along
        else:
            along = np.int64(NEAREST[join, min(max(before // columns - top, 0), SIDE - 1)])
            pins[place] = (top + along) * columns + left + (side & 1) * (SIDE - 1)
    return pins, way.size + _draw_taut(columns, pins, pins, way, diagonals, regions)


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_taut(columns, pins, bends, way, diagonals, regions):
    """Draw each pin taut between its neighbours, `TAUT` times; return the cells touched.

    They were chosen when it was not known yet where they lead. At first the way to each is that
    from where it bends last, which may lie several regions back.
    """
    across, blocks, touched = (columns + SIDE - 1) // SIDE, regions.count.size, 0
    masks, count = regions.mask, pins.size
    drawn = np.full(count, -1, np.int32)
    coming, going = np.empty(SIDE * SIDE + 1, np.uint64), np.empty(SIDE * SIDE + 1, np.uint64)
    for turn in range(TAUT):
        for step in range(1, count - 1):
            place = step if turn % 2 == 1 else count - 1 - step
            here, behind = way[place], way[place - 1]
            block, other_block = here % blocks, behind % blocks
            side = other_block - block
            bent = turn > 0 or bends[place] == pins[place]
            before = np.int64(pins[place - 1] if bent else bends[place])
            if before == drawn[place]:  # neither neighbour has moved since
                continue
            drawn[place] = before if bent else -1
            after = np.int64(pins[place + 1])
            before_row, after_row = before // columns, after // columns
            before_column, after_column = before - before_row * columns, after - after_row * columns
            top = block // across * SIDE
            left = (block - top // SIDE * across) * SIDE
            mask, other = masks[here], masks[behind]
            beside = SIDE * (SIDE - 1)  # from a cell to the one beside it in the block before
            if side == -across:
                join, stride, first = mask & FIRST_ROW & (other >> LAST_ROW), 1, 0
            elif side == across:
                join, stride, first = (mask >> LAST_ROW) & FIRST_ROW & other, 1, beside
                beside = -beside
            elif side == -1:
                join, stride, first = mask & FIRST_COLUMN & (other >> LAST_BIT), SIDE, 0
                beside = SIDE - 1
            else:
                beside = 1 - SIDE
                join, stride, first = (mask >> LAST_BIT) & FIRST_COLUMN & other, SIDE, SIDE - 1
            # What stands within the two blocks may make one cell a longer way than another.
            other_top = top - SIDE if side == -across else top + SIDE if side == across else top
            # A map of one block across has its blocks above each other, one apart.
            other_left = left if abs(side) == across else left + side * SIDE
            from_cell = (before_row - other_top) * SIDE + before_column - other_left
            to_cell = min(max(after_row - top, 0), SIDE - 1) * SIDE
            to_cell += min(max(after_column - left, 0), SIDE - 1)
            came, went, least = np.int64(0), np.int64(0), SPAN
            straight = least_way(after_row - before_row, after_column - before_column, diagonals)
            for along in range(SIDE):
                bit = along * stride
                if (join >> np.uint64(bit)) & ONE == ZERO:
                    continue
                touched += 1
                inside = first + bit
                row, column = top + inside // SIDE, left + inside % SIDE
                there = least_way(row - before_row, column - before_column, diagonals)
                there += least_way(row - after_row, column - after_column, diagonals)
                if there >= least:
                    continue
                if went == 0 and not is_clear(mask, to_cell, inside):
                    went = flood(mask, to_cell, diagonals, going)
                    touched += went
                if went > 0:
                    there += STRAIGHT * detour(going, went, to_cell, inside, diagonals)
                if bent and came == 0 and not is_clear(other, from_cell, inside + beside):
                    came = flood(other, from_cell, diagonals, coming)
                    touched += came
                if came > 0:
                    there += STRAIGHT * detour(coming, came, from_cell, inside + beside, diagonals)
                if there < least:
                    least = there
                    pins[place] = row * columns + column
                    if least == straight:
                        break
    return touched


@njit(cache=True, nogil=True, error_model="numpy")
def _line(cost, wall, dearest, columns, start, goal, diagonals, straight_first, path, count):
    """Append a least way of two legs to a path, after its last cell, which is `start`.

    Returns (cells of the path then, or 0 if something is in the way; cells touched).
    """
    down, across = goal // columns - start // columns, goal % columns - start % columns
    high, wide = abs(down), abs(across)
    dr, dc = np.sign(down), np.sign(across)
    if diagonals:
        slant, ahead = min(high, wide), max(high, wide) - min(high, wide)
        leg_dr, leg_dc = (dr, 0) if high > wide else (0, dc)
        other_dr, other_dc, other = dr, dc, slant
    else:
        leg_dr, leg_dc, ahead = dr, 0, high
        other_dr, other_dc, other = 0, dc, wide
    node, touched = start, 0
    for leg in range(2):
        first = (leg == 0) == straight_first
        step_r, step_c, steps = (leg_dr, leg_dc, ahead) if first else (other_dr, other_dc, other)
        for _ in range(steps):
            touched += 1
            step = step_cost(cost, wall, columns, node, step_r, step_c)
            if step == 0 or step > DIAGONAL * dearest:
                return 0, touched
            node += step_r * columns + step_c
            path[count] = node
            count += 1
    return count, touched


@njit(cache=True, nogil=True, error_model="numpy")
def _within(mask, start, goal, diagonals, steps):
    """A way with the fewest steps between two cells of a region, straight ones where it can.

    Cells are bits; the way is written backwards into `steps`. Returns (its steps, words touched).
    """
    waves = np.empty(SIDE * SIDE + 1, np.uint64)
    waves[0] = ONE << np.uint64(start)
    count, target = 0, ONE << np.uint64(goal)
    while waves[count] & target == ZERO:
        waves[count + 1] = wave(waves[count], mask, diagonals)
        count += 1
    here = goal
    for step in range(count):
        steps[step] = here
        row, column = here // SIDE, here % SIDE
        before, found = waves[count - 1 - step], -1
        for side in range(8 if diagonals else 4):
            dr = (-1, 1, 0, 0, -1, -1, 1, 1)[side]
            dc = (0, 0, -1, 1, -1, 1, -1, 1)[side]
            if not (0 <= row + dr < SIDE and 0 <= column + dc < SIDE):
                continue
            there = (row + dr) * SIDE + column + dc
            if (before >> np.uint64(there)) & ONE == ZERO:
                continue
            if side >= 4:
                beside = (mask >> np.uint64(row * SIDE + column + dc)) & ONE
                below = (mask >> np.uint64((row + dr) * SIDE + column)) & ONE
                if beside == ZERO or below == ZERO:
                    continue
            found = there
            break
        here = found
    return count, 2 * count


@njit(cache=True, nogil=True, error_model="numpy")
def connect(cost, wall, dearest, columns, pins, way, regions, diagonals, path):
    """Write the way over the pins into `path`: straight over as many as nothing stands between,
    within a region where it bends.

    Returns (cells of the way, cells and words touched).
    """
    across = (columns + SIDE - 1) // SIDE
    path[0] = pins[0]
    count, here, touched = np.int64(1), 0, 0
    steps = np.empty(SIDE * SIDE, np.int64)
    while here < pins.size - 1:
        start = np.int64(pins[here])
        # Twice as far as long as it goes, then between the last that went and the first that not.
        reached, failed, ahead, straight_first = here, pins.size, 1, True
        while reached + 1 < failed:
            to = (reached + failed) // 2
            if failed == pins.size:
                to = min(here + ahead, pins.size - 1)
                ahead *= 2
            end = np.int64(0)
            for turn in range(2):
                if end == 0:
                    end, taken = _line(
                        cost, wall, dearest, columns, start, np.int64(pins[to]), diagonals,
                        turn == 0, path, count,
                    )  # fmt: skip
                    touched += taken
                    first = turn == 0
            if end == 0:
                failed = to
            else:
                reached, straight_first = to, first
                if to == pins.size - 1:
                    break
        if reached > here:  # the last try may have written over the way that went
            count, taken = _line(
                cost, wall, dearest, columns, start, np.int64(pins[reached]), diagonals,
                straight_first, path, count,
            )  # fmt: skip
            touched += taken
            here = reached
            continue
        goal = np.int64(pins[here + 1])
        block = way[here] % regions.count.size
        top, left = block // across * SIDE, block % across * SIDE
        # The cell of this region from which the next is entered; the last pin lies in this one.
        row = min(max(goal // columns, top), top + SIDE - 1)
        column = min(max(goal % columns, left), left + SIDE - 1)
        begin = (start // columns - top) * SIDE + start % columns - left
        end = (row - top) * SIDE + column - left
        taken, words = _within(regions.mask[way[here]], begin, end, diagonals, steps)
        touched += words
        for step in range(taken - 1, -1, -1):
            path[count] = (top + steps[step] // SIDE) * columns + left + steps[step] % SIDE
            count += 1
        if row * columns + column != goal:
            path[count] = goal
            count += 1
        here += 1
    return count, touched
