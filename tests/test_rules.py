"""Rules compared on the robot: one column of the table is the reference, the others are judged against it."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from homing_lib.agent import ClimbingAgent, RandomAgent, run
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


FIRST = np.array([[99, 10, 10, 10, 10, 10], [99, 20, 20, 20, 20, 20], [99, 30, 30, 30, 30, 30]], dtype=float)


def test_the_verdict_is_on_the_steps_of_all_episodes_seed_by_seed_against_the_first_rule():
    late = np.c_[FIRST[:, :1], FIRST[:, 1:] * 2]
    found = rules.Rules({"a": FIRST, "twice": 2 * FIRST, "half": FIRST / 2, "same": FIRST, "late": late})
    words = {label: verdict.verdict for label, verdict in found.verdicts.items()}
    assert words == {"twice": "more", "half": "fewer", "same": "the same", "late": "more"}
    assert found.verdicts["twice"].interval == (2, 2, 2)
    assert found.verdicts["late"].value == pytest.approx((3 * 99 + 2 * 300) / (3 * 99 + 300))
    assert found.late["late"].interval == (2, 2, 2)


def test_what_is_said_of_the_late_episodes_is_said_of_the_typical_robot():
    ours, theirs = np.full((8, 6), 20.0), np.full((8, 6), 10.0)
    theirs[0] = 10_000
    found = rules.Rules({"theirs": theirs, "ours": ours})
    assert found.late["ours"].value == 2
    assert found.verdicts["ours"].value == pytest.approx(160 / 10_070)


def test_the_table_has_total_and_late_steps_each_as_a_multiple_of_the_first_with_its_verdict():
    first = np.array([[9.0, 10], [9, 10], [9, 10], [9, 50]])
    *_, one, twice = str(rules.Rules({"a": first, "twice": 2 * first})).splitlines()
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in (one, twice)]
    assert cells[0] == ["a", "29", "1", "", "9.5", "1", ""]  # late: 9.5 three times and 29.5; the middle half is 9.5
    assert cells[1] == ["twice", "58", "2.00 [2.00, 2.00]", "more", "19.0", "2.00 [2.00, 2.00]", "more"]


def test_lambdas_are_drawn_as_often_as_they_were_met_to_two_digits_and_whatever_the_step():
    def drawn():
        return rules.ResampledLambda([0.0, 0.254, 1, 0.246], [8, 1, 5, 6], np.random.default_rng(0))

    one, other = drawn(), drawn()
    values = np.array([one(delta=np.nan, phi=None) for _ in range(4000)])
    for value, share in ((0, 0.4), (0.25, 0.35), (1, 0.25)):
        assert (values == value).mean() == pytest.approx(share, abs=0.03)
        assert (values[1:][values[:-1] == value] == 0).mean() == pytest.approx(0.4, abs=0.06)
    np.testing.assert_array_equal(other.beforehand(4000), values)


def test_the_first_few_seeds_are_what_they_alone_would_say():
    few = rules.compare({"a": Fixed(0.5), "b": Fixed(0)}, range(2), TINY)
    more = rules.compare({"a": Fixed(0.5), "b": Fixed(0)}, range(4), TINY)
    assert str(more.of_first(2)) == str(few)


def test_other_agents_are_compared_with_rules_over_the_same_seeds():
    compared = rules.compare({"zero": Fixed(0)}, [3, 4], TINY, agents={"climb": ClimbingAgent, "mine": Forwards})
    climb = [run(TINY.with_changes(controller="climb"), seed).lengths for seed in (3, 4)]
    mine = [run(TINY, seed, agent=Forwards).lengths for seed in (3, 4)]
    assert [*compared.steps] == ["zero", "climb", "mine"]
    np.testing.assert_array_equal(compared.steps["climb"], climb)
    np.testing.assert_array_equal(compared.steps["mine"], mine)
    assert [*rules.compare({}, [3, 4], TINY, agents={"a": Forwards, "b": RandomAgent}).verdicts] == ["b"]


class Forwards(RandomAgent):
    """Three methods, no learner."""

    def choose(self, phi):
        return 2


def test_a_comparison_is_stopped_by_ctrl_c():
    program = (
        "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from homing_lib.study import engine, rules\nfrom homing_lib.lambdas import Fixed\n"
        "engine.run(engine.Settings(images='compact'), 0)\nprint('begins', flush=True)\n"
        "rules.compare({'a': Fixed(0), 'b': Fixed(0.5)}, range(100_000))"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert process.stdout.readline() == b"begins\n"
        time.sleep(1)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) in (1, -signal.SIGINT)
    finally:
        process.kill()
        process.communicate()


def test_a_mistake_in_a_rule_is_told_whoever_runs_it():
    def text(*, delta, **_):
        return "0.5"

    with pytest.raises(ValueError, match=r"^lambda rule text returned '0.5'; a lambda rule is a function"):
        rules.compare({"form 2": fletcher_reeves, "text": text}, range(4), TINY)


def test_a_run_that_diverges_counts_as_the_step_cap():
    wild = TINY.with_changes(alpha0=1e9, theta0=1e9, lambda_rule="fixed:1", discount=1)
    steps = rules.compare({"one": Fixed(1)}, [0, 1], wild).steps["one"]
    assert steps.shape == (2, 6) and (steps == 60).all()


FORM_2 = {"form 2": fletcher_reeves}


@pytest.mark.parametrize(
    ("rules_", "seeds", "agents", "told"),
    [
        (FORM_2, [3], {}, r"seeds = \[3\]: one robot says nothing of how robots differ; give two or more"),
        (FORM_2, 3, {}, r"seeds = 3: must be a list or range of 0, 1, 2, ..."),
        (FORM_2 | {"half": 0.5}, [0, 1], {}, r"half: lambda_rule = 0.5: .*a lambda rule is a function of the keywords"),
        (FORM_2, [0, 1], {"half": 0.5}, r"half: an agent is made by a function of settings"),
        (FORM_2, [0, 1], {"no rng": lambda settings: None}, r"no rng: .*too many positional"),
        (FORM_2, [0, 1], {"made": RandomAgent(TINY, None)}, r"made: .*not a callable"),
        (FORM_2, [0, 1], {"form 2": RandomAgent}, r"form 2: .*label of its own"),
    ],
)
def test_before_any_run_what_cannot_be_compared_is_refused_by_its_label(rules_, seeds, agents, told, monkeypatch):
    monkeypatch.setattr(rules, "run", None)
    with pytest.raises((UserError, TypeError), match=f"^{told}") as refusal:
        rules.compare(rules_, seeds, TINY, agents=agents)
    assert "\n" not in str(refusal.value)


def test_of_one_robot_there_is_no_table():
    with pytest.raises(UserError, match=r"^a: 1 seed; one robot .* give two or more$"):
        rules.Rules({"a": FIRST, "b": FIRST}).of_first(1)
