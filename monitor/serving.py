"""The replay page of a mission that is still under way, on 127.0.0.1 only.

The viewer only ever reads the log, so that a slow or dead one cannot hold the mission.
"""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from anytime.errors import AnytimeError
from monitor.log_reading import read_log
from monitor.page.rendering import page_data, render_all

LOOK = 0.3  # seconds between two looks at the log's size
BEAT = 10.0  # seconds after which silence is broken, so that a closed page is noticed


class LogServer(ThreadingHTTPServer):
    """Serves `/` (the page), `/data` (what it shows) and `/events` (one for each growth)."""

    daemon_threads = True

    def __init__(self, log: Path, port: int) -> None:
        self.log = log
        self.closing = threading.Event()
        super().__init__(("127.0.0.1", port), _Handler)

    @property
    def url(self) -> str:
        """Where to look."""
        return f"http://127.0.0.1:{self.server_address[1]}/"

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing of a viewer that went away: the terminal belongs to the mission."""

    def server_close(self) -> None:
        self.closing.set()
        super().server_close()


def serve(path: Path | str, port: int = 0) -> LogServer:
    """A server of this log's page; call `serve_forever()` on it, and use it as a context manager.

    port: 0 takes any free one, see `url`. Raises AnytimeError if the log or the port is no use.
    """
    read_log(path)
    try:
        return LogServer(Path(path), port)
    except (OSError, OverflowError) as error:
        raise AnytimeError(f"port {port} of 127.0.0.1: {error}; 0 takes a free one") from None


class _Handler(BaseHTTPRequestHandler):
    server: LogServer
    protocol_version = "HTTP/1.0"

    def do_GET(self) -> None:
        # A page elsewhere whose name was rebound to 127.0.0.1 carries its own name here.
        if self.headers.get("Host", "").partition(":")[0] not in ("127.0.0.1", "localhost"):
            self._answer(403, "text/plain", b"only for 127.0.0.1\n")
            return
        try:
            if self.path == "/":
                page = render_all([read_log(self.server.log)], live=True)
                self._answer(200, "text/html; charset=utf-8", page.encode(errors="replace"))
            elif self.path == "/data":
                data = json.dumps(page_data([read_log(self.server.log)]), allow_nan=False)
                self._answer(200, "application/json", data.encode())
            elif self.path == "/events":
                self._events()
            else:
                self._answer(404, "text/plain", b"there are /, /data and /events\n")
        except AnytimeError as error:
            self._answer(500, "text/plain", f"{error}\n".encode())
        except ConnectionError:
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal belongs to the mission."""

    def _answer(self, status: int, kind: str, content: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def _events(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        # The first event tells of what was written between the page and this request.
        size, silence = self._size(), 0.0
        self.wfile.write(f"data: {size}\n\n".encode())
        while not self.server.closing.wait(LOOK):
            grown = self._size()
            silence += LOOK
            if grown != size:
                self.wfile.write(f"data: {grown}\n\n".encode())
            elif silence >= BEAT:
                self.wfile.write(b": still here\n\n")
            else:
                continue
            size, silence = grown, 0.0

    def _size(self) -> int:
        try:
            return self.server.log.stat().st_size
        except OSError:
            return 0
