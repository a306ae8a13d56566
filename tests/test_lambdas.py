"""Eq. (7) in its three forms, what they are made of, and how a rule is named."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from homing_lib import lambdas
from homing_lib.lambdas import RULES, Fixed, LambdaSpec, lambda_spec, rule_named

FORMS = ("hestenes-stiefel", "fletcher-reeves", "polak-ribiere")


def step(**changes):
    """Arguments of a rule: a step that can be worked by hand, with these changes."""
    arguments = {
        "delta": 2.0,
        "phi": np.array([1.0, 1.0]),
        "delta_prev": 4.0,
        "phi_prev": np.array([2.0, 1.0]),
        "trace_prev": np.array([2.0, 1.0]),
        "discount": 0.5,
    }
    return arguments | changes


BY_HAND = {  # delta phi - delta_prev phi_prev = (2, 2) - (8, 4) = (-6, -2)
    "hestenes-stiefel": -8 / 7,  # -(-8) / (.5 * -14)
    "hestenes-stiefel:printed": 8 / 7,
    "fletcher-reeves": 0.4,  # 2 * 2 / (.5 * 4 * 5)
    "polak-ribiere": -0.8,  # -8 / (.5 * 4 * 5)
    "gate": 1,
    "gate:0.7": 0.7,
    "gate:opposite": 0,
    "inverse": 2.5,
    "absolute": 0.4,
    "fletcher-reeves:negated": -0.4,
    "polak-ribiere:negated": 0.8,
}


@pytest.mark.parametrize("name", BY_HAND)
def test_a_rule_gives_the_value_of_a_step_worked_by_hand_and_the_printed_sign_is_that_of_form_1_alone(name):
    assert RULES[name](**step()) == pytest.approx(BY_HAND[name])


@pytest.mark.parametrize(("delta", "delta_prev"), [(1.0, 2.0), (-1.0, -2.0), (5e-324, 5e-324)])
def test_the_gate_is_open_while_the_error_keeps_its_sign_and_its_opposite_where_that_changes(delta, delta_prev):
    kept, changed = (step(delta=delta, delta_prev=before) for before in (delta_prev, -delta_prev))
    assert [RULES["gate"](**s) for s in (kept, changed)] == [1, 0]
    assert [RULES["gate:opposite"](**s) for s in (kept, changed)] == [0, 1]
    for none in (step(delta=0.0, delta_prev=delta_prev), step(delta=delta, delta_prev=0.0)):
        assert [RULES[name](**none) for name in ("gate", "gate:opposite")] == [0, 0]


ZERO, HUGE = np.zeros(2), np.full(2, 1e300)
UNDEFINED = {
    "no previous error": (FORMS, {"delta_prev": 0.0, "trace_prev": ZERO}),
    "no previous features": (FORMS, {"phi_prev": ZERO, "trace_prev": ZERO}),
    "nothing at all": (FORMS, {"delta": 0.0, "phi": ZERO, "delta_prev": 0.0, "phi_prev": ZERO, "trace_prev": ZERO}),
    "no discount": (FORMS, {"discount": 0.0}),
    "features beyond the range": (FORMS, {"phi": HUGE, "phi_prev": HUGE, "trace_prev": HUGE}),
    "an error that is not a number": (FORMS, {"delta": np.nan}),
    "no error, upside down": (["inverse"], {"delta": 0.0}),
    "a change of gradient that is orthogonal to the trace": (FORMS[:1], {"trace_prev": np.array([1.0, -3.0])}),
}


@pytest.mark.parametrize(("forms", "changes"), UNDEFINED.values(), ids=UNDEFINED)
def test_where_the_ratio_is_undefined_a_form_says_so(forms, changes):
    for form in forms:
        with pytest.raises(ArithmeticError):
            RULES[form](**step(**changes))


size = st.floats(0.1, 10)


@given(delta=size, sign=st.sampled_from([-1, 1]), delta_prev=size, phi=size, phi_prev=size, discount=st.floats(0.1, 1))
def test_on_orthogonal_features_without_revisits_the_forms_are_one_and_the_printed_first_its_negative(
    delta, sign, delta_prev, phi, phi_prev, discount
):
    before = {"delta_prev": delta_prev, "phi_prev": np.array([0, phi_prev]), "trace_prev": np.array([0, phi_prev])}
    s = step(delta=sign * delta, phi=np.array([phi, 0]), discount=discount, **before)
    expected = sign * delta * phi**2 / (discount * delta_prev * phi_prev**2)
    assert [RULES[form](**s) for form in FORMS] == pytest.approx([expected] * 3)
    assert lambdas.hestenes_stiefel_printed(**s) == pytest.approx(-expected)


number = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 2.3e-308, 1e300, -1e300, 1.0]),
)


@st.composite
def any_step(draw):
    n = draw(st.integers(1, 4))
    vectors = npst.arrays(np.float64, n, elements=number)
    deltas = {name: draw(number) for name in ("delta", "delta_prev")}
    discount = draw(st.one_of(st.floats(0, 1), st.sampled_from([0.0, 5e-324, 1.0])))
    return {**deltas, **{name: draw(vectors) for name in ("phi", "phi_prev", "trace_prev")}, "discount": discount}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
@settings(deadline=None, max_examples=100)
@given(s=any_step())
@example(s=step(delta_prev=np.float64(0), discount=np.float64(1)))
@example(s=step(phi=HUGE))
@example(s=step(phi_prev=np.full(2, 5e-324)))
def test_for_any_finite_input_a_named_rule_gives_a_finite_plain_float_or_says_that_there_is_none(rule, s):
    with np.errstate(all="raise"):
        try:
            ratio = rule(**s)
        except ArithmeticError:
            return
    assert type(ratio) is float and np.isfinite(ratio)


# Names


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("fixed:0", (Fixed(0), 0, True)),
        ("fixed:1", (Fixed(np.float64(1)), 0, True)),
        ("polak-ribiere:on_zero=0.3", (lambdas.polak_ribiere, 0.3, True)),
        ("hestenes-stiefel:unclipped", (lambdas.hestenes_stiefel, 0, False)),
        ("hestenes-stiefel:printed:on_zero=1:unclipped", (lambdas.hestenes_stiefel_printed, 1, False)),
        *((name, (rule, 0, True)) for name, rule in RULES.items()),
    ],
)
def test_a_spec_and_its_name_make_each_other(text, spec):
    assert lambda_spec(text)[1:] == rule_named(text)[1:] == spec
    assert str(lambda_spec(text)) == text


@given(value=st.floats(0, 1))
def test_the_short_name_of_a_fixed_lambda_keeps_every_digit(value):
    assert lambda_spec(str(Fixed(value))).rule == Fixed(value)


def test_a_rule_is_known_by_the_name_under_which_it_is_defined_and_a_function_needs_none(monkeypatch):
    def always(**_):
        return 1.0

    monkeypatch.setattr(lambdas, "RULES", RULES.copy())
    assert lambdas.register("a-new-one")(always) is always
    assert lambda_spec("a-new-one:on_zero=0.5") == LambdaSpec("a-new-one", always, 0.5, True)
    assert lambda_spec(always) == LambdaSpec("always", always, 0, True)


@pytest.mark.parametrize(
    ("make", "wrong", "named"),
    [
        (lambda_spec, "steepest", ", ".join(RULES)),
        (lambda_spec, "fletcher-reevs", "did you mean fletcher-reeves"),
        (lambda_spec, "", "fletcher-reeves"),
        (lambda_spec, "fixed", "fixed:<lambda>"),
        (lambda_spec, "fletcher-reeves:printed", "unknown option 'printed'"),
        (lambda_spec, "fixed:1.5", r"lambda must lie in \[0, 1\], got 1.5"),
        (lambda_spec, "fixed:nan", "got nan"),
        (lambda_spec, "fixed:much", "much"),
        (lambda_spec, "fletcher-reeves:clipped", "unclipped, on_zero=<lambda>"),
        (lambda_spec, "fletcher-reeves:on_zero=-1", r"on_zero must lie in \[0, 1\], got -1"),
        (rule_named, 0.5, "fixed:<lambda>, .*function"),
        (Fixed, -0.1, "got -0.1"),
        *((lambda_spec, wrong, lambdas.TAKES_AND_RETURNS) for wrong in (0.9, None, len)),
        (lambda_spec, lambda delta, delta_prev: 1.0, "unexpected keyword argument"),
        (lambda_spec, lambda *, delta, step, **_: 1.0, "missing a required argument: 'step'"),
    ],
)
def test_what_is_no_rule_or_no_name_of_one_is_refused_in_one_line_that_names_what_is(make, wrong, named):
    with pytest.raises((TypeError, ValueError)) as refusal:
        make(wrong)
    assert "\n" not in str(refusal.value)
    refusal.match(re.escape(named) if named == lambdas.TAKES_AND_RETURNS else named)
