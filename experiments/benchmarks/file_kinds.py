"""Every kind of file that is read: a good one, its reader, and how it is taken apart as a tree."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import compiler
from anytime import ProfileLibrary, WorkClock
from anytime.faults import read_schedule
from anytime.files import checksum, laid_out
from anytime.library import read_machine, read_profile
from experiments import crossings, shipped
from monitor import Energy, Mission, Value
from monitor.log_reading import read_log
from monitor.logs import Floor, write_log
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.robots.faulty import kinds_of
from monitor.robots.grid import GridRobot, Scene
from monitor.robots.grid_missions import REFERENCE, read_mission
from monitor.robots.lessons import Memory
from monitor.robots.nao_body import NaoBody
from monitor.robots.nao_drift import Drift, read_drift, write_drift
from monitor.robots.nao_recording import Recorder, Replay
from monitor.robots.nao_scenes import Scene as NaoScene
from monitor.robots.nao_scenes import read_scene
from monitor.robots.simulated_nao import SimulatedNao
from sensing import read_map
from sensing.images import read_pgm
from sensing.movingai import read_scenarios


@dataclass(frozen=True)
class Kind:
    """A kind of file: a good one, its reader, and how its trees are taken apart and written."""

    name: str
    good: bytes
    read: Callable[[Path], object]
    parse: Callable[[bytes], Any] | None = None
    write: Callable[[Any], bytes] | None = None
    command: tuple[str, ...] = ()


def all_kinds(folder: Path) -> Iterator[Kind]:
    """Every kind of file that is read, from good ones of our own."""
    data = shipped.DATA
    small = _small(shipped.profiles())
    small.save(folder / "good")
    program = crossings.compiled(small)
    modules = [call.module for call in program.program.calls]
    program.save(folder / "good.schedule")
    write_drift(folder / "good.drift", Drift())
    write_log_of_a_mission(folder / "good.jsonl")

    def record(name: str, path: Path, read: Callable[[Path], object], *command: str) -> Kind:
        return Kind(name, path.read_bytes(), read, _record_tree, _record_bytes, command)

    def toml(name: str, path: Path, read: Callable[[Path], object]) -> Kind:
        return Kind(name, path.read_bytes(), read, _toml_tree, _toml_bytes)

    def words(name: str, text: str, read: Callable[[Path], object], apart: str = " ") -> Kind:
        return Kind(
            name,
            text.encode(),
            read,
            lambda content: [line.split(apart) for line in content.decode().split("\n")],
            lambda tree: "\n".join(_line(line, apart) for line in tree).encode(),
        )

    yield record("profile", folder / "good" / "see.profile", read_profile)
    yield record("machine", folder / "good" / "machine.json", read_machine)
    yield record(
        "schedule",
        folder / "good.schedule",
        lambda path: compiler.load(path, modules),
        *("explain", "--seconds", "5"),
    )
    yield record("drift", folder / "good.drift", read_drift)
    good_log = (folder / "good.jsonl").read_bytes()
    replay = ("replay", "-o", str(folder / "page.html"))
    yield Kind("jsonl", good_log, read_log, _log_tree, _log_bytes, replay)
    record_a_run(folder / "good.run")
    recording = (folder / "good.run").read_bytes()
    yield Kind("recording", recording, replayed, _log_tree, _log_bytes)
    learnt = hashed_lesson(folder)
    yield record("lesson", learnt, lambda path: recalled(path, learnt))
    yield toml("mission.toml", data / "missions" / "office.toml", lambda path: _mission(path, data))
    yield toml("scene.toml", data / "scenes" / "appearing.toml", read_scene)
    faults = folder / "faults.toml"
    faults.write_text('seed = 1\n[[fault]]\nwhat = "see"\nkind = "raises"\nfrom = 1.0\nto = 2.0\n')
    yield toml("faults.toml", faults, lambda path: read_schedule(path, kinds_of(program.program)))
    floor = "type octile\nheight 6\nwidth 7\nmap\n" + ".......\n" * 5 + "..@@..T\n"
    yield words("map", floor, read_map)
    query = "0\troom.map\t7\t6\t0\t0\t5\t4\t6.65685425\n"
    yield words("scen", "version 1\n" + query * 3, read_scenarios, "\t")
    plain = "P2\n4 3\n255\n" + "0 254 205 254\n" * 3
    yield words("plain.pgm", plain, read_pgm)
    yield Kind("pgm", b"P5\n4 3\n255\n" + bytes([0, 254, 205, 254] * 3), read_pgm)
    (folder / "office.pgm").write_bytes((data / "office.pgm").read_bytes())
    yield words("yaml", (data / "office.yaml").read_text(), read_map)


def _small(library: ProfileLibrary) -> ProfileLibrary:
    """A few runs of each profile, so that thousands of them are read in a minute."""
    profiles = {
        name: replace(profile, recordings=profile.recordings[:3])
        for name, profile in library.items()
    }
    return ProfileLibrary(profiles=profiles, machine=library.machine)


def _mission(path: Path, data: Path) -> object:
    return read_mission(path, map_path=data / "office.yaml")


def write_log_of_a_mission(path: Path) -> None:
    """The log of a short mission."""
    program = crossings.compiled()
    free = np.ones((24, 24), bool)
    scene = Scene(free, (0, 0), (23, 23))
    mission = Mission(Value("hard", 10.0, 500.0), Energy(0.1, 0.1, 0.1))
    policy = constant(dict(zip(program.labels, (2.0, 1.0), strict=True)), 5.0)
    robot = GridRobot(scene, mission.energy, WorkClock(REFERENCE))
    report = Monitor(program, policy).run(mission, robot)
    floor = Floor(scene.free, scene.start, scene.goal, scene.radius)
    write_log(path, mission, floor, report)


def record_a_run(path: Path) -> None:
    """A NAO that walks a little, as `replayed` asks for it."""
    recorder = Recorder(SimulatedNao(NaoScene(posture="Stand")), path)
    _walked(recorder)


def replayed(path: Path) -> object:
    """Replay that run."""
    return _walked(Replay(path))


def _walked(nao: NaoBody) -> tuple[object, ...]:
    action = nao.walk(0.1, 0.0, 0.0)
    seen: list[object] = []
    for _ in range(3):
        nao.wait(0.5)
        seen += [nao.now(), nao.read(), action.poll()]
    nao.close()
    return tuple(seen)


def hashed_lesson(folder: Path) -> Path:
    """The file of a lesson: what `recalled` recalls."""
    Memory(folder / "lessons").recall("numbers", b"", tuple[float, ...], lambda: (0.5, 1.5, 2.5))
    (path,) = (folder / "lessons").glob("*.json")
    return path


def recalled(path: Path, place: Path) -> object:
    """The lesson in this file, or learnt anew. Raises AssertionError for what is no lesson."""
    place.write_bytes(path.read_bytes())
    memory = Memory(place.parent)
    lesson = memory.recall("numbers", b"", tuple[float, ...], lambda: (0.5, 1.5, 2.5))
    assert isinstance(lesson, tuple)
    assert all(isinstance(number, float) for number in lesson)
    return lesson


def good_files_are_read(folder: Path) -> Iterator[str]:
    """The kinds whose good file is not read: none."""
    for kind in all_kinds(folder):
        path = folder / f"whole.{kind.name}"
        path.write_bytes(kind.good)
        kind.read(path)
        if kind.parse is not None and kind.write is not None:
            path.write_bytes(kind.write(kind.parse(kind.good)))
            kind.read(path)
        yield kind.name


def _record_tree(content: bytes) -> Any:
    tree = json.loads(content)
    del tree["checksum"]
    return tree


def _record_bytes(tree: Any) -> bytes:
    """With a checksum that fits, which JSON as it is written here may not even be."""
    try:
        tree = {**tree, "checksum": checksum(tree)}
        return laid_out(tree).encode()
    except ValueError:
        return json.dumps(tree).encode()


def _log_tree(content: bytes) -> Any:
    return [json.loads(line) for line in content.splitlines()]


def _log_bytes(tree: Any) -> bytes:
    return b"".join(json.dumps(line).encode() + b"\n" for line in tree)


def _toml_tree(content: bytes) -> Any:
    return tomllib.loads(content.decode())


def _toml_bytes(tree: Any) -> bytes:
    return "".join(f"{json.dumps(key)} = {_toml(value)}\n" for key, value in tree.items()).encode()


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, float):
        return {"inf": "inf", "-inf": "-inf"}.get(repr(value), repr(value))
    return '""' if value is None else json.dumps(value)


def _line(words: Any, apart: str) -> str:
    return apart.join(map(str, words)) if isinstance(words, list) else str(words)
