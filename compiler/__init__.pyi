"""The compiler: from a program of anytime modules to the best division of any amount of time."""

from .activities import Activity
from .baselines import equal_shares, maximal, minimal
from .compiled import CompiledProgram
from .compiling import compile
from .constructs import all_of, any_of, branch, choose, loop, output, parallel
from .enough import UntilRegret
from .interruption import Interruptible, interruptible
from .loading import load
from .objectives import at_least, cvar, expected, quantile
from .processors import round_robin
from .reading import program
from .shadowing import advise

__all__ = [
    "Activity",
    "CompiledProgram",
    "Interruptible",
    "UntilRegret",
    "advise",
    "all_of",
    "any_of",
    "at_least",
    "branch",
    "choose",
    "compile",
    "cvar",
    "equal_shares",
    "expected",
    "interruptible",
    "load",
    "loop",
    "maximal",
    "minimal",
    "output",
    "parallel",
    "program",
    "quantile",
    "round_robin",
]
