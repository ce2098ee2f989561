"""Problems to measure planners on: every kind of floor, and all our planners can be measured."""

from itertools import islice

import numpy as np
import pytest

import anytime
from planners import ara, atp, paper_atp
from planners.problems import KINDS, SIZES, known_floors, walked_quality


def test_every_kind_and_size_comes_in_turn_with_a_name_of_its_own():
    floors = list(islice(known_floors(np.random.default_rng(0)), len(KINDS) * len(SIZES)))
    assert len({floor.name for floor in floors}) == len(floors)
    assert {floor.free.shape[0] for floor in floors} == set(SIZES)


def test_equal_generators_yield_equal_floors():
    one, two = (next(known_floors(np.random.default_rng(7))) for _ in range(2))
    assert one.name == two.name
    assert (one.free == two.free).all()


@pytest.mark.parametrize("module", [atp.find_path, ara.find_path], ids=["atp", "ara"])
def test_a_completed_plan_on_a_known_floor_is_walked_as_short_as_can_be(module):
    floor = next(known_floors(np.random.default_rng(1)))
    result = anytime.run(module, floor.domain, floor.start, floor.goal, seconds=60.0)
    assert walked_quality(result.value, floor) == pytest.approx(1.0)


@pytest.mark.parametrize("module", [atp.find_path, ara.find_path, paper_atp.find_path])
def test_planners_name_problems_that_they_can_be_measured_on(module):
    floors = list(islice(module.problems(np.random.default_rng(2)), 2))
    clock = anytime.WorkClock(anytime.Machine("here").with_rate(module.name, 1e-6))
    library = anytime.measure(module, floors, seconds=1.0, clock=lambda: clock)
    assert library[module.name].mean(1.0) > 0.5
