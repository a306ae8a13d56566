"""The controls of notebooks 3 and 4 draw their figure anew, and what they draw says what was chosen."""

from unittest.mock import Mock

import numpy as np
import pytest
from matplotlib.figure import Figure

from homing_lib import lambdas
from homing_lib.publish import curves, plans
from homing_lib.study import walk
from homing_lib.teach import widgets


@pytest.fixture
def display(monkeypatch):
    """Stands in for IPython's: what was shown, and what that was replaced by."""
    monkeypatch.setattr(widgets, "display", display := Mock())
    return display


def test_each_control_draws_the_figure_anew_with_the_values_of_all(display):
    first, draw = Figure(), Mock()
    draw.return_value = first
    assert widgets.play(draw, rule="fixed", lambda_=0.5, step_size=0.3) is None  # what a cell ends with is shown again
    draw.assert_called_once_with(rule="fixed", lambda_=0.5, step_size=0.3)
    (box,), (below,) = (call.args for call in display.call_args_list)
    assert below is first
    display.return_value.update.assert_not_called()
    rule, lambda_, step_size = box.children
    rule.value, lambda_.value, step_size.value = "gate", 0.75, 0.04
    assert draw.call_args.kwargs == {"rule": "gate", "lambda_": 0.75, "step_size": pytest.approx(0.04)}
    assert draw.call_count == 4
    assert display.return_value.update.call_count == 3


def test_a_step_size_may_be_ten_times_smaller_or_greater():
    slider = widgets.control("step_size", 0.3)
    assert (slider.base**slider.min, slider.base**slider.max) == pytest.approx((0.03, 3.0))


@pytest.mark.parametrize("rule", widgets.RULES)
def test_every_rule_on_offer_is_one_that_settings_know_and_has_lambda_or_a_guard(rule):
    choice = lambdas.lambda_spec(widgets.setting(rule, 0.5))
    assert (choice.rule == lambdas.Fixed(0.5)) if rule == "fixed" else choice.on_zero == 0.5


def test_on_the_walk_the_chosen_rule_stands_beside_the_same_reference(monkeypatch):
    monkeypatch.setattr(curves, "by_episode", drawn := Mock(wraps=curves.by_episode))
    monkeypatch.setattr(walk, "learning", lambda rule, seed, size: np.full(10, np.inf if size > 1 else size))
    assert isinstance(widgets.on_the_walk("fletcher-reeves", 0.8, 0.1), Figure)
    widgets.on_the_walk("fixed", 1.0, 2.0)
    (title, tables, _), (lost, capped, _) = (call.args for call in drawn.call_args_list)
    assert title == "Mean error 0.1 with form 2, guard 0.8, step size 0.1; 0.3 with λ = 0.8, step size 0.3"
    assert {name: (table.shape, table.mean().round(3)) for name, table in tables.items()} == {
        "form 2, guard 0.8": ((10, 10), 0.1),
        "for comparison": ((10, 10), 0.3),
    }
    assert lost.startswith("Mean error inf with λ = 1, step size 2;")
    assert capped["λ = 1"].max() == 0.7


def test_on_the_robot_episodes_that_were_not_finished_are_named(monkeypatch):
    monkeypatch.setattr(plans, "paths", drawn := Mock(wraps=plans.paths))
    widgets.on_the_robot("fletcher-reeves", 0.0, 1.25e-3)
    widgets.on_the_robot("fixed", 1.0, 1.25e-2)
    home, lost = (call.args[0]["one run"] for call in drawn.call_args_list)
    assert [label for label, _ in home] == [
        f"episode {number}: {len(way)} steps" for number, (_, way) in zip((1, 2, 5, 10, 20), home, strict=True)
    ]
    assert [label for label, _ in lost][-1] == "episode 20: diverged"
