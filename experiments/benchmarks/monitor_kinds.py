"""Sixteen kinds of mission as decision processes: noise, planner, and what completing is worth."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monitor.decision_process import DecisionProcess, steady_planning, uneven_progress
from monitor.missions import Value

Kind = tuple[str, str, str]
"""(noise, planner, value)."""
FRAMES, LEVELS, TICKS = 8, 10, 260
LENGTH = 44  # cells of a frame with the best plan
# Walked by a plan of each level: its quality is .5 + .05 × level.
LENGTHS = (0, *(round(LENGTH / (0.5 + 0.05 * level)) for level in range(1, LEVELS + 1)))
SPEEDS = tuple(float(speed) for speed in range(1, 17))
ENERGY = 0.015  # × speed², a tick
NOISES: Mapping[str, tuple[float, ...]] = {"low": (0.9, 1.0, 1.1), "high": (0.4, 1.0, 1.3)}
SHARES = (0.25, 0.5, 0.25)  # of the three factors by which a tick's progress is off
RATES: Mapping[str, float] = {"fast": 0.9, "slow": 0.4}  # levels a tick
KINDS: tuple[Kind, ...] = tuple(
    itertools.product(NOISES, RATES, ("linear", "exponential", "soft", "hard"))
)
SLOWER = 1.3  # ticks that a planner needs, in times of what is believed of it


def values() -> dict[str, NDArray[np.float64]]:
    """What completing is worth at each tick, by kind; 100 at the start."""
    ticks = np.arange(TICKS + 1.0)
    return {
        "linear": Value("linear", 100.0, 220.0)(ticks),
        "exponential": Value("exponential", 100.0, 160.0)(ticks),
        "soft": 100.0 / (1.0 + np.exp((ticks - 110.0) / 5.0)),
        "hard": Value("hard", 100.0, 120.0)(ticks),
    }


def kinds() -> dict[Kind, DecisionProcess]:
    """The processes of all kinds."""
    speeds, worths = np.array(SPEEDS), values()
    return {
        (noise, planner, kind): DecisionProcess(
            frames=FRAMES,
            lengths=LENGTHS,
            planning=steady_planning(LEVELS, RATES[planner]),
            speeds=SPEEDS,
            progress=uneven_progress(speeds, NOISES[noise], SHARES),
            energy=ENERGY * speeds**2,
            value=worths[kind],
        )
        for noise, planner, kind in KINDS
    }
