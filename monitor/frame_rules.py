"""The paper's way to act in a decision process: contract and speed for each frame. [ZR93] §5."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor import decision_kernels as kernels
from monitor.decision_process import DecisionProcess, Moment

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
PATIENCE = 1.5  # contracts considered, in times that a planner needs for its best plan


@dataclass(frozen=True)
class FrameRule:
    """Decides when a frame begins.

    contracts, speeds: [F + 1, T, Y] ticks of thinking and index of the speed, by frames still to
    plan, tick, and level of the plan in hand (0: standing without one). gain: how strongly the
    speed answers within the frame to planning and execution that are ahead or behind; 0 never.
    """

    contracts: Whole
    speeds: Whole
    gain: float = 0.0


def constant_rule(process: DecisionProcess, contract: int, speed: int) -> FrameRule:
    """The same contract and speed (its index) in every frame."""
    ticks, frames, _, levels = process.shape
    shape = (frames, ticks, levels)
    return FrameRule(np.full(shape, contract), np.full(shape, speed))


def paper_rule(process: DecisionProcess, gain: float = 0.0) -> FrameRule:
    """t_c = argmax VOT − COE for each frame, with the speed, as if all went as expected.

    With a gain, the rule of four cases acts within the frames. [ZR93] §5.
    """
    ticks, frames, _, levels = process.shape
    shape = (frames, ticks, levels)
    contracts, speeds = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    decide = argmax_contract(process)
    for f, t, hand in np.ndindex(*shape):
        begun = Moment(f, process.lengths[hand], 0, t)
        contracts[f, t, hand], speeds[f, t, hand] = decide(begun)
    return FrameRule(contracts, speeds, gain)


def argmax_contract(process: DecisionProcess) -> Callable[[Moment], tuple[int, int]]:
    """The decision between frames: (t_c, index of the speed) = argmax VOT − COE. [ZR93] §5.

    A frame takes the longer of its contract and of its walk; the last one is only walked.
    """
    pace, energy = process.pace, process.energy
    ladder = np.arange(1, contract_limit(process) + 1)[:, None]
    drive = expected_lengths(process)[1 : len(ladder) + 1, None] / pace
    each = np.maximum(ladder, drive)
    grid = np.arange(process.ticks + 1)
    worth = np.append(process.value[: process.ticks], 0.0)

    def decide(moment: Moment) -> tuple[int, int]:
        frames, path, _, tick = moment
        walk = path / pace
        left = np.broadcast_to(walk, drive.shape)
        if frames > 0:
            left = np.maximum(ladder, walk) + (frames - 1) * each + drive
        cost = energy * (walk + frames * drive) + process.thinking * frames * ladder
        net = np.interp(tick + left, grid, worth) - cost
        row, column = divmod(int(net.argmax()), net.shape[1])
        return row + 1, column

    return decide


def tuned_constant_rule(process: DecisionProcess, chance: Floats) -> FrameRule:
    """The constant rule that did best on simulated missions, the same for each. chance: [N, T, 2]
    uniform numbers."""
    rules = (
        constant_rule(process, contract, speed)
        for contract in range(1, contract_limit(process) + 1)
        for speed in range(len(process.speeds))
    )
    return max(rules, key=lambda rule: float(simulate_frames(process, rule, chance).mean()))


def contract_limit(process: DecisionProcess) -> int:
    """The longest contract worth considering, ticks."""
    return min(int(np.ceil(PATIENCE * process.thinking_times[0, -1])), process.ticks)


def expected_lengths(process: DecisionProcess) -> Floats:
    """Cells to walk of the plan to expect after each number of ticks of thinking: that of its mean
    quality, where a plan that there is not has quality 0."""
    lengths = np.array(process.lengths, dtype=float)
    quality = np.where(lengths > 0, 1.0 / np.where(lengths > 0, lengths, 1.0), 0.0)
    mean = process.chances(process.ticks) @ quality
    return 1.0 / np.maximum(mean, 1e-9)


def evaluate_frames(process: DecisionProcess, rule: FrameRule) -> float:
    """The net value to expect of acting by a rule: exact, frame by frame forward in time."""
    ticks, frames, _, levels = process.shape
    known: dict[tuple[int, ...], tuple[Floats, Floats]] = {}
    begins = np.zeros((ticks, levels))  # chance that the frame begins at a tick with a plan in hand
    begins[0, 0] = 1.0
    net = 0.0
    for f in range(frames - 1, -1, -1):
        ends = np.zeros((ticks, levels))
        for t, hand in _occupied(begins):
            contract, speed = int(rule.contracts[f, t, hand]), int(rule.speeds[f, t, hand])
            key = (hand, contract, speed) if f > 0 else (hand, -1, speed)
            if key not in known:
                known[key] = _frame(process, rule.gain, *key)
            over, spent = known[key]
            chance = begins[t, hand]
            ends[t:] += chance * over[: ticks - t]
            net -= chance * float(spent[: ticks - t].sum())
        begins = ends
    return net + float(begins.sum(axis=1) @ process.value[:ticks])


def simulate_frames(process: DecisionProcess, rule: FrameRule, chance: Floats) -> Floats:
    """Net values of missions lived by a rule, [N]. chance: [N, T, 2] uniform numbers."""
    return kernels.simulate_frames(
        np.array(process.lengths),
        process.planning,
        process.progress,
        process.energy,
        process.thinking,
        process.value[: process.ticks],
        rule.contracts,
        rule.speeds,
        rule.gain,
        process.pace,
        expected_levels(process),
        chance,
    )


def expected_levels(process: DecisionProcess) -> Floats:
    """The level to expect after each number of ticks of thinking, [T + 1]."""
    return process.chances(process.ticks) @ np.arange(process.levels)


def _occupied(begins: Floats) -> Iterator[tuple[int, int]]:
    for t, hand in np.argwhere(begins > 1e-13):
        yield int(t), int(hand)


def _frame(
    process: DecisionProcess, gain: float, hand: int, contract: int, speed: int
) -> tuple[Floats, Floats]:
    """How a frame ends and what it costs; a contract of −1 is the last frame, which thinks not."""
    over, spent = np.zeros((process.ticks, process.levels)), np.zeros(process.ticks)
    last = contract < 0
    kernels.frame(
        process.planning,
        process.progress,
        process.energy,
        process.thinking,
        process.lengths[hand],
        process.levels - 1 if last else 0,
        0 if last else contract,
        speed,
        0.0 if last else gain,
        process.pace,
        expected_levels(process),
        over,
        spent,
    )
    return over, spent
