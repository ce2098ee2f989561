"""Knobs in a division of time: a module is set in one way, never in two at once."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from anytime.knobs import family_of
from compiler.tables import Table


def settings_of(tables: Sequence[Table]) -> list[list[Table]]:
    """The tables with each module's knobs set in every way; settings that are not chosen have no
    time. One list where nothing is left to set."""
    groups: dict[tuple[object, ...], list[str]] = {}
    for table in tables:
        family = family_of(table.module)
        if family != table.module and len(table.times) > 1:
            numbered = table.label.removeprefix(table.module)  # a second call has a number
            groups.setdefault((family, table.feeds, numbered), []).append(table.label)
    every = {label for group in groups.values() for label in group}
    return [
        [_untimed(t) if t.label in every - set(chosen) else t for t in tables]
        for chosen in itertools.product(*groups.values())
    ]


def _untimed(table: Table) -> Table:
    return replace(table, times=table.times[:1], chances=table.chances[..., :1, :])
