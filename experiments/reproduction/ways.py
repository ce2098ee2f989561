"""The papers' ways of doing things, and ours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from monitor.robots.nao_planning import Planning
from planners import atp, paper_atp
from planners.multipath import Step
from sensing.camera import Camera
from sensing.vision import Device, Vision


@dataclass(frozen=True)
class Way:
    """How a NAO's plans are made, and how a grid robot sees, plans and is monitored.

    learns: whether the NAO knows from earlier runs how standing up turns it, and learns more of it.
    device: what one looks with. steps: the planner's plans across a floor, from the chances that
    its cells are blocked. policy: of the monitor.
    """

    name: str
    planning: Planning
    learns: bool
    device: Device
    steps: Callable[..., Iterator[Step]]
    policy: Literal["paper", "expected"]


PAPER = Way("paper", Planning.paper(), False, Vision(), paper_atp.refinements, "paper")
"""That of [PRP16], its operators and its rule of what a collision does; and that of [ZR93], its
sensor, a plan registered at every refinement, and its argmax over certain frames."""
OURS = Way("ours", Planning(), True, Camera(), atp.steps, "expected")
"""All operators, a robot that falls where it touches, drift that is learnt; a camera, a planner for
maps with walls, and a monitor that takes expectations."""
