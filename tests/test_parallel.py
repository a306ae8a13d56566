"""Processes are killed and interrupted: one line says so, nothing is lost, nobody is left."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from joblib.externals.loky.process_executor import _ExecutorManagerThread

from homing_lib import parallel
from homing_lib.errors import RESUMES
from tests.kills import (
    STUDY,
    contents,
    leftovers,
    lives,
    said,
    started,
    stored_in,
    sweep,
    undisturbed,
    wait_for,
    workers_of,
    written,
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What the study stores if nobody disturbs it."""
    return undisturbed(tmp_path_factory.mktemp("undisturbed"))


def test_results_come_as_soon_as_they_are_done_and_a_failure_is_raised_here():
    assert sorted(parallel.results(pow, [(2, 3), (3, 2)], workers=1)) == [8, 9]
    order = [*parallel.results(napped, [(1.0,), (0.0,)], workers=2)]
    assert order == [0.0, 1.0]
    with pytest.raises(ZeroDivisionError):
        list(parallel.results(divmod, [(1, 0)], workers=1))


def napped(seconds):
    time.sleep(seconds)
    return seconds


def test_of_two_sweeps_one_is_killed_its_workers_go_and_the_other_ends_with_the_same_bytes(tmp_path, whole):
    with started(tmp_path, "--workers", "2") as killed, started(tmp_path, "--workers", "1") as other:
        wait_for(lambda: len(workers_of(killed)) == 2 and written(tmp_path))
        orphans = workers_of(killed)
        killed.kill()
        wait_for(lambda: not any(lives(orphan) for orphan in orphans), seconds=10)
        output, errors = other.communicate(timeout=120)
        assert other.returncode == 0, errors
    assert output == "small: 10 runs computed, 10 stored\n"
    assert contents(tmp_path) == whole


def test_a_killed_worker_is_one_line_and_the_next_sweep_goes_on_from_there(tmp_path, whole):
    with started(tmp_path, "--workers", "2") as process:
        wait_for(lambda: len(workers_of(process)) == 2 and len(written(tmp_path)) >= 2)
        os.kill(workers_of(process)[0], signal.SIGKILL)
        _, errors = process.communicate(timeout=120)
    assert (process.returncode, said(errors)) == (
        1,
        [f"homing: a worker process was killed (too little memory?); {RESUMES}"],
    )
    before = written(tmp_path)
    with stored_in(tmp_path):
        assert 0 < sweep(STUDY, workers=1) <= 8
    assert before.items() <= written(tmp_path).items()
    assert contents(tmp_path) == whole
    assert not leftovers(tmp_path)


@pytest.mark.parametrize(("threads", "moment"), [("default", "runs are stored"), ("1", "workers start")])
def test_an_interrupt_is_answered_in_one_line_and_by_nobody_else_and_what_was_finished_is_kept(
    threads, moment, tmp_path, whole
):
    """With as many threads as cores, the default, libraries have some that could take the signal."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    if threads != "default":
        environment |= {"OPENBLAS_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
    with started(tmp_path, "--workers", "2", environment=environment) as process:
        wait_for(lambda: written(tmp_path) if moment == "runs are stored" else len(workers_of(process)) == 2)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert (process.returncode, said(errors)) == (130, [f"homing: interrupted; {RESUMES}"])
    assert len(written(tmp_path)) < len(STUDY.jobs())
    assert contents(tmp_path).items() <= whole.items()


def test_an_interrupt_while_workers_are_started_is_late_but_not_lost(monkeypatch):
    call = parallel.joblib.Parallel.__call__

    def interrupted(self, *arguments):
        results = call(self, *arguments)
        os.kill(os.getpid(), signal.SIGINT)
        came.append("started")
        return results

    came = []
    monkeypatch.setattr(parallel.joblib.Parallel, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(parallel.results(napped, [(0.1,)] * 4, workers=2))
    assert came == ["started"]


# --- Left unsaid ------------------------------------------------------------------------------------------------------


def test_of_threads_that_fail_only_lokys_that_misses_a_cancelled_task_is_left_unsaid(monkeypatch):
    heard = []
    monkeypatch.setattr(threading, "excepthook", lambda what: heard.append((what.exc_type, type(what.thread).__name__)))
    parallel.quieten()

    def fail(kind, error):
        def run():
            raise error

        thread = kind.__new__(kind)
        threading.Thread.__init__(thread)
        thread.run = run
        thread.start()
        thread.join()

    fail(_ExecutorManagerThread, KeyError(5))
    fail(_ExecutorManagerThread, ValueError())
    fail(threading.Thread, KeyError(5))
    assert heard == [(ValueError, "_ExecutorManagerThread"), (KeyError, "Thread")]


@pytest.mark.parametrize("quietly", [True, False])
def test_what_an_early_end_left_of_semaphores_is_removed_without_a_word(quietly):
    left = "from joblib.externals.loky.backend.resource_tracker import register\nregister('/loky-0-gone', 'semlock')"
    quieten = "from homing_lib.parallel import quieten\nquieten()\n" if quietly else ""
    ended = subprocess.run([sys.executable, "-c", quieten + left], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0
    assert ("leaked semlock" in ended.stderr, not ended.stderr) == (not quietly, quietly)


def test_a_worker_that_has_grown_by_what_it_keeps_goes_on_without_a_word(recwarn):
    workers = {*parallel.results(growing, [(number,) for number in range(5)], workers=2)}
    assert len(workers) <= 2
    assert not [str(one.message) for one in recwarn]


KEPT = []


def growing(_):
    """400 MB are kept from the second call on, in each worker; which it is."""
    KEPT.append(bytearray(b"x") * (400_000_000 if len(KEPT) == 1 else 1))
    time.sleep(0.6)
    return os.getpid()
