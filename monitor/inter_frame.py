"""Inter-frame optimisation: the contract time of the next frame. [ZR93] §5."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from anytime.programs import makers
from compiler import CompiledProgram
from compiler.division import expected_quality, moments_within
from compiler.settings import settings_of
from compiler.tables import Table
from monitor.missions import Mission
from monitor.rhythms import Rhythm
from monitor.states import Decision, State, Why

Floats = NDArray[np.float64]
CONTRACTS = 24  # considered at each decision, at most
SPEEDS = 19
PROBE = 0.1  # of a contract, for the price of more time


@dataclass(frozen=True)
class Contracts:
    """The contracts to choose from.

    labels: of the calls. shares: [C, n] seconds of each call; the first call senses.
    efficiency: [C] expected quality of the plan over what unlimited planning would give on the
    same sensing; the frame is expected to be longer by its inverse.
    probes: [C, n] the efficiency when one of the calls gets a tenth of the contract more.
    """

    labels: tuple[str, ...]
    shares: Floats
    efficiency: Floats
    probes: Floats

    @property
    def seconds(self) -> Floats:
        """The contract times, [C]."""
        return self.shares.sum(axis=1)

    def decision(self, index: int, speed: float, why: Why) -> Decision:
        """The decision for one of them."""
        shares = dict(zip(self.labels, self.shares[index].tolist(), strict=True))
        return Decision(shares, speed, why)


def compiled_contracts(program: CompiledProgram) -> Contracts:
    """The divisions that the compiler found worth having."""
    count = len(program.frontier.budgets)
    chosen = np.unique(np.linspace(0, count - 1, min(CONTRACTS, count)).round().astype(int))
    return _contracts(program, program.frontier.shares[chosen])


def pinned_contracts(program: CompiledProgram, extreme: str) -> Contracts:
    """The same program with sensing pinned to its least ("min") or greatest ("max") useful time."""
    settings = settings_of(program.tables)
    rows: list[Floats] = []
    for tables in settings:
        timed = [place for place, t in enumerate(tables) if t.rule is None and len(t.times) > 1]
        pinned = np.zeros(len(tables))
        for place in timed:
            table = tables[place]
            pinned[place] = table.first if extreme == "min" else table.saturation
        useful = _useful(tables[timed[-1]])
        count = min(max(CONTRACTS // len(settings), 1), len(useful))
        chosen = np.unique(np.linspace(0, len(useful) - 1, count).round().astype(int))
        for seconds in useful[chosen]:
            rows.append(pinned.copy())
            rows[-1][timed[-1]] = seconds
    return _contracts(program, np.array(rows))


def _useful(table: Table) -> Floats:
    """The moments of a call at which its quality rises."""
    gained = table.expected.reshape(-1, len(table.times)).mean(axis=0)
    rises = np.diff(np.maximum.accumulate(gained), prepend=0.0) > 1e-9
    return table.times[np.flatnonzero(rises)]


def _contracts(program: CompiledProgram, shares: Floats) -> Contracts:
    calls = [place for place, table in enumerate(program.tables) if table.rule is None]
    probes = np.array(
        [[_efficiency(program, row) for row in _probed(row)[calls]] for row in shares]
    )
    efficiency = np.array([_efficiency(program, row) for row in shares])
    return Contracts(program.labels, shares[:, calls], efficiency, probes)


def _probed(row: Floats) -> Floats:
    """Shares with a tenth of the contract more for each call in turn, [n, n]."""
    return row + np.eye(len(row)) * PROBE * row.sum()


def _efficiency(program: CompiledProgram, row: Floats) -> float:
    tables = program.tables
    quality = expected_quality(tables, moments_within(tables, row.tolist()))
    plans = {call.label for call in makers(program.program.output)}
    endless = [
        np.inf if table.label in plans else share
        for table, share in zip(tables, row.tolist(), strict=True)
    ]
    unlimited = expected_quality(tables, moments_within(tables, endless))
    return float(np.clip(quality / max(unlimited, 1e-9), 0.05, 1.0))


@dataclass(frozen=True)
class Spread:
    """How far the time that is left really is from the time foreseen.

    beyond: [B] foreseen seconds left from which each row of ratios holds, increasing from 0.
    ratios: [B, R] real over foreseen, equally likely.
    """

    beyond: tuple[float, ...] = (0.0,)
    ratios: tuple[tuple[float, ...], ...] = ((1.0,),)

    def at(self, seconds: float) -> Floats:
        """The ratios for this much time left, [R]."""
        row = int(np.searchsorted(self.beyond, seconds, side="right")) - 1
        return np.array(self.ratios[max(row, 0)])


@cache
def _speeds(least: float, greatest: float) -> Floats:
    """Those that are chosen among, [V]; made once, for it takes as long as to foresee them all."""
    speeds = np.geomspace(least, greatest, SPEEDS)
    speeds.flags.writeable = False  # all who ask get this one
    return speeds


def foresee(
    mission: Mission, contracts: Contracts, rhythm: Rhythm, state: State, speeds: Floats
) -> tuple[Floats, Floats]:
    """Seconds and energy left for every contract and speed, ([C, V], [C, V]).

    Frame k + 1 is computed while frame k is executed, so a frame takes the longer of both; the
    last one is executed without computing another.
    """
    situation = state.situation
    per_length, length, stops = (row[:, None] for row in rhythm.at(contracts.shares[:, 0]))
    length = length / contracts.efficiency[:, None]
    contract = contracts.seconds[:, None]
    frames = per_length * situation.to_go
    drive = length / speeds
    longer = np.maximum(contract, drive)
    in_hand = rhythm.stretched(situation.in_hand, state.made_on) / speeds
    thinking = situation.to_go > 0
    begun = np.maximum(contract * thinking, in_hand)
    seconds = begun + np.maximum(frames - 1.0, 0.0) * longer + np.minimum(frames, 1.0) * drive
    seconds = seconds + stops * frames * contract + mission.job
    moving = in_hand + frames * drive
    energy = moving * mission.energy.power(speeds) + mission.energy.idle * (seconds - moving)
    return seconds, energy


def best_contract(
    mission: Mission, contracts: Contracts, rhythm: Rhythm, spread: Spread, state: State
) -> Decision:
    """t_c = argmax VOT − COE, with the speed chosen together with it. [ZR93] §5."""
    speeds = _speeds(*mission.speeds)
    seconds, energy = foresee(mission, contracts, rhythm, state, speeds)
    # The spread is known for what was chosen, so it is looked up where one would go without it.
    plain = _value_and_cost(mission, state, seconds, energy, np.ones(1))
    ratios = spread.at(float(seconds.flat[int(np.argmax(plain[0] - plain[1]))]))
    value, cost = _value_and_cost(mission, state, seconds, energy, ratios)
    net = value - cost
    row, column = (int(at) for at in np.unravel_index(int(np.argmax(net)), net.shape))
    best = net.max(axis=1)
    probes = _probes_of(contracts, row)
    probed = _value_and_cost(
        mission, state, *foresee(mission, probes, rhythm, state, speeds), ratios
    )
    gains = (probed[0] - probed[1]).max(axis=1) - best[row]
    step = PROBE * float(contracts.seconds[row])
    prices = gains / step if step > 0 else np.zeros(len(gains))
    why = Why(
        float(value[row, column]),
        float(cost[row, column]),
        float(seconds[row, column]),
        tuple(zip(contracts.seconds.tolist(), best.tolist(), strict=True)),
        "inter-frame",
        dict(zip(contracts.labels, prices.tolist(), strict=True)),
    )
    return contracts.decision(row, float(speeds[column]), why)


def _value_and_cost(
    mission: Mission, state: State, seconds: Floats, energy: Floats, ratios: Floats
) -> tuple[Floats, Floats]:
    """Expected value of the task and cost of energy, VOT and COE, ([C, V], [C, V])."""
    value = mission.value(state.time + seconds[..., None] * ratios).mean(axis=-1)
    used = state.situation.energy + energy * ratios.mean()
    return value, mission.energy.price * used


def _probes_of(contracts: Contracts, row: int) -> Contracts:
    """The contracts that give each call in turn more than this one does."""
    shares = _probed(contracts.shares[row])
    return Contracts(contracts.labels, shares, contracts.probes[row], contracts.probes[row][None])
