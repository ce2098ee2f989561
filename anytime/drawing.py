"""Figures of profiles as PNG, by matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anytime.library import read_profile
from anytime.pictures import COLOURS


def draw_profile(source: Path, target: Path) -> None:
    """Draw a stored profile: expected quality against time, a line for each input quality, with
    a 95 % band that is simultaneous over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    profile = read_profile(source)
    horizon = max(run.end[0] for run in profile.recordings) or 1.0
    times = np.linspace(0, horizon, 200)
    figure, axes = plt.subplots(figsize=(6, 4))
    lines = [("all inputs", profile)]
    if len(profile.inputs) == 1:
        name = profile.inputs[0]
        seen = [run.inputs[name] for run in profile.recordings]
        levels = sorted({round(float(q), 2) for q in np.quantile(seen, [0.1, 0.4, 0.7, 1.0])})
        lines = [(f"{name} {level:.2f}", profile.given(**{name: level})) for level in levels]
    styles = ("-", "--", "-.", ":")
    for index, (label, given) in enumerate(lines):
        colour = COLOURS[index % len(COLOURS)]
        low, high = given.band(times)
        axes.fill_between(times, low, high, color=colour, alpha=0.12, linewidth=0)
        axes.plot(times, given.mean(times), styles[index % 4], color=colour, label=label)
    axes.set(xlabel="time [s]", ylabel="expected quality", ylim=(0, 1.02), xlim=(0, horizon))
    axes.set_title(f"{profile.module} ({len(profile.problems)} problems, {profile.machine})")
    axes.legend(frameon=False)
    figure.savefig(target, dpi=150, bbox_inches="tight")
    plt.close(figure)
