"""A rover's whole turn, from photons to speeds: thirteen anytime modules on synthetic sensors.

It looks at its surroundings with a camera and a range sensor, finds out what is blocked, where it
stands and what ground it is on, plans a way to a beacon and drives it as fast as the ground allows.
"""

from experiments.rover.program import MACHINE, turn
from experiments.rover.turns import Turn, turns

__all__ = ["MACHINE", "Turn", "turn", "turns"]
