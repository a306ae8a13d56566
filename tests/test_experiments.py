"""What the lab shows beside its checks is what was computed: rates, tables and the recap."""

import re
from contextlib import suppress

import numpy as np
import pytest

from homing_lib.study import walk
from homing_lib.study.questions import drives
from homing_lib.study.rules import Rules
from homing_lib.teach import experiments
from tests.test_lab import DRIVEN, TRIED, paragraphs


def test_how_often_a_rule_has_no_lambda_is_counted_over_the_steps_of_all_walks(monkeypatch):
    def learning(rule, seed, step_size):
        for x in seed:
            with suppress(ZeroDivisionError):
                rule(x=x)

    monkeypatch.setattr(walk, "learning", learning)
    walks = [[0], [2, 0.5, 4]]  # no λ, then 0.5, 2 (cut to 1) and 0.25
    assert experiments.lambdas_given(lambda *, x: 1 / x, walks, 0.1) == (0.25, pytest.approx(1.75 / 3))
    assert experiments.lambdas_given(lambda *, x: 1 / x, walks[:1], 0.1) == (1.0, 0.0)


def test_both_ways_down_step_to_the_lowest_point_ahead_and_conjugate_gradient_is_at_the_bottom_after_two():
    steepest, conjugate = (line.get_xydata() for line in experiments.two_ways_down().axes[0].lines)
    curvature = np.diag([1, 4])
    for way, straight in ((steepest, 7), (conjugate, 1)):  # so many steps go straight downhill
        steps, downhill = np.diff(way, axis=0), -way @ curvature
        assert np.sum(steps * downhill[1:], axis=1) == pytest.approx(0, abs=1e-12)
        lengths = steps[:straight] / downhill[:straight]
        assert lengths[:, 0] == pytest.approx(lengths[:, 1])
    first, second = np.diff(conjugate, axis=0)
    assert first @ curvature @ second == pytest.approx(0, abs=1e-12)
    assert not conjugate[2].any()


def test_robots_are_tried_as_the_study_tries_them_and_the_table_has_their_means(monkeypatch):
    def trials(settings, seed):
        assert settings == drives.after(10, images="compact")
        return {"kind": range(8), "steps": [np.nan, *(100.0 * kind + seed for kind in range(1, 8))]}

    monkeypatch.setattr(drives, "tried", lambda *given: {k: np.array(v) for k, v in trials(*given).items()})
    tried = experiments.tried(range(3))
    assert {kind: steps.tolist() for kind, steps in tried.items()} == {
        kind: [100 * at, 100 * at + 1, 100 * at + 2] if at else [2000] * 3 for at, kind in enumerate(drives.KINDS)
    }
    *_, learnt, initial, _, beside = experiments.four_ways(tried).splitlines()
    kinds = {learnt: ("restored", "frozen"), initial: ("forgetful", "untrained"), beside: ("climb", "random")}
    for line, pair in kinds.items():
        assert re.findall(r"(\d+) \[", line) == [f"{tried[kind].mean():.0f}" for kind in pair]


def test_the_table_of_the_drivers_has_their_steps_and_mine_as_a_multiple_of_them_and_no_verdicts():
    *_, mine, first, _, _, _ = experiments.without_verdicts(DRIVEN).splitlines()
    steps = {label: total.sum(axis=1).mean() for label, total in DRIVEN.steps.items()}
    assert mine == f"| my rule | {steps['my rule']:.0f} |  |  |"
    ten = {label: total[:10].sum() for label, total in DRIVEN.steps.items()}
    ratios = [each["my rule"] / each["fixed 0"] for each in (ten, steps)]
    assert re.match(rf"\| fixed 0 \| {steps['fixed 0']:.0f} \| {ratios[0]:.2f} \[0.* \| {ratios[1]:.2f} \[0", first)


def test_most_tables_of_task_3_part_at_step_2_or_3():
    assert sum(experiments.twelve_steps(seed).first in (2, 3) for seed in range(50)) > 30


def test_the_recap_says_what_was_computed():
    errors = {"λ = 0.8": 2, "λ = 0": 4, "form 2, guard 0": 5, "form 2, guard 0.8": 2, "form 2, guard 1": 8}
    raced = walk.Race({}, dict.fromkeys(errors, 0.1), {label: np.full(3, error) for label, error in errors.items()})
    mine, climb, seen = np.tile([80.0, 60, 40, 35], (2, 1)), np.full((2, 4), 50.0), experiments.twelve_steps(28)
    lines = paragraphs(seen, raced, Rules({"my rule": mine, "the climb": climb}), TRIED | {"climb": climb})
    never = Rules({"my rule": mine + 20, "the climb": climb})
    _, _, not_parted, _, _, not_caught, policy = paragraphs(
        seen._replace(first=0), raced, never, TRIED | {"climb": climb, "frozen": TRIED["restored"]}
    )
    assert [re.findall(r"-?\d[\d.]*\b(?!\])", line) for line in (lines[at - 1] for at in (1, 2, 6, 7))] == [
        ["0.9", "0.8", "3"],
        ["1", "-1", "2"],
        ["50", "3", "40"],
        ["69", "774", "399", "50", "355"],
    ]
    assert "at step 6;" in lines[2]
    assert "does not come back" in lines[2]
    assert "do not part" in not_parted
    assert re.search(r"4\.00.* 1\.25\. The guard", lines[3])
    assert re.search(r"all 4 episodes.* 95 ", not_caught)
    assert "worse than chance" in lines[6]
    assert "better than chance" in policy
