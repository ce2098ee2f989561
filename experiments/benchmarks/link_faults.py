"""Links that fail while a robot walks, over libqi on loopback in real time: when it stands.

Whoever watches looks at the robot itself, over a connection of its own, fifty times a second. What
is counted is motion: how long after the last sure sign of life of its commander it was seen.
"""

from __future__ import annotations

import contextlib
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from anytime.errors import AnytimeError
from anytime.running import seed_of
from experiments.benchmarks.nao_rig import FLOOR
from experiments.nao_serving import FaultProxy, ServedNao
from monitor.robots.nao_body import LinkLostError
from monitor.robots.naoqi import NaoqiBody
from monitor.robots.naoqi_link import Link
from monitor.robots.naoqi_watch import LIMIT

LANES = 6  # servers at a time; a trial is mostly waiting
WATCHED = 1.7  # seconds that are looked at after a fault
_WALKING = 5.0  # seconds in which a walk must have begun
_PATIENT = 5.0  # seconds in which a watcher is answered
_TRIES = 5  # at a trial; a busy machine takes long to connect
_LOOK = 0.02  # seconds between two looks
_STILL = 1e-9  # metres or radians that are no motion
_STOOD = 5  # looks without a motion after which a robot stands

KINDS = (
    "silent",  # half-open: nothing comes through, and nobody hangs up
    "silent, then not",  # what was kept arrives late
    "lossy",  # stalls of up to a second, as TCP makes them of lost packets
    "slow",  # everything takes 0.1 to 2 s more
    "reset",
    "garbage",
    "client killed",
    "client stopped",  # SIGSTOP: it lives, and says nothing
    "server killed",
)

TOLD = ("silent", "slow", "reset", "garbage", "server killed")
"""Those of which the client must hear."""

WALKER = """
import sys
from monitor.robots.naoqi import NaoqiBody
nao = NaoqiBody(sys.argv[1])
action = nao.walk(50.0, 0.0, 0.0)
print("WALKS", flush=True)
while action.poll() is None:
    nao.wait(0.1)
"""


@dataclass
class Seen:
    """What was seen of a robot.

    halt: greatest age, in seconds, of the last sign of life when it still moved. after: motions
    once it had stopped because nobody was heard. unwatched: motions while nobody claimed to
    command. told: seconds until the client knew that the link was lost; NaN if it was not.
    """

    kind: str
    moved: bool = False
    halt: float = 0.0
    after: int = 0
    unwatched: int = 0
    told: float = math.nan
    looks: int = 0


class Watcher:
    """Looks at a robot until it is left."""

    def __init__(self, url: str, seen: Seen) -> None:
        self._link, self._seen = Link(url, _PATIENT), seen
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Watcher:
        self._link.connect()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._link.drop()

    def _watch(self) -> None:
        seen, before, still, was_off, stands = self._seen, None, 0, False, False
        with contextlib.suppress(LinkLostError):  # the robot died with its server
            while not self._over.wait(_LOOK):
                now = time.perf_counter()
                send = self._link.send
                place, heard = self._link.values(
                    [send("SimClock", "truth"), send("Watch", "heard")]
                )
                seen.looks += 1
                moves = before is not None and math.dist(place[:3], before) > _STILL
                off, age = math.isnan(heard), now - heard
                before, still = place[:3], 0 if moves else still + 1
                seen.moved |= moves
                if moves and not off:
                    seen.halt = max(seen.halt, age)
                    seen.after += stands and age > LIMIT
                seen.unwatched += moves and off and was_off
                was_off = off
                stands = (stands or still >= _STOOD) and not off and age > LIMIT


@dataclass
class Lane:
    """A server, made anew when it was killed."""

    floor: Path
    _ends: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    _server: ServedNao | None = None

    def server(self) -> ServedNao:
        if self._server is None or self._server.process.poll() is not None:
            self._server = self._ends.enter_context(ServedNao("--scene", str(self.floor)))
        return self._server

    def close(self) -> None:
        self._ends.close()


def trials(count: int, seed: int, lanes: int = LANES) -> Iterator[Seen]:
    """So many random faults of links, the kinds in turn."""
    with TemporaryDirectory() as folder, ThreadPoolExecutor(lanes) as pool:
        floor = Path(folder) / "floor.toml"
        floor.write_text(FLOOR, encoding="utf-8")

        def drive(first: int) -> list[Seen]:
            lane = Lane(floor)
            with contextlib.closing(lane):
                return [trial(lane, number, seed) for number in range(first, count, lanes)]

        for found in pool.map(drive, range(lanes)):
            yield from found


def trial(lane: Lane, number: int, seed: int) -> Seen:
    """One fault, drawn from a number; again where none came to pass, for want of a connection."""
    for _ in range(_TRIES):
        with contextlib.suppress(LinkLostError):
            return _lived(lane.server(), number, seed)
    raise AnytimeError(
        f"fault {number}: a server on loopback could not be reached in {_TRIES} tries"
    )


def _lived(server: ServedNao, number: int, seed: int) -> Seen:
    rng = np.random.default_rng(seed_of("link fault", number, seed))
    seen = Seen(KINDS[number % len(KINDS)])
    with Watcher(server.url, seen):
        if seen.kind.startswith("client"):
            _client_dies(server, seen, rng)
        else:
            _link_fails(server, seen, rng)
    return seen


def _client_dies(server: ServedNao, seen: Seen, rng: np.random.Generator) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", WALKER, server.url], stdout=subprocess.PIPE, text=True
    ) as walker:
        assert walker.stdout is not None
        walker.stdout.readline()
        begun = time.perf_counter()
        while time.perf_counter() < begun + _WALKING and not seen.moved:
            time.sleep(_LOOK)
        time.sleep(rng.uniform(0.0, 0.5))
        stopped = seen.kind == "client stopped"
        walker.send_signal(signal.SIGSTOP if stopped else signal.SIGKILL)
        time.sleep(WATCHED)
        walker.kill()


def _link_fails(server: ServedNao, seen: Seen, rng: np.random.Generator) -> None:
    proxy = FaultProxy(server.port)
    try:
        nao = NaoqiBody(proxy.url)
    except LinkLostError:
        proxy.close()
        raise
    try:
        action = nao.walk(50.0, 0.0, 0.0)
        begun, until = time.perf_counter(), rng.uniform(0.0, 0.5)
        while time.perf_counter() < begun + _WALKING and not seen.moved:
            nao.wait(_LOOK)
        begun = time.perf_counter()
        while time.perf_counter() < begun + until:
            nao.wait(_LOOK)
        breaks = _inject(server, proxy, seen.kind, rng)
        failed = time.perf_counter()
        while (since := time.perf_counter() - failed) < WATCHED:
            breaks = [each for each in breaks if not _due(proxy, each, since)]
            if action.poll() is not None and math.isnan(seen.told):
                seen.told = since
            nao.wait(_LOOK)
    finally:
        proxy.heal()
        proxy.delay, proxy.garbled = 0.0, False
        nao.close()
        proxy.close()


def _inject(
    server: ServedNao, proxy: FaultProxy, kind: str, rng: np.random.Generator
) -> list[tuple[float, bool]]:
    """Let it fail; (seconds from now, whether the link is open from then on)."""
    if kind == "silent":
        proxy.silence()
    elif kind == "silent, then not":
        proxy.silence()
        return [(float(rng.uniform(0.2, 1.4)), True)]
    elif kind == "lossy":
        times = np.cumsum(rng.uniform(0.05, 1.0, 8)).tolist()
        return [(each, bool(index % 2)) for index, each in enumerate(times)]
    elif kind == "slow":
        proxy.delay = float(rng.uniform(0.1, 2.0))
    elif kind == "reset":
        proxy.reset()
    elif kind == "garbage":
        proxy.garbled = True
    else:
        server.kill()
    return []


def _due(proxy: FaultProxy, each: tuple[float, bool], since: float) -> bool:
    at, opens = each
    if since >= at:
        (proxy.heal if opens else proxy.silence)()
    return since >= at
