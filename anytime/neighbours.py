"""The packages beside this one, which a user's own file of the same name would hide."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("compiler", "monitor", "planners", "sensing", "experiments")


def check() -> None:
    """End with one line when a file of the user's hides one of our packages."""
    home = Path(__file__).resolve().parent.parent
    for name in PACKAGES:
        if name in sys.modules and not hasattr(sys.modules[name], "__file__"):
            continue
        try:
            spec = find_spec(name)
        except (ImportError, ValueError):
            continue
        found = None if spec is None else spec.origin
        if found is None or not (home / name).is_dir():
            continue
        if Path(found).resolve().parent != home / name:
            print(
                f"anytime: {found} hides our package {name!r}; "
                "rename it or run from another folder",
                file=sys.stderr,
            )
            raise SystemExit(2)
