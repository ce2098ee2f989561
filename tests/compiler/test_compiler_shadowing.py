"""What a schedule would have earned lies between what is sure and what is possible."""

import numpy as np
import pytest

import compiler
from anytime import Machine, WorkClock
from anytime.shadow import Shadow


def watched(tail, count=400):
    """A shadow of a loop that sees and finds; `tail`: seconds that see goes on in vain."""
    clock = WorkClock(Machine("test"))
    shadow = Shadow(clock)
    rng = np.random.default_rng(0)

    def see(image):
        for quality in (0.5, 0.9):
            clock.advance(0.01)
            yield [quality, image]
        clock.advance(tail)

    def find(boxes):
        for quality in (0.3, 0.6, 0.9, 0.9, 0.9, 0.9):
            clock.advance(0.01)
            shadow.register([quality * boxes[0]])
        return [0.9 * boxes[0]]

    see = shadow.watch(see, quality=lambda boxes: boxes[0])
    find = shadow.watch(find, quality=lambda found: found[0])

    @shadow.frame
    def step(image):
        for boxes in see(image):
            last = boxes
        return find(last)

    for _ in range(count):
        step(rng.random())
    return shadow


@pytest.fixture(scope="module")
def advice():
    return compiler.advise(watched(tail=0.1))


def test_time_spent_in_vain_is_surely_saved(advice):
    assert advice.p95 == pytest.approx(0.18)
    assert advice.quality == pytest.approx(0.81)
    surely, at_best = advice.sooner
    assert at_best <= surely <= 0.06


def test_what_is_sure_is_never_more_than_what_is_possible(advice):
    low, high = advice.promised
    assert low <= high


def test_what_worse_inputs_do_is_said_to_be_unknown(advice):
    told = repr(advice)
    assert "what find makes of worse boxes: see fed it but once a frame" in told
    assert max(map(len, told.splitlines())) <= 100
