"""A claim is judged by its predicate, and by nothing else."""

import numpy as np
import pandas as pd
import pytest

from homing_lib.study import claims, judges, studies
from homing_lib.study.claims import CLAIMS, Finding

SEEDS = 10
EPISODES = 20


def table(conditions, **columns):
    """A study's table: steps of each episode by condition, the same for all seeds but for a step or so."""
    rows = []
    for condition, steps in conditions.items():
        for seed in range(SEEDS):
            for episode, value in enumerate(np.broadcast_to(steps, EPISODES), 1):
                rows.append({"condition": condition, "seed": seed, "episode": episode, "steps": value + seed / 10})
    of = pd.DataFrame(rows)
    defaults = {"change": of.steps, "diverged": 0, "at_wall": 0.1}
    return of.assign(**{name: columns.get(name, value) for name, value in defaults.items()})


LEARNS = np.r_[np.full(8, 200.0), np.full(12, 40.0)]
PARTS = {label: LEARNS for label in studies.PARTS.conditions}


def trials(reached, kidnapped_reached=None):
    """Trials at two places, and as many kidnapped; `reached` of ten reach home."""
    rows = [
        {"condition": "20 episodes", "seed": seed, "light": 1.0, "x": x, "y": 0.5, "kidnapped": away, "reached": home}
        for away, homes in enumerate((reached, reached if kidnapped_reached is None else kidnapped_reached))
        for seed in range(SEEDS)
        for x in (0.2, 0.6)
        for home in [1] * homes + [0] * (10 - homes)
    ]
    return pd.DataFrame(rows)


def by_step_size(rules):
    return table({f"{rule} @ {alpha:g}": steps for rule, steps in rules.items() for alpha in studies.STEP_SIZES})


ALIKE = {rule: LEARNS for rule in studies.RULES}


@pytest.mark.parametrize(
    ("others", "verdict"),
    [
        (LEARNS, "reproduced"),
        (LEARNS * 2, "reproduced"),
        (LEARNS / 2, "not reproduced"),
    ],
)
def test_a_conjugate_lambda_must_do_as_well_as_every_fixed_one(others, verdict):
    of = {rule: LEARNS if rule == "form 2" else others for rule in studies.RULES}
    assert judges.conjugate_lambda(table(of), by_step_size(of))[0] == verdict


def test_a_conjugate_lambda_that_does_as_well_as_some_is_partly_reproduced():
    of = ALIKE | {"fixed 0.5": LEARNS / 2}
    verdict, effect = judges.conjugate_lambda(table(of), by_step_size(of))
    assert verdict == "partly reproduced"
    assert "of 7 fixed values: steps: 6; parameter change: 6; steps, each at its best step size: 6." in effect
    assert "Against the fixed one of the least mean, fixed 0.5," in effect


def test_a_rule_whose_changes_are_beyond_all_bounds_changes_more():
    of = table(ALIKE)
    of.loc[(of.condition == "fixed 1") & (of.episode > 3), ["change", "diverged"]] = np.nan, 1
    assert claims.of_change(of, "form 2", "fixed 1") == (0, 0, 0)
    assert claims.of_change(of, "form 2", "fixed 0").value == pytest.approx(1)
    assert claims.lost(of, "fixed 1") == SEEDS
    assert claims.lost(of, "fixed 0") == 0


def test_each_rule_is_taken_at_the_step_size_that_suits_it():
    of = by_step_size(ALIKE)
    better = of.condition == "fixed 0 @ 0.004"
    of.loc[better, "steps"] -= 30
    at_best = claims.at_best_step_size(of)
    assert at_best["fixed 0"].mean() == pytest.approx(at_best["form 2"].mean() - 30)


@pytest.mark.parametrize(
    ("twenty", "two_hundred", "verdict"),
    [
        (LEARNS, 40, "reproduced"),
        (LEARNS, 20, "partly reproduced"),
        (np.full(EPISODES, 100), 100, "not reproduced"),
    ],
)
def test_convergence_is_fewer_steps_than_at_first_and_hardly_fewer_later(twenty, two_hundred, verdict):
    assert judges.within_twenty_episodes(table({"learnt": twenty}), table({"form 2": two_hundred}))[0] == verdict


@pytest.mark.parametrize(("homes", "verdict"), [(10, "reproduced"), (7, "partly reproduced"), (1, "not reproduced")])
def test_almost_anywhere_is_95_per_cent_and_partly_is_more_than_half(homes, verdict):
    chance = table({"random": np.r_[np.full(10, 100), np.full(10, 1000)]})
    found, effect = judges.from_almost_anywhere(trials(homes), chance)
    assert found == verdict
    assert "random actions, from the usual start alone, which is a hard one, 50.0" in effect


@pytest.mark.parametrize(("homes", "verdict"), [(8, "reproduced"), (6, "not reproduced")])
def test_a_kidnapped_robot_may_lose_five_points(homes, verdict):
    assert judges.kidnapped(trials(8, homes))[0] == verdict


@pytest.mark.parametrize(("judge", "part"), [(judges.falling_cost, "constant cost")])
@pytest.mark.parametrize(("factor", "verdict"), [(2, "reproduced"), (0.5, "not reproduced"), (1, "not shown")])
def test_a_part_helps_if_it_takes_more_steps_without_it(judge, part, factor, verdict):
    assert judge(table(PARTS | {part: LEARNS * factor}))[0] == verdict


@pytest.mark.parametrize(
    ("penalty", "learning", "verdict"),
    [(0.3, 0.3, "reproduced"), (0.1, 0.3, "partly reproduced"), (0.1, 0.1, "not shown"), (0.05, 0.05, "not shown")],
)
def test_the_wall_penalty_and_learning_help_if_more_steps_are_spent_at_walls_without(penalty, learning, verdict):
    of = table(PARTS)
    of.loc[of.condition == "no wall penalty", "at_wall"] = penalty
    of.loc[of.condition == "no learning at walls", "at_wall"] = learning
    assert judges.wall_penalty(of)[0] == verdict


def test_exploring_less_converges_if_the_end_is_better_than_the_beginning():
    assert judges.less_and_less_exploration(table(PARTS))[0] == "reproduced"
    assert judges.less_and_less_exploration(table(PARTS | {"default": 50}))[0] == "not reproduced"


@pytest.mark.parametrize(
    ("decay", "verdict"),
    [
        (lambda n: np.exp(-n / 3), "reproduced"),
        (lambda n: 1 / (6 + n), "partly reproduced"),
        (lambda n: 1 + 0 * n, "not reproduced"),
    ],
)
def test_the_change_falls_exponentially_if_its_logarithm_is_a_straight_line(decay, verdict):
    of = table({"form 2": 50})
    of["change"] = decay(of.episode) * (1 + of.seed / 100)
    assert judges.exponential_change(of)[0] == verdict


@pytest.mark.parametrize(("good_from", "verdict"), [(9, "reproduced"), (3, "not reproduced"), (14, "not reproduced")])
def test_good_episodes_begin_where_the_mean_first_comes_near_the_last_ones(good_from, verdict):
    of = table({"form 2": np.where(np.arange(1, 21) < good_from, 200, 40)})
    assert claims.first_good(of).value == good_from
    assert judges.around_the_ninth(of)[0] == verdict


def test_a_finding_is_told_in_a_paragraph_and_every_judged_claim_in_a_row():
    told = str(Finding("C9", "not shown", "It differs by 1 [-2, 4]."))
    assert told == "**Claim C9**, a kidnapped robot recovers at once: **not shown**. It differs by 1 [-2, 4]."
    of_the_paper = claims.names("C")
    rows = claims.table(of_the_paper).splitlines()
    assert len(rows) == 2 + len(of_the_paper)
    assert f"| C2 | {CLAIMS['C2'].text} | **{claims.judge('C2').verdict}** | " in "\n".join(rows)


def test_a_claim_or_a_question_is_added_by_its_judge_alone(monkeypatch):
    for name in ("C99", "Q99"):
        monkeypatch.setitem(CLAIMS, name, None)  # so that it goes again

    @claims.claim("C99", "robots fly")
    def flight():
        return "not shown", "None did."

    @claims.claim("Q99", "should they?")
    def better_not():
        return "no", "It is dangerous."

    assert claims.judge("C99") == Finding("C99", "not shown", "None did.")
    assert claims.table(["C99"]).splitlines()[-1] == "| C99 | robots fly | **not shown** | None did. |"
    assert str(claims.judge("Q99")) == "**Question Q99**, should they?: **no**. It is dangerous."
    assert claims.names()[-1] == "Q99"


def test_names_are_in_the_order_of_their_numbers():
    of_the_paper = claims.names("C")
    assert of_the_paper == sorted(of_the_paper, key=lambda name: int(name[1:]))
    assert claims.names() == of_the_paper + claims.names("Q")


def test_a_lost_robot_leaves_a_comparison_open_that_the_typical_robot_would_decide():
    theirs = 40 + np.arange(50.0)
    ours = theirs * 0.7
    both = claims.compare(ours, theirs)
    assert (both.word, both.side) == ("better", "below")
    ours[3] = 2000
    both = claims.compare(ours, theirs)
    assert both.typical.high < 1 < both.mean.high
    assert (both.word, both.side) == ("open", "open")
    assert f"{both:.1f}" == f"{both.typical:.1f} (mean {both.mean:.1f})"


def test_differences_that_are_too_small_to_matter_are_comparable_though_only_one_of_both_excludes_1():
    theirs = 40 + np.arange(50.0)
    ours = theirs * np.where(np.arange(50) < 5, 0.8, 1.0)
    both = claims.compare(ours, theirs)
    assert (both.typical.high < 1) != (both.mean.high < 1)
    assert both.word == "comparable"
