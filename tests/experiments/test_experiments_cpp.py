"""The C++ program makes the choices that our queries make, so that its speed can be compared."""

from __future__ import annotations

import pytest

from anytime.errors import AnytimeError
from experiments.benchmarks.replanning import sitting
from experiments.benchmarks.rivals import cpp_program
from planners.nao import STAND
from planners.query import Operators

OPERATORS = {
    "ours": Operators(),
    "paper": Operators.paper(),
    "islands": Operators(islands=4),
    "without dormant genes": Operators().without("dormant"),
    "without scouts": Operators().without("scouts"),
    "long": Operators(structure=1.0, immigrants=0.2),
}
SEEDS = range(5)


@pytest.fixture(scope="module", params=cpp_program.VARIANTS)
def program(request, tmp_path_factory):
    if cpp_program.compiler() is None:
        pytest.skip("g++ is not installed")
    return cpp_program.build(tmp_path_factory.mktemp("cpp"), request.param)


@pytest.fixture(scope="module")
def ours():
    """Ours for some operators, world and seed, made once for both variants."""
    made = {}

    def of(name, seed, **changed):
        key = (name, seed, *changed.items())
        if key not in made:
            made[key] = cpp_program.ours(
                sitting() | changed, OPERATORS[name], seed=seed, generations=30, warm_up=10
            )
        return made[key]

    return of


@pytest.mark.parametrize("name", OPERATORS)
def test_the_same_seed_makes_the_same_choices(program, ours, name):
    for seed in SEEDS:
        one = ours(name, seed)
        other = cpp_program.run(
            program, sitting(), OPERATORS[name], seed=seed, generations=30, warm_up=10
        )
        assert other.value.hex() == one.value.hex()
        assert (other.hash, other.evaluations) == (one.hash, one.evaluations)
        assert one.evaluations == 30 * (60 + round(60 * OPERATORS[name].scouts))


@pytest.mark.parametrize(
    "changed",
    [
        {"posture": 4, "elapsed": 2.5, "drift": 0.3, "heading": -0.7},
        {"collision": 1, "obstacle_count": 0},
        {"collision": 1, "goal_x": 0.5, "goal_y": 0.1},
    ],
)
def test_another_world_is_simulated_alike(program, ours, changed):
    for seed in SEEDS:
        one = ours("ours", seed, **changed)
        other = cpp_program.run(program, sitting() | changed, seed=seed, generations=30, warm_up=10)
        assert (other.value.hex(), other.hash) == (one.value.hex(), one.hash)


def test_tables_grow_alike(program):
    """Runs that ask for more choices than there is room for are invalid; then there is room."""
    world = {**sitting(), "goal_x": 9.0, "posture": STAND, "effort": 0.0}
    for seed in SEEDS:
        inputs = (world, OPERATORS["long"], 60, seed, 150)
        one, other = cpp_program.ours(*inputs), cpp_program.run(program, *inputs)
        assert (other.value.hex(), other.hash) == (one.value.hex(), one.hash)


def test_another_seed_makes_other_choices(program):
    hashes = {
        cpp_program.run(program, sitting(), seed=seed, generations=30, warm_up=0).hash
        for seed in SEEDS
    }
    assert len(hashes) == len(SEEDS)


def test_a_comparison_says_how_many_pairs_were_equal():
    if cpp_program.compiler() is None:
        pytest.skip("g++ is not installed")
    lines: list[str] = []
    made = cpp_program.compare(sitting(), pairs=2, generations=20, progress=lines.append)
    assert made.same == 1.0
    assert len(made.ratios) == len(lines) == 2
    assert min(made.ratios) <= made.ratio <= max(made.ratios)


def test_what_cannot_be_built_is_said_in_one_line(tmp_path, monkeypatch):
    with pytest.raises(AnytimeError, match="choose slots or tags"):
        cpp_program.build(tmp_path, "maps")
    monkeypatch.setattr(cpp_program, "compiler", lambda: None)
    with pytest.raises(AnytimeError, match="g\\+\\+ is not installed"):
        cpp_program.build(tmp_path)
