"""The office that ships with the project."""

from pathlib import Path

import numpy as np

import experiments
from experiments.office import GOAL, START, draw
from sensing import connected, read_map

SHIPPED = Path(experiments.__file__).parent / "data" / "office.yaml"


def test_the_files_that_ship_are_what_the_script_draws():
    assert read_map(SHIPPED) == draw()


def test_there_is_room_to_walk_and_all_of_it_can_be_reached():
    office = draw()
    assert office.shape == (160, 240)
    assert 0.75 <= office.free_share <= 0.82
    assert all(
        connected(office.free, START, (int(row), int(column)))
        for row, column in np.argwhere(office.free)[::997]
    )


def test_the_way_is_long():
    down, right = abs(GOAL[0] - START[0]), abs(GOAL[1] - START[1])
    assert max(down, right) + (2**0.5 - 1) * min(down, right) >= 250


def test_several_routes_lead_to_the_goal():
    free = draw().free
    for closed in ((38, 100, 46, 102), (106, 100, 114, 102), (73, 100, 79, 102)):
        top, left, bottom, right = closed
        barred = free.copy()
        barred[top:bottom, left:right] = False
        assert connected(barred, START, GOAL)
