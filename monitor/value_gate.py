"""The value gate: what a change of profiles costs in mission value, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from anytime.errors import AnytimeError
from anytime.pictures import number
from compiler.division import Frontier, expected_quality, moments_within
from compiler.tables import Table
from monitor.calibration import Steady, rhythm_from
from monitor.inter_frame import Contracts, foresee
from monitor.missions import Mission
from monitor.rhythms import Rhythm
from monitor.shifts import GROUPS, SAME, Shift, Shifts
from monitor.states import Situation, State

Floats = NDArray[np.float64]
LOOKS, PLANS = 24, 16  # times of sensing, and divisions of the rest, that are considered
SPEEDS = 91  # on a coarser grid, what is rounded is as large as what is looked for
LEAST = 1e-6  # of the task's worth: a smaller loss is the arithmetic's


class UnreachedError(AnytimeError):
    """No mission reached its goal, so that nothing can be foreseen from those lived."""


@dataclass(frozen=True)
class Gate:
    """What a change costs, with its 95 % interval.

    before, after: net value of the mission. low, high: of the loss, before − after. tolerance: the
    loss that is put up with. shifts: what changed, by module. parts: loss by each of them alone.
    """

    mission: str
    before: float
    after: float
    low: float
    high: float
    tolerance: float
    shifts: Mapping[str, Shift]
    parts: Mapping[str, float]

    @property
    def loss(self) -> float:
        return self.before - self.after

    @property
    def shown(self) -> bool:
        """Whether a loss beyond the tolerance is shown: the whole interval lies above it."""
        return self.low > self.tolerance

    def backwards(self, shifts: Mapping[str, Shift]) -> Gate:
        """The same found of the change the other way round, whose shifts are these."""
        parts = {name: -loss for name, loss in self.parts.items()}
        return Gate(
            self.mission, self.after, self.before, -self.high, -self.low, self.tolerance, shifts,
            parts,
        )  # fmt: skip

    def __repr__(self) -> str:
        verdict = "no loss is shown"
        if self.shown:
            beyond = f" beyond {number(self.tolerance)}" if self.tolerance else ""
            verdict = f"a loss{beyond} is shown"
        head = (
            f"{self.mission}: {number(self.before)} before, {number(self.after)} after, loss "
            f"{number(self.loss)} [{number(self.low)}, {number(self.high)}]: {verdict}"
        )
        width = max(map(len, self.shifts))
        rows = (
            f"  {name:<{width}}  {shift!r}, alone a loss of {number(self.parts[name])}"
            for name, shift in self.shifts.items()
        )
        return "\n".join([head, *rows])


@dataclass(frozen=True)
class Foresight:
    """A mission lived at constant sensing times with the modules as they were before.

    situation: when it is presented. ratios: real over foreseen time, equally likely. tables,
    frontier: of the program before. A program's first call senses.
    """

    mission: Mission
    situation: Situation
    lived: tuple[Steady, ...]
    ratios: Floats
    tables: tuple[Table, ...]
    frontier: Frontier

    def worth(self, shifts: Mapping[str, Shift], out: int | None = None) -> float:
        """The net value to expect with modules that shifted, by label of their calls.

        A look is worth what one of its quality was worth before, over a whole mission; a plan
        what its quality is, over that of unlimited planning on such a look before. The contract
        and the speed are the best with these modules. out: a group of missions that is left out.
        """
        known = [shifts.get(table.label, SAME) for table in self.tables]
        shares, efficiency = self._divisions
        spoiled = float(np.prod([shift.quality for shift in known[1:]]))
        efficiency = (efficiency * spoiled).clip(0.05)
        seen = self._seen(shares[:, 0]) * known[0].quality
        shares = shares * np.array([shift.slower for shift in known])
        labels = tuple(table.label for table in self.tables)
        contracts = Contracts(labels, shares, efficiency, efficiency[:, None])
        speeds = np.geomspace(*self.mission.speeds, SPEEDS)
        state = State("frame", 0.0, self.situation, standing=True)
        rhythm = self._rhythm(shares[:, 0], seen, out)
        seconds, energy = foresee(self.mission, contracts, rhythm, state, speeds)
        value = self.mission.value(seconds[..., None] * self.ratios).mean(axis=-1)
        cost = self.mission.energy.price * energy * self.ratios.mean()
        return float((value - cost).max())

    @cached_property
    def unchanged(self) -> dict[int | None, float]:
        """The worth of before, with each group of missions left out and with none."""
        return {out: self.worth({}, out) for out in (None, *range(GROUPS))}

    @cached_property
    def _divisions(self) -> tuple[Floats, Floats]:
        """Every time of sensing with every division of the rest, [C, n], and the quality of each
        over that of unlimited time after sensing, [C]; before any shift.

        Those that the compiler found are too few: a look is worth more over a mission than in a
        frame.
        """
        looks = _thinned(self.tables[0].times[1:], LOOKS).tolist()
        rest = _thinned(np.unique(self.frontier.shares[:, 1:], axis=0), PLANS).tolist()
        endless = [np.inf] * (len(self.tables) - 1)
        shares = [[look, *row] for look in looks for row in rest]
        gained = np.array([self._quality(row) for row in shares]).reshape(len(looks), -1)
        most = np.array([self._quality([look, *endless]) for look in looks])[:, None]
        return np.array(shares), (gained / np.maximum(most, 1e-9)).reshape(-1)

    def _quality(self, shares: Sequence[float]) -> float:
        return expected_quality(self.tables, moments_within(self.tables, shares))

    def _seen(self, looks: Floats) -> Floats:
        first = self.tables[0]
        known = np.maximum.accumulate(first.expected)
        return known[np.searchsorted(first.times, looks + 1e-12, side="right") - 1]

    def _rhythm(self, looks: Floats, seen: Floats, out: int | None) -> Rhythm:
        """The rhythm of missions whose looks take so long and have these qualities.

        A parabola over quality, because few missions are lived at each: what chance put between
        two of them would else be taken for what seeing is worth.
        """
        kept = [_without(steady, out) for steady in self.lived]
        lived = rhythm_from(kept)
        if lived is None:
            raise UnreachedError(
                f"no mission of {self.mission.name!r} reached its goal, so none can be foreseen"
            )
        there = self._seen(lived.sensing)
        degree = min(2, len(np.unique(there)) - 1)
        looks, first = np.unique(looks, return_index=True)
        within = seen[first]

        def at(values: Floats) -> Floats:
            return np.polyval(np.polyfit(there, values, degree), within).clip(0.0)

        return Rhythm(
            looks,
            at(lived.frames),
            at(lived.length),
            at(lived.stretch),
            at(lived.stops),
            at(lived.estimate),
        )


def gate(foresight: Foresight, shifts: Shifts, tolerance: float = 0.0) -> Gate:
    """What a change costs in mission value, with its 95 % interval.

    Before and after are worth what they are on the same missions, so what those have in common
    cancels. The interval is Student's over groups of problems and of missions that are left out
    together (the delete-a-group jackknife, Shao & Wu 1989): it holds for the noise of measuring
    the profiles as well as for that of the missions.
    """
    losses = np.array(
        [
            foresight.unchanged[out] - foresight.worth(shifts.without(out), out)
            for out in range(GROUPS)
        ]
    )
    before, after = foresight.unchanged[None], foresight.worth(shifts.all)
    error = float(losses.std()) * (GROUPS - 1) ** 0.5
    reach = float(stats.t.ppf(0.975, GROUPS - 1)) * error + LEAST * foresight.mission.value.worth
    loss = before - after
    alone = {label: before - foresight.worth({label: shift}) for label, shift in shifts.all.items()}
    name = foresight.mission.name
    return Gate(name, before, after, loss - reach, loss + reach, tolerance, shifts.all, alone)


def _without(steady: Steady, out: int | None) -> Steady:
    """Without a group of the missions lived, those of every level in turn."""
    if out is None:
        return steady
    kept = [place for place in range(len(steady.lived)) if place % GROUPS != out]
    return replace(steady, lived=tuple(steady.lived[place] for place in kept), legs=())


def _thinned(rows: Floats, most: int) -> Floats:
    return rows[np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))]
