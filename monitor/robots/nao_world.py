"""The floor that a simulated NAO walks on, in pymunk: obstacles that stand, move, come and go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pymunk

from anytime.errors import AnytimeError
from sensing.sonar import Circle, Surroundings, Wall

Vector = tuple[float, float]

_ROBOT, _OBSTACLE = 1, 2
_MASS = 5.4  # kg, of a NAO
_WIDEST = 1e4  # metres of an obstacle: squares of it stay numbers


@dataclass(frozen=True)
class Obstacle:
    """A disc or a box on the floor. Lengths in metres, times in seconds of the scene.

    at: its middle when it appears. radius: of a disc. size: width and depth of a box, turned
    counterclockwise by `turned` radians. velocity: m/s. It is there from `appears` (and not before
    the robot is out of its place) until `vanishes`.
    Raises AnytimeError for what cannot be.
    """

    at: Vector
    radius: float | None = None
    size: Vector | None = None
    turned: float = 0.0
    appears: float = 0.0
    vanishes: float = math.inf
    velocity: Vector = (0.0, 0.0)

    def __post_init__(self) -> None:
        if (self.radius is None) == (self.size is None):
            raise AnytimeError("an obstacle is a disc or a box; give one of the two")
        lengths = (self.radius,) if self.radius is not None else self.size or ()
        if not all(0.0 < length <= _WIDEST for length in lengths):
            raise AnytimeError(
                f"an obstacle's lengths are {lengths}; they must be > 0 and at most {_WIDEST:g} m"
            )
        if not all(map(math.isfinite, (*self.at, self.turned, *self.velocity))):
            raise AnytimeError(f"an obstacle at {self.at}: place and velocity must be finite")
        if not 0.0 <= self.appears < self.vanishes:
            raise AnytimeError(
                f"an obstacle appears at {self.appears} s and vanishes at {self.vanishes} s; "
                "it must be 0 <= appears < vanishes"
            )
        if math.hypot(*self.velocity) > 1.0:
            raise AnytimeError(f"an obstacle's velocity is {self.velocity}; 1 m/s is the most")

    @property
    def moves(self) -> bool:
        """Whether it has a velocity."""
        return self.velocity != (0.0, 0.0)

    def corners(self, at: Vector) -> list[Vector]:
        """The corners of a box whose middle is there, counterclockwise."""
        assert self.size is not None
        cos, sin = math.cos(self.turned), math.sin(self.turned)
        width, depth = self.size[0] / 2, self.size[1] / 2
        around = ((width, depth), (-width, depth), (-width, -depth), (width, -depth))
        return [(at[0] + cos * u - sin * v, at[1] + sin * u + cos * v) for u, v in around]

    def clearance(self, place: Vector, at: Vector | None = None) -> float:
        """Metres from a place to its surface, negative inside; `at`: where its middle is now."""
        middle = self.at if at is None else at
        right, up = place[0] - middle[0], place[1] - middle[1]
        if self.radius is not None:
            return math.hypot(right, up) - self.radius
        assert self.size is not None
        cos, sin = math.cos(self.turned), math.sin(self.turned)
        over = abs(cos * right + sin * up) - self.size[0] / 2
        beside = abs(cos * up - sin * right) - self.size[1] / 2
        return math.hypot(max(over, 0.0), max(beside, 0.0)) + min(max(over, beside), 0.0)


class _Thing:
    """An obstacle that is there now."""

    def __init__(self, obstacle: Obstacle, space: pymunk.Space) -> None:
        self.obstacle = obstacle
        self.body = pymunk.Body(
            body_type=pymunk.Body.KINEMATIC if obstacle.moves else pymunk.Body.STATIC
        )
        self.body.position = obstacle.at
        self.velocity = obstacle.velocity
        if obstacle.radius is not None:
            self.shape: pymunk.Shape = pymunk.Circle(self.body, obstacle.radius)
        else:
            self.shape = pymunk.Poly(self.body, obstacle.corners((0.0, 0.0)))
        self.shape.collision_type = _OBSTACLE
        self.shape.friction = self.shape.elasticity = 0.0
        space.add(self.body, self.shape)

    @property
    def at(self) -> Vector:
        return self.body.position.x, self.body.position.y


class World:
    """Obstacles and the disc of a robot that pushes at a velocity of its own.

    A moving obstacle never shoves the robot: it waits while the robot is in its way, and turns back
    when the robot has fallen over it.
    """

    def __init__(
        self, obstacles: tuple[Obstacle, ...], place: Vector, radius: float, tick: float
    ) -> None:
        self._radius = radius
        self._tick = tick
        self._space = pymunk.Space()
        self._space.collision_slop = 0.001  # pymunk's 0.1 is made for pixels: 0.1 m
        self._robot = pymunk.Body(_MASS, math.inf)
        self._robot.position = place
        self._robot.velocity_func = self._walk
        shape = pymunk.Circle(self._robot, radius)
        shape.collision_type = _ROBOT
        shape.friction = shape.elasticity = 0.0
        self._space.add(self._robot, shape)
        self._space.on_collision(_ROBOT, _OBSTACLE, pre_solve=self._touch)
        self._wish: Vector = (0.0, 0.0)
        self._touching: list[tuple[pymunk.Shape, float, float]] = []
        self._waiting: set[int] = set()  # shapes of what would run into it
        self.contacts = 0  # how often the robot began to touch something
        self._things: list[_Thing] = []
        self._to_come = sorted(obstacles, key=lambda obstacle: obstacle.appears)
        self._come_and_go(0.0)

    @property
    def place(self) -> Vector:
        """Where the middle of the robot is."""
        return self._robot.position.x, self._robot.position.y

    def obstacles(self) -> list[tuple[Obstacle, Vector]]:
        """What is there now, and where its middle is."""
        return [(thing.obstacle, thing.at) for thing in self._things]

    def surroundings(self) -> Surroundings:
        """What is there now, as the sonars see it."""
        circles: list[Circle] = []
        walls: list[Wall] = []
        for obstacle, at in self.obstacles():
            if obstacle.radius is not None:
                circles.append((*at, obstacle.radius))
            else:
                corners = obstacle.corners(at)
                after = [*corners[1:], corners[0]]
                walls.extend((*one, *other) for one, other in zip(corners, after, strict=True))
        return Surroundings(tuple(circles), tuple(walls))

    def step(self, time: float, wish: Vector, intent: Vector) -> float:
        """Let one tick pass, which ends at `time`; returns how many metres of way were blocked.

        The robot moves as it wished in the tick before: pymunk moves first, then looks what
        touches. intent: its velocity without noise, which says how hard it runs into something.
        """
        self._come_and_go(time)
        self._wish = wish
        before = self._touched()
        blocked = self._let_move(intent)
        self._touching = []
        self._space.step(self._tick)
        self.contacts += not before and bool(self._touched())
        velocities = {id(thing.shape): thing.velocity for thing in self._things}
        for shape, across, up in self._touching:
            towards = velocities[id(shape)]
            speed = (intent[0] - towards[0]) * across + (intent[1] - towards[1]) * up
            blocked = max(blocked, speed * self._tick)
        return blocked

    def turn_back(self) -> None:
        """Let the moving obstacles that touch the robot go back where they came from."""
        for thing in self._things:
            if id(thing.shape) in self._touched():
                thing.velocity = -thing.velocity[0], -thing.velocity[1]

    def _let_move(self, intent: Vector) -> float:
        """Let obstacles move unless they would run into the robot; returns the way so blocked."""
        blocked, place, tick = 0.0, self.place, self._tick
        pushed = place[0] + intent[0] * tick, place[1] + intent[1] * tick
        self._waiting = set()
        for thing in [thing for thing in self._things if thing.obstacle.moves]:
            obstacle, at = thing.obstacle, thing.at
            ahead = at[0] + thing.velocity[0] * tick, at[1] + thing.velocity[1] * tick
            gap, then = obstacle.clearance(place, at), obstacle.clearance(place, ahead)
            waits = then <= self._radius and then < gap
            thing.body.velocity = (0.0, 0.0) if waits else thing.velocity
            if waits:
                self._waiting.add(id(thing.shape))
                blocked = max(blocked, gap - obstacle.clearance(pushed, ahead))
        return blocked

    def _touched(self) -> set[int]:
        return self._waiting | {id(shape) for shape, _, _ in self._touching}

    def _walk(self, body: pymunk.Body, gravity: Vector, damping: float, dt: float) -> None:
        # Here and not before the step, else the wish would beat the contact it was solved against.
        body.velocity = self._wish

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        # pymunk swallows what a callback raises, so it only takes notes.
        normal = arbiter.contact_point_set.normal
        self._touching.append((arbiter.shapes[1], normal.x, normal.y))

    def _come_and_go(self, time: float) -> None:
        for thing in [thing for thing in self._things if thing.obstacle.vanishes <= time]:
            self._things.remove(thing)
            self._space.remove(thing.shape, thing.body)
        for obstacle in [each for each in self._to_come if each.appears <= time]:
            if obstacle.vanishes <= time:
                self._to_come.remove(obstacle)
            elif obstacle.clearance(self.place) > self._radius:
                self._to_come.remove(obstacle)
                self._things.append(_Thing(obstacle, self._space))
