"""Anytime computation: modules that improve while they are given time, and their profiles."""

from .clocks import Clock, Deadline, WallClock, WorkClock
from .errors import AnytimeError, OutsideRunError
from .knobs import knob
from .library import ProfileLibrary
from .machines import Machine
from .measuring import measure
from .modules import Module, module
from .profiles import Profile
from .results import Result, Status
from .running import charge, expired, here, register, run

__all__ = [
    "AnytimeError",
    "Clock",
    "Deadline",
    "Machine",
    "Module",
    "OutsideRunError",
    "Profile",
    "ProfileLibrary",
    "Result",
    "Status",
    "WallClock",
    "WorkClock",
    "charge",
    "expired",
    "here",
    "knob",
    "measure",
    "module",
    "register",
    "run",
]
