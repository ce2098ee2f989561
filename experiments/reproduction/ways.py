"""The paper's way of making plans, and ours."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.robots.nao_planning import Planning


@dataclass(frozen=True)
class Way:
    """How plans are made. learns: whether the robot knows from earlier runs how standing up turns
    it, and learns more of it."""

    name: str
    planning: Planning
    learns: bool


PAPER = Way("paper", Planning.paper(), learns=False)
"""That of [PRP16]: its operators, and its rule of what a collision does."""
OURS = Way("ours", Planning(), learns=True)
"""All operators, a robot that falls where it touches, and drift that is learnt."""
