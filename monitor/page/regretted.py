"""What the page says of decisions that were lived again."""

from __future__ import annotations

from typing import Any

import numpy as np

from anytime.pictures import number
from monitor.log_lines import FrameLine, Log
from monitor.page.answers import span, speed_unit


def sentence(log: Log) -> str:
    """What other decisions would have brought; empty where none was lived."""
    if not log.regrets:
        return ""
    found = [_regret(log, index) for index in range(len(log.regrets))]
    count = sum(len(line.forks) for line in log.regrets)
    good = sum(regret <= 0 for regret in found)
    worst = int(np.argmax(found))
    most = f"most in frame {worst}, {number(found[worst])}" if found[worst] > 0 else "in none any"
    return (
        f"{count} missions were lived again on this seed, each with one decision changed. The best "
        f"of the others would have added {number(float(np.mean(found)))} a frame on the mean, "
        f"{most}; in {good} of {len(found)} frames none was better. Which one it is was not to be "
        "known: part of this is luck."
    )


def here(log: Log, frame: FrameLine) -> str:
    """What another decision in this frame would have brought."""
    if frame.index >= len(log.regrets):
        return ""
    forks, net = log.regrets[frame.index].forks, log.net or 0.0
    shares, speed, best = max(forks, key=lambda fork: fork[2])
    worse = sum(fork[2] < net for fork in forks)
    if best <= net:
        return f"Here none of {len(forks)} was better than the {number(net)} that was lived."
    decided = frame.moments[0]
    changed = [
        f"{label} {span(seconds)}"
        for label, seconds in shares.items()
        if abs(seconds - decided.shares[label]) > 1e-6
    ]
    if abs(speed - decided.speed) > 1e-6:
        changed.append(f"{number(speed)} {speed_unit(log)}")
    return (
        f"Here {' and '.join(changed)} would have ended at {number(best)}, "
        f"{number(best - net)} more; {worse} of {len(forks)} would have been worse."
    )


def forks(log: Log, frame: FrameLine) -> dict[str, Any] | None:
    """The forks of a frame as the page draws them; None where there are none."""
    if frame.index >= len(log.regrets):
        return None
    decided = frame.moments[0]
    made = [
        {
            "contract": sum(shares.values()),
            "speed": speed,
            "net": net,
            "timed": any(abs(s - decided.shares.get(name, s)) > 1e-6 for name, s in shares.items()),
            "text": f"{', '.join(f'{name} {span(s)}' for name, s in shares.items())}, "
            f"{number(speed)} {speed_unit(log)}: {number(net)}",
        }
        for shares, speed, net in log.regrets[frame.index].forks
    ]
    return {"regret": _regret(log, frame.index), "made": made}


def _regret(log: Log, index: int) -> float:
    best = max(net for *_, net in log.regrets[index].forks)
    return max(best - (log.net or 0.0), 0.0)
