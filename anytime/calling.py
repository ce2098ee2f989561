"""Who answers when a module is called like a function: a program being read, or a run."""

from __future__ import annotations

from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from anytime.modules import Module


class Caller(Protocol):
    """What makes something of the call of a module."""

    def call(self, module: Module, arguments: tuple[Any, ...]) -> Any: ...


current: ContextVar[Caller | None] = ContextVar("caller", default=None)
