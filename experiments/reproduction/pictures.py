"""Pictures of a reproduction: vector graphics for the page, and the same as an image for others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anytime.pictures import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = ("-", "--", "-.", ":", (0, (5, 2, 1, 2)))
"""One for each colour, so that lines are told apart in grey too."""
_DOTS = 150  # an inch, of the image
_SALT: Any = {"svg.hashsalt": "anytime", "font.size": 9}  # equal pictures are equal bytes


@dataclass(frozen=True)
class Picture:
    """file: an SVG; beside it lies a PNG of the same name. caption: what it shows, and of how many.

    part: of the claims that it belongs to.
    """

    part: str
    file: Path
    caption: str


def new_figure(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure, width x height in inches, and its panels side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(np.atleast_1d(np.asarray(figure.subplots(1, columns))))


def save(figure: Figure, folder: Path, part: str, name: str, caption: str) -> Picture:
    """Write `part-name.svg` and `.png`."""
    from matplotlib import rc_context

    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{part}-{name}.svg"
    with rc_context(_SALT):
        figure.savefig(file, metadata={"Date": None})
        figure.savefig(file.with_suffix(".png"), dpi=_DOTS, metadata={"Software": None})
    return Picture(part, file, caption)


def curve(
    axes: Axes, place: int, x: NDArray[Any], samples: NDArray[Any], label: str, **style: Any
) -> None:
    """The mean of qualities, [n, X], with its 95 % interval, in the colour and style of a place."""
    mean = samples.mean(axis=0)
    half = 1.96 * samples.std(axis=0, ddof=1) / np.sqrt(len(samples))
    colour = COLOURS[place]
    axes.plot(x, mean, linestyle=STYLES[place], color=colour, label=label, **style)
    low, high = np.clip(mean - half, 0.0, None), np.clip(mean + half, None, 1.0)
    axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
