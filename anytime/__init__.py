"""Anytime computation: modules that improve while they are given time, and their profiles."""

from anytime import neighbours as _neighbours
from anytime.clocks import Clock, Deadline, WallClock, WorkClock
from anytime.errors import AnytimeError, OutsideRunError
from anytime.knobs import knob
from anytime.library import ProfileLibrary
from anytime.machines import Machine
from anytime.measuring import measure
from anytime.modules import Module, module
from anytime.profiles import Profile
from anytime.results import Result, Status
from anytime.running import charge, expired, here, register, run

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

_neighbours.check()
