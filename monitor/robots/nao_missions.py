"""Missions of a NAO: the compiled program, the monitor, and one life in a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

import compiler
from anytime import Machine, WorkClock, measure
from anytime.clocks import Clock
from compiler import CompiledProgram
from monitor.logs import LogWriter
from monitor.missions import Energy, Mission, Value
from monitor.monitoring import Monitor
from monitor.policies import constant
from monitor.reports import Frame, Report
from monitor.robots.nao import Manner, NaoRobot
from monitor.robots.nao_body import NaoBody
from monitor.robots.nao_drift import Drift
from monitor.robots.nao_floor import plan_of
from monitor.robots.nao_planning import Planning, errands, improve
from monitor.robots.nao_scenes import Scene
from monitor.robots.simulated_nao import SimulatedNao
from planners.nao import Body

MACHINE = Machine("nao").with_rate("sonar_map", 0.1).with_rate("find_plan", 1e-5)
"""A NAO of the paper's days: ten sonar readings and a hundred thousand evaluations a second."""

MISSION = Mission(
    Value("soft", 100.0, 60.0), Energy(0.1, 1.0, 0.0), (Body().speed, Body().speed), name="nao"
)


@dataclass(frozen=True)
class NaoBriefing:
    """What the monitor is to know of a NAO: its program, compiled, and how long a frame is.

    frame: seconds of listening and planning, which the compiler divides.
    """

    program: CompiledProgram
    mission: Mission = MISSION
    machine: Machine = MACHINE
    frame: float = 0.4
    manner: Manner = field(default_factory=Manner)
    planning: Planning = field(default_factory=Planning)

    @cached_property
    def monitor(self) -> Monitor:
        shares = self.program.allocate(self.frame).shares
        return Monitor(self.program, constant(dict(shares), self.mission.speeds[0]), "fixed")

    def robot(
        self,
        scene: Scene,
        *,
        body: NaoBody | None = None,
        clock: Clock | None = None,
        drift: Drift | None = None,
    ) -> NaoRobot:
        """The robot at the start of a scene.

        body, clock: a simulated one on a work clock by default. drift: what earlier runs taught of
        standing up.
        """
        clock = clock or WorkClock(self.machine)
        return NaoRobot(
            body or SimulatedNao(scene, clock),
            clock,
            scene.goal,
            self.mission.energy,
            sonars=scene.sonars,
            manner=self.manner,
            planning=self.planning,
            drift=drift,
            seed=scene.seed,
        )

    def live(
        self, robot: NaoRobot, seed: int = 0, listen: Callable[[Frame], None] | None = None
    ) -> Report:
        """Live a mission to its ending."""
        return self.monitor.run(self.mission, robot, seed=seed, listen=listen)

    def log(self, robot: NaoRobot, scene: Scene, path: Path) -> Report:
        """Live a mission in a scene, and write its log while it goes on."""
        drawn = plan_of(scene)
        with LogWriter(path) as writer:
            writer.mission(
                self.mission,
                policy=self.monitor.name,
                seed=scene.seed,
                labels=self.program.labels,
                machine=self.program.machine,
                floor=drawn.floor,
            )
            report = self.live(robot, scene.seed, lambda frame: writer.frame(drawn.drawn(frame)))
            writer.end(report)
        return report

    def unmonitored(self) -> NaoBriefing:
        """The same, but the first good plan is executed to its end, come what may."""
        return replace(self, manner=replace(self.manner, plans=1))


def brief(problems: int = 6, seed: int = 0) -> NaoBriefing:
    """Measure listening and planning on a few errands, and compile the program."""
    rng = np.random.default_rng(seed)
    library = measure(
        improve, errands(rng, problems), seconds=0.8, clock=lambda: WorkClock(MACHINE)
    )
    return NaoBriefing(compiler.compile(improve, library))
