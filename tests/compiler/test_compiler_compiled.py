"""Compiled programs: promised, divided, run, explained, saved and read again."""

from __future__ import annotations

import copy
import json
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import anytime
import compiler
from anytime import AnytimeError, Deadline, Machine, Status, WorkClock
from anytime.files import checksum

MACHINE = Machine("m")
for _name in ("see", "find", "quick", "walk"):
    MACHINE = MACHINE.with_rate(_name, 0.001)
ALL = {"image": 1.0, "goal": 1.0}


@dataclass
class Problem:
    image: float
    goal: float = 1.0


def problems(count=8):
    return [Problem(float(image)) for image in np.linspace(0.6, 1.0, count)]


def clock() -> WorkClock:
    return WorkClock(MACHINE)


@anytime.module(quality=lambda value: value, problems=lambda rng: problems())
def see(image):
    for step in range(1, 5):
        anytime.charge(10 * step)
        yield image * step / 4


@anytime.module(quality=lambda value: value, estimate=lambda value: value)
def find(boxes, goal):
    for step in range(1, 9):
        anytime.charge(10)
        yield boxes * goal * step / 8


@anytime.module(quality=lambda value: value)
def walk(path):
    for step in (1, 2):
        anytime.charge(5)
        anytime.register(path * step / 2)


@compiler.program
def navigate(image, goal):
    return find(see(image), goal)


@compiler.program
def tour(image, goal):
    return walk(find(see(image), goal))


@pytest.fixture(scope="module")
def library():
    return anytime.measure(tour, problems(), seconds=1.0, clock=clock)


@pytest.fixture(scope="module")
def schedule(library):
    return compiler.compile(navigate, library)


@pytest.fixture(scope="module")
def long_schedule(library):
    return compiler.compile(tour, library)


def run(schedule, seconds, **inputs):
    return schedule.run(seconds, clock=clock(), **(inputs or ALL))


# Promises


def test_it_promises_more_with_more_time_and_says_how_sure_it_is(schedule):
    budgets = np.linspace(0, 0.3, 100)
    promised = [schedule.promise(t) for t in budgets]
    assert promised == sorted(promised)
    for seconds, promise in zip(budgets, promised, strict=True):
        low, high = schedule.interval(seconds)
        assert 0 <= low <= promise <= high <= 1


def test_an_allocation_is_the_whole_budget(schedule):
    for seconds in np.linspace(schedule.least, 0.4, 20):
        allocation = schedule.allocate(seconds)
        assert list(allocation.shares) == ["see", "find"]
        assert sum(allocation.shares.values()) == pytest.approx(seconds)
        assert min(allocation.shares.values()) >= 0
        assert allocation.promised == schedule.promise(seconds)


def test_below_the_least_budget_there_is_no_allocation(schedule):
    for seconds in (0.0, -1.0, schedule.least * 0.99):
        assert schedule.promise(seconds) == 0
        with pytest.raises(AnytimeError, match="below the least budget of 'navigate', "):
            schedule.allocate(seconds)


@pytest.mark.parametrize("seconds", [np.nan, np.inf, -np.inf, "1", None, True])
def test_a_budget_is_a_finite_number_of_seconds(schedule, seconds):
    asks = schedule.promise, schedule.ceiling, schedule.allocate, schedule.explain, schedule.advise
    for ask in asks:
        with pytest.raises(AnytimeError, match="finite number"):
            ask(seconds)
    if seconds is not None:
        with pytest.raises(AnytimeError, match=r"finite number|the time that may be spent"):
            run(schedule, seconds)


@pytest.mark.parametrize(
    ("profiles", "more", "says"),
    [
        ("folder", {}, "library is 'folder'; give profiles by module name"),
        ({}, {"machine": "fast"}, "machine is 'fast'; give a Machine"),
        ({}, {"objective": "mean"}, "objective is 'mean'; give compiler.expected"),
    ],
)
def test_what_it_is_compiled_from_is_named_where_it_does_not_fit(schedule, profiles, more, says):
    with pytest.raises(AnytimeError, match=says):
        compiler.compile(schedule.program, profiles, **more)


def test_its_profile_says_what_it_promises(schedule):
    assert len(schedule.profile.recordings) == 20
    for seconds in np.linspace(schedule.least, 0.3, 10):
        assert schedule.profile.mean(seconds)[0] == pytest.approx(
            schedule.promise(seconds), abs=0.05
        )


def test_compiling_twice_gives_the_same_file(library, tmp_path):
    for name in ("a", "b"):
        compiler.compile(tour, library).save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_faster_machine_promises_no_less(library):
    fast = Machine("fast", dict(MACHINE.rates))
    for name in ("see", "find", "walk"):
        fast = fast.with_rate(name, 0.0005)
    slow, quick = (
        compiler.compile(navigate, library),
        compiler.compile(navigate, library, machine=fast),
    )
    assert quick.machine == "fast"
    assert quick.least == pytest.approx(slow.least / 2)
    for seconds in np.linspace(0.02, 0.3, 20):
        assert quick.promise(seconds) >= slow.promise(seconds) - 1e-9


def test_a_missing_profile_is_named_with_those_there_are(library):
    only = {"see": library["see"]}
    with pytest.raises(AnytimeError, match="no profile for module 'find'; measured: see"):
        compiler.compile(navigate, only)


def test_a_profile_of_the_module_alone_does_not_do_where_another_feeds_it(library):
    @dataclass
    class Alone:
        boxes: float
        goal: float = 1.0

    alone = anytime.measure(find, [Alone(0.5), Alone(1.0)], seconds=1.0, clock=clock)
    with pytest.raises(AnytimeError, match="'find' is not conditioned on boxes"):
        compiler.compile(navigate, {"see": library["see"], "find": alone["find"]})


def test_a_program_that_never_has_a_result_cannot_be_compiled():
    @anytime.module(quality=lambda value: value, name="see")
    def blind(image):
        anytime.charge(image)
        yield

    library = anytime.measure(blind, problems(), seconds=1.0, clock=clock)
    with pytest.raises(AnytimeError, match="never has a result"):
        compiler.compile(blind, library)


def test_a_result_that_takes_no_time_is_compiled_too():
    @anytime.module(quality=lambda value: value, name="see")
    def instant(image):
        anytime.charge(0)
        yield image / 2
        anytime.charge(10)
        yield image

    compiled = compiler.compile(
        instant, anytime.measure(instant, problems(), seconds=1, clock=clock)
    )
    assert compiled.least == 1e-9  # a call without time is not run
    assert compiled.promise(0) == 0
    assert compiled.promise(1e-9) == pytest.approx(0.4)
    assert max(map(len, repr(compiled).splitlines())) <= 100
    assert "<svg" in compiled._repr_html_()


@pytest.mark.parametrize("free_one", ["see", "find"])
def test_a_module_that_costs_nothing_gets_as_much_time_as_it_takes_to_be_run(free_one):
    machine = anytime.Machine("m")
    for name in ("see", "find"):
        machine = machine.with_rate(name, 0.0 if name == free_one else 0.001)
    free_clock = lambda: anytime.WorkClock(machine)  # noqa: E731
    library = anytime.measure(navigate, problems(), seconds=1, clock=free_clock)
    schedule = compiler.compile(navigate, library)
    for seconds in schedule.frontier.budgets[1:]:
        assert schedule.run(float(seconds), clock=free_clock(), **ALL).value is not None


def test_an_adaptive_program_gives_a_module_that_costs_nothing_its_turn():
    machine = MACHINE.with_rate("last", 0.0)
    free_clock = lambda: anytime.WorkClock(machine)  # noqa: E731

    @anytime.module(quality=lambda value: value, estimate=lambda value: value)
    def last(path):
        yield path

    @anytime.module(quality=lambda value: value, estimate=lambda value: value, name="see")
    def look(image):
        for step in range(1, 5):
            anytime.charge(10 * step)
            yield image * step / 4

    @compiler.program
    def shown(image, goal):
        return last(find(look(image), goal))

    library = anytime.measure(shown, problems(), seconds=1, clock=free_clock)
    adaptive = compiler.compile(shown, library, adaptive=True)
    for seconds in np.linspace(0.06, 0.3, 25):
        result = adaptive.run(float(seconds), clock=free_clock(), **ALL)
        assert (result.value is None) == (adaptive.promise(float(seconds)) == 0.0)


# Running


def test_unspent_time_flows_on(schedule):
    result = run(schedule, 0.3)
    assert result.parts["see"].elapsed < schedule.allocate(0.3).shares["see"] + 1e-9
    assert result.parts["find"].elapsed == pytest.approx(0.08)
    assert result.value == 1.0
    assert result.overrun == 0


def test_a_module_that_ends_early_leaves_its_time_to_the_next(library):
    @anytime.module(quality=lambda value: value, name="see")
    def swift(image):
        anytime.charge(1)
        yield image

    schedule = compiler.compile(navigate, library)
    budget = 0.099
    shares = schedule.allocate(budget).shares
    bound = compiler.compile(
        compiler.program(lambda image, goal: find(swift(image), goal)), library
    )
    result = run(bound, budget)
    assert result.parts["find"].elapsed > shares["find"] + 0.01
    assert len(result.parts["find"].history) == 8


def test_it_achieves_what_it_promises(schedule):
    for seconds in np.linspace(schedule.least, 0.3, 12):
        achieved = [
            run(schedule, seconds, image=problem.image, goal=1.0).value for problem in problems()
        ]
        assert np.mean(achieved) >= schedule.promise(seconds) - 0.02


@pytest.mark.parametrize("seconds", [0.0, -2.0, 0.001])
def test_below_the_least_budget_nothing_is_run_and_the_result_says_why(schedule, seconds):
    result = run(schedule, seconds)
    assert (result.status, result.value, dict(result.parts)) == (Status.NO_RESULT, None, {})
    assert "below the least budget" in result.why
    assert not result


def test_at_the_least_budget_there_is_a_result(schedule):
    result = run(schedule, schedule.least)
    assert result
    assert len(result.history) == 1


def test_shares_are_soft_and_a_first_result_is_never_refused(schedule):
    """On a machine half as fast no step fits its share; there is a result all the same."""
    slow = MACHINE.with_rate("see", 0.002).with_rate("find", 0.002)
    result = schedule.run(0.055, clock=WorkClock(slow), **ALL)
    assert len(result.parts["see"].history) >= 1
    assert result.parts["see"].elapsed > 0
    assert result


def test_a_contract_module_in_the_middle_is_told_its_share(library):
    told: list[float] = []

    @anytime.module(quality=lambda value: value, name="find")
    def contract(boxes, goal, *, seconds):
        told.append(seconds)
        anytime.charge(1000 * seconds)
        yield boxes * goal * min(1.0, 10 * seconds)

    @compiler.program
    def told_tour(image, goal):
        return walk(contract(see(image), goal))

    measured = anytime.measure(told_tour, problems(), seconds=0.4, clock=clock)
    compiled = compiler.compile(told_tour, measured)
    assert compiled.promise(0.3) > compiled.promise(0.08) > 0
    for seconds in (0.08, 0.15, 0.2):
        told.clear()
        result = run(compiled, seconds)
        unspent = compiled.allocate(seconds).shares["see"] - result.parts["see"].elapsed
        assert told == [pytest.approx(compiled.allocate(seconds).shares["find"] + unspent)]
        assert result.value >= compiled.promise(seconds) - 0.1


def test_a_plain_function_in_the_middle_has_time_for_a_first_result(library):
    @anytime.module(quality=lambda value: value, name="find")
    def plain(boxes, goal):
        for step in range(1, 9):
            anytime.charge(10)
            anytime.register(boxes * goal * step / 8)

    program = compiler.program(lambda image, goal: walk(plain(see(image), goal)))
    compiled = compiler.compile(program, library)
    slow = MACHINE.with_rate("see", 0.004)
    for seconds in np.linspace(0.08, 0.3, 12):
        result = compiled.run(seconds, clock=WorkClock(slow), **ALL)
        assert result.parts["find"].history, f"nothing found in {seconds} s"


def test_every_result_is_told_as_it_comes(schedule):
    told = []
    result = schedule.run(
        0.2,
        clock=clock(),
        on_result=lambda label, value, change: told.append((label, value, change.seconds)),
        **ALL,
    )
    assert [label for label, *_ in told].count("find") == len(result.history)
    assert told[-1][1] == result.value
    assert {label for label, *_ in told} == {"see", "find"}


def test_a_run_on_a_work_clock_repeats_bit_for_bit(long_schedule):
    one, other = (repr(run(long_schedule, 0.17)) for _ in range(2))
    assert one == other


def test_inputs_are_bound_by_name(schedule):
    with pytest.raises(AnytimeError, match="navigate misses 'goal'; its inputs are image, goal"):
        run(schedule, 0.1, image=1.0)
    with pytest.raises(AnytimeError, match="navigate does not take 'colour'"):
        run(schedule, 0.1, colour=3, **ALL)
    with pytest.raises(AnytimeError, match="one of them"):
        schedule.run(**ALL)
    with pytest.raises(AnytimeError, match="one of them"):
        schedule.run(0.1, deadline=Deadline.after(1, clock()), **ALL)


def test_a_fault_of_a_part_is_a_fault_of_the_whole(library):
    @anytime.module(quality=lambda value: value, name="see")
    def faulty(image):
        anytime.charge(10)
        yield image / 4
        raise OSError("lens cap")

    compiled = compiler.compile(
        compiler.program(lambda image, goal: find(faulty(image), goal)), library
    )
    result = run(compiled, 0.2)
    assert result.value == 0.25
    assert "lens cap" in str(result.fault)
    assert result.status is Status.INTERRUPTED


def test_a_part_without_a_result_ends_the_program_and_is_named(library):
    @anytime.module(quality=lambda value: value, name="see")
    def blind(image):
        anytime.charge(10)
        yield

    compiled = compiler.compile(
        compiler.program(lambda image, goal: find(blind(image), goal)), library
    )
    result = run(compiled, 0.2)
    assert result.status is Status.NO_RESULT
    assert "see had no result" in result.why
    assert list(result.parts) == ["see"]


def test_the_deadline_can_be_absolute(schedule):
    time = clock()
    time.advance(5)
    result = schedule.run(deadline=Deadline.after(0.1, time), **ALL)
    assert result
    assert time.now() <= 5.1 + 1e-9


def test_inside_a_run_it_ends_at_the_earlier_deadline(schedule):
    inner: list[anytime.Result] = []

    @anytime.module(name="quick")
    def outer():
        anytime.charge(0)
        inner.append(schedule.run(50.0, **ALL))
        return inner[0].value

    result = anytime.run(outer, deadline=Deadline.after(0.06, clock()))
    assert result.elapsed <= 0.06 + 1e-9
    assert inner[0].elapsed <= 0.06 + 1e-9


# A compiled program is a module again


def test_a_compiled_program_is_a_contract_module(schedule):
    assert schedule.module.contract
    assert schedule.module.parameters == ("image", "goal")
    result = anytime.run(schedule.module, 1.0, 1.0, deadline=Deadline.after(0.1, clock()))
    assert result.fault is None
    assert result.value == run(schedule, 0.1).value


def test_a_compiled_program_is_called_in_another(library, schedule):
    @anytime.module(quality=lambda value: value)
    def quick(path):
        anytime.charge(5)
        yield path

    @compiler.program
    def journey(image, goal):
        return quick(schedule(image, goal))

    @dataclass
    class Alone:
        path: float

    assert [call.label for call in journey.calls] == ["navigate", "quick"]
    profile = anytime.measure(journey, problems(), seconds=0.3, clock=clock)["quick"]
    composed = compiler.compile(journey, {"navigate": schedule.profile, "quick": profile})
    result = run(composed, 0.2)
    assert result.fault is None
    assert result.parts["navigate"].value is not None
    assert result.value == result.parts["navigate"].value
    assert result.elapsed <= 0.2 + 1e-9


# Explaining


def test_texts_keep_to_a_hundred_columns(schedule, long_schedule):
    for each in (schedule, long_schedule):
        for told in (each, each.explain(0.1), each.advise(0.1), each.allocate(0.1), run(each, 0.1)):
            assert max(map(len, repr(told).splitlines())) <= 100


def test_the_table_begins_at_the_least_budget_and_gives_intervals(schedule):
    lines = repr(schedule).splitlines()
    assert lines[1].split() == ["budget", "see", "find", "promised", "95", "%"]
    assert len(lines) == 9
    assert all("[" in line for line in lines[2:8])
    assert "division" in lines[8]


def test_an_explanation_divides_the_budget_and_prices_it(schedule):
    told = schedule.explain(0.1)
    assert [price.label for price in told.prices] == ["see", "find"]
    assert sum(price.share for price in told.prices) == pytest.approx(0.1)
    assert told.less <= told.promised <= told.more
    with pytest.raises(AnytimeError, match="below the least"):
        schedule.explain(0.001)


def test_advice_ranks_what_a_faster_module_would_bring(schedule):
    told = schedule.advise(0.05)
    assert {change.label for change in told.changes} == {"see", "find"}
    assert told.changes[0].gain >= told.changes[1].gain >= 0
    assert told.changes[0].gain > 0


def test_a_notebook_shows_it_above_min_and_max(schedule):
    html = schedule._repr_html_()
    assert html.count("<svg") == 2
    assert ">MIN<" in html
    assert ">MAX<" in html


# Files


@pytest.fixture
def saved(long_schedule, tmp_path):
    long_schedule.save(tmp_path / "tour.schedule")
    return tmp_path / "tour.schedule"


def test_what_is_loaded_does_the_same(long_schedule, saved, tmp_path):
    loaded = compiler.load(saved, modules=[see, find, walk])
    assert repr(loaded) == repr(long_schedule)
    assert repr(run(loaded, 0.15)) == repr(run(long_schedule, 0.15))
    assert repr(loaded.explain(0.15)) == repr(long_schedule.explain(0.15))
    loaded.save(tmp_path / "again.schedule")
    assert (tmp_path / "again.schedule").read_bytes() == saved.read_bytes()


def test_what_is_only_looked_at_cannot_run(saved):
    from compiler.loading import inspect

    looked = inspect(saved)
    assert "tour" in repr(looked)
    result = run(looked, 0.2)
    assert "compiler.load" in str(result.fault)


def test_missing_and_other_modules_are_named(saved):
    with pytest.raises(AnytimeError, match=r"module 'walk', which is not among modules=\[…\] \("):
        compiler.load(saved, modules=[see, find])

    @anytime.module(name="walk")
    def other(road):
        yield road

    with pytest.raises(AnytimeError, match=r"compiled for walk\(path\); .* \(road\)"):
        compiler.load(saved, modules=[see, find, other])


def test_a_constant_that_no_file_holds_is_refused(library, tmp_path):
    compiled = compiler.compile(
        compiler.program(lambda image: find(see(image), np.ones(2))), library
    )
    with pytest.raises(AnytimeError, match="make it an input"):
        compiled.save(tmp_path / "x.schedule")
    assert not list(tmp_path.iterdir())


def test_a_constant_is_kept(library, tmp_path):
    compiled = compiler.compile(compiler.program(lambda image: find(see(image), 0.5)), library)
    compiled.save(tmp_path / "x.schedule")
    loaded = compiler.load(tmp_path / "x.schedule", modules=[see, find])
    assert run(loaded, 0.3, image=1.0).value == 0.5


def test_every_cut_and_flipped_file_is_refused_or_the_same(saved, tmp_path):
    content = saved.read_bytes()
    whole = repr(compiler.load(saved, modules=[see, find, walk]))
    rng, path = np.random.default_rng(0), tmp_path / "broken.schedule"
    damaged = [content[: int(n)] for n in rng.integers(len(content) - 1, size=60)]
    for _ in range(100):
        flipped = bytearray(content)
        flipped[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        damaged.append(bytes(flipped))
    for each in damaged:
        path.write_bytes(each)
        loaded = loaded_or_refused(path)
        assert loaded is None or repr(loaded) == whole


def loaded_or_refused(path):
    try:
        return compiler.load(path, modules=[see, find, walk])
    except AnytimeError as error:
        if "\n" in str(error):
            raise AssertionError(f"more than one line: {error}") from error
        return None


def rewritten(path, content):
    content = {key: value for key, value in content.items() if key != "checksum"}
    content["checksum"] = checksum(content)
    path.write_text(json.dumps(content))
    return path


def forged(content, *place, value):
    content = copy.deepcopy(content)
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return content


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("nodes",), []),
        (("tables",), []),
        (("budgets",), []),
        (("promised",), []),
        (("calibration",), []),
        (("calibration", 1), [0.1, 0.1, 0.9, 0.1]),
        (("calibration", 0), [2.0, 0.0, 0.0, 0.0]),
        (("regret",), -0.1),
        (("promised", 0), -0.5),
        (("promised", -1), 1.5),
        (("promised", 1), 0.0),
        (("budgets", 1), 0.0),
        (("budgets", 0), -1.0),
        (("shares", 0), [0.1]),
        (("shares", 0), [9.0, 9.0, 9.0]),
        (("shares", 0), [-0.1, 0.1, 0.1]),
        (("steps", "see", "median"), []),
        (("steps", "see", "p95", 0), -0.1),
        (("steps", "see", "spread"), -1.0),
        (("tables", 0, "times"), []),
        (("tables", 0, "times", 0), 0.5),
        (("tables", 0, "levels", 0), 0.5),
        (("tables", 0, "levels", 1), 1.5),
        (("tables", 0, "shape"), [-1, -1]),
        (("tables", 0, "shape"), []),
        (("tables", 0, "chances", 0), 7.0),
        (("tables", 0, "first"), -1.0),
        (("tables", 0, "label"), "other"),
        (("tables", 0, "module"), "other"),
        (("tables", 1, "feeds"), []),
        (("tables", 1, "feeds"), ["find"]),
        (("nodes", 1, "label"), "see"),
        (("nodes", 1, "arguments"), []),
        (("nodes", 0, "arguments", 0), {"input": None, "node": "walk", "constant": None}),
        (("nodes", 0, "arguments", 0), {"input": "nothing", "node": None, "constant": None}),
        (("schema",), "anytime.schedule/0"),
        (("extra",), 1),
    ],
)
def test_a_forged_file_is_refused(saved, tmp_path, place, value):
    content = forged(json.loads(saved.read_text()), *place, value=value)
    assert loaded_or_refused(rewritten(tmp_path / "forged.schedule", content)) is None


numbers = st.one_of(
    st.floats(-2, 2), st.integers(-3, 3), st.none(), st.text(max_size=3), st.lists(st.floats(0, 1))
)


@settings(max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_content_with_a_fitting_checksum_is_valid_or_refused(saved, tmp_path, data):
    content = json.loads(saved.read_text())
    place: list = []
    inner = content
    while isinstance(inner, dict | list) and inner and (not place or data.draw(st.integers(0, 4))):
        keys = sorted(inner) if isinstance(inner, dict) else list(range(len(inner)))
        place.append(data.draw(st.sampled_from(keys)))
        inner = inner[place[-1]]
    content = forged(content, *place, value=data.draw(numbers))
    loaded = loaded_or_refused(rewritten(tmp_path / "forged.schedule", content))
    if loaded is not None:
        assert max(map(len, repr(loaded).splitlines())) <= 100
        assert 0 <= loaded.promise(0.2) <= 1
        repr(run(loaded, 0.2))


def test_what_modules_keep_is_kept_in_what_was_given_for_it():
    @anytime.module(quality=lambda value, problem: value, name="keeping")
    def keeping(x, *, memory):
        memory["runs"] = memory.get("runs", 0) + 1
        anytime.charge(1)
        yield x * memory["runs"] / 10

    machine = Machine("m").with_rate("keeping", 0.01)
    library = anytime.measure(
        keeping,
        [SimpleNamespace(x=1.0), SimpleNamespace(x=0.5)],
        seconds=1.0,
        clock=lambda: WorkClock(machine),
    )
    compiled, kept = compiler.compile(keeping, library), {}
    values = [
        compiled.run(0.1, clock=WorkClock(machine), memory=kept, x=1.0).value for _ in range(3)
    ]
    assert values == [0.1, 0.2, 0.3]
    assert kept == {"keeping": {"runs": 3}}
