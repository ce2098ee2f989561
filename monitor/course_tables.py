"""The table of a course: what going on is worth, by time and by what is still to be walked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor import course_kernels as kernels
from monitor.courses import Course
from monitor.missions import Mission

Floats = NDArray[np.float64]
TICKS, SPEEDS = 300, 17
COLUMNS = 160  # of what is still to be walked
REACH = 1.8  # of the foreseen length of a whole mission that the table goes to
PATIENCE = 8.0  # time scales after which a task without a deadline is taken to be over
NORMAL = np.array([-1.383, -0.674, -0.210, 0.210, 0.674, 1.383])  # equally likely deviations


@dataclass(frozen=True)
class CourseTable:
    """What it is worth to keep to a course, at the best speeds.

    speeds: [V]. power: [V] price of a second at each; idle: of one of standing. value: [T + 1] of
    completing at each tick, the job at the goal paid.
    worth: [T + 1, F] net value to expect when a frame begins, what was used before apart.
    tick: seconds. cell: length to be walked from one column to the next.
    """

    course: Course
    speeds: Floats
    power: Floats
    idle: float
    value: Floats
    worth: Floats
    tick: float
    cell: float

    def standing(self, time: float, to_walk: float) -> float:
        """The worth of a frame that begins at a time with a length still to be walked."""
        k, u = _split(time / self.tick, self.worth.shape[0] - 1)
        j, z = _split(to_walk / self.cell, self.worth.shape[1] - 1)
        rows = self.worth[k : k + 2, j : j + 2] @ (1.0 - z, z)
        return float(rows @ (1.0 - u, u))

    def walking(
        self, time: float, to_walk: float, in_hand: float, thinking: float, made_on: Course
    ) -> tuple[float, float]:
        """(worth, best speed) with a plan in hand that was made on a course's sensing.

        thinking: seconds that the frame's calls still take. in_hand: planned length left; what is
        walked beyond a plan does not depend on how much of it is left.
        """
        row = int(np.searchsorted(made_on.beyond, to_walk, side="right")) - 1
        worth, index = kernels.best_speed(
            time / self.tick,
            to_walk,
            thinking,
            self.course.contract,
            self.course.forecast.whole / made_on.forecast.whole,
            np.maximum(made_on.walked[row] + (in_hand - made_on.planned), 0.5 * in_hand),
            made_on.changes[row],
            made_on.stops[row],
            self.speeds,
            self.power,
            self.idle,
            self.value,
            self.worth,
            self.tick,
            self.cell,
        )
        return float(worth), float(self.speeds[index])


def _split(at: float, last: int) -> tuple[int, float]:
    index = min(max(int(at), 0), last - 1)
    return index, min(at - index, 1.0)


def solve(mission: Mission, course: Course, route: float) -> CourseTable:
    """The table of a course, exactly, by dynamic programming backwards in time (Bellman).

    route: length of the longest way that is presented. Nobody foresees the end of a mission to
    less than about half a frame, so completing is worth its mean over a normal spread of that much
    time: a table that is sure of itself arrives at deadlines exactly, that is, half of the
    time too late.
    """
    value = mission.value
    until = value.deadline if np.isfinite(value.deadline) else PATIENCE * value.seconds
    tick = until / TICKS
    speeds = np.geomspace(*mission.speeds, SPEEDS)
    unsure = float(course.walked.mean()) / (2.0 * float(np.sqrt(speeds[0] * speeds[-1])))
    times = np.arange(TICKS + 1)[:, None] * tick + mission.job + unsure * NORMAL
    idle = mission.energy.price * mission.energy.idle
    completing = value(np.maximum(times, 0.0)).mean(axis=1) - idle * mission.job
    power = mission.energy.price * mission.energy.power(speeds)
    worth = np.zeros((TICKS + 1, COLUMNS))
    cell = REACH * max(course.forecast.whole * route, 1.0) / (COLUMNS - 1)
    kernels.solve(
        completing,
        tick,
        cell,
        course.beyond,
        course.walked,
        course.changes,
        course.stops,
        course.contract,
        speeds,
        power,
        idle,
        worth,
    )
    return CourseTable(course, speeds, power, idle, completing, worth, tick, cell)
