"""Portable graymaps (PGM), the images in which ROS keeps its maps: a small strict reader."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from anytime.errors import AnytimeError
from sensing.maps import LARGEST_MAP

_HEADER = 4096
_GAP = rb"(?:\s|#[^\r\n]*[\r\n])+"
_START = re.compile(_GAP.join((rb"(P[25])", rb"(\d{1,9})", rb"(\d{1,9})", rb"(\d{1,5})")))


def read_pgm(path: str | os.PathLike[str]) -> NDArray[np.uint8]:
    """Read an 8-bit PGM image, binary (P5) or plain (P2), as uint8 [rows, columns], scaled to 255.

    Raises AnytimeError in one line; sizes are refused from the header, before memory is taken.
    """
    path = Path(path)
    if not path.is_file():
        raise AnytimeError(f"{path}: no such image, or no plain file")
    try:
        with path.open("rb") as file:
            head = file.read(_HEADER)
            found = _START.match(head)
            if found is None:
                _refuse(path, "the file does not begin as a PGM: 'P5' or 'P2', width, height, 255")
            width, height, brightest = (int(found.group(at)) for at in (2, 3, 4))
            if width < 1 or height < 1:
                _refuse(path, f"the image is {width} x {height}; it must have at least one pixel")
            if width * height > LARGEST_MAP:
                _refuse(path, f"the image is {width} x {height}; at most {LARGEST_MAP} pixels")
            if not 1 <= brightest <= 255:
                _refuse(path, f"the brightest value is {brightest}; it must be 1 to 255 (8 bits)")
            binary = found.group(1) == b"P5"
            room = path.stat().st_size - found.end()
            needed = width * height + 1 if binary else 2 * width * height
            if room < needed:
                _refuse(
                    path,
                    f"the header says {width} x {height}, which takes at least {needed} bytes, but"
                    f" {room} follow; the file is cut short, or the header is wrong",
                )
            most = needed + 4096 if binary else 16 * width * height + 65536
            if room > most:
                _refuse(path, f"{room} bytes follow a header for {width} x {height} pixels")
            file.seek(found.end())
            body = file.read()
    except OSError as error:
        raise AnytimeError(f"{path}: cannot be read ({error.strerror})") from None
    values = _binary(path, body, width * height) if binary else _plain(path, body, width * height)
    if int(values.max()) > brightest:
        _refuse(path, f"a pixel is {values.max()}; the header says that {brightest} is brightest")
    if brightest != 255:
        values = (values.astype(np.uint32) * 255 + brightest // 2) // brightest
    return values.astype(np.uint8).reshape(height, width)


def write_pgm(image: NDArray[np.uint8], path: str | os.PathLike[str]) -> None:
    """Write uint8 [rows, columns] as a binary PGM."""
    if image.ndim != 2 or image.dtype != np.uint8 or image.size == 0:
        raise AnytimeError(
            f"the image is {image.dtype} {image.shape}: a PGM takes uint8 [rows, columns]"
        )
    rows, columns = image.shape
    Path(path).write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + image.tobytes())


def _binary(path: Path, body: bytes, count: int) -> NDArray[np.uint8]:
    if not body[:1].isspace():
        _refuse(path, "no white space parts the header from the pixels; the header is damaged")
    if body[1 + count :].strip():
        _refuse(path, "bytes follow the last pixel; a map has one image of the size it declares")
    return np.frombuffer(body, np.uint8, count, offset=1)


def _plain(path: Path, body: bytes, count: int) -> NDArray[np.int64]:
    words = re.sub(rb"#[^\r\n]*", b"", body).split()
    if len(words) != count:
        _refuse(path, f"{len(words)} pixels follow; the header says {count}")
    if not all(len(word) <= 3 and word.isdigit() for word in words):
        _refuse(path, "a pixel is no whole number from 0 to 255")
    return np.array(words, dtype="S3").astype(np.int64)


def _refuse(path: Path, problem: str) -> NoReturn:
    raise AnytimeError(f"{path}: {problem}")
