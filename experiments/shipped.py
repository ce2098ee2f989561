"""What ships with the project: maps, missions and measured profiles.

`python -m experiments.shipped` measures the profiles anew.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from anytime import ProfileLibrary

DATA = Path(str(files("experiments") / "data"))


def mission_path(name: str = "office") -> Path:
    """The file of a shipped mission."""
    return DATA / "missions" / f"{name}.toml"


def profiles() -> ProfileLibrary:
    """The shipped profiles of `see` and `find_path`, quality over units of work."""
    return ProfileLibrary(DATA / "profiles")


def measure_profiles(runs: int = 60) -> ProfileLibrary:
    """Measure the profiles that ship: seeing and planning in the office, on the work clock."""
    from experiments.demo import measured
    from monitor.robots.grid_missions import read_mission

    return measured(read_mission(mission_path()), seed=1993, problems=runs)


if __name__ == "__main__":
    measure_profiles().save(DATA / "profiles")
