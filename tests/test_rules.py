"""Rules compared on the robot: one column of the table is the reference, the others are judged against it."""

import numpy as np
import pytest

from homing_lib.agent import run
from homing_lib.errors import UserError
from homing_lib.lambdas import Fixed, fletcher_reeves
from homing_lib.settings import Settings
from homing_lib.study import rules

TINY = Settings(images="compact", episodes=6, survey_steps=50, max_steps=60)


def test_every_rule_is_run_with_every_seed_as_alone():
    compared = rules.compare({"form 2": fletcher_reeves, "zero": Fixed(0)}, [3, 4], TINY)
    names = ("fletcher-reeves", "fixed:0")
    alone = [[run(TINY.with_changes(lambda_rule=name), seed).lengths for seed in (3, 4)] for name in names]
    np.testing.assert_array_equal([*compared.steps.values()], alone)


def test_the_verdict_is_on_the_last_five_episodes_seed_by_seed_against_the_first_rule():
    first = np.array([[99, 10, 10, 10, 10, 10], [99, 20, 20, 20, 20, 20], [99, 30, 30, 30, 30, 30]])
    found = rules.Rules({"a": first, "twice": 2 * first, "half": first / 2, "same": first})
    assert {label: verdict.word for label, verdict in found.verdicts.items()} == {
        "twice": "worse",
        "half": "better",
        "same": "comparable",
    }
    assert found.verdicts["twice"].typical == (2, 2, 2)
    header, _, *rows = str(found).splitlines()
    assert header == "| rule | steps, last 5 episodes | as a multiple of a | |"
    assert rows[0] == "| a | 20.0 | 1 | |"
    assert rows[1].startswith("| twice | 40.0 | 2.00 [2.00, 2.00]") and rows[1].endswith("| worse |")


def test_a_run_that_diverges_counts_as_the_step_cap():
    wild = TINY.with_changes(alpha0=1e9, theta0=1e9, lambda_rule="fixed:1", discount=1)
    steps = rules.compare({"one": Fixed(1)}, [0], wild).steps["one"]
    assert steps.shape == (1, 6) and (steps == 60).all()


def test_what_is_no_rule_is_refused_in_one_line():
    with pytest.raises(TypeError, match="a lambda rule is a function of the keywords"):
        rules.compare({"half": 0.5}, [0], TINY)


def test_before_any_run_all_rules_and_seeds_are_looked_at_and_the_label_named(monkeypatch):
    monkeypatch.setattr(rules, "run", None)
    with pytest.raises(TypeError, match=r"^half: lambda_rule = 0.5: "):
        rules.compare({"form 2": fletcher_reeves, "half": 0.5}, [0], TINY)
    with pytest.raises(UserError, match=r"^seeds = 3: must be a list or range of 0, 1, 2, ...$"):
        rules.compare({"form 2": fletcher_reeves}, 3, TINY)
