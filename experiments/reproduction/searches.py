"""What [PRP16] claims of searches for plans: §2, §3 and the first half of §4.

A second is one of the reference machine, which makes a hundred thousand evaluations in it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from experiments.benchmarks.replanning import CLOSE, GOAL, body, detour
from experiments.reproduction.ways import Way
from monitor.robots.nao_missions import MACHINE
from monitor.robots.nao_planning import Planning, new_query
from planners import query
from planners.nao import CROUCH, SIT, STAND, STANDING
from planners.nao_plan import Action, Pose, actions_of, plan_world, trajectory
from planners.query import Query

PRINTED = (
    ((0.1, 0.27), (0.93, -0.25)),
    ((0.173, 0.269), (1.426, -0.268)),
    ((0.036, -0.352), (0.964, 0.352)),
    ((0.26, 0.32), (0.82, -0.28)),
)
"""The walks of the plans that §4 prints to go round the obstacle: to a goal that moves, after .5 s
and after 6 s; to one that stands, after 3 s and after .5 s."""
MOVING = 0.1
"""m/s of the goal that moves."""
EARLY, LATE = 0.5, 3.0
"""Seconds of search before a population has converged, and after."""
ARRIVED = 0.1
"""Metres from the goal that count as there: what the paper's own robot missed it by."""
STRAIGHT = 1.02
"""Of the least way, what counts as straight."""
SHORTEST = 1.1
"""Of the least way round, what counts as the shortest route."""
INITIAL = 0.06
"""What a plan to stand up and walk a metre costs, §4: the effort alone."""


@dataclass(frozen=True)
class Scene:
    """What is around the robot while it searches: an obstacle half-way to its goal, from some
    second of the search on until another; and by how many m/s its goal moves away from it."""

    appears: float = 0.0
    vanishes: float = math.inf
    moves: float = 0.0


BARE = Scene(appears=math.inf)
AROUND = Scene()
"""[PRP16] Fig. 1."""
MOVING_GOAL = Scene(moves=MOVING)
REMOVED_EARLY, REMOVED_LATE = Scene(vanishes=EARLY), Scene(vanishes=LATE)
APPEARS = Scene(appears=EARLY)


class Search:
    """A query for a plan of a robot that sits a metre from its goal, on the reference machine."""

    def __init__(self, seed: int, way: Way, scene: Scene) -> None:
        planning = replace(way.planning, effort=effort())
        self.scene = scene
        self.query = new_query(world(planning, scene.appears == 0.0), seed, planning)
        self._surrounded = world(planning, True)

    @property
    def seconds(self) -> float:
        return MACHINE.seconds("find_plan", self.query.evaluations)

    def until(self, seconds: float) -> Search:
        """Search on until so many seconds have passed since it began."""
        while self.seconds < seconds:
            self.step()
        return self

    def step(self) -> None:
        """One generation more, in the world as it is now."""
        now, scene, there = self.seconds, self.scene, self.query.world
        if there["obstacle_count"] and now >= scene.vanishes:
            there["obstacle_count"] = 0
        if not there["obstacle_count"] and scene.appears <= now < scene.vanishes:
            there.update(self._surrounded)
        if scene.moves:
            there["goal_x"] = GOAL[0] + scene.moves * now
        self.query.step()

    def actions(self) -> tuple[Action, ...]:
        return actions_of(self.query.best.choices)

    def poses(self) -> tuple[Pose, ...]:
        """Where the best plan leads, as its model has it."""
        return trajectory(self.actions(), dict(self.query.world))

    def apart(self) -> float:
        """Metres from the goal at which it ends."""
        end = self.poses()[-1]
        return math.dist((end.x, end.y), (self.query.world["goal_x"], self.query.world["goal_y"]))

    def length(self) -> float:
        """Metres that it walks."""
        return sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(self.poses()))

    def aside(self) -> float:
        """Metres by which it leaves the straight line to the goal."""
        return max(abs(pose.y) for pose in self.poses())

    def straight(self) -> bool:
        return self.apart() <= ARRIVED and self.length() <= STRAIGHT * GOAL[0]

    def collides(self) -> bool:
        """Whether one of its walks leads into something: by either rule it ends in a crouch."""
        steps = zip(self.actions(), itertools.pairwise(self.poses()), strict=True)
        return any(
            action.name == "walk" and before.posture in STANDING and after.posture == CROUCH
            for action, (before, after) in steps
        )


def world(planning: Planning, obstacle: bool) -> dict[str, Any]:
    """A robot that sits, its goal a metre ahead, and an obstacle half-way or none."""
    return plan_world(
        GOAL,
        obstacles=[printed_disc()] if obstacle else [],
        effort=planning.effort,
        collision=planning.collision,
        body=body(),
    )


def effort() -> float:
    """Of a second, so that to stand up and walk to the goal costs what the paper says."""
    direct = [Action("posture", STAND), Action("walk", *GOAL)]
    return INITIAL / trajectory(direct, world(Planning(), False))[-1].seconds


@cache
def printed_disc() -> tuple[float, float, float]:
    """The largest disc half-way to the goal that none of the printed plans touches: the paper
    does not say how large its obstacle was."""
    return (GOAL[0] / 2, 0.0, min(_clearance(walks) for walks in PRINTED))


def _clearance(walks: Sequence[tuple[float, float]]) -> float:
    """Metres by which a plan passes the point half-way to the goal."""
    x, y, nearest = -GOAL[0] / 2, 0.0, math.inf
    for dx, dy in walks:
        share = min(1.0, max(0.0, -(x * dx + y * dy) / (dx * dx + dy * dy)))
        nearest = min(nearest, math.hypot(x + share * dx, y + share * dy))
        x, y = x + dx, y + dy
    return nearest


def _shortest() -> float:
    """Metres of the shortest way round the obstacle."""
    return detour((0.0, 0.0), GOAL, printed_disc())


# --- The claims, one draw each.


@query.model
def five(rng: Any) -> float:
    """The program of §2."""
    total = 0.0
    while rng.flip("A"):
        total += rng.gaussian("B", 0, 1)
    return abs(total - 5.0)


def toy(seed: int, way: Way) -> bool:
    """The program of §2 finds its five, to a hundredth, before the population has converged."""
    planning = way.planning
    found = Query(five, population=planning.population, seed=seed, operators=planning.operators)
    found.run(evaluations=LATE / MACHINE.seconds("find_plan", 1.0), until=0.01)
    return found.value <= 0.01


def any_length(seed: int, way: Way) -> bool:
    """The best plans so far had different numbers of actions, and the last one arrives."""
    search, lengths = Search(seed, way, AROUND), set[int]()
    while search.seconds < LATE:
        search.step()
        lengths.add(len(search.actions()))
    return len(lengths) > 1 and search.apart() <= ARRIVED


def stand_first(seed: int, way: Way) -> bool:
    """Without an obstacle, the first thing that changes where the robot is or how it stands is to
    stand up (while it sits, walks and turns change nothing), and it goes straight to the goal."""
    search = Search(seed, way, BARE).until(LATE)
    states = [(pose.x, pose.y, pose.heading, pose.posture) for pose in search.poses()]
    changed = next((state for state in states if state != states[0]), states[0])
    rises = changed[:3] == states[0][:3] and changed[3] in STANDING
    return rises and search.straight()


def round_obstacle(seed: int, way: Way) -> tuple[float, ...]:
    """The plan goes round the obstacle to the goal; and by the shortest route."""
    search = Search(seed, way, AROUND).until(LATE)
    goes_round = not search.collides() and search.apart() <= ARRIVED
    return float(goes_round), float(goes_round and search.length() <= SHORTEST * _shortest())


def first_plan(seed: int, way: Way) -> tuple[float, ...]:
    """Seconds until an almost precise plan; what takes longer than 6 s counts as 6 s."""
    search, nao = Search(seed, way, AROUND), body()
    seconds = nao.posture_seconds[SIT, STAND] + _shortest() / nao.speed
    while search.query.value > effort() * seconds + CLOSE and search.seconds < 2 * LATE:
        search.step()
    return (search.seconds,)


def moving_tracked(seed: int, way: Way) -> tuple[float, ...]:
    """Metres from where a moving goal is after 6 s at which the best plan of then ends."""
    return (Search(seed, way, MOVING_GOAL).until(2 * LATE).apart(),)


def printed_moving_error() -> float:
    """The same of the plan that the paper prints."""
    x, y = (sum(walk[axis] for walk in PRINTED[1]) for axis in (0, 1))
    return math.dist((x, y), (GOAL[0] + MOVING * 2 * LATE, 0.0))


def removed_early_straight(seed: int, way: Way) -> bool:
    """The obstacle goes after .5 s; 3 s later the plan is straight."""
    return Search(seed, way, REMOVED_EARLY).until(EARLY + LATE).straight()


def removed_late_stays(seed: int, way: Way) -> bool:
    """The obstacle goes after 3 s; 3 s later the plan still makes at least half of its detour."""
    search = Search(seed, way, REMOVED_LATE).until(LATE)
    before = search.aside()
    return search.until(2 * LATE).aside() >= 0.5 * before > 0.0


def value_unchanged_by_removal(seed: int, way: Way) -> bool:
    """What the best plan is worth does not change when the obstacle goes."""
    search = Search(seed, way, AROUND).until(LATE)
    best = search.query.best
    search.query.world["obstacle_count"] = 0
    return search.query.value_of(best.choices) == best.value


def appeared_most_cases(seed: int, way: Way) -> tuple[float, ...]:
    """An obstacle appears after .5 s; 3 s later the plan goes round it to the goal."""
    search = Search(seed, way, APPEARS).until(EARLY + LATE)
    return (float(not search.collides() and search.apart() <= ARRIVED),)


def fall_stands_up(seed: int, way: Way) -> bool:
    """It falls on its way and crouches where no plan expected it: 3 s later the plan stands up and
    goes to the goal, without another collision."""
    search = Search(seed, way, AROUND).until(EARLY)
    search.query.world.update(x=0.3, y=0.25, heading=0.7, posture=CROUCH)
    search.until(EARLY + LATE)
    rises = any(a.name == "posture" and int(a.ahead) in STANDING for a in search.actions())
    return rises and not search.collides() and search.apart() <= ARRIVED
