"""A check proves what a student answers or says what is wrong with it, in one line; nothing stops the notebook."""

import re

import numpy as np
import pytest

from homing_lib.teach import checks, lab


@checks.check("1 twice")
def doubles(function):
    """It doubles every number.

    No more than that.
    """
    for x in np.random.default_rng(0).normal(size=5):
        checks.expect(function(x), 2 * x, {"You squared it.": x**2}, "Not the double.")


ANSWERS = {
    "proven. It doubles every number.": lambda x: 2 * x,
    "wrong. You squared it.": lambda x: x * x,
    "wrong. Not the double.": lambda x: -x,
    "blank. Nothing is checked yet.": lambda x: ...,
    "raised. Line 3: ZeroDivisionError: division by zero": eval("(\n\nlambda x: 1 / 0)"),
}


@pytest.mark.parametrize("answer", [None, ..., lambda x: ...])
def test_an_answer_that_is_not_there_is_blank(answer):
    assert doubles.judge(answer).verdict == "blank"


@pytest.mark.parametrize("told", ANSWERS)
def test_each_answer_is_told_in_one_line(told, capsys, monkeypatch):
    monkeypatch.setattr(checks, "RECORD", {})
    doubles(ANSWERS[told])
    assert capsys.readouterr().out == f"1 twice: {told}\n"


def without_a_case(*, delta, delta_prev, **_):
    if delta_prev != 0:
        return 0.5


def test_a_function_that_forgets_to_return_hears_so_and_with_which_errors():
    missing = "is a `return` missing, or a case not covered?"
    assert doubles.judge(lambda x: None)[1:] == ("wrong", f"Your function gave None: {missing}")
    verdict, told = lab.a_rule.judge(without_a_case)[1:]
    assert verdict == "wrong"
    assert re.fullmatch(rf"Your function gave None with δ = [-.\d]+, δ before = 0: {re.escape(missing)}", told)


def test_the_report_says_of_each_check_what_was_found_last(capsys, monkeypatch):
    other, left = (checks.check(title)(lambda answer: None) for title in ("2 always", "3 left out"))
    monkeypatch.setattr(checks, "RECORD", {})
    monkeypatch.setattr(lab, "TASKS", (doubles, other, left))
    for answer in (ANSWERS["wrong. You squared it."], ANSWERS["proven. It doubles every number."]):
        doubles(answer)
    other(...)
    capsys.readouterr()
    lab.report()
    assert capsys.readouterr().out.splitlines() == [
        "1 twice: proven. It doubles every number.",
        "2 always: blank. Nothing is checked yet.",
        "3 left out: blank. Its cell was not run.",
        "1 of 3 proven.",
    ]


def test_numbers_of_another_shape_are_not_alike_and_rounding_is():
    assert checks.alike(0.1 + 0.2, 0.3)
    assert not checks.alike([0.3], 0.3)
    assert not checks.alike(np.nan, np.nan)
