"""Section III.H: when is a view similar enough to the snapshot to stop?"""

from math import pi, sqrt
from typing import NamedTuple


class Thresholds(NamedTuple):
    """Similarities (NRB, in [0, 1]) that end an episode (`upper`) and that mean "home at perspective" (`lower`)."""

    upper: float
    lower: float


def linear(multiplier: float) -> float:
    """First printed form: 1 - 1 / sqrt(m pi), the multiple of pi inside the root."""
    return 1 - 1 / sqrt(_positive(multiplier) * pi)


def square_root(multiplier: float) -> float:
    """Second printed form, used by eq. (19): 1 - 1 / (pi sqrt(m)), which changes more finely with m."""
    return 1 - 1 / (pi * sqrt(_positive(multiplier)))


def stopping_thresholds(multiplier: float, band: float = 1.0) -> Thresholds:
    """Eq. (19): upper from `multiplier`, lower from `multiplier - band`. The paper's 12 and 1 give .9081 and .9040.

    Table I prints the two in the opposite order; eq. (19) and section III.D fix which is which.
    """
    return Thresholds(upper=square_root(multiplier), lower=square_root(multiplier - band))


def _positive(multiplier: float) -> float:
    if not multiplier > 0:
        raise ValueError(f"multiplier = {multiplier}: must be greater than 0 (eq. 19)")
    return multiplier
