"""A film shows what the run recorded, with the camera's own images, and is never half-written."""

import json
import os
import sys
from itertools import pairwise
from pathlib import Path

import cv2
import imageio.v3 as iio
import matplotlib
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # a film is rendered

from homing_lib import agent
from homing_lib.arena import Arena
from homing_lib.publish.cli import main
from homing_lib.publish.film import FRAMES, FRAMES_PER_SECOND, HOLD, Scene, timetable
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import write_bytes
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
    lasts = iio.immeta(path)["duration"]  # of a frame in ms, a multiple of 10, or of all in s
    assert len(frames) == 1 + 5 + HOLD
    assert lasts == pytest.approx(1000 / FRAMES_PER_SECOND if kind == "gif" else len(frames) / FRAMES_PER_SECOND, abs=5)
    moves = [np.abs(before.astype(int) - after).max() > 100 for before, after in pairwise(frames)]
    assert moves == [True] * 5 + [False] * HOLD


def test_an_mp4_plays_everywhere(films):
    about = iio.immeta(films / "film.mp4", plugin="FFMPEG")
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p")


@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_every_frame_shows_the_cameras_image_at_that_step(films, result, kind):
    frames = iio.imread(films / f"film.{kind}")
    with Arena(PAPER, result.settings) as arena:
        scene = Scene(arena, result, [1, 2])
        for episode in scene.episodes:
            panel = episode.panels["view"].get_window_extent().transformed(scene.figure.transFigure.inverted())
            views = np.array([arena.image(pose)[:, :, :3] for pose in episode.poses], dtype=float)
            height, width = frames[0].shape[:2]
            rows = slice(round((1 - panel.y1) * height), round((1 - panel.y0) * height))
            columns = slice(round(panel.x0 * width), round(panel.x1 * width))
            for step, frame in enumerate(frames[: len(views)]):
                shown = cv2.resize(frame[rows, columns, :3], (16, 16), interpolation=cv2.INTER_AREA)
                error = np.abs(views - shown).mean(axis=(1, 2, 3))
                assert error.argmin() == step
                assert error[step] < 10  # of 255: the GIF has 256 colours, the MP4 few bits


def test_curves_and_title_say_what_the_run_recorded_and_an_episode_that_is_over_stays(result):
    with Arena(PAPER, result.settings) as arena:
        scene = Scene(arena, result, [1, 2])
        first, second = scene.episodes
        scene.draw(3)
        recorded = dict(zip(agent.STEP_COLUMNS, result.episode(2)[:3].T, strict=True))
        steps, lambda_, kept = np.arange(1, 4), recorded["lambda"], recorded["clipped"] == 0
        np.testing.assert_array_equal(second.panels["similarity"].lines[1].get_data(), [steps, recorded["similarity"]])
        for line, marker, which in zip(second.panels["lambda"].lines, "ox", (kept, ~kept), strict=True):
            assert line.get_marker() == marker
            np.testing.assert_array_equal(line.get_data(), [steps[which], lambda_[which]])
        stems = second.panels["lambda"].collections[0].get_segments()
        np.testing.assert_array_equal([stem[-1] for stem in stems], np.column_stack([steps, lambda_]))
        assert first.panels["room"].get_title(loc="left") == "episode 1, step 3"
        for step in (5, 400):
            scene.draw(step)
            assert second.panels["room"].get_title(loc="left") == "episode 2, step 5: cut"
            assert len(second.panels["lambda"].collections[0].get_segments()) == 5


@pytest.mark.parametrize(
    ("lengths", "slow"), [([219, 25], 25), ([25, 219], 25), ([2000, 1500], FRAMES // 2), ([30, 28], 30), ([5], 5)]
)
def test_a_film_shows_every_step_while_all_episodes_go_on_and_no_more_than_its_frames(lengths, slow):
    steps = timetable(lengths)
    assert steps[: slow + 1] == list(range(slow + 1))
    assert steps[-1] == max(lengths)
    assert steps == sorted(set(steps))
    assert len(steps) == min(FRAMES, max(lengths) + 1)


@pytest.fixture
def stored(result, tmp_path, monkeypatch) -> Path:
    """The run, stored where a run of the headline is, and as yet without a manifest; none is computed."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr("homing_lib.publish.film.run", None)
    path = runs.path_of(HEADLINE.folder, result.settings, 3)
    write_bytes(path, runs.content_of(result))
    return path


HOSTILE = {"axes.grid": True, "savefig.bbox": "tight", "animation.bitrate": 50, "animation.codec": "mpeg4"}


def test_a_stored_run_is_filmed_as_it_is_whatever_the_films_name_and_the_users_style(
    films, stored, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    name = "-10:30 '[%03d]"  # an option, an address, a quotation, a pattern
    for stem in (name, "other"):
        Path(f".{stem}.17.part.mp4").touch()
        os.utime(f".{stem}.17.part.mp4", (0, 0))  # what a killed film left long ago
    assert homing_film(f"{name}.mp4") == 1
    assert f"{stored}: no manifest" in capsys.readouterr().err
    manifest = {"sha256": {stored.name: runs.sha256(stored)}, "made by": runs.MADE_BY}
    HEADLINE.manifest.write_text(json.dumps(manifest))
    with matplotlib.rc_context(HOSTILE):
        assert homing_film(f"{name}.mp4") == 0
    assert {path.name for path in tmp_path.iterdir()} == {"data", ".other.17.part.mp4", f"{name}.mp4"}
    assert Path(f"{name}.mp4").read_bytes() == (films / "film.mp4").read_bytes()  # which was run, and drawn, anew


@pytest.mark.parametrize(
    ("out", "changes", "line"),
    [
        ("film.avi", {}, "--out {out}: a film ends in .gif or .mp4"),
        ("film", {}, "--out {out}: a film ends in .gif or .mp4"),
        ("film.gif", {"episode": 3}, "--episode 3: the run has episodes 1 to 2"),
        ("film.gif", {"episode": 0}, "--episode 0: the run has episodes 1 to 2"),
        ("file/film.gif", {}, "{out}: cannot be written ("),
        ("film.gif", {"pybullet": None}, "a film is rendered, and needs PyBullet"),
        ("film.gif", {"alpha0": 1e300, "max_steps": 50}, "--episode 2: the run diverged in episode 1"),
    ],
)
def test_what_cannot_be_filmed_is_one_line_and_leaves_nothing(tmp_path, monkeypatch, capsys, out, changes, line):
    (tmp_path / "file").touch()
    if "pybullet" in changes:
        monkeypatch.setitem(sys.modules, "pybullet", changes.pop("pybullet"))
        monkeypatch.delitem(sys.modules, "homing_lib.arena", raising=False)
    if "alpha0" not in changes:
        monkeypatch.setattr("homing_lib.publish.film.run", None)  # none is computed
    options = ["--episode", str(changes.pop("episode"))] if "episode" in changes else []
    path = tmp_path / out
    assert homing_film(path, *options, **changes) == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"homing: {line.format(out=path)}")
    assert [left.name for left in tmp_path.iterdir()] == ["file"]


def test_a_film_of_a_tour_shows_its_legs_one_after_the_other(tmp_path, capsys):
    assert homing_film(tmp_path / "tour.gif", "--tour") == 0
    assert len(iio.imread(tmp_path / "tour.gif")) == 1 + 3 * 5 + HOLD


def test_a_tour_of_a_room_without_homes_for_it_is_refused(tmp_path, capsys):
    assert homing_film(tmp_path / "tour.gif", "--tour", room="cell") == 1
    assert capsys.readouterr().err == "homing: room 'cell': homes for a tour are known of paper, workshop\n"
    assert not [*tmp_path.iterdir()]
