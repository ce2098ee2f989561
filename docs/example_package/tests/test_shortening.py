"""The package's module keeps the contract of anytime modules."""

from itertools import islice

import anytime
import numpy as np
from anytime_tours.shortening import shorten, some_places

pytest_plugins = ["anytime.fixtures"]
MACHINE = anytime.Machine("test").with_rate("shorten", 1e-3)


def clock():
    return anytime.WorkClock(MACHINE)


def test_shorten_conforms(module_check):
    problems = list(islice(some_places(np.random.default_rng(0)), 3))
    module_check(shorten, problems, seconds=0.2, clock=clock)
