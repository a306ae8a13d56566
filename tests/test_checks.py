"""A check proves what a student answers or says what is wrong with it, in one line; nothing stops the notebook."""

import re

import numpy as np
import pytest
from IPython.core.formatters import MarkdownFormatter, PlainTextFormatter

from homing_lib.teach import checks, lab


@checks.check("1 twice")
def doubles(function):
    """It doubles every number.

    No more than that.
    """
    for x in np.random.default_rng(0).normal(size=5):
        if checks.alike(answer := function(x), x + 2):
            raise checks.Behind("By far.")
        squared = checks.mistake_in(answer, {"square": x**2}) == "square"
        checks.must(checks.alike(answer, 2 * x), "You squared it." if squared else "")
    return "Always." if function(1) == 2 else None


def without_a_case(*, delta, delta_prev, **_):
    if delta_prev != 0:
        return 0.5


ANSWERS = {
    "proven. It doubles every number. Always.": lambda x: 2 * x,
    "wrong. You squared it.": lambda x: x * x,
    "wrong. This must hold: It doubles every number.": lambda x: -x,
    "behind. By far.": lambda x: x + 2,
    "blank. Nothing is checked yet.": lambda x: ...,
    "blank. Still to fill in: b, 0.8.": {"a": 1, "b": ..., 0.8: None},
    "wrong. Your function gave None: is a `return` missing, or a case not covered?": lambda x: None,
    "raised. Line 3: ZeroDivisionError: division by zero": eval("(\n\nlambda x: 1 / 0)"),
    "raised. TypeError: 'int' object is not callable": 2,
}


@pytest.mark.parametrize("line", ANSWERS)
def test_each_answer_is_judged_in_one_line(line, capsys, monkeypatch):
    monkeypatch.setattr(checks, "RECORD", {})
    doubles(ANSWERS[line])
    assert capsys.readouterr().out == f"1 twice: {line}\n"


@pytest.mark.parametrize("answer", [None, ..., {"a": None, "b": ...}, lambda x: {"a": ...}])
def test_an_answer_that_is_not_there_is_blank(answer):
    assert doubles.judge(answer)[1:] == ("blank", "Nothing is checked yet.")


def test_in_a_notebook_the_verdict_is_marked_and_what_a_student_wrote_does_not_change_the_print():
    outcome = checks.Outcome("5a", "raised", "Line 2: TypeError: f(*, a, **_) takes `x * y` in [0, 1]")
    assert PlainTextFormatter()(outcome) == f"5a: raised. {outcome.message}"
    shown = MarkdownFormatter()(outcome)
    assert shown == r"5a: **⚠ raised.** Line 2: TypeError: f(\*, a, \*\*\_) takes `x * y` in \[0, 1]"


def test_a_function_that_forgets_a_case_hears_with_which_errors():
    verdict, message = lab.a_rule.judge(without_a_case)[1:]
    assert verdict == "wrong"
    assert re.search(r"None with δ = [-.\d]+, δ before = 0: ", message)


@pytest.mark.parametrize(
    ("answers", "message"), [([1, 2], r"\{'a': \.\.\., 0\.8: \.\.\.\}"), ({"a": 1}, "0.8 is missing")]
)
def test_a_dictionary_has_all_keys_that_are_asked_for(answers, message):
    checks.complete({"a": 1, 0.8: 2}, ("a", 0.8))
    with pytest.raises(checks.Wrong, match=message):
        checks.complete(answers, ("a", 0.8))


def test_numbers_of_another_shape_are_not_alike_and_rounding_is():
    assert checks.alike(0.1 + 0.2, 0.3)
    assert not checks.alike([0.3], 0.3)
    assert not checks.alike(np.nan, np.nan)
    assert checks.alike(1.01, 1.0, tolerance=0.02)


def test_the_first_mistake_that_gives_the_answer_is_named():
    assert checks.mistake_in(2.0, {"none": np.nan, "sum": 2, "double": 2}) == "sum"
    assert checks.mistake_in(3.0, {"sum": 2}) == "otherwise"
