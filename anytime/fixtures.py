"""pytest fixtures over `anytime.testing`; say `pytest_plugins = ["anytime.fixtures"]`.

No entry point loads them by itself: every pytest run in the environment would import us.
"""

from __future__ import annotations

import pytest

from anytime.testing import CHECKS, Check


@pytest.fixture(params=CHECKS, ids=lambda check: check.__name__)
def module_check(request: pytest.FixtureRequest) -> Check:
    """Each check of a module in turn: `module_check(module, problems, seconds=0.2)`."""
    return request.param
