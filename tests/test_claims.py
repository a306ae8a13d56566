"""A claim is judged by its predicate, and by nothing else."""

import numpy as np
import pandas as pd

from homing_lib.study import claims, studies
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


ALIKE = {rule: LEARNS for rule in studies.RULES}


def test_a_run_that_diverged_is_lost():
    of = table(ALIKE)
    of.loc[(of.condition == "fixed 1") & (of.episode > 3), ["change", "diverged"]] = np.nan, 1
    assert claims.lost(of, "fixed 1") == SEEDS
    assert claims.lost(of, "fixed 0") == 0


def test_a_finding_is_told_in_a_paragraph_and_every_judged_claim_in_a_row():
    of_the_paper = claims.names("C")
    told = str(Finding("C9", "not shown", "It differs by 1 [-2, 4]."))
    assert told.startswith(
        "**Claim C9**, a kidnapped robot recovers at once: **not shown**. It differs by 1 [-2, 4].\n"
    )
    rows = claims.table(of_the_paper).splitlines()
    assert len(rows) == 2 + len(of_the_paper)
    assert f"| C2 | {CLAIMS['C2'].text} | **{claims.judge('C2').verdict}** | " in "\n".join(rows)


def test_a_claim_or_a_question_is_added_by_its_judge_alone(monkeypatch):
    for name in ("C99", "Q99"):
        monkeypatch.setitem(CLAIMS, name, None)  # so that it goes again

    @claims.claim("C99", "robots fly")
    def flight():
        return "not shown", "None did."

    @claims.claim("Q99", "should they?", studies.SHORTEST)
    def better_not(_):
        """No, if {EPISODES} of
        them fell.
        """
        return "no", "It is dangerous."

    assert claims.judge("C99") == Finding("C99", "not shown", "None did.")
    assert claims.table(["C99"]).splitlines()[-1] == "| C99 | robots fly | **not shown** | None did. |"
    assert str(claims.judge("Q99")).split("\n\n") == [
        "**Question Q99**, should they?: **no**. It is dangerous.",
        f"> *Predicate*: No, if {EPISODES} of them fell. Tables: shortest (seeds 1000-1009).",
    ]
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
