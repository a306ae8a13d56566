"""The task as Gymnasium's contract: checked for every kind of images, and what its docstring promises."""

import copy
import doctest
import gc
import pickle
import tempfile
import warnings
from functools import partial
from itertools import pairwise
from math import pi, radians
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from homing_lib import atlas
from homing_lib.environment import HomingEnv, reward
from homing_lib.errors import UserError
from homing_lib.features import histogram
from homing_lib.robot import GO_FORWARD, LEFT_FORWARD, RIGHT_FORWARD
from homing_lib.rooms import PAPER, Pose
from homing_lib.settings import Settings
from homing_lib.survey import survey
from homing_lib.thresholds import stopping_thresholds

FORWARD = Settings().forward_m
FACING_WALL = (0.06, 0.5, pi)
COMPACT = {"observation": "features", "images": "compact", "survey_steps": 60}
KINDS = {
    "camera's images": {"survey_steps": 60},
    "camera's features": {"observation": "features", "survey_steps": 60},
    "compact": COMPACT,
    "atlas": COMPACT | {"images": "atlas", "atlas_spacing_m": 0.1, "atlas_heading_deg": 90, "image_size": 16},
}
every_kind = pytest.mark.parametrize("options", KINDS.values(), ids=KINDS)


@pytest.fixture(autouse=True, scope="module")
def folder(tmp_path_factory):
    """Where a coarse atlas is kept."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(atlas, "FOLDER", tmp_path_factory.mktemp("atlas"))
        yield


def make(**options):
    return gymnasium.make("homing_lib:homing/UTurn-v0", **options)


@pytest.fixture
def env():
    """An environment of default settings on the compact atlas."""
    with HomingEnv(**COMPACT) as env:
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
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1:] == other[1:]


def random_actions(number, seed=0):
    return np.random.default_rng(seed).integers(3, size=number).tolist()


# Gymnasium's contract


@every_kind
def test_gymnasiums_two_checkers_pass_it_without_a_warning(options):
    with warnings.catch_warnings(), make(**options, start="uniform") as env:
        warnings.simplefilter("error")
        check_env(env.unwrapped)
        drive(env, random_actions(20), seed=0)  # through the passive one


@every_kind
def test_an_observation_is_a_new_array_that_belongs_to_its_receiver(options):
    with HomingEnv(**options) as env, HomingEnv(**options) as twin:
        expected = drive(twin, [0, 2, 2], seed=0)
        seen, kept = env.reset(seed=0)[0], []
        for action, (observation, *_) in zip((0, 2, 2, 2), expected, strict=True):
            np.testing.assert_array_equal(seen, observation)
            kept.append(seen)
            assert seen.flags.c_contiguous
            seen[:] = 0
            seen = env.step(action)[0]
        assert not any(np.shares_memory(one, other) for one, other in pairwise(kept))


def test_its_specification_goes_through_json_with_settings_by_their_names_and_makes_it_again_as_do_whole_ones():
    whole = Settings(images="compact", survey_steps=60, wheel_slip=0.1, lambda_rule="fixed:0.5", multiplier=11)
    options = {"observation": "features", "home": (0.5, 0.5, 0.0)}
    with make(**whole.model_dump(), **options) as env:
        specification = EnvSpec.from_json(env.spec.to_json())
        expected = drive(env, random_actions(20), seed=3)
    for again in (gymnasium.make(specification), make(settings=whole, **options)):
        with again:
            assert again.unwrapped.settings == whole
            assert_same(drive(again, random_actions(20), seed=3), expected)


def test_wrappers_see_the_same_episode(env):
    expected = drive(env, random_actions(9), seed=2)
    wrapped = gymnasium.wrappers.TimeLimit(make(**COMPACT), 9)
    with gymnasium.wrappers.FrameStackObservation(gymnasium.wrappers.RecordEpisodeStatistics(wrapped), 2) as stacked:
        (first, _), *steps = drive(stacked, random_actions(50), seed=2)
    np.testing.assert_array_equal(first[-1], expected[0][0])
    for (seen, *_), (phi, *_) in zip(steps, expected[1:], strict=True):
        np.testing.assert_array_equal(seen[-1], phi)
    assert steps[-1][3]
    assert steps[-1][4]["episode"]["r"] == pytest.approx(sum(gain for _, gain, *_ in expected[1:]))


@pytest.mark.slow
def test_the_checker_of_stable_baselines_3_passes_it_without_a_warning_and_its_dqn_learns_from_it():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    from stable_baselines3 import DQN

    for observation in ("image", "features"):
        with warnings.catch_warnings(), make(observation=observation, render_mode="rgb_array") as env:
            warnings.simplefilter("error")
            checker.check_env(env.unwrapped)
    with make(**COMPACT) as env:
        learner = DQN("MlpPolicy", env, learning_starts=50, seed=0).learn(200)
        assert learner.num_timesteps == 200


@pytest.mark.parametrize("vector", [SyncVectorEnv, partial(AsyncVectorEnv, context="spawn")], ids=["sync", "async"])
def test_in_a_vector_each_environment_drives_as_if_it_were_alone(vector):
    actions, options = random_actions(15), COMPACT | {"start": "uniform"}
    envs = vector([partial(make, **options)] * 2)
    try:
        together = [envs.reset(seed=[3, 4])[0].copy()]
        together += [envs.step(np.array([action, action]))[0].copy() for action in actions]
    finally:
        envs.close()
    for index, seed in enumerate([3, 4]):
        with make(**options) as alone:
            expected = drive(alone, actions, seed=seed)
        for seen, (observation, *_) in zip(together, expected, strict=True):
            np.testing.assert_array_equal(seen[index], observation)


def test_the_example_in_its_docstring_runs():
    finder, runner = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner()
    for example in finder.find(HomingEnv, "HomingEnv", globs={}):
        runner.run(example)
    assert runner.summarize(verbose=False) == (0, 5)


# Seeds


@every_kind
def test_the_same_seed_gives_the_same_episode_to_the_bit_and_another_seed_another(options):
    actions = random_actions(40)
    with HomingEnv(**options, start="uniform", wheel_slip=0.05) as env:
        first = drive(env, actions, seed=7)  # surveys after the generator is seeded
        assert env.reset(seed=8)[1]["pose"] != first[0][1]["pose"]
        assert_same(drive(env, actions, seed=7), first)  # does not survey again
        with HomingEnv(**options, start="uniform", wheel_slip=0.05, model=env.model) as given:
            assert_same(drive(given, actions, seed=7), first)


def test_without_a_seed_the_next_episode_goes_on_with_the_same_random_numbers(env):
    uniform = {"options": {"start": "uniform"}}
    starts = [
        [env.reset(seed=7, **uniform)[1]["pose"], *(env.reset(**uniform)[1]["pose"] for _ in range(2))]
        for _ in range(2)
    ]
    assert starts[0] == starts[1]
    assert len(set(starts[0])) == 3


def test_environments_alive_at_once_share_a_survey_unless_its_seed_differs(env):
    with HomingEnv(**COMPACT) as second, HomingEnv(**COMPACT, survey_seed=1) as third:
        models = [each.surveyed() for each in (env, second, third)]
    assert models[0] is models[1]
    assert (models[2].variance != models[0].variance).all()
    np.testing.assert_array_equal(models[2].snapshots, models[0].snapshots)


# What it sees


def test_images_and_features_show_the_same_episode(home_model):
    actions = random_actions(20)
    with HomingEnv(model=home_model) as seeing, HomingEnv(observation="features", model=home_model) as env:
        both = zip(*(drive(each, actions, seed=0) for each in (seeing, env)), strict=True)
        for (image, *_, info), (phi, *_, same) in both:
            np.testing.assert_array_equal(home_model.features(histogram(image, 3)), phi)
            assert info == same


@every_kind
def test_home_may_be_anywhere_on_the_lattice_and_there_the_similarity_is_one(options):
    home = (PAPER.home.x - 0.4, PAPER.home.y - 0.2, pi / 2)
    with HomingEnv(**options, home=home, start=home) as env:
        assert env.reset()[1]["similarity"] == 1


def test_the_survey_keeps_the_view_at_home_and_with_three_snapshots_those_20_degrees_to_either_side(arena):
    s = Settings(snapshots=3, survey_steps=10)
    model = survey(arena, s, PAPER.home, np.random.default_rng(0))
    assert model.n_features == s.n_features
    for row, degrees in enumerate((0, 20, -20)):
        view = PAPER.home._replace(heading=PAPER.home.heading + radians(degrees))
        np.testing.assert_array_equal(model.snapshots[row], arena.histogram(view))


# Start


def test_an_episode_starts_where_it_is_told_for_once_or_always_and_by_default_where_the_settings_say(env):
    pose = (0.5, 0.4, 1.0)
    assert env.reset()[1]["pose"] == PAPER.start
    assert env.reset(options={"start": pose})[1]["pose"] == pose
    assert env.reset()[1]["pose"] == PAPER.start
    with HomingEnv(Settings(start="uniform"), **COMPACT) as drawn:
        assert len({PAPER.start, *(drawn.reset(seed=seed)[1]["pose"] for seed in (1, 2))}) == 3
    with HomingEnv(Settings(start="uniform"), **COMPACT, start=pose) as other:
        assert other.reset(seed=1)[1]["pose"] == pose
        assert other.reset(options={"start": "uniform"}, seed=1)[1]["pose"] != pose


def test_uniform_starts_are_free_and_spread_evenly_over_room_and_headings(env):
    poses = np.array([env.reset(seed=seed, options={"start": "uniform"})[1]["pose"] for seed in range(400)])
    assert all(env.world.clearance(x, y) >= 0 for x, y, _ in poses)
    # Free positions lie between the body's radius from the walls; the television's side has fewer.
    assert poses.min(axis=0) == pytest.approx([0.035, 0.035, -pi], abs=0.05)
    assert poses.max(axis=0)[1:] == pytest.approx([0.965, pi], abs=0.05)
    for column, middle in ((0, 0.55), (1, 0.5), (2, 0.0)):
        assert 0.4 < (poses[:, column] < middle).mean() < 0.6


def test_a_kidnapped_robot_goes_on_from_where_it_is_put(env):
    drive(env, [GO_FORWARD], options={"start": FACING_WALL})
    env.robot.place(Pose(0.5, 0.5, 0.0))
    info = env.step(GO_FORWARD)[4]
    assert info["pose"] == pytest.approx((0.5 + FORWARD, 0.5, 0.0))
    assert info["action"] == GO_FORWARD


# A step


@pytest.mark.parametrize(
    ("action", "turn"), [(LEFT_FORWARD, 20), (RIGHT_FORWARD, -20), (np.int64(GO_FORWARD), 0)], ids=["0", "1", "2"]
)
def test_the_actions_are_left_right_and_forward(env, action, turn):
    env.reset(options={"start": (0.5, 0.5, 0.0)})
    info = env.step(action)[4]
    assert info["pose"].heading == pytest.approx(radians(turn))
    assert info["action"] == action


def test_info_says_what_was_driven_and_what_will_be(env):
    (_, at_start), *steps = drive(env, [GO_FORWARD] * 8, options={"start": FACING_WALL})
    nothing = {"pose": FACING_WALL, "action": -1, "reflex": -1, "at_wall": False}
    assert at_start == {"similarity": at_start["similarity"], **nothing}
    stopped = steps[0][4]
    side = stopped["reflex"]
    assert (stopped["action"], stopped["at_wall"]) == (GO_FORWARD, True)
    assert side in (LEFT_FORWARD, RIGHT_FORWARD)
    for (*_, before), (*_, after) in pairwise(steps):
        assert after["action"] == (GO_FORWARD if before["reflex"] < 0 else side)
    assert [info["action"] for *_, info in steps].count(side) >= 2
    assert steps[-1][4]["reflex"] == -1


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


@pytest.mark.parametrize("changes", [{}, {"band": 11.0, "terminal_bonus": 50.0}])
def test_rewards_and_the_end_of_an_episode_follow_from_what_info_reports(changes):
    s = Settings(max_steps=150, **changes)
    (psi_upper, psi_lower), ends = stopping_thresholds(12, s.band), set()
    with HomingEnv(s, **COMPACT, start="uniform") as env:
        for seed in range(6):
            (_, at_start), *steps = drive(env, random_actions(200, seed), seed=seed)
            infos = [at_start, *(info for *_, info in steps)]
            for t, ((before, after), (_, gain, *ended, _)) in enumerate(zip(pairwise(infos), steps, strict=True), 1):
                views, home = (after["similarity"], before["similarity"]), after["similarity"] >= psi_upper
                assert ended == [home, not home and t == 150]
                assert gain == reward(t, *views, psi_lower, after["at_wall"], s, home=home)
            ends.add(tuple(ended))
    assert ends == {(True, False), (False, True)}  # or else half of this says nothing


def test_who_comes_home_in_the_last_step_that_is_allowed_is_home():
    before_home = (PAPER.home.x - FORWARD, PAPER.home.y, 0.0)
    with HomingEnv(**COMPACT, start=before_home, max_steps=1) as env:
        assert drive(env, [GO_FORWARD])[1][2:4] == (True, False)


# Rendering


def pixel(frame, x, y):
    scale = frame.shape[1] / PAPER.size[0]
    return frame[round((PAPER.size[1] - y) * scale), round(x * scale)].tolist()


YELLOW = [255, 220, 0]


def test_a_frame_shows_the_robot_and_its_path_and_the_next_episode_starts_with_a_clean_floor():
    with HomingEnv(**COMPACT, render_mode="rgb_array") as env:
        env.reset(options={"start": (0.3, 0.7, 0.0)})
        first = env.render()
        assert (first.shape, first.dtype) == ((417, 480, 3), np.uint8)
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


def test_without_a_render_mode_render_returns_nothing_and_warns(env):
    env.reset()
    with pytest.warns(UserWarning, match='render_mode="rgb_array"'):
        assert env.render() is None


# Refusals


def open_clients():
    pybullet = pytest.importorskip("pybullet", reason="needs PyBullet")
    return [client for client in range(1025) if pybullet.isConnected(client)]


NO_FIT = "the robot does not fit there; .* room 'paper', 1.15 m x 1 m"
NO_POSE = r"\(x, y, heading\)"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"start": (0.0, 0.5, 0.0)}, rf"start = \(0, 0.5, 0\): {NO_FIT}"),
        ({"start": (1.1, 0.5, 0.0)}, rf"start = \(1.1, 0.5, 0\): {NO_FIT}"),
        ({"start": (5.0, 0.5, 0.0)}, rf"start = \(5, 0.5, 0\): {NO_FIT}"),
        ({"start": (0.5, float("nan"), 0.0)}, rf"start = \(0.5, nan, 0\): {NO_FIT}"),
        ({"start": (0.5, 0.5, float("inf"))}, rf"start = \(0.5, 0.5, inf\): {NO_FIT}"),
        *(({"start": start}, f"start = .*: .*{NO_POSE}") for start in ((0.5, 0.5), "home", 3)),
        ({"home": (0, 0, 0)}, rf"home = \(0, 0, 0\): {NO_FIT}"),
        ({"room": "cellar"}, "room 'cellar': .* paper"),
        ({"observation": "both"}, "observation = 'both': .* image, features"),
        ({"observation": "image", "images": "atlas"}, 'observation = "image", .*observation="features".* PyBullet'),
        ({"render_mode": "human"}, "render_mode = 'human': .* rgb_array"),
        ({"alpha0": -1}, "setting alpha0 = -1: .* 0.000000001"),
        ({"colour": 1}, "setting colour: "),
        ({"settings": {}}, "settings and model: "),
        ({"survey_seed": -1}, "survey_seed = -1: "),
        ({"snapshots": 3}, r"model: has 258 features, .* 774 \(eq. 14\)"),
    ],
)
def test_an_environment_that_cannot_be_is_refused_in_one_line_and_leaves_no_client_behind(options, line, home_model):
    clients = open_clients()
    with pytest.raises(UserError, match=f"^{line}") as refusal:
        HomingEnv(**{"model": home_model} | options)
    assert "\n" not in str(refusal.value)
    assert open_clients() == clients


@pytest.mark.parametrize(
    ("method", "argument", "line"),
    [
        ("reset", {"options": {"start": (0, 0, 0)}}, rf"start = \(0, 0, 0\): {NO_FIT}"),
        *(("reset", {"options": o}, "options = .*'start'") for o in (5, {"strat": (0, 0, 0)}, ["start"], "start")),
        *(
            ("step", {"action": action}, "action = .{1,60}: must be 0, 1 or 2$")
            for action in (-1, 3, 0.5, None, "left", np.array([1]), 1.0, [0], np.ones(300))
        ),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line_and_nothing_moves(env, method, argument, line):
    pose = env.reset()[1]["pose"]
    with pytest.raises(UserError, match=f"^{line}") as refusal:
        getattr(env, method)(**argument)
    assert "\n" not in str(refusal.value)
    assert env.step(GO_FORWARD)[4]["pose"].x == pytest.approx(pose.x - FORWARD)


def test_what_is_asked_before_the_first_reset_or_after_the_end_is_refused_with_its_reason(env):
    steps = [env.render, partial(env.step, GO_FORWARD)]
    for attempt in steps:
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"reset\(\)"):
            attempt()
    env.reset()
    for _ in range(2):
        env.close()
    for attempt in (env.reset, *steps):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="closed"):
            attempt()


def test_where_every_view_passes_for_home_there_is_one_line_though_a_stricter_threshold_had_the_same_survey():
    wide = COMPACT | {"variance_floor_pixels": 1000}
    with HomingEnv(**wide, multiplier=1e9) as strict, HomingEnv(**wide) as env:
        strict.reset(seed=0)
        with pytest.raises(UserError, match=r"^settings: every view passes for home; .*light"):
            env.reset(seed=0)


# Resources


def test_environments_opened_and_closed_leave_nothing_behind(tmp_path, monkeypatch, home_model):
    def held():
        return len(list(Path("/proc/self/fd").iterdir())), open_clients()

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for number in range(12):
        env = HomingEnv(observation="features", model=home_model)
        env.reset(seed=number)
        if number % 2:
            env.close()
        del env  # unclosed, its client goes with it
        gc.collect()
        if number == 3:  # what is allocated once, is by now
            files, clients = held()
    assert held()[0] <= files  # joblib's idle workers may have closed theirs meanwhile
    assert held()[1] == clients
    assert list(tmp_path.iterdir()) == []


def test_an_environment_with_the_camera_cannot_be_copied_or_pickled_and_one_without_can(env):
    env.reset(seed=0)
    others = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    expected = [env.step(0), env.step(2)]
    for other in others:
        assert_same([other.step(0), other.step(2)], expected)
    with HomingEnv() as camera:
        for attempt in (copy.deepcopy, copy.copy, pickle.dumps):
            with pytest.raises(UserError, match=r'^an environment with images="camera"'):
                attempt(camera)
