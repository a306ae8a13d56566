"""Eqs. (20)-(23): the two policies, their mixtures, drawing, and how exploration falls."""

from math import exp
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_lib.policy import Mixture, action_probabilities, decrease_rate, epsilon_greedy, sample, scaled, softmax

values = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3)
equal_values = st.sampled_from([1.7e308, -1.7e308, 5e-324, -5e-324, 0.0]).map(lambda value: [value] * 3)
positive = st.lists(st.floats(1e-3, 1e3), min_size=3, max_size=3)
epsilons = st.floats(0, 1)


@pytest.mark.parametrize("mixture", get_args(Mixture))
@given(values=values | equal_values, epsilon=epsilons, temperature=st.floats(5e-324, 1e300))
def test_probabilities_are_probabilities_for_any_finite_values_and_the_best_is_likeliest_unless_as_printed(
    mixture, values, epsilon, temperature
):
    p = action_probabilities(values, epsilon=epsilon, temperature=temperature, mixture=mixture)
    assert len(p) == 3
    assert all(0 <= x <= 1 for x in p)
    assert sum(p) == pytest.approx(1)
    assert mixture == "literal" or epsilon == 1 or max(p) == p[values.index(max(values))]


# Eq. (20)


def test_where_the_sum_is_negative_the_printed_formula_reverses_the_preference_and_the_guard_does_not():
    assert scaled([-1, -2, -5], literal=True) == [1 / 8, 2 / 8, 5 / 8]  # the worst value gets the largest share
    assert scaled([-1, -2, -5]) == [-1 / 8, -2 / 8, -5 / 8]


def test_where_the_sum_is_zero_there_is_no_preference():
    assert scaled([1, -1, 0], literal=True) == scaled([0, 0, 0]) == [0, 0, 0]
    assert scaled([1, -1, 0]) == [1 / 2, -1 / 2, 0]


@given(values=positive, temperature=st.floats(0.1, 10), shift=st.floats(-1e3, 1e3))
def test_a_softmax_is_its_formula_and_a_shift_of_all_values_does_not_change_it(values, temperature, shift):
    assert scaled(values) == scaled(values, literal=True) == pytest.approx([value / sum(values) for value in values])
    weights = [exp((value - max(values)) / temperature) for value in values]
    expected = [weight / sum(weights) for weight in weights]
    assert softmax(values, temperature) == pytest.approx(expected)
    assert softmax([value + shift for value in values], temperature) == pytest.approx(expected)


# Eq. (21)


def test_epsilon_greedy_gives_the_first_of_the_best_its_share_and_all_others_a_third_of_epsilon():
    assert epsilon_greedy([1, 3, 2], 0.3) == pytest.approx([0.1, 0.8, 0.1])
    assert epsilon_greedy([2, 2, 2], 0.3) == pytest.approx([0.8, 0.1, 0.1])


# Eq. (22)


def test_the_printed_policy_is_the_one_worked_by_hand():
    # Scaled .2, .3, .5; exp(Scaled / .5) + greedy; the sum of both is the divisor
    terms = [exp(0.4) + 0.1, exp(0.6) + 0.1, exp(1.0) + 0.8]
    p = action_probabilities([2, 3, 5], epsilon=0.3, temperature=0.5, mixture="literal")
    assert p == pytest.approx([term / sum(terms) for term in terms])


@given(values=values, epsilon=epsilons, temperature=st.floats(1e-3, 1e3))
def test_the_normalised_policy_is_the_mean_of_softmax_and_epsilon_greedy(values, epsilon, temperature):
    both = zip(softmax(scaled(values), temperature), epsilon_greedy(values, epsilon), strict=True)
    p = action_probabilities(values, epsilon=epsilon, temperature=temperature, mixture="normalised")
    assert p == pytest.approx([(s + g) / 2 for s, g in both])


def test_at_tau_one_the_printed_policy_gives_the_best_of_three_like_values_46_percent_without_any_exploration():
    # theta_0 = 1: every Q is about n NRB, so that each share is about a third
    p = action_probabilities([200, 200, 200.1], epsilon=0, temperature=1, mixture="literal")
    assert p == pytest.approx([0.269, 0.269, 0.462], abs=1e-3)


def test_at_tau_a_thirtieth_epsilon_has_no_effect_on_the_printed_policy():
    pure, exploring = (
        action_probabilities([200, 205, 210], epsilon=epsilon, temperature=0.03, mixture="literal")
        for epsilon in (0.0, 1.0)
    )
    assert pure == pytest.approx(exploring, abs=1e-4)


# Drawing, and eq. (23)


class Drawn:
    """A generator whose next number is known."""

    def __init__(self, number):
        self.number = number

    def random(self):
        return self.number


@pytest.mark.parametrize(
    ("probabilities", "number", "action"),
    [
        *(([0.2, 0.3, 0.5], *drawn) for drawn in ((0.0, 0), (0.19, 0), (0.2, 1), (0.49, 1), (0.5, 2), (0.999, 2))),
        ([0.0, 1.0, 0.0], 0.0, 1),  # one without probability, at either end
        ([0.5, 0.4, 0.1 - 1e-16], np.nextafter(1, 0), 2),  # rounding leaves the last
    ],
)
def test_an_action_is_the_first_whose_cumulative_probability_exceeds_the_number_drawn(probabilities, number, action):
    assert sample(probabilities, Drawn(number)) == action


def test_the_decrease_rate_is_one_at_first_then_hyperbolic():
    assert [round(decrease_rate(episode, 6), 3) for episode in (1, 9, 20)] == [1, 0.467, 0.269]
    # An exponential has a constant ratio from episode to episode.
    assert decrease_rate(2, 6) / decrease_rate(1, 6) == pytest.approx(7 / 8)
    assert decrease_rate(20, 6) / decrease_rate(19, 6) == pytest.approx(25 / 26)
