"""What joblib says when parallel work ends early, by an error or an interrupt: it has been said in one line already."""

import threading
import warnings
from typing import Any

_before = threading.excepthook


def quieten() -> None:
    """Leave that unsaid, from here on in this process: it may come late, when all else is done."""
    threading.excepthook = _unless_it_is_lokys
    warnings.filterwarnings("ignore", "[0-9]+ tasks (have been successfully|which were still)", UserWarning)


def _unless_it_is_lokys(what: Any) -> None:
    """The thread that hands out tasks stumbles over those that were cancelled meanwhile."""
    if what.exc_type is not KeyError or "loky" not in type(what.thread).__module__:
        _before(what)
