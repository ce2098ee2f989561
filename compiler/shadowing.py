"""What a schedule would have earned in a system that was watched, and what nobody can know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anytime.pictures import clipped, duration, number
from anytime.programs import Program
from anytime.shadow import Shadow
from anytime.shadowed import shadowed
from compiler.compiled import CompiledProgram
from compiler.compiling import compile

HARDLY = 0.01  # of quality, what nobody would miss


@dataclass(frozen=True)
class ShadowAdvice:
    """What a schedule would have earned.

    quality: of a frame now, on average. seconds, p95: how long one takes now, on average and at the
    95th percentile. promised: quality of a schedule whose deadline is the p95. sooner: the least
    deadline at which it is as good as now but for `HARDLY`; inf if none is. Both (surely, at
    best): the first counts on nothing that was not seen, the second takes it that worse inputs do
    no harm; each at its end of a 95 % interval. overhead: share of the time that watching took.
    unknown: a line for each thing that cannot be known.
    """

    program: Program
    frames: int
    seconds: float
    p95: float
    quality: float
    promised: tuple[float, float]
    sooner: tuple[float, float]
    overhead: float
    unknown: tuple[str, ...]

    def __repr__(self) -> str:
        low, high = map(number, self.promised)
        mean, p95 = duration(self.seconds), duration(self.p95)
        surely, best = (
            duration(each) if np.isfinite(each) else "no deadline" for each in self.sooner
        )
        lines = [
            f"{self.program!r}, {self.frames} frames",
            f"now: {number(self.quality)} in {mean} on average, 95 % of the frames in {p95}",
            f"a schedule with a deadline of {p95}: {low} surely, {high} at best",
            f"as good as now with: {surely} surely, {best} at best",
            f"watching took {100 * self.overhead:.2g} % of the time",
            "cannot be known from this:",
            *(f"  {line}" for line in self.unknown),
        ]
        return "\n".join(clipped(line) for line in lines)


def advise(shadow: Shadow) -> ShadowAdvice:
    """Compile what a shadow has seen and compare the schedule with what the system does.

    Raises AnytimeError when fewer than 20 frames show the program.
    """
    seen = shadowed(shadow)
    surely = compile(seen.program, seen.library(cautious=True))
    perhaps = compile(seen.program, seen.library(cautious=False))
    p95, quality = float(np.quantile(seen.seconds, 0.95)), seen.quality
    return ShadowAdvice(
        program=seen.program,
        frames=shadow.count,
        seconds=float(seen.seconds.mean()),
        p95=p95,
        quality=quality,
        promised=(surely.interval(p95)[0], perhaps.interval(p95)[1]),
        sooner=(_sooner(surely, quality, 0), _sooner(perhaps, quality, 1)),
        overhead=shadow.overhead / shadow.busy if shadow.busy else 0.0,
        unknown=seen.unknown,
    )


def _sooner(compiled: CompiledProgram, quality: float, end: int) -> float:
    """The least budget that is as good, at one end of its interval."""
    budgets = compiled.frontier.budgets.tolist()
    good = (budget for budget in budgets if compiled.interval(budget)[end] >= quality - HARDLY)
    return next(good, float("inf"))
