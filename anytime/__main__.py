"""The command `anytime`: walks the sub-commands that packages declare."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
import tempfile
import traceback
from collections.abc import Sequence

from anytime import plugins
from anytime.command_line import Parser, as_json, told
from anytime.errors import AnytimeError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # for what is printed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Exit codes: 0 done, 1 the mission was not reached or a goal was missed, 2 bad input, 130
    interrupted, 70 a bug of ours (with the path of a report).
    """
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal may know fewer characters than we use
        sys.stdout.reconfigure(errors="replace")
    parser = Parser(prog="anytime", description="Anytime computation for robots.")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for point in plugins.registered("anytime.commands").values():
        try:
            plugins.load(point).declare(commands)
        except Exception as error:  # a third party's broken command must not break ours
            broken = f"commands of {plugins.origin(point)} are left out: {error}"
            print(f"anytime: {broken}".replace("\n", " "), file=sys.stderr)
    options = parser.parse_args(arguments)
    try:
        with told():
            answer = options.run(options)
        print(as_json(answer.data) if options.json else answer.text, flush=True)
    except AnytimeError as error:
        print(f"anytime: {error}".replace("\n", " "), file=sys.stderr)
        return 2
    except BrokenPipeError:
        _drop_output()
        return 0
    except OSError as error:
        if not error.filename and error.errno not in NO_ROOM:
            return _bug(error)
        if not error.filename:
            _drop_output()
        place = error.filename2 or error.filename or "standard output"
        print(f"anytime: {place}: {error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("anytime: interrupted", file=sys.stderr)
        return 130
    except Exception as error:
        return _bug(error)
    return answer.code


def _drop_output() -> None:
    """Let what could not be printed go nowhere, or it would be tried once more at the end."""
    with contextlib.suppress(OSError):  # a stand-in for standard output has no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _bug(error: Exception) -> int:
    print(f"anytime: a bug of ours, {error!r}; report: {_report()}", file=sys.stderr)
    return 70


def _report() -> str:
    """Where the traceback is: in a file, or above where none can be made."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="anytime-crash-", suffix=".txt", delete=False, encoding="utf-8"
        ) as file:
            traceback.print_exc(file=file)
    except OSError:
        traceback.print_exc()
        return "above"
    return file.name


if __name__ == "__main__":
    sys.exit(main())
