"""The grid robot: a simulated body on a floor of cells, with variable speed. [ZR93] §3, §5."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from monitor.endings import Ending
from monitor.missions import Energy
from monitor.states import Situation
from planners.avoidance import Walk, walk
from planners.multipath import MultiPath
from planners.navigation import (
    IMPASSABLE,
    NO_PLAN,
    ROUTE_WEIGHT,
    FramePlan,
    NoWay,
    Place,
    follow,
    travel_cost,
)
from planners.path_finding import Cell, route
from planners.touring import MOST_GOALS, shortest_tour
from sensing import Belief
from sensing.vision import Device, Sensor, Vision


@dataclass(frozen=True, eq=False)
class Scene:
    """A floor and what is to be reached on it.

    free: bool [rows, columns], the truth. start, goal: (row, column). also: further goals; all are
    to be visited, in whatever order is best. radius: of sensing, in cells.
    frame: length of a frame in cells, at most half the radius. device: what the robot looks with.
    density: prior probability that a cell is blocked.
    """

    free: NDArray[np.bool_]
    start: Cell
    goal: Cell
    radius: int = 32
    frame: float = 16.0
    device: Device = field(default_factory=Vision)
    density: float = 0.2
    name: str = "floor"
    also: tuple[Cell, ...] = ()

    def __post_init__(self) -> None:
        rows, columns = self.free.shape
        goals = self.goals
        if len(set(goals)) < len(goals) or len(goals) > MOST_GOALS:
            raise AnytimeError(
                f"{len(goals)} goals, {len(set(goals))} of them different; a mission has 1 to "
                f"{MOST_GOALS} different goals"
            )
        for name, (row, column) in (("start", self.start), *(("goal", goal) for goal in goals)):
            if not (0 <= row < rows and 0 <= column < columns):
                raise AnytimeError(
                    f"{name} ({row}, {column}) is off the map {self.name!r} of {rows} rows and "
                    f"{columns} columns"
                )
            if not self.free[row, column]:
                raise AnytimeError(
                    f"{name} ({row}, {column}) is inside an obstacle of the map {self.name!r}; "
                    "choose a free cell"
                )
        if not 0 < self.density < 1:
            raise AnytimeError(f"density is {self.density}; it must be more than 0, less than 1")
        if self.radius < 2 or not 1 <= self.frame <= self.radius / 2:
            raise AnytimeError(
                f"frame {self.frame} and radius {self.radius}: a frame is 1 cell to half the radius"
            )

    @property
    def goals(self) -> tuple[Cell, ...]:
        """All that is to be visited."""
        return (self.goal, *self.also)

    @property
    def optimal(self) -> float:
        """Length of the shortest way through all goals in cells; inf if there is none."""
        cost = np.where(self.free, 1, IMPASSABLE).astype(np.uint8)
        tour = shortest_tour(cost, self.start, self.goals)
        return float("inf") if tour is None else tour.length


class GridRobot:
    """Walks plans by bumping its way along them, and believes what it sensed and touched.

    A goal is visited when a walk ends there. In which order several are visited is chosen when
    the task is presented and again at each of them, on what is then believed; who plans the frame
    chooses, and is charged.

    It is where the clock says: its place is computed when it is asked for.
    """

    def __init__(self, scene: Scene, energy: Energy, clock: Clock) -> None:
        self.scene = scene
        self.clock = clock
        self.belief = Belief((scene.free.shape[0], scene.free.shape[1]), scene.density)
        self.belief.touch_around(scene.start, scene.free)
        self.cell = scene.start
        self.walked = 0.0
        self._energy_model = energy
        self._energy = 0.0
        self._driven = 0.0
        self._plan: FramePlan | None = None
        self._executed: FramePlan | None = None  # since the last story
        self._path = np.array([scene.start], np.int32)  # of the walk in progress, or the last one
        self._along = np.zeros(1)
        self._done = 0.0  # length of it that is walked
        self._speed = 1.0
        self._since = clock.now()
        self._interrupted = False
        self._avoided = 0  # times in a row that it went without a plan
        self._fruitless = 0  # frames in a row that touched no new cell
        self._goals = tuple(goal for goal in scene.goals if goal != scene.start)  # not yet visited
        self._beyond = _unchosen(self._goals)  # length from the first through the rest of them
        self._ending: Ending | None = None if self._goals else Ending.REACHED
        self._to_go = self._route_from(scene.start)

    def inputs(self) -> Mapping[str, Any]:
        self._settle()
        here = self.at()
        start = self._plan.sub_goal if self._plan is not None else here
        scene, goals, beyond = self.scene, self._goals, self._beyond
        if goals and goals[0] == start:  # the plan in hand ends there
            goals, beyond = goals[1:], _unchosen(goals[1:])
        goal, *later = goals or (start,)
        place = Place(
            self.belief, start, goal, here, scene.radius, scene.frame, tuple(later), beyond
        )
        return {"sensor": Sensor(scene.free, here, scene.radius, scene.device), "place": place}

    def situation(self) -> Situation:
        self._settle()
        in_hand = 0.0
        if self._plan is not None and self._along[-1] > 0:
            in_hand = self._plan.length * (1.0 - min(1.0, self._done / self._plan.length))
        return Situation(self._energy, self._to_go, in_hand, self._interrupted, self._ending)

    def at(self) -> Cell:
        """The cell where the robot is now."""
        self._settle()
        row, column = self._path[self._reached()]
        return int(row), int(column)

    def _reached(self) -> int:
        """The place on its path of the last cell that it came to."""
        return int(np.searchsorted(self._along, self._done + 1e-9, side="right")) - 1

    def learn(self, plan: FramePlan | NoWay) -> None:
        """Take over the belief that the plan was made with; what was touched since stays known."""
        if isinstance(plan, NoWay):
            return
        touched, odds = self.belief.touched, self.belief.log_odds
        self.belief = plan.belief.copy()
        np.copyto(self.belief.log_odds, odds, where=touched)
        np.copyto(self.belief.touched, True, where=touched)
        if self._plan is None and not self._interrupted:
            self._to_go = plan.route_left
        if self._interrupted:
            self._to_go = self._route_from(self.cell)

    def begin(self, plan: FramePlan | NoWay, speed: float) -> None:
        self._settle()
        if isinstance(plan, NoWay):
            self._ending = Ending.UNREACHABLE
            return
        goals = (plan.goal, *plan.later)
        if plan.start != self.at() or set(goals) != set(self._goals):
            raise AnytimeError(f"a plan from {plan.start} to {plan.goal} is for another walk")
        self._goals, self._beyond = goals, plan.beyond
        walk = follow(self.scene.free, plan, self.cell, insist=self._fruitless)
        self._avoided = 0
        self._set_out(plan, walk, speed)

    def avoid(self, speed: float) -> None:
        """Walk towards the goal by obstacle avoidance alone, twice as far each time in a row."""
        self._settle()
        if not self._goals:
            return  # it has arrived, and who asks does not know yet
        self._avoided += 1
        leash = self.scene.frame * 2.0 ** min(self._avoided, 40)
        goal, touched = self._goals[0], self.belief.touched.copy()
        cost = travel_cost(self.belief)
        walked = walk(self.scene.free, cost, touched, NO_PLAN, self.cell, goal, leash=leash)
        none = MultiPath(NO_PLAN, np.zeros(1, np.int32), np.zeros(0), leash, 0.0)
        plan = FramePlan(none, self.cell, goal, goal, 0.0, self.belief)
        self._set_out(plan, walked, speed)

    def _set_out(self, plan: FramePlan, walk: Walk, speed: float) -> None:
        self._plan = self._executed = plan
        self._path = walk.cells
        steps = np.abs(np.diff(walk.cells, axis=0)).sum(axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(np.where(steps == 2, np.sqrt(2.0), 1.0))])
        self._done = 0.0
        self._speed = speed
        self._interrupted = False
        self._to_go = plan.route_left
        self._since = self.clock.now()

    def change_speed(self, speed: float) -> None:
        self._settle()
        self._speed = speed

    def complete(self) -> None:
        self._settle()
        while self._plan is not None:
            left = float(self._along[-1] - self._done) / self._speed
            self.clock.advance(max(left, 1e-9))
            self._settle()

    def work(self, seconds: float) -> None:
        self._settle()
        self.clock.advance(seconds)
        self._settle()

    def stop(self) -> None:
        """Stand still where it is; a plan in execution is broken off there."""
        self._settle()
        if self._plan is None:
            return
        walked = self._reached() + 1
        self._path, self._along = self._path[:walked], self._along[:walked]
        self._done = float(self._along[-1])
        self._arrive()

    def driven(self) -> float:
        self._settle()
        return self._driven

    def story(self) -> Mapping[str, Any]:
        """Of the frame just ended: cells walked [m, 2], lengths planned and walked in cells, cells
        of the plan [n, 3] with their levels."""
        plan, self._executed = self._executed, None
        return {
            "path": self._path.tolist() if plan else [list(self.cell)],
            "length": float(self._along[-1]) if plan else 0.0,
            "planned": plan.length if plan else 0.0,
            "plan": plan.plan.plan.tolist() if plan else [],
        }

    def picture(self) -> Mapping[str, Any]:
        """What is believed of the floor now: probabilities of being blocked [rows, columns]."""
        return {"belief": self.belief.probabilities()}

    def _settle(self) -> None:
        """Bring place and energy up to now."""
        now = self.clock.now()
        passed = now - self._since
        self._since = now
        if passed < 0:
            return
        moving = 0.0
        if self._plan is not None:
            left = float(self._along[-1] - self._done) / self._speed
            moving = min(passed, left)
            self._done = min(float(self._along[-1]), self._done + moving * self._speed)
        self._driven += moving
        model = self._energy_model
        self._energy += moving * float(model.power(self._speed)) + (passed - moving) * model.idle
        if self._plan is not None and self._done >= self._along[-1] - 1e-9:
            self._arrive()

    def _arrive(self) -> None:
        plan = self._plan
        assert plan is not None
        self._plan = None
        self.walked += float(self._along[-1])
        known = int(self.belief.touched.sum())
        self.belief.touch_around(self._path, self.scene.free)
        fruitful = int(self.belief.touched.sum()) > known
        self._fruitless = 0 if fruitful else self._fruitless + 1
        self.cell = int(self._path[-1, 0]), int(self._path[-1, 1])
        self._interrupted = self.cell != plan.sub_goal
        if self.cell in self._goals:
            self._goals = tuple(goal for goal in self._goals if goal != self.cell)
            self._beyond = _unchosen(self._goals)
        if not self._goals:
            self._interrupted = False
            self._ending = Ending.REACHED
        if self._interrupted:
            self._to_go = self._route_from(self.cell)

    def _route_from(self, cell: Cell) -> float:
        """Believed length of the way through all goals that are left."""
        if not self._goals:
            return 0.0
        cost = travel_cost(self.belief)
        if self._beyond is None:
            way = shortest_tour(cost, cell, self._goals, ROUTE_WEIGHT)
        else:
            way = route(cost, cell, self._goals[0], ROUTE_WEIGHT)
        if way is None:
            self._ending = self._ending or Ending.UNREACHABLE
            return float("inf")
        return way.length + (self._beyond or 0.0)


def _unchosen(goals: tuple[Cell, ...]) -> float | None:
    """What is known of the way beyond the first of these goals before their order is chosen."""
    return None if len(goals) > 1 else 0.0
