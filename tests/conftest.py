import re
import signal
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

from homing_lib.atlas import camera_available
from homing_lib.environment import survey
from homing_lib.errors import UserError
from homing_lib.features import HomeModel
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import ROOT

if TYPE_CHECKING:
    from homing_lib.arena import Arena

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
        if not camera_available() and str(error).startswith("the camera needs PyBullet"):
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
