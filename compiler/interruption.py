"""Contract modules made interruptible, by the best sequence of contracts. [RZ91], [ZCC03]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from anytime.errors import AnytimeError
from anytime.modules import Module
from anytime.pictures import clipped, duration, figure, line_chart, number
from anytime.profiles import Profile
from anytime.programs import Call, Input
from compiler.compiled import CompiledProgram
from compiler.contracts import (
    Following,
    contract_of,
    in_turn,
    one_after_the_other,
    profile_of_sequence,
)
from compiler.curves import Curve, curve, curve_of
from compiler.deadlines import WORST, Interruption, Survival, log_uniform, survival_of
from compiler.objectives import EXPECTED
from compiler.retrying import Retries, retrying
from compiler.sequencing import (
    acceleration_ratio,
    best_sequence,
    expected_quality,
    least_ratio,
    tuned_doubling,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Interruptible(Module):
    """A module that may be interrupted at any time, made of contracts run one after the other.

    contract_profile: of one contract. profile: its own, with a result whenever a contract is done.
    lengths: seconds that each contract is told; none for a module that is interruptible as it is,
    or whose contracts `retries` chooses, by time and quality achieved.
    expected, doubling: expected quality when the interruption comes as assumed, of this and of
    doubling from the best first length. ratio: how many times as long as one contract it takes, at
    worst, to be as good as that; inf where there is no bound.
    """

    contract_profile: Profile
    profile: Profile
    lengths: tuple[float, ...] = ()
    retries: Retries | None = None
    expected: float
    doubling: float
    ratio: float

    def promise(self, seconds: float) -> float:
        """Expected quality if the interruption comes after `seconds`."""
        return float(self.profile.mean(seconds)[0])

    def __repr__(self) -> str:
        lines = [f"{self.name}({', '.join(self.parameters)}), interruptible"]
        expected = f"expected {number(self.expected)} at the interruption"
        if self.retries is not None:
            lines.append(f"{expected}, contracts chosen by what is achieved")
        elif not self.lengths:
            lines[0] += " as it is: it registers results while it runs"
        else:
            lines.append(f"{'contract':>12}{'done after':>14}   promised")
            for length, end in zip(self.lengths, np.cumsum(self.lengths).tolist(), strict=True):
                done = f"{duration(length):>12}{duration(end):>14}"
                lines.append(f"{done}   {number(self.promise(end)):>8}")
            bound = "" if math.isinf(self.ratio) else f"; at worst {self.ratio:.3g} × one contract"
            lines.append(f"{expected}, by doubling {number(self.doubling)}{bound}")
        return "\n".join(clipped(line) for line in lines)

    def _repr_html_(self) -> str:
        end = max(run.end[0] for run in self.profile.recordings)
        times = np.linspace(0, max(end, 1e-9), 200)
        x = times.tolist()
        series = {
            "interruptible": (x, self.profile.mean(times).tolist()),
            "one contract": (x, self.contract_profile.mean(times).tolist()),
        }
        chart = line_chart(
            series,
            x_label="interrupted after [s]",
            y_label="expected quality",
            dashed=("one contract",),
            title=self.name,
        )
        return figure(chart, repr(self))


def interruptible(
    contract: Module | CompiledProgram,
    library: Mapping[str, Profile] | None = None,
    *,
    interruption: Interruption | None = None,
    robustness: float | None = None,
    adaptive: bool = False,
) -> Interruptible:
    """Make a contract module, or a compiled program, interruptible: contracts one after the other,
    the best result kept, by the module's estimate or else the longest contract's.

    library: profiles by module name; a compiled program brings its own.
    interruption: when it comes: a distribution of seconds (with `.sf`, as those of scipy.stats), a
    list of observed times, or one predicted time; by default nothing is known. The sequence is the
    best one for it, exactly [ZCC03].
    robustness: at no time may it be behind one contract of that time / robustness. By default 4 if
    nothing is known or a single time is predicted [AK21], or the least that the measured lengths
    allow; else unbounded.
    adaptive: choose each contract by what is achieved, for a module that takes `rng`, so that it
    may be luckier another time, and has an `estimate` to see it by.
    A module that registers results while it runs is interruptible as it is. One that takes `memory`
    keeps it from contract to contract and may go on from there; its profile does not count on that.
    Raises AnytimeError for a missing profile, and for a robustness that no sequence has.
    """
    module, profile, steps = _described(contract, library)
    survival = log_uniform(steps) if interruption is None else survival_of(interruption)
    doubling = expected_quality(steps, tuned_doubling(steps, survival), survival)
    native = _native(contract)
    if native is not None:
        return Interruptible(
            **_fields(native),
            contract_profile=profile,
            profile=profile,
            expected=_expected(profile, survival),
            doubling=doubling,
            ratio=1.0,
        )
    name = f"{module.name}_interruptible"
    if adaptive:
        _check_luck(module, _filled(contract), robustness)
        retries, own = retrying(module, profile, survival)
        made = _sequence(
            contract, module, lambda _, at, seen: retries.following(at, seen), again=True
        )
        return Interruptible(
            **_fields(replace(made, name=name)),
            contract_profile=profile,
            profile=replace(own, module=name),
            retries=retries,
            expected=_expected(own, survival),
            doubling=doubling,
            ratio=math.inf,
        )
    lengths = best_sequence(steps, survival, _bound(robustness, interruption, steps))
    made = _sequence(contract, module, in_turn(lengths), again=False)
    return Interruptible(
        **_fields(replace(made, name=name)),
        contract_profile=profile,
        profile=profile_of_sequence(name, profile, lengths),
        lengths=lengths,
        expected=expected_quality(steps, lengths, survival),
        doubling=doubling,
        ratio=acceleration_ratio(steps, lengths),
    )


def _fields(module: Module) -> dict[str, Any]:
    return {field.name: getattr(module, field.name) for field in fields(Module)}


def _sequence(
    contract: Module | CompiledProgram, module: Module, following: Following, *, again: bool
) -> Module:
    """The module with its function in place of one contract: contracts one after the other."""
    enough = isinstance(contract, CompiledProgram) and not _has_contracts(contract)
    run = contract_of(contract)
    refine = one_after_the_other(run, module.name, following, again=again, enough=enough)
    return replace(module, function=refine, filled=_filled(contract), generator=True)


def _described(
    contract: Module | CompiledProgram, library: Mapping[str, Profile] | None
) -> tuple[Module, Profile, Curve]:
    """The module, its profile, and what contracts of each length are worth."""
    if isinstance(contract, CompiledProgram):
        if contract.objective != EXPECTED:
            raise AnytimeError(
                f"{contract.name!r} was compiled for {contract.objective!r}; what a contract is "
                "worth must be its expected quality, so compile it without objective=…"
            )
        frontier = contract.frontier
        steps = curve(frontier.budgets, frontier.promised, contract.name)
        steps = replace(steps, sampled=_has_contracts(contract))
        return contract.module, contract.profile, steps
    if not isinstance(contract, Module):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise AnytimeError(f"interruptible takes a module or a compiled program, not {contract!r}")
    if library is None or contract.name not in library:
        measured = ", ".join(library or ()) or "none"
        raise AnytimeError(
            f"no profile for module {contract.name!r}; measured: {measured}. "
            f"Give anytime.measure({contract.name}, problems, seconds=…)"
        )
    return contract, library[contract.name], curve_of(library[contract.name])


def _has_contracts(compiled: CompiledProgram) -> bool:
    return any(call.module.contract for call in compiled.program.calls)


def _native(contract: Module | CompiledProgram) -> Module | None:
    """The module that registers results while it runs, if this is one; also as a program's only
    call, on the program's inputs."""
    if isinstance(contract, Module):
        return None if contract.contract else contract
    program, call = contract.program, contract.program.output
    if len(program.nodes) > 1 or not isinstance(call, Call) or call.module.contract:
        return None
    names = tuple(a.name if isinstance(a, Input) else None for a in call.arguments)
    return call.module if names == program.inputs else None


def _filled(contract: Module | CompiledProgram) -> frozenset[str]:
    """What a run fills in for the contracts, besides their seconds."""
    if isinstance(contract, Module):
        return contract.filled - {"seconds"}
    modules = (call.module for call in contract.program.calls)
    return frozenset[str]().union(*(module.filled for module in modules)) - {"seconds"}


def _bound(robustness: float | None, interruption: Interruption | None, steps: Curve) -> float:
    if robustness is None:
        predicted = interruption is None or isinstance(interruption, int | float)
        return max(WORST, least_ratio(steps)) if predicted else math.inf
    if not robustness >= 1:
        raise AnytimeError(f"robustness={robustness}; give a factor >= 1, such as 4")
    return robustness


def _check_luck(module: Module, filled: frozenset[str], robustness: float | None) -> None:
    if robustness is not None:
        raise AnytimeError("adaptive contracts have no robustness; leave one of the two out")
    if "rng" not in filled:
        raise AnytimeError(
            f"{module.name} takes no rng, so the same contract gives the same result again; "
            "leave adaptive out"
        )
    if module.estimate is None:
        raise AnytimeError(
            f"{module.name} has no estimate, so what it achieves cannot be seen; "
            "give @anytime.module(estimate=…) or leave adaptive out"
        )


def _expected(profile: Profile, survival: Survival) -> float:
    """Expected quality of a module with this profile at the interruption."""
    return sum(
        float(weight * (survival(run.seconds) @ np.diff(quality, prepend=0.0)))
        for weight, run, quality in zip(
            profile.weights, profile.recordings, profile.qualities, strict=True
        )
    )
