"""Section III.I, eq. (20)-(23): a softmax and an epsilon-greedy policy, averaged, that explore less every episode.

All functions take and return plain sequences with one float per action: with three actions that is faster than
arrays, and as easy to read.
"""

from collections.abc import Sequence
from math import exp
from typing import Literal

import numpy as np

Mixture = Literal["normalised", "literal", "epsilon-greedy"]

_LARGEST = float(np.finfo(float).max)


def scaled(values: Sequence[float], *, literal: bool = False) -> list[float]:
    """Eq. (20), first line: every action value as a share of their sum.

    As printed (`literal=True`) the divisor is the sum itself, so that the preference is reversed where the sum is
    negative. Otherwise it is the sum of the magnitudes: the same number wherever all values are positive, and the
    order of the values everywhere. A divisor of zero gives zeros: no preference.
    """
    divisor = _total(values if literal else [abs(value) for value in values])
    return [value / divisor for value in values] if divisor else [0.0] * len(values)


def softmax(preferences: Sequence[float], temperature: float) -> list[float]:
    """Eq. (20), second line, divided by its sum so that it is a distribution. `temperature` is the paper's tau."""
    top = max(preferences)
    return _shares([exp((preference - top) / temperature) for preference in preferences])


def _shares(weights: list[float]) -> list[float]:
    total = _total(weights)
    return [weight / total for weight in weights]


def _total(values: Sequence[float]) -> float:
    """One after the other; Python's `sum` rounds otherwise from version 3.12 on, and a run would not be the same."""
    total = 0.0
    for value in values:
        total += value
    return total


def epsilon_greedy(values: Sequence[float], epsilon: float) -> list[float]:
    """Eq. (21): 1 - epsilon + epsilon/|A| for the best action (the first of equals), epsilon/|A| for the others."""
    probabilities = [epsilon / len(values)] * len(values)
    probabilities[values.index(max(values))] += 1 - epsilon
    return probabilities


def action_probabilities(
    values: Sequence[float], *, epsilon: float, temperature: float, mixture: Mixture
) -> list[float]:
    """Eq. (22): the probability of every action.

    - `literal`: as printed, exp(Scaled/tau) plus the epsilon-greedy share, divided by the sum of both. While the three
      values are about alike (theta_0 = 1) the best gets at most about 46 % at tau = 1, even without exploration; at
      tau <= .03 epsilon has no effect.
    - `normalised`: the softmax is made a distribution first, so that the two components weigh the same.
    - `epsilon-greedy`: eq. (21) alone.
    """
    greedy = epsilon_greedy(values, epsilon)
    if mixture == "epsilon-greedy":
        return greedy
    if mixture == "normalised":
        soft = softmax(scaled(values), temperature)
        return [(s + g) / 2 for s, g in zip(soft, greedy, strict=True)]
    preferences = [min(max(value / temperature, -_LARGEST), _LARGEST) for value in scaled(values, literal=True)]
    top = max(0.0, *preferences)  # a common factor of numerator and denominator, taken out against overflow
    return _shares([exp(p - top) + g * exp(-top) for p, g in zip(preferences, greedy, strict=True)])


def sample(probabilities: Sequence[float], rng: np.random.Generator) -> int:
    """Draw an action: the first whose cumulative probability exceeds one uniform number."""
    remaining = rng.random()
    for action, probability in enumerate(probabilities):
        remaining -= probability
        if remaining < 0:
            return action
    return len(probabilities) - 1


def decrease_rate(episode: int, first_episode: float) -> float:
    """Eq. (23): (ep_0 + 1) / (ep_0 + episode), the factor on alpha_0, epsilon_0 and tau_0 in `episode` (1, 2, ...).

    The paper calls the decrease exponential; it is hyperbolic: 1, .467 at the ninth and .269 at the 20th episode for
    ep_0 = 6.
    """
    return (first_episode + 1) / (first_episode + episode)
