"""A NAO, or its simulator in another process, driven over NAOqi."""

from __future__ import annotations

import math
import time
from typing import Any

from anytime.clocks import Clock, WallClock, WorkClock
from anytime.errors import AnytimeError
from anytime.machines import Machine
from monitor.robots.nao_body import LinkLostError, Outcome, Pose, Reading
from monitor.robots.nao_clocks import PacedClock
from monitor.robots.nao_odometry import FROZEN, Odometry
from monitor.robots.naoqi_actions import Call, NaoqiAction, Piece, Way
from monitor.robots.naoqi_link import Link, RemoteError
from monitor.robots.naoqi_lockstep import Lockstep
from monitor.robots.naoqi_looks import Look, Looks
from monitor.robots.naoqi_watch import Heart
from planners.nao import POSTURES, STANDING, Body

_FARTHEST = 100.0  # metres or radians that one walk may go
_PROBING = 0.05  # seconds of real time between two looks at a robot that does something
_NEAR = 0.05  # metres of a walk that are not worth a piece of their own
_NAME = "anytime"  # of us, as a subscriber
_STOPPING = ("ALMotion", "ALRobotPosture")
_UPRIGHT = tuple(POSTURES[index] for index in STANDING)


class NaoqiBody:
    """A NAO at a url such as tcp://192.168.1.5:9559. Implements `NaoBody`.

    Against a server in lock-step (`anytime nao-sim --lockstep`) it is to the bit what
    `SimulatedNao` is on the same clock: the scene starts anew when the body is made, and time
    stands still between two calls. Anywhere else time is real. There a walk is told in pieces of
    at most `segment` metres, each when half of the one before is left, so that a robot whose
    master has died stops soon; each piece goes where odometry says that the walk should end.
    After the link was lost, reading makes a new one, and stops the robot before anything else.

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
        self._looks = Looks(self.link, self.odometry)
        self._heart = Heart(self.link)
        self._auto_stand, self._closed = auto_stand, False
        self._action: NaoqiAction | None = None
        self._probe: tuple[float, float, bool, list[Any]] | None = None
        self._look: Look | None = None  # in lock-step: what there is to see until time goes on
        self.link.connect()
        rate = float(self.link.call("SimClock", "rate")) if self.link.has("SimClock") else 1.0
        self._lockstep = Lockstep(self.link, seed) if rate == 0.0 else None
        self._segment = math.inf if self._lockstep else segment
        self.clock = _fitting(clock, rate, url)
        self._greet()

    def now(self) -> float:
        return self.clock.now()

    def wait(self, seconds: float) -> None:
        """Let time pass, and attend to a walk meanwhile. Raises AnytimeError for a bad time."""
        if self._lockstep or self._action is None or not 0 <= seconds < math.inf:
            self.clock.advance(seconds)
            return
        until, pace = self.now() + seconds, getattr(self.clock, "rate", 1.0)
        while (left := until - self.now()) > 0:
            self.clock.advance(min(left, _PROBING * pace))
            self.attend()

    def read(self) -> Reading:
        self._ensure()
        now = self.now()
        look = self._see()
        return Reading(
            time=self._lockstep.time if self._lockstep else now,
            pose_in_world=look.pose,
            posture=look.posture,
            fallen=look.fallen,
            moving=look.moving,
            sonars=look.sonars,
        )

    def walk(self, x: float, y: float, turn: float) -> NaoqiAction:
        try:
            look = self._ready()
            sensible = all(math.isfinite(far) and abs(far) <= _FARTHEST for far in (x, y, turn))
            upright = look.posture in _UPRIGHT
            if not sensible or look.fallen or not (self._auto_stand or upright):
                return NaoqiAction(self, Outcome.REFUSED)
            way, body = Way(look.pose, x, y, turn), self.body
            seconds = max(way.length / body.speed, abs(turn) / body.turn_rate) + body.step_phase
            if not upright:
                seconds += float(body.posture_seconds.max())
            action = self._begin(NaoqiAction(self, way=way), seconds)
            action.calls = _waking(look)
            self._tell_piece(action, way, look.pose)
        except (LinkLostError, RemoteError) as error:
            return self._not_begun(error)
        return action

    def posture(self, name: str) -> NaoqiAction:
        try:
            look = self._ready()
            if name not in POSTURES:
                return NaoqiAction(self, Outcome.REFUSED)
            seconds = float(self.body.posture_seconds.max())
            seconds += look.fallen * self.body.fall_seconds
            action = self._begin(NaoqiAction(self, name=name, rising=look.fallen), seconds)
            action.calls = [*_waking(look), ("ALRobotPosture", "goToPosture", (name, 1.0))]
            self._call_next(action)
        except (LinkLostError, RemoteError) as error:
            return self._not_begun(error)
        return action

    def stop(self) -> None:
        if self._closed:
            return
        self.attend()
        try:
            self._halt()
        except (LinkLostError, RemoteError):
            self._end(Outcome.LINK_LOST)
        self._end(Outcome.CANCELLED)

    def close(self) -> None:
        self.stop()
        self._closed = True
        self._heart.close()
        self.link.close("ALSonar", "unsubscribe", _NAME)

    def attend(self) -> None:
        """Look how the action in execution is getting on. Neither blocks long nor raises."""
        action = self._action
        if action is None:
            return
        try:
            if self._lockstep:
                look = self._see()
                over = self._lockstep.running != action.number
                self._decide(action, look, self.now(), over)
            else:
                self._watch(action)
        except LinkLostError:
            self._end(Outcome.LINK_LOST)
        except RemoteError:
            self._end(Outcome.FAILED)

    def _watch(self, action: NaoqiAction) -> None:
        """In real time: decide by the look that was asked for earlier, and ask for another."""
        if not self.link.connected:
            raise LinkLostError(f"no link to {self.link.url}")
        if self._probe is not None:
            asked, at, over, futures = self._probe
            if not all(map(self.link.ended, futures)):
                if time.perf_counter() - asked > self.link.timeout:
                    self.link.drop()
                    raise LinkLostError(f"{self.link.url} does not answer")
                return
            if time.perf_counter() - asked < _PROBING:
                return
            self._probe = None
            self._decide(action, self._looks.look(futures, at), at, over)
        if self._action is action:  # what is judged when it is over, must be seen after that
            over = self.link.ended(action.future)
            self._probe = time.perf_counter(), self.now(), over, self._looks.ask()

    def _decide(self, action: NaoqiAction, look: Look, at: float, over: bool) -> None:
        """Go on with an action, or end it. over: whether its call has been answered."""
        action.rising = action.rising and look.fallen
        frozen = self.odometry.unseen - action.unseen > FROZEN
        if look.fallen and not action.rising:
            self._end(Outcome.FELL)
        elif at > action.deadline or (frozen and look.moving and action.way):
            self._halt()
            self._end(Outcome.TIMEOUT)
        elif look.moving and action.way and action.piece:  # some answer as soon as they walk
            left = math.hypot(*action.way.rest(look.pose)[:2]) - action.piece.beyond
            if action.piece.beyond > _NEAR and left < self._segment / 2:
                if self.link.ended(action.future) and self.link.value(action.future) is False:
                    self._end(Outcome.FAILED)  # somebody else has stopped it since it was seen
                else:
                    self._tell_piece(action, action.way, look.pose, self.now() - at)
        elif over:
            self._judge(action, self.link.value(action.future), look)

    def _judge(self, action: NaoqiAction, answer: bool | None, look: Look) -> None:
        """Go on with an action whose call is over, or end it. An answer of None may mean both."""
        if answer is False:
            self._end(Outcome.FAILED)
        elif action.calls:
            self._call_next(action)
        elif action.way and (piece := action.piece):
            rest = math.hypot(*action.way.rest(look.pose)[:2])
            trusted = piece.length > 0.1 and piece.jumps == self.odometry.jumps
            if trusted and piece.rest - rest < 0.2 * piece.length:
                self._end(Outcome.FAILED)  # motors without stiffness, for one
            elif action.way.length > self._segment and rest > _NEAR:
                self._tell_piece(action, action.way, look.pose)
            else:
                self._end(Outcome.DONE)
        else:
            taken = answer is True or look.posture == action.name
            self._end(Outcome.DONE if taken else Outcome.FAILED)

    def _tell_piece(self, action: NaoqiAction, way: Way, here: Pose, walked: float = 0.0) -> None:
        """Tell the next piece of a walk; walked: for how long the robot has gone on from here."""
        told = way.x, way.y, way.turn
        rest = length = way.length
        if length > self._segment:
            x, y, turn = way.rest(here)
            rest = math.hypot(x, y)
            left = max(0.0, rest - self.body.speed * walked)
            length = min(left, self._segment)
            share = length / max(rest, _NEAR)
            told = x * share, y * share, turn * share
            rest = left
        action.piece = Piece(length, rest, self.odometry.jumps)
        action.calls.append(("ALMotion", "moveTo", told))
        self._call_next(action)

    def _call_next(self, action: NaoqiAction) -> None:
        """Make the next call of an action."""
        service, method, arguments = action.calls.pop(0)
        action.future = self.link.send(service, method, *arguments)
        action.unseen, self._probe = self.odometry.unseen, None
        if self._lockstep and action.calls:
            self.link.value(action.future)
            self._call_next(action)
        elif self._lockstep:
            action.number, self._look = self._lockstep.command(self.now()), None

    def _begin(self, action: NaoqiAction, seconds: float) -> NaoqiAction:
        """Put an action in the place of the one in execution."""
        before = self._action
        if before is not None and (before.way is None) != (action.way is None):
            self._halt()
        self._end(Outcome.CANCELLED)
        self._heart.start()
        action.deadline = self.now() + 5.0 + 2.0 * seconds
        self._action = action
        return action

    def _not_begun(self, error: AnytimeError) -> NaoqiAction:
        lost = isinstance(error, LinkLostError)
        outcome = Outcome.LINK_LOST if lost else Outcome.FAILED
        self._end(outcome)
        return NaoqiAction(self, outcome)

    def _end(self, outcome: Outcome) -> None:
        action, self._action, self._probe = self._action, None, None
        if action is not None:
            action.outcome = outcome
            self._heart.rest(leave=outcome is not Outcome.LINK_LOST)

    def _ready(self) -> Look:
        """What a command is decided by. Raises LinkLostError."""
        self._ensure()
        self.attend()
        return self._see()

    def _see(self) -> Look:
        """How the robot is now. Raises LinkLostError."""
        if self._lockstep is None:
            return self._looks.look(self._looks.ask(), self.now())
        if self._lockstep.settle(self.now()) or self._look is None:
            self._look = self._looks.look(self._looks.ask(), self.now())
        return self._look

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
            self._halt()
            if self.link.has("ALSonar"):  # else the sonars tell what they once heard
                self.link.call("ALSonar", "subscribe", _NAME)
            if self._lockstep:
                self._lockstep.begin(self.now())
        except RemoteError as error:
            self.link.drop()
            raise LinkLostError(f"{self.link.url} is not a NAO as expected: {error}") from None

    def _halt(self) -> None:
        self.link.values([self.link.send(name, "stopMove") for name in _STOPPING])
        self._look = None


def _waking(look: Look) -> list[Call]:
    """A fall turns the motors off, and without them all is done and nothing happens."""
    return [("ALMotion", "wakeUp", ())] if look.fallen or not look.awake else []


def _fitting(clock: Clock | None, rate: float, url: str) -> Clock:
    """The clock, or one that goes with time at a url. Raises AnytimeError if it does not."""
    if rate == 0.0:
        return clock or WorkClock(Machine("nao"))
    if clock is None:
        return PacedClock(rate)
    pace = clock.rate if isinstance(clock, PacedClock) else 1.0
    if isinstance(clock, WallClock | PacedClock) and pace == rate:
        return clock
    raise AnytimeError(
        f"time at {url} runs by itself, at {rate:g} times its pace; "
        + ("give a wall clock" if rate == 1.0 else "give no clock, or serve with --lockstep")
    )
