"""A served NAO as a process of its own, and a link to it that can be made to fail."""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Coroutine
from types import TracebackType
from typing import Any, Self

from anytime.errors import AnytimeError


class ServedNao:
    """`anytime nao-sim` with these options, until it is closed or killed.

    Raises AnytimeError if it does not start.
    """

    def __init__(self, *options: str) -> None:
        command = [sys.executable, "-m", "anytime", "nao-sim", *options]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        line = next((line for line in self.process.stdout if line.startswith("READY ")), None)
        if line is None:
            raise AnytimeError(f"no NAO is served: {self.process.stderr.read().strip()}")
        self.url = line.split()[1]

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    def kill(self) -> None:
        """End it at once, as a crash does."""
        self.process.kill()
        self.process.wait()

    def close(self) -> None:
        """Let it end by closing its stdin; if it does not, kill it."""
        try:
            self.process.communicate(timeout=5.0)
        except (subprocess.TimeoutExpired, ValueError):
            self.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class FaultProxy:
    """A port of 127.0.0.1 that leads to another, unless it is told to fail."""

    def __init__(self, port: int) -> None:
        self.delay = 0.0  # seconds that everything takes on its way
        self.garbled = False  # from now on other bytes arrive than were sent
        self._target = port
        self._writers: list[asyncio.StreamWriter] = []
        self._loop = asyncio.new_event_loop()
        self._open = asyncio.Event()
        self._open.set()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = self._do(asyncio.start_server(self._join, "127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    def silence(self) -> None:
        """From now on nothing comes through; it is kept for `heal`."""
        self._loop.call_soon_threadsafe(self._open.clear)

    def heal(self) -> None:
        """All goes through again, what was kept as well."""
        self._loop.call_soon_threadsafe(self._open.set)

    def reset(self) -> None:
        """Break all connections, without a farewell."""
        self._loop.call_soon_threadsafe(self._abort)

    def close(self) -> None:
        self._do(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
        self._loop.close()

    def _do(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(5.0)

    def _abort(self) -> None:
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _end(self) -> None:
        self._server.close()
        self._abort()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    async def _join(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.CancelledError):
            there = await asyncio.open_connection("127.0.0.1", self._target)
            self._writers += [writer, there[1]]
            await asyncio.gather(self._pump(reader, there[1]), self._pump(there[0], writer))

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while data := await reader.read(65536):
                await asyncio.sleep(self.delay)
                await self._open.wait()
                writer.write(os.urandom(len(data)) if self.garbled else data)
                await writer.drain()
        finally:
            writer.close()
