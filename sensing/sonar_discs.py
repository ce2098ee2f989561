"""The obstacles that a sonar's echoes came from: a few discs that explain what was heard."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sensing.sonar_grid import Arc, SonarMap, wrapped

Array = NDArray[np.float64]

RADII = (0.08, 0.12, 0.18, 0.26)
"""Radii that are tried, in metres: a sonar hears no size."""
WIDEST = 0.1
"""Standard deviation in metres of where one disc may be; beyond, it becomes a chain of them."""

_STEPS = 25  # bearings that are tried across a cone
_OUTWARD = np.radians([20.0, 40.0, 60.0, 80.0])  # and out of it, from the ends of its arc
_TOUCHING = 0.1  # metres from a sonar on NAO's chest to what touches its arms or feet
_GRAZE = 0.04  # metres by which a disc may reach into a cone unheard
_DOUBT = 0.5  # echoes by which a disc that is as good as the best may be worse
_REFUTED = 2  # later readings that contradict a disc which is gone: one may be a lost echo


@lru_cache(maxsize=2)  # a robot asks for those of its newest map again and again
def obstacles(heard: SonarMap) -> Array:
    """Discs to keep away from, the nearest to the robot first: x, y, radius in world, float [n, 3].

    The latest echo that is not explained yet is explained by that disc on its arc which agrees best
    with everything else that was heard; it explains other echoes, too. Where several discs are as
    good, one stands in their middle, or, if they are far apart, a chain of discs covers them all.
    An echo for which later readings leave no disc is of something that has gone. The array is
    read-only.
    """
    arcs = list(reversed(heard.arcs))
    told = np.array([arc.told for arc in arcs])
    unexplained = np.isfinite(told)
    found: list[tuple[float, float, float]] = []
    for index, arc in enumerate(arcs):
        if not unexplained[index]:
            continue
        unexplained[index] = False
        discs = _candidates(arc)
        agreement, refuted = _agreement(discs, arcs)
        possible = refuted[:, :index].sum(axis=1) < _REFUTED
        if not possible.any():
            continue
        discs, agreement, refuted = discs[possible], agreement[possible], refuted[possible]
        score = agreement.sum(axis=1) - refuted.sum(axis=1)
        good = score >= score.max() - _DOUBT
        found += _chain(discs[good], score[good])
        unexplained &= ~(agreement[good] > 0).any(axis=0)
    discs = _nearest_first(np.array(found).reshape(-1, 3), heard)
    discs.flags.writeable = False
    return discs


def _agreement(discs: Array, arcs: Sequence[Arc]) -> tuple[Array, NDArray[np.bool_]]:
    """How well each disc explains each echo, 0 to 1, and whether it would have come from nearer.

    Both [discs, arcs].
    """
    rows = [(a.cone.x, a.cone.y, a.cone.bearing, a.cone.half_angle, a.told, a.thick) for a in arcs]
    x, y, bearing, half, told, thick = np.array(rows).T
    blurred = np.array([arc.blurred for arc in arcs])
    right, up = discs[:, :1] - x, discs[:, 1:2] - y
    distance, radius = np.hypot(right, up), discs[:, 2:]
    side = np.abs(wrapped(np.arctan2(up, right) - bearing))
    off = np.maximum(side - half, 0.0)  # the nearest point of the disc is on the edge of the cone

    def nearest(radius: Array) -> Array:
        along = distance * np.cos(off)
        chord = radius**2 - (distance * np.sin(off)) ** 2
        near = np.where(chord >= 0, along - np.sqrt(np.maximum(chord, 0.0)), np.inf)
        return np.where(off < math.pi / 2, near, np.inf)

    near = nearest(radius)
    error = np.full(near.shape, np.inf)
    np.subtract(near, told, out=error, where=np.isfinite(near) & np.isfinite(told))
    error = np.where(blurred & (error < 0), 0.0, error)
    core = nearest(np.maximum(radius - _GRAZE, 0.0))
    refuted = ~blurred & (core < told - thick - _GRAZE)
    return np.maximum(1.0 - (error / thick) ** 2, 0.0), refuted


def _candidates(arc: Arc) -> Array:
    """Discs whose nearest point to the sonar, in the cone, is on the arc, float [n, 3].

    The nearest point of those whose middle is outside the cone is at an end of the arc.
    """
    cone = arc.cone
    across = np.linspace(-1, 1, _STEPS) * cone.half_angle
    beyond = np.repeat([-cone.half_angle, cone.half_angle], len(_OUTWARD))
    aside = np.concatenate([across, beyond])[:, None]
    outward = np.concatenate([across, beyond + np.array([*-_OUTWARD, *_OUTWARD])])[:, None]
    radius = np.array(RADII)[None, :]
    # what is too near to be measured may be anywhere up to there
    distances = np.linspace(min(_TOUCHING, arc.told), arc.told, 4) if arc.blurred else [arc.told]
    found: list[Array] = []
    for far in distances:
        x = cone.x + far * np.cos(cone.bearing + aside) + radius * np.cos(cone.bearing + outward)
        y = cone.y + far * np.sin(cone.bearing + aside) + radius * np.sin(cone.bearing + outward)
        found.append(np.column_stack([x.ravel(), y.ravel(), np.broadcast_to(radius, x.shape).flat]))
    return np.concatenate(found)


def _chain(discs: Array, score: Array) -> list[tuple[float, float, float]]:
    """One disc in the middle of those that are as good, or chains of the halves of what is wide."""
    middle = discs.mean(axis=0)
    apart = discs[:, :2] - middle[:2]
    spread, axes = np.linalg.eigh(apart.T @ apart / len(discs))
    side = apart @ axes[:, 1] > 0
    if spread[1] <= WIDEST**2 or side.all() or not side.any():
        return [(float(middle[0]), float(middle[1]), float(middle[2]))]
    return _chain(discs[side], score[side]) + _chain(discs[~side], score[~side])


def _nearest_first(discs: Array, heard: SonarMap) -> Array:
    if heard.echoes is None:
        return discs
    x, y, _ = heard.echoes.pose_in_world
    far = np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2]
    return discs[np.argsort(far, kind="stable")]
