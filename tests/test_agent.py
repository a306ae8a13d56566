"""A run is fixed by its seed and recorded step by step, whoever drives: an agent is any object with three methods."""

import hashlib
import subprocess
import sys
from math import pi
from typing import get_args

import numpy as np
import pytest

from homing_lib.agent import (
    STEP_COLUMNS,
    ClimbingAgent,
    Learnt,
    Overwritten,
    RandomAgent,
    Run,
    SarsaAgent,
    run,
    run_episode,
)
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.features import similarity
from homing_lib.lambdas import TAKES_AND_RETURNS, Fixed, fletcher_reeves
from homing_lib.policy import Mixture, decrease_rate
from homing_lib.rooms import PAPER
from homing_lib.sarsa import LinearSarsa
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import runs, studies
from homing_lib.survey import survey
from tests.conftest import other_value

SHORT = Settings(images="compact", episodes=2, survey_steps=100, max_steps=60)


def digest(result):
    return hashlib.sha256(result.steps.tobytes() + result.lengths.tobytes() + result.reached.tobytes()).hexdigest()


def columns(steps, *names):
    return [steps[:, STEP_COLUMNS.index(name)] for name in names]


@pytest.fixture(scope="module")
def short():
    return run(SHORT, 1)


# A seed


def test_a_seed_fixes_a_run_to_the_bit_whatever_ran_before_in_any_process_and_another_seed_gives_another(short):
    run(SHORT.with_changes(alpha0=0.01, controller="random"), 1)
    assert digest(run(SHORT, 1)) == digest(short) != digest(run(SHORT, 2))
    code = "from tests.test_agent import *\nprint(digest(run(SHORT, 1)))"
    command = [sys.executable, "-OO", "-c", code]  # without docstrings and assertions too
    there = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert there.stdout.strip() == digest(short)


def test_runs_that_share_a_survey_would_each_have_made_the_same():
    """Whatever is said not to matter to a survey."""
    seen = SHORT.of_scope("view", "lattice", "survey").keys()
    changed = SHORT.with_changes(**{name: other_value(name) for name in Settings.model_fields.keys() - seen})
    with HomingEnv(SHORT, observation="features") as env:
        one, other = (survey(env.world, s, PAPER.home, np.random.default_rng(0)) for s in (SHORT, changed))
    np.testing.assert_array_equal(one.variance, other.variance)
    np.testing.assert_array_equal(one.snapshots, other.snapshots)


# What a run records


class Watched(RandomAgent):
    """Draws at random and keeps what it is taught."""

    def __init__(self):
        super().__init__(SHORT, np.random.default_rng(0))
        self.lessons = []

    def learn(self, *lesson):
        self.lessons.append(lesson)


def test_each_update_credits_the_action_driven_and_looks_ahead_to_the_one_driven_next_reflex_or_not():
    agent = Watched()
    with HomingEnv(SHORT, observation="features", max_steps=100) as env:
        env.reset(seed=0)
        steps, reached = run_episode(env, agent, {"start": (0.06, 0.5, pi)})
    driven, at_walls, paid, alike = columns(steps, "action", "at_wall", "reward", "similarity")
    assert at_walls[1:].any()  # in a reflex
    phis, actions, rewards, phis_next, actions_next, terminals, walls = zip(*agent.lessons, strict=True)
    np.testing.assert_array_equal(actions, driven)
    np.testing.assert_array_equal(actions_next[:-1], driven[1:])
    np.testing.assert_array_equal(phis[1:], phis_next[:-1])
    np.testing.assert_array_equal(rewards, paid)
    np.testing.assert_array_equal(walls, at_walls)
    np.testing.assert_array_equal([similarity(phi) for phi in phis_next], alike)
    assert terminals == (*[False] * (len(steps) - 1), reached)


def test_each_episode_ends_at_home_or_at_the_step_cap_and_a_run_has_them_all_in_a_row():
    told = []
    result = run(SHORT.with_changes(episodes=4, survey_steps=300, max_steps=150), 5, after_episode=told.append)
    assert told == [1, 2, 3, 4]
    assert result.steps.shape == (result.lengths.sum(), len(STEP_COLUMNS))
    assert set(result.reached) == {True, False}
    assert ((result.lengths == 150) | result.reached).all()


def test_episodes_count_from_one_and_negative_numbers_from_the_last():
    six = Run(Settings(), 0, np.arange(6.0)[:, None], np.array([1, 2, 3]), np.ones(3, dtype=bool), 0)
    assert [six.episode(k)[:, 0].tolist() for k in (1, 2, 3)] == [[0], [1, 2], [3, 4, 5]]
    assert [six.episode(k)[:, 0].tolist() for k in (-3, -2, -1)] == [[0], [1, 2], [3, 4, 5]]
    for number in (0, 4, -4):
        with pytest.raises(IndexError):
            six.episode(number)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("mixture", get_args(Mixture))
def test_a_run_that_diverges_is_recorded_as_such_with_the_episodes_before_it(mixture):
    handed_over = []
    lost = SHORT.with_changes(lambda_rule="fixed:1", alpha0=1, max_steps=400, episodes=5, mixture=mixture)
    result = run(lost, 1, afterwards=lambda env, agent: handed_over.append(agent))
    assert result.diverged >= 1
    assert len(result.lengths) == len(result.reached) == result.diverged - 1
    assert result.steps.shape == (result.lengths.sum(), len(STEP_COLUMNS))
    assert handed_over == []


# Sarsa


def test_step_size_epsilon_and_tau_fall_together_from_episode_to_episode_by_eq_23():
    s = Settings(alpha0=0.01, epsilon0=0.5, tau0=0.2)
    agent = SarsaAgent(s, np.random.default_rng(0))
    for number in (1, 9, 20):
        agent.begin_episode(number)
        rate = decrease_rate(number, 6)
        assert agent.learner.step_size == 0.01 * rate
        assert (agent.epsilon, agent.temperature) == (0.5 * rate, 0.2 * rate)
        assert s.step_size_rates[number - 1] == rate


def test_learning_at_walls_may_be_switched_off_and_then_only_those_steps_teach_nothing(short):
    off = run(SHORT.with_changes(learn_at_walls=False), 1)
    for result, taught in ((off, 0), (short, 1)):
        at_wall = result.column("at_wall").astype(bool)
        assert at_wall.sum() > 5
        assert (result.column("change")[at_wall] > 0).mean() == taught
        assert (result.column("change")[~at_wall] > 0).all()


@pytest.mark.parametrize("rule", [fletcher_reeves, "fletcher-reeves"])
def test_a_rule_that_is_given_drives_the_robot_as_the_one_of_that_name_in_its_settings_does(rule, short):
    result = run(SHORT.with_changes(lambda_rule="fixed:1:on_zero=1:unclipped"), 1, lambda_rule=rule)
    assert digest(result) == digest(short)
    assert short.column("clipped").mean() > 0.5


def test_overwriting_the_features_shows_the_lambda_rule_this_steps_for_those_of_the_step_before():
    phi, phi_prev, trace = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([5.0, 6.0])
    step = {"delta": 2.0, "phi": phi, "delta_prev": 8.0, "phi_prev": phi_prev, "trace_prev": trace, "discount": 0.5}
    assert Overwritten(lambda **seen: seen)(**step) == step | {"phi_prev": phi}


def test_with_features_overwritten_form_2_is_the_ratio_of_the_td_errors_in_a_whole_run(short):
    literal = run(SHORT.with_changes(overwrite_features=True), 1)
    for result, is_ratio in ((literal, True), (short, False)):
        delta, lambda_, clipped = columns(result.episode(1), "delta", "lambda", "clipped")
        ratio = delta[1:] / delta[:-1]
        assert lambda_[0] == 0
        assert (lambda_ > 0).sum() > 10
        assert np.allclose(lambda_[1:], np.clip(ratio, 0, 1), rtol=1e-9, atol=0) is is_ratio
        assert not is_ratio or (clipped[1:] == ((ratio < 0) | (ratio > 1))).all()


# Other agents


class Mine:
    """Forward while that pays, and else by chance."""

    def __init__(self, settings, rng):
        self.rng = rng

    def begin_episode(self, number):
        self.paid = 0.0

    def choose(self, phi):
        return 2 if self.paid > 0 else int(self.rng.integers(3))

    def learn(self, phi, action, reward, phi_next, next_action, terminal, at_wall):
        self.paid = reward
        return Learnt(delta=reward)


def test_an_agent_of_ones_own_drives_and_is_recorded_as_it_says_and_as_the_seed_has_it():
    result = run(SHORT, 4, agent=Mine)
    assert digest(run(SHORT, 4, agent=Mine)) == digest(result) != digest(run(SHORT, 4))
    delta, paid, change = columns(result.steps, "delta", "reward", "change")
    assert (delta == paid).all() and not change.any()


def test_whoever_drives_the_environment_alone_has_the_same_survey_starts_and_chance_from_the_seeds_that_it_names():
    settings, rewards = SHORT.with_changes(controller="random", start="uniform"), []
    survey_seed, agent_seed, world_seed = np.random.SeedSequence(4).spawn(3)
    rng = np.random.default_rng(agent_seed)
    with HomingEnv(settings, observation="features", survey_seed=survey_seed) as env:
        env.reset(seed=int(world_seed.generate_state(1)[0]))
        for _ in range(settings.episodes):
            env.reset()
            action, ended = int(rng.integers(3)), False
            while not ended:
                _, reward, terminated, truncated, info = env.step(action)
                rewards.append(reward)
                ended = terminated or truncated
                action = int(rng.integers(3)) if info["reflex"] < 0 else info["reflex"]
    assert rewards == run(settings, 4).column("reward").tolist()


def test_a_climber_keeps_to_an_action_while_the_similarity_rises_and_takes_another_when_it_does_not():
    others = set()
    for seed in range(20):
        agent = ClimbingAgent(SHORT, np.random.default_rng(seed))
        agent.begin_episode(1)
        action, *same = (agent.choose(np.full(258, alike)) for alike in (0.5, 0.6, 0.7))
        assert same == [action, action]
        for lower in (0.7, 0.4):
            other = agent.choose(np.full(258, lower))
            others.add((other - action) % 3)
            action = other
    assert others == {1, 2}


# Refusals


class Without(RandomAgent):
    choose = None


class Short(RandomAgent):
    def learn(self, phi, action):
        """Takes too little."""


class Returns(RandomAgent):
    def learn(self, *_):
        return 0.5


class Nowhere(RandomAgent):
    def choose(self, phi):
        """Returns nothing."""


RULE = TAKES_AND_RETURNS[:20]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"seed": -1}, ("seed = -1",)),
        ({"seed": None}, ("seed = None",)),
        *(({"lambda_rule": rule}, (RULE,)) for rule in (0.5, lambda delta, phi: 0.5, lambda **_: None)),
        ({"lambda_rule": "steepest"}, ("unknown lambda rule 'steepest'; known: fixed:<lambda>",)),
        ({"lambda_rule": Fixed(1), "agent": SarsaAgent}, ("lambda_rule", "pass one")),
        ({"lambda_rule": Fixed(1), "settings": SHORT.with_changes(controller="climb")}, ("lambda_rule", "'climb'")),
        ({"agent": RandomAgent(SHORT, None)}, ("agent: ", "(settings, rng)", "homing_lib.agent.Agent")),
        ({"agent": lambda settings: None}, ("agent: ", "(settings, rng)")),
        ({"agent": lambda settings, rng: None}, ("agent: begin_episode of NoneType", "(number)")),
        ({"agent": LinearSarsa}, ("agent",)),
        ({"agent": Without}, ("agent: choose of Without", "(phi)", "homing_lib.agent.Agent")),
        ({"agent": Short}, ("agent: learn of Short", "next_action, terminal, at_wall)")),
        ({"agent": Returns}, ("agent: learn of Returns returned 0.5", "Learnt", "None")),
        ({"agent": Nowhere}, ("action = None", "0, 1 or 2")),
    ],
)
def test_what_is_no_seed_rule_or_agent_is_refused_in_one_line(how, words):
    with pytest.raises((TypeError, ValueError, UserError)) as refusal:
        run(**{"settings": SHORT, "seed": 1} | how)
    assert all(word in str(refusal.value) for word in words), refusal.value
    assert "\n" not in str(refusal.value)


# What was learnt


def test_in_the_stored_runs_the_last_five_episodes_are_far_shorter_than_the_first_five_and_than_a_random_robots():
    stored = runs.load_study(studies.HEADLINE)
    learnt, random = (np.array([result.lengths for result in stored[label]]) for label in ("form 2", "random"))
    assert learnt.shape == random.shape == (5, 20)
    assert learnt[:, -5:].mean() < 0.6 * min(learnt[:, :5].mean(), random.mean())
    assert all(result.reached[-5:].all() for result in stored["form 2"])
