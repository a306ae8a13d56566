"""What the reward does, what the paper's letter gives and what the earlier model gave: judged by their predicates."""

import numpy as np
import pandas as pd
import pytest

from homing_lib import lambdas
from homing_lib.environment import CONSTANT_COST, reward
from homing_lib.sarsa import LinearSarsa
from homing_lib.settings import Settings
from homing_lib.study import readings
from homing_lib.study.runs import load_table
from homing_lib.thresholds import stopping_thresholds

SEEDS = 12


def table(late, **columns):
    """Summaries: late steps by condition, a step or so more from seed to seed; other columns likewise, or the same."""
    rows = []
    for condition, steps in late.items():
        row = {"early": 200, "late": steps, "total": 1000, "band": 0.01, "band_stay": 2}
        row |= {name: values[condition] for name, values in columns.items() if condition in values}
        rows += [{"condition": condition, "seed": seed, **row, "late": steps + seed / 10} for seed in range(SEEDS)]
    return pd.DataFrame(rows)


def of_rewards(**late):
    """Late steps 40, but for the rewards named."""
    names = [f"{one}, {home}" for one in readings.REWARDS for home in readings.HOMES]
    return table({name: late.get(name.split(",")[0].replace(" ", "_"), 40) for name in names})


@pytest.mark.parametrize(
    ("zero", "negated", "constant", "verdict"),
    [
        (40, 40, 40, "no"),
        (80, 80, 20, "yes"),
        (40, 80, 40, "partly"),
    ],
)
def test_the_reward_matters_if_steps_are_others_without_it(zero, negated, constant, verdict):
    of = of_rewards(zero=zero, negated=negated, constant=constant)
    assert readings.reward_matters(of, of)[0] == verdict


def test_whether_the_reward_matters_is_not_shown_by_robots_that_differ_too_much():
    of = of_rewards()
    zero = of.condition == "zero, bootstrapped"
    of.loc[zero, "late"] *= np.resize([0.4, 1.8], zero.sum())
    assert readings.reward_matters(of, of)[0] == "not shown"


@pytest.mark.parametrize(
    ("without_reward", "empty", "verdict"),
    [
        (40, 300, "yes"),
        (40, 40, "partly"),
        (200, 300, "partly"),
        (200, 40, "no"),
    ],
)
def test_the_initial_value_carries_the_learning_if_it_suffices_and_nothing_else_does(without_reward, empty, verdict):
    initial = table({f"as is, {home}, theta_0 0": empty for home in ("bootstrapped", "bonus")})
    long = table({"as is, bonus, theta_0 0": empty, "as is, bonus": 40})
    assert readings.initial_value_carries(of_rewards(zero=without_reward), initial, long)[0] == verdict


@pytest.mark.parametrize(
    ("where", "factor", "verdict"),
    [
        ("band 1", 2, "yes"),
        ("band 9", 2, "partly"),
        ("nowhere", 1, "no"),
        ("band 1", 0.5, "no"),
    ],
)
def test_the_band_is_exploited_if_a_robot_that_is_paid_spends_more_steps_there(where, factor, verdict):
    share = {label: 0.01 * (factor if where in label and "unpaid" not in label else 1) for label in BANDS}
    assert readings.band_is_exploited(table(dict.fromkeys(BANDS, 40), band=share))[0] == verdict


BANDS = list(readings.BAND.conditions)


def test_steps_in_the_band_are_compared_as_they_are_however_few():
    share = {label: 0.002 if "unpaid" in label else 0.003 for label in BANDS}
    assert "band 1, 20 episodes, 1.50" in readings.band_is_exploited(table(dict.fromkeys(BANDS, 40), band=share))[1]


@pytest.mark.parametrize(
    ("masked", "bonus", "verdict"),
    [(200, 40, "yes"), (200, 90, "partly"), (40, 40, "no"), (40, 90, "no"), (20, 20, "no")],
)
def test_a_bootstrapped_home_pays_if_a_masked_one_is_worse_and_a_bonus_makes_up_for_it(masked, bonus, verdict):
    of = table({"as is, bootstrapped": 40, "as is, masked": masked, "as is, bonus": bonus})
    assert readings.home_pays_itself(of)[0] == verdict


@pytest.mark.parametrize(
    ("late", "verdict"),
    [([40] * 6, "yes"), ([40] * 3 + [250] * 3, "partly"), ([250] * 6, "no"), ([120] * 6, "no")],
)
def test_a_robot_learns_if_it_beats_its_first_episodes_and_chance(late, verdict):
    of = table({**dict(zip(readings.LETTER, late, strict=True)), "random": 100}, total={"random": 20 * 100})
    assert readings.learns_to_the_letter(of)[0] == verdict


def by_episode(good_from, late):
    """Steps of 300 episodes, good from one on, and of 20, by model."""
    rows = []
    for model in good_from:
        for length in (300, 20):
            steps = np.full(length, 40.0 if length == 300 else late[model])
            steps[: good_from[model] - 1 if length == 300 else 5] = 300
            for seed in range(SEEDS):
                episode = {"episode": np.arange(1, length + 1), "steps": steps + seed / 10}
                rows.append(pd.DataFrame({"condition": f"{model}, {length} episodes", "seed": seed, **episode}))
    return pd.concat(rows)


@pytest.mark.parametrize(
    ("ours", "theirs", "late", "verdict"),
    [
        (30, 150, 40, "reproduced"),
        (30, 60, 90, "partly reproduced"),
        (30, 60, 40, "not reproduced"),
        (150, 150, 40, "not shown"),
    ],
)
def test_tens_suffice_if_this_model_needs_them_and_the_earlier_one_hundreds(ours, theirs, late, verdict):
    earlier = [f"earlier, {name}" for name in readings.EARLIER_ALPHAS]
    of = by_episode(
        {"this model": ours} | dict.fromkeys(earlier, theirs), {"this model": 40} | dict.fromkeys(earlier, late)
    )
    assert readings.tens_of_episodes(of)[0] == verdict


@pytest.mark.parametrize(
    ("same", "third", "verdict"),
    [
        (80, 80, "reproduced"),
        (80, 40, "partly reproduced"),
        (40, 40, "not reproduced"),
        (20, 20, "not reproduced"),
    ],
)
def test_one_snapshot_does_better_if_three_take_more_steps_at_a_third_of_the_step_size_too(same, third, verdict):
    of = table({"one": 40, "three, alpha": same, "three, alpha / 3": third})
    assert readings.one_snapshot(of)[0] == verdict


def test_the_earlier_model_has_the_fixed_lambda_of_the_least_total_steps():
    of = load_table(readings.EARLIER_CHOICE)
    for name, chosen in readings.EARLIER_FIXED.items():
        total = {value: readings.column(of, f"fixed {value:g}, {name}", "total").mean() for value in readings.FIXED}
        assert min(total, key=total.get) == chosen


# The frame, and two errors of the print (E21, E22)


@pytest.mark.parametrize("rule", ["fixed:0.7", "fletcher-reeves", "polak-ribiere"])
@pytest.mark.parametrize("update", ["taken", "all"])
def test_a_first_value_of_n_nrb_learns_as_one_of_zero_that_is_paid_for_approaching(rule, update):
    rng = np.random.default_rng(0)
    n, gamma = 5, 0.9
    views, actions = rng.uniform(size=(41, n)), rng.integers(3, size=41)
    how = {
        "step_size": 0.05,
        "discount": gamma,
        "lambda_rule": lambdas.parse(rule).rule,
        "update": update,
        "bootstrap_terminal": True,
    }
    full, empty = LinearSarsa(n, 3, initial_weight=1, **how), LinearSarsa(n, 3, initial_weight=0, **how)
    for view, there, action, following, paid in zip(
        views, views[1:], actions, actions[1:], rng.normal(size=40), strict=False
    ):
        approach = gamma * there.sum() - view.sum()  # Phi = n NRB, the sum of the features
        deltas = (
            full.update(view, action, paid, there, following),
            empty.update(view, action, paid + approach, there, following),
        )
        assert deltas[0] == pytest.approx(deltas[1])
        assert full.lambda_ == pytest.approx(empty.lambda_)
    np.testing.assert_allclose(full.weights - empty.weights, 1)
    assert np.abs(empty.weights).max() > 0.01  # something was learnt


def test_loitering_in_the_band_is_paid_nine_tenths_a_step_without_end():
    upper, lower = stopping_thresholds(12)
    view = (upper + lower) / 2
    paid = [reward(step, view, view, lower, False, Settings()) for step in range(1, 2001)]
    assert all(gain > 0 for gain in paid[1:])
    assert np.mean(paid) == pytest.approx(0.9, abs=0.01)


def test_a_spinning_robot_pays_little_more_for_2000_steps_than_for_20_unless_the_cost_is_constant():
    costs = {
        cost: np.cumsum([-reward(step, 0.5, 0.5, 0.9, False, Settings(step_cost=cost)) for step in range(1, 2001)])
        for cost in ("1/t", "constant")
    }
    assert costs["1/t"][1999] / costs["1/t"][19] == pytest.approx(8.178 / 3.598, abs=1e-3)  # harmonic numbers
    assert costs["constant"][1999] == pytest.approx(2000 * CONSTANT_COST)
    assert costs["constant"][1999] / costs["constant"][19] == pytest.approx(100)
