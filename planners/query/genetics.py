"""How a generation of the genetic algorithm is made, and the loop over generations.

[PRP16] §2 and §4, and beyond: islands, scouts, clouds. Crossover and edits prepare a child's genome
before its run (varying.py); mutation happens inside it (choosing.py).
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportPrivateImportUsage=false
# (native code mixes numpy's numbers with Python's; intrinsics are called without a context)

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, njit, types
from numba.extending import intrinsic

from planners.query.choosing import draw_below, draw_bits, draw_unit
from planners.query.header import (
    copy_reals,
    header_at,
    load_int,
    load_real,
    pointer,
    store_int,
    store_real,
)
from planners.query.varying import blend, cloud, edit_choices, is_continuous, mix, shift

CALLED = "ca6a83d29a26"

_U, _S32 = np.uint64, np.uint64(32)
_AFTER_CHANGE = 0.005  # a cloud's step at least, in spreads, when the world has changed
_CALMING = 0.1  # of the way back to the usual rate of mutation, each generation


@njit(cache=True, forceinline=True)
def _parent(h: Any, row: int) -> int:
    """The genome of a parent."""
    return h.genomes + 8 * (h.side * (h.size + 1) + row) * h.most_cells


@njit(cache=True, forceinline=False)
def _better(h: Any, first: int, size: int) -> int:
    """A parent: the better of two."""
    values = h.values + 8 * h.side * (h.size + 1)
    bits = draw_bits(h)
    one = first + np.int64(((bits >> _S32) * _U(size)) >> _S32)
    two = first + np.int64(((bits & _U(0xFFFFFFFF)) * _U(size)) >> _S32)
    return one if load_real(values, one) <= load_real(values, two) else two


@njit(cache=True)
def _island(h: Any, row: int) -> int:
    """The island of a row; the scouts are the last one."""
    return h.islands if row >= h.main else row // (h.main // h.islands)


@njit(cache=True)
def _extent(h: Any, island: int) -> tuple[int, int, int]:
    """First row, rows and elites of an island."""
    if island == h.islands:
        return h.main, h.size - h.main, h.scouts_kept
    size = h.main // h.islands
    return island * size, size, h.kept


@njit(cache=True)
def prepare(header: int, row: int) -> None:
    """Set the tables for a run on a row of the children."""
    h = header_at(header)
    at = (1 - h.side) * (h.size + 1) + row
    h.genome = h.genomes + 8 * at * h.most_cells
    h.log = h.logs + 4 * at * h.longest
    h.length = 0
    h.overflow = 0
    h.countdown = 0
    h.clouded = 0
    for stream in range(h.known_streams):
        store_int(h.counts, stream, 0)


@njit(cache=True)
def breed(header: int, row: int) -> None:
    """Prepare the genome of an individual of the next generation, and the tables for its run."""
    prepare(header, row)
    h = header_at(header)
    child, known = h.genome, h.known_cells
    island = _island(h, row)
    first, size, kept = _extent(h, island)
    begins = h.generation == 0 or load_int(h.begins, island) != 0
    if begins or (row - first >= kept and draw_unit(h) < h.immigrants):
        for cell in range(known):
            store_real(child, cell, np.nan)
    elif row - first < kept:
        copy_reals(child, _parent(h, np.int64(load_int(h.elites, row))), known)
    else:
        chosen = draw_unit(h)
        clouded = chosen < h.cloud
        a = np.int64(load_int(h.elites, first)) if clouded else _better(h, first, size)
        at = h.side * (h.size + 1) + a
        length = np.int64(load_int(h.lengths, at))
        log = h.logs + 4 * at * h.longest
        parent = _parent(h, a)
        chosen -= h.cloud
        if clouded:
            h.clouded = cloud(h, child, parent, log, length, load_real(h.steps, island))
        elif chosen < h.crossover:
            mix(h, child, parent, _parent(h, _better(h, first, size)), known)
        elif chosen < h.crossover + h.line:
            other = _parent(h, _better(h, first, size))
            blend(h, child, parent, other, parent, 1.5 * draw_unit(h) - 0.25, log, length)
        elif chosen < h.crossover + h.line + h.difference:
            b = _parent(h, first + draw_below(h, size))
            c = _parent(h, first + draw_below(h, size))
            blend(h, child, parent, b, c, draw_unit(h), log, length)
        else:
            copy_reals(child, parent, known)
        if length > 0 and not clouded:
            shifted = draw_unit(h) < h.pair and shift(h, child, log, length)
            if draw_unit(h) < h.structure:
                edit_choices(header, child, log, length, known)
            if not shifted:
                hurry = 1.0 if h.adaptive == 0 else 1.0 + 2.0 * (1.0 - h.calm)
                h.gap = max(1, np.int64(length / (h.mutations * hurry)))
                h.countdown = 1 + draw_below(h, 2 * h.gap)
    if h.constrained:
        for cell in range(known):
            fixed = load_real(h.fixed, cell)
            if fixed == fixed:
                store_real(child, cell, fixed)


@njit(cache=True)
def settle(header: int, row: int, value: float) -> None:
    """Write down what the run of an individual gave. NaN is no value: it counts as inf."""
    h = header_at(header)
    at = (1 - h.side) * (h.size + 1) + row
    if h.overflow:
        h.grow = h.grow | h.overflow
    valid = value == value and not h.overflow
    store_real(h.values, at, value if valid else np.inf)
    length = min(h.length, h.longest)
    store_int(h.lengths, at, 0 if h.overflow else length)
    h.evaluations = h.evaluations + 1
    if h.clouded > 0:
        # One success in five: Rechenberg's rule, damped as in Igel, Suttorp & Hansen 2006.
        island = _island(h, row)
        best = (1 - h.side) * (h.size + 1) + _extent(h, island)[0]
        gain = 0.82 if value < load_real(h.values, best) else -0.18
        step = load_real(h.steps, island) * math.exp(gain / (0.82 + 0.41 * h.clouded))
        store_real(h.steps, island, min(h.largest_step, max(1e-12, step)))
    if not h.dormant and not h.overflow:
        log = carray(pointer(h.log), h.longest, np.int32)
        genome = carray(pointer(h.genome), h.most_cells, np.float64)
        spare = carray(
            pointer(h.genomes + 8 * (2 * h.size + 1) * h.most_cells), h.most_cells, np.float64
        )
        for i in range(length):
            spare[log[i]] = genome[log[i]]
        genome[:] = np.nan
        for i in range(length):
            genome[log[i]] = spare[log[i]]


@njit(cache=True)
def _choose_elites(h: Any, values: np.ndarray, first: int, size: int, kept: int) -> None:
    """The rows of the best individuals of an island, best first, equal values once."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    found = 0
    for row in range(first, first + size):
        value = values[row]
        if found == kept and not value < values[elites[first + found - 1]]:
            continue
        place = found
        while place > 0 and value < values[elites[first + place - 1]]:
            place -= 1
        if place > 0 and value == values[elites[first + place - 1]]:
            continue
        found = min(kept, found + 1)
        for i in range(found - 1, place, -1):
            elites[first + i] = elites[first + i - 1]
        elites[first + place] = row
    for i in range(found, kept):  # fewer different ones than places
        elites[first + i] = elites[first]


@njit(cache=True)
def close(header: int) -> None:
    """End a generation: the children become the parents."""
    h = header_at(header)
    values = carray(pointer(h.values), (2, h.size + 1), np.float64)
    elites = carray(pointer(h.elites), h.size, np.int32)
    begins = carray(pointer(h.begins), h.islands + 1, np.int32)
    steps = carray(pointer(h.steps), h.islands + 1, np.float64)
    now = values[1 - h.side]
    if h.generation > 0:
        leading = h.best_island
        first = _extent(h, leading)[0]
        same = now[first] == values[h.side, elites[first]] or begins[leading] != 0
        h.calm = h.calm + _CALMING * (1.0 - h.calm) if same else 0.0
        if not same:
            for island in range(h.islands + 1):
                steps[island] = max(steps[island], _AFTER_CHANGE)
    h.side = 1 - h.side
    h.generation = h.generation + 1
    for island in range(h.islands + 1):
        first, size, kept = _extent(h, island)
        begins[island] = 0
        _choose_elites(h, now, first, size, kept)
    if h.size > h.main:
        _receive(h, now, begins, steps)
    if h.islands > 1 and h.exclusion > 0.0:
        _exclude(h, now, begins, steps)
    best = np.int64(0)
    for island in range(1, h.islands):
        if now[elites[_extent(h, island)[0]]] < now[elites[_extent(h, best)[0]]]:
            best = island
    h.best_island = best
    h.best = np.int64(elites[_extent(h, best)[0]])


@njit(cache=True)
def _receive(h: Any, now: np.ndarray, begins: np.ndarray, steps: np.ndarray) -> None:
    """Take the scouts' best into the population if it is the best of all, or if they begin anew."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    scout = np.int64(elites[h.main])
    worst, leader, near = np.int64(0), np.inf, np.int64(-1)
    for island in range(h.islands):
        at = np.int64(elites[_extent(h, island)[0]])
        if not now[at] < now[elites[_extent(h, worst)[0]]]:
            worst = island
        leader = min(leader, now[at])
        if h.islands > 1 and _near(h, scout, at):
            near = island
    h.scouts_age = h.scouts_age + 1
    over = h.scouts_age >= h.restart
    if over:
        h.scouts_age = 0
        begins[h.islands] = 1
    if not (over or now[scout] < leader):
        return
    target = near if near >= 0 else worst
    first, size, kept = _extent(h, target)
    if h.islands > 1 and not now[scout] < now[elites[first]]:
        return
    if h.islands > 1 and near < 0:  # the worst island settles where the scouts were
        for row in range(first, first + size):
            _copy(h, scout, row)
        steps[target] = _AFTER_CHANGE
    else:
        row = first
        for other in range(first, first + size):
            row = other if now[other] > now[row] else row
        _copy(h, scout, row)
    _choose_elites(h, now, first, size, kept)


@njit(cache=True)
def _exclude(h: Any, now: np.ndarray, begins: np.ndarray, steps: np.ndarray) -> None:
    """Of two islands whose best are near each other, the worse begins anew."""
    elites = carray(pointer(h.elites), h.size, np.int32)
    for one in range(h.islands):
        for two in range(one):
            if begins[one] or begins[two]:
                continue
            a = np.int64(elites[_extent(h, one)[0]])
            b = np.int64(elites[_extent(h, two)[0]])
            if _near(h, a, b):
                worse = one if now[b] <= now[a] else two
                begins[worse] = 1
                steps[worse] = h.largest_step


@njit(cache=True)
def _near(h: Any, one: int, two: int) -> bool:
    """Whether two parents made the same choices, up to a little in the continuous ones."""
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)[h.side]
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)[h.side]
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)[h.side]
    homes = carray(pointer(h.homes), (h.most_cells, 3), np.int32)
    if lengths[one] != lengths[two]:
        return False
    square = 0.0
    for at in range(lengths[one]):
        cell = logs[one, at]
        if logs[two, at] != cell:
            return False
        apart = genomes[one, cell] - genomes[two, cell]
        if is_continuous(homes[cell, 2]):
            apart /= load_real(h.scales, np.int64(homes[cell, 0]))
            square += apart * apart
        elif apart != 0.0:
            return False
    return square < h.exclusion * h.exclusion


@njit(cache=True)
def _copy(h: Any, source: int, target: int) -> None:
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)
    values = carray(pointer(h.values), (2, rows), np.float64)
    for at in range(h.most_cells):  # one by one, or numba compiles numpy's words for other shapes
        genomes[h.side, target, at] = genomes[h.side, source, at]
    lengths[h.side, target] = lengths[h.side, source]
    for at in range(lengths[h.side, source]):
        logs[h.side, target, at] = logs[h.side, source, at]
    values[h.side, target] = values[h.side, source]


@njit(cache=True)
def adopt(header: int, value: float) -> None:
    """Put what was run on the spare row of the children into the place of the worst parent."""
    h = header_at(header)
    rows = h.size + 1
    genomes = carray(pointer(h.genomes), (2, rows, h.most_cells), np.float64)
    logs = carray(pointer(h.logs), (2, rows, h.longest), np.int32)
    lengths = carray(pointer(h.lengths), (2, rows), np.int32)
    now = carray(pointer(h.values), (2, rows), np.float64)[h.side]
    worst = np.int64(0)
    for row in range(h.main):
        worst = row if now[row] > now[worst] else worst
    if h.overflow or not value < now[worst]:
        return
    genomes[h.side, worst] = genomes[1 - h.side, h.size]
    logs[h.side, worst] = logs[1 - h.side, h.size]
    lengths[h.side, worst] = h.length
    now[worst] = value
    first, size, kept = _extent(h, _island(h, worst))
    _choose_elites(h, now, first, size, kept)
    if value < now[h.best]:
        h.best, h.best_island = worst, _island(h, worst)


# --- The loop.


@intrinsic
def _call(typingctx: Any, model: Any, header: Any, world: Any) -> Any:
    """Call a native model, float64(rng, world), by its address; what it raises is passed on."""
    signature = types.float64(types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        convention = context.call_conv
        arguments = [types.int64, types.voidptr]
        function = convention.get_function_type(types.float64, arguments)
        target = builder.inttoptr(args[0], function.as_pointer())
        world_pointer = builder.inttoptr(args[2], ir.IntType(8).as_pointer())
        status, result = convention.call_function(
            builder, target, types.float64, arguments, [args[1], world_pointer]
        )
        with builder.if_then(status.is_error, likely=False):
            convention.return_status_propagate(builder, status)
        return result

    return signature, codegen


@njit(cache=True)
def call(header: int, model: int, world: int) -> float:
    """Run a native model once."""
    return _call(model, header, world)


@njit(cache=True, nogil=True)
def evolve(header: int, model: int, world: int, generations: int, until: float) -> int:
    """Run whole generations of a native model; how many were finished.

    Ends early when the best value is at most `until` or the tables must grow.
    """
    h = header_at(header)
    values = carray(pointer(h.values), (2, h.size + 1), np.float64)
    for done in range(generations):
        for row in range(h.size):
            breed(header, row)
            settle(header, row, _call(model, header, world))
        close(header)
        if h.grow or values[h.side, h.best] <= until:
            return done + 1
    return generations
