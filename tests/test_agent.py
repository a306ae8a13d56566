import hashlib
import subprocess
import sys
from math import pi
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from homing_lib.agent import (
    STEP_COLUMNS,
    ClimbingAgent,
    Overwritten,
    RandomAgent,
    Run,
    SarsaAgent,
    run,
    run_episode,
)
from homing_lib.environment import HomingEnv, reward, survey
from homing_lib.errors import UserError
from homing_lib.lambdas import TAKES_AND_RETURNS, fletcher_reeves
from homing_lib.policy import Mixture, decrease_rate
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.study import runs, studies
from homing_lib.study.robots import FrozenAgent
from homing_lib.thresholds import stopping_thresholds

ROOT = Path(__file__).parent.parent
SHORT = Settings(episodes=2, survey_steps=100, max_steps=60)


def digest(result):
    return hashlib.sha256(result.steps.tobytes() + result.lengths.tobytes() + result.reached.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def short():
    return run(SHORT, 1)


# A seed


def test_a_seed_fixes_a_run_to_the_bit_whatever_ran_before_and_another_seed_gives_another(short):
    run(SHORT.with_changes(alpha0=0.01, controller="random"), 1)
    assert digest(run(SHORT, 1)) == digest(short)
    assert digest(run(SHORT, 2)) != digest(short)


def test_a_seed_fixes_a_run_to_the_bit_in_another_process_too(short):
    code = f"""
import sys
sys.path[:0] = [{str(ROOT)!r}]
import hashlib
from homing_lib.agent import run
from homing_lib.settings import Settings
result = run(Settings(episodes=2, survey_steps=100, max_steps=60), 1)
print(hashlib.sha256(result.steps.tobytes() + result.lengths.tobytes() + result.reached.tobytes()).hexdigest())
"""
    there = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert there.stdout.strip() == digest(short)


def test_runs_that_share_a_survey_would_each_have_made_the_same(arena):
    changed = Settings(
        survey_steps=50,
        episodes=3,
        alpha0=0.5,
        epsilon0=0.1,
        first_episode_share=0.1,
        discount=0.5,
        multiplier=5,
        lambda_rule="fixed:0",
        theta0=0,
        traces="dutch",
        update="all",
        bootstrap_terminal=False,
        overwrite_features=True,
        mixture="literal",
        tau0=1,
        step_cost="constant",
        approach_reward=False,
        wall_penalty=5,
        learn_at_walls=False,
        reward_scale=-1,
        terminal_bonus=5,
        band=2,
        start="uniform",
        controller="random",
        max_steps=3,
    )
    differ = {name for name in Settings.model_fields if getattr(changed, name) != getattr(Settings(), name)}
    assert differ - {"survey_steps"} == Settings.model_fields.keys() - Settings().of_scope("view", "lattice", "survey")
    models = [
        survey(arena, settings, PAPER.home, np.random.default_rng(0))
        for settings in (Settings(survey_steps=50), changed)
    ]
    np.testing.assert_array_equal(models[0].variance, models[1].variance)
    np.testing.assert_array_equal(models[0].snapshots, models[1].snapshots)


# What a run records


def test_each_episode_ends_at_home_or_at_the_step_cap_and_records_every_step():
    result = run(Settings(episodes=4, survey_steps=300, max_steps=150), 5)
    psi_upper, _ = stopping_thresholds(12)
    assert len(result.lengths) == 4
    assert result.steps.shape == (result.lengths.sum(), len(STEP_COLUMNS))
    assert set(result.reached) == {True, False}  # or else half of what follows says nothing
    for number, reached in enumerate(result.reached, start=1):
        similarity = result.episode(number)[:, STEP_COLUMNS.index("similarity")]
        assert (similarity[:-1] < psi_upper).all()
        assert reached == (similarity[-1] >= psi_upper)
        assert reached or len(similarity) == 150


def test_the_recorded_rewards_follow_from_the_recorded_views_and_walls(short):
    _, psi_lower = stopping_thresholds(12)
    similarity, rewards, at_wall = (
        short.episode(1)[:, STEP_COLUMNS.index(name)] for name in ("similarity", "reward", "at_wall")
    )
    for t in range(2, len(rewards) + 1):
        expected = reward(t, similarity[t - 1], similarity[t - 2], psi_lower, bool(at_wall[t - 1]), SHORT)
        assert rewards[t - 1] == expected


def test_progress_is_told_after_each_episode_and_the_trained_agent_is_handed_over_at_the_end():
    told = []
    run(SHORT, 1, after_episode=told.append, afterwards=lambda env, agent: told.append((env, agent)))
    assert told[:2] == [1, 2]
    (env, agent) = told[2]
    assert env.settings == SHORT
    assert isinstance(agent, SarsaAgent)
    assert len(told) == 3


SIX = Run(Settings(), 0, np.arange(6.0)[:, None], np.array([1, 2, 3]), np.ones(3, dtype=bool), 0)


@pytest.mark.parametrize(
    ("number", "steps"), [(1, [0]), (2, [1, 2]), (3, [3, 4, 5]), (-1, [3, 4, 5]), (-2, [1, 2]), (-3, [0])]
)
def test_episodes_count_from_one_and_negative_numbers_from_the_last(number, steps):
    assert SIX.episode(number)[:, 0].tolist() == steps


@pytest.mark.parametrize("number", [0, 4, -4])
def test_an_episode_that_is_not_there_is_an_index_error(number):
    with pytest.raises(IndexError):
        SIX.episode(number)


# Learning


class Watched(RandomAgent):
    """Draws at random and keeps what it is taught."""

    def __init__(self):
        super().__init__(SHORT, np.random.default_rng(0))
        self.lessons = []

    def learn(self, *lesson):
        self.lessons.append(lesson)
        return super().learn()


def test_each_update_credits_the_action_driven_and_looks_ahead_to_the_one_driven_next_reflex_or_not(home_model):
    agent = Watched()
    with HomingEnv(observation="features", model=home_model, max_steps=100) as env:
        env.reset(seed=0)
        steps, reached = run_episode(env, agent, {"start": (0.06, 0.5, pi)})
    driven = steps[:, STEP_COLUMNS.index("action")]
    at_walls = steps[:, STEP_COLUMNS.index("at_wall")]
    assert at_walls[1:].any()  # in a reflex
    phis, actions, rewards, phis_next, actions_next, terminals, walls = zip(*agent.lessons, strict=True)
    np.testing.assert_array_equal(actions, driven)
    np.testing.assert_array_equal(actions_next[:-1], driven[1:])
    np.testing.assert_array_equal(phis[1:], phis_next[:-1])
    np.testing.assert_array_equal(rewards, steps[:, STEP_COLUMNS.index("reward")])
    np.testing.assert_array_equal(walls, at_walls)
    assert terminals == (*[False] * (len(steps) - 1), reached)


def test_a_random_controller_learns_nothing(short):
    result = run(SHORT.with_changes(controller="random"), 1)
    for name in ("delta", "lambda", "clipped", "change"):
        assert not result.column(name).any()
        assert short.column(name).any()


def test_step_size_epsilon_and_tau_fall_together_from_episode_to_episode_by_eq_23():
    s = Settings(alpha0=0.01, epsilon0=0.5, tau0=0.2)
    agent = SarsaAgent(s, np.random.default_rng(0))
    for number in (1, 9, 20):
        agent.begin_episode(number)
        rate = decrease_rate(number, 6)
        assert agent.learner.step_size == 0.01 * rate
        assert (agent.epsilon, agent.temperature) == (0.5 * rate, 0.2 * rate)


def test_learning_at_walls_may_be_switched_off_and_then_only_those_steps_teach_nothing(short):
    off = run(SHORT.with_changes(learn_at_walls=False), 1)
    for result, taught in ((off, 0), (short, 1)):
        at_wall = result.column("at_wall").astype(bool)
        assert at_wall.sum() > 5
        assert (result.column("change")[at_wall] > 0).mean() == taught
        assert (result.column("change")[~at_wall] > 0).all()


# A rule of one's own


def test_a_rule_of_ones_own_drives_the_robot_as_the_one_of_that_name_does(short):
    def mine(*, delta, phi, delta_prev, phi_prev, discount, **_):
        return delta * float(phi @ phi) / (discount * delta_prev * float(phi_prev @ phi_prev))

    result = run(SHORT.with_changes(lambda_rule="fixed:1"), 1, lambda_rule=mine)
    assert result.lengths.tolist() == short.lengths.tolist()
    np.testing.assert_allclose(result.steps, short.steps, rtol=1e-6)
    assert result.column("clipped").mean() == short.column("clipped").mean() > 0.5


@pytest.mark.parametrize(
    "wrong", [0.5, lambda delta, phi: 0.5, lambda **_: None, lambda **_: "0.5", lambda **_: np.nan]
)
def test_what_is_no_rule_is_refused_in_one_line_that_says_what_a_rule_takes_and_returns(wrong):
    with pytest.raises((TypeError, ValueError)) as refusal:
        run(SHORT, 1, lambda_rule=wrong)
    assert TAKES_AND_RETURNS in str(refusal.value) and "\n" not in str(refusal.value)


def test_who_does_not_learn_has_no_use_for_a_rule():
    with pytest.raises(UserError, match="controller = 'random' has no use for one"):
        run(SHORT.with_changes(controller="random", images="compact"), 1, lambda_rule=fletcher_reeves)


def test_overwriting_the_features_shows_the_lambda_rule_this_steps_for_those_of_the_step_before():
    seen = []
    rule = Overwritten(lambda **step: seen.append(step) or 0.5)
    phi, phi_prev, trace = np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([5.0, 6.0])
    assert rule(delta=1.0, phi=phi, delta_prev=2.0, phi_prev=phi_prev, trace_prev=trace, discount=0.9) == 0.5
    assert seen[0]["phi"] is seen[0]["phi_prev"] is phi
    assert (seen[0]["delta"], seen[0]["delta_prev"], seen[0]["trace_prev"] is trace) == (1.0, 2.0, True)
    # Form 2 by hand: 2 * |(1, 2)|^2 / (.5 * 8 * |(3, 4)|^2) = .1; overwritten, the lengths cancel: 2 / (.5 * 8)
    step = {"delta": 2.0, "phi": phi, "delta_prev": 8.0, "phi_prev": phi_prev, "trace_prev": trace, "discount": 0.5}
    assert fletcher_reeves(**step) == pytest.approx(0.1)
    assert Overwritten(fletcher_reeves)(**step) == pytest.approx(0.5)


def test_with_features_overwritten_form_2_is_the_ratio_of_the_td_errors_in_a_whole_run(short):
    plain, literal = short, run(SHORT.with_changes(overwrite_features=True), 1)
    for result, is_ratio in ((literal, True), (plain, False)):
        delta, lambda_ = (result.episode(1)[:, STEP_COLUMNS.index(name)] for name in ("delta", "lambda"))
        ratio = np.clip(delta[1:] / delta[:-1], 0, 1)
        assert lambda_[0] == 0
        assert (lambda_ > 0).sum() > 10
        assert np.allclose(lambda_[1:], ratio, rtol=1e-9, atol=0) is is_ratio
    delta, clipped = (literal.episode(1)[:, STEP_COLUMNS.index(name)] for name in ("delta", "clipped"))
    np.testing.assert_array_equal(clipped[1:], (delta[1:] / delta[:-1] < 0) | (delta[1:] / delta[:-1] > 1))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("mixture", get_args(Mixture))
def test_a_run_that_diverges_is_recorded_as_such_with_the_episodes_before_it(mixture):
    handed_over = []
    result = run(
        SHORT.with_changes(lambda_rule="fixed:1", alpha0=1, max_steps=400, episodes=5, mixture=mixture),
        1,
        afterwards=lambda env, agent: handed_over.append(agent),
    )
    assert result.diverged >= 1
    assert len(result.lengths) == len(result.reached) == result.diverged - 1
    assert result.steps.shape == (result.lengths.sum(), len(STEP_COLUMNS))
    assert handed_over == []


# Other agents


def view(similarity):
    return np.full(258, similarity)


def test_a_climber_keeps_to_an_action_while_the_similarity_rises_and_takes_another_when_it_does_not():
    others = set()
    for seed in range(20):
        agent = ClimbingAgent(SHORT, np.random.default_rng(seed))
        agent.begin_episode(1)
        action = agent.choose(view(0.5))
        assert agent.choose(view(0.6)) == agent.choose(view(0.7)) == action
        for lower in (0.7, 0.4):
            other = agent.choose(view(lower))
            assert other != action
            others.add((other - action) % 3)
            action = other
    assert others == {1, 2}


def test_a_frozen_agent_chooses_as_it_did_and_learns_no_more():
    agent = SarsaAgent(SHORT, np.random.default_rng(0))
    agent.begin_episode(20)
    weights, phi = agent.learner.weights.copy(), view(0.5)
    frozen = FrozenAgent(agent)
    twin = SarsaAgent(SHORT, np.random.default_rng(0))
    twin.begin_episode(20)
    assert [frozen.choose(phi) for _ in range(20)] == [twin.choose(phi) for _ in range(20)]
    assert frozen.learn(phi, 0, -1.0, phi, 1, False, False) == (0, 0, False, 0)
    np.testing.assert_array_equal(agent.learner.weights, weights)


# What was learnt


def test_in_the_stored_runs_the_last_five_episodes_are_far_shorter_than_the_first_five_and_than_a_random_robots():
    stored = runs.load_study(studies.HEADLINE)
    lengths = {label: np.array([result.lengths for result in results]) for label, results in stored.items()}
    learnt, random = lengths["form 2"], lengths["random"]
    assert learnt.shape == random.shape == (5, 20)
    assert learnt[:, -5:].mean() < 0.6 * learnt[:, :5].mean()
    assert learnt[:, -5:].mean() < 0.6 * random.mean()
    assert all(result.reached[-5:].all() for result in stored["form 2"])
