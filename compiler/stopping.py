"""When to end a call that shows what it has: optimal stopping within its run.

The level of the result is a Markov chain over the moments of the call [Hansen & Zilberstein 2001,
non-myopic monitoring], whose transitions are counted over the recorded runs with the weights of
the table. They carry the distribution of the table from each moment to the next exactly. So whoever
ends at one moment whatever is seen gets what the table promises, and stopping by what is seen is
never worth less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compiler.tables import Table

Floats = NDArray[np.float64]
TIE = 1e-12  # by which going on must be worth more


@dataclass(frozen=True)
class Stopping:
    """The decisions within a call, for every state and for every tick left when it begins.

    value: [..., R] with the best decisions. latest: [..., R] moment by which it always ends.
    ends: [..., M, ⌈L / 8⌉, R] whether to end at a moment with a level, a bit for each level.
    """

    value: Floats
    latest: NDArray[np.int16]
    ends: NDArray[np.uint8]


def transitions(table: Table) -> Floats:
    """Of a call, the probability of each level at the next moment given that at a moment and the
    levels of its inputs, [M - 1, L_1, …, L_k, L, L].

    A run counts for the level that it has, and half for those next to it: of a few dozen runs only
    one or two may have had a level at a moment, and a policy must not take their luck for a rule.
    What that moves away from the distribution of the table is put back as evenly as can be. From a
    level at which no run was, as many levels up or down as from the nearest with a run.
    Raises ValueError for a table whose runs are not known.
    """
    if table.courses is None:
        raise ValueError(f"the runs behind the table of {table.label} are not known")
    size, cells = len(table.levels), table.courses.weights.shape[:-1]
    runs = table.courses.levels
    weights = table.courses.weights.reshape(-1, len(runs))
    cell, run = np.nonzero(weights)
    counts, shape = weights[cell, run], (len(weights), size, size)
    found = np.zeros((len(table.times) - 1, *shape))
    for moment, chances in enumerate(found):
        place = np.ravel_multi_index((cell, runs[run, moment], runs[run, moment + 1]), shape)
        chances += np.bincount(place, counts, minlength=chances.size).reshape(shape)
        now, then = chances.sum(axis=-1), chances.sum(axis=-2)
        _smooth(chances)
        _restore(chances, now, then)
        chances /= np.where(now > 0, now, 1.0)[..., None]
        _fill(chances, now)
    return found.reshape(len(found), *cells, size, size)


def _smooth(chances: Floats) -> None:
    """Let each run count half for the levels next to its own, with the same rise or fall, in place.
    What has no result is like nothing else."""
    some = chances[:, 1:, 1:]
    near = np.zeros_like(some)
    near[:, 1:, 1:] += some[:, :-1, :-1] / 2
    near[:, :-1, :-1] += some[:, 1:, 1:] / 2
    some += near


def _restore(chances: Floats, now: Floats, then: Floats) -> None:
    """Change joint chances [cells, L, L] as little as need be so that they sum to `now` over the
    next levels and to `then` over the present ones, in place: none is raised beyond its share, and
    what is missing goes from the lowest to the lowest (the monotone coupling)."""
    for axis, wanted in ((-1, now), (-2, then)):
        total = chances.sum(axis=axis)
        share = np.where(total > 0, wanted / np.where(total > 0, total, 1.0), 0.0)
        chances *= np.expand_dims(share if axis == -1 else np.minimum(share, 1.0), axis)
    left = np.maximum(now - chances.sum(axis=-1), 0.0)
    lacking = np.maximum(then - chances.sum(axis=-2), 0.0)
    leaves, comes = np.cumsum(left, axis=-1)[..., None], np.cumsum(lacking, axis=-1)[..., None, :]
    begins = np.maximum(leaves - left[..., None], comes - lacking[..., None, :])
    chances += np.maximum(np.minimum(leaves, comes) - begins, 0.0)


def _fill(chances: Floats, mass: Floats) -> None:
    """Fill the rows of levels at which no run was, [cells, L, L] in place."""
    chances[mass.sum(axis=-1) == 0] = np.eye(chances.shape[-1])  # without an input nothing changes
    cell, level = np.nonzero((mass == 0) & (mass.sum(axis=-1, keepdims=True) > 0))
    every = np.arange(chances.shape[-1])
    apart = np.where(mass[cell] > 0, np.abs(every - level[:, None]), len(every))
    near = apart.argmin(axis=-1)
    rows = chances[cell, near]
    to = every + (level - near)[:, None]
    to = np.clip(to, np.minimum(level, 1)[:, None], len(every) - 1)  # a result is never lost
    np.add.at(chances, (cell[:, None], level[:, None], to), rows)


def stop(
    begins: Floats, steps: Floats, units: NDArray[np.intp], worth: Floats, patient: bool
) -> Stopping:
    """The best decisions within a call, backwards from its last moment.

    begins: [..., M, L] the table's chances. steps: [M - 1, ..., L, L] its transitions. units: [M]
    ticks until each moment. worth: [..., L, R] of ending with a level and so many ticks left; the
    axes before may be more than those of the others, which are the last of them.
    patient: go on where that makes no difference; without a result it always does.
    """
    ticks = worth.shape[-1]
    count = max(1, int((units < ticks).sum()))
    shape, levels = worth.shape[:-2], worth.shape[-2]
    ends = np.full((*shape, count, -(-levels // 8), ticks), 255, dtype=np.uint8)
    going = np.zeros((*shape, count, ticks), dtype=bool)
    eager = np.full((levels, 1), TIE)
    eager[: levels if patient else 1] = -TIE
    value = worth[..., : ticks - units[count - 1]]
    for moment in range(count - 2, -1, -1):
        after = np.matmul(steps[moment], value)
        value = worth[..., : ticks - units[moment]].copy()
        now = value[..., units[moment + 1] - units[moment] :]
        on = after > now + eager
        at = slice(units[moment + 1], None)
        ends[..., moment, :, at] = np.packbits(~on, axis=-2)
        likely = (begins[..., moment, :] > 0)[..., None]
        going[..., moment, at] = (on & likely).any(axis=-2)
        np.copyto(now, after, where=on)
    latest = np.where(going.all(axis=-2), count - 1, (~going).argmax(axis=-2))
    first = np.einsum("...l,...lr->...r", begins[..., 0, :], value)
    return Stopping(first, latest.astype(np.int16), ends)


def endings(begins: Floats, steps: Floats, ends: NDArray[np.bool_]) -> Floats:
    """Where a call ends for one state: the chance of each moment and level, [M', L].

    begins: [L] chances at its first moment. steps: [M - 1, L, L]. ends: [M', L] of the decisions.
    """
    going, found = begins, np.zeros(ends.shape)
    for moment, over in enumerate(ends):
        found[moment] = np.where(over, going, 0.0)
        if moment < len(steps):
            going = np.where(over, 0.0, going) @ steps[moment]
    return found
