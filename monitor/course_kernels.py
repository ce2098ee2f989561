"""Kernels of courses: what it is worth to walk a frame at each speed, now and in every state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from anytime.machine_code import njit

Floats = NDArray[np.float64]


@njit(cache=True, nogil=True)
def best_speed(
    now: float,
    left: float,
    thinking: float,
    contract: float,
    scale: float,
    walked: Floats,
    changes: Floats,
    stops: Floats,
    speeds: Floats,
    power: Floats,
    idle: float,
    value: Floats,
    worth: Floats,
    tick: float,
    cell: float,
) -> tuple[float, int]:
    """(worth, index of the speed) of the best speed for a frame that begins or goes on now.

    now: in ticks. left: length to be walked in all. thinking: seconds that the frame's calls still
    take; contract: those of a frame. walked, changes, stops: [O] equally likely outcomes. power:
    [V] price of a second at each speed; idle: of one of standing. value: [T + 1] of completing at
    each tick. worth: [T + 1, F] of frames that begin later.
    """
    last, rows = worth.shape[0] - 1, worth.shape[1]
    top, chosen = -np.inf, 0
    for action in range(len(speeds)):
        total = 0.0
        for outcome in range(len(walked)):
            drive = min(walked[outcome], left / scale) / speeds[action]
            total -= power[action] * drive
            if walked[outcome] * scale >= left:  # it arrives; the last frame only walks
                at = now + drive / tick
                if at < last:
                    k = int(at)
                    total += value[k] + (at - k) * (value[k + 1] - value[k])
                continue
            frame = max(thinking, drive) + stops[outcome] * contract
            total -= idle * (frame - drive)
            at = now + max(frame / tick, 1.0)
            if at >= last:
                continue
            after = min((left - walked[outcome] * scale) * changes[outcome] / cell, rows - 1.0)
            j, k = min(int(after), rows - 2), int(at)
            u = after - j
            early = worth[k, j] + u * (worth[k, j + 1] - worth[k, j])
            late = worth[k + 1, j] + u * (worth[k + 1, j + 1] - worth[k + 1, j])
            total += early + (at - k) * (late - early)
        if total > top:
            top, chosen = total, action
    return top / len(walked), chosen


@njit(cache=True, nogil=True)
def solve(
    value: Floats,
    tick: float,
    cell: float,
    beyond: Floats,
    walked: Floats,
    changes: Floats,
    stops: Floats,
    contract: float,
    speeds: Floats,
    power: Floats,
    idle: float,
    worth: Floats,
) -> None:
    """Fill worth, [T + 1, F], backwards in time; that of the last tick stays as it is.

    tick: seconds. cell: length from one column to the next. beyond: [B] lengths from which each
    row of outcomes, [B, O], holds. The rest as in `best_speed`.
    """
    for now in range(worth.shape[0] - 2, -1, -1):
        row = 0
        for place in range(worth.shape[1]):
            left = place * cell
            while row + 1 < len(beyond) and beyond[row + 1] <= left:
                row += 1
            worth[now, place], _ = best_speed(
                now,
                left,
                contract,
                contract,
                1.0,
                walked[row],
                changes[row],
                stops[row],
                speeds,
                power,
                idle,
                value,
                worth,
                tick,
                cell,
            )
