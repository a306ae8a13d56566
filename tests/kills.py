"""A small sweep in processes of its own, to be killed and interrupted; `python -m tests.kills FOLDER [OPTION...]`."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from homing_lib.publish.cli import main
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import runs, studies
from homing_lib.study.runs import Study
from homing_lib.study.sweep import sweep

Process = subprocess.Popen[str]
Contents = dict[str, bytes]


def slowly(settings: Settings, seed: int) -> runs.Columns:
    """A measure that takes its time, and no robot."""
    time.sleep(0.2)
    return {"number": np.array([seed, settings.alpha0]), "late": np.array([False, True])}


STUDY = Study(
    "small",
    "To be killed.",
    {"alone": Settings(), "together": Settings(images="compact"), "again": Settings()},
    (0, 1, 2, 10, 11),
    slowly,
)
"""Of its files five hold one run each, and two hold three and two runs."""


def contents(folder: Path) -> Contents:
    """Every file below a folder by its path, but for what was being written."""
    files = [path for path in folder.rglob("*") if path.is_file() and ".part" not in path.name]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def written(folder: Path) -> dict[Path, int]:
    """When each stored run was written."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("[!.]*.npz")}


def leftovers(folder: Path) -> list[Path]:
    """What was being written when somebody was killed."""
    return list(folder.rglob(".*.part*"))


@contextmanager
def stored_in(folder: Path) -> Iterator[None]:
    """Studies are stored below this folder."""
    before = runs.DATA, runs.SCRATCH
    runs.DATA, runs.SCRATCH = folder / "data", folder / "scratch"
    try:
        yield
    finally:
        runs.DATA, runs.SCRATCH = before


def undisturbed(folder: Path, study: Study = STUDY) -> Contents:
    """What a study stores if nobody disturbs it."""
    with stored_in(folder):
        sweep(study, workers=1)
    return contents(folder)


@contextmanager
def started(folder: Path, *options: str, environment: Mapping[str, str] | None = None) -> Iterator[Process]:
    """The command that computes the study, in a process group of its own; nothing of it is left in the end."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.kills", str(folder), *options],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def workers_of(process: Process) -> list[int]:
    """The processes that compute for a sweep."""
    found = []
    for child in psutil.Process(process.pid).children():
        with suppress(psutil.Error):  # it has just ended
            if any("LokyProcess" in word for word in child.cmdline()):
                found.append(child.pid)
    return found


def lives(process: int) -> bool:
    """Whether it is still at work."""
    return psutil.pid_exists(process) and psutil.Process(process).status() != psutil.STATUS_ZOMBIE


def wait_for(what: Callable[[], Any], seconds: float = 60) -> None:
    """Until it is so."""
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def said(errors: str) -> list[str]:
    """The lines of standard error, but for the progress."""
    return [line for line in errors.replace("\r", "\n").splitlines() if line.strip() and "small: runs:" not in line]


if __name__ == "__main__":
    from tests import kills  # so that workers find the measure under its name

    studies.in_order = lambda: iter([kills.STUDY])
    with stored_in(Path(sys.argv[1])):
        sys.exit(main(["data", STUDY.name, *sys.argv[2:]]))
