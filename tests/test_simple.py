"""The learner of a page: its update by hand, what it learns, and how it is held against the bar."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import run
from homing_lib.settings import Settings
from homing_lib.study import engine, measures
from homing_lib.study.methods.simple import CONSTANT, REPLAY_SHARE, SimpleAgent
from homing_lib.study.questions import simple
from homing_lib.study.robots import FrozenAgent
from homing_lib.thresholds import stopping_thresholds

NINE = {"bin_size": 128, "theta0": 0.0, "alpha0": 0.5, "epsilon0": 0.0}  # nine features: three bins a channel
ONE, TWO, THREE = np.eye(9)[:3]


def agent(**changes):
    made = SimpleAgent(Settings(**(NINE | changes)), np.random.default_rng(0))
    made.begin_episode(1)
    return made


def test_two_steps_and_their_replay_are_what_one_works_out_by_hand():
    robot, share, c = agent(), 0.5 * REPLAY_SHARE, CONSTANT
    assert robot.learn(ONE, 0, -1.0, TWO, 1, False, False).delta == -1  # no view met: the mean is 0
    np.testing.assert_allclose(robot.weights[0], [*(-0.5 * ONE), -0.5 * c])
    assert robot.learn(TWO, 1, -1.0, THREE, 0, True, False).delta == -1  # home is worth 0
    np.testing.assert_allclose(robot.mean, (TWO + THREE) / 2)
    # Replayed: away from the mean of what was met, one is (2, -1, -1)/sqrt(6), two (0, 1, -1)/sqrt(2).
    one, two = np.zeros(10), np.zeros(10)
    one[:3], two[:3], one[9], two[9] = np.array([2, -1, -1]) / 6**0.5, np.array([0, 1, -1]) / 2**0.5, c, c
    last = np.array([*(-0.5 * TWO), -0.5 * c])
    error = -1 + 0.5 * (1 / 2**0.5 + c * c)  # home is 0 ahead
    last += share * error * two
    np.testing.assert_allclose(robot.weights[1], last)
    first = np.array([*(-0.5 * ONE), -0.5 * c])
    ahead = max(-0.5 * c * c, last @ two, 0.0)  # of two: what was learnt of the third action is nothing
    error = -1 + ahead + 0.5 * (2 / 6**0.5 + c * c)
    first += share * error * one
    np.testing.assert_allclose(robot.weights[0], first)
    assert not robot.weights[2].any()


def test_an_action_is_worth_at_first_what_the_similarity_promises_and_home_is_worth_nothing():
    robot = agent(theta0=0.5)
    psi = stopping_thresholds(12, 1).upper
    np.testing.assert_allclose(robot.value_list(np.full(9, psi)), 0, atol=1e-12)
    np.testing.assert_allclose(robot.value_list(np.full(9, psi - 0.2)), 0.5 * 9 * -0.2)


def test_a_view_that_is_the_mean_of_all_views_has_finite_features():
    robot = agent()
    robot.learn(ONE, 0, -1.0, TWO, 1, False, False)
    np.testing.assert_array_equal(robot.x(robot.mean), [*np.zeros(9), CONSTANT])


def test_what_was_looked_at_is_valued_anew_once_something_was_learnt():
    robot = agent()
    assert robot.choose(ONE) == 0
    robot.learn(ONE, 0, -1.0, ONE, 0, False, False)
    assert robot.choose(ONE) == 1
    np.testing.assert_allclose(robot.value_list(TWO), robot.weights @ robot.x(TWO))


def test_without_replay_it_learns_from_each_step_once_and_uncentred_it_takes_nothing_out():
    robot = SimpleAgent(Settings(**NINE), np.random.default_rng(0), replayed=0, centred=False)
    robot.begin_episode(1)
    robot.learn(ONE, 2, -1.0, TWO, 0, True, False)
    np.testing.assert_allclose(robot.weights[2], [*(-0.5 * ONE), -0.5 * CONSTANT])
    assert not robot.mean.any()


@pytest.mark.parametrize("seed", range(5))
def test_it_learns_a_corridor_to_the_optimum_whose_views_hardly_differ(seed):
    rng = np.random.default_rng(seed)
    views = 0.9 + 0.1 * rng.random((8, 27))
    robot = SimpleAgent(Settings(bin_size=32, theta0=0.0, alpha0=0.7, epsilon0=0.0), rng)
    for number in range(1, 31):
        robot.begin_episode(number)
        place, steps = 0, 0
        while place < 7 and steps < 500:
            action = robot.choose(views[place])
            there = min(max(place + (action == 2) - (action == 1), 0), 7)
            robot.learn(views[place], action, -1.0, views[there], 0, there == 7, False)
            place, steps = there, steps + 1
    assert steps == 7


def test_a_seed_fixes_a_run_to_the_bit_and_it_comes_home():
    settings = simple.settings("paper", images="compact", episodes=3, survey_steps=100, alpha0=0.7, theta0=0.02)
    ours, again = run(settings, 1), run(settings, 1)
    np.testing.assert_array_equal(ours.steps, again.steps)
    assert ours.reached.all()


def test_the_ten_episodes_are_those_that_begin_once_two_thousand_steps_are_driven():
    lengths = np.array([1500, 499, 1, *range(1, 11), 9999])
    assert simple.reached(lengths) == {"steps": 5.5, "cut": 5.5}
    lengths = np.array([1500, 499, 2, *10 * [600], 9999])
    assert simple.reached(lengths) == {"steps": 600, "cut": 500}


def test_what_is_looked_at_in_half_the_time_is_the_same_and_each_number_is_of_the_same_drive():
    settings = Settings(images="compact")
    row = simple.bar(settings, 3)
    assert simple.bar_on(settings, 3) == {name: row[name] for name in ("steps", "cut")}
    lengths = run(settings.with_changes(episodes=20), 3).lengths
    assert (row["at_0"], row["at_250"]) == (lengths[0], lengths[np.searchsorted(np.cumsum(lengths), 250, "right")])
    assert row["diverged"] == 0


def test_a_robot_that_diverged_takes_the_step_cap_in_each_episode_that_is_looked_at():
    lost = Settings(images="compact", lambda_rule="fixed:1", alpha0=1e9, theta0=1e9)
    row = simple.bar(lost, 0)
    assert (row["steps"], row["cut"], row["at_4750"], row["diverged"]) == (2000, 500, 2000, 1)
    assert (row["frozen"], row["home"]) == (2000, 0)  # it is not tried frozen


def test_it_is_tried_frozen_once_after_the_episode_in_which_it_has_driven_far_enough(monkeypatch):
    tried, episodes = [], []

    def run_episode(world, robot, *_):
        frozen = isinstance(robot, FrozenAgent)
        if frozen:
            tried.append(sum(episodes))
        else:
            episodes.append(700)
        return np.zeros((30 if frozen else 700, 11)), frozen

    monkeypatch.setattr(measures, "run_episode", run_episode)
    monkeypatch.setattr(simple, "run_episode", run_episode)
    row = simple.bar(Settings(images="compact", survey_steps=60), 0)
    assert tried == [5600]
    assert len(episodes) == 3 + simple.NEXT  # the first of the ten begins at 2,100
    assert (row["frozen"], row["home"], row["steps"]) == (30, 1, 700)


def test_who_is_led_drives_what_is_given_and_learns_from_it():
    learnt = []
    robot = SimpleNamespace(begin_episode=learnt.append, learn=lambda *step: learnt.append(step))
    led = simple.Led(robot, [0, 1])
    led.begin_episode(3)
    assert [led.choose(np.zeros(2)) for _ in range(4)] == [0, 1, 2, 2]
    led.learn("a step")
    assert learnt == [3, ("a step",)]


def test_who_is_led_comes_home_by_the_shortest_way_and_then_drives_by_itself(monkeypatch):
    drove = []

    def run_episode(world, robot, *options):
        path, home = engine.run_episode(world, robot, *options)
        drove.append((isinstance(robot, simple.Led), len(path), home))
        return path, home

    monkeypatch.setattr(simple, "run_episode", run_episode)
    monkeypatch.setattr(measures, "run_episode", run_episode)
    monkeypatch.setattr(simple, "LATE", simple.LEARNT)
    settings = simple.settings("paper", images="compact", survey_steps=200, alpha0=0.7, theta0=0.02, epsilon0=0.0)
    row = {name: value for name, (value,) in simple.lacks(settings, 3).items()}
    plain, _ = measures.driven(settings, 3, lambda lengths, *_: len(simple.next_ten(lengths)) < simple.NEXT)
    assert drove[: simple.LED] == simple.LED * [(True, row["way"], True)]
    assert not any(is_led for is_led, *_ in drove[simple.LED :])
    own = [steps for _, steps, _ in drove[simple.LED : -2 * len(plain)]]
    assert row["led"] == simple.next_ten(own).mean()  # the episodes in which it was led do not count
    assert own != plain  # it learnt from them
    assert row["late"] == simple.next_ten(plain).mean()


def robots(steps=20.0, frozen=21.0, home=1.0, diverged=0.0, one=None):
    table = pd.DataFrame({"steps": steps, "frozen": frozen, "home": home, "diverged": diverged}, index=range(400))
    for name, value in (one or {}).items():
        table.loc[0, name] = value
    return table


@pytest.mark.parametrize(
    ("table", "on", "frozen"),
    [
        (robots(), True, True),
        (robots(steps=23.1), False, True),  # 1.15 times 20 is 23
        (robots(one={"steps": 400}), False, True),  # one lost
        (robots(one={"diverged": 1}), False, True),
        (robots(frozen=26.1), True, False),  # 1.3 times 20 is 26
        (robots(one={"home": 0, "frozen": 2000}), True, False),  # one of four hundred leaves open if it is a hundredth
        (pd.concat([robots(home=0)[:20], robots()[20:]]), True, False),
    ],
)
def test_a_room_is_beaten_only_where_each_number_is_on_the_right_side(table, on, frozen):
    held = simple.against_the_bar(table, 20, 377, simple.COMPARISONS)
    found = {f"attic.simple.{name}": one for name, one in held.items()}
    assert simple.beats(found, "attic") == (on, frozen)


def test_what_an_interval_leaves_open_beats_nothing():
    spread = robots()
    spread["steps"] = np.resize([10.0, 35.0], len(spread))  # 22.5 on average, and 23 within its interval
    held = simple.against_the_bar(spread, 20, 377, simple.COMPARISONS)
    assert held["on"].verdict == "undecided"
    on, _ = simple.beats({f"hall.simple.{name}": one for name, one in held.items()}, "hall")
    assert not on


def test_every_drawn_candidate_drives_in_every_room():
    candidates = simple.CHOICE.first.conditions.values()
    assert {(one.room, one.alpha0, one.theta0, one.epsilon0) for one in candidates} == {
        (room, *drawn.values()) for room, drawn in product(simple.IN_ROOMS, simple._candidates())
    }
