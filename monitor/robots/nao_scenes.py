"""Scenes for a simulated NAO as TOML files."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from anytime.errors import AnytimeError
from anytime.files import read_toml
from monitor.robots.nao_body import Pose
from monitor.robots.nao_noise import NOISELESS, Noise
from monitor.robots.nao_world import Obstacle, Vector
from planners.nao import POSTURES, Body
from sensing.sonar import Sonars

FAR = 50.0  # metres from the origin within which a scene takes place
_FARTHEST = 60.0  # seconds ahead that a goal's way is foreseen


@dataclass(frozen=True)
class Goal:
    """Where NAO should go: a place that may move. Metres, m/s."""

    at: Vector
    velocity: Vector = (0.0, 0.0)

    def place(self, time: float) -> Vector:
        """Where it is after `time` seconds."""
        return self.at[0] + self.velocity[0] * time, self.at[1] + self.velocity[1] * time

    def meeting_point(self, here: Vector, time: float, *, speed: float, delay: float) -> Vector:
        """Where it will be when one who is `here` after `time` seconds, and walks at `speed` (m/s)
        after a `delay` (s), can be there; one who is too slow for it looks a minute ahead."""
        if self.velocity == (0.0, 0.0):
            return self.place(time)
        takes = 0.0
        for _ in range(20):
            way = math.dist(here, self.place(time + takes))
            takes = min(_FARTHEST, delay + way / speed)
        return self.place(time + takes)


@dataclass(frozen=True)
class Scene:
    """Where a simulated NAO begins, where it should go, what stands in the way, what goes wrong.

    start_in_world: x, y and heading. posture: one of `planners.nao.POSTURES`. auto_stand: whether a
    walk from a low posture begins with standing up, as NAOqi does, instead of being refused, as in
    [PRP16] §3. secure: metres from an obstacle at which the body itself ends a walk towards it, as
    NAOqi's secure move does; 0 is never.
    Raises AnytimeError for a scene that cannot be.
    """

    name: str = "scene"
    start_in_world: Pose = (0.0, 0.0, 0.0)
    posture: str = "Sit"
    goal: Goal = field(default_factory=lambda: Goal((1.0, 0.0)))
    obstacles: tuple[Obstacle, ...] = ()
    sonars: Sonars = field(default_factory=Sonars)
    noise: Noise = field(default_factory=Noise)
    seed: int = 0
    auto_stand: bool = False
    secure: float = 0.0

    def __post_init__(self) -> None:
        if self.posture not in POSTURES:
            raise AnytimeError(
                f"posture is {self.posture!r}; it must be one of {', '.join(POSTURES)}"
            )
        numbers = (*self.start_in_world, *self.goal.at, *self.goal.velocity)
        if not all(map(math.isfinite, numbers)):
            raise AnytimeError("start and goal must be finite numbers")
        if math.hypot(*self.goal.velocity) > 1.0:
            raise AnytimeError(f"the goal's velocity is {self.goal.velocity}; 1 m/s is the most")
        places = [self.start_in_world[:2], self.goal.at, *(each.at for each in self.obstacles)]
        for x, y in places:
            if max(abs(x), abs(y)) > FAR:
                raise AnytimeError(
                    f"something is at ({x:g}, {y:g}); a scene reaches {FAR:g} m from the origin"
                )
        if not 0.0 <= self.secure < math.inf:
            raise AnytimeError(f"secure is {self.secure} m; it must be 0 (never) or more")
        radius = Body().radius
        for number, obstacle in enumerate(self.obstacles, 1):
            clear = obstacle.clearance((self.start_in_world[0], self.start_in_world[1]))
            if obstacle.appears == 0.0 and clear <= radius:
                raise AnytimeError(
                    f"obstacle {number} stands where the robot starts; its surface must be more "
                    f"than {radius} m from the start"
                )

    def noiseless(self) -> Scene:
        """The same scene, in which everything goes as it was meant to."""
        return replace(self, noise=NOISELESS)


class _Section(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A table of the file; keys that it does not have are refused."""


class _Nao(_Section):
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    posture: str = "Sit"
    auto_stand: bool = False
    secure: float = 0.0


class _Goal(_Section):
    at: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)


class _Sonar(_Section):
    version: str = "V4"
    half_angle_degrees: float = 30.0


class _Noise(_Section):
    execution: bool = True
    odometry: bool = True
    drift: bool = True
    sonar: bool = True
    falls: bool = True


class _Obstacle(_Section):
    disc: tuple[float, float, float] | None = None
    box: tuple[float, float, float, float] | None = None
    turned: float = 0.0
    appears: float = msgspec.field(default=0.0, name="from")
    vanishes: float = msgspec.field(default=math.inf, name="until")
    velocity: tuple[float, float] = (0.0, 0.0)


class _File(_Section):
    goal: _Goal
    name: str | None = None
    seed: int = 0
    nao: _Nao = msgspec.field(default_factory=_Nao)
    sonar: _Sonar = msgspec.field(default_factory=_Sonar)
    noise: _Noise | bool = True
    obstacle: list[_Obstacle] = msgspec.field(default_factory=list)


_OWN = {"goal", "nao", "sonar", "noise", "obstacle"}
"""Tables that only a scene has."""


def read_scene(path: Path, *, seed: int | None = None, noise: bool = True) -> Scene:
    """Read a scene; `seed` replaces the file's, `noise=False` turns off all that is random.

    Raises AnytimeError, in one line with the path, for whatever is wrong.
    """
    file = read_toml(path, _File, "scene file")
    try:
        scene = Scene(
            name=file.name or path.stem,
            start_in_world=file.nao.at,
            posture=file.nao.posture,
            goal=Goal(file.goal.at, file.goal.velocity),
            obstacles=tuple(
                _obstacle(number, given) for number, given in enumerate(file.obstacle, 1)
            ),
            sonars=Sonars(file.sonar.version, math.radians(file.sonar.half_angle_degrees)),
            noise=_noise(file.noise),
            seed=file.seed if seed is None else seed,
            auto_stand=file.nao.auto_stand,
            secure=file.nao.secure,
        )
    except AnytimeError as error:
        raise AnytimeError(f"{path}: {error}") from None
    return scene if noise else scene.noiseless()


def is_scene(path: Path) -> bool:
    """Whether a TOML file is about a NAO rather than a grid mission: by the tables that it has."""
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8")).keys()
    except (OSError, ValueError, RecursionError):  # whoever reads it in earnest says what is wrong
        return False
    return bool(tables & _OWN) and not tables & {"mission", "value", "world"}


def _obstacle(number: int, given: _Obstacle) -> Obstacle:
    if (given.disc is None) == (given.box is None):
        raise AnytimeError(
            f"obstacle {number}: give either disc = [x, y, radius] or box = [x, y, width, depth]"
        )
    try:
        if given.disc is not None:
            x, y, radius = given.disc
            return Obstacle(
                (x, y),
                radius=radius,
                appears=given.appears,
                vanishes=given.vanishes,
                velocity=given.velocity,
            )
        assert given.box is not None
        x, y, width, depth = given.box
        return Obstacle(
            (x, y),
            size=(width, depth),
            turned=given.turned,
            appears=given.appears,
            vanishes=given.vanishes,
            velocity=given.velocity,
        )
    except AnytimeError as error:
        raise AnytimeError(f"obstacle {number}: {error}") from None


def _noise(given: _Noise | bool) -> Noise:
    switches = given if isinstance(given, _Noise) else _all(given)
    full, none = Noise(), NOISELESS
    falls = full if switches.falls else none
    drift = full if switches.drift else none
    return Noise(
        execution=(full if switches.execution else none).execution,
        odometry=(full if switches.odometry else none).odometry,
        drift=drift.drift,
        hidden_drift=drift.hidden_drift,
        sonar=switches.sonar,
        falls=falls.falls,
        get_up=falls.get_up,
    )


def _all(on: bool) -> _Noise:
    return _Noise(execution=on, odometry=on, drift=on, sonar=on, falls=on)
