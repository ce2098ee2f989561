"""Comparing two libraries, or two compiled programs, by what a grid mission is worth with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from anytime import Machine, ProfileLibrary
from anytime.errors import AnytimeError
from compiler import CompiledProgram, load
from monitor.policies import Expected
from monitor.robots.briefing import Briefing, Effort, brief, brief_with, effort_for
from monitor.robots.grid_missions import GridMission
from monitor.robots.lessons import NO_MEMORY, Memory
from monitor.robots.navigation import navigate
from monitor.shifts import GROUPS, shifts_of_libraries, shifts_of_schedules
from monitor.value_gate import Foresight, Gate, UnreachedError, gate
from planners.navigation import find_path
from sensing.vision import see


def compare(
    before: Path,
    after: Path,
    grid: GridMission,
    tolerance: float = 0.0,
    memory: Memory = NO_MEMORY,
) -> Gate:
    """What a change costs in the value of a mission.

    before, after: folders of profiles, or files that `anytime compile` wrote. tolerance: the loss
    of net value that is put up with. memory: where what the missions lived teach is kept. Missions
    are lived with what was before; where none of them reaches its goal, with what came after.
    Raises AnytimeError if no mission reaches its goal with either, or it begins there, for a path
    that is not there, for two of different kinds, and for programs of other modules.
    """
    grid = replace(grid, mission=grid.mission.known(0.0))  # judged as it is presented
    if grid.scene.optimal == 0:
        raise AnytimeError(
            f"the mission {grid.mission.name!r} begins at its goal; nothing is to be divided there"
        )
    for path in (before, after):
        if not path.exists():
            raise AnytimeError(f"{path}: no such file or folder")
    if before.is_dir() != after.is_dir():
        raise AnytimeError(
            f"{before} and {after}: one is a folder of profiles and one is not; give two folders "
            "or two schedules"
        )
    if before.is_dir():
        libraries = ProfileLibrary(before), ProfileLibrary(after)
        shifts, back = (
            shifts_of_libraries(navigate, *pair) for pair in (libraries, libraries[::-1])
        )

        def lived(side: int) -> Briefing:
            known = replace(grid, machine=as_before(grid.machine, libraries[side].machine))
            return brief(known, libraries[side], effort(grid), memory)
    else:
        schedules = _schedule(before, grid), _schedule(after, grid)
        shifts, back = (shifts_of_schedules(*pair) for pair in (schedules, schedules[::-1]))

        def lived(side: int) -> Briefing:
            return brief_with(schedules[side], grid, effort(grid), memory)

    try:
        return gate(foreseen(lived(0)), shifts, tolerance)
    except UnreachedError:  # with what it was before; a change that mends that is told as well
        return gate(foreseen(lived(1)), back, tolerance).backwards(shifts.all)


def as_before(machine: Machine, before: Machine) -> Machine:
    """The mission's machine with the modules as fast as they were.

    In simulated time rates say how fast a module is; measured in real time they say how fast it is
    there, and not on the mission's machine.
    """
    if before.host:
        return machine
    return replace(machine, rates={**machine.rates, **before.rates})


def foreseen(briefing: Briefing) -> Foresight:
    """A mission foreseen from its briefing, and from missions that `expected` then lived."""
    policy = briefing.monitor("expected").policy
    assert isinstance(policy, Expected)
    return Foresight(
        briefing.grid.mission,
        briefing.robot().situation(),
        briefing.lived,
        np.array(policy.spread.ratios[-1]),  # those of missions just presented
        tuple(briefing.program.tables),
        briefing.program.frontier,
    )


def effort(grid: GridMission) -> Effort:
    """At least two missions for each group that is left out, at each sensing time."""
    usual = effort_for(grid.scene)
    return replace(usual, rhythm_seeds=max(usual.rhythm_seeds, 2 * GROUPS))


def _schedule(path: Path, grid: GridMission) -> CompiledProgram:
    compiled = load(path, modules=[see, find_path])
    labels = [call.label for call in navigate.calls]
    if list(compiled.labels) != labels:
        raise AnytimeError(
            f"{path} divides {', '.join(compiled.labels)}; a grid mission needs {', '.join(labels)}"
        )
    if compiled.machine != grid.machine.name:
        raise AnytimeError(
            f"{path} was compiled for the machine {compiled.machine!r}, the mission thinks on "
            f"{grid.machine.name!r}; give the folders of profiles instead"
        )
    return compiled
