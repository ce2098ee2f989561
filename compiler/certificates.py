"""What rounding qualities to levels can have cost: a floor and a ceiling for every budget."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compiler.elimination import Factor, Floats, Levels
from compiler.solving import CELLS, Solution, cheapest

WALKED = 256  # ways to levels of the result that are walked back for their divisions


@dataclass(frozen=True)
class Response:
    """The quality that one call delivers, a real number, if every quality is what is expected.

    label: of the call. feeds: labels of the calls that feed it, in the order of the axes. levels:
    [L] qualities to which its result is rounded, increasing, from the least to the greatest that
    there is. times: [M] seconds, increasing from 0. quality: [L_1, …, L_k, M] for inputs at their
    levels, linear between them.
    """

    label: str
    feeds: tuple[str, ...]
    levels: Floats
    times: Floats
    quality: Floats


@dataclass(frozen=True)
class Certificate:
    """The optimum of a real-valued program lies between floor and ceiling, at every budget.

    budgets: [B] seconds at which one of them rises, increasing. floor: [B] delivered by a division
    that is known. ceiling: [B] no division delivers more. divisions: [B, n] seconds of each call.
    """

    budgets: Floats
    floor: Floats
    ceiling: Floats
    divisions: Floats

    @property
    def error(self) -> float:
        """Quality that the divisions can miss at any budget, at most."""
        return float((self.ceiling - self.floor).max(initial=0.0))


def certified(responses: Sequence[Response], cells: float = CELLS) -> Certificate:
    """Floor and ceiling of the result, which the last of the responses delivers.

    A quality rounded up needs no more time than the true one and promises no less to those it
    feeds: the least times with all qualities rounded up are necessary, and those with all rounded
    down are enough. Where a response falls with better input, the floor takes its least value on
    any better input and the ceiling its greatest on any worse, so both hold for every program.
    """
    floors = [floor_factor(response) for response in responses]
    ceilings = [ceiling_factor(response) for response in responses]
    return bracketed(responses, floors, ceilings, cells)


def bracketed(
    responses: Sequence[Response],
    floors: Sequence[Factor],
    ceilings: Sequence[Factor],
    cells: float = CELLS,
) -> Certificate:
    """`certified` with the factors already there."""
    output = responses[-1]
    upper = cheapest(ceilings, output.label, cells)
    lower = cheapest(floors, output.label, cells)
    necessary = np.minimum.accumulate(upper.bound[::-1])[::-1]  # for this level or a better one
    # Any division is one that may be made. Between those that the ceiling hopes for lie the best
    # where qualities rise gradually; those of the floor are sure to be any good where they jump.
    hoped, sure = _divisions(upper, ceilings, WALKED), _divisions(lower, floors, WALKED // 4)
    ends = [hoped.sum(axis=1), sure.sum(axis=1)]
    budgets = np.unique(np.concatenate([*ends, necessary[np.isfinite(necessary)]]))
    shares = np.concatenate([sure, _between(responses, hoped, budgets)])
    totals = np.concatenate([ends[1], budgets])
    order = np.argsort(totals, kind="stable")
    delivered = qualities(responses, shares)[order]
    best = best_so_far(delivered)[np.searchsorted(totals[order], budgets, side="right") - 1]
    ceiling = output.levels[np.searchsorted(necessary, budgets, side="right") - 1]
    return Certificate(budgets, delivered[best], ceiling, shares[order[best]])


def _between(responses: Sequence[Response], known: Floats, budgets: Floats) -> Floats:
    """Divisions of budgets between known ones, [B, n]: at times that there are, and what is left
    goes to the call that delivers the result."""
    known = known[np.argsort(known.sum(axis=1), kind="stable")]
    totals, shares = known.sum(axis=1), np.zeros((len(budgets), len(responses)))
    for call, response in enumerate(responses):
        seconds = np.interp(budgets, totals, known[:, call])
        if call == len(responses) - 1:
            seconds = budgets - shares.sum(axis=1)
        seconds = seconds + 1e-12 * budgets  # what is a time but for rounding is that time
        shares[:, call] = response.times[np.searchsorted(response.times, seconds, "right") - 1]
    return shares


def best_so_far(values: Floats) -> Levels:
    """For each place, that of the greatest value up to it."""
    return np.maximum.accumulate(
        np.where(values >= np.maximum.accumulate(values), np.arange(len(values)), 0)
    )


def _divisions(solution: Solution, factors: Sequence[Factor], most: int) -> Floats:
    """Seconds of each call on the ways to levels of the output that are reached, [K, n]: to all, or
    to `most` of them evenly where there are more."""
    reached = np.flatnonzero(np.isfinite(solution.seconds))
    count = min(most, len(reached))
    some = np.unique(np.linspace(0, len(reached) - 1, count).round().astype(int))
    levels = solution.levels(reached[some])
    return np.array([f.table[tuple([levels[name] for name in f.scope])] for f in factors]).T


def qualities(responses: Sequence[Response], shares: Floats) -> Floats:
    """Quality of the result for [K, n] seconds of each call, each at one of its times: [K]."""
    made: dict[str, tuple[Floats, Floats]] = {}
    value: Floats = np.zeros(len(shares))
    for response, seconds in zip(responses, shares.T, strict=True):
        moment: Levels = np.asarray(np.searchsorted(response.times, seconds), dtype=np.intp)
        value = np.zeros(len(shares))
        sides: list[tuple[tuple[Levels, Floats], tuple[Levels, Floats]]] = []
        for feed in response.feeds:
            levels, quality = made[feed]
            below = np.clip(np.searchsorted(levels, quality, "right") - 1, 0, len(levels) - 1)
            above = np.minimum(below + 1, len(levels) - 1)
            width = np.maximum(levels[above] - levels[below], 1e-300)
            weight = np.clip((quality - levels[below]) / width, 0.0, 1.0)
            sides.append(((below, 1 - weight), (above, weight)))
        for corner in itertools.product(*sides):
            weight = np.prod([w for _, w in corner], axis=0) if corner else 1.0
            value += weight * response.quality[(*[index for index, _ in corner], moment)]
        made[response.label] = response.levels, value
    return value


def floor_factor(response: Response) -> Factor:
    """Seconds after which at least each level is delivered, for inputs at least at theirs."""
    return _factor(response, _over_inputs(response, np.minimum, better=True), strictly=False)


def ceiling_factor(response: Response) -> Factor:
    """Seconds before which less than each level is delivered, rounded up, for inputs at most at
    theirs."""
    return _factor(response, _over_inputs(response, np.maximum, better=False), strictly=True)


def _over_inputs(response: Response, extreme: np.ufunc, better: bool) -> Floats:
    """The extreme value over all inputs that are better, or worse, and any time until then."""
    quality = response.quality
    for axis in range(len(response.feeds)):
        turned = np.flip(quality, axis) if better else quality
        turned = extreme.accumulate(turned, axis=axis)
        quality = np.flip(turned, axis) if better else turned
    return np.maximum.accumulate(quality, axis=-1)


def _factor(response: Response, quality: Floats, strictly: bool) -> Factor:
    """The first times at which the quality is at each level; strictly: above the level before."""
    levels, times = response.levels, np.append(response.times, np.inf)
    wanted = levels[:-1] if strictly else levels[1:]
    side = "right" if strictly else "left"
    rows = quality.reshape(-1, quality.shape[-1])
    first = np.array([np.searchsorted(row, wanted, side=side) for row in rows], dtype=np.intp)
    table = np.zeros((len(rows), len(levels)))  # the lowest level is there at once
    table[:, 1:] = times[first]
    return Factor(
        (*response.feeds, response.label), table.reshape(*quality.shape[:-1], len(levels))
    )
