"""The rover's turn as one program, and a machine to run it on."""

from __future__ import annotations

import compiler
from anytime import Machine
from experiments.rover.driving import plan, shortcut, smooth, speeds
from experiments.rover.seeing import (
    classify,
    denoise,
    despeckle,
    expose,
    fuse,
    inflate,
    localise,
    scan,
    segment,
)

_SECONDS = {
    "expose": 2e-3,
    "scan": 1e-3,
    "denoise": 4e-4,
    "segment": 5e-4,
    "despeckle": 5e-4,
    "fuse": 6e-4,
    "classify": 2e-4,
    "localise": 5e-5,
    "inflate": 1e-3,
    "plan": 1e-5,
    "shortcut": 1e-4,
    "smooth": 1e-4,
    "speeds": 2e-4,
}  # of a unit of each module's work
MACHINE = Machine("rover")
for _name, _rate in _SECONDS.items():
    MACHINE = MACHINE.with_rate(_name, _rate)


@compiler.program
def turn(sensors, start, goal):
    """One turn of the rover."""
    image = denoise(expose(sensors))
    ranges = despeckle(scan(sensors))
    seen = segment(image)
    costs = inflate(fuse(seen, localise(ranges, seen)))
    way = smooth(shortcut(plan(costs, start, goal), costs))
    return speeds(way, classify(image))
