"""Kill a small sweep at random moments, start it again, and see that nothing is lost: `python -m tests.kills [KILLS]`.

Killed with -9 is everything at once, the parent of the workers alone, or one worker alone. After each kill, every file
that stood before stands untouched, and every whole file has the bytes of a sweep that nobody disturbed. A sweep that
comes to its end has left exactly those files, and another one begins.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import cycle
from pathlib import Path

import psutil

from homing_lib.publish.cli import main
from homing_lib.settings import Settings
from homing_lib.study import measures, runs, studies
from homing_lib.study.runs import Study, sweep

ROOT = Path(__file__).parent.parent
SMALL = Settings(episodes=2, survey_steps=60, max_steps=40, image_size=16, bin_size=32)
STUDY = Study(
    "small",
    "To be killed.",
    {"form 2": SMALL, "random": Settings(images="compact", controller="random", episodes=2, max_steps=40)},
    (0, 1, 2, 10, 11),
    measures.curve,
)
"""Of its files five hold a run that the camera made, and two some runs on an atlas."""

VICTIMS = (("everything", 1), ("the parent", 2), ("one worker", 2), ("everything", 2))
"""Who is killed, and how many workers there are, in turns."""

Contents = dict[str, bytes]


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


def place_of(study: Study, number: int) -> Path:
    """Where the file is stored that is made as the first (0), the second (1), ..."""
    settings, seeds = study.jobs()[number]
    return runs.path_of(study.folder, settings, *seeds)


@contextmanager
def stored_in(folder: Path) -> Iterator[None]:
    """Studies are stored below this folder."""
    before = runs.DATA, runs.SCRATCH
    runs.DATA, runs.SCRATCH = folder / "data", folder / "scratch"
    try:
        yield
    finally:
        runs.DATA, runs.SCRATCH = before


def undisturbed(folder: Path) -> Contents:
    """What the study stores if nobody disturbs it."""
    with stored_in(folder):
        sweep(STUDY, workers=1)
    return contents(folder)


def start(folder: Path, *arguments: str, environment: Mapping[str, str] | None = None) -> subprocess.Popen[str]:
    """`homing data` of the study in a process group of its own, on a slow disk. Returns when it begins."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.kills", "--sweep", str(folder), *arguments],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n", process.communicate()
    return process


def _swept(folder: Path, arguments: list[str]) -> int:
    quick = Path.write_bytes

    def slow(path: Path, content: bytes) -> int:
        quick(path, content[: len(content) // 2])
        time.sleep(0.06)
        return quick(path, content)

    Path.write_bytes = slow  # type: ignore[method-assign, assignment]
    studies.in_order = lambda: iter([STUDY])
    with stored_in(folder):
        print("ready", flush=True)
        return main(["data", STUDY.name, *arguments])


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The processes that compute for a sweep."""
    found = []
    for child in psutil.Process(process.pid).children():
        with suppress(psutil.Error):  # it has just ended
            if any("LokyProcess" in word for word in child.cmdline()):
                found.append(child.pid)
    return found


def end(process: subprocess.Popen[str]) -> None:
    """Leave nothing of a sweep running."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def last_line(errors: str) -> str:
    """What stands below the progress."""
    return errors.strip().rpartition("\n")[2].rpartition("\r")[2]


def torment(folder: Path, kills: int, seed: int = 0) -> Counter[str]:
    """Kill so many times; raises AssertionError if anything is lost. Returns what happened how often."""
    rng, done = random.Random(seed), Counter[str]()
    began = time.monotonic()
    whole = undisturbed(folder / "undisturbed")
    duration = time.monotonic() - began
    disturbed = folder / "disturbed"
    for number, (victim, workers) in enumerate(cycle(VICTIMS), 1):
        before = written(disturbed)
        process = start(disturbed, "--workers", str(workers))
        moment = rng.uniform(0, duration + workers)
        try:
            code, errors = _kill(process, victim, moment)
        finally:
            end(process)
        after, left = written(disturbed), leftovers(disturbed)
        assert before.items() <= after.items(), "a stored run was lost or written again"
        assert contents(disturbed).items() <= whole.items(), "a file differs from that of the undisturbed sweep"
        if code == 0:
            assert contents(disturbed) == whole, "the sweep ended without all of its files"
            assert not left, "what was being written was not cleared away"
            shutil.rmtree(disturbed)
            done["sweeps ended"] += 1
            print(f"{number:4}. ended with {len(after)} files and the same bytes as undisturbed", flush=True)
        else:
            done["kills"] += 1
            done[victim] += 1
            done["found in mid-write"] += bool(left)
            state = f"{len(after)} of {len(STUDY.jobs())} files stored" + ", one in mid-write" * bool(left)
            print(f"{number:4}. killed {victim} after {moment:.2f} s: {state}", flush=True)
            if victim == "one worker":
                assert code == 1, errors
                assert last_line(errors).startswith("homing: a worker process was killed"), errors
        if done["kills"] == kills:
            break
    with stored_in(disturbed):
        sweep(STUDY, workers=1)
    assert contents(disturbed) == whole
    assert not leftovers(disturbed)
    return done


def _kill(process: subprocess.Popen[str], victim: str, moment: float) -> tuple[int, str]:
    """Kill at a moment, or, a worker, as soon as there is one. Returns the exit code and the errors."""
    deadline = time.monotonic() + moment
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.002)
    if victim == "everything" and process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    elif victim == "the parent":
        process.kill()
    else:
        while process.poll() is None and not (workers := workers_of(process)):
            time.sleep(0.002)
        if process.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(workers[0], signal.SIGKILL)
    if victim != "one worker":
        process.wait()
        end(process)  # its workers hold its pipes open
        return process.returncode, ""
    _, errors = process.communicate(timeout=120)
    return process.returncode, errors


if __name__ == "__main__":
    if sys.argv[1:2] == ["--sweep"]:
        sys.exit(_swept(Path(sys.argv[2]), sys.argv[3:]))
    with tempfile.TemporaryDirectory() as temporary:
        happened = torment(Path(temporary), int(sys.argv[1]) if sys.argv[1:] else 100)
    print("nothing was lost: " + ", ".join(f"{name} {times}" for name, times in happened.items()))
