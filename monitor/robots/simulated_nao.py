"""A NAO that walks, errs, listens and falls on a simulated floor; its time is that of a clock."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import NamedTuple

import numpy as np

from anytime.clocks import Clock, WorkClock
from anytime.machines import Machine
from anytime.running import seed_of
from monitor.robots.nao_body import LYING, UNKNOWN, LinkLostError, Outcome, Pose, Reading
from monitor.robots.nao_noise import Disturbance
from monitor.robots.nao_scenes import Scene
from monitor.robots.nao_world import Vector, World
from planners.nao import CROUCH, POSTURES, STAND, STANDING, Body
from sensing import sonar

_YIELDING = 0.01  # metres: the blocked way over which the chance to stay upright falls by e
_FARTHEST = 100.0  # metres or radians that one walk may go


class _Motion(NamedTuple):
    """What the legs do in one tick, in the robot's frame, and how far rising turns it."""

    ahead: float = 0.0
    aside: float = 0.0
    turn: float = 0.0
    drift: float = 0.0
    hidden: float = 0.0  # the part of the drift that odometry does not notice


_STILL = _Motion()
_Motions = Generator[_Motion, None, Outcome]


class SimulatedAction:
    """A command to a simulated NAO."""

    def __init__(self, nao: SimulatedNao, outcome: Outcome | None = None) -> None:
        self._nao = nao
        self.outcome = outcome

    def poll(self) -> Outcome | None:
        self._nao.settle()
        return self.outcome

    def cancel(self) -> None:
        self._nao.settle()
        if self.outcome is None:
            self._nao.end(Outcome.CANCELLED)


class SimulatedNao:
    """A NAO on the floor of a scene. Implements `NaoBody`.

    It is where the clock says: the ticks up to now are lived through when it is asked or told
    something. tick: seconds of one. Every source of noise draws from a stream of its own, and
    reading draws nothing, so that equal commands at equal ticks give equal bytes.
    """

    def __init__(
        self,
        scene: Scene,
        clock: Clock | None = None,
        *,
        body: Body | None = None,
        tick: float = 0.02,
    ) -> None:
        self.scene = scene
        self.clock: Clock = clock or WorkClock(Machine("nao"))
        self.body = body or Body()
        self.falls = 0
        self._tick = tick
        self._origin = self.clock.now()
        self._ticks = 0
        x, y, self._heading = scene.start_in_world
        self._odometry = scene.start_in_world
        self._world = World(scene.obstacles, (x, y), self.body.radius, tick)
        self._random = {
            name: np.random.default_rng(seed_of("nao", scene.seed, name))
            for name in ("execution", "odometry", "drift", "hidden", "sonar", "falls", "rising")
        }
        noise = scene.noise
        self._execution = Disturbance(noise.execution, self._random["execution"])
        self._reporting = Disturbance(noise.odometry, self._random["odometry"])
        self._share = np.eye(len(POSTURES))[POSTURES.index(scene.posture)]  # of each posture
        self._fallen = self._walking = self._closed = False
        self._risk, self._limit = 0.0, self._stability()
        self._coming = _STILL  # what the world moves in the next tick: it answers one tick late
        self._way = self._turned = 0.0  # of that, as it was told
        self._motions: _Motions | None = None
        self._action: SimulatedAction | None = None
        self._every = max(1, round(sonar.PERIOD / tick))  # ticks between samples of the sonars
        self._heard = self._listen()

    def now(self) -> float:
        return self.clock.now()

    def wait(self, seconds: float) -> None:
        """Let time pass. Raises AnytimeError for a negative or non-finite time."""
        self.clock.advance(seconds)
        self.settle()

    def read(self) -> Reading:
        self.settle()
        if self._closed:
            raise LinkLostError("the body is closed; there is nothing to read")
        x, y, heading = self._odometry
        return Reading(
            time=self._origin + self._ticks * self._tick,
            pose_in_world=(x, y, math.remainder(heading, math.tau)),
            posture=self._posture(),
            fallen=self._fallen,
            moving=self._walking,
            sonars=self._heard,
        )

    def walk(self, x: float, y: float, turn: float) -> SimulatedAction:
        self.settle()
        sensible = all(math.isfinite(far) and abs(far) <= _FARTHEST for far in (x, y, turn))
        able = not self._fallen and (self.scene.auto_stand or self._posture() in _UPRIGHT)
        return self._begin(self._go(x, y, turn), sensible and able)

    def posture(self, name: str) -> SimulatedAction:
        self.settle()
        target = POSTURES.index(name) if name in POSTURES else STAND
        return self._begin(self._take(target), name in POSTURES)

    def stop(self) -> None:
        self.settle()
        self.end(Outcome.CANCELLED)

    def close(self) -> None:
        self.stop()
        self._closed = True

    @property
    def true_pose_in_world(self) -> Pose:
        """Where the robot really is: for scoring and pictures, never for the robot."""
        self.settle()
        return (*self._world.place, math.remainder(self._heading, math.tau))

    @property
    def goal_in_world(self) -> Vector:
        """Where the goal is now."""
        self.settle()
        return self.scene.goal.place(self._ticks * self._tick)

    @property
    def world(self) -> World:
        """What is around the robot now: for scoring and pictures, never for the robot."""
        self.settle()
        return self._world

    def settle(self) -> None:
        """Live through the ticks up to now."""
        # the margin takes up the rounding of times that were added up
        due = math.floor((self.clock.now() - self._origin) / self._tick + 1e-6)
        while self._ticks < due:
            self._live()

    def end(self, outcome: Outcome) -> None:
        """End the action in execution, if there is one."""
        action, self._action, self._motions = self._action, None, None
        self._walking = False
        if action is not None:
            action.outcome = outcome

    def _begin(self, motions: _Motions, accepted: bool) -> SimulatedAction:
        if self._closed:
            return SimulatedAction(self, Outcome.LINK_LOST)
        if not accepted:
            return SimulatedAction(self, Outcome.REFUSED)
        self.end(Outcome.CANCELLED)
        self._action, self._motions = SimulatedAction(self), motions
        return self._action

    def _live(self) -> None:
        """Live through one tick."""
        self._ticks += 1
        motion = self._move()
        way, turned = math.hypot(motion.ahead, motion.aside), abs(motion.turn)
        ahead, aside, turn = self._execution.disturb(*motion[:3], way, turned)
        moved, told = self._coming, (self._way, self._turned)
        before, facing = self._world.place, self._heading
        self._heading += moved.turn
        middle = self._heading + turn / 2
        wish = _rotated((ahead / self._tick, aside / self._tick), middle)
        intent = _rotated((motion.ahead / self._tick, motion.aside / self._tick), middle)
        blocked = self._world.step(self._ticks * self._tick, wish, intent)
        after = self._world.place
        covered = (after[0] - before[0], after[1] - before[1])
        self._report(_rotated(covered, -(facing + moved.turn / 2)), moved, told)
        drift = motion.drift + motion.hidden
        self._coming = _Motion(ahead, aside, turn + drift, motion.drift, motion.hidden)
        self._way, self._turned = way, turned
        self._stumble(blocked, way)
        if self._ticks % self._every == 0:
            self._heard = self._listen()

    def _move(self) -> _Motion:
        """The next tick of the action in execution, which ends when it has no more."""
        if self._motions is None:
            return _STILL
        try:
            return next(self._motions)
        except StopIteration as last:
            self.end(last.value)
            return _STILL

    def _report(self, covered: Vector, moved: _Motion, told: tuple[float, float]) -> None:
        """Odometry: what it makes of the way covered in one tick, in the robot's frame."""
        felt = moved.turn - moved.hidden
        ahead, aside, turn = self._reporting.disturb(*covered, felt, *told)
        x, y, heading = self._odometry
        right, up = _rotated((ahead, aside), heading + turn / 2)
        self._odometry = (x + right, y + up, heading + turn)

    def _stumble(self, blocked: float, way: float) -> None:
        """Fall, if it pushed long enough against something, or by bad luck."""
        if self._fallen or self._share[list(STANDING)].sum() < 0.5:
            return
        self._risk += blocked / _YIELDING + self.scene.noise.falls * way
        if self._risk >= self._limit:
            self.falls += 1
            self._fallen = True
            self._risk, self._limit = 0.0, self._stability()
            self._world.turn_back()
            self.end(Outcome.FELL)

    def _stability(self) -> float:
        """The risk that it takes until the next fall: so falls come at a rate, whatever the tick"""
        return float(self._random["falls"].exponential()) if self.scene.noise.falls > 0 else 1.0

    def _listen(self) -> tuple[float, float]:
        pose = (*self._world.place, self._heading)
        sonars, noise = self.scene.sonars, self.scene.noise
        distances = sonars.distances(pose, self._world.surroundings())
        return sonars.hear(distances, self._random["sonar"] if noise.sonar else None)

    def _posture(self) -> str:
        if self._fallen:
            return LYING
        best = int(self._share.argmax())
        return POSTURES[best] if self._share[best] > 1 - 1e-9 else UNKNOWN

    def _go(self, x: float, y: float, turn: float) -> _Motions:
        """Walk on a straight line, after half of the step phase and before the other half.

        Who is walking already, goes on without the first.
        """
        if x == y == turn == 0.0:
            return Outcome.DONE
        if self._posture() not in _UPRIGHT:
            yield from self._take(STAND)
        self._walking = True
        body, phase = self.body, self.body.step_phase / 2
        starts = 0.0 if self._way or self._turned else phase
        seconds = max(math.hypot(x, y) / body.speed, abs(turn) / body.turn_rate)
        done, ticks = 0.0, self._ticks_of(starts + seconds + phase)
        for count in range(1, ticks + 1):
            passed = (count * self._tick - starts) / seconds
            share = min(max(passed, 0.0), 1.0)
            if x > 0 and min(self._heard) <= self.scene.secure:
                return Outcome.FAILED
            # the line is straight in the frame where the walk began, while the robot turns
            ahead, aside = _rotated((x, y), -turn * (done + share) / 2)
            part, done = share - done, share
            yield _Motion(ahead * part, aside * part, turn * part)
        return Outcome.DONE

    def _take(self, target: int) -> _Motions:
        """Take a posture: evenly from that mixture of postures in which the body is now."""
        if self._fallen:
            for _ in range(self._ticks_of(self.body.fall_seconds)):
                yield _STILL
            if self._random["rising"].random() >= self.scene.noise.get_up:
                return Outcome.FAILED
            self._fallen = False
            self._share = np.eye(len(POSTURES))[CROUCH]
        begin, end = self._share, np.eye(len(POSTURES))[target]
        ticks = self._ticks_of(float(begin @ self.body.posture_seconds[:, target]))
        drift, hidden = self._drift(begin, target)
        for count in range(1, ticks + 1):
            self._share = end if count == ticks else begin + (end - begin) * (count / ticks)
            yield _Motion(drift=drift / ticks, hidden=hidden / ticks)
        return Outcome.DONE

    def _ticks_of(self, seconds: float) -> int:
        return math.ceil(seconds / self._tick - 1e-9)

    def _drift(self, begin: np.ndarray, target: int) -> tuple[float, float]:
        """How far standing up will turn the robot: what odometry notices, and what it does not."""
        noise = self.scene.noise
        seen = float(self._random["drift"].normal(*noise.drift))
        hidden = float(self._random["hidden"].normal(0.0, noise.hidden_drift))
        rising = 1.0 - float(begin[list(STANDING)].sum()) if target in STANDING else 0.0
        return seen * rising, hidden * rising


_UPRIGHT = tuple(POSTURES[index] for index in STANDING)


def _rotated(vector: Vector, angle: float) -> Vector:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]
