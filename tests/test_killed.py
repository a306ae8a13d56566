"""A sweep may be killed at any moment: the next one keeps what is there and stores the same in the end."""

import os
import shutil
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

from homing_lib import agent
from homing_lib.agent import run
from homing_lib.study import runs
from homing_lib.study.runs import load_study, load_table
from homing_lib.study.sweep import sweep
from tests.kills import contents, leftovers, stored_in, written
from tests.test_sweep import ATLAS, TABLE, WHOLE, both_kinds, earlier, numbers


@pytest.fixture
def here(tmp_path):
    with stored_in(tmp_path):
        yield tmp_path


def dies(study, point, force):
    """Sweep in a process that is killed at its point-th moment: in the midst of a write, before or after a renaming,
    or when a file is removed. Returns its exit code."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    moments = count()

    def moment(before=lambda: None):
        if next(moments) == point:
            before()
            os._exit(9)

    def mortal_write(path, content):
        moment(lambda: write(path, content[: len(content) // 2]))
        write(path, content)

    def mortal_replace(path, target):
        moment()
        replace_file(path, target)
        moment()

    def mortal_unlink(path, **options):
        unlink(path, **options)
        if ".part" not in path.name:
            moment()

    write, replace_file, unlink = Path.write_bytes, Path.replace, Path.unlink
    Path.write_bytes, Path.replace, Path.unlink = mortal_write, mortal_replace, mortal_unlink
    try:
        sweep(study, workers=1, force=force)
        os._exit(0)
    finally:
        os._exit(1)


def renamed(settings, seed):
    """Other results under the name of `numbers`."""
    return {name: column + 1 for name, column in numbers(settings, seed).items()}


renamed.__name__ = renamed.__qualname__ = "numbers"


@both_kinds
@pytest.mark.parametrize("before", ["nothing", "other seeds", "other results"])
def test_wherever_it_is_killed_the_next_sweep_keeps_what_is_there_and_ends_with_the_same_bytes(
    study, before, here, monkeypatch
):
    monkeypatch.setattr(runs, "LEFTOVER_S", -1)
    few = replace(study, given={"atlas": ATLAS}, seeds=(4, 5) if study is WHOLE else (4, 11))
    sweep(few, workers=1)
    whole = contents(here / "data")
    for point in count():
        shutil.rmtree(here)
        here.mkdir()
        if before == "other seeds":
            earlier(replace(few, seeds=(4, 12)), monkeypatch)
        if before == "other results":
            with monkeypatch.context() as patch:
                patch.setattr(agent, "run", lambda settings, seed: replace(run(settings, seed), diverged=1))
                earlier(replace(few, measure=few.measure and renamed), monkeypatch)
        force = before == "other results"
        if (code := dies(few, point, force)) == 0:
            break
        assert code == 9
        there = written(here)
        try:
            load_table(few) if few.measure else load_study(few)
        except runs.UserError as error:  # never of what it was in the midst of
            assert "damaged file" not in str(error)
        sweep(few, workers=1, force=force)
        assert whole.items() <= contents(here / "data").items()
        assert not leftovers(here)
        assert before != "nothing" or there.items() <= written(here).items()
    assert point >= 7


def test_what_a_killed_process_was_writing_is_cleared_away_after_an_hour_and_nothing_else(here):
    TABLE.folder.mkdir(parents=True)
    ages = {".a-1.17.part.npz": 3700, ".a.18.part.parquet": 3700, ".a.19.part.npz": 3500, ".notes.part.npz": 9999}
    for name, age in ages.items():
        (TABLE.folder / name).write_bytes(b"half")
        then = (TABLE.folder / name).stat().st_mtime - age
        os.utime(TABLE.folder / name, (then, then))
    sweep(TABLE, workers=1)
    assert sorted(path.name for path in TABLE.folder.glob(".*")) == [".a.19.part.npz", ".notes.part.npz"]
