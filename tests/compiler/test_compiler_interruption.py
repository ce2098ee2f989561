"""Contract modules and compiled programs made interruptible: run, promised, refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

import anytime
import compiler
from anytime import AnytimeError, Deadline, Machine, Status, WorkClock

MACHINE = Machine("m")
for _name in ("solve", "see", "find", "lucky"):
    MACHINE = MACHINE.with_rate(_name, 1.0)  # a unit of work is a second


@dataclass(frozen=True)
class Problem:
    hard: float


def problems(count=9):
    return [Problem(float(hard)) for hard in np.linspace(0.5, 2.0, count)]


def clock():
    return WorkClock(MACHINE)


def quality(answer):
    return answer[1]


@anytime.module(quality=quality)
def solve(hard, *, seconds):
    """Better the longer it was told that it may take; nothing before its end."""
    for step in range(16):
        anytime.charge(seconds / 16)
        yield (seconds, 1 - np.exp(-seconds / (0.05 * hard))) if step == 15 else None


@anytime.module(quality=lambda seen: seen)
def see(hard):
    for step in range(1, 5):
        anytime.charge(0.01 * step)
        yield step / 4 / hard**0.1 if hard > 1 else step / 4


@anytime.module(quality=lambda found: found, estimate=lambda found: found)
def find(seen, hard):
    for step in range(1, 9):
        anytime.charge(0.01)
        yield seen * step / 8


@compiler.program
def fetch(hard):
    return find(see(hard), hard)


@pytest.fixture(scope="module")
def library():
    return anytime.measure(solve, problems(), seconds=1.0, clock=clock)


@pytest.fixture(scope="module")
def schedule():
    return compiler.compile(fetch, anytime.measure(fetch, problems(), seconds=1.0, clock=clock))


def interrupted(module, end, *inputs, **options):
    """What a run has that nobody told when it would be interrupted, and on_result saw in time."""
    time, in_time = clock(), []
    until = Deadline(time, event=lambda: time.now() >= end)
    result = anytime.run(
        module,
        *(inputs or (1.0,)),
        deadline=until,
        on_result=lambda value, change: in_time.append(value) if change.seconds <= end else None,
        **options,
    )
    return in_time[-1] if in_time else None, result


# Running


def test_at_any_interruption_it_has_the_longest_contract_that_is_done(library):
    patient = compiler.interruptible(solve, library)
    ends = np.cumsum(patient.lengths)
    for end in np.linspace(0.001, 2.2, 60):
        done = [
            length for length, done in zip(patient.lengths, ends, strict=True) if done <= end + 1e-9
        ]
        answer, result = interrupted(patient, float(end) + 1e-9)
        assert (answer[0] if answer else None) == (pytest.approx(max(done)) if done else None)
        assert result.status in (Status.INTERRUPTED, Status.NO_RESULT) or end > ends[-1] - 1e-6


def test_it_keeps_its_ratio_when_it_is_really_run(library):
    """At no moment is it behind a single contract of a quarter of the time."""
    patient = compiler.interruptible(solve, library)
    assert patient.ratio <= 4
    curve = library["solve"]
    for end in np.cumsum(patient.lengths):
        answer, _ = interrupted(patient, float(end) * (1 - 1e-6))
        achieved = 0.0 if answer is None else answer[1]
        alone = 1 - np.exp(-curve.times[curve.times <= end / 4] / 0.05)
        assert achieved >= max(alone, default=0.0) - 1e-6


def test_left_alone_it_completes_with_the_best(library):
    patient = compiler.interruptible(solve, library)
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert result.status is Status.COMPLETE
    assert result.value[0] == pytest.approx(1.0)
    assert len(result.history) == len(patient.lengths)


def test_a_deadline_that_is_known_shortens_the_contract_that_it_would_cut(library):
    patient = compiler.interruptible(solve, library)
    seconds = float(sum(patient.lengths[:3])) + 0.9 * patient.lengths[3]
    result = anytime.run(patient, 1.0, deadline=Deadline.after(seconds, clock()))
    assert result.status is Status.INTERRUPTED
    assert result.value[0] == pytest.approx(0.9 * patient.lengths[3])


def test_a_contract_that_could_not_be_longer_than_the_last_is_not_begun(library):
    patient = compiler.interruptible(solve, library)
    seconds = float(sum(patient.lengths[:3])) + 0.9 * patient.lengths[2]
    result = anytime.run(patient, 1.0, deadline=Deadline.after(seconds, clock()))
    assert result.status is Status.INTERRUPTED
    assert result.elapsed == pytest.approx(sum(patient.lengths[:3]))


def test_the_best_result_is_kept_by_its_estimate():
    """A module that is worse when it is told more time, and can tell."""

    @anytime.module(quality=lambda answer: answer, estimate=lambda answer: answer)
    def solve(hard, *, seconds):
        anytime.charge(seconds)
        yield 0.9 if seconds < 0.1 * hard else 0.5

    listed = [Problem(hard) for hard in (0.5, 1.0, 4.0, 16.0)]
    library = anytime.measure(solve, listed, seconds=1.0, clock=clock)
    patient = compiler.interruptible(solve, library, interruption=[0.02, 3.0])
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert result.value == 0.9
    estimates = [change.estimate for change in result.history]
    assert estimates == sorted(estimates)


def test_a_result_that_is_estimated_at_nothing_is_a_result():
    @anytime.module(quality=lambda answer: 0.5, estimate=lambda answer: 0.0, name="solve")
    def modest(hard, *, seconds):
        anytime.charge(seconds)
        return "something"

    library = anytime.measure(modest, problems(3), seconds=1.0, clock=clock)
    patient = compiler.interruptible(modest, library)
    assert anytime.run(patient, 1.0, deadline=Deadline(clock())).value == "something"


def test_without_an_estimate_the_longest_contract_speaks(library):
    patient = compiler.interruptible(solve, library)
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert [change.estimate for change in result.history] == [None] * len(patient.lengths)
    assert result.value[0] == pytest.approx(max(patient.lengths))


def test_a_module_with_memory_goes_on_where_the_last_contract_stopped():
    @anytime.module(quality=lambda spent: spent / 64, name="solve")
    def kept(hard, *, seconds, memory):
        anytime.charge(seconds)
        memory["spent"] = memory.get("spent", 0.0) + seconds
        return memory["spent"]

    library = anytime.measure(kept, problems(3), seconds=64.0, clock=clock)
    patient = compiler.interruptible(kept, library)
    assert patient.filled == {"memory"}
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert result.value == pytest.approx(sum(patient.lengths))
    spent = np.cumsum(patient.lengths)
    behind = spent[1:] / spent[:-1]
    cold = spent[1:] / np.array(patient.lengths[:-1])
    assert behind.max() < cold.max()


def test_a_contract_that_fails_is_a_fault_and_what_was_there_stays():
    @anytime.module(quality=quality, name="solve")
    def fragile(hard, *, seconds):
        anytime.charge(seconds)
        if seconds > 0.2 and hard == 3:
            raise OSError("out of memory")
        yield (seconds, min(1.0, seconds))

    library = anytime.measure(fragile, problems(3), seconds=1.0, clock=clock)
    patient = compiler.interruptible(fragile, library)
    result = anytime.run(patient, 3, deadline=Deadline(clock()))
    assert result.value[0] <= 0.2
    assert "a contract of solve for" in str(result.fault)
    assert "out of memory" in str(result.fault)


# Compiled programs


def test_a_compiled_program_becomes_interruptible(schedule):
    patient = compiler.interruptible(schedule, interruption=stats.uniform(0, 0.3))
    assert patient.parameters == ("hard",)
    for end in np.linspace(0.03, 0.5, 12):
        answer, _ = interrupted(patient, float(end))
        assert (answer or 0.0) >= patient.promise(float(end)) - 0.15
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert result.status is Status.COMPLETE
    assert result.value == 1.0


def test_results_within_a_contract_are_there_at_once_when_they_can_be_seen_to_be_better(schedule):
    """The last call of a program registers results before its contract ends."""
    patient = compiler.interruptible(schedule)
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert len(result.history) > len(patient.lengths)
    estimates = [change.estimate for change in result.history]
    assert estimates == sorted(estimates)


def test_modules_of_a_program_keep_their_memory_from_contract_to_contract():
    calls = []

    @anytime.module(quality=lambda found: found, name="find")
    def remembers(seen, hard, *, memory):
        memory["times"] = memory.get("times", 0) + 1
        calls.append(memory["times"])
        anytime.charge(0.02)
        yield seen * 0.5
        anytime.charge(0.05)
        yield seen

    @compiler.program
    def kept(hard):
        return remembers(see(hard), hard)

    measured = anytime.measure(kept, problems(), seconds=1.0, clock=clock)
    patient = compiler.interruptible(compiler.compile(kept, measured))
    calls.clear()
    anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert calls == list(range(1, len(calls) + 1))
    assert len(calls) > 1


def test_the_output_may_be_a_choice_of_results():
    @anytime.module(quality=lambda found: found, estimate=lambda found: found, name="solve")
    def other(seen, hard):
        anytime.charge(0.03)
        yield 0.9 * seen

    @compiler.program
    def either(hard):
        seen = see(hard)
        return compiler.choose(find(seen, hard), other(seen, hard))

    measured = anytime.measure(either, problems(), seconds=1.0, clock=clock)
    patient = compiler.interruptible(compiler.compile(either, measured))
    result = anytime.run(patient, 1.0, deadline=Deadline(clock()))
    assert result.fault is None
    assert result.value >= 0.9
    estimates = [change.estimate for change in result.history]
    assert estimates == sorted(estimates)


def test_it_achieves_what_it_promises(schedule):
    when = stats.uniform(0, 0.3)
    patient = compiler.interruptible(schedule, interruption=when)
    ends = when.ppf((np.arange(40) + 0.5) / 40)
    achieved = [
        interrupted(patient, float(end), problem.hard)[0] or 0.0
        for end in ends
        for problem in problems(5)
    ]
    assert np.mean(achieved) >= patient.expected - 0.02


def test_it_is_a_module_that_programs_call_and_that_is_measured(library):
    patient = compiler.interruptible(solve, library)

    @anytime.module(quality=lambda answer: answer[1], name="find")
    def polish(answer):
        anytime.charge(0.01)
        yield answer

    @compiler.program
    def both(hard):
        return polish(patient(hard))

    measured = anytime.measure(both, problems(), seconds=3.0, clock=clock)
    own = measured[patient.name]
    for seconds in np.cumsum(patient.lengths) + 1e-6:
        assert own.mean(seconds)[0] == pytest.approx(patient.promise(seconds), abs=1e-6)
    joint = compiler.compile(both, {**measured, patient.name: patient.profile})
    result = joint.run(0.5, clock=clock(), hard=1.0)
    assert result
    assert result.elapsed <= 0.5 + 1e-9


# Building


def test_its_profile_is_that_of_its_contracts(library):
    patient = compiler.interruptible(solve, library)
    profile = library["solve"]
    best = 0.0
    for length, end in zip(patient.lengths, np.cumsum(patient.lengths), strict=True):
        assert patient.promise(end - 1e-9) == pytest.approx(best)
        best = float(profile.mean(length)[0])
        assert patient.promise(end) == pytest.approx(best)


@pytest.mark.parametrize(
    "when", [stats.uniform(0, 0.5), stats.expon(scale=0.1), [0.05, 0.3, 0.3, 0.7]]
)
def test_a_known_distribution_is_worth_no_less_than_doubling(library, when):
    patient = compiler.interruptible(solve, library, interruption=when)
    assert patient.expected >= patient.doubling - 1e-9


def test_a_predicted_time_is_used_and_the_rest_is_kept_robust(library):
    told = compiler.interruptible(solve, library, interruption=0.3)
    nothing = compiler.interruptible(solve, library)
    assert told.promise(0.3) >= nothing.promise(0.3)
    assert told.ratio <= 4 + 1e-9
    bold = compiler.interruptible(solve, library, interruption=0.3, robustness=8)
    assert bold.promise(0.3) >= told.promise(0.3)


def test_a_module_that_registers_as_it_goes_is_interruptible_as_it_is():
    library = anytime.measure(see, problems(), seconds=1.0, clock=clock)
    patient = compiler.interruptible(see, library)
    assert patient.function is see.function
    assert patient.profile is library["see"]
    assert (patient.lengths, patient.ratio) == ((), 1.0)
    assert patient.expected >= patient.doubling
    assert "as it is" in repr(patient)


def test_what_is_interruptible_already_stays_as_it_is(library):
    patient = compiler.interruptible(solve, library)
    again = compiler.interruptible(patient, {patient.name: patient.profile})
    assert again.function is patient.function
    assert again.name == patient.name


def test_so_is_a_program_of_such_a_module_alone():
    library = anytime.measure(see, problems(), seconds=1.0, clock=clock)
    patient = compiler.interruptible(compiler.compile(see, library))
    assert patient.function is see.function


def test_its_text_keeps_to_a_hundred_columns_and_a_notebook_shows_it(library, schedule):
    for contract in (solve, schedule):
        patient = compiler.interruptible(contract, library)
        assert max(map(len, repr(patient).splitlines())) <= 100
        html = patient._repr_html_()
        assert html.count("<svg") == 1
        assert "one contract" in html


# Luck


@anytime.module(quality=lambda found: found, estimate=lambda found: found)
def lucky(hard, *, seconds, rng):
    anytime.charge(seconds)
    return float(rng.uniform(0.5, 1)) if rng.random() < 1 - np.exp(-10 * seconds / hard) else None


def test_luck_is_tried_again_until_it_is_not_worth_it():
    library = anytime.measure(lucky, problems(240), seconds=1.0, clock=clock)
    when = stats.uniform(0, 0.4)
    ends = when.ppf((np.arange(200) + 0.5) / 200)
    achieved = {}
    for adaptive in (False, True):
        patient = compiler.interruptible(lucky, library, interruption=when, adaptive=adaptive)
        found = [
            interrupted(patient, float(end), rng=np.random.default_rng(seed))[0] or 0.0
            for seed, end in enumerate(ends)
        ]
        achieved[adaptive] = float(np.mean(found))
    assert achieved[True] > 1.1 * achieved[False]
    assert achieved[True] == pytest.approx(patient.expected, abs=0.12)
    assert "chosen by what is achieved" in repr(patient)


def test_luck_needs_a_generator_an_estimate_and_no_bound(library):
    with pytest.raises(AnytimeError, match="solve takes no rng, so the same contract"):
        compiler.interruptible(solve, library, adaptive=True)

    @anytime.module(quality=lambda found: found, name="lucky")
    def blind(hard, *, seconds, rng):
        anytime.charge(seconds)
        return 0.5

    measured = anytime.measure(blind, problems(3), seconds=1.0, clock=clock)
    with pytest.raises(AnytimeError, match="has no estimate, so what it achieves cannot be seen"):
        compiler.interruptible(blind, measured, adaptive=True)
    with pytest.raises(AnytimeError, match="leave one of the two out"):
        compiler.interruptible(blind, measured, adaptive=True, robustness=5)


# Refusing


def test_a_program_compiled_for_something_else_is_refused():
    measured = anytime.measure(fetch, problems(), seconds=1.0, clock=clock)
    compiled = compiler.compile(fetch, measured, objective=compiler.at_least(0.5))
    with pytest.raises(AnytimeError, match=r"compiled for at_least\(0.5\)"):
        compiler.interruptible(compiled)


def test_what_cannot_be_made_is_refused_in_one_line(library):
    with pytest.raises(AnytimeError, match="no profile for module 'solve'; measured: none"):
        compiler.interruptible(solve)
    with pytest.raises(AnytimeError, match="not 3"):
        compiler.interruptible(3, library)
    with pytest.raises(AnytimeError, match="give a factor >= 1"):
        compiler.interruptible(solve, library, robustness=0.5)
    with pytest.raises(AnytimeError, match="the least ratio is"):
        compiler.interruptible(solve, library, robustness=1.1)
    with pytest.raises(AnytimeError, match="before the first result"):
        compiler.interruptible(solve, library, interruption=1e-4)
