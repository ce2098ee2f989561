"""The servers that are done harm to: a simulated NAO over libqi, in the scenes that this needs."""

from __future__ import annotations

import contextlib
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

from experiments.nao_serving import ServedNao

CROWD = """
[nao]
posture = "Stand"
[goal]
at = [1.0, 0.0]
[[obstacle]]
disc = [0.7, 0.05, 0.12]
[[obstacle]]
box = [0.0, -1.0, 2.0, 0.2]
turned = 0.1
[[obstacle]]
disc = [-0.4, 1.2, 0.1]
velocity = [0.05, -0.1]
from = 2.0
[[obstacle]]
disc = [0.3, 0.0, 0.1]
from = 5.0
until = 30.0
"""
"""Where NAO runs into things."""

WALL = """
[nao]
posture = "Stand"
[goal]
at = [1.0, 0.0]
[noise]
falls = false
[[obstacle]]
box = [1.2, 0.0, 0.1, 2.0]
"""
"""Where something stands ahead."""

FLOOR = """
[nao]
posture = "Stand"
[goal]
at = [1.0, 0.0]
[noise]
falls = false
"""
"""Where nothing stands in the way."""

_FAULTS = (
    "sonar-nan:1:2",
    "sonar-zero:2:3",
    "odometry-jump:5",
    "odometry-nan:10:10.5",
    "odometry-nan:11:15",
    "posture:20:25",
    "stiffness:30:40",
    "fall:45:50",
    "odometry-frozen:60:80",
    "fall-event:120",
)
_RATE = 10.0


class Rig:
    """The servers of one campaign, started when they are needed, ended with it."""

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed
        self._ends = contextlib.ExitStack()
        self._servers: dict[str, ServedNao] = {}
        self.kept: list[ServedNao] = []

    def __enter__(self) -> Self:
        folder = Path(self._ends.enter_context(TemporaryDirectory()))
        self.crowd = _written(folder / "crowd.toml", CROWD)
        self.floor = _written(folder / "floor.toml", FLOOR)
        self.wall = _written(folder / "wall.toml", WALL)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ends.close()

    def crowded(self) -> ServedNao:
        """In lock-step, among obstacles, without a fault."""
        return self._served("crowd", "--scene", str(self.crowd), "--lockstep")

    def faulty(self) -> ServedNao:
        """In lock-step, before a wall, with one fault after the other."""
        faults = [word for fault in _FAULTS for word in ("--fault", fault)]
        return self._served("faulty", "--scene", str(self.wall), "--lockstep", *faults)

    def live(self) -> ServedNao:
        """In real time, ten times as fast, on a free floor."""
        return self._served("live", *self.live_options())

    def live_options(self, port: int = 0) -> tuple[str, ...]:
        """The options of such a server, to start one's own."""
        scene = ("--scene", str(self.floor), "--seed", str(self.seed))
        return *scene, "--rate", str(_RATE), "--port", str(port)

    def keep(self, server: ServedNao) -> ServedNao:
        """Close it in the end."""
        self.kept.append(server)
        return self._ends.enter_context(server)

    def _served(self, name: str, *options: str) -> ServedNao:
        if name not in self._servers:
            self._servers[name] = self.keep(ServedNao(*options))
        return self._servers[name]


def _written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path
