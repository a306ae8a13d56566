"""By halving, the fewest steps choose, an episode cut where one lost robot would decide."""

import pandas as pd
import pytest

from homing_lib.errors import UserError
from homing_lib.settings import Settings
from homing_lib.study import choosing, findings, runs, studies
from homing_lib.study.choosing import Choice

findings.questions()  # lest their studies be listed while another list is in its place

SIZES = (0.001, 0.002, 0.004)
RULES = ("fixed:0", "fixed:0.5")


def of(rule, alpha):
    return Settings(images="compact", lambda_rule=rule, alpha0=alpha)


CANDIDATES = {rule: [of(rule, alpha) for alpha in SIZES] for rule in RULES}


@pytest.fixture
def scores(monkeypatch):
    """Tables are what is written here: by study, rule and step size the `cut` of each seed; `total` says the contrary.

    A candidate that is not named takes 100.
    """
    monkeypatch.setattr(studies, "LISTED", {})
    by_study = {"chosen": {}, "chosen-best": {}}

    def load_table(study):
        rows = []
        for label, one in study.conditions.items():
            cuts = by_study[study.name].get((one.lambda_rule, one.alpha0), [100, 100])
            for seed, cut in zip(study.seeds, cuts, strict=True):
                rows.append({"condition": label, "seed": seed, "cut": cut, "total": 1e6 - cut})
        return pd.DataFrame(rows).astype({"condition": "category"})[::-1]

    monkeypatch.setattr(choosing, "load_table", load_table)
    return by_study


def chosen(candidates=CANDIDATES, **options):
    return Choice("chosen", "Which?", candidates, seeds=range(2), then=range(2, 4), **options)


def test_the_best_of_each_group_go_on_and_the_best_of_these_on_other_seeds_is_chosen(scores):
    scores["chosen"] = {
        ("fixed:0", 0.001): [10, 30],
        ("fixed:0", 0.002): [10, 20],
        ("fixed:0", 0.004): [50, 50],
        ("fixed:0.5", 0.001): [90, 90],
        ("fixed:0.5", 0.002): [5, 500],
        ("fixed:0.5", 0.004): [80, 80],
    }
    scores["chosen-best"] = {
        ("fixed:0", 0.001): [11, 13],
        ("fixed:0", 0.002): [15, 15],
        ("fixed:0.5", 0.001): [70, 71],
        ("fixed:0.5", 0.004): [60, 62],
    }
    choice = chosen()
    assert [*choice.first.conditions.values()] == [of(rule, alpha) for rule in RULES for alpha in SIZES]
    best = [("fixed:0", 0.002), ("fixed:0", 0.001), ("fixed:0.5", 0.004), ("fixed:0.5", 0.001)]
    assert [*choice.second.conditions.values()] == [of(*one) for one in best]
    assert (list(choice.first.seeds), list(choice.second.seeds)) == ([0, 1], [2, 3])
    assert [choice.best(rule) for rule in RULES] == [of("fixed:0", 0.001), of("fixed:0.5", 0.004)]
    assert [choice.score(rule) for rule in RULES] == [12, 61]
    robots = choice.robots("fixed:0")
    assert (robots.seed.tolist(), robots.cut.tolist()) == ([2, 3], [11, 13])


def test_whoever_is_in_a_group_competes_and_as_many_go_on_as_shall(scores):
    scores["chosen"] = scores["chosen-best"] = {("fixed:0.5", 0.004): [1, 1]}
    of_all = chosen({"all": [one for several in CANDIDATES.values() for one in several]}, keep=3)
    assert len(of_all.second.conditions) == 3
    assert of_all.best("all") == of("fixed:0.5", 0.004)


def test_who_is_in_two_groups_drives_once_and_competes_in_both(scores):
    scores["chosen"] = scores["chosen-best"] = {("fixed:0", 0.002): [1, 1], ("fixed:0.5", 0.004): [2, 2]}
    both = chosen(CANDIDATES | {"all": [of("fixed:0.5", 0.004), of("fixed:0", 0.002)]})
    assert len(both.first.conditions) == len(RULES) * len(SIZES)
    assert [both.best(group) for group in ("fixed:0", "fixed:0.5", "all")] == [
        of("fixed:0", 0.002),
        of("fixed:0.5", 0.004),
        of("fixed:0", 0.002),
    ]


def test_a_choice_is_made_after_what_it_needs_and_its_candidates_then(scores):
    asked = []
    before = studies.study("before", "Is needed.", {"all": Settings()}, range(2))
    choice = chosen(lambda: asked.append(True) or CANDIDATES, needs=[before])
    assert (choice.first.needs, choice.second.needs) == ([before], [choice.first])
    assert [study.name for study in studies.in_order()] == ["before", "chosen", "chosen-best"]
    assert asked == []
    assert choice.best("fixed:0") in choice.first.conditions.values()
    assert asked == [True]


def test_without_its_tables_nothing_is_chosen(monkeypatch, tmp_path):
    monkeypatch.setattr(studies, "LISTED", {})
    monkeypatch.setattr(runs, "DATA", tmp_path)
    with pytest.raises(UserError, match=r"chosen\.parquet: missing"):
        chosen().best("fixed:0")
