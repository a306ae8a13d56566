"""Runs and tables are read as they were written, or refused in one line."""

import zipfile
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, Run, run
from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays
from homing_lib.study.runs import Study, content_of, episode_matrix, episodes_of, load, path_of
from homing_lib.study.sweep import TOLERANCE, compare, sweep, verify
from tests.kills import stored_in

TINY = Settings(images="compact", episodes=2, survey_steps=20, max_steps=10)


def refusal(function, *arguments, **options):
    """The one line with which a call is refused."""
    with pytest.raises(UserError) as error:
        function(*arguments, **options)
    line = str(error.value)
    assert "\n" not in line
    return line


def write(result, path):
    path.write_bytes(content_of(result))
    return path


@pytest.fixture(scope="module")
def result():
    return run(TINY, 0)


@pytest.fixture
def stored(result, tmp_path):
    return write(result, tmp_path / "run.npz")


# One run


def test_a_run_is_read_as_it_was_written(result, stored):
    again = load(stored)
    assert (again.settings, again.seed, again.diverged) == (result.settings, result.seed, result.diverged)
    for name in ("steps", "lengths", "reached"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
        assert getattr(again, name).dtype == getattr(result, name).dtype


def test_the_same_run_gives_the_same_bytes_now_and_later(stored, monkeypatch):
    monkeypatch.setattr("time.localtime", lambda *_: (2031, 5, 4, 3, 2, 1, 0, 0, 0))  # by which zip files are dated
    assert content_of(run(TINY, np.int64(0))) == stored.read_bytes()


def test_a_run_that_diverged_at_once_is_stored_too(tmp_path):
    diverged = run(TINY.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400), 0)
    assert diverged.diverged == 1
    assert compare(diverged, load(write(diverged, tmp_path / "diverged.npz"))) == "to the bit"


def without_arrays(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("picture.png", b"no array")


def altered(**changes):
    def alter(path):
        about, arrays = read_arrays(path)
        arrays |= {name: arrays[name][:-1] for name in changes if name in arrays}
        path.write_bytes(npz_bytes(about | {name: one for name, one in changes.items() if name in about}, arrays))

    return alter


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda path: path.unlink(), "no such run; `make data`"),
        (without_arrays, "damaged"),
        (lambda path: np.savez(path, about=np.array({"pickled": "object"}, dtype=object)), "damaged"),
        (lambda path: np.savez(path, steps=np.zeros(3)), "damaged"),
        (altered(settings={"colour": 1}), "setting colour"),
        (altered(seed="1"), "damaged"),
        (altered(steps=-1), "do not fit"),
        (altered(reached=-1), "do not fit"),
    ],
)
def test_what_is_no_run_is_refused_with_its_path_and_the_remedy(harm, words, stored):
    harm(stored)
    line = refusal(load, stored)
    assert line.startswith(f"{stored}: ")
    assert words in line
    assert "`make data` computes it" in line


def test_a_run_with_any_byte_changed_is_refused_or_is_the_same_run_still(result, stored):
    whole, refused = stored.read_bytes(), 0
    positions = range(0, len(whole), 7)
    for position in positions:
        changed = bytearray(whole)
        changed[position] ^= 0xFF
        stored.write_bytes(changed)
        try:
            again = load(stored)
        except UserError as error:
            assert str(error).startswith(f"{stored}: damaged file (")
            refused += 1
        else:
            assert compare(result, again) == "to the bit"  # it was a byte that says nothing, such as a date
    assert refused > 0.7 * len(positions)


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


# The same again


def changed(result, **arrays):
    return replace(result, **{name: getattr(result, name) + by for name, by in arrays.items()})


def test_a_repeated_run_is_the_stored_one_to_the_bit_or_within_the_tolerance_or_not():
    steps = np.array([[1.0, np.nan], [1000.0, 0.0]])
    first = Run(TINY, 0, steps, np.array([2]), np.array([True]), 0)
    assert compare(first, replace(first, steps=steps.copy())) == "to the bit"
    assert compare(first, changed(first, steps=[[1e-9, 0], [1e-4, 1e-7]])) == "within tolerance"
    others = [{"steps": [[1e-5, 0], [0, 0]]}, {"steps": [[0, 0], [0, np.nan]]}, {"lengths": 1}]
    others = [changed(first, **one) for one in others] + [replace(first, steps=steps[:1]), replace(first, diverged=2)]
    others += [replace(first, reached=np.array([False]))]
    assert {compare(first, other) for other in others} == {"not"}


def test_verification_repeats_the_first_run_live_and_tells_a_tampered_one_from_it(tmp_path):
    study = Study("tiny", "To be quick.", {"form 2": TINY}, [3])
    with stored_in(tmp_path):
        sweep(study, workers=1)
        path = path_of(study.folder, TINY, 3)
        whole = load(path)
        assert "to the bit (seed 3, 2 episodes, 20 steps)" in verify(study)
        for by, words in ((1e-9, f"within {TOLERANCE:g}, though not to the bit"), (1e-3, "does NOT reproduce")):
            write(changed(whole, steps=by), path)
            assert words in verify(study)
