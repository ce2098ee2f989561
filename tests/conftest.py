"""What all tests share: Hypothesis without a clock, and the same examples every time; a home of
their own for what missions teach."""

import pytest
from hypothesis import settings

settings.register_profile("laws", deadline=None, derandomize=True)
settings.load_profile("laws")


@pytest.fixture(scope="session", autouse=True)
def home_of_lessons(tmp_path_factory):
    """One for all processes of a run, and never the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ANYTIME_CACHE", str(tmp_path_factory.getbasetemp().parent / "cache"))
        yield
