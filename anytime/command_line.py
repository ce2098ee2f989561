"""The command line: what every command shares."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import math
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from anytime import plugins
from anytime.errors import AnytimeError

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Answer:
    """What a command has to say: text for people, data for `--json`, and its exit code."""

    text: str
    data: Mapping[str, Any] = field(default_factory=dict)
    code: int = 0


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def add_command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], Answer], summary: str
) -> argparse.ArgumentParser:
    """Declare a sub-command that prints figures: it gets `--json`."""
    parser = commands.add_parser(name, help=summary, description=summary)
    parser.add_argument("--json", action="store_true", help="print one JSON object instead")
    parser.set_defaults(run=run)
    return parser


def as_json(data: Mapping[str, Any]) -> str:
    """One JSON object; a number that is not finite becomes null."""
    return json.dumps(_finite(data), sort_keys=True, ensure_ascii=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, bool | str | int | None):
        return value
    if isinstance(value, float) or hasattr(value, "__float__"):
        number = float(value)
        return number if math.isfinite(number) else None
    return str(value)


def positive(text: str) -> float:
    """A finite number > 0, as an argument."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number > 0")
    return number


def natural(text: str) -> int:
    """A whole number >= 0, as an argument: a seed, a count."""
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a whole number >= 0")
    return int(text)


def folder(text: str) -> Path:
    """A folder to read, as an argument."""
    if Path(text).exists() and not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a file; give a folder")
    return Path(text)


def destination(text: str) -> Path:
    """A folder to write to or to make, as an argument: found out before there is anything that
    could be lost."""
    place = folder(text)
    _may_be_written(place)
    return place


def target(text: str) -> Path:
    """A file to write, as an argument."""
    if Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a folder; give a file")
    if Path(text).is_file() or not Path(text).exists():  # else a pipe or a device
        _may_be_written(Path(os.path.realpath(text)).parent)
    return Path(text)


def _may_be_written(place: Path) -> None:
    there = next(each for each in (place, *place.absolute().parents) if each.exists())
    if not os.access(there, os.W_OK | os.X_OK):
        raise argparse.ArgumentTypeError(f"{there} cannot be written; give a folder that can")


def resolve(reference: str) -> Any:
    """What a user means by a registered name or by FILE.py:NAME.

    Files that the user types are imported; names found in data never are. Raises AnytimeError
    that lists the registered names.
    """
    if ".py:" in reference:
        file, _, name = reference.rpartition(":")
        return _from_file(Path(file), name)
    known = plugins.registered("anytime.modules")
    if reference not in known:
        raise AnytimeError(
            f"{reference!r} is not registered (known: {', '.join(known) or 'none'}); "
            "give one of these or FILE.py:NAME"
        )
    return plugins.load(known[reference])


def _from_file(file: Path, name: str) -> Any:
    if not file.is_file():
        raise AnytimeError(f"{file}: no such file; give FILE.py:NAME")
    module = sys.modules.get(file.stem)
    known = getattr(module, "__file__", None)
    if known is None or Path(known).resolve() != file.resolve():
        module = _imported(file)
    if not hasattr(module, name):
        names = ", ".join(key for key in vars(module) if not key.startswith("_"))
        raise AnytimeError(f"{file} has no {name!r}; it has {names}"[:300])
    return getattr(module, name)


def _imported(file: Path) -> Any:
    """Run a user's file once, as its own folder's Python would."""
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise AnytimeError(f"{file} is not a Python file; give FILE.py:NAME")
    module = importlib.util.module_from_spec(spec)
    named = sys.modules.setdefault(file.stem, module) is module
    sys.path.insert(0, str(file.resolve().parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        if named:
            del sys.modules[file.stem]
        what = str(error) if isinstance(error, AnytimeError) else f"{type(error).__name__}: {error}"
        raise AnytimeError(f"{file} cannot be imported: {what}") from error
    finally:
        sys.path.pop(0)
    return module


@contextlib.contextmanager
def progress(task: str) -> Iterator[Progress]:
    """A progress bar on a terminal, silence elsewhere; yields a callback of (done, total)."""
    if not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from tqdm import tqdm

    with tqdm(desc=task, file=sys.stderr, leave=False) as bar:

        def show(done: int, total: int) -> None:
            bar.total, bar.n = total, done
            bar.refresh()

        yield show


@contextlib.contextmanager
def told() -> Iterator[list[str]]:
    """Warnings of the library as lines for people; yields those told so far."""
    lines: list[str] = []

    def tell(message: Warning | str, *_: Any) -> None:
        lines.append(str(message))
        print(f"anytime: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.simplefilter("ignore", DeprecationWarning)  # of packages, to their authors
        warnings.showwarning = tell
        yield lines
