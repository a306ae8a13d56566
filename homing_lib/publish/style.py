"""The one look of all figures: the style sheet, the colours, and how a thing is marked.

Colours are Okabe and Ito's, which the colour-blind tell apart; lines differ in dashes and marks in shape as well, for
grey prints.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import matplotlib.pyplot as plt

SHEET = Path(__file__).with_name("homing.mplstyle")
TEXT_WIDTH = 6.3  # inches, of the report

BLUE, ORANGE, GREEN, SKY, GREY, INK = "#0072B2", "#D55E00", "#009E73", "#56B4E9", "#8A8A8A", "#222222"
PINK, AMBER, VIOLET, BROWN, PLUM = "#CC79A7", "#E69F00", "#7A5195", "#6B4E16", "#AA3377"

_DASHES = "-", (0, (4, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (2, 1)), (0, (8, 2)), "-"
LINES = tuple(zip((BLUE, ORANGE, GREEN, INK, PINK, GREY, SKY), _DASHES, strict=True))
"""Colours and dashes of several curves in one panel, in order."""

COLOURS = {
    "form 2": BLUE,
    "camera": VIOLET,
    "learning on": SKY,
    "frozen": AMBER,
    "extension": GREEN,
    "climb": GREY,
    "random": INK,
    "standard": BROWN,
    "PPO": ORANGE,
    "DQN": PINK,
    "simple": PLUM,
}
"""One for each thing, in all figures."""

DASHED: dict[str, Any] = {"color": INK, "linestyle": (0, (5, 2)), "linewidth": 0.8}
"""A level that something is held against."""


class Look(NamedTuple):
    """How a thing is marked: colour, matplotlib's marker, and whether that is full or hollow."""

    colour: str
    marker: str = "o"
    full: bool = True

    def line(self, size: float, dashes: Any = "") -> dict[str, Any]:
        """Its properties as a `Line2D`, without a line unless there are dashes. size: of the marker, in points."""
        face = self.colour if self.full else "white"
        return dict(color=self.colour, marker=self.marker, markerfacecolor=face, markersize=size, linestyle=dashes)


SHAPES = {"fewer": ("o", True), "more": ("s", True), "the same": ("D", True), "undecided": ("D", False)}
"""Marker, and whether it is full, by the word that an interval allows: what is hollow is undecided."""


def shown_as(word: str, colour: str = INK) -> Look:
    """How a number is marked by its word; a disc where none was asked."""
    return Look(colour, *SHAPES.get(word, ("o", True)))


@contextmanager
def house_style(changes: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Within it matplotlib's own defaults hold, our sheet and these changes, whatever a user's matplotlibrc says."""
    with plt.style.context(["default", SHEET, dict(changes or {})]):
        yield
        interactive = plt.isinteractive()
    # The first figure loads the backend. A notebook's then switches interactive mode on, without which it shows nothing
    # more; leaving the context has switched it off again.
    matplotlib.interactive(interactive)


styled = house_style()
"""For a function that draws a figure: in our style, and at no cost to anyone else's."""
