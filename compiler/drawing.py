"""Figures of compiled programs as PNG, by matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anytime.pictures import COLOURS
from compiler import baselines
from compiler.loading import inspect


def draw_schedule(source: Path, target: Path) -> None:
    """Draw a compiled program: its profile above MIN and MAX [ZR93 Fig. 8], what it
    promises on problems never seen, and the shares."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    compiled = inspect(source)
    times = np.linspace(max(compiled.least, 1e-9), max(compiled.frontier.budgets[-1], 1e-6), 300)
    figure, (above, below) = plt.subplots(2, 1, figsize=(6, 6.4), sharex=True)
    # All three by the tables; what is promised was calibrated on problems never seen.
    by_tables = baselines.divided(compiled.tables, compiled.frontier, times)
    above.plot(times, by_tables, color=COLOURS[0], label="compiled")
    promised = [compiled.promise(t) for t in times]
    above.plot(times, promised, color=COLOURS[0], linewidth=0.8, alpha=0.6, label="promised")
    above.plot(
        times, baselines.minimal(compiled.tables, times), "--", color=COLOURS[1], label="MIN"
    )
    above.plot(times, baselines.maximal(compiled.tables, times), ":", color=COLOURS[3], label="MAX")
    above.set(ylabel="expected quality", ylim=(0, 1.02), title=compiled.name)
    above.legend(framealpha=0.9)
    shares = np.array([list(compiled.allocate(t).shares.values()) for t in times]) / times[:, None]
    hatches = ("", "//", "..", "xx")
    bottom = np.zeros(len(times))
    for index, label in enumerate(compiled.labels):
        below.fill_between(
            times,
            bottom,
            bottom + shares[:, index],
            label=label,
            facecolor=COLOURS[index % len(COLOURS)],
            hatch=hatches[index % 4],
            alpha=0.6,
            edgecolor="white",
        )
        bottom += shares[:, index]
    below.set(xlabel="budget [s]", ylabel="share of the budget", ylim=(0, 1))
    below.legend(framealpha=0.9)  # it lies on the areas
    figure.savefig(target, dpi=150, bbox_inches="tight")
    plt.close(figure)
