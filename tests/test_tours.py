"""Several homes: one world, one survey, a network for each; and tours of them, as they are counted."""

from itertools import pairwise

import gymnasium
import numpy as np
import pandas as pd
import pytest

from homing_lib import agent as in_python
from homing_lib import survey
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.rooms import PAPER, Pose
from homing_lib.settings import Settings
from homing_lib.study import engine
from homing_lib.study.questions import tours

COMPACT = Settings(images="compact", survey_steps=50, episodes=3, max_steps=60)
HOMES = tours.HOMES["paper"]


def world(**options) -> HomingEnv:
    return HomingEnv(COMPACT, observation="features", **{"homes": HOMES} | options)


def driven(env):
    """Views, rewards and poses of twenty steps."""
    rng, seen = np.random.default_rng(1), [env.reset(seed=3)[0]]
    for _ in range(20):
        phi, reward, _, _, info = env.step(int(rng.integers(3)))
        seen += [phi, reward, info["pose"]]
    return seen


def test_a_world_with_one_home_in_a_list_is_to_the_bit_the_world_with_that_home():
    alone, listed = driven(world(homes=None)), driven(world(homes=[PAPER.home]))
    assert all(np.array_equal(one, other) for one, other in zip(alone, listed, strict=True))


def test_the_robot_sees_itself_at_the_home_that_it_seeks_and_at_no_other():
    env = world()
    for sought in range(3):
        env.seek(sought)
        seen = [env.reset(options={"start": home})[1]["similarity"] for home in HOMES]
        assert [similarity > 0.9 for similarity in seen] == [home == sought for home in range(3)]


def test_one_drive_surveys_the_room_for_all_homes(monkeypatch):
    drives = []

    def wander(world, settings, home, rng):
        drives.append(home)
        return survey.wander(world, settings, home, rng)

    env = world(survey_seed=11)
    models = survey.surveys(env.world, COMPACT, env.homes, np.random.default_rng(0), wander=wander)
    assert drives == [PAPER.home]
    assert len({model.variance.tobytes() for model in models}) == 1  # sigma^2 is about the mean of what was seen
    assert len({model.snapshots.tobytes() for model in models}) == 3


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"homes": []}, "homes: must be a list of poses"),
        ({"homes": HOMES, "home": HOMES[1]}, "homes: must be a list of poses"),
        ({"homes": [HOMES[0], (9, 9, 0)]}, "home = (9, 9, 0): the robot does not fit there"),
    ],
)
def test_homes_that_cannot_be_are_refused(options, problem):
    with pytest.raises(UserError) as refused:
        world(**options)
    assert problem in str(refused.value)


@pytest.mark.parametrize("number", [-1, 3, "2", None])
def test_a_home_that_there_is_not_is_not_sought(number):
    with pytest.raises(UserError, match="must be one of the 3 homes"):
        world().seek(number)


def test_whoever_seeks_another_home_begins_a_new_episode():
    env = world()
    env.reset(seed=1)
    env.seek(1)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(0)


def test_an_episode_from_here_begins_where_the_robot_stands():
    env = world()
    env.reset(seed=1)
    *_, info = env.step(2)
    assert env.reset(options={"start": "here"})[1]["pose"] == info["pose"] != PAPER.start


def all_legs(run_episode, monkeypatch):
    monkeypatch.setattr(engine, "run_episode", run_episode)
    env, agents = tours.begin(COMPACT, 5)
    return [leg for legs in tours.touring(env, agents, tours.plan, 3) for leg in legs]


def test_a_leg_begins_where_the_last_ended_compiled_as_in_python(monkeypatch):
    compiled, python = (all_legs(one, monkeypatch) for one in (engine.run_episode, in_python.run_episode))
    assert [leg.goal for leg in compiled] == 3 * [0, 1, 2]
    assert all(np.array_equal(one.path, other.path) for one, other in zip(compiled, python, strict=True))
    step = max(COMPACT.forward_m, COMPACT.turn_advance_m) + 1e-9
    for before, leg in pairwise(compiled):
        assert np.hypot(*(leg.path[0, :2] - before.path[-1, :2])) <= step


def test_each_prioritisation_chooses_as_its_name_says():
    env = world()
    needs = np.array([5.0, 7.0, 6.0])
    env.robot.place(env.homes[2])
    assert tours.plan(env, [1, 2], needs) == 1
    assert tours.battery(env, [0, 1, 2], needs) == 1
    assert tours.battery(env, [0, 2], needs) == 2
    assert tours.nearest(env, [0, 1, 2], needs) == 2


def test_a_tour_visits_each_home_once_and_does_not_begin_at_the_one_where_the_robot_stands():
    env, agents = tours.begin(COMPACT.with_changes(max_steps=2000, controller="climb"), 5)
    rounds = list(tours.touring(env, agents, tours.nearest, 4))
    assert all(sorted(leg.goal for leg in legs) == [0, 1, 2] for legs in rounds)
    assert all(last[-1].goal != first[0].goal for last, first in pairwise(rounds) if last[-1].home)


def test_what_a_robot_needs_grows_until_it_is_fed(monkeypatch):
    ends = iter([(10, True), (20, False), (30, True)])
    seen = []

    def run_episode(env, agent, options):
        steps, home = next(ends)
        return np.zeros((steps, 11)), home

    def prioritise(env, left, needs):
        seen.append(needs.tolist())
        return left[0]

    monkeypatch.setattr(engine, "run_episode", run_episode)
    env, agents = tours.begin(COMPACT, 5)
    list(tours.touring(env, agents, prioritise, 1))
    assert seen == [[0, 0, 0], [0, 20, 30], [20, 60, 90]]  # home 2 was not reached


def test_a_tour_in_numbers():
    env = world()
    at, away = (np.array([[*pose, *[0.0] * 8]]) for pose in (env.homes[0], Pose(0.5, 0.5, 0.0)))
    legs = [tours.Leg(0, at, 1, True), tours.Leg(2, away, 7, True), tours.Leg(1, away, 9, False)]
    assert tours.summed_up(env, legs) == (17, False, 1 / 3, 21)


def test_the_shortest_tour_is_added_up_from_the_home_where_the_last_one_ended():
    pairs = [(whence, goal) for whence in range(4) for goal in range(3) if whence != goal]
    legs = pd.DataFrame([(whence, goal, 10.0 * whence + goal) for whence, goal in pairs])
    legs.columns = ["whence", "goal", "steps"]
    goals = np.array([[12.0, 102.0, 120.0]])  # homes 0 1 2, then 1 0 2, then 1 2 0
    assert tours.shortest_tours(goals, legs).tolist() == [[21 + 10 + 2, 21 + 12 + 20]]
