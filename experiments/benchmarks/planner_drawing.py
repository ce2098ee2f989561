"""The picture of the planner's benchmark: quality against work and time, planner by planner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from experiments.benchmarks.planner_races import Race, Track, curve, mean_quality

_SHARES = np.geomspace(0.005, 1.5, 200)
_STYLES = {
    "atp": ("ATP", "#0b6e4f", "-", 2.2),
    "ara": ("ARA*", "#c44536", "--", 1.3),
    "rwa": ("restarting WA*", "#7a5195", "-.", 1.3),
    "wa": ("WA* 1.5", "#888888", ":", 1.3),
    "paper": ("ATP of the paper", "#d79921", (0, (5, 2, 1, 2)), 1.3),
}


def draw(
    raced: Mapping[str, Sequence[Race]], against_time: Mapping[str, Sequence[Track]], path: Path
) -> Path:
    """Draw the mean quality of the best plan so far against the share of A*'s work, and ATP's
    against that of its time, family by family, into a PNG; returns its path."""
    from matplotlib.figure import Figure

    drawn = {key: found for key, found in raced.items() if found}
    columns = 3
    rows = -(-len(drawn) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.0 * rows), layout="constrained")
    axes = np.atleast_1d(figure.subplots(rows, columns, sharex=True, sharey=True)).ravel()
    for axis, (key, found) in zip(axes, drawn.items(), strict=False):
        for name, (label, colour, style, width) in _STYLES.items():
            if name not in found[0].tracks:
                continue
            quality = curve(found, name, _SHARES)
            axis.plot(_SHARES, quality, color=colour, linestyle=style, linewidth=width, label=label)
        if key in against_time:
            tracks = against_time[key]
            end = max((track[-1][0] for track in tracks if track), default=0.0)
            shares = _SHARES[: np.searchsorted(_SHARES, end)]  # there timing ended
            quality = mean_quality(tracks, shares)
            axis.plot(shares, quality, color="#222222", linewidth=0.9, label="ATP, of A*'s time")
        axis.set_title(f"{key} ({len(found)})", fontsize=10)
        axis.set_xscale("log")
        axis.set_xlim(0.005, 1.5)
        axis.set_ylim(0.85, 1.003)
        axis.axhline(0.97, color="#bbbbbb", linewidth=0.6)
        axis.grid(alpha=0.25)
    for axis in axes[len(drawn) :]:
        axis.set_visible(False)
    axes[0].legend(fontsize=8, loc="lower right")
    figure.supxlabel("share of A*'s expansions; thin black: of its time")
    figure.supylabel("mean quality of the best plan so far")
    figure.savefig(path, dpi=110)
    return path
