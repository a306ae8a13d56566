import copy
import doctest
import gc
import os
import pickle
import subprocess
import sys
import tempfile
import warnings
from functools import partial
from itertools import pairwise
from math import pi, radians
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from gymnasium.wrappers import FlattenObservation, TransformReward

import homing_lib.atlas
from homing_lib.environment import CONSTANT_COST, HomingEnv, reward, survey
from homing_lib.errors import UserError
from homing_lib.features import histogram
from homing_lib.robot import GO_FORWARD, LEFT_FORWARD, RIGHT_FORWARD
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.thresholds import stopping_thresholds

ROOT = Path(__file__).parent.parent
FORWARD = Settings().forward_m
BEFORE_HOME = (PAPER.home.x - FORWARD, PAPER.home.y, 0.0)
"""From here one step forward ends at home."""
FACING_WALL = (0.06, 0.5, pi)


def make(name="homing/UTurn-v0", **options):
    return gymnasium.make(name, **{"survey_steps": 60} | options)


@pytest.fixture
def env(home_model):
    """An environment of default settings, surveyed, which observes features."""
    with HomingEnv(observation="features", model=home_model) as env:
        yield env


def drive(env, actions, **reset):
    """One episode as far as the actions go: all that reset and step returned."""
    seen = [env.reset(**reset)]
    for action in actions:
        seen.append(env.step(action))
        if seen[-1][2] or seen[-1][3]:
            break
    return seen


def assert_same(first, second):
    """Nested results equal to the bit."""
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        for a, b in zip(one, other, strict=True):
            if isinstance(a, dict):
                assert a == b
            else:
                np.testing.assert_array_equal(a, b)


def random_actions(number, seed=0):
    return np.random.default_rng(seed).integers(3, size=number).tolist()


# Gymnasium's contract


@pytest.mark.parametrize(
    ("observation", "images"), [("image", "camera"), ("features", "camera"), ("features", "compact")]
)
@pytest.mark.parametrize("start", [None, "uniform"])
def test_gymnasiums_checker_passes_it_without_a_warning(observation, images, start):
    with warnings.catch_warnings(), make(observation=observation, images=images, start=start) as env:
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_gymnasiums_checker_passes_it_through_wrappers_too():
    with (
        warnings.catch_warnings(),
        TransformReward(FlattenObservation(make(render_mode="rgb_array")), lambda r: r / 2) as env,
    ):
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*is different from the unwrapped version")  # that it is wrapped
        check_env(env)


@pytest.mark.slow
def test_the_checker_of_stable_baselines_3_passes_it_without_a_warning_and_its_dqn_learns_from_it():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    from stable_baselines3 import DQN

    for observation in ("image", "features"):
        with warnings.catch_warnings(), make(observation=observation, render_mode="rgb_array") as env:
            warnings.simplefilter("error")
            checker.check_env(env.unwrapped)
    with make(observation="features") as env:
        learner = DQN("MlpPolicy", env, learning_starts=50, seed=0).learn(200)
        assert learner.num_timesteps == 200


def test_the_name_is_known_after_import_of_the_package_which_does_not_load_the_simulator():
    pytest.importorskip("pybullet", reason="needs PyBullet")
    code = """
import sys, gymnasium, homing_lib
assert "homing/UTurn-v0" in gymnasium.registry
print("pybullet" in sys.modules)
gymnasium.make("homing/UTurn-v0").close()
print("pybullet" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
    assert done.stderr == ""


def test_gymnasium_finds_it_by_module_and_name():
    with make("homing_lib:homing/UTurn-v0") as env:
        assert isinstance(env.unwrapped, HomingEnv)


@pytest.mark.parametrize("vector", [SyncVectorEnv, partial(AsyncVectorEnv, context="spawn")], ids=["sync", "async"])
def test_in_a_vector_each_environment_drives_as_if_it_were_alone(vector):
    actions = random_actions(15)
    envs = vector([partial(make, start="uniform")] * 2)
    try:
        observations, infos = envs.reset(seed=[3, 4])
        together = [(observations.copy(), infos["similarity"])]
        for action in actions:
            observations, rewards, terminated, truncated, infos = envs.step(np.array([action, action]))
            assert not (terminated.any() or truncated.any())
            together.append((observations.copy(), rewards))
    finally:
        envs.close()
    for index, seed in enumerate([3, 4]):
        with make(start="uniform") as alone:
            (observation, info), *steps = drive(alone, actions, seed=seed)
        np.testing.assert_array_equal(together[0][0][index], observation)
        assert together[0][1][index] == info["similarity"]
        for (seen, rewards), (observation, gain, *_) in zip(together[1:], steps, strict=True):
            np.testing.assert_array_equal(seen[index], observation)
            assert rewards[index] == gain


def test_the_example_in_its_docstring_runs():
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner()
    for example in finder.find(HomingEnv, "HomingEnv", globs={}):
        runner.run(example)
    assert runner.summarize(verbose=False) == (0, 5)


# Seeds


@pytest.mark.parametrize("observation", ["image", "features"])
def test_the_same_seed_gives_the_same_episode_to_the_bit_and_another_seed_another(observation, home_model):
    actions = random_actions(40)
    with HomingEnv(observation=observation, model=home_model, start="uniform", wheel_slip=0.05) as env:
        first = drive(env, actions, seed=7)
        env.reset(seed=8)
        assert_same(drive(env, actions, seed=7), first)
        assert env.reset(seed=8)[1]["pose"] != first[0][1]["pose"]


def test_without_a_seed_the_next_episode_goes_on_with_the_same_random_numbers(home_model):
    starts = []
    with HomingEnv(observation="features", model=home_model, start="uniform") as env:
        for _ in range(2):
            starts.append([env.reset(seed=7)[1]["pose"], env.reset()[1]["pose"], env.reset()[1]["pose"]])
    assert starts[0] == starts[1]
    assert len(set(starts[0])) == 3


def test_the_survey_does_not_disturb_the_seed():
    actions = random_actions(40)
    with HomingEnv(observation="features", survey_steps=60, start="uniform") as surveying:
        first = drive(surveying, actions, seed=7)  # surveys after the generator is seeded
        assert_same(drive(surveying, actions, seed=7), first)  # does not survey again
        with HomingEnv(observation="features", survey_steps=60, start="uniform", model=surveying.model) as told:
            assert_same(drive(told, actions, seed=7), first)


def test_environments_alive_at_once_share_a_survey_unless_its_seed_differs():
    with (
        HomingEnv(survey_steps=60) as first,
        HomingEnv(survey_steps=60) as second,
        HomingEnv(survey_steps=60, survey_seed=1) as third,
    ):
        for env in (first, second, third):
            env.reset()
        assert second.model is first.model
        assert (third.model.variance != first.model.variance).all()
        np.testing.assert_array_equal(third.model.snapshots, first.model.snapshots)


# Observations


def test_images_and_features_show_the_same_episode(env, home_model):
    actions = random_actions(20)
    with HomingEnv(model=home_model) as seeing:
        for (image, *_, info), (phi, *_, same) in zip(
            *(drive(each, actions, seed=0) for each in (seeing, env)), strict=True
        ):
            assert image in seeing.observation_space
            assert phi in env.observation_space
            np.testing.assert_array_equal(home_model.features(histogram(image, 3)), phi)
            assert info == same


def test_an_image_belongs_to_its_receiver(home_model):
    with HomingEnv(model=home_model) as env:
        (image, _), (after, *_) = drive(env, [GO_FORWARD])
        kept = image.copy()
        after[:] = 0
        env.step(LEFT_FORWARD)
        np.testing.assert_array_equal(image, kept)


def test_home_may_be_anywhere_and_there_the_similarity_is_one():
    home = (0.3, 0.3, 1.0)
    with HomingEnv(observation="features", home=home, start=home, survey_steps=60) as env:
        phi, info = env.reset()
        assert info["similarity"] == 1
        np.testing.assert_array_equal(phi, np.ones(258))


def test_the_survey_keeps_the_view_at_home_and_with_three_snapshots_those_20_degrees_to_either_side(arena):
    s = Settings(snapshots=3, survey_steps=10)
    model = survey(arena, s, PAPER.home, np.random.default_rng(0))
    assert model.n_features == s.n_features
    for row, degrees in enumerate((0, 20, -20)):
        view = PAPER.home._replace(heading=PAPER.home.heading + radians(degrees))
        np.testing.assert_array_equal(model.snapshots[row], arena.histogram(view))


# Start


def test_an_episode_starts_where_it_is_told_for_once_or_always_and_by_default_where_the_room_says(env, home_model):
    assert env.reset()[1]["pose"] == PAPER.start
    assert env.reset(options={"start": (0.5, 0.4, 1.0)})[1]["pose"] == (0.5, 0.4, 1.0)
    assert env.reset()[1]["pose"] == PAPER.start
    with HomingEnv(observation="features", model=home_model, start=(0.5, 0.4, 1.0)) as other:
        assert other.reset()[1]["pose"] == (0.5, 0.4, 1.0)
        assert other.reset(options={"start": "uniform"}, seed=1)[1]["pose"] != (0.5, 0.4, 1.0)


def test_uniform_starts_are_free_and_spread_evenly_over_room_and_headings(env):
    poses = np.array([env.reset(seed=seed, options={"start": "uniform"})[1]["pose"] for seed in range(400)])
    assert all(env.world.clearance(x, y) >= 0 for x, y, _ in poses)
    # Free positions lie between the body's radius from the walls; the television's side has fewer.
    assert poses.min(axis=0) == pytest.approx([0.035, 0.035, -pi], abs=0.05)
    assert poses.max(axis=0)[1:] == pytest.approx([0.965, pi], abs=0.05)
    for column, middle in ((0, 0.55), (1, 0.5), (2, 0.0)):
        assert 0.4 < (poses[:, column] < middle).mean() < 0.6


@pytest.mark.parametrize(
    ("start", "line"),
    [
        ((0.0, 0.5, 0.0), "start = (0, 0.5, 0): the robot does not fit there; choose a pose in free space of room"),
        ((1.1, 0.5, 0.0), "start = (1.1, 0.5, 0): the robot does not fit there"),
        ((5.0, 0.5, 0.0), "start = (5, 0.5, 0): the robot does not fit there"),
        ((0.5, float("nan"), 0.0), "start = (0.5, nan, 0): the robot does not fit there"),
        ((0.5, 0.5, float("inf")), "start = (0.5, 0.5, inf): the robot does not fit there"),
        ((0.5, 0.5), "start = (0.5, 0.5): must be a pose (x, y, heading) in metres and radians"),
        ("home", "start = 'home': must be a pose"),
        (3, "start = 3: must be a pose"),
    ],
)
def test_a_start_that_cannot_be_is_refused_in_one_line_and_leaves_no_client_behind(start, line, env):
    clients = open_clients()
    for attempt in (lambda: HomingEnv(start=start), lambda: env.reset(options={"start": start})):
        with pytest.raises(UserError) as refusal:
            attempt()
        assert str(refusal.value).startswith(line)
        assert "\n" not in str(refusal.value)
    assert open_clients() == clients


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"home": (0, 0, 0)}, "home = (0, 0, 0): the robot does not fit there"),
        ({"room": "cellar"}, "room 'cellar': there is none of this name; known are paper, "),
        ({"observation": "both"}, "observation = 'both': must be one of image, features"),
        ({"render_mode": "human"}, "render_mode = 'human': must be rgb_array or None"),
        ({"alpha0": -1}, "setting alpha0 = -1: Input should be greater than or equal to 0.000000001"),
        ({"colour": 1}, "setting colour: there is none of this name"),
        ({"images": "atlas"}, 'observation = "image": an atlas has histograms only; choose "features"'),
        ({"snapshots": 3}, "model: has 258 features, the settings ask for 774 (eq. 14)"),
    ],
)
def test_an_option_that_cannot_be_is_refused_in_one_line_and_leaves_no_client_behind(options, line, home_model):
    clients = open_clients()
    with pytest.raises(UserError) as refusal:
        HomingEnv(model=home_model, **options)
    assert str(refusal.value).startswith(line)
    assert "\n" not in str(refusal.value)
    assert open_clients() == clients


# A step


@pytest.mark.parametrize("action", [-1, 3, 0.5, None, "left"])
def test_an_action_that_does_not_exist_is_refused_and_nothing_moves(action, env):
    pose = env.reset()[1]["pose"]
    with pytest.raises(UserError, match=f"^action = {action!r}: must be 0, 1 or 2$"):
        env.step(action)
    assert env.step(np.int64(GO_FORWARD))[4]["pose"].x == pytest.approx(pose.x - FORWARD)


def test_the_actions_are_left_right_and_forward(env):
    s = Settings()
    for action, turn in ((LEFT_FORWARD, s.turn_deg), (RIGHT_FORWARD, -s.turn_deg), (GO_FORWARD, 0)):
        env.reset(options={"start": (0.5, 0.5, 0.0)})
        info = env.step(action)[4]
        assert info["pose"].heading == pytest.approx(radians(turn))
        assert info["action"] == action


STEP = {"step": 4, "similarity": 0.95, "before": 0.92, "psi_lower": 0.9, "at_wall": False}


@pytest.mark.parametrize(
    ("changes", "settings", "expected"),
    [
        ({}, {}, -1 / 4 + 2 * 0.95 - 0.92),
        ({"similarity": 0.89}, {}, -1 / 4),  # this view below psi_lower
        ({"before": 0.89}, {}, -1 / 4),  # the view before it
        ({"similarity": 0.9, "before": 0.9}, {}, -1 / 4 + 0.9),  # both just reach it
        ({"at_wall": True}, {"wall_penalty": 3}, -1 / 4 + 2 * 0.95 - 0.92 - 3),
        ({}, {"approach_reward": False}, -1 / 4),
        ({"similarity": 0.5, "step": 1}, {}, -1),
        ({"similarity": 0.5}, {"step_cost": "constant"}, -5.187377517639621 / 100),  # the 100th harmonic number
        ({"at_wall": True}, {"wall_penalty": 3, "reward_scale": 0}, 0),
        ({"at_wall": True}, {"wall_penalty": 3, "reward_scale": -1}, 1 / 4 - 2 * 0.95 + 0.92 + 3),
        ({"home": True, "before": 0.5}, {"terminal_bonus": 7}, -1 / 4 + 7),
        ({"home": True, "before": 0.5}, {"terminal_bonus": 7, "reward_scale": -1}, 1 / 4 + 7),
        ({"before": 0.5}, {"terminal_bonus": 7}, -1 / 4),  # not at home yet
    ],
)
def test_the_reward_is_eq_16_less_the_wall_penalty(changes, settings, expected):
    assert reward(**STEP | changes, settings=Settings(**settings)) == pytest.approx(expected)


def test_the_constant_cost_of_100_steps_is_that_of_the_first_100_steps_under_one_over_t():
    assert sum(1 / t for t in range(1, 101)) == pytest.approx(100 * CONSTANT_COST)


def test_rewards_of_an_episode_follow_from_what_info_reports(env):
    s, (_, psi_lower) = Settings(), stopping_thresholds(12)
    (_, at_start), *steps = drive(env, random_actions(60), seed=0)
    infos = [at_start, *(info for *_, info in steps)]
    for t, ((before, after), (_, gain, *_)) in enumerate(zip(pairwise(infos), steps, strict=True), start=1):
        assert gain == reward(t, after["similarity"], before["similarity"], psi_lower, after["at_wall"], s)
    assert any(info["at_wall"] for info in infos)


def test_the_bonus_is_paid_in_the_step_that_ends_at_home_and_in_no_other(home_model):
    with HomingEnv(observation="features", model=home_model, start="uniform", terminal_bonus=50) as env:
        _, *steps = drive(env, random_actions(2000), seed=1)
    assert [gain > 40 for _, gain, *_ in steps] == [home for _, _, home, *_ in steps]
    assert steps[-1][2]


def test_a_wider_band_pays_for_views_that_eq_19_would_not(home_model):
    gains = {}
    for band in (1, 11):
        with HomingEnv(observation="features", model=home_model, start="uniform", band=band) as env:
            _, *steps = drive(env, random_actions(2000), seed=1)
        gains[band] = np.array([gain for _, gain, *_ in steps])
    assert (gains[11] >= gains[1]).all()
    assert (gains[11] > 0).sum() > (gains[1] > 0).sum()


def test_the_setting_start_draws_each_start_anew_unless_the_environment_is_told_one(home_model):
    uniform = Settings(start="uniform")
    with HomingEnv(uniform, observation="features", model=home_model) as env:
        first, second = (env.reset(seed=seed)[1]["pose"] for seed in (1, 2))
    assert first != second
    assert env.room.start not in (first, second)
    with HomingEnv(uniform, observation="features", model=home_model, start=(0.5, 0.4, 1.0)) as env:
        assert env.reset(seed=1)[1]["pose"] == (0.5, 0.4, 1.0)


def test_info_says_what_was_driven_and_what_will_be(env):
    (_, at_start), *steps = drive(env, [GO_FORWARD] * 8, options={"start": FACING_WALL})
    assert at_start == {
        "similarity": at_start["similarity"],
        "pose": FACING_WALL,
        "action": -1,
        "reflex": -1,
        "at_wall": False,
    }
    stopped = steps[0][4]
    side = stopped["reflex"]
    assert (stopped["action"], stopped["at_wall"]) == (GO_FORWARD, True)
    assert side in (LEFT_FORWARD, RIGHT_FORWARD)
    for (*_, before), (*_, after) in pairwise(steps):
        expected = GO_FORWARD if before["reflex"] < 0 else side
        assert after["action"] == expected
    assert [info["action"] for *_, info in steps].count(side) >= 2
    assert steps[-1][4]["reflex"] == -1


# The end of an episode


def test_an_episode_ends_at_home_and_is_terminated_not_truncated_even_at_the_step_cap(home_model):
    for max_steps in (1, 100):
        with HomingEnv(observation="features", model=home_model, start=BEFORE_HOME, max_steps=max_steps) as env:
            _, (_, gain, terminated, truncated, info) = drive(env, [GO_FORWARD])
            assert (terminated, truncated) == (True, False)
            assert info["similarity"] == pytest.approx(1)
            assert gain > -1


def test_an_episode_that_does_not_reach_home_is_truncated_at_the_step_cap_and_not_before(home_model):
    with HomingEnv(observation="features", model=home_model, max_steps=5) as env:
        for _ in range(2):
            ends = [step[2:4] for step in drive(env, [LEFT_FORWARD] * 9)[1:]]
            assert ends == [(False, False)] * 4 + [(False, True)]


def test_home_is_where_the_similarity_reaches_psi_upper(home_model):
    with HomingEnv(observation="features", model=home_model, start="uniform") as env:
        psi_upper, _ = stopping_thresholds(env.settings.multiplier)
        similarities = []
        for seed in range(5):
            for _, _, terminated, _, info in drive(env, random_actions(300, seed), seed=seed)[1:]:
                assert terminated == (info["similarity"] >= psi_upper)
                similarities.append(info["similarity"])
    assert max(similarities) > psi_upper


def test_a_kidnapped_robot_goes_on_from_where_it_is_put(env):
    drive(env, [GO_FORWARD], options={"start": FACING_WALL})
    env.place((0.5, 0.5, 0.0))
    _, _, _, _, info = env.step(GO_FORWARD)
    assert info["pose"] == pytest.approx((0.5 + FORWARD, 0.5, 0.0))
    assert info["action"] == GO_FORWARD
    with pytest.raises(UserError, match="the robot does not fit there"):
        env.place((0.0, 0.0, 0.0))


# Rendering


def pixel(frame, x, y):
    scale = frame.shape[1] / PAPER.size[0]
    return frame[round((PAPER.size[1] - y) * scale), round(x * scale)].tolist()


YELLOW = [255, 220, 0]


def test_a_frame_shows_the_robot_and_its_path_and_the_next_episode_starts_with_a_clean_floor(home_model):
    with HomingEnv(model=home_model, render_mode="rgb_array") as env:
        env.reset(options={"start": (0.3, 0.7, 0.0)})
        first = env.render()
        assert first.shape == (417, 480, 3)
        assert first.dtype == np.uint8
        assert pixel(first, 0.28, 0.7) == YELLOW  # the disc, behind its middle
        assert pixel(first, 0.24, 0.7) != YELLOW
        for _ in range(4):
            env.step(GO_FORWARD)
        later = env.render()
        assert pixel(later, 0.28 + 4 * FORWARD, 0.7) == YELLOW
        assert pixel(later, 0.35, 0.7) == YELLOW  # the path
        assert pixel(later, 0.35, 0.74) != YELLOW
        env.reset(options={"start": (0.3, 0.7, 0.0)})
        np.testing.assert_array_equal(env.render(), first)


def test_rendering_does_not_change_an_episode(home_model):
    actions = random_actions(20)
    with HomingEnv(model=home_model) as blind, HomingEnv(model=home_model, render_mode="rgb_array") as watched:
        expected = drive(blind, actions, seed=1)
        seen = [watched.reset(seed=1)]
        for action in actions:
            watched.render()
            seen.append(watched.step(action))
        assert_same(seen, expected)


def test_without_a_render_mode_render_returns_nothing_and_warns(env):
    env.reset()
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None


# The atlas


def test_on_an_atlas_it_drives_without_the_simulator_and_home_is_exactly_home(tmp_path, monkeypatch):
    monkeypatch.setattr(homing_lib.atlas, "open_atlas", partial(homing_lib.atlas.open_atlas, folder=tmp_path))
    options = {"images": "atlas", "atlas_spacing_m": 0.1, "atlas_heading_deg": 90, "survey_steps": 200}
    clients = open_clients()
    with HomingEnv(observation="features", start=PAPER.home, render_mode="rgb_array", **options) as env:
        phi, info = env.reset()
        assert info["similarity"] == 1
        np.testing.assert_array_equal(phi, np.ones(258))
        drive(env, random_actions(50), options={"start": "uniform"}, seed=0)
        assert env.render().shape == (417, 480, 3)
        assert open_clients() == clients


# Closing


def open_clients():
    pybullet = pytest.importorskip("pybullet", reason="needs PyBullet")
    return [client for client in range(1025) if pybullet.isConnected(client)]


def test_a_closed_environment_is_closed_twice_without_harm_and_refuses_everything_else_with_its_reason(home_model):
    env = HomingEnv(model=home_model, render_mode="rgb_array")
    env.reset()
    for _ in range(2):
        env.close()
    for attempt in (env.reset, env.render, partial(env.step, GO_FORWARD), partial(env.place, PAPER.home)):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="this environment is closed"):
            attempt()


def test_before_the_first_reset_a_step_is_refused_with_its_reason(env):
    for attempt in (env.render, partial(env.step, GO_FORWARD), partial(env.place, PAPER.home)):
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"begins with reset\(\)"):
            attempt()


def test_60_environments_opened_and_closed_leave_nothing_behind(tmp_path, monkeypatch, home_model):
    def held():
        resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        return len(list(Path("/proc/self/fd").iterdir())), open_clients(), resident / 2**20

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for number in range(60):
        with HomingEnv(observation="features", model=home_model) as env:
            env.reset(seed=number)
        if number == 19:  # what is allocated once, is by now
            before = held()
    after = held()
    assert after[0] <= before[0]  # joblib's idle workers may have closed theirs meanwhile
    assert after[1] == before[1]
    assert list(tmp_path.iterdir()) == []
    assert after[2] - before[2] < 30  # MB; Bullet keeps about .05 an environment, a forgotten one would keep some 10


def test_an_environment_with_the_camera_cannot_be_copied_or_pickled_and_one_without_can(home_model):
    with HomingEnv(model=home_model) as env:
        for attempt in (copy.deepcopy, copy.copy, pickle.dumps):
            with pytest.raises(UserError, match=r'^an environment with images="camera" cannot be copied or pickled'):
                attempt(env)
        env.reset(seed=0)
    with HomingEnv(images="compact", observation="features") as env:
        env.reset(seed=0)
        others = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
        env.step(0)
        seen = env.step(2)
        for other in others:
            other.step(0)
            again = other.step(2)
            np.testing.assert_array_equal(again[0], seen[0])
            assert again[1:] == seen[1:]


def test_an_environment_that_is_dropped_unclosed_frees_its_client(home_model):
    before = open_clients()
    env = HomingEnv(model=home_model)
    env.reset(seed=0)
    del env
    gc.collect()
    assert open_clients() == before


@pytest.mark.parametrize("action", [np.array([1]), 1.0, "1", None, [0], np.ones(300)])
def test_an_action_is_a_whole_number(action):
    with HomingEnv(images="compact", observation="features") as env:
        env.reset(seed=0)
        with pytest.raises(UserError, match=r"^action = .{1,60}: must be 0, 1 or 2$"):
            env.step(action)


@pytest.mark.parametrize("options", [5, {"strat": (0, 0, 0)}, ["start"], "start"])
def test_options_that_are_none_are_refused(options):
    env = HomingEnv(images="compact", observation="features")
    with pytest.raises(UserError, match=r"^options = .*: must be None or \{'start': ...\}$"):
        env.reset(options=options)


def test_where_every_view_passes_for_home_there_is_one_line():
    env = HomingEnv(light=0.01, image_size=16, observation="features", survey_steps=20)
    with pytest.raises(UserError, match=r"^settings: every view passes for home"):
        env.reset(seed=0)
