"""Certainty equivalence: in every state, act as if all went as expected from there, and solve again
in the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from monitor import decision_kernels as kernels
from monitor.decision_process import DecisionProcess

Actions = NDArray[np.int8]
Floats = NDArray[np.float64]
NORMAL = np.array([-1.645, -1.036, -0.674, -0.385, -0.126, 0.126, 0.385, 0.674, 1.036, 1.645])


def resolve(process: DecisionProcess, caution: float = 0.0) -> Actions:
    """The table of actions [T, F + 1, X, Y] of re-solving in each tick.

    One level to plan to and one speed are chosen for all the frames that are left. caution: with
    0 the time left is taken as sure; else completing is worth its mean over a normal spread of the
    time left, whose variance is (caution × spread of a tick's progress)² × ticks left.
    """
    ticks = process.ticks
    actions = np.zeros(process.shape, np.int8)
    kernels.resolve(
        np.array(process.lengths),
        process.energy,
        process.thinking,
        process.pace,
        process.thinking_times,
        worth_by_time_left(process, caution, longest=4 * ticks),
        actions,
    )
    return actions


def worth_by_time_left(process: DecisionProcess, caution: float, longest: int) -> Floats:
    """What completing is worth, now and ticks left, [T, longest + 1]."""
    left = np.arange(longest + 1)
    spread = caution * process.unevenness * np.sqrt(left)
    ticks = np.arange(process.ticks)
    worth = np.zeros((len(ticks), len(left)))
    for deviation in NORMAL if caution > 0 else np.zeros(1):
        ends = ticks[:, None] + np.maximum(left + deviation * spread, 0.0)
        worth += np.interp(
            ends, np.arange(process.ticks + 1), np.append(process.value[: process.ticks], 0.0)
        )
    return worth / (len(NORMAL) if caution > 0 else 1)
