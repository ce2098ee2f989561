"""What every search over a grid needs: labels without clearing, a heap, steps, reading a path back.

A grid is flat bytes of costs: `wall` is impassable, every other value at least 1. A step costs
10 000 straight and 14 142 diagonally, times the dearest cell that it sweeps; a diagonal sweeps both
orthogonal cells, so corners are never cut. Labels and bases are those of `planners.search`.

Kernels of other files call these, and numba's cache does not see a callee in another file change.
So a file with kernels states the digest of the files it calls as `CALLED` (a test compares): who
changes this file touches those, and all of their machine code is made anew. And who moves a tuple
of arrays to another file moves the kernels that take it by a line: their stored signatures name the
file where it was.
"""

import numpy as np

from anytime.machine_code import njit
from planners.search import CLOSED, DIAGONAL, LAST, SPAN, STRAIGHT

CALLED = "a205cc50c874"

ONE, SIDE_BITS, EVERY = np.uint64(1), np.uint64(8), ~np.uint64(0)
NOT_FIRST = ~np.uint64(0x0101010101010101)
NOT_LAST = ~np.uint64(0x8080808080808080)
"""In a word whose bit 8·row + column is a cell of a block: a step to the right and one down, all
cells but those of the first column, and but those of the last."""


@njit(cache=True, nogil=True, error_model="numpy")
def octile(rows, columns):
    """Return the length of the shortest 8-connected way over a free rectangle."""
    rows, columns = abs(rows), abs(columns)
    if rows > columns:
        return STRAIGHT * rows + (DIAGONAL - STRAIGHT) * columns
    return STRAIGHT * columns + (DIAGONAL - STRAIGHT) * rows


@njit(cache=True, nogil=True, error_model="numpy")
def least_way(rows, columns, diagonals):
    """Return the length of the shortest way over a free rectangle, with diagonals or without."""
    if diagonals:
        return octile(rows, columns)
    return STRAIGHT * (abs(rows) + abs(columns))


@njit(cache=True, nogil=True, error_model="numpy")
def next_base(work):
    """Start a generation of labels that all earlier ones lie below."""
    if work.clock[0] >= LAST:
        work.label[:] = 0
        work.clock[0] = 0
    work.clock[0] += SPAN
    return work.clock[0]


@njit(cache=True, nogil=True, error_model="numpy")
def sift_up(place, node, f, heap, slot, key, label):
    """Put `node` into the heap at `place`, or above it: lower f first, then greater g.

    `key` is the f of every place of the heap, so that comparing reads one stretch of memory; `slot`
    is each node's place.
    """
    mine = label[node]
    while place > 0:
        above = (place - 1) >> 1
        parent = np.int64(heap[above])
        if f > key[above] or (f == key[above] and mine >= label[parent]):
            break
        heap[place], key[place] = parent, key[above]
        slot[parent] = place
        place = above
    heap[place], key[place] = node, f
    slot[node] = place


@njit(cache=True, nogil=True, error_model="numpy")
def pop(size, heap, slot, key, label):
    """Take the first node from a heap of `size`; the heap then holds one less."""
    first, node, place = np.int64(heap[0]), np.int64(heap[size - 1]), 0
    f, mine = key[size - 1], label[node]
    size -= 1
    while 2 * place + 1 < size:
        child = 2 * place + 1
        if child + 1 < size and (
            key[child + 1] < key[child]
            or (key[child + 1] == key[child] and label[heap[child + 1]] < label[heap[child]])
        ):
            child += 1
        moved = np.int64(heap[child])
        if f < key[child] or (f == key[child] and mine <= label[moved]):
            break
        heap[place], key[place] = moved, key[child]
        slot[moved] = place
        place = child
    if size > 0:
        heap[place], key[place] = node, f
        slot[node] = place
    slot[first] = CLOSED
    return first


@njit(cache=True, nogil=True, error_model="numpy")
def step_cost(cost, wall, columns, node, dr, dc):
    """Return what the step (dr, dc) costs, or 0 where it is not allowed (the map's edge apart)."""
    there = node + dr * columns + dc
    dearest = int(cost[there])
    if dearest == wall:
        return 0
    if dr == 0 or dc == 0:
        return STRAIGHT * dearest
    beside, below = int(cost[node + dc]), int(cost[node + dr * columns])
    if beside == wall or below == wall:
        return 0
    return DIAGONAL * max(dearest, beside, below)


@njit(cache=True, nogil=True, error_model="numpy")
def step_between(node, there, columns):
    """Return the step (dr, dc) from a cell to one of its neighbours, by flat indices."""
    if columns < 3:  # several steps are the same difference
        return there // columns - node // columns, there % columns - node % columns
    apart = there - node
    down = (1 if apart > 1 else 0) - (1 if apart < -1 else 0)
    return down, apart - down * columns


@njit(cache=True, nogil=True, error_model="numpy")
def way_cost(cost, wall, columns, path, first, last):
    """Return the cost of the way from its cell number `first` to its cell number `last`."""
    total = np.int64(0)
    for place in range(first, last):
        node, there = np.int64(path[place]), np.int64(path[place + 1])
        down, across = step_between(node, there, columns)
        total += step_cost(cost, wall, columns, node, down, across)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def cells_of(path, columns, ahead):
    """Return a path as int32 [n, ahead + 2] cells, with so many zeros ahead of their rows and
    columns, and how many of its steps are diagonal."""
    cells, diagonal = np.zeros((path.size, ahead + 2), np.int32), 0
    if path.size == 0:
        return cells, diagonal
    node = np.int64(path[0])
    row, column = node // columns, node % columns
    for place in range(path.size):
        there = np.int64(path[place])
        down, across = step_between(node, there, columns)
        row, column, node = row + down, column + across, there
        diagonal += down != 0 and across != 0
        cells[place, ahead], cells[place, ahead + 1] = row, column
    return cells, diagonal


@njit(cache=True, nogil=True, error_model="numpy")
def with_room(row, used, room):
    """Return the `used` first numbers of a row at the beginning of one of `room` numbers.

    One by one: to assign a slice, numba compiles numpy's words for shapes that do not fit, which
    takes four seconds.
    """
    longer = np.empty(room, np.int32)
    for place in range(used):
        longer[place] = row[place]
    return longer


@njit(cache=True, nogil=True, error_model="numpy")
def path_to(cost, wall, columns, start, node, diagonals, work):
    """Read the path from `start` to `node` back from the labels of the last search."""
    rows, label = cost.size // columns, work.label
    path = np.empty(512, np.int32)
    count, row, column = 0, node // columns, node % columns
    while True:
        # A loop of its own: one in which the array is replaced counts references to it each time.
        while count < path.size:
            path[count] = node
            count += 1
            if node == start:
                return path[:count][::-1].copy()
            # Every label is the length of a real way, so the best neighbour is closer by its step,
            # but for the one by which labels of closed nodes are less.
            best, best_label, best_dr, best_dc = node, label[node] - 2, 0, 0
            for dr in range(-1, 2):
                if row + dr < 0 or row + dr >= rows:
                    continue
                for dc in range(-1, 2):
                    if column + dc < 0 or column + dc >= columns:
                        continue
                    if (dr == 0 and dc == 0) or (not diagonals and dr != 0 and dc != 0):
                        continue
                    there = node + dr * columns + dc
                    least = DIAGONAL if dr != 0 and dc != 0 else STRAIGHT
                    if label[there] - least <= best_label:
                        continue
                    step = step_cost(cost, wall, columns, there, -dr, -dc)
                    if step > 0 and label[there] - step > best_label:
                        best, best_label, best_dr, best_dc = there, label[there] - step, dr, dc
            node, row, column = best, row + best_dr, column + best_dc
        path = with_room(path, count, 2 * count)


@njit(cache=True, nogil=True, error_model="numpy")
def wave(reached, mask, diagonals):
    """The cells of a region that one more step leads to, with those already reached."""
    east, west = (mask >> ONE) & NOT_LAST, (mask << ONE) & NOT_FIRST
    south, north = mask >> SIDE_BITS, mask << SIDE_BITS
    more = ((reached << ONE) & NOT_FIRST) | ((reached >> ONE) & NOT_LAST)
    more |= (reached << SIDE_BITS) | (reached >> SIDE_BITS)
    if diagonals:  # both orthogonal cells are free, so corners are not cut
        more |= ((reached & east & south) << (SIDE_BITS + ONE)) & NOT_FIRST
        more |= ((reached & west & south) << (SIDE_BITS - ONE)) & NOT_LAST
        more |= ((reached & east & north) >> (SIDE_BITS - ONE)) & NOT_FIRST
        more |= ((reached & west & north) >> (SIDE_BITS + ONE)) & NOT_LAST
    return (more & mask) | reached


@njit(cache=True, nogil=True, error_model="numpy")
def flood(mask, start, diagonals, waves):
    """Write the waves from a cell through a region of a block; return how many steps they go."""
    waves[0], count = ONE << np.uint64(start), 0
    while waves[count] != mask:
        waves[count + 1] = wave(waves[count], mask, diagonals)
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def is_clear(mask, one, other):
    """Whether the rectangle between two cells of a block is in the region, so that there is no
    detour."""
    row, column, other_row, other_column = one >> 3, one & 7, other >> 3, other & 7
    left, right = min(column, other_column), max(column, other_column)
    between = np.uint64((0xFF << left) & (0xFF >> (7 - right))) * ~NOT_FIRST
    between &= EVERY << np.uint64(8 * min(row, other_row))
    between &= EVERY >> np.uint64(8 * (7 - max(row, other_row)))
    return mask & between == between


@njit(cache=True, nogil=True, error_model="numpy")
def detour(waves, count, start, goal, diagonals):
    """How many steps more than on a free floor a way has between two cells of a flooded region."""
    down, along = abs((start >> 3) - (goal >> 3)), abs((start & 7) - (goal & 7))
    least = max(down, along) if diagonals else down + along
    steps, bit = least, ONE << np.uint64(goal)
    while steps < count and waves[steps] & bit == np.uint64(0):
        steps += 1
    return steps - least
