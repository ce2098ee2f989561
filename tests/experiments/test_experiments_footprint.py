"""What is counted as the room that the library takes."""

from __future__ import annotations

import sys

from experiments.benchmarks.footprint import APART, OURS, cpu_seconds, installed


def test_what_it_needs_is_counted_and_what_a_robot_has_anyway_is_not():
    found = installed(OURS, APART)
    assert {OURS, "tqdm", "lazy-loader", "msgspec"} <= found
    assert found.isdisjoint({*APART, "llvmlite", "pillow", "pytest"})


def test_who_works_longer_takes_more_of_the_processor():
    little, much = (
        cpu_seconds([sys.executable, "-S", "-c", f"sum(range({count}))"])
        for count in (1, 20_000_000)
    )
    assert 0 < little < much
