"""A sweep on a Dask cluster: real processes on this machine, killed like any other, and the same bytes."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.kills import ROOT, STUDY, contents, end, last_line, leftovers, start, undisturbed, written

Process = subprocess.Popen[bytes]


def dask(*arguments: str) -> Process:
    """A part of a cluster, in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1", "--no-dashboard"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, Process, list[Process]]]:
    """The address of a scheduler, its process, and its two workers: one of one thread, one of two."""
    described = folder / "scheduler.json"
    common = ("--scheduler-file", str(described))
    processes = [dask("scheduler", "--port", "0", *common)]
    try:
        for threads in (1, 2):
            processes.append(
                dask(
                    *("worker", *common, "--nthreads", str(threads), "--no-nanny"),
                    *("--local-directory", str(folder)),
                )
            )
        wait_for(lambda: described.exists() and described.read_text().endswith("}"))
        yield json.loads(described.read_text())["address"], processes[0], processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def wait_for(what, seconds=60):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_a_cluster_that_loses_a_worker_in_mid_sweep_stores_the_same_bytes_as_this_machine_alone(tmp_path):
    whole = undisturbed(tmp_path / "alone")
    with cluster(tmp_path) as (address, _, workers):
        process = start(tmp_path / "cluster", "--cluster", address)
        try:
            wait_for(lambda: len(written(tmp_path / "cluster")) >= 2)
            os.kill(workers[0].pid, signal.SIGKILL)
            found = len(written(tmp_path / "cluster"))
            output, errors = process.communicate(timeout=120)
        finally:
            end(process)
    assert found < len(STUDY.jobs())
    assert process.returncode == 0, errors
    assert output == "small: 10 runs computed, 10 stored\n"
    assert contents(tmp_path / "cluster") == whole


def test_a_cluster_that_loses_its_scheduler_says_so_in_one_line_and_what_was_finished_is_kept(tmp_path):
    with cluster(tmp_path) as (address, scheduler, _):
        process = start(tmp_path / "cluster", "--cluster", address)
        try:
            wait_for(lambda: written(tmp_path / "cluster"))
            scheduler.kill()
            _, errors = process.communicate(timeout=120)
        finally:
            end(process)
    assert process.returncode == 1
    assert "Traceback" not in errors
    assert last_line(errors) == (
        f"homing: --cluster {address}: the connection to the Dask scheduler was lost; "
        "what was finished is kept; the same command resumes from there"
    )
    assert 0 < len(written(tmp_path / "cluster")) < len(STUDY.jobs())
    assert not leftovers(tmp_path / "cluster")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def refused(folder, address):
    """What a sweep on no cluster says on standard error, having ended with 1."""
    process = start(folder, "--cluster", address)
    try:
        _, errors = process.communicate(timeout=60)
    finally:
        end(process)
    assert process.returncode == 1
    return errors


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:{port}", "nowhere"])
def test_an_address_without_a_scheduler_is_refused_in_one_line(address, tmp_path):
    address = address.format(port=free_port())
    began = time.monotonic()
    errors = refused(tmp_path, address)
    assert time.monotonic() - began < 20
    assert "Traceback" not in errors
    assert last_line(errors).startswith(f"homing: --cluster {address}: no Dask scheduler answers there (")
    assert not contents(tmp_path)


@pytest.mark.parametrize("scheme", ["tcp", "tls", "ucx", "nothing"])
def test_what_is_no_scheduler_is_refused_in_one_line_within_some_seconds(scheme, tmp_path):
    with socket.socket() as silent:  # takes whoever comes, and never says a word
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = "" if scheme == "nothing" else f"{scheme}://127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        errors = refused(tmp_path, address)
    assert time.monotonic() - began < 25  # of which loading it takes some
    (line,) = errors.strip().splitlines()
    assert line.startswith("homing: --cluster")
    assert not contents(tmp_path)
