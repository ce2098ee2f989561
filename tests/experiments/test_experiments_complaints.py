"""What users of other libraries complain of, each as a test. `docs/complaints.md` is made of this
file: `python tests/experiments/test_experiments_complaints.py` writes it.

The first line of a docstring is the complaint, the second names threads that tell of it, the rest
says what is so here.
"""

import ast
import itertools
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import anytime
from anytime import Deadline, Machine, Status, WorkClock, campaigns, testing

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "complaints.md"
MACHINE = Machine("desk").with_rate("climb", 0.01).with_rate("last_moment", 0.01)


def clock():
    return WorkClock(MACHINE)


@anytime.module(quality=lambda value: value)
def climb(start, *, rng):
    """Gets better a step at a time, with some luck."""
    value = start
    for _ in range(100):
        value = min(1.0, value + 0.02 * rng.random())
        yield value


@anytime.module(quality=lambda value: value)
def last_moment(start):
    for _ in range(99):
        yield
    yield 1.0


@anytime.module(quality=lambda value: value)
def hangs_on_one(number):
    anytime.charge(1)
    yield 0.5
    while number == 3:
        pass
    anytime.charge(1)
    yield 0.9


def problems(count=6):
    return [SimpleNamespace(name=f"p{i}", start=i / 20) for i in range(count)]


@pytest.fixture(scope="module")
def office(tmp_path_factory):
    """A mission of the grid robot: how it is lived with a seed, its report with seed 3, its log."""
    from experiments import shipped
    from monitor.robots.briefing import QUICK, brief
    from monitor.robots.grid_missions import read_mission

    briefing = brief(read_mission(shipped.mission_path()), shipped.profiles(), QUICK)

    log = tmp_path_factory.mktemp("office") / "mission.jsonl"

    def live(seed, log=None):
        return briefing.live(briefing.monitor("fixed"), seed, log=log)

    return live, live(3, log), log


def test_a_budget_is_a_budget():
    """A planner ignores its time, or always uses all of it.
    ompl#1096, ompl#947, moveit#1349, navigation2#2584
    A run ends at the first check-point after its deadline, and tells by how much that was late; one
    that is done returns at once."""
    cut = anytime.run(climb, 0.0, deadline=Deadline.after(0.095, clock()))
    assert cut.status is Status.INTERRUPTED
    assert cut.overrun <= 0.01
    done = anytime.run(climb, 0.0, deadline=Deadline.after(50.0, clock()))
    assert done.status is Status.COMPLETE
    assert done.elapsed == pytest.approx(1.0)


def test_no_time_left_means_stop_now_and_never_no_limit():
    """Left-over time of zero or less, passed to the next stage, means no limit.
    moveit#1329
    Zero or negative time runs nothing, and the result says that there is none."""
    for seconds in (0.0, -1.0):
        assert anytime.run(climb, 0.0, seconds=seconds).status is Status.NO_RESULT


def test_a_run_in_progress_can_be_stopped():
    """Planning cannot be cancelled.
    navigation2#4139, navigation2#4659, moveit_ros#439
    Every check-point is a place to stop, which is tried in a worker process; and a run inside
    another ends with it."""
    testing.is_interruptible(climb, problems(), seconds=0.5)


@anytime.module(quality=lambda value: value)
def goes_on(start, *, memory):
    value = memory.get("value", start)
    for _ in range(100):
        yield value
        memory["value"] = value = min(1.0, value + 0.01)


def test_an_interrupted_search_goes_on_where_it_was():
    """An interrupt loses the work; a search cannot be resumed.
    ompl#622, ompl#583
    The best so far is the result, and a module with a memory goes on from it."""
    memory = {}
    machine = MACHINE.with_rate("goes_on", 0.01)
    first = anytime.run(
        goes_on, 0.0, deadline=Deadline.after(0.2, WorkClock(machine)), memory=memory
    )
    second = anytime.run(
        goes_on, 0.0, deadline=Deadline.after(0.2, WorkClock(machine)), memory=memory
    )
    assert first.value > 0
    assert second.value > first.value


def test_a_module_that_registers_only_at_its_end_is_found_out():
    """Termination conditions do nothing for planners that register solutions at the end.
    ompl#708, ompl#907, moveit#2167
    The conformance kit fails such a module, and says what to do."""
    with pytest.raises(testing.ConformanceError, match="register as soon as there is something"):
        testing.registers_early(last_moment, problems(), seconds=1.0, clock=clock)


def test_each_intermediate_result_is_seen_from_python():
    """Intermediate solutions are hard to get at from Python.
    ompl#1047, ompl#901, ompl#521
    `on_result` is called with each result as it comes."""
    seen = []
    result = anytime.run(
        climb,
        0.0,
        deadline=Deadline.after(0.1, clock()),
        on_result=lambda value, change: seen.append((change.seconds, value)),
    )
    assert len(seen) == len(result.history)
    assert seen[-1][1] == result.value


def test_quality_over_time_is_recorded_alike_for_every_module():
    """Quality over time is not recorded, or not alike for all planners; reported cost goes up.
    ompl#1298, ompl#1021, bench-mr#42
    `measure` records every result of any module; as measured, and as the best so far."""
    profile = anytime.measure(climb, problems(), seconds=0.5, clock=clock)["climb"]
    times = np.linspace(0, 0.5, 20)
    assert all(len(run.seconds) for run in profile.recordings)
    assert np.all(np.diff(profile.mean(times)) >= 0)
    assert np.all(profile.mean(times) >= profile.mean(times, as_measured=True))


def test_a_seed_is_an_argument_and_nothing_global_is_touched():
    """Seeds are global, come too late, or are dropped without a word.
    ompl#729, ompl#1173
    A run draws from the generator that it is given; the global ones stay as they are."""
    before = np.random.get_state()[1].copy()  # noqa: NPY002

    def run(seed):
        rng = np.random.default_rng(seed)
        return anytime.run(climb, 0.0, deadline=Deadline.after(0.3, clock()), rng=rng).value

    assert run(1) == run(1) != run(2)
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002


def measured(**where):
    import functools

    made = functools.partial(WorkClock, MACHINE)
    return anytime.measure(climb, problems(), seconds=0.5, clock=made, **where)


def stored(library, folder):
    library.save(folder)
    return (folder / "climb.profile").read_bytes()


def test_parallel_runs_give_what_serial_runs_give(tmp_path):
    """Parallel runs are not reproducible, though they are seeded.
    ompl#1200, optuna#4412, DEAP#75
    The seed is a hash of what is run; the same bytes come from any number of processes."""
    here = stored(measured(), tmp_path / "here")
    assert stored(measured(executor="processes:2"), tmp_path / "there") == here


def test_resuming_changes_nothing(tmp_path):
    """Resuming changes the results, or repeats what was tried.
    optuna#3255, optuna#3526
    A store holds whole runs by what was run; what it holds is not run again, and the bytes are the
    same."""
    store = tmp_path / "climb.runs"
    whole = stored(measured(store=store), tmp_path / "a")
    store.write_bytes(store.read_bytes()[:-400])
    ran = []
    again = measured(store=store, progress=lambda done, total: ran.append(done))
    assert stored(again, tmp_path / "b") == whole
    assert len(ran) < 6


def test_one_run_that_hangs_does_not_stop_the_night(monkeypatch):
    """One hung task stalls the night; a time-out stops only between trials.
    optuna#1484, optuna#3009, optuna#2478
    A watchdog ends the worker of a run that hangs, which is left out; the others stand."""
    import functools

    monkeypatch.setattr(campaigns, "PATIENCE", 0.5)
    asked = [SimpleNamespace(name=f"p{i}", number=i) for i in range(6)]
    made = functools.partial(WorkClock, Machine("m").with_rate("hangs_on_one", 0.01))
    with pytest.warns(UserWarning, match="p3 is left out"):
        library = anytime.measure(
            hangs_on_one, asked, seconds=0.05, clock=made, executor="processes:2"
        )
    assert len(library["hangs_on_one"].problems) == 5


def test_a_plan_is_changed_only_if_that_gains_enough():
    """Replanning oscillates; when should one replan?
    navigation2#1570, navigation2#2381, navigation2#2804
    Plan and alternative are compared in the newest world, and taken up is only what is better by a
    threshold [PRP16]."""
    from monitor.robots.nao_missions import brief
    from monitor.robots.nao_scenes import read_scene

    scene = read_scene(ROOT / "experiments" / "data" / "scenes" / "fall.toml", seed=2)
    briefing = brief(problems=3)
    report = briefing.live(briefing.robot(scene))
    told = [c for f in report.frames for c in f.story["motion"]["comparisons"]]
    assert told
    assert all(c["taken"] == (c["found"] < c["held"] - c["threshold"]) for c in told)


def test_the_next_plan_is_made_while_the_last_is_executed(office):
    """One cannot plan while executing.
    moveit#3562, moveit#468, move_base_flex#70
    The next frame is computed while the robot drives, so that both together take less than their
    sum."""
    _, report, _ = office
    thought = sum(call.elapsed for frame in report.frames for call in frame.calls)
    assert thought + report.ledger["drive"] + report.ledger["job"] > report.seconds


def test_missed_time_is_explained(office):
    """Warnings of a missed control rate explain nothing, or are wrong.
    navigation2#4759, navigation2#5712, navigation2#1050
    The ledger says where all the time went, and each call what it was given and took."""
    _, report, _ = office
    ledger = report.ledger
    assert ledger["drive"] + ledger["wait"] + ledger["job"] == pytest.approx(report.seconds)
    calls = list(itertools.chain.from_iterable(frame.calls for frame in report.frames))
    assert ledger["overrun"] == pytest.approx(sum(call.overrun for call in calls))


def test_a_run_is_seen_again_without_ros_and_without_a_network(office, tmp_path):
    """One cannot see or replay a run without ROS; logs are printed lines.
    py_trees#415, py_trees#361
    A mission leaves a log of JSON lines, from which one page is made that needs nothing else."""
    from anytime.__main__ import main

    _, _, log = office
    assert all(json.loads(line) for line in log.read_text().splitlines())
    page = tmp_path / "mission.html"
    assert main(["replay", str(log), "-o", str(page)]) == 0
    assert 'src="http' not in page.read_text()


def test_figures_come_from_one_command(tmp_path, capsys):
    """Benchmarking needs a database, R, and scripts.
    moveit_tutorials#478, ompl#325, navigation2#1782
    A command measures, keeps plain text, draws pictures, and prints one JSON object."""
    from anytime.__main__ import main

    library = str(tmp_path / "kept")
    asked = ("profile", f"{__file__}:climb", "--problems", f"{__file__}:few", "--json")
    assert main([*asked, "--library", library, "--seconds", "0.05"]) == 0
    assert json.loads(capsys.readouterr().out)["modules"] == ["climb"]
    assert main(["plot", f"{library}/climb.profile", "-o", str(tmp_path)]) == 0
    assert (tmp_path / "climb.profile.png").exists()


def few(rng):
    """Problems for the command line."""
    return problems(3)


def test_the_same_seed_is_the_same_world(office):
    """How an environment is seeded and reset is confusing.
    Gymnasium#1321, Gymnasium#427, gym#2680
    A mission is a function of its seed: lived again, it is the same decision by decision."""
    live, report, _ = office
    again = live(3)
    assert again.seconds == report.seconds
    assert [f.started for f in again.frames] == [f.started for f in report.frames]
    assert live(4).seconds != report.seconds


def page() -> str:
    """The page that the docstrings of this file make."""
    lines = [
        "# Seventeen complaints",
        "",
        "What users of OMPL, MoveIt, Nav2, Optuna, DEAP, Gymnasium and py_trees complain of, and",
        "what is so here. Each row is a test of `tests/experiments/test_experiments_complaints.py`",
        "and this page is made of their docstrings.",
        "",
        "| | complaint | threads | here | test |",
        "|---|---|---|---|---|",
    ]
    tree = ast.parse(Path(__file__).read_text(encoding="utf-8"))
    tests = [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name.startswith("test_")]
    told = [(test.name, (ast.get_docstring(test) or "").split("\n", 2)) for test in tests]
    rows = [(name, parts) for name, parts in told if len(parts) == 3]
    for number, (name, (complaint, threads, here)) in enumerate(rows, 1):
        lines.append(
            f"| {number} | {complaint} | {threads} | {' '.join(here.split())} | `{name}` |"
        )
    return "\n".join(lines) + "\n"


def test_the_page_is_what_these_tests_say():
    assert page().count("| `test_") == 17
    assert PAGE.read_text(encoding="utf-8") == page()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
