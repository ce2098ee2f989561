"""pytest fixtures over `monitor.testing`; say `pytest_plugins = ["monitor.fixtures"]`."""

from __future__ import annotations

import pytest

from monitor.testing import CHECKS, Check


@pytest.fixture(params=CHECKS, ids=lambda check: check.__name__)
def robot_check(request: pytest.FixtureRequest) -> Check:
    """Each check of a robot in turn: `robot_check(make, plan, speed=1.0)`."""
    return request.param
