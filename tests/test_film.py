"""A film shows what the run recorded, with the camera's own images, and is never half-written."""

import json
import subprocess
import sys
from itertools import pairwise

import cv2
import imageio.v3 as iio
import numpy as np
import pytest

pytest.importorskip("pybullet", reason="needs PyBullet")  # a film is rendered

from homing_lib import agent
from homing_lib.arena import Arena
from homing_lib.publish.cli import main
from homing_lib.publish.film import FRAMES, FRAMES_PER_SECOND, HOLD, Scene, timetable
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
    lasts = iio.immeta(path)["duration"]  # of a frame in ms, a multiple of 10, or of all in s
    assert len(frames) == 1 + 5 + HOLD
    assert lasts == pytest.approx(1000 / FRAMES_PER_SECOND if kind == "gif" else len(frames) / FRAMES_PER_SECOND, abs=5)
    moves = [np.abs(before.astype(int) - after).max() > 100 for before, after in pairwise(frames)]
    assert moves == [True] * 5 + [False] * HOLD


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
        scene = Scene(arena, result, [1, 2])
        (first, second), length = scene.episodes, len(result.column("lambda")) // 2
        scene.draw(3)
        lambda_, clipped = (result.episode(2)[:3, agent.STEP_COLUMNS.index(name)] for name in ("lambda", "clipped"))
        lines = second.panels["lambda"].lines
        steps, similarity = second.panels["similarity"].lines[1].get_data()
        np.testing.assert_array_equal(steps, [1, 2, 3])
        np.testing.assert_array_equal(similarity, result.episode(2)[:3, agent.STEP_COLUMNS.index("similarity")])
        for line, marker, shown in zip(lines, "ox", (clipped == 0, clipped == 1), strict=True):
            assert line.get_marker() == marker
            np.testing.assert_array_equal(np.column_stack(line.get_data()).T, [steps[shown], lambda_[shown]])
        stems = second.panels["lambda"].collections[0].get_segments()
        np.testing.assert_array_equal([stem[-1] for stem in stems], np.column_stack([steps, lambda_]))
        assert first.panels["room"].get_title(loc="left") == "episode 1, step 3"
        scene.draw(length)
        assert second.panels["room"].get_title(loc="left") == f"episode 2, step {length}: cut"


def test_an_episode_that_is_over_stays_as_it_ended(result):
    with Arena(PAPER, result.settings) as arena:
        scene = Scene(arena, result, [1])
        scene.draw(5)
        before = scene.episodes[0].panels["room"].images[0].get_array().copy()
        scene.draw(400)
        np.testing.assert_array_equal(scene.episodes[0].panels["room"].images[0].get_array(), before)
        assert scene.episodes[0].panels["room"].get_title(loc="left") == "episode 1, step 5: cut"


@pytest.mark.parametrize(
    ("lengths", "slow"), [([219, 25], 25), ([25, 219], 25), ([2000, 1500], FRAMES // 2), ([30, 28], 30), ([5], 5)]
)
def test_a_film_shows_every_step_while_all_episodes_go_on_and_lasts_less_than_forty_seconds(lengths, slow):
    steps = timetable(lengths)
    assert steps[: slow + 1] == list(range(slow + 1))
    assert steps[-1] == max(lengths)
    assert steps == sorted(set(steps))
    assert len(steps) <= FRAMES
    assert (FRAMES + HOLD) / FRAMES_PER_SECOND < 40
    if max(lengths) >= 2 * FRAMES:
        assert (len(steps) + HOLD) / FRAMES_PER_SECOND > 30


def test_a_stored_run_is_not_computed_again(result, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "DATA", tmp_path)
    path = runs.path_of(HEADLINE.folder, result.settings, 3)
    runs.save(result, path)
    manifest = {"sha256": {path.name: runs.sha256(path)}, "made by": runs.MADE_BY}
    HEADLINE.manifest.write_text(json.dumps(manifest))
    monkeypatch.setattr("homing_lib.publish.film.run", None)
    assert homing_film(tmp_path / "film.gif") == 0


@pytest.mark.parametrize(
    ("out", "options", "line"),
    [
        ("film.avi", [], "--out {out}: a film ends in .gif or .mp4"),
        ("film", [], "--out {out}: a film ends in .gif or .mp4"),
        ("film.gif", ["--episode", "3"], "--episode 3: the run has episodes 1 to 2"),
        ("film.gif", ["--episode", "0"], "--episode 0: the run has episodes 1 to 2"),
        (
            "film.gif",
            ["--set", "room=moon"],
            "room 'moon': there is none of this name; known are paper, divided, attic, hall, cell, workshop",
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


def test_a_film_that_cannot_be_written_is_one_line_and_nothing_is_computed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("homing_lib.publish.film.run", None)
    (tmp_path / "file").touch()
    assert homing_film(tmp_path / "file" / "film.gif") == 1
    assert capsys.readouterr().err.startswith(f"homing: {tmp_path / 'file' / 'film.gif'}: cannot be written (")


def test_without_the_camera_a_film_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    monkeypatch.delitem(sys.modules, "homing_lib.arena", raising=False)
    assert homing_film(tmp_path / "film.gif") == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("homing: a film is rendered, and needs PyBullet")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_diverged_before_says_so(tmp_path, capsys):
    assert homing_film(tmp_path / "film.gif", alpha0=1e300, max_steps=50) == 1
    assert capsys.readouterr().err.splitlines()[-1] == "homing: --episode 2: the run diverged in episode 1"
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_film_left_is_cleared_by_the_next_of_that_name(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    (tmp_path / f".film.{gone.pid}.part.gif").touch()
    (tmp_path / f".other.{gone.pid}.part.gif").touch()
    assert homing_film(tmp_path / "film.gif") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [f".other.{gone.pid}.part.gif", "film.gif"]


def test_a_stored_run_that_is_not_what_its_manifest_says_is_not_filmed(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runs, "DATA", tmp_path)
    runs.save(result, runs.path_of(HEADLINE.folder, result.settings, 3))
    assert homing_film(tmp_path / "film.gif") == 1
    assert "no manifest vouches for it; `make data` computes it" in capsys.readouterr().err
