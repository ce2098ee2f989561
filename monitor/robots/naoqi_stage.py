"""The robot behind NAOqi's services: what it does, and who waits for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from anytime.clocks import Clock
from monitor.robots.nao_body import Action, LinkLostError, NaoBody, Outcome, Reading
from monitor.robots.nao_clocks import PacedClock, ToldClock
from monitor.robots.nao_faults import Fault, Faulty
from monitor.robots.nao_scenes import Scene
from monitor.robots.naoqi_link import libqi
from monitor.robots.naoqi_names import FALLEN
from monitor.robots.naoqi_watch import LIMIT, Watch
from monitor.robots.simulated_nao import SimulatedNao

_POSTURE = "PostureChanged"
_FAILED = "ALMotion/MoveFailed"
_BACK = 0.02  # seconds between two looks whether a lost link is back
_SILENT = 0.2  # seconds that lock-step waits for a command that it was told of


class Stage:
    """One lock, one body, the calls that wait for it, and what it remembers."""

    def __init__(self, scene: Scene, faults: Iterable[Fault] = (), rate: float | None = 1.0):
        self.rate = rate  # None is lock-step
        self.commands = 0  # how many moveTo and goToPosture there were
        self.begun = False
        self.listened = False  # whether somebody subscribed to the sonars
        self.awake, self.closed = True, False
        self.watch = Watch(time.perf_counter)
        self.lock = threading.Condition()
        self.memory: dict[str, Any] = {FALLEN: 0.0, _POSTURE: scene.posture, _FAILED: []}
        self.subscribers: dict[str, Any] = {}
        self.qi = libqi()
        self._scene, self._faults = scene, tuple(faults)
        self._waiting: list[tuple[int, str, Action, Any]] = []
        self.begin(0.0)

    def begin(self, start: float, seed: int | None = None) -> None:
        """Let the scene start anew at a time, of another seed if one is given."""
        with self.lock:
            self.close()
            scene = self._scene if seed is None else replace(self._scene, seed=seed)
            self.clock: Clock = ToldClock(start) if self.rate is None else PacedClock(self.rate)
            self.simulated = SimulatedNao(scene, self.clock)
            self.body: NaoBody = Faulty(self.simulated, self._faults)
            self.awake, self.closed, self.commands = True, False, 0
            self.tick()

    def command(self, kind: str, begin: Callable[[NaoBody], Action]) -> Any:
        """Tell the body something; the future of whether it was done."""
        with self.lock:
            self.live()
            if self.watch.silent:  # it was on its way for too long, like its sender's last beat
                raise RuntimeError(f"nobody was heard for {LIMIT} s; beat Watch first")
            self.commands += 1
            promise = self.qi.Promise()
            if self.awake:
                self._waiting.append((self.commands, kind, begin(self.body), promise))
                self.live()
            else:  # without stiffness nothing moves, and only a posture notices
                promise.setValue(kind == "walk")
            self.lock.notify_all()
            return promise.future()

    def halt(self, kind: str) -> None:
        """Break off what is in execution, if it is of that kind."""
        with self.lock:
            self.live()
            if any(waiting == kind for _, waiting, _, _ in self._waiting):
                self.body.stop()
                self.live()

    def live(self) -> Reading:
        """Live up to now: raise what there is to raise, answer the calls that came to their end.

        Who asks while the link is lost hears nothing before it is back.
        """
        with self.lock:
            while (reading := self.tick()) is None:
                if self.closed:
                    raise RuntimeError("the link is lost, and the simulator ends")
                self.lock.wait(_BACK)
            return reading

    def tick(self) -> Reading | None:
        """The same, without waiting for a link that is lost: then None."""
        with self.lock:
            if self.watch.silent and any(kind == "walk" for _, kind, _, _ in self._waiting):
                self.body.stop()
            try:
                reading = self.body.read()
            except LinkLostError:
                return None
            if reading.fallen and not self.memory[FALLEN]:
                self.awake = False
            self.remember(FALLEN, float(reading.fallen))
            self.remember(_POSTURE, reading.posture)
            for waiting in tuple(self._waiting):
                _, kind, action, promise = waiting
                if promise.isCancelRequested() and action.poll() is None:
                    action.cancel()
                if (outcome := action.poll()) is not None:
                    self._waiting.remove(waiting)
                    if (kind, outcome) == ("walk", Outcome.FAILED):
                        self.remember(
                            _FAILED, ["ALMotion", "obstacle", list(reading.pose_in_world)]
                        )
                    promise.setValue(outcome is Outcome.DONE)
            return reading

    def running(self) -> int:
        """The number of the command in execution, 0 if there is none."""
        return max((number for number, _, _, _ in self._waiting), default=0)

    def settle(self, now: float, commands: int) -> tuple[float, int]:
        """In lock-step: live up to `now`, after so many commands; the robot's time, and `running`.

        Calls of different services may overtake each other, hence the count.
        """
        with self.lock:
            self.lock.wait_for(lambda: self.commands >= commands, _SILENT)
            if isinstance(self.clock, ToldClock):
                self.clock.tell(now)
            return self.live().time, self.running()

    def remember(self, key: str, value: Any) -> None:
        """Keep a value in the memory, and raise its event if it is another than before."""
        if self.memory.get(key) != value:
            self.memory[key] = value
            if key in self.subscribers:
                self.subscribers[key].signal(value)

    def close(self) -> None:
        """Answer all calls that still wait: a promise that is dropped is an error at its caller."""
        with self.lock:
            self.closed = True
            for _, _, _, promise in self._waiting:
                promise.setValue(False)
            self._waiting.clear()
