"""Eq. (19) and the two forms of the interval that are printed."""

from math import pi, sqrt

import pytest

from homing_lib.thresholds import linear, square_root, stopping_thresholds


def test_the_published_multiplier_gives_the_upper_threshold_and_one_less_the_lower():
    upper, lower = stopping_thresholds(12)
    assert (round(upper, 4), round(lower, 4)) == (0.9081, 0.9040)
    assert stopping_thresholds(12, 8) == (square_root(12), square_root(4))


@pytest.mark.parametrize(
    ("multiplier", "first", "second"),
    [
        (1 / pi, 0, 1 - 1 / sqrt(pi)),  # m pi = 1; pi sqrt(m) = sqrt(pi)
        (4 / pi, 1 / 2, 1 - 1 / (2 * sqrt(pi))),
        (1 / pi**2, 1 - sqrt(pi), 0),
        (4, 1 - 1 / (2 * sqrt(pi)), 1 - 1 / (2 * pi)),
    ],
)
def test_both_printed_forms_are_those_worked_by_hand(multiplier, first, second):
    assert linear(multiplier) == pytest.approx(first, abs=1e-12)
    assert square_root(multiplier) == pytest.approx(second, abs=1e-12)


@pytest.mark.parametrize("multiplier", [0, -1, float("nan")])
@pytest.mark.parametrize("form", [linear, square_root, stopping_thresholds])
def test_a_multiplier_that_is_not_positive_is_refused(form, multiplier):
    with pytest.raises(ValueError, match=r"multiplier = .* greater than 0"):
        form(multiplier)
