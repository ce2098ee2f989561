"""Figures of mission logs as PNG, by matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anytime.pictures import COLOURS
from monitor.logs import read_log


def draw_log(source: Path, target: Path) -> None:
    """Draw a mission: who worked when, frame by frame, and the net value so far."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    log = read_log(source)
    figure, (lanes, value) = plt.subplots(
        2, 1, figsize=(8, 5), sharex=True, height_ratios=(3, 2), constrained_layout=True
    )
    names = [*log.mission.labels, "drive"]
    hatches = ("", "//", "..", "xx")
    least = 0.002 * (log.frames[-1].ended if log.frames else 1.0)  # seconds, so wide as to be seen
    for row, name in enumerate(names):
        spans = [
            (call.started, max(call.elapsed, least))
            for frame in log.frames
            for call in frame.calls
            if call.label == name
        ]
        if name == "drive":
            spans = [(frame.started, frame.driven) for frame in log.frames]
        lanes.broken_barh(
            spans,
            (row - 0.4, 0.8),
            facecolor=COLOURS[row % len(COLOURS)],
            hatch=hatches[row % len(hatches)],
            edgecolor="white",
            linewidth=0,  # white edges would hide short bars
        )
    lanes.set_yticks(np.arange(len(names)), names)
    lanes.invert_yaxis()
    lanes.set_title(f"{log.mission.name}, {log.mission.policy}, seed {log.mission.seed}")
    ends = [frame.ended for frame in log.frames]
    value.plot(ends, [frame.so_far for frame in log.frames], color=COLOURS[0])
    value.set(xlabel="time [s]", ylabel="net value if\nit ended now")
    figure.savefig(target, dpi=150)
    plt.close(figure)
