"""Running modules: what ends a run, what it keeps, and what it refuses."""

from __future__ import annotations

import contextlib
import functools
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
from anytime import AnytimeError, Deadline, Machine, OutsideRunError, Status, WallClock, WorkClock
from anytime.running import execute

MACHINE = Machine("m").with_rate("count", 1.0).with_rate("outer", 0.0).with_rate("search", 1.0)


@anytime.module()
def count():
    yield from range(1, 6)


@anytime.module(name="search")
def search(steps):
    for value in range(steps):
        anytime.register(value)


def on_work_clock(module, *inputs, seconds, **options):
    """Run on a clock where every step takes one second."""
    return anytime.run(
        module, *inputs, deadline=Deadline.after(seconds, WorkClock(MACHINE)), **options
    )


# What ends a run


def test_a_generator_that_returns_in_time_is_complete():
    result = on_work_clock(count, seconds=100)
    assert (result.status, result.value, len(result.history)) == (Status.COMPLETE, 5, 5)
    assert result.overrun == 0


def test_a_generator_is_not_stepped_past_its_deadline():
    result = on_work_clock(count, seconds=3)
    assert (result.status, result.value) == (Status.INTERRUPTED, 3)
    assert result.elapsed == 3


def test_register_ends_a_plain_function_at_the_deadline_and_keeps_the_value():
    result = on_work_clock(search, 10, seconds=3)
    assert (result.status, result.value, result.elapsed) == (Status.INTERRUPTED, 2, 3)
    assert result.fault is None


def test_expired_tells_a_plain_function_to_stop():
    @anytime.module(name="search")
    def patient():
        asked = 0
        while not anytime.expired():
            asked += 1
        return asked

    result = on_work_clock(patient, seconds=5)
    assert (result.value, result.status) == (4, Status.INTERRUPTED)


def test_what_returns_without_ever_being_told_to_stop_is_complete():
    @anytime.module(name="search")
    def quick():
        assert not anytime.expired()
        return "done"

    assert on_work_clock(quick, seconds=50).status is Status.COMPLETE


def test_a_bare_except_that_swallows_the_stop_is_not_complete():
    @anytime.module(name="search")
    def stubborn():
        for value in range(5):
            with contextlib.suppress(BaseException):
                anytime.register(value)

    result = on_work_clock(stubborn, seconds=2)
    assert (result.status, result.value) == (Status.INTERRUPTED, 4)
    assert result.overrun == 3


@pytest.mark.parametrize("seconds", [0, 0.0, -1, -np.inf])
@pytest.mark.parametrize("module", [count, search])
def test_no_time_means_stop_now(module, seconds):
    ran = on_work_clock(module, *([3] if module is search else []), seconds=seconds)
    assert (ran.status, ran.value, ran.history) == (Status.NO_RESULT, None, ())
    assert not ran


def test_seconds_that_are_not_a_number_are_refused():
    with pytest.raises(AnytimeError, match="seconds is nan"):
        anytime.run(count, seconds=float("nan"))


def test_a_bare_yield_is_a_check_point_with_nothing_new():
    @anytime.module(name="count")
    def slow_start():
        yield
        yield
        yield "found"

    result = on_work_clock(slow_start, seconds=10)
    assert [change.work for change in result.history] == [3]
    assert on_work_clock(slow_start, seconds=2).status is Status.NO_RESULT


def test_a_returned_value_is_registered():
    @anytime.module(name="count")
    def last_word():
        yield 1
        return 2

    assert on_work_clock(last_word, seconds=9).value == 2


def test_a_result_that_comes_late_is_returned_with_its_overrun():
    @anytime.module(name="count")
    def jump():
        anytime.charge(7)
        yield "late"

    result = on_work_clock(jump, seconds=5)
    assert (result.value, result.overrun, result.history[0].seconds) == ("late", 2, 7)


def test_the_average_of_its_steps_keeps_a_generator_in_time():
    result = on_work_clock(count, seconds=2.5)
    assert (result.value, result.overrun) == (2, 0)


# Faults


def test_an_exception_keeps_the_last_good_result():
    @anytime.module(name="count")
    def faulty():
        yield "good"
        raise KeyError("gone")

    result = on_work_clock(faulty, seconds=9)
    assert (result.value, result.status) == ("good", Status.INTERRUPTED)
    assert result.fault is not None
    assert result.fault.kind == "KeyError"
    assert "gone" in str(result.fault)
    assert "Traceback" in result.fault.details
    assert "fault" in repr(result)
    assert "Traceback" not in repr(result)


@pytest.mark.parametrize("at", range(4))
def test_a_fault_at_any_step_is_a_fault_of_the_result(at):
    @anytime.module(name="count")
    def faulty():
        for step in range(4):
            if step == at:
                raise SystemExit(3)
            yield step

    result = on_work_clock(faulty, seconds=9)
    assert result.fault is not None
    assert result.fault.kind == "SystemExit"
    assert result.value == (at - 1 if at else None)
    assert bool(result) == (at > 0)


@pytest.mark.parametrize("seen", [float("nan"), float("inf"), -1.0, 2.0, "much"])
def test_an_estimate_that_is_no_quality_is_a_fault_and_the_earlier_result_stands(seen):
    told = iter([0.5, seen])

    @anytime.module(name="count", estimate=lambda value: next(told))
    def sure():
        yield "good"
        yield "bad"

    result = on_work_clock(sure, seconds=9)
    assert (result.value, len(result.history)) == ("good", 1)
    assert result.fault is not None


def test_keyboard_interrupt_is_the_users_and_passes_through():
    @anytime.module(name="count")
    def interrupted():
        yield 1
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        on_work_clock(interrupted, seconds=9)


def test_a_generator_that_refuses_to_close_is_a_fault():
    @anytime.module(name="count")
    def clinging():
        for value in range(100):
            try:
                yield value
            except GeneratorExit:
                yield value

    result = on_work_clock(clinging, seconds=2)
    assert result.value == 1
    assert result.fault is not None


# Runs inside runs


def test_a_run_inside_a_run_ends_at_the_earlier_deadline():
    inner: list[anytime.Result] = []

    @anytime.module(name="outer")
    def outer():
        inner.append(anytime.run(search, 100, seconds=50))
        anytime.register("after")
        anytime.register("never")

    result = on_work_clock(outer, seconds=4)
    assert inner[0].value == 3
    assert inner[0].elapsed == 4
    assert result.value == "after"


def test_a_shorter_run_inside_leaves_the_outer_one_going():
    @anytime.module(name="outer")
    def outer():
        found = anytime.run(search, 100, seconds=2)
        anytime.register(found.value)
        return "went on"

    result = on_work_clock(outer, seconds=100)
    assert (result.status, result.value) == (Status.COMPLETE, "went on")


def test_only_the_own_run_catches_the_stop():
    inner: list[anytime.Result] = []

    @anytime.module(name="count")
    def outer():
        stop_outer = anytime.here()

        @anytime.module(name="search")
        def meddling():
            while True:
                stop_outer.register("from within")

        inner.append(anytime.run(meddling, seconds=50))

    result = on_work_clock(outer, seconds=0.5)
    assert inner == []
    assert result.value == "from within"


def test_a_wall_deadline_inside_a_run_in_real_time_is_bounded_too():
    seen: list[float] = []

    @anytime.module()
    def inner():
        seen.append(anytime.here().deadline.remaining())
        return 1

    @anytime.module()
    def outer():
        return anytime.run(inner, deadline=Deadline.after(1e6, WallClock())).value

    anytime.run(outer, seconds=100)
    assert seen[0] <= 100


def test_a_module_called_inside_another_gets_what_is_left():
    @anytime.module(name="outer")
    def outer():
        return count() + 100

    assert on_work_clock(outer, seconds=3).value == 103


def test_a_generator_leaks_no_run_to_its_caller():
    @anytime.module(name="count")
    def looks_inside():
        yield anytime.here()
        yield anytime.here()

    on_work_clock(looks_inside, seconds=9)
    with pytest.raises(OutsideRunError):
        anytime.here()


# Outside and after a run


@pytest.mark.parametrize(
    "call", [lambda: anytime.register(1), anytime.expired, lambda: anytime.charge(1), anytime.here]
)
def test_outside_a_run_one_is_told_how_to_run(call):
    with pytest.raises(OutsideRunError, match=r"anytime\.run\(module, …, seconds=…\)"):
        call()


def test_a_module_called_like_a_function_says_how_to_run_it():
    with pytest.raises(AnytimeError, match=r"anytime\.run\(search, …, seconds=…\)"):
        search(3)


def test_a_closed_run_refuses_and_changes_nothing():
    left: list[anytime.running.Run] = []

    @anytime.module(name="count")
    def leaks():
        left.append(anytime.here())
        yield "kept"

    result, run = execute(leaks, (), Deadline.after(9, WorkClock(MACHINE)))
    for call in (lambda: left[0].register("late"), left[0].expired, lambda: left[0].charge(1)):
        with pytest.raises(OutsideRunError, match="has ended"):
            call()
    assert (run.value, len(run.history)) == ("kept", 1)
    assert result.value == "kept"


def test_here_hands_the_run_to_a_thread():
    @anytime.module()
    def threaded():
        run = anytime.here()
        failed: list[BaseException] = []

        def work():
            run.register("from the thread")
            try:
                anytime.register("without the handle")
            except OutsideRunError as error:
                failed.append(error)

        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        assert failed

    result = anytime.run(threaded, seconds=100)
    assert (result.value, result.fault) == ("from the thread", None)


# What a run fills in


def test_a_contract_module_is_told_its_time():
    @anytime.module(name="count")
    def contract(factor, *, seconds):
        yield factor * seconds

    assert contract.contract
    assert on_work_clock(contract, 2, seconds=7).value == 14
    assert contract.parameters == ("factor",)


def test_the_generator_is_seeded_by_the_name_alone_and_can_be_given():
    @anytime.module(name="count")
    def drawn(*, rng):
        yield rng.random()

    same = {on_work_clock(drawn, seconds=9).value for _ in range(3)}
    assert len(same) == 1
    given_rng = on_work_clock(drawn, seconds=9, rng=np.random.default_rng(4)).value
    assert given_rng == np.random.default_rng(4).random()


def test_memory_is_fresh_unless_it_is_given():
    @anytime.module(name="count")
    def remembers(*, memory):
        memory["seen"] = memory.get("seen", 0) + 1
        yield memory["seen"]

    kept: dict[str, int] = {}
    assert [on_work_clock(remembers, seconds=9).value for _ in range(2)] == [1, 1]
    assert [on_work_clock(remembers, seconds=9, memory=kept).value for _ in range(2)] == [1, 2]


def test_a_keyword_that_nothing_fills_in_is_refused_at_once():
    with pytest.raises(AnytimeError, match="'colour', which nothing fills in"):

        @anytime.module()
        def painted(*, colour):
            yield colour


def test_inputs_that_nobody_names_are_refused_at_once():
    with pytest.raises(AnytimeError, match=r"\*inputs; name its inputs"):

        @anytime.module()
        def many(*inputs):
            yield inputs


def test_quality_and_cost_exclude_each_other():
    with pytest.raises(AnytimeError, match="not both"):
        anytime.module(quality=lambda x: 1.0, cost=lambda x: 1.0)


def test_the_wrong_number_of_inputs_is_named():
    with pytest.raises(AnytimeError, match=r"takes 1 inputs \(steps\), not 2"):
        anytime.run(search, 1, 2, seconds=1)


def test_one_deadline_is_needed_and_only_one():
    with pytest.raises(AnytimeError, match="one of them"):
        anytime.run(count)
    with pytest.raises(AnytimeError, match="one of them"):
        anytime.run(count, seconds=1, deadline=Deadline.after(1))


def test_what_is_no_module_is_named():
    with pytest.raises(AnytimeError, match="is not a module"):
        anytime.run(len, seconds=1)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("work", [-1, float("nan"), float("inf")])
def test_work_is_a_finite_amount(work):
    @anytime.module(name="count")
    def cheats():
        yield "good"
        anytime.charge(work)

    fault = on_work_clock(cheats, seconds=9).fault
    assert fault is not None
    assert "charged" in fault.message


# Solvers of others


def test_scipy_is_stopped_from_within_its_objective():
    optimize = pytest.importorskip("scipy.optimize")
    calls: list[int] = []

    @anytime.module(name="search")
    def solve():
        def objective(x):
            calls.append(1)
            anytime.register(x.copy())
            return float((x**2).sum())

        try:
            optimize.minimize(objective, np.ones(5), method="L-BFGS-B")
        except Exception as error:  # what careful code around a solver looks like
            raise AssertionError("the stop is not an Exception") from error

    result = on_work_clock(solve, seconds=4)
    assert (len(calls), result.status, result.fault) == (4, Status.INTERRUPTED, None)


def test_register_can_be_the_callback_of_a_solver_with_two_arguments():
    optimize = pytest.importorskip("scipy.optimize")

    @anytime.module(name="search")
    def solve():
        optimize.minimize(
            lambda x: float((x**2).sum()),
            np.ones(2),
            method="trust-constr",
            callback=anytime.register,
        )

    result = on_work_clock(solve, seconds=2)
    assert (len(result.history), result.fault) == (2, None)


# Repeatable


@given(seconds=st.floats(0, 12), work=st.lists(st.integers(0, 4), min_size=1, max_size=8))
def test_a_run_on_a_work_clock_repeats_bit_for_bit(seconds, work):
    @anytime.module(name="count", estimate=lambda value: value)
    def charged(*, rng):
        for units in work:
            anytime.charge(units)
            yield float(rng.random())

    runs = [on_work_clock(charged, seconds=seconds) for _ in range(2)]
    assert repr(runs[0]) == repr(runs[1])
    assert runs[0] == runs[1]
    result = runs[0]
    assert result.work == pytest.approx(result.elapsed)
    assert result.overrun == pytest.approx(max(0.0, result.elapsed - seconds))
    assert bool(result) == bool(result.history)
    times = [change.seconds for change in result.history]
    assert times == sorted(times)


def test_the_text_of_a_result_keeps_to_its_line():
    @anytime.module(name="count")
    def long_winded():
        yield "x" * 1000
        raise RuntimeError("y" * 1000)

    assert max(map(len, repr(on_work_clock(long_winded, seconds=9)).splitlines())) <= 100


# Interrupted by an event


def test_an_event_stops_a_run_at_its_next_check():
    clock = WorkClock(Machine("m").with_rate("climb", 1.0))

    @anytime.module(quality=lambda value: value)
    def climb():
        for step in range(100):
            anytime.charge(1)
            yield step

    until = Deadline(clock, event=lambda: clock.now() >= 7.5)
    result = anytime.run(climb, deadline=until)
    assert (result.status, result.value) == (Status.INTERRUPTED, 7)


def test_an_event_stops_a_solver_and_what_runs_inside():
    clock = WorkClock(Machine("m").with_rate("inner", 1.0).with_rate("outer", 0.0))

    @anytime.module(quality=lambda value: value)
    def inner():
        step = 0
        while not anytime.expired():
            step += 1
            anytime.register(step)

    @anytime.module(quality=lambda value: value)
    def outer():
        anytime.charge(0)
        return anytime.run(inner, deadline=Deadline(clock)).value

    result = anytime.run(outer, deadline=Deadline(clock, event=lambda: clock.now() >= 6.5))
    assert clock.now() <= 8
    assert 1 <= result.value <= 7


def test_an_event_that_has_come_already_means_that_nothing_is_run():
    @anytime.module(quality=lambda value: value)
    def never():
        raise AssertionError("it was run")
        yield

    result = anytime.run(never, deadline=Deadline(WorkClock(Machine("m")), event=lambda: True))
    assert (result.status, result.fault) == (Status.NO_RESULT, None)


def test_a_generator_behind_a_wrapper_is_run_as_one():
    def traced(function):
        @functools.wraps(function)
        def wrapper(*inputs):
            return function(*inputs)

        return wrapper

    @anytime.module(name="search")
    @traced
    def wrapped(steps):
        yield from range(1, steps)

    assert on_work_clock(wrapped, 9, seconds=3.0).value == 3


def test_a_generator_that_is_returned_is_a_fault_and_no_result():
    @anytime.module(name="search")
    def returning():
        return (value for value in range(3))

    result = on_work_clock(returning, seconds=3.0)
    assert result.status is Status.NO_RESULT
    assert "returned a generator" in str(result.fault)


def test_what_a_generator_registers_while_it_is_closed_is_its_own():
    @anytime.module(name="search")
    def inner():
        try:
            yield "inner"
            yield "more"
        finally:
            with contextlib.suppress(AnytimeError):
                anytime.register("cleaning up")

    @anytime.module()
    def outer():
        yield "outer"
        anytime.run(inner, seconds=1.5)

    assert on_work_clock(outer, seconds=9.0).value == "outer"


def test_an_error_that_cannot_say_what_it_is_is_a_fault_all_the_same():
    class BrokenError(Exception):
        def __str__(self):
            return self.missing

    @anytime.module(name="search")
    def breaks():
        yield "good"
        raise BrokenError

    result = on_work_clock(breaks, seconds=9.0)
    assert result.value == "good"
    assert result.fault.kind == "BrokenError"


def test_a_deadline_is_an_instant_and_no_number():
    with pytest.raises(AnytimeError, match=r"deadline is 0\.1; give Deadline\.after"):
        anytime.run(count, deadline=0.1)


def test_a_first_result_that_was_at_hand_makes_no_later_step_look_cheap():
    @anytime.module(name="search")
    def prepared():
        anytime.charge(0)
        yield "at hand"
        for step in range(20):
            anytime.charge(4)
            yield step

    for seconds in range(10, 60):
        result = on_work_clock(prepared, seconds=float(seconds))
        assert result.overrun == 0
        assert result.value == seconds // 4 - 1
