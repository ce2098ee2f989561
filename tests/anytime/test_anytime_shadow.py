"""A shadow changes nothing and records what it saw."""

import gc
import inspect
import threading
import weakref
from enum import Enum
from operator import attrgetter
from types import SimpleNamespace

import numpy as np
import pytest

from anytime import AnytimeError, Machine, WorkClock
from anytime.shadow import FRAMES, RESULTS, Shadow
from anytime.shadowed import shadowed

Mode = Enum("Mode", "ON OFF")


@pytest.fixture
def system():
    """A loop of three functions on a clock of its own."""
    clock = WorkClock(Machine("test"))
    shadow = Shadow(clock)

    def see(image, *, sizes=(1, 2, 4)):
        for size in sizes:
            clock.advance(0.01 * size)
            yield [1 - image / size]

    def find(boxes, start=0):
        """Finds."""
        for cost in 3.0, 2.0, 1.5:
            clock.advance(0.02)
            shadow.register(cost)
        return (boxes, 1.5)

    def fail(how):
        raise how

    watched = SimpleNamespace(
        see=shadow.watch(see, quality=lambda boxes: boxes[0]),
        find=shadow.watch(find, cost=lambda found: found if isinstance(found, float) else found[1]),
        fail=shadow.watch(fail),
    )

    @shadow.frame
    def step(image):
        last = None
        for boxes in watched.see(image):
            clock.advance(100.0)  # what happens between results is not the function's time
            last = boxes
        return watched.find(last)

    plain = SimpleNamespace(see=see, find=find, fail=fail)
    return SimpleNamespace(shadow=shadow, clock=clock, step=step, plain=plain, **vars(watched))


def test_results_exceptions_and_signatures_are_what_they_were(system):
    assert list(system.see(0.5)) == list(system.plain.see(0.5))
    assert system.find([1.0], start=3) == system.plain.find([1.0])
    assert system.find.__doc__ == "Finds."
    for name in "see", "find", "fail":
        plain, watched = getattr(system.plain, name), getattr(system, name)
        assert inspect.signature(plain) == inspect.signature(watched)
        assert inspect.isgeneratorfunction(plain) == inspect.isgeneratorfunction(watched)
    error = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt) as caught:
        system.shadow.frame(system.fail)(error)
    assert caught.value is error
    with pytest.raises(TypeError, match=r"find\(\) got an unexpected"):
        system.shadow.frame(lambda: system.find(wrong=1))()


def test_a_generator_is_sent_thrown_into_and_closed_as_ever():
    shadow, told = Shadow(), []

    def talk():
        try:
            told.append((yield 0.1))
            yield 0.2
        except ValueError as error:
            told.append(error)
            yield 0.3
        finally:
            told.append("closed")
        return 0.4

    @shadow.frame
    def frame():
        talking = shadow.watch(talk, quality=float)()
        error = ValueError()
        assert (next(talking), talking.send("hello"), talking.throw(error)) == (0.1, 0.2, 0.3)
        with pytest.raises(StopIteration) as stopped:
            next(talking)
        assert told == ["hello", error, "closed"]
        return stopped.value.value

    assert frame() == 0.4
    assert shadow.frames[0].calls["talk"].scores == [0.1, 0.2, 0.3, 0.4]
    assert shadow.frames[0].calls["talk"].complete


def test_times_scores_and_what_went_where_are_recorded_and_no_result_is_kept(system):
    system.step(0.5)
    (frame,) = system.shadow.frames
    see, find = frame.calls["see"], frame.calls["find"]
    assert see.seconds == pytest.approx([0.01, 0.03, 0.07])
    assert see.scores == [0.5, 0.75, 0.875]
    assert find.seconds == pytest.approx([0.02, 0.04, 0.06, 0.06])
    assert find.fed == {"boxes": ("see", 2)}
    assert not frame.made


def test_a_score_that_fails_or_is_none_goes_no_further(system):
    bad = system.shadow.watch(lambda: 7, quality=lambda value: 1 / 0)
    worse = system.shadow.watch(abs, quality=lambda value: value)
    assert system.shadow.frame(lambda: (bad(), worse(-7)))() == (7, 7)
    assert system.shadow.odd["abs with a score that is none"] == 1


def test_what_returns_nothing_has_what_it_registered():
    shadow = Shadow()

    def seek():
        shadow.register(0.7)

    def look():
        yield 0.5

    watched = [shadow.watch(each, quality=float) for each in (seek, look)]
    shadow.frame(lambda: (watched[0](), list(watched[1]())))()
    assert shadow.frames[0].calls["seek"].scores == [0.7]
    assert shadow.frames[0].calls["look"].scores == [0.5]


def test_of_many_results_all_times_are_covered_and_few_results_are_alive():
    clock = WorkClock(Machine("here"))
    shadow, alive = Shadow(clock), weakref.WeakSet()

    class Result:
        def __init__(self, quality):
            self.quality = quality
            alive.add(self)

    def many():
        for index in range(1000):
            clock.advance(0.001)
            yield Result(min(1.0, (index + 1) / 100))

    def use(result):
        return result

    quality = attrgetter("quality")
    watched_many, watched_use = (shadow.watch(each, quality=quality) for each in (many, use))
    most = []

    @shadow.frame
    def turn():
        last = None
        for result in watched_many():
            last = result
            most.append(len(alive))
        watched_use(last)

    for _ in range(20):
        turn()
    gc.collect()
    assert not alive
    assert max(most) <= RESULTS + 2
    seen = shadow.frames[0].calls["many"]
    assert len(seen.seconds) <= RESULTS
    assert seen.seconds[-1] == pytest.approx(1.0)
    assert max(np.diff(seen.seconds)) < 0.04
    assert next(t for t, q in zip(seen.seconds, seen.scores, strict=True) if q == 1.0) < 0.14
    assert shadow.frames[0].calls["use"].fed == {"result": ("many", 999)}
    assert shadowed(shadow).library(cautious=False)["use"].recordings[0].inputs == {"result": 1.0}


def test_what_every_function_may_hold_feeds_nobody():
    shadow = Shadow()
    make = shadow.watch(lambda: (Mode.ON, ()), quality=lambda _: 1.0)

    def drive(mode, empty):
        return mode

    shadow.frame(lambda: (make(), shadow.watch(drive)(Mode.ON, ())))()
    assert shadow.frames[0].calls["drive"].fed == {}


def test_an_array_is_told_apart_by_what_it_is_and_not_by_what_it_holds():
    shadow = Shadow()
    make = shadow.watch(lambda: np.zeros(3))

    def use(array, other):
        return array.sum() + other.sum()

    use = shadow.watch(use)
    assert shadow.frame(lambda: use(make(), np.zeros(3)))() == 0.0
    assert shadow.frames[0].calls["use"].fed == {"array": ("<lambda>", 0)}


def test_results_that_go_in_a_circle_make_no_program():
    shadow = Shadow()

    def pair(name):
        def function(x=None):
            return object()

        function.__name__ = name
        return shadow.watch(function)

    a, b, c = pair("a"), pair("b"), pair("c")

    @shadow.frame
    def turn(one, two, three):
        three(two(one()))

    for _ in range(20):
        for order in ((a, b, c), (b, c, a), (c, a, b)):
            turn(*order)
    with pytest.raises(AnytimeError, match="no such circle"):
        shadowed(shadow)


def test_frames_and_functions_that_cannot_be_watched_are_refused():
    async def wait():
        pass

    async def come():
        yield 1

    def give():
        yield 1

    shadow = Shadow()
    for function in (wait, come, give):
        with pytest.raises(AnytimeError, match="give a plain function"):
            shadow.frame(function)
    for function in (wait, come):
        with pytest.raises(AnytimeError, match="give a function or generator function"):
            shadow.watch(function)
    with pytest.raises(AnytimeError, match="it tells no parameters"):
        shadow.watch(int)


def test_threads_have_frames_of_their_own(system):
    threads = [threading.Thread(target=system.step, args=(0.1,)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(system.shadow.frames) == 8
    assert all(list(frame.calls) == ["see", "find"] for frame in system.shadow.frames)


def test_the_memory_of_a_shadow_is_bounded(system):
    turn = system.shadow.frame(lambda: None)
    for _ in range(FRAMES + 100):
        turn()
    assert len(system.shadow.frames) == FRAMES
    assert system.shadow.count == FRAMES + 100


def test_what_cannot_be_watched_is_refused(system):
    async def later(): ...

    with pytest.raises(AnytimeError, match="give a function or generator function"):
        system.shadow.watch(later)
    with pytest.raises(AnytimeError, match="'see' is watched already"):
        system.shadow.watch(system.plain.see)
    with pytest.raises(AnytimeError, match="0 frames with watched calls; 20 are needed"):
        shadowed(system.shadow)


def test_a_program_is_read_off_what_went_where(system):
    for number in range(30):
        system.step(number / 30)
        system.see(0.3)
    seen = shadowed(system.shadow)
    assert (
        repr(seen.program) == "program shadow(image, sizes, start) = find(see(image, sizes), start)"
    )
    assert len(seen.frames) == 30
    assert seen.library(cautious=False)["find"].inputs == ("boxes",)
    cautious = seen.library(cautious=True)["find"]
    assert not cautious.given(boxes=0.0).mean(1.0).any()
    assert cautious.given(boxes=1.0).mean(1.0) == pytest.approx(1.0)


def test_frames_in_which_a_call_was_missing_are_told(system):
    for number in range(60):
        system.step(number / 60) if number % 2 else system.shadow.frame(
            lambda: list(system.see(0.5))
        )()
    assert any(
        "the 30 of 60 frames in which a call" in line for line in shadowed(system.shadow).unknown
    )


@pytest.mark.parametrize(
    ("budget", "expected"),
    [
        (lambda number: 1.0, "sleep has no curve: it was only ever told one time"),
        (lambda number: 1.0 + number % 3, "each was seen at one of 3 times"),
    ],
)
def test_a_contract_function_that_was_only_told_one_time_has_no_curve(system, budget, expected):
    def sleep(start, seconds):
        system.clock.advance(seconds)
        return start

    turn = system.shadow.frame(system.shadow.watch(sleep, quality=lambda value: 0.5))
    for number in range(30):
        turn(number, seconds=budget(number))
    assert any(expected in line for line in shadowed(system.shadow).unknown)
