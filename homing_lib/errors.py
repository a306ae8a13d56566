"""What goes wrong by no fault of the code: one line that says what, where and the remedy."""

from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from inspect import signature
from math import isfinite, nan
from operator import index
from typing import Any, SupportsFloat

import numpy as np

RESUMES = "what was finished is kept; the same command resumes from there"  # said of a command that was stopped


class UserError(Exception):
    """A mistake that the user can mend: one line that says what, where and the remedy."""


class DamagedFile(UserError):
    """A file that is there and cannot be read: one line that names it and says what is wrong."""


def shown(value: Any) -> str:
    """A value as a line of an error shows it: as in Python, on one line, and short."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def nearest(name: Any, known: Iterable[str]) -> str:
    """ "; did you mean ...?" if one of the known names is much like this one, else nothing."""
    return "".join(f"; did you mean {like}?" for like in get_close_matches(str(name)[:60], list(known), 1))


def _number(value: Any) -> float:
    """The value as a float; NaN for what is no number, or too large for one."""
    try:
        return float(value) if isinstance(value, SupportsFloat) else nan
    except (TypeError, ValueError, OverflowError):
        return nan


def finite(name: str, value: float) -> float:
    """The value as a float, or ValueError unless it is finite."""
    if not isfinite(number := _number(value)):
        raise ValueError(f"{name} must be a finite number, got {shown(value)}")
    return number


def unit_interval(name: str, value: float) -> float:
    """The value as a float, or ValueError unless it lies in [0, 1]."""
    if not 0 <= (number := _number(value)) <= 1:
        raise ValueError(f"{name} must lie in [0, 1], got {shown(value)}")
    return number


def one_of(name: str, value: str, known: tuple[str, ...]) -> None:
    """ValueError, with the list of what is known, unless the value is in it."""
    if value not in known:
        raise ValueError(f"unknown {name} {shown(value)}; known: {', '.join(known)}")


def seed_of(what: str, seed: Any) -> Any:
    """A seed as Python's own number, or a SeedSequence as it is. Raises UserError for anything else, None too."""
    with suppress(TypeError):
        if isinstance(seed, np.random.SeedSequence) or index(seed) >= 0:
            return seed if isinstance(seed, np.random.SeedSequence) else index(seed)
    raise UserError(f"{what} = {shown(seed)}: must be 0, 1, 2, ...")


def misfit(function: Any, *arguments: Any, **named: Any) -> str:
    """Why something cannot be called with these arguments, in one line; "" if it can."""
    try:
        signature(function).bind(*arguments, **named)
    except TypeError as error:
        return " ".join(str(error)[:90].split())
    except ValueError:
        pass  # one of C, which keeps its signature to itself
    return ""
