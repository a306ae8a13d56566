"""Notebooks 3 and 4 as lessons: controls draw anew, and each exercise knows a right answer and the usual wrong ones."""

from functools import partial

import ipywidgets
import numpy as np
import pytest
from matplotlib.figure import Figure

from homing_lib import lambdas
from homing_lib.publish import exercises, figures, plots, widgets
from homing_lib.study import measures, walk

# Controls


class Display:
    """Stands in for IPython's `display`: what was shown, and what it was replaced by."""

    def __init__(self):
        self.shown, self.updates = [], []

    def __call__(self, what, display_id=False):
        self.shown.append(what)
        return self if display_id else None

    def update(self, what):
        self.updates.append(what)


@pytest.fixture
def page(monkeypatch):
    monkeypatch.setattr(widgets, "display", page := Display())
    return page


def test_under_the_controls_stands_the_figure_of_their_first_values(page):
    figure, asked = Figure(), []
    assert widgets.play(lambda **values: asked.append(values) or figure, lambda_=0.5, step_size=0.3) is figure
    assert asked == [{"lambda_": 0.5, "step_size": pytest.approx(0.3)}]
    box, below = page.shown
    assert isinstance(box, ipywidgets.HBox)
    assert below is figure
    assert page.updates == []


def test_each_control_draws_the_figure_anew_with_the_values_of_all(page):
    drawn = []
    widgets.play(lambda **values: drawn.append(values) or Figure(), rule="fixed", lambda_=0.5, step_size=0.3)
    rule, lambda_, step_size = page.shown[0].children
    rule.value, lambda_.value, step_size.value = "gate", 0.75, 0.03
    assert drawn[-1] == {"rule": "gate", "lambda_": 0.75, "step_size": pytest.approx(0.03)}
    assert len(drawn) == 4
    assert len(page.updates) == 3


@pytest.mark.parametrize("rule", widgets.RULES)
def test_every_rule_on_offer_is_one_that_settings_know_and_has_lambda_or_a_guard(rule):
    choice = lambdas.parse(widgets.setting(rule, 0.5))
    assert choice.rule(
        delta=1.0, phi=np.ones(1), delta_prev=4.0, phi_prev=np.ones(1), trace_prev=np.ones(1), discount=1
    )
    assert (choice.rule == lambdas.Fixed(0.5)) if rule == "fixed" else choice.on_zero == 0.5


def drawn_by(monkeypatch, module, name):
    """The arguments with which a plot is called."""
    seen, plot = [], getattr(module, name)
    monkeypatch.setattr(module, name, lambda *given, **how: seen.append(given) or plot(*given, **how))
    return seen


def test_on_the_walk_the_chosen_rule_stands_beside_the_same_reference(monkeypatch):
    seen = drawn_by(monkeypatch, plots, "curves")
    monkeypatch.setattr(walk, "learning", lambda rule, seed, size: np.full(10, np.inf if size > 1 else size))
    assert isinstance(widgets.on_the_walk("fletcher-reeves", 0.8, 0.1), Figure)
    widgets.on_the_walk("fixed", 1.0, 2.0)
    ((title, tables),), ((lost, capped),) = (panels.items() for panels, *_ in seen)
    assert title == "Mean error 0.1 with form 2, guard 0.8, step size 0.1; 0.3 with λ = 0.8, step size 0.3"
    assert {name: (table.shape, table.mean().round(3)) for name, table in tables.items()} == {
        "form 2, guard 0.8": ((10, 10), 0.1),
        "for comparison": ((10, 10), 0.3),
    }
    assert lost.startswith("Mean error inf with λ = 1, step size 2;")
    assert capped["λ = 1"].max() == 0.7


def test_on_the_robot_episodes_that_were_not_finished_are_named(monkeypatch):
    seen = drawn_by(monkeypatch, figures, "paths")
    widgets.on_the_robot("fletcher-reeves", 0.0, 1.25e-3)
    widgets.on_the_robot("fixed", 1.0, 1.25e-2)
    home, lost = (rows["one run"] for rows, _ in seen)
    assert [label.split(":")[0] for label, _ in home] == [f"episode {number}" for number in (1, 2, 5, 10, 20)]
    assert all(label.endswith(f": {len(way)} steps") for label, way in home)
    assert [label for label, _ in lost][-1] == "episode 20: weights lost"


# Exercises


RIGHT_AND_WRONG = [
    (exercises.late_steps, lambda run: measures.by_episode([run])[0, -5:].mean(), "proven"),
    (exercises.late_steps, lambda run: run.lengths[-5:].mean(), "makes it look good"),
    (exercises.late_steps, lambda run: run.lengths[:5].mean(), "first five episodes"),
    (exercises.late_steps, lambda run: run.lengths.mean(), "all episodes"),
    (exercises.late_steps, lambda run: run.lengths[-4:].mean(), "the last four"),
    (exercises.late_steps, lambda run: run.lengths[-5:].sum(), "the sum, not the mean"),
    (exercises.late_steps, lambda run: 0.0, "of 8 planned, give"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower <= nrb) & (nrb < psi.upper)), "proven"),
    (exercises.share_in_band, lambda nrb, psi: np.sum((psi.lower <= nrb) & (nrb < psi.upper)), "not their share"),
    (exercises.share_in_band, lambda nrb, psi: np.mean(psi.lower <= nrb), "the upper threshold?"),
    (exercises.share_in_band, lambda nrb, psi: np.mean(nrb < psi.upper), "the lower threshold?"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower <= nrb) & (nrb <= psi.upper)), "the robot is home"),
    (exercises.share_in_band, lambda nrb, psi: np.mean((psi.lower < nrb) & (nrb < psi.upper)), "that step counts"),
    (exercises.share_in_band, lambda nrb, psi: 0.5, "count."),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: delta / delta_prev / discount, "proven"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: delta / delta_prev, "γ is missing"),
    (
        exercises.on_orthogonal_features,
        lambda delta, delta_prev, discount: discount * delta / delta_prev,
        "denominator",
    ),
    (
        exercises.on_orthogonal_features,
        lambda delta, delta_prev, discount: delta_prev / delta / discount,
        "upside down",
    ),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: (delta / delta_prev) ** 2, "That is β"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: -delta / delta_prev / discount, "sign"),
    (exercises.on_orthogonal_features, lambda delta, delta_prev, discount: 1.0, "With errors"),
]


@pytest.mark.parametrize(("check", "answer", "told"), RIGHT_AND_WRONG)
def test_an_exercise_proves_the_right_answer_and_names_each_usual_mistake(check, answer, told):
    outcome = check.judge(answer)
    assert outcome.verdict == ("proven" if told == "proven" else "wrong")
    assert told in f"{outcome.verdict} {outcome.told}"


@pytest.mark.parametrize(
    ("rule", "told"),
    [
        (lambda *, delta, delta_prev, **_: 0.8 if delta * delta_prev >= 0 else 0.4, "better"),
        (lambda **_: 0.8, "1.00 [1.00, 1.00] (mean 1.00 [1.00, 1.00]) of that of λ = 0.8: comparable."),
        (lambda *, delta, delta_prev, **_: 0.9 if delta * delta_prev > 0 else 0.0, "it forgets the whole trace"),
        (lambda *, delta, delta_prev, **_: abs(delta / delta_prev), "it divides by zero, and λ is 0"),
        (lambda **_: 1, "it keeps the whole trace"),
        (lambda **_: 0.2, "it keeps 0.2"),
    ],
)
def test_a_rule_that_loses_hears_what_it_does_where_nothing_is_learnt_yet_and_a_tie_counts(rule, told, monkeypatch):
    sizes = {"choose": range(2), "judge": range(1000, 1010), "step_sizes": (0.2, 0.4, 0.6)}
    monkeypatch.setattr(walk, "race", partial(walk.race, **sizes))
    outcome = exercises.as_good_as_a_constant.judge(rule)
    assert outcome.verdict == ("wrong" if ", it " in outcome.told else "proven")
    assert told in outcome.told
