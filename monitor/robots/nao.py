"""A NAO that executes its plan while the plan is still being improved. [PRP16] §4."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from anytime.clocks import Clock
from monitor.endings import Ending
from monitor.missions import Energy
from monitor.robots.nao_body import LYING, LinkLostError, NaoBody, Outcome, Reading
from monitor.robots.nao_drift import Drift
from monitor.robots.nao_execution import Execution, command, leads
from monitor.robots.nao_hearing import Hearing
from monitor.robots.nao_odometry import FROZEN, Odometry
from monitor.robots.nao_planning import Errand, Planning, new_query
from monitor.robots.nao_scenes import Goal
from monitor.robots.nao_story import Story
from monitor.robots.nao_touched import Touched
from monitor.states import Situation
from planners.nao import POSTURES, STAND, STANDING, Body
from planners.nao_plan import (
    MOST_OBSTACLES,
    Action,
    actions_of,
    made_before,
    plan_world,
)
from planners.query import Solution
from sensing.sonar import Sonars
from sensing.sonar_map import SonarMap, obstacles


@dataclass(frozen=True)
class Manner:
    """How a NAO is careful.

    tolerance: metres from the goal that are near enough. threshold: by how much, in metres, another
    plan must be better to take the place of the one in execution. margin: metres that it keeps from
    what it hears, beside its own radius. falls: after so many it gives up. patience: seconds
    without a plan that would bring it nearer before it says that it is blocked. plans: how many it
    takes up at most.
    """

    tolerance: float = 0.03
    threshold: float = 0.03
    margin: float = 0.05
    falls: int = 3
    patience: float = 8.0
    plans: int | None = None


_DANGER = 0.2  # metres by which a plan is worse that leads into something
_WORTH = 0.01  # metres by which a plan must be better than to do nothing
_TRIES = 3  # walks that odometry does not see, one after the other, before the body is lost

NOTHING = {("more", 0): False}
"""The plan to do nothing."""


class NaoRobot:
    """A NAO with a goal, on a clock: what the monitor runs. Implements `monitor.bodies.Robot`.

    A frame is a time of thinking. The plan goes on meanwhile, and `begin` takes up another one if
    it is better by a threshold, in the newest world, from the current moment on.
    """

    def __init__(
        self,
        body: NaoBody,
        clock: Clock,
        goal: Goal,
        energy: Energy,
        *,
        sonars: Sonars | None = None,
        figures: Body | None = None,
        manner: Manner | None = None,
        planning: Planning | None = None,
        drift: Drift | None = None,
        seed: int = 0,
    ) -> None:
        self.body, self.clock, self.goal = body, clock, goal
        self.figures, self.manner = figures or Body(), manner or Manner()
        self.planning = planning or Planning()
        self.drift = drift or Drift()
        self.falls = 0
        self.plans = 0
        self.switches = 0
        self.gains: list[float] = []  # metres by which the plan of each switch was better
        self.odometry = Odometry(self.figures.speed, self.figures.turn_rate)
        self.reading = self.read()
        self._power = float(energy.power(self.figures.speed)), energy.idle  # moving, standing
        self._energy = self._driven = 0.0
        self._since = self._presented = clock.now()
        self._hopeful = self._since  # when a plan last brought it nearer
        self._execution: Execution | None = None
        self._posture = "Crouch"  # the last one that had a name
        self._touched = Touched()
        self.hearing = Hearing(self, sonars or Sonars())
        self.query = new_query(self._world(self.hearing.known), seed, self.planning)
        self._tries = 0  # walks broken off since the pose last changed
        self._ending: Ending | None = None
        self._story = Story(self.reading.pose_in_world)

    # --- A body that is looked after: whoever lets its time pass moves the plan on.

    def now(self) -> float:
        return self.body.now()

    def wait(self, seconds: float) -> None:
        """Let time pass, and look at the plan again and again."""
        left = seconds
        while left > 0:
            part = min(left, 0.02)
            self.body.wait(part)
            self.attend()
            left -= part

    def read(self) -> Reading:
        """What the body tells, its pose as far as it can be believed. Raises LinkLostError.

        Over NAOqi the driver has looked at the pose already, and nothing is found here.
        """
        reading, jumps = self.body.read(), self.odometry.jumps
        pose = self.odometry.believe(reading.time, reading.pose_in_world, reading.moving)
        if self.odometry.jumps > jumps:
            self._story.happened(self._elapsed(), "odometry jumped")
        return replace(reading, pose_in_world=pose)

    # --- What the monitor asks for.

    def inputs(self) -> Mapping[str, Any]:
        self.attend()
        return {
            "sonar": self.hearing,
            "errand": Errand(lambda: self.query, self._world, self.attend),
        }

    def situation(self) -> Situation:
        self.attend()
        to_go = 0.0 if self._decided else max(self.apart(), 1e-3)
        return Situation(self._energy, to_go, 0.0, False, self._ending)

    def begin(self, plan: Solution, speed: float) -> None:
        """Take up a plan if none is in execution, or if it is better by the threshold."""
        self.attend()
        if self._ending is not None or self._decided:
            return
        if not self._better(plan):
            return
        self.switches += self._execution is not None
        self._hopeful = self.clock.now()
        self.plans += 1
        self._start(plan)

    def _better(self, plan: Solution) -> bool:
        """Whether a plan is better by the threshold than the one in execution, or than nothing."""
        execution = self._execution
        held, threshold = 0.0, _WORTH
        if execution is not None:  # it may come a little nearer to obstacles than a new one
            self.query.world.update(self._world(self.hearing.known, 0.4 * self.manner.margin))
            held = self.query.value_of(execution.solution.choices)
            # Who begins anew before the feet have moved never moves: then only danger counts.
            young = self.clock.now() - execution.began < self.figures.step_phase
            threshold = _DANGER if young else self.manner.threshold
        world = self._world(self.hearing.known)
        self.query.world.update(world)
        if execution is None:
            held = self.query.value_of(NOTHING)
        found = self.query.value_of(plan.choices)
        better = found < held - threshold
        if better and execution is not None:
            self.gains.append(held - found)
        actions = actions_of(plan.choices)
        current = execution.actions if execution else ()
        kept, other = (actions, current) if better else (current, actions)
        self._story.compared(
            self._elapsed(),
            held,
            found,
            threshold=threshold,
            idle=execution is None,
            taken=better,
            plan=leads(kept, world) if kept else (),
            other=leads(other, world) if other and other != kept else (),
        )
        return better

    def change_speed(self, speed: float) -> None:
        """A NAO walks at its own speed."""

    def learn(self, plan: Solution) -> None:
        """Nothing to do: what was heard is kept by whoever listens."""

    def complete(self) -> None:
        """A frame ends with its thinking; the plan goes on. The last plan is executed to its end,
        and nobody thinks meanwhile."""
        self.attend()
        while self._decided and self._ending is None:
            self.wait(0.1)

    def work(self, seconds: float) -> None:
        self.wait(seconds)

    def stop(self) -> None:
        self.body.stop()
        self._execution = None

    def driven(self) -> float:
        self.attend()
        return self._driven

    def story(self) -> Mapping[str, Any]:
        """Of the frame just ended; see `monitor.robots.nao_story`."""
        world = self._world(self.hearing.known)
        clearance = self.figures.radius + self.manner.margin
        grown = world["obstacles"][: world["obstacle_count"]].tolist()
        return self._story.told(
            self.reading,
            executes=self._execution is not None,
            goal=self.goal.place(self._elapsed()),
            discs=[(x, y, r - clearance) for x, y, r in grown],
            clearance=clearance,
            radius=self.figures.radius,
            sonars=self.hearing.sonars,
        )

    def picture(self) -> Mapping[str, Any]:
        """What was heard."""
        return {"belief": self.hearing.known}

    # --- Execution.

    @property
    def _decided(self) -> bool:
        """Whether no other plan may be taken up."""
        return self.plans == self.manner.plans

    def attend(self) -> None:
        """Bring everything up to now: energy, the plan's actions, falls, the ending."""
        now = self.clock.now()
        if now == self._since and self._execution is not None:
            return  # it was just brought there
        passed, self._since = now - self._since, now
        try:
            before, self.reading = self.reading, self.read()
        except LinkLostError:
            self._ending = self._ending or Ending.LINK_LOST
            self._execution = None
            return
        moving = self._execution is not None
        self._energy += passed * self._power[0 if moving else 1]
        self._driven += passed * moving
        if self.odometry.unseen == 0.0:
            self._tries = 0
        self._story.moved(self.reading.pose_in_world)
        if self.reading.fallen and not before.fallen:
            self._fell()
        elif self._execution is not None:
            self._go_on(self._execution)
        met = self.goal.velocity != (0.0, 0.0) and self._near()
        if (self._execution is None or met) and self._ending is None:
            self._judge(now, met)

    def _judge(self, now: float, met: bool) -> None:
        """Whether it has arrived, or given up. A goal that moves need only be met."""
        standing = self.reading.posture in {POSTURES[posture] for posture in STANDING}
        if standing and (met or self.apart() <= self.manner.tolerance):
            self._ending = Ending.REACHED
        elif now - self._hopeful <= self.manner.patience or self.reading.fallen:
            return
        elif self._touched:  # before it gives up it doubts what it touched: that may have gone
            self._touched.doubt()
            self._hopeful = now
        else:
            self._ending = Ending.REACHED if self._near() else Ending.BLOCKED

    def _near(self) -> bool:
        return self.apart() <= 2 * self.manner.tolerance

    def _fell(self) -> None:
        self.falls += 1
        self._story.happened(self._elapsed(), "fell")
        action = self._execution.current if self._execution else None
        if action is not None and action.name == "walk":
            pose, radius = self.reading.pose_in_world, self.figures.radius
            self._touched.fell(pose, action, radius, self.clock.now())
        self._drop()
        if self.falls > self.manner.falls or self._decided:
            self._ending = Ending.FALLEN

    def _start(self, plan: Solution) -> None:
        """Execute a plan from the current moment on: what is executed is skipped, the action that
        goes on in part."""
        before = self._execution
        made = Execution(plan, actions_of(plan.choices))
        if before is not None:
            made.done = before.done
            if made.current == before.current:  # nothing changes before its end
                made.began, made.running = before.began, before.running
                made.heading, made.rises = before.heading, before.rises
        self._execution = made
        self._go_on(made)

    def _go_on(self, execution: Execution) -> None:
        """Begin the next action when one has ended."""
        while execution.running is None or (outcome := self._outcome(execution)) is not None:
            if execution.running is not None:
                if outcome not in (Outcome.DONE, Outcome.REFUSED):
                    self._drop()
                    if outcome is Outcome.LINK_LOST:
                        self._ending = Ending.LINK_LOST
                    return
                if execution.rises and outcome is Outcome.DONE:
                    turned = self.reading.pose_in_world[2] - execution.heading
                    self.drift = self.drift.learn(math.remainder(turned, math.tau))
                execution.done += 1
            action = execution.current
            if action is None:
                self._drop()
                return
            self.query.constrain(made_before(execution.solution.choices, execution.done))
            execution.began = self.clock.now()
            execution.heading = self.reading.pose_in_world[2]
            execution.rises = self._rises(action)
            execution.running = command(self.body, self.clock, action)

    def _outcome(self, execution: Execution) -> Outcome | None:
        """How the action in execution ended, if it did. A walk that odometry does not see is broken
        off: nobody knows where it leads."""
        assert execution.running is not None
        if self.odometry.unseen > FROZEN * (self._tries + 1):
            self._tries += 1
            self.body.stop()
            return Outcome.LINK_LOST if self._tries == _TRIES else Outcome.TIMEOUT
        return execution.running.poll()

    def _drop(self) -> None:
        """No plan is in execution any more."""
        self._execution = None
        self.query.constrain({})

    def _rises(self, action: Action) -> bool:
        return (
            action.name == "posture"
            and int(action.ahead) in STANDING
            and self.reading.posture not in {POSTURES[posture] for posture in STANDING}
        )

    # --- What plans are simulated in.

    def _world(self, heard: SonarMap, margin: float | None = None) -> dict[str, Any]:
        """The world now: where the robot is, what it heard, and how much of its plan is done."""
        margin = self.manner.margin if margin is None else margin
        self.hearing.known = heard
        reading, execution = self.reading, self._execution
        if reading.posture in POSTURES:
            self._posture = reading.posture
        elif reading.posture == LYING:
            self._posture = "Crouch"
        action = execution.current if execution else None
        grown = self.figures.radius + margin
        now = self.clock.now()
        near = [*self._touched.discs(now), *obstacles(heard).tolist()][:MOST_OBSTACLES]
        discs = [(x, y, r + grown) for x, y, r in near]
        return plan_world(
            self._meeting_point(),
            pose=reading.pose_in_world,
            posture=self._posture,
            obstacles=discs,
            done=execution.done if execution else 0,
            current=action,
            elapsed=now - execution.began if execution and action else 0.0,
            drift=float(self.drift.mean),
            effort=self.planning.effort,
            collision=self.planning.collision,
            body=self.figures,
        )

    def _meeting_point(self) -> tuple[float, float]:
        """Where the goal will be when the robot can be there."""
        body = self.figures
        rising = float(body.posture_seconds[POSTURES.index(self._posture), STAND])
        here, delay = self.reading.pose_in_world[:2], rising + body.step_phase
        return self.goal.meeting_point(here, self._elapsed(), speed=body.speed, delay=delay)

    def apart(self) -> float:
        """Metres to the goal, by odometry."""
        return math.dist(self.reading.pose_in_world[:2], self.goal.place(self._elapsed()))

    def _elapsed(self) -> float:
        """Seconds since the task was presented."""
        return self.clock.now() - self._presented
