"""How a mission can end: a closed set."""

from __future__ import annotations

from enum import Enum


class Ending(Enum):
    """Every mission ends with one of these, never with an exception."""

    REACHED = "reached"
    DEADLINE = "deadline"
    UNREACHABLE = "unreachable"
    BLOCKED = "blocked"
    COLLISION_LIMIT = "collision_limit"
    FALLEN = "fallen"
    LINK_LOST = "link_lost"
    MODULES_FAILED = "modules_failed"
    ABORTED = "aborted"
    INVALID = "invalid"
    INTERNAL = "internal"
