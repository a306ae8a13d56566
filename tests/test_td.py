"""TD prediction: TD(lambda_t) is conjugate gradient until lambda is reset, and what every rule and learner is owed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_lib.lambdas import RULES, Fixed, fletcher_reeves
from homing_lib.study.theorem import distance_from_cg
from homing_lib.td import LinearTD, TrueOnlineTD

FORMS = ("hestenes-stiefel", "fletcher-reeves", "polak-ribiere")
both = pytest.mark.parametrize("cls", [LinearTD, TrueOnlineTD])


def make(cls=LinearTD, n=2, rule=fletcher_reeves, **changes):
    return cls(n, **{"step_size": 0.1, "discount": 0.5, "lambda_rule": rule} | changes)


def random_stream(seed, n=8, steps=30):
    """Features x_0..x_T and rewards r_1..r_T of one episode."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((steps + 1, n)), rng.standard_normal(steps)


def test_three_steps_of_td_with_form_2_are_those_worked_by_hand():
    learner = make()
    assert learner.update([1, 0], 1, [0.5, 0.5]) == pytest.approx(1.05 - 0.05)
    assert learner.lambda_ == 0
    # delta = .55 - .05; lambda = .5 * .5 / (.5 * 1 * 1); e = .25 (1, 0) + (.5, .5)
    assert learner.update([0.5, 0.5], 0.55, [0, 1]) == pytest.approx(0.5)
    assert learner.lambda_ == pytest.approx(0.5)
    assert learner.trace == pytest.approx([0.75, 0.5])
    assert learner.weights == pytest.approx([0.1375, 0.025])
    # the end has no value: delta = .125 - .025; lambda = .1 * 1 / (.5 * .5 * .5); e = .4 (.75, .5) + (0, 1)
    assert learner.update([0, 1], 0.125, [7, 7], terminal=True) == pytest.approx(0.1)
    assert learner.lambda_ == pytest.approx(0.8)
    assert learner.trace == pytest.approx([0.3, 1.2])
    assert learner.weights == pytest.approx([0.1405, 0.037])
    assert learner.value([1, 2]) == pytest.approx(0.2145)


@pytest.mark.parametrize("form", FORMS)
@settings(deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), discount=st.floats(0.1, 1), variety=st.sampled_from([0.05, 0.2, 1]))
def test_conjugate_gradient_and_trace_agree_until_the_first_clip_and_the_clip_is_reported(
    form, seed, discount, variety
):
    # The less features and rewards vary, the longer lambda stays in the unit interval.
    x, r = random_stream(seed)
    x, r = 1 + variety * x, 1 + variety * r
    raw, deltas = [0.0], []
    by_trace = make(n=8, step_size=1e-4, discount=discount, rule=lambda **s: raw.append(RULES[form](**s)) or raw[-1])
    for t in range(len(r)):
        trace_prev = by_trace.trace
        deltas.append(by_trace.update(x[t], r[t], x[t + 1]))
        assert by_trace.clipped == (t > 0 and not 0 <= raw[t] <= 1)
        if by_trace.clipped:
            break
    found = distance_from_cg(x[: t + 2], r[: t + 1], form, discount)
    clip = discount * (by_trace.lambda_ - raw[t]) * trace_prev
    away = np.linalg.norm(clip) / np.linalg.norm(by_trace.trace - clip)
    assert found.reset == pytest.approx([*[0] * t, away], rel=1e-6, abs=1e-8)
    assert found.first == (t + 1) * by_trace.clipped
    assert found.ratio == pytest.approx(raw)
    assert found.delta == pytest.approx(deltas)


def test_both_agree_until_the_first_reset_of_lambda_which_is_named():
    rng = np.random.default_rng(1)
    found = distance_from_cg(rng.standard_normal((13, 5)), rng.standard_normal(12))
    at = found.first - 1
    assert at > 0 and not 0 <= found.ratio[at] <= 1
    assert found.free.max() < 1e-9
    assert found.reset[:at].max() < 1e-9 < found.reset[at]


@pytest.mark.parametrize("form", FORMS[1:])  # those whose lambda, too, is undefined then
def test_conjugate_gradient_starts_afresh_after_a_step_without_error(form):
    phi, reward = np.array([[1.0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 0]]), np.array([1.0, 0, 1])
    found = distance_from_cg(phi, reward, form)
    assert (found.delta == reward).all()
    assert found.free[2] == found.reset[2] == 0


# The rule and the learner


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


@both
def test_lambda_is_what_the_rule_returns_reset_to_the_unit_interval_or_on_zero_where_there_is_no_ratio(cls):
    returned = (-0.5, 0.25, 1.5, 0.0, 1.0, np.array(2.0), ZeroDivisionError(), OverflowError())
    bounded, free = (make(cls, rule=ratios(*returned), clip=clip, on_zero=0.75) for clip in (True, False))
    reset = [(0, True), (0.25, False), (1, True), (0, False), (1, False), (1, True)]
    undefined = [(0.75, False)] * 2
    assert list(lambdas_of(bounded, 9)) == [(0, False), *reset, *undefined]
    assert list(lambdas_of(free, 9)) == [(0, False), *((value, False) for value in returned[:6]), *undefined]


@both
def test_a_rule_sees_this_step_the_one_before_and_the_trace_between_but_is_not_asked_at_the_first(cls):
    seen = []
    learner = make(cls, n=3, discount=0.9, rule=lambda **step: seen.append(step) or 0.5)
    x, r = random_stream(4, n=3, steps=4)
    for _ in range(2):
        learner.begin_episode()
        seen.clear()
        assert not learner.trace.any()
        deltas, traces = [], []
        for t in range(4):
            deltas.append(learner.update(x[t], r[t], x[t + 1]))
            traces.append(learner.trace)
            assert (learner.lambda_, len(seen)) == (0.5 if t else 0, t)
        for t in range(1, 4):
            s = seen[t - 1]
            assert (s["delta"], s["delta_prev"], s["discount"]) == (deltas[t], deltas[t - 1], 0.9)
            for name, vector in {"phi": x[t], "phi_prev": x[t - 1], "trace_prev": traces[t - 1]}.items():
                np.testing.assert_array_equal(s[name], vector)


def test_the_step_size_may_change_between_steps():
    learner = make(rule=Fixed(0), discount=0.0)
    learner.update([1, 0], 1, [0, 0])
    learner.step_size = 0.01
    learner.update([0, 1], 1, [0, 0])
    assert learner.weights == pytest.approx([0.1, 0.01])
    with pytest.raises(ValueError, match=r"step_size .* got 0"):
        learner.step_size = 0
    assert learner.step_size == 0.01


@both
@pytest.mark.filterwarnings("error")
def test_weights_that_are_huge_but_finite_have_not_diverged(cls):
    learner = make(cls, rule=Fixed(0), step_size=1.0)
    learner.update([3, 4], 1e200, [0, 0])
    assert learner.weights == pytest.approx([3e200, 4e200])
    assert learner.change == pytest.approx(5e200)
