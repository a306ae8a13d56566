"""What is drawn follows its pool and nothing else; step sizes are kept by rule; each question is judged as it says."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.settings import Settings
from homing_lib.study import mechanism, statistics
from homing_lib.study.claims import Comparison
from homing_lib.study.measures import summary
from homing_lib.study.mechanism import ROOMS, STAND_INS, STEP_SIZES, ResampledLambda
from homing_lib.study.runs import load_table
from homing_lib.study.statistics import Interval


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """Made-up tables leave no doubt that more of them would settle."""
    monkeypatch.setattr(statistics, "RESAMPLES", 500)


# Lambdas drawn from a pool


def test_how_often_a_lambda_follows_which_is_counted_within_episodes_and_without_their_first_steps():
    steps = np.zeros((7, len(STEP_COLUMNS)))
    steps[:, STEP_COLUMNS.index("lambda")] = [0, 1, 0.304, 0.296, 0, 0, 1]
    found = mechanism.transitions(Run(Settings(), 0, steps, np.array([5, 2]), np.ones(2, bool), 0))
    assert list(zip(*found.values(), strict=True)) == [(0, 1, 2), (0.5, 0, 1), (0.5, 0.3, 1), (1, 0.3, 1)]


POOL = pd.DataFrame({"after": [0, 0, 0.5, 1], "lambda": [0, 0.25, 1, 0], "count": [3, 1, 1, 5]})


def drawn(chain, count=4000):
    rule = ResampledLambda(POOL, np.random.default_rng(0), chain=chain)
    return np.array([rule(delta=np.nan, phi=None) for _ in range(count)])


def test_independent_draws_come_as_often_as_in_the_pool_whatever_came_before():
    values = drawn(chain=False)
    for value, share in ((0, 0.8), (0.25, 0.1), (1, 0.1)):
        assert (values == value).mean() == pytest.approx(share, abs=0.02)
        assert (values[1:][values[:-1] == value] == 0).mean() == pytest.approx(0.8, abs=0.06)


def test_a_chain_draws_what_followed_such_a_lambda_in_the_pool():
    values = drawn(chain=True)
    assert set(values[1:][values[:-1] == 0.25]) == {1}
    assert set(values[1:][values[:-1] == 1]) == {0}
    assert (values[1:][values[:-1] == 0] == 0.25).mean() == pytest.approx(0.25, abs=0.03)


def test_stand_ins_are_drawn_from_the_pool_of_their_room_and_update_and_run_by_seed(monkeypatch):
    small = Settings(images="compact", episodes=2, max_steps=60, survey_steps=100, update="all")
    asked = []
    monkeypatch.setattr(mechanism, "pool_of", lambda room, update: asked.append((room, update)) or POOL)
    found = mechanism.resampled(small, 0)
    assert list(found["stand_in"]) == [0, 1, 2]
    assert found["lambda"] == pytest.approx([0.125, 0.2, 0.125], abs=0.12)
    assert found["lambda"][2] == pytest.approx(0.125, abs=0.006)  # the mean, but for first steps
    again, two, few = mechanism.resampled(small, 0), mechanism.drawn_or_mean(small, 0), mechanism.handful(small, 0)
    for name, values in found.items():
        np.testing.assert_array_equal(values, again[name])
        np.testing.assert_array_equal(values[[0, 2]], two[name])
        if name != "stand_in":
            assert few[name][3] == values[0]
    for rule, late in zip(mechanism.HANDFUL[:3], few["late"], strict=False):
        changed = small.with_changes(lambda_rule=mechanism.CORE[rule])
        assert summary(changed, 0)["late"] == late
    assert set(asked) == {("paper", "all")}


# Step sizes


def names_of(study):
    return sorted({condition.split(" @ ")[0] for condition in study.conditions})


def by_size(table, name, column="late", statistic=np.mean):
    """That of the runs with a step size that is too small, with those of the four, and with one that is too great."""
    of = table[table.condition.astype(str).str.startswith(f"{name} @ ")].groupby("condition", observed=True)[column]
    found = {float(condition.split(" @ ")[1]): statistic(values.to_numpy()) for condition, values in of}
    return (
        found.get(mechanism.TOO_SMALL),
        [found[alpha] for alpha in STEP_SIZES if alpha in found],
        found.get(mechanism.TOO_GREAT),
    )


@pytest.mark.parametrize("column", ["late", "total"])
def test_no_rule_learns_best_in_any_room_with_a_step_size_that_is_greater_than_the_four(column):
    table = load_table(mechanism.CHOICE)
    for name in names_of(mechanism.CHOICE):
        _, four, too_great = by_size(table, name, column)
        assert too_great > min(four), name


def test_nor_with_a_smaller_one_and_where_that_comes_near_forty_more_seeds_say_so():
    table, near = load_table(mechanism.CHOICE), []
    for name in names_of(mechanism.CHOICE):
        too_small, four, _ = by_size(table, name)
        if too_small < 4 / 3 * min(too_small, *four):
            near.append(name)
        assert by_size(table, name, "total")[0] > min(by_size(table, name, "total")[1]), name
    assert tuple(near) == mechanism.DOUBTFUL
    for name in mechanism.DOUBTFUL:
        for statistic in (np.mean, statistics.iqm):
            too_small, next_three, _ = by_size(load_table(mechanism.LEAST), name, "late", statistic)
            assert too_small > min(next_three), (name, statistic)


def test_where_the_smallest_of_the_four_is_left_out_no_rule_comes_within_half_again_of_its_best_with_it():
    table = load_table(mechanism.CHOICE)
    small = {room for room in ROOMS if mechanism.step_sizes(room) == STEP_SIZES}
    assert small == {"paper", "divided", "attic", "cell"}
    for name in names_of(mechanism.CHOICE):
        _, (smallest, *others), _ = by_size(table, name)
        assert name.split(", ")[0] in small or smallest > 1.5 * min(others), name


# What is measured


def test_a_fixed_lambda_on_the_walk_has_the_error_of_the_literature(monkeypatch):
    monkeypatch.setattr(mechanism, "WALK_STEP_SIZES", (0.6, 0.8))
    errors = [mechanism.walk(Settings(lambda_rule=f"fixed:{value}"), seed) for seed in range(10) for value in (0, 0.4)]
    for kind, alpha, published in ((0, 0.8, 0.3452), (1, 0.6, 0.2803)):  # Sutton & Barto (2018), fig. 12.6
        found = [float(one["error"][one["alpha"] == alpha][0]) for one in errors[kind::2]]
        assert np.mean(found) == pytest.approx(published, abs=4 * np.std(found) / np.sqrt(10))


def test_a_room_is_measured_by_its_views_and_by_a_run_there():
    small = Settings(images="compact", episodes=3, max_steps=60, survey_steps=300)
    found = mechanism.properties(small, 0)
    assert found["area"] == pytest.approx(1.15)
    assert 0 <= found["home"] < 0.3
    assert found["slope"] < 0  # views of places nearer to home are more like it
    for share in ("same_sign", "positive", "at_wall"):
        assert 0 < found[share] < 1
    assert 0 < found["early"] <= 60


# What is judged


def test_what_the_others_lack_matters_if_form_2_is_better_than_each():
    word = {"better": (0.5, 0.4, 0.6), "comparable": (1, 0.9, 1.1), "worse": (2, 1.8, 2.2), "open": (1, 0.5, 2)}

    def of(*words):
        return mechanism.whether(*(Comparison(*[Interval(*word[one])] * 2) for one in words))

    assert of("better", "better") == "yes"
    assert [of("better", other) for other in ("comparable", "worse", "open")] == ["partly"] * 3
    assert [of("comparable", "worse"), of("worse"), of("comparable", "comparable")] == ["no"] * 3
    assert [of("open"), of("comparable", "open"), of("worse", "open")] == ["not shown"] * 3


def table(study, late, stand_ins=False, **columns):
    """A study's table in which conditions take 40 steps, but for those whose label holds a key of `late`."""
    spread, made = np.linspace(0.95, 1.05, 12), []
    for label in study.conditions:
        for stand_in in range(3) if stand_ins else (None,):
            name = STAND_INS[stand_in] if stand_ins else label
            value = next((steps for key, steps in late.items() if key in name), 40)
            made.append(pd.DataFrame({"condition": label, "seed": np.arange(12), "late": value * spread}))
            made[-1] = made[-1].assign(total=made[-1].late * 20, stand_in=stand_in, **columns)
    return pd.concat(made, ignore_index=True)


def drawn_table(study, late):
    return table(study, late, stand_ins=True)


M, D = mechanism.MECHANISM, mechanism.MECHANISM_DRAWN


@pytest.mark.parametrize(
    ("late", "verdict"),
    [
        ({"i.i.d.": 60, "Markov": 60}, "yes"),
        ({"i.i.d.": 60}, "partly"),
        ({}, "no"),
        ({"i.i.d.": 20, "Markov": 20}, "no"),
    ],
)
def test_timing_matters_if_form_2_is_better_than_what_is_drawn_from_its_own(late, verdict):
    assert mechanism.when(table(M, {}), drawn_table(D, late))[0] == verdict


@pytest.mark.parametrize(
    ("judge", "both"), [(mechanism.size, mechanism.SAME_SIGN), (mechanism.sign, mechanism.SAME_SIZE)]
)
def test_size_and_sign_matter_if_form_2_is_better_than_the_rules_without_them(judge, both):
    one, other = (f", {name}, " for name in both)
    assert judge(table(M, {one: 60, other: 60}))[0] == "yes"
    assert judge(table(M, {one: 60}))[0] == "partly"
    assert judge(table(M, {}))[0] == "no"


def test_the_best_of_the_fixed_lambdas_is_the_one_to_beat():
    fixed = {", fixed": 60}
    assert mechanism.than_the_best_fixed(table(M, fixed))[0] == "yes"
    assert mechanism.than_the_best_fixed(table(M, {", fixed 0.25": 30} | fixed))[0] == "no"
    assert mechanism.fast(table(M, fixed))[0] == "yes"
    assert mechanism.fast(table(M, {", fixed 0.25": 30} | fixed))[0] == "partly"
    assert mechanism.fast(table(M, {}))[0] == "no"


def noisy(of, column="late", but=()):
    """The same, with steps that leave everything open, but for the conditions whose label holds one of `but`."""
    steady = of.condition.str.contains("|".join(but)) if but else False
    return of.assign(**{column: of[column] * np.where(steady, 1, np.where(of.seed // 2 % 2, 2.2, 0.4))})


def test_whether_it_is_fast_is_told_by_intervals_of_one_width():
    _, effect = mechanism.fast(noisy(table(M, {}), "total", but=["form 2"]))
    assert len(set(re.findall(r"\d\.\d\d \[.*?\] \(.*?\)", effect))) == 1
    assert effect.count("open") == 3


def test_what_holds_with_the_taken_action_holds_with_all_if_the_verdicts_are_the_same():
    mine = {"absolute": 60, "opposite": 60}
    of, of_all = table(M, mine), table(mechanism.MECHANISM_ALL, mine)
    drawn, drawn_all = drawn_table(D, {}), drawn_table(mechanism.ALL_DRAWN, {})
    assert mechanism.standard(of, drawn, of_all, drawn_all)[0] == "yes"
    assert mechanism.standard(of, drawn, table(mechanism.MECHANISM_ALL, {}), drawn_all)[0] == "partly"
    others = table(mechanism.MECHANISM_ALL, {"gate": 60, "inverse": 60, "fixed": 60})
    drawn_others = drawn_table(mechanism.ALL_DRAWN, {"i.i.d.": 60, "Markov": 60})
    others = others.assign(late=np.where(others.condition.str.contains("opposite"), 40, others.late))
    assert mechanism.standard(of, drawn, others, drawn_others)[0] == "no"


def test_what_is_not_shown_with_all_weights_is_no_evidence_against_what_holds_with_the_taken_action():
    mine = {"absolute": 60, "opposite": 60}
    of, drawn, of_all = table(M, mine), drawn_table(D, {}), table(mechanism.MECHANISM_ALL, {})
    drawn_all = noisy(drawn_table(mechanism.ALL_DRAWN, {}))
    sign = ["form 2", "absolute", "opposite"]
    assert mechanism.standard(of, drawn, noisy(of_all, but=["form 2"]), drawn_all)[0] == "not shown"
    assert mechanism.standard(of, drawn, noisy(of_all, but=sign), drawn_all)[0] == "no"
    assert (
        mechanism.standard(of, drawn, noisy(table(mechanism.MECHANISM_ALL, mine), but=sign), drawn_all)[0] == "partly"
    )


def in_rooms(better):
    """The four tables of six rooms, in the first `better` of which draws are worse than form 2."""
    rooms_drawn = drawn_table(mechanism.ROOMS_DRAWN, {})
    worse = rooms_drawn.condition.str.split(",").str[0].isin(list(ROOMS)[1:better])
    rooms_drawn["late"] *= np.where(worse, 1.5, 1)
    drawn = drawn_table(D, {"i.i.d.": 60} if better else {})
    return table(M, {}), drawn, table(mechanism.ROOMS_RULES, {}), rooms_drawn


ALL = table(mechanism.MECHANISM_ALL, {}), drawn_table(mechanism.ALL_DRAWN, {})


def test_timing_matters_in_the_rooms_in_which_draws_are_worse():
    verdict, effect = mechanism.rooms(*in_rooms(6), *ALL)
    assert verdict == "yes"
    assert "independent draws from its own λ: better in 6 rooms, pooled 0.67 [0.6" in effect
    verdict, effect = mechanism.rooms(*in_rooms(2), *ALL)
    assert verdict == "partly"
    assert "better in 2, comparable in 4 rooms" in effect
    assert mechanism.rooms(*in_rooms(0), *ALL)[0] == "no"


def test_rooms_in_which_an_interval_ends_near_1_are_named():
    assert "knife edge in" not in mechanism.rooms(*in_rooms(6), *ALL)[1].split(";")[0]
    of, drawn, of_rooms, rooms_drawn = in_rooms(6)
    attic = rooms_drawn.condition.str.startswith("attic")
    rooms_drawn["late"] = np.where(attic, 40 * np.linspace(0.95, 1.1, 12)[rooms_drawn.seed], rooms_drawn.late)
    assert "(a knife edge in attic)" in mechanism.rooms(of, drawn, of_rooms, rooms_drawn, *ALL)[1].split(";")[0]


def test_only_a_property_that_orders_the_rooms_as_the_effect_does_decides():
    tables = list(in_rooms(0))
    for of in (tables[1], tables[3]):
        room = of.condition.str.split(",").str[0].map(list(ROOMS).index)
        of["late"] *= 1 + room / 10
    measured = table(mechanism.ROOMS_MEASURED, {})[["condition", "seed"]]
    room = measured.condition.map(list(ROOMS).index)
    measured = measured.assign(home=(room * 5) % 7, slope=-(room**2))
    verdict, effect = mechanism.what_decides(*tables, measured)
    assert verdict == "yes"
    assert "NRB by distance goes with the effect most (rank correlation +1.00" in effect
    assert mechanism.what_decides(*tables, measured.drop(columns="slope"))[0] == "not shown"
    # Among six, three that are alike may stand in 6 orders, upwards and downwards; four in 24.
    for alike, verdict, p in ((3, "yes", 12 / 720), (4, "not shown", 48 / 720)):
        tied = measured[["condition", "seed"]].assign(area=np.maximum(room, alike - 1))
        found, effect = mechanism.what_decides(*tables, tied)
        assert found == verdict
        assert f"p = {p:.2f}" in effect


def camera_table(late):
    """A table of `CAMERA`, filled as `table` does it."""
    rules = replace(mechanism.CAMERA, conditions=dict.fromkeys(mechanism.HANDFUL, Settings()))
    of = table(rules, late)
    return of.assign(rule=of.condition.map(mechanism.HANDFUL.index))


def test_the_camera_confirms_what_it_decides_as_the_atlas_does():
    atlas = table(M, {"opposite": 60}), drawn_table(D, {"i.i.d.": 60})

    def judged(opposite, draws):
        return mechanism.camera(camera_table({"opposite": opposite, "i.i.d.": draws}), *atlas)[0]

    assert judged(60, 60) == "yes"
    assert [judged(60, 40), judged(40, 60)] == ["partly"] * 2
    assert [judged(60, 20), judged(20, 20)] == ["no"] * 2
    assert judged(40, 40) == "not shown"
    nothing = table(M, {}), drawn_table(D, {})
    assert mechanism.camera(camera_table({}), *nothing)[0] == "not shown"


def test_on_the_walk_form_2_must_beat_the_best_fixed_lambda():
    def errors(best):
        return pd.DataFrame(
            [
                {"condition": rule, "seed": seed, "alpha": alpha, "error": error * (1 + seed / 100)}
                for rule in mechanism.WALK.conditions
                for error in [best.get(rule, 0.4)]
                for alpha in mechanism.WALK_STEP_SIZES
                for seed in range(10)
            ]
        )

    assert mechanism.on_the_walk(errors({"form 2": 0.3}))[0] == "yes"
    verdict, effect = mechanism.on_the_walk(errors({"fixed 0.8": 0.3}))
    assert verdict == "no"
    assert (
        "Each rule's least mean error, over the first 10 walks at its best step size: fixed 0.8 0.31, form 2 0.42"
        in effect
    )
