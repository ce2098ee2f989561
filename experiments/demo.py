"""The main job: a robot crosses an office, monitored and by the baselines on the same seeds."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anytime import ProfileLibrary, WorkClock, measure
from experiments.benchmarks.figures import Benchmark
from experiments.comparing import margins
from monitor.logs import read_log
from monitor.page import write_page
from monitor.reports import Report
from monitor.robots.briefing import Briefing, brief
from monitor.robots.grid_missions import GridMission
from monitor.robots.lessons import user_memory
from monitor.robots.navigation import frame_problems, navigate

PROBLEMS = 30
SECONDS = 8.0  # of the work clock, for each run that is measured
# How the policies are called in the table, and what the monitor calls them.
ROWS = {"monitored": "expected", "min": "min", "max": "max", "fixed": "fixed"}
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Demo:
    """What the demo found: the briefing, every mission by policy, and the figures."""

    briefing: Briefing
    reports: dict[str, tuple[Report, ...]]
    benchmark: Benchmark

    def __repr__(self) -> str:
        figures = self.benchmark.figures
        lines = [
            f"{self.briefing.grid.mission.name}: {len(self.reports['monitored'])} missions for "
            "each policy, on the same seeds",
            f"{'policy':<12}{'net value':>10}{'reached':>9}{'seconds':>9}"
            f"{'energy':>8}{'frames':>8}",
        ]
        for name, reports in self.reports.items():
            lines.append(
                f"{name:<12}{np.mean([r.net for r in reports]):>10.1f}"
                f"{np.mean([bool(r) for r in reports]):>9.0%}"
                f"{np.mean([r.seconds for r in reports]):>9.1f}"
                f"{np.mean([r.energy for r in reports]):>8.1f}"
                f"{np.mean([len(r.frames) for r in reports]):>8.1f}"
            )
        lines += [
            _promise(figures),
            _margin("the better of MIN and MAX", figures, "value.margin"),
        ]
        if "value.margin_fixed" in figures:
            lines.append(_margin("the tuned fixed division", figures, "value.margin_fixed"))
        return "\n".join(lines)


def _promise(figures: Mapping[str, float | int | None]) -> str:
    gap = float(figures["gap.promised"] or 0.0)
    kept = "less" if gap > 0 else "more"
    return f"promised {figures['value.promised']:.1f} at the start, achieved {abs(gap):.1%} {kept}"


def _margin(rival: str, figures, key: str) -> str:
    low, high = figures[f"{key}_low"], figures[f"{key}_high"]
    return f"over {rival}: {figures[key]:+.1%} [{low:+.1%}, {high:+.1%}]"


def measured(
    grid: GridMission,
    seed: int,
    tell: Callable[[int, int], None] | None = None,
    problems: int = PROBLEMS,
) -> ProfileLibrary:
    """Profiles of seeing and planning on a mission's own floor, in the machine's seconds."""
    frames = list(frame_problems(grid.scene, np.random.default_rng(seed), problems))
    return measure(
        navigate,
        frames,
        seconds=SECONDS,
        clock=lambda: WorkClock(grid.machine),
        seed=seed,
        progress=tell,
    )


def run(grid: GridMission, *, seeds: Sequence[int], tell: Tell, seed: int = 0) -> Demo:
    """Measure, compile, and live the mission once for each seed and policy.

    tell: called with (what is done, done, total).
    """
    library = measured(grid, seed, lambda done, total: tell("measuring", done, total))
    tell("calibrating", 0, 1)
    briefing = brief(grid, library, memory=user_memory())
    reports: dict[str, tuple[Report, ...]] = {}
    total = len(ROWS) * len(seeds)
    for row, policy in ROWS.items():
        monitor = briefing.monitor(policy)
        lived: list[Report] = []
        for index in seeds:
            lived.append(briefing.live(monitor, index))
            tell("living missions", len(reports) * len(seeds) + len(lived), total)
        reports[row] = tuple(lived)
    return Demo(briefing, reports, _figures(grid, reports, seed))


def _figures(grid: GridMission, reports: dict[str, tuple[Report, ...]], seed: int) -> Benchmark:
    nets = {row: np.array([report.net for report in lived]) for row, lived in reports.items()}
    figures: dict[str, float | int | None] = {
        f"value.{row}": float(net.mean()) for row, net in nets.items()
    }
    promised = float(np.mean([report.promised for report in reports["monitored"]]))
    figures["value.promised"] = promised
    figures["gap.promised"] = 1.0 - figures["value.monitored"] / promised  # type: ignore[operator]
    figures |= margins(nets)
    for row, lived in reports.items():
        figures[f"reached.{row}"] = float(np.mean([bool(report) for report in lived]))
    settings = {
        "mission": grid.mission.name,
        "seeds": len(reports["monitored"]),
        "problems": PROBLEMS,
        "machine": grid.machine.name,
        "value": grid.mission.value.kind,
    }
    return Benchmark("demo", figures, settings, seed)


def write_report(demo: Demo, folder: Path, seed: int) -> Path:
    """Live one seed again under each policy, logged, and write `report.html` about it."""
    logs = []
    for row, policy in ROWS.items():
        file = folder / "anytime-run" / f"{row}.jsonl"
        demo.briefing.live(demo.briefing.monitor(policy), seed, log=file)
        logs.append(read_log(file))
    table = f"<pre>{html.escape(repr(demo))}</pre>"
    title = f"{demo.briefing.grid.mission.name}, seed {seed}"
    return write_page(logs, folder / "report.html", names=tuple(ROWS), summary=table, title=title)
