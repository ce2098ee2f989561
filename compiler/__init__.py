"""The compiler: from a program of anytime modules to the best division of any amount of time."""

from compiler.baselines import equal_shares, maximal, minimal
from compiler.compiled import CompiledProgram
from compiler.compiling import compile
from compiler.loading import load
from compiler.reading import program

__all__ = [
    "CompiledProgram",
    "compile",
    "equal_shares",
    "load",
    "maximal",
    "minimal",
    "program",
]
