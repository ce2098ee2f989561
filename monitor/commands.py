"""Commands of the monitor: replay."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from anytime.command_line import Answer, add_command, natural, target
from anytime.errors import AnytimeError


def declare(commands: Any) -> None:
    """Declare the sub-commands."""
    parser = add_command(commands, "replay", replay, "the page of a mission's log")
    parser.add_argument("log", nargs="+", type=Path, help="log files; several become tabs")
    parser.add_argument("-o", "--output", type=target, metavar="FILE", help="default LOG.html")
    parser.add_argument("--follow", action="store_true", help="serve the page while it grows")
    parser.add_argument(
        "--port", type=natural, default=0, help="for --follow (default: a free one)"
    )


def replay(options: argparse.Namespace) -> Answer:
    """Write the page of one or several logs, or serve that of one that is still being written."""
    from monitor.logs import read_log
    from monitor.page import write_page

    if options.follow:
        from monitor.serving import serve

        if len(options.log) > 1:
            raise AnytimeError(f"--follow shows one log, not {len(options.log)}; give one")
        server = serve(options.log[0], port=options.port)
        print(f"http://127.0.0.1:{server.server_port}/  (Ctrl-C ends it)", flush=True)
        try:
            server.serve_forever()
        finally:
            server.server_close()
        return Answer("")
    for path in options.log:
        if path.is_dir():
            raise AnytimeError(f"{path} is a folder; give the log of a mission, a file")
    page = options.output or options.log[0].with_suffix(".html")
    if any(page.resolve() == path.resolve() for path in options.log):
        raise AnytimeError(f"{page} is the log itself; give another file with -o")
    logs = [read_log(path) for path in options.log]
    write_page(logs, page)
    return Answer(str(page), {"page": str(page), "frames": [len(log.frames) for log in logs]})
