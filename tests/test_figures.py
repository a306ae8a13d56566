"""Figures are functions of their data, and their files of the figures."""

import matplotlib

matplotlib.use("Agg")
import numpy as np
import pytest

from homing_lib.errors import UserError
from homing_lib.publish import figures
from homing_lib.publish.drawing import TEXT_WIDTH, in_sight
from homing_lib.rooms import ROOMS
from homing_lib.settings import Settings
from homing_lib.study.bootstrap import Interval
from homing_lib.thresholds import Thresholds
from tests.test_plots import PLOTS as OF_STUDIES

RNG = np.random.default_rng(3)
IMAGE = RNG.integers(0, 255, (8, 8, 4), dtype=np.uint8)
PSI = Thresholds(0.9, 0.8)
WAY = RNG.uniform(0.2, 0.8, (6, 2))
TABLE = RNG.uniform(20, 200, (3, 20))
LOST = np.where(np.arange(20) > 15, np.nan, TABLE)  # what runs that diverged leave
ROOM = ROOMS["paper"]

PLOTS = {
    "home view": lambda: figures.home_view(IMAGE, np.full(12, 0.25), 64),
    "room": lambda: figures.room_views(IMAGE, IMAGE, IMAGE, IMAGE, ROOM, Settings()),
    "thresholds": lambda: figures.threshold_forms(np.arange(1, 9), np.arange(8) / 9, np.arange(8) / 8, {3: 0.25}),
    "shares": lambda: figures.passing_shares({"some": 0.1, "none": 0.0}, ["some"]),
    "paths": lambda: figures.paths({"early": [("a", WAY), ("b", WAY)], "late": [("c", WAY)]}, ROOM),
    "curves": lambda: figures.learning_curves(
        TABLE, -LOST, LOST, TABLE, np.linspace(1, 0.3, 20), *[Interval(90, 80, 99)] * 3, window=5
    ),
}


# Files that an earlier test of the same worker left to the garbage collector are none of the figure's.
@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")
@pytest.mark.parametrize("plot", [*PLOTS.values(), *OF_STUDIES.values()], ids=[*PLOTS, *OF_STUDIES])
def test_every_figure_is_drawn_without_a_warning_and_fits_the_text(plot, tmp_path):
    figure = plot()
    assert figure.get_figwidth() <= TEXT_WIDTH
    figures.save(figure, tmp_path, "drawn")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["drawn.pdf", "drawn.png"]


def test_saving_twice_gives_the_same_bytes_without_a_date_and_with_embedded_outlines(tmp_path, monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    written = []
    for name in ("once", "again"):
        figures.save(figures.passing_shares({"some": 0.1}), tmp_path, name)
        written.append([(tmp_path / f"{name}.{kind}").read_bytes() for kind in ("pdf", "png")])
    assert written[0] == written[1]
    pdf, png = written[0]
    assert b"CreationDate" not in pdf
    assert b"/TrueType" in pdf or b"/CIDFontType2" in pdf  # type 42
    assert b"/Type3" not in pdf
    assert b"Software" not in png


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    figures.save(figures.passing_shares({"some": 0.1}), None, "nowhere")
    assert list(tmp_path.iterdir()) == []


def test_the_robot_sees_as_far_as_the_nearest_thing_or_wall():
    settings = Settings()
    eye, *stops = in_sight(ROOM.home, ROOM, settings)  # before it the television, left and right of it cone and ball
    assert eye == pytest.approx((ROOM.home.x + settings.camera_offset_m, 0.5))
    assert stops[60] == pytest.approx((1.07, 0.5), abs=0.002)
    for first, thing in ((-1, "cone"), (0, "ball")):
        (stop,) = (found for found in ROOM.objects if found.name == thing)
        assert np.hypot(stops[first][0] - stop.x, stops[first][1] - stop.y) == pytest.approx(stop.radius, abs=0.002)
    _, *stops = in_sight(ROOM.start, ROOM, settings)  # only the west wall
    assert [x for x, _ in stops] == pytest.approx([0] * 121, abs=0.002)


def test_a_title_says_that_steps_fall_only_if_the_intervals_do_not_touch():
    def title(last):
        changes, rate = TABLE, np.ones(20)
        several = Interval(150, 140, 160), last, Interval(300, 250, 350)
        figure = figures.learning_curves(TABLE, -TABLE, changes, -TABLE, rate, *several, window=5)
        return figure.axes[0].get_title(loc="left")

    assert title(Interval(30, 25, 35)) == "Steps per episode fall from 150 to 30"
    assert title(Interval(130, 110, 145)) == "Steps per episode: no fall shown"


def test_a_figure_that_cannot_be_saved_leaves_nothing_behind(tmp_path, monkeypatch):
    figure = figures.passing_shares({"some": 0.1})
    monkeypatch.setattr(figure, "savefig", lambda *_, **__: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(UserError, match=r"lost.pdf: cannot be written \(disk full\)"):
        figures.save(figure, tmp_path, "lost")
    assert list(tmp_path.iterdir()) == []


def test_the_style_stays_with_the_figures():
    before = dict(matplotlib.rcParams)
    figures.passing_shares({"some": 0.1})
    assert dict(matplotlib.rcParams) == before
