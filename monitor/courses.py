"""Courses: what is left of a mission, foreseen from missions lived at a constant sensing time.

How far a robot walks depends on what it saw, hardly on how fast it walked. So a mission that was
lived once tells what it would have been like at any speeds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from monitor.reports import Report

Floats = NDArray[np.float64]
PARTS = 6  # of the way, each with its own ratio of what is walked to what the route says
BINS, OUTCOMES = 3, 16  # of what is left; equally likely frames in each
SHRINK = 0.7  # of the logarithms of a forecast's changes, which partly take each other back
FAR = 1.2  # times the contract of one course that a neighbour's may have
TINY = 1e-12
LEAST_EXCESS = 0.02  # of what is walked over the route
NEAR = 8.0  # lengths; the forecast of less does not change by ratios


@dataclass(frozen=True)
class Leg:
    """A frame as it was lived.

    left: length of the route at its start. planned, walked: in it. thinking: seconds of its calls.
    standing: there was no plan to walk.
    """

    left: float
    planned: float
    walked: float
    thinking: float
    standing: bool


Legs = Sequence[Leg]


@dataclass(frozen=True)
class Forecast:
    """Foresees the length still to be walked.

    whole: length walked in a mission over its route at the start. parts, ratios: [P] walked over
    route by what is left of the route. trust: [P] weight of that there; the rest has the whole less
    what was walked, which says little near the goal.
    """

    whole: float
    parts: Floats
    ratios: Floats
    trust: Floats

    def __call__(self, left: float, walked: float, route: float) -> float:
        """The length to be walked; never less than what is left of the route.

        left: of the route. walked: so far, on this course; who has walked on another converts that
        by their wholes. route: its length when the task was presented.
        """
        seen = left * float(np.interp(left, self.parts, self.ratios))
        reckoned = max(self.whole * route - walked, 0.0)
        trust = float(np.interp(left, self.parts, self.trust))
        return max(trust * seen + (1.0 - trust) * reckoned, left)


@dataclass(frozen=True)
class Course:
    """What to expect of the rest of a mission whose frames give this much time to each call.

    shares: seconds of each call. contract: seconds that the calls really take together.
    planned: mean planned length of a frame. error: standard error of `forecast.whole`.
    beyond: [B] lengths still to be walked from which each row of outcomes holds.
    walked, changes, stops: [B, O] of equally likely frames: the length walked, the forecast after
    it over what it was less that length, and the frames stood before the next.
    """

    shares: tuple[float, ...]
    contract: float
    planned: float
    error: float
    forecast: Forecast
    beyond: Floats
    walked: Floats
    changes: Floats
    stops: Floats


def legs_of(report: Report) -> tuple[Leg, ...]:
    """The frames of a mission that was lived."""
    return tuple(
        Leg(
            frame.situation.to_go + frame.situation.in_hand,
            frame.situation.in_hand,
            0.0 if frame.standing else frame.told("length"),
            sum(call.elapsed for call in frame.calls),
            frame.standing,
        )
        for frame in report.frames
    )


def course_of(missions: Sequence[Legs], shares: tuple[float, ...]) -> Course | None:
    """The course of missions lived with these shares; None if none of them walked."""
    missions = [legs for legs in missions if any(leg.walked for leg in legs) and legs[0].left > 0]
    if not missions:
        return None
    forecast = _forecast(missions)
    rows = np.array([row for legs in missions for row in _frames(legs, forecast)])
    thinking = [leg.thinking for legs in missions for leg in legs if leg.thinking > 0]
    contract = float(np.median(thinking)) if thinking else sum(shares)
    in_hand = [leg.planned for legs in missions for leg in legs if leg.planned > 0]
    planned = float(np.mean(in_hand)) if in_hand else 0.0
    beyond = np.quantile(rows[:, 0], np.arange(BINS) / BINS)
    beyond[0] = 0.0
    bins = np.searchsorted(beyond, rows[:, 0], side="right") - 1
    kept = [_outcomes(rows[bins == row, 1:]) for row in range(BINS) if (bins == row).any()]
    held = np.array([row for row in range(BINS) if (bins == row).any()])
    walked, changes, stops = np.array(kept).transpose(1, 0, 2)
    wholes = [float(_to_walk(legs)[0]) / legs[0].left for legs in missions]
    error = float(np.std(wholes)) / np.sqrt(max(len(wholes) - 1, 1))
    return Course(shares, contract, planned, error, forecast, beyond[held], walked, changes, stops)


def smoothed(courses: Sequence[Course]) -> tuple[Course, ...]:
    """The courses with their forecasts shrunk towards what they have in common.

    The logarithm of what is walked beyond the route falls about steadily with sensing. With few
    missions a course, one that was lucky would else be chosen; how far each is moved towards that
    line follows from how much of its distance chance alone explains (empirical Bayes). Where on
    the way the excess is walked, and how far to trust that, all tell together: it is a matter of
    the floor, and between courses that differ in it by chance a policy would go to and fro.
    """
    if len(courses) < 4:
        return tuple(courses)
    seconds = np.array([course.shares[0] for course in courses])
    excess = np.log([max(course.forecast.whole - 1.0, LEAST_EXCESS) for course in courses])
    line = np.polynomial.Polynomial.fit(seconds, excess, 1)(seconds)
    errors = np.array([course.error / max(course.forecast.whole - 1.0, 0.05) for course in courses])
    apart = float(((excess - line) ** 2).sum()) / (len(courses) - 2)
    real = max(0.0, apart - float((errors**2).mean()))
    own = real / np.maximum(real + errors**2, TINY)
    wholes = 1.0 + np.exp(own * excess + (1.0 - own) * line)
    forecasts = [course.forecast for course in courses]
    parts = np.mean([each.parts for each in forecasts], axis=0)
    trust = np.mean([each.trust for each in forecasts], axis=0)
    beyond = np.sum([each.ratios - 1.0 for each in forecasts], axis=0)
    share = beyond / max(sum(each.whole - 1.0 for each in forecasts), TINY)
    return tuple(
        replace(course, forecast=Forecast(float(whole), parts, 1.0 + (whole - 1.0) * share, trust))
        for course, whole in zip(courses, wholes, strict=True)
    )


def refined(courses: Sequence[Course]) -> tuple[Course, ...]:
    """The courses, and one half-way between each two neighbours that are far apart."""
    found = list(courses[:1])
    for one, other in pairwise(courses):
        alike = one.walked.shape == other.walked.shape
        if alike and other.contract > FAR * one.contract:
            found.append(_between(one, other))
        found.append(other)
    return tuple(found)


def _between(one: Course, other: Course) -> Course:
    """The course half-way: of its outcomes every second is of either."""
    mean = {
        name: (getattr(one, name) + getattr(other, name)) / 2.0
        for name in ("contract", "planned", "error")
    }
    excess, others = one.forecast.whole - 1.0, other.forecast.whole - 1.0
    # It falls by a factor; but who saw all may have walked no more than the route said, or less.
    falls = excess > 0 and others > 0
    forecast = Forecast(
        1.0 + (float(np.sqrt(excess * others)) if falls else (excess + others) / 2.0),
        (one.forecast.parts + other.forecast.parts) / 2.0,
        (one.forecast.ratios + other.forecast.ratios) / 2.0,
        (one.forecast.trust + other.forecast.trust) / 2.0,
    )
    outcomes = {
        name: np.where(np.arange(OUTCOMES) % 2, getattr(one, name), getattr(other, name))
        for name in ("walked", "changes", "stops")
    }
    shares = tuple((a + b) / 2.0 for a, b in zip(one.shares, other.shares, strict=True))
    beyond = (one.beyond + other.beyond) / 2.0
    return Course(shares, forecast=forecast, beyond=beyond, **mean, **outcomes)


def _to_walk(legs: Legs) -> Floats:
    """Length still walked from each frame on."""
    return np.cumsum([leg.walked for leg in reversed(legs)])[::-1]


def _forecast(missions: Sequence[Legs]) -> Forecast:
    left = np.array([leg.left for legs in missions for leg in legs])
    to_walk = np.concatenate([_to_walk(legs) for legs in missions])
    begun = np.concatenate([np.full(len(legs), _to_walk(legs)[0]) for legs in missions])
    route = np.concatenate([np.full(len(legs), legs[0].left) for legs in missions])
    whole = float(np.mean([_to_walk(legs)[0] / legs[0].left for legs in missions]))
    parts, ratios = [0.0], [1.0]
    bounds = np.quantile(left, np.linspace(0, 1, PARTS + 1))
    for low, high in pairwise(bounds):
        within = (left >= low) & (left <= high)
        some = within.any()  # not if there are hardly any frames
        parts.append(float(left[within].mean()) if some else (low + high) / 2.0)
        ratio = float(to_walk[within].sum() / left[within].sum()) if some else ratios[-1]
        ratios.append(max(1.0, ratio))
    seen = left * np.interp(left, parts, ratios)
    reckoned = np.maximum(whole * route - (begun - to_walk), 0.0)
    apart, off = seen - reckoned, to_walk - reckoned
    trust = [1.0]
    for low, high in pairwise(bounds):
        within = (left >= low) & (left <= high)
        weight = float(apart[within] @ apart[within])
        share = float(off[within] @ apart[within]) / weight if weight > 0 else 1.0
        trust.append(float(np.clip(share, 0.0, 1.0)))
    return Forecast(whole, np.array(parts), np.array(ratios), np.array(trust))


def _frames(legs: Legs, forecast: Forecast) -> list[tuple[float, float, float, float]]:
    """(to be walked, walked, logarithm of the forecast's change, frames stood after it) of each
    frame that was walked; the last has nothing after it and tells its length alone."""
    walked = np.cumsum([leg.walked for leg in legs]) - [leg.walked for leg in legs]
    moving = [index for index, leg in enumerate(legs) if not leg.standing]
    foreseen = {
        index: forecast(legs[index].left, float(walked[index]), legs[0].left) for index in moving
    }
    rows: list[tuple[float, float, float, float]] = []
    for index, after in zip(moving, [*moving[1:], None], strict=True):
        left = foreseen[index] - legs[index].walked
        if after is None:
            if len(moving) == 1:
                rows.append((foreseen[index], legs[index].walked, 0.0, 0.0))
            continue
        change = float(np.log(foreseen[after] / left)) if left > NEAR else 0.0
        rows.append((foreseen[index], legs[index].walked, change, after - index - 1.0))
    return rows


def _outcomes(rows: Floats) -> Floats:
    """Equally likely (walked, change, stops), [3, OUTCOMES], with the means of all the rows.

    Changes are shrunk and made to have the mean 1: a forecast that is right on average.
    """
    order = np.argsort(rows[:, 1] - 1e-3 * rows[:, 0])
    chosen = order[((np.arange(OUTCOMES) + 0.5) / OUTCOMES * len(order)).astype(int)]
    walked, changes, stops = rows[chosen].T
    changes = np.exp(SHRINK * changes)
    return np.array(
        [
            walked * (rows[:, 0].mean() / max(float(walked.mean()), 1e-9)),
            changes / changes.mean(),
            stops * (rows[:, 2].mean() / max(float(stops.mean()), 1e-9)),
        ]
    )
