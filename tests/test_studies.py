"""The studies ask what they say, their measures are what their columns say, and their stored data are theirs."""

import re
from collections import Counter
from contextlib import suppress
from math import pi
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from homing_lib import atlas
from homing_lib.agent import STEP_COLUMNS, RandomAgent, Run, run, run_episode
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.robot import drive
from homing_lib.rooms import PAPER, Pose
from homing_lib.settings import Settings
from homing_lib.study import measures, runs, studies
from homing_lib.study.measures import episode_table
from homing_lib.study.robots import Kidnapped
from homing_lib.study.runs import DATA, load_table
from tests.kills import SMALL

STUDIES = []
with suppress(UserError):  # the last needs a table, and its tests say so
    for study in studies.in_order():
        STUDIES.append(study)
TABLES = [study for study in STUDIES if study.measure and study.table.exists()]
EPISODE_COLUMNS = (
    *("episode", "steps", "reached", "return", "change", "lambda", "clipped", "at_wall"),
    *("distance_m", "angle_deg", "diverged"),
)
COARSE = Settings(
    images="atlas", image_size=16, atlas_spacing_m=0.05, atlas_heading_deg=30, survey_steps=300, max_steps=200
)

each = pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
each_table = pytest.mark.parametrize("study", TABLES, ids=lambda study: study.name)


# What is asked


def test_studies_have_different_names_and_each_its_reason():
    assert len({study.name for study in STUDIES}) == len(STUDIES)
    assert all(len(study.reason) > 30 for study in STUDIES)


def test_a_study_is_listed_where_it_is_defined(monkeypatch):
    monkeypatch.setattr(studies, "_LISTED", [])
    new = studies.study("new", "Does the robot fly?", {"default": Settings()}, range(2000, 2002), measures.episodes)
    assert list(studies.in_order()) == [new]
    assert "## new\n\nDoes the robot fly?\n\nSeeds 2000 to 2001, 1 conditions." in studies.page()


def test_the_page_of_the_studies_is_up_to_date_and_tells_reason_seeds_and_settings_of_each():
    page = studies.PAGE.read_text(encoding="utf-8")
    assert page == studies.page()
    for study in STUDIES:
        section = page.split(f"## {study.name}\n")[1].split("\n## ")[0]
        assert study.reason in section
        assert f"Seeds {study.seeds[0]} to {study.seeds[-1]}" in section
    assert "| E3 form 1, printed sign | `lambda_rule = hestenes-stiefel:printed` |" in page


def test_calibration_and_its_finalists_use_seeds_below_100_none_twice_and_what_is_judged_none_below_1000():
    seeds = [seed for study in (studies.CALIBRATION, studies.finalists()) for seed in study.seeds]
    assert sorted(seeds) == list(range(100))
    searched = {study.name: max(study.seeds) for study in STUDIES if min(study.seeds) < 1000}
    assert set(searched) <= {
        *("calibration", "finalists", "lambda-pool", "lambda-choice", "lambda-choice-least"),
        "earlier-choice",
        "anywhere-search",
    }
    assert all(seed < 100 for seed in searched.values())
    assert all(len(set(study.seeds)) == len(study.seeds) for study in STUDIES)


@each
def test_conditions_differ_but_for_a_reading_of_the_print_that_is_the_default_and_either_update_with_lambda_0(study):
    labels = {}
    for label, settings in study.conditions.items():
        labels.setdefault(settings.digest, []).append(label)
    shared = [same for same in labels.values() if len(same) > 1]
    if study is studies.PRINTED:
        assert shared == [["default", "E4 alpha_0 of the text"]]
    else:
        for every, taken in map(sorted, shared):
            assert "fixed 0," in taken and every == taken.replace(", taken", ", all")


@each
def test_every_condition_survives_being_written_down(study):
    for settings in study.conditions.values():
        assert Settings(**settings.model_dump()) == settings


def test_every_error_of_the_print_that_is_a_setting_is_tried():
    tried = {label.split(" ")[0] for label in studies.AS_PRINTED}
    assert tried == {"E3", "E4", "E5", "E9", "E12", "E13", "E18", "E19", "E20", "theta_0"}
    for label, changes in studies.AS_PRINTED.items():
        condition = studies.PRINTED.conditions[label]
        assert condition == Settings(images="atlas").with_changes(**changes)


def test_the_defaults_are_the_calibrations_winner():
    winner = studies.calibration_score(load_table(studies.finalists())).index[0]
    assert studies.finalists().conditions[winner].with_changes(images="camera") == Settings()


def test_the_calibrations_score_is_the_mean_of_episodes_11_to_20_and_a_diverged_episode_counts_as_the_step_cap():
    episode = np.tile(np.arange(1.0, 21), 2)
    steps = np.concatenate([np.where(np.arange(20) < 10, 500, 40.0), np.where(np.arange(20) < 15, 30, np.nan)])
    table = pd.DataFrame({"condition": ["good"] * 20 + ["diverges"] * 20, "seed": 0, "episode": episode})
    table["steps"] = steps
    assert list(studies.calibration_score(table).items()) == [("good", 40), ("diverges", (5 * 30 + 5 * 2000) / 10)]


# What is kept of a run


def test_the_table_of_a_run_is_what_one_works_out_by_hand():
    home = PAPER.home
    steps = np.array(
        [  # x, y, heading, action, reward, similarity, delta, lambda, clipped, change, at_wall
            (0.10, 0.20, 0.0, 2, -1.0, 0.5, 3.0, 0.50, 1, 0.25, 0),
            (home.x, home.y - 0.4, home.heading + pi / 2, 0, -0.5, 0.6, 2.0, 0.25, 0, 0.50, 1),
            (home.x - 0.3, home.y + 0.4, home.heading - 0.75 * pi, 1, 1.5, 0.9, 1.0, 0.0, 0, 2.0, 0),
        ]
    )
    result = Run(Settings(episodes=4), 7, steps, np.array([2, 1]), np.array([False, True]), diverged=3)
    nan = np.nan
    expected = {
        "episode": [1, 2, 3, 4],
        "steps": [2, 1, nan, nan],
        "reached": [0, 1, nan, nan],
        "return": [-1.5, 1.5, nan, nan],
        "change": [0.75, 2, nan, nan],
        "lambda": [0.375, 0, nan, nan],
        "clipped": [0.5, 0, nan, nan],
        "at_wall": [0.5, 0, nan, nan],
        "distance_m": [0.4, 0.5, nan, nan],
        "angle_deg": [90, 135, nan, nan],
        "diverged": [0, 0, 1, 1],
    }
    table = episode_table(result)
    assert tuple(table) == EPISODE_COLUMNS
    for name, values in expected.items():
        np.testing.assert_allclose(table[name], values, rtol=1e-12, err_msg=name)


def test_the_typical_episode_of_several_is_the_one_of_median_length():
    result = Run(
        Settings(episodes=5), 0, np.zeros((60, len(STEP_COLUMNS))), np.array([9, 30, 4, 12, 5]), np.ones(5, bool), 0
    )
    assert measures.typical(result, range(1, 6)) == 1
    assert measures.typical(result, range(2, 5)) == 4


def test_resets_are_counted_by_their_bound_and_how_many_steps_come_before_the_first_of_an_episode():
    steps = np.zeros((10, len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("lambda")] = [0, 0.5, 1, 0.3, 0, 0, 0, 1, 1, 0.2]
    steps[:, STEP_COLUMNS.index("clipped")] = [
        0,
        0,
        1,
        0,
        1,
        0,
        1,
        1,
        0,
        0,
    ]  # two episodes, of 5 steps and of 4; a run of one
    runs = [
        Run(Settings(episodes=2), 0, steps[:9], np.array([5, 4]), np.ones(2, bool), 0),
        Run(Settings(episodes=1), 1, steps[9:], np.array([1]), np.ones(1, bool), 0),
    ]
    assert measures.resets(runs) == pytest.approx(
        {
            "reset to 0": 0.2,
            "reset to 1": 0.2,
            "as (7) gives it": 0.6,
            "before the first reset of their episode": 0.4,
        }
    )


def test_a_run_that_diverged_in_its_first_episode_has_all_its_rows():
    nothing = np.empty((0, len(STEP_COLUMNS)))
    table = episode_table(Run(Settings(episodes=2), 0, nothing, np.array([], int), np.array([], bool), diverged=1))
    assert list(table["episode"]) == [1, 2]
    assert list(table["diverged"]) == [1, 1]
    assert all(np.isnan(table[name]).all() for name in EPISODE_COLUMNS if name not in ("episode", "diverged"))


def test_a_run_in_one_row_is_what_one_works_out_by_hand():
    nrb = np.array([0.5, 0.905, 0.906, 0.95, 0.907, 0.905, 0.9, 0.905, 0.1, 0.92])
    steps = np.zeros((10, len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("similarity")] = nrb
    steps[:, STEP_COLUMNS.index("change")] = 0.5
    steps[:, STEP_COLUMNS.index("lambda")] = np.arange(10) / 10
    steps[:2, STEP_COLUMNS.index("clipped")] = steps[:3, STEP_COLUMNS.index("at_wall")] = 1
    reached = np.array([True, False, True, True, True, True])
    result = Run(Settings(episodes=7, max_steps=50), 7, steps, np.array([4, 2, 1, 1, 1, 1]), reached, diverged=7)
    row = measures.summary_table(result)
    expected = {
        "early": 9 / 5,  # 4, 2, 1, 1, 1
        "late": (1 + 1 + 1 + 1 + 50) / 5,
        "total": 60,
        "lost": 1 / 5,
        "change": 5,
        "lambda": 0.45,
        "clipped": 0.2,
        "at_wall": 0.3,
        "band": 0.5,
        "band_stay": 2,
        "diverged": 1,
    }
    assert {name: len(values) for name, values in row.items()} == dict.fromkeys(expected, 1)
    for name, value in expected.items():
        assert row[name][0] == pytest.approx(value), name


def test_a_stay_in_the_band_ends_with_its_episode():
    steps = np.zeros((4, len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("similarity")] = 0.905
    for lengths, longest in (([4], 4), ([1, 3], 3), ([2, 2], 2)):
        result = Run(Settings(), 0, steps, np.array(lengths), np.zeros(len(lengths), bool), diverged=len(lengths) + 1)
        assert measures.summary_table(result)["band_stay"][0] == longest


def test_a_kidnapped_robot_drives_the_stated_number_of_steps_undisturbed_and_the_next_from_elsewhere():
    elsewhere = Pose(0.6, 0.7, 1.0)

    def poses(kidnapper):
        with HomingEnv(SMALL.with_changes(max_steps=6), observation="features") as env:
            env.reset(seed=0)
            steps, _ = run_episode(kidnapper(env), RandomAgent(SMALL, np.random.default_rng(1)))
            moves = [env.settings.wheel_commands_m[int(action)] for action in steps[:, 3]]
            there, _ = drive(elsewhere, *moves[3], SMALL.wheel_base_m, env.world.clearance)
        return steps[:, :3], there

    alone, _ = poses(lambda env: env)
    kidnapped, there = poses(lambda env: Kidnapped(env, 3, elsewhere))
    np.testing.assert_array_equal(kidnapped[:3], alone[:3])
    np.testing.assert_allclose(kidnapped[3], there, rtol=0, atol=1e-9)
    assert not np.allclose(kidnapped[3], alone[3])


def test_a_robot_is_kidnapped_in_every_episode():
    elsewhere = Pose(0.6, 0.7, 1.0)
    with HomingEnv(SMALL.with_changes(max_steps=4), observation="features") as env:
        env.reset(seed=0)
        kidnapped = Kidnapped(env, 2, elsewhere)
        agent = RandomAgent(SMALL, np.random.default_rng(1))
        for _ in range(2):
            steps, _ = run_episode(kidnapped, agent)
            assert np.hypot(*(steps[2, :2] - elsewhere[:2])) < 0.07 < np.hypot(*(steps[1, :2] - elsewhere[:2]))


def test_trials_begin_everywhere_and_where_a_kidnapper_says_and_in_other_light(monkeypatch):
    monkeypatch.setattr(measures, "TRIAL_STEPS", 10)
    few = list(range(3))
    monkeypatch.setattr(measures, "starts_everywhere", lambda env: [Pose(0.2, 0.5, float(k)) for k in few])
    table = measures.trials(SMALL, 0)
    rows = list(zip(*table.values(), strict=True))
    assert tuple(table) == ("kidnapped", "x", "y", "heading", "steps", "reached", "light")
    assert Counter((row[0], row[-1]) for row in rows) == {(0, 1): 3, (1, 1): 40, (0, 0.97): 40, (0, 1.03): 40}
    assert [row[1:4] for row in rows[:3]] == [(0.2, 0.5, k) for k in few]
    at_once = {row[1:4] for row in rows if row[0] == 1}
    assert at_once == {row[1:4] for row in rows if row[-1] == 0.97} == {row[1:4] for row in rows if row[-1] == 1.03}
    for kidnapped, *_, steps, reached, _ in rows:
        assert steps <= 10 - 8 * kidnapped
        assert reached or steps == 10 - 8 * kidnapped


def test_trials_of_a_run_that_diverged_keep_one_row_without_numbers():
    table = measures.trials(SMALL.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400), 0)
    assert all(len(values) == 1 and np.isnan(values).all() for values in table.values())


def test_at_each_random_place_a_robot_begins_once_and_is_carried_there_once(monkeypatch):
    monkeypatch.setattr(measures, "TRIAL_STEPS", 10)
    table = measures.abductions(SMALL, 0)
    assert {len(values) for values in table.values()} == {40}
    assert len({pose for pose in zip(table["x"], table["y"], table["heading"], strict=True)}) == 40
    for how in ("begun", "carried"):
        steps, home = table[how], table[f"{how}_home"]
        assert steps.max() == 10
        assert (home[steps < 10] == 1).all()
    again = measures.abductions(SMALL, 0)
    assert all(np.array_equal(table[name], again[name]) for name in table)


def test_abductions_of_a_run_that_diverged_keep_one_row_without_numbers():
    table = measures.abductions(SMALL.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400), 0)
    assert all(len(values) == 1 and np.isnan(values).all() for values in table.values())


def test_starts_cover_the_room_where_the_robot_fits():
    with HomingEnv(SMALL) as env:
        starts = list(measures.starts_everywhere(env))
        assert all(env.world.clearance(*pose[:2]) >= 0 for pose in starts)
    places = Counter(pose[:2] for pose in starts)
    assert set(places.values()) == {8}
    assert len({round(pose.heading, 6) for pose in starts}) == 8
    for low, high, size in zip(np.min(list(places), 0), np.max(list(places), 0), PAPER.size, strict=True):
        assert low < 0.1
        assert high > size - 0.16


# The shortest way


def plane(home, **changes):
    """An endless plane: home is seen wherever `home` says of a pose."""
    return SimpleNamespace(
        settings=Settings(**changes),
        room=SimpleNamespace(start=Pose(0.21, 0.51, 0.0)),
        world=SimpleNamespace(clearance=lambda x, y: 1.0, histogram=lambda pose: np.full(3, float(home(pose)))),
        model=SimpleNamespace(features=lambda histogram: histogram),
    )


def test_straight_ahead_the_shortest_way_is_the_distance_by_the_step():
    assert measures.fewest_steps(plane(lambda pose: pose.x >= 0.21 + 0.31, forward_m=0.04)) == 8
    assert measures.fewest_steps(plane(lambda pose: pose.x >= 0.21 + 0.01, forward_m=0.04)) == 1


def test_an_about_turn_takes_the_angle_by_the_turn_and_no_way_takes_more_than_the_cap():
    away = plane(lambda pose: abs(pose.heading) > pi - 0.01, turn_deg=20.0)
    assert measures.fewest_steps(away) == 9
    assert np.isnan(measures.fewest_steps(plane(lambda pose: False, max_steps=4)))


def test_a_wall_is_not_driven_through():
    def behind(pose):
        return pose.x >= 0.40

    around = plane(behind, forward_m=0.04, turn_deg=30.0, turn_advance_m=0.03)
    straight = measures.fewest_steps(around)
    around.world.clearance = lambda x, y: max(abs(x - 0.31) - 0.005, abs(y - 0.51) - 0.1)
    assert straight == 5
    assert 5 < measures.fewest_steps(around) < 20


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """Settings whose atlas is built in a moment, and stored apart."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(atlas, "FOLDER", tmp_path_factory.mktemp("atlas"))
        yield COARSE


def test_no_episode_is_shorter_than_the_shortest_way(coarse):
    for seed in (1000, 1001):
        least = measures.shortest(coarse, seed)["steps"]
        learnt = run(coarse, seed)
        assert least.shape == (1,)
        assert learnt.reached.any()
        assert least[0] <= learnt.lengths[learnt.reached].min()


def test_views_compare_the_camera_with_the_atlas(coarse):
    table = measures.views(coarse, 0)
    assert tuple(table) == ("x", "y", "heading", "camera", "atlas")
    assert all(values.shape == (400,) for values in table.values())
    camera, looked_up = table["camera"], table["atlas"]
    assert ((camera > 0) & (camera <= 1) & (looked_up > 0) & (looked_up <= 1)).all()
    assert np.corrcoef(camera, looked_up)[0, 1] > 0.5


# What is stored


def test_data_readme_names_every_column_of_every_measure(coarse):
    text = (DATA / "README.md").read_text(encoding="utf-8")
    sections = {part.split("\n", 1)[0]: set(re.findall(r"`([^`]+)`", part)) for part in text.split("\n## ")}
    columns = {
        "Episodes": EPISODE_COLUMNS,
        "Trials (`after`)": ("kidnapped", "x", "y", "heading", "steps", "reached", "light"),
        "Views (`lattice-views`) and shortest paths (`shortest`)": ("x", "y", "heading", "camera", "atlas", "steps"),
        "Steps (`headline/`)": STEP_COLUMNS,
    }
    for section, names in columns.items():
        assert set(names) <= sections[section], section
    words = set().union(*sections.values())
    for study in (study for study in STUDIES if study.measure):
        assert set(load_table(study)) - words <= {"condition", "seed"}, study.name


@each_table
def test_a_stored_table_is_of_its_study_as_it_stands_and_complete(study):
    table = load_table(study)
    rows = table.groupby(["condition", "seed"], observed=True).size()
    assert len(rows) == len(study.conditions) * len(study.seeds)
    if study.measure is measures.episodes:
        assert tuple(table)[2:] == EPISODE_COLUMNS
        assert all(rows[label].eq(settings.episodes).all() for label, settings in study.conditions.items())
        finished = table.diverged == 0
        assert table.steps.notna().eq(finished).all()
        cap = table.condition.map({label: settings.max_steps for label, settings in study.conditions.items()})
        cut = finished & (table.reached == 0)
        assert (table.steps[cut] == cap[cut].astype(float)).all()


def test_all_data_together_are_small():
    assert sum(file.stat().st_size for file in DATA.rglob("*") if file.is_file()) < 20e6


def recomputed_as_stored(study, label, seed, **changes):
    """Whether a run gives the rows that are stored of it, to 32-bit precision."""
    table = load_table(study)
    rows = table[(table.condition == label) & (table.seed == seed)]
    for name, values in study.measure(study.conditions[label].with_changes(**changes), seed).items():
        with np.errstate(over="ignore"):
            np.testing.assert_allclose(rows[name], values.astype(np.float32), rtol=1e-6, atol=1e-6, err_msg=name)


def sample(tables, count, longest=np.inf):
    """Runs drawn at random among those of at most so many steps."""
    drawn = []
    rng = np.random.default_rng(2014)
    for study in tables:
        rows = load_table(study).groupby(["condition", "seed"], observed=True)
        short = [of_run for of_run, row in rows if longest == np.inf or row.steps.sum() <= longest]
        drawn += [(study, *short[i]) for i in rng.choice(len(short), count, replace=False)]
    return drawn


def test_a_random_sample_of_the_headline_is_the_same_when_computed_again():
    study = studies.HEADLINE
    stored = [(one, label) for label, results in runs.load_study(study).items() for one in results]
    stored = [(one, label) for one, label in stored if one.lengths.sum() < 1500]
    one, label = stored[int(np.random.default_rng(2014).integers(len(stored)))]
    assert runs.compare(one, run(study.conditions[label], one.seed)) in ("to the bit", "within tolerance")


def test_a_random_sample_of_the_runs_with_the_camera_is_the_same_when_computed_again():
    for study, label, seed in sample([studies.CAMERA], 2, longest=1500):
        recomputed_as_stored(study, label, seed)


def test_a_random_sample_of_the_runs_on_the_coarsest_atlas_is_the_same_when_computed_again():
    label, *_ = studies.LATTICES
    for seed in np.random.default_rng(2014).choice(studies.JUDGED, 3, replace=False):
        recomputed_as_stored(studies.LATTICE_RUNS, label, int(seed), images="compact")  # the same lattice


@pytest.mark.slow
def test_a_random_sample_of_every_table_is_the_same_when_computed_again():
    for study, label, seed in sample(TABLES, 2):
        recomputed_as_stored(study, label, seed)
