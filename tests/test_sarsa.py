import numpy as np
import pytest

from homing_lib.lambdas import Fixed, lambda_spec
from homing_lib.sarsa import Diverged, LinearQ, LinearSarsa
from homing_lib.td import LinearTD, TrueOnlineTD

RULES = ("fixed:0.7", "hestenes-stiefel", "fletcher-reeves", "polak-ribiere")


def make(cls=LinearSarsa, n=2, actions=2, rule="fletcher-reeves", **changes):
    return cls(n, actions, **{"step_size": 0.1, "discount": 1.0} | of_lambda(rule) | changes)


def of_lambda(text):
    """A learner's settings from the name of a rule."""
    _, rule, on_zero, clip = lambda_spec(text)
    return {"lambda_rule": rule, "on_zero": on_zero, "clip": clip}


def random_stream(seed, n=6, actions=3, steps=40):
    """Features x_0..x_T, actions a_0..a_T and rewards r_1..r_T of one episode."""
    rng = np.random.default_rng(seed)
    return rng.random((steps + 1, n)), rng.integers(actions, size=steps + 1), rng.standard_normal(steps)


def feed(learner, stream):
    """Run a stream through a learner, its last step terminal; yield after each step."""
    x, a, r = stream
    learner.begin_episode()
    for t in range(len(r)):
        learner.update(x[t], a[t], r[t], x[t + 1], a[t + 1], terminal=t == len(r) - 1)
        yield t


# Worked by hand: theta = 1, gamma = 1, alpha = .1, form 2


@pytest.mark.parametrize(("update", "other_action"), [("taken", 1.1), ("all", 1.104)])
def test_two_steps_of_fig_2_are_those_worked_by_hand(update, other_action):
    learner = make(initial_weight=1.0, update=update)
    # Q(s, 0) = 1, Q(s', 1) = 2
    assert learner.update([1, 0], 0, 0, [0, 2], 1) == pytest.approx(1)
    np.testing.assert_allclose(learner.weights, [[1.1, 1], [1, 1]])
    # Q(s, 1) = 2, Q(s', 0) = 2.1; lambda = .1 * 4 / (1 * 1); e(0) = .4 (1, 0), e(1) = (0, 2)
    assert learner.update([0, 2], 1, 0, [1, 1], 0) == pytest.approx(0.1)
    assert learner.lambda_ == pytest.approx(0.4)
    np.testing.assert_allclose(learner.trace, [[0.4, 0], [0, 2]])
    np.testing.assert_allclose(learner.weights, [[other_action, 1], [1, 1.02]])


@pytest.mark.parametrize(("bootstrap", "delta", "theta"), [(False, -1.0, [0.9, 0.9]), (True, 0.0, [1.0, 1.0])])
def test_the_last_step_takes_the_value_after_it_as_zero_unless_it_bootstraps_as_printed(bootstrap, delta, theta):
    learner = make(initial_weight=1.0, bootstrap_terminal=bootstrap)
    # Q(s, 0) = 2, Q(s', 1) = 1 or 0 by definition
    assert learner.update([1, 1], 0, 1, [1, 0], 1, terminal=True) == pytest.approx(delta)
    np.testing.assert_allclose(learner.weights, [theta, [1, 1]])


def test_after_a_terminal_step_no_next_state_or_action_is_needed():
    assert make(initial_weight=1.0).update([1, 1], 0, 1, None, None, terminal=True) == -1
    with pytest.raises(ValueError, match=r"next_action must be an integer in 0\.\.1, got None"):
        make(bootstrap_terminal=True).update([1, 1], 0, 1, [1, 1], None, terminal=True)


def test_replacing_traces_are_set_by_the_features_that_are_not_zero_and_decay_elsewhere():
    learner = make(n=3, rule="fixed:0.5", traces="replacing")
    learner.update([1, 0, 2], 0, 0, [0, 1, 0], 0)
    learner.update([0.25, 1, 0], 0, 0, [1, 0, 0], 1)
    np.testing.assert_allclose(learner.trace, [[0.25, 1, 1], [0, 0, 0]])
    learner.update([1, 0, 0], 1, 0, [1, 0, 0], 1)
    np.testing.assert_allclose(learner.trace, [[0.125, 0.5, 0.5], [1, 0, 0]])


# Sarsa is TD on state-action features


@pytest.mark.parametrize("rule", (*RULES, "hestenes-stiefel:printed:on_zero=0.5"))
@pytest.mark.parametrize(("traces", "cls"), [("accumulating", LinearTD), ("dutch", TrueOnlineTD)])
def test_sarsa_that_updates_all_actions_equals_td_on_state_action_features(traces, cls, rule):
    n, actions = 6, 3
    x, a, r = stream = random_stream(11)
    stacked = np.zeros((len(x), actions, n))
    stacked[np.arange(len(x)), a] = x
    stacked = stacked.reshape(len(x), -1)
    setting = {"step_size": 0.02, "discount": 0.9} | of_lambda(rule)
    sarsa = LinearSarsa(n, actions, **setting, traces=traces, update="all")
    td = cls(n * actions, **setting)
    for _ in range(3):
        td.begin_episode()
        for t in feed(sarsa, stream):
            td.update(stacked[t], r[t], stacked[t + 1], terminal=t == len(r) - 1)
            assert sarsa.lambda_ == pytest.approx(td.lambda_, rel=1e-9, abs=1e-12)
            np.testing.assert_allclose(sarsa.weights.ravel(), td.weights, rtol=1e-12, atol=1e-13)
            np.testing.assert_allclose(sarsa.trace.ravel(), td.trace, rtol=1e-12, atol=1e-13)


def test_the_printed_update_leaves_the_weights_of_the_other_actions_alone():
    learner = make(n=6, actions=3)
    x, a, _ = stream = random_stream(13)
    before = learner.weights.copy()
    for t in feed(learner, stream):
        others = np.arange(3) != a[t]
        np.testing.assert_array_equal(learner.weights[others], before[others])
        assert learner.change == pytest.approx(np.linalg.norm(learner.weights - before))
        before = learner.weights.copy()
    assert (before != 0).all() and len(x) > 40


def test_the_update_is_the_printed_one_by_default_and_the_exact_one_with_dutch_traces():
    assert [make(traces=traces).updates for traces in ("accumulating", "replacing", "dutch")] == [
        "taken",
        "taken",
        "all",
    ]
    assert make(traces="dutch", update="taken").updates == "taken"
    assert make(LinearQ).updates == "all"


def test_values_are_those_that_the_update_sees():
    learner = make(n=6, actions=3)
    x, a, r = stream = random_stream(14)
    for _ in feed(learner, stream):
        pass
    q, q_next = learner.values(x[0])[a[0]], learner.values(x[1])[a[1]]
    assert learner.update(x[0], a[0], r[0], x[1], a[1]) == r[0] + q_next - q
    assert learner.values(x[0]) == pytest.approx(learner.weights @ x[0])


@pytest.mark.parametrize("cls", [LinearSarsa, LinearQ])
def test_the_caller_may_use_its_feature_buffers_again(cls):
    x, a, r = random_stream(15)
    copied, shared = (make(cls, n=6, actions=3, rule="polak-ribiere") for _ in range(2))
    buffer, buffer_next = np.empty(6), np.empty(6)
    for t in range(len(r)):
        copied.update(x[t].copy(), a[t], r[t], x[t + 1].copy(), a[t + 1])
        buffer[:], buffer_next[:] = x[t], x[t + 1]
        shared.update(buffer, a[t], r[t], buffer_next, a[t + 1])
        buffer.fill(np.nan)
        np.testing.assert_array_equal(copied.weights, shared.weights)


def test_the_features_of_the_step_before_are_kept_and_not_overwritten_by_those_of_this_step():
    # Fig. 2 read literally copies phi_{t+1} into phi_t first, and so would find a ratio of norms of 1 here.
    learner = make(rule="fletcher-reeves:unclipped", discount=1.0)
    learner.update([1, 0], 0, 1, [0, 0], 0)
    learner.update([0, 3], 1, 1, [0, 0], 0)
    assert learner.lambda_ == pytest.approx(9)


# Watkins's Q(lambda)


def test_three_steps_of_watkins_q_are_those_worked_by_hand():
    learner = make(LinearQ, rule="fixed:1", step_size=0.5, discount=0.5)
    s0, s1 = np.eye(2)
    # Q(s1) = (0, 0): a tie, so any next action is best
    assert learner.update(s0, 0, 1, s1, 1) == 1
    np.testing.assert_allclose(learner.weights, [[0.5, 0], [0, 0]])
    # delta = 0 + .5 * max(.5, 0) - 0; e(0) = .5 (1, 0), e(1) = (0, 1); next action 1 is not the best: cut
    assert learner.update(s1, 1, 0, s0, 1) == pytest.approx(0.25)
    assert learner.lambda_ == 1
    np.testing.assert_allclose(learner.weights, [[0.5625, 0], [0, 0.125]])
    np.testing.assert_array_equal(learner.trace, np.zeros((2, 2)))
    # delta = 0 + .5 * max(0, .125) - 0, and no trace of what was before the cut
    assert learner.update(s0, 1, 0, s1, 1) == pytest.approx(0.0625)
    assert learner.lambda_ == 0
    np.testing.assert_allclose(learner.trace, [[0, 0], [1, 0]])
    np.testing.assert_allclose(learner.weights, [[0.5625, 0], [0.03125, 0.125]])


def test_the_end_of_an_episode_cuts_no_trace_even_right_after_a_cut():
    learner = make(LinearQ, rule="fixed:1", initial_weight=1.0)
    learner.weights[1] = 2.0
    learner.update([1, 0], 0, 0, [0, 1], 0)
    assert not learner.trace.any()
    learner.update([0, 1], 0, 0, None, None, terminal=True)
    np.testing.assert_array_equal(learner.trace, [[0, 1], [0, 0]])


@pytest.mark.parametrize("lambda_", [0, 0.6, 1])
def test_q_equals_watkins_tabular_algorithm_as_the_textbook_writes_it(lambda_):
    states, actions, alpha, gamma = 5, 3, 0.2, 0.9
    rng = np.random.default_rng(21)
    learner = make(LinearQ, n=states, actions=actions, rule=f"fixed:{lambda_}", step_size=alpha, discount=gamma)
    q, features, cuts = np.zeros((actions, states)), np.eye(states), 0
    for _ in range(20):
        learner.begin_episode()
        e = np.zeros_like(q)
        s, a = rng.integers(states), rng.integers(actions)
        for t in range(30):
            reward, s_next, a_next = rng.standard_normal(), rng.integers(states), rng.integers(actions)
            if rng.random() < 0.7:
                a_next = q[:, s_next].argmax()
            last = t == 29
            learner.update(features[s], a, reward, features[s_next], a_next, terminal=last)
            best = q[:, s_next].max()
            greedy = q[a_next, s_next] == best
            delta = reward + (0 if last else gamma * best) - q[a, s]
            e[a, s] += 1
            q += alpha * delta * e
            e = gamma * lambda_ * e if greedy else np.zeros_like(e)
            cuts += not greedy
            np.testing.assert_allclose(learner.weights, q, rtol=1e-12, atol=1e-13)
            s, a = s_next, a_next
    assert 50 < cuts < 550


@pytest.mark.parametrize("rule", RULES)
def test_q_learns_the_best_values_of_a_corridor_from_random_actions(rule):
    # States 0..4, left or right, -1 a step, out at the right end: Q(s, right) = s - 5, Q(s, left) one step worse.
    rng = np.random.default_rng(22)
    features, goal = np.eye(5), 5
    learner = make(LinearQ, n=5, rule=rule)
    for _ in range(600):
        learner.begin_episode()
        s, a = rng.integers(5), rng.integers(2)
        while s != goal:
            s_next, a_next = max(0, s + 2 * a - 1), rng.integers(2)
            phi_next = None if s_next == goal else features[s_next]
            learner.update(features[s], a, -1, phi_next, a_next, terminal=s_next == goal)
            s, a = s_next, a_next
    best = np.arange(5) - 5.0
    np.testing.assert_allclose(learner.weights[1], best, atol=0.05)
    np.testing.assert_allclose(learner.weights[0], best[[0, 0, 1, 2, 3]] - 1, atol=0.05)


# Refusals and divergence


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"traces": "forever"}, "unknown traces 'forever'; known: accumulating, replacing, dutch"),
        ({"update": "some"}, "unknown update 'some'; known: taken, all"),
        ({"actions": 0}, "at least 1"),
        ({"step_size": 0}, "step_size must be finite and greater than 0, got 0"),
        ({"step_size": "0.1"}, "step_size must be finite and greater than 0, got '0.1'"),
        ({"discount": "1"}, r"discount must lie in \[0, 1\], got '1'"),
        ({"discount": 2}, r"discount must lie in \[0, 1\], got 2"),
    ],
)
@pytest.mark.parametrize("cls", [LinearSarsa, LinearQ])
def test_a_setting_out_of_bounds_is_refused_with_its_value_and_the_bound(cls, settings, reason):
    with pytest.raises(ValueError, match=reason):
        make(cls, **settings)


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (([1, 2, 3], 0, 0, [1, 2], 0), r"phi must have shape \(2,\), got \(3,\)"),
        (([1, 2], 0, 0, [[1, 2]], 0), r"phi_next must have shape \(2,\), got \(1, 2\)"),
        (([1, 2], 2, 0, [1, 2], 0), "action must be an integer in 0..1, got 2"),
        (([1, 2], -1, 0, [1, 2], 0), "action must be an integer in 0..1, got -1"),
        (([1, 2], 0.5, 0, [1, 2], 0), "action must be an integer in 0..1, got 0.5"),
        (([1, 2], "0", 0, [1, 2], 0), "action must be an integer in 0..1, got '0'"),
        (([1, 2], 0, None, [1, 2], 0), "reward must be a finite number, got None"),
        (([1, 2], 0, 0, [1, 2], 5), "next_action must be an integer in 0..1, got 5"),
        (([np.nan, 2], 0, 0, [1, 2], 0), "phi must be finite"),
        (([1, 2], 0, 0, [np.inf, 2], 0), "phi_next must be finite"),
        (([1, 2], 0, np.inf, [1, 2], 0), "reward must be a finite number, got inf"),
    ],
)
@pytest.mark.parametrize("cls", [LinearSarsa, LinearQ])
def test_a_step_that_is_malformed_or_not_finite_is_refused_and_changes_nothing(cls, step, reason):
    learner = make(cls, initial_weight=1.0)
    with pytest.raises(ValueError, match=reason):
        learner.update(*step)
    np.testing.assert_array_equal(learner.weights, np.ones((2, 2)))
    np.testing.assert_array_equal(learner.trace, np.zeros((2, 2)))
    assert learner.steps == 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("traces", ["accumulating", "replacing", "dutch"])
@pytest.mark.parametrize("cls", [LinearSarsa, LinearQ])
def test_weights_that_leave_the_finite_numbers_raise_an_error_that_says_when_and_with_what(cls, traces):
    learner = make(cls, n=6, actions=3, lambda_rule=Fixed(0.9), step_size=3.0, traces=traces)
    x, a, r = random_stream(31)
    with np.errstate(all="raise"), pytest.raises(Diverged) as outcome:
        while learner.steps < 20_000:
            assert np.isfinite(learner.weights).all()
            t = learner.steps % 40
            learner.update(x[t], a[t], r[t], x[t + 1], a[t + 1])
    assert not np.isfinite(learner.weights).all()
    diverged = outcome.value
    assert (diverged.step, diverged.rule, diverged.step_size) == (learner.steps, "fixed:0.9", 3.0)
