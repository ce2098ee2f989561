"""ATP: every plan can be executed, later ones are not believed longer, and bytes repeat."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import anytime
from anytime.errors import AnytimeError
from planners import astar, blind_quality, blind_walk, textbook_astar
from planners.paper_atp import find_path, steps
from sensing import clustered, connected, instance, maze, rooms, uniform

FLOORS = {
    "uniform": lambda shape, rng: uniform(shape, 0.2, rng),
    "dense": lambda shape, rng: uniform(shape, 0.36, rng),
    "clustered": lambda shape, rng: clustered(shape, 0.3, rng),
    "rooms": rooms,
    "maze": lambda shape, rng: maze(shape, rng, corridor=2),
}


@st.composite
def problems(draw):
    """A domain that may be wrong about its floor, of any kind and shape."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(3, 70)), draw(st.integers(3, 70)))
    free = FLOORS[draw(st.sampled_from(sorted(FLOORS)))](shape, rng)
    free[rng.integers(shape[0]), rng.integers(shape[1])] = True
    cells = np.argwhere(free)
    start, goal = (tuple(cells[i].tolist()) for i in rng.integers(len(cells), size=2))
    domain = (~free).astype(np.float32)
    if draw(st.booleans()):
        domain = np.abs(domain - rng.random(shape, np.float32) * 0.6)
        domain[start] = domain[goal] = 0.1
    return free, domain, start, goal


@given(problems(), st.sampled_from([None, 0, 1, 3, 5]))
@settings(max_examples=100, deadline=None)
def test_every_plan_is_executable_and_none_is_believed_longer_than_the_last(problem, level):
    free, domain, start, goal = problem
    taken = list(steps(domain, start, goal, highest_level=level, grain=1))
    assert taken[0].plan is not None
    assert all(step.work > 0 or step.plan is not None for step in taken)
    plans = [step.plan for step in taken if step.plan is not None]
    lengths = [plan.length for plan in plans]
    assert lengths[:-1] == sorted(lengths[:-1], reverse=True)
    # Only a plan without abstraction may be believed longer: of that one the length is known.
    assert len(plans) == 1 or lengths[-1] <= lengths[-2] or plans[-1].level == 0
    for plan in plans:
        assert 0.0 <= plan.estimate <= 1.0
        assert (plan.estimate > 0.0) == (len(plan.plan) > 0) or start == goal
        assert sum(len(piece.cells) for piece in plan.segments) == len(plan.plan)
        assert all(0.0 <= piece.obstacleness <= 1.0 for piece in plan.segments)
    for plan in (plans[0], plans[len(plans) // 2], plans[-1]):
        assert blind_walk(free, plan.plan, start, goal).reached == connected(free, start, goal)


@given(problems())
@settings(max_examples=60, deadline=None)
def test_a_plan_without_abstraction_is_a_way_and_knows_its_length(problem):
    free, _, start, goal = problem
    plan = [step.plan for step in steps((~free).astype(np.float32), start, goal)][-1]
    if plan is None or plan.level > 0 or start == goal or not connected(free, start, goal):
        return
    walked = blind_walk(free, plan.plan, start, goal)
    assert walked.length <= plan.length + 1e-3
    assert plan.length <= astar(free, start, goal).length / plan.estimate + 1e-3


def test_the_paper_s_figures_hold_on_its_own_kind_of_floor():
    quality, first, work = [], [], []
    for index in range(30):
        free, start, goal = instance("r20", 128, index)
        taken = list(steps((~free).astype(np.float32), start, goal))
        plans = [step.plan.plan for step in taken if step.plan is not None]
        best = astar(free, start, goal)
        least = min(best.expansions, textbook_astar(free, start, goal).expansions)
        quality.append(blind_quality(free, plans[-1], start, goal, best.length))
        first.append(blind_quality(free, plans[0], start, goal, best.length))
        work.append(sum(step.work for step in taken) / least)
    assert np.mean(quality) >= 0.93
    assert np.mean(work) <= 0.27
    assert abs(np.mean(first) - 0.82) <= 0.03


def test_segments_keep_their_length_whatever_their_level():
    free, start, goal = instance("r20", 128, 0)
    plans = [step.plan for step in steps((~free).astype(np.float32), start, goal) if step.plan]
    sizes = [len(piece.cells) for plan in plans for piece in plan.segments]
    assert max(sizes) <= 2 * np.median(sizes)


def test_as_an_anytime_module_it_counts_its_own_work():
    free, start, goal = instance("r20", 64, 1)
    domain = (~free).astype(np.float32)
    result = anytime.run(find_path, domain, start, goal, seconds=60.0)
    assert result.status.name == "COMPLETE"
    last = [step.plan for step in steps(domain, start, goal) if step.plan][-1]
    assert result.value.plan.tobytes() == last.plan.tobytes()


def test_believed_obstacles_are_dear_and_certain_ones_impassable():
    domain = np.zeros((9, 9), np.float32)
    domain[:, 4] = 0.95
    crossing = next(steps(domain, (4, 0), (4, 8), highest_level=0)).plan
    assert crossing.level == 0
    assert len(crossing.plan) > 0
    domain[:, 4] = 1.0
    nothing = next(steps(domain, (4, 0), (4, 8), highest_level=0)).plan
    assert len(nothing.plan) == 0
    assert (nothing.length, nothing.estimate) == (float("inf"), 0.0)


def test_a_search_between_two_steps_changes_nothing():
    free, start, goal = instance("r20", 64, 2)
    domain = (~free).astype(np.float32)
    alone = [step.plan.plan.tobytes() for step in steps(domain, start, goal) if step.plan]
    beside = []
    for step in steps(domain, start, goal):
        astar(np.ones((90, 90), bool), (0, 0), (89, 40))
        if step.plan:
            beside.append(step.plan.plan.tobytes())
    assert alone == beside


def test_mistakes_are_named():
    domain = np.zeros((9, 9), np.float32)
    with pytest.raises(AnytimeError, match=r"goal cell \(9, 0\) is outside"):
        list(steps(domain, (0, 0), (9, 0)))
    domain[0, 0] = 1.0
    with pytest.raises(AnytimeError, match=r"start cell \(0, 0\) is blocked for certain"):
        list(steps(domain, (0, 0), (8, 8)))
    domain[0, 0] = np.nan
    with pytest.raises(AnytimeError, match=r"outside \[0, 1\]"):
        list(steps(domain, (1, 1), (8, 8)))
    with pytest.raises(AnytimeError, match="highest_level is 99"):
        list(steps(domain, (1, 1), (8, 8), highest_level=99))
    with pytest.raises(AnytimeError, match="grain is -1"):
        list(steps(domain, (1, 1), (8, 8), grain=-1))


def fingerprint(size):
    """Work, plans and walks of a few problems, as a hash."""
    digest = hashlib.sha256()
    for family in ("r20", "rooms"):
        free, start, goal = instance(family, size, 0)
        digest.update(astar(free, start, goal).cells.tobytes())
        for step in steps((~free).astype(np.float32), start, goal, grain=1):
            digest.update(repr(step.work).encode())
            if step.plan is not None:
                walked = blind_walk(free, step.plan.plan, start, goal)
                digest.update(step.plan.plan.tobytes() + walked.cells.tobytes())
                digest.update(repr((step.plan.length, walked.expansions)).encode())
    return digest.hexdigest()


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
    assert elsewhere(48) == fingerprint(48)


def test_the_kernels_mean_the_same_uncompiled():
    assert elsewhere(24, NUMBA_DISABLE_JIT="1") == fingerprint(24)
