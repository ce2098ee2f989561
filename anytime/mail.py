"""Letters between two processes over a socket. A letter counts when it is whole.

What is large travels as a file in memory whose descriptor is passed along: the sender is never held
up half-way through it, and it outlives a sender that dies.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import tempfile
import time
from collections import deque
from typing import NamedTuple

from anytime.errors import AnytimeError
from anytime.files import LARGEST

INLINE = 16 * 2**10  # bytes of a letter that are sent with it
_HEAD = struct.Struct("<cBQ")  # kind, whether the content is in a file, length of the content
_CHUNK = 64 * 2**10
_MILLISECOND = 1e-3


class Letter(NamedTuple):
    """What one end sent to the other."""

    kind: bytes
    content: bytes


class ClosedError(ConnectionError):
    """The other end is gone, or speaks in riddles."""


class Mailbox:
    """One end of the line. It blocks no longer than it is told."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self._bytes = bytearray()
        self._files: deque[int] = deque()
        self._poll = select.poll()
        self._poll.register(line, select.POLLIN)
        line.setblocking(False)

    def send(self, kind: bytes, content: bytes = b"", until: float = float("inf")) -> None:
        """Send a letter until a time of `time.perf_counter`.

        Raises AnytimeError for more than `LARGEST` bytes, TimeoutError, and ClosedError.
        """
        if len(content) > LARGEST:
            raise AnytimeError(f"{len(content)} bytes are too many; at most {LARGEST} are sent")
        head = _HEAD.pack(kind, len(content) > INLINE, len(content))
        if len(content) <= INLINE:
            self._send(head + content, (), until)
            return
        file = _in_memory(content)
        try:
            self._send(head, (file,), until)
        finally:
            os.close(file)

    def receive(self, until: float) -> Letter | None:
        """The next letter; None if there is none by then. Raises ClosedError."""
        while (letter := self._next()) is None:
            if self._read():
                continue
            if time.perf_counter() >= until:
                return None
            self.wait(until)
        return letter

    def wait(self, until: float) -> None:
        """Until something arrives, or that time."""
        # The kernel's poll counts milliseconds and rounds up: the last one is slept through, and
        # what arrives in it is found by the next look.
        left = until - time.perf_counter()
        if left > _MILLISECOND:
            self._poll.poll(min(1e3 * left - 1, 1e6))
        elif left > 0:
            time.sleep(left)

    def waiting(self) -> bool:
        """Whether a letter has begun to arrive."""
        return bool(self._bytes) or bool(self._poll.poll(0))

    def close(self) -> None:
        self._line.close()
        while self._files:
            os.close(self._files.popleft())

    def _send(self, content: bytes, files: tuple[int, ...], until: float) -> None:
        view = memoryview(content)
        while view:
            try:
                sent = (
                    socket.send_fds(self._line, [view], files) if files else self._line.send(view)
                )
            except BlockingIOError:
                left = until - time.perf_counter()
                if left <= 0:
                    raise TimeoutError("nobody took the letter in time") from None
                free = select.poll()
                free.register(self._line, select.POLLOUT)
                free.poll(min(1e3 * left, 1e3))
                continue
            except OSError as error:
                raise ClosedError(str(error)) from None
            view, files = view[sent:], ()

    def _next(self) -> Letter | None:
        if len(self._bytes) < _HEAD.size:
            return None
        kind, filed, length = _HEAD.unpack_from(self._bytes)
        if filed > 1 or length > (LARGEST if filed else INLINE):
            raise ClosedError("what arrives is no letter")
        whole = _HEAD.size + (0 if filed else length)
        if len(self._bytes) < whole:
            return None
        content = bytes(self._bytes[_HEAD.size : whole])
        del self._bytes[:whole]
        if filed:
            if not self._files:
                raise ClosedError("a letter came without its file")
            content = _taken(self._files.popleft(), length)
        return Letter(kind, content)

    def _read(self) -> bool:
        """Take what is there; whether there was anything."""
        try:
            found, files, _, _ = socket.recv_fds(self._line, _CHUNK, 16)
        except BlockingIOError:
            return False
        except OSError as error:
            raise ClosedError(str(error)) from None
        self._files.extend(files)
        if not found:
            raise ClosedError("the line is closed")
        self._bytes += found
        return True


def _in_memory(content: bytes) -> int:
    """A descriptor of a file without a name that holds the content."""
    if hasattr(os, "memfd_create"):
        file = os.memfd_create("anytime")
    else:
        with tempfile.TemporaryFile() as made:
            file = os.dup(made.fileno())
    try:
        view, at = memoryview(content), 0
        while at < len(content):
            at += os.pwrite(file, view[at:], at)
    except BaseException:
        os.close(file)
        raise
    return file


def _taken(file: int, length: int) -> bytes:
    """What such a file holds; it is closed. Raises ClosedError for less than was promised."""
    content = bytearray(length)
    try:
        with contextlib.suppress(OSError):
            if os.preadv(file, [content], 0) == length:
                return bytes(content)
        raise ClosedError("a letter's file is shorter than it said")
    finally:
        os.close(file)
