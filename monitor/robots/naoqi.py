"""A NAO, or its simulator in another process, driven over NAOqi."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from anytime.clocks import Clock, WallClock, WorkClock
from anytime.errors import AnytimeError
from anytime.machines import Machine
from monitor.robots.nao_body import LYING, UNKNOWN, LinkLostError, Outcome, Pose, Reading
from monitor.robots.nao_clocks import PacedClock
from monitor.robots.nao_odometry import Odometry, compose, inverse
from monitor.robots.naoqi_link import Link, RemoteError
from planners.nao import POSTURES, STANDING, Body

_FALLEN = "robotHasFallen"
_SONARS = tuple(f"Device/SubDeviceList/US/{side}/Sensor/Value" for side in ("Left", "Right"))
_NO_ECHO = 5.0  # metres: NAOqi's word for silence
_FARTHEST = 100.0  # metres or radians that one walk may go
_CHUNK = 5.0  # seconds that a server in lock-step lives at once: it must answer within a time-out
_PROBING = 0.05  # seconds of real time between two looks at a robot that does something
_BLIND = 1.0  # seconds that the last pose stands for a pose that is none
_FROZEN = 3.0  # seconds without a change of the pose after which who walks does not
_UPRIGHT = tuple(POSTURES[index] for index in STANDING)


@dataclass(frozen=True)
class _Look:
    """What the robot answered when it was asked for everything at once."""

    pose: Pose
    posture: str
    fallen: bool
    moving: bool
    sonars: tuple[float, float]


@dataclass(frozen=True)
class _Way:
    """A walk that is told to the robot piece by piece."""

    start: Pose
    x: float
    y: float
    turn: float

    @property
    def length(self) -> float:
        return math.hypot(self.x, self.y)

    def rest(self, here: Pose) -> Pose:
        """What is left of it, in the robot's frame."""
        target = compose(self.start, (self.x, self.y, self.turn))
        x, y, turn = compose(inverse(here), target)
        left = self.turn * min(math.hypot(x, y) / self.length, 1.0) if self.length else self.turn
        return x, y, left + math.remainder(turn - left, math.tau)  # a turn may be more than pi


class NaoqiAction:
    """A command to a NAO over NAOqi."""

    def __init__(self, body: NaoqiBody, outcome: Outcome | None = None) -> None:
        self._body = body
        self.outcome = outcome
        self.kind = ""
        self.number = 0  # of the command, as the server counts them
        self.rising = False  # it began on the floor
        self.deadline = math.inf
        self.name = ""  # of a posture
        self.way: _Way | None = None
        self.jumps = 0  # of the odometry when it began
        self.begun = 0.0
        self.futures: list[Any] = []  # of the calls; the last one is in execution

    def poll(self) -> Outcome | None:
        self._body.attend()
        return self.outcome

    def cancel(self) -> None:
        self._body.attend()
        if self.outcome is None:
            self._body.stop()


class NaoqiBody:
    """A NAO at a url such as tcp://192.168.1.5:9559. Implements `NaoBody`.

    Against a server in lock-step (`anytime nao-sim --lockstep`) it is to the bit what
    `SimulatedNao` is on the same clock: the scene starts anew when the body is made, and time
    stands still between two calls. Anywhere else time is real. There a walk is told in pieces of
    at most `segment` metres, each when half of the one before is left, so that a robot whose
    master has died stops soon; each piece goes where odometry says that the walk should end.

    clock: what tells the time; by default the one that fits the server. seed: of the scene, for a
    server in lock-step. auto_stand: walk from low postures too; the robot stands up first.
    timeout: seconds of real time after which a robot that does not answer is lost. user: for newer
    robots; the password comes from the environment, see `naoqi_link.password`.
    Raises LinkLostError if there is no NAO, AnytimeError without libqi or with a clock that does
    not fit.
    """

    def __init__(
        self,
        url: str,
        clock: Clock | None = None,
        *,
        seed: int | None = None,
        auto_stand: bool = False,
        segment: float = 0.3,
        timeout: float = 0.5,
        user: str = "nao",
        body: Body | None = None,
    ) -> None:
        if not segment > 0.0:
            raise AnytimeError(f"segment is {segment} m; it must be > 0")
        self.body = body or Body()
        self.link = Link(url, timeout, user)
        self.odometry = Odometry(self.body.speed, self.body.turn_rate)
        self._seed, self._auto_stand, self._segment = seed, auto_stand, segment
        self._closed = self._asked_clock = False
        self._action: NaoqiAction | None = None
        self._commands = 0
        self._time = 0.0  # of the robot, in lock-step
        self._running = 0  # the number of the command in execution, in lock-step
        self._settled = -math.inf
        self._probe: tuple[float, float, list[Any]] | None = None
        self._answer: bool | None = None
        self._answered = False
        self._good = -math.inf  # when the pose last was one
        self._pose: Pose | None = None
        self.lockstep = False
        self.link.connect()
        rate = self._rate()
        self.lockstep = rate == 0.0
        self.clock: Clock = clock or _clock_for(rate)
        self._check(rate)
        self._greet()

    def now(self) -> float:
        return self.clock.now()

    def wait(self, seconds: float) -> None:
        """Let time pass, and attend to a walk meanwhile. Raises AnytimeError for a bad time."""
        if self.lockstep or self._action is None or not 0 <= seconds < math.inf:
            self.clock.advance(seconds)
            return
        until = self.now() + seconds
        while (left := until - self.now()) > 0:
            self.clock.advance(min(left, _PROBING * self._pace()))
            self.attend()

    def read(self) -> Reading:
        self._ensure()
        now = self.now()
        self._settle()
        look = self._look(self._ask())
        return Reading(
            time=self._time if self.lockstep else now,
            pose_in_world=look.pose,
            posture=look.posture,
            fallen=look.fallen,
            moving=look.moving,
            sonars=look.sonars,
        )

    def walk(self, x: float, y: float, turn: float) -> NaoqiAction:
        try:
            look = self._look_before()
            sensible = all(math.isfinite(far) and abs(far) <= _FARTHEST for far in (x, y, turn))
            able = not look.fallen and (self._auto_stand or look.posture in _UPRIGHT)
            if not (sensible and able):
                return NaoqiAction(self, Outcome.REFUSED)
            action = NaoqiAction(self)
            action.way = _Way(look.pose, x, y, turn)
            seconds = max(action.way.length / self.body.speed, abs(turn) / self.body.turn_rate)
            self._begin(action, "walk", seconds + self.body.step_phase + self._standing(look))
            self._tell_piece(action, look.pose)
        except (LinkLostError, RemoteError) as error:
            return self._not_begun(error)
        return action

    def posture(self, name: str) -> NaoqiAction:
        try:
            look = self._look_before()
            if name not in POSTURES:
                return NaoqiAction(self, Outcome.REFUSED)
            action = NaoqiAction(self)
            action.name, action.rising = name, look.fallen
            seconds = float(self.body.posture_seconds.max())
            self._begin(action, "posture", seconds + look.fallen * self.body.fall_seconds)
            if look.fallen:  # a fall turns the motors off, and without them nothing happens
                self._send(action, "ALMotion", "wakeUp")
                action.futures[0].wait(round(1000 * self.link.timeout))
            if not action.futures or self.link.ended(action.futures[0]):
                self._send(action, "ALRobotPosture", "goToPosture", name, 1.0)
        except (LinkLostError, RemoteError) as error:
            return self._not_begun(error)
        return action

    def stop(self) -> None:
        if self._closed:
            return
        self.attend()
        try:
            self._stop_robot()
        except (LinkLostError, RemoteError):
            self._end(Outcome.LINK_LOST)
        self._end(Outcome.CANCELLED)

    def close(self) -> None:
        self.stop()
        self._closed = True
        if self.link.connected and self.link.has("ALSonar"):
            self._quietly("ALSonar", "unsubscribe", "anytime")
        self.link.drop()

    def attend(self) -> None:
        """Look how the action in execution is getting on. Neither blocks long nor raises."""
        action = self._action
        if action is None:
            return
        try:
            if self.lockstep:
                self._attend_in_lockstep(action)
            else:
                self._attend(action)
        except LinkLostError:
            self._end(Outcome.LINK_LOST)
        except RemoteError:
            self._end(Outcome.FAILED)

    def _attend_in_lockstep(self, action: NaoqiAction) -> None:
        self._settle()
        if action.rising and not self._look(self._ask()).fallen:
            action.rising = False
        if self._running != action.number:
            self._judge(action, self.link.value(action.futures[-1]), self._look(self._ask()))

    def _attend(self, action: NaoqiAction) -> None:
        if not self.link.connected:
            raise LinkLostError(f"no link to {self.link.url}")
        if not self._answered and self.link.ended(action.futures[-1]):
            self._answer = self.link.value(action.futures[-1])
            self._answered, self._probe = True, None  # what is judged is seen after the answer
        if self._probe is None:
            self._probe = time.perf_counter(), self.now(), self._ask()
            return
        sent, at, futures = self._probe
        if not all(map(self.link.ended, futures)):
            if time.perf_counter() - sent > self.link.timeout:
                self.link.value(next(each for each in futures if not self.link.ended(each)), 0.0)
            return
        if time.perf_counter() - sent < _PROBING and not self._answered:
            return
        self._probe = None
        look = self._look(futures)
        action.rising = action.rising and look.fallen
        if look.fallen and not action.rising:
            self._end(Outcome.FELL)
        elif self.now() > action.deadline or self._is_frozen(action, look, at):
            self._stop_robot()
            self._end(Outcome.TIMEOUT)
        elif not self._answered:
            self._go_on(action, look)
        elif action.name and len(action.futures) == 1 and action.rising:  # it woke up
            self._send(action, "ALRobotPosture", "goToPosture", action.name, 1.0)
        elif not look.moving:
            self._judge(action, self._answer, look)

    def _judge(self, action: NaoqiAction, answer: bool | None, look: _Look) -> None:
        """End an action whose call has been answered."""
        if look.fallen and not action.rising:
            self._end(Outcome.FELL)
        elif answer is False:
            self._end(Outcome.FAILED)
        elif action.way is not None:
            way, rest = action.way, action.way.rest(look.pose)
            if not self.lockstep and way.length > self._segment and math.hypot(*rest[:2]) > 0.03:
                self._tell_piece(action, look.pose)  # the piece ended before the next was told
                return
            still = math.dist(look.pose[:2], way.start[:2]) < 0.2 * way.length
            trusted = way.length > 0.1 and action.jumps == self.odometry.jumps
            self._end(Outcome.FAILED if trusted and still else Outcome.DONE)
        else:
            taken = answer is True or look.posture == action.name
            self._end(Outcome.DONE if taken else Outcome.FAILED)

    def _go_on(self, action: NaoqiAction, look: _Look) -> None:
        """Tell the next piece of a walk when half of the one before is left."""
        if action.way is None or action.way.length <= self._segment or not look.moving:
            return
        told = len(action.futures) * self._segment / 2 + self._segment / 2
        left = math.hypot(*action.way.rest(look.pose)[:2])
        if told < action.way.length and left < action.way.length - told + self._segment / 2:
            self._tell_piece(action, look.pose)

    def _tell_piece(self, action: NaoqiAction, here: Pose) -> None:
        assert action.way is not None
        way = action.way
        if self.lockstep or way.length <= self._segment:
            self._send(action, "ALMotion", "moveTo", way.x, way.y, way.turn)
            return
        x, y, turn = way.rest(here)
        share = min(1.0, self._segment / max(math.hypot(x, y), 1e-9))
        self._send(action, "ALMotion", "moveTo", x * share, y * share, turn * share)

    def _send(self, action: NaoqiAction, service: str, method: str, *arguments: Any) -> None:
        """Send a command of an action, which is in execution from now on."""
        action.futures.append(self.link.send(service, method, *arguments))
        self._answered, self._probe = False, None
        if method != "wakeUp":
            self._commands += 1
            action.number = self._commands
            self._settle(again=True)

    def _begin(self, action: NaoqiAction, kind: str, seconds: float) -> None:
        """Put an action in the place of the one in execution."""
        before = self._action
        if before is not None and before.kind != kind:
            self._stop_robot()
        self._end(Outcome.CANCELLED)
        action.kind, action.begun, action.jumps = kind, self.now(), self.odometry.jumps
        action.deadline = action.begun + 5.0 + 2.0 * seconds
        self._action = action

    def _end(self, outcome: Outcome) -> None:
        action, self._action, self._probe = self._action, None, None
        if action is not None:
            action.outcome = outcome

    def _not_begun(self, error: AnytimeError) -> NaoqiAction:
        lost = isinstance(error, LinkLostError)
        outcome = Outcome.LINK_LOST if lost else Outcome.FAILED
        self._end(outcome)
        return NaoqiAction(self, outcome)

    def _look_before(self) -> _Look:
        """What a command is decided by. Raises LinkLostError."""
        self._ensure()
        self.attend()
        self._settle()
        return self._look(self._ask())

    def _standing(self, look: _Look) -> float:
        return 0.0 if look.posture in _UPRIGHT else float(self.body.posture_seconds.max())

    def _is_frozen(self, action: NaoqiAction, look: _Look, at: float) -> bool:
        since = max(self.odometry.changed, action.begun)
        return action.way is not None and look.moving and at - since > _FROZEN

    def _ask(self) -> list[Any]:
        """Ask for everything at once: one after the other would take as many times the way."""
        return [
            self.link.send("ALMotion", "getRobotPosition", True),
            self.link.send("ALMotion", "moveIsActive"),
            self.link.send("ALRobotPosture", "getPosture"),
            self.link.send("ALMemory", "getListData", [_FALLEN, *_SONARS]),
        ]

    def _look(self, futures: Sequence[Any]) -> _Look:
        """What was answered to that. Raises LinkLostError."""
        try:
            told, moving, posture, (fell, left, right) = self.link.values(futures)
        except RemoteError as error:
            raise LinkLostError(f"the robot does not tell how it is: {error}") from None
        except (TypeError, ValueError):
            raise LinkLostError("the robot does not tell how it is: answers are missing") from None
        lies = str(posture).startswith("Lying")
        posture = LYING if lies else posture if posture in POSTURES else UNKNOWN
        # The event may be lost and the posture late. On a robot the key may outlive the fall.
        fallen = lies or (bool(fell) and posture not in POSTURES)
        return _Look(
            self._believed(told), posture, fallen, bool(moving), (_heard(left), _heard(right))
        )

    def _believed(self, told: Sequence[Any]) -> Pose:
        pose = self.odometry.believe(self.now(), told)
        if pose is not None:
            self._pose, self._good = pose, self.now()
        if self._pose is None or self.now() - self._good > _BLIND:
            raise LinkLostError(f"the robot does not tell where it is; it says {told!r}")
        return self._pose

    def _settle(self, again: bool = False) -> None:
        """In lock-step: let the server live up to now."""
        now = self.now()
        if not self.lockstep or self._settled == -math.inf or (now == self._settled and not again):
            return
        while now - self._settled > _CHUNK:
            self._settled += _CHUNK
            self.link.call("SimClock", "settle", self._settled, self._commands)
        told, running = self.link.call("SimClock", "settle", now, self._commands)
        self._settled, self._time, self._running = now, told, int(running)

    def _ensure(self) -> None:
        """Raises LinkLostError unless there is a link, or one can be made anew."""
        if self._closed:
            raise LinkLostError("the body is closed; there is nothing to read")
        if not self.link.connected:
            self._end(Outcome.LINK_LOST)
            self.link.connect()
            self._greet()

    def _greet(self) -> None:
        """Stop a robot that may be in motion; then make ready what a new connection needs."""
        try:
            self._stop_robot()
            if self.link.has("ALSonar"):  # else the sonars tell what they once heard
                self.link.call("ALSonar", "subscribe", "anytime")
            if self.lockstep:
                if self._settled == -math.inf or not self.link.call("SimClock", "begun"):
                    self.link.call("SimClock", "begin", self.now(), self._seed)
                    self._settled = self.now()
                self._commands = self.link.call("SimClock", "commands")
                self._settle(again=True)
        except RemoteError as error:
            self.link.drop()
            raise LinkLostError(f"{self.link.url} is not a NAO as expected: {error}") from None

    def _stop_robot(self) -> None:
        for each in [self.link.send(name, "stopMove") for name in ("ALMotion", "ALRobotPosture")]:
            self.link.value(each)
        self._settle(again=True)

    def _quietly(self, service: str, method: str, *arguments: Any) -> None:
        try:
            self.link.call(service, method, *arguments)
        except (LinkLostError, RemoteError):
            return

    def _rate(self) -> float:
        """How fast the server's time runs; 0 is lock-step; a robot's runs at 1."""
        return float(self.link.call("SimClock", "rate")) if self.link.has("SimClock") else 1.0

    def _pace(self) -> float:
        return self.clock.rate if isinstance(self.clock, PacedClock) else 1.0

    def _check(self, rate: float) -> None:
        if self.lockstep:
            return
        fits = isinstance(self.clock, WallClock | PacedClock) and self._pace() == rate
        if not fits:
            self.link.drop()
            raise AnytimeError(
                f"time at {self.link.url} runs by itself, at {rate:g} times its pace; "
                + ("give a wall clock" if rate == 1.0 else "give no clock, or use --lockstep")
            )


def _clock_for(rate: float) -> Clock:
    return WorkClock(Machine("nao")) if rate == 0.0 else PacedClock(rate)


def _heard(value: Any) -> float:
    """What a sonar told, in metres: inf is no echo, NaN no information."""
    if not isinstance(value, float | int) or not value > 0.0:
        return math.nan
    return math.inf if value >= _NO_ECHO else float(value)
