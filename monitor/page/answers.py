"""The sentences of the replay page, each made of the numbers of the log and nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from anytime.pictures import number
from monitor.log_lines import CallLine, FrameLine, Log, MomentLine
from monitor.page.losses import Loss

# Seconds that "a little more thinking" can mean: the longest that the numbers reach.
STEPS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)
BAND = 0.1  # how far an estimate may lie from what its profile advertised


def headline(log: Log, frame: FrameLine, moment: MomentLine) -> str:
    """What was decided and whether a little more thinking would have paid."""
    drove = f"drove at {number(moment.speed)} {speed_unit(log)}"
    if not frame.calls:
        where = "to the goal" if frame.index == len(log.frames) - 1 else "on"
        return f"Nothing left to plan: {drove} {where} for {span(frame.driven)}."
    gave = _shares(moment.shares)
    did = f"Stood, gave {gave}" if frame.standing else f"Gave {gave}, {drove}"
    step = step_of(moment)
    more, less = gain(moment, step), gain(moment, -step)
    if more is not None:
        return f"{did}: {_step(step)} more would {_change(more)}."
    if less is not None:
        return f"{did}: there was no longer contract, and {_step(step)} less would {_change(less)}."
    return f"{did}: nothing else was weighed."


def why(log: Log, frame: FrameLine, moment: MomentLine) -> str:
    """Why stop here?"""
    if not frame.calls:
        foreseen = "" if moment.net is None else f", and {number(moment.net)} was foreseen"
        return f"0 calls were made: the plan in hand was enough{foreseen}."
    if moment.net is None or len(moment.curve) < 2:
        return (
            f"Nothing else was weighed: {_shares(moment.shares)}, {span(moment.contract)} in all."
        )
    known = [(at, net) for at, net in moment.curve if net is not None]
    peak, best = max(known, key=lambda point: point[1])
    parts = [
        f"Of {len(known)} contracts from {span(known[0][0])} to {span(known[-1][0])}, "
        f"{span(peak)} promised most: a net value of {number(best)}"
        f" ({number(moment.value or 0.0)} of value − {number(moment.cost or 0.0)} of energy)"
    ]
    moves, step = [], step_of(moment)
    for change, word in ((gain(moment, step), "more"), (gain(moment, -step), "less")):
        if change is not None:
            moves.append(f"{_step(step)} {word} would {_change(change)}")
    sentence = "; ".join([*parts, " and ".join(moves)] if moves else parts) + "."
    if moment.moment == "call":
        before = frame.moments[0].speed
        sentence += (
            f" At {span(moment.time - frame.started)} into the frame the speed went from "
            f"{number(before)} to {number(moment.speed)} ({moment.case})."
        )
    return sentence


def fixed(log: Log, frame: FrameLine, moment: MomentLine, division: Mapping | None) -> str:
    """What would fixed have done?"""
    net = log.net or 0.0
    if log.mission.policy == "fixed":
        return f"This is the fixed division: {_shares(moment.shares)}; it made {number(net)}."
    if not division:
        return (
            f"This mission made {number(net)} and states no fixed division to set beside it: "
            "[fixed] in its file, or a log of policy fixed on the same seed, would."
        )
    shares = division["shares"]
    contract = sum(shares.values())
    sentence = (
        f"Fixed would have given {_shares(shares)} at {number(division['speed'])} "
        f"{speed_unit(log)}, as in every frame"
    )
    here = worth_at(moment, contract)
    if frame.calls and here is not None and moment.net is not None:
        apart = contract - moment.contract
        word = "more" if apart > 0 else "less"
        sentence += (
            f": {span(abs(apart))} {word} than was chosen here, "
            f"{_worth(here - moment.net)} by the curve"
        )
    made = division.get("net")
    if made is None:
        return sentence + "."
    ahead = net - made
    word = "less" if ahead >= 0 else "more"
    return f"{sentence}. Over the mission it made {number(made)}, {number(abs(ahead))} {word}."


def losses(log: Log, ranked: Sequence[Loss]) -> str:
    """Where was most lost? ranked: `costliest` of the log."""
    if not ranked:
        return "0 frames so far, so nothing is lost yet."
    worst = [loss for loss in ranked[:3] if loss.total > 0]
    energy = sum(loss.energy for loss in ranked)
    driven, waited = (sum(getattr(loss, name) for loss in ranked) for name in ("drive", "wait"))
    parts = [f"In no frame of {len(ranked)}"]
    if worst:
        others = [str(loss.index) for loss in worst[1:]]
        parts = [f"In frame {worst[0].index}: {_loss(worst[0])}"]
        if others:
            parts.append(f"Next come {' and '.join(others)}")
    if all(loss.before is not None for loss in ranked):
        whole = sum(loss.total for loss in ranked)
        moved = "lost" if whole >= 0 else "won"
        parts.append(f"All {len(ranked)} together {moved} {_amount(whole)}")
    parts.append(
        f"Driving took {_amount(driven)} of the value, standing {_amount(waited)}, "
        f"energy {_amount(energy)}"
    )
    news = sum(loss.news for loss in ranked)
    if abs(news) >= 0.005:
        parts.append(
            f"What became known on the way {'took' if news > 0 else 'added'} {_amount(news)}"
        )
    return ". ".join(parts) + "."


def here_lost(frame: FrameLine, loss: Loss, rank: int, frames: int) -> str:
    """What this frame lost, the `rank`-th costliest of so many."""
    broken = "; it was broken off" if frame.interrupted else ""
    return f"This frame: {_loss(loss)}{broken}. The {_ordinal(rank)}costliest of {frames}."


def profile(log: Log) -> str:
    """Was the profile right?"""
    pairs = compared(log)
    if not pairs:
        calls = sum(len(frame.calls) for frame in log.frames)
        return f"Nothing was advertised for these {calls} calls, so nothing can be compared."
    apart = np.array([seen - advertised for _, advertised, seen in pairs])
    outside = int((np.abs(apart) > BAND).sum())
    advertised, seen = (float(np.mean([pair[place] for pair in pairs])) for place in (1, 2))
    if len(pairs) < 2:
        return (
            f"One result says little: {number(advertised)} advertised, {number(seen)} seen in it."
        )
    doubt = 2.0 * float(apart.std(ddof=1)) / math.sqrt(len(pairs))
    verdict = "Yes, on the mean"
    if abs(apart.mean()) > max(doubt, 0.02):
        verdict = f"No, it promised too {'much' if seen < advertised else 'little'}"
    return (
        f"{verdict}: {number(advertised)} advertised, {number(seen)} ± {number(doubt)} seen in "
        f"{len(pairs)} results; {outside} of them lay more than {number(BAND)} off, "
        f"{int((apart < -BAND).sum())} below."
    )


def here_seen(frame: FrameLine) -> str:
    """Expected against seen in this frame."""
    parts = []
    for call in frame.calls:
        if call.estimate is None:
            continue
        text = f"{call.label} saw {number(call.estimate)}"
        if call.advertised is not None:
            text += f", {number(call.advertised)} was advertised"
        parts.append(text)
    return f"Here {'; '.join(parts)}." if parts else ""


def price(frame: FrameLine, moment: MomentLine, prices: Mapping[str, float | None]) -> str:
    """Who pays for another millisecond?"""
    known = {label: price for label, price in prices.items() if price is not None}
    if not frame.calls or not known:
        return (
            "Nobody: 0 calls are left to pay for."
            if not frame.calls
            else (f"Unknown: the {span(moment.contract)} were not weighed against any other.")
        )
    if set(known) == {"thinking"}:
        rate = known["thinking"]
        who = "All calls together would pay" if rate > 0 else "Nobody"
        return (
            f"{who}: a millisecond more of contract would {_rate(rate / 1e3)}, "
            f"{number(abs(rate))} a second, whichever call got it."
        )
    label = max(known, key=lambda name: known[name])
    listed = ", ".join(f"{name} would {_rate(rate / 1e3)}" for name, rate in known.items())
    if known[label] <= 0:
        return f"Nobody pays for another millisecond: {listed}."
    return f"{label} pays most for another millisecond: {listed}."


def prices_of(frame: FrameLine, moment: MomentLine) -> dict[str, float | None]:
    """Net value of one more second, by call; of all together where only the curve is known."""
    if frame.prices:
        return dict(frame.prices)
    step = step_of(moment)
    more = gain(moment, step)
    return {"thinking": None if more is None else more / step}


def step_of(moment: MomentLine) -> float:
    """What "a little more" means for this contract, in seconds: at most half of it."""
    steps = [step for step in STEPS if step <= 0.5 * moment.contract] or [STEPS[-1]]
    for direction in (1, -1):
        for step in steps:
            if gain(moment, direction * step) is not None:
                return step
    return steps[0]


def gain(moment: MomentLine, seconds: float) -> float | None:
    """Change of the foreseen net value if the contract were longer; None off the curve's ends."""
    chosen, other = worth_at(moment, moment.contract), worth_at(moment, moment.contract + seconds)
    return None if chosen is None or other is None else other - chosen


def worth_at(moment: MomentLine, contract: float) -> float | None:
    """The foreseen net value of a contract time, from the curve; None beyond its ends."""
    known = [(at, net) for at, net in moment.curve if net is not None]
    if len(known) < 2 or not known[0][0] - 1e-9 <= contract <= known[-1][0] + 1e-9:
        return None
    times, nets = zip(*known, strict=True)
    return float(np.interp(contract, times, nets))


def worth_of(moment: MomentLine) -> float:
    """What a decision was worth: its net value over that of the mean contract considered."""
    known = [net for _, net in moment.curve if net is not None]
    return max(0.0, max(known) - float(np.mean(known))) if known else 0.0


def compared(log: Log) -> list[tuple[int, float, float]]:
    """(frame, advertised, seen) of every result that was foreseen."""
    return [
        (frame.index, call.advertised, call.estimate)
        for frame in log.frames
        for call in frame.calls
        if call.advertised is not None and call.estimate is not None
    ]


def call_text(call: CallLine) -> str:
    """One call in one line, for the pointer that rests on it."""
    text = f"{call.label}: {span(call.elapsed)} of {span(call.share)}, {call.status}"
    if call.overrun > 0:
        text += f", {span(call.overrun)} over"
    return f"{text}, {call.fault}" if call.fault else text


def speed_unit(log: Log) -> str:
    """Unit of speeds."""
    if log.frames and log.frames[0].motion is not None:
        return "m/s"
    return "cells/s" if log.mission.scene else "lengths/s"


def span(seconds: float) -> str:
    """A time in a sentence: 436 ms, 1.25 s."""
    return f"{1e3 * seconds:.0f} ms" if seconds < 1 else f"{seconds:.2f} s"


def _shares(shares: Mapping[str, float]) -> str:
    parts = [f"{label} {span(seconds)}" for label, seconds in shares.items()]
    if len(parts) < 2:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} and {parts[-1]}"


def _change(change: float) -> str:
    if abs(change) < 0.005:
        return f"change nothing (±{number(0.005)})"
    return f"{'gain' if change > 0 else 'lose'} {number(abs(change))}"


def _step(seconds: float) -> str:
    return f"{seconds:g} s" if seconds >= 0.1 else f"{1e3 * seconds:g} ms"


def _rate(rate: float) -> str:
    size = f"{abs(rate):.2g}"
    return f"{'gain' if rate > 0 else 'lose'} {size.removeprefix('0') if size != '0' else size}"


def _worth(change: float) -> str:
    word = "more" if change > 0 else "less"
    return f"worth {number(abs(change))} {word}"


def _loss(loss: Loss) -> str:
    parts: Sequence[tuple[str, float]] = (
        ("driving", loss.drive),
        ("standing", loss.wait),
        ("energy", loss.energy),
    )
    shown = ", ".join(f"{number(part)} to {name}" for name, part in parts if part > 5e-4)
    if loss.before is None or loss.after is None:
        return f"{number(loss.used)} used up ({shown})" if shown else f"{number(loss.used)} used up"
    moved = "lost" if loss.total >= 0 else "won"
    return (
        f"{number(abs(loss.total))} {moved}, for {number(loss.before)} was foreseen before it and "
        f"{number(loss.after)} after it"
    )


def _amount(value: float) -> str:
    return "0" if abs(value) < 0.005 else number(abs(value))


def _ordinal(rank: int) -> str:
    """What stands before "costliest"."""
    if rank == 1:
        return ""
    ending = (
        "th" if rank % 100 in (11, 12, 13) else {1: "st", 2: "nd", 3: "rd"}.get(rank % 10, "th")
    )
    return f"{rank}{ending} "
