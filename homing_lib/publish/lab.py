"""What a student answers, checked: each check proves a property, and none knows an answer by heart.

A check is a function under `@check("its title")`. The first paragraph of its docstring is the property that it proves;
it takes the student's answers (numbers, arrays, functions), returns nothing, or a remark, if the property holds, and
else raises `Wrong` with a hint. Called in a notebook, it prints one line; `report` prints all of them once more:

    proven    the property holds
    blank     an answer is None or ..., or a function that returns such
    wrong     it does not hold, with the hint
    raised    the student's code raised, with what

Nothing that a student writes stops the notebook. Trials are random, from a generator of a given seed.
"""

from collections.abc import Callable, Mapping
from functools import update_wrapper, wraps
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike


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


RECORD: dict[str, Outcome] = {}  # what was found last, by title


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
            return Outcome(self.title, "raised", f"{type(error).__name__}: {' '.join(str(error).split())[:200]}")
        return Outcome(self.title, "proven", " ".join(filter(None, (self.proves, remark))))

    def __call__(self, *answers: Any) -> None:
        RECORD[self.title] = outcome = self.judge(*answers)
        print(outcome)


def check(title: str) -> Callable[[Callable[..., str | None]], Check]:
    """A decorator that makes a function a check."""
    return lambda function: Check(title, function)


def report() -> None:
    """Print what was proven, and how much of all that was checked."""
    for outcome in RECORD.values():
        print(outcome)
    proven = sum(outcome.verdict == "proven" for outcome in RECORD.values())
    print(f"{proven} of {len(RECORD)} proven.")


def _asked(answer: Any) -> Any:
    """The answer; a function says Blank where it would return nothing."""
    if answer is None or answer is ...:
        raise Blank
    if not callable(answer):
        return answer

    @wraps(answer)
    def asked(*arguments: Any, **keywords: Any) -> Any:
        return _asked(answer(*arguments, **keywords))

    return asked


def alike(found: ArrayLike, expected: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether both have the same shape and agree to rounding. TypeError for what is no number."""
    found, expected = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    return found.shape == expected.shape and np.allclose(found, expected, rtol=tolerance, atol=tolerance)


def expect(found: ArrayLike, expected: ArrayLike, mistakes: Mapping[str, ArrayLike], otherwise: str) -> None:
    """Wrong unless both are alike: with the hint of the usual mistake that gives what was found, or `otherwise`.

    mistakes: by hint, what the mistake would have given.
    """
    if not alike(found, expected):
        raise Wrong(next((hint for hint, value in mistakes.items() if alike(found, value)), otherwise))
