"""What a student answers, checked: each check proves a property, and none knows an answer by heart.

A check is a function under `@check("its title")`. The first paragraph of its docstring is the property that it proves;
it takes the student's answers (numbers, arrays, functions), returns nothing, or a remark, if the property holds, and
else raises `Wrong`, by `must`. Called in a notebook, it shows one paragraph:

    proven    the property holds
    blank     an answer, or a part of it, is still None or ...
    wrong     the property does not hold, with a hint, or with the property
    behind    a rule lost a race, with the result
    raised    the student's code raised, with the line of its cell and what

Nothing that a student writes stops the notebook. The checks themselves: `lab`, `exercises`.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from functools import update_wrapper, wraps
from traceback import walk_tb
from typing import Any, Literal, NamedTuple

import numpy as np
from IPython.display import display
from numpy.typing import ArrayLike

SEED = 2014  # of every random trial


class Wrong(Exception):
    """The property does not hold. Its text is the hint, if there is one."""


class Behind(Exception):
    """A rule lost a race, which is a result and no mistake. Its text is the result."""


class Blank(Exception):
    """There is no answer yet. Its text says what is missing, if a part is there."""


Verdict = Literal["proven", "blank", "wrong", "behind", "raised"]
MARKS: dict[Verdict, str] = {"proven": "✓", "blank": "○", "wrong": "✗", "behind": "▽", "raised": "⚠"}


class Outcome(NamedTuple):
    """What a check says. message: the property if proven, else the hint, the result, or what was raised."""

    title: str
    verdict: Verdict
    message: str

    def __repr__(self) -> str:
        return f"{self.title}: {self.verdict}. {self.message}"

    def _repr_markdown_(self) -> str:
        """For notebooks, which break what is printed in mid-word, and Markdown between words."""
        words = re.split("(`[^`]*`)", self.message)
        words[::2] = [re.sub(r"([\\*_<$\[])", r"\\\1", part) for part in words[::2]]
        return f"{self.title}: **{MARKS[self.verdict]} {self.verdict}.** {''.join(words)}"


RECORD: dict[str, Outcome] = {}  # the last outcome of each check, by its title
ABOUT: dict[str, Any] = {}  # of those that are proven or behind: what they are about, by their title


class Check:
    """A check with its title. Calling it shows and records what `judge` says, and what the answers are about."""

    def __init__(self, title: str, function: Callable[..., str | None], about: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self.title, self._function, self._about = title, function, about

    @property
    def proves(self) -> str:
        """The property: the first paragraph of the docstring, in one line."""
        return " ".join((self.__doc__ or "").split("\n\n")[0].split())

    def judge(self, *answers: Any) -> Outcome:
        """The outcome for these answers. Raises nothing, whatever they are."""
        try:
            remark = self._function(*map(_guarded, answers))
        except Blank as missing:
            return Outcome(self.title, "blank", str(missing) or "Nothing is checked yet.")
        except Wrong as hint:
            return Outcome(self.title, "wrong", str(hint) or f"This must hold: {self.proves}")
        except Behind as result:
            return Outcome(self.title, "behind", str(result))
        except Exception as error:  # whatever a student may write
            what = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            return Outcome(self.title, "raised", f"{_place(error)}{what}")
        return Outcome(self.title, "proven", f"{self.proves} {remark or ''}".rstrip())

    def __call__(self, *answers: Any) -> None:
        RECORD[self.title] = outcome = self.judge(*answers)
        ABOUT[self.title] = self._about(*answers) if outcome.verdict in ("proven", "behind") else None
        display(outcome)  # type: ignore[no-untyped-call]


def check(title: str, about: Callable[..., Any] = lambda *_: None) -> Callable[[Callable[..., str | None]], Check]:
    """A decorator that makes a function a check. about: of the answers, what they depend on that may change later."""
    return lambda function: Check(title, function, about)


def must(holds: Any, hint: str = "") -> None:
    """Raises Wrong, with this hint, unless it holds."""
    if not holds:
        raise Wrong(hint)


def alike(answer: ArrayLike, right: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether both have the same shape and agree to rounding. Raises TypeError or ValueError for what is no number."""
    answer, right = np.asarray(answer, dtype=float), np.asarray(right, dtype=float)
    return answer.shape == right.shape and np.allclose(answer, right, rtol=tolerance, atol=tolerance)


def first_of(mistakes: Mapping[str, bool]) -> str:
    """The name of the first mistake that was made, else "otherwise"."""
    return next((name for name, made in mistakes.items() if made), "otherwise")


def mistake_in(answer: ArrayLike, gives: Mapping[str, ArrayLike]) -> str:
    """The name of the first mistake that gives this answer, else "otherwise"."""
    return first_of({name: alike(answer, value) for name, value in gives.items()})


def complete(answers: Any, keys: Sequence[Any]) -> None:
    """Raises Wrong for what is no dictionary with these keys."""
    must(isinstance(answers, Mapping), f"Write a dictionary: `{{{', '.join(f'{key!r}: ...' for key in keys)}}}`.")
    for key in keys:
        must(key in answers, f"{key} is missing.")


def _guarded(answer: Any) -> Any:
    """The answer. Raises Blank if it, or a value of a dictionary, is missing; a function does so when it is called."""
    if answer is None or answer is ...:
        raise Blank
    if isinstance(answer, dict):
        empty = [str(key) for key, value in answer.items() if value is None or value is ...]
        if empty:
            raise Blank(f"Still to fill in: {', '.join(empty)}." if len(empty) < len(answer) else "")
        return answer
    if not callable(answer):
        return answer

    @wraps(answer)
    def guarded(*arguments: Any, **keywords: Any) -> Any:
        if (value := answer(*arguments, **keywords)) is None:
            errors = {"delta": "δ", "delta_prev": "δ before"}
            case = ", ".join(f"{error} = {keywords[name]:.3g}" for name, error in errors.items() if name in keywords)
            given = f" with {case}" if case else ""
            raise Wrong(f"Your function gave None{given}: is a `return` missing, or a case not covered?")
        return _guarded(value)

    return guarded


def _place(error: Exception) -> str:
    """Where in its cell the student's function raised, as "Line 2: ". Empty if it was none."""
    frames = [(frame.f_code, line) for frame, line in walk_tb(error.__traceback__)]
    calls = [at for at, (code, _) in enumerate(frames) if (code.co_name, code.co_filename) == ("guarded", __file__)]
    return f"Line {frames[calls[-1] + 1][1]}: " if calls and len(frames) > calls[-1] + 1 else ""
