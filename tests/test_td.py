import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_lib.lambdas import RULES, TAKES_AND_RETURNS, Fixed, lambda_spec
from homing_lib.sarsa import Diverged
from homing_lib.study.theorem import ConjugateTD, beta
from homing_lib.td import LinearTD, TrueOnlineTD

FORMS = ("hestenes-stiefel", "fletcher-reeves", "polak-ribiere")
LEARNERS = (LinearTD, TrueOnlineTD)


def make(cls=LinearTD, n=2, rule="fletcher-reeves", **changes):
    _, lambda_rule, on_zero, clip = lambda_spec(rule)
    setting = {"step_size": 0.1, "discount": 0.5}
    if cls is not ConjugateTD:
        setting |= {"lambda_rule": lambda_rule, "on_zero": on_zero, "clip": clip}
    return cls(n, **setting | changes)


def random_stream(seed, n=8, steps=30):
    """Features x_0..x_T and rewards r_1..r_T of one episode."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((steps + 1, n)), rng.standard_normal(steps)


# Worked by hand


def test_three_steps_of_td_with_a_fixed_lambda_are_those_worked_by_hand():
    learner = make(rule="fixed:0.5")
    # delta = 1 + .5 * 0 - 0
    assert learner.update([1, 0], 1, [0, 1]) == pytest.approx(1)
    assert learner.weights == pytest.approx([0.1, 0])
    # delta = 2 + .5 * .1 - 0; e = .25 (1, 0) + (0, 1)
    assert learner.update([0, 1], 2, [1, 1]) == pytest.approx(2.05)
    assert learner.trace == pytest.approx([0.25, 1])
    assert learner.weights == pytest.approx([0.15125, 0.205])
    # the end has no value: delta = -1 - .35625; e = .25 (.25, 1) + (1, 1)
    assert learner.update([1, 1], -1, [7, 7], terminal=True) == pytest.approx(-1.35625)
    assert learner.trace == pytest.approx([1.0625, 1.25])
    assert learner.weights == pytest.approx([0.0071484375, 0.03546875])


def test_three_steps_of_td_with_form_2_are_those_worked_by_hand():
    learner = make(rule="fletcher-reeves")
    assert learner.update([1, 0], 1, [0.5, 0.5]) == pytest.approx(1.05 - 0.05)
    assert learner.lambda_ == 0
    # delta = .55 - .05; lambda = .5 * .5 / (.5 * 1 * 1); e = .25 (1, 0) + (.5, .5)
    assert learner.update([0.5, 0.5], 0.55, [0, 1]) == pytest.approx(0.5)
    assert learner.lambda_ == pytest.approx(0.5)
    assert learner.trace == pytest.approx([0.75, 0.5])
    assert learner.weights == pytest.approx([0.1375, 0.025])
    # delta = .125 - .025; lambda = .1 * 1 / (.5 * .5 * .5); e = .4 (.75, .5) + (0, 1)
    assert learner.update([0, 1], 0.125, [0, 0], terminal=True) == pytest.approx(0.1)
    assert learner.lambda_ == pytest.approx(0.8)
    assert learner.trace == pytest.approx([0.3, 1.2])
    assert learner.weights == pytest.approx([0.1405, 0.037])


@pytest.mark.parametrize(
    ("rule", "lambda_", "trace"),
    [  # (delta phi - delta_prev phi_prev) = (.25, .25) - (1, 0); times phi: -.25; times e: -.75
        ("hestenes-stiefel:unclipped", -2 / 3, [1 / 6, 0.5]),
        ("hestenes-stiefel:printed", 2 / 3, [5 / 6, 0.5]),
        ("polak-ribiere:unclipped", -0.5, [0.25, 0.5]),
        ("polak-ribiere", 0, [0.5, 0.5]),
    ],
)
def test_a_second_step_with_forms_1_and_3_is_the_one_worked_by_hand(rule, lambda_, trace):
    learner = make(rule=rule)
    learner.update([1, 0], 1, [0, 0])
    assert learner.update([0.5, 0.5], 0.55, [0, 1]) == pytest.approx(0.5)
    assert learner.lambda_ == pytest.approx(lambda_)
    assert learner.clipped == (rule == "polak-ribiere")
    assert learner.trace == pytest.approx(trace)
    assert learner.weights == pytest.approx([0.1 + 0.05 * trace[0], 0.05 * trace[1]])


def test_two_steps_of_true_online_td_are_those_worked_by_hand():
    learner = make(TrueOnlineTD, rule="fixed:1", discount=1.0, step_size=0.5)
    learner.update([1, 0], 2, [1, 1])
    assert learner.weights == pytest.approx([1, 0])
    # delta = 1 - 1; e = (1, 0) + (1 - .5) (1, 1); the value grew by 1 since, so theta += .5 (e - phi)
    assert learner.update([1, 1], 1, [0, 0], terminal=True) == pytest.approx(0)
    assert learner.trace == pytest.approx([1.5, 0.5])
    assert learner.weights == pytest.approx([1.25, -0.25])


# The theorem: TD-conj is TD with a lambda that varies


@pytest.mark.parametrize("form", FORMS)
@settings(deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), discount=st.floats(0.1, 1), variety=st.sampled_from([0.05, 0.2, 1]))
def test_conjugate_gradient_and_trace_agree_until_the_first_clip_and_the_clip_is_reported(
    form, seed, discount, variety
):
    # The less features and rewards vary, the longer lambda stays in the unit interval.
    x, r = random_stream(seed)
    x, r = 1 + variety * x, 1 + variety * r
    raw = [0.0]
    by_trace = make(
        n=8, step_size=1e-3, discount=discount, lambda_rule=lambda **s: raw.append(RULES[form](**s)) or raw[-1]
    )
    by_gradient = make(ConjugateTD, n=8, step_size=1e-3, discount=discount, form=form)
    for t in range(len(r)):
        trace_prev = by_trace.trace
        delta = by_trace.update(x[t], r[t], x[t + 1])
        by_gradient.update(x[t], r[t], x[t + 1])
        difference = delta * by_trace.trace - by_gradient.direction
        scale = 1e-8 * np.linalg.norm(by_gradient.direction)
        assert by_trace.clipped == (t > 0 and not 0 <= raw[t] <= 1)
        if by_trace.clipped:
            clip = by_trace.lambda_ - raw[t]
            assert difference == pytest.approx(delta * discount * clip * trace_prev, abs=scale)
            return
        assert difference == pytest.approx(0, abs=scale)
        assert by_trace.weights == pytest.approx(by_gradient.weights)


def test_conjugate_gradient_starts_afresh_after_an_episode_and_after_a_step_without_error():
    for rest in ("episode", "zero error"):
        learner = make(ConjugateTD, form="polak-ribiere", discount=1.0)
        learner.update([1, 0], 1, [0, 0])
        if rest == "episode":
            learner.begin_episode()
        else:
            assert learner.update([0, 1], 0, [0, 0]) == 0
        delta = learner.update([1, 1], 1, [0, 0])
        assert learner.direction == pytest.approx(delta * np.ones(2))


def test_an_unknown_form_is_refused_with_the_known_ones():
    for attempt in (lambda: make(ConjugateTD, form="newton"), lambda: beta("newton", *np.ones((3, 2)))):
        with pytest.raises(ValueError, match="'newton'; known: hestenes-stiefel, fletcher-reeves, polak-ribiere"):
            attempt()


# Clip and guard


def ratios(*values):
    """A rule that returns these, one a step; an exception is raised."""
    rest = iter(values)

    def rule(**_):
        value = next(rest)
        if isinstance(value, Exception):
            raise value
        return value

    return rule


def lambdas_of(learner, steps):
    x, r = random_stream(1, n=2, steps=steps)
    for t in range(steps):
        learner.update(x[t], r[t], x[t + 1])
        yield learner.lambda_, learner.clipped


@pytest.mark.parametrize("cls", LEARNERS)
def test_the_learner_resets_any_rule_to_the_unit_interval_and_says_so_of_the_last_step_only(cls):
    given = (-0.5, 0.25, 1.5, 0.0, 1.0, np.array(2.0))
    bounded, free = (make(cls, lambda_rule=ratios(*given), clip=clip) for clip in (True, False))
    assert list(lambdas_of(bounded, 7)) == [
        (0, False),
        (0, True),
        (0.25, False),
        (1, True),
        (0, False),
        (1, False),
        (1, True),
    ]
    assert list(lambdas_of(free, 7)) == [(0, False), *((value, False) for value in given)]


@pytest.mark.parametrize("cls", LEARNERS)
def test_where_a_rule_says_that_its_ratio_is_undefined_lambda_is_on_zero_and_no_clip_is_reported(cls):
    learner = make(cls, lambda_rule=ratios(ZeroDivisionError(), 0.25, OverflowError()), on_zero=0.75)
    assert list(lambdas_of(learner, 4)) == [(0, False), (0.75, False), (0.25, False), (0.75, False)]


@pytest.mark.parametrize("wrong", [None, "0.9", np.nan, -np.inf, np.ones(258), 1j])
def test_a_rule_that_returns_no_finite_number_is_named_in_one_line_that_says_what_one_returns(wrong):
    learner = make(lambda_rule=ratios(wrong))
    learner.update([1, 0], 1, [0, 1])
    with pytest.raises(ValueError, match="lambda rule rule returned") as refusal:
        learner.update([1, 0], 1, [0, 1])
    assert TAKES_AND_RETURNS in str(refusal.value) and "\n" not in str(refusal.value)


# What holds for every learner


@pytest.mark.parametrize("cls", LEARNERS)
def test_lambda_is_zero_at_the_first_step_of_each_episode_and_the_rule_is_not_asked(cls):
    asked = []
    learner = make(cls, n=8, lambda_rule=lambda **step: asked.append(step) or 1.0)
    x, r = random_stream(3)
    for episode in range(3):
        learner.begin_episode()
        assert not learner.trace.any()
        learner.update(x[0], r[0], x[1])
        assert (learner.lambda_, len(asked)) == (0, episode)
        assert learner.trace == pytest.approx(x[0])
        learner.update(x[1], r[1], x[2], terminal=True)
        assert (learner.lambda_, len(asked)) == (1, episode + 1)


def test_a_rule_sees_this_step_the_step_before_and_the_trace_between_them():
    seen = []
    learner = make(n=3, discount=0.9, lambda_rule=lambda **step: seen.append(step) or 0.5)
    x, r = random_stream(4, n=3, steps=4)
    deltas, traces = [], []
    for t in range(4):
        deltas.append(learner.update(x[t], r[t], x[t + 1]))
        traces.append(learner.trace)
    for t in range(1, 4):
        s = seen[t - 1]
        assert (s["delta"], s["delta_prev"], s["discount"]) == (deltas[t], deltas[t - 1], 0.9)
        for name, vector in {"phi": x[t], "phi_prev": x[t - 1], "trace_prev": traces[t - 1]}.items():
            np.testing.assert_array_equal(s[name], vector)


@pytest.mark.parametrize("cls", (*LEARNERS, ConjugateTD))
def test_the_caller_may_use_its_feature_buffers_again(cls):
    x, r = random_stream(5)
    copied, shared = make(cls, n=8), make(cls, n=8)
    buffer, buffer_next = np.empty(8), np.empty(8)
    for t in range(len(r)):
        copied.update(x[t].copy(), r[t], x[t + 1].copy())
        buffer[:], buffer_next[:] = x[t], x[t + 1]
        shared.update(buffer, r[t], buffer_next)
        np.testing.assert_array_equal(copied.weights, shared.weights)
        buffer.fill(np.nan)


@pytest.mark.parametrize("cls", LEARNERS)
def test_a_terminal_step_takes_the_value_after_it_as_zero(cls):
    learner = make(cls, initial_weight=3.0)
    assert learner.update([1, 0], 1, [1, 1], terminal=True) == -2
    learner = make(cls, initial_weight=3.0)
    assert learner.update([1, 0], 1, None, terminal=True) == -2


@pytest.mark.parametrize("cls", LEARNERS)
def test_the_reported_change_is_the_norm_of_the_change_of_the_weights(cls):
    learner = make(cls, n=8)
    x, r = random_stream(6)
    for t in range(len(r)):
        before = learner.weights.copy()
        learner.update(x[t], r[t], x[t + 1])
        assert learner.change == pytest.approx(np.linalg.norm(learner.weights - before))
    assert learner.steps == len(r)


def test_the_step_size_may_change_between_steps():
    learner = make(rule="fixed:0", discount=0.0)
    learner.update([1, 0], 1, [0, 0])
    learner.step_size = 0.01
    learner.update([0, 1], 1, [0, 0])
    assert learner.weights == pytest.approx([0.1, 0.01])


# Refusals


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"step_size": 0.0}, "step_size must be finite and greater than 0, got 0.0"),
        ({"step_size": -0.1}, "greater than 0, got -0.1"),
        ({"step_size": np.inf}, "got inf"),
        ({"step_size": np.nan}, "got nan"),
        ({"discount": 1.5}, r"discount must lie in \[0, 1\], got 1.5"),
        ({"discount": -0.5}, r"discount must lie in \[0, 1\], got -0.5"),
        ({"discount": np.nan}, r"discount must lie in \[0, 1\], got nan"),
        ({"initial_weight": np.inf}, "initial_weight must be a finite number, got inf"),
        ({"n": 0}, "at least 1"),
        ({"on_zero": -1}, r"on_zero must lie in \[0, 1\], got -1"),
    ],
)
@pytest.mark.parametrize("cls", LEARNERS)
def test_a_setting_out_of_bounds_is_refused_with_its_value_and_the_bound(cls, settings, reason):
    with pytest.raises(ValueError, match=reason):
        make(cls, **settings)


def test_a_step_size_out_of_bounds_is_refused_later_too_and_the_old_one_stays():
    learner = make()
    with pytest.raises(ValueError, match="got 0"):
        learner.step_size = 0
    assert learner.step_size == 0.1


def test_a_number_in_place_of_a_rule_is_refused_with_what_to_write():
    with pytest.raises(TypeError, match=r"lambda_rule = 0.9: .* such as lambdas.fletcher_reeves or Fixed\(0.9\)"):
        make(lambda_rule=0.9)


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (([1, 2, 3], 0, [1, 2]), r"phi must have shape \(2,\), got \(3,\)"),
        (([[1, 2]], 0, [1, 2]), r"phi must have shape \(2,\), got \(1, 2\)"),
        ((1.0, 0, [1, 2]), r"phi must have shape \(2,\), got \(\)"),
        (([1, 2], 0, [1]), r"phi_next must have shape \(2,\), got \(1,\)"),
        (([1, 2], 0, None), "phi_next must have shape"),
        (([1, np.nan], 0, [1, 2]), "phi must be finite"),
        (([1, 2], 0, [1, np.inf]), "phi_next must be finite"),
        (([1, 2], np.nan, [1, 2]), "reward must be a finite number, got nan"),
    ],
)
@pytest.mark.parametrize("cls", (*LEARNERS, ConjugateTD))
def test_a_step_that_is_malformed_or_not_finite_is_refused_and_changes_nothing(cls, step, reason):
    learner = make(cls, initial_weight=1.0)
    with pytest.raises(ValueError, match=reason):
        learner.update(*step)
    np.testing.assert_array_equal(learner.weights, np.ones(2))
    np.testing.assert_array_equal(learner.trace, np.zeros(2))
    assert learner.steps == 0


# Divergence


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rule", ["fixed:0.9", "fletcher-reeves:unclipped"])
@pytest.mark.parametrize("cls", (*LEARNERS, ConjugateTD))
def test_weights_that_leave_the_finite_numbers_raise_an_error_that_says_when_and_with_what(cls, rule):
    learner = make(cls, rule=rule, step_size=50.0, discount=0.9)
    name = rule if cls is not ConjugateTD and rule.startswith("fixed") else "fletcher_reeves"
    with np.errstate(all="raise"), pytest.raises(Diverged) as outcome:
        while learner.steps < 10_000:
            assert np.isfinite(learner.weights).all()
            learner.update([1, 0.5], 1, [0.5, 1])
    assert not np.isfinite(learner.weights).all()
    diverged = outcome.value
    assert (diverged.step, diverged.rule, diverged.step_size) == (learner.steps, name, 50.0)
    assert str(diverged) == f"weights not finite after step {learner.steps}, lambda rule {name}, step size 50.0"
    assert isinstance(diverged, ArithmeticError)


def test_the_error_survives_the_way_back_from_another_process():
    diverged = pickle.loads(pickle.dumps(Diverged(7, "fixed:0.9", 0.1)))
    assert (diverged.step, diverged.rule, diverged.step_size) == (7, "fixed:0.9", 0.1)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("cls", LEARNERS)
def test_weights_that_are_huge_but_finite_have_not_diverged(cls):
    learner = make(cls, rule="fixed:0", step_size=1.0)
    learner.update([3, 4], 1e200, [0, 0])
    assert learner.weights == pytest.approx([3e200, 4e200])
    assert learner.change == pytest.approx(5e200)


def test_a_value_and_its_lambda_rule_may_be_read_at_any_time():
    learner = LinearTD(2, step_size=0.5, discount=1.0, lambda_rule=Fixed(0.5), initial_weight=2.0)
    assert learner.value([1, 0.5]) == 3
    assert str(learner.lambda_rule) == "fixed:0.5"
