"""What learning is worth: robots put down somewhere, rules that stop them, directions of updates, and the verdicts."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import run
from homing_lib.lambdas import Fixed
from homing_lib.rooms import room_named
from homing_lib.settings import Settings
from homing_lib.study import opponents, probes
from homing_lib.study.measures import TRIAL_STEPS
from homing_lib.study.opponents import CHOSEN, CLIMBING, ROOMS
from homing_lib.study.robots import ClimbGuidedAgent
from homing_lib.study.runs import load_table

COMPACT = Settings(images="compact")

# Put down somewhere


def trained(best):
    """An agent whose best action is always the same."""
    return SimpleNamespace(learner=SimpleNamespace(value_list=lambda phi: np.eye(3)[best].tolist()))


def choices(guided, similarities):
    return [guided.choose(np.array([similarity])) for similarity in similarities]


def test_a_guided_robot_that_never_climbs_takes_its_best_action():
    guided = ClimbGuidedAgent(trained(2), 0.0, np.random.default_rng(0))
    assert choices(guided, [0.1, 0.3, 0.2]) == [2, 2, 2]


def test_a_guided_robot_that_always_climbs_keeps_to_an_action_while_the_similarity_rises():
    guided = ClimbGuidedAgent(trained(2), 1.0, np.random.default_rng(0))
    first, second, third, fourth = choices(guided, [0.1, 0.2, 0.3, 0.25])
    assert first == second == third != fourth


def test_with_a_negative_share_it_explores_at_random():
    guided = ClimbGuidedAgent(trained(2), -0.6, np.random.default_rng(0))
    counts = np.bincount(choices(guided, np.linspace(0, 1, 3000)), minlength=3) / 3000
    assert counts == pytest.approx([0.2, 0.2, 0.6], abs=0.03)


def test_all_who_are_tried_with_a_seed_begin_at_the_same_poses_and_only_the_learnt_climb():
    few = COMPACT.with_changes(episodes=1, max_steps=50)
    learnt = pd.DataFrame(probes.placed(few, 2000))
    random = pd.DataFrame(probes.placed(few.with_changes(controller="random"), 2000))
    pose = ["usual", "x", "y", "heading"]
    parts = [rows[pose].reset_index(drop=True) for _, rows in learnt.groupby("share")]
    assert sorted(learnt.share.unique()) == [0, CLIMBING]
    assert parts[0].equals(parts[1])
    assert parts[0].equals(random[pose])
    assert (learnt.usual == 1).sum() == 2 * probes.USUAL
    assert learnt.steps.max() <= TRIAL_STEPS
    assert (learnt.steps[learnt.reached == 0] == TRIAL_STEPS).all()


def test_who_stops_to_learn_early_did_the_first_episodes_of_twenty():
    whole = run(COMPACT, 3)
    for number in (5, 10):
        begun = run(COMPACT.with_changes(**opponents._after(number)), 3)
        assert begun.lengths.tolist() == whole.lengths[:number].tolist()
        assert np.array_equal(begun.steps, whole.steps[: len(begun.steps)])


def test_the_declared_extension_is_what_the_search_found():
    assert opponents.chosen(load_table(opponents.SEARCH)) == (CHOSEN, CLIMBING)


def test_the_choice_is_the_farthest_ahead_in_its_worse_room_of_those_that_come_home():
    def rows(way, share, paper, attic, home=1.0):
        steps = {"paper": paper, "attic": attic}
        return [
            {"condition": f"{room}, {way}", "share": share, "usual": 0, "steps": of, "reached": home}
            for room, of in steps.items()
        ]

    tried = pd.DataFrame(
        rows("climb", 0.0, 100, 50)
        + rows("even", 0.3, 60, 30)
        + rows("one-sided", 0.5, 20, 45)
        + rows("lost", 0.3, 10, 10, home=0.96)
    )
    assert opponents.chosen(tried) == ("even", 0.3)


# What is compared


def test_learning_has_paid_for_itself_from_the_episode_on_from_which_the_sum_stays_below():
    ours = np.array([[10.0, 1, 1, 1, 1], [10.0, 1, 1, 1, 1]])
    assert opponents.paid_back(ours, np.full((2, 5), 4.0)) == (4, 4, 4)
    assert opponents.paid_back(np.full((2, 5), 5.0), np.full((2, 5), 4.0)) == (6, 6, 6)
    assert opponents.paid_back(np.full((2, 5), 3.0), np.full((2, 5), 4.0)) == (1, 1, 1)


def test_beside_home_is_no_farther_back_than_home_whichever_way_it_faces():
    for room in ROOMS:
        x, y, heading = room_named(room).home
        ahead = np.array([0.1, 0.0, -0.1])
        rows = pd.DataFrame({"x": x + ahead * np.cos(heading), "y": y + ahead * np.sin(heading)})
        assert opponents.beyond_home(rows, room).tolist()[::2] == [True, False]


def views(one, three, raw):
    """Four views anywhere, of which the first two would be false alarms; then five at home, from -4 to 4 degrees."""
    kind = [probes.ANYWHERE] * 4 + [probes.AT_HOME] * 5
    away, turned = [1.0, 0.1, 0.1, 0.0] + [0.0] * 5, [0.0, 90.0, 0.0, 1.0, -4, -2, 0, 2, 4]
    return pd.DataFrame(
        {"seed": 0, "kind": kind, "away_m": away, "turned_deg": turned, "one": one, "three": three, "raw": raw}
    )


def test_every_rule_of_stopping_is_allowed_as_many_false_alarms():
    home = [0.8, 0.92, 1.0, 0.92, 0.8]
    of = views([0.95, 0.5, 0.99, 1, *home], [0.7, 0.6, 0.9, 1, *home], [-0.3, -0.2, -0.1, 0, *home])
    assert opponents.thresholds(of) == {"one": 0.5, "three": 0.6, "raw": -0.3}
    none = views([0.9, 0.5, 0.99, 1, *home], [0.7, 0.6, 0.9, 1, *home], [-0.3, -0.2, -0.1, 0, *home])
    assert opponents.thresholds(none) == {"one": 0.9, "three": 0.7, "raw": -0.2}
    assert opponents.tolerance(none, "one", 0.9) == (6.0, 0.0)


# Where the updates point


def test_with_all_weights_updated_the_direction_is_conjugate_until_lambda_is_first_reset():
    of = pd.DataFrame(probes.directions(COMPACT.with_changes(update="all", episodes=5), 2000))
    assert (of.until >= of.unclipped).all()
    assert (of.until < of.steps).any()
    assert (of.restarted >= of.until).all()
    assert of.restarted.sum() > of.follows.sum()


def test_with_the_weights_of_the_taken_action_alone_it_is_left_as_soon_as_the_action_changes():
    of = pd.DataFrame(probes.directions(COMPACT.with_changes(episodes=5), 2000))
    assert (of.until >= 1).all()
    assert (of.follows < of.steps).all()


def test_a_fixed_lambda_does_not_follow_the_conjugate_direction():
    watched = probes.Watched("fletcher-reeves")
    watched._rule = Fixed(0.5)
    run(COMPACT.with_changes(update="all", episodes=1), 2000, lambda_rule=watched)
    assert not any(strict for strict, *_ in watched.asked)


# Verdicts

SEEDS = list(opponents.OPPONENTS.seeds)


def placed(steps, reached=None):
    """Rows of `OPPONENTS`: steps by who and share, alike in all rooms unless it is said by room."""
    rows = []
    for room in ROOMS:
        x, y, heading = room_named(room).home
        for (who, share), value in steps.items():
            number = value[room] if isinstance(value, dict) else value
            for seed in SEEDS:
                for usual, ahead in ((0, 0.05), (0, -0.3), (1, -0.6)):
                    home = (reached or {}).get((who, share, ahead), 1)
                    rows.append(
                        {
                            "condition": f"{room}, {who}",
                            "seed": seed,
                            "share": share,
                            "usual": usual,
                            "x": x + ahead * np.cos(heading),
                            "y": y + ahead * np.sin(heading),
                            "steps": number + seed % 3,
                            "reached": home,
                        }
                    )
    return pd.DataFrame(rows)


ALIKE = {(who, share): 60.0 for who in opponents._WHO for share in (0.0, CLIMBING)}
NEAREST = pd.DataFrame({"condition": list(ROOMS), "usual": 1, "steps": 20.0})


@pytest.mark.parametrize(
    ("learnt", "verdict"),
    [(30.0, "yes"), (60.0, "no"), (90.0, "no"), ({"paper": 30.0, "attic": 60.0, "workshop": 90.0}, "partly")],
)
def test_learning_is_better_than_a_climb_where_it_takes_fewer_steps(learnt, verdict):
    of = placed({**ALIKE, ("after 20", 0.0): learnt})
    assert opponents.from_the_usual_start(of, NEAREST)[0] == verdict
    assert opponents.from_everywhere(of)[0] == verdict


def test_each_room_has_its_word():
    learnt = {"paper": 30.0, "attic": 60.0, "workshop": 90.0}
    rooms = opponents.from_everywhere(placed({**ALIKE, ("after 20", 0.0): learnt}))[1].split(";")
    for room, word in zip(rooms, ("better", "comparable", "worse"), strict=False):
        assert f"), {word}" in room


ONE_ROOM = {"paper": 30.0, "attic": 60.0, "workshop": 60.0}


@pytest.mark.parametrize(
    ("steps", "lost", "verdict"),
    [
        (30.0, 0, "yes"),
        (60.0, 0, "not shown"),
        (90.0, 0, "no"),
        ({"paper": 30.0, "attic": 60.0, "workshop": 60.0}, 0, "partly"),
        (30.0, 1, "no"),
    ],
)
def test_from_anywhere_asks_for_trials_at_home_from_each_place_and_fewer_steps(steps, lost, verdict):
    reached = {("extension", CLIMBING, 0.05): 0} if lost else None
    of = placed({**ALIKE, ("extension", CLIMBING): steps}, reached)
    assert opponents.from_anywhere(of)[0] == verdict


@pytest.mark.parametrize(("extension", "verdict"), [(40.0, "yes"), (60.0, "no"), (80.0, "no")])
def test_the_longer_learning_counts_where_it_saves_steps_with_the_same_climbing(extension, verdict):
    assert opponents.learning_or_climbing(placed({**ALIKE, ("extension", CLIMBING): extension}))[0] == verdict


@pytest.mark.parametrize(("there", "elsewhere", "verdict"), [(0, 1, "yes"), (1, 1, "not shown"), (1, 0, "no")])
def test_robots_get_lost_beside_home_where_fewer_come_home_from_there(there, elsewhere, verdict):
    reached = {("after 20", 0.0, 0.05): there, ("after 20", 0.0, -0.3): elsewhere}
    assert opponents.beside_and_behind(placed(ALIKE, reached))[0] == verdict


@pytest.mark.parametrize(("good", "verdict"), [(10.0, "yes"), (56.0, "partly"), (70.0, "no")])
def test_learning_pays_for_itself_where_the_sum_of_all_steps_falls_below_the_climbs(good, verdict):
    rows = []
    for condition in opponents.WORTH.conditions:
        steps = np.r_[200.0, np.full(59, good)] if "sarsa" in condition else np.full(60, 60.0)
        for seed in (2000, 2001, 2002):
            rows += [
                {"condition": condition, "seed": seed, "episode": number, "steps": value}
                for number, value in enumerate(steps, 1)
            ]
    assert opponents.pays(pd.DataFrame(rows))[0] == verdict


@pytest.mark.parametrize(
    ("until", "follows", "verdict"),
    [(10, 10, "reproduced"), (3, 3, "partly reproduced"), (2, 10, "not reproduced")],
)
def test_the_equivalence_must_hold_to_the_first_reset_and_on_the_robot_throughout(until, follows, verdict):
    of = pd.DataFrame(
        {"condition": condition, "seed": seed, "steps": 10, "unclipped": 3, "until": until, "follows": follows}
        for condition in ("all", "taken")
        for seed in (1, 2, 3)
    ).assign(restarted=10)
    assert opponents.equivalence(of)[0] == verdict


@pytest.mark.parametrize(
    ("three", "raw", "verdict"),
    [(2, 1, "reproduced"), (8, 2, "partly reproduced"), (2, 8, "not reproduced"), (2, 5, "not shown")],
)
def test_the_stopping_rule_is_less_sensitive_if_it_fires_over_more_headings_at_home(three, raw, verdict):
    """Each rule fires within so many steps of 2 degrees to either side; eq. (19) within 5."""
    turns = np.arange(-45, 46)
    fires = {"one": 5, "three": three, "raw": raw}
    anywhere = pd.DataFrame({"kind": probes.ANYWHERE, "away_m": 1.0, "turned_deg": np.arange(9.0)})
    at_home = pd.DataFrame({"kind": probes.AT_HOME, "away_m": 0.0, "turned_deg": 2.0 * turns})
    driven = pd.DataFrame({"kind": probes.DRIVEN, "away_m": [1.0, 0.1], "turned_deg": 0.0})
    for rule, within in fires.items():
        anywhere[rule] = 0.1
        at_home[rule] = np.where(abs(turns) <= within, 0.95, 0.0)
        driven[rule] = [0.0, 0.95]
    one = pd.concat([anywhere, at_home, driven])
    of = pd.concat(
        [one.assign(condition=room, seed=seed) for room in opponents.ORIENTATION.conditions for seed in range(3)]
    )
    assert opponents.orientation(of)[0] == verdict


@pytest.mark.parametrize(
    ("at_wall", "verdict"),
    [
        ((0.7, 0.6, 0.9), "yes"),
        ((0.7, 0.6, 0.4), "partly"),
        ((0.4985, 0.4985, 0.4), "not shown"),
        ((0.4, 0.3, 0.1), "no"),
        ((0.4985, 0.4985, 0.4985), "not shown"),
    ],
)
def test_walls_hold_lost_robots_where_these_spend_most_of_their_last_steps_there(at_wall, verdict):
    rows = [
        {"condition": room, "seed": seed, "end_x": 0.1, "end_y": 0.1, "spread_m": 0.1, "at_wall": share + seed / 1000}
        for room, share in zip(ROOMS, at_wall, strict=True)
        for seed in range(4)
    ]
    nobody = {"condition": "attic", "seed": 9, "at_wall": np.nan}
    assert opponents.held_by_walls(pd.DataFrame([*rows, nobody]))[0] == verdict


def test_lost_robots_are_those_of_the_trials_that_do_not_come_home():
    few = COMPACT.with_changes(episodes=1, max_steps=50)
    lost = pd.DataFrame(probes.where_lost(few, 2000))
    tried = pd.DataFrame(probes.placed(few, 2000))
    tried = tried[(tried.share == 0) & (tried.usual == 0)]
    assert len(lost) == pytest.approx((tried.reached == 0).sum(), abs=1)
    assert lost.at_wall.between(0, 1).all()
    assert lost.spread_m.max() < 0.6
