"""Campaigns: the same bytes wherever the runs are made, whoever dies meanwhile."""

import contextlib
import functools
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

import anytime
from anytime import AnytimeError, Machine, WorkClock, campaigns, executors
from anytime.programs import program_of

MACHINE = Machine("test").with_rate("climb", 0.01).with_rate("fragile", 0.01)
CLOCK = functools.partial(WorkClock, MACHINE)


@anytime.module(quality=lambda value, problem: 1 - abs(value - problem.truth))
def climb(start, trap, *, rng):
    value = start
    for _ in range(12):
        anytime.charge(1)
        value += 0.3 * (0.5 - value) + rng.normal(0, 0.01)
        yield value
    if trap is not None and Path(trap).exists():
        Path(trap).unlink()
        os.kill(os.getpid(), signal.SIGKILL)


def leave(value):
    sys.exit("no more")


@anytime.module(quality=leave)
def judged(start):
    yield start


@anytime.module(quality=lambda value: value)
def mended(bug):
    if bug and Path(bug).exists():
        raise ValueError("a bug")
    anytime.charge(1)
    yield 0.5


@anytime.module(quality=lambda value: value)
def fragile(how):
    if how == "raises":
        raise ValueError("two\nlines")
    if how == "hangs":
        threading.Event().wait()
    if how == "kills":
        os.kill(os.getpid(), signal.SIGKILL)
    for value in 0.2, 0.4, 0.6:
        anytime.charge(1)
        yield value


def problems(count=40, trap=None):
    return [
        SimpleNamespace(name=f"p{i}", start=i / count, truth=0.5, trap=trap if i == 17 else None)
        for i in range(count)
    ]


def fragiles(*hows):
    return [SimpleNamespace(name=f"{i} {how}", how=how) for i, how in enumerate(hows)]


def saved(library, folder: Path) -> dict[str, bytes]:
    library.save(folder)
    files = (folder / "climb.profile", folder / "machine.json")
    return {file.name: file.read_bytes() for file in files}


def measured(folder, trap=None, **where):
    library = anytime.measure(climb, problems(trap=trap), seconds=1.0, clock=CLOCK, **where)
    return saved(library, folder)


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    return measured(tmp_path_factory.mktemp("serial"))


@pytest.fixture
def trap(tmp_path):
    """A file: the process that comes upon it first kills itself."""
    file = tmp_path / "trap"
    file.touch()
    return str(file)


def test_a_serial_campaign_gives_what_measuring_gives(tmp_path, serial):
    assert measured(tmp_path, executor="serial") == serial
    assert measured(tmp_path, executor="serial", store=tmp_path / "s" / "climb.runs") == serial


def test_two_processes_give_the_same_bytes_though_one_is_killed(tmp_path, serial, trap):
    assert measured(tmp_path / "library", trap, executor="processes:2") == serial
    assert not Path(trap).exists()


def test_a_dask_cluster_gives_the_same_bytes_though_a_worker_is_killed(tmp_path, serial, trap):
    pytest.importorskip("distributed")
    from experiments.benchmarks.clusters import cluster

    with cluster(2) as address:
        assert measured(tmp_path / "library", trap, executor=address) == serial
    assert not Path(trap).exists()


def test_a_killed_campaign_is_resumed_to_the_same_bytes(tmp_path, serial):
    store = tmp_path / "climb.runs"
    measured(tmp_path / "a", executor="serial", store=store)
    whole = store.read_bytes()
    for kept in (0, 5, len(whole) // 3, len(whole) - 7, len(whole)):
        store.write_bytes(whole[:kept])
        assert measured(tmp_path / "b", executor="serial", store=store) == serial
        assert sorted(store.read_bytes().splitlines()) == sorted(whole.splitlines())


def test_what_the_store_holds_is_not_run_again(tmp_path):
    store, seen = tmp_path / "climb.runs", []
    measured(tmp_path, executor="serial", store=store)
    measured(tmp_path, executor="serial", store=store, progress=lambda *at: seen.append(at))
    assert seen == []


def test_a_store_of_another_campaign_is_refused(tmp_path):
    store = tmp_path / "climb.runs"
    measured(tmp_path, store=store)
    with pytest.raises(AnytimeError, match=r"holds runs with seed 0, asked is 1"):
        measured(tmp_path, store=store, seed=1)
    store.write_text("{}\n")
    with pytest.raises(AnytimeError, match=r"climb.runs:1: not one of our runs"):
        measured(tmp_path, store=store)


def test_two_campaigns_do_not_write_to_one_store(tmp_path):
    pytest.importorskip("fcntl")
    from anytime.outcomes import Campaign, opened

    path = tmp_path / "climb.runs"
    asked = Campaign(program="p", seconds=1.0, rest=0.0, seed=0, clock="WallClock")
    with (
        opened(path, asked),
        pytest.raises(AnytimeError, match="another process writes"),
        opened(path, asked),
    ):
        pass


def test_a_run_that_fails_is_left_out_and_the_others_stand(tmp_path):
    asked = fragiles("works", "raises", "works")
    with pytest.warns(UserWarning, match="1 raises is left out: .*ValueError: two lines"):
        library = anytime.measure(fragile, asked, seconds=1.0, clock=CLOCK, executor="serial")
    assert library["fragile"].problems == ("0 works", "2 works")


def test_a_run_that_kills_its_workers_is_left_out_and_the_others_stand(tmp_path):
    asked = fragiles(*("works",) * 5, "kills", *("works",) * 5)
    store = tmp_path / "fragile.runs"
    with pytest.warns(UserWarning, match="5 kills is left out: its worker died 2 times"):
        library = anytime.measure(
            fragile, asked, seconds=1.0, clock=CLOCK, executor="processes:2", store=store
        )
    assert len(library["fragile"].problems) == 10
    with pytest.warns(UserWarning, match="5 kills is left out"):  # and not tried again
        anytime.measure(fragile, asked, seconds=1.0, clock=CLOCK, store=store)


def test_what_raised_is_tried_again_when_the_campaign_goes_on(tmp_path):
    bug, store = tmp_path / "bug", tmp_path / "mended.runs"
    bug.touch()
    asked = [SimpleNamespace(name=f"p{i}", bug=str(bug) if i % 2 else "") for i in range(16)]
    machine = Machine("test").with_rate("mended", 0.01)
    clock = functools.partial(WorkClock, machine)
    with pytest.warns(UserWarning, match="is left out: .*a bug"):
        library = anytime.measure(mended, asked, seconds=1.0, clock=clock, store=store)
    assert len(library["mended"].problems) == 8
    bug.unlink()
    library = anytime.measure(mended, asked, seconds=1.0, clock=clock, store=store)
    assert len(library["mended"].problems) == 16
    assert len(store.read_text().splitlines()) == 1 + 16 + 8


def test_a_campaign_that_cannot_begin_keeps_the_runs_that_it_was_to_replace(tmp_path):
    store = tmp_path / "climb.runs"
    asked = problems(4)
    anytime.measure(climb, asked, seconds=1.0, clock=CLOCK, store=store)
    before = store.read_bytes()
    nobody = "dask://127.0.0.1:1"
    with pytest.raises(AnytimeError, match="Dask"):
        anytime.measure(
            climb, asked, seconds=1.0, clock=CLOCK, store=store, resume=False, executor=nobody
        )
    assert store.read_bytes() == before
    anytime.measure(climb, asked[:1], seconds=1.0, clock=CLOCK, store=store, resume=False)
    assert len(store.read_text().splitlines()) == 2


@pytest.mark.parametrize("executor", ["serial", "processes:1"])
def test_a_score_that_ends_the_program_is_a_failure_of_its_problem(executor):
    machine = Machine("test").with_rate("judged", 0.01)
    with pytest.raises(AnytimeError, match=r"score of 'judged' failed .*SystemExit: no more"):
        anytime.measure(
            judged,
            problems(6),
            seconds=1.0,
            clock=functools.partial(WorkClock, machine),
            executor=executor,
        )


class Fleeting:
    """A problem that can be sent and not received."""

    def __init__(self, name):
        self.name, self.how = name, "works"

    def __reduce__(self):
        return _lost, (self.name,)


def _lost(name):
    raise LookupError(f"{name} is \ud800 nowhere")


def test_a_problem_that_cannot_be_received_is_left_out_and_told_as_it_is(tmp_path):
    asked = [*fragiles("works", "works"), Fleeting("2 lost")]
    store = tmp_path / "fragile.runs"
    with pytest.warns(UserWarning, match=r"2 lost is left out: LookupError: .*\\ud800 nowhere"):
        library = anytime.measure(
            fragile, asked, seconds=1.0, clock=CLOCK, executor="processes:1", store=store
        )
    assert library["fragile"].problems == ("0 works", "1 works")


def test_a_run_that_hangs_is_ended_and_left_out_and_the_others_stand(monkeypatch):
    monkeypatch.setattr(campaigns, "PATIENCE", 0.2)
    asked = fragiles("works", "hangs", "works")
    with pytest.warns(UserWarning, match="1 hangs is left out: its worker died 2 times"):
        library = anytime.measure(fragile, asked, seconds=0.05, clock=CLOCK, executor="processes:1")
    assert library["fragile"].problems == ("0 works", "2 works")


def test_when_all_fail_the_campaign_ends_early_with_the_reason():
    with pytest.raises(AnytimeError, match=r"the first 5 problems all failed: .*two lines"):
        anytime.measure(
            fragile, fragiles(*("raises",) * 100), seconds=1.0, clock=CLOCK, executor="serial"
        )


def test_without_an_executor_the_first_failure_is_raised():
    with pytest.raises(AnytimeError, match="failed on problem 1 raises before any result"):
        anytime.measure(fragile, fragiles("works", "raises"), seconds=1.0, clock=CLOCK)


def test_what_cannot_travel_is_measured_here_with_one_line_that_says_why(tmp_path, serial):
    @anytime.module(quality=lambda value: value)
    def local(how):
        yield 0.5

    with pytest.warns(UserWarning, match=r"local is measured serially: .*top level of a file"):
        anytime.measure(local, fragiles("works"), seconds=1.0, executor="processes:2")
    with pytest.warns(UserWarning, match=r"its clock cannot be sent.*functools\.partial"):
        library = anytime.measure(
            climb, problems(), seconds=1.0, clock=lambda: CLOCK(), executor="processes:2"
        )
    assert saved(library, tmp_path) == serial


def test_an_executor_of_the_users_own_is_used_and_left_open(tmp_path, serial):
    with ThreadPoolExecutor(2) as pool:
        assert measured(tmp_path, executor=pool) == serial
        assert pool.submit(int, "3").result() == 3


@pytest.mark.parametrize(
    "name", ["", "threads", "processes:", "processes:0", "processes:x", "dask:"]
)
def test_an_executor_that_is_none_is_refused(name):
    with pytest.raises(AnytimeError, match="serial, processes:N or dask://HOST:PORT"):
        executors.maker(name)


def test_a_program_travels_with_its_calls_as_they_are_joined():
    import pickle

    program = program_of(climb)
    back = pickle.loads(pickle.dumps(program))
    assert back.output is back.nodes[-1]
    assert back.output.module is climb


SCRIPT = """
import functools, time, os, sys
import anytime
from types import SimpleNamespace

@anytime.module(quality=lambda value: value)
def slow(start):
    for value in 0.2, 0.5, 0.9:
        anytime.charge(1)
        yield min(1.0, start + value * (1 - start))
    while os.path.exists(sys.argv[2] if len(sys.argv) > 2 else "") and start > 0.5:
        time.sleep(0.01)

def problems(rng):
    for i in range(20):
        yield SimpleNamespace(name=f"p{i}", start=i / 20)

def clock():
    return anytime.WorkClock(anytime.Machine("m").with_rate("slow", 0.01))

if __name__ == "__main__":
    library = anytime.measure(
        slow, problems(None), seconds=1.0, clock=clock, executor="processes:2",
        store=__import__("pathlib").Path(sys.argv[1], "slow.runs"))
    library.save(sys.argv[1])
"""


def test_a_script_of_the_user_runs_its_own_modules_in_processes(tmp_path):
    script = tmp_path / "mine.py"
    script.write_text(SCRIPT)
    ran = subprocess.run(
        [sys.executable, str(script), str(tmp_path / "out")], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr == ""
    assert anytime.ProfileLibrary(tmp_path / "out")["slow"].recordings


def processes_of(folder):
    """Those with the folder in their command line, where the system tells."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if str(folder).encode() in file.read_bytes():
                found.append(file.parent.name)
    return found


def test_a_campaign_killed_with_sigkill_goes_on_where_it_was(tmp_path):
    script, out, hold = tmp_path / "mine.py", tmp_path / "out", tmp_path / "hold"
    script.write_text(SCRIPT)
    hold.touch()
    begun = subprocess.Popen([sys.executable, str(script), str(out), str(hold)])
    store = out / "slow.runs"
    while not store.exists() or store.read_bytes().count(b"\n") < 6:
        assert begun.poll() is None
        time.sleep(0.02)
    begun.kill()
    begun.wait()
    while processes_of(tmp_path):  # none outlives it
        time.sleep(0.02)
    hold.unlink()
    kept = store.read_bytes()
    subprocess.run([sys.executable, str(script), str(out), str(hold)], check=True)
    assert store.read_bytes().startswith(kept[: kept.rfind(b"\n") + 1])
    fresh = tmp_path / "fresh"
    subprocess.run([sys.executable, str(script), str(fresh)], check=True)
    assert (out / "slow.profile").read_bytes() == (fresh / "slow.profile").read_bytes()


def test_the_command_resumes_and_tells_what_is_left_out(tmp_path, capsys):
    from anytime.__main__ import main

    script = tmp_path / "mine.py"
    script.write_text(SCRIPT)
    library = ("--library", str(tmp_path / "kept"))
    asked = ("profile", f"{script}:slow", "--problems", f"{script}:problems", *library)
    assert main([*asked, "--seconds", "0.05", "--runs", "4"]) == 0
    held = (tmp_path / "kept" / "slow.runs").read_bytes()
    assert main([*asked, "--seconds", "0.05", "--resume", "--executor", "processes:2"]) == 0
    assert (tmp_path / "kept" / "slow.runs").read_bytes().startswith(held)
    kept = (tmp_path / "kept" / "slow.runs").read_bytes()
    assert main([*asked, "--executor", "moon"]) == 2
    assert "executor 'moon'; give serial" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "kept").glob("*.runs*")] == ["slow.runs"]
    assert (tmp_path / "kept" / "slow.runs").read_bytes() == kept  # what it was asked lost nothing
