"""What is kept of a robot that has learnt: trials that leave it as it was, by their seed alone, and their sums."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, run
from homing_lib.lambdas import Fixed
from homing_lib.settings import Settings
from homing_lib.study import measures
from homing_lib.study.questions import claims, conjugate, drives, home, varying, worth
from homing_lib.study.robots import ClimbGuidedAgent

COMPACT = Settings(images="compact")
FEW = COMPACT.with_changes(episodes=3, survey_steps=100, max_steps=200)
LOST = FEW.with_changes(lambda_rule="fixed:1", alpha0=1e9, theta0=1e9, max_steps=400)
SIXTY = FEW.with_changes(episodes=60, max_steps=30)

MEASURES = {
    drives.tried: FEW,
    worth.placed: FEW,
    worth.mapped: FEW,
    worth.carried: FEW,
    worth.added_up: SIXTY,
    conjugate.directions: FEW,
    home.stops: COMPACT,
    varying.lambdas_met: FEW,
    varying.drawn: FEW,
    claims.changes: FEW,
}
each = pytest.mark.parametrize("measure", MEASURES, ids=lambda measure: measure.__name__)


@pytest.fixture(autouse=True)
def _as_far_as_the_compact_atlas_goes(monkeypatch):
    """It has one light; and what is drawn comes from a pool of its own."""
    monkeypatch.setattr(worth, "LIGHTS", (1.0,))
    pool = pd.DataFrame({"met": [0.0, 0.25, 1.0], "count": [8, 1, 1]})
    monkeypatch.setattr(varying, "pool_of", lambda room, update: pool)


@each
def test_the_same_seed_gives_the_same_rows_and_another_seed_others(measure):
    once, again, other = (measure(MEASURES[measure], seed) for seed in (3, 3, 4))
    assert len({len(values) for values in once.values()}) == 1
    for name, values in once.items():
        np.testing.assert_array_equal(values, again[name], name)
    assert not all(np.array_equal(values, other[name], equal_nan=True) for name, values in once.items())


@pytest.mark.parametrize("measure", [drives.tried, worth.placed, worth.mapped, worth.carried, home.stops])
def test_what_diverged_has_nothing_to_show_and_is_one_row_without_numbers(measure):
    table = measure(LOST, 0)
    assert all(len(values) == 1 and np.isnan(values).all() for values in table.values())


def test_what_diverged_counts_as_the_cap_where_all_episodes_are_added_up():
    assert worth.added_up(LOST.with_changes(episodes=60), 0)["after_20"] == [20 * 400]
    assert list(claims.changes(LOST, 0)["steps"]) == [400] * 3


def test_weights_learnt_and_learning_under_way_are_each_there_or_not_in_four_ways(monkeypatch):
    """Weights before and after each of three trials."""
    seen = []

    def watched(world, driver):
        weights = getattr(getattr(driver, "agent", driver), "learner", SimpleNamespace(weights=np.zeros(1))).weights
        before = weights.copy()
        found = run_episode(world, driver)
        seen.append((before, weights.copy()))
        return found

    run_episode = drives.run_episode
    monkeypatch.setattr(drives, "run_episode", watched)
    drives.tried(FEW, 3)
    trials = dict(zip(drives.KINDS, np.reshape(np.array(seen, dtype=object), (-1, 3, 2)), strict=True))
    learnt, initial = trials["learning on"][0, 0], FEW.theta0

    def begins(kind, weights):
        return [bool(np.all(before == weights)) for before, _ in trials[kind]]

    def learns(kind):
        return [not np.array_equal(*both) for both in trials[kind]]

    assert begins("learning on", learnt) == [True, False, False]
    assert begins("restored", learnt) == begins("frozen", learnt) == begins("greedy", learnt) == [True] * 3
    assert begins("forgetful", initial) == begins("untrained", initial) == [True] * 3
    assert learns("learning on") == learns("restored") == learns("forgetful") == [True] * 3
    assert learns("frozen") == learns("greedy") == learns("untrained") == [False] * 3


@pytest.mark.parametrize(("module", "measure"), [(drives, drives.tried), (worth, worth.placed)])
def test_each_kind_of_trial_has_with_each_seed_a_randomness_of_its_own(module, measure, monkeypatch):
    states, driver = [], module.driver

    def noted(*arguments):
        states.append(str(arguments[-1].bit_generator.state))
        return driver(*arguments)

    monkeypatch.setattr(module, "driver", noted)
    for seed in (3, 4):
        measure(FEW, seed)
    assert len({*states}) == len(states) == 2 * len(module.KINDS)


def path(**columns):
    steps = np.zeros((len(next(iter(columns.values()))), len(STEP_COLUMNS)))
    for name, values in columns.items():
        steps[:, STEP_COLUMNS.index(name)] = values
    return steps


def test_trials_are_summed_up_as_one_works_out_by_hand():
    """After steps 2, 3 and 4 the view had come closer, not closer and closer; step 6 is a wall's."""
    nrb = [0.1, 0.2, 0.1, 0.2, 0.3, 0.4]
    home_at_once = path(action=[0, 1, 1, 1, 2, 2], similarity=nrb, at_wall=[0, 0, 0, 0, 0, 1])
    stuck = path(action=np.r_[np.zeros(1000), [1] * 700, [2] * 300], x=np.r_[np.zeros(1500), np.ones(500)])
    steps, cut, reached, up, down, walls, one_action, spread, stuck_at_wall = drives.summed_up(
        [(home_at_once, True), (stuck, False)]
    )
    assert (steps, cut, reached) == ((6 + 2000) / 2, (6 + 300) / 2, 0.5)
    assert up == 0.5  # 1 after 1, once it was closer; 2 after 1, once more
    assert down == pytest.approx((1 + 1998 - 2) / 1999)
    assert walls == 1 / 2006
    assert (one_action, spread, stuck_at_wall) == (0.7, 0.5, 0)


def test_the_climb_keeps_to_an_action_while_the_view_comes_closer_and_to_none_that_took_it_away():
    table = drives.tried(FEW, 3)
    climb, chance = (drives.KINDS.index(kind) for kind in ("climb", "random"))
    assert (table["stay_up"][climb], table["stay_down"][climb]) == (1, 0)
    assert table["stay_up"][chance] == pytest.approx(1 / 3, abs=0.1)


def test_who_stops_to_learn_early_did_the_first_episodes_of_twenty():
    whole = run(COMPACT, 3)
    for number in (5, 10):
        begun = run(drives.after(number, images="compact"), 3)
        assert begun.lengths.tolist() == whole.lengths[:number].tolist()
        assert np.array_equal(begun.steps, whole.steps[: len(begun.steps)])


def test_steps_of_all_episodes_are_added_up_to_the_fifth_the_tenth_and_so_on():
    lengths = run(SIXTY, 3).lengths
    assert {name: list(values) for name, values in worth.added_up(SIXTY, 3).items()} == {
        f"after_{number}": [lengths[:number].sum()] for number in worth.EVERY
    }


def watch(monkeypatch, name):
    """What a function of `worth` is asked and answers, in order."""
    seen, function = [], getattr(worth, name)

    def noted(*arguments):
        answer = function(*arguments)
        answer = answer if isinstance(answer, tuple) else list(answer)
        seen.append((arguments, answer))
        return answer

    monkeypatch.setattr(worth, name, noted)
    return seen


def test_everyone_is_tried_from_every_place_once_and_sums_are_those_of_the_trials(monkeypatch):
    seen = watch(monkeypatch, "trials")
    table = worth.placed(FEW, 3)
    ((_, trials),) = seen
    by_kind = [[one[1:] for one in trials if one[0] == kind] for kind in worth.KINDS]
    places = [sorted(pose for pose, *_ in some[:-5]) for some in by_kind]
    assert all(some == places[0] for some in places)
    assert len(places[0]) == len(set(places[0])) > 50
    for kind, some in enumerate(by_kind):
        taken, reached = np.array([one[1:] for one in some], dtype=float).T
        assert {pose for pose, *_ in some[-5:]} == {home.room_named("paper").start}
        assert table["steps"][kind] == taken[:-5].mean()
        assert table["cut"][kind] == np.minimum(taken[:-5], measures.TRIAL_STEPS).mean()
        assert table["soon"][kind] == np.mean((reached[:-5] > 0) & (taken[:-5] <= measures.TRIAL_STEPS))
        assert table["home"][kind] == reached[:-5].mean() == np.mean((taken[:-5] < 2000) | (reached[:-5] > 0))
        assert table["start_steps"][kind] == taken[-5:].mean()


def test_on_the_map_those_are_home_who_came_there_soon():
    table = pd.DataFrame(worth.mapped(FEW, 3))
    assert {*table.kind} == {worth.KINDS.index(kind) for kind in worth.MAPPED}
    assert (table.home[table.steps > measures.TRIAL_STEPS] == 0).all()
    assert table.steps.max() <= 2000
    counts = table.groupby(["x", "y"]).size()
    assert {*counts} == {len(worth.MAPPED)}


def test_robots_are_carried_to_the_places_at_which_others_begin_and_have_as_many_steps_from_there(monkeypatch):
    seen = watch(monkeypatch, "way_home")
    table = worth.carried(FEW, 3)
    assert list(zip(table["learning"], table["kidnapped"], strict=True)) == [(1, 0), (1, 1), (0, 0), (0, 1)]
    assert len(seen) == 4 * 40
    begun, carried = ([pose for (*_, pose, taken), _ in seen if taken == kidnapped] for kidnapped in (False, True))
    assert begun == carried
    assert len({*begun}) == 40
    for _, (steps, reached) in seen:
        assert steps <= measures.TRIAL_STEPS
        assert reached or steps == measures.TRIAL_STEPS


def test_with_all_weights_updated_the_direction_is_conjugate_until_lambda_is_first_reset():
    of = pd.DataFrame(conjugate.directions(COMPACT.with_changes(update="all", episodes=5), 2000))
    assert (of.until >= of.unclipped).all()
    assert (of.until < of.steps).any()
    assert (of.restarted >= of.until).all()
    assert of.restarted.sum() > of.follows.sum()


def test_with_the_weights_of_the_taken_action_alone_it_is_left_as_soon_as_the_action_changes():
    of = pd.DataFrame(conjugate.directions(COMPACT.with_changes(episodes=5), 2000))
    assert (of.until >= 1).all()
    assert (of.follows < of.steps).all()


def test_a_fixed_lambda_does_not_follow_the_conjugate_direction(monkeypatch):
    form_2 = conjugate.lambda_spec("fletcher-reeves")
    monkeypatch.setattr(conjugate, "lambda_spec", lambda _: form_2._replace(rule=Fixed(0.5)))
    watched = conjugate.Watched("fletcher-reeves", "all")
    run(COMPACT.with_changes(update="all", episodes=1), 2000, lambda_rule=watched)
    assert not any(strict for strict, *_ in watched.follows)


def test_stops_are_where_episodes_end_at_home_as_seen_from_home():
    short = COMPACT.with_changes(max_steps=80)
    result, table = run(short, 3), home.stops(short, 3)
    ends = np.array([result.episode(number)[-1] for number in range(1, 21) if result.reached[number - 1]])
    assert 0 < len(ends) < 20
    assert table["x"].tolist() == ends[:, 0].tolist()
    x, y, heading = home.room_named("paper").home
    np.testing.assert_allclose(table["away_m"], np.hypot(ends[:, 0] - x, ends[:, 1] - y))
    turned = np.exp(1j * (ends[:, 2] - heading))
    np.testing.assert_allclose(np.exp(1j * np.radians(table["turned_deg"])), turned, atol=1e-9)


def test_lambdas_are_met_at_all_steps_but_an_episodes_first():
    result, table = run(FEW, 3), varying.lambdas_met(FEW, 3)
    assert table["count"].sum() == len(result.steps) - len(result.lengths)
    assert set(table["met"]) <= {*result.column("lambda").round(2)}
    later = np.delete(result.column("lambda"), result.ended - result.lengths)
    assert (table["met"] @ table["count"]) == pytest.approx(later.round(2).sum())


def test_drawn_lambdas_are_those_of_the_pool():
    assert varying.drawn(COMPACT, 3)["lambda"] == pytest.approx([0.125], abs=0.02)
    assert varying.drawn(COMPACT, 3)["clipped"] == [0]


# A robot that is guided by the climb


def choices(share, similarities):
    """Of a robot whose best action is always the last."""
    agent = SimpleNamespace(learner=SimpleNamespace(value_list=lambda phi: [0, 0, 1]))
    guided = ClimbGuidedAgent(agent, share, np.random.default_rng(0))
    return [guided.choose(np.array([similarity])) for similarity in similarities]


def test_a_guided_robot_takes_its_best_action_or_climbs_by_its_share():
    assert choices(0.0, [0.1, 0.3, 0.2]) == [2, 2, 2]
    first, second, third, fourth = choices(1.0, [0.1, 0.2, 0.3, 0.25])
    assert first == second == third != fourth
    assert np.mean(np.array(choices(0.6, -np.linspace(0, 1, 3000))) == 2) == pytest.approx(
        0.7 / 1.3, abs=0.03
    )  # p = .4 + .6 (1 - p) / 2
