"""What all tests share: Hypothesis without a clock, and the same examples every time; a home of
their own for what missions teach; a browser."""

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A headless Chromium; skips where there is none."""
    pytest.importorskip("websockets")
    place = Path(__file__).with_name("chromium.py")
    spec = importlib.util.spec_from_file_location("chromium_for_tests", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if module.executable() is None:
        pytest.skip("no Chromium is installed: the page cannot be looked at")
    browser = module.Browser()
    yield browser
    browser.close()
