"""What a benchmark hands back: named figures, how they were obtained, and with which seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scipy.stats import beta


@dataclass(frozen=True)
class Benchmark:
    """The outcome of one benchmark.

    `figures` maps dotted names (`paper.q_128_r20`) to numbers; None means "not measurable here",
    and then `settings["not_measured"][name]` gives the reason. `picture` draws the benchmark into a
    file, for those that can be drawn.
    """

    name: str
    figures: Mapping[str, float | int | None]
    settings: Mapping[str, object] = field(default_factory=dict)
    seed: int = 0
    picture: Callable[[Path], Path] | None = None


def share_interval(key: str, held: Sequence[bool]) -> dict[str, float | int | None]:
    """A share as a figure, `key`, with its bounds `key_low`, `key_high`. held: of each instance, at
    least one."""
    count, successes = len(held), sum(held)
    low, high = share_bounds(successes, count)
    return {key: successes / count, f"{key}_low": low, f"{key}_high": high}


def share_bounds(successes: int, count: int) -> tuple[float, float]:
    """A 95 % interval of a share: Clopper and Pearson's, which covers at least as often as that."""
    low = float(beta.ppf(0.025, successes, count - successes + 1)) if successes else 0.0
    high = float(beta.ppf(0.975, successes + 1, count - successes)) if successes < count else 1.0
    return low, high
