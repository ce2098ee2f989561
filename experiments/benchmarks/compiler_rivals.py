"""What the compiler's engine is compared with: the time domain, and a general solver."""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from anytime.machine_code import njit
from compiler.elimination import Factor


@njit(cache=True)
def forward(profiles, first):
    """The optimal profile of a chain by trying every split of every budget. [ZR93] §4.

    profiles: [n, Q, T] level that each further call reaches from a level in a time; first: [T] of
    the first call. Returns [T], the best level for every budget.
    """
    best = first
    for call in range(profiles.shape[0]):
        composed = np.zeros_like(best)
        for budget in range(len(best)):
            for before in range(budget + 1):
                level = profiles[call, best[before], budget - before]
                if level > composed[budget]:
                    composed[budget] = level
        best = composed
    return best


@njit(cache=True)
def forward_by_rows(profiles, first):
    """The same, ordered so that the machine takes many budgets at once: as fast as we could make
    the time domain, on levels of one byte."""
    best = first
    count = len(best)
    for call in range(profiles.shape[0]):
        composed = np.zeros_like(best)
        for before in range(count):
            row = profiles[call, best[before]]
            for after in range(count - before):
                level = row[after]
                reached = composed[before + after]
                composed[before + after] = level if level > reached else reached
        best = composed
    return best


def cp_sat(factors: Sequence[Factor], budget: int, limit: float) -> tuple[int, float, bool]:
    """The best level of the last variable within a budget by CP-SAT, with one table constraint
    for each factor of whole seconds, as one would model it.

    Returns the level, the CPU-seconds of one worker for the search, and whether it was ended by
    its limit of seconds. Raises ImportError without OR-tools.
    """
    cp_model: Any = importlib.import_module("ortools.sat.python.cp_model")
    model = cp_model.CpModel()
    sizes = {n: s for f in factors for n, s in zip(f.scope, f.table.shape, strict=True)}
    levels = {name: model.new_int_var(0, size - 1, name) for name, size in sizes.items()}
    seconds = []
    for factor in factors:
        cells = np.argwhere(factor.table <= budget)
        times = factor.table[tuple(cells.T)].astype(int)
        seconds.append(model.new_int_var(0, budget, ""))
        rows = np.column_stack([cells, times]).tolist()
        model.add_allowed_assignments([*[levels[n] for n in factor.scope], seconds[-1]], rows)
    model.add(sum(seconds) <= budget)
    output = levels[factors[-1].scope[-1]]
    model.maximize(output)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    solver.parameters.max_time_in_seconds = limit
    started = time.process_time()
    status = solver.solve(model)
    spent = time.process_time() - started
    found = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    return int(solver.value(output)) if found else 0, spent, status != cp_model.OPTIMAL
