"""Other people's optimisers, on the very text that ours optimises."""

from experiments.benchmarks.rivals.catalogue import RIVALS, Rival, installed, missing
from experiments.benchmarks.rivals.random_keys import (
    KeyRng,
    Problem,
    measured_layout,
    plain_world,
)
from experiments.benchmarks.rivals.trail import Stop, Trail, Watch
from experiments.benchmarks.rivals.trials import TrialRng

__all__ = [
    "RIVALS",
    "KeyRng",
    "Problem",
    "Rival",
    "Stop",
    "Trail",
    "TrialRng",
    "Watch",
    "installed",
    "measured_layout",
    "missing",
    "plain_world",
]
