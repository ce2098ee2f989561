"""How much better than the chosen division any other can be, given how sure the profiles are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from anytime.profiles import Profile
from anytime.programs import Program, upstream
from compiler.tables import Table

Floats = NDArray[np.float64]
GIVEN = (0.1, 0.5, 0.9)  # quantiles of the input qualities at which a band is taken
MOMENTS = 48  # at which a band is taken


def regret_bound(
    program: Program, profiles: Mapping[str, Profile], tables: Sequence[Table]
) -> float:
    """A 95 % bound of what the best division may be better than the chosen one.

    If no profile is off by more than its simultaneous band, a call's expected quality is off by
    its own band and by what it makes of an input that is off. With an error e of the output for
    any division, the chosen one is worse than the best by 2 e at most: |Q^* - Q*| <= e_B + L e_A.
    In place of a Lipschitz constant, L e_A is the greatest change of a table over inputs e_A
    apart. 1 means that there are too few problems to say anything.
    """
    confidence = 1.0 - 0.05 / len(profiles)
    bands = {name: _half_width(profile, confidence) for name, profile in profiles.items()}
    errors: dict[str, float] = {}
    for call, table in zip(program.calls, tables, strict=True):
        error = bands[call.module.name]
        for axis, source in enumerate(upstream(call).values()):
            error += _change(table, axis, _levels_of(tables, source.label), errors[source.label])
        errors[call.label] = min(error, 1.0)
    return min(1.0, 2.0 * errors[program.output.label])


def _half_width(profile: Profile, confidence: float) -> float:
    """The greatest half width of a profile's band, over time and input quality."""
    times = np.linspace(0.0, float(profile.times[-1]), MOMENTS)
    conditions = [profile]
    if profile.inputs:
        fed = np.array(
            [[run.inputs[name] for name in profile.inputs] for run in profile.recordings]
        )
        quantiles = np.quantile(fed, GIVEN, axis=0).tolist()
        conditions = [
            profile.given(**dict(zip(profile.inputs, row, strict=True))) for row in quantiles
        ]
    widths: list[float] = []
    for conditioned in conditions:
        low, high = conditioned.band(times, confidence)
        mean = np.clip(conditioned.mean(times), low, high)
        widths.append(float(np.maximum(high - mean, mean - low).max()))
    return max(widths)


def _change(table: Table, axis: int, levels: Floats, error: float) -> float:
    """The greatest change of expected quality between inputs that are `error` apart."""
    inside = (slice(1, None),) * len(table.feeds)
    expected = np.moveaxis(table.expected[inside], axis, 0).reshape(len(levels) - 1, -1)
    known = levels[1:]
    if len(known) < 2:
        return 0.0
    apart = np.minimum(known + error, known[-1])
    moved = np.array([np.interp(apart, known, column) for column in expected.T]).T
    return float(np.abs(moved - expected).max())


def _levels_of(tables: Sequence[Table], label: str) -> Floats:
    return next(table.levels for table in tables if table.label == label)
