"""One problem's runs on inputs of several qualities: how much each counts for a quality asked."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
SAME = 1e-12  # qualities closer than this are one
NEAREST = 6  # runs among which corners are sought


def stratum_weights(points: Floats, target: Floats, there: Mask) -> Floats:
    """Weights [n, R] of the runs of n problems for the input qualities asked for, each sum 1.

    points: [n, R, inputs] quality of what a run was fed with; target: [n, inputs] asked for;
    there: [n, R] whether there is such a run, and a problem without any has no weight. Linear
    between the nearest runs: two of one input, the corners of a triangle of several; never
    extrapolated. Without inputs all runs count alike.
    """
    inputs = points.shape[2]
    if not inputs:
        return there / np.maximum(there.sum(axis=1, keepdims=True), 1)
    if inputs == 1:
        return _between(points[:, :, 0], target[:, 0], there)
    return _among(points, target, there)


def _between(points: Floats, target: Floats, there: Mask) -> Floats:
    """Linear interpolation weights among the points [n, R]; equal points share theirs."""
    asked = target[:, None]
    low = np.where(there & (points <= asked + SAME), points, -np.inf).max(axis=1)
    high = np.where(there & (points >= asked - SAME), points, np.inf).min(axis=1)
    low, high = np.where(np.isfinite(low), low, high), np.where(np.isfinite(high), high, low)
    apart = high - low >= SAME
    share = np.where(apart, (target - low) / np.where(apart, high - low, 1.0), 0.0)
    weights = np.zeros(points.shape)
    for level, part in ((low, 1.0 - share), (high, share)):
        same = there & (np.abs(points - level[:, None]) < SAME)
        weights += same * (part / np.maximum(same.sum(axis=1), 1))[:, None]
    return weights


def _among(points: Floats, target: Floats, there: Mask) -> Floats:
    """Barycentric weights in the triangle (or edge, or point) of runs that comes nearest to the
    target and, of those, is the smallest: Delaunay's, in a metric that counts it as far when one
    input is better and another worse. So what all inputs together do is interpolated along their
    diagonal, and a module that is as good as its worst input is not taken for one as good as
    their mean.
    """
    corner = _corners(points, there)
    every, there = there, there & (corner == np.arange(points.shape[1]))
    count = len(points)
    away = points - target[:, None, :]
    off = away - away.mean(axis=2, keepdims=True)
    size = np.where(there, (away**2).sum(axis=2) + (off**2).sum(axis=2), np.inf)
    near = np.argsort(size, axis=1, kind="stable")[:, :NEAREST]
    rows = np.arange(count)
    away, size = away[rows[:, None], near], size[rows[:, None], near]
    best = np.full(count, np.inf)
    found = np.zeros(near.shape)
    for corners in (c for n in (1, 2, 3) for c in combinations(range(near.shape[1]), n)):
        shares, inside = _barycentric(away[:, corners, :])
        missed = ((shares[:, :, None] * away[:, corners, :]).sum(axis=1) ** 2).sum(axis=1)
        with np.errstate(invalid="ignore"):  # 0 · inf, of a corner that is not there nor needed
            far = np.where(shares > 0, shares * size[:, corners], 0.0).sum(axis=1)
        cost = 1e6 * missed + far
        better = rows[inside & (cost < best - SAME)]
        found[better] = 0.0
        found[better[:, None], corners] = shares[better]
        best[better] = cost[better]
    weights = np.zeros(there.shape)
    weights[rows[:, None], near] = found
    sizes = np.bincount((rows[:, None] * points.shape[1] + corner).ravel(), minlength=every.size)
    shared = weights / np.maximum(sizes.reshape(every.shape), 1)
    return np.where(every, np.take_along_axis(shared, corner, axis=1), 0.0)


def _corners(points: Floats, there: Mask) -> NDArray[np.intp]:
    """The place of one of the points that are equal to each, [n, R]: the corner, whose weight they
    share."""
    runs = np.arange(points.shape[1])
    # Powers of π are independent of each other: sums of qualities times them are equal for equal
    # qualities alone. What is not there is equal to nothing.
    key = points @ np.pi ** -np.arange(points.shape[2], dtype=float)
    key = np.where(there, key, 2.0 * points.shape[2] + runs)
    order = np.argsort(key, axis=1, kind="stable")
    fresh = np.diff(np.take_along_axis(key, order, axis=1), axis=1, prepend=-1.0) > SAME
    first = np.maximum.accumulate(np.where(fresh, runs, 0), axis=1)
    corner = np.empty_like(order)
    np.put_along_axis(corner, order, np.take_along_axis(order, first, axis=1), axis=1)
    return corner


def _barycentric(away: Floats) -> tuple[Floats, Mask]:
    """Weights [n, corners] of the point nearest to 0 on the plane through the corners
    [n, corners, inputs], and whether it lies inside, [n]."""
    first, edges = away[:, 0, :], away[:, 1:, :] - away[:, :1, :]
    if edges.shape[1] == 0:
        return np.ones((len(away), 1)), np.ones(len(away), dtype=bool)
    along = -(edges * first[:, None, :]).sum(axis=2)
    lengths = (edges**2).sum(axis=2)
    if edges.shape[1] == 1:
        rest = along / np.maximum(lengths, SAME)
        flat = lengths[:, 0] < SAME
    else:
        across = (edges[:, 0, :] * edges[:, 1, :]).sum(axis=1)
        area = lengths[:, 0] * lengths[:, 1] - across**2
        flat = area < 1e-9
        area = np.where(flat, 1.0, area)
        one = (along[:, 0] * lengths[:, 1] - along[:, 1] * across) / area
        other = (along[:, 1] * lengths[:, 0] - along[:, 0] * across) / area
        rest = np.stack([one, other], axis=1)
    shares = np.concatenate([1.0 - rest.sum(axis=1, keepdims=True), rest], axis=1)
    inside = (shares >= -1e-9).all(axis=1) & ~flat
    return np.clip(shares, 0.0, 1.0), inside
