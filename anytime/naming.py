"""Objects of the user's files by name, so that another process finds the same ones.

Only ever for names that this process got from its own objects, never for names found in data.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from anytime.errors import AnytimeError

Address = tuple[str, str, str]
"""The name of a Python module, that of the object in there, and the file."""

SCRIPT = "__mp_main__"  # the name of the caller's script in another process, as the library's own


def address(function: Callable[..., Any]) -> Address:
    """Where a function lies."""
    file = getattr(sys.modules.get(function.__module__), "__file__", None) or ""
    return function.__module__, function.__qualname__, file


def found(module: str, name: str, file: str) -> Any:
    """What lies at an address. Raises AnytimeError if nothing does."""
    here: Any = _module(module, file)
    for part in name.split("."):
        if not hasattr(here, part):
            raise AnytimeError(
                f"{module} has no {name!r} that another process could find; define it at the top "
                "level of a file"
            )
        here = getattr(here, part)
    return here


def _module(name: str, file: str) -> ModuleType:
    """A Python module by its name, else by its file; one of these must be right."""
    script = name in ("__main__", SCRIPT)
    for known in (SCRIPT, "__main__") if script else (name,):
        if known in sys.modules and _is_from(sys.modules[known], file):
            return sys.modules[known]
    if not script and name not in sys.modules:
        try:
            made = importlib.import_module(name)
        except ImportError:
            made = None
        if made is not None and _is_from(made, file):
            return made
    if not Path(file).is_file():
        raise AnytimeError(f"{name} has no file; define what another process runs in a file")
    return _run(SCRIPT if script else name, file)


def _is_from(module: ModuleType, file: str) -> bool:
    known = getattr(module, "__file__", None)
    if known is None or not file:
        return known is None and not file
    return Path(known).resolve() == Path(file).resolve()


def _run(name: str, file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise AnytimeError(f"{file} is not a Python file")
    made = importlib.util.module_from_spec(spec)
    sys.modules[name] = made
    sys.path.insert(0, str(Path(file).resolve().parent))
    try:
        spec.loader.exec_module(made)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        sys.path.pop(0)
    if name == SCRIPT:  # what was pickled by the script itself calls it so
        sys.modules["__main__"] = made
    return made
