"""What was recorded of one run of a module."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anytime.clocks import DECIMALS

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """One recorded run of a module on one problem.

    inputs: achieved quality of what arrived at each parameter that another module feeds.
    seconds, work, raw, estimates: [n] at each registration, thinned; seconds to the picosecond;
        raw is the quality, or the cost for a module with a cost; estimates are NaN for a module
        without one.
    end: seconds, work when the run ended.
    results: registrations in all, of which some are left out here; by default none is.
    steps: check-points in all, at which it can be ended; by default one for each result.
    """

    problem: str
    call: str
    inputs: Mapping[str, float]
    features: Mapping[str, float]
    seconds: Floats
    work: Floats
    raw: Floats
    estimates: Floats
    end: tuple[float, float]
    complete: bool
    results: int = 0
    steps: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "results", self.results or len(self.seconds))
        object.__setattr__(self, "steps", self.steps or self.results)
        # The same steps added in another order differ in the last bit, and are the same moment.
        object.__setattr__(self, "seconds", np.round(self.seconds, DECIMALS))
        object.__setattr__(self, "end", (round(float(self.end[0]), DECIMALS), float(self.end[1])))
