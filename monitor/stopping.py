"""When to stop a single module: rules, the runs they are learnt from, and what they are worth.

A rule sees the history of one run and says for how many seconds to go on before it looks again, or
that the run is to stop. Utility is a function of quality and seconds; a look may cost something.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from anytime.clocks import is_number
from anytime.errors import AnytimeError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Stop:
    """Stop after so many seconds more, without looking again."""

    after: float = 0.0


STOP = Stop()
TINY = 1e-9  # of a second, within which two times of a grid are one
LEAST_WORTH = 0.1  # of the mean of the best utilities, that a run counts for in shares


@dataclass(frozen=True)
class History:
    """What was seen of a run: seconds [k] and estimated quality [k], the last being now.

    Empty before the run: a rule may say then already when it stops.
    """

    seconds: Floats
    quality: Floats


StoppingRule = Callable[[History], float | Stop]
Utility = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True)
class Task:
    """What stopping is worth.

    utility: of (quality, seconds), arrays that broadcast. look: what a look costs, in its units.
    """

    utility: Utility
    look: float = 0.0

    def __post_init__(self) -> None:
        if not callable(self.utility):
            raise AnytimeError(f"utility is {self.utility!r}; give a function of quality, seconds")
        if not is_number(self.look) or not 0 <= self.look < math.inf:
            raise AnytimeError(f"look is {self.look!r}; it must be a finite number >= 0")


@dataclass(frozen=True)
class Runs:
    """Recorded runs of a module on one grid of times.

    seconds: [T], increasing. quality: [N, T], the truth, known afterwards. seen: [N, T], what may
    be known at run time.
    """

    seconds: Floats
    quality: Floats
    seen: Floats

    def __post_init__(self) -> None:
        for name in ("seconds", "quality", "seen"):
            kept = np.array(getattr(self, name), dtype=float)
            kept.flags.writeable = False  # rules get parts of them
            object.__setattr__(self, name, kept)
        if self.quality.ndim != 2 or self.quality.shape != self.seen.shape:
            raise AnytimeError("quality and seen must have the same shape, [runs, times]")
        if self.seconds.shape != self.quality.shape[1:] or self.quality.size == 0:
            raise AnytimeError(
                f"seconds has shape {self.seconds.shape}; it must be {self.quality.shape[1:]}"
            )
        if not np.isfinite(self.seconds).all() or (self.seconds < 0).any():
            raise AnytimeError("seconds must be finite numbers >= 0")
        if (np.diff(self.seconds) <= 0).any():
            raise AnytimeError("seconds must increase")
        if not (np.isfinite(self.quality).all() and np.isfinite(self.seen).all()):
            raise AnytimeError("quality and seen must be finite numbers")

    def __len__(self) -> int:
        return len(self.quality)

    def of(self, chosen: ArrayLike) -> Runs:
        """Some of them, by index or mask."""
        rows = np.asarray(chosen)
        return Runs(self.seconds, self.quality[rows], self.seen[rows])

    def utilities(self, task: Task) -> Floats:
        """What stopping at each time would be worth, [N, T].

        Raises AnytimeError for a utility that is no finite number for each quality and time.
        """
        found = np.asarray(task.utility(self.quality, self.seconds[None, :]), dtype=float)
        if found.shape != self.quality.shape or not np.isfinite(found).all():
            raise AnytimeError(
                "utility must give a finite number for each quality and time: "
                f"[runs, times] = {list(self.quality.shape)}, and it gave {list(found.shape)}"
                f"{'' if np.isfinite(found).all() else ' with some that are not finite'}"
            )
        return found


Learner = Callable[[Runs, Task], StoppingRule]


@dataclass(frozen=True)
class Stopped:
    """How a rule did on runs, each [N].

    seconds: at which it stopped. looks: how often it looked. utility: what it got, looks paid.
    loss: share of the best utility in hindsight that it missed, which counts as at least
    `LEAST_WORTH` of its mean over the runs.
    """

    seconds: Floats
    looks: NDArray[np.int64]
    utility: Floats
    loss: Floats


def stop_runs(rule: StoppingRule, runs: Runs, task: Task) -> Stopped:
    """Let a rule stop recorded runs. A time between two of the grid counts as the next of it.

    Raises AnytimeError if the rule returns what is neither a number of seconds > 0 nor a Stop.
    """
    stops = [_stop(rule, runs.seconds, seen) for seen in runs.seen]
    at = np.array([index for index, _ in stops])
    looks = np.array([count for _, count in stops])
    utilities = runs.utilities(task)
    best = utilities.max(axis=1)
    got = utilities[np.arange(len(runs)), at] - task.look * looks
    # Where next to nothing can be had, a share of it would outweigh all the other runs.
    worth = np.maximum(np.abs(best), LEAST_WORTH * np.abs(best).mean())
    loss = (best - got) / np.maximum(worth, 1e-12)
    return Stopped(runs.seconds[at], looks, got, loss)


def _stop(rule: StoppingRule, seconds: Floats, seen: Floats) -> tuple[int, int]:
    """(Index of the time at which a rule stops a run, number of its looks)."""
    now, last, looks = -1, len(seconds) - 1, 0
    while True:
        answer = rule(History(seconds[: now + 1], seen[: now + 1]))
        base = seconds[now] if now >= 0 else 0.0
        if isinstance(answer, Stop):
            if not is_number(answer.after) or not 0 <= answer.after < math.inf:
                raise AnytimeError(f"a rule stops after {answer.after!r} s; it must be >= 0")
            return _index(seconds, base + answer.after, 0), looks
        if not is_number(answer) or not answer > 0:
            raise AnytimeError(f"a rule returned {answer!r}; return seconds > 0, or STOP")
        now = _index(seconds, base + answer, now + 1)
        looks += 1
        if now >= last:
            return last, looks


def _index(seconds: Floats, at: float, least: int) -> int:
    """Index of the first time that is not before `at`, at least `least`, at most the last."""
    index = int(np.searchsorted(seconds, at * (1 - 1e-9)))  # a sum of times may be off by a bit
    return min(max(index, least), len(seconds) - 1)


def until(now: float, then: float) -> float:
    """Seconds from one time of a grid to a later one, as a rule returns them."""
    return max(then - now, TINY)


def fixed_contract(runs: Runs, task: Task) -> StoppingRule:
    """Stop at the time that is best on the average of recorded runs; never look."""
    best = float(runs.seconds[int(np.argmax(runs.utilities(task).mean(axis=0)))])

    def rule(history: History) -> Stop:
        return Stop(max(best - (history.seconds[-1] if len(history.seconds) else 0.0), 0.0))

    return rule


@dataclass(frozen=True)
class Choice:
    """The rule chosen for a module.

    name: of the rule. rule: learnt from all runs. losses: [N] of each rule by name, each run's by a
    rule that was learnt without it.
    """

    name: str
    rule: StoppingRule
    losses: Mapping[str, Floats]


def choose(
    runs: Runs,
    task: Task,
    learners: Mapping[str, Learner],
    *,
    folds: int = 10,
    rng: np.random.Generator,
) -> Choice:
    """Choose by cross-validation: the fixed contract unless a rule is better by a standard error.

    learners: by name, the preferred first. Of rules that can hardly be told apart, the first is
    taken: the first that loses at most one standard error more than the best does (Breiman's rule;
    picking the very best of several would follow the noise of a few dozen runs).
    Raises AnytimeError for less runs than folds, and for a learner that is called "fixed".
    """
    if "fixed" in learners:
        raise AnytimeError("'fixed' is the fixed contract, which is always there; rename the rule")
    divided = parts(len(runs), folds, rng.permutation(len(runs)))
    every = {**learners, "fixed": fixed_contract}
    losses = {name: held_out(runs, task, learner, divided) for name, learner in every.items()}
    best = min(losses.values(), key=lambda loss: float(loss.mean()))
    good = (name for name in learners if errors_apart(losses[name], best) <= 1.0)
    better = (name for name in good if errors_apart(losses["fixed"], losses[name]) >= 1.0)
    name = next(better, "fixed")
    return Choice(name, every[name](runs, task), losses)


def errors_apart(more: Floats, less: Floats) -> float:
    """By how many standard errors of the mean difference the first losses are the greater."""
    difference = more - less
    return float(difference.mean()) / max(standard_error(difference), 1e-12)


def held_out(
    runs: Runs, task: Task, learner: Learner, folds: Sequence[NDArray[np.int64]]
) -> Floats:
    """Loss on each run by a rule learnt from the runs of the other folds, [N]."""
    losses = np.zeros(len(runs))
    for fold in folds:
        others = np.setdiff1d(np.arange(len(runs)), fold)
        rule = learner(runs.of(others), task)
        losses[fold] = stop_runs(rule, runs.of(fold), task).loss
    return losses


def parts(count: int, folds: int, order: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Folds of as equal size as can be, from an order of the runs."""
    if not 2 <= folds <= count:
        raise AnytimeError(
            f"{count} runs in {folds} folds; give at least 2 folds and a run for each"
        )
    return [order[start::folds] for start in range(folds)]


def standard_error(values: Floats) -> float:
    """Of the mean of values, of which there are at least two."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values)))
