"""A film of one episode: the robot's view, the room from above, similarity and lambda, side by side."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from math import cos, sin
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING

import imageio_ffmpeg
import matplotlib
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from tqdm import tqdm

from homing_lib.agent import STEP_COLUMNS, Run, run
from homing_lib.errors import UserError
from homing_lib.publish.drawing import BLUE, INK, ORANGE, STYLE
from homing_lib.rooms import Pose, room_named
from homing_lib.settings import Settings
from homing_lib.study import runs
from homing_lib.study.studies import HEADLINE
from homing_lib.thresholds import stopping_thresholds

if TYPE_CHECKING:
    from homing_lib.arena import Arena

FRAMES_A_SECOND = 4
HOLD = 8
"""How many more frames the last one stands."""

_KINDS = {
    # One palette and no dithering: frames stay small, and equal where nothing moves.
    ".gif": ("gif", 100, ["-filter_complex", "split [a][b]; [a] palettegen [p]; [b][p] paletteuse=dither=none"]),
    ".mp4": ("h264", 200, ["-pix_fmt", "yuv420p", "-crf", "18"]),  # what every player plays
}
"""Codec, dots an inch and ffmpeg's options, by a file's ending."""

_SAME_BYTES = ["-fflags", "+bitexact", "-flags:v", "+bitexact"]

_STYLE = STYLE | {"font.size": 11, "axes.titlesize": 12, "axes.labelsize": 11, "lines.linewidth": 2}
_YELLOW = "#F0E442"


def film(settings: Settings, seed: int, episode: int | None, path: Path) -> None:
    """Film episode 1, 2, ... of a run, or its last, as GIF or MP4: one frame a step, the first at the start.

    A stored run of the headline is taken as it is, any other is run first. The robot's views are rendered from the
    poses that the run has kept. Raises UserError in one line for what cannot be.
    """
    from homing_lib.arena import Arena

    number = settings.episodes if episode is None else episode
    if not 1 <= number <= settings.episodes:
        raise UserError(f"--episode {number}: the run has episodes 1 to {settings.episodes}")
    room = room_named(settings.room)
    with _whole(path) as part:
        codec, dpi, options = _KINDS[path.suffix.lower()]
        result = _run(settings, seed)
        if len(result.lengths) < number:
            raise UserError(f"--episode {number}: the run diverged in episode {result.diverged}")
        writer = FFMpegWriter(FRAMES_A_SECOND, codec, extra_args=options + _SAME_BYTES)
        with (
            Arena(room, settings) as arena,
            matplotlib.rc_context({"animation.ffmpeg_path": imageio_ffmpeg.get_ffmpeg_exe()}),
        ):
            scene = Scene(arena, result, number)
            last = len(scene.poses) - 1
            with writer.saving(scene.figure, part, dpi):
                for step in tqdm([*range(last), *[last] * (1 + HOLD)], f"film of episode {number}", unit="frame"):
                    scene.draw(step)
                    writer.grab_frame()


@contextmanager
def _whole(path: Path) -> Iterator[Path]:
    """A place beside the path to write to; what was written there is then renamed. Tried before any work is done."""
    if path.suffix.lower() not in _KINDS:
        raise UserError(f"--out {path}: a film ends in {' or '.join(_KINDS)}")
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        part.touch()
        try:
            yield part
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"--out {path}: cannot be written ({error.strerror})") from None
    except CalledProcessError:
        raise UserError(f"--out {path}: cannot be written (ffmpeg stopped; is the disk full?)") from None


def _run(settings: Settings, seed: int) -> Run:
    stored = runs.path_of(HEADLINE.folder, settings, seed)
    if stored.exists():
        return runs.load(stored)
    with tqdm(total=settings.episodes, desc="episodes", unit="episode") as bar:
        return run(settings, seed, after_episode=lambda _: bar.update())


class Scene:
    """The four panels, redrawn for one step after the other. Step 0 is the start."""

    @matplotlib.rc_context(_STYLE)
    def __init__(self, arena: "Arena", result: Run, number: int) -> None:
        self._arena = arena
        steps = dict(zip(STEP_COLUMNS, result.episode(number).T, strict=True))
        self.poses = [arena.room.start, *map(Pose, *(steps[name].tolist() for name in ("x", "y", "heading")))]
        self._curves = {"similarity": steps["similarity"], "lambda": steps["lambda"]}
        self._number = number
        self._end = "home" if result.reached[number - 1] else "cut"

        self.figure = Figure(figsize=(9.6, 3.2))
        width, depth = arena.room.size
        self.panels = self.figure.subplot_mosaic(
            [["view", "top", "similarity"], ["view", "top", "lambda"]], width_ratios=[1, width / depth, 1.3]
        )
        self._picture("view", "what the robot sees")
        self._image = self.panels["view"].imshow(arena.image(arena.room.start)[:, :, :3])
        self._way, self._nose, self._body = self._floor_plan()
        self._title = self.panels["top"].set_title("")
        self._lines = {
            "similarity": self._curve("similarity", "similarity to home (NRB)", BLUE),
            "lambda": self._curve("lambda", "$\\lambda$", ORANGE),
        }
        upper, lower = self.panels["similarity"], self.panels["lambda"]
        psi = stopping_thresholds(result.settings.multiplier).upper
        upper.axhline(psi, color=INK, linestyle=(0, (5, 2)), linewidth=1)
        upper.annotate("$\\psi_{upper}$", (0, psi), (4, 1), textcoords="offset points")
        upper.set(ylim=(min(0.5, steps["similarity"].min()), 1.03), yticks=[0.5, 0.75, 1], xticklabels=[])
        lower.set(ylim=(-0.06, 1.06), yticks=[0, 0.5, 1], xlabel="step")

    def draw(self, step: int) -> None:
        """Bring all panels to this step."""
        pose = self.poses[step]
        self._image.set_data(self._arena.image(pose)[:, :, :3])
        self._way.set_data(*np.array([passed[:2] for passed in self.poses[: step + 1]]).T)
        self._body.set_center(pose[:2])
        radius = self._body.get_radius()
        self._nose.set_data(
            [pose.x, pose.x + radius * cos(pose.heading)], [pose.y, pose.y + radius * sin(pose.heading)]
        )
        for name, line in self._lines.items():
            line.set_data(np.arange(1, step + 1), self._curves[name][:step])
        end = f": {self._end}" if step == len(self.poses) - 1 else ""
        self._title.set_text(f"episode {self._number}, step {step}{end}")

    def _picture(self, name: str, title: str = "") -> Axes:
        axes = self.panels[name]
        axes.set(title=title, xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        return axes

    def _floor_plan(self) -> tuple[Line2D, Line2D, Circle]:
        """The room from above with home; returns the way, the robot's heading and its body."""
        axes, room, settings = self._picture("top"), self._arena.room, self._arena.settings
        axes.imshow(self._arena.top_view(), extent=(0, room.size[0], 0, room.size[1]))
        axes.autoscale(False)
        axes.plot(*room.home[:2], "s", markersize=16, fillstyle="none", color="white")
        axes.annotate("home", room.home[:2], (0, 11), textcoords="offset points", color="white", ha="center")
        body = Circle(room.start[:2], settings.body_diameter_m / 2, facecolor=_YELLOW, edgecolor=INK, zorder=3)
        axes.add_patch(body)
        return axes.plot([], [], color=_YELLOW)[0], axes.plot([], [], color=INK, zorder=4)[0], body

    def _curve(self, name: str, title: str, colour: str) -> Line2D:
        axes = self.panels[name]
        axes.set_title(title, color=colour)
        axes.set(xlim=(0, len(self.poses)))
        return axes.plot([], [], color=colour)[0]
