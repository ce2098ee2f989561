"""Missions of the grid robot as TOML files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from anytime.errors import AnytimeError
from anytime.files import read_toml
from anytime.machines import Machine
from monitor.missions import Energy, Mission, News, Value
from monitor.robots.grid import Scene
from planners.path_finding import Cell
from planners.touring import MOST_GOALS
from sensing import corner_to_corner, read_map
from sensing.camera import MOST_EXPOSURES, Camera
from sensing.maps import BoolGrid
from sensing.vision import Device, Vision


@dataclass(frozen=True)
class GridMission:
    """A mission, the floor it takes place on, and the machine that thinks for the robot."""

    mission: Mission
    scene: Scene
    machine: Machine


class _Section(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """A table of the file; keys that it does not have are refused."""


class _Mission(_Section):
    name: str = "mission"
    job: float = 0.0
    gain: float = 1.0
    speeds: tuple[float, float] = (1.0, 10.0)


class _Value(_Section):
    kind: str
    worth: float
    seconds: float


class _News(_Section):
    at: float
    kind: str
    worth: float
    seconds: float


class _Energy(_Section):
    price: float
    base: float
    square: float
    idle: float = 0.0


class _World(_Section):
    map: str
    start: tuple[int, int] | None = None
    goal: tuple[int, int] | None = None
    goals: tuple[tuple[int, int], ...] | None = None
    radius: int = 32
    frame: float = 16.0
    density: float = 0.2


class _Vision(_Section):
    kind: str = "parametric"
    t_a: float = 2.0
    t_b: float = 24.0
    q_a: float = 0.75
    q_b: float = 1.0
    concave: bool = True
    falloff: float = 0.0
    exposures: int = 24


class _File(_Section):
    mission: _Mission
    value: _Value
    energy: _Energy
    world: _World
    vision: _Vision = msgspec.field(default_factory=_Vision)
    news: _News | None = None
    machine: dict[str, float] = msgspec.field(default_factory=dict)
    fixed: dict[str, float] = msgspec.field(default_factory=dict)


REFERENCE = Machine("reference").with_rate("see", 0.25).with_rate("find_path", 0.001)
"""Slow enough that thinking costs about as much as walking, so that the division matters."""


def read_mission(
    path: str | Path,
    *,
    map_path: Path | None = None,
    start: Cell | None = None,
    goals: Sequence[Cell] = (),
) -> GridMission:
    """Read a mission; map_path, start and goals replace those of the file.

    The map's path is relative to the mission's file. Raises AnytimeError, in one line with the
    path, for whatever is wrong.
    """
    path = Path(path)
    file = read_toml(path, _File, "mission file")
    floor = read_map(map_path or path.parent / file.world.map)
    replaced = map_path is not None
    begin = start or (None if replaced else file.world.start)
    if file.world.goals is not None and not file.world.goals:
        raise AnytimeError(
            f"{path}: world: goals is empty; a mission has 1 to {MOST_GOALS} different goals"
        )
    if file.world.goal and file.world.goals:
        raise AnytimeError(f"{path}: world: it has a goal and goals; give one of them")
    named = file.world.goals or ((file.world.goal,) if file.world.goal else ())
    ends = tuple(goals) or (() if replaced else named)
    try:
        begin, ends = _ends(floor.free, begin, ends)
        scene = Scene(
            free=floor.free,
            start=begin,
            goal=ends[0],
            radius=file.world.radius,
            frame=file.world.frame,
            device=_device(file.vision),
            density=file.world.density,
            name=floor.name,
            also=tuple(ends[1:]),
        )
        mission = Mission(
            value=Value(file.value.kind, file.value.worth, file.value.seconds),  # pyright: ignore[reportArgumentType]
            energy=Energy(
                file.energy.price, file.energy.base, file.energy.square, file.energy.idle
            ),
            speeds=file.mission.speeds,
            job=file.mission.job,
            gain=file.mission.gain,
            name=file.mission.name if not replaced else f"{file.mission.name} on {floor.name}",
            fixed=file.fixed,
            news=_news(file.news),
        )
        _known("machine", file.machine, REFERENCE.rates)
        _known("fixed", file.fixed, [*REFERENCE.rates, "speed"])
        machine = REFERENCE
        for module, rate in file.machine.items():
            machine = machine.with_rate(module, rate)
    except AnytimeError as error:
        raise AnytimeError(f"{path}: {error}") from None
    return GridMission(mission, scene, machine)


def _news(table: _News | None) -> News | None:
    if table is None:
        return None
    try:
        value = Value(table.kind, table.worth, table.seconds)  # pyright: ignore[reportArgumentType]
    except AnytimeError as error:
        raise AnytimeError(str(error).replace("value.", "news.", 1)) from None
    return News(table.at, value)


def _known(table: str, given: Iterable[str], known: Iterable[str]) -> None:
    for key in given:
        if key not in known:
            raise AnytimeError(f"[{table}] has no key {key!r}; it has {', '.join(known)}")


def _device(vision: _Vision) -> Device:
    if vision.kind == "parametric":
        return Vision(
            vision.t_a, vision.t_b, vision.q_a, vision.q_b, vision.concave, vision.falloff
        )
    if vision.kind == "camera":
        if not Camera().first <= vision.exposures <= MOST_EXPOSURES:
            raise AnytimeError(
                f"vision.exposures is {vision.exposures}; a camera makes {Camera().first} to "
                f"{MOST_EXPOSURES}"
            )
        return replace(Camera(), last=vision.exposures)
    raise AnytimeError(f"vision.kind is {vision.kind!r}; it must be parametric or camera")


def _ends(
    free: BoolGrid, start: Cell | None, goals: tuple[Cell, ...]
) -> tuple[Cell, tuple[Cell, ...]]:
    """Start and goals, those that are not given far off: in the corners of the part of the floor in
    which the given ones lie, or of its largest part."""
    if start is not None and goals:
        return start, goals
    if not free.any():
        raise AnytimeError("the map has no free cell")
    given = start or (goals[0] if goals else None)
    first, last = corner_to_corner(_part(free, given))
    if given is None:
        return first, (last,)
    far = max(first, last, key=lambda cell: math.dist(cell, given))
    return start or far, goals or (far,)


def _part(free: BoolGrid, cell: Cell | None) -> BoolGrid:
    """The free cells that hang together with a cell, or the largest part of a floor without one;
    all of them for a cell that is not on the floor."""
    from scipy.ndimage import label

    parts = np.asarray(label(free)[0])  # pyright: ignore[reportIndexIssue]
    if cell is None:
        return parts == 1 + int(np.argmax(np.bincount(parts.ravel())[1:]))
    rows, columns = free.shape
    on_floor = 0 <= cell[0] < rows and 0 <= cell[1] < columns and free[cell]
    return parts == parts[cell] if on_floor else free
