"""What goes wrong by no fault of the code: one line that says what, where and the remedy."""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

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
