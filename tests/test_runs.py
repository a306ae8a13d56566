import shutil
import time
import zipfile
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, Run, run
from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.study import measures, runs
from homing_lib.study.runs import (
    Study,
    compare,
    episode_matrix,
    episodes_of,
    fingerprint,
    load,
    load_study,
    load_table,
    path_of,
    save,
    sweep,
    verify,
)

TINY = Settings(episodes=2, survey_steps=20, max_steps=10)
STUDY = Study("tiny", "To be quick.", {"form 2": TINY, "random": TINY.with_changes(controller="random")}, range(3))
TABLE = replace(STUDY, measure=measures.curve)

both_kinds = pytest.mark.parametrize("study", [STUDY, TABLE], ids=["every step", "table"])


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    """No test reads or writes the project's own data."""
    use(tmp_path / "here", monkeypatch)


def use(folder, monkeypatch):
    monkeypatch.setattr(runs, "DATA", folder / "data")
    monkeypatch.setattr(runs, "SCRATCH", folder / "scratch")


@pytest.fixture(scope="module")
def result():
    return run(TINY, 0)


@pytest.fixture
def stored(result, tmp_path):
    path = tmp_path / "run.npz"
    save(result, path)
    return path


@pytest.fixture(scope="module")
def computed_once(tmp_path_factory):
    """Where both kinds of the study are stored."""
    folders = {study.measured: tmp_path_factory.mktemp("computed") for study in (STUDY, TABLE)}
    for study in (STUDY, TABLE):
        with pytest.MonkeyPatch.context() as patch:
            use(folders[study.measured], patch)
            sweep(study, workers=1)
    return folders


@pytest.fixture
def computed(computed_once, tmp_path):
    """Call it with a study, and that is stored."""
    return lambda study: shutil.copytree(computed_once[study.measured], tmp_path / "here", dirs_exist_ok=True)


def contents(folder):
    """Every file below a folder: its bytes by its path."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def written(folder):
    """Every file below a folder: when it was written, by its path."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def refusal(function, *arguments):
    """The one line with which a call is refused."""
    with pytest.raises(UserError) as error:
        function(*arguments)
    line = str(error.value)
    assert "\n" not in line
    return line


# One run


def test_a_run_is_read_as_it_was_written(result, stored):
    again = load(stored)
    assert (again.settings, again.seed, again.diverged) == (result.settings, result.seed, result.diverged)
    for name in ("steps", "lengths", "reached"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
        assert getattr(again, name).dtype == getattr(result, name).dtype


def test_the_same_run_gives_the_same_bytes_now_and_later(result, stored, tmp_path):
    time.sleep(2.1)  # a zip file's clock ticks every two seconds
    save(run(TINY, 0), tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == stored.read_bytes()


def test_a_run_that_diverged_at_once_is_stored_too(tmp_path):
    diverged = run(TINY.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400), 0)
    assert diverged.diverged == 1
    save(diverged, tmp_path / "diverged.npz")
    assert compare(diverged, load(tmp_path / "diverged.npz")) == "to the bit"


def test_a_run_that_is_missing_is_refused_with_its_path_and_the_remedy(tmp_path):
    line = refusal(load, tmp_path / "none.npz")
    assert line == f"{tmp_path}/none.npz: there is no such run; `make data` computes it"


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99])
def test_a_truncated_run_is_refused_with_its_path_and_the_remedy(share, stored):
    whole = stored.read_bytes()
    stored.write_bytes(whole[: int(share * len(whole))])
    line = refusal(load, stored)
    assert line.startswith(f"{stored}: damaged file (")
    assert line.endswith("delete it, and `make data` computes it from scratch")


def test_a_run_with_any_byte_changed_is_refused_with_its_path_or_is_the_same_run_still(result, stored):
    whole, refused = stored.read_bytes(), 0
    positions = range(0, len(whole), 3)
    for position in positions:
        changed = bytearray(whole)
        changed[position] ^= 0xFF
        stored.write_bytes(changed)
        try:
            again = load(stored)
        except UserError as error:
            assert str(error).startswith(f"{stored}: damaged file (")
            assert "\n" not in str(error)
            refused += 1
        else:
            assert compare(result, again) == "to the bit"  # it was a byte that says nothing, such as a date
    assert refused > 0.7 * len(positions)


def test_files_that_are_no_runs_are_refused_with_their_path(stored, tmp_path):
    text, pictures, objects, other = (tmp_path / f"{name}.npz" for name in ("text", "zip", "objects", "other"))
    text.write_text("a run\n" * 100)
    with zipfile.ZipFile(pictures, "w") as archive:
        archive.writestr("picture.png", b"no array")
    np.savez(objects, about=np.array({"pickled": "object"}, dtype=object))
    np.savez(other, steps=np.zeros(3))
    for path in (text, pictures, objects, other):
        assert refusal(load, path).startswith(f"{path}: damaged file (")


def test_a_run_of_settings_that_no_longer_exist_is_refused_with_its_path(stored, tmp_path):
    about, arrays = runs.read_arrays(stored)
    stored.write_bytes(runs.npz_bytes(about | {"settings": {"colour": 1}}, arrays))
    assert refusal(load, stored).startswith(f"{stored}: damaged file (setting colour: there is none of this name")


def test_where_a_package_is_not_installed_a_run_is_made_by_none_of_it(monkeypatch):
    monkeypatch.setattr(runs, "_PACKAGES", ("numpy", "no-such-package"))
    assert runs._made_by().items() >= {"numpy": np.__version__, "no-such-package": "none"}.items()


# Many runs


@both_kinds
def test_one_worker_and_two_store_the_same_bytes_and_a_second_sweep_computes_nothing(study, tmp_path, monkeypatch):
    found = []
    for workers in (1, 2):
        use(tmp_path / str(workers), monkeypatch)
        assert sweep(study, workers=workers) == 6
        before = written(tmp_path / str(workers))
        assert sweep(study, workers=workers) == 0
        assert written(tmp_path / str(workers)) == before
        found.append(contents(tmp_path / str(workers)))
    assert found[0] == found[1]
    assert len(found[0]) == 7 + bool(study.measure)  # with the manifest, and the table


@both_kinds
def test_a_deleted_run_is_computed_again_to_the_bit_and_no_other(study, tmp_path, computed):
    computed(study)
    before, times = contents(tmp_path), written(study.folder)
    gone = path_of(study.folder, TINY, 1)
    gone.unlink()
    if study.measure:
        study.table.unlink()
    assert sweep(study, workers=1) == 1
    assert contents(tmp_path) == before
    assert {path for path, when in written(study.folder).items() if when != times[path]} == {gone}


def test_a_deleted_table_is_joined_again_from_the_runs_to_the_bit(tmp_path, computed):
    computed(TABLE)
    before = contents(tmp_path)
    TABLE.table.unlink()
    assert sweep(TABLE, workers=1) == 0
    assert contents(tmp_path) == before


@both_kinds
def test_a_forced_sweep_computes_everything_again_to_the_bit(study, tmp_path, computed):
    computed(study)
    before, times = contents(tmp_path), written(study.folder)
    assert sweep(study, workers=1, force=True) == 6
    assert contents(tmp_path) == before
    assert all(when != times[path] for path, when in written(study.folder).items())


@both_kinds
def test_a_sweep_refuses_a_damaged_run_and_one_of_other_settings_or_another_seed(study, computed):
    computed(study)
    if study.measure:
        study.table.with_suffix(".json").unlink()  # it would notice at once
    path, other = path_of(study.folder, TINY, 0), path_of(study.folder, TINY, 1)
    whole = path.read_bytes()
    shutil.copy(other, path)
    line = refusal(sweep, study)
    if study.measure:
        assert line.startswith(f"{path}: holds other runs than its name says; delete it")
    else:
        assert line.startswith(f"{path}: damaged file (its content is not what its manifest says); delete it")
    path.write_bytes(whole[:-100])
    assert refusal(sweep, study).startswith(f"{path}: damaged file (")
    path.unlink()
    assert sweep(study, workers=1) == 1
    assert path.read_bytes() == whole


def test_complete_runs_are_read_by_condition_with_seeds_in_order(computed):
    computed(STUDY)
    stored = load_study(STUDY)
    assert list(stored) == ["form 2", "random"]
    for label, settings in STUDY.conditions.items():
        assert [(one.settings, one.seed) for one in stored[label]] == [(settings, seed) for seed in range(3)]


def test_a_table_holds_the_measure_of_each_run_by_condition_and_seed(computed):
    computed(TABLE)
    table = load_table(TABLE)
    assert len(table) == 2 * 3 * TINY.episodes
    for (label, seed), rows in table.groupby(["condition", "seed"], observed=True):
        alone = measures.curve(TABLE.conditions[label], seed)
        for name, values in alone.items():
            np.testing.assert_array_equal(rows[name], values.astype(np.float32))


def test_a_setting_that_varies_is_a_column_unless_the_measure_has_one_of_its_name(computed):
    computed(TABLE)
    table = load_table(TABLE)
    assert list(table) == ["condition", "seed", "episode", "steps", "controller"]
    assert (table.controller == table.condition.map({"form 2": "sarsa", "random": "random"}).astype(object)).all()
    alike = replace(TABLE, name="alike", conditions={"form 2": TINY})
    varied = replace(
        TABLE, name="varied", conditions={"one": TINY, "two": TINY.with_changes(alpha0=0.1)}, measure=alpha
    )
    for study in (alike, varied):
        sweep(study, workers=1)
    assert list(load_table(alike)) == ["condition", "seed", "episode", "steps"]
    assert load_table(varied).alpha0.tolist() == [7] * 6


def alpha(settings, seed):
    return {"alpha0": np.array([7.0])}


def test_steps_and_sums_of_each_episode_are_those_of_its_steps():
    several = [made([1, 2, 3]), made([2, 2, 2])]
    assert episode_matrix(several).tolist() == [[1, 2, 3], [2, 2, 2]]
    assert episode_matrix(several, "reward").tolist() == [[0, 1 + 2, 3 + 4 + 5], [1, 5, 9]]


def made(lengths, diverged=0):
    steps = np.zeros((sum(lengths), len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("reward")] = np.arange(sum(lengths))
    settings = Settings(episodes=3, max_steps=100)
    return Run(settings, 0, steps, np.array(lengths, dtype=int), np.ones(len(lengths), dtype=bool), diverged)


def test_episodes_lost_to_divergence_count_as_never_home_and_have_no_sums():
    several = [made([4], diverged=2), made([], diverged=1)]
    assert episode_matrix(several).tolist() == [[4, 100, 100], [100, 100, 100]]
    assert np.isnan(episode_matrix(several, "reward")).tolist() == [[False, True, True], [True] * 3]


def test_a_table_gives_a_row_a_run_whatever_its_order_and_counts_lost_episodes_as_the_cap():
    rows = [("a", 7, 2, np.nan, np.nan), ("a", 7, 1, 30.0, 3.0), ("a", 5, 1, 10.0, 1.0), ("a", 5, 2, 20.0, 2.0)]
    table = pd.DataFrame([*rows, ("b", 5, 1, 99.0, 9.0)], columns=["condition", "seed", "episode", "steps", "change"])
    assert episodes_of(table, "a").tolist() == [[10, 20], [30, Settings().max_steps]]
    assert np.isnan(episodes_of(table, "a", "change")).tolist() == [[False, False], [False, True]]


def test_a_damaged_table_or_manifest_is_refused_and_one_of_another_study_is_not_taken_for_this(computed):
    refused = f"{TABLE.table}: missing, or of an older version of this study; `make data` computes it"
    assert refusal(load_table, TABLE) == refused
    computed(TABLE)
    assert refusal(load_table, replace(TABLE, seeds=range(4))) == refused
    whole = TABLE.table.read_bytes()
    TABLE.table.write_bytes(whole[:-1])
    for function in (load_table, sweep):
        assert refusal(function, TABLE).startswith(f"{TABLE.table}: damaged file (")
    TABLE.table.write_bytes(whole)
    manifest = TABLE.table.with_suffix(".json")
    manifest.write_text(manifest.read_text()[:-10])
    assert refusal(load_table, TABLE).startswith(f"{manifest}: damaged file (")


@both_kinds
def test_the_fingerprint_changes_when_the_data_do_and_only_then(study, tmp_path, monkeypatch, computed):
    computed(study)
    first = fingerprint([study])
    use(tmp_path / "there", monkeypatch)
    sweep(study, workers=1)
    assert fingerprint([study]) == first
    file = study.table if study.measure else path_of(study.folder, TINY, 2)
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    assert fingerprint([study]) != first


# The same again


def changed(result, **arrays):
    return replace(result, **{name: getattr(result, name) + by for name, by in arrays.items()})


def test_a_repeated_run_is_the_stored_one_to_the_bit_or_within_the_tolerance_or_not():
    steps = np.array([[1.0, np.nan], [1000.0, 0.0]])
    one = Run(TINY, 0, steps, np.array([2]), np.array([True]), 0)
    assert compare(one, replace(one, steps=steps.copy())) == "to the bit"
    assert compare(one, changed(one, steps=[[1e-9, 0], [1e-4, 1e-7]])) == "within tolerance"
    assert compare(one, changed(one, steps=[[1e-5, 0], [0, 0]])) == "not"
    assert compare(one, changed(one, steps=[[0, 0], [0, np.nan]])) == "not"
    assert compare(one, replace(one, steps=steps[:1])) == "not"
    assert compare(one, changed(one, lengths=1)) == "not"
    assert compare(one, replace(one, reached=np.array([False]))) == "not"
    assert compare(one, replace(one, diverged=2)) == "not"


def test_verification_repeats_the_first_run_live_and_tells_a_tampered_one_from_it(computed):
    computed(STUDY)
    assert verify(STUDY) == "This machine reproduces the stored run to the bit (seed 0, 2 episodes, 20 steps)."
    path = path_of(STUDY.folder, TINY, 0)
    whole = load(path)
    save(changed(whole, steps=1e-9), path)
    assert "within 1e-06, though not to the bit" in verify(STUDY)
    save(changed(whole, steps=1e-3), path)
    assert "does NOT reproduce the stored run" in verify(STUDY)
