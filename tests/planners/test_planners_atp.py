"""The abstract planner on maps of any kind: always a way, never a worse one, then the shortest."""

import copy
import gc
import hashlib
import itertools
import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime.errors import AnytimeError
from planners import Grid, astar, find_path, length_of, route, steps
from planners.blocks import UNKNOWN
from sensing import clustered, connected, instance, maze, rooms, uniform

KINDS = {
    "sparse": lambda shape, rng: uniform(shape, 0.1, rng),
    "dense": lambda shape, rng: uniform(shape, 0.36, rng),
    "clustered": lambda shape, rng: clustered(shape, 0.3, rng),
    "rooms": rooms,
    "maze": lambda shape, rng: maze(shape, rng, corridor=2),
    "squares": lambda shape, rng: squares(shape, rng),
    "combs": lambda shape, rng: combs(shape, rng),
}


def squares(shape, rng):
    """A floor of large squares, on which a short query goes beyond its first, small search."""
    side = int(rng.integers(4, 14))
    coarse = rng.random((shape[0] // side + 1, shape[1] // side + 1)) > rng.uniform(0.1, 0.6)
    return np.kron(coarse, np.ones((side, side)))[: shape[0], : shape[1]] > 0


def combs(shape, rng):
    """A floor of combs, on which ways over regions visit cells twice."""
    side, free = int(rng.integers(2, 7)), np.ones(shape, bool)
    free[::side] = free[:, ::side] = False
    return free | (rng.random(shape) < rng.uniform(0.2, 0.4))


@st.composite
def floors(draw, largest=150):
    """A floor of any kind and shape, and two of its free cells: (free, start, goal)."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(3, largest)), draw(st.integers(3, largest)))
    free = KINDS[draw(st.sampled_from(sorted(KINDS)))](shape, rng)
    free[rng.integers(shape[0]), rng.integers(shape[1])] = True
    cells = np.argwhere(free)
    start, goal = (tuple(cells[i].tolist()) for i in rng.integers(len(cells), size=2))
    return free, start, goal


def plans_of(taken):
    return [step.plan for step in taken if step.plan is not None]


def is_a_way(free, plan, start, goal, connectivity=8):
    """Whether a plan leads from neighbour to neighbour over free cells and cuts no corner."""
    cells = plan.plan[:, 1:]
    if tuple(cells[0]) != start or tuple(cells[-1]) != goal:
        return False
    for (row, column), (r, c) in itertools.pairwise(cells):
        if max(abs(r - row), abs(c - column)) != 1 or not free[r, c]:
            return False
        if (
            r != row
            and c != column
            and not (connectivity == 8 and free[row, c] and free[r, column])
        ):
            return False
    return bool(free[start])


@given(floors(), st.sampled_from([4, 8]))
@settings(max_examples=80)
def test_the_last_plan_is_the_shortest_or_says_that_there_is_none(floor, connectivity):
    free, start, goal = floor
    last = plans_of(steps(Grid.known(free), start, goal, connectivity=connectivity))[-1]
    best = astar(free, start, goal, connectivity)
    if best is None:
        assert math.isinf(last.length)
        assert len(last.plan) == 0
        assert not connected(free, start, goal)
        return
    assert last.length == pytest.approx(best.length, abs=1e-4 * best.length)
    assert last.estimate == 1.0


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (1, 9), (9, 1), (2, 2), (3, 5), (17, 31)])
def test_floors_of_odd_shapes_are_planned_on_be_they_free_or_blocked(shape):
    far = (shape[0] - 1, shape[1] - 1)
    last = plans_of(steps(Grid.known(np.ones(shape, bool)), (0, 0), far))[-1]
    diagonal, straight = min(far), max(far) - min(far)
    assert last.length == pytest.approx(math.sqrt(2) * diagonal + straight, rel=1e-4)
    blocked = np.zeros(shape, bool)
    blocked[0, 0] = blocked[far] = True
    last = plans_of(steps(Grid.known(blocked), (0, 0), far))[-1]
    near = max(far) <= 1 and min(far) == 0
    assert math.isfinite(last.length) == near


@given(floors(), st.sampled_from([4, 8]))
@settings(max_examples=80)
def test_every_plan_from_cell_to_cell_is_a_way_and_shorter_than_the_one_before(floor, connectivity):
    free, start, goal = floor
    best = astar(free, start, goal, connectivity)
    if best is None:
        return
    ways = plans_of(steps(Grid.known(free), start, goal, connectivity=connectivity))
    assert ways
    for plan in ways:
        assert is_a_way(free, plan, start, goal, connectivity)
        assert plan.length == pytest.approx(length_of(plan.plan[:, 1:]))
        quality = best.length / plan.length if plan.length else 1.0
        assert plan.estimate <= quality + 1e-4  # a proven bound
    lengths = [plan.length for plan in ways]
    assert lengths == sorted(lengths, reverse=True)
    assert len(set(lengths)) >= len(lengths) - 1  # only the last is told twice, when it is proven


@given(floors(largest=60), st.data())
@settings(max_examples=40)
def test_what_earlier_queries_found_out_changes_no_answer(floor, data):
    free, start, goal = floor
    grid, cells = Grid.known(free), np.argwhere(free)
    for _ in range(3):
        one, other = (
            data.draw(st.integers(0, len(cells) - 1)),
            data.draw(st.integers(0, len(cells) - 1)),
        )
        list(steps(grid, tuple(cells[one]), tuple(cells[other])))
    kept, new = (plans_of(steps(g, start, goal))[-1] for g in (grid, Grid.known(free)))
    assert kept.length == new.length


@given(floors(largest=90), st.data())
@settings(max_examples=40)
def test_a_map_that_changes_is_planned_on_as_it_is_now(floor, data):
    free, start, goal = floor
    grid = Grid((~free).astype(np.float32))
    list(steps(grid, start, goal))
    top, left = (data.draw(st.integers(0, size - 1)) for size in free.shape)
    height = data.draw(st.integers(1, free.shape[0] - top))
    width = data.draw(st.integers(1, free.shape[1] - left))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    changed = free.copy()
    changed[top : top + height, left : left + width] = rng.random((height, width)) > 0.3
    changed[start] = changed[goal] = True
    patch = changed[top : top + height, left : left + width]
    grid.update(top, left, (~patch).astype(np.float32))
    for cell in (start, goal):
        grid.update(*cell, np.zeros((1, 1), np.float32))
    last = plans_of(steps(grid, start, goal))[-1]
    best = astar(changed, start, goal)
    assert last.length == (math.inf if best is None else pytest.approx(best.length, rel=1e-4))


@pytest.mark.parametrize("family", ["r20", "r35", "rooms", "clustered", "maze"])
def test_large_maps_have_a_good_plan_long_before_the_shortest(family):
    free, start, goal = instance(family, 256, 1)
    best, spent, plans = astar(free, start, goal), 0.0, []
    for step in steps(Grid.known(free), start, goal):
        spent += step.work
        if step.plan is not None:
            plans.append((spent / best.expansions, best.length / step.plan.length))
    assert plans[0][0] < 0.3
    assert plans[0][1] > 0.85
    assert next(share for share, quality in plans if quality >= 0.97) < 0.8
    assert spent <= 1.6 * best.expansions
    assert plans[-1][1] == pytest.approx(1.0)


def test_a_believed_obstacle_is_dear_and_no_map_is_too_wrong_to_plan_on():
    free, start, goal = instance("r20", 128, 3)
    domain = np.where(free, np.float32(0.04), np.float32(0.96))
    domain[:, 60] = 0.96  # the map believes that nothing leads across
    domain[start] = domain[goal] = 0.0
    last = plans_of(steps(domain, start, goal))[-1]
    assert len(last.plan) > 0
    assert np.isfinite(last.length)
    dear = np.where(domain > 0.5, 97, 1).astype(np.uint8)
    assert last.length == pytest.approx(route(dear, start, goal).cost / 10_000, rel=1e-3)


def test_who_is_there_already_has_nothing_to_walk():
    last = plans_of(steps(np.zeros((9, 9), np.float32), (4, 4), (4, 4)))[-1]
    assert (last.length, last.estimate) == (0.0, 1.0)


def test_a_planner_in_the_middle_of_its_work_is_disturbed_by_no_other():
    free, start, goal = instance("rooms", 128, 2)
    grid = Grid.known(free)
    alone = [plan.plan.tobytes() for plan in plans_of(steps(Grid.known(free), start, goal))]
    beside = []
    for step in steps(grid, start, goal):
        next(steps(grid, goal, start)).work  # begun, and left alone
        if step.plan is not None:
            beside.append(step.plan.plan.tobytes())
    assert alone == beside


def test_no_step_is_long():
    free, start, goal = instance("rooms", 512, 0)
    assert max(step.work for step in steps(Grid.known(free), start, goal)) <= 5000


def test_as_an_anytime_module_it_counts_its_own_work():
    free, start, goal = instance("r20", 64, 1)
    domain = (~free).astype(np.float32)
    result = anytime.run(find_path, domain, start, goal, seconds=60.0)
    assert result.status.name == "COMPLETE"
    assert result.value.plan.tobytes() == plans_of(steps(domain, start, goal))[-1].plan.tobytes()


def test_a_known_map_may_be_given_as_bytes_of_0_and_1():
    free, start, goal = instance("rooms", 64, 0)
    as_bytes, as_bools = (
        plans_of(steps(Grid.known(kind), start, goal)) for kind in (free.astype(np.uint8), free)
    )
    assert [p.plan.tobytes() for p in as_bytes] == [p.plan.tobytes() for p in as_bools]


def test_mistakes_are_named():
    domain = np.zeros((9, 9), np.float32)
    with pytest.raises(AnytimeError, match=r"goal cell \(9, 0\) is outside"):
        list(steps(domain, (0, 0), (9, 0)))
    with pytest.raises(AnytimeError, match="connectivity is 6"):
        list(steps(domain, (0, 0), (8, 0), connectivity=6))
    domain[0, 0] = 1.0
    with pytest.raises(AnytimeError, match=r"start cell \(0, 0\) is blocked for certain"):
        list(steps(domain, (0, 0), (8, 8)))
    domain[0, 0] = np.nan
    with pytest.raises(AnytimeError, match=r"outside \[0, 1\]"):
        list(steps(domain, (1, 1), (8, 8)))
    with pytest.raises(AnytimeError, match="the domain is bool"):
        list(steps(np.ones((9, 9), bool), (1, 1), (8, 8)))
    with pytest.raises(AnytimeError, match="the domain is a str; give probabilities"):
        Grid("map")
    grid = Grid.known(np.ones((9, 9), bool))
    with pytest.raises(AnytimeError, match="the domain is bool"):
        grid.update(0, 0, np.ones((2, 2), bool))
    grid.update(0, 0, [[1.0, 0.0]])
    with pytest.raises(AnytimeError, match=r"the domain is \[3\], it must be \[height, width\]"):
        grid.update(0, 0, [0.0, 1.0, 0.0])
    with pytest.raises(AnytimeError, match="not all on the map of 9 rows"):
        grid.update(8, 8, np.zeros((2, 2), np.float32))
    with pytest.raises(AnytimeError, match="the map is known"):
        grid.update(0, 0, np.full((2, 2), 0.5, np.float32))
    with pytest.raises(AnytimeError, match="free holds 255: give bools"):
        Grid.known(np.full((9, 9), 255, np.uint8))


@given(st.integers(0, 2**32), st.integers(80, 200), st.integers(1, 9), st.booleans())
@settings(max_examples=60)
def test_corridors_of_one_block_across_are_planned_on_either_way(seed, length, width, upright):
    rng = np.random.default_rng(seed)
    free = rng.random((length, width)) > rng.uniform(0.05, 0.4)
    free = free if upright else np.ascontiguousarray(free.T)
    free[0, 0] = free[-1, -1] = True
    start, goal = (0, 0), (free.shape[0] - 1, free.shape[1] - 1)
    best, last = astar(free, start, goal), plans_of(steps(Grid.known(free), start, goal))[-1]
    assert last.length == (math.inf if best is None else pytest.approx(best.length, rel=1e-4))


def small_search_left():
    rng = np.random.default_rng(748)
    side = int(rng.integers(4, 14))
    rows, columns = int(rng.integers(70, 120)), int(rng.integers(70, 120))
    coarse = rng.random((rows // side + 1, columns // side + 1)) > rng.uniform(0.1, 0.6)
    return np.kron(coarse, np.ones((side, side)))[:rows, :columns] > 0


@pytest.mark.parametrize(
    ("free", "start", "goal", "connectivity"),
    [
        (small_search_left(), (45, 74), (98, 25), 8),
        (np.random.default_rng(47956).random((16, 32)) > 0.3, (0, 0), (15, 31), 8),
        (combs((96, 96), np.random.default_rng(2607)), (1, 1), (90, 94), 4),
    ],
    ids=["a small search that was not done", "a bucket passed over", "a way in a circle"],
)
def test_what_is_called_optimal_is(free, start, goal, connectivity):
    free[start] = free[goal] = True
    plans = plans_of(steps(Grid.known(free), start, goal, connectivity=connectivity))
    assert is_a_way(free, plans[-1], start, goal, connectivity)
    assert plans[-1].length == pytest.approx(astar(free, start, goal, connectivity).length)
    assert plans[-1].estimate == 1.0


def test_a_wall_that_is_certain_is_no_way_on_a_map_of_probabilities_either():
    free = np.ones((140, 140), bool)
    free[64:72] = False
    last = plans_of(steps(1.0 - free, (0, 0), (139, 139)))[-1]
    assert math.isinf(last.length)


def test_a_plan_on_a_map_that_has_changed_is_refused():
    free, start, goal = instance("rooms", 256, 0)
    grid = Grid.known(free)
    planning = steps(grid, start, goal)
    next(planning)
    grid.update(100, 100, np.ones((1, 1)))
    with pytest.raises(AnytimeError, match="the map has changed while a plan was made; plan anew"):
        list(planning)
    assert plans_of(steps(grid, start, goal))


def fingerprint(size):
    """Work and plans of a few problems, as a hash."""
    digest = hashlib.sha256()
    for family in ("r20", "rooms"):
        free, start, goal = instance(family, size, 0)
        for step in steps(Grid.known(free), start, goal):
            digest.update(repr(step.work).encode())
            if step.plan is not None:
                digest.update(step.plan.plan.tobytes() + repr(step.plan.length).encode())
    return digest.hexdigest()


def test_a_copy_of_a_map_knows_nothing_of_what_was_found_out_about_it():
    free, start, goal = instance("rooms", 96, 0)
    grid = Grid.known(free)
    unused = pickle.dumps(grid)
    first = plans_of(steps(grid, start, goal))[-1]
    assert pickle.dumps(grid) == unused
    for again in (copy.copy(grid), pickle.loads(unused)):
        assert (again.regions.count == UNKNOWN).all()
        assert plans_of(steps(again, start, goal))[-1].plan.tobytes() == first.plan.tobytes()


def test_a_new_map_knows_nothing_of_one_that_is_gone():
    grid = Grid.known(np.ones((40, 40), bool))
    plans_of(steps(grid, (0, 0), (39, 39)))
    left = [grid.regions]
    left[0].count[:] = 3
    del grid
    gc.collect()
    grid = Grid.known(np.ones((40, 40), bool))
    assert grid.regions is left.pop()
    assert (grid.regions.count == UNKNOWN).all()


def test_a_copy_of_a_map_may_change_alone():
    free, start, goal = instance("rooms", 96, 0)
    grid = Grid.known(free.copy())
    first = plans_of(steps(grid, start, goal))[-1]
    changed = copy.copy(grid)
    changed.update(40, 0, np.ones((1, free.shape[1])))
    assert plans_of(steps(grid, start, goal))[-1].plan.tobytes() == first.plan.tobytes()
    assert len(plans_of(steps(changed, start, goal))[-1].plan) == 0


def test_a_map_that_is_revived_shares_nothing_with_the_next():
    revived = []

    def robot(grid):
        try:
            yield from steps(grid, (0, 0), (95, 95))
        finally:
            revived.append(grid)

    holder = [robot(Grid.known(instance("rooms", 96, 1)[0]))]
    holder.append(holder)
    for _ in range(3):
        next(holder[0])
    del holder
    gc.collect()
    other = Grid.known(instance("rooms", 96, 2)[0])
    assert other.regions is not revived[0].regions


def elsewhere(size, **environment):
    """The fingerprint as another process computes it."""
    program = (
        "import importlib.util, sys\n"
        f"spec = importlib.util.spec_from_file_location('again', {__file__!r})\n"
        "again = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(again)\n"
        f"sys.stdout.write(again.fingerprint({size}))\n"
    )
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    found = subprocess.run(
        [sys.executable, "-c", program],
        cwd=root,
        env={**os.environ, "PYTHONPATH": root, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return found.stdout


def test_another_process_does_the_same_work_and_finds_the_same_plans():
    assert elsewhere(200) == fingerprint(200)


def test_the_kernels_mean_the_same_uncompiled():
    assert elsewhere(72, NUMBA_DISABLE_JIT="1") == fingerprint(72)
