"""Hostile files for every reader: trees with a wrong node and a right checksum, and raw bytes.

A changed byte hardly ever gets past the checksum or the syntax, so most of the corpus is changed as
a tree and written again as the reader wants it.
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import compiler
from anytime import ProfileLibrary, WorkClock
from anytime.__main__ import main
from anytime.errors import AnytimeError
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
from monitor.robots.nao_drift import Drift, read_drift, write_drift
from monitor.robots.nao_scenes import read_scene
from sensing import read_map

RAW = 0.15  # share of the corpus that is raw bytes
COMMANDS = 0.01  # share of the corpus that the command line reads as well
_WORST: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**30, -0.5, 1.5, 1e300, 1e999, -1e999, 5e-324),
    *("", "x", "../../x", "NaN", "\x00", "é" * 50, "x" * 3000, [], {}, [[]], [None], {"": 0}),
    [0] * 1000,
)


@dataclass(frozen=True)
class Kind:
    """A kind of file: a good one, its reader, and how its trees are taken apart and written."""

    name: str
    good: bytes
    read: Callable[[Path], object]
    parse: Callable[[bytes], Any] | None = None
    write: Callable[[Any], bytes] | None = None
    command: tuple[str, ...] = ()


@dataclass
class Counts:
    """What came of reading the corpus. tree: files that were changed as a tree."""

    count: int = 0
    tree: int = 0
    tracebacks: int = 0
    bad_exit: int = 0
    slowest: float = 0.0
    first: str = ""


def read_all(count: int, seed: int) -> Counts:
    """Read so many malformed files, over all readers in turn."""
    counts = Counts()
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        kinds = list(all_kinds(Path(folder)))
        for number in range(count):
            kind = kinds[number % len(kinds)]
            content, tree = malformed(kind, rng)
            path = Path(folder) / f"hostile.{kind.name}"
            path.write_bytes(content)
            counts.count += 1
            counts.tree += tree
            began = time.perf_counter()
            try:
                kind.read(path)
            except AnytimeError:
                pass
            except Exception as error:
                counts.tracebacks += 1
                counts.first = counts.first or f"{kind.name} {number}: {error!r}"
            counts.slowest = max(counts.slowest, time.perf_counter() - began)
            if kind.command and rng.random() < COMMANDS * len(kinds):
                counts.bad_exit += _exit_code((*kind.command, str(path))) not in (0, 1, 2)
    return counts


def _exit_code(words: tuple[str, ...]) -> int:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            return main(words)
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 1


def malformed(kind: Kind, rng: np.random.Generator) -> tuple[bytes, bool]:
    """A malformed file of a kind, and whether it was changed as a tree."""
    if kind.parse is None or kind.write is None or rng.random() < RAW:
        return _bytes_changed(kind.good, rng), False
    tree = copy.deepcopy(kind.parse(kind.good))
    for _ in range(int(rng.integers(1, 4))):
        tree = _changed(tree, rng)
    try:
        return kind.write(tree), True
    except (TypeError, ValueError, AttributeError):  # no such tree can be written
        return _bytes_changed(kind.good, rng), False


def _bytes_changed(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(len(changed) + 1))
        way = int(rng.integers(4))
        if way == 0:
            del changed[at:]
        elif way == 1:
            changed[at : at + 1] = bytes([int(rng.integers(256))])
        elif way == 2:
            changed[at:at] = changed[: int(rng.integers(64))]
        else:
            del changed[at : at + int(rng.integers(1, 64))]
    return bytes(changed)


def _changed(tree: Any, rng: np.random.Generator) -> Any:
    """The tree with one node changed: replaced, dropped, doubled or swapped with a neighbour."""
    places = list(_places(tree))
    if not places:
        return _WORST[int(rng.integers(len(_WORST)))]
    holder, key = places[int(rng.integers(len(places)))]
    way = int(rng.integers(5))
    if way == 0:
        del holder[key]
    elif way == 1 and isinstance(holder, list):
        holder.insert(key, copy.deepcopy(holder[key]))
    elif way == 1:
        holder[f"{key}_"] = holder[key]
    elif way == 2:
        other, place = places[int(rng.integers(len(places)))]
        with contextlib.suppress(LookupError, TypeError):
            holder[key] = copy.deepcopy(other[place])
    else:
        holder[key] = _WORST[int(rng.integers(len(_WORST)))]
    return tree


def _places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Where a value can be changed: all in small lists, a few in long ones."""
    if isinstance(tree, dict):
        items = list(tree.items())
    elif isinstance(tree, list):
        items = list(enumerate(tree))
    else:
        return
    for key, value in items[:6] + items[6 :: max(1, len(items) // 6)]:
        yield tree, key
        yield from _places(value)


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
    yield toml("mission.toml", data / "missions" / "office.toml", lambda path: _mission(path, data))
    yield toml("scene.toml", data / "scenes" / "appearing.toml", read_scene)
    faults = folder / "faults.toml"
    faults.write_text('seed = 1\n[[fault]]\nwhat = "see"\nkind = "raises"\nfrom = 1.0\nto = 2.0\n')
    yield toml("faults.toml", faults, lambda path: read_schedule(path, kinds_of(program)))
    floor = "type octile\nheight 6\nwidth 7\nmap\n" + ".......\n" * 5 + "..@@..T\n"
    yield Kind("map", floor.encode(), read_map, _lines_tree, _lines_bytes)
    (folder / "office.pgm").write_bytes((data / "office.pgm").read_bytes())
    yield Kind("yaml", (data / "office.yaml").read_bytes(), read_map, _lines_tree, _lines_bytes)


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


def _lines_tree(content: bytes) -> Any:
    return [line.split(" ") for line in content.decode().split("\n")]


def _lines_bytes(tree: Any) -> bytes:
    lines = (" ".join(map(str, line)) if isinstance(line, list) else str(line) for line in tree)
    return "\n".join(lines).encode()


EVENTS = ("exec", "compile", "import", "pickle.find_class", "marshal.loads", "os.system")
"""What Python does when it runs code that it did not run before."""


class Watch:
    """Counts the events of running code, while it is asked to. A hook can never be taken away."""

    def __init__(self) -> None:
        self.on = False
        self.events: list[str] = []
        sys.addaudithook(self._heard)

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.on and (event in EVENTS or event.startswith("subprocess")):
            self.events.append(f"{event} {arguments[:1]!r}"[:80])


def code_run(count: int, seed: int) -> list[str]:
    """The events of running code while a hostile corpus is read, after a good file of each kind."""
    rng = np.random.default_rng(seed)
    watch = Watch()
    with tempfile.TemporaryDirectory() as folder:
        kinds = list(all_kinds(Path(folder)))
        for number in range(count + 20 * len(kinds)):
            kind = kinds[number % len(kinds)]
            path = Path(folder) / f"hostile.{kind.name}"
            first = number < len(kinds)
            path.write_bytes(kind.good if first else malformed(kind, rng)[0])
            watch.on = number >= 20 * len(kinds)  # what is imported late is imported by then
            with contextlib.suppress(Exception):
                kind.read(path)
            watch.on = False
    return watch.events


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
