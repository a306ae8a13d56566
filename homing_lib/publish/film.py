"""A film of a run: its first episode beside another, each with the room, the robot's view, similarity and lambda."""

from collections.abc import Sequence
from glob import escape
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, Any

import imageio_ffmpeg
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from tqdm import tqdm

from homing_lib.agent import STEP_COLUMNS, Run, run
from homing_lib.atlas import require_camera
from homing_lib.errors import UserError
from homing_lib.publish.parts import picture
from homing_lib.publish.style import BLUE, DASHED, ORANGE, SKY, house_style
from homing_lib.rooms import Pose, room_named
from homing_lib.settings import Settings
from homing_lib.storage import atomic_write
from homing_lib.study import runs
from homing_lib.study.questions import tours
from homing_lib.study.studies import HEADLINE
from homing_lib.thresholds import stopping_thresholds
from homing_lib.top_view import draw

if TYPE_CHECKING:
    from homing_lib.arena import Arena

FRAMES_PER_SECOND = 3
FRAMES = 92  # at most, whatever an episode takes
HOLD = 6  # more, for which the last one stands

_KINDS = {
    # One palette and no dithering: frames stay small, and equal where nothing moves.
    ".gif": ("gif", 100, ["-filter_complex", "split [a][b]; [a] palettegen [p]; [b][p] paletteuse=dither=none"]),
    ".mp4": ("h264", 200, ["-pix_fmt", "yuv420p", "-crf", "18"]),  # what every player plays
}
"""Codec, dots per inch and ffmpeg's options, by a file's ending."""

_SAME_BYTES = ["-fflags", "+bitexact", "-flags:v", "+bitexact"]
_LARGER: dict[str, Any] = {"font.size": 10, "axes.titlesize": 11, "axes.labelsize": 10, "lines.linewidth": 2}


def film(settings: Settings, seed: int, episode: int | None, path: Path, *, tour: bool = False) -> None:
    """Film the first episode of a run beside episode 2, 3, ... or its last, as GIF or MP4; see `timetable`.

    A stored run of the headline is taken as it is, any other is run first. The robot's views are rendered from the
    poses that the run has kept. tour: instead, after as many tours as the settings have episodes, one of three homes.
    Raises UserError in one line for what cannot be.
    """
    require_camera("a film is rendered, and")
    from homing_lib.arena import Arena

    number = settings.episodes if episode is None else episode
    if not 1 <= number <= settings.episodes:
        raise UserError(f"--episode {number}: the run has episodes 1 to {settings.episodes}")
    if path.suffix.lower() not in _KINDS:
        raise UserError(f"--out {path}: a film ends in {' or '.join(_KINDS)}")
    room = room_named(settings.room)
    runs.remove_leftovers(path.parent, escape(path.stem))  # of one that was killed
    with atomic_write(path) as part:
        part.touch()  # tried before any work is done
        codec, dpi, options = _KINDS[path.suffix.lower()]
        result, shown = _tour(settings, seed) if tour else (_run(settings, seed), {})
        if not tour and len(result.lengths) < number:
            raise UserError(f"--episode {number}: the run diverged in episode {result.diverged}")
        ffmpeg = {"animation.ffmpeg_path": imageio_ffmpeg.get_ffmpeg_exe()}
        with Arena(room, settings) as arena, house_style(_LARGER | ffmpeg):
            scene = Scene(arena, result, [1] if tour else sorted({1, number}), **shown)
            steps = timetable([len(one.poses) - 1 for one in scene.episodes])
            writer = FFMpegWriter(FRAMES_PER_SECOND, codec, extra_args=options + _SAME_BYTES)
            try:
                # Absolute, since ffmpeg takes run-10:30.gif for an address, and what begins with - for an option.
                with writer.saving(scene.figure, part.absolute(), dpi):
                    for step in tqdm([*steps, *steps[-1:] * HOLD], f"film of episode {number}", unit="frame"):
                        scene.draw(step)
                        writer.grab_frame()
            except CalledProcessError as error:
                why = error.stderr.strip() or f"ended with code {error.returncode}"
                raise UserError(f"{path}: cannot be written (ffmpeg: {why})") from None


def timetable(lengths: Sequence[int]) -> list[int]:
    """The steps that have a frame: each while all episodes go on, then as many as fit, and the last.

    So that an episode of hundreds of steps does not take minutes, and a short one is not over at once.
    """
    slow, last = min(*lengths, FRAMES // 2), max(lengths)
    later = np.linspace(slow, last, FRAMES - slow).round().astype(int).tolist()
    return list(dict.fromkeys([*range(slow), *later]))


def _run(settings: Settings, seed: int) -> Run:
    stored = runs.path_of(HEADLINE.folder, settings, seed)
    if stored.exists():
        return runs.load_one(HEADLINE, settings, seed)
    with tqdm(total=settings.episodes, desc="episodes", unit="episode") as bar:
        return run(settings, seed, after_episode=lambda _: bar.update())


def _tour(settings: Settings, seed: int) -> tuple[Run, dict[str, Any]]:
    """Of the last tours that of median length, as a run of one episode, and what `_Episode` must know of it."""
    env, agents = tours.begin(settings, seed)
    starts, driven = [env.robot.pose], []
    with env, tqdm(total=settings.episodes, desc="tours", unit="tour") as bar:
        for legs in tours.touring(env, agents, tours.plan, settings.episodes):
            driven.append(legs)
            starts.append(env.robot.pose)
            bar.update()
    late = range(settings.episodes)[-tours.LATE :]
    number = sorted(late, key=lambda one: sum(leg.steps for leg in driven[one]))[len(late) // 2]
    steps = np.concatenate([leg.path for leg in driven[number]])
    homes = [env.homes[leg.goal] for leg in driven[number] for _ in leg.path]
    reached = np.array([all(leg.home for leg in driven[number])])
    shown = {"name": f"tour {number + 1}", "start": starts[number], "homes": [*homes[:1], *homes]}
    return Run(settings, seed, steps, np.array([len(steps)]), reached, 0), shown


class Scene:
    """Episodes side by side, redrawn for one step after the other. Step 0 is the start.

    name, start, homes: of one that is no episode of the room; which home is sought at each step.
    """

    @house_style(_LARGER)
    def __init__(self, arena: "Arena", result: Run, numbers: Sequence[int], **shown: Any) -> None:
        self.figure = Figure(figsize=(4.4 * len(numbers), 4.4))
        (columns,) = self.figure.subfigures(1, len(numbers), squeeze=False)
        top_view, longest = arena.top_view(), max(result.lengths[number - 1] for number in numbers)
        self.episodes = [
            _Episode(arena, top_view, result, number, column, longest, **shown)
            for number, column in zip(numbers, columns, strict=True)
        ]
        self.draw(0)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # laid out once: what follows is quick, and stands still

    def draw(self, step: int) -> None:
        """Bring all episodes to this step; one that is over stays as it ended."""
        for episode in self.episodes:
            episode.draw(min(step, len(episode.poses) - 1))


class _Episode:
    """One episode: above, the room and what the robot sees there; below, similarity and lambda so far."""

    def __init__(
        self,
        arena: "Arena",
        top_view: Any,
        result: Run,
        number: int,
        figure: SubFigure,
        longest: int,
        *,
        name: str = "",
        start: Pose | None = None,
        homes: Sequence[Pose] = (),
    ) -> None:
        self._arena, self._top_view, self._name, self._homes = arena, top_view, name or f"episode {number}", homes
        start = start or arena.room.start
        self._steps = dict(zip(STEP_COLUMNS, result.episode(number).T, strict=True))
        self.poses = [start, *map(Pose, *(self._steps[name].tolist() for name in ("x", "y", "heading")))]
        self._end = "home" if result.reached[number - 1] else "cut"
        width, depth = arena.room.size
        self.panels: dict[str, Axes] = figure.subplot_mosaic(
            [["room", "view"], ["similarity", "similarity"], ["lambda", "lambda"]],
            width_ratios=[width / depth, 1],
            height_ratios=[2.6, 0.8, 0.8],
        )
        picture(self.panels["room"], top_view, "")
        self._title = self.panels["room"].set_title("episode")
        picture(self.panels["view"], arena.image(start), "")
        self.panels["view"].set_title("its view", loc="right")
        upper, lower = self.panels["similarity"], self.panels["lambda"]
        psi = stopping_thresholds(result.settings.multiplier).upper
        upper.axhline(psi, **DASHED)
        upper.set(ylim=(min(0.7, self._steps["similarity"].min()), 1.03), xticklabels=[], ylabel="similarity")
        upper.set_yticks([psi, 1], ["$\\psi_{upper}$", "1"])
        lower.set(ylim=(-0.12, 1.12), yticks=[0, 1], xlabel="step (crosses: reset to 0 or 1)", ylabel="$\\lambda$")
        for axes in (upper, lower):
            axes.set_xlim(0, longest + 1)
        (self._similarity,) = upper.plot([], [], color=BLUE, linewidth=1.5)
        self._stems = lower.vlines([], [], [], color=SKY, linewidth=1)
        (self._kept,) = lower.plot([], [], "o", color=BLUE, markersize=3)
        (self._reset,) = lower.plot([], [], "x", color=ORANGE, markersize=4, markeredgewidth=1)

    def draw(self, step: int) -> None:
        """Bring all panels to this step."""
        pose, room = self.poses[step], self._arena.room
        path = [passed[:2] for passed in self.poses[: step + 1]]
        home = self._homes[step] if self._homes else room.home
        radius_m = self._arena.settings.body_diameter_m / 2
        self.panels["room"].images[0].set_data(draw(self._top_view, room, radius_m, path, pose, home))
        self.panels["view"].images[0].set_data(self._arena.image(pose)[:, :, :3])
        passed, lambda_ = np.arange(1, step + 1), self._steps["lambda"][:step]
        reset = self._steps["clipped"][:step] > 0
        self._similarity.set_data(passed, self._steps["similarity"][:step])
        self._stems.set_segments([[(at, 0.0), (at, value)] for at, value in zip(passed, lambda_, strict=True)])
        self._kept.set_data(passed[~reset], lambda_[~reset])
        self._reset.set_data(passed[reset], lambda_[reset])
        end = f": {self._end}" if step == len(self.poses) - 1 else ""
        self._title.set_text(f"{self._name}, step {step}{end}")
