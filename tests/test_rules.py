"""Rules and learners compared on the robot: one row of the table is the reference, the others are judged against it."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from homing_lib.agent import ClimbingAgent, RandomAgent, Run, run
from homing_lib.errors import UserError
from homing_lib.lambdas import Fixed, fletcher_reeves
from homing_lib.settings import Settings
from homing_lib.study import rules

TINY = Settings(images="compact", episodes=6, survey_steps=50, max_steps=60)
FORM_2 = {"form 2": fletcher_reeves}
FIRST = np.array([[99, 10, 10, 10, 10, 10], [99, 20, 20, 20, 20, 20], [99, 30, 30, 30, 30, 30]], dtype=float)


class Forwards(RandomAgent):
    """Three methods, no learner."""

    def choose(self, phi):
        return 2


def lengths(settings, **how):
    return [run(settings, seed, **how).lengths for seed in (3, 4)]


# What is compared


def test_rules_and_agents_are_run_with_every_seed_as_each_would_be_alone():
    agents = {"climb": ClimbingAgent, "mine": Forwards}
    compared = rules.compare(FORM_2 | {"zero": "fixed:0"}, [3, 4], TINY, agents=agents)
    alone = {"form 2": lengths(TINY), "zero": lengths(TINY.with_changes(lambda_rule="fixed:0"))}
    alone |= {"climb": lengths(TINY.with_changes(controller="climb")), "mine": lengths(TINY, agent=Forwards)}
    assert [*compared.steps] == [*alone]
    for label, steps in alone.items():
        np.testing.assert_array_equal(compared.steps[label], steps)
    assert [*rules.compare({}, [3, 4], TINY, agents={"a": Forwards, "b": RandomAgent}).verdicts] == ["b"]


def test_a_run_that_diverges_counts_as_the_step_cap():
    wild = TINY.with_changes(alpha0=1e9, theta0=1e9, lambda_rule="fixed:1", discount=1)
    steps = rules.compare({"one": Fixed(1)}, [0, 1], wild).steps["one"]
    assert steps.shape == (2, 6) and (steps == 60).all()


def test_lambdas_are_drawn_as_often_as_they_were_met_to_two_digits_and_whatever_the_step():
    def drawn():
        return rules.ResampledLambda([0.0, 0.254, 1, 0.246], [8, 1, 5, 6], np.random.default_rng(0))

    one, other = drawn(), drawn()
    values = np.array([one(delta=np.nan, phi=None) for _ in range(4000)])
    for value, share in ((0, 0.4), (0.25, 0.35), (1, 0.25)):
        assert (values == value).mean() == pytest.approx(share, abs=0.03)
        assert (values[1:][values[:-1] == value] == 0).mean() == pytest.approx(0.4, abs=0.06)
    np.testing.assert_array_equal(other.beforehand(4000), values)


# Step sizes and seeds


@pytest.fixture
def driven(monkeypatch):
    """Call it with what an episode takes, of step size, seed and agent: the seeds and step sizes that drove."""
    seen = []

    def instead(steps):
        def pretend(settings, seed, lambda_rule=None, agent=None):
            if settings.controller == "random":
                return Run(settings, seed, np.empty((0, 11)), np.full(settings.episodes, 100), None, 0)
            seen.append((seed, settings.alpha0))
            taken = np.full(settings.episodes, steps(settings.alpha0, seed, agent))
            return Run(settings, seed, np.empty((0, 11)), taken, None, 0)

        monkeypatch.setattr(rules, "run", pretend)
        rules.steps_at_random.cache_clear()
        return seen

    yield instead
    rules.steps_at_random.cache_clear()


def by_halves(alpha0, seed, agent):
    """Steps: of the two step sizes that are best at first, .2 (of the agent .4) is better later, but for one robot."""
    best = 0.4 if agent else 0.2
    early, later = {0.1: (10, 50), best: (20, 2000 if seed == 50 else 44)}.get(alpha0, (30, 1))
    return early if seed < 20 else later


def test_each_drives_with_the_step_size_that_was_best_on_seeds_that_do_not_judge_it(driven):
    seen = driven(by_halves)
    compared = rules.compare(
        {"rule": Fixed(0)}, range(200, 203), agents={"agent": Forwards}, step_sizes=(0.1, 0.2, 0.4)
    )
    assert compared.step_size == {"rule": 0.2, "agent": 0.4}
    assert {size for seed, size in seen if seed < 20} == {0.1, 0.2, 0.4}
    assert sum(20 <= seed < 100 for seed, _ in seen) == 2 * 2 * 80
    assert [one for one in seen if one[0] >= 100] == [(seed, size) for seed in range(200, 203) for size in (0.2, 0.4)]


def test_the_table_says_whether_other_step_sizes_might_be_better_and_when_none_matters(driven):
    driven(lambda alpha0, seed, agent: 101 if agent is Forwards else 10 + 1000 * abs(alpha0 - (0.3 if agent else 0.2)))
    agents = {"agent": RandomAgent, "indifferent": Forwards}
    table = str(rules.compare({"rule": Fixed(0)}, [7, 8], agents=agents, step_sizes=(0.1, 0.2, 0.3), choose=range(6)))
    assert [row.split(" | ")[:2] for row in table.splitlines()] == [
        ["| learner", "step size"],
        ["| ---", "---"],
        ["| rule", "0.2"],
        ["| agent", "0.3, the largest tried"],
        ["| indifferent", "any"],
    ]
    assert [row.split(" | ")[-1] for row in table.splitlines()[2:]] == ["0 |", "0 |", "2 |"]  # chance takes 100 steps


@pytest.mark.parametrize(("agents", "seeds"), [({}, rules.THOUSAND), ({"mine": Forwards}, rules.HUNDRED)])
def test_a_thousand_robots_are_compared_where_all_compile_else_a_hundred_and_it_says_why(agents, seeds, driven, capfd):
    seen = driven(lambda *_: 10)
    rules.compare(FORM_2, agents=agents)
    assert sorted({seed for seed, _ in seen}) == [*seeds]
    assert ("not compiled: mine\n" in capfd.readouterr().err) == bool(agents)


# What is said of them


def test_the_verdict_is_on_the_steps_of_all_episodes_seed_by_seed_against_the_first():
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


@pytest.mark.parametrize(("chance", "lost"), [(None, []), (29.6, ["0", "1"]), (29.5, ["0", "1"]), (19, ["1", "1"])])
def test_the_table_has_total_and_late_steps_as_multiples_of_the_first_and_who_ends_slower_than_chance(chance, lost):
    first = np.array([[9.0, 10], [9, 10], [9, 10], [9, 50]])  # late: 9.5, thrice, and 29.5; the middle half is 9.5
    titles, _, *rows = str(rules.Rules({"a": first, "twice": 2 * first}, chance=chance)).splitlines()
    one, twice = ([cell.strip() for cell in row.strip("|").split("|")] for row in rows)
    assert one == ["a", "29", "1", "", "9.5", "1", "", *lost[:1]]
    assert twice == ["twice", "58", "2.00 [2.00, 2.00]", "more", "19.0", "2.00 [2.00, 2.00]", "more", *lost[1:]]
    assert titles.count("|") == len(one) + 1


def test_the_first_few_seeds_are_what_they_alone_would_say():
    few = rules.compare({"a": Fixed(0.5), "b": Fixed(0)}, range(2), TINY)
    more = rules.compare({"a": Fixed(0.5), "b": Fixed(0)}, range(4), TINY)
    assert str(more.of_first(2)) == str(few)


# Refusals


def text(*, delta, **_):
    return "0.5"


def test_a_mistake_in_a_rule_is_told_whoever_runs_it():
    with pytest.raises(ValueError, match=r"^lambda rule text returned '0.5'; a lambda rule is a function"):
        rules.compare(FORM_2 | {"text": text}, range(4), TINY)


@pytest.mark.parametrize(
    ("rules_", "seeds", "more", "told"),
    [
        (FORM_2, [3], {}, r"seeds = \[3\]: one robot says nothing of how robots differ; give two or more"),
        (FORM_2, 3, {}, r"seeds = 3: must be a list or range of 0, 1, 2, ..."),
        (FORM_2 | {"half": 0.5}, [0, 1], {}, r"half: lambda_rule = 0.5: .*a lambda rule is a function of the keywords"),
        (FORM_2 | {"fast": "fixd:1"}, [0, 1], {}, r"fast: unknown lambda rule 'fixd:1'"),
        (FORM_2, [0, 1], {"agents": {"half": 0.5}}, r"half: an agent is made by a function of settings"),
        (FORM_2, [0, 1], {"agents": {"no rng": lambda settings: None}}, r"no rng: .*too many positional"),
        (FORM_2, [0, 1], {"agents": {"made": RandomAgent(TINY, None)}}, r"made: .*not a callable"),
        (FORM_2, [0, 1], {"agents": {"form 2": RandomAgent}}, r"form 2: .*label of its own"),
        (
            FORM_2,
            [98, 99, 100],
            {"step_sizes": (0.1,)},
            r"seeds = \[98, 99, 100\]: .* on some of them; judge on others",
        ),
        (FORM_2, [5, 6], {"step_sizes": (0.1,), "choose": [6]}, r"seeds = \[5, 6\]: .* on some of them"),
        (FORM_2, [200, 201], {"step_sizes": 0.1}, r"step_sizes = 0.1: must be a list of numbers"),
        (FORM_2, [200, 201], {"step_sizes": (0, 1)}, r"setting alpha0 = 0.0: "),
    ],
)
def test_before_any_run_what_cannot_be_compared_is_refused_in_one_line(rules_, seeds, more, told, monkeypatch):
    monkeypatch.setattr(rules, "run", None)
    with pytest.raises((UserError, TypeError, ValueError), match=f"^{told}") as refusal:
        rules.compare(rules_, seeds, TINY, **more)
    assert "\n" not in str(refusal.value)


def test_of_one_robot_there_is_no_table():
    with pytest.raises(UserError, match=r"^a: 1 seed; one robot .* give two or more$"):
        rules.Rules({"a": FIRST, "b": FIRST}).of_first(1)


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
