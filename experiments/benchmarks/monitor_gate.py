"""How often the value gate finds a planted slow-down, and how often it cries without a change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from anytime import ProfileLibrary
from experiments import shipped
from experiments.comparing import bootstrap
from experiments.demo import measured
from monitor.robots.briefing import Briefing, brief
from monitor.robots.comparing import effort, foreseen
from monitor.robots.grid_missions import GridMission, read_mission
from monitor.robots.navigation import navigate
from monitor.shifts import shifts_of_libraries
from monitor.value_gate import gate

PROBLEMS = 60
SLOWER = 1.2
JITTER = 0.05  # by which a run's seconds vary from measuring to measuring (log-normal)
Figures = dict[str, float | int | None]


def gate_figures(seed: int, trials: int, lived: int) -> tuple[Figures, dict[str, object]]:
    """Figures under `gate.`, and the settings; lived: missions with and without the slow-down, to
    hold the foreseen loss against.

    found: share of trials in which `see`, a fifth slower, is called a loss; `found_planner` the
    same of `find_path`, which takes a tenth of a contract. false_alarms: share without a change.
    Both libraries of a trial are measured anew on the same problems; without a change, in half of
    the trials on other ones.
    """
    grid = read_mission(shipped.mission_path())
    library = measured(grid, seed, problems=PROBLEMS)
    briefing = brief(grid, library, effort(grid))
    known = foreseen(briefing)
    rng = np.random.default_rng([seed, 5])

    def alarm(before: ProfileLibrary, after: ProfileLibrary) -> bool:
        return gate(known, shifts_of_libraries(navigate, before, after)).shown

    def again(**slower: float) -> ProfileLibrary:
        return _measured_again(library, slower, rng)

    found = [alarm(again(), again(see=SLOWER)) for _ in range(trials)]
    planner = [alarm(again(), again(find_path=SLOWER)) for _ in range(trials // 2)]
    same = [alarm(again(), again()) for _ in range(trials - trials // 2)]
    others = (measured(grid, seed + 1 + each, problems=PROBLEMS) for each in range(trials // 2))
    other = [alarm(again(), _measured_again(fresh, {}, rng)) for fresh in others]
    figures: Figures = {
        "gate.found": float(np.mean(found)),
        "gate.found_planner": float(np.mean(planner)),
        "gate.false_alarms": float(np.mean([*same, *other])),
        "gate.false_alarms_other_problems": float(np.mean(other)),
    }
    slow = _slowed(library, {"see": SLOWER})
    figures["gate.foreseen"] = gate(known, shifts_of_libraries(navigate, library, slow)).loss
    figures |= _lived_loss(grid, briefing, library, lived)
    settings = {
        "gate.trials": trials,
        "gate.problems": PROBLEMS,
        "gate.slower": SLOWER,
        "gate.jitter": JITTER,
    }
    return figures, settings


def _measured_again(
    library: ProfileLibrary, slower: Mapping[str, float], rng: np.random.Generator
) -> ProfileLibrary:
    """The same runs with other seconds, as one measures them again on the same problems and
    seeds: what a run does repeats, how long it takes does not."""

    def factor() -> float:
        return float(np.exp(JITTER * rng.standard_normal()))

    return _slowed(library, slower, factor)


def _slowed(
    library: ProfileLibrary,
    slower: Mapping[str, float],
    factor: Callable[[], float] = lambda: 1.0,
) -> ProfileLibrary:
    profiles = {}
    for name, profile in library.items():
        times = [slower.get(name, 1.0) * factor() for _ in profile.recordings]
        runs = (
            replace(run, seconds=run.seconds * time, end=(run.end[0] * time, run.end[1]))
            for run, time in zip(profile.recordings, times, strict=True)
        )
        profiles[name] = replace(profile, recordings=tuple(runs))
    return ProfileLibrary(profiles=profiles, machine=library.machine)


def _lived_loss(
    grid: GridMission, briefing: Briefing, library: ProfileLibrary, missions: int
) -> Figures:
    """What the slow-down costs missions that are lived, calibrated anew, on the same seeds."""
    rate = SLOWER * grid.machine.rates["see"].per_work
    slow = brief(replace(grid, machine=grid.machine.with_rate("see", rate)), library)
    nets = []
    for each in (briefing, slow):
        monitor = each.monitor("expected")
        nets.append(np.array([each.live(monitor, seed).net for seed in range(missions)]))
    return {**bootstrap(nets, lambda before, after: before - after).under("gate.lived")}
