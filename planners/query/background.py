"""A search that goes on beside something else: in a thread, or on a work clock."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planners.query.querying import Query


class Worker(threading.Thread):
    """Makes generations until it is told to end."""

    def __init__(self, query: Query) -> None:
        super().__init__(name=f"query {query.model.name}", daemon=True)
        self._query = query
        self._over = threading.Event()
        self._error: BaseException | None = None

    def run(self) -> None:
        try:
            while not self._over.is_set():
                self._query.step(self._query.turn)
        except BaseException as error:
            self._error = error

    def end(self) -> None:
        self._over.set()
        self.join()
        if self._error is not None:
            raise self._error


class Share:
    """Spends time that passes on a work clock on whole generations, and keeps the rest."""

    def __init__(self, query: Query, seconds_per_evaluation: float) -> None:
        self._query = query
        self._each = seconds_per_evaluation
        self._owed = 0.0

    def __call__(self, seconds: float) -> None:
        generation = self._query.size * self._each
        self._owed += seconds
        generations = int(self._owed / generation)
        if generations:
            self._owed -= generations * generation
            self._query.step(generations)
