"""What a user would install instead: how it is measured and judged, on numbers that fit in a hand."""

import subprocess
import sys
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_lib import agent
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import bootstrap, runs, studies, sweep
from homing_lib.study.methods import deep
from homing_lib.study.questions import instead
from homing_lib.study.runs import Study, is_current, load_table, read_manifest
from tests.test_runs import refusal

COMPACT = Settings(images="compact")


# What is measured


def test_episodes_are_counted_until_the_steps_are_spent_and_the_last_is_cut_there():
    made = instead.until(100, [40, 30, 50, 7], max_steps=2000)
    assert made["steps"].tolist() == [40, 30, 30]
    assert made["episode"].tolist() == [1, 2, 3]
    assert instead.until(70, [40, 30, 50], 2000)["steps"].tolist() == [40, 30]


def test_a_robot_that_diverged_or_is_under_way_does_not_come_home():
    assert instead.until(100, [10], max_steps=40)["steps"].tolist() == [10, 40, 40, 10]
    assert instead.until(100, [], max_steps=50)["steps"].tolist() == [50, 50]


@given(st.lists(st.integers(1, 40), max_size=30), st.integers(1, 300))
def test_however_long_its_episodes_a_run_has_as_many_steps_as_it_shall(steps, budget):
    made = instead.until(budget, steps, 40)["steps"]
    assert made.sum() == budget
    assert made[:-1].tolist() == (steps + [40] * 10)[: len(made) - 1]


def test_the_next_ten_episodes_are_those_that_begin_then_or_later_and_at_the_end_those_that_are_left():
    steps = np.array([30.0, 20, *[10] * 9, 60, 5])  # they begin at 0, 30, 50, 60, ..., 130, 140, 200
    assert instead.next_ten(steps, [0, 1, 30, 50]).tolist() == [13.0, (20 + 90) / 10, 11.0, (90 + 60) / 10]
    assert instead.next_ten(steps, [51, 140, 141]).tolist() == [(80 + 60 + 5) / 10, 32.5, 5.0]
    assert np.isnan(instead.next_ten(steps, [201]))[0]


def test_curves_are_by_robot_and_of_one_condition():
    table = pd.DataFrame(
        {"condition": ["a", "a", "b", "a"], "seed": [2, 1, 1, 2], "episode": [1, 1, 1, 2], "steps": [5, 7, 9, 3]}
    )
    np.testing.assert_array_equal(instead.curves(table, "a", [0, 5]), [[7, np.nan], [4, 3]])


@pytest.mark.parametrize("seed", range(2))
def test_the_published_robot_goes_on_as_it_would_in_a_longer_run_whose_rates_fall_alike(seed, monkeypatch):
    monkeypatch.setattr(instead, "STEPS", 3000)
    long = agent.run(COMPACT.with_changes(episodes=120, first_episode_share=COMPACT.first_episode / 120), seed).lengths
    made = instead.learning(COMPACT, seed)["steps"]
    assert 20 < len(made) < 120
    assert made[:-1].tolist() == long[: len(made) - 1].tolist()
    assert made.sum() == 3000


def test_a_robot_that_diverges_counts_as_one_that_does_not_come_home(monkeypatch):
    monkeypatch.setattr(instead, "STEPS", 9000)
    made = instead.learning(COMPACT.with_changes(alpha0=1e6, lambda_rule="fixed:1", episodes=2), 0)["steps"]
    assert made.tolist() == [2000, 2000, 2000, 2000, 1000]


# Learners that are not installed


def test_without_torch_a_deep_learner_says_in_one_line_what_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    for who in deep.LEARNERS:
        line = refusal(instead.learning, COMPACT.with_changes(controller=who), 0)
        assert line == f"controller = '{who}': needs Stable-Baselines3 and torch; `make deep` installs both"
        assert "drives by itself" in refusal(agent.run, COMPACT.with_changes(controller=who), 0)


def test_nothing_of_the_library_loads_torch():
    program = (
        "import sys; from homing_lib.study import findings; findings.questions()\n"
        "print({'torch', 'stable_baselines3'} & {*sys.modules})"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


@pytest.mark.slow
def test_a_seed_fixes_what_a_deep_learner_does():
    pytest.importorskip("stable_baselines3")
    for who, other in product(deep.LEARNERS, (False, True)):
        settings = COMPACT.with_changes(controller=who)
        first = deep.episode_lengths(settings, 7, 4096)
        assert (deep.episode_lengths(settings, 7 + other, 4096) == first) != other


# Studies that `make` does not compute


@pytest.fixture
def deep_study(tmp_path, monkeypatch):
    """A study that is deep, and one that is not, in a folder of their own."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    one = Study(
        "one", "Deep.", {"all": COMPACT}, range(3), lambda settings, seed: {"seeds": np.array([seed])}, deep=True
    )
    monkeypatch.setattr(studies, "in_order", lambda: iter([one]))
    return one


def test_a_deep_study_is_computed_by_its_name_alone_and_else_must_be_there(deep_study):
    assert refusal(lambda: [*sweep.compute(workers=1, force=True)]).endswith("`make deep` computes it")
    assert refusal(load_table, deep_study).endswith("`make deep` computes it")
    assert [*sweep.compute(["one"], workers=1)] == [(deep_study, 3)]
    assert [*sweep.compute(workers=1, force=True)] == []
    assert load_table(deep_study).seeds.tolist() == [0, 1, 2]


def test_each_run_of_a_deep_study_is_a_file_and_its_manifest_says_which_torch_made_it(deep_study):
    sweep.sweep(deep_study, workers=1)
    assert len([*deep_study.folder.iterdir()]) == 3
    assert {"torch", "stable-baselines3"} < read_manifest(deep_study)["made by"].keys()


@pytest.mark.parametrize("study", [instead.DEEP, instead.IMAGES], ids=lambda one: one.name)
def test_the_tables_of_deep_learners_are_stored_of_runs_that_torch_made_and_each_has_all_its_steps(study):
    assert is_current(study)
    made_by = read_manifest(study)["made by"]
    assert made_by["torch"].startswith("2.")
    assert made_by["stable-baselines3"].startswith("2.")
    steps = load_table(study).groupby(["condition", "seed"], observed=True).steps.sum()
    assert steps.eq(instead.STEPS).all()


def test_what_make_needs_is_locked_without_torch_and_the_other_lock_holds_only_what_that_lacks():
    first, second = (
        {line.partition("==")[0] for line in (ROOT / name).read_text().splitlines() if line[:1].isalnum()}
        for name in ("environment.lock", ".ci/deep.lock")
    )
    assert {"torch", "stable-baselines3"} <= second
    assert not first & second


# How it is judged


def test_of_robots_that_share_no_seeds_each_side_is_drawn_by_itself():
    ours, theirs = np.full(500, 30.0), np.arange(10, 20.0)
    value, low, high = bootstrap.ratio_unpaired(ours, theirs)
    assert value == pytest.approx(30 / 14.5)
    assert low < 30 / theirs.mean() < high
    # Student's t with 9 degrees of freedom: 2.262; what is drawn of 10 robots spreads sqrt(9/10) as much.
    error = theirs.std(ddof=1) / np.sqrt(10)
    assert 30 / low == pytest.approx(14.5 + 2.262 * error, rel=0.03)
    assert 30 / high == pytest.approx(14.5 - 2.262 * error, rel=0.03)
    wider = bootstrap.ratio_unpaired(ours, theirs, comparisons=16)
    assert wider.low < low < high < wider.high
    both = bootstrap.ratio_unpaired(theirs, theirs)  # drawn together, the ratio would be 1 each time
    assert both.value == 1
    assert both.low < 0.9 < 1.1 < both.high


@pytest.mark.parametrize(
    ("words", "of_all"),
    [
        (["fewer"] * 4, "fewer"),
        (["fewer", "more", "undecided", "fewer"], "more"),
        (["fewer", "the same", "fewer", "fewer"], "the same"),
        (["the same"] * 4, "the same"),
        (["fewer", "the same", "undecided", "fewer"], "undecided"),
    ],
)
def test_form_2_takes_fewer_if_fewer_than_all_and_more_if_more_than_one(words, of_all):
    assert instead.of_all(words) == of_all


@pytest.mark.parametrize(
    ("words", "verdict"),
    [
        (["fewer"] * 4, "fewer throughout"),
        (["more"] * 4, "more throughout"),
        (["fewer", "fewer", "more", "more"], "fewer up to 5,000 steps, more from 20,000 on"),
        (["fewer", "undecided", "the same", "more"], "fewer up to 2,000 steps, more from 40,000 on"),
        (["more", "fewer", "fewer", "fewer"], "more up to 2,000 steps, fewer from 5,000 on"),
        (["undecided", "fewer", "fewer", "undecided"], "undecided up to 2,000 steps, undecided from 40,000 on"),
    ],
)
def test_the_verdict_says_how_it_begins_and_how_it_ends(words, verdict):
    assert instead.over_time(dict(zip(instead.AT, words, strict=True))) == verdict
