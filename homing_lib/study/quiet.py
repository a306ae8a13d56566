"""What joblib says of parallel work that concerns no user: how it ended early, which has been said in one line already,
and that it replaced a worker, since the views that are kept there look like a leak.
"""

import sys
import threading
import warnings
from typing import Any

_before = threading.excepthook
_TRACKER = "ignore:resource_tracker"  # a process that inherits this, and removes what an end left of semaphores


def quieten() -> None:
    """Leave that unsaid, from here on in this process: it may come late, when all else is done."""
    threading.excepthook = _unless_it_is_lokys
    early, replaced = "[0-9]+ tasks (have been successfully|which were still)", "A worker stopped while some jobs"
    warnings.filterwarnings("ignore", f"{early}|{replaced}", UserWarning)
    if _TRACKER not in sys.warnoptions:
        sys.warnoptions.append(_TRACKER)


def _unless_it_is_lokys(what: Any) -> None:
    """The thread that hands out tasks stumbles over those that were cancelled meanwhile."""
    if what.exc_type is not KeyError or "loky" not in type(what.thread).__module__:
        _before(what)
