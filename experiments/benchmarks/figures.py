"""What a benchmark hands back: named figures, how they were obtained, and with which seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path


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
