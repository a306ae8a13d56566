"""The lab and the exercises check what a student answers, and nothing that a student writes stops a notebook."""

import numpy as np
import pytest

from homing_lib.publish import lab


@lab.check("1 twice")
def doubles(function):
    """It doubles every number.

    No more than that.
    """
    for x in np.random.default_rng(0).normal(size=5):
        lab.expect(function(x), 2 * x, {"You squared it.": x**2}, "Not the double.")


ANSWERS = {
    "proven. It doubles every number.": lambda x: 2 * x,
    "wrong. You squared it.": lambda x: x * x,
    "wrong. Not the double.": lambda x: -x,
    "blank. Nothing is checked yet.": lambda x: ...,
    "raised. ZeroDivisionError: division by zero": lambda x: 1 / 0,
}


@pytest.mark.parametrize("answer", [None, ..., lambda x: None, lambda x: ...])
def test_an_answer_that_is_not_there_is_blank(answer):
    assert doubles.judge(answer).verdict == "blank"


@pytest.mark.parametrize("told", ANSWERS)
def test_each_answer_is_told_in_one_line(told, capsys, monkeypatch):
    monkeypatch.setattr(lab, "RECORD", {})
    doubles(ANSWERS[told])
    assert capsys.readouterr().out == f"1 twice: {told}\n"


def test_the_report_says_of_each_check_what_was_found_last(capsys, monkeypatch):
    monkeypatch.setattr(lab, "RECORD", {})
    other = lab.check("2 always")(lambda answer: None)
    for answer in (ANSWERS["wrong. You squared it."], ANSWERS["proven. It doubles every number."]):
        doubles(answer)
    other(...)
    capsys.readouterr()
    lab.report()
    assert capsys.readouterr().out.splitlines() == [
        "1 twice: proven. It doubles every number.",
        "2 always: blank. Nothing is checked yet.",
        "1 of 2 proven.",
    ]


def test_numbers_of_another_shape_are_not_alike_and_rounding_is():
    assert lab.alike(0.1 + 0.2, 0.3)
    assert not lab.alike([0.3], 0.3)
    assert not lab.alike(np.nan, np.nan)
