"""Other learners are what their authors say: by hand, by their fixed points, by their theorems."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_lib import agent
from homing_lib.agent import AGENTS
from homing_lib.errors import UserError
from homing_lib.sarsa import Diverged, LinearSarsa
from homing_lib.settings import Settings
from homing_lib.study import methods  # noqa: F401, so that settings know them by name
from homing_lib.study.methods.base import COST
from homing_lib.study.methods.lambda_greedy import LambdaGreedySarsa, greedy_lambda
from homing_lib.study.methods.natural_actor_critic import ActorCritic
from homing_lib.study.methods.recursive_least_squares import RecursiveLeastSquares
from homing_lib.study.methods.residual_gradient import ResidualGradient
from homing_lib.study.methods.scaled_conjugate_gradient import ScaledConjugateGradient, minimised
from homing_lib.study.methods.step_size_bound import BoundedSarsa
from homing_lib.study.methods.swift_sarsa import DECAY, LEAST, META, SwiftSarsa
from homing_lib.study.methods.tdc import TDC
from homing_lib.study.methods.true_online import TrueOnlineSarsa

NO_TRACE = {"lambda_rule": "fixed:0"}


def path(steps, n=3, actions=2, seed=0):
    """Features, actions and rewards of a random path: one more of the first two than steps."""
    rng = np.random.default_rng(seed)
    return rng.random((steps + 1, n)), rng.integers(actions, size=steps + 1).tolist(), rng.normal(size=steps)


def on(phi, action, actions=2):
    """phi(s, a), one vector."""
    x = np.zeros((actions, len(phi)))
    x[action] = phi
    return x.ravel()


def drive(learner, phi, action, reward, ends=False):
    for t, r in enumerate(reward):
        learner.learn(phi[t], action[t], float(r), phi[t + 1], action[t + 1], ends and t == len(reward) - 1)
    return learner.weights.ravel()


# --- True online ------------------------------------------------------------------------------------------------------


def test_true_online_sarsa_has_the_weights_of_the_online_forward_view_after_every_step():
    """Each time all of the path is learnt anew, from returns that end where the robot is."""
    alpha, gamma, lam = 0.1, 0.9, 0.7
    phi, action, reward = path(6)
    x = [on(*step) for step in zip(phi, action, strict=True)]
    weights = [np.zeros(6)]
    for horizon in range(1, 7):
        w = np.zeros(6)
        for k in range(horizon):
            returns = [
                sum(gamma**i * reward[k + i] for i in range(n)) + gamma**n * weights[k + n - 1] @ x[k + n]
                for n in range(1, horizon - k + 1)
            ]
            shares = [(1 - lam) * lam**n for n in range(len(returns) - 1)] + [lam ** (len(returns) - 1)]
            w = w + alpha * (np.dot(shares, returns) - w @ x[k]) * x[k]
        weights.append(w)
    learner = TrueOnlineSarsa(3, 2, step_size=alpha, discount=gamma, lambda_rule=f"fixed:{lam}", update="taken")
    for t in range(6):
        learner.learn(phi[t], action[t], float(reward[t]), phi[t + 1], action[t + 1], False)
        np.testing.assert_allclose(learner.weights.ravel(), weights[t + 1], rtol=1e-12)


# --- A bound on the step size -----------------------------------------------------------------------------------------


def test_the_bound_by_hand():
    """e = x = (1, 2), x' = (0, 1): |e.(x' - x)| = 3, so that a third of the error is taken, not ten times of it."""
    learner = BoundedSarsa(2, 1, step_size=10, discount=1, **NO_TRACE)
    learner.learn(np.array([1.0, 2.0]), 0, 6.0, np.array([0.0, 1.0]), 0, False)
    np.testing.assert_allclose(learner.weights, [[2, 4]], rtol=1e-15)
    learner.learn(np.array([0.1, 0.0]), 0, 1.0, np.array([0.0, 0.0]), 0, True)
    assert learner.bound == pytest.approx(1 / 3)


@given(st.integers(0, 1000), st.sampled_from(["taken", "all"]), st.sampled_from(["fixed:0.9", "fletcher-reeves"]))
def test_within_the_bound_no_step_overshoots_however_large_the_step_size(seed, update, rule):
    phi, action, reward = path(8, seed=seed)
    learner = BoundedSarsa(3, 2, step_size=1e3, discount=1, lambda_rule=rule, update=update)
    for t in range(8):
        steps = phi[t], action[t], float(reward[t]), phi[t + 1], action[t + 1], False
        delta = learner.learn(*steps)
        left = reward[t] + learner.weights[action[t + 1]] @ phi[t + 1] - learner.weights[action[t]] @ phi[t]
        assert abs(left - delta) <= abs(delta) * (1 + 1e-9)


# --- Gradients: where TD goes, and where the residual goes ------------------------------------------------------------

CHAIN = np.array([[1.0, 0.0], [0.5, 0.5], [0.2, 0.9]])
WAGES = (1.0, 0.0, 2.0)
"""Three states in a ring, two features, gamma = .8: values cannot be right, so that methods part."""


def around(learner, rounds):
    """The weights after so many rounds of the ring."""
    for step in range(3 * rounds):
        s, s_next = step % 3, (step + 1) % 3
        learner.learn(CHAIN[s], 0, WAGES[s], CHAIN[s_next], 0, False)
    return learner.weights[0]


def fixed_points():
    """Of TD, where the errors are orthogonal to the features, and of the residual, where their squares are least."""
    difference = CHAIN - 0.8 * np.roll(CHAIN, -1, axis=0)
    return np.linalg.solve(CHAIN.T @ difference, CHAIN.T @ WAGES), np.linalg.lstsq(difference, WAGES, rcond=None)[0]


def test_tdc_comes_to_the_fixed_point_of_td_and_the_residual_gradient_to_the_least_squares_of_errors():
    td, residual = fixed_points()
    assert np.abs(td - residual).max() > 0.1
    how = {"step_size": 0.05, "discount": 0.8, **NO_TRACE}
    np.testing.assert_allclose(around(TDC(2, 1, ratio=1, **how), 4000), td, atol=0.02)
    np.testing.assert_allclose(around(ResidualGradient(2, 1, **how), 4000), residual, atol=0.02)


def star(learner, sweeps):
    """Baird's star: seven states that all lead to the last, reward 0; the largest weight after so many sweeps."""
    phi = np.zeros((7, 8))
    phi[range(6), range(6)], phi[6, 6], phi[:6, 7], phi[6, 7] = 2, 1, 1, 2
    learner.weights[0, 6] = 10
    for _ in range(sweeps):
        for s in range(7):
            learner.learn(phi[s], 0, 0.0, phi[6], 0, False)
    return np.abs(phi @ learner.weights[0]).max()


def test_on_bairds_star_td_diverges_and_the_two_gradients_do_not():
    """As the sources show it, at gamma = .99."""
    how = {"step_size": 0.01, "discount": 0.99, "initial_weight": 1.0, **NO_TRACE}
    start = star(LinearSarsa(8, 1, **how), 0)
    assert star(LinearSarsa(8, 1, **how), 1000) > 1e6 * start
    assert star(TDC(8, 1, ratio=10, **how), 1000) < start / 5
    assert star(ResidualGradient(8, 1, **how), 1000) < start / 5


def test_tdc_by_hand():
    """Two steps at alpha = .1, beta = .2: the first has no correction yet."""
    learner = TDC(1, 2, ratio=2, step_size=0.1, discount=0.5, **NO_TRACE)
    learner.learn(np.array([1.0]), 0, 2.0, np.array([1.0]), 1, False)  # delta 2: w0 = .2, h0 = .4
    np.testing.assert_allclose([*learner.weights[:, 0], *learner.h], [0.2, 0, 0.4, 0])
    learner.learn(np.array([1.0]), 0, 0.0, np.array([2.0]), 1, False)  # delta -.2: w0 -= .02, w1 -= .1 * .4 * 1
    np.testing.assert_allclose([*learner.weights[:, 0], *learner.h], [0.18, -0.04, 0.4 + 0.2 * -0.6, 0])


# --- The actor-critic -------------------------------------------------------------------------------------------------


def test_the_actor_critic_by_hand():
    """One feature, two actions, alpha = .1, beta = .05: pi = (.5, .5), psi of the second = (-.5, .5), delta = 1."""
    learner = ActorCritic(1, 2, ratio=0.5, step_size=0.1, discount=1, **NO_TRACE)
    learner.learn(np.ones(1), 1, 1.0, np.ones(1), 0, True)
    np.testing.assert_allclose([*learner.v, *learner.w[:, 0]], [0.1, -0.05, 0.05])
    np.testing.assert_allclose(learner.weights[:, 0], [-0.0025, 0.0025])
    share = 1 / (1 + np.exp(-0.005))
    assert learner.policy(np.ones(1)) == pytest.approx([1 - share, share])


def test_the_natural_gradient_is_the_advantage_of_the_actions_and_the_actor_goes_along_it():
    """Two states, each with two actions, of which the second pays 1: an advantage of a half either way."""
    rng = np.random.default_rng(0)
    learner = ActorCritic(2, 2, ratio=1e-12, step_size=0.02, discount=1, **NO_TRACE)
    actor = ActorCritic(2, 2, ratio=1, step_size=0.05, discount=1, **NO_TRACE)
    for state in rng.integers(2, size=3000):
        phi, action = np.eye(2)[state], int(rng.random() < 0.5)
        learner.learn(phi, action, float(action), phi, 0, True)
        action = int(rng.random() < actor.policy(phi)[1])
        actor.learn(phi, action, float(action), phi, 0, True)
    np.testing.assert_allclose(learner.w, [[-0.5, -0.5], [0.5, 0.5]], atol=0.05)
    assert min(actor.policy(phi)[1] for phi in np.eye(2)) > 0.9


# --- Scaled conjugate gradient ----------------------------------------------------------------------------------------


@given(st.integers(0, 1000), st.integers(2, 6))
def test_scaled_conjugate_gradient_is_at_the_minimum_of_a_quadratic_after_n_directions(seed, n):
    """Moller's theorem, for the least squares of more steps than weights; the scale of 1e-6 is all that is left."""
    rng = np.random.default_rng(seed)
    inputs = np.concatenate([rng.normal(size=(n + 3, n)), np.eye(n)])
    targets = rng.normal(size=len(inputs))
    least = np.linalg.lstsq(inputs, targets, rcond=None)[1][0]

    def above(directions):
        return np.square(inputs @ minimised(np.zeros(n), inputs, targets, directions) - targets).sum() - least

    assert above(n) < 1e-6 * above(0)
    assert above(n) < above(n - 1) < above(0)


def test_scaled_conjugate_gradient_by_hand():
    """Two orthogonal inputs of lengths 1 and 2, targets 1 and 2, no scale: r = (1, 4), so that the first step is
    17 / 65; then r = (48, -12) / 65.
    """
    inputs, targets = np.diag([1.0, 2.0]), np.array([1.0, 2.0])
    np.testing.assert_allclose(minimised(np.zeros(2), inputs, targets, 1, 0.0), [17 / 65, 68 / 65])
    np.testing.assert_allclose(minimised(np.zeros(2), inputs, targets, 2, 0.0), [1, 1])
    np.testing.assert_allclose(minimised(np.zeros(2), inputs, targets, 1, 3.0), [17 / 116, 68 / 116])


def test_a_batch_is_learnt_when_it_is_over_its_targets_held_fixed():
    """Three steps of one batch: enough directions meet all targets, under the weights as they were."""
    phi, action, reward = path(3, n=4, actions=1)
    learner = ScaledConjugateGradient(
        4, 1, batch=3, directions=4, step_size=1, discount=0.9, initial_weight=1, **NO_TRACE
    )
    drive(learner, phi[:3], action[:3], reward[:2])
    assert (learner.weights == 1).all()
    learner.learn(phi[2], 0, float(reward[2]), phi[3], 0, False)
    np.testing.assert_allclose(phi[:3] @ learner.weights[0], reward + 0.9 * phi[1:].sum(axis=1), atol=1e-4)


# --- lambda-greedy ----------------------------------------------------------------------------------------------------


def test_the_greedy_lambda_by_hand():
    by_hand = {(2, 4): 0.5, (1, 3): 0.25, (3, -1): 1, (0, 5): 0, (0, 0): 1}
    assert [greedy_lambda(*both) for both in by_hand] == [*by_hand.values()]


def test_lambda_greedy_by_hand_over_two_steps():
    """One feature of 1, gamma = .5, alpha = .1. Step 1, reward 1: the return's error is 1, so that all three weights
    become .1; before, both values of the next state were 0: lambda 0.
    """
    learner = LambdaGreedySarsa(1, 1, step_size=0.1, discount=0.5, lambda_rule="fixed:0", update="all")
    returns, variance = learner.returns.weights[0], learner.variance.weights[0]
    learner.learn(np.ones(1), 0, 1.0, np.ones(1), 0, False)
    assert (returns[0], variance[0], learner.weights[0, 0]) == pytest.approx((0.1, 0.1, 0.1))
    assert learner._lambda_next == 0
    returns[0] = 0.5
    learner.learn(np.ones(1), 0, 0.0, np.ones(1), 0, False)
    # error = .5 (.5) - .5 = -.25 with e = 1.5; variance: .0625 + .25 (.1) - .1 = -.0125 with e = 1.25
    assert returns[0] == pytest.approx(0.5 - 0.1 * 0.25 * 1.5)
    assert variance[0] == pytest.approx(0.1 - 0.1 * 0.0125 * 1.25)
    expected = 0.4**2 / (0.4**2 + variance[0])
    learner.learn(np.ones(1), 0, 0.0, np.ones(1), 0, False)
    assert learner.lambda_ == pytest.approx(expected)
    learner.begin_episode()
    learner.learn(np.ones(1), 0, 0.0, np.ones(1), 0, False)
    assert (learner.lambda_, learner.returns.trace[0], learner.variance.trace[0]) == (0, 1, 1)


# --- Least squares ----------------------------------------------------------------------------------------------------


def test_recursive_least_squares_has_the_weights_of_the_system_solved_at_once():
    phi, action, reward = path(40)
    x = np.array([on(*step) for step in zip(phi, action, strict=True)])
    ahead = 0.9 * x[1:]
    ahead[-1] = 0
    left = np.eye(6) / 0.5 + x[:-1].T @ (x[:-1] - ahead)
    batch = np.linalg.solve(left, np.full(6, 2.0) / 0.5 + x[:-1].T @ reward)
    learner = RecursiveLeastSquares(3, 2, step_size=0.5, discount=0.9, initial_weight=2, **NO_TRACE)
    np.testing.assert_allclose(drive(learner, phi, action, reward, ends=True), batch, atol=1e-8)


# --- Swift-Sarsa ------------------------------------------------------------------------------------------------------


class WrittenOut:
    """Swift-Sarsa as its paper writes it, for a path that begins in one step and goes on: all vectors at once."""

    def __init__(self, size, lam, alpha, eta, weights):
        self.w, self.b = np.full(size, weights), np.full(size, np.log(alpha))
        names = ("z", "z_delta", "w_delta", "h", "h_old", "h_temp", "z_bar", "p")
        vars(self).update({name: np.zeros(size) for name in names})
        self.lam, self.eta, self.v_delta, self.v_old = lam, eta, 0.0, 0.0

    def learn(self, x, reward, gamma):
        v = self.w @ x
        delta = reward + gamma * v - self.v_old
        on = self.z != 0  # those with a trace
        self.w_delta = np.where(on, delta * self.z - self.z_delta * self.v_delta, self.w_delta)
        self.w += np.where(on, self.w_delta, 0)
        self.b += np.where(on, META / np.exp(self.b) * (delta - self.v_delta) * self.p, 0)
        self.b = np.where(on, np.clip(self.b, np.log(LEAST), np.log(self.eta)), self.b)
        self.h_old = np.where(on, self.h, self.h_old)
        self.h = np.where(on, self.h_temp + delta * self.z_bar - self.z_delta * self.v_delta, self.h)
        self.h_temp = np.where(on, self.h, self.h_temp)
        self.z_delta = np.where(on, 0, self.z_delta)
        for trace in (self.z, self.p, self.z_bar):
            trace *= gamma * self.lam
        self.v_old = v
        here = x != 0
        tau, b = np.exp(self.b) @ x**2, self.z @ x
        self.v_delta = self.w_delta @ x
        gain = min(1, self.eta / tau)
        self.z_delta = np.where(here, gain * np.exp(self.b) * x, self.z_delta)
        if gain < 1:
            for name in ("h_temp", "h", "h_old", "z_bar"):
                setattr(self, name, np.where(here, 0, getattr(self, name)))
            self.b += np.log(DECAY) * x**2
        self.z += np.where(here, self.z_delta * (1 - b), 0)
        self.p += self.h_old * x
        self.z_bar += np.where(here, self.z_delta * (1 - b - self.z_bar * x), 0)
        temp = self.h - self.h_old * x * (self.z - self.z_delta) - self.h * x * self.z_delta
        self.h_temp = np.where(here, temp, self.h_temp)


@pytest.mark.parametrize("eta", [0.02, 0.5])
def test_swift_sarsa_is_what_its_paper_says_also_from_weights_of_1(eta):
    """With weights in front, and a bound that is met at every step (.02) or never. The package has 32-bit numbers."""
    pytest.importorskip("swiftsarsa")
    phi, action, reward = path(12)
    learner = SwiftSarsa(3, 2, eta=eta, step_size=0.02, discount=0.9, lambda_rule="fixed:0.8", initial_weight=1)
    written = WrittenOut(6, 0.8, 0.02, eta, weights=1.0)
    written.learn(on(phi[0], action[0]), 0.0, 0.9)
    for t in range(12):
        learner.learn(phi[t], action[t], float(reward[t]), phi[t + 1], action[t + 1], False)
        written.learn(on(phi[t + 1], action[t + 1]), reward[t], 0.9)
        np.testing.assert_allclose(learner.value_list(phi[t]), written.w.reshape(2, 3) @ phi[t], rtol=2e-5)


def test_swift_sarsa_learns_the_last_step_and_clears_its_traces():
    """At home and where an episode is cut."""
    pytest.importorskip("swiftsarsa")
    one = np.ones(1)
    learner = SwiftSarsa(1, 2, eta=0.9, step_size=0.1, discount=1, lambda_rule="fixed:0.9")
    learner.learn(one, 0, 1.0, one, 1, True)
    assert learner.value_list(one) == pytest.approx([0.1, 0])
    learner.begin_episode()
    learner.learn(one, 1, 1.0, one, 1, False)
    before = learner.value_list(one)
    assert before[0] == pytest.approx(0.1)  # no trace is left of it
    learner.begin_episode()
    learner.learn(one, 0, 1.0, one, 0, True)
    assert learner.value_list(one)[1] == pytest.approx(before[1], abs=0.02)


def test_without_its_package_or_a_fixed_lambda_swift_sarsa_says_so_in_one_line(monkeypatch):
    settings = Settings(images="compact", controller="swift-sarsa:0.5")
    monkeypatch.setitem(sys.modules, "swiftsarsa", SimpleNamespace(SwiftSarsa=None))
    with pytest.raises(UserError, match="needs a fixed lambda") as varies:
        agent.run(settings, 1)
    monkeypatch.setitem(sys.modules, "swiftsarsa", None)
    with pytest.raises(UserError, match="pip install swiftsarsa") as absent:
        agent.run(settings, 1)
    assert not any("\n" in str(error.value) for error in (varies, absent))


# --- All --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted({name.partition(":")[0]: name for name in COST}.values()))
def test_every_method_drives_the_robot_and_a_seed_fixes_its_path(name):
    if "swift" in name:
        pytest.importorskip("swiftsarsa")
    settings = Settings(
        images="compact", episodes=2, max_steps=40, controller=name, lambda_rule="fixed:0.8", update="all", alpha0=1e-4
    )
    first, second = (agent.run(settings, 3) for _ in range(2))
    assert name in AGENTS
    assert first.lengths.sum() > 40
    assert not first.diverged
    np.testing.assert_array_equal(first.steps, second.steps)
    assert np.ptp(first.column("delta")) > 0


def test_weights_that_leave_the_finite_numbers_are_told_as_divergence():
    learner = ResidualGradient(1, 1, step_size=1e9, discount=1, initial_weight=1, **NO_TRACE)
    with np.errstate(all="ignore"), pytest.raises(Diverged):
        for _ in range(100):
            learner.learn(np.ones(1), 0, 2.0, np.zeros(1), 0, False)
