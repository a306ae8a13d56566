"""A figure's file depends on its data alone, and its colours and marks can be told apart by all who see it."""

import os
import subprocess
import sys
from itertools import combinations

import matplotlib

matplotlib.use("Agg")
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from homing_lib.publish import charts, figures, forests, style
from homing_lib.storage import ROOT
from homing_lib.study import findings, studies
from homing_lib.study.questions.rooms import CALIBRATED_IN

DRAWS = """
import sys
from homing_lib.publish import charts, figures
figures.save(charts.passing_shares({"some": 0.1, "none": 0.0}, ["some"]), sys.argv[1], "drawn")
"""
HOSTILE = "axes.grid: True\nsavefig.bbox: tight\nfont.size: 20\nlines.linewidth: 9\nsavefig.facecolor: red\n"


def saved(folder, **environment) -> list[bytes]:
    """The bytes of a figure that another process draws: its PDF, and its PNG."""
    subprocess.run([sys.executable, "-c", DRAWS, folder], check=True, cwd=ROOT, env=os.environ | environment)
    return [(folder / f"drawn.{kind}").read_bytes() for kind in ("pdf", "png")]


def test_nothing_of_a_users_own_style_and_no_date_is_in_a_file_and_letters_are_embedded(tmp_path, monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    (tmp_path / "matplotlibrc").write_text(HOSTILE, encoding="utf-8")
    pdf, png = saved(tmp_path, MATPLOTLIBRC=str(tmp_path / "matplotlibrc"))
    figures.save(charts.passing_shares({"some": 0.1, "none": 0.0}, ["some"]), tmp_path, "here")
    assert (pdf, png) == tuple((tmp_path / f"here.{kind}").read_bytes() for kind in ("pdf", "png"))
    assert b"CreationDate" not in pdf
    assert b"/CIDFontType2" in pdf  # outlines that can be searched, not pictures of letters
    assert b"Software" not in png


def test_the_style_stays_with_the_figures(monkeypatch):
    monkeypatch.setitem(matplotlib.rcParams, "lines.linewidth", 9.0)
    before = dict(matplotlib.rcParams)
    charts.passing_shares({"some": 0.1})
    assert dict(matplotlib.rcParams) == before


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    figures.save(charts.passing_shares({"some": 0.1}), None, "nowhere")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "question", "plot"),
    [
        ("varying", "varying", forests.varying),
        ("varying-own", "varying", forests.own_mean),
        ("rooms", "rooms", lambda found: forests.rooms(found, studies.ROOMS)),
        ("rooms-matrix", "rooms", lambda found: charts.matrix(found, CALIBRATED_IN)),
        ("worth-everywhere", "worth", lambda found: forests.everywhere(found, studies.ROOMS)),
    ],
)
def test_a_stored_figure_shows_what_is_stored_as_found(tmp_path, name, question, plot):
    figures.save(plot(findings.finding(question)), tmp_path, name)
    stored = imread(ROOT / "figures" / f"{name}.png")
    np.testing.assert_array_equal(imread(tmp_path / f"{name}.png"), stored, err_msg="`make notebooks` draws it anew")


# --- Colours ----------------------------------------------------------------------------------------------------------

BLIND_TO = {
    "nothing": np.eye(3),
    "red": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "green": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "blue": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
"""What is left of linear red, green and blue (Machado, Oliveira and Fernandes 2009, at full severity)."""


def lab(colour: str, blindness: str = "nothing") -> np.ndarray:
    """Lightness (0 to 100) and two opponent colours, in steps of about the same size to the eye (CIELAB)."""
    rgb = np.array(to_rgb(colour))
    seen = np.clip(BLIND_TO[blindness] @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4), 0, 1)
    x, y, z = np.cbrt([[0.434, 0.376, 0.190], [0.213, 0.715, 0.072], [0.018, 0.109, 0.873]] @ seen)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("blindness", BLIND_TO)
@pytest.mark.parametrize("colours", [style.COLOURS.values(), [colour for colour, _ in style.LINES]])
def test_colours_stand_apart_for_the_colour_blind(colours, blindness):
    for one, other in combinations(colours, 2):
        assert np.linalg.norm(lab(one, blindness) - lab(other, blindness)) > 8  # 2.3 is just to be seen


def test_in_grey_curves_differ_in_dashes_or_lightness_and_marks_in_shape():
    for (one, dashes), (other, others) in combinations(style.LINES, 2):
        assert dashes != others or abs(lab(one)[0] - lab(other)[0]) > 20
    for looks in (forests.LOOKS.values(), [look for _, look in forests.TRIED.values()]):
        shapes = [(look.marker, look.full) for look in looks]
        assert len(set(shapes)) == len(shapes)
