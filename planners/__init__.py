"""How a robot finds its way: path finding, abstract plans, and avoidance of what is in the way."""

from planners.avoidance import Walk, blind_quality, blind_walk, walk
from planners.path_finding import Path, astar, length_of, route, textbook_astar, weighted_astar

__all__ = [
    "Path",
    "Walk",
    "astar",
    "blind_quality",
    "blind_walk",
    "length_of",
    "route",
    "textbook_astar",
    "walk",
    "weighted_astar",
]
