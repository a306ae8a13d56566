"""Charts of one thing each: thresholds, lambda and its trace, the calibration, who learns with what."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from homing_lib.features import Array
from homing_lib.publish.parts import beside, name_rows, panels
from homing_lib.publish.style import BLUE, COLOURS, GREY, INK, ORANGE, Look, styled
from homing_lib.study.findings import Finding
from homing_lib.study.theorem import Distance


@styled
def threshold_forms(multiplier: Array, linear: Array, square_root: Array, chosen: Mapping[int, float]) -> Figure:
    """The paper's Fig. 3: the threshold against the multiplier in both printed forms, and what one more changes.

    multiplier: consecutive whole numbers; chosen: the thresholds in use by their multipliers.
    """
    figure, (height, rate) = panels(2.4, 2)
    forms = (
        (linear, "$1-(M\\pi)^{-1/2}$", ORANGE, (0, (4, 2)), (0, -5), "top"),
        (square_root, "$1-(\\pi\\sqrt{M})^{-1}$", BLUE, "-", (0, 4), "bottom"),
    )
    for values, name, colour, dashes, offset, side in forms:
        height.plot(multiplier, values, color=colour, linestyle=dashes)
        beside(height, name, (multiplier[-1], values[-1]), offset, ha="right", va=side, color=colour)
        rate.plot(multiplier[1:], np.diff(values), color=colour, linestyle=dashes)
    for number, value in chosen.items():
        height.plot(number, value, "o", color=BLUE, markersize=4)
    used = ",\n".join(f"{value:.4f} at $M$ = {number}" for number, value in sorted(chosen.items(), reverse=True))
    place = min(chosen), min(chosen.values())
    beside(height, f"in use: {used}", place, (0, 7), ha="center", color=BLUE)
    height.set(ylabel="threshold $\\psi$ (similarity)", ylim=(None, 1.06), yticks=np.arange(0.5, 1.01, 0.1))
    times = float(np.mean(np.diff(linear) / np.diff(square_root)))
    middle = multiplier.size // 2
    place = multiplier[middle], np.diff(square_root)[middle - 1]
    beside(rate, f"{times:.2f} times finer", place, (-4, -4), ha="right", va="top", color=BLUE)
    rate.set(ylabel="rise of $\\psi$ from $M-1$ to $M$", yscale="log")
    plt.setp((height, rate), xlabel="multiplier $M$", xlim=(0, multiplier[-1]))
    return figure


@styled
def passing_shares(shares: Mapping[str, float], selective: Sequence[str] = ()) -> Figure:
    """Share of random poses that pass for home, by the reading of sigma^2; those in `selective` stand out."""
    figure, (axes,) = panels(0.42 + 0.3 * len(shares), share=0.8)
    places, percent = np.arange(len(shares))[::-1], 100 * np.array(list(shares.values()))
    colours = [BLUE if name in selective else GREY for name in shares]
    bars = axes.barh(places, percent, height=0.62, color=colours, tick_label=list(shares))
    axes.bar_label(bars, fmt="%.1f %%", padding=4)
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="random poses that pass for home (%)", xlim=(0, 1.12 * max(*percent, 1)))
    if selective:
        passing = " and ".join(f"{100 * shares[name]:.1f} %" for name in selective)
        axes.set_title(f"With σ² as it is used here, {passing} pass for home")
    return figure


@styled
def trace_depth(traces: Mapping[str, Array]) -> Figure:
    """How much of each past step is left in the trace. traces: by rule, shape (steps, past steps), NaN for later."""
    figure, grid = panels(2.35, len(traces), sharey=True)
    for axes, (name, trace) in zip(grid, traces.items(), strict=True):
        edges = np.arange(len(trace) + 1) + 0.5
        shown = axes.pcolormesh(edges, edges, trace.T, vmin=0, vmax=1, cmap="Greys", rasterized=True)
        axes.set(title=name, xlabel="step $t$", aspect="equal")
    grid[0].set_ylabel("past step $k$")
    figure.colorbar(shown, ax=list(grid), label="share of $\\phi_k$ in $e_t$", shrink=0.8)
    return figure


@styled
def distance(forms: Mapping[str, Distance]) -> Figure:
    """How far TD-conj stands from conjugate gradient at each step: by form, without resets of lambda and with them."""
    figure, grid = panels(2.3, len(forms), sharey=True)
    floor = 1e-18
    for axes, (name, apart) in zip(grid, forms.items(), strict=True):
        step = np.arange(1, apart.free.size + 1)
        axes.plot(step, np.maximum(apart.reset, floor), color=ORANGE, linestyle=(0, (4, 1.5)))
        axes.plot(step, np.maximum(apart.free, floor), color=BLUE)
        axes.axvline(apart.first, color=GREY, linewidth=0.8)
        beside(axes, "first reset", (apart.first, 1e-8), (4, 0), rotation=90)
        axes.set(title=name, xlabel="step $t$", yscale="log", ylim=(floor / 3, 1e3), xlim=(1, step[-1]))
        axes.set_xticks(step[:: max(1, step.size // 4)])
    grid[-1].annotate("with resets", (0.97, 0.83), xycoords="axes fraction", ha="right", va="top", color=ORANGE)
    grid[-1].annotate("without resets", (0.97, 0.2), xycoords="axes fraction", ha="right", color=BLUE)
    grid[0].set_ylabel("relative distance from $p_t$")
    return figure


KEPT = {
    "follows conjugate gradient": "until",
    "since the last restart": "restarted",
    "reset to 0": "to_0",
    "reset to 1": "to_1",
}
"""What becomes of a step, and how the finding names it."""


@styled
def conjugate(finding: Finding, lambda_: Array, reset: NDArray[np.bool_]) -> Figure:
    """lambda_t of one episode, its resets marked; and what becomes of the steps of all, by update."""
    figure, (trace, shares) = panels(2.1, 2, width_ratios=[1.7, 1])
    step, blue = np.arange(1, len(lambda_) + 1), COLOURS["form 2"]
    trace.vlines(step, 0, lambda_, color=blue, linewidth=0.9)
    for which, look in ((~reset, Look(blue)), (reset, Look(blue, full=False))):
        trace.plot(step[which], lambda_[which], **look.line(3.5))
    trace.set(xlabel="step of one episode", ylabel="$\\lambda_t$", ylim=(-0.05, 1.08))
    trace.set_title("hollow: reset to 0 or 1")
    for place, name in enumerate(KEPT.values()):
        for update, colour, up in (("taken", INK, -0.15), ("all", GREY, 0.15)):
            value, low, high = (100 * end for end in finding[f"{update}.{name}"].interval)
            shares.barh(place + up, value, 0.28, color=colour)
            shares.hlines(place + up, low, high, color="0.5", linewidth=1)
    name_rows(shares, KEPT)
    shares.set(xlim=(0, 100), xlabel="steps (%)")
    shares.set_title("grey: all weights updated", loc="right")
    return figure


LEARNERS = {"form 2": "form2", "fixed λ": "fixed", "standard": "standard", "standard,\nhome\nmasked": "masked"}


@styled
def matrix(finding: Finding, rooms: Sequence[str]) -> Figure:
    """Total steps, a panel for each room: a column for who learns, a row for whom the model was calibrated for; the
    fewest of each row are bold.
    """
    suits = {"as declared": "declared"} | {name.replace("\n", " "): key for name, key in LEARNERS.items()}
    figure, grid = panels(0.9 + 0.3 * len(suits), len(rooms), sharey=True)
    steps = np.array(
        [
            [[finding[f"matrix.{room}.{row}.{key}.steps"].value for key in LEARNERS.values()] for row in suits.values()]
            for room in rooms
        ]
    )
    scale, middle = LogNorm(steps.min(), steps.max()), np.sqrt(steps.min() * steps.max())
    for axes, room, values in zip(grid, rooms, steps, strict=True):
        axes.pcolormesh(values, norm=scale, cmap="cividis_r", edgecolor="white", linewidth=0.8)
        for (row, column), value in np.ndenumerate(values):
            weight = "bold" if values[row].argmin() == column else "normal"
            colour = "white" if value > middle else INK
            axes.text(column + 0.5, row + 0.5, f"{value:,.0f}", ha="center", va="center", color=colour, weight=weight)
        axes.set_xticks(np.arange(len(LEARNERS)) + 0.5, list(LEARNERS))
        axes.set(title=f"{room}: total steps", ylim=(len(suits), 0), xlabel="who learns (bold: the fewest of a row)")
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    grid[0].set_yticks(np.arange(len(suits)) + 0.5, list(suits))
    grid[0].set_ylabel("calibrated for")
    return figure
