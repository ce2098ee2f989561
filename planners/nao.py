"""NAO as its planner knows it: postures, how long they take, and how fast it walks.

Lengths in metres, angles in radians, times in seconds. The simulated body is built from the same
figures, so they live here once.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

POSTURES = ("StandInit", "Crouch", "Sit", "SitRelax", "Stand", "StandZero")
"""The six postures of [PRP16] §3, in its order; a posture is its index here."""
STAND_INIT, CROUCH, SIT, SIT_RELAX, STAND, STAND_ZERO = range(6)
STANDING = (STAND_INIT, STAND, STAND_ZERO)
"""The postures from which NAO can walk and turn."""


def _posture_seconds() -> NDArray[np.float64]:
    """Seconds from one posture (row) to another (column), at full speed of the joints."""
    seconds = np.full((6, 6), 2.0)
    for low in (SIT, SIT_RELAX):
        seconds[low, :] = seconds[:, low] = 8.0
        seconds[low, CROUCH] = 5.0
    seconds[SIT, SIT_RELAX] = seconds[SIT_RELAX, SIT] = 2.0
    np.fill_diagonal(seconds, 0.0)
    return seconds


@dataclass(frozen=True, eq=False)
class Body:
    """What a NAO takes for what it does.

    speed: of walking. turn_rate: of turning on the spot, sustained. step_phase: seconds that a
    walk or a turn takes beside the way, to start and to stop. radius: of the disc that it sweeps,
    arms included. posture_seconds: float [6, 6], from row to column. fall_seconds: what a fall
    costs until it can be told to stand up. command_seconds: what each command costs beside.
    """

    speed: float = 0.095
    turn_rate: float = 0.42
    step_phase: float = 1.2
    radius: float = 0.15
    posture_seconds: NDArray[np.float64] = field(default_factory=_posture_seconds)
    fall_seconds: float = 10.0
    command_seconds: float = 0.1
