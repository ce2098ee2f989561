"""Branches, choices, loops, parallels and several outputs: compiled, run, saved, refused."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from statistics import mean
from types import SimpleNamespace

import pytest

import anytime
import compiler
from anytime import AnytimeError, Machine, Status, WallClock, WorkClock
from compiler import division
from experiments.benchmarks.compiler_constructs import KINDS, mismatches

MACHINE = Machine("m")
for _name in ("day", "night", "dark", "blurred", "smooth", "join"):
    MACHINE = MACHINE.with_rate(_name, 0.01)


@dataclass(frozen=True)
class Scene:
    """light: in [0, 1]; below .5 it is dark."""

    light: float
    name: str


SCENES = [Scene((index + 0.5) / 10, f"scene {index}") for index in range(10)]
DAY, NIGHT = SCENES[9], SCENES[0]


def clock() -> WorkClock:
    return WorkClock(MACHINE)


def same(quality, scene=None):
    return quality


@anytime.module(quality=same, estimate=same)
def day(light):
    for step in range(1, 5):
        yield light * step / 4


@anytime.module(quality=same, estimate=same)
def night(light):
    for step in range(1, 3):
        yield (1 - light) * step / 2


@anytime.module(quality=lambda answer, scene: 1.0 if answer == (scene.light < 0.5) else 0.0)
def dark(light):
    yield light < 0.5


@anytime.module(quality=lambda answer, scene: 1.0 if answer == (scene.light < 0.2) else 0.0)
def blurred(light):
    yield light < 0.2


@anytime.module(quality=same, estimate=same)
def smooth(value):
    yield value
    yield min(1.0, value + 0.1)


@anytime.module(quality=same)
def join(one, other):
    yield (one + other) / 2


def compiled(function, **options):
    program = compiler.program(function)
    library = anytime.measure(program, SCENES, seconds=1.0, clock=clock)
    return compiler.compile(program, library, **options)


def run(schedule, seconds, scene, **options):
    return schedule.run(seconds, clock=options.pop("clock", clock()), light=scene.light, **options)


def either(light):
    return compiler.branch(dark(light), night(light), day(light), chance=0.5)


def best(light):
    return compiler.choose(day(light), night(light))


def polished(light):
    return compiler.loop(smooth, day(light), times=3, until=0.8)


def asked(light):
    return compiler.loop(smooth, day(light), until=dark, chances=(0.5,))


def cautious(light):
    sure = compiler.all_of(dark(light), blurred(light), chances=(0.5, 0.2))
    return compiler.branch(sure, night(light), day(light), wrong=0.5)


def at_once(light):
    return join(*compiler.parallel(day(light), night(light)))


def shared_processor(light):
    return join(*compiler.parallel(smooth(night(light)), day(light), processors=1))


def joined_in_an_arm(light):
    best = compiler.choose(day(light), night(light))
    return join(*compiler.parallel(smooth(best), night(light)))


def looped_in_an_arm(light):
    return join(*compiler.parallel(compiler.loop(smooth, day(light), times=2), night(light)))


def nested(light):
    inner = join(*compiler.parallel(day(light), night(light)))
    return join(*compiler.parallel(smooth(inner), day(light)))


def nested_on_one_processor(light):
    inner = join(*compiler.parallel(day(light), night(light), processors=1))
    return join(*compiler.parallel(smooth(inner), day(light)))


def one_after_the_other(light):
    one, other = compiler.parallel(day(light), night(light))
    return join(*compiler.parallel(smooth(one), smooth(other)))


def two(light):
    return (
        compiler.output(day(light), deadline=0.06),
        compiler.output(smooth(night(light)), weight=2.0),
    )


EVERY = (either, best, polished, asked, cautious, at_once, shared_processor, two)


@pytest.fixture(scope="module")
def schedules():
    return {function: compiled(function) for function in EVERY}


# Exact


@pytest.mark.parametrize("kind", KINDS)
def test_no_division_of_a_program_with_constructs_beats_the_compiled_one(kind):
    assert mismatches(kind, 25, seed=1) == 0


@pytest.mark.parametrize("kind", ["choose", "parallel"])
def test_programs_too_large_to_weigh_all_divisions_are_exact_where_nothing_is_left_to_chance(
    kind, monkeypatch
):
    monkeypatch.setattr(division, "ALL", 0)
    assert mismatches(kind, 25, seed=2) == 0


# What runs


def test_of_a_branch_one_arm_is_run(schedules):
    result = run(schedules[either], 0.2, NIGHT)
    assert list(result.parts) == ["dark", "night"]
    assert result.value == pytest.approx(0.95)
    assert list(run(schedules[either], 0.2, DAY).parts) == ["dark", "day"]


def test_each_arm_of_a_branch_has_the_time_of_the_other(schedules):
    allocation = schedules[either].allocate(0.2)
    assert allocation.shares["night"] == pytest.approx(allocation.shares["day"])
    assert allocation.shares["dark"] + allocation.shares["day"] == pytest.approx(0.2)


def test_of_several_alternatives_the_best_is_kept_and_one_without_time_is_not_run(schedules):
    assert run(schedules[best], 0.5, NIGHT).value == pytest.approx(0.95)
    assert run(schedules[best], 0.5, DAY).value == pytest.approx(0.95)
    least = schedules[best].least
    assert len(run(schedules[best], least, DAY).parts) == 1


def test_without_estimates_the_first_alternative_that_is_there_is_taken():
    @compiler.program
    def first(light):
        return compiler.choose(dark(light), blurred(light))

    assert first.output.rule.compare is False


def test_a_loop_ends_when_the_result_is_good_enough(schedules):
    good, poor = run(schedules[polished], 1.0, DAY), run(schedules[polished], 1.0, SCENES[4])
    assert list(good.parts) == ["day", "smooth"]
    assert list(poor.parts) == ["day", "smooth", "smooth_2", "smooth_3"]
    assert poor.value == pytest.approx(0.75)


def test_a_loop_ends_when_a_module_says_so():
    @compiler.program
    def turning(light):
        return compiler.loop(smooth, day(light), until=dark, chances=(0.5, 0.5))

    assert [call.label for call in turning.calls] == [
        "day",
        "smooth",
        "dark",
        "smooth_2",
        "dark_2",
        "smooth_3",
    ]


def test_a_loop_of_a_module_that_never_says_so_runs_to_its_last_turn(schedules):
    assert list(run(schedules[asked], 1.0, DAY).parts) == ["day", "smooth", "dark", "smooth_2"]


def test_tests_are_asked_until_the_answer_is_settled(schedules):
    assert list(run(schedules[cautious], 1.0, DAY).parts) == ["dark", "day"]
    assert list(run(schedules[cautious], 1.0, NIGHT).parts) == ["dark", "blurred", "night"]


def test_the_arms_of_a_parallel_take_the_time_of_the_longest(schedules):
    result = run(schedules[at_once], 1.0, DAY)
    assert result.value == pytest.approx(0.5)
    spent = result.parts["day"].elapsed
    assert spent > result.parts["night"].elapsed > 0
    assert result.elapsed == pytest.approx(spent + result.parts["join"].elapsed)


@pytest.mark.parametrize("function", [at_once, shared_processor])
def test_each_arm_of_a_parallel_has_its_share_at_every_budget(schedules, function):
    """What one arm needs for its first result is no part of the other's time."""
    schedule = schedules[function]
    for seconds in schedule.frontier.budgets.tolist():
        shares, found = schedule.allocate(seconds).shares, run(schedule, seconds, DAY)
        assert found
        for label, part in found.parts.items():
            assert part.elapsed <= shares[label] + 1e-9
            assert part.elapsed >= shares[label] - 0.01 or part.status is Status.COMPLETE


@pytest.mark.parametrize(
    "function",
    [
        at_once,
        shared_processor,
        joined_in_an_arm,
        looped_in_an_arm,
        nested,
        nested_on_one_processor,
        one_after_the_other,
    ],
)
@pytest.mark.parametrize("adaptive", [False, True])
def test_where_nothing_is_left_to_chance_a_parallel_achieves_what_it_promises(function, adaptive):
    program = compiler.program(function)
    for scene in (DAY, NIGHT):
        library = anytime.measure(program, [scene], seconds=1.0, clock=clock)
        schedule = compiler.compile(program, library, adaptive=adaptive)
        for seconds in schedule.frontier.budgets.tolist():
            result = run(schedule, seconds, scene)
            assert result.value == pytest.approx(schedule.promise(seconds), abs=0.03)
            assert result.elapsed <= seconds + 1e-9


def test_promises_of_few_problems_are_unsure_whatever_the_program_is_made_of(schedules):
    for function in (either, at_once):
        low, high = schedules[function].interval(1.0)
        assert high - low > 1.0 / len(SCENES)


def test_one_problem_makes_nothing_sure():
    library = anytime.measure(
        compiler.program(at_once), SCENES[:1], seconds=1.0, clock=lambda: WorkClock(MACHINE)
    )
    low, high = compiler.compile(compiler.program(at_once), library).interval(1.0)
    assert high - low > 0.5


def test_what_returns_several_results_or_an_answer_is_no_module(schedules):
    with pytest.raises(AnytimeError, match="it returns several outputs"):
        _ = schedules[two].module


def test_arms_that_share_a_processor_follow_each_other(schedules):
    result = run(schedules[shared_processor], 1.0, DAY)
    assert result.elapsed == pytest.approx(sum(part.elapsed for part in result.parts.values()))


def test_in_real_time_the_arms_of_a_parallel_run_in_threads():
    meeting = threading.Barrier(2, timeout=20)

    @anytime.module(quality=same, name="left")
    def left(light):
        meeting.wait()  # passes only if the other runs meanwhile
        return light

    @anytime.module(quality=same, name="right")
    def right(light):
        meeting.wait()
        return light

    @compiler.program
    def both(light):
        return join(*compiler.parallel(left(light), right(light)))

    machine = MACHINE.with_rate("left", 0.01).with_rate("right", 0.01)

    @anytime.module(quality=same, name="left")
    def alone_left(light):
        return light

    @anytime.module(quality=same, name="right")
    def alone_right(light):
        return light

    @compiler.program
    def alone(light):
        return join(*compiler.parallel(alone_left(light), alone_right(light)))

    library = anytime.measure(alone, SCENES, seconds=1.0, clock=lambda: WorkClock(machine))
    result = run(compiler.compile(both, library), 20.0, DAY, clock=WallClock())
    assert result.value == DAY.light


def test_of_several_outputs_each_keeps_its_deadline(schedules):
    late = 0.06
    for seconds in (0.05, 0.1, 0.5):
        result = run(schedules[two], seconds, DAY)
        assert len(result.value) == 2
        if "day" in result.parts:
            assert result.parts["day"].elapsed <= late + 1e-9
    assert result.value == (pytest.approx(0.95), pytest.approx(0.15))


def test_a_result_that_is_missing_among_several_is_none(schedules):
    result = run(schedules[two], schedules[two].least, NIGHT)
    assert result.status is not Status.NO_RESULT
    assert None in result.value


def test_a_branch_keeps_what_it_promises(schedules):
    """Each arm is promised what it achieves where the test sends it, not on all problems."""
    schedule = schedules[either]
    for seconds in (0.031, 0.081, 0.4):
        found = [run(schedule, seconds, scene).value or 0.0 for scene in SCENES]
        assert sum(found) / len(found) == pytest.approx(schedule.promise(seconds), abs=0.03)


def test_an_input_of_the_program_may_be_the_test():
    @compiler.program
    def told(light, late):
        return compiler.branch(late, night(light), day(light), chance=0.5)

    scenes = [SimpleNamespace(name=s.name, light=s.light, late=s.light < 0.5) for s in SCENES]
    schedule = compiler.compile(told, anytime.measure(told, scenes, seconds=1.0, clock=clock))
    for seconds in (0.031, 0.081, 0.4):
        ran = [
            schedule.run(seconds, clock=clock(), light=scene.light, late=scene.late)
            for scene in scenes
        ]
        assert mean(result.value or 0.0 for result in ran) == pytest.approx(
            schedule.promise(seconds), abs=0.03
        )


# Kept in files, and explained


@pytest.mark.parametrize("function", EVERY)
def test_what_is_loaded_does_the_same(schedules, function, tmp_path):
    schedule = schedules[function]
    schedule.save(tmp_path / "a.schedule")
    modules = [day, night, dark, blurred, smooth, join]
    again = compiler.load(tmp_path / "a.schedule", modules=modules)
    assert repr(again) == repr(schedule)
    assert repr(again.explain(0.1)) == repr(schedule.explain(0.1))
    for scene in (DAY, NIGHT):
        assert repr(run(again, 0.15, scene)) == repr(run(schedule, 0.15, scene))
    again.save(tmp_path / "b.schedule")
    assert (tmp_path / "b.schedule").read_bytes() == (tmp_path / "a.schedule").read_bytes()


@pytest.mark.parametrize("function", EVERY)
def test_it_explains_itself_within_a_hundred_columns(schedules, function):
    schedule = schedules[function]
    texts = (schedule, schedule.program, schedule.explain(0.1), schedule.advise(0.1))
    for text in texts:
        assert max(map(len, repr(text).splitlines())) <= 100
    assert all(gain >= -1e-9 for gain in [change.gain for change in schedule.advise(0.1).changes])


# What is refused


def no_chance(light):
    return compiler.branch(dark(light), day(light), night(light))


def an_input_as_arm(light):
    return compiler.branch(dark(light), light, night(light), chance=0.5)


def one_alternative(light):
    return compiler.choose(day(light))


def blind_loop(light):
    return compiler.loop(lambda value: join(value, value), day(light), times=2, until=0.5)


def endless(light):
    return compiler.loop(smooth, day(light))


def a_test_as_value(light):
    return smooth(compiler.all_of(dark(light), blurred(light), chances=(0.5, 0.5)))


def nested_tests(light):
    inner = compiler.any_of(dark(light), blurred(light), chances=(0.5, 0.5))
    return compiler.all_of(inner, dark(light), chances=(0.5, 0.5))


def shared_deadlines(light):
    seen = day(light)
    return compiler.output(smooth(seen), deadline=0.1), compiler.output(seen)


def impossible_chance(light):
    return compiler.branch(dark(light), day(light), night(light), chance=1.5)


def no_processor(light):
    return join(*compiler.parallel(day(light), night(light), processors=0))


def python_and(light):
    return day(light) and night(light)


def beside_with_deadlines(light):
    one, other = compiler.parallel(day(light), night(light), processors=1)
    return compiler.output(one, deadline=0.03), compiler.output(other, deadline=0.02)


def cut_in_two(light):
    one, other = compiler.parallel(day(light), night(light))
    return join(compiler.branch(dark(light), one, smooth(light), chance=0.5), other)


@pytest.mark.parametrize(
    ("function", "says"),
    [
        (no_chance, r"without the chance that it is true; give chance=…"),
        (an_input_as_arm, r"branch: then is light; give the result of a module"),
        (one_alternative, r"choose takes two alternatives or more"),
        (blind_loop, r"cannot see how good .* give its module an estimate"),
        (endless, r"loop takes times=…, 1 or more, or until=MODULE"),
        (a_test_as_value, r"smooth is called with a test"),
        (nested_tests, r"all_of of any_of\(.*give its tests themselves"),
        (shared_deadlines, r"results with deadlines of their own share a call"),
        (impossible_chance, r"chance=1\.5; give a number in \[0, 1\]"),
        (no_processor, r"processors=0; give 1 or more"),
        (python_and, r"use compiler\.branch for if, all_of for and, any_of for or"),
        (beside_with_deadlines, r"deadlines of their own share a parallel"),
        (cut_in_two, r"use all results of a parallel in the same arm"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_place_and_cure(function, says):
    with pytest.raises(AnytimeError, match=says) as caught:
        compiler.program(function)
    assert f"{__file__}:{function.__code__.co_firstlineno}: program" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_outside_a_program_constructs_are_refused():
    with pytest.raises(AnytimeError, match="branch is called in a function decorated with"):
        compiler.branch(True, 1, 2, chance=0.5)


def test_a_program_that_answers_tests_or_has_several_results_is_no_module():
    @compiler.program
    def safe(x):
        return compiler.all_of(check(x), check(x), chances=(0.5, 0.5))

    @compiler.program
    def both(x):
        return check(x), check(x)

    machine = Machine("m").with_rate("check", 0.01)
    problems = [SimpleNamespace(x=x) for x in (0.2, 0.9)]
    for read, what in ((safe, "the answer of tests"), (both, "several outputs")):
        library = anytime.measure(read, problems, seconds=1.0, clock=lambda: WorkClock(machine))
        with pytest.raises(AnytimeError, match=f"cannot be a module.* it returns {what}"):
            _ = compiler.compile(read, library).module


@anytime.module(quality=lambda answer, problem: 1.0)
def check(x):
    anytime.charge(1)
    yield x > 0.5
