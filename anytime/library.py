"""The anytime library: profiles by module and the machine they were measured on."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from anytime.errors import AnytimeError
from anytime.files import Stored, read_record, write_record
from anytime.machines import Machine, Rate, processor
from anytime.pictures import clipped, figure
from anytime.profiles import Profile
from anytime.recordings import Recording

PROFILE = "anytime.profile/1"
MACHINE = "anytime.machine/1"
_COUNTABLE = 2**53  # more than any run registers; beyond it floats do not count
UNSURE = 2.0  # times as fast or slow as where it was measured that a machine may be
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]{0,99}(@[A-Za-z0-9_.=,-]{1,99})?")


class ProfileLibrary(Mapping[str, Profile]):
    """The profiles of some modules [ZR93 §1], kept in a folder with the machine's rates.

    `ProfileLibrary("profiles")` reads a folder; `save` writes one, each file as a whole. A folder
    that was measured on another kind of processor is read with a warning and with wider bands.
    """

    def __init__(
        self,
        folder: str | Path | None = None,
        *,
        profiles: Mapping[str, Profile] | None = None,
        machine: Machine | None = None,
    ) -> None:
        self.machine = machine or Machine("this")
        self._profiles = dict(profiles or {})
        if folder is not None:
            self._read(Path(folder))

    def __getitem__(self, module: str) -> Profile:
        if module not in self._profiles:
            raise KeyError(
                f"no profile for module {module!r}; "
                f"measured: {', '.join(sorted(self._profiles)) or 'none'}"
            )
        return self._profiles[module]

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._profiles))

    def __len__(self) -> int:
        return len(self._profiles)

    def on(self, machine: Machine) -> ProfileLibrary:
        """These profiles in the seconds of another machine."""
        moved = {name: profile.on(machine) for name, profile in self._profiles.items()}
        return ProfileLibrary(profiles=moved, machine=machine)

    def updated(self, other: ProfileLibrary) -> ProfileLibrary:
        """This library with the profiles and rates of another one added or replaced."""
        rates = {**self.machine.rates, **other.machine.rates}
        # Seconds of two kinds of machine in one folder: the doubt stays.
        mixed = not set(self._profiles) <= set(other._profiles)
        host = self.machine.host if mixed and self.machine.host else other.machine.host
        machine = Machine(other.machine.name, rates, host)
        return ProfileLibrary(profiles={**self._profiles, **other._profiles}, machine=machine)

    def save(self, folder: str | Path) -> None:
        """Write every profile and the machine into a folder, each atomically."""
        root = Path(folder)
        for name, profile in self._profiles.items():
            write_record(root / f"{_checked(name)}.profile", PROFILE, _store(profile))
        write_record(root / "machine.json", MACHINE, _store_machine(self.machine))

    def _read(self, root: Path) -> None:
        if not root.is_dir():
            raise AnytimeError(
                f"{root}: no such folder; anytime profile … --library {root} makes it"
            )
        for path in sorted(root.glob("*.profile")):
            profile = read_profile(path)
            if profile.module != path.stem:
                raise AnytimeError(
                    f"{path}: holds the profile of {profile.module!r}; name it "
                    f"{profile.module}.profile"
                )
            self._profiles[profile.module] = profile
        if (root / "machine.json").exists():
            self.machine = read_machine(root / "machine.json")
            self._doubt(root)

    def _doubt(self, root: Path) -> None:
        """Widen the bands of what was measured in the seconds of another kind of machine."""
        host = self.machine.host
        if not host or host == processor():
            return
        warnings.warn(
            f"{root}: its seconds are those of {host}, not of this machine; bands are widened to "
            f"{UNSURE:g} times as fast or slow, until `anytime calibrate`",
            stacklevel=4,
        )
        doubted = {name: replace(each, unsure=UNSURE) for name, each in self._profiles.items()}
        self._profiles = doubted

    def __repr__(self) -> str:
        count = f"{len(self)} profile{'s' if len(self) != 1 else ''}"
        head = f"library of {count}, machine {self.machine.name}"
        return "\n".join([head, *(clipped(f"  {self[name]!r}") for name in self)])

    def _repr_html_(self) -> str:
        pictures = (self[name].picture() for name in self)
        return "".join(pictures) or figure("", repr(self))


class _Run(Stored):
    problem: str
    call: str
    inputs: dict[str, float]
    features: dict[str, float]
    seconds: list[float]
    work: list[float]
    raw: list[float]
    estimates: list[float] | None
    end: tuple[float, float]
    complete: bool
    results: int = 0
    steps: int = 0


class _Profile(Stored):
    module: str
    inputs: list[str]
    machine: str
    references: dict[str, float]
    runs: list[_Run]


class _Rate(Stored):
    per_work: float
    per_step: list[float]
    p95_over_mean: float
    steps: int


class _Machine(Stored):
    name: str
    rates: dict[str, _Rate]
    host: str = ""


def _checked(name: str) -> str:
    if not _NAME.fullmatch(name) or ".." in name:
        raise AnytimeError(f"{name!r} cannot name a file; use letters, digits, _ . - (at most 100)")
    return name


def _store(profile: Profile) -> _Profile:
    runs = [
        _Run(
            problem=run.problem,
            call=run.call,
            inputs=dict(run.inputs),
            features=dict(run.features),
            seconds=run.seconds.tolist(),
            work=run.work.tolist(),
            raw=run.raw.tolist(),
            estimates=None if np.isnan(run.estimates).any() else run.estimates.tolist(),
            end=run.end,
            complete=run.complete,
            results=run.results,
            steps=run.steps,
        )
        for run in sorted(
            profile.recordings, key=lambda run: (run.problem, run.call, sorted(run.inputs.items()))
        )
    ]
    return _Profile(
        module=profile.module,
        inputs=list(profile.inputs),
        machine=profile.machine,
        references=dict(profile.references),
        runs=runs,
    )


def read_profile(path: Path) -> Profile:
    """Read one profile. Raises AnytimeError for a broken file."""
    stored = read_record(path, PROFILE, _Profile)
    runs = tuple(_restored_run(path, index, run, stored) for index, run in enumerate(stored.runs))
    try:
        return Profile(
            _checked(stored.module), tuple(stored.inputs), runs, stored.references, stored.machine
        )
    except AnytimeError as error:
        raise AnytimeError(f"{path}: {error}") from None


def _restored_run(path: Path, index: int, run: _Run, profile: _Profile) -> Recording:
    def refuse(reason: str) -> AnytimeError:
        return AnytimeError(f"{path}: runs[{index}]: {reason}")

    count = len(run.seconds)
    if len(run.work) != count or len(run.raw) != count:
        raise refuse("seconds, work and raw differ in length; each registration has all three")
    if run.estimates is not None and len(run.estimates) != count:
        raise refuse("estimates and seconds differ in length")
    for name, column in (("seconds", run.seconds), ("work", run.work)):
        if any(b < a for a, b in pairwise(column)) or (column and column[0] < 0):
            raise refuse(f"{name} must not decrease or be negative")
    if max(run.results, run.steps) > _COUNTABLE:
        raise refuse(f"says {max(run.results, run.steps)} results or steps, which cannot be")
    if min(run.results, run.steps) < 0 or 0 < run.results < count:
        raise refuse(f"has {count} results, and says {run.results} in {run.steps} steps are all")
    if min(run.end) < 0:
        raise refuse("the end of a run cannot be negative")
    if profile.references:
        if profile.references.get(run.problem, -1.0) < 0:
            raise refuse(f"no reference cost for its problem {run.problem!r}")
        if any(cost < 0 for cost in run.raw):
            raise refuse("a cost is negative; costs are >= 0")
    elif any(not 0 <= quality <= 1 for quality in run.raw):
        raise refuse("a quality lies outside [0, 1]")
    if set(run.inputs) != set(profile.inputs):
        raise refuse(f"has inputs {sorted(run.inputs)}, the profile {sorted(profile.inputs)}")
    if any(not 0 <= quality <= 1 for quality in run.inputs.values()):
        raise refuse("an input's quality lies outside [0, 1]")
    return Recording(
        run.problem,
        run.call,
        run.inputs,
        run.features,
        np.array(run.seconds, dtype=float),
        np.array(run.work, dtype=float),
        np.array(run.raw, dtype=float),
        np.full(count, np.nan) if run.estimates is None else np.array(run.estimates, dtype=float),
        run.end,
        run.complete,
        run.results,
        run.steps,
    )


def _store_machine(machine: Machine) -> _Machine:
    rates = {
        name: _Rate(
            per_work=rate.per_work,
            per_step=list(rate.per_step),
            p95_over_mean=rate.p95_over_mean,
            steps=rate.steps,
        )
        for name, rate in machine.rates.items()
    }
    return _Machine(name=machine.name, rates=rates, host=machine.host)


def write_machine(path: Path, machine: Machine) -> None:
    """Write a machine's rates, atomically."""
    write_record(path, MACHINE, _store_machine(machine))


def read_machine(path: Path) -> Machine:
    """Read a machine's rates. Raises AnytimeError for a negative rate or a broken file."""
    stored = read_record(path, MACHINE, _Machine)
    for name, rate in stored.rates.items():
        if min([rate.per_work, rate.p95_over_mean, *rate.per_step], default=0.0) < 0:
            raise AnytimeError(f"{path}: rates.{name} has a negative number; seconds are >= 0")
    rates = {
        name: Rate(rate.per_work, tuple(rate.per_step), rate.p95_over_mean, rate.steps)
        for name, rate in stored.rates.items()
    }
    return Machine(stored.name, rates, stored.host)
