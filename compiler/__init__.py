"""The compiler: from a program of anytime modules to the best division of any amount of time."""

from compiler.activities import Activity
from compiler.baselines import equal_shares, maximal, minimal
from compiler.compiled import CompiledProgram
from compiler.compiling import compile
from compiler.constructs import all_of, any_of, branch, choose, loop, output, parallel
from compiler.enough import UntilRegret
from compiler.interruption import Interruptible, interruptible
from compiler.loading import load
from compiler.objectives import at_least, cvar, expected, quantile
from compiler.processors import round_robin
from compiler.reading import program
from compiler.shadowing import advise

__all__ = [
    "advise",
    "Activity",
    "CompiledProgram",
    "Interruptible",
    "UntilRegret",
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
