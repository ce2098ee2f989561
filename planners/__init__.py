"""How a robot finds its way: path finding, abstract plans, and avoidance of what is in the way."""

from planners.atp import find_path, steps
from planners.avoidance import Walk, blind_quality, blind_walk, walk
from planners.grids import Grid
from planners.multipath import MultiPath, Segment
from planners.paper_atp import steps as paper_steps
from planners.path_finding import Path, astar, length_of, route, textbook_astar, weighted_astar

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
    "paper_steps",
    "route",
    "steps",
    "textbook_astar",
    "walk",
    "weighted_astar",
]
