"""A libqi session with a NAO: calls that end in time, and connecting anew when it was lost."""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from anytime.errors import AnytimeError
from monitor.robots.nao_body import LinkLostError

PASSWORD = "NAO_PASSWORD"
"""The environment variable that holds the robot's password, or NAO_PASSWORD_FILE its file."""

_NEEDED = ("ALMotion", "ALRobotPosture", "ALMemory")
_OPTIONAL = ("ALSonar", "SimClock", "Watch")
_LOST = (
    "Future timeout",
    "Session closed",
    "Session not connected",
    "Socket is not connected",
    "Promise broken",
)
_SHORTEST, _LONGEST = 0.1, 5.0  # seconds between two tries to connect


class RemoteError(AnytimeError):
    """The robot answered a call with an error."""


def libqi() -> Any:
    """The package `qi`, silenced. Raises AnytimeError where it is not installed."""
    try:
        import qi  # pyright: ignore[reportMissingImports]
        import qi.logging  # pyright: ignore[reportMissingImports]
    except ImportError:
        version = ".".join(map(str, sys.version_info[:2]))
        raise AnytimeError(
            "NAOqi is spoken through libqi, which is not installed; pip install "
            "'anytime-robots[nao]' brings it for Linux x86_64 with Python 3.11 and 3.12 and macOS "
            f"arm64 with 3.12 (this is {platform.system()} {platform.machine()} with {version})"
        ) from None
    qi.logging.setLevel(qi.logging.FATAL)  # else it writes warnings to stdout
    return qi


def password() -> str | None:
    """The robot's password, from the environment or from the file that it names; else None.

    Raises AnytimeError if the file cannot be read.
    """
    file = os.environ.get(f"{PASSWORD}_FILE")
    if file is None:
        return os.environ.get(PASSWORD)
    try:
        return Path(file).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise AnytimeError(f"{PASSWORD}_FILE: {file} cannot be read: {error.strerror}") from None


class Authenticator:
    """What a newer NAO wants to know of who connects."""

    def __init__(self, user: str, token: str) -> None:
        self._data = {"user": user, "token": token}

    def initialAuthData(self) -> dict[str, str]:  # noqa: N802 - libqi's name
        return self._data


class AuthenticatorFactory:
    """Makes an `Authenticator` for every connection, as libqi wants it."""

    def __init__(self, user: str, token: str) -> None:
        self._user, self._token = user, token

    def newAuthenticator(self) -> Authenticator:  # noqa: N802 - libqi's name
        return Authenticator(self._user, self._token)


class Link:
    """The services of a NAO at a url such as tcp://192.168.1.5:9559.

    Every call ends within `timeout` seconds of real time. Whoever does not answer by then is lost,
    like one that hung up: what comes later is not used, and the next connection is a new session
    with new services, after a pause that doubles from try to try.
    """

    def __init__(self, url: str, timeout: float = 0.5, user: str = "nao") -> None:
        self.url = url
        self.timeout = timeout
        self._user = user
        self._qi = libqi()
        self._session: Any = None
        self._services: dict[str, Any] = {}
        self._pause, self._due = 0.0, 0.0

    @property
    def connected(self) -> bool:
        """Whether there is a session; that somebody answers, only an answer can show."""
        return self._session is not None and self._session.isConnected()

    def has(self, service: str) -> bool:
        """Whether the robot has a service."""
        return service in self._services

    def service(self, name: str) -> Any:
        """A service of this connection, as libqi has it."""
        return self._services[name]

    def connect(self) -> None:
        """Connect anew. Raises LinkLostError if that fails, or if it is too early to try again."""
        early = self._due - time.perf_counter()
        if early > 0:
            raise LinkLostError(f"no link to {self.url}; the next try is in {early:.1f} s")
        self.drop()
        self._pause = min(max(2 * self._pause, _SHORTEST), _LONGEST)
        session = self._qi.Session()
        token = password() if self.url.startswith("tcps://") else None  # never in the clear
        if token is not None:
            session.setClientAuthenticatorFactory(AuthenticatorFactory(self._user, token))
        try:
            self._session = session
            self.value(session.connect(self.url, _async=True), 4 * self.timeout)
            there = [each["name"] for each in self.value(session.services(_async=True))]
            names = [name for name in (*_NEEDED, *_OPTIONAL) if name in there or name in _NEEDED]
            asked = [session.service(name, _async=True) for name in names]
            self._services = dict(zip(names, self.values(asked), strict=True))
        except RemoteError as error:
            self.drop()
            raise LinkLostError(f"no NAO at {self.url}: {error}") from None
        self._pause = self._due = 0.0

    def send(self, service: str, method: str, *arguments: Any) -> Any:
        """Call without waiting; returns libqi's future. Raises LinkLostError, RemoteError."""
        if not self.connected:
            self.drop()
            raise LinkLostError(f"no link to {self.url}")
        try:
            return getattr(self._services[service], method)(*arguments, _async=True)
        except (AttributeError, KeyError):
            raise RemoteError(f"the robot has no {service}.{method}") from None
        except RuntimeError as error:
            raise self._complaint(error) from None

    def call(self, service: str, method: str, *arguments: Any) -> Any:
        """Call and wait for the answer. Raises LinkLostError, RemoteError."""
        return self.value(self.send(service, method, *arguments))

    def value(self, future: Any, timeout: float | None = None) -> Any:
        """The answer to a call, waited for. Raises LinkLostError, RemoteError."""
        timeout = self.timeout if timeout is None else timeout
        if future.wait(round(1000 * timeout)) == self._qi.FutureState.Running:
            self.drop()
            raise LinkLostError(f"{self.url} has not answered for {timeout} s")
        try:
            return future.value(0)
        except RuntimeError as error:
            raise self._complaint(error) from None

    def values(self, futures: Sequence[Any]) -> list[Any]:
        """The answers to calls that were sent together, all within one time-out."""
        until = time.perf_counter() + self.timeout
        return [self.value(each, max(0.001, until - time.perf_counter())) for each in futures]

    def drop(self) -> None:
        """Let go of the session; nothing that was asked of it is answered any more."""
        session, self._session, self._services = self._session, None, {}
        if session is not None:
            self._due = time.perf_counter() + self._pause
            session.close(_async=True)  # to a silent peer it would block

    def close(self, service: str, method: str, *arguments: Any) -> None:
        """Let go of the robot, after a last call of a service that it may have."""
        try:
            if self.connected and self.has(service):
                self.call(service, method, *arguments)
        except (LinkLostError, RemoteError):
            pass  # nothing is expected of it any more
        self.drop()

    def ended(self, future: Any) -> bool:
        """Whether the answer to a call, or an error, is there."""
        return future.wait(0) != self._qi.FutureState.Running

    def _complaint(self, error: RuntimeError) -> AnytimeError:
        lines = str(error).strip().splitlines() or ["an error without a text"]
        if not self.connected or lines[0].startswith(_LOST):
            self.drop()
            return LinkLostError(f"no link to {self.url}: {lines[0]}")
        return RemoteError(lines[0])
