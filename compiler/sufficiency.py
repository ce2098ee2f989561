"""Is quality enough to describe an input? A test over problems, and the feature that would help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.pictures import number
from anytime.programs import Call, Program, upstream

Floats = NDArray[np.float64]
PERMUTATIONS = 2000
LEVEL = 0.05  # of error, over all candidates of a call together


@dataclass(frozen=True)
class Lives:
    """What happened to each call at each budget on each problem.

    qualities, seconds: [budgets, problems] by call, NaN for no result. features: of the call's
    inputs, one mapping for each problem. attributes: numbers of the problems, [problems], by name.
    """

    qualities: Mapping[str, Floats]
    seconds: Mapping[str, Floats]
    features: Mapping[str, Sequence[Mapping[str, float]]]
    attributes: Mapping[str, Floats]


@dataclass(frozen=True)
class Finding:
    """Whether a call's outcome depends on something beyond the quality of its inputs.

    candidate: what it depends on most; correlation: partial, given the input qualities; chance:
    how often as much is found where nothing is (permutations of the problems, times the number of
    candidates).
    """

    label: str
    inputs: tuple[str, ...]
    candidate: str
    correlation: float
    chance: float

    @property
    def enough(self) -> bool:
        """Whether nothing was found beyond quality."""
        return not self.chance < LEVEL

    def __str__(self) -> str:
        inputs = " and ".join(self.inputs)
        if not self.candidate:
            return f"{self.label}: nothing beside the quality of {inputs} could be tested"
        shown = f"r {self.correlation:+.2f}, p {number(self.chance)}"
        if self.enough:
            return f"{self.label}: the quality of {inputs} is enough ({self.candidate} {shown})"
        return (
            f"{self.label}: beside the quality of {inputs} it depends on {self.candidate} ({shown})"
        )


def findings(program: Program, lives: Lives, seed: int = 0) -> tuple[Finding, ...]:
    """Test every call that others feed.

    At each budget all problems have the same shares of time, so the outcome is a function of the
    inputs alone. What is left of it after a quadratic in the input qualities, averaged over
    budgets, is correlated over problems with what is left of each candidate: the seconds that
    its inputs took, features of its inputs, numbers that the problems carry.
    """
    rng = np.random.default_rng(seed)
    fed = [call for call in program.calls if upstream(call)]
    return tuple(
        _finding(call, lives, rng)
        for call in fed
        if all(isinstance(source, Call) for source in upstream(call).values())
    )


def _finding(call: Call, lives: Lives, rng: np.random.Generator) -> Finding:
    feeding = upstream(call)
    given = np.array([lives.qualities[source.label] for source in feeding.values()])
    outcome = lives.qualities[call.label]
    candidates: dict[str, Floats] = {
        f"the seconds that {name} took": lives.seconds[source.label]
        for name, source in feeding.items()
    }
    rows = len(outcome)
    for name in {name for known in lives.features[call.label] for name in known}:
        column = [known.get(name, np.nan) for known in lives.features[call.label]]
        candidates[f"its feature {name}"] = np.tile(column, (rows, 1))
    for name, column in lives.attributes.items():
        candidates[f"the problem's {name}"] = np.tile(column, (rows, 1))
    best, tested = (0.0, 1.0, ""), 0
    for name in sorted(candidates):
        pair = _left(outcome, candidates[name], given)
        if pair is None:
            continue
        tested += 1
        correlation, chance = _correlated(*pair, rng)
        if (chance, -abs(correlation)) < (best[1], -abs(best[0])):
            best = (correlation, chance, name)
    correlation, chance, name = best
    return Finding(call.label, tuple(feeding), name, correlation, min(1.0, chance * max(tested, 1)))


def _left(outcome: Floats, candidate: Floats, given: Floats) -> tuple[Floats, Floats] | None:
    """Mean residuals of outcome and candidate on each problem, [n] and [n]; None if there is no
    spread to speak of."""
    sums = np.zeros((3, outcome.shape[1]))
    for row in range(len(outcome)):
        there = np.isfinite(outcome[row]) & np.isfinite(candidate[row])
        there &= np.isfinite(given[:, row]).all(axis=0)
        quality = given[:, row, there]
        design = np.vstack([np.ones(there.sum()), quality, quality**2]).T
        if there.sum() <= design.shape[1] + 2:
            continue
        for place, values in enumerate((outcome[row, there], candidate[row, there])):
            fitted = np.linalg.pinv(design) @ values
            sums[place, there] += values - design @ fitted
        sums[2, there] += 1
    known = sums[2] > 0
    if known.sum() < 8:
        return None
    one, other = sums[0, known] / sums[2, known], sums[1, known] / sums[2, known]
    if one.std() < 1e-6 or other.std() < 1e-9 * (
        1 + np.abs(candidate[np.isfinite(candidate)]).max()
    ):
        return None
    return one, other


def _correlated(one: Floats, other: Floats, rng: np.random.Generator) -> tuple[float, float]:
    """Correlation over problems, and how often a permutation of them gives as much."""
    a, b = (one - one.mean()) / one.std(), (other - other.mean()) / other.std()
    found = float(a @ b) / len(a)
    shuffled = rng.permuted(np.tile(b, (PERMUTATIONS, 1)), axis=1) @ a / len(a)
    as_much = int((np.abs(shuffled) >= abs(found) - 1e-12).sum())
    return found, (1 + as_much) / (1 + PERMUTATIONS)
