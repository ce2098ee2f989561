"""An independent judge of the simulated NAO's geometry: Bullet, in three dimensions.

Random worlds are extruded into cylinders and boxes; a cylinder of the robot's size is driven at
the same velocity, and its sonars are fans of rays. The first contact and the distances of the
sonars are compared with those of `monitor.robots.nao_world` and `sensing.sonar`, which compute in
the plane with another engine and in closed form. pybullet is the extra `oracle`.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from monitor.robots.nao_world import Obstacle, Vector, World
from planners.nao import Body
from sensing.sonar import MOUNTS, Pose, Sonars

OBSTACLES, MOVING = 14, 3
"""Of each world: how many, and how many of them move."""
WITHIN_M, WITHIN_TICKS = 0.01, 3
"""What counts as agreement: of a distance, and of a first contact."""
MISSING = "pybullet is not installed (extra oracle)"
"""Why nothing is measured."""

_TICK, _SECONDS = 0.02, 20.0
_EVERY = 75  # ticks between two looks of the sonars
_HEIGHT = 0.6  # metres, of everything
_MARGIN = 0.0005  # metres
_RAYS = 601  # of a fan: one every tenth of a degree
_NOWHERE = 10_000  # ticks: no contact


class Compared(NamedTuple):
    """One world by both: distances [n] that both sonars measured, first contacts in ticks."""

    ours: np.ndarray
    theirs: np.ndarray
    our_contact: int
    their_contact: int

    @property
    def met(self) -> bool:
        """Whether either saw a contact."""
        return min(self.our_contact, self.their_contact) < _NOWHERE


def available() -> bool:
    """Whether pybullet is installed."""
    return importlib.util.find_spec("pybullet") is not None


def figures(seeds: Sequence[int]) -> dict[str, float | int | None]:
    """Over a random world for each seed: the share of the sonars' readings within a centimetre,
    and of the first contacts within three ticks; the greatest differences, and how many there were.
    """
    worlds = [compare(seed) for seed in seeds]
    apart = np.concatenate([np.abs(world.ours - world.theirs) for world in worlds])
    late = [abs(each.our_contact - each.their_contact) for each in worlds if each.met]
    return {
        "oracle.within_cm": float(np.mean(apart <= WITHIN_M)),
        "oracle.readings": len(apart),
        "oracle.max_m": float(apart.max()),
        "oracle.contacts_within_3_ticks": float(np.mean(np.array(late) <= WITHIN_TICKS)),
        "oracle.contacts": len(late),
        "oracle.max_ticks": max(late),
    }


def compare(seed: int) -> Compared:
    """Drive the robot through a random world, in the plane and in space, until both touched."""
    rng = np.random.default_rng((seed, 5))
    obstacles = random_obstacles(rng)
    bearing, body = rng.uniform(-math.pi, math.pi), Body()
    velocity = (body.speed * math.cos(bearing), body.speed * math.sin(bearing))
    plane = World(obstacles, (0.0, 0.0), body.radius, _TICK)
    sonars = Sonars()
    ours: list[float] = []
    theirs: list[float] = []
    our_contact = their_contact = _NOWHERE
    with _Space(obstacles, body.radius) as space:
        for tick in range(1, round(_SECONDS / _TICK) + 1):
            if (tick - 1) % _EVERY == 0 and our_contact == _NOWHERE:
                pose = (*plane.place, bearing + 0.6 * math.sin(0.5 * tick * _TICK))
                reach = sonars.ranger.estimated
                seen = sonars.distances(pose, plane.surroundings())
                ours += [min(distance, reach) for distance in seen]
                theirs += space.distances(pose, sonars.half_angle, reach)
            plane.step(tick * _TICK, velocity, velocity)
            space.step(tick * _TICK, velocity)
            if plane.contacts and our_contact == _NOWHERE:
                our_contact = tick
            if their_contact == _NOWHERE and space.touches():
                their_contact = tick
            if max(our_contact, their_contact) < _NOWHERE:
                break
            if tick > min(our_contact, their_contact) + 10 * WITHIN_TICKS:
                break
    return Compared(np.array(ours), np.array(theirs), our_contact, their_contact)


def random_obstacles(rng: np.random.Generator) -> tuple[Obstacle, ...]:
    """Discs and boxes around a robot at the origin, none of which it touches; a few move."""
    found: list[Obstacle] = []
    while len(found) < OBSTACLES:
        x, y, turned = rng.uniform([-2.2, -2.2, -math.pi], [2.2, 2.2, math.pi])
        width, depth = rng.uniform(0.06, 0.4, 2)
        towards, speed = rng.uniform(-math.pi, math.pi), rng.uniform(0.02, 0.08)
        moves = len(found) < MOVING
        velocity = (speed * math.cos(towards), speed * math.sin(towards)) if moves else (0.0, 0.0)
        obstacle = (
            Obstacle((x, y), radius=width / 2, velocity=velocity)
            if rng.integers(2)
            else Obstacle((x, y), size=(width, depth), turned=turned, velocity=velocity)
        )
        if obstacle.clearance((0.0, 0.0)) > Body().radius + 0.1:
            found.append(obstacle)
    return tuple(found)


class _Space:
    """The same world in Bullet, without gravity: what stands has no mass, what moves is put where
    its velocity leads, and the robot is an upright cylinder that is driven."""

    def __init__(self, obstacles: Sequence[Obstacle], radius: float) -> None:
        self._bullet: Any = importlib.import_module("pybullet")
        self._client = self._bullet.connect(self._bullet.DIRECT)
        self._bullet.setTimeStep(_TICK, physicsClientId=self._client)
        self._obstacles = obstacles
        self._bodies = [self._extruded(obstacle) for obstacle in obstacles]
        self._robot = self._made(self._cylinder(radius), (0.0, 0.0), 0.0, mass=4.5)
        # no turning over: it stays the upright cylinder that the plane knows
        self._bullet.changeDynamics(
            self._robot,
            -1,
            localInertiaDiagonal=(0.0, 0.0, 0.0),
            lateralFriction=0.0,
            linearDamping=0.0,
            physicsClientId=self._client,
        )
        # rays begin within the robot, which must not hide what they look for: it is a group apart
        for things, group, meets in ((self._bodies, 1, 3), ([self._robot], 2, 1)):
            for thing in things:
                self._bullet.setCollisionFilterGroupMask(
                    thing, -1, group, meets, physicsClientId=self._client
                )

    def __enter__(self) -> _Space:
        return self

    def __exit__(self, *ignored: object) -> None:
        self._bullet.disconnect(physicsClientId=self._client)

    def step(self, time: float, velocity: Vector) -> None:
        """Let one tick pass, which ends at `time`."""
        for obstacle, body in zip(self._obstacles, self._bodies, strict=True):
            if obstacle.moves:
                at = [p + v * time for p, v in zip(obstacle.at, obstacle.velocity, strict=True)]
                self._put(body, (at[0], at[1]), obstacle.turned)
        self._bullet.resetBaseVelocity(
            self._robot, (*velocity, 0.0), (0.0, 0.0, 0.0), physicsClientId=self._client
        )
        self._bullet.stepSimulation(physicsClientId=self._client)

    def touches(self) -> bool:
        """Whether the robot touches anything, up to the margin at which Bullet lets it slide along;
        farther contact points are of mere neighbours."""
        points = self._bullet.getContactPoints(self._robot, physicsClientId=self._client)
        return any(point[8] <= _MARGIN for point in points)

    def distances(self, pose: Pose, half_angle: float, reach: float) -> list[float]:
        """What the left and the right sonar measure, by fans of rays, in metres up to `reach`."""
        x, y, heading = pose
        cos, sin = math.cos(heading), math.sin(heading)
        found: list[float] = []
        for ahead, aside, bearing in MOUNTS:
            apex = (x + cos * ahead - sin * aside, y + sin * ahead + cos * aside)
            rays = list(self._fan(apex, heading + bearing, half_angle, reach))
            hits = self._bullet.rayTestBatch(
                [(*apex, _HEIGHT / 2)] * len(rays),
                rays,
                numThreads=1,
                collisionFilterMask=1,
                physicsClientId=self._client,
            )
            found.append(min(hit[2] for hit in hits) * reach)
        return found

    def _fan(
        self, apex: Vector, bearing: float, half_angle: float, reach: float
    ) -> Iterator[tuple[float, float, float]]:
        for aside in np.linspace(-half_angle, half_angle, _RAYS).tolist():
            angle = bearing + aside
            yield (
                apex[0] + reach * math.cos(angle),
                apex[1] + reach * math.sin(angle),
                _HEIGHT / 2,
            )

    def _extruded(self, obstacle: Obstacle) -> int:
        if obstacle.radius is not None:
            shape = self._cylinder(obstacle.radius)
        else:
            assert obstacle.size is not None
            width, depth = obstacle.size
            shape = self._bullet.createCollisionShape(
                self._bullet.GEOM_BOX,
                halfExtents=(width / 2, depth / 2, _HEIGHT / 2),
                physicsClientId=self._client,
            )
        return self._made(shape, obstacle.at, obstacle.turned)

    def _cylinder(self, radius: float) -> int:
        return self._bullet.createCollisionShape(
            self._bullet.GEOM_CYLINDER,
            radius=radius,
            height=_HEIGHT,
            physicsClientId=self._client,
        )

    def _made(self, shape: int, at: Vector, turned: float, mass: float = 0.0) -> int:
        body = self._bullet.createMultiBody(mass, shape, physicsClientId=self._client)
        # Bullet rounds edges by its margin, 4 cm where nobody says otherwise
        self._bullet.changeDynamics(body, -1, collisionMargin=_MARGIN, physicsClientId=self._client)
        self._put(body, at, turned)
        return body

    def _put(self, body: int, at: Vector, turned: float) -> None:
        self._bullet.resetBasePositionAndOrientation(
            body,
            (*at, _HEIGHT / 2),
            (0.0, 0.0, math.sin(turned / 2), math.cos(turned / 2)),
            physicsClientId=self._client,
        )
