"""Processes: calls on all cores, a Ctrl-C that stops them cleanly, and no noise about either."""

import gc
import multiprocessing.resource_tracker
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Any

import joblib
import psutil
from joblib.externals.loky import process_executor
from joblib.externals.loky.backend import resource_tracker

from homing_lib.errors import RESUMES, UserError


def results(function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], *, workers: int = -1) -> Iterator[Any]:
    """What the function returns for each job, a tuple of its arguments, as soon as it is done.

    workers: processes on this machine, -1 for one per core. Raises UserError when workers are lost.
    """
    quieten()
    how: dict[str, Any] = {"n_jobs": min(workers, len(jobs)), "initializer": init_worker, "initargs": (os.getpid(),)}
    done: Any = None
    try:
        with _interrupts_later():
            parallel = joblib.Parallel(return_as="generator_unordered", **how)
            done = parallel(joblib.delayed(function)(*job) for job in jobs)
        yield from done
    except BrokenProcessPool:
        raise UserError(f"a worker process was killed (too little memory?); {RESUMES}") from None
    finally:
        del done  # which stops what still goes on


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


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Ctrl-C counts when the block ends, whichever thread it reaches, and never in processes that are started in it."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    came: list[Any] = []
    before = signal.signal(signal.SIGINT, lambda *what: came.append(what))
    resource_tracker.ensure_running()  # both trackers unblock it when they start
    multiprocessing.resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which processes inherit
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if came and callable(before):
        before(*came[0])


# --- Left unsaid ------------------------------------------------------------------------------------------------------

_TRACKER = "ignore:resource_tracker"  # a process that inherits this, and removes what an end left of semaphores


def quieten() -> None:
    """From here on, in this process, suppress two kinds of noise: how parallel work ended early, which was said in one
    line already, and that a worker was replaced, since the atlases it keeps look like a leak.
    """
    if getattr(threading.excepthook, "func", None) is not _hook_without_loky:
        threading.excepthook = partial(_hook_without_loky, threading.excepthook)
    early, replaced = "[0-9]+ tasks (have been successfully|which were still)", "A worker stopped while some jobs"
    warnings.filterwarnings("ignore", f"{early}|{replaced}", UserWarning)
    if _TRACKER not in sys.warnoptions:
        sys.warnoptions.append(_TRACKER)


def _hook_without_loky(before: Callable[[Any], object], what: Any) -> None:
    """A thread's excepthook: passes on to `before` all but loky's KeyError over a task cancelled meanwhile."""
    if what.exc_type is not KeyError or "loky" not in type(what.thread).__module__:
        before(what)
