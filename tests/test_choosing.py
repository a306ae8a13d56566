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


CANDIDATES = [of(rule, alpha) for rule in RULES for alpha in SIZES]


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
    assert [*choice.first().conditions.values()] == CANDIDATES
    best = [("fixed:0", 0.002), ("fixed:0", 0.001), ("fixed:0.5", 0.004), ("fixed:0.5", 0.001)]
    assert [*choice.second().conditions.values()] == [of(*one) for one in best]
    assert (list(choice.first().seeds), list(choice.second().seeds)) == ([0, 1], [2, 3])
    like = [of(rule, 0.1) for rule in RULES]
    assert [choice.best(one) for one in like] == [of("fixed:0", 0.001), of("fixed:0.5", 0.004)]
    assert [choice.score(one) for one in like] == [12, 61]
    robots = choice.robots(like[0])
    assert (robots.seed.tolist(), robots.cut.tolist()) == ([2, 3], [11, 13])


def test_candidates_compete_that_are_alike_but_for_the_step_size_unless_grouped_otherwise(scores):
    assert choosing.but_for_the_step_size(of("fixed:0", 0.1)) == choosing.but_for_the_step_size(of("fixed:0", 0.2))
    for changes in ({"lambda_rule": "fixed:0.5"}, {"update": "all"}, {"theta0": 0.5}):
        other = of("fixed:0", 0.1).with_changes(**changes)
        assert choosing.but_for_the_step_size(other) != choosing.but_for_the_step_size(of("fixed:0", 0.1))
    scores["chosen"] = scores["chosen-best"] = {("fixed:0.5", 0.004): [1, 1]}
    of_all = chosen(group=lambda settings: "all", keep=3)
    assert len(of_all.second().conditions) == 3
    assert of_all.best(of("fixed:0", 0.1)) == of("fixed:0.5", 0.004)


def test_a_choice_is_made_after_what_it_needs_and_its_candidates_then(scores):
    asked = []
    before = studies.study("before", "Is needed.", {"all": Settings()}, range(2))
    choice = chosen(lambda: asked.append(True) or CANDIDATES, needs=[before])
    assert asked == []
    assert (choice.first.needs, choice.second.needs) == ([before], [choice.first])
    assert [study.name for study in studies.in_order()] == ["before", "chosen", "chosen-best"]


def test_without_its_tables_nothing_is_chosen(monkeypatch, tmp_path):
    monkeypatch.setattr(studies, "LISTED", {})
    monkeypatch.setattr(runs, "DATA", tmp_path)
    with pytest.raises(UserError, match=r"chosen\.parquet: missing"):
        chosen().best(CANDIDATES[0])
