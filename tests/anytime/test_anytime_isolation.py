"""Modules in worker processes: whatever they do, the caller has the last good result in time."""

import math
import os
import pickle
import signal
import threading
import time
from collections import namedtuple
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
from anytime import (
    AnytimeError,
    Deadline,
    Machine,
    Status,
    WallClock,
    WorkClock,
    isolation,
    modules,
    naming,
)
from anytime.isolation import HUNG
from anytime.mail import Letter
from anytime.modules import Limits
from anytime.running import Run, execute
from anytime.worker_letters import BEGINS, BEGUN, DONE, POST, POSTED
from anytime.workers import workers
from experiments.benchmarks import misbehaving
from experiments.benchmarks.misbehaving import GOOD, MISBEHAVING

LEFT = 30.0  # seconds that a test's contract leaves where time does not matter


@anytime.module(isolated=True, estimate=lambda value: value / 10)
def count(steps, *, rng):
    for value in range(steps):
        anytime.charge(0.5 * value)
        yield value


@anytime.module(isolated=True)
def search(steps):
    for value in range(steps):
        anytime.register(value)
    return "searched"


@anytime.module(isolated=True)
def patient():
    asked = 0
    while not anytime.expired():
        asked += 1
    return asked


@anytime.module(isolated=True)
def spoils(grid):
    grid[:] = 7
    os.chdir("/")
    np.random.seed(3)  # noqa: NPY002
    return int(grid.sum())


@anytime.module(isolated=True)
def drawn(*, rng):
    return rng.random()


@anytime.module(isolated=True)
def larger(size):
    yield np.arange(size)


def in_process(module):
    """The same module, run here."""
    function = module.function
    here = anytime.module(name=module.name, estimate=module.estimate)
    return here(function)


@pytest.fixture(autouse=True, scope="module")
def _no_process_is_left():
    yield
    workers.close()
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


@anytime.module(isolated=True)
def spots():
    """Its last results are of a type that its worker alone knows."""
    global Better
    Better = namedtuple("Better", "row column")
    for row in range(3):
        yield (row, row) if row < 2 else Better(2, 2)


@anytime.module(quality=lambda value: value, isolated=True)
def slowly(start):
    time.sleep(0.05)
    yield start


@anytime.module(isolated=True)
def crowded(steps):
    run = anytime.here()

    def work():
        for step in range(steps):
            run.charge(1)
            run.register(step)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


# What a run gives


def test_an_isolated_module_that_returns_in_time_is_complete():
    result = anytime.run(count, 4, seconds=LEFT)
    assert (result.status, result.value, result.fault) == (Status.COMPLETE, 3, None)
    assert [change.estimate for change in result.history] == [0.0, 0.1, 0.2, 0.3]
    assert result.work == 3.0


def test_each_result_is_told_to_whoever_listens():
    told = []
    anytime.run(count, 3, seconds=LEFT, on_result=lambda value, change: told.append(value))
    assert told == [0, 1, 2]


def test_a_large_result_travels_as_well():
    result = anytime.run(larger, 200_000, seconds=LEFT)
    assert np.array_equal(result.value, np.arange(200_000))


@pytest.mark.parametrize("observe", [None, lambda value, change: None])
def test_a_last_result_that_cannot_be_read_leaves_the_one_before_it(observe):
    result = anytime.run(spots, seconds=LEFT, on_result=observe)
    assert (result.value, len(result.history)) == ((1, 1), 2)
    assert "Better" in result.fault.message


def test_the_start_of_a_worker_is_no_step_of_its_module():
    workers.close()
    _, run = execute(count, (3,), Deadline.after(LEFT))
    assert sum(run.step_seconds) < 0.5 * run.history[-1].seconds


class Late:
    """A worker whose letters lay there for a while: it began at 1 s, had a result at 1.5 s and was
    done, and it is 4 s now."""

    def __init__(self):
        told = pickle.dumps((True, None))
        result = POSTED.pack(1.5, True, math.nan, 0) + pickle.dumps("result")
        self.letters = [(BEGUN, BEGINS.pack(1.0)), (POST, result), (DONE, told)]
        self.mailbox = SimpleNamespace(send=lambda *letter, until: None)

    def receive(self, until):
        return Letter(*self.letters.pop(0))


def test_a_step_is_as_long_as_it_was_though_the_caller_hears_of_it_late():
    now = iter([0.5])
    clock = SimpleNamespace(now=lambda: next(now, 4.0))
    run = Run(patient, Deadline(clock, 1e9))
    assert isolation._Isolated(run, Late(), lambda _: True).live(b"", 1e9) == (True, None)
    assert run.step_seconds == [0.5]
    assert [change.seconds for change in run.history] == [1.0]


def test_the_start_of_a_worker_is_no_time_of_what_is_measured():
    workers.close()
    asked = [SimpleNamespace(name=f"p{i}", start=0.5) for i in range(2)]
    library = anytime.measure(slowly, asked, seconds=0.1)
    assert [len(run.seconds) for run in library["slowly"].recordings] == [1, 1]


def test_what_its_threads_register_arrives_whole():
    machine = Machine("m").with_rate("crowded", 1e-6)
    result = anytime.run(crowded, 50, deadline=Deadline.after(1.0, WorkClock(machine)))
    assert (len(result.history), result.work, result.fault) == (150, 150.0, None)


def test_its_randomness_is_that_of_a_run_in_process():
    assert anytime.run(drawn, seconds=LEFT).value == anytime.run(in_process(drawn), seconds=9).value


def test_no_time_means_stop_now():
    assert anytime.run(count, 4, seconds=0).status is Status.NO_RESULT


@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.2, 4.0, 100.0])
@pytest.mark.parametrize("name", ["count", "search", "patient"])
def test_on_a_work_clock_it_is_the_run_of_this_process_bit_for_bit(name, seconds):
    module = {"count": count, "search": search, "patient": patient}[name]
    inputs = () if name == "patient" else (6,)
    clocks = [WorkClock(Machine("m").with_rate(name, 0.3)) for _ in range(2)]
    isolated, here = (
        anytime.run(each, *inputs, deadline=Deadline.after(seconds, clock))
        for each, clock in zip((module, in_process(module)), clocks, strict=True)
    )
    assert repr(isolated) == repr(here)
    assert isolated == here
    assert clocks[0].now() == clocks[1].now()


def test_where_no_worker_can_start_the_run_says_how_they_died(monkeypatch):
    workers.close()
    monkeypatch.setattr("sys.executable", "/bin/false")
    result = anytime.run(count, 4, seconds=1.0)
    assert result.status is Status.NO_RESULT
    assert result.fault.message == (
        "no worker process became ready in time; "
        "of the last that was never ready: the worker exited with 1"
    )
    workers.close()


def test_workers_that_die_one_after_the_other_end_even_a_run_without_a_deadline(monkeypatch):
    workers.close()
    monkeypatch.setattr("sys.executable", "/bin/false")
    result = anytime.run(count, 4, seconds=float("inf"))
    assert result.status is Status.NO_RESULT
    assert "the worker exited with 1" in result.fault.message
    workers.close()


def test_an_event_ends_the_wait_for_a_worker_that_is_not_ready_yet():
    workers.close()
    asked = []

    def event():
        asked.append(None)
        return len(asked) > 2  # it begins, and waits

    result = anytime.run(count, 4, deadline=Deadline(WallClock(), event=event))
    assert (result.status, result.fault) == (Status.NO_RESULT, None)


def test_who_looks_on_and_fails_ends_the_run_with_a_fault_as_in_process():
    def falls(value, change):
        raise TimeoutError("I cannot look")

    for module in (count, in_process(count)):
        result = anytime.run(module, 4, seconds=LEFT, on_result=falls)
        assert (result.status, result.value) == (Status.INTERRUPTED, 0)
        assert result.fault.kind == "TimeoutError"


# What a module may do, and what comes of it


@pytest.mark.parametrize("name", sorted(set(MISBEHAVING) - {"leaks", "floods_heavily"}))
def test_whatever_a_module_does_its_last_good_result_stands(name):
    isolation.warm(MISBEHAVING[name])
    result = anytime.run(MISBEHAVING[name], seconds=0.3)
    assert result.value == GOOD
    assert result.status is Status.INTERRUPTED
    assert anytime.run(count, 2, seconds=LEFT).value == 1  # and the next module has a worker


def test_how_a_worker_died_is_told():
    assert "SIGSEGV" in str(anytime.run(misbehaving.crashes, seconds=LEFT).fault)
    assert "exited with 3" in str(anytime.run(misbehaving.exits, seconds=LEFT).fault)


def test_a_leak_ends_at_its_limit_of_memory():
    fault = anytime.run(misbehaving.leaks, seconds=LEFT).fault
    assert fault is not None
    assert "MemoryError" in fault.kind


def test_an_exception_that_is_the_users_is_a_fault_of_the_module():
    fault = anytime.run(misbehaving.interrupts, seconds=LEFT).fault
    assert fault is not None
    assert fault.kind == "KeyboardInterrupt"


def test_what_a_module_spoils_is_its_own():
    grid, state, place = np.zeros(5), np.random.default_rng(1).random(), os.getcwd()
    result = anytime.run(spoils, grid, seconds=LEFT)
    assert (result.value, grid.sum(), os.getcwd()) == (35, 0.0, place)
    assert np.random.default_rng(1).random() == state


def test_a_module_without_progress_on_a_work_clock_is_charged_exactly_its_contract():
    clock = WorkClock(Machine("m").with_rate("loops", 0.1))
    clock.advance(0.3)
    began = time.perf_counter()
    result = anytime.run(misbehaving.loops, deadline=Deadline.after(3.0, clock))
    assert (clock.now(), result.elapsed, result.overrun) == (3.3, 3.0, 0.0)
    assert result.value == GOOD
    assert result.fault is not None
    assert time.perf_counter() - began >= HUNG


def test_a_module_that_was_told_to_stop_and_goes_on_is_cut():
    clock = WorkClock(Machine("m").with_rate("swallows", 0.1))
    result = anytime.run(misbehaving.swallows, deadline=Deadline.after(1.0, clock))
    assert result.fault is not None
    assert "goes on" in result.fault.message


def test_what_it_started_dies_with_it():
    anytime.run(misbehaving.starts_others, seconds=0.3)
    workers.close()
    with os.popen("ps -eo args") as listed:
        assert "sleep 30" not in listed.read()


def test_threads_may_run_isolated_modules_at_the_same_time():
    found = {}

    def work(steps):
        found[steps] = anytime.run(count, steps, seconds=LEFT).value

    threads = [threading.Thread(target=work, args=(steps,)) for steps in (2, 3, 4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {2: 1, 3: 2, 4: 3}


def test_a_worker_that_is_killed_from_outside_is_replaced():
    isolation.warm(count)
    worker = workers.take(naming.address(count.function), time.perf_counter() + LEFT)
    assert worker is not None, workers.missing()
    os.kill(worker.process.pid, signal.SIGKILL)
    workers.give(worker)
    assert anytime.run(count, 3, seconds=LEFT).value == 2


# What is refused


def test_inputs_that_cannot_be_sent_are_a_fault():
    fault = anytime.run(count, lambda: None, seconds=LEFT).fault
    assert fault is not None
    assert "cannot be sent" in fault.message


def test_a_module_that_no_other_process_can_find_is_refused_at_once():
    with pytest.raises(AnytimeError, match="top level of a file"):

        @anytime.module(isolated=True)
        def hidden():
            yield 1


def test_where_processes_cannot_be_cut_an_isolated_module_is_refused(monkeypatch):
    monkeypatch.setattr(modules, "_POSIX", False)
    with pytest.raises(AnytimeError, match="it takes Linux or macOS"):
        anytime.module(isolated=True)(_remembers)


def test_an_isolated_module_has_no_memory():
    with pytest.raises(AnytimeError, match="worker may die"):
        anytime.module(isolated=True)(_remembers)


def _remembers(*, memory):
    yield memory


def test_a_limit_that_nothing_fits_in_is_refused():
    with pytest.raises(AnytimeError, match="at least"):
        Limits(memory=10)


def test_a_module_is_pickled_by_its_name():
    assert pickle.loads(pickle.dumps(count)) is count
    with pytest.raises(pickle.PicklingError):
        pickle.dumps(in_process(count))


# Interrupted by an event


@anytime.module(isolated=True)
def silent():
    anytime.register(GOOD)
    while True:  # no check-point any more
        pass


def test_an_event_ends_the_wait_for_a_worker_that_says_nothing():
    heard = []
    until = Deadline.after(LEFT)
    until = Deadline(until.clock, until.at, event=lambda: len(heard) > 0)
    result = anytime.run(
        silent, deadline=until, on_result=lambda value, change: heard.append(value)
    )
    assert (result.status, result.value, result.fault) == (Status.INTERRUPTED, GOOD, None)
    assert result.elapsed < LEFT / 2


def test_an_event_stops_a_worker_on_a_work_clock_at_its_next_check():
    clock = WorkClock(Machine("m").with_rate("count", 1.0))
    until = Deadline(clock, event=lambda: clock.now() >= 2.0)
    result = anytime.run(count, 10, deadline=until)
    here = WorkClock(clock.machine)
    same = anytime.run(
        in_process(count), 10, deadline=Deadline(here, event=lambda: here.now() >= 2)
    )
    assert result.value == same.value
    assert result.history == same.history
