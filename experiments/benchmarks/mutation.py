"""How many changed programs the tests notice: `python -m experiments.benchmarks.mutation`.

Each mutant is run in a fork, with the tests that mirror its file alone; nothing is written. Those
that `equivalent_mutants` lists are not run and do not count.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.abc
import importlib.util
import os
import random
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import CodeType, ModuleType

from experiments.benchmarks.equivalent_mutants import EQUIVALENT
from experiments.benchmarks.figures import share_interval
from experiments.benchmarks.mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[2]
TARGETS = {
    "compiler.division": ("compiler/test_compiler_division.py",),
    "compiler.elimination": (
        "compiler/test_compiler_elimination.py",
        "compiler/test_compiler_solving.py",
    ),
    "anytime.distributions": (
        "anytime/test_anytime_distributions.py",
        "anytime/test_anytime_profiles.py",
    ),
    "anytime.profiles": ("anytime/test_anytime_profiles.py",),
    "monitor.policies": ("monitor/test_monitor_policies.py",),
    "monitor.inter_frame": ("monitor/test_monitor_policies.py",),
    "monitor.intra_frame": ("monitor/test_monitor_policies.py",),
    "monitor.stopping": ("monitor/test_monitor_stopping.py",),
}
"""What is changed, and the tests that should notice."""

_LOADED = ("numpy", "scipy.stats", "hypothesis", "pytest", "msgspec", "numba")
_FEW, _FULL = "few", "full"
_SLACK = 20.0  # seconds beyond three times what the unchanged program takes: then it hangs


@dataclass(frozen=True)
class Tried:
    """A mutant, and whether the tests noticed."""

    module: str
    mutant: Mutant
    killed: bool

    def __str__(self) -> str:
        return f"{self.module}:{self.mutant.line}: {self.mutant.change}"


def available() -> bool:
    """Whether the tests are here: an installed package has none."""
    return hasattr(os, "fork") and all(
        (ROOT / "tests" / name).is_file() for names in TARGETS.values() for name in names
    )


def tried(
    seconds: float, seed: int, targets: list[str], progress: Callable[[str], None]
) -> Iterator[Tried]:
    """Try mutants in a random order until so many seconds have passed.

    Raises RuntimeError when tests fail for the program as it is.
    """
    for name in _LOADED:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    _profiles()
    all_of = [(name, mutant) for name in targets for mutant in counted(name)]
    random.Random(seed).shuffle(all_of)
    progress(f"{len(all_of)} mutants of {len(targets)} modules")
    taken = dict[tuple[str, ...], float]()
    for tests in {TARGETS[name] for name in targets}:
        begun = time.perf_counter()
        if not _passes(None, None, tests, 600.0, _FULL):
            raise RuntimeError(f"{', '.join(tests)} fail as they are")
        taken[tests] = time.perf_counter() - begun
    until = time.perf_counter() + seconds
    for name, mutant in all_of:
        if time.perf_counter() > until:
            return
        tests = TARGETS[name]
        most = 3 * taken[tests] + _SLACK
        passes = all(_passes(name, mutant.code, tests, most, each) for each in (_FEW, _FULL))
        yield Tried(name, mutant, killed=not passes)


def every(name: str) -> Iterator[Mutant]:
    """All mutants of a module."""
    path = ROOT / f"{name.replace('.', '/')}.py"
    return mutants(path.read_text(encoding="utf-8"), str(path))


def counted(name: str) -> list[Mutant]:
    """Those that are not known to be equivalent."""
    known = EQUIVALENT.get(name, {})
    return [each for each in every(name) if (each.text, each.change) not in known]


def figures(found: Sequence[Tried]) -> dict[str, float | int | None]:
    """The shares that were noticed: of all, and by package."""
    shares = share_interval("mutation.killed", [each.killed for each in found])
    for package in sorted({each.module.partition(".")[0] for each in found}):
        of_it = [each.killed for each in found if each.module.partition(".")[0] == package]
        shares |= share_interval(f"mutation.{package}.killed", of_it)
        shares[f"mutation.{package}.count"] = len(of_it)
    return {**shares, "mutation.count": len(found)}


def _profiles() -> None:
    """Hypothesis looks for counter-examples as it does in tests, but not for the smallest; first
    among few examples, where most mutants show."""
    from hypothesis import Phase, settings

    phases = (Phase.explicit, Phase.generate)
    every = settings(
        settings.get_profile("default"), deadline=None, derandomize=True, phases=phases
    )
    settings.register_profile(_FULL, every)
    settings.register_profile(_FEW, every, max_examples=10)


def _passes(
    name: str | None, code: CodeType | None, tests: tuple[str, ...], most: float, profile: str
) -> bool:
    """Whether tests pass with a module's code in place of its file's, within so many seconds."""
    child = os.fork()
    if child == 0:
        status = 70
        try:
            os.setsid()
            status = _tested(name, code, tests, profile)
        finally:
            os._exit(status)
    until = time.perf_counter() + most
    while time.perf_counter() < until:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status == 0
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def _tested(name: str | None, code: CodeType | None, tests: tuple[str, ...], profile: str) -> int:
    import pytest

    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    if name is not None and code is not None:
        for loaded in [each for each in sys.modules if each.split(".")[0] in _PACKAGES]:
            del sys.modules[loaded]
        sys.meta_path.insert(0, _Changed(name, code))
    files = [str(ROOT / "tests" / each) for each in tests]
    options = ["-n", "0", "-q", "-x", "-p", "no:cacheprovider", f"--rootdir={ROOT}"]
    options += [f"--hypothesis-profile={profile}"]
    options += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # loaded before the fork
    return int(pytest.main([*options, *files]))


_PACKAGES = ("anytime", "compiler", "monitor", "sensing", "planners", "experiments")


class _Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds one module, with another code than its file's."""

    def __init__(self, name: str, code: CodeType) -> None:
        self._name, self._code = name, code

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        if fullname != self._name:
            return None
        return importlib.util.spec_from_file_location(fullname, self._code.co_filename, loader=self)

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        exec(self._code, module.__dict__)


def main() -> None:
    """Print the share that was noticed, and every mutant that was not."""
    parser = argparse.ArgumentParser(description="which changes of the program the tests notice")
    parser.add_argument("module", nargs="*", default=[], help=", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    targets = options.module or list(TARGETS)
    found = list[Tried]()
    for each in tried(60 * options.minutes, options.seed, targets, print):
        found.append(each)
        if not each.killed:
            print(f"survived  {each}  ({len(found)} tried)", flush=True)
    for name in targets:
        of_it = [each.killed for each in found if each.module == name]
        print(f"{name:22s} {sum(of_it):4d} of {len(of_it)} noticed")
    for name, figure in figures(found).items():
        print(f"{name} {figure:.3f}")


if __name__ == "__main__":
    main()
