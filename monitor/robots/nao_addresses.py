"""A NAO by its address: simulated here, simulated elsewhere, or real."""

from __future__ import annotations

from anytime.clocks import Clock
from anytime.errors import AnytimeError
from monitor.robots.nao_body import NaoBody
from monitor.robots.nao_scenes import Scene
from monitor.robots.simulated_nao import SimulatedNao

_SCHEMES = ("tcp://", "tcps://")


def nao_body(where: str, scene: Scene, clock: Clock | None = None) -> NaoBody:
    """The NAO that lives at an address.

    where: "simulated", or "naoqi:" and the url of a robot or of `anytime nao-sim`, such as
    naoqi:tcp://127.0.0.1:9559. Of the scene, a NAO over NAOqi takes only what is the body's own
    business: `auto_stand`, and the seed in lock-step; the floor is where it stands.
    Raises AnytimeError for an address that is none, LinkLostError if nobody is there.
    """
    if where == "simulated":
        return SimulatedNao(scene, clock)
    scheme, _, url = where.partition(":")
    if scheme != "naoqi" or not url.startswith(_SCHEMES):
        raise AnytimeError(
            f"no robot at {where!r}; give simulated, or naoqi:tcp://HOST:PORT "
            "(naoqi:tcps://HOST:9503 with a password in NAO_PASSWORD for newer robots)"
        )
    from monitor.robots.naoqi import NaoqiBody

    return NaoqiBody(url, clock, seed=scene.seed, auto_stand=scene.auto_stand)
