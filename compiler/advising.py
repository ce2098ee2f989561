"""What would make a program better: each module faster, better, or with one more rung."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from anytime.pictures import clipped, duration, number
from compiler.calibrating import AS_IT_IS, Calibration
from compiler.division import Frontier, divide
from compiler.explaining import shares_at
from compiler.intervals import bootstrap_means
from compiler.replaying import BETTER, Replay, error_ratio
from compiler.tables import Table

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """A change to one module and what the program would then promise.

    low, high: 95 % interval of the gain, by bootstrap over problems; NaN for a program read from a
    file, which holds no problems.
    """

    label: str
    what: str
    promised: float
    gain: float
    low: float = float("nan")
    high: float = float("nan")


@dataclass(frozen=True)
class Advice:
    """Changes to single modules, the most valuable first."""

    program: str
    seconds: float
    promised: float
    changes: tuple[Change, ...]

    @property
    def sentence(self) -> str:
        """The advice in one sentence."""
        best = self.changes[0]
        where = f"{self.program} in {duration(self.seconds)}"
        if best.gain < 0.0005:
            return f"nothing that was tried makes {where} better than {number(self.promised)}"
        return (
            f"{best.label} {best.what} brings {where} from {number(self.promised)} to "
            f"{number(best.promised)}"
        )

    def __repr__(self) -> str:
        lines = [self.sentence]
        for change in self.changes:
            sure = "" if np.isnan(change.low) else f"  [{change.low:+.3f}, {change.high:+.3f}]"
            lines.append(
                f"  {change.gain:+.3f}{sure}  {change.label} {change.what}: "
                f"{number(change.promised)}"
            )
        return "\n".join(clipped(line) for line in lines)


@dataclass(frozen=True)
class Kind:
    """A kind of change: to the tables, and to the recordings that are lived again."""

    what: str
    table: Callable[[Table, bool], Table]  # with whether it is the program's output
    replay: Callable[[Replay, str], Replay]


KINDS = (
    Kind("2× faster", lambda table, _: table.faster(2.0), lambda lived, m: lived.faster(m, 2.0)),
    Kind("10 % better", lambda table, out: better(table, out), lambda lived, m: lived.better(m)),
    Kind("with one more rung", lambda t, out: longer(t, out), lambda lived, m: lived.longer(m)),
)


def advise(
    name: str,
    tables: Sequence[Table],
    frontier: Frontier,
    seconds: float,
    calibration: Calibration = AS_IT_IS,
    replay: Replay | None = None,
) -> Advice:
    """Each module changed in turn, the time divided anew, ranked by what is gained.

    A module twice as fast does the same work in half the time. One that is 10 % better has every
    result 1.1 times as good, at most 1. One more rung is a result after twice the time of the
    last, whose errors are to the last one's as those were to the errors at half its time. With
    `replay` the gain is what the recorded problems would have gained, else what the tables say.
    """
    promised = frontier.promise(seconds)
    before = shares_at(tables, frontier, seconds)
    changes: list[Change] = []
    for module in dict.fromkeys(table.module for table in tables if table.rule is None):
        for kind in KINDS:
            changed = [kind.table(t, t is tables[-1]) if t.module == module else t for t in tables]
            again = divide(changed)
            after = shares_at(changed, again, seconds)
            if replay is None or before is None or after is None:
                value = max(calibration.promise(again.promise(seconds)), promised)
                changes.append(Change(module, kind.what, value, value - promised))
                continue
            other = kind.replay(replay, module)
            now = replay.achieved([*before.values()], seconds)
            # Whoever finds the new division worse keeps the old one.
            then = max(
                (other.achieved([*shares.values()], seconds) for shares in (after, before)),
                key=lambda values: float(values.mean()),
            )
            gain = max(float((then - now).mean()), 0.0)
            low, high = np.quantile(bootstrap_means((then - now)[:, None]), [0.025, 0.975])
            changes.append(
                Change(
                    module,
                    kind.what,
                    min(promised + gain, 1.0),
                    gain,
                    min(float(low), gain),
                    max(float(high), gain),
                )
            )
    changes.sort(key=lambda change: -change.gain)
    return Advice(name, seconds, promised, tuple(changes))


def better(table: Table, output: bool) -> Table:
    """This call with every result better by `BETTER`, at most 1."""
    moved = np.minimum(table.levels * BETTER, 1.0)
    if output:
        return replace(table, levels=moved)
    return replace(table, chances=table.chances @ _onto(moved, table.levels))


def longer(table: Table, output: bool) -> Table:
    """This call with one more result, after twice the time of its last."""
    last = table.saturation
    if last <= 0:
        return table
    expected = table.expected[(slice(1, None),) * len(table.feeds)]
    mean = expected.reshape(-1, len(table.times)).mean(axis=0)
    half = float(mean[np.searchsorted(table.times, last / 2, side="right") - 1])
    moved = 1.0 - error_ratio(float(mean.max()), half) * (1.0 - table.levels)
    moved[0] = 0.0
    earlier = table.times < 2 * last
    chances = table.chances[..., earlier, :]
    if output:
        none = np.zeros((*chances.shape[:-1], len(moved) - 1))
        rung = np.concatenate([chances[..., -1, :1], none[..., -1, :], chances[..., -1, 1:]], -1)
        chances = np.concatenate([chances, none], axis=-1)
        levels = np.concatenate([table.levels, moved[1:]])
    else:
        levels = table.levels
        rung = chances[..., -1, :] @ _onto(moved, levels)
    return replace(
        table,
        levels=levels,
        times=np.append(table.times[earlier], 2 * last),
        chances=np.concatenate([chances, rung[..., None, :]], axis=-2),
    )


def _onto(moved: Floats, levels: Floats) -> Floats:
    """Each moved level shared between the two levels next to it, [L, L]; no result stays."""
    onto = np.zeros((len(levels), len(levels)))
    onto[0, 0] = 1.0
    places: Floats = np.interp(moved, levels[1:], np.arange(1, len(levels)))
    for row in range(1, len(levels)):
        place = float(places[row])
        low = int(place)
        onto[row, low] += 1.0 - (place - low)
        onto[row, min(low + 1, len(levels) - 1)] += place - low
    return onto
