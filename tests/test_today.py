"""The question `today` can come out either way, and its parts say what they compare."""

import pytest

from homing_lib.settings import Settings
from homing_lib.study import bootstrap
from homing_lib.study.questions import today, varying
from homing_lib.study.studies import ROOMS, labelled
from tests.test_questions import CHOSEN, Chosen, judged, robots


@pytest.fixture(autouse=True)
def few_resamples_and_nothing_to_choose(monkeypatch):
    """Made-up tables leave no doubt that more resamples would settle."""
    bootstrap.draws.cache_clear()
    monkeypatch.setattr(bootstrap, "RESAMPLES", 500)
    monkeypatch.setattr(varying, "CHOICE", CHOSEN[varying, "CHOICE"])
    monkeypatch.setattr(today, "CHOICE", Chosen(lambda group: WHO[group]))
    yield
    bootstrap.draws.cache_clear()


METHODS = today.METHODS
CANDIDATES = today.CHOICE.first.conditions
WHO = {
    (room, method): Settings(images="atlas", room=room, **METHODS[method][0])
    for room in today.IN_ROOMS
    for method in METHODS
}
"""Who stands for a method in a room."""


def tables(late=50.0, **steps):
    """All tables. steps: of a method, in both rooms or by room, where form 2 takes 1000; late: steps of least squares,
    where random actions take 100.
    """

    def taken(_, one):
        (method,) = (method for (_, method), settings in WHO.items() if settings == one)
        said = steps.get(method.replace("-", "_"), 1000.0)
        return said if isinstance(said, float) else said[one.room]

    methods = labelled(WHO.values())
    rules = [
        labelled(
            varying.settings(room, update, rule)
            for update, rule in (("taken", varying.FORM_2), ("all", "fixed:0.5"), ("taken", "fixed:0"))
        )
        for room in today.IN_ROOMS
    ]
    unlearnt = labelled(Settings(room=room, controller=who) for room in ROOMS for who in ("random", "climb"))
    return (
        robots(methods, taken),
        robots(today.CEILING.conditions, lambda *_: 500.0, late=lambda *_: late),
        *(robots(one, lambda _, one: 1000.0 if one.lambda_rule == varying.FORM_2 else 800.0) for one in rules),
        robots(unlearnt, lambda *_: 2000.0),
    )


WORD = "{} of 8 take fewer steps than form 2 in both rooms, {} take more in both"


@pytest.mark.parametrize(
    ("steps", "fewer", "more"),
    [
        ({}, 0, 0),
        ({"tdc": 700.0, "swift_sarsa": 700.0, "true_online": 1400.0}, 2, 1),
        ({"tdc": {"paper": 700.0, "attic": 1400.0}}, 0, 0),
        ({name.replace("-", "_"): 700.0 for name in today.JUDGED}, 8, 0),
        ({name.replace("-", "_"): 1400.0 for name in today.JUDGED}, 0, 8),
    ],
)
def test_today_counts_the_methods_that_are_ahead_in_both_rooms_and_those_behind(steps, fewer, more):
    verdict, found = judged("today", *tables(**steps))
    assert verdict == WORD.format(fewer, more)
    expected = steps.get("tdc", 1000.0)
    for room in today.IN_ROOMS:
        taken = expected if isinstance(expected, float) else expected[room]
        assert found[f"{room}.tdc.total"].value == pytest.approx(taken / 1000)
        assert found[f"{room}.tdc.of standard"].value == pytest.approx(taken / 800)


def test_what_stands_beside_today_decides_nothing():
    verdict, found = judged("today", *tables(late=150.0, **{"bounded form 2": 100.0}))
    assert verdict == WORD.format(0, 0)
    assert found["attic.bounded form 2.total"].verdict == "fewer"
    assert (found["paper.least-squares.lost"].value, found["paper.standard.total"].value) == (1, 0.8)
    assert found["paper.least-squares.total"].value == 0.5


def test_candidates_compete_within_their_room_and_method_and_each_stands_once():
    for method, several in METHODS.items():
        known_as = "step-size-bound" if method == "bounded form 2" else method
        assert {values["controller"].partition(":")[0] for values in several} == {known_as}
    assert {values["lambda_rule"] for values in METHODS["bounded form 2"]} == {varying.FORM_2}
    assert len({*CANDIDATES.values()}) == len(today.IN_ROOMS) * sum(map(len, METHODS.values()))
