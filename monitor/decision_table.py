"""The decision table: what is best in every state of a decision process, solved exactly."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor import decision_kernels as kernels
from monitor.decision_process import DecisionProcess, Moment, Move

Floats = NDArray[np.float64]
Actions = NDArray[np.int8]
CAUTION = 1.1  # times as many ticks as were measured that a cautious table gives the planner


@dataclass(frozen=True)
class DecisionTable:
    """The optimal policy of a process.

    actions: [T, F + 1, X, Y] for each tick, frames still to plan, cells of path left, level of the
    next plan; a byte a state. worth: of the same shape, the net value to expect from there on.
    promised: the net value to expect when the task is presented.
    """

    process: DecisionProcess
    actions: Actions
    worth: NDArray[np.float32]
    promised: float

    @cached_property
    def _look(self) -> tuple[bytes, tuple[Move, ...], int, int, int]:
        process = self.process
        codes = 2 * len(process.speeds) + 3
        moves = tuple(process.move(code) for code in range(codes))
        _, frames, cells, levels = process.shape
        return self.actions.tobytes(), moves, frames, cells, levels

    def decide(self, moment: Moment) -> Move:
        """The best move: a look-up. Raises IndexError beyond the last tick."""
        actions, moves, frames, cells, levels = self._look
        f, x, y, t = moment
        return moves[actions[((t * frames + f) * cells + x) * levels + y]]


def solve(process: DecisionProcess) -> DecisionTable:
    """The exact optimum, by dynamic programming backwards in time (Bellman)."""
    actions = np.zeros(process.shape, np.int8)
    worth = np.zeros(process.shape, np.float32)
    promised = kernels.solve(*_arrays(process), actions, worth)
    return DecisionTable(process, actions, worth, float(promised))


def solve_cautiously(process: DecisionProcess) -> DecisionTable:
    """The optimum for a planner that is a tenth slower than believed.

    A table that expects too much of its planner loses several times more than one that expects too
    little: it hurries along the path and then stands and thinks. So where a profile was measured,
    this one is the better to act by (`bench monitor` has both).
    """
    return solve(process.slower(CAUTION))


def evaluate(process: DecisionProcess, actions: Actions) -> float:
    """The net value to expect of acting by a table, which may be another process's."""
    return float(kernels.evaluate(*_arrays(process), actions))


def simulate(
    process: DecisionProcess, actions: Actions, missions: int, rng: np.random.Generator
) -> Floats:
    """Net values of missions lived by a table, [missions]."""
    chance = rng.random((missions, process.ticks, 2))
    return kernels.simulate(*_arrays(process), actions, chance)


def _arrays(process: DecisionProcess) -> tuple[Any, Any, Any, Any, Any, Any]:
    return (
        np.array(process.lengths),
        process.planning,
        process.progress,
        process.energy,
        process.thinking,
        process.value[: process.ticks],
    )
