"""Why a robot that moves in metres goes on with its plan or takes up another, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from monitor.log_lines import Comparison, FrameLine, Log

_SAME = 5e-4  # metres of objective below which two plans are equally good


def headline(frame: FrameLine) -> str | None:
    """What was decided in a frame and why; None if no plans were compared and nothing happened."""
    if frame.motion is None:
        return None
    parts = [verdict(comparison) for comparison in frame.motion.comparisons]
    parts += [f"At {time:.2f} s: {what}." for time, what in frame.motion.events]
    return " ".join(parts) or None


def verdict(comparison: Comparison) -> str:
    """Why a plan was taken up, or was not."""
    gain = comparison.held - comparison.found
    apart = f"{metres(abs(gain))} {'better' if gain > 0 else 'worse'}"
    limit = f"the threshold of {metres(comparison.threshold)}"
    if comparison.idle:
        if comparison.taken:
            return f"Began a plan: it was {apart} than doing nothing, more than {limit}."
        if gain < _SAME:
            return (
                "Did nothing: no plan was found that is better, with an objective of "
                f"{metres(comparison.held)}."
            )
        return f"Did nothing: the best plan was {apart} than that, less than {limit}."
    if comparison.taken:
        return f"Switched: another plan was {apart}, more than {limit}."
    if abs(gain) < _SAME:
        return (
            "Stayed: nothing better was found than the plan in execution, whose objective is "
            f"{metres(comparison.held)}."
        )
    if gain < 0:
        return f"Stayed: the best alternative was {apart}."
    return f"Stayed: the best alternative was {apart}, less than {limit}."


def switching(log: Log) -> str:
    """How often and how profitably the plan was changed in a mission, and what happened."""
    comparisons = [each for _, each in _comparisons(log)]
    if not comparisons:
        return ""
    switches = [each for each in comparisons if each.taken and not each.idle]
    began = sum(each.taken and each.idle for each in comparisons)
    parts = [
        f"{_count(len(comparisons), 'comparison')}, {_count(began, 'plan')} begun from nothing, "
        f"{_count(len(switches), 'switch', 'switches')}"
    ]
    if switches:
        best = max(switches, key=lambda each: each.held - each.found)
        parts.append(
            f"The most profitable, at {best.time:.2f} s, made the objective "
            f"{metres(best.found)} instead of {metres(best.held)}"
        )
    frames = [frame.motion for frame in log.frames if frame.motion is not None]
    parts += [f"At {time:.2f} s: {what}" for motion in frames for time, what in motion.events]
    return ". ".join(parts) + "."


def opening(log: Log) -> int | None:
    """The frame of the most profitable switch, at which the page opens; None without one."""
    switches = [
        (each.held - each.found, -index)
        for index, each in _comparisons(log)
        if each.taken and not each.idle
    ]
    return -max(switches)[1] if switches else None


def drawn(frame: FrameLine) -> dict[str, Any] | None:
    """What the page draws of a frame, as plain data."""
    motion = frame.motion
    if motion is None:
        return None
    return {
        "track": motion.track,
        "radius": motion.radius,
        "plan": motion.plan,
        "goal": motion.goal,
        "discs": motion.discs,
        "clearance": motion.clearance,
        "cones": [
            [each.row, each.column, each.bearing, each.half_angle, each.reach, each.heard]
            for each in motion.cones
        ],
        "comparisons": [
            {
                "time": each.time,
                "held": each.held,
                "found": each.found,
                "idle": each.idle,
                "taken": each.taken,
                "other": each.other,
                "text": verdict(each),
            }
            for each in motion.comparisons
        ],
        "events": motion.events,
    }


def metres(length: float) -> str:
    """A length in a sentence, to the centimetre, a short one to the millimetre: .21 m, .012 m."""
    text = f"{length:.3f}" if length < 0.0995 else f"{length:.2f}"
    return f"{text.rstrip('0').rstrip('.').removeprefix('0') or '0'} m"


def _comparisons(log: Log) -> Iterator[tuple[int, Comparison]]:
    for frame in log.frames:
        for comparison in frame.motion.comparisons if frame.motion else ():
            yield frame.index, comparison


def _count(count: int, one: str, more: str = "") -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"
