"""How a robot finds its way: path finding, abstract plans, and avoidance of what is in the way."""

from .atp import find_path, steps
from .avoidance import Walk, blind_quality, blind_walk, walk
from .grids import Grid
from .multipath import MultiPath, Segment
from .path_finding import Path, astar, length_of, route, textbook_astar, weighted_astar

__all__ = [
    "Grid",
    "MultiPath",
    "Path",
    "Segment",
    "Walk",
    "astar",
    "blind_quality",
    "blind_walk",
    "find_path",
    "length_of",
    "route",
    "steps",
    "textbook_astar",
    "walk",
    "weighted_astar",
]
