"""Activities: a compiled program in a loop that is not ours, a control loop or a ROS node."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import TracebackType
from typing import Any

import numpy as np

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.pictures import clipped
from anytime.results import Result
from compiler.compiled import CompiledProgram
from compiler.division import divide
from compiler.guarding import STEPS, Steps

WEIGHT = 0.2  # of the newest run in a module's running ratio
WILDEST = 4.0  # times as long, or as short, as one run may claim that its steps take
FORGOTTEN = 0.01  # of what is known of the pace, of a module, at each call in which it is not run
DRIFT = 1.1  # by which a ratio must have changed before time is divided anew


class Activity:
    """A program that is called again and again.

    Modules keep what they put into `memory` from call to call; one with a memory registers first
    what it already has. How long steps really take is compared with the profile, and when that
    changes time is divided anew. Made by `CompiledProgram.start`; close it, or use it with `with`.
    """

    def __init__(
        self,
        program: CompiledProgram,
        clock: Clock | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._measured = self._program = program
        self._clock, self._rng = clock, rng
        self._memory: dict[str, dict[str, Any]] = {label: {} for label in program.labels}
        self._modules = {call.module.name: call.module for call in program.program.calls}
        self._logs = dict.fromkeys(self._modules, 0.0)  # of the running ratios
        self._divided = dict.fromkeys(self._modules, 1.0)  # ratios of the division in force
        self._closed = False
        self.calls = 0
        self.why = "divided as compiled"

    @property
    def program(self) -> CompiledProgram:
        """The program as it is divided now."""
        return self._program

    @property
    def ratios(self) -> Mapping[str, float]:
        """How long the steps of each module take now over how long they took when measured."""
        return {name: math.exp(ratio) for name, ratio in self._logs.items()}

    @property
    def drift(self) -> Mapping[str, float]:
        """The ratios by which time was divided anew, of the modules that have left their profile;
        empty where all is as measured."""
        return {name: ratio for name, ratio in self._divided.items() if ratio != 1.0}

    def run(self, seconds: float, **inputs: Any) -> Result:
        """Run the program once within a budget of seconds; see `CompiledProgram.run`.

        Raises AnytimeError once the activity is closed.
        """
        if self._closed:
            raise AnytimeError(f"the activity of {self._program.name!r} is closed; start another")
        self.calls += 1
        result = self._program.run(
            seconds, clock=self._clock, rng=self._rng, memory=self._memory, **inputs
        )
        calls = self._program.program.calls
        for call in calls:
            part = result.parts.get(call.label)
            if part is not None:
                self._observe(call.module, part)
        ran = {call.module.name for call in calls if call.label in result.parts}
        for name in self._modules.keys() - ran:
            # What is taken for too slow to be run is not seen to recover.
            self._logs[name] *= 1.0 - FORGOTTEN
        self._divide()
        return result

    def close(self) -> None:
        """Forget what modules keep; later calls are refused."""
        self._closed = True
        self._memory.clear()

    def _observe(self, module: Module, part: Result) -> None:
        """Compare the durations of a run's steps with those of the profile."""
        steps = self._measured.steps.get(module.name)
        if steps is None or not steps.median:
            return
        took = np.diff([change.seconds for change in part.history], prepend=0.0).tolist()
        took = took[: STEPS - 1]  # those after them are not known one by one
        ratio = steps.pace(took)
        if "memory" in module.filled:  # the first result is an old one
            ratio = replace(steps, median=steps.median[1:] or steps.median).pace(took[1:])
        if math.isnan(ratio):
            return
        ratio = min(max(ratio, 1.0 / WILDEST), WILDEST)
        old = self._logs[module.name]
        self._logs[module.name] = old + WEIGHT * (math.log(ratio) - old)

    def _divide(self) -> None:
        """Divide time anew when a module's ratio has moved away from the division in force."""
        ratios = self.ratios
        moved = [
            name
            for name, ratio in ratios.items()
            if not self._alike(name, ratio, self._divided[name])
        ]
        if not moved:
            return
        self._divided = {
            name: 1.0 if self._alike(name, ratio, 1.0) else ratio for name, ratio in ratios.items()
        }
        self.why = "; ".join(
            f"{name} takes {ratios[name]:.2f} times as long as measured" for name in moved
        )
        self._program = _scaled(self._measured, self._divided)

    def _alike(self, module: str, one: float, other: float) -> bool:
        """Whether two ratios may be those of one machine on other problems."""
        steps = self._measured.steps.get(module)
        return abs(math.log(one / other)) <= max(math.log(DRIFT), steps.spread if steps else 0.0)

    def __enter__(self) -> Activity:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        state = "closed" if self._closed else self.why
        return clipped(f"<activity of {self._program.name}, {self.calls} calls: {state}>")


def _scaled(program: CompiledProgram, ratios: Mapping[str, float]) -> CompiledProgram:
    """The program with its modules so many times as slow as measured, divided anew.

    An adaptive policy and recorded problems belong to the times as measured: they are left aside.
    """
    if all(ratio == 1.0 for ratio in ratios.values()):
        return program
    tables = tuple(
        table.faster(1.0 / ratios[table.module]) if table.module in ratios else table
        for table in program.tables
    )
    steps = {
        name: Steps(
            tuple(ratios.get(name, 1.0) * gap for gap in known.median),
            tuple(ratios.get(name, 1.0) * gap for gap in known.p95),
            known.spread,
            known.whole,
        )
        for name, known in program.steps.items()
    }
    frontier = program.calibration.applied(divide(tables, program.objective))
    return replace(program, tables=tables, frontier=frontier, steps=steps, policy=None, replay=None)
