"""How fast each module works on a machine: seconds per unit of work, apart from any profile."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from anytime.knobs import family_of

# Steps of a module that does not count its own work cost different times (a ladder of growing
# models, a growing tree): their seconds are kept in geometric bins of the step's index.
STEP_BINS: tuple[int, ...] = (
    *range(8),
    *(8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256, 362, 512, 724, 1024),
    *(1448, 2048, 4096, 8192, 16384, 32768, 65536, 131072, 524288),
)


def step_bin(step: int) -> int:
    """The bin of the step with this index, counted from 0."""
    return bisect_right(STEP_BINS, step) - 1


@dataclass(frozen=True)
class Rate:
    """Seconds per unit of work of one module on one machine.

    per_work: seconds a unit, for a module that charges its own work.
    per_step: mean seconds of a step by bin of its index (see `STEP_BINS`), for one that does not.
    p95_over_mean: how much longer than its mean a step takes at the 95th percentile.
    steps: how many steps were measured.
    """

    per_work: float = 0.0
    per_step: tuple[float, ...] = ()
    p95_over_mean: float = 1.0
    steps: int = 0


@dataclass(frozen=True)
class Machine:
    """The speeds of one machine, module by module."""

    name: str
    rates: Mapping[str, Rate] = field(default_factory=dict[str, Rate])

    def rate(self, module: str) -> Rate | None:
        """The rate of a module; of one with set knobs its own, or that of all its settings."""
        return self.rates.get(module, self.rates.get(family_of(module)))

    def seconds(self, module: str, work: float, step: int | None = None) -> float:
        """Expected seconds of `work` units, or of the uncharged step with index `step`.

        Raises AnytimeError when the machine has no rate for the module.
        """
        rate = self.rate(module)
        if rate is None:
            known = ", ".join(sorted(self.rates)) or "none"
            raise AnytimeError(
                f"machine {self.name!r} has no rate for module {module!r} (known: {known}); "
                f"measure it on this machine or add Machine.with_rate({module!r}, …)"
            )
        if step is None or not rate.per_step:
            return work * rate.per_work
        return work * rate.per_step[min(step_bin(step), len(rate.per_step) - 1)]

    def elapsed(self, module: str, work: NDArray[np.float64]) -> NDArray[np.float64]:
        """Seconds [n] after which amounts of work [n] of one run are done."""
        rate = self.rate(module)
        if rate is None or not rate.per_step:
            return np.array([self.seconds(module, float(w)) for w in work])
        steps = int(work.max(initial=0.0))
        ends = np.cumsum([self.seconds(module, 1.0, step) for step in range(steps)])
        return np.concatenate([[0.0], ends])[np.round(work).astype(int)]

    def with_rate(self, module: str, seconds_per_work: float) -> Machine:
        """This machine with one rate set: `seconds_per_work` for each unit of `module`."""
        if not 0 <= seconds_per_work < float("inf"):
            raise AnytimeError(
                f"rate of {module!r} is {seconds_per_work}; give finite seconds per unit of work"
            )
        return Machine(self.name, {**self.rates, module: Rate(per_work=seconds_per_work)})

    def __repr__(self) -> str:
        lines = [f"machine {self.name}"]
        for module, rate in sorted(self.rates.items()):
            if rate.per_step:
                first, last = rate.per_step[0], rate.per_step[-1]
                lines.append(
                    f"  {module:<24.24} step 1: {1e3 * first:.3g} ms, last: {1e3 * last:.3g} ms"
                    f"  ({rate.steps} steps)"
                )
            else:
                lines.append(f"  {module:<24.24} {1e3 * rate.per_work:.4g} ms a unit of work")
        return "\n".join(lines)


def charged_rate(samples: Iterable[tuple[float, float]]) -> Rate:
    """The rate of a module that counts its work, from steps of (work, seconds)."""
    pairs = [(work, seconds) for work, seconds in samples if work > 0]
    total = sum(work for work, _ in pairs)
    if not total:
        return Rate()
    mean = sum(seconds for _, seconds in pairs) / total
    return Rate(mean, (), _tail([s / (w * mean) for w, s in pairs if mean > 0]), len(pairs))


def stepped_rate(samples: Iterable[tuple[int, float]]) -> Rate:
    """The rate of a module that does not count, from steps of (index, seconds)."""
    bins: dict[int, list[float]] = {}
    for step, seconds in samples:
        bins.setdefault(step_bin(step), []).append(seconds)
    if not bins:
        return Rate()
    means: list[float] = []
    for index in range(max(bins) + 1):
        values = bins.get(index)
        means.append(sum(values) / len(values) if values else (means[-1] if means else 0.0))
    ratios = [s / means[b] for b, values in bins.items() for s in values if means[b] > 0]
    return Rate(0.0, tuple(means), _tail(ratios), sum(map(len, bins.values())))


def _tail(ratios: list[float]) -> float:
    if not ratios:
        return 1.0
    return max(1.0, sorted(ratios)[int(0.95 * (len(ratios) - 1))])
