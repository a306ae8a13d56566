"""Processes: what a worker does first, and what joblib says of parallel work that concerns no user."""

import gc
import os
import signal
import sys
import threading
import time
import warnings
from typing import Any

import psutil
from joblib.externals.loky import process_executor


def init_worker(parent: int) -> None:
    """The initializer of a pool: a worker leaves Ctrl-C to its parent, and ends when that is gone.

    parent: the process that started it.
    """

    def end_with_parent() -> None:
        while os.getppid() == parent and psutil.pid_exists(parent):  # the first never changes on Windows
            time.sleep(2)
        os._exit(1)  # whatever it waits for: a pipe, or a lock, that nobody serves any more

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    process_executor._MAX_MEMORY_LEAK_SIZE = 2**40  # the atlases that a worker keeps are no leak, to end it for
    gc.set_threshold(100_000)  # the many numbers of an episode are no cycles to look for
    threading.Thread(target=end_with_parent, daemon=True).start()


_before = threading.excepthook
_TRACKER = "ignore:resource_tracker"  # a process that inherits this, and removes what an end left of semaphores


def quieten() -> None:
    """Leave unsaid, from here on in this process, how parallel work ended early, which has been said in one line
    already, and that a worker was replaced, since the views that are kept there look like a leak.

    It may come late, when all else is done.
    """
    threading.excepthook = _unless_it_is_lokys
    early, replaced = "[0-9]+ tasks (have been successfully|which were still)", "A worker stopped while some jobs"
    warnings.filterwarnings("ignore", f"{early}|{replaced}", UserWarning)
    if _TRACKER not in sys.warnoptions:
        sys.warnoptions.append(_TRACKER)


def _unless_it_is_lokys(what: Any) -> None:
    """The thread that hands out tasks stumbles over those that were cancelled meanwhile."""
    if what.exc_type is not KeyError or "loky" not in type(what.thread).__module__:
        _before(what)
