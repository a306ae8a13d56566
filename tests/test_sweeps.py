"""A sweep may be stopped, killed, doubled and damaged at any moment: what it stores in the end is the same."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import joblib
import numpy as np
import pandas as pd
import psutil
import pytest
from joblib.externals.loky.process_executor import _ExecutorManagerThread

from homing_lib import parallel
from homing_lib.agent import run
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays
from homing_lib.study import runs
from homing_lib.study.runs import load_study, load_table, path_of, sweep
from tests import kills
from tests.kills import (
    SMALL,
    STUDY,
    contents,
    end,
    leftovers,
    place_of,
    start,
    stored_in,
    undisturbed,
    workers_of,
    written,
)
from tests.test_runs import refusal

FEW = replace(STUDY, seeds=range(3), conditions={"form 2": SMALL, "random": SMALL.with_changes(controller="random")})
VARY = ("controller",)  # the setting that is a column of its table
WHOLE_RUNS = replace(FEW, measure=None)
GOES_ON = "what was finished is kept; the same command resumes from there"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """No test reads or writes the project's own data."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    return tmp_path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What `STUDY` stores if nobody disturbs it."""
    return undisturbed(tmp_path_factory.mktemp("undisturbed"))


def wait_for(what, seconds=60):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def lives(process):
    return psutil.pid_exists(process) and psutil.Process(process).status() != psutil.STATUS_ZOMBIE


# Killed, doubled, interrupted


def test_kills_at_random_moments_lose_nothing(tmp_path):
    """The whole hundred: `python -m tests.kills`."""
    assert kills.torment(tmp_path, 4)["kills"] == 4


def test_of_three_sweeps_at_once_one_is_killed_and_the_others_end_with_the_same_bytes(here, whole):
    sweeps = [start(here, "--workers", "1") for _ in range(3)]
    try:
        wait_for(lambda: written(here))
        sweeps[0].kill()
        for process in sweeps[1:]:
            _, errors = process.communicate(timeout=120)
            assert process.returncode == 0, errors
    finally:
        for process in sweeps:
            end(process)
    assert contents(here) == whole


def test_the_workers_of_a_killed_parent_go_by_themselves_within_ten_seconds(here):
    process = start(here, "--workers", "2")
    try:
        wait_for(lambda: len(workers_of(process)) == 2 and written(here))
        orphans = workers_of(process)
        process.kill()
        wait_for(lambda: not any(lives(orphan) for orphan in orphans), seconds=10)
    finally:
        end(process)


@pytest.mark.parametrize(
    ("workers", "threads", "moment"),
    [
        (1, "as many as cores", "runs are stored"),
        (2, "as many as cores", "runs are stored"),
        (2, "as many as cores", "workers start"),
        (2, "one", "workers start"),
    ],
)
def test_an_interrupt_is_answered_in_one_line_and_by_nobody_else_and_what_was_finished_is_kept(
    workers, threads, moment, here, whole
):
    """With as many threads as cores, the default, libraries have some that could take the signal."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    if threads == "one":
        environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    process = start(here, "--workers", str(workers), environment=environment)
    try:
        wait_for(lambda: written(here) if moment == "runs are stored" else len(workers_of(process)) == 2)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        end(process)
    assert process.returncode == 130
    said = [line for line in errors.replace("\r", "\n").splitlines() if line and "small: runs:" not in line]
    assert said == [f"homing: interrupted; {GOES_ON}"]
    assert len(written(here)) < len(STUDY.jobs())
    assert contents(here).items() <= whole.items()


def test_what_a_killed_process_was_writing_is_cleared_away_but_nothing_that_one_alive_writes(here):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    for study in (FEW, WHOLE_RUNS):
        study.folder.mkdir(parents=True)
        kept = [f".a-1.{os.getpid()}.part.npz", ".a.1.part.parquet", ".notes.part.npz", "mine.part.npz"]
        for name in (*kept, f".a-1.{gone.pid}.part.npz", f".a.{gone.pid}.part.parquet"):
            (study.folder / name).write_bytes(b"half")
        sweep(study, workers=1)
        assert sorted(path.name for path in study.folder.glob("*.part*")) == sorted(kept)


# A full disk


def test_a_full_disk_is_named_with_the_file_in_one_line_and_what_was_finished_is_kept(here):
    place = place_of(FEW, 3)
    FEW.folder.mkdir(parents=True)
    part = place.with_name(f".{place.stem}.{os.getpid()}.part.npz")
    part.symlink_to("/dev/full")
    assert refusal(lambda: sweep(FEW, workers=1)) == f"{place}: cannot be written (No space left on device)"
    assert set(written(here)) == {place_of(FEW, number) for number in range(3)}
    assert not leftovers(here)
    assert sweep(FEW, workers=1) == 3
    assert len(load_table(FEW)) == 6 * SMALL.episodes


def test_a_disk_that_is_full_when_the_table_is_written_keeps_the_runs(here):
    FEW.table.parent.mkdir(parents=True)
    FEW.table.with_name(f".{FEW.table.stem}.{os.getpid()}.part.parquet").symlink_to("/dev/full")
    assert refusal(lambda: sweep(FEW, workers=1)) == f"{FEW.table}: cannot be written (No space left on device)"
    assert sweep(FEW, workers=1) == 0
    assert len(load_table(FEW)) == 6 * SMALL.episodes


# Damaged


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """Where a study is stored that is complete."""
    folder = tmp_path_factory.mktemp("complete")
    with stored_in(folder):
        sweep(FEW, workers=1)
    return folder


@pytest.fixture
def stored(complete, here):
    """A study that is complete, and its bytes."""
    shutil.copytree(complete, here, dirs_exist_ok=True)
    return contents(here)


def test_a_run_that_is_damaged_in_mid_sweep_harms_no_table_and_is_named_when_it_is_next_asked_for(
    here, monkeypatch, stored
):
    shutil.rmtree(FEW.folder)
    FEW.table.unlink()
    first, store = place_of(FEW, 0), runs._store

    def damaging(path, *result):
        store(path, *result)
        if path != first:
            first.write_bytes(first.read_bytes()[:-9])

    with monkeypatch.context() as patch:
        patch.setattr(runs, "_store", damaging)
        sweep(FEW, workers=1)
    assert FEW.table.read_bytes() == stored[str(FEW.table.relative_to(here))]
    FEW.table.unlink()
    line = refusal(lambda: sweep(FEW, workers=1))
    assert line.startswith(f"{first}: damaged file (")
    assert line.endswith("); delete it, and `make data` computes it from scratch")
    first.unlink()
    assert sweep(FEW, workers=1) == 1
    assert contents(here) == stored


def test_a_table_that_somebody_edited_is_refused_with_the_remedy_which_helps(here, stored):
    table = pd.read_parquet(FEW.table)
    table.loc[0, "steps"] += 1
    table.to_parquet(FEW.table)
    for function in (load_table, sweep):
        assert refusal(function, FEW) == (
            f"{FEW.table}: damaged file (its content is not what its manifest says); "
            "delete it, and `make data` computes it from scratch"
        )
    FEW.table.unlink()
    assert sweep(FEW, workers=1) == 0
    assert contents(here) == stored


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"sha256": "0"}', "\x00" * 9])
def test_a_damaged_manifest_is_refused_with_the_remedy_which_helps(content, here, stored):
    manifest = FEW.table.with_suffix(".json")
    manifest.write_text(content)
    for function in (load_table, sweep):
        line = refusal(function, FEW)
        assert line.startswith(f"{manifest}: damaged file (")
        assert line.endswith("); delete it, and `make data` computes it from scratch")
    manifest.unlink()
    assert refusal(load_table, FEW).startswith(f"{FEW.table}: missing, or of an older version of this study; ")
    assert sweep(FEW, workers=1) == 0
    assert contents(here) == stored


def test_a_manifest_that_does_not_vouch_for_the_table_is_not_taken_for_one_that_does(here, stored):
    manifest = FEW.table.with_suffix(".json")
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"sha256": {}}))
    assert refusal(load_table, FEW).startswith(f"{FEW.table}: missing, or of an older version of this study; ")
    assert sweep(FEW, workers=1) == 0
    assert contents(here) == stored


def test_a_complete_run_that_is_not_what_the_manifest_says_is_refused(here):
    sweep(WHOLE_RUNS, workers=1)
    path = place_of(WHOLE_RUNS, 0)
    result = runs.load(path)
    runs.save(replace(result, steps=result.steps + 1), path)
    for function in (load_study, sweep):
        assert refusal(function, WHOLE_RUNS).startswith(f"{path}: damaged file (its content is not what its manifest")


# Changed


def test_a_study_with_further_seeds_computes_those_and_keeps_the_others(here, stored):
    before = written(here)
    longer = replace(FEW, seeds=range(4))
    assert refusal(load_table, longer).startswith(f"{FEW.table}: missing, or of an older version of this study; ")
    assert sweep(longer, workers=1) == 2
    assert before.items() <= written(here).items()
    assert sorted(load_table(longer).seed.unique()) == [0, 1, 2, 3]


def test_a_condition_that_changed_is_computed_anew_though_its_label_did_not(stored):
    changed = replace(FEW, conditions={**FEW.conditions, "form 2": SMALL.with_changes(max_steps=30)})
    assert sweep(changed, workers=1) == 3
    assert load_table(changed).query("condition == 'form 2'").steps.max() <= 30


def test_another_measure_of_the_same_runs_is_computed_anew(stored):
    assert sweep(replace(FEW, measure=lengths), workers=1) == 6
    assert list(load_table(replace(FEW, measure=lengths))) == ["condition", "seed", "length", *VARY]


def lengths(settings, seed):
    return {"length": run(settings, seed).lengths}


def test_a_condition_under_two_labels_is_computed_once_and_in_the_table_twice():
    twice = replace(FEW, conditions={"one": SMALL, "the same": SMALL})
    assert sweep(twice, workers=1) == 3
    table = load_table(twice)
    one, other = (table[table.condition == label].drop(columns="condition") for label in ("one", "the same"))
    pd.testing.assert_frame_equal(one.reset_index(drop=True), other.reset_index(drop=True))


# Blocks of seeds

COMPACT = Settings(images="compact", episodes=2, survey_steps=60, max_steps=40)
BLOCKS = replace(STUDY, conditions={"form 2": COMPACT, "random": COMPACT.with_changes(controller="random")})


def test_runs_on_an_atlas_are_stored_ten_seeds_to_a_file_and_give_the_table_of_single_ones(here, monkeypatch):
    study = replace(BLOCKS, seeds=range(5, 25))
    assert sweep(study, workers=1) == len(study) == 40
    first = COMPACT.digest
    assert {path.name for path in written(here) if first in path.name} == {
        f"{first}-5-9.npz",
        f"{first}-10-19.npz",
        f"{first}-20-24.npz",
    }
    table = study.table.read_bytes()
    monkeypatch.setattr(runs, "BLOCK", 1)
    assert sweep(study, workers=1, force=True) == 40
    assert study.table.read_bytes() == table


def test_runs_that_two_studies_ask_for_are_computed_once_and_anew_once_where_all_is_forced(here):
    few, more = replace(BLOCKS, seeds=range(4)), replace(BLOCKS, name="more", seeds=range(2, 14))
    assert sweep(few, workers=1) == 8
    assert sweep(more, workers=1) == 24 - 4
    stored = contents(here)
    anew = set()
    assert sweep(few, workers=1, force=True, anew=anew) == 8
    assert sweep(more, workers=1, force=True, anew=anew) == 24 - 4
    assert contents(here) == stored
    assert sweep(more, workers=1, force=True) == 24


def test_a_block_of_which_some_runs_are_there_is_completed(here):
    sweep(replace(BLOCKS, seeds=[1, 4, 7]), workers=1)
    assert sweep(replace(BLOCKS, seeds=range(8)), workers=1) == 2 * 5
    together = BLOCKS.table.read_bytes()
    shutil.rmtree(here)
    sweep(replace(BLOCKS, seeds=range(8)), workers=1)
    assert BLOCKS.table.read_bytes() == together


def test_where_all_is_forced_nothing_of_before_stays_beside_what_is_new(here, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(runs, "MADE_BY", dict.fromkeys(runs.MADE_BY, "earlier"))
        sweep(replace(BLOCKS, seeds=range(4)), workers=1)
        sweep(replace(BLOCKS, seeds=range(10)), workers=1)
    assert sweep(replace(BLOCKS, seeds=range(10)), workers=1, force=True) == 20
    BLOCKS.table.unlink()
    BLOCKS.table.with_suffix(".json").unlink()
    assert sweep(replace(BLOCKS, seeds=range(10)), workers=1) == 0
    assert json.loads(BLOCKS.table.with_suffix(".json").read_text())["made by"] == runs.MADE_BY


def test_blocks_of_other_seeds_have_other_names():
    names = {path_of(BLOCKS.folder, COMPACT, *seeds).name for seeds in ((1, 4, 7), range(1, 8), (1, 7), (1,), (7,))}
    assert len(names) == 5


def half_a_number(settings, seed):
    """A whole number for some seeds, and none for others."""
    return {"number": np.array([seed]) if seed else np.array([np.nan])}


def test_what_is_measured_in_whole_numbers_here_and_not_at_all_there_is_stored_as_both():
    study = replace(BLOCKS, conditions={"form 2": COMPACT}, seeds=(1, 0, 2), measure=half_a_number)
    sweep(study, workers=1)
    np.testing.assert_array_equal(load_table(study).number, [1, np.nan, 2])


# What is kept


def test_runs_that_diverge_and_episodes_that_are_cut_are_kept_and_counted():
    wild = SMALL.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400)
    study = replace(FEW, conditions={"diverges": wild, "cut": SMALL.with_changes(max_steps=3)})
    sweep(study, workers=1)
    table = load_table(study)
    assert len(table) == 2 * 3 * SMALL.episodes
    diverged, cut = (table[table.condition == label] for label in study.conditions)
    assert list(diverged.episode) == 3 * [1, 2]
    assert (diverged.steps == 400).all()
    assert (cut.steps == 3).all()


def test_a_manifest_says_what_was_run_with_which_seeds_and_by_what(stored):
    manifest = json.loads(FEW.table.with_suffix(".json").read_text())
    assert (manifest["seeds"], manifest["measure"]) == ("0-2", "curve")
    assert [*manifest["conditions"]] == [*FEW.conditions]
    for label, values in manifest["conditions"].items():
        digest = values.pop("digest")
        assert Settings(**values) == FEW.conditions[label]
        assert digest == FEW.conditions[label].digest
    assert manifest["made by"] == runs.MADE_BY
    assert set(runs.MADE_BY) == {"numpy", "opencv-python-headless", "pybullet", "python", "homing_lib"}


def test_a_manifest_names_every_library_that_made_a_part_of_the_table(monkeypatch):
    sweep(replace(FEW, seeds=[0]), workers=1)
    this = runs.MADE_BY["homing_lib"]
    monkeypatch.setattr(runs, "MADE_BY", runs.MADE_BY | {"homing_lib": "0123456789ab"})
    sweep(FEW, workers=1)
    made_by = json.loads(FEW.table.with_suffix(".json").read_text())["made by"]
    assert sorted(made_by["homing_lib"].split(", ")) == sorted([this, "0123456789ab"])
    assert made_by["numpy"] == np.__version__


def test_a_table_begins_with_condition_and_seed_and_is_in_the_order_of_the_study(stored):
    table = load_table(FEW)
    assert list(table) == ["condition", "seed", *FEW.measure(SMALL, 0), *VARY]
    keys = list(zip(table.condition, table.seed, table.episode, strict=True))
    assert keys == [(label, seed, episode) for label in FEW.conditions for seed in FEW.seeds for episode in (1, 2)]
    assert {str(kind) for kind in table.drop(columns=[*VARY]).dtypes[2:]} == {"float32"}


def test_an_interrupt_in_the_moment_when_workers_are_started_is_late_but_not_lost(monkeypatch):
    call = joblib.Parallel.__call__

    def interrupted(self, *arguments):
        results = call(self, *arguments)
        os.kill(os.getpid(), signal.SIGINT)
        return results

    monkeypatch.setattr(joblib.Parallel, "__call__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sweep(STUDY, workers=2)


def test_of_threads_that_fail_only_lokys_that_misses_a_cancelled_task_is_left_unsaid(monkeypatch):
    said = []
    monkeypatch.setattr(parallel, "_before", lambda what: said.append((what.exc_type, type(what.thread).__name__)))
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)  # as it is again at the end
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
    assert said == [(ValueError, "_ExecutorManagerThread"), (KeyError, "Thread")]


@pytest.mark.parametrize("quietly", [True, False])
def test_what_an_early_end_left_of_semaphores_is_removed_without_a_word(quietly):
    left = "from joblib.externals.loky.backend.resource_tracker import register\nregister('/loky-0-gone', 'semlock')"
    quieten = "from homing_lib.parallel import quieten\nquieten()\n" if quietly else ""
    ended = subprocess.run([sys.executable, "-c", quieten + left], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0
    assert ("leaked semlock" in ended.stderr, not ended.stderr) == (not quietly, quietly)


KEPT = []


def growing(settings, seed):
    """A measure that keeps 400 MB from its second call on, in each worker."""
    KEPT.append(np.ones(50_000_000 if len(KEPT) == 1 else 1))
    time.sleep(0.6)
    return {"worker": np.array([float(os.getpid())])}


def test_a_worker_that_has_grown_by_what_it_keeps_goes_on_without_a_word(recwarn):
    many = replace(STUDY, seeds=range(5), measure=growing)
    sweep(many, workers=2)
    assert len(load_table(many).worker.unique()) <= 2
    assert not [str(one.message) for one in recwarn]


# What vouches for a run


@pytest.mark.parametrize("what", ["a column", "what made it", "its hash"])
def test_a_single_run_that_was_altered_and_is_whole_is_computed_anew(what, here, stored):
    FEW.table.unlink()
    path = place_of(FEW, 0)
    about, arrays = read_arrays(path)
    if what == "a column":
        arrays["table"]["steps"] *= 2
    elif what == "what made it":
        about["made by"] = dict.fromkeys(runs.MADE_BY, "someone")
    else:
        del about["sha256"]  # as earlier versions stored it
    path.write_bytes(npz_bytes(about, arrays))
    assert sweep(FEW, workers=1) == 1
    assert contents(here) == stored


@pytest.fixture
def whole_runs(here):
    """A study of complete runs that an earlier version made."""
    earlier = dict.fromkeys(runs.MADE_BY, "earlier")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "MADE_BY", earlier)
        sweep(WHOLE_RUNS, workers=1)
    return contents(here)


def _reversed(path):
    result = runs.load(path)
    runs.save(replace(result, steps=result.steps[::-1]), path)


@pytest.mark.parametrize("manifest", ["missing", "of another study"])
def test_what_no_manifest_vouches_for_is_not_read_and_is_computed_anew(manifest, here, whole_runs):
    file, first = WHOLE_RUNS.table.with_suffix(".json"), place_of(WHOLE_RUNS, 0)
    _reversed(first)
    if manifest == "missing":
        file.unlink()
    else:
        other = replace(FEW, name="other")
        sweep(other, workers=1)
        shutil.copy(other.table.with_suffix(".json"), file)
    assert refusal(load_study, WHOLE_RUNS).startswith(f"{first}: no manifest vouches for it; `make data` computes it")
    assert sweep(WHOLE_RUNS, workers=1) == len(WHOLE_RUNS)
    assert first.read_bytes() == whole_runs[str(first.relative_to(here))]
    assert json.loads(file.read_text())["made by"] == runs.MADE_BY


@pytest.mark.parametrize("change", [{"seeds": [9]}, {"conditions": {}}, {"measure": 5}])
def test_what_was_not_computed_again_keeps_what_made_it(change, here, whole_runs):
    file = WHOLE_RUNS.table.with_suffix(".json")
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    assert sweep(WHOLE_RUNS, workers=1) == 0
    assert contents(here) == whole_runs


def test_a_run_that_comes_out_the_same_again_keeps_what_first_made_it(here, whole_runs):
    place_of(WHOLE_RUNS, 0).unlink()
    assert sweep(WHOLE_RUNS, workers=1) == 1
    assert contents(here) == whole_runs


def test_a_run_that_replaces_another_is_said_to_be_made_by_this_version_too(here, whole_runs):
    file, first = WHOLE_RUNS.table.with_suffix(".json"), place_of(WHOLE_RUNS, 0)
    manifest = json.loads(file.read_text())
    manifest["sha256"][first.name] = "0" * 64
    file.write_text(json.dumps(manifest))
    first.unlink()
    assert sweep(WHOLE_RUNS, workers=1) == 1
    this = runs.MADE_BY["homing_lib"]
    assert json.loads(file.read_text())["made by"]["homing_lib"] == ", ".join(sorted(["earlier", this]))


def test_a_sweep_of_complete_runs_that_is_stopped_keeps_those_that_it_has(here, monkeypatch):
    save, saved = runs.save, []

    def stopped(*result):
        if len(saved) == 2:
            raise KeyboardInterrupt
        saved.append(save(*result))

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(runs, "save", stopped)
        sweep(WHOLE_RUNS, workers=1)
    assert sweep(WHOLE_RUNS, workers=1) == len(WHOLE_RUNS) - 2


@pytest.mark.parametrize("content", ["[" * 100_000, '{"sha256": {}}', '{"sha256": {}, "made by": {"numpy": 1}}'])
def test_a_manifest_that_does_not_say_what_made_it_is_refused_with_the_remedy(content, here, stored):
    manifest = FEW.table.with_suffix(".json")
    manifest.write_text(content)
    for function in (load_table, sweep):
        assert refusal(function, FEW).startswith(f"{manifest}: damaged file (")
    manifest.unlink()
    assert sweep(FEW, workers=1) == 0
    assert contents(here) == stored


def test_seeds_may_be_numpys_and_what_are_no_seeds_is_one_line(tmp_path):
    study = replace(WHOLE_RUNS, seeds=np.arange(2))
    sweep(study, workers=1)
    assert json.loads(study.table.with_suffix(".json").read_text())["seeds"] == "0-1"
    runs.save(run(SMALL, np.int64(1)), tmp_path / "run.npz")
    assert runs.load(tmp_path / "run.npz").seed == 1
    for seeds in (3, [-1], [0.5], [None], [], [1, 1], "01"):
        assert refusal(lambda seeds=seeds: replace(FEW, seeds=seeds)).startswith("seeds = ")
    for seed in (None, -1, 0.5, "1"):
        assert refusal(run, SMALL, seed) == f"seed = {seed!r}: must be 0, 1, 2, ..."


def test_the_workers_of_complete_runs_go_with_their_parent_too(here):
    program = (
        "from pathlib import Path; import sys; from tests import kills\n"
        "from tests.test_sweeps import WHOLE_RUNS, replace\n"
        "slow = kills.SMALL.with_changes(survey_steps=100_000)\n"
        "with kills.stored_in(Path(sys.argv[1])):\n"
        "    kills.sweep(replace(WHOLE_RUNS, conditions={'slow': slow}), workers=2)"
    )
    process = subprocess.Popen([sys.executable, "-c", program, str(here)], cwd=kills.ROOT, start_new_session=True)
    try:
        wait_for(lambda: len(workers_of(process)) == 2)
        time.sleep(2)  # they are at work
        orphans = workers_of(process)
        os.kill(process.pid, signal.SIGTERM)
        process.wait()
        assert orphans
        wait_for(lambda: not any(lives(orphan) for orphan in orphans), seconds=10)
    finally:
        end(process)
