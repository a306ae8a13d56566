"""A figure's file depends on its data alone, and its colours and marks can be told apart by all who see it."""

import ast
import subprocess
import sys
from itertools import combinations

import matplotlib

matplotlib.use("Agg")
import nbformat
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from homing_lib.publish import charts, figures, forests, style, where
from homing_lib.storage import ROOT

HOSTILE = """
axes.grid: True
axes.formatter.use_locale: True
font.size: 20
lines.linewidth: 9
savefig.bbox: tight
savefig.facecolor: red
text.usetex: True
"""
DRAWS = """
import sys
from homing_lib.publish import charts, figures
figures.save(charts.passing_shares({"some": 0.1, "none": 0.0}, ["some"]), sys.argv[1], sys.argv[2])
"""


def test_nothing_of_a_users_own_style_and_no_date_is_in_a_file_and_letters_are_embedded(tmp_path, monkeypatch):
    (tmp_path / "matplotlibrc").write_text(HOSTILE, encoding="utf-8")
    monkeypatch.setenv("MATPLOTLIBRC", str(tmp_path / "matplotlibrc"))
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    subprocess.run([sys.executable, "-c", DRAWS, tmp_path, "theirs"], check=True, cwd=ROOT)
    figures.save(charts.passing_shares({"some": 0.1, "none": 0.0}, ["some"]), tmp_path, "ours")
    pdf, png = ((tmp_path / f"theirs.{kind}").read_bytes() for kind in ("pdf", "png"))
    assert (pdf, png) == tuple((tmp_path / f"ours.{kind}").read_bytes() for kind in ("pdf", "png"))
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


REDRAWN = (
    *("fig3-thresholds", "calibration-finalists", "varying", "today", "rooms", "rooms-matrix"),
    *("drives-start", "worth", "worth-everywhere"),
)


@pytest.fixture(scope="module")
def every():
    return where.drawn()


@pytest.mark.parametrize("name", REDRAWN)
def test_what_a_figure_is_said_to_depend_on_draws_it_as_it_is_stored(every, tmp_path, name):
    figure = every[name]
    codes = [cell.source for cell in nbformat.read(figure.notebook, as_version=4).cells if cell.cell_type == "code"]
    imports = [node for code in codes for node in ast.parse(code).body if isinstance(node, ast.Import | ast.ImportFrom)]
    needed = [one for one in reversed(figure.statements) if ast.unparse(one) != "figures_dir = None"]
    exec(compile(ast.Module([*imports, *needed], []), name, "exec"), {"figures_dir": tmp_path})
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
