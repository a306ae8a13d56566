"""Processes: calls on all cores or on a cluster, a Ctrl-C that stops them cleanly, and no noise about either."""

import asyncio
import gc
import logging
import multiprocessing.resource_tracker
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any

import joblib
import psutil
from joblib.externals.loky import process_executor
from joblib.externals.loky.backend import resource_tracker

from homing_lib.errors import RESUMES, UserError

PATIENCE_S = 5  # in which a Dask scheduler answers


def results(
    function: Callable[..., Any], jobs: Sequence[tuple[Any, ...]], *, workers: int = -1, cluster: str | None = None
) -> Iterator[Any]:
    """What the function returns for each job, a tuple of its arguments, as soon as it is done.

    workers: processes on this machine, -1 for one per core; cluster: address of a Dask scheduler to use instead. Raises
    UserError if no scheduler answers, or when workers are lost.
    """
    quieten()
    client = _connected(cluster) if cluster is not None else None
    how: dict[str, Any] = {"n_jobs": min(workers, len(jobs)), "initializer": init_worker, "initargs": (os.getpid(),)}
    done: Any = None
    try:
        with _interrupts_later(), joblib.parallel_config("dask", client=client) if client else nullcontext():
            parallel = joblib.Parallel(return_as="generator_unordered", **({} if client else how))
            done = parallel(joblib.delayed(function)(*job) for job in jobs)
        yield from done
    except BrokenProcessPool:
        raise UserError(f"a worker process was killed (too little memory?); {RESUMES}") from None
    except CancelledError:
        raise UserError(f"--cluster {cluster}: the connection to the Dask scheduler was lost; {RESUMES}") from None
    except Exception as error:
        if type(error).__name__ != "KilledWorker":  # of `distributed`, which is slow to import
            raise
        raise UserError(f"--cluster {cluster}: workers keep dying of the same run; {RESUMES}") from None
    finally:
        del done  # which stops what still goes on
        if client:
            client.close()


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


def _connected(address: str) -> Any:
    """A client of the Dask scheduler there. Raises UserError if none answers within some seconds."""
    from distributed import Client
    from distributed.core import rpc

    async def kind() -> str:
        async with rpc(address, timeout=PATIENCE_S) as there:
            return str((await there.identity())["type"])

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what it would say at length is said here
    try:
        # Asked first, since a client waits for ever for a server that is no scheduler.
        if (what := asyncio.run(asyncio.wait_for(kind(), 1.6 * PATIENCE_S))) != "Scheduler":
            raise OSError(f"a {what} does")
        return Client(address, timeout=PATIENCE_S, set_as_default=False)
    except Exception as error:  # addresses and servers of other kinds raise what they like
        why = " ".join(str(error).split())[:120] or "what is there does not speak as one"
        raise UserError(f"--cluster {address}: no Dask scheduler answers there ({why})") from None


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
