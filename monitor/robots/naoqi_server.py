"""A simulated NAO served as NAOqi services over libqi, on 127.0.0.1 alone.

What there is, is listed in docs/nao.md; calling what there is not, fails at the caller.
"""

from __future__ import annotations

import atexit
import math
import os
import sys
import threading
from collections.abc import Callable, Iterable
from typing import Any

from anytime.errors import AnytimeError
from monitor.robots.nao_faults import Fault
from monitor.robots.nao_scenes import Scene
from monitor.robots.naoqi_link import libqi
from monitor.robots.naoqi_names import NO_ECHO, SONARS
from monitor.robots.naoqi_stage import Stage
from planners.nao import POSTURES

_AT_ONCE = 60.0  # seconds that lock-step lives in one call: meanwhile nobody is answered


def _numbers(call: str, *values: Any) -> None:
    """Raises what the caller is told if one is no finite number: anybody may send anything."""
    for value in values:
        number = isinstance(value, float | int) and not isinstance(value, bool)
        if not number or not math.isfinite(value):
            raise RuntimeError(f"{call}: needs finite numbers, not {str(value)[:40]!r}")


class Motion:
    """ALMotion: walking. Metres, radians, in the robot's frame."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def moveTo(self, x: float, y: float, theta: float) -> Any:  # noqa: N802
        _numbers("ALMotion::moveTo", x, y, theta)
        return self._stage.command("walk", lambda body: body.walk(x, y, theta))

    def stopMove(self) -> None:  # noqa: N802
        self._stage.halt("walk")

    def moveIsActive(self) -> bool:  # noqa: N802
        return self._stage.live().moving

    def getRobotPosition(self, use_sensors: bool) -> list[float]:  # noqa: N802
        return list(self._stage.live().pose_in_world)

    def wakeUp(self) -> None:  # noqa: N802
        self._stage.live()
        self._stage.awake = True

    def rest(self) -> Any:
        resting = self._stage.command("posture", lambda body: body.posture("Crouch"))
        self._stage.awake = False
        return resting

    def robotIsWakeUp(self) -> bool:  # noqa: N802
        self._stage.live()
        return self._stage.awake


class Postures:
    """ALRobotPosture: the six postures, at full speed whatever is asked."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def goToPosture(self, name: str, speed: float) -> Any:  # noqa: N802
        return self._stage.command("posture", lambda body: body.posture(name))

    def stopMove(self) -> None:  # noqa: N802
        self._stage.halt("posture")

    def getPosture(self) -> str:  # noqa: N802
        return self._stage.live().posture

    def getPostureList(self) -> list[str]:  # noqa: N802
        return list(POSTURES)


class Subscriber:
    """What `ALMemory.subscriber(key)` returns: connect to its signal."""

    def __init__(self, qi: Any) -> None:
        self.signal = qi.Signal("(m)")


class Memory:
    """ALMemory: the sonars and the events, read or subscribed to."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def getData(self, key: str) -> Any:  # noqa: N802
        (value,) = self.getListData([key])
        if value is None:
            raise RuntimeError(f"ALMemory::getData: no data for the key {key}")
        return value

    def getListData(self, keys: list[str]) -> list[Any]:  # noqa: N802
        if not isinstance(keys, list) or not all(isinstance(key, str) for key in keys):
            raise RuntimeError(f"ALMemory::getListData: needs names, not {str(keys)[:40]!r}")
        told = self._stage.live().sonars if self._stage.listened else (0.0, 0.0)
        heard = [NO_ECHO if each == math.inf else each for each in told]
        now = self._stage.memory | dict(zip(SONARS, heard, strict=True))
        return [now.get(key) for key in keys]

    def getDataListName(self) -> list[str]:  # noqa: N802
        return sorted([*self._stage.memory, *SONARS])

    def subscriber(self, key: str) -> Subscriber:
        with self._stage.lock:
            return self._stage.subscribers.setdefault(key, Subscriber(self._stage.qi))


class Listening:
    """ALSonar: until somebody subscribes, the sonars' keys tell nothing."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._names: set[str] = set()

    def subscribe(self, name: str) -> None:
        self._names.add(name)
        self._stage.listened = True

    def unsubscribe(self, name: str) -> None:
        self._names.discard(name)
        self._stage.listened = bool(self._names)


class SimClock:
    """The service that no robot has: the simulation's time, and the truth."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def rate(self) -> float:
        """How fast time runs; 0 is lock-step."""
        return self._stage.rate or 0.0

    def now(self) -> float:
        return self._stage.clock.now()

    def begun(self) -> bool:
        """Whether `begin` was called."""
        return self._stage.begun

    def begin(self, start: float, seed: int | None) -> None:
        """Lock-step: let the scene start anew at a time, of that seed if it is one."""
        if self._stage.rate is not None:
            raise RuntimeError("SimClock.begin: only a server with --lockstep can begin anew")
        _numbers("SimClock.begin", start, *(() if seed is None else (seed,)))
        self._stage.begin(start, seed)
        self._stage.begun = True

    def commands(self) -> int:
        """How many moveTo and goToPosture there were."""
        return self._stage.commands

    def settle(self, now: float, commands: int) -> list[float]:
        """Lock-step: live up to a time, after so many commands; time and number of what runs."""
        if self._stage.rate is not None:
            raise RuntimeError("SimClock.settle: only a server with --lockstep is told the time")
        _numbers("SimClock.settle", now, commands)
        if now - self._stage.clock.now() > _AT_ONCE:
            raise RuntimeError(f"SimClock.settle: at most {_AT_ONCE:g} s at once")
        return list(self._stage.settle(now, commands))

    def truth(self) -> list[float]:
        """Where the robot really is: x, y, heading; falls and contacts so far."""
        with self._stage.lock:
            robot = self._stage.simulated
            return [*robot.true_pose_in_world, float(robot.falls), float(robot.world.contacts)]


class Watching:
    """The service that a robot needs for a halt within a second: see `naoqi_watch.Watch`."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def beat(self, echo: float) -> float:
        _numbers("Watch.beat", echo)
        with self._stage.lock:
            return self._stage.watch.beat(echo)

    def leave(self, echo: float) -> None:
        _numbers("Watch.leave", echo)
        with self._stage.lock:
            if not self._stage.running():  # who lost the link believes that all is over
                self._stage.watch.leave(echo)

    def heard(self) -> float:
        """When somebody was last surely alive, on the server's `time.perf_counter`."""
        return self._stage.watch.heard


def serve(
    scene: Scene,
    *,
    port: int = 0,
    rate: float | None = 1.0,
    faults: Iterable[Fault] = (),
    ready: Callable[[str], None],
    done: threading.Event,
) -> None:
    """Serve a scene until `done` is set; `ready` is called with the url.

    rate: how fast time runs; None is lock-step: it stands until `SimClock.settle` tells it.
    Raises AnytimeError without libqi, or if the port is taken.
    """
    qi = libqi()
    stage = Stage(scene, faults, rate)
    session = qi.Session()
    try:
        session.listenStandalone(f"tcp://127.0.0.1:{port}")
    except RuntimeError:
        raise AnytimeError(
            f"nobody can be served at port {port} of 127.0.0.1; give one that is free, or 0"
        ) from None
    kinds = {"ALMotion": Motion, "ALRobotPosture": Postures, "ALMemory": Memory}
    kinds |= {"ALSonar": Listening, "SimClock": SimClock}
    if rate is not None:  # in lock-step nothing moves when nobody is heard
        kinds["Watch"] = Watching
    for name, kind in kinds.items():
        session.registerService(name, kind(stage))
    try:
        ready(session.endpoints()[0])
        period = None if rate is None else max(0.001, 0.02 / rate)
        while not done.wait(period):
            stage.tick()
    finally:
        stage.close()
        session.close()


def end_without_teardown(code: int) -> None:
    """Let this process end as usual, but with the interpreter as it is.

    A thread of libqi that lets go of a service while Python is torn down would abort the process.
    """

    def end() -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

    atexit.register(end)


def until_stdin_closes() -> threading.Event:
    """An event that is set when whoever started this process is gone."""
    done = threading.Event()

    def watch() -> None:
        # os.read and not sys.stdin: a thread that waits in that would hold its lock at exit
        while os.read(0, 4096):
            pass
        done.set()

    threading.Thread(target=watch, daemon=True).start()
    return done
