"""A film shows what the run recorded: a frame a step, the camera's own images, and nothing half-written."""

from itertools import pairwise

import cv2
import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # a film is rendered

from homing_lib import agent
from homing_lib.__main__ import main
from homing_lib.arena import Arena
from homing_lib.publish.film import FRAMES_A_SECOND, HOLD, Scene
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.study import runs
from homing_lib.study.studies import HEADLINE

TINY = dict(image_size=16, survey_steps=10, episodes=2, max_steps=5, multiplier=1e6)
"""Two episodes of five steps each: no view resembles home that much."""


def homing_film(out, *options, **changes) -> int:
    settings = [f"--set={name}={value}" for name, value in (TINY | changes).items()]
    return main(["film", "--seed", "3", "--out", str(out), *options, *settings])


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    """The same episode as .gif and .mp4."""
    folder = tmp_path_factory.mktemp("films")
    for kind in ("gif", "mp4"):
        assert homing_film(folder / f"film.{kind}") == 0
    return folder


@pytest.fixture(scope="module")
def result():
    """The run that is filmed."""
    return agent.run(Settings(**TINY), 3)


@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_a_film_has_a_frame_for_the_start_and_every_step_and_holds_the_last(films, kind):
    path = films / f"film.{kind}"
    frames = iio.imread(path)
    lasts = iio.immeta(path).get("duration", 0)
    assert len(frames) == 1 + 5 + HOLD
    assert lasts in (1000 / FRAMES_A_SECOND, len(frames) / FRAMES_A_SECOND)  # of a frame in ms, or of all in s
    moves = [np.abs(before.astype(int) - after).max() > 100 for before, after in pairwise(frames)]
    assert moves == [True] * 5 + [False] * HOLD


@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_every_frame_shows_the_cameras_image_at_that_step(films, result, kind):
    frames = iio.imread(films / f"film.{kind}")
    with Arena(PAPER, result.settings) as arena:
        scene = Scene(arena, result, 2)
        scene.figure.draw_without_rendering()  # which lays it out
        panel = scene.panels["view"].get_window_extent().transformed(scene.figure.transFigure.inverted())
        views = np.array([arena.image(pose)[:, :, :3] for pose in scene.poses], dtype=float)
    height, width = frames[0].shape[:2]
    rows = slice(round((1 - panel.y1) * height), round((1 - panel.y0) * height))
    columns = slice(round(panel.x0 * width), round(panel.x1 * width))
    for step, frame in enumerate(frames[: len(views)]):
        shown = cv2.resize(frame[rows, columns, :3], (16, 16), interpolation=cv2.INTER_AREA)
        error = np.abs(views - shown).mean(axis=(1, 2, 3))
        assert error.argmin() == step
        assert error[step] < 10  # of 255: the GIF has 256 colours, the MP4 few bits


def test_an_mp4_plays_everywhere(films):
    about = iio.immeta(films / "film.mp4", plugin="FFMPEG")
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p")


def test_the_same_episode_gives_the_same_bytes(films, tmp_path):
    for kind in ("gif", "mp4"):
        homing_film(tmp_path / f"again.{kind}")
        assert (tmp_path / f"again.{kind}").read_bytes() == (films / f"film.{kind}").read_bytes()


def test_curves_and_title_say_what_the_run_recorded(result):
    with Arena(PAPER, result.settings) as arena:
        scene = Scene(arena, result, 1)
        scene.draw(3)
        for name in ("similarity", "lambda"):
            steps, values = scene.panels[name].lines[0].get_data()
            np.testing.assert_array_equal(steps, [1, 2, 3])
            np.testing.assert_array_equal(values, result.column(name)[:3])
        assert scene.panels["top"].get_title(loc="left") == "episode 1, step 3"
        scene.draw(5)
        assert scene.panels["top"].get_title(loc="left") == "episode 1, step 5: cut"


def test_a_stored_run_is_not_computed_again(result, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "DATA", tmp_path)
    runs.save(result, runs.path_of(HEADLINE.folder, result.settings, 3))
    monkeypatch.setattr("homing_lib.publish.film.run", None)
    assert homing_film(tmp_path / "film.gif") == 0


@pytest.mark.parametrize(
    ("out", "options", "line"),
    [
        ("film.avi", [], "--out {out}: a film ends in .gif or .mp4"),
        ("film", [], "--out {out}: a film ends in .gif or .mp4"),
        ("nowhere/film.gif", [], "--out {out}: cannot be written (No such file or directory)"),
        ("film.gif", ["--episode", "3"], "--episode 3: the run has episodes 1 to 2"),
        ("film.gif", ["--episode", "0"], "--episode 0: the run has episodes 1 to 2"),
        (
            "film.gif",
            ["--set", "room=moon"],
            "room 'moon': there is none of this name; known are paper, divided, attic",
        ),
    ],
)
def test_what_cannot_be_filmed_is_one_line_and_nothing_is_computed_or_left(
    tmp_path, monkeypatch, capsys, out, options, line
):
    monkeypatch.setattr("homing_lib.publish.film.run", None)
    path = tmp_path / out
    assert homing_film(path, *options) == 1
    assert capsys.readouterr().err == f"homing: {line.format(out=path)}\n"
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_diverged_before_says_so(tmp_path, capsys):
    assert homing_film(tmp_path / "film.gif", alpha0=1e300, max_steps=50) == 1
    assert capsys.readouterr().err.splitlines()[-1] == "homing: --episode 2: the run diverged in episode 1"
    assert list(tmp_path.iterdir()) == []
