"""Draws of the claims: of each seed the figures of all, in the paper's way and in ours."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from anytime.executors import processes
from experiments.reproduction.claims import Claim, Verdict, judge
from experiments.reproduction.keeping import Kept
from experiments.reproduction.ways import OURS, PAPER, Way

Draw = Mapping[str, Mapping[str, Sequence[float | None]]]
"""By claim and way, a figure for each of its values; None where the seed shows nothing."""


def drawn(
    claims: Sequence[Claim],
    seeds: Sequence[int],
    kept: Kept,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Draw]:
    """A draw for each seed; those that are not kept are made, and kept as they come.

    Made in two processes, which end with this one.
    """
    names = {claim.name for claim in claims}
    missing = [seed for seed in seeds if not names <= set(kept.get(_name(seed)) or ())]
    with processes(2) as pool:
        made = pool.map(_draw, [tuple(claims)] * len(missing), missing)
        for done, (seed, draw) in enumerate(zip(missing, made, strict=True), 1):
            before = kept.get(_name(seed)) or {}  # of other claims
            kept.keep(_name(seed), {**before, **draw})
            progress(len(seeds) - len(missing) + done, len(seeds))
    return [kept.get(_name(seed)) for seed in seeds]


def verdicts(claim: Claim, way: Way, draws: Sequence[Draw]) -> tuple[Verdict, ...]:
    """What the draws say of each value of a claim."""
    rows = (draw[claim.name][way.name] for draw in draws)
    columns = zip(*([math.nan if x is None else x for x in row] for row in rows), strict=True)
    return tuple(judge(*pair) for pair in zip(claim.values, columns, strict=True))


def known(value: float) -> float | None:
    """A figure as JSON can say it: NaN is None."""
    return None if math.isnan(value) else float(value)


def _name(seed: int) -> str:
    return f"draw {seed}"


def _draw(claims: Sequence[Claim], seed: int) -> Draw:
    """One draw of every claim in both ways; in one process, so that what they share is made once"""
    return {
        claim.name: {way.name: [*map(known, claim.draw(seed, way))] for way in (PAPER, OURS)}
        for claim in claims
    }
