"""What is drawn is what was found: marks, curves and words of the figures, on numbers that fit in a hand."""

from types import SimpleNamespace

import matplotlib

matplotlib.use("Agg")
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from homing_lib.publish import charts, curves, forests, parts, plans
from homing_lib.publish.forests import Panel, forest
from homing_lib.publish.style import AMBER, BLUE, INK, TEXT_WIDTH
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.study import theorem
from homing_lib.study.bootstrap import Interval
from homing_lib.study.findings import Comparison

# Warnings are errors, but of files that an earlier test left to the garbage collector.
pytestmark = pytest.mark.filterwarnings("error", "ignore::ResourceWarning")

RNG = np.random.default_rng(3)
RUNS = RNG.uniform(20, 200, (6, 20))
LOST = np.where(np.arange(20) > 15, np.nan, RUNS)  # what runs that diverged leave
WAY = RNG.uniform(0.2, 0.8, (9, 11))
X, Y = (values.ravel() for values in np.meshgrid(np.arange(0.05, 1, 0.1), np.arange(0.05, 1, 0.1)))
IMAGE = RNG.integers(0, 255, (8, 8, 4), dtype=np.uint8)
WORDS = {
    "fewer": Comparison(0.5, 0.4, 0.6, "fewer"),
    "more": Comparison(2.0, 1.5, 2.5, "more"),
    "the same": Comparison(1.0, 0.95, 1.05, "the same"),
    "undecided": Comparison(1.0, 0.6, 1.5, "undecided"),
    "": Comparison(1.0, 0.6, 1.5),
}


def number(value: float, word: str = "") -> Comparison:
    return Comparison(value, 0.9 * value, 1.2 * value, word)


def headline(first: Interval, last: Interval, random: Interval) -> SimpleNamespace:
    return SimpleNamespace(first=first, last=last, random=random, settings=Settings())


def drawn(figure: Figure) -> list[Axes]:
    """Its axes, once it is seen to be as wide as the text, and all of it to stand on the page."""
    figure.canvas.draw()
    content, (width, height) = figure.get_tightbbox().padded(-0.05), figure.get_size_inches()
    assert width <= TEXT_WIDTH
    assert (content.x0 > 0, content.y0 > 0, content.x1 < width, content.y1 < height) == (True,) * 4
    return figure.axes


@pytest.mark.parametrize(
    "figure",
    [
        lambda: plans.home_view(IMAGE, np.full(12, 0.25), 64),
        lambda: plans.room_views(IMAGE, IMAGE, IMAGE, IMAGE, PAPER, Settings()),
        lambda: plans.stuck({"learning on": [WAY], "frozen": [WAY, WAY]}, PAPER, {"all": (WORDS["fewer"],) * 2}),
        lambda: plans.home(
            *(np.where(RNG.random((11, 11)) < 0.1, np.nan, RNG.uniform(0.5, 1, (11, 11))), PAPER, 0.9),
            *(np.arange(-90.0, 91, 10), np.linspace(0.5, 1, 19), (X, Y, 90 * (X - 0.5))),
        ),
        lambda: charts.trace_depth({"a": np.tril(RUNS[:, :6] / 200), "b": np.eye(6)}),
        lambda: charts.distance({"a": theorem.distance_from_cg(RNG.normal(size=(13, 3)), np.ones(12))}),
        lambda: charts.passing_shares({"some": 0.1, "none": 0.0}, ["some"]),
        lambda: plans.paths({"early": [("a", WAY[:, :2])] * 2, "late": [("c", WAY[:0, :2])]}, PAPER),
        lambda: curves.instead(
            np.geomspace(100, 40_000, 20),
            {name: RUNS for name in ("form 2", "standard Sarsa(λ)", "PPO", "PPO, constant cost", "DQN")},
            {"climb": 61.0},
        ),
        lambda: curves.learning_curves(RUNS, -LOST, LOST, RUNS, headline(*[Interval(90, 80, 99)] * 3)),
    ],
)
def test_images_and_awkward_data_are_drawn_without_a_warning_on_the_page(figure):
    drawn(figure())


def marks(axes) -> list[tuple[str, bool]]:
    """Shape, and whether it is filled, of each mark."""
    lines = [line for line in axes.lines if line.get_marker() in "osDv^P" and len(line.get_xdata())]
    return [(line.get_marker(), line.get_markerfacecolor() != "white") for line in lines]


def places(axes) -> list[tuple[str, float, float]]:
    """Colour and place of each mark."""
    lines = [line for line in axes.lines if line.get_marker() in "osDv^P|" and len(line.get_xdata()) == 1]
    return [(line.get_color(), *map(float, line.get_xydata()[0].round(3))) for line in lines]


def words(texts) -> list[str]:
    return [text.get_text() for text in texts]


def test_an_undecided_interval_is_hollow_and_the_key_names_the_words_that_are_met():
    figure = forest(Panel("steps", {name: [found] for name, found in WORDS.items()}))
    assert marks(figure.axes[0]) == [("o", True), ("s", True), ("D", True), ("D", False), ("o", True)]
    assert words(figure.legends[0].texts) == ["fewer", "more", "the same", "undecided"]
    figure = forest(Panel("steps", {"a": [WORDS["more"]]}), series=["one"])
    assert words(figure.legends[0].texts) == ["one", "more"]
    assert forest(Panel("steps", {"a": [WORDS[""]]})).legends == []


@pytest.mark.parametrize(
    ("ends", "narrow", "numbers"),
    [
        ((10, 300), False, [10, 20, 50, 100, 200]),
        ((10, 300), True, [10, 30, 100, 300]),
        ((10, 150), True, [10, 20, 50, 100]),
        ((10, 60), False, [10, 12, 15, 20, 25, 30, 40, 50, 60]),
        ((0.8, 1.3), False, [0.8, 0.9, 1, 1.1, 1.2, 1.3]),
        ((0.8, 1.3), True, [0.8, 1, 1.2]),  # where more would touch
        ((0.9, 1.2), True, [0.9, 1, 1.1, 1.2]),
    ],
)
def test_a_logarithmic_axis_has_the_more_numbers_written_out_the_less_it_spans(ends, narrow, numbers):
    axes = Figure().add_subplot(xlim=ends)
    parts.log_axis(axes, "x", narrow=narrow)
    ticks = [tick for tick in axes.get_xticks() if ends[0] <= tick <= 1.0001 * ends[1]]
    assert [f"{tick:g}" for tick in ticks] == [f"{number:g}" for number in numbers]


def test_a_reading_of_the_print_that_learns_is_a_disc_and_one_that_does_not_a_square():
    found = {f"{name}.{when}": number(steps) for name in ("yes", "no") for when, steps in (("early", 80), ("late", 50))}
    found |= {"yes.of first": WORDS["fewer"], "yes.of random": WORDS["fewer"]}
    found |= {"no.of first": WORDS["fewer"], "no.of random": WORDS["undecided"]}
    (axes,) = drawn(forests.printed(found, {"": {"one": "yes", "two": "no"}}))
    assert marks(axes) == [("o", False), ("o", True), ("o", False), ("s", True)]
    # In the middle random actions: late steps by their ratio to those.
    assert places(axes)[:3] == [(INK, 80, 0), (INK, 100, 0), (BLUE, 50, 0)]
    assert places(axes)[3:] == [(INK, 80, 1), (INK, 50, 1), (AMBER, 50, 1)]


def test_the_frozen_robots_stand_after_the_episodes_that_they_learnt():
    (axes,) = drawn(curves.learns(RUNS, RUNS[:2], {"least": 20}, {10: number(60)}))
    assert places(axes) == [(AMBER, 10, 60)]
    assert [line.get_ydata() for line in axes.lines][-1] == [20, 20]
    assert words(axes.texts) == ["frozen after 10", "least", "6 robots on the atlas", "2 with the camera"]


def test_a_title_says_that_steps_fall_only_if_the_intervals_do_not_touch():
    def title(last):
        found = headline(Interval(150, 140, 160), last, Interval(300, 250, 350))
        figure = curves.learning_curves(RUNS, -RUNS, RUNS, -RUNS, found)
        return figure.axes[0].get_title(loc="left")

    assert "from 150 to 30" in title(Interval(30, 25, 35))
    assert "no fall" in title(Interval(130, 110, 140))


def test_a_curve_by_episode_is_the_mean_of_the_runs_and_there_may_be_more_of_them_than_colours():
    (axes,) = drawn(curves.by_episode("", {str(times): times * RUNS for times in range(1, 10)}, "steps"))
    assert words(axes.texts) == [str(times) for times in range(1, 10)]
    for times, line in enumerate(axes.lines, start=1):
        np.testing.assert_allclose(line.get_xydata(), np.column_stack([range(1, 21), times * RUNS.mean(axis=0)]))


def test_names_at_the_ends_of_curves_do_not_overlap_and_stand_beside_those_that_end_below_zero():
    (axes,) = drawn(curves.by_episode("", {"down": -RUNS, "a": RUNS, "b": RUNS, "c": RUNS}, "ahead"))
    boxes = {text.get_text(): Text.get_window_extent(text) for text in axes.texts}
    assert not any(box.overlaps(other) for box in boxes.values() for other in boxes.values() if box is not other)
    assert boxes["down"].y1 < axes.transData.transform((1, 0))[1] < boxes["a"].y0 < boxes["b"].y0


def test_over_step_sizes_the_best_of_each_has_a_dot_and_what_is_nowhere_low_enough_is_named_nonetheless():
    error = {"a": np.array([[200.0, 100, 150]] * 2), "b": np.full((2, 3), 900.0)}
    (axes,) = drawn(curves.over_step_sizes(np.array([0.1, 0.2, 0.4]), error, "error", 300))
    assert places(axes) == [(BLUE, 0.2, 100)]
    assert words(axes.texts) == ["a", "b: beyond 300"]
    assert "above 300 are not drawn" in axes.get_title(loc="left")


def test_a_reset_is_hollow_and_what_becomes_of_the_steps_is_told_in_percent():
    found = {f"{update}.{name}": number(0.5) for update in ("taken", "all") for name in charts.KEPT.values()}
    trace, shares = drawn(charts.conjugate(found, np.array([0.2, 1.0, 0.4]), np.array([False, True, False])))
    assert [line.get_xydata().tolist() for line in trace.lines] == [[[1, 0.2], [3, 0.4]], [[2, 1.0]]]
    assert marks(trace) == [("o", True), ("o", False)]
    assert [bar.get_width() for bar in shares.patches] == [50] * 8


def test_maps_of_one_figure_share_their_scale_in_percent():
    figure = plans.maps({"a": (X, Y, X), "b": (X, Y, Y)}, PAPER, "share")
    for axes, share in zip(drawn(figure), (X, Y), strict=False):
        assert axes.images[0].get_clim() == (0, 100)
        np.testing.assert_allclose(axes.images[0].get_array().ravel(), 100 * share)
        assert axes.images[0].get_extent() == pytest.approx((0, 1, 0, 1))


def test_the_robot_sees_as_far_as_the_nearest_thing_or_wall():
    settings = Settings()
    eye, *stops = plans.in_sight(PAPER.home, PAPER, settings)  # before it the television, left and right cone and ball
    assert eye == pytest.approx((PAPER.home.x + settings.camera_offset_m, 0.5))
    assert stops[60] == pytest.approx((1.07, 0.5), abs=0.002)
    for first, name in ((-1, "cone"), (0, "ball")):
        (thing,) = (thing for thing in PAPER.objects if thing.name == name)
        assert np.hypot(stops[first][0] - thing.x, stops[first][1] - thing.y) == pytest.approx(thing.radius, abs=0.002)
    _, *stops = plans.in_sight(PAPER.start, PAPER, settings)  # only the west wall
    assert [x for x, _ in stops] == pytest.approx([0] * 121, abs=0.002)
