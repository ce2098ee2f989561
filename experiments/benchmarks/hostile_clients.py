"""Clients that mean no good, at a robot served over libqi on loopback: does it move, and who waits.

Connections that speak nonsense, some of them in well-formed headers and some never to the end, and
calls whose arguments are of a wrong type or no number. Between them a good client connects anew
and reads where the robot is.
"""

from __future__ import annotations

import contextlib
import math
import socket
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from experiments.nao_serving import ServedNao
from monitor.robots.naoqi_link import Link

BETWEEN = 10  # connections, after which the good client comes
HELD = 50  # connections at a time that are left open in mid-sentence
_PATIENT = 5.0  # seconds for which the good client waits
_STILL = 1e-9  # metres or radians that are no motion
_MAGIC = bytes.fromhex("42dead42")
_ROOT = str(Path(__file__).parents[2])

_WORSE: tuple[Any, ...] = (
    *(None, "far", "", "x" * 10_000, [], {}, [1.0], {"x": 1.0}, True, [[[]]], [None]),
    *(math.nan, math.inf, -math.inf, "../../etc/passwd", "\x00"),
)
_FAR = (1e9, -1e9, 1e300, 2**62)
"""Metres and radians that nobody walks; seconds they may be."""
_METHODS = {
    ("ALMotion", "moveTo"): (1.0, 0.0, 0.0),
    ("ALRobotPosture", "goToPosture"): ("Sit", 1.0),
    ("ALMemory", "getData"): ("robotHasFallen",),
    ("ALMemory", "getListData"): (["robotHasFallen"],),
    ("SimClock", "begin"): (5.0, 1),
    ("SimClock", "settle"): (5.0, 0),
    ("Watch", "beat"): (0.0,),
    ("Watch", "leave"): (0.0,),
    ("ALMotion", "fly"): (1.0,),
}
"""What is called, and arguments of the right types."""
_UNREAD = {("ALRobotPosture", "goToPosture"): 1}
"""How many of the arguments count where the others are ignored whatever they are."""


@dataclass(frozen=True)
class Harm:
    """What hostile clients did.

    motions: times that the robot was elsewhere afterwards, moved, or had another posture.
    waits: seconds in which the good client was served, beside them. floors: before there were any.
    taken: calls that made no sense and were not refused. told: errors that told a path of ours.
    """

    connections: int
    calls: int
    motions: int
    waits: list[float]
    floors: list[float]
    taken: list[str]
    told: list[str]
    grown: float


def harmed(server: ServedNao, connections: int, calls: int, seed: int) -> Harm:
    """Connect and call so many times, and look at the robot between."""
    rng = np.random.default_rng(seed)
    floors = [_served(server)[0] for _ in range(20)]
    before, memory = _served(server)[1], _megabytes(server)
    waits: list[float] = []
    motions = 0
    for _ in _nonsense(server.port, connections, rng):
        wait, seen = _served(server)
        motions += _moved(before, seen)
        waits.append(wait)
    taken: list[str] = []
    told: list[str] = []
    link = Link(server.url, _PATIENT)
    link.connect()
    for number in range(calls):
        service, method, arguments = ill_typed(rng)
        called = f"{service}.{method}({', '.join(repr(each)[:20] for each in arguments)})"
        try:
            if link.call(service, method, *arguments) is not False:
                taken.append(called)
        except AnytimeError as error:
            if _ROOT in str(error) or "Traceback" in str(error):
                told.append(f"{called}: {error}")
        if number % BETWEEN == 0:
            wait, seen = _served(server)
            motions += _moved(before, seen)
            waits.append(wait)
    link.drop()
    grown = _megabytes(server) - memory
    return Harm(connections, calls, motions, waits, floors, taken, told, grown)


def _nonsense(port: int, count: int, rng: np.random.Generator) -> Iterator[None]:
    """Connect so many times; after some of them, while others are still open, it is the turn of
    the good client."""
    held: list[socket.socket] = []
    with contextlib.ExitStack() as ends:
        for number in range(count):
            connection = socket.create_connection(("127.0.0.1", port), _PATIENT)
            ends.callback(connection.close)
            with contextlib.suppress(OSError):  # it may hang up before all is said
                connection.sendall(nonsense(rng))
            if rng.random() < 0.25:
                held.append(connection)
            else:
                connection.close()
            if len(held) > HELD:
                held.pop(0).close()
            if number % BETWEEN == 0:
                yield


def nonsense(rng: np.random.Generator) -> bytes:
    """What no client says: noise, a size that never comes, half a word, a message to anybody."""
    noise = rng.bytes(int(rng.integers(1, 200)))
    way = int(rng.integers(5))
    if way == 0:
        return noise
    if way == 1:  # 4 GiB are announced
        return _MAGIC + noise[:4].ljust(4, b"\0") + b"\xff" * 4 + noise
    if way == 2:
        return _MAGIC[: int(rng.integers(4))]
    size = len(noise) if way == 3 else int(rng.integers(2**32))
    kind, flags = (int(each) for each in rng.integers(0, 12, 2))
    service, thing, action = (int(each) for each in rng.integers(0, 120, 3))
    numbers = (int(rng.integers(2**32)), size, 0, kind, flags, service, thing, action)
    return _MAGIC + struct.pack("<IIHBBIII", *numbers) + noise


def ill_typed(rng: np.random.Generator) -> tuple[str, str, tuple[Any, ...]]:
    """A call with an argument, of those that count, that is none, or with too few or too many."""
    service, method = list(_METHODS)[int(rng.integers(len(_METHODS)))]
    arguments = [*_METHODS[service, method]]
    if rng.random() < 0.2:
        few = rng.random() < 0.5
        return service, method, tuple(arguments[:-1] if few else [*arguments, 0.0])
    place = int(rng.integers(_UNREAD.get((service, method), len(arguments))))
    worse = [each for each in _WORSE if not (service == "ALMemory" and _fits(each, method))]
    worse += _FAR if method == "moveTo" else ()
    if (service, method, place) == ("SimClock", "begin", 1):
        worse = [each for each in worse if each is not None]  # no seed is a seed too
    arguments[place] = worse[int(rng.integers(len(worse)))]
    return service, method, tuple(arguments)


def _fits(value: Any, method: str) -> bool:
    """Whether it may be asked for, though there is no data of that name."""
    return value == [] if method == "getListData" else isinstance(value, str)


def _served(server: ServedNao) -> tuple[float, tuple[Any, ...]]:
    """Seconds in which a client that connects anew is answered; where and how the robot is."""
    began = time.perf_counter()
    link = Link(server.url, _PATIENT)
    link.connect()
    truth, moving, posture = link.values(
        [
            link.send("SimClock", "truth"),
            link.send("ALMotion", "moveIsActive"),
            link.send("ALRobotPosture", "getPosture"),
        ]
    )
    seconds = time.perf_counter() - began
    link.drop()
    return seconds, (*truth[:3], moving, posture)


def _moved(before: tuple[Any, ...], after: tuple[Any, ...]) -> bool:
    return before[3:] != after[3:] or math.dist(before[:3], after[:3]) > _STILL


def _megabytes(server: ServedNao) -> float:
    """Resident memory of the server; 0 where the system does not tell."""
    told = Path(f"/proc/{server.process.pid}/status")
    if not told.exists():
        return 0.0
    line = next(line for line in told.read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024
