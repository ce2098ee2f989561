"""The run-time monitor: spends a mission's time frame by frame. [ZR93] §5."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anytime.clocks import Deadline, WallClock
from anytime.collecting import settled
from anytime.errors import AnytimeError
from anytime.programs import makers
from anytime.results import Fault, Result
from compiler import CompiledProgram
from compiler.executing import known_of
from monitor.bodies import Robot, must_be_whole
from monitor.endings import Ending
from monitor.failing import Failures, last_resort, unsound
from monitor.interrupting import Interruption, interruptible
from monitor.missions import Mission
from monitor.policies import Policy
from monitor.reports import CallRecord, Frame, Moment, Report
from monitor.rhythms import Rhythm
from monitor.states import Decision, Situation, State, checked, loggable

STILL = 100  # frames in a row in which no time passes, that end a mission …
UNMOVED = 10_000  # … as do so many in which the robot does not move
NO_PLAN = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)  # what one raises
Listener = Callable[[Frame], None]


@dataclass(frozen=True)
class Monitor:
    """Runs missions of a robot with a compiled program and a policy.

    `decide` is pure: the same state, the same decision. `run` is a loop over it, which nothing
    leaves that a module, a robot or the policy raises.
    """

    program: CompiledProgram
    policy: Policy
    name: str = "expected"
    rhythm: Rhythm | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.program, CompiledProgram):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(f"the program is a {type(self.program).__name__}, not compiled")
        if not callable(self.policy):
            raise AnytimeError(f"the policy is {self.policy!r}; give a function of a State")

    def decide(self, state: State) -> Decision:
        """The decision in a state."""
        return self.policy(state)

    def promise(self, robot: Robot) -> float:
        """The net value to expect of a mission that is presented now."""
        state = State("frame", 0.0, robot.situation(), standing=True)
        return self.decide(state).why.net

    def run(
        self, mission: Mission, robot: Robot, *, seed: int = 0, listen: Listener | None = None
    ) -> Report:
        """Live a mission to one of the endings of the closed set.

        seed: of everything random in the modules, >= 0. listen: called with each frame when it is
        over. Raises AnytimeError for what is no mission, robot or seed, before anything moves.
        """
        if not isinstance(mission, Mission):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise AnytimeError(f"the mission is a {type(mission).__name__}; give a Mission")
        must_be_whole(robot)
        if not isinstance(seed, numbers.Integral) or seed < 0:
            raise AnytimeError(f"seed is {seed!r}; it must be a whole number >= 0")
        with interruptible() as told, settled(isinstance(robot.clock, WallClock)):
            life = _Life(self, mission, robot, seed, listen, told)
            fault = ""
            try:
                ending = life.live()
            except KeyboardInterrupt:
                ending = Ending.ABORTED
            except ConnectionError as error:
                ending, fault = Ending.LINK_LOST, str(Fault.of(error))
            except (Exception, SystemExit, GeneratorExit) as error:
                ending, fault = Ending.INTERNAL, str(Fault.of(error))
            finally:  # whatever else leaves it
                life.stop()
            return life.report(ending, fault)


class _Life:
    """A mission in progress."""

    def __init__(
        self,
        monitor: Monitor,
        mission: Mission,
        robot: Robot,
        seed: int,
        listen: Listener | None,
        told: Interruption,
    ) -> None:
        self.monitor, self.mission, self.robot, self.seed = monitor, mission, robot, seed
        self.listen, self.told = listen, told
        self.failures = Failures()
        self.still = self.unmoved = 0
        self.frames: list[Frame] = []
        self.presented = robot.clock.now()
        self.promised = float("nan")
        self.job = self.driven_before = 0.0
        self.route = self.walked = self.walked_on = 0.0
        self.inputs: Mapping[str, Any] = {}

    def live(self) -> Ending:
        plan: Any = None
        made_on = 0.0
        self.driven_before = self.robot.driven()
        while True:
            if self.told:
                return Ending.ABORTED
            standing = not self.set_out(plan)
            situation = checked(self.robot.situation())
            if situation.ending is Ending.REACHED:
                self.robot.work(self.mission.job)
                self.job = self.mission.job
                return Ending.REACHED if self.time() <= self.deadline() else Ending.DEADLINE
            if situation.ending is not None:
                return situation.ending
            if self.time() >= self.deadline():
                return Ending.DEADLINE
            if standing and self.failures.no_plan_in_sight:
                return Ending.MODULES_FAILED
            before, driven = self.time(), self.robot.driven()
            plan, made_on, had_result = self.frame(standing, situation, made_on)
            self.failures.fruitless = 0 if had_result else self.failures.fruitless + 1
            self.still = 0 if self.time() > before else self.still + 1
            self.unmoved = 0 if self.robot.driven() > driven else self.unmoved + 1
            if self.still >= STILL or self.unmoved >= UNMOVED:
                return Ending.BLOCKED

    def set_out(self, plan: Any) -> bool:
        """Begin to execute a plan, or to go without one when none is in sight; whether it moves."""
        speed = self.mission.speeds[0]
        if plan is not None:
            try:
                self.robot.begin(plan, speed)
            except NO_PLAN as error:
                self.failures.refuse(str(Fault.of(error)))
            else:
                self.failures.refused = 0
                return True
        avoid = getattr(self.robot, "avoid", None)  # see `monitor.bodies.Reactive`
        if not self.failures.no_plan_in_sight or avoid is None:
            return False
        avoid(speed)
        self.failures.refused = 0
        return True

    def decide(self, state: State) -> Decision:
        """The policy's decision; the one before, or the last resort, when it has none."""
        try:
            decision = self.monitor.decide(state)
            reason = unsound(decision, self.monitor.program.labels)
            if not reason:
                return decision
        except Exception as error:
            reason = str(Fault.of(error))
        self.failures.note(f"the policy {self.monitor.name} failed: {reason}")
        before = state.contract or (self.frames[-1].decision if self.frames else None)
        return before or last_resort(self.monitor.program, self.mission)

    def deadline(self) -> float:
        """The time from which on the task is worth nothing, as far as it is known now."""
        return self.mission.known(self.time()).value.deadline

    def time(self) -> float:
        """Seconds since the task was presented."""
        return self.robot.clock.now() - self.presented

    def frame(
        self, standing: bool, situation: Situation, made_on: float
    ) -> tuple[Any, float, bool]:
        """Execute the plan in hand and make the next; returns it (None if it is of no use), the
        seconds of sensing behind it, and whether the modules had a result."""
        started, energy, driven = self.time(), situation.energy, self.robot.driven()
        if not self.frames:
            self.route = situation.to_go
        state = State(
            "frame",
            started,
            situation,
            standing,
            made_on,
            frame_started=started,
            route=self.route,
            walked=self.walked,
            walked_on=self.walked_on,
            frame=len(self.frames),
        )
        decision = self.decide(state)
        if not self.frames:
            self.promised = decision.why.net if decision.why.curve else float("nan")
        moments = [Moment(started, "frame", decision)]
        self.robot.change_speed(decision.speed)
        last_frame = not standing and (situation.to_go <= 0 or self.failures.quarantined)
        results: dict[str, Result] = {}
        records: list[CallRecord] = []
        if not last_frame:
            self.think(state, decision, moments, results, records)
        self.robot.complete()
        after = checked(self.robot.situation())
        interrupted = after.interrupted and not standing
        output = self.monitor.program.program.output
        known = known_of(output, results, self.inputs) if results else None
        plan = known.value if known else None
        self.frames.append(
            Frame(
                index=len(self.frames),
                started=started,
                ended=self.time(),
                standing=standing,
                moments=tuple(moments),
                calls=tuple(records),
                driven=self.robot.driven() - driven,
                energy=after.energy - energy,
                interrupted=interrupted,
                story=loggable(self.robot.story()),
                situation=situation,
                made_on=made_on,
            )
        )
        length = float(self.frames[-1].story.get("length", 0.0))
        if length > 0:
            self.walked += length
            self.walked_on += (made_on - self.walked_on) * length / self.walked
        self.tell()
        if plan is not None:
            try:
                self.robot.learn(plan)
            except NO_PLAN as error:
                self.failures.blame(self.monitor.program.program.output.label, str(Fault.of(error)))
                plan = None
        sensed = results.get(self.monitor.program.labels[0])
        usable = None if interrupted else plan
        had_result = last_frame or interrupted or plan is not None
        return usable, sensed.elapsed if sensed else 0.0, had_result

    def tell(self) -> None:
        """Tell the listener of the frame that is over; one that fails is told no more."""
        if self.listen is None:
            return
        try:
            story = {**self.frames[-1].story, **self.robot.picture()}
            self.listen(replace(self.frames[-1], story=story))
        except Exception as error:
            self.listen = None
            self.failures.note(f"who listened failed: {Fault.of(error)}")

    def think(
        self,
        state: State,
        decision: Decision,
        moments: list[Moment],
        results: dict[str, Result],
        records: list[CallRecord],
    ) -> None:
        """Run the program for its contract, deciding again after each call."""
        try:
            self.think_freely(state, decision, moments, results, records)
        except KeyboardInterrupt:  # of the user, or of a module that has no right to it
            if self.told or not self.told.hears:
                raise
            self.failures.blame(self.at_work(results), "KeyboardInterrupt")

    def at_work(self, results: Mapping[str, Result]) -> str:
        """The call that has no result yet."""
        labels = self.monitor.program.labels
        return next((label for label in labels if label not in results), labels[-1])

    def think_freely(
        self,
        state: State,
        decision: Decision,
        moments: list[Moment],
        results: dict[str, Result],
        records: list[CallRecord],
    ) -> None:
        program, clock = self.monitor.program, self.robot.clock
        deadline = Deadline.after(decision.contract, clock)
        rng = np.random.default_rng([self.seed, len(self.frames)])
        began = self.time()
        try:
            self.inputs = inputs = self.robot.inputs()
        except ConnectionError:
            raise
        except Exception as error:
            self.failures.note(f"the robot senses nothing: {Fault.of(error)}")
            return
        stages = program.stages(
            decision.shares,
            deadline,
            inputs,
            rng=rng,
            interrupted=lambda: (
                bool(self.told) or (not state.standing and self.robot.situation().interrupted)
            ),
        )
        for label, result in stages:
            results[label] = result
            self.failures.count(label, result)
            estimate = result.history[-1].estimate if result.history else None
            advertised = self.advertised(label, results)
            records.append(
                CallRecord(
                    label,
                    began,
                    result.elapsed,
                    decision.shares[label],
                    result.overrun,
                    result.status.value,
                    advertised,
                    estimate,
                    str(result.fault) if result.fault else None,
                )
            )
            began = self.time()
            situation = checked(self.robot.situation())
            if state.standing or situation.interrupted:  # nothing to steer
                continue
            now = replace(
                state,
                moment="call",
                time=began,
                situation=situation,
                advertised=advertised,
                seen=estimate,
                contract=moments[-1].decision,
                walked=state.walked + state.situation.in_hand - situation.in_hand,
            )
            again = self.decide(now)
            if again.speed != moments[-1].decision.speed:
                self.robot.change_speed(again.speed)
                moments.append(Moment(began, "call", again))

    def advertised(self, label: str, results: Mapping[str, Result]) -> float | None:
        """What the rhythm lets expect of the estimate of a plan; None for other calls."""
        plans = [call.label for call in makers(self.monitor.program.program.output)]
        if self.monitor.rhythm is None or label not in plans:
            return None
        return self.monitor.rhythm.advertised(results[self.monitor.program.labels[0]].elapsed)

    def stop(self) -> None:
        """Let the robot stand still; one that cannot even do that is told."""
        try:
            self.robot.stop()
        except (Exception, SystemExit, GeneratorExit) as error:
            self.failures.note(f"the robot could not be stopped: {Fault.of(error)}")

    def report(self, ending: Ending, fault: str) -> Report:
        seconds = self.time()
        energy = sum(frame.energy for frame in self.frames)
        driven = sum(frame.driven for frame in self.frames)
        try:
            energy = checked(self.robot.situation()).energy
            driven = min(seconds, max(0.0, self.robot.driven() - self.driven_before))
        except Exception as error:  # then what is known of the frames that ended
            self.failures.note(str(Fault.of(error)))
        reached = ending is Ending.REACHED
        return Report(
            mission=self.mission.name,
            policy=self.monitor.name,
            seed=self.seed,
            ending=ending,
            promised=self.promised,
            net=self.mission.net(reached, seconds, energy),
            earned=float(self.mission.known(seconds).value(seconds)) if reached else 0.0,
            seconds=seconds,
            energy=energy,
            driven=driven,
            job=self.job,
            frames=tuple(self.frames),
            machine=self.monitor.program.machine,
            fault="; ".join(dict.fromkeys(filter(None, (fault, *self.failures.notes)))),
        )
