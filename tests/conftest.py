import signal
from collections.abc import Iterator

import numpy as np
import pytest

from homing_lib.arena import Arena
from homing_lib.environment import survey
from homing_lib.features import HomeModel
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings

# Whoever is started in the background ignores Ctrl-C, and so would all that the tests start.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def arena() -> Iterator[Arena]:
    """The paper's room in PyBullet, under default settings."""
    with Arena(PAPER, Settings()) as world:
        yield world


@pytest.fixture(scope="session")
def home_model(arena: Arena) -> HomeModel:
    """What a robot knows of the paper's home after the default survey."""
    return survey(arena, Settings(), PAPER.home, np.random.default_rng(0))
