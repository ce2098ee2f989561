"""The shape of a program: what is run in which order, what only sometimes, and what at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from anytime.errors import AnytimeError
from anytime.joins import Best, Branch, Several
from anytime.programs import Call, Input, Join, Parallel, Program

Node = Call | Join


@dataclass(frozen=True)
class Group:
    """Calls in arms. Of a branch one arm alone is run; of a parallel all at once.

    label: unique in its program. arms: labels of the calls of each. processors: that the arms
    share; 0 for a branch.
    """

    label: str
    arms: tuple[frozenset[str], ...]
    processors: int

    @property
    def calls(self) -> frozenset[str]:
        return frozenset().union(*self.arms)


@dataclass(frozen=True)
class Arm:
    """One arm of one group: where in the program a call stands."""

    group: str
    index: int
    processors: int


def behind(node: object) -> frozenset[Node]:
    """A node and every node that it depends on."""
    found, pending = set[Node](), [node]
    while pending:
        one = pending.pop()
        if isinstance(one, Call | Join) and one not in found:
            found.add(one)
            pending += one.arguments
    return frozenset(found)


def only_for(program: Program, join: Join) -> tuple[frozenset[str], ...]:
    """For each argument of a join, the labels of the calls that nothing else needs."""
    return tuple(
        _private(program, place, join.arguments, join) for place in range(len(join.arguments))
    )


def _parallels(program: Program) -> list[Group]:
    """A parallel whose results go to several arms of a later one is over when that begins."""
    by_label = {node.label: node for node in program.nodes}
    found: list[Group] = []
    over: list[frozenset[str]] = []  # of each, all that is behind its results
    for count, parallel in enumerate(program.parallels, start=1):
        results = tuple(by_label[label] for label in parallel.labels)
        arms = [_private(program, place, results, None) for place in range(len(results))]
        for earlier, before in zip(found, over, strict=True):
            if sum(bool(arm & earlier.calls) for arm in arms) > 1:
                arms = [arm - before for arm in arms]
        found.append(Group(f"parallel {count}", tuple(arms), parallel.processors))
        over.append(frozenset(node.label for result in results for node in behind(result)))
    return found


def within(program: Program, group: Group) -> frozenset[Node]:
    """The calls of a group, and the joins of their results: between them, and of nothing else."""
    calls = frozenset(node for node in program.nodes if node.label in group.calls)
    above = frozenset().union(*(behind(call) for call in calls))
    found = {node for node in above if behind(node) & calls}
    for node in program.nodes:  # in order: what a node is made from comes before it
        made_from = [a for a in node.arguments if isinstance(a, Call | Join)]
        if isinstance(node, Join) and made_from and found.issuperset(made_from):
            found.add(node)
    return frozenset(found)


def outlets(program: Program, inside: frozenset[Node]) -> list[Node]:
    """Those of some nodes that others are made from, or the program's output is, in order."""
    used = {a for node in program.nodes if node not in inside for a in node.arguments}
    used.add(program.output)
    return [node for node in program.nodes if node in inside and node in used]


def groups(program: Program) -> tuple[Group, ...]:
    """The branches and parallels of a program, from the outermost in.

    Raises AnytimeError for two that cut each other.
    """
    found: list[Group] = []
    for node in program.nodes:
        if isinstance(node, Join) and isinstance(node.rule, Branch):
            arms = only_for(program, node)[len(node.rule.tests) :]
            if all(arms):
                found.append(Group(node.label, arms, 0))
    found += _parallels(program)
    found.sort(key=lambda group: -len(group.calls))
    for place, inner in enumerate(found):
        for outer in found[:place]:
            apart = not inner.calls & outer.calls
            if not apart and not any(inner.calls <= arm for arm in outer.arms):
                raise AnytimeError(
                    f"{inner.label} and {outer.label} share {_some(inner.calls & outer.calls)} "
                    "and neither is within one arm of the other; use all results of a parallel "
                    "in the same arm of a branch"
                )
    return tuple(found)


def outermost(program: Program) -> tuple[Group, ...]:
    """The parallels of a program that stand in no other parallel."""
    found: list[Group] = []
    for group in groups(program):
        if group.processors and not any(group.calls <= other.calls for other in found):
            found.append(group)
    return tuple(found)


def answers(program: Program) -> tuple[tuple[Join, frozenset[str], bool], ...]:
    """For each arm of a branch with one test: the branch, the arm's own calls, and the answer at
    which they are run."""
    branches = [
        node
        for node in program.nodes
        if isinstance(node, Join) and isinstance(node.rule, Branch) and len(node.rule.tests) == 1
    ]
    return tuple(
        (node, labels, answer)
        for node in branches
        for labels, answer in zip(only_for(program, node)[1:], (True, False), strict=True)
    )


def paths(program: Program) -> dict[str, tuple[Arm, ...]]:
    """For each call, the arms that it stands in, from the outermost in."""
    found: dict[str, tuple[Arm, ...]] = {call.label: () for call in program.calls}
    for group in groups(program):
        for index, arm in enumerate(group.arms):
            for label in arm:
                found[label] += (Arm(group.label, index, group.processors),)
    return found


def apart(one: Sequence[Arm], other: Sequence[Arm]) -> bool:
    """Whether two calls with these paths are in different arms of one group."""
    arms = {arm.group: arm.index for arm in other}
    return any(arms.get(arm.group, arm.index) != arm.index for arm in one)


def due(program: Program) -> dict[str, float]:
    """For each call that a result with a deadline of its own needs, the earliest, in seconds."""
    return {
        node.label: deadline
        for node, deadline in _urgencies(program.output).items()
        if isinstance(node, Call) and deadline < float("inf")
    }


def in_order(
    name: str,
    inputs: tuple[str, ...],
    output: Node,
    parallels: Sequence[Parallel],
    made: list[Node],
) -> Program:
    """The program of an output, its nodes in the order in which they are run.

    That is the order of their making, except that a test comes before what it decides about, a
    parallel after all that its arms need, and a result with an earlier deadline before others.
    """
    used = behind(output)
    left = [node for node in made if node in used]
    program = Program(name, inputs, tuple(left), output, tuple(parallels))
    before: dict[Node, set[Node]] = {
        node: {a for a in node.arguments if isinstance(a, Call | Join)} for node in left
    }
    by_label = {node.label: node for node in left}
    for node in left:
        if isinstance(node, Join):
            _after_their_test(program, node, by_label, before)
    for group in groups(program):
        if group.processors:
            inside = within(program, group)
            needed = {n for node in inside for n in before[node]} - inside
            for label in group.calls:
                before[by_label[label]] |= needed
    urgency = _urgencies(output)
    left.sort(key=lambda node: urgency.get(node, float("inf")))  # stable: else as they were made
    ordered: list[Node] = []
    while left:
        ready = next(node for node in left if before[node] <= set(ordered))
        left.remove(ready)
        ordered.append(ready)
    return Program(name, inputs, tuple(ordered), output, tuple(parallels))


def _private(
    program: Program, place: int, arguments: Sequence[object], owner: Join | None
) -> frozenset[str]:
    """Labels of the calls behind one of several arguments that nothing else needs.

    owner: the join that alone may use the argument itself; None where anybody may.
    """
    argument = arguments[place]
    if isinstance(argument, Input):
        return frozenset()
    kept = set(behind(argument))
    for other, rival in enumerate(arguments):
        if other != place:
            kept -= behind(rival)
    while True:
        users = {node: {user for user in program.nodes if node in user.arguments} for node in kept}
        lost = {
            node
            for node, by in users.items()
            if not (node is argument and owner is None) and not by <= kept | ({owner} - {None})
        }
        if not lost:
            return frozenset(node.label for node in kept if isinstance(node, Call))
        kept -= lost


def _after_their_test(
    program: Program, join: Join, by_label: dict[str, Node], before: dict[Node, set[Node]]
) -> None:
    """What only some arguments need waits for the first, which decides whether they are made."""
    first = join.arguments[0]
    if isinstance(join.rule, Several | Best) or isinstance(first, Input):
        return
    for labels in only_for(program, join)[1:]:
        for label in labels:
            before[by_label[label]].add(first)


def _urgencies(output: Node) -> dict[Node, float]:
    """The earliest deadline of the results that each node is needed for."""
    if not isinstance(output, Join) or not isinstance(output.rule, Several):
        return {}
    found: dict[Node, float] = {}
    for argument, deadline in zip(output.arguments, output.rule.deadlines, strict=True):
        for node in behind(argument):
            found[node] = min(deadline, found.get(node, float("inf")))
    return found


def _some(labels: frozenset[str]) -> str:
    return ", ".join(sorted(labels))
