"""A sweep may be repeated, changed, stopped by a full disk and damaged: what it stores in the end is the same, and each
run is computed once."""

import errno
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from homing_lib import agent, storage
from homing_lib.agent import run
from homing_lib.settings import Settings
from homing_lib.study import runs, studies
from homing_lib.study.runs import Study, content_of, fingerprint, load, load_study, load_table
from homing_lib.study.sweep import compute, sweep
from tests.kills import contents, leftovers, undisturbed, written
from tests.test_runs import refusal

ATLAS, CAMERA = Settings(images="compact", episodes=1, survey_steps=5, max_steps=4), Settings(alpha0=0.5)
CALLS = []


def numbers(settings, seed):
    """A measure without a robot: as many rows as the seed says, one of which is no number a float can hold."""
    CALLS.append(seed)
    rows = np.arange(seed % 4)
    return {"number": rows + seed, "alpha0": np.full(len(rows), 7), "large": np.where(rows == 2, 1e300, 0)}


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


def edited(manifest, **changes):
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | changes))


# What is computed, and when


@both_kinds
def test_two_workers_store_the_same_bytes_as_one_and_a_second_sweep_does_nothing(study, here, whole):
    assert sweep(study, workers=2) == len(set(study.conditions.values())) * len(study.seeds)
    assert contents(here) == whole[study.name]
    times = {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()}
    assert sweep(study, workers=2) == 0
    assert {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()} == times


@both_kinds
def test_a_run_that_is_deleted_is_computed_again_to_the_bit_and_no_other_file_is_written(study, here, whole):
    times = written(here) if stored(study) else {}
    gone = study.jobs()[0]
    gone.path.unlink()
    if study.measure:
        study.table.unlink()
    assert sweep(study, workers=1) == (len(gone.seeds) if study.measure else 4)
    assert contents(here) == whole[study.name]
    assert {path for path, when in written(here).items() if when != times[path]} == {gone.path}


def test_all_is_computed_anew_where_it_is_forced_and_what_two_studies_ask_for_once(here, monkeypatch):
    more, other = replace(TABLE, name="more", seeds=range(2, 14)), replace(TABLE, name="other", measure=other_numbers)
    monkeypatch.setattr(studies, "in_order", lambda: iter([TABLE, more, other, WHOLE]))
    expected = {"table": 2 * 4, "more": 2 * 12 - 2 * 3, "other": 2 * 4, "whole": 4}
    for _ in ("nothing is there", "all is there"):
        assert {study.name: done for study, done in compute(workers=1, force=True)} == expected
    first, kept = contents(here), written(other.folder)
    assert [done for _, done in compute(workers=1)] == [0, 0, 0, 0]
    assert [done for _, done in compute(["more"], workers=1, force=True)] == [2 * 12]
    assert kept and written(other.folder) == kept
    assert {name: one for name, one in contents(here).items() if name.startswith("data")} == {
        name: one for name, one in first.items() if name.startswith("data")
    }


def test_a_name_that_no_study_has_is_refused_before_anything_is_computed(here):
    assert "study 'tabel'" in (line := refusal(lambda: list(compute(["whole", "tabel"]))))
    assert line.endswith("did you mean table?")
    assert not contents(here)
    assert [study.name for study, _ in compute(["whole"], workers=1)] == ["whole"]


def test_outside_a_clone_nothing_is_computed(here, monkeypatch):
    monkeypatch.setattr(storage, "ROOT", here)
    for names in ([], ["whole"]):
        assert "clone it and work there" in refusal(lambda names=names: list(compute(names)))
    assert not contents(here)


@pytest.mark.parametrize(
    ("changes", "computed"),
    [
        ({"seeds": range(5)}, [0, 0, 4, 4]),
        ({"given": {"atlas": ATLAS, "camera": CAMERA.with_changes(alpha0=0.25)}}, [1, 2, 3, 11]),
        ({"measure": other_numbers}, []),
        ({"given": {"camera": CAMERA, "renamed": ATLAS}}, []),
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


def test_ten_seeds_share_a_file_but_those_of_the_camera_and_a_file_with_some_of_them_is_completed(here, monkeypatch):
    study = replace(TABLE, seeds=range(5, 25))
    assert [(job.settings.images, job.seeds[0], len(job.seeds)) for job in study.jobs() if job.seeds[-1] < 10] == [
        ("compact", 5, 5),
        *(("camera", seed, 1) for seed in range(5, 10)),
    ]
    stored(replace(TABLE, seeds=[1, 6, 17]))
    assert sweep(study, workers=1) == 2 * 18
    table = study.table.read_bytes()
    shutil.rmtree(here)
    monkeypatch.setattr(runs, "BLOCK", 1)
    assert stored(study).table.read_bytes() == table


# What is stored


def test_a_table_holds_the_rows_of_each_run_in_the_order_of_the_study_and_a_column_for_each_setting_that_varies():
    table = load_table(stored(TABLE))
    assert [*table][:5] == ["condition", "seed", "number", "alpha0", "large"]
    assert {*table} - {*[*table][:5]} == {"images", "episodes", "survey_steps", "max_steps"}
    assert {str(kind) for kind in table[["number", "alpha0", "large"]].dtypes} == {"float32"}
    rows = [(label, seed, seed + row) for label in TABLE.conditions for seed in TABLE.seeds for row in range(seed % 4)]
    assert [*zip(table.condition, table.seed, table.number, strict=True)] == rows
    assert (table.large == np.where(table.number - table.seed == 2, np.inf, 0)).all()
    assert (table.images == table.condition.map({"atlas": "compact", "camera": "camera", "again": "compact"})).all()
    assert (table.alpha0 == 7).all()  # which varies too, but is a column of the measure


def test_complete_runs_are_read_by_condition_with_seeds_in_order():
    results = load_study(stored(WHOLE))
    assert list(results) == ["form 2", "random"]
    for label, settings in WHOLE.conditions.items():
        assert [(one.settings, one.seed) for one in results[label]] == [(settings, seed) for seed in WHOLE.seeds]
        assert results[label][1].steps.tobytes() == run(settings, 5).steps.tobytes()


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


@pytest.mark.parametrize(
    ("file", "makes_runs"),
    [("sarsa.py", True), ("rooms.toml", True), ("study/questions/home.py", True), ("publish/cli.py", False)],
)
def test_what_is_measured_counts_as_made_by_another_version_if_model_or_study_is_edited_but_not_the_rest(
    file, makes_runs, tmp_path
):
    house = shutil.copytree(Path(agent.__file__).parent, tmp_path / "house", ignore=shutil.ignore_patterns("*.atlas"))
    before = runs.source_hash(house)
    with (house / file).open("a") as edited_file:
        edited_file.write("\n")
    assert (runs.source_hash(house) != before) == makes_runs


@both_kinds
def test_what_comes_out_the_same_again_keeps_what_first_made_it_and_what_does_not_says_so(study, here, monkeypatch):
    before = contents(here) if earlier(study, monkeypatch) else {}
    first = fingerprint([study])
    assert sweep(study, workers=1, force=True) > 0
    for file in (study.manifest, *study.files):
        assert file.read_bytes() == before[str(file.relative_to(here))]
    assert fingerprint([study]) == first
    changed = replace(study, seeds=range(6, 8))
    sweep(changed, workers=1)
    assert json.loads(study.manifest.read_text())["made by"] == runs.MADE_BY
    assert fingerprint([changed]) != first


# A full disk, and damage


@pytest.mark.parametrize("which", ["a block", "the table"])
def test_a_full_disk_is_named_with_the_file_in_one_line_and_what_was_finished_is_kept(which, here, whole, monkeypatch):
    place = TABLE.table if which == "the table" else TABLE.jobs()[3].path
    write = Path.write_bytes

    def full(path, content):
        if path.name.startswith(f".{place.stem}."):
            write(path, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        line = refusal(sweep, TABLE, workers=1)
    assert line == f"{place}: cannot be written (No space left on device)"
    done = sum(len(job.seeds) for job in TABLE.jobs() if job.path.exists())
    assert not leftovers(here)
    assert sweep(TABLE, workers=1) == 8 - done < 8
    assert contents(here) == whole["table"]


def flipped(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def other_number(path):
    table = pd.read_parquet(path)
    table.loc[0, "number"] += 1
    table.to_parquet(path)


HARMS = [
    *((TABLE, "table", harm) for harm in (flipped, other_number)),
    *((TABLE, "manifest", lambda path, text=text: path.write_text(text)) for text in ("{", "{}")),
    *(
        (TABLE, "manifest", lambda path, changes=changes: edited(path, **changes))
        for changes in ({"made by": None}, {"made by": {"numpy": 1}}, {"sha256": {"table.parquet": 5}})
    ),
    (WHOLE, "run", flipped),
    (WHOLE, "run", lambda path: shutil.copy(WHOLE.jobs()[1].path, path)),
    (WHOLE, "run", lambda path: path.write_bytes(content_of(replace(load(path), diverged=1)))),
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
    assert sweep(study, workers=1) == {"run": 4, "manifest": 0, "table": 0}[which]
    assert contents(here) == whole[study.name]


def test_what_no_manifest_vouches_for_is_not_read_and_is_computed_anew(here, whole):
    edited(stored(WHOLE).manifest, sha256={})
    assert "no manifest vouches" in refusal(load_study, WHOLE)
    assert sweep(WHOLE, workers=1) == 4
    edited(stored(TABLE).manifest, sha256={})
    assert "missing" in refusal(load_table, TABLE)
    assert sweep(TABLE, workers=1) == 0
    assert contents(here) == whole["table"] | whole["whole"]


@pytest.mark.parametrize("harm", [flipped, lambda path: shutil.copy(TABLE.jobs()[1].path, path), "older"])
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
def test_what_are_no_seeds_is_one_line_and_numpys_are(seeds):
    assert refusal(replace, TABLE, seeds=seeds).startswith("seeds = ")
    assert replace(TABLE, seeds=np.arange(3)).definition()["seeds"] == "0-2"
