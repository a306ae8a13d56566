"""The plots of the studies are functions of their data, awkward data included."""

import matplotlib

matplotlib.use("Agg")
import numpy as np
import pytest
from matplotlib.text import Text

from homing_lib.publish import figures, plots
from homing_lib.publish.forests import Column, compared, first_to_last, forest
from homing_lib.rooms import ROOMS
from homing_lib.study import theorem
from homing_lib.study.claims import Comparison
from homing_lib.study.rules import Rules
from homing_lib.study.statistics import Interval

RNG = np.random.default_rng(3)
RUNS = RNG.uniform(20, 200, (6, 20))
CAPPED = np.where(np.arange(20) > 15, 2000.0, RUNS)  # what runs that diverged leave
FOUND = {"one": Interval(2, 1, 3), "two": Interval(0, -1, 1), "three": Interval(-2, -3, -1)}
SHARES = {name: Interval(0.5, 0.4, 0.6) for name in ("one", "three")}  # none for two
COMPARED = {
    "faster": Comparison(Interval(0.5, 0.4, 0.6), Interval(0.6, 0.5, 0.7)),
    "slower": Comparison(Interval(2.0, 1.5, 2.5), Interval(3.0, 2.0, 4.0)),
    "typically slower": Comparison(Interval(2.0, 1.5, 2.5), Interval(1.2, 0.8, 1.6)),
    "the same": Comparison(Interval(1.0, 0.9, 1.1), Interval(1.0, 0.9, 1.1)),
}
FIRST_AND_LAST = {
    "falls": (RUNS[:, 0] + 300, RUNS[:, 0]),
    "rises": (RUNS[:, 0], RUNS[:, 0] + 300),
    "stays": (RUNS[:, 0], RUNS[:, 0]),
}
X, Y = (values.ravel() for values in np.meshgrid(np.arange(0.05, 1, 0.1), np.arange(0.05, 1, 0.1)))

PLOTS = {
    "depth": lambda: plots.trace_depth({"a": np.tril(RUNS[:, :6] / 200), "b": np.eye(6)}),
    "parting": lambda: plots.parting(
        {"a": theorem.parting(np.random.default_rng(0).normal(size=(13, 3)), np.ones(12))}
    ),
    "step sizes": lambda: plots.over_step_sizes(
        np.array([0.1, 0.2, 0.4]), {"a": RUNS[:, :3], "b": np.where([0, 0, 1], np.inf, RUNS[:, :3])}, "error", 300
    ),
    "curves": lambda: plots.curves({"one": {"a": RUNS, "b": CAPPED}, "two": {"a": RUNS}}, "steps"),
    "curves with a level": lambda: plots.curves({"": {"a": RUNS}}, "steps", levels={"least": 20}),
    "curves of different kinds": lambda: plots.curves({"one": {"a": RUNS}, "two": {"a": RUNS}}, ("steps", "m")),
    "curves about zero": lambda: plots.curves({"": {"a": -RUNS, "b": RUNS}}, "ahead", levels={"even": 0}, log=False),
    "forest": lambda: forest(Column("difference", FOUND, 0.0), shared=True),
    "forest of columns": lambda: forest(
        Column("all", FOUND, also={"one": 2.5}), Column("p", SHARES, 0.5), ylabel="row"
    ),
    "forest, log": lambda: forest(Column("steps", SHARES, log=True, text=".2f")),
    "forest with a title": lambda: forest(Column("all", FOUND, 0.0), Column("p", SHARES, 0.5), title="yes"),
    "forest of comparisons": lambda: forest(compared("steps", COMPARED)),
    "first to last": lambda: first_to_last({"": {"a": (RUNS[:, 0], RUNS[:, 1])}}, ("random actions", 100)),
    "panels of first to last": lambda: first_to_last(
        {"one": FIRST_AND_LAST, "two": {"else": (RUNS[:, 0], RUNS[:, 1])}}
    ),
    "potential": lambda: figures.potential_trace(RUNS[0], np.append(0.0, -1 / np.arange(1, 20))),
    "forest of many comparisons": lambda: forest(*[compared("a", COMPARED, key=False)] * 5, shared=True),
    "rules": lambda: plots.rules(Rules({"form 2": RUNS, "mine": 2 * RUNS, "lost": CAPPED})),
    "heat map": lambda: plots.heat_map(["a", "b"], ["1", "2"], RUNS[:2, :2], {(0, 1): "3 diverged"}),
    "responses": lambda: plots.responses(
        np.arange(3.0), {"a": np.array([0.0, np.nan, 1.0]), "b": np.zeros(3)}, "ratio", "lambda"
    ),
    "explained": lambda: plots.explained(
        {name: {"one": 1.0, "two": 2.0, "three": 3.0} for name in "abcde"}, FOUND, "ratio"
    ),
    "marginals": lambda: plots.marginals({"alpha": {"1": RUNS[0], "2": RUNS[1]}}, {"alpha": "1"}, 2000),
    "lattices": lambda: plots.lattice_errors({"a": RUNS[0] / 1e4, "b": RUNS[1] / 1e4}, 0.004),
    "room": lambda: plots.over_room({"a": (X, Y, X), "b": (X, Y, Y)}, ROOMS["paper"], "share"),
    "stops": lambda: plots.stops_by_heading(
        {"one": {"a": (np.arange(-90, 91, 90), np.array([9.0, 0, 9])), "b": (np.arange(-90, 91, 90), np.zeros(3))}},
        {"one": 0.5},
    ),
    "rooms": lambda: plots.over_room({"a": (X, Y, X), "b": (X, Y, Y)}, [ROOMS["paper"], ROOMS["attic"]], "share"),
    "light": lambda: plots.similarity_by_light(np.linspace(0.8, 1.2, 9), 1 - abs(np.linspace(-0.2, 0.2, 9)), 0.9),
}


def marks(axes) -> list[tuple[str, bool]]:
    """Shape, and whether it is filled, of each row."""
    lines = [line for line in axes.lines if line.get_marker() in "osD" and len(line.get_xdata())]
    return [(line.get_marker(), line.get_markerfacecolor() != "white") for line in lines]


def test_an_interval_is_marked_by_the_side_of_the_reference_on_which_all_of_it_lies():
    worse, unsettled, better = ("s", True), ("D", False), ("o", True)
    (axes,) = forest(Column("difference", FOUND, 0.0)).axes
    assert marks(axes) == [worse, unsettled, better]
    (axes,) = forest(Column("success", FOUND, 0.0, more=True)).axes
    assert marks(axes) == [better, unsettled, worse]


def test_a_comparison_is_marked_and_named_and_counted_by_its_own_word():
    (axes,) = forest(compared("steps", COMPARED)).axes
    assert marks(axes) == [("o", True), ("s", True), ("D", False), ("D", True)]
    words = [text.get_text().rsplit(" ", 1)[1] for text in axes.texts]
    assert words == [found.word for found in COMPARED.values()] == ["better", "worse", "open", "comparable"]
    assert axes.get_title(loc="left") == "1 better, 1 worse, 1 comparable, 1 open"


def test_first_and_last_episodes_are_a_ring_and_a_mark_whose_title_counts_those_that_take_fewer():
    (axes,) = first_to_last({"here": FIRST_AND_LAST}).axes
    ring = ("o", False)
    assert marks(axes) == [ring, ("o", True), ring, ("s", True), ring, ("D", True)]
    assert axes.get_title(loc="left") == "here: 1 of 3 take fewer"


def test_the_title_of_the_potential_says_how_much_more_it_pays_than_the_reward():
    upper, _ = figures.potential_trace(np.array([10.0, 14.0, 10.0, 14.0]), np.array([-1.0, -0.5, -0.5, -0.25])).axes
    assert "pays 8 times as much" in upper.get_title(loc="left")


def test_a_short_logarithmic_axis_has_more_than_one_number_though_it_is_narrow():
    one, other = forest(*[Column("ratio", {"a": Interval(1.0, 0.8, 1.3)}, 1.0, log=True)] * 2).axes
    for axes in (one, other):
        low, high = axes.get_xlim()
        assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 3


def test_rules_are_drawn_against_the_first_by_the_words_of_their_table():
    found = Rules({"form 2": RUNS, "same": RUNS, "slow": 3 * RUNS})
    learning, against = plots.rules(found).axes
    assert [text.get_text() for text in learning.texts] == ["form 2", "same", "slow"]
    assert [label.get_text() for label in against.get_yticklabels()] == ["same", "slow"]
    assert [verdict.word for verdict in found.verdicts.values()] == ["comparable", "worse"]
    assert marks(against) == [("D", True), ("s", True)]
    assert against.get_title(loc="left") == "left of 1: fewer steps"
    assert against.get_xlabel().splitlines() == [
        "late steps / those of form 2",
        "(mark and line: typical; upright bar: mean)",
    ]


def test_panels_of_different_kinds_name_and_scale_their_own_axis():
    figure = plots.curves({"one": {"a": RUNS}, "two": {"a": RUNS / 100}}, ("steps", "metres"))
    assert [axes.get_ylabel() for axes in figure.axes] == ["steps", "metres"]
    assert figure.axes[0].get_ylim()[0] > figure.axes[1].get_ylim()[1]


def test_maps_of_one_figure_share_their_scale():
    figure = plots.over_room({"a": (X, Y, X), "b": (X, Y, 3 * Y)}, ROOMS["paper"], "share")
    one, other, bar = figure.axes
    assert one.collections[0].get_clim() == other.collections[0].get_clim()
    assert bar.get_ylabel() == "share"


def test_an_effect_is_drawn_against_each_property_with_their_rank_correlation():
    rising, falling = {"one": 1.0, "two": 4.0, "three": 5.0}, {"one": 3.0, "two": 2.0, "three": 1.0}
    effect = {"one": Interval(0.5, 0.4, 0.6), "two": Interval(0.9, 0.8, 1.1), "three": Interval(1.2, 1.1, 1.3)}
    axes = [axes for axes in plots.explained({"area": rising, "spread": falling}, effect, "ratio").axes if axes.texts]
    assert [one.get_title(loc="left") for one in axes] == ["rank correlation +1.00", "rank correlation −1.00"]
    assert [text.get_text() for text in axes[0].texts] == ["1", "2", "3"]


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


def test_places_from_which_no_other_view_looks_like_home_are_drawn_at_the_foot():
    turned = np.array([-90.0, 0, 90])
    (axes,) = plots.stops_by_heading({"room": {"rule": (turned, np.array([9.0, 0, 9]))}}, {"room": 0.5}).axes
    assert axes.lines[0].get_ydata().min() == axes.get_ylim()[0] > 0
    assert axes.get_title(loc="left") == "room"


@pytest.mark.filterwarnings("error")
def test_a_curve_that_is_nowhere_low_enough_is_named_nonetheless():
    figure = plots.over_step_sizes(np.array([0.1, 0.2]), {"a": RUNS[:, :2], "b": RUNS[:, :2] + 900}, "error", 300)
    assert [text.get_text() for text in figure.axes[0].texts] == ["a", "b: beyond 300"]
