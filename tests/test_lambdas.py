import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from homing_lib import lambdas
from homing_lib.lambdas import RULES, Fixed

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


def test_the_rules_give_the_values_of_a_step_worked_by_hand_and_the_printed_sign_is_that_of_form_1_alone():
    # delta phi - delta_prev phi_prev = (2, 2) - (8, 4) = (-6, -2)
    found = {name: rule(**step()) for name, rule in RULES.items()}
    assert found == pytest.approx(
        {
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
    )


@pytest.mark.parametrize(("delta", "delta_prev"), [(1.0, 2.0), (-1.0, -2.0), (5e-324, 5e-324)])
def test_the_gate_is_open_while_the_error_keeps_its_sign_and_its_opposite_where_that_changes(delta, delta_prev):
    kept, changed = (step(delta=delta, delta_prev=before) for before in (delta_prev, -delta_prev))
    assert [RULES["gate"](**s) for s in (kept, changed)] == [1, 0]
    assert [RULES["gate:0.7"](**s) for s in (kept, changed)] == [0.7, 0]
    assert [RULES["gate:opposite"](**s) for s in (kept, changed)] == [0, 1]


@pytest.mark.parametrize("changes", [{"delta": 0.0}, {"delta_prev": 0.0}])
def test_no_gate_is_open_where_an_error_is_zero(changes):
    assert [RULES[name](**step(**changes)) for name in ("gate", "gate:opposite")] == [0, 0]


def test_upside_down_form_2_is_undefined_at_a_step_of_zero_error_and_without_its_sign_it_is_its_size():
    with pytest.raises(ZeroDivisionError):
        RULES["inverse"](**step(delta=0.0))
    assert RULES["absolute"](**step(delta=-2.0)) == pytest.approx(0.4)


ZERO = np.zeros(2)
UNDEFINED = {
    "no previous error": {"delta_prev": 0.0, "trace_prev": ZERO},
    "no previous features": {"phi_prev": ZERO, "trace_prev": ZERO},
    "nothing at all": {"delta": 0.0, "phi": ZERO, "delta_prev": 0.0, "phi_prev": ZERO, "trace_prev": ZERO},
    "no discount": {"discount": 0.0},
    "features beyond the range": {
        "phi": np.full(2, 1e300),
        "phi_prev": np.full(2, 1e300),
        "trace_prev": np.full(2, 1e300),
    },
    "an error that is not a number": {"delta": np.nan},
}


@pytest.mark.parametrize("changes", UNDEFINED.values(), ids=UNDEFINED)
@pytest.mark.parametrize("form", FORMS)
def test_where_the_ratio_is_undefined_a_form_says_so(form, changes):
    with pytest.raises(ArithmeticError):
        RULES[form](**step(**changes))


def test_a_step_of_zero_error_has_lambda_zero_in_form_2():
    assert lambdas.fletcher_reeves(**step(delta=0.0)) == 0


def test_form_1_is_undefined_where_the_change_of_gradient_is_orthogonal_to_the_trace():
    with pytest.raises(ZeroDivisionError):
        lambdas.hestenes_stiefel(**step(trace_prev=np.array([1.0, -3.0])))


number = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 2.3e-308, 1e300, -1e300, 1.0]),
)


@st.composite
def any_step(draw):
    n = draw(st.integers(1, 4))
    vectors = npst.arrays(np.float64, n, elements=number)
    return {
        "delta": draw(number),
        "phi": draw(vectors),
        "delta_prev": draw(number),
        "phi_prev": draw(vectors),
        "trace_prev": draw(vectors),
        "discount": draw(st.one_of(st.floats(0, 1), st.sampled_from([0.0, 5e-324, 1.0]))),
    }


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
@settings(deadline=None, max_examples=200)
@given(s=any_step())
@example(s=step(delta_prev=np.float64(0), discount=np.float64(1)))
@example(s=step(phi=np.full(2, 1e300)))
@example(s=step(phi_prev=np.full(2, 5e-324)))
def test_for_any_finite_input_a_named_rule_gives_a_finite_plain_float_or_says_that_there_is_none(rule, s):
    with np.errstate(all="raise"):
        try:
            ratio = rule(**s)
        except ArithmeticError:
            return
    assert type(ratio) is float and np.isfinite(ratio)


@pytest.mark.parametrize(
    ("text", "choice"),
    [
        ("fixed:0.9", (Fixed(0.9), 0, True)),
        ("fixed:0", (Fixed(0), 0, True)),
        ("fixed:1", (Fixed(np.float64(1)), 0, True)),
        ("fletcher-reeves", (lambdas.fletcher_reeves, 0, True)),
        ("hestenes-stiefel:printed", (lambdas.hestenes_stiefel_printed, 0, True)),
        ("polak-ribiere:on_zero=0.3", (lambdas.polak_ribiere, 0.3, True)),
        ("hestenes-stiefel:unclipped", (lambdas.hestenes_stiefel, 0, False)),
        ("hestenes-stiefel:printed:on_zero=1:unclipped", (lambdas.hestenes_stiefel_printed, 1, False)),
    ],
)
def test_a_choice_and_its_name_make_each_other(text, choice):
    assert lambdas.lambda_spec(text)[1:] == choice
    assert str(lambdas.lambda_spec(text)) == text


def test_a_rule_is_known_by_the_name_under_which_it_is_defined():
    def always(**_):
        return 1.0

    try:
        assert lambdas.register("a-new-one")(always) is always
        assert lambdas.lambda_spec("a-new-one:on_zero=0.5")[1:] == (always, 0.5, True)
    finally:
        del RULES["a-new-one"]


@given(value=st.floats(0, 1))
def test_the_short_name_of_a_fixed_lambda_keeps_every_digit(value):
    assert lambdas.lambda_spec(str(Fixed(value))).rule == Fixed(value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("steepest", "fixed:<lambda>, hestenes-stiefel, hestenes-stiefel:printed, fletcher-reeves, polak-ribiere"),
        ("", "fletcher-reeves"),
        ("fixed", "fixed:<lambda>"),
        ("fletcher-reeves:printed", "unknown option 'printed'"),
        ("fixed:1.5", r"lambda must lie in \[0, 1\], got 1.5"),
        ("fixed:nan", r"lambda must lie in \[0, 1\], got nan"),
        ("fixed:much", "much"),
        ("fletcher-reeves:clipped", "unclipped, on_zero=<lambda>"),
        ("fletcher-reeves:on_zero=-1", r"on_zero must lie in \[0, 1\], got -1"),
    ],
)
def test_a_rule_that_does_not_exist_is_refused_in_one_line_that_names_what_does(text, named):
    with pytest.raises(ValueError, match=named) as refusal:
        lambdas.lambda_spec(text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan, np.inf])
def test_a_lambda_outside_the_unit_interval_is_refused_with_its_value(value):
    with pytest.raises(ValueError, match=rf"lambda must lie in \[0, 1\], got {value}"):
        Fixed(value)


@pytest.mark.parametrize(
    ("rule", "fault"),
    [
        (0.9, "not a callable"),
        ("fletcher-reeves", "not a callable"),
        (lambda delta, delta_prev: 1.0, "unexpected keyword argument"),
        (lambda *, delta, step, **_: 1.0, "missing a required argument: 'step'"),
    ],
)
def test_what_cannot_be_called_as_a_rule_is_refused_in_one_line_that_says_what_a_rule_takes_and_returns(rule, fault):
    with pytest.raises(TypeError, match=fault) as refusal:
        lambdas.checked(rule)
    assert lambdas.TAKES_AND_RETURNS in str(refusal.value) and "\n" not in str(refusal.value)
