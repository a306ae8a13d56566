"""Controls under which a figure is drawn anew, for lessons; and what they draw: one rule on the walk, and on the robot.

Whoever executes a notebook without watching, such as papermill, gets the figure as it is at first.
"""

from collections.abc import Callable
from math import log10
from typing import Any

import ipywidgets
import matplotlib.pyplot as plt
import numpy as np
from IPython.display import display
from matplotlib.figure import Figure

from homing_lib.publish import curves, plans
from homing_lib.rooms import room_named
from homing_lib.settings import Settings
from homing_lib.study import engine, walk

RULES = {
    "fixed": "fixed λ",
    "hestenes-stiefel": "form 1",
    "fletcher-reeves": "form 2",
    "polak-ribiere": "form 3",
    "gate": "gate",
}
"""What `rule` may be, and what it is called."""


def play(draw: Callable[..., Figure], **start: Any) -> None:
    """Show a figure, and controls that draw it anew.

    draw takes `rule`, `lambda_`, `step_size` or some of them; start: their first values. Nothing is returned, since a
    notebook would show that as well.
    """
    controls = {name: control(name, value) for name, value in start.items()}
    figure = draw(**start)
    display(ipywidgets.HBox(list(controls.values())))  # type: ignore[no-untyped-call]
    shown = display(figure, display_id=True)  # type: ignore[no-untyped-call]
    plt.close(figure)  # it is shown, and the end of the cell would show it once more

    def redraw(_: Any) -> None:
        drawn = draw(**{name: control.value for name, control in controls.items()})
        shown.update(drawn)
        plt.close(drawn)

    for each in controls.values():
        each.observe(redraw, "value")


def control(name: str, value: Any) -> Any:
    """The widget for `rule`, `lambda_` or `step_size`, with its first value; a step size ranges over two decades."""
    if name == "rule":
        choices = [(label, rule) for rule, label in RULES.items()]
        return ipywidgets.Dropdown(options=choices, value=value, description="rule")
    slider: dict[str, Any] = {"continuous_update": False, "style": {"description_width": "initial"}}
    if name == "lambda_":
        return ipywidgets.FloatSlider(value, min=0, max=1, step=0.05, description="λ, or guard", **slider)
    ends = {"min": log10(value) - 1, "max": log10(value) + 1, "step": 0.1}
    return ipywidgets.FloatLogSlider(value, **ends, description="step size", readout_format=".2g", **slider)


def setting(rule: str, lambda_: float) -> str:
    """The rule as settings name it. lambda_: the fixed one, or its guard, where another rule divides by zero."""
    return f"{rule}:{lambda_:g}" if rule == "fixed" else f"{rule}:on_zero={lambda_:g}"


REFERENCE = 0.8, 0.3
"""Lambda and step size of what `on_the_walk` draws for comparison: about the best of the fixed ones."""

TOP = 0.7
"""Greater errors are drawn as this one."""


def on_the_walk(rule: str, lambda_: float, step_size: float) -> Figure:
    """How a rule learns to predict the random walk, beside a good fixed λ: the error by episode, of ten seeds."""
    label = f"λ = {lambda_:g}" if rule == "fixed" else f"{RULES[rule]}, guard {lambda_:g}"
    chosen, reference = (
        np.array([walk.learning(name, seed, size) for seed in range(10)])
        for name, size in ((setting(rule, lambda_), step_size), (setting("fixed", REFERENCE[0]), REFERENCE[1]))
    )
    title = (
        f"Mean error {chosen.mean():.2g} with {label}, step size {step_size:.2g}; "
        f"{reference.mean():.2g} with λ = {REFERENCE[0]:g}, step size {REFERENCE[1]:g}"
    )
    tables = {label: np.minimum(chosen, TOP), "for comparison": np.minimum(reference, TOP)}
    return curves.by_episode(title, tables, f"error, drawn up to {TOP:g}")


def on_the_robot(rule: str, lambda_: float, step_size: float) -> Figure:
    """Five episodes of one run of the robot: its ways home on the compact atlas."""
    settings = Settings(images="compact", lambda_rule=setting(rule, lambda_), alpha0=step_size)
    run = engine.run(settings, seed=1)
    ways = []
    for number in (1, 2, 5, 10, 20):
        finished = number <= len(run.lengths)
        path = run.episode(number)[:, :2] if finished else np.empty((0, 2))
        ways.append((f"episode {number}: {f'{len(path)} steps' if finished else 'diverged'}", path))
    return plans.paths({"one run": ways}, room_named(settings.room))
