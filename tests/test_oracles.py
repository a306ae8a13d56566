"""Checks against what was not written here: the literature, the definitions, and another implementation."""

from itertools import pairwise

import numpy as np
import pytest
import swifttd

from homing_lib.lambdas import RULES, Fixed, hestenes_stiefel_printed
from homing_lib.sarsa import LinearSarsa
from homing_lib.study.theorem import beta, on_a_quadratic
from homing_lib.study.walk import VALUES, follow, walks
from homing_lib.td import LinearTD, TrueOnlineTD

FORMS = ("hestenes-stiefel", "fletcher-reeves", "polak-ribiere")

# 19-state random walk, root mean square error over the states, mean of the first 10 episodes and of 200 runs:
# Sutton & Barto (2018), figs 12.6 and 12.8, measured with their public code. The step sizes are the best of a grid.
#   lambda: (step size, error) of TD(lambda), and of true online TD(lambda)
WALK = {
    0: ((0.8, 0.3452), (0.8, 0.3452)),
    0.4: ((0.6, 0.2803), (0.8, 0.2788)),
    0.8: ((0.27, 0.2682), (0.4, 0.2573)),
    0.9: ((0.2, 0.2982), (0.2, 0.2794)),
    0.95: ((0.12, 0.3348), (0.2, 0.3138)),
    1: ((0.016, 0.4953), (0.03, 0.4890)),
}


def walk_error(learner, seed):
    """Root mean square over the states, mean of ten episodes."""
    errors = []
    for states in walks(seed):
        follow(learner, states)
        errors.append(np.sqrt(np.mean((learner.weights - VALUES) ** 2)))
    return np.mean(errors)


@pytest.mark.parametrize("cls", [LinearTD, TrueOnlineTD])
@pytest.mark.parametrize(("count", "lambdas"), [(20, (0, 0.8, 1)), pytest.param(200, WALK, marks=pytest.mark.slow)])
def test_the_random_walk_gives_the_errors_of_the_literature_and_lambda_of_point_8_the_least(cls, count, lambdas):
    # Two means, of so many runs and of 200 with this spread, differ by more than that once in 16,000 times.
    means = {}
    for lambda_ in lambdas:
        step_size, error = WALK[lambda_][cls is TrueOnlineTD]
        setting = {"step_size": step_size, "discount": 1.0, "lambda_rule": Fixed(lambda_)}
        errors = np.array([walk_error(cls(19, **setting), seed) for seed in range(count)])
        standard_error = errors.std(ddof=1) * np.sqrt(1 / count + 1 / 200)
        assert errors.mean() == pytest.approx(error, abs=4 * standard_error), lambda_
        assert standard_error < 0.02
        means[lambda_] = errors.mean()
    assert min(means, key=means.get) == 0.8 and means[0] < means[1]


@pytest.mark.parametrize(("cls", "lambda_"), [(LinearTD, 0), (LinearTD, 0.8), (TrueOnlineTD, 0.8)])
def test_the_fixed_point_of_the_boyan_chain_is_a_straight_line_from_minus_24_to_0(cls, lambda_):
    # Boyan (2002): from state 12 one or two states down at even odds for a reward of -3, from state 1 to state 0 for
    # -2; state 0 ends it. Four features interpolate between states 12, 8, 4 and 0.
    phi = np.maximum(0, 1 - np.abs(np.arange(13)[:, None] - [12, 8, 4, 0]) / 4)
    rng, learner = np.random.default_rng(7), cls(4, step_size=0.1, discount=1.0, lambda_rule=Fixed(lambda_))
    for k in range(1500):
        learner.begin_episode()
        learner.step_size = 0.1 * 50 / (50 + k)
        state = 12
        while state > 0:
            after = max(0, state - rng.choice((1, 2)))
            learner.update(phi[state], -3 if state > 1 else -2, phi[after], terminal=after == 0)
            state = after
    np.testing.assert_allclose(learner.weights, [-24, -16, -8, 0], atol=0.25)


@pytest.mark.parametrize("form", FORMS)
def test_unclipped_td_moves_along_the_conjugate_direction_of_the_textbook(form):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        phi, reward = rng.standard_normal((11, 6)), rng.standard_normal(10)
        learner = LinearTD(6, step_size=1e-3, discount=0.9, lambda_rule=RULES[form], clip=False)
        g_prev = p = np.zeros(6)
        for t in range(10):
            delta = learner.update(phi[t], reward[t], phi[t + 1])
            g = delta * phi[t]
            p = g + (beta(form, g, g_prev, p) if t else 0) * p
            assert np.linalg.norm(delta * learner.trace - p) <= 1e-12 * np.linalg.norm(p)
            g_prev = g


@pytest.mark.parametrize("seed", range(10))
def test_on_a_quadratic_with_exact_line_search_the_three_forms_coincide_with_the_minus_and_only_so(seed):
    # E3: along conjugate gradient, which reaches the minimum of n dimensions in n steps.
    rules = [*(RULES[form] for form in FORMS), hestenes_stiefel_printed]
    said, gradient = on_a_quadratic(rules, np.random.default_rng(seed), n=6)
    assert said.shape == (5, 4)
    np.testing.assert_allclose(said * [1, 1, 1, -1], said[:, :1] @ np.ones((1, 4)), rtol=1e-6)
    assert gradient < 1e-6


def episode_with_varying_lambda(seed, n=4, steps=12):
    """Features x_0..x_T, rewards r_1..r_T, and lambdas l_0..l_T, of which l_0 is never used."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((steps + 1, n)), rng.standard_normal(steps), rng.random(steps + 1)


def lambda_return(t, horizon, reward, lambdas, discount, value):
    """G_t^lambda cut off at the horizon, from its definition: a mean of the n-step returns, in which that of n steps
    has weight lambda_{t+1} ... lambda_{t+n-1} (1 - lambda_{t+n}) and the last what is left. value(k) is V(s_k)."""
    total, left = 0.0, 1.0
    for n in range(1, horizon - t + 1):
        n_step = sum(discount**k * reward[t + k] for k in range(n)) + discount**n * value(t + n)
        weight = left if t + n == horizon else left * (1 - lambdas[t + n])
        total += weight * n_step
        left -= weight
    return total


class Follow:
    """A rule that reads its lambdas from a list."""

    def __init__(self, lambdas):
        self.rest = iter(lambdas[1:])

    def __call__(self, **_):
        return next(self.rest)


@pytest.mark.parametrize("discount", [1.0, 0.8])
def test_with_frozen_weights_the_backward_view_equals_the_forward_view_of_a_varying_lambda(discount):
    for seed in range(5):
        x, reward, lambdas = episode_with_varying_lambda(seed)
        steps, theta, alpha = len(reward), np.random.default_rng(seed + 100).standard_normal(4), 0.1
        learner = LinearTD(4, step_size=alpha, discount=discount, lambda_rule=Follow(lambdas))
        backward = np.zeros(4)
        for t in range(steps):
            learner.weights[:] = theta
            learner.update(x[t], reward[t], x[t + 1], terminal=t == steps - 1)
            backward += learner.weights - theta

        def value(k, x=x, theta=theta, steps=steps):
            return 0.0 if k == steps else x[k] @ theta

        forward = sum(
            alpha * (lambda_return(t, steps, reward, lambdas, discount, value) - value(t)) * x[t] for t in range(steps)
        )
        np.testing.assert_allclose(backward, forward, rtol=0, atol=1e-10)


@pytest.mark.parametrize("discount", [1.0, 0.8])
def test_true_online_td_equals_the_online_forward_view_after_every_step(discount):
    # van Seijen et al. (2016): at each new horizon, redo all updates with the returns that it allows.
    for seed in range(5):
        x, reward, lambdas = episode_with_varying_lambda(seed)
        steps, alpha = len(reward), 0.1
        learner = TrueOnlineTD(4, step_size=alpha, discount=discount, lambda_rule=Follow(lambdas), initial_weight=0.5)
        online = [learner.weights.copy()]  # theta_t as known at time t

        def value(k, x=x, online=online, steps=steps):
            return 0.0 if k == steps else x[k] @ online[k - 1]

        for horizon in range(1, steps + 1):
            learner.update(x[horizon - 1], reward[horizon - 1], x[horizon], terminal=horizon == steps)
            theta = online[0].copy()
            for t in range(horizon):
                target = lambda_return(t, horizon, reward, lambdas, discount, value)
                theta += alpha * (target - x[t] @ theta) * x[t]
            online.append(theta)
            np.testing.assert_allclose(learner.weights, theta, rtol=0, atol=1e-10)


@pytest.mark.parametrize("lambda_", [0, 0.5, 0.9, 1])
def test_true_online_td_and_sarsa_agree_with_another_implementation_over_200_steps(lambda_):
    n, alpha, discount = 20, 0.01, 0.95
    rng = np.random.default_rng(42)
    x, reward = rng.random((201, n), np.float32), rng.standard_normal(200, np.float32)
    # Tuning off: no bound on the step (1e6), no decay, a step size that does not adapt.
    other = swifttd.SwiftTDNonSparse(n, lambda_, alpha, discount, 1e-12, 1e6, 1.0, 0.0, 1e-12)
    setting = {"step_size": alpha, "discount": discount, "lambda_rule": Fixed(lambda_)}
    td, sarsa = TrueOnlineTD(n, **setting), LinearSarsa(n, 1, **setting, traces="dutch")
    other.step(x[0], 0.0)
    for (x_t, x_next), r in zip(pairwise(x), reward, strict=True):
        # It is given a reward together with the state after it, and returns that state's value before learning.
        expected = other.step(x_next, r)
        assert td.value(x_next) == pytest.approx(expected, abs=1e-5)
        assert sarsa.values(x_next) == pytest.approx([expected], abs=1e-5)
        td.update(x_t, r, x_next)
        sarsa.update(x_t, 0, r, x_next, 0)
