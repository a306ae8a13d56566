"""Learners that set lambda or the step size themselves: each against its formula by hand, its definition, its claim."""

from functools import partial
from inspect import signature

import numpy as np
import pytest

from homing_lib.lambdas import Fixed
from homing_lib.study import walk
from homing_lib.study.methods.prediction import HL, META, LambdaGreedy
from homing_lib.td import LinearTD, TrueOnlineTD

A, B = np.eye(2)


def random_episodes(rng, states, count=4):
    """States and rewards of episodes that end after some steps: (s, r, s' or None)."""
    for _ in range(count):
        visited = rng.integers(states, size=rng.integers(2, 8))
        yield list(zip(visited, rng.normal(size=len(visited)), [*visited[1:], None], strict=True))


def learn(learner, episode, states):
    phi = np.eye(states)
    for here, reward, ahead in episode:
        ends = ahead is None
        learner.update(phi[here], reward, phi[here if ends else ahead], terminal=ends)
        yield


# --- HL ---------------------------------------------------------------------------------------------------------------


def test_the_first_steps_of_hl_are_those_that_its_formula_gives_by_hand():
    learner = HL(2, lambda_=0.5, discount=0.5)
    learner.update(A, 1, B)  # N = (2, 1), E = (1, 0), beta(A) = 1/2
    np.testing.assert_allclose(learner.weights, [1 / 2, 0])
    learner.update(B, 0, A)  # delta = 1/4, N = (1, 3/2), E = (1/4, 1), beta = 8/7 / N
    np.testing.assert_allclose(learner.weights, [4 / 7, 4 / 21])
    learner.update(A, 2, B, terminal=True)  # delta = 10/7, N = (3/2, 3/4), E = (17/16, 1/4), beta = 1 / N
    np.testing.assert_allclose(learner.weights, [19 / 12, 2 / 3])
    # The returns from A are 2 and, of weight 1/4, 3/2, and that from B is 1, beside one of 0 that was not seen.
    np.testing.assert_allclose(learner.weights, [(2 + 1 / 4 * 3 / 2) / (1 + 1 / 4 + 1 / 4), 1 / 2 / (1 / 2 + 1 / 4)])


@pytest.mark.parametrize(("lambda_", "discount"), [(1, 1), (0.9, 1), (0.8, 0.6), (1, 0.5)])
def test_a_value_of_hl_is_the_mean_of_all_returns_so_far_completed_by_the_value_where_it_is(lambda_, discount):
    # The definition from which the authors derive it: the least squares of the returns, weighted by lambda^age.
    rng, states = np.random.default_rng(3), 4
    learner, seen = HL(states, lambda_=lambda_, discount=discount), []
    for episode in random_episodes(rng, states):
        learner.begin_episode()
        begun = len(seen)
        for step, _ in zip(episode, learn(learner, episode, states), strict=False):
            seen.append(step)
            ends_at = [begun] * begun + [len(seen)] * (len(seen) - begun)
            sums, visits = np.zeros(states), np.full(states, float(lambda_) ** (len(seen) - 1))
            for k, (state, _, _) in enumerate(seen):
                weight, value, fade = lambda_ ** (len(seen) - 1 - k), 0.0, 1.0
                for _, reward, ahead in seen[k : ends_at[k]]:
                    value, fade = value + fade * reward, fade * discount
                    if ahead is None:
                        break
                else:
                    value += fade * learner.weights[seen[-1][2]]
                sums[state] += weight * value
                visits[state] += weight
            np.testing.assert_allclose(learner.weights, sums / visits, atol=1e-9)


def test_hl_without_a_step_size_predicts_the_chain_of_its_paper_better_than_td_with_any_of_several():
    # Their figure 1, ten runs: 51 states, a step up or down; from an end to the middle, paid 1 or -1.
    states, discount, phi = 51, 0.99, np.eye(51)
    moves = np.zeros((states, states))
    moves[0, 25] = moves[50, 25] = 1
    for state in range(1, 50):
        moves[state, [state - 1, state + 1]] = 0.5
    rewards = phi[0] - phi[50]
    values = np.linalg.solve(np.eye(states) - discount * moves, rewards)
    errors = []
    for seed in range(10):
        learners = [HL(states, lambda_=1, discount=discount)]
        for lambda_, size in ((0.9, 0.1), (0.9, 0.2)):
            learners.append(LinearTD(states, step_size=size, discount=discount, lambda_rule=Fixed(lambda_)))
        rng, state = np.random.default_rng(seed), 25
        for up in rng.integers(2, size=2000):
            ahead = 25 if state in (0, 50) else state + 2 * up - 1
            for learner in learners:
                learner.update(phi[state], rewards[state], phi[ahead])
            state = ahead
        errors.append([np.sqrt(np.mean((learner.weights - values) ** 2)) for learner in learners])
    ours, *theirs = np.mean(errors, axis=0)
    assert ours < 0.85 * min(theirs) < np.sqrt(np.mean(values**2))


# --- Lambda-greedy and META ------------------------------------------------------------------------------------------


def test_the_lambda_of_lambda_greedy_is_that_which_its_formula_gives_by_hand():
    learner = LambdaGreedy(2, step_size=0.5, helper_step_size=0.5, discount=0.5, initial_return=1)
    learner.update(A, 1, B)
    np.testing.assert_allclose(learner.weights, [1 / 2, 0])
    np.testing.assert_allclose(learner.mean.weights, [5 / 4, 1])  # delta = 1 + 1/2 - 1
    np.testing.assert_allclose(learner.variance, [1 / 2, 0])  # half of 1 squared
    assert learner.lambda_ == 1  # D = 1, and no variance
    learner.update(B, 0, A)  # traces (1/2, 1); TD errors 1/4, and -3/8 of the mean
    np.testing.assert_allclose(learner.weights, [9 / 16, 1 / 8])
    np.testing.assert_allclose(learner.mean.weights, [37 / 32, 13 / 16])
    np.testing.assert_allclose(learner.variance, [1 / 2, 3 / 32])  # half of 1/16 + 1/4 * 1/2
    assert learner.lambda_ == pytest.approx((21 / 32) ** 2 / ((21 / 32) ** 2 + 1 / 2))  # D = 37/32 - 1/2


def meta_that_believes(value, lambda_mean, mean, variance, **settings):
    """Of the second of two states; it holds nothing of the first."""
    learner = META(2, **settings)
    learner.weights[1], learner.lambda_mean.weights[1], learner.mean.weights[1] = value, lambda_mean, mean
    learner.variance[1] = variance
    return learner


def test_a_step_of_meta_is_that_which_its_formula_gives_by_hand():
    learner = meta_that_believes(0.5, 0.2, 0.1, 0.4, step_size=0.1, discount=1.0, kappa=0.1)
    learner.update(A, 0, B)
    np.testing.assert_allclose(learner.lambda_weights, [1, 1 - 0.1 * (0.09 + 0.4 - 0.3 * 0.4)])
    np.testing.assert_allclose(learner.weights, [0.05, 0.5])
    np.testing.assert_allclose(learner.mean.weights, [0.02, 0.1])  # the helpers' step size is 0.2
    np.testing.assert_allclose(learner.lambda_mean.weights, [0.04, 0.2])
    np.testing.assert_allclose(learner.variance, [0.2 * (0.25 + 0.4), 0.4])


def test_meta_moves_lambda_down_the_squared_bias_and_the_variance_of_the_target_until_it_is_lambda_greedy():
    value, mean, variance = 0.5, 0.2, 0.05

    def error(lambda_, lambda_mean):
        return ((1 - lambda_) * value + lambda_ * lambda_mean - mean) ** 2 + lambda_**2 * variance

    learner = meta_that_believes(value, 0.3, mean, variance, step_size=1e-9, discount=0.9, kappa=0.1)
    learner.update(A, 0, B)
    slope = (error(1 + 1e-6, 0.3) - error(1 - 1e-6, 0.3)) / 2e-6
    assert learner.lambda_weights[1] == pytest.approx(1 - 0.1 * 0.9**2 * slope / 2, abs=1e-6)

    learner = meta_that_believes(value, mean, mean, variance, step_size=1e-9, discount=0.9, kappa=1.0)
    for _ in range(150):  # both returns have one mean, as they have where lambda is 1 or the values are right
        learner.begin_episode()
        learner.update(A, 0, B)
    assert learner.lambda_weights[1] == pytest.approx((value - mean) ** 2 / ((value - mean) ** 2 + variance), abs=1e-4)


def test_meta_that_does_not_learn_lambda_is_true_online_td_with_lambda_1():
    settings = {"step_size": 0.1, "discount": 1.0}
    ours = META(19, kappa=0.0, **settings)
    theirs = TrueOnlineTD(19, lambda_rule=Fixed(1), **settings)
    for states in walk.walks(3):
        walk.follow(ours, states)
        walk.follow(theirs, states)
    np.testing.assert_array_equal(ours.weights, theirs.weights)


def test_form_3_is_form_2_where_no_two_states_share_a_feature():
    two, three = (walk.learning(f"{form}:on_zero=0.8", 3, 0.3) for form in ("fletcher-reeves", "polak-ribiere"))
    np.testing.assert_array_equal(two, three)


@pytest.mark.parametrize("learner", [partial(LambdaGreedy, helper_step_size=0.05), partial(META, kappa=0.3)])
def test_lambda_varies_and_stays_within_0_and_1_on_the_walk_and_helpers_learn_the_mean_return(learner):
    learner, seen = learner(19, step_size=0.1, discount=1.0), []
    update = learner.update
    learner.update = lambda *step, **ends: (update(*step, **ends), seen.append(learner.lambda_))
    for states in walk.walks(0) + walk.walks(1):
        walk.follow(learner, states)
    assert 0 <= min(seen) < 0.9 < max(seen) <= 1
    assert np.corrcoef(learner.mean.weights, walk.VALUES)[0, 1] > 0.7
    assert (learner.variance > 0).all()


# --- On the walk -----------------------------------------------------------------------------------------------------


def test_a_method_that_makes_td_learns_what_the_rule_learns_to_the_bit():
    made = walk.Method(lambda size: LinearTD(19, step_size=size, discount=1.0, lambda_rule="gate"))
    np.testing.assert_array_equal(walk.learning(made, 3, 0.3), walk.learning("gate", 3, 0.3))


def test_hl_has_after_each_walk_the_mean_of_what_its_visits_were_paid_and_of_a_0():
    paid, visits, learner = np.zeros(19), np.ones(19), HL(19, lambda_=1, discount=1)
    for states in walk.walks(3):
        walk.follow(learner, states)
        *inside, beyond = states
        np.add.at(visits, inside, 1)
        np.add.at(paid, inside, np.sign(beyond - 9))
        np.testing.assert_allclose(learner.weights, paid / visits, atol=1e-12)


def test_values_that_are_no_numbers_are_a_great_error():
    broken = walk.Method(lambda _: HL(19, lambda_=np.nan, discount=1.0))
    assert (walk.race({"broken": broken}, [0], [1], [0.1]).errors["broken"] == walk.ERROR_CAP).all()


def test_a_race_may_be_told_against_any_of_those_that_run():
    race = walk.Race({}, {}, {label: np.full(3, error) for label, error in (("a", 1.0), ("b", 2.0), ("c", 4.0))})
    against = race.against("b")
    assert list(against.errors) == ["b", "a", "c"]
    assert {label: found.value for label, found in against.verdicts.items()} == {"a": 0.5, "c": 2.0}


def test_the_methods_of_today_meet_on_walks_that_chose_nothing_each_with_its_step_size_or_none():
    race = walk.today(judge=[90, 91])
    assert list(race.errors) == list(walk.TODAY)
    for label, (rule, size) in walk.TODAY.items():
        assert race.errors[label][1] == walk.learning(rule, 91, size).mean()
    assert "| form 2, guard 0.8 | 0.4 |" in str(race) and "| HL, λ = 1 | none |" in str(race)
    assert min(signature(walk.today).parameters["judge"].default) >= 10_000


def online(learner, **settings):
    return walk.Method(lambda size: learner(19, step_size=size, discount=1.0, **settings))


def hl(lambda_):
    return walk.Method(lambda _: HL(19, lambda_=lambda_, discount=1.0))


LAMBDAS, GUARDS = (0.4, 0.8, 0.9), (0, 0.8, 1)
CANDIDATES = {
    "TD": {f"TD, λ = {x:g}": Fixed(x) for x in LAMBDAS},
    "form 1": {f"form 1, guard {x:g}": f"hestenes-stiefel:on_zero={x:g}" for x in GUARDS},
    "form 2": {f"form 2, guard {x:g}": f"fletcher-reeves:on_zero={x:g}" for x in GUARDS},
    "true online TD": {f"true online TD, λ = {x:g}": online(TrueOnlineTD, lambda_rule=Fixed(x)) for x in LAMBDAS},
    "HL": {f"HL, λ = {x:g}": hl(x) for x in (0.99, 0.999, 1)},
    "λ-greedy": {
        f"λ-greedy, α' = {x:g}{', optimistic' * first}": online(LambdaGreedy, helper_step_size=x, initial_return=first)
        for x in (0.003, 0.01, 0.03)
        for first in (0, 1)
    },
    "META": {f"META, κ = {x:g}": online(META, kappa=x) for x in (0.03, 0.1, 0.3, 1)},
}


@pytest.mark.slow
@pytest.mark.parametrize("method", CANDIDATES)
def test_each_method_of_today_has_the_setting_and_the_step_size_that_walks_below_100_choose(method):
    sizes = [np.nan] if method == "HL" else walk.RACE_SIZES
    raced = walk.race(CANDIDATES[method], range(20), range(20, 100), sizes)
    best = min(raced.errors, key=lambda label: raced.errors[label].mean())
    assert best in walk.TODAY
    for label in raced.step_size.keys() & walk.TODAY.keys():
        np.testing.assert_equal(raced.step_size[label], walk.TODAY[label][1])  # also NaN, of none
    if method != "HL":
        assert sizes[0] < raced.step_size[best] < sizes[-1]
