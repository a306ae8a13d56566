"""What tests share: a skip where there is no camera, the paper's room and its home, a JavaScript engine, a browser, and
settings unlike the default."""

import re
import signal
import sys
from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import pytest

from homing_lib.atlas import camera_available
from homing_lib.errors import UserError
from homing_lib.features import HomeModel
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.survey import survey

if TYPE_CHECKING:
    from homing_lib.arena import Arena
    from tests.browser import Browser
    from tests.javascript import Engine

# Whoever is started in the background ignores Ctrl-C, and so would all that the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)


needs_camera = pytest.mark.skipif(not camera_available(), reason="needs PyBullet")
"""For tests whose own processes ask for the camera; those that do so themselves are skipped without it."""

FINDINGS = ROOT / "data" / "findings.json"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Iterator[None]:
    yield from _as_far_as_possible()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    yield from _as_far_as_possible()


def _as_far_as_possible() -> Iterator[None]:
    """Skipped is a test that meets the refusal of the camera where there is none, or data before they are made."""
    try:
        yield
    except UserError as error:
        if not camera_available() and "needs PyBullet" in str(error):
            pytest.skip("needs PyBullet")
        if not FINDINGS.exists() and re.match(rf"{re.escape(str(FINDINGS.parent))}\S+: missing", str(error)):
            pytest.skip("`make data` has not come to its end: there is no data/findings.json")
        raise


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    """Those that a test draws end with it; tests that draw none load no matplotlib."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def arena() -> Iterator["Arena"]:
    """The paper's room in PyBullet, under default settings."""
    from homing_lib.arena import Arena

    with Arena(PAPER, Settings()) as world:
        yield world


@pytest.fixture(scope="session")
def home_model(arena: "Arena") -> HomeModel:
    """What a robot knows of the paper's home after the default survey."""
    return survey(arena, Settings(), PAPER.home, np.random.default_rng(0))


@pytest.fixture(scope="module")
def engine() -> Iterator["Engine"]:
    """The demonstration's model in a JavaScript engine."""
    from tests.javascript import Engine

    with closing(Engine()) as engine:
        yield engine


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator["Browser"]:
    """One browser for all tests of a process: it takes its time to start."""
    from tests.browser import CHROMIUM, Browser

    if CHROMIUM is None:
        pytest.skip("needs Chromium (Debian: apt-get install chromium)")
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture
def browser(chromium: "Browser") -> Iterator["Browser"]:
    """That browser for the demonstration: whatever is done, the page does not complain and asks nobody for anything."""
    from tests.browser import DEMONSTRATION

    chromium.said.clear()
    chromium.asked.clear()
    chromium.resize(1280, 800)
    yield chromium
    chromium.open("about:blank")  # after which nothing of the page is noted in the next test
    assert chromium.said == []
    asked = {address.split("#")[0] for address in chromium.asked if not address.startswith("blob:")}
    assert asked <= {DEMONSTRATION, "about:blank", "data:,"}


_OTHER = {"lambda_rule": "fixed:0.5", "room": "attic", "atlas_heading_deg": 20, "snapshots": 3, "clear_way_m": 0.01}
_OTHER |= {"controller": "random"}


def other_value(name: str) -> Any:
    """A value of a setting other than its default: of those above, else the other choice, one more, or less."""
    field = Settings.model_fields[name]
    if name in _OTHER:
        return _OTHER[name]
    if isinstance(field.default, bool):
        return not field.default
    if choices := get_args(field.annotation):
        return next((choice for choice in choices if choice != field.default), field.default)
    return field.default + 1 if isinstance(field.default, int) else field.default * 0.9 or 0.01
