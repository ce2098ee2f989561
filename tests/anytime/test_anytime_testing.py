"""The conformance kit passes a module that keeps its contract and names what another does not."""

from types import SimpleNamespace

import numpy as np
import pytest

import anytime
from anytime import AnytimeError, Machine, WorkClock, testing

pytest_plugins = ["anytime.fixtures"]

NAMES = ("good", "late", "single", "lazy", "falls", "draws", "keeps", "spoils", "stubborn", "flat")


def clock():
    machine = Machine("test")
    for name in NAMES:
        machine = machine.with_rate(name, 0.01)
    return WorkClock(machine)


def near(value, problem):
    return 1 - abs(float(np.sum(value)) - problem.truth)


def problems():
    return [SimpleNamespace(start=np.array([i / 8]), truth=0.5) for i in range(4)]


@anytime.module(quality=near)
def good(start, *, rng):
    guess = start.copy()
    for step in range(1, 20):
        guess = guess + 0.5 * (0.5 - guess) + rng.normal(0, 1e-3) / step
        yield guess


@anytime.module(quality=near)
def late(start):
    for _ in range(15):
        yield
    for share in 0.5, 0.9, 1.0:
        yield start + share * (0.5 - start)


@anytime.module(quality=near)
def single(start):
    yield start
    for _ in range(15):
        yield


@anytime.module(quality=near)
def lazy(start):
    for share in 0.5, 0.9, 1.0:
        anytime.charge(40)
        yield start + share * (0.5 - start)


@anytime.module(quality=near)
def falls(start):
    for share in 1.0, 0.5, 0.2, 0.1:
        yield start + share * (0.5 - start)


@anytime.module(quality=near)
def draws(start):
    for _ in range(5):
        yield start * np.random.default_rng().random()


@anytime.module(quality=near)
def keeps(start):
    guess = start.copy()
    for _ in range(8):
        guess += 0.5 * (0.5 - guess)
        yield guess


@anytime.module(quality=near)
def spoils(start):
    for _ in range(8):
        start += 0.5 * (0.5 - start)
        yield start.copy()


@anytime.module(quality=near)
def stubborn(start):
    while True:
        try:
            anytime.register(start)
        except BaseException:
            continue


@anytime.module(quality=lambda value: 0.5)
def flat(start):
    for share in 0.5, 0.9, 1.0:
        yield start * share


def test_a_module_that_keeps_its_contract_passes(module_check):
    module_check(good, problems(), seconds=0.2, clock=clock)


@pytest.mark.parametrize(
    ("module", "check", "told"),
    [
        (late, testing.registers_early, "first result after"),
        (single, testing.registers_often, "registers 1 results"),
        (lazy, testing.keeps_deadline, "needs a check-point every"),
        (falls, testing.is_monotone, "go on registering the best"),
        (draws, testing.is_deterministic, "draw from its keyword-only parameter rng"),
        (keeps, testing.leaves_values_alone, "after it has registered it"),
        (spoils, testing.leaves_values_alone, "changes its input 'start'"),
        (stubborn, testing.is_interruptible, "told to stop"),
        (flat, testing.is_measurable, "must tell a rough result from a good one"),
    ],
    ids=lambda each: getattr(each, "name", None) or getattr(each, "__name__", None),
)
def test_what_a_module_does_not_keep_is_named_in_one_line(module, check, told):
    with pytest.raises(testing.ConformanceError, match=told) as raised:
        check(module, problems(), seconds=0.2, clock=clock)
    assert module.name in str(raised.value)
    assert "\n" not in str(raised.value)
    with pytest.raises(testing.ConformanceError):
        testing.conforms(module, problems(), seconds=0.2, clock=clock)


def test_a_module_that_no_worker_can_find_is_said_so():
    @anytime.module(quality=near)
    def hidden(start):
        yield start

    with pytest.raises(AnytimeError, match="top level of a file"):
        testing.is_interruptible(hidden, problems(), seconds=0.2)


def test_a_problem_without_an_input_is_named():
    with pytest.raises(AnytimeError, match=r"no \.start"):
        testing.registers_early(good, [SimpleNamespace(truth=1)], seconds=0.1, clock=clock)


def test_the_kit_works_in_real_time():
    testing.is_deterministic(good, problems(), seconds=0.05)
    testing.registers_often(good, problems(), seconds=0.05)
