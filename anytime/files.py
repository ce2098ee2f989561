"""Files that are whole or absent: atomic writing, strict JSON with a checksum."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import os
import stat
import tempfile
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import msgspec

from anytime.errors import AnytimeError

LARGEST = 256 * 2**20  # bytes of a file that we are ready to parse
DEEPEST = 32  # lists and objects inside one another


class Stored(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """What every stored struct derives from: unknown fields are refused."""


Record = TypeVar("Record", bound=Stored)
Table = TypeVar("Table", bound=msgspec.Struct)


class Disk:
    """The calls that writing makes of the file system; one that fails stands in for it in tests."""

    def create(self, folder: Path, prefix: str) -> tuple[int, str]:
        return tempfile.mkstemp(dir=folder, prefix=prefix, suffix=_STRAY)

    def write(self, file: int, content: bytes) -> None:
        view = memoryview(content)
        while view:
            view = view[os.write(file, view) :]

    def sync(self, file: int) -> None:
        os.fsync(file)

    def rename(self, old: str, new: Path) -> None:
        Path(old).chmod(stat.S_IMODE(new.stat().st_mode) if new.exists() else 0o644)
        Path(old).replace(new)

    def remove(self, path: str) -> None:
        Path(path).unlink(missing_ok=True)

    def open_folder(self, folder: Path) -> int:
        return os.open(folder, os.O_RDONLY)


DISK = Disk()
_STRAY = ".tmp"  # how the name of a file ends that is not whole yet


def write_atomically(path: Path, content: bytes, disk: Disk = DISK) -> None:
    """Write a file so that a crash leaves the old one or the new one, never a mixture.

    When this returns the new one is on the disk; when it raises OSError the old one stands, unless
    the folder alone could not be synchronised. What a link leads to is written, and what is no
    file (a pipe, a device) is written to. Raises AnytimeError for a folder.
    """
    path = Path(os.path.realpath(path))
    if path.is_dir():
        raise AnytimeError(f"{path} is a folder; give the name of a file")
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    sweep(path.parent)
    file, temporary = disk.create(path.parent, f".{path.name}.{os.getpid()}.")
    try:
        try:
            disk.write(file, content)
            disk.sync(file)
        finally:
            os.close(file)
        disk.rename(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):  # what stays is swept by the next to write
            disk.remove(temporary)
        raise
    folder = disk.open_folder(path.parent)
    try:
        disk.sync(folder)
    finally:
        os.close(folder)


def sweep(folder: Path) -> None:
    """Remove what writers left in a folder that died before they had written."""
    for stray in folder.glob(f".*.*{_STRAY}"):
        writer = stray.name.removesuffix(_STRAY).split(".")[-2]
        if writer.isdigit() and not _lives(int(writer)):
            with contextlib.suppress(OSError):
                stray.unlink()


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def write_record(path: Path, schema: str, record: Stored) -> None:
    """Write a struct as JSON: sorted keys, one row of a list a line, no NaN, a checksum.

    Raises AnytimeError when a number in it is not finite; the old file then stays.
    """
    content = msgspec.to_builtins(record)
    _refuse_non_finite(content, "$", path)
    content = {"schema": schema, **content}
    content["checksum"] = checksum(content)
    write_atomically(path, laid_out(content).encode())


def read_record(path: Path, schema: str, kind: type[Record]) -> Record:
    """Read a struct written by `write_record`.

    Raises AnytimeError, in one line with the path, for whatever is wrong with the file.
    """
    content = read_json(path)
    if not isinstance(content, dict) or "schema" not in content:
        raise AnytimeError(f"{path}: not one of our files: no 'schema'; expected {schema!r}")
    if content["schema"] != schema:
        raise AnytimeError(f"{path}: has schema {content['schema']!r}, needed is {schema!r}")
    stated = content.pop("checksum", None)
    if stated != checksum(content):
        raise AnytimeError(f"{path}: checksum does not match; the file was cut or edited by hand")
    del content["schema"]
    try:
        return msgspec.convert(content, kind)
    except (msgspec.ValidationError, OverflowError) as error:
        raise AnytimeError(f"{path}: {' '.join(str(error).split())}") from None


def read_json(path: Path) -> Any:
    """Parse strict JSON: no NaN, no infinity, no key twice. Raises AnytimeError with the path."""
    try:
        size = path.stat().st_size
        if path.exists() and not path.is_file() and not path.is_dir():
            raise AnytimeError(f"{path}: a pipe or a device, no file")
        if size > LARGEST:
            raise AnytimeError(f"{path}: {size} bytes; at most {LARGEST} are read")
        text = path.read_bytes().decode()
    except FileNotFoundError:
        raise AnytimeError(f"{path}: no such file") from None
    except OSError as error:
        raise AnytimeError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise AnytimeError(f"{path}: not a text file in UTF-8") from None
    try:
        content = json.loads(text, object_pairs_hook=_unique, parse_constant=_refuse_constant)
    except (json.JSONDecodeError, RecursionError) as error:
        reason = error.msg if isinstance(error, json.JSONDecodeError) else "nested too deeply"
        line = f":{error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise AnytimeError(f"{path}{line}: not one of our files, not JSON: {reason}") from None
    except ValueError as error:
        raise AnytimeError(f"{path}: {error}") from None
    _refuse_non_finite(content, "$", path)
    return content


def checksum(content: Mapping[str, Any]) -> str:
    """Of a record without its checksum."""
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(canonical.encode(), digest_size=16).hexdigest()


def laid_out(content: Mapping[str, Any]) -> str:
    """One key a line, and in a list of rows one row a line, so that differences read well."""
    lines: list[str] = []
    for key in sorted(content):
        value = content[key]
        if isinstance(value, list) and value and isinstance(value[0], dict | list):
            rows = ",\n  ".join(_compact(row) for row in value)
            lines.append(f"{json.dumps(key)}: [\n  {rows}\n]")
        else:
            lines.append(f"{json.dumps(key)}: {_compact(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _compact(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise ValueError("a key occurs twice in one object")
    return content


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number that a file may hold")


def _refuse_non_finite(value: Any, where: str, path: Path, depth: int = 0) -> None:
    if depth > DEEPEST:
        raise AnytimeError(f"{path}: nested too deeply; our files nest at most {DEEPEST} deep")
    if isinstance(value, float) and not math.isfinite(value):
        raise AnytimeError(f"{path}: {where} is {value}; numbers must be finite")
    if isinstance(value, dict):
        for key, item in value.items():
            _refuse_non_finite(item, f"{where}.{key}", path, depth + 1)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _refuse_non_finite(item, f"{where}[{index}]", path, depth + 1)


def read_toml(path: Path, kind: type[Table], what: str) -> Table:
    """A TOML file that people write, as a struct. what: it is, as in "no such mission file".

    Raises AnytimeError, in one line with the path, for whatever is wrong with it.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise AnytimeError(f"{path}: no such {what}") from None
    except IsADirectoryError:
        raise AnytimeError(f"{path} is a folder; give a {what}") from None
    except OSError as error:
        raise AnytimeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:  # of the text, its bytes, a number's digits
        raise AnytimeError(f"{path}: not TOML: {error}") from None
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        message, _, where = str(error).partition(" - at `$.")
        place = f"{where.rstrip('`')}: " if where else ""
        raise AnytimeError(f"{path}: {place}{message}") from None
