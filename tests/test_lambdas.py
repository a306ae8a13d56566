import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from homing_lib import lambdas
from homing_lib.lambdas import Conjugate, Fixed

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


def test_the_three_forms_give_the_values_of_a_step_worked_by_hand():
    # delta phi - delta_prev phi_prev = (2, 2) - (8, 4) = (-6, -2)
    s = step()
    trace = s.pop("trace_prev")
    assert lambdas.hestenes_stiefel(**s, trace_prev=trace) == pytest.approx(-8 / 7)  # -(-8) / (.5 * -14)
    assert lambdas.fletcher_reeves(**s) == pytest.approx(0.4)  # 2 * 2 / (.5 * 4 * 5)
    assert lambdas.polak_ribiere(**s) == pytest.approx(-0.8)  # -8 / (.5 * 4 * 5)


@pytest.mark.parametrize(
    ("rule", "raw", "used", "clipped"),
    [
        ("hestenes-stiefel", -8 / 7, 0, True),
        ("hestenes-stiefel:printed", 8 / 7, 1, True),
        ("fletcher-reeves", 0.4, 0.4, False),
        ("fletcher-reeves:printed", 0.4, 0.4, False),
        ("polak-ribiere", -0.8, 0, True),
        ("polak-ribiere:printed", -0.8, 0, True),
    ],
)
def test_a_rule_clips_to_the_unit_interval_says_so_and_changes_sign_in_form_1_alone(rule, raw, used, clipped):
    free, bounded = lambdas.parse(rule + ":unclipped"), lambdas.parse(rule)
    assert free(**step()) == pytest.approx(raw) and not free.clipped
    assert bounded(**step()) == pytest.approx(used) and bounded.clipped == clipped


def test_the_report_of_a_clip_is_of_the_last_call_only():
    rule = Conjugate("fletcher-reeves")
    assert rule(**step(delta=-2.0)) == 0 and rule.clipped
    assert rule(**step()) == pytest.approx(0.4) and not rule.clipped


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
def test_where_the_ratio_is_undefined_lambda_is_on_zero_and_no_clip_is_reported(form, changes):
    for on_zero in (0.0, 0.25, 1.0):
        rule = Conjugate(form, on_zero=on_zero)
        assert rule(**step(**changes)) == on_zero
        assert not rule.clipped


def test_a_step_of_zero_error_has_lambda_zero_in_form_2_and_needs_no_guard():
    assert Conjugate("fletcher-reeves", on_zero=1.0)(**step(delta=0.0)) == 0


def test_form_1_is_undefined_where_the_change_of_gradient_is_orthogonal_to_the_trace():
    assert Conjugate("hestenes-stiefel", on_zero=0.5)(**step(trace_prev=np.array([1.0, -3.0]))) == 0.5


def test_on_orthogonal_unit_features_forms_1_and_2_and_3_are_equal_and_printed_form_1_is_their_negative():
    rng = np.random.default_rng(1)
    basis = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    trace, discount = basis[0], 0.9
    deltas = rng.standard_normal(6)
    for t in range(1, 6):
        s = step(
            delta=deltas[t],
            phi=basis[t],
            delta_prev=deltas[t - 1],
            phi_prev=basis[t - 1],
            trace_prev=trace,
            discount=discount,
        )
        one, two, three = (Conjugate(form, clip=False)(**s) for form in FORMS)
        printed = Conjugate("hestenes-stiefel", sign="printed", clip=False)(**s)
        assert two == pytest.approx(deltas[t] / (discount * deltas[t - 1]), rel=1e-12)
        assert [one, three, -printed] == pytest.approx([two] * 3, rel=1e-12)
        trace = discount * two * trace + basis[t]


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
@pytest.mark.parametrize("sign", ["conjugate", "printed"])
@pytest.mark.parametrize("form", FORMS)
@settings(deadline=None, max_examples=300)
@given(s=any_step(), on_zero=st.floats(0, 1))
@example(s=step(delta_prev=np.float64(0), discount=np.float64(1)), on_zero=0.5)
@example(s=step(phi=np.full(2, 1e300)), on_zero=0.0)
@example(s=step(phi_prev=np.full(2, 5e-324)), on_zero=1.0)
def test_for_any_finite_input_lambda_is_finite_and_clipped_to_the_unit_interval(form, sign, s, on_zero):
    with np.errstate(all="raise"):
        bounded = Conjugate(form, sign=sign, on_zero=on_zero)
        lambda_ = bounded(**s)
        raw = Conjugate(form, sign=sign, on_zero=on_zero, clip=False)(**s)
    assert np.isfinite(raw)
    assert 0 <= lambda_ <= 1
    assert lambda_ == min(max(raw, 0), 1)
    assert bounded.clipped == (not 0 <= raw <= 1)
    assert type(lambda_) is float


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("fixed:0.9", Fixed(0.9)),
        ("fixed:0", Fixed(0)),
        ("fixed:1", Fixed(np.float64(1))),
        ("fletcher-reeves", Conjugate("fletcher-reeves")),
        ("hestenes-stiefel:printed", Conjugate("hestenes-stiefel", sign="printed")),
        ("polak-ribiere:on_zero=0.3", Conjugate("polak-ribiere", on_zero=0.3)),
        ("hestenes-stiefel:unclipped", Conjugate("hestenes-stiefel", clip=False)),
        (
            "hestenes-stiefel:printed:on_zero=1:unclipped",
            Conjugate("hestenes-stiefel", sign="printed", on_zero=1, clip=False),
        ),
    ],
)
def test_a_rule_and_its_short_name_make_each_other(text, rule):
    assert lambdas.parse(text) == rule
    assert str(rule) == text


@given(value=st.floats(0, 1))
def test_the_short_name_of_a_fixed_lambda_keeps_every_digit(value):
    assert lambdas.parse(str(Fixed(value))) == Fixed(value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("steepest", "fixed:<lambda>, hestenes-stiefel, fletcher-reeves, polak-ribiere"),
        ("", "fletcher-reeves"),
        ("fixed", "fixed:<lambda>"),
        ("fixed:1.5", r"lambda must lie in \[0, 1\], got 1.5"),
        ("fixed:nan", r"lambda must lie in \[0, 1\], got nan"),
        ("fixed:much", "much"),
        ("fletcher-reeves:clipped", "printed, unclipped, on_zero=<lambda>"),
        ("fletcher-reeves:on_zero=-1", r"on_zero must lie in \[0, 1\], got -1"),
    ],
)
def test_a_rule_that_does_not_exist_is_refused_in_one_line_that_names_what_does(text, named):
    with pytest.raises(ValueError, match=named) as refusal:
        lambdas.parse(text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan, np.inf])
def test_a_lambda_outside_the_unit_interval_is_refused_with_its_value(value):
    with pytest.raises(ValueError, match=rf"lambda must lie in \[0, 1\], got {value}"):
        Fixed(value)
    with pytest.raises(ValueError, match=rf"on_zero must lie in \[0, 1\], got {value}"):
        Conjugate("fletcher-reeves", on_zero=value)


def test_an_unknown_form_or_sign_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="'newton'; known: hestenes-stiefel, fletcher-reeves, polak-ribiere"):
        Conjugate("newton")
    with pytest.raises(ValueError, match="'plus'; known: conjugate, printed"):
        Conjugate("hestenes-stiefel", sign="plus")
