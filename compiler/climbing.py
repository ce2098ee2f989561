"""Hill climbing over levels: divisions that are good, without a proof."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from compiler.elimination import Factor


def cost_of(factors: Sequence[Factor], levels: Mapping[str, int]) -> float:
    """Seconds in all at these levels; inf where they do not go together."""
    return sum(float(f.table[tuple([levels[name] for name in f.scope])]) for f in factors)


def climbed(
    factors: Sequence[Factor], start: Mapping[str, int], fixed: frozenset[str]
) -> dict[str, int]:
    """Change one level, or two of one table at once, to the cheapest there is until none gains."""
    levels = dict(start)
    touching = {
        name: [factor for factor in factors if name in factor.scope]
        for name in levels
        if name not in fixed
    }
    pairs = dict.fromkeys(
        (one, other)
        for factor in factors
        for place, one in enumerate(factor.scope)
        for other in factor.scope[place + 1 :]
        if one in touching and other in touching
    )
    groups: list[tuple[str, ...]] = [*[(name,) for name in touching], *pairs]
    best, before = cost_of(factors, levels), np.inf
    while best < before:
        before = best
        for group in groups:
            near = list({id(f): f for name in group for f in touching[name]}.values())
            total = np.zeros([1] * len(group))
            for factor in near:
                index = tuple([slice(None) if n in group else levels[n] for n in factor.scope])
                inside = [name for name in factor.scope if name in group]
                part = factor.table[index].transpose(
                    [inside.index(n) for n in group if n in inside]
                )
                total = total + part[tuple([slice(None) if n in inside else None for n in group])]
            cheapest = np.unravel_index(int(np.argmin(total)), total.shape)
            if total[cheapest] < total[tuple([levels[name] for name in group])]:
                levels.update({n: int(level) for n, level in zip(group, cheapest, strict=True)})
        best = cost_of(factors, levels)
    return levels
