"""The studies ask what they say, their measures are what their columns say, and their stored data are theirs."""

import re
import subprocess
import sys
from itertools import pairwise
from math import pi
from pkgutil import iter_modules
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, RandomAgent, Run, run, run_episode
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.robot import GO_FORWARD, LEFT_FORWARD, drive
from homing_lib.rooms import PAPER, Pose
from homing_lib.rooms import ROOMS as EVERY_ROOM
from homing_lib.settings import Settings
from homing_lib.study import findings, measures, questions, runs, studies, sweep
from homing_lib.study.questions import learns, printed
from homing_lib.study.robots import Kidnapped
from homing_lib.study.runs import DATA, Study, load_table

SMALL = Settings(episodes=2, survey_steps=60, max_steps=40, image_size=16, bin_size=32)
STUDIES = [*studies.in_order()]
TABLES = [study for study in STUDIES if study.measure and study.table.exists()]
COMPACT = Settings(images="compact")

each_table = pytest.mark.parametrize("study", TABLES, ids=lambda study: study.name)


# What is asked


def test_every_study_has_a_name_a_reason_and_conditions_of_its_own_and_all_but_the_headline_a_table():
    assert len({study.name for study in STUDIES}) == len(STUDIES)
    assert all(study.reason.endswith((".", "?", ")")) for study in STUDIES)
    assert [study.name for study in STUDIES if study.measure is None] == ["headline"]
    for study in STUDIES:
        assert len({settings.digest for settings in study.conditions.values()}) == len(study.conditions), study.name
    assert {*studies.UNLIKE} < {*studies.ROOMS} <= {*EVERY_ROOM}


NEW_FILE = """
from homing_lib.settings import Settings
from homing_lib.study.findings import question
from homing_lib.study.measures import curve
from homing_lib.study.studies import study

FLIGHTS = study("flights", "Does it fly?", {"all": Settings()}, range(3000, 3002), curve)


@question("flies", "Does the robot fly?", "Yes, if it does.", FLIGHTS)
def flies(table):
    return "yes", {}
"""


def test_a_new_file_is_found_without_a_list_elsewhere_whichever_is_imported_first(tmp_path):
    (tmp_path / "flies.py").write_text(NEW_FILE, encoding="utf-8")
    program = (
        "import sys; from importlib import import_module; from homing_lib.study import findings, questions, studies\n"
        "questions.__path__.append(sys.argv[1])\n"
        "for name in sys.argv[:1:-1]: import_module(f'homing_lib.study.questions.{name}')\n"
        "print(findings.questions()['flies'].studies[0].name, *(study.name for study in studies.in_order()))"
    )
    names = [one.name for one in iter_modules(questions.__path__)]
    command = [sys.executable, "-c", program, str(tmp_path), *names]
    asked, *listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert asked in listed
    assert [name for name in listed if name != asked] == [study.name for study in STUDIES]


def test_a_study_is_listed_where_it_is_defined_and_one_that_needs_another_after_it(monkeypatch, tmp_path):
    monkeypatch.setattr(runs, "DATA", tmp_path)
    monkeypatch.setattr(studies, "LISTED", {})
    default = {"default": Settings()}
    needed = studies.study("needed", "Does the robot fly?", default, range(3), measures.curve)
    new = studies.study("new", "Does it land?", default, range(2000, 2002), measures.curve)
    how = studies.study("how", "How?", lambda: dict(load_table(needed).groupby("seed")), range(3), needs=[needed])
    assert [*studies.in_order()] == [needed, new, how]
    with pytest.raises(UserError, match=r"needed\.parquet: missing"):
        print(how.conditions)


def test_settings_are_labelled_by_what_varies_and_the_same_are_one():
    one, other = Settings(room="attic"), Settings(room="attic", alpha0=0.1)
    assert studies.labelled([one, other, one]) == {f"alpha0={one.alpha0}": one, "alpha0=0.1": other}
    assert studies.labelled([one]) == {"all": one}


def test_rows_are_those_of_some_settings_by_seed_and_what_does_not_vary_holds():
    table = pd.DataFrame({"seed": [2, 1, 1], "room": ["attic", "attic", "hall"], "steps": [3, 4, 5]})
    assert studies.rows(table, room="attic", update="all").steps.tolist() == [4, 3]
    with pytest.raises(ValueError, match="no runs with"):
        studies.rows(table, room="cell")


def test_the_page_of_the_studies_is_up_to_date_and_tells_reason_seeds_and_settings_of_each():
    made, page = studies.page(), studies.PAGE.read_text(encoding="utf-8")
    assert sorted(page.split("\n## ")) == sorted(made.split("\n## "))
    for study in STUDIES:
        section = page.split(f"## {study.name}\n")[1].split("\n## ")[0]
        assert study.reason in section
        assert f"Seeds {study.seeds[0]} to {study.seeds[-1]}" in section
    assert "\n| random | `controller = random` |\n" in page


def test_who_chooses_has_seeds_below_100_the_finalists_others_than_the_calibration_and_who_is_judged_none_below_1000():
    seeds = [seed for study in (studies.CALIBRATION, studies.FINALISTS) for seed in study.seeds]
    assert sorted(seeds) == list(range(100))
    for study in STUDIES:
        assert max(study.seeds) < 100 or min(study.seeds) >= 1000, study.name
    judged = {table.name for question in findings.questions().values() for table in question.studies}
    assert [study.name for study in STUDIES if study.name in judged and min(study.seeds) < 1000] == []


def test_every_reading_of_the_print_is_tried_alone_and_the_letter_differs_in_what_is_printed_only():
    for label, changes in printed.READINGS.items():
        assert printed.PRINTED.conditions[label] == Settings(images="atlas").with_changes(**changes) != printed.OURS
    default = dict(Settings())
    assert {name: value for name, value in printed.LETTER if value != default[name]} == {
        "centre": "zero",
        "mixture": "literal",
        "tau0": 1.0,
        "overwrite_features": True,
        "alpha0": 1.25e-2,
    }


def test_from_the_letter_to_ours_one_substitution_is_made_at_a_time():
    steps = [dict(settings) for settings in printed.CASCADE.values()]
    changed = [{name for name in before if before[name] != after[name]} for before, after in pairwise(steps)]
    assert changed == [{*ours} & {*now} for now, (_, ours) in zip(changed, printed.SUBSTITUTIONS.values(), strict=True)]
    assert steps[-1] == dict(Settings(images="atlas"))
    for name, (as_printed, _) in printed.SUBSTITUTIONS.items():
        assert printed.UNDONE[f"all but {name}"] == printed.OURS.with_changes(**as_printed)


def test_the_defaults_are_the_winner_by_mean_steps_of_episodes_11_to_20_a_diverged_one_counted_as_the_step_cap():
    winner = studies.calibration_score(load_table(studies.FINALISTS)).index[0]
    assert studies.FINALISTS.conditions[winner].with_changes(images="camera") == Settings()
    steps = np.concatenate([np.where(np.arange(20) < 10, 500, 40.0), np.where(np.arange(20) < 15, 30, np.nan)])
    table = pd.DataFrame({"condition": ["good"] * 20 + ["diverges"] * 20, "seed": 0, "steps": steps})
    table["episode"] = np.tile(np.arange(1.0, 21), 2)
    assert list(studies.calibration_score(table).items()) == [("good", 40), ("diverges", (5 * 30 + 5 * 2000) / 10)]


# What is kept of a run


def test_the_typical_episode_of_several_is_the_one_of_median_length():
    steps, lengths = np.zeros((60, len(STEP_COLUMNS))), np.array([9, 30, 4, 12, 5])
    result = Run(Settings(episodes=5), 0, steps, lengths, np.ones(5, bool), 0)
    assert measures.typical(result, range(1, 6)) == 1
    assert measures.typical(result, range(2, 5)) == 4


def test_a_run_in_one_row_is_what_one_works_out_by_hand():
    steps = np.zeros((610, len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("change")] = 0.5
    steps[:, STEP_COLUMNS.index("lambda")] = np.arange(610) % 10 / 10
    steps[:61, STEP_COLUMNS.index("clipped")] = steps[:122, STEP_COLUMNS.index("at_wall")] = 1
    lengths = np.array([600, 6, 1, 1, 1, 1])
    row = measures.totals_of(Run(Settings(episodes=7), 7, steps, lengths, np.ones(6, bool), diverged=7))
    expected = {
        "total": 610 + 2000,
        "cut": 500 + 10 + 500,
        "early": 609 / 5,
        "late": (6 + 1 + 1 + 1 + 1 + 2000 - 6) / 5,
        "change": 305,
        "lambda": 0.45,
        "clipped": 0.1,
        "at_wall": 0.2,
        "diverged": 1,
    }
    assert {name: len(values) for name, values in row.items()} == dict.fromkeys(expected, 1)
    assert {name: values[0] for name, values in row.items()} == pytest.approx(expected)


def test_a_run_that_diverged_at_once_takes_the_cap_in_every_episode():
    lost = SMALL.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, episodes=5, max_steps=400)
    row, table = measures.totals(lost, 0), measures.curve(lost, 0)
    assert (row["total"][0], row["late"][0], row["diverged"][0]) == (2000, 400, 1)
    assert list(table["episode"]) == [1, 2, 3, 4, 5]
    assert list(table["steps"]) == [400] * 5


def test_what_is_seen_after_learning_is_a_table_and_the_measure_has_the_name_by_which_runs_are_kept():
    @measures.after_learning("episodes", "seed", episodes=1)
    def seen(settings, seed, env, agent):
        yield settings.episodes, seed
        yield env.settings.episodes, agent.learner.weights.size

    table = {name: list(values) for name, values in seen(SMALL, 7).items()}
    assert table == {"episodes": [1, 1], "seed": [7, 3 * SMALL.n_features]}
    assert Study("seen", "Why?", {"all": SMALL}, range(2), seen).definition()["measure"] == "seen"


def test_a_kidnapped_robot_drives_some_steps_undisturbed_and_the_next_from_elsewhere_in_every_episode():
    elsewhere = Pose(0.6, 0.7, 1.0)

    def poses(kidnapper):
        with HomingEnv(SMALL.with_changes(max_steps=6), observation="features") as env:
            env.reset(seed=0)
            world, agent = kidnapper(env), RandomAgent(SMALL, np.random.default_rng(1))
            steps, after = run_episode(world, agent)[0], run_episode(world, agent)[0]
            there, _ = drive(
                elsewhere, *env.settings.wheel_commands_m[int(steps[3, 3])], SMALL.wheel_base_m, env.world.clearance
            )
        return steps[:, :3], there, after[:, :2]

    alone, *_ = poses(lambda env: env)
    kidnapped, there, after = poses(lambda env: Kidnapped(env, 3, elsewhere))
    np.testing.assert_array_equal(kidnapped[:3], alone[:3])
    np.testing.assert_allclose(kidnapped[3], there, rtol=0, atol=1e-9)
    assert np.hypot(*(after[3] - elsewhere[:2])) < 0.07 < np.hypot(*(after[2] - elsewhere[:2]))


def test_a_name_that_is_neither_a_column_nor_a_setting_selects_no_rows():
    table = pd.DataFrame({"seed": [1, 2], "kind": [0.0, 1.0]})
    assert studies.rows(table, kind=1, room="attic").seed.tolist() == [2]  # a setting that does not vary
    with pytest.raises(ValueError, match=r"nor a setting: rom$"):
        studies.rows(table, kind=1, rom="attic")


def test_starts_cover_the_room_where_the_robot_fits():
    with HomingEnv(SMALL) as env:
        starts = list(measures.starts_everywhere(env))
        assert all(env.world.clearance(*pose[:2]) >= 0 for pose in starts)
    places = [pose[:2] for pose in starts]
    assert len({*places}) == len(places)
    for low, high, size in zip(np.min(places, 0), np.max(places, 0), PAPER.size, strict=True):
        assert low < 0.1
        assert high > size - 0.16


# The shortest way


def plane(home, **changes):
    """An endless plane: home is seen wherever `home` says of a pose."""
    return SimpleNamespace(
        settings=Settings(**changes),
        room=SimpleNamespace(start=Pose(0.21, 0.51, 0.0)),
        home=Pose(0.21, 0.51, 0.0),
        world=SimpleNamespace(clearance=lambda x, y: 1.0, histogram=lambda pose: np.full(3, float(home(pose)))),
        model=SimpleNamespace(features=lambda histogram: histogram),
    )


@pytest.mark.parametrize(
    ("home", "changes", "least"),
    [
        (lambda pose: pose.x >= 0.21 + 0.31, {"forward_m": 0.04}, 8),
        (lambda pose: pose.x >= 0.21 + 0.01, {"forward_m": 0.04}, 1),
        (lambda pose: abs(pose.heading) > pi - 0.01, {"turn_deg": 20.0}, 9),
        (lambda pose: False, {"max_steps": 4}, np.nan),
    ],
)
def test_the_shortest_way_is_distance_by_step_and_angle_by_turn_and_none_is_longer_than_the_cap(home, changes, least):
    assert measures.fewest_steps(plane(home, **changes)) == pytest.approx(least, nan_ok=True)


def test_the_shortest_way_does_not_drive_through_a_wall():
    around = plane(lambda pose: pose.x >= 0.40, forward_m=0.04, turn_deg=30.0, turn_advance_m=0.03)
    straight = measures.fewest_steps(around)
    around.world.clearance = lambda x, y: max(abs(x - 0.31) - 0.005, abs(y - 0.51) - 0.1)
    assert straight == 5
    assert 5 < measures.fewest_steps(around) < 20


def test_the_shortest_way_is_the_actions_that_lead_there():
    world = plane(lambda pose: pose.y >= 0.51 + 0.07, forward_m=0.04, turn_deg=90.0, turn_advance_m=0.0)
    assert measures.shortest_way(world) == [LEFT_FORWARD, GO_FORWARD, GO_FORWARD]
    walled = plane(lambda pose: pose.heading < -1, forward_m=0.04, turn_deg=90.0, max_steps=6)
    walled.world.clearance, walled.world.infrared = lambda x, y: -0.01, lambda pose: np.zeros(8)
    assert measures.shortest_way(walled) == []
    assert len(measures.shortest_way(walled, walls=True)) == 2  # stopped by the wall, then turned by the reflex


def test_an_end_that_does_not_count_ends_a_way_all_the_same():
    changes = {"forward_m": 0.04, "turn_deg": 90.0, "turn_advance_m": 0.0, "max_steps": 6}
    world = plane(lambda pose: pose.x >= 0.21 + 0.07, **changes)
    assert len(measures.shortest_way(world)) == 2
    beside = measures.shortest_way(world, counts=lambda pose: pose.y > 0.51 + 0.02)
    assert len(beside) == 5  # up, ahead, and there: two turns, three moves
    assert measures.shortest_way(world, counts=lambda pose: pose.x >= 0.21 + 0.11) == []  # behind the first


def test_an_end_that_does_not_count_hides_no_other_in_its_cell():
    # Two ways into the same cell of 2 cm: the first, straight, ends where it does not count.
    world = plane(
        lambda pose: pose.x >= 0.21 + 0.035, forward_m=0.038, turn_deg=20.0, turn_advance_m=0.019, max_steps=4
    )
    asked = []

    def counts(pose):
        asked.append((int(pose.x / 0.02), int(pose.y / 0.02), round(pose.heading / np.radians(10))))
        return pose.y != pytest.approx(0.51)

    assert measures.shortest_way(world) == [GO_FORWARD]
    assert len(measures.shortest_way(world, counts=counts)) == 2
    assert len({*asked}) < len(asked)


@pytest.mark.slow
def test_no_episode_is_shorter_than_the_shortest_way():
    for seed in (1000, 1001):
        (least,), learnt = measures.shortest(COMPACT, seed)["steps"], run(COMPACT, seed)
        assert least <= learnt.lengths[learnt.reached].min()


def test_views_compare_the_camera_with_the_atlas():
    table = measures.views(COMPACT, 0)
    assert tuple(table) == ("x", "y", "heading", "camera", "atlas")
    assert all(values.shape == (400,) for values in table.values())
    camera, looked_up = table["camera"], table["atlas"]
    assert ((camera > 0) & (camera <= 1) & (looked_up > 0) & (looked_up <= 1)).all()
    assert np.corrcoef(camera, looked_up)[0, 1] > 0.5


# What is stored


def test_the_docstring_of_a_measure_names_every_column_of_its_table():
    assert {*STEP_COLUMNS} <= set(re.findall(r"`([^`]+)`", (DATA / "README.md").read_text(encoding="utf-8")))
    for study in TABLES:
        text = f"{study.measure.__doc__} {measures.totals_of.__doc__ if 'total' in study.measure.__doc__ else ''}"
        words = set(re.findall(r"`([^`]+)`", text))
        columns = {
            re.sub(r"^at_\d+", "at_0", re.sub(r"after_\d+", "after_5", name)) for name in pd.read_parquet(study.table)
        }
        assert columns - words <= {"condition", "seed"}, (study.name, study.measure.__name__)


@each_table
def test_a_stored_table_is_of_its_study_as_it_stands_and_complete(study):
    rows = load_table(study).groupby(["condition", "seed"], observed=True).size()
    assert len(rows) == len(study.conditions) * len(study.seeds)
    if study.measure in (measures.totals, measures.curve):
        for label, settings in study.conditions.items():
            assert rows[label].eq(1 if study.measure is measures.totals else settings.episodes).all()


def recomputed_as_stored(study, label, seed, **changes):
    """Whether a run gives the rows that are stored of it, to 32-bit precision."""
    table = pd.read_parquet(study.table)
    rows = table[(table.condition == label) & (table.seed == seed)]
    for name, values in study.measure(study.conditions[label].with_changes(**changes), seed).items():
        with np.errstate(over="ignore"):
            np.testing.assert_allclose(rows[name], values.astype(np.float32), rtol=1e-6, atol=1e-6, err_msg=name)


def sample(study, count):
    """Conditions and seeds of runs drawn at random."""
    rng = np.random.default_rng(2014)
    return [(rng.choice([*study.conditions]), int(rng.choice(study.seeds))) for _ in range(count)]


def test_the_shortest_run_of_the_headline_is_the_same_when_computed_again():
    stored = [one for results in runs.load_study(studies.HEADLINE).values() for one in results]
    one = min(stored, key=lambda result: len(result.steps))
    assert sweep.compare(one, run(one.settings, one.seed)) in ("to the bit", "within tolerance")


def test_a_run_with_the_camera_and_some_on_the_coarsest_atlas_are_the_same_when_computed_again():
    table = load_table(learns.CAMERA)
    recomputed_as_stored(learns.CAMERA, *table.groupby(["condition", "seed"], observed=True).steps.sum().idxmin())
    label, *_ = studies.LATTICES
    for _, seed in sample(studies.LATTICE_RUNS, 3):
        recomputed_as_stored(studies.LATTICE_RUNS, label, seed, images="compact")  # the same lattice


@pytest.mark.slow
@each_table
def test_a_random_sample_of_every_table_is_the_same_when_computed_again(study):
    if study.deep:
        pytest.importorskip("stable_baselines3")
    for label, seed in sample(study, 2):
        recomputed_as_stored(study, label, seed)
