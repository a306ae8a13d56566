"""What a student answers, checked: each check proves a property, and none knows an answer by heart.

A check is a function under `@check("its title")`. The first paragraph of its docstring is the property that it proves;
it takes the student's answers (numbers, arrays, functions), returns nothing, or a remark, if the property holds, and
else raises `Wrong` with a hint. Called in a notebook, it prints one line:

    proven    the property holds
    blank     an answer is None or ..., or a function that returns ..., or has such a value
    wrong     it does not hold, with the hint
    raised    the student's code raised, with the line of its cell and what

Nothing that a student writes stops the notebook. The checks themselves: `lab`, `exercises`.
"""

from collections.abc import Callable, Mapping
from functools import update_wrapper, wraps
from traceback import walk_tb
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

SEED = 2014  # of every random trial


class Wrong(Exception):
    """The property does not hold. Its text is the hint."""


class Blank(Exception):
    """There is no answer yet."""


class Outcome(NamedTuple):
    """What a check found. `told`: the property if proven, else the hint or what was raised."""

    title: str
    verdict: Literal["proven", "blank", "wrong", "raised"]
    told: str

    def __str__(self) -> str:
        return f"{self.title}: {self.verdict}. {self.told}"


RECORD: dict[str, Outcome] = {}  # what was found last, by title, in the order in which it was found


class Check:
    """A check with its title. Calling it prints and records what `judge` finds."""

    def __init__(self, title: str, function: Callable[..., str | None]) -> None:
        update_wrapper(self, function)
        self.title, self._function = title, function

    @property
    def proves(self) -> str:
        """The property: the first paragraph of the docstring, in one line."""
        return " ".join((self.__doc__ or "").split("\n\n")[0].split())

    def judge(self, *answers: Any) -> Outcome:
        """What is to be said of these answers."""
        try:
            remark = self._function(*map(_asked, answers))
        except Blank:
            return Outcome(self.title, "blank", "Nothing is checked yet.")
        except Wrong as hint:
            return Outcome(self.title, "wrong", str(hint))
        except Exception as error:  # whatever a student may write
            told = f"{_line(error)}{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            return Outcome(self.title, "raised", told)
        return Outcome(self.title, "proven", " ".join(filter(None, (self.proves, remark))))

    def __call__(self, *answers: Any) -> None:
        outcome = self.judge(*answers)
        RECORD.pop(self.title, None)
        RECORD[self.title] = outcome  # as the last
        print(outcome)


def check(title: str) -> Callable[[Callable[..., str | None]], Check]:
    """A decorator that makes a function a check."""
    return lambda function: Check(title, function)


def _line(error: Exception) -> str:
    """Of the student's function that raised: "Line 2: ", in its cell. Empty if it was none."""
    frames = [(frame.f_code, line) for frame, line in walk_tb(error.__traceback__)]
    wrapped = [at for at, (code, _) in enumerate(frames) if (code.co_name, code.co_filename) == ("asked", __file__)]
    return f"Line {frames[wrapped[-1] + 1][1]}: " if wrapped and len(frames) > wrapped[-1] + 1 else ""


def _asked(answer: Any) -> Any:
    """The answer; a function says Blank where it would return ..., a dictionary if one of its values is missing."""
    if answer is None or answer is ...:
        raise Blank
    if isinstance(answer, dict):
        return {key: _asked(value) for key, value in answer.items()}
    if not callable(answer):
        return answer

    @wraps(answer)
    def asked(*arguments: Any, **keywords: Any) -> Any:
        if (given := answer(*arguments, **keywords)) is None:
            errors = {"delta": "δ", "delta_prev": "δ before"}
            case = ", ".join(f"{error} = {keywords[name]:.3g}" for name, error in errors.items() if name in keywords)
            told = f"Your function gave None{f' with {case}' if case else ''}"
            raise Wrong(f"{told}: is a `return` missing, or a case not covered?")
        return _asked(given)

    return asked


def alike(found: ArrayLike, expected: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether both have the same shape and agree to rounding. TypeError for what is no number."""
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    return found.shape == expected.shape and np.allclose(found, expected, rtol=tolerance, atol=tolerance)


def hint(found: ArrayLike, mistakes: Mapping[str, ArrayLike], otherwise: str, tolerance: float = 1e-9) -> str:
    """The hint of the usual mistake that gives what was found, else `otherwise`. mistakes: by hint, what each gives."""
    return next((told for told, value in mistakes.items() if alike(found, value, tolerance)), otherwise)


def expect(found: ArrayLike, expected: ArrayLike, mistakes: Mapping[str, ArrayLike], otherwise: str) -> None:
    """Wrong, with the `hint`, unless both are alike."""
    if not alike(found, expected):
        raise Wrong(hint(found, mistakes, otherwise))
