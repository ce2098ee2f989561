"""Measuring: which runs are made, on what, and how they are scored."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import anytime
import compiler
from anytime import AnytimeError, Machine, ProfileLibrary, WorkClock
from anytime.measuring import problem_keys
from anytime.sampling import CHANGES, COMBINATIONS, STRATA, _design

MACHINE = Machine("m")
for _name in ("see", "find", "merge", "walk"):
    MACHINE = MACHINE.with_rate(_name, 0.01)


@dataclass
class Problem:
    image: float
    goal: float = 1.0
    truth: float = 1.0
    left: float = 0.5
    right: float = 0.25
    extra: dict[str, Any] = field(default_factory=dict)


def ladder(image):
    """Eight results, each a little nearer to the image."""
    for step in range(1, 9):
        anytime.charge(10)
        yield image * step / 8


see = anytime.module(quality=lambda value, problem: value / 2, name="see")(ladder)


@anytime.module(cost=lambda value, problem: 1 + abs(problem.goal - value))
def find(boxes, goal, *, rng):
    for step in range(1, 4):
        anytime.charge(20)
        yield boxes * step / 3 + 0.01 * rng.random()


@anytime.module(quality=lambda value: value / 4)
def merge(one, other):
    anytime.charge(5)
    yield one + other


@compiler.program
def navigate(image, goal):
    return find(see(image), goal)


@compiler.program
def stereo(left, right):
    return merge(see(left), see(right))


def measured(what, problems, seconds=10.0, **options) -> ProfileLibrary:
    return anytime.measure(
        what, problems, seconds=seconds, clock=lambda: WorkClock(MACHINE), **options
    )


def problems(count=6, seed=0):
    rng = np.random.default_rng(seed)
    return [Problem(float(rng.random())) for _ in range(count)]


def saved(library, folder) -> dict[str, bytes]:
    library.save(folder)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_each_module_is_run_on_what_the_one_before_really_delivers():
    library = measured(navigate, problems())
    assert list(library) == ["find", "see"]
    assert library["find"].inputs == ("boxes",)
    assert library["see"].inputs == ()
    delivered = {float(q) for values in library["see"].qualities for q in values}
    for run in library["find"].recordings:
        assert run.inputs["boxes"] in delivered


def test_a_module_runs_at_most_four_times_on_a_problem_and_on_the_last_result():
    library = measured(navigate, problems())
    for problem in library["find"].problems:
        runs = [run for run in library["find"].recordings if run.problem == problem]
        assert 1 < len(runs) <= STRATA
        levels = sorted(run.inputs["boxes"] for run in runs)
        last = next(run.raw[-1] for run in library["see"].recordings if run.problem == problem)
        assert levels[-1] == last
        assert np.diff(levels).min() > 0.5 * (levels[-1] - levels[0]) / len(levels)


def test_several_inputs_are_as_good_as_each_other_in_half_of_the_runs():
    library = measured(stereo, problems())
    for problem in library["merge"].problems:
        pairs = [
            (run.inputs["one"], run.inputs["other"])
            for run in library["merge"].recordings
            if run.problem == problem
        ]
        assert 2 < len(pairs) <= COMBINATIONS
        ones, others = (sorted(set(column)) for column in zip(*pairs, strict=True))
        assert {(ones[0], others[0]), (ones[-1], others[-1])} <= set(pairs)


@given(st.lists(st.integers(1, 4), min_size=2, max_size=4), st.integers(0, 99))
def test_the_design_of_several_inputs_is_small_and_holds_all_of_a_few(sizes, seed):
    rows = _design(sizes, seed)
    assert len(set(rows)) == len(rows) <= COMBINATIONS
    assert {tuple(0 for _ in sizes), tuple(size - 1 for size in sizes)} <= set(rows)
    for place, size in enumerate(sizes):
        assert {row[place] for row in rows} == set(range(size))
    if np.prod(sizes) <= COMBINATIONS:
        assert len(rows) == np.prod(sizes)


def test_a_module_that_is_called_twice_has_one_profile_with_the_call_in_its_runs():
    library = measured(stereo, problems(3))
    assert {run.call for run in library["see"].recordings} == {"see", "see_2"}
    assert len(library["see"].recordings) == 6
    assert set(library.machine.rates) >= {"see", "merge"}


def test_measured_rates_are_those_of_all_calls_of_a_module():
    @anytime.module(quality=lambda value: 0.5, name="walk")
    def walk(steps):
        for _ in range(int(steps)):
            yield 1

    @anytime.module(quality=lambda value: 0.5)
    def both(one, other):
        yield one + other

    @compiler.program
    def twice(image, goal):
        return both(walk(image), walk(goal))

    library = anytime.measure(twice, [Problem(image=3, goal=1)], seconds=50)
    assert library.machine.rates["walk"].steps == 3 + 1


def test_a_module_called_in_two_ways_is_refused():
    @compiler.program
    def mixed(image, goal):
        return find(find(see(image), goal), see(goal))

    with pytest.raises(AnytimeError, match="calls find in two ways"):
        measured(mixed, problems(2))


def test_the_truth_is_never_on_the_clock():
    """A quality that takes long changes nothing: the profile is the same to the last bit."""

    def slow(clock):
        def quality(value, problem):
            clock[-1].advance(1000.0)
            return value / 2

        return quality

    clocks: list[WorkClock] = []

    def clock():
        clocks.append(WorkClock(MACHINE))
        return clocks[-1]

    patient = anytime.module(quality=slow(clocks), name="see")(ladder)
    one = anytime.measure(patient, problems(), seconds=10, clock=clock)
    other = measured(see, problems())
    assert repr(one["see"].recordings) == repr(other["see"].recordings)


def test_the_estimate_is_recorded_and_the_truth_is_not_asked_during_the_run():
    inside: list[bool] = []

    def quality(value):
        try:
            anytime.here()
        except anytime.OutsideRunError:
            inside.append(False)
        else:
            inside.append(True)
        return value / 2

    module = anytime.module(quality=quality, estimate=lambda v: v / 4, name="see")(ladder)
    library = measured(module, problems(2))
    assert not any(inside)
    assert library["see"].recordings[0].estimates.max() <= 0.25


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    first, again = (
        saved(measured(navigate, problems(), seed=3), tmp_path / name) for name in ("a", "b")
    )
    assert first == again
    other = saved(measured(navigate, problems(), seed=4), tmp_path / "c")
    assert other["find.profile"] != first["find.profile"]


def test_the_order_of_problems_does_not_matter(tmp_path):
    forward = saved(measured(navigate, problems()), tmp_path / "a")
    backward = saved(measured(navigate, problems()[::-1]), tmp_path / "b")
    assert forward == backward


def test_problems_have_their_names_or_a_digest_of_their_inputs():
    @dataclass
    class Named:
        image: float
        name: str

    listed = [Named(0.1, "a"), Named(0.2, "a#2"), Named(0.3, "a"), Named(0.4, "a")]
    library = measured(see, listed)
    assert len(library["see"].problems) == 4
    unnamed = measured(see, [Problem(0.5), Problem(0.5), Problem(0.25)])
    assert len(unnamed["see"].problems) == 3


def test_a_cost_is_normalised_by_the_cheapest_known_of_all_runs_of_its_problem():
    library = measured(navigate, problems())
    profile = library["find"]
    for problem in profile.problems:
        costs = [c for r in profile.recordings if r.problem == problem for c in r.raw]
        assert profile.references[problem] == min(costs)
        best = max(
            float(values.max())
            for run, values in zip(profile.recordings, profile.qualities, strict=True)
            if run.problem == problem
        )
        assert best == 1.0


def test_the_cost_of_a_module_in_the_middle_labels_the_inputs_of_the_next():
    @anytime.module(quality=lambda value: 0.5, name="walk")
    def walk(path):
        anytime.charge(1)
        yield path

    @compiler.program
    def tour(image, goal):
        return walk(find(see(image), goal))

    library = measured(tour, problems())
    delivered = {float(q) for values in library["find"].qualities for q in values}
    assert {run.inputs["path"] for run in library["walk"].recordings} <= delivered


def test_costs_of_zero_and_problems_without_any_result_have_qualities_too(tmp_path):
    @anytime.module(cost=lambda value: value, name="see")
    def free(image):
        anytime.charge(1)
        if image:
            yield image - 1

    library = measured(free, [Problem(0), Problem(1), Problem(3)])
    profile = library["see"]
    assert sorted(q.tolist() for q in profile.qualities) == [[], [1.0], [1.0]]
    library.save(tmp_path)
    assert repr(ProfileLibrary(tmp_path)["see"]) == repr(profile)


def test_where_nothing_arrives_nothing_is_run():
    @anytime.module(quality=lambda value: 1.0, name="see")
    def blind(image):
        anytime.charge(1)
        if image > 0.5:
            yield image

    @compiler.program
    def follow(image, goal):
        return find(blind(image), goal)

    library = measured(follow, [Problem(0.2), Problem(0.9)])
    assert len(library["see"].problems) == 2
    assert len(library["find"].problems) == 1


def test_a_long_run_keeps_its_first_and_last_results():
    @anytime.module(quality=lambda value: value / 10000, name="see")
    def many():
        for value in range(5000):
            anytime.charge(0.01)
            yield value

    run = measured(many, [Problem(1)])["see"].recordings[0]
    assert len(run.raw) <= CHANGES
    assert (run.raw[0], run.raw[-1]) == (0, 4999 / 10000)
    assert run.results == run.steps == 5000
    assert run.complete


def test_a_recording_says_how_often_a_run_could_be_ended():
    @anytime.module(quality=lambda value: value, name="see")
    def searching():
        for value in (0.2, 0.4):
            for _ in range(5):
                anytime.charge(1)
                if anytime.expired():
                    return
            yield value

    run = measured(searching, [Problem(1)])["see"].recordings[0]
    assert run.results == 2
    assert run.steps == 12


def test_a_run_is_cut_at_its_time():
    run = measured(see, [Problem(1.0)], seconds=0.35)["see"].recordings[0]
    assert run.seconds.tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert not run.complete


def test_a_contract_module_is_measured_for_shorter_times_too():
    @anytime.module(quality=lambda value: value, name="see")
    def contract(image, *, seconds):
        anytime.charge(100 * seconds * 0.4)
        yield image * seconds
        anytime.charge(100 * seconds * 0.4)
        yield image * seconds

    run = measured(contract, [Problem(1.0)], seconds=1.0)["see"].recordings[0]
    budgets = 0.5 ** np.arange(7, -1, -1)
    assert run.raw == pytest.approx(budgets)
    assert run.seconds == pytest.approx(0.8 * budgets)
    assert (np.diff(run.work) > 0).all()


def test_features_are_those_of_the_inputs():
    module = anytime.module(
        quality=lambda v: v / 2, features=lambda image: {"light": image}, name="see"
    )(ladder)
    assert measured(module, [Problem(0.5)])["see"].recordings[0].features == {"light": 0.5}


def test_progress_is_told():
    told: list[tuple[int, int]] = []
    measured(see, problems(3), progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 3), (2, 3), (3, 3)]


# Refusals


def test_a_problem_without_an_input_is_named_with_all_inputs():
    with pytest.raises(AnytimeError, match=r"problems\[1\] has no \.goal; .*navigate are image, g"):
        measured(navigate, [Problem(1.0), type("Bare", (), {"image": 1.0})()])


def test_no_problems_and_no_time_are_refused():
    with pytest.raises(AnytimeError, match="at least one"):
        measured(see, [])
    for seconds in (0.0, -1.0, float("nan")):
        with pytest.raises(AnytimeError, match="> 0"):
            measured(see, problems(1), seconds=seconds)


def test_work_charged_after_an_uncharged_check_is_refused():
    @anytime.module(quality=lambda value: 1.0, name="see")
    def mixed():
        yield 1
        anytime.charge(3)
        yield 2

    with pytest.raises(AnytimeError, match="charge before the first yield"):
        measured(mixed, [Problem(1)])


def test_a_module_that_cannot_be_scored_says_what_to_give():
    @anytime.module(name="see")
    def unscored():
        yield 1

    with pytest.raises(AnytimeError, match=r"cannot be scored; give .*quality=….* or .*cost=…"):
        measured(unscored, [Problem(1)])


@pytest.mark.parametrize("score", [-0.5, 1.5, float("nan"), float("inf")])
def test_a_quality_outside_the_unit_interval_names_module_and_problem(score):
    module = anytime.module(quality=lambda value: score, name="see")(ladder)
    with pytest.raises(AnytimeError, match=r"quality of 'see' is .* on problem .*\[0, 1\]"):
        measured(module, problems(1))


@pytest.mark.parametrize("score", [-0.5, float("nan"), float("inf")])
def test_a_cost_is_finite_and_not_negative(score):
    module = anytime.module(cost=lambda value: score, name="see")(ladder)
    with pytest.raises(AnytimeError, match="finite and >= 0"):
        measured(module, problems(1))


def test_a_module_that_fails_before_its_first_result_is_reported():
    @anytime.module(quality=lambda value: 1.0, name="see")
    def broken():
        raise OSError("no camera")
        yield

    with pytest.raises(AnytimeError, match=r"failed on problem .* before .* result: .*no camera"):
        measured(broken, [Problem(1)])


def test_a_score_may_take_the_result_alone():
    one = measured(anytime.module(quality=lambda v: v / 2, name="see")(ladder), problems(2))
    two = measured(see, problems(2))
    assert repr(one["see"].recordings) == repr(two["see"].recordings)


def test_of_many_results_those_at_equal_distances_are_kept_and_the_last():
    @anytime.module(quality=lambda value: value)
    def long(start):
        for step in range(1500):
            anytime.charge(1)
            yield start + step / 1500

    machine = Machine("m").with_rate("long", 0.001)
    problems = [SimpleNamespace(start=0.0)]
    library = anytime.measure(long, problems, seconds=2.0, clock=lambda: WorkClock(machine))
    (run,) = library["long"].recordings
    apart = np.diff(run.work)
    assert len(run.work) == CHANGES
    assert apart.max() <= 3 * apart.min()
    assert run.work[[0, -1]].tolist() == [1.0, 1500.0]


class Scene:
    """What an input may be: an object of the user's."""

    def __init__(self, quality):
        self.quality = quality


@anytime.module(quality=lambda value, problem: value)
def look(scene):
    yield scene.quality


@pytest.mark.parametrize(
    "problems",
    [
        (SimpleNamespace(scene=Scene(0.1)), SimpleNamespace(scene=Scene(0.9))),
        (
            SimpleNamespace(scene=Scene(0.5), truth=0.1),
            SimpleNamespace(scene=Scene(0.5), truth=0.2),
        ),
    ],
    ids=["other objects", "another truth"],
)
def test_a_store_tells_problems_apart_by_all_that_they_hold(problems):
    keys = {problem_keys(anytime.programs.program_of(look), [problem])[0] for problem in problems}
    assert len(keys) == 2


def test_arrays_of_other_shapes_are_other_problems():
    program = anytime.programs.program_of(look)
    shapes = [(2, 8), (4, 4), (16,)]
    listed = [SimpleNamespace(scene=np.zeros(shape)) for shape in shapes]
    listed.append(SimpleNamespace(scene=np.zeros(32, np.float32)))
    assert len({problem_keys(program, [problem])[0] for problem in listed}) == 4


def test_a_store_refuses_problems_that_it_could_not_know_again(tmp_path):
    problem = SimpleNamespace(scene=Scene(0.5), hook=lambda: None)
    assert anytime.measure(look, [problem], seconds=1)["look"].mean(1.0)[0] == 0.5
    with pytest.raises(AnytimeError, match=r"problems\[0\] has no name, and .* give it a \.name"):
        anytime.measure(look, [problem], seconds=1, store=tmp_path / "s.runs")


def test_a_store_of_other_rates_or_of_another_constant_is_refused(tmp_path):
    @anytime.module(quality=lambda value, problem: min(1.0, value))
    def climb(x, start):
        yield start
        yield start + 0.1

    def measured_with(middle, start):
        program = compiler.program(lambda x: climb(x, start))
        rate = anytime.machines.Rate(0.0, (0.01, middle, 0.01), 1.0, 3)
        machine = Machine("s", {"climb": rate})
        return anytime.measure(
            program,
            [SimpleNamespace(x=1, name="p")],
            seconds=1,
            clock=lambda: WorkClock(machine),
            store=tmp_path / "s.runs",
        )

    measured_with(0.01, 0.1)
    measured_with(0.01, 0.1)
    for middle, start in ((0.0100004, 0.1), (0.01, 0.2)):
        with pytest.raises(AnytimeError, match="start anew"):
            measured_with(middle, start)


def test_a_cost_of_nothing_is_the_cheapest_there_is():
    @anytime.module(cost=lambda value, problem: value)
    def errors(x):
        for count in (5.0, 1.0, 0.0):
            anytime.charge(1)
            yield count

    machine = Machine("m").with_rate("errors", 0.01)
    library = anytime.measure(
        errors, [SimpleNamespace(x=1)], seconds=1, clock=lambda: WorkClock(machine)
    )
    assert library["errors"].mean([0.01, 0.02, 0.03]).tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_feature_that_is_no_number_is_refused_with_the_problem(value):
    @anytime.module(quality=lambda v, p: v, features=lambda x: {"size": value})
    def sized(x):
        yield x

    with pytest.raises(AnytimeError, match=r"feature 'size' of 'sized' is .* on problem"):
        anytime.measure(sized, [SimpleNamespace(x=0.5)], seconds=1)


def test_numbers_of_numpy_are_measured_stored_and_saved(tmp_path):
    @anytime.module(quality=lambda v, p: np.float32(v))
    def counted(x):
        anytime.charge(np.ones(5, bool).sum())
        yield x

    library = anytime.measure(
        counted,
        [SimpleNamespace(x=0.5)],
        seconds=np.float64(1),
        seed=np.int64(3),
        store=tmp_path / "s.runs",
    )
    library.save(tmp_path / "library")


def test_an_executor_is_named_or_submits():
    with pytest.raises(AnytimeError, match="executor=4; give"):
        anytime.measure(look, [SimpleNamespace(scene=Scene(0.5))], seconds=1, executor=4)


def test_a_clock_is_made_for_each_run_and_not_given():
    clock = WorkClock(MACHINE)
    with pytest.raises(AnytimeError, match="give what makes a run's clock"):
        anytime.measure(look, [SimpleNamespace(scene=Scene(0.5))], seconds=1, clock=clock)


@dataclass(slots=True)
class Slotted:
    scene: float
    truth: float


class Tupled(NamedTuple):
    scene: float
    truth: float


@pytest.mark.parametrize("kind", [Slotted, Tupled, Problem])
def test_whatever_holds_a_problem_all_of_it_counts(kind):
    program = anytime.programs.program_of(see if kind is Problem else look)
    keys = {problem_keys(program, [kind(0.5, truth)])[0] for truth in (0.1, 0.2, 0.3)}
    assert len(keys) == 3
