"""The tables of a compiled program as a C header: C99 and C++, no state, no allocation."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from anytime.files import write_atomically
from compiler.exporting import LONGEST, Exported, Integers

BUCKETS = 1024  # of the index, at most: two kilobytes

_TEMPLATE = """\
/* {text}
 *
 * {about}
 *
 * Written by `anytime export`; export again rather than edit.
 */
#ifndef {guard}
#define {guard}

#include <stdint.h>

/* A budget, divided: microseconds of each call in order, and what the result is expected to be
 * worth. Below {least} ms there is no result: then all is 0. */
typedef struct {{
{fields}
    double promised;
}} {name}_division;

/* The best division of a budget in milliseconds. What a call leaves unspent is the next one's. */
static inline {name}_division {name}_divide(int32_t budget_ms)
{{
    /* The least budget of each row; what each call has, to which some add the whole budget. */
{tables}
    /* A row to begin at, by the budget above the least one, in steps of {bucket} ms. */
    {start}
    {name}_division division = {{{zeros}}};
    uint32_t row = {last}u;
    if (budget_ms < from_ms[0]) {{
        return division;
    }}
    if (budget_ms < from_ms[{last}]) {{
        row = start[(uint32_t)(budget_ms - from_ms[0]) >> {shift}];
{search}    }}
{answer}
    division.promised = promised[row];
    return division;
}}

#endif
"""


def write_header(tables: Exported, path: Path) -> None:
    """Write the tables as a header with one struct and one function, named after the program."""
    write_atomically(path, header(tables).encode())


def header(tables: Exported) -> str:
    """The text of the header.

    An index by budget leads near the row, and what is left of the way is a search by halving
    without branches: unpredictable budgets cost no more than others.
    """
    name, last = identifier(tables.name), len(tables.from_ms) - 1
    fields = [f"{field}_us" for field in identifiers(tables.calls)]
    start, shift, steps = _index(tables.from_ms)
    beyond = [LONGEST] * (2**steps - 1)  # where the search may look
    columns = [_column("int32_t", "from_ms", tables.from_ms.tolist() + beyond)]
    answer: list[str] = []
    for field, us, rest in zip(fields, tables.share_us.T, tables.rest.T, strict=True):
        columns.append(_column(_integer(us), field, us.tolist()))
        if rest.any() and not rest.all():
            columns.append(_column("uint8_t", f"{field}_rest", rest.astype(int).tolist()))
        budget = "INT64_C(1000) * budget_ms + " if rest.any() else ""
        factor = f"{field}_rest[row] * " if rest.any() and not rest.all() else ""
        answer.append(f"    division.{field} = {factor}{budget}{field}[row];")
    columns.append(_column("double", "promised", tables.promised.tolist()))
    return _TEMPLATE.format(
        text=_comment(tables.text),
        about=_comment(_about(tables)),
        guard=f"ANYTIME_{name}_H",
        fields="\n".join(f"    int64_t {field};" for field in fields),
        name=name,
        tables="\n".join(columns),
        start=_column("uint16_t" if last < 2**16 else "uint32_t", "start", start.tolist()).lstrip(),
        bucket=2**shift,
        shift=shift,
        last=last,
        least=int(tables.from_ms[0]),
        zeros=", ".join(["0"] * (len(fields) + 1)),
        search="".join(
            f"        row = from_ms[row + {step}u] <= budget_ms ? row + {step}u : row;\n"
            for step in (2**power for power in reversed(range(steps)))
        ),
        answer="\n".join(answer),
    )


def _index(from_ms: Integers) -> tuple[Integers, int, int]:
    """The row at the beginning of each bucket of 2^shift ms, at most `BUCKETS`; the shift; and how
    many halvings lead to any row that begins within a bucket."""
    span = int(from_ms[-1] - from_ms[0])
    shift = max(0, (span // BUCKETS).bit_length())
    begins = from_ms[0] + (np.arange((span >> shift) + 1, dtype=np.int64) << shift)
    start = _row(from_ms, begins)
    within = _row(from_ms, begins + (2**shift - 1)) - start
    return start, shift, int(within.max()).bit_length()


def _row(from_ms: Integers, budgets: Integers) -> Integers:
    return np.asarray(np.searchsorted(from_ms, budgets, side="right") - 1, dtype=np.int64)


def _integer(values: Integers) -> str:
    return "int32_t" if np.abs(values).max() < 2**31 else "int64_t"


def identifier(text: str) -> str:
    """What C and C++ accept as the beginning of an identifier; different texts stay different."""
    plain = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z]", "_", text)).strip("_")
    safe = plain if plain and not plain[0].isdigit() else f"p{plain}"
    if safe == text:
        return text
    return f"{safe}_{hashlib.blake2b(text.encode(), digest_size=4).hexdigest()}"


def identifiers(labels: Iterable[str]) -> list[str]:
    """A different identifier for each label."""
    taken: list[str] = []
    for label in labels:
        base = identifier(label)
        numbered = (f"{base}_{count}" for count in itertools.count(2))
        taken.append(base if base not in taken else next(n for n in numbered if n not in taken))
    return taken


def _about(tables: Exported) -> str:
    seconds = tables.from_ms / 1000
    return (
        f"{len(seconds)} divisions of {seconds[0]:g} to {seconds[-1]:g} s among "
        f"{', '.join(tables.calls)}; measured on machine {tables.machine}."
    )


def _comment(text: str) -> str:
    """Text that neither ends the comment nor means anything to a preprocessor."""
    plain = "".join(c if c.isprintable() and c not in "\\?" else "." for c in text)
    return "\n * ".join(wrap(plain.replace("*/", "* /").replace("/*", "/ *"), 94)) or "-"


def _column(kind: str, name: str, values: Sequence[float]) -> str:
    rows = wrap(", ".join(repr(value) for value in values), 88)
    body = "\n".join(f"        {row}" for row in rows)
    return f"    static const {kind} {name}[{len(values)}] = {{\n{body}\n    }};"
