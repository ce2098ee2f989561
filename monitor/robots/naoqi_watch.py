"""The watch over whoever commands a walking robot: it stops when nobody is heard any more.

A heartbeat is as old as the answer that it echoes, on the robot's own clock. So one that a slow
link has kept back does not count as fresh, and no clocks need to agree.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable
from typing import Any

from monitor.robots.naoqi_link import Link

LIMIT = 0.7  # seconds of real time since somebody was heard, after which a walk ends
_PACE = 0.1  # seconds between two beats
_SERVICE = "Watch"


class Watch:
    """The robot's side. Off until somebody beats, and after the one who did has taken leave.

    clock: seconds of real time, > 0.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._heard: float | None = None
        self._left = 0.0  # what was echoed up to then counts no more

    @property
    def heard(self) -> float:
        """When whoever commands was last surely alive; NaN while the watch is off."""
        return math.nan if self._heard is None else self._heard

    @property
    def silent(self) -> bool:
        """Whether nobody was heard for too long; nothing walks then, nor begins to move."""
        return self._heard is not None and self._clock() - self._heard > LIMIT

    def beat(self, echo: float) -> float:
        """Hear somebody who echoes the last answer, or 0 at first; the answer."""
        now = self._clock()
        if self._left < echo <= now and now - echo <= LIMIT:
            self._heard = max(self._heard or 0.0, echo)
        return now

    def leave(self, echo: float) -> None:
        """Whoever echoes that commands no more. What overtook it on the way stands."""
        if self._heard is not None and self._heard <= echo:
            self._heard, self._left = None, echo


class Heart:
    """The commanding side: beats from a thread of its own while an action is in execution.

    The thread is none of the control loop's, so that a planner may think for longer than the
    limit; it ends with the process, whatever happens to that.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._lock = threading.Lock()
        self._service: Any = None  # the link's when it began: the link itself is for one thread
        self._echo = 0.0
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Be heard, before anything moves. Raises LinkLostError."""
        if not self._link.has(_SERVICE):
            return
        echo = self._link.call(_SERVICE, "beat", 0.0)
        echo = self._link.call(_SERVICE, "beat", echo)
        with self._lock:
            self._service, self._echo = self._link.service(_SERVICE), echo
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def rest(self, *, leave: bool = True) -> None:
        """Nothing is in execution any more; leave: that is known of the robot, too.

        Who lost the link must not take leave: a command may be on its way, and overtaken by that.
        """
        with self._lock, contextlib.suppress(RuntimeError):  # libqi's, of a link that is lost
            service, self._service = self._service, None
            if service is not None and leave:
                service.leave(self._echo, _async=True)

    def close(self) -> None:
        """Rest for ever."""
        self.rest()
        self._over.set()

    def _run(self) -> None:
        asked: tuple[Any, Any] | None = None  # a service, and what it has not answered yet
        while not self._over.wait(_PACE):
            with self._lock:
                if self._service is None or (asked and asked[0] is not self._service):
                    asked = None
                if self._service is not None:
                    asked = self._beat(asked)

    def _beat(self, asked: tuple[Any, Any] | None) -> tuple[Any, Any] | None:
        with contextlib.suppress(RuntimeError):  # a lost link is for the control loop to see
            if asked is not None:
                if not self._link.ended(asked[1]):
                    return asked
                self._echo = asked[1].value(0)
            return self._service, self._service.beat(self._echo, _async=True)
        return None
