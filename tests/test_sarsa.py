"""The learner of Fig. 2, and what holds for all that are built on it."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_lib.lambdas import TAKES_AND_RETURNS, polak_ribiere
from homing_lib.sarsa import Diverged, LinearQ, LinearSarsa, decayed, dutch, td_error
from homing_lib.td import LinearTD, TrueOnlineTD

CONTROL = (LinearSarsa, LinearQ)
LEARNERS = (*CONTROL, LinearTD, TrueOnlineTD)
every_learner = pytest.mark.parametrize("cls", LEARNERS)


def make(cls=LinearSarsa, n=2, actions=2, rule="fletcher-reeves", **changes):
    shape = (n, actions) if cls in CONTROL else (n,)
    return cls(*shape, **{"step_size": 0.1, "discount": 1.0, "lambda_rule": rule} | changes)


def step(learner, phi, reward, phi_next, action=0, next_action=0, **how):
    """An update, whether or not the learner has actions."""
    if type(learner) in CONTROL:
        return learner.update(phi, action, reward, phi_next, next_action, **how)
    return learner.update(phi, reward, phi_next, **how)


def random_stream(seed, n=6, actions=3, steps=40):
    """Features x_0..x_T, actions a_0..a_T and rewards r_1..r_T of one episode."""
    rng = np.random.default_rng(seed)
    return rng.random((steps + 1, n)), rng.integers(actions, size=steps + 1), rng.standard_normal(steps)


def feed(learner, stream):
    """Run a stream through a learner, its last step terminal; yield after each step."""
    x, a, r = stream
    learner.begin_episode()
    for t in range(len(r)):
        step(learner, x[t], r[t], x[t + 1], a[t], a[t + 1], terminal=t == len(r) - 1)
        yield t


# Worked by hand


def test_the_equations_are_those_worked_by_hand():
    assert td_error(q_tm1=2.0, r_t=1.0, discount=0.5, q_t=4.0) == 1
    np.testing.assert_array_equal(decayed(np.array([4.0, 8.0]), 0.5, 0.25), [0.5, 1])
    # 1 - .5 (1 * 2 + 3 * 1) = -1.5
    np.testing.assert_array_equal(dutch(np.array([2.0, 1.0]), np.array([1.0, 3.0]), 0.5), [-3, -1.5])


@pytest.mark.parametrize(("update", "other_action"), [("taken", 1.1), ("all", 1.104)])
def test_two_steps_of_fig_2_are_those_worked_by_hand(update, other_action):
    learner = make(initial_weight=1.0, update=update)
    # Q(s, 0) = 1, Q(s', 1) = 2
    assert learner.update([1, 0], 0, 0, [0, 2], 1) == pytest.approx(1)
    np.testing.assert_allclose(learner.weights, [[1.1, 1], [1, 1]])
    # Q(s, 1) = 2, Q(s', 0) = 2.1; lambda = .1 * 4 / (1 * 1), of phi as it was: E12; e(0) = .4 (1, 0), e(1) = (0, 2)
    assert learner.update([0, 2], 1, 0, [1, 1], 0) == pytest.approx(0.1)
    assert learner.lambda_ == pytest.approx(0.4)
    np.testing.assert_allclose(learner.trace, [[0.4, 0], [0, 2]])
    np.testing.assert_allclose(learner.weights, [[other_action, 1], [1, 1.02]])
    np.testing.assert_allclose(learner.values([1, 2]), learner.weights @ [1, 2])


@pytest.mark.parametrize(("bootstrap", "delta", "theta"), [(False, -1.0, [0.9, 0.9]), (True, 0.0, [1.0, 1.0])])
def test_the_last_step_takes_the_value_after_it_as_zero_unless_it_bootstraps_as_printed(bootstrap, delta, theta):
    learner = make(initial_weight=1.0, bootstrap_terminal=bootstrap)
    # Q(s, 0) = 2, Q(s', 1) = 1 or 0 by definition
    assert learner.update([1, 1], 0, 1, [1, 0], 1, terminal=True) == pytest.approx(delta)
    np.testing.assert_allclose(learner.weights, [theta, [1, 1]])


# Sarsa is TD on state-action features


@pytest.mark.parametrize("rule", ["fixed:0.7", "hestenes-stiefel:printed:on_zero=0.5", "fletcher-reeves"])
@pytest.mark.parametrize(("traces", "cls"), [("accumulating", LinearTD), ("dutch", TrueOnlineTD)])
def test_sarsa_that_updates_all_actions_equals_td_on_state_action_features(traces, cls, rule):
    n, actions = 6, 3
    x, a, r = stream = random_stream(11)
    stacked = np.zeros((len(x), actions, n))
    stacked[np.arange(len(x)), a] = x
    stacked = stacked.reshape(len(x), -1)
    setting = {"step_size": 0.02, "discount": 0.9, "lambda_rule": rule}
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
    _, a, _ = stream = random_stream(13)
    before = learner.weights.copy()
    for t in feed(learner, stream):
        others = np.arange(3) != a[t]
        np.testing.assert_array_equal(learner.weights[others], before[others])
        before = learner.weights.copy()
    assert (before != 0).all()


def test_the_update_is_the_printed_one_by_default_and_the_exact_one_with_dutch_traces_and_for_q():
    assert [make(traces=traces).update_mode for traces in ("accumulating", "dutch")] == ["taken", "all"]
    assert make(traces="dutch", update="taken").update_mode == "taken"
    assert make(LinearQ).update_mode == "all"


# What holds for every learner


@every_learner
def test_buffers_may_be_used_again_and_the_reported_change_is_the_norm_of_the_weights(cls):
    x, a, r = stream = random_stream(15)
    shared, copied = (make(cls, n=6, actions=3, step_size=1e-3) for _ in range(2))
    buffer, buffer_next = np.empty(6), np.empty(6)
    for t in feed(copied, stream):
        before = shared.weights.copy()
        buffer[:], buffer_next[:] = x[t], x[t + 1]
        step(shared, buffer, r[t], buffer_next, a[t], a[t + 1], terminal=t == len(r) - 1)
        np.testing.assert_array_equal(copied.weights, shared.weights)
        assert shared.change == pytest.approx(np.linalg.norm(shared.weights - before))
        buffer.fill(np.nan)
    assert shared.steps == len(r)


@every_learner
def test_after_a_terminal_step_nothing_follows_and_none_may_say_so(cls):
    for phi_next in ([1, 1], None):
        assert step(make(cls, initial_weight=3.0), [1, 0], 1, phi_next, next_action=phi_next, terminal=True) == -2


@every_learner
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rule", ["fixed:0.9", "fletcher-reeves:unclipped"])
def test_weights_that_leave_the_finite_numbers_raise_an_error_that_says_when_and_with_what(cls, rule):
    learner = make(cls, rule=rule, step_size=50.0, discount=0.9)
    name = rule if rule.startswith("fixed") else "fletcher_reeves"
    with np.errstate(all="raise"), pytest.raises(Diverged) as outcome:
        while learner.steps < 10_000:
            assert np.isfinite(learner.weights).all()
            step(learner, [1, 0.5], 1, [0.5, 1])
    assert not np.isfinite(learner.weights).all()
    for diverged in (outcome.value, pickle.loads(pickle.dumps(outcome.value))):  # as from another process
        assert isinstance(diverged, Diverged)
        assert str(diverged) == f"weights not finite after step {learner.steps}, lambda rule {name}, step size 50.0"


# Watkins's Q(lambda)


@given(lambda_=st.floats(0, 1), seed=st.integers(0, 10**6))
def test_q_equals_watkins_tabular_algorithm_as_the_textbook_writes_it_and_begins_anew_after_a_cut(lambda_, seed):
    states, actions, alpha, gamma = 5, 3, 0.2, 0.9
    rng = np.random.default_rng(seed)
    learner = make(LinearQ, n=states, actions=actions, step_size=alpha, discount=gamma, rule=f"fixed:{lambda_}")
    q, e, features = np.zeros((actions, states)), np.zeros((actions, states)), np.eye(states)
    s, a, greedy = rng.integers(states), rng.integers(actions), False
    for t in range(30):
        reward, s_next, a_next = rng.standard_normal(), rng.integers(states), rng.integers(actions)
        if rng.random() < 0.7:
            a_next = q[:, s_next].argmax()
        last = t == 29
        learner.update(features[s], a, reward, features[s_next], a_next, terminal=last)
        assert learner.lambda_ == (lambda_ if greedy else 0)
        best = q[:, s_next].max()
        greedy = q[a_next, s_next] == best
        delta = reward + (0 if last else gamma * best) - q[a, s]
        e[a, s] += 1
        q += alpha * delta * e
        np.testing.assert_allclose(learner.weights, q, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(learner.trace, e * (greedy or last), rtol=1e-12, atol=1e-13)
        e = gamma * lambda_ * e if greedy else np.zeros_like(e)
        s, a = s_next, a_next


# Rules


def test_a_rule_may_be_given_by_its_name_and_what_is_said_beside_it_counts():
    named = make(rule="polak-ribiere:on_zero=0.5:unclipped")
    assert (named.lambda_rule, named.on_zero, named.clip) == (polak_ribiere, 0.5, False)
    other = make(rule="polak-ribiere:on_zero=0.5", on_zero=1, clip=False)
    assert (other.on_zero, other.clip) == (1, False)


# Refusals

UNIT, STEP_SIZE = r"must lie in \[0, 1\], got", "step_size must be finite and greater than 0, got"


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"n": 0}, "at least 1 feature"),
        ({"actions": 0}, "at least 1"),
        *(({"step_size": value}, f"{STEP_SIZE} {value!r}") for value in (0, -0.1, np.inf, np.nan, "0.1")),
        *(({"discount": value}, f"discount {UNIT} {value!r}") for value in (1.5, -0.5, np.nan, "1")),
        ({"on_zero": -1}, f"on_zero {UNIT} -1"),
        ({"initial_weight": np.inf}, "initial_weight must be a finite number, got inf"),
        ({"traces": "replacing"}, "unknown traces 'replacing'; known: accumulating, dutch"),
        ({"update": "some"}, "unknown update 'some'; known: taken, all"),
        ({"lambda_rule": 0.9}, r"lambda_rule = 0.9: .* such as lambdas.fletcher_reeves or Fixed\(0.9\)"),
    ],
)
def test_a_setting_out_of_bounds_is_refused_with_its_value_and_the_bound(changes, line):
    with pytest.raises((TypeError, ValueError), match=line) as refusal:
        make(**changes)
    assert "\n" not in str(refusal.value)


MALFORMED = [
    ({"phi": [1, 2, 3]}, r"phi must have shape \(2,\), got \(3,\)"),
    ({"phi": [[1, 2]]}, r"phi must have shape \(2,\), got \(1, 2\)"),
    ({"phi": 1.0}, r"phi must have shape \(2,\), got \(\)"),
    ({"phi": ["a", 2]}, r"phi must be numbers of shape \(2,\), got \['a', 2\]"),
    ({"phi": [np.nan, 2]}, "phi must be finite"),
    ({"phi_next": None}, "phi_next must have shape"),
    ({"phi_next": [1, np.inf]}, "phi_next must be finite"),
    ({"reward": np.nan}, "reward must be a finite number, got nan"),
    ({"reward": None}, "reward must be a finite number, got None"),
    *(({"action": value}, f"action must be an integer in 0..1, got {value!r}") for value in (2, -1, 0.5, "0")),
    ({"next_action": 5}, "next_action must be an integer in 0..1, got 5"),
    ({"next_action": None}, "next_action must be an integer in 0..1, got None"),
]
"""What of a step is changed, and the line that refuses it."""


@pytest.mark.parametrize(
    ("cls", "changes", "line"),
    [
        (cls, changes, line)
        for cls in LEARNERS
        for changes, line in MALFORMED
        if cls in CONTROL or not {"action", "next_action"} & changes.keys()
    ],
)
def test_a_step_that_is_malformed_or_not_finite_is_refused_and_changes_nothing(cls, changes, line):
    learner = make(cls, initial_weight=1.0)
    with pytest.raises(ValueError, match=line):
        step(learner, **{"phi": [1, 2], "reward": 0, "phi_next": [1, 2]} | changes)
    assert (learner.weights == 1).all() and not learner.trace.any() and learner.steps == 0


@pytest.mark.parametrize("wrong", [None, "0.9", np.nan, -np.inf, np.float64(np.nan), np.ones(258), 1j])
def test_a_rule_that_returns_no_finite_number_is_named_in_one_line_that_says_what_one_returns(wrong):
    learner = make(lambda_rule=lambda **_: wrong)
    learner.update([1, 0], 0, 1, [0, 1], 0)
    with pytest.raises(ValueError, match="lambda rule <lambda> returned") as refusal:
        learner.update([1, 0], 0, 1, [0, 1], 0)
    assert TAKES_AND_RETURNS in str(refusal.value) and "\n" not in str(refusal.value)
