"""From a program and a library of profiles to a compiled program."""

from __future__ import annotations

from collections.abc import Mapping

from anytime.errors import AnytimeError
from anytime.joins import Best, Rule
from anytime.machines import Machine
from anytime.modules import Module
from anytime.profiles import Profile
from anytime.programs import Join, Program, program_of
from compiler.adaptive import adapt
from compiler.calibrating import as_tables_say, calibrate
from compiler.compiled import CompiledProgram
from compiler.division import divide
from compiler.guarding import guards_of
from compiler.objectives import EXPECTED, Objective
from compiler.regret import regret_bound
from compiler.replaying import replay_of
from compiler.seeing import calibrations
from compiler.tables import tables


def compile(
    program: Program | Module,
    library: Mapping[str, Profile],
    *,
    machine: Machine | None = None,
    objective: Objective = EXPECTED,
    adaptive: bool = False,
    seed: int = 0,
) -> CompiledProgram:
    """Compile a program: the best division of every amount of time among its calls. [ZR93] §4.

    library: conditional profiles by module name. machine: compile for another machine's rates.
    objective: what a division is chosen for, see `compiler.expected` and its like. adaptive: decide
    each share when its call begins, by what was achieved before, and whether it goes on after each
    of its results, by what it shows, where that is worth more.
    The result is a contract program with a profile of its own. The promises of a program of
    calls and alternatives are cross-fitted over problems, with 95 % intervals; those of others are
    what the tables say, with intervals by leaving problems out.
    Raises AnytimeError for a missing or unsuitable profile, before any search.
    """
    if isinstance(program, Module):
        program = program_of(program)
    if not isinstance(program, Program):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(
            f"compile takes a program, not {program!r}; decorate a function with @compiler.program"
        )
    for name, given, kind, wanted in (
        ("library", library, Mapping, "profiles by module name, as `measure` returns them"),
        ("machine", machine, Machine | None, "a Machine"),
        ("objective", objective, Objective, "compiler.expected() or one of its like"),
    ):
        if not isinstance(given, kind):
            raise AnytimeError(f"{name} is {given!r}; give {wanted}")
    measured = profiles = _needed(program, library)
    if machine is not None:
        profiles = {name: profile.on(machine) for name, profile in measured.items()}
    made = tables(program, profiles)
    frontier = divide(made, objective)
    if not len(frontier.budgets):
        raise AnytimeError(
            f"program {program.name!r} never has a result in its profiles; measure its modules "
            "for longer"
        )
    steps = guards_of(profiles)
    replay = None
    if _in_a_row(program, Best) and objective == EXPECTED:
        replay = replay_of(program, profiles, steps, made, seed)
        frontier, calibration = calibrate(program, profiles, frontier, replay, seed)
        if machine is not None:
            # Promised as on the machine of the profiles, so that a faster one never promises less.
            there = tables(program, measured)
            lives = replay_of(program, measured, guards_of(measured), there, seed)
            _, calibration = calibrate(program, measured, divide(there), lives, seed)
        frontier = calibration.applied(frontier)
    else:
        calibration = as_tables_say(program, profiles, frontier, objective, seed)
    policy = None
    if adaptive:
        policy = adapt(program, made, calibrations(program, profiles), frontier, objective)
    names = {profile.machine for profile in profiles.values()}
    return CompiledProgram(
        program=program,
        tables=made,
        frontier=frontier,
        calibration=calibration,
        steps=steps,
        machine=" and ".join(sorted(names)),
        regret=regret_bound(program, profiles, made) if _in_a_row(program) else 1.0,
        objective=objective,
        policy=policy,
        replay=replay,
    )


def _needed(program: Program, library: Mapping[str, Profile]) -> dict[str, Profile]:
    needed = {call.module.name for call in program.calls}
    missing = sorted(needed - set(library))
    if missing:
        raise AnytimeError(
            f"no profile for module {missing[0]!r}; measured: {', '.join(library) or 'none'}. "
            f"anytime.measure({program.name}, problems, seconds=…) measures them all"
        )
    return {name: library[name] for name in needed}


def _in_a_row(program: Program, *rules: type[Rule]) -> bool:
    """Whether it is calls, and joins by these rules alone, one after the other."""
    joins = [node for node in program.nodes if isinstance(node, Join)]
    return not program.parallels and all(isinstance(join.rule, rules) for join in joins)
