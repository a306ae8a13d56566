"""A sweep may be stopped, doubled and damaged at any moment: what it stores in the end is the same, and each run is
computed once."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from homing_lib import agent
from homing_lib.agent import run
from homing_lib.settings import Settings
from homing_lib.study import runs, studies
from homing_lib.study.runs import Study, fingerprint, load_study, load_table, path_of
from homing_lib.study.sweep import compute, sweep
from tests.kills import contents, leftovers, undisturbed, written
from tests.test_runs import refusal

ATLAS, CAMERA = Settings(images="compact", episodes=1, survey_steps=5, max_steps=4), Settings()
CALLS = []


def numbers(settings, seed):
    """A measure without a robot: as many rows as the seed says, one of which is no number a float can hold."""
    CALLS.append(seed)
    rows = np.arange(seed % 4)
    return {"number": rows + seed, "alpha": np.full(len(rows), settings.alpha0), "large": np.where(rows == 2, 1e300, 0)}


def other_numbers(settings, seed):
    return {"number": np.array([2 * seed])}


TABLE = Study("table", "Rows.", {"atlas": ATLAS, "camera": CAMERA, "again": ATLAS}, (1, 2, 3, 11), numbers)
WHOLE = Study("whole", "Steps.", {"form 2": ATLAS, "random": ATLAS.with_changes(controller="random")}, (4, 5))

both_kinds = pytest.mark.parametrize("study", [TABLE, WHOLE], ids=["table", "every step"])


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """No test reads or writes the project's own data."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    monkeypatch.setattr(studies, "in_order", lambda: iter([TABLE, WHOLE]))
    CALLS.clear()
    return tmp_path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What each study stores if nobody disturbs it, by name."""
    return {study.name: undisturbed(tmp_path_factory.mktemp(study.name), study) for study in (TABLE, WHOLE)}


def stored(study):
    """The study, once it is computed."""
    sweep(study, workers=1)
    CALLS.clear()
    return study


def earlier(study, monkeypatch):
    """The study, computed by an earlier version of the library."""
    with monkeypatch.context() as patch:
        patch.setattr(runs, "MADE_BY", dict.fromkeys(runs.MADE_BY, "earlier"))
        return stored(study)


# What is computed, and when


@both_kinds
def test_two_workers_store_the_same_bytes_as_one_and_a_second_sweep_does_nothing(study, here, whole):
    assert sweep(study, workers=2) == len(set(study.conditions.values())) * len(study.seeds)
    assert contents(here) == whole[study.name]
    times = {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()}
    assert sweep(study, workers=2) == 0
    assert {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()} == times


@both_kinds
def test_a_run_that_is_deleted_is_computed_again_to_the_bit_and_no_other(study, here, whole):
    times = written(here) if stored(study) else {}
    gone = study.jobs()[0]
    gone.path.unlink()
    if study.measure:
        study.table.unlink()
    assert sweep(study, workers=1) == len(gone.seeds)
    assert contents(here) == whole[study.name]
    assert {path for path, when in written(here).items() if when != times[path]} == {gone.path}


def test_a_deleted_table_or_manifest_is_written_again_from_what_was_measured(here, whole):
    for file in (stored(TABLE).table, TABLE.manifest):
        file.unlink()
        assert refusal(load_table, TABLE).startswith(f"{TABLE.table}: missing")
        assert sweep(TABLE, workers=1) == 0
        assert contents(here) == whole["table"]


def test_all_is_computed_anew_where_it_is_forced_and_what_two_studies_ask_for_once(here, monkeypatch):
    more = replace(TABLE, name="more", seeds=range(2, 14))
    monkeypatch.setattr(studies, "in_order", lambda: iter([TABLE, more, WHOLE]))
    expected = {"table": 2 * 4, "more": 2 * 12 - 2 * 3, "whole": 4}
    for force in (False, True):
        assert {study.name: done for study, done in compute(workers=1, force=force)} == expected
    first = contents(here)
    assert [done for _, done in compute(workers=1)] == [0, 0, 0]
    assert [done for _, done in compute(["more"], workers=1, force=True)] == [2 * 12]
    assert {name: one for name, one in contents(here).items() if name.startswith("data")} == {
        name: one for name, one in first.items() if name.startswith("data")
    }


def test_a_name_that_no_study_has_is_refused_before_anything_is_computed(here):
    assert "study 'tabel'" in (line := refusal(lambda: list(compute(["whole", "tabel"]))))
    assert line.endswith("did you mean table?")
    assert not contents(here)
    assert [study.name for study, _ in compute(["whole"], workers=1)] == ["whole"]


@pytest.mark.parametrize(
    ("changes", "computed"),
    [
        ({"seeds": range(5)}, [0, 0, 4, 4]),
        ({"conditions": {"atlas": ATLAS, "camera": CAMERA.with_changes(alpha0=0.5)}}, [1, 2, 3, 11]),
        ({"measure": other_numbers}, []),
        ({"conditions": {"camera": CAMERA, "renamed": ATLAS}}, []),
    ],
)
def test_of_a_study_that_changed_what_is_new_is_computed_and_the_stored_table_is_not_taken_for_it(changes, computed):
    changed = replace(stored(TABLE), **changes)
    assert "older version of this study" in refusal(load_table, changed)
    sweep(changed, workers=1)
    assert sorted(CALLS) == computed
    table = load_table(changed)
    assert {*table.condition} == {*changed.conditions}
    assert {*table.seed} <= {*changed.seeds}


def test_seeds_are_kept_ten_to_a_file_but_for_those_of_the_camera_and_the_table_is_that_of_single_files(monkeypatch):
    study = replace(TABLE, seeds=range(5, 25))
    assert [(job.settings.images, job.seeds[0], len(job.seeds)) for job in study.jobs() if job.seeds[-1] < 10] == [
        ("compact", 5, 5),
        *(("camera", seed, 1) for seed in range(5, 10)),
    ]
    table = stored(study).table.read_bytes()
    monkeypatch.setattr(runs, "BLOCK", 1)
    sweep(study, workers=1, force=True)
    assert study.table.read_bytes() == table


def test_a_block_of_which_some_runs_are_there_is_completed(here):
    table = stored(replace(TABLE, seeds=range(8))).table.read_bytes()
    shutil.rmtree(here)
    stored(replace(TABLE, seeds=[1, 4, 7]))
    assert sweep(replace(TABLE, seeds=range(8)), workers=1) == 2 * 5
    assert TABLE.table.read_bytes() == table


# What is stored


def test_a_table_holds_the_rows_of_each_run_in_the_order_of_the_study(here):
    table = load_table(stored(TABLE))
    assert [*table][:5] == ["condition", "seed", "number", "alpha", "large"]
    assert {*table} - {*[*table][:5]} == {"images", "episodes", "survey_steps", "max_steps"}  # which vary
    assert {str(kind) for kind in table[["number", "alpha", "large"]].dtypes} == {"float32"}
    rows = [(label, seed, seed + row) for label in TABLE.conditions for seed in TABLE.seeds for row in range(seed % 4)]
    assert [*zip(table.condition, table.seed, table.number, strict=True)] == rows
    assert (table.large == np.where(table.number - table.seed == 2, np.inf, 0)).all()
    assert (table.images == table.condition.map({"atlas": "compact", "camera": "camera", "again": "compact"})).all()


def test_a_setting_that_varies_is_no_column_where_the_measure_has_one_of_its_name():
    study = replace(TABLE, conditions={"one": ATLAS, "two": ATLAS.with_changes(alpha0=0.5)}, measure=alpha)
    assert load_table(stored(study)).alpha0.tolist() == [7] * 8


def alpha(settings, seed):
    return {"alpha0": np.array([7 if seed > 1 else np.nan])[:1] if seed == 0 else np.array([7])}


def test_complete_runs_are_read_by_condition_with_seeds_in_order():
    found = load_study(stored(WHOLE))
    assert list(found) == ["form 2", "random"]
    for label, settings in WHOLE.conditions.items():
        assert [(one.settings, one.seed) for one in found[label]] == [(settings, seed) for seed in WHOLE.seeds]
        assert found[label][1].steps.tobytes() == run(settings, 5).steps.tobytes()


@both_kinds
def test_a_manifest_says_what_was_run_with_which_seeds_and_by_what(study):
    manifest = json.loads(stored(study).manifest.read_text())
    assert manifest["seeds"] == ([1, 2, 3, 11] if study.measure else "4-5")
    assert manifest["measure"] == ("numbers" if study.measure else "every step")
    for label, values in manifest["conditions"].items():
        digest = values.pop("digest")
        assert Settings(**values) == study.conditions[label]
        assert digest == study.conditions[label].digest
    assert manifest["made by"] == runs.MADE_BY
    assert set(runs.MADE_BY) == {"numpy", "opencv-python-headless", "pybullet", "python", "homing_lib"}
    assert [*manifest["sha256"]] == [file.name for file in study.files]


@both_kinds
def test_what_comes_out_the_same_again_keeps_what_first_made_it_and_what_does_not_says_so(study, here, monkeypatch):
    before = contents(here) if earlier(study, monkeypatch) else {}
    assert sweep(study, workers=1, force=True) > 0
    for file in (study.manifest, *study.files):
        assert file.read_bytes() == before[str(file.relative_to(here))]
    changed = replace(study, seeds=range(6, 8))
    sweep(changed, workers=1)
    assert json.loads(study.manifest.read_text())["made by"] == runs.MADE_BY


@both_kinds
def test_the_fingerprint_changes_when_the_data_do_and_only_then(study):
    first = fingerprint([stored(study)])
    sweep(study, workers=1, force=True)
    assert fingerprint([study]) == first
    file = study.files[0]
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    assert fingerprint([study]) != first


# Killed, in mid-write, at every point


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
    few = replace(study, conditions={"atlas": ATLAS}, seeds=(4, 5) if study is WHOLE else (4, 11))
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
        if before == "nothing":  # but for a complete run for which no manifest vouched as yet
            assert len(there.items() - written(here).items()) <= (few.measure is None)
    assert point >= 9


def test_what_a_killed_process_was_writing_is_cleared_away_but_nothing_that_one_alive_writes():
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    for study in (TABLE, WHOLE):
        study.folder.mkdir(parents=True)
        kept = [f".a-1.{os.getpid()}.part.npz", ".a.1.part.parquet", ".notes.part.npz", "mine.part.npz"]
        for name in (*kept, f".a-1.{gone.pid}.part.npz", f".a.{gone.pid}.part.parquet"):
            (study.folder / name).write_bytes(b"half")
        sweep(study, workers=1)
        assert sorted(path.name for path in study.folder.glob("*.part*")) == sorted(kept)


@pytest.mark.parametrize("which", ["a block", "the table"])
def test_a_full_disk_is_named_with_the_file_in_one_line_and_what_was_finished_is_kept(which, here, whole):
    place = TABLE.table if which == "the table" else TABLE.jobs()[3].path
    place.parent.mkdir(parents=True)
    place.with_name(f".{place.stem}.{os.getpid()}.part{place.suffix}").symlink_to("/dev/full")
    assert refusal(sweep, TABLE, workers=1) == f"{place}: cannot be written (No space left on device)"
    done = sum(len(job.seeds) for job in TABLE.jobs() if job.path.exists())
    assert not leftovers(here)
    assert sweep(TABLE, workers=1) == 8 - done < 8
    assert contents(here) == whole["table"]


# Damaged


def flipped(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def edited(path):
    table = pd.read_parquet(path)
    table.loc[0, "number"] += 1
    table.to_parquet(path)


def text(content):
    return lambda path: path.write_text(content)


def manifested(**changes):
    return lambda path: path.write_text(json.dumps(json.loads(path.read_text()) | changes))


HARMS = [
    *(
        (TABLE, "table", harm)
        for harm in (flipped, edited, text(""), lambda path: path.write_bytes(path.read_bytes()[:-1]))
    ),
    *((TABLE, "manifest", text(garbage)) for garbage in ("", "{", "[]", "{}", "\x00" * 9, "[" * 100_000, '"' * 9)),
    *((TABLE, "manifest", manifested(**{"made by": one})) for one in (None, {}, {"numpy": 1})),
    (TABLE, "manifest", manifested(sha256={"table.parquet": 5})),
    (WHOLE, "run", flipped),
    (WHOLE, "run", lambda path: shutil.copy(WHOLE.jobs()[1].path, path)),
    (WHOLE, "run", lambda path: runs.save(replace(runs.load(path), diverged=1), path)),
]


@pytest.mark.parametrize(("study", "which", "harm"), HARMS)
def test_a_stored_file_that_is_harmed_is_refused_in_one_line_with_a_remedy_which_helps(study, which, harm, here, whole):
    stored(study)
    path = {"table": study.table, "manifest": study.manifest, "run": study.jobs()[0].path}[which]
    harm(path)
    for function in (load_table if study.measure else load_study, sweep):
        line = refusal(function, study)
        assert line.startswith(f"{path}: damaged file (")
        assert "delete it, and `make data` computes it" in line
    path.unlink()
    assert sweep(study, workers=1) == {"run": 1, "manifest": 0, "table": 0}[which]
    assert contents(here) == whole[study.name]


def test_what_no_manifest_vouches_for_is_not_read_and_is_computed_anew(here, whole):
    stored(WHOLE).manifest.write_text(json.dumps(json.loads(WHOLE.manifest.read_text()) | {"sha256": {}}))
    assert "no manifest vouches" in refusal(load_study, WHOLE)
    assert sweep(WHOLE, workers=1) == 4
    stored(TABLE).manifest.write_text(json.dumps(json.loads(TABLE.manifest.read_text()) | {"sha256": {}}))
    assert "missing" in refusal(load_table, TABLE)
    assert sweep(TABLE, workers=1) == 0
    assert contents(here) == whole["table"] | whole["whole"]


@pytest.mark.parametrize("harm", [flipped, text(""), lambda path: shutil.copy(TABLE.jobs()[1].path, path), "older"])
def test_what_was_measured_and_is_not_as_this_version_wrote_it_is_measured_again(harm, here, whole, monkeypatch):
    if harm == "older":
        earlier(TABLE, monkeypatch)
        TABLE.manifest.unlink()
    else:
        harm(stored(TABLE).jobs()[0].path)
    TABLE.table.unlink()
    assert sweep(TABLE, workers=1) == (8 if harm == "older" else 3)
    assert contents(here) == whole["table"]


@pytest.mark.parametrize("seeds", [3, [-1], [0.5], [None], [], [1, 1], "01"])
def test_what_are_no_seeds_is_one_line(seeds):
    assert refusal(replace, TABLE, seeds=seeds).startswith("seeds = ")


def test_seeds_may_be_numpys():
    assert replace(TABLE, seeds=np.arange(3)).definition()["seeds"] == "0-2"
    assert path_of(TABLE.folder, ATLAS, 3) != path_of(TABLE.folder, ATLAS, 4)
