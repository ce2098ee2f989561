"""The monitored mission against MIN, MAX, a raced fixed division and hindsight; arriving or
saying why not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments import crossings, shipped
from experiments.benchmarks.figures import Benchmark
from experiments.comparing import bootstrap, margins
from experiments.demo import ROWS, measured
from experiments.hindsight import hindsight
from experiments.racing import race
from monitor.endings import Ending
from monitor.missions import Value
from monitor.reports import Report
from monitor.robots.briefing import Briefing, brief
from monitor.robots.grid_missions import read_mission

# The other task values, with constants at which the division matters as much.
VALUES = (
    Value("linear", 100.0, 300.0),
    Value("exponential", 100.0, 120.0),
    Value("hard", 100.0, 110.0),
)
SEEDS, HINDSIGHT_SEEDS, CANDIDATES = 100, 30, 300


def measure(
    *,
    quick: bool = False,
    full: bool = False,
    seed: int = 0,
    maps: Path | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> Benchmark:
    """Net values on the same seeds for several task values, hindsight, and 2 × 500 crossings."""
    settings: dict[str, object] = {"seeds": SEEDS, "not_measured": {}}
    grid = read_mission(shipped.mission_path())
    library = measured(grid, seed)
    briefing = brief(grid, library)
    figures: dict[str, float | int | None] = {}
    if not quick:
        progress("racing fixed divisions")
        briefing = _with_raced(briefing)
        settings["fixed"] = dict(briefing.grid.mission.fixed)
    progress(f"{grid.mission.value.kind} value: {SEEDS} seeds, {len(ROWS)} policies")
    reports = _live(briefing)
    figures |= _values(reports)
    if quick:
        for key in ("value.hindsight", "gap.hindsight", "gap.normalised"):
            figures[key] = None
            settings["not_measured"][key] = "minutes of search: without --quick"  # type: ignore[index]
    else:
        progress(f"hindsight: {HINDSIGHT_SEEDS} seeds, {CANDIDATES} candidates each")
        figures |= _hindsight(briefing, reports)
        for value in VALUES:
            progress(f"{value.kind} value: racing, then {SEEDS} seeds")
            other = replace(grid, mission=replace(grid.mission, value=value))
            figures |= {
                f"{value.kind}.{key}": figure
                for key, figure in _values(_live(_with_raced(brief(other, library)))).items()
            }
    count = 30 if quick else 100
    program = crossings.compiled()
    for key, reachable, wanted in (
        ("connected.reached", True, Ending.REACHED),
        ("unreachable.named", False, Ending.UNREACHABLE),
    ):
        right: list[bool] = []
        for kind in crossings.KINDS:
            progress(f"{key}: {count} maps of {kind}")
            right += [
                crossings.cross(
                    program, crossings.crossing(kind, i, reachable=reachable, seed=seed)
                )
                is wanted
                for i in range(count)
            ]
        figures[key] = float(np.mean(right))
        figures[f"{key}_maps"] = len(right)
    return Benchmark("mission", figures, settings, seed)


def _with_raced(briefing: Briefing) -> Briefing:
    best = race(briefing)
    fixed = {"see": best.see, "find_path": best.find_path, "speed": best.speed}
    mission = replace(briefing.grid.mission, fixed=fixed)
    return replace(briefing, grid=replace(briefing.grid, mission=mission))


def _live(briefing: Briefing) -> dict[str, list[Report]]:
    reports: dict[str, list[Report]] = {}
    for row, policy in ROWS.items():
        monitor = briefing.monitor(policy)
        reports[row] = [briefing.live(monitor, seed) for seed in range(SEEDS)]
    return reports


def _values(reports: dict[str, list[Report]]) -> dict[str, float | int | None]:
    nets = {row: np.array([report.net for report in lived]) for row, lived in reports.items()}
    figures: dict[str, float | int | None] = {
        f"value.{row}": float(net.mean()) for row, net in nets.items()
    }
    promised = float(np.mean([report.promised for report in reports["monitored"]]))
    figures["value.promised"] = promised
    figures["gap.promised"] = 1.0 - float(nets["monitored"].mean()) / promised
    return figures | margins(nets)


def _hindsight(
    briefing: Briefing, reports: dict[str, list[Report]]
) -> dict[str, float | int | None]:
    best = np.array(
        [
            hindsight(briefing, seed, [lived[seed] for lived in reports.values()], CANDIDATES)
            for seed in range(HINDSIGHT_SEEDS)
        ]
    )
    nets = {
        row: np.array([report.net for report in lived[:HINDSIGHT_SEEDS]])
        for row, lived in reports.items()
    }
    worst = min(("min", "max", "fixed"), key=lambda row: float(nets[row].mean()))

    def gap(monitored: float, found: float) -> float:
        return 1.0 - monitored / found

    def normalised(monitored: float, found: float, least: float) -> float:
        return (found - monitored) / (found - least)

    figures: dict[str, float | int | None] = {"value.hindsight": float(best.mean())}
    figures |= bootstrap([nets["monitored"], best], gap).under("gap.hindsight")
    columns = [nets["monitored"], best, nets[worst]]
    return figures | bootstrap(columns, normalised).under("gap.normalised")
