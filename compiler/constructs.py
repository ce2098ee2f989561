"""What a program may say besides calling modules: branch, choose, all_of, any_of, loop, parallel.

Each is called while a program is read and makes a `Join` of results, which costs no time itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from anytime import calling
from anytime.errors import AnytimeError
from anytime.joins import Branch, Several, Tests, Until
from anytime.modules import Module
from anytime.programs import Call, Input, Join, Parallel, Reading, Source, makers


def branch(
    test: Any, then: Any, otherwise: Any, *, chance: float | None = None, wrong: float = 0.0
) -> Any:
    """One of two results, by a test.

    test: the result of a module, whose quality is the probability that it is right, or an input
    that is known when the program runs. chance: that the test is true; of `all_of` and `any_of`
    it is known. wrong: the share of its quality that the wrong arm's result is still worth.
    What only the other arm needs is not run. Both arms have the same time, since one is run.
    Raises AnytimeError outside a program and for an arm that no module makes.
    """
    reading = _reading("branch")
    _result("branch", "then", then)
    _result("branch", "otherwise", otherwise)
    if isinstance(test, Join) and isinstance(test.rule, Tests):
        # Its tests are asked by the branch itself. By identity: symbols refuse to be compared.
        reading.nodes[:] = [node for node in reading.nodes if node is not test]
        rule = Branch(test.rule.chances, wrong, test.rule.everyone)
        return reading.join(rule, (*test.arguments, then, otherwise))
    if chance is None:
        raise AnytimeError(
            f"branch on {test!r} without the chance that it is true; give chance=…, say .5"
        )
    return reading.join(Branch((chance,), wrong), (_test("branch", test), then, otherwise))


def choose(*alternatives: Any) -> Any:
    """Whichever alternative, or several of them and then the best, is worth most in the time.

    An alternative that is given no time is not run. Several are only compared where every module
    that they come from has an estimate=…; otherwise the first that has a result is taken.
    Raises AnytimeError outside a program, for fewer than two and for one that no module makes.
    """
    reading = _reading("choose")
    if len(alternatives) < 2:
        raise AnytimeError("choose takes two alternatives or more")
    for alternative in alternatives:
        _result("choose", "an alternative", alternative)
    return reading.chosen(alternatives)


def all_of(*tests: Any, chances: Sequence[float]) -> Any:
    """Whether all tests are true, asked one after the other until one is not.

    tests: results of modules, whose quality is the probability that they are right. chances: that
    each is true. The result is for `branch`, or is the program's.
    """
    return _tests("all_of", tests, chances, everyone=True)


def any_of(*tests: Any, chances: Sequence[float]) -> Any:
    """Whether any test is true, asked one after the other until one is. See `all_of`."""
    return _tests("any_of", tests, chances, everyone=False)


def loop(
    body: Callable[[Any], Any],
    first: Any,
    *,
    times: int | None = None,
    until: float | Module | None = None,
    chances: Sequence[float] | None = None,
) -> Any:
    """`body(body(…first…))`, each turn with a share of its own.

    times: how many turns. With until=.9, at most so many: it ends with the first result whose
    estimate is that good. With until=MODULE, that module is asked of every result whether to end,
    which is so with chances[k] after turn k + 1; one more turn than there are chances is the last.
    body: called while the program is read, with the result of the turn before.
    Raises AnytimeError outside a program and for a body that calls no module.
    """
    reading = _reading("loop")
    if isinstance(until, Module):
        if chances is None or times is not None:
            raise AnytimeError(
                "loop until a module says so takes chances=(…), that it ends after each turn but "
                "the last, and no times"
            )
        turns = len(chances) + 1
    elif not isinstance(times, int) or times < 1 or chances is not None:
        raise AnytimeError("loop takes times=…, 1 or more, or until=MODULE with chances=(…)")
    else:
        turns = times
    results: list[Any] = []
    tests: list[Any] = []
    for turn in range(turns):
        result = body(results[-1] if results else first)
        _result("loop", "what the body returns", result)
        results.append(result)
        if isinstance(until, Module) and turn < turns - 1:
            tests.append(until(result))
    ended = results[-1]
    if isinstance(until, Module):
        for chance, test, result in reversed(
            list(zip(chances or (), tests, results, strict=False))
        ):
            ended = reading.join(Branch((chance,), 1.0), (test, result, ended))
    elif until is not None:
        for result in results:
            if not _seen(result):
                raise AnytimeError(
                    f"loop until {until} cannot see how good {result!r} is; "
                    "give its module an estimate=…"
                )
        for result in reversed(results[:-1]):
            ended = reading.join(Until(until), (result, ended))
    return ended


def parallel(*results: Any, processors: int | None = None) -> tuple[Any, ...]:
    """The same results, made at once: what only one of them needs runs beside the others.

    processors: how many there are, one for each result unless told; with fewer, the results are
    spread so that the last ends as early as can be.
    Raises AnytimeError outside a program, for fewer than two results or processors below 1.
    """
    reading = _reading("parallel")
    if len(results) < 2 or len(set(map(id, results))) < len(results):
        raise AnytimeError("parallel takes two different results or more")
    for result in results:
        _result("parallel", "a result", result)
    count = len(results) if processors is None else processors
    if count < 1:
        raise AnytimeError(f"processors={count}; give 1 or more")
    reading.parallels.append(Parallel(tuple(result.label for result in results), count))
    return results


@dataclass(frozen=True)
class Output:
    """One of several results of a program, what it is worth and by when it is wanted."""

    result: Any
    weight: float
    deadline: float


def output(result: Any, *, weight: float = 1.0, deadline: float = math.inf) -> Output:
    """One of several results that a program returns: `return output(a, weight=2), output(b)`.

    weight: what its quality counts among the others'. deadline: seconds from the start, after
    which it is worth nothing. [Boddy & Dean 1994, deliberation scheduling]
    """
    _result("output", "its result", result)
    return Output(result, weight, deadline)


def several(reading: Reading, returned: Sequence[object]) -> Join:
    """The one node of a program that returns several results."""
    outputs = [r if isinstance(r, Output) else output(r) for r in returned]
    rule = Several(tuple(o.weight for o in outputs), tuple(o.deadline for o in outputs))
    return reading.join(rule, tuple(o.result for o in outputs))


def _tests(name: str, tests: Sequence[Any], chances: Sequence[float], everyone: bool) -> Any:
    reading = _reading(name)
    if len(tests) < 2 or len(chances) != len(tests):
        raise AnytimeError(f"{name} takes two tests or more, and as many chances")
    rule = Tests(tuple(map(float, chances)), everyone)
    return reading.join(rule, tuple(_test(name, test) for test in tests))


def _reading(name: str) -> Reading:
    opened = calling.current.get()
    if not isinstance(opened, Reading):
        raise AnytimeError(
            f"{name} is called in a function decorated with @compiler.program, nowhere else"
        )
    return opened


def _result(name: str, what: str, value: object) -> None:
    if not isinstance(value, Call | Join):
        raise AnytimeError(f"{name}: {what} is {value!r}; give the result of a module")
    if isinstance(value, Join) and isinstance(value.rule, Tests):
        raise AnytimeError(f"{name}: {what} is {value!r}, a test; use it in a branch")


def _test(name: str, value: Any) -> Source:
    if not isinstance(value, Input | Call | Join):
        raise AnytimeError(
            f"{name} on {value!r}; give the result of a module or an input of the program"
        )
    if isinstance(value, Join) and isinstance(value.rule, Tests):
        raise AnytimeError(f"{name} of {value!r}; give its tests themselves")
    return value


def _seen(node: Call | Join) -> bool:
    return all(call.module.estimate is not None for call in makers(node))
