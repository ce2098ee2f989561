"""The compiler: from a program of anytime modules to the best division of any amount of time."""

from compiler.baselines import equal_shares, maximal, minimal
from compiler.compiled import CompiledProgram
from compiler.compiling import compile
from compiler.interruption import Interruptible, interruptible
from compiler.loading import load
from compiler.processors import round_robin
from compiler.reading import program

__all__ = [
    "CompiledProgram",
    "Interruptible",
    "compile",
    "equal_shares",
    "interruptible",
    "load",
    "maximal",
    "minimal",
    "program",
    "round_robin",
]
