"""The plots of the studies are functions of their data, awkward data included."""

import matplotlib

matplotlib.use("Agg")
import numpy as np
import pytest
from matplotlib.text import Text

from homing_lib.publish import charts, plots
from homing_lib.publish.charts import Panel, forest
from homing_lib.rooms import ROOMS
from homing_lib.study import theorem
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison
from homing_lib.study.rules import Rules

RNG = np.random.default_rng(3)
RUNS = RNG.uniform(20, 200, (6, 20))
CAPPED = np.where(np.arange(20) > 15, 2000.0, RUNS)  # what runs that diverged leave
WORDS = {
    "fewer": Comparison(0.5, 0.4, 0.6, "fewer"),
    "more": Comparison(2.0, 1.5, 2.5, "more"),
    "the same": Comparison(1.0, 0.95, 1.05, "the same"),
    "undecided": Comparison(1.0, 0.6, 1.5, "undecided"),
    "": Comparison(1.0, 0.6, 1.5),
}
X, Y = (values.ravel() for values in np.meshgrid(np.arange(0.05, 1, 0.1), np.arange(0.05, 1, 0.1)))
PAPER = ROOMS["paper"]
WAY = RNG.uniform(0.2, 0.8, (9, 11))


class Everything:
    """Stands in for a finding, and has a comparison of any name, now with this word and now with that."""

    def __getitem__(self, name):
        return [*WORDS.values()][sum(name.encode()) % len(WORDS)]


FOUND = Everything()

PLOTS = {
    "depth": lambda: plots.trace_depth({"a": np.tril(RUNS[:, :6] / 200), "b": np.eye(6)}),
    "parting": lambda: plots.parting(
        {"a": theorem.distance_from_cg(np.random.default_rng(0).normal(size=(13, 3)), np.ones(12))}
    ),
    "step sizes": lambda: plots.over_step_sizes(
        np.array([0.1, 0.2, 0.4]), {"a": RUNS[:, :3], "b": np.where([0, 0, 1], np.inf, RUNS[:, :3])}, "error", 300
    ),
    "curves": lambda: plots.curves({"one": {"a": RUNS, "b": CAPPED}, "two": {"a": RUNS}}, "steps"),
    "curves with a level": lambda: plots.curves({"": {"a": RUNS}}, "steps", levels={"least": 20}),
    "curves of different kinds": lambda: plots.curves({"one": {"a": RUNS}, "two": {"a": RUNS}}, ("steps", "m")),
    "curves about zero": lambda: plots.curves({"": {"a": -RUNS, "b": RUNS}}, "ahead", levels={"even": 0}, log=False),
    "forest": lambda: forest(Panel("steps", {"one": [WORDS["more"]], "two": [WORDS[""]]}, 1, True)),
    "forest of panels": lambda: forest(
        *[Panel("steps", {name: [one, WORDS["fewer"]] for name, one in WORDS.items()})] * 3,
        series={"black": "k", "grey": "0.5"},
    ),
    "printed": lambda: charts.printed(FOUND, {"one": {"the letter": "letter"}, "two": {"a": "a", "b": "b"}}),
    "finalists": lambda: charts.finalists({"a": Interval(30, 28, 33)}, {"a": 25.0}),
    "learns": lambda: charts.learns(CAPPED, RUNS, {"random actions": 100}, {10: WORDS["more"]}),
    "drives": lambda: charts.drives(FOUND, {"here": "paper", "there": "cell"}),
    "drives in other ways": lambda: charts.drives(
        FOUND, {"here": "paper"}, {"climb": "a", "greedy": "b", "random": "c"}
    ),
    "stuck": lambda: charts.stuck({"learning on": [WAY], "frozen": [WAY, WAY]}, PAPER, {"all": (WORDS["fewer"],) * 2}),
    "conjugate": lambda: charts.conjugate(FOUND, np.linspace(0, 1, 9), np.arange(9) % 2 > 0),
    "varying": lambda: charts.varying(FOUND),
    "own mean": lambda: charts.own_mean(FOUND),
    "rooms": lambda: charts.rooms(FOUND, [*ROOMS]),
    "matrix": lambda: charts.matrix(FOUND, ["paper", "attic"]),
    "worth": lambda: charts.worth(FOUND, [*ROOMS], (5, 10, 20), {"room": "from the start", "uniform": "from anywhere"}),
    "everywhere": lambda: charts.everywhere(FOUND, [*ROOMS]),
    "maps": lambda: charts.maps({"a": (X, Y, X), "b": (X, Y, Y)}, PAPER, "share"),
    "home": lambda: charts.home(
        *(np.where(RNG.random((11, 11)) < 0.1, np.nan, RNG.uniform(0.5, 1, (11, 11))), PAPER, 0.9),
        *(np.arange(-90.0, 91, 10), np.linspace(0.5, 1, 19), (X, Y, 90 * (X - 0.5))),
    ),
    "rules": lambda: plots.rules(Rules({"form 2": RUNS, "mine": 2 * RUNS, "lost": CAPPED})),
    "marginals": lambda: plots.marginals({"alpha": {"1": RUNS[0], "2": RUNS[1]}}, {"alpha": "1"}, 2000),
    "lattices": lambda: plots.lattice_errors({"a": RUNS[0] / 1e4, "b": RUNS[1] / 1e4}, 0.004),
}


def marks(axes) -> list[tuple[str, bool]]:
    """Shape, and whether it is filled, of each row."""
    lines = [line for line in axes.lines if line.get_marker() in "osD" and len(line.get_xdata())]
    return [(line.get_marker(), line.get_markerfacecolor() != "white") for line in lines]


def test_a_comparison_is_marked_by_its_word_and_the_key_names_the_words_that_are_met():
    figure = forest(Panel("steps", {name: [one] for name, one in WORDS.items()}, 1, True))
    assert marks(figure.axes[0]) == [("o", True), ("s", True), ("D", True), ("D", False), ("o", True)]
    assert [text.get_text() for text in figure.legends[0].texts] == ["fewer", "more", "the same", "undecided"]
    figure = forest(Panel("steps", {"a": [WORDS["more"]]}), series={"one": "k"})
    assert [text.get_text() for text in figure.legends[0].texts] == ["one", "more"]


def test_a_letter_that_learns_is_a_disc_and_one_that_does_not_a_square():
    found = {f"{name}.{kind}": Comparison(50, 40, 60) for name in ("yes", "no") for kind in ("early", "late")}
    found |= {f"yes.of {what}": WORDS["fewer"] for what in ("first", "random")}
    found |= {"no.of first": WORDS["fewer"], "no.of random": WORDS["undecided"]}
    (axes,) = charts.printed(found, {"": {"one": "yes", "two": "no"}}).axes
    assert marks(axes) == [("o", False), ("o", True), ("o", False), ("s", True)]
    chance = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "|"]
    assert chance == [100, 50]  # late steps by their ratio to those of random actions


def test_a_short_logarithmic_axis_has_more_than_one_number_though_it_is_narrow():
    for axes in forest(*[Panel("ratio", {"a": [Comparison(1.0, 0.8, 1.3)]}, 1, True)] * 3).axes:
        low, high = axes.get_xlim()
        assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 3


def test_the_least_of_each_row_of_the_matrix_is_bold():
    panels = {"one": np.array([[3.0, 1.0], [1.0, 2.0]])}
    (axes,) = charts.cells(panels, ["a", "b"], ["x", "y"]).axes
    assert [text.get_text() for text in axes.texts if text.get_weight() == "bold"] == ["1", "1"]
    assert [text.get_position() for text in axes.texts if text.get_weight() == "bold"] == [(1.5, 0.5), (0.5, 1.5)]


def test_rules_are_drawn_against_the_first_by_the_words_of_their_table():
    found = Rules({"form 2": RUNS, "same": RUNS, "slow": 3 * RUNS})
    learning, against = plots.rules(found).axes
    assert [text.get_text() for text in learning.texts] == ["form 2", "same", "slow"]
    assert [label.get_text() for label in against.get_yticklabels()] == ["same", "slow"]
    assert [verdict.verdict for verdict in found.verdicts.values()] == ["the same", "more"]
    assert marks(against) == [("D", True), ("D", True), ("s", True), ("s", True)]  # of all steps, and of the late ones
    assert against.get_title(loc="left") == "left of 1: fewer steps"
    assert against.get_xlabel().splitlines()[0] == "steps / those of form 2"


def test_panels_of_different_kinds_name_and_scale_their_own_axis():
    figure = plots.curves({"one": {"a": RUNS}, "two": {"a": RUNS / 100}}, ("steps", "metres"))
    assert [axes.get_ylabel() for axes in figure.axes] == ["steps", "metres"]
    assert figure.axes[0].get_ylim()[0] > figure.axes[1].get_ylim()[1]


def test_maps_of_one_figure_share_their_scale():
    figure = charts.maps({"a": (X, Y, X), "b": (X, Y, 3 * Y)}, ROOMS["paper"], "share")
    one, other, bar = figure.axes
    assert one.collections[0].get_clim() == other.collections[0].get_clim()
    assert bar.get_ylabel() == "share"


def test_names_at_the_ends_of_curves_do_not_overlap():
    figure = plots.curves({"": {name: RUNS for name in ("a", "b", "c")}}, "steps")
    figure.canvas.draw()
    boxes = [Text.get_window_extent(text) for text in figure.axes[0].texts]
    assert len(boxes) == 3
    assert not any(one.overlaps(other) for one in boxes for other in boxes if one is not other)


def test_names_stand_beside_curves_that_end_below_zero():
    (axes,) = plots.curves({"": {"down": -RUNS, "up": RUNS}}, "ahead", log=False).axes
    axes.figure.canvas.draw()
    ends = {text.get_text(): Text.get_window_extent(text) for text in axes.texts}
    middle = axes.transData.transform((1, 0))[1]
    assert ends["down"].y1 < middle < ends["up"].y0


@pytest.mark.filterwarnings("error")
def test_a_curve_that_is_nowhere_low_enough_is_named_nonetheless():
    figure = plots.over_step_sizes(np.array([0.1, 0.2]), {"a": RUNS[:, :2], "b": RUNS[:, :2] + 900}, "error", 300)
    assert [text.get_text() for text in figure.axes[0].texts] == ["a", "b: beyond 300"]
