"""Whether a NAO over libqi in lock-step is to the bit the one in process."""

from __future__ import annotations

import contextlib
import hashlib

from experiments.benchmarks.nao_rig import Rig
from monitor.robots.nao_body import NaoBody
from monitor.robots.nao_scenes import read_scene
from monitor.robots.naoqi import NaoqiBody
from monitor.robots.simulated_nao import SimulatedNao

FREE = (("walk", 0.3, 0.1, 0.4), ("walk", -0.2, 0.2, 0.0), ("posture", "Sit"), ("walk", 0.1, 0, 0))
COLLIDING = (
    ("walk", 0.9, 0.1, 0.0),
    ("posture", "Stand"),
    ("walk", 0.0, -0.9, 0.5),
    ("posture", "Stand"),
)


def lockstep_identical(seed: int = 0) -> bool:
    """Whether all that can be observed in process and over libqi in lock-step is the same."""
    with Rig(seed) as rig:
        return all(identical(rig, commands) for commands in (FREE, COLLIDING))


def identical(rig: Rig, commands: tuple[tuple[object, ...], ...]) -> bool:
    """Whether a sequence of commands looks the same in process and over libqi in lock-step."""
    here = SimulatedNao(read_scene(rig.crowd, seed=rig.seed))
    there = NaoqiBody(rig.crowded().url, seed=rig.seed, timeout=5.0)
    with contextlib.closing(there):
        return observed(here, commands) == observed(there, commands)


def observed(nao: NaoBody, commands: tuple[tuple[object, ...], ...], every: float = 0.2) -> str:
    """A digest of everything that can be observed while commands are carried out."""
    digest = hashlib.sha256(repr(nao.read()).encode())
    for command, *arguments in commands:
        action = getattr(nao, str(command))(*arguments)
        for _ in range(round(16 / every)):
            outcome = action.poll()
            digest.update(repr((nao.now(), nao.read(), outcome)).encode())
            if outcome is not None:
                break
            nao.wait(every)
    return digest.hexdigest()
