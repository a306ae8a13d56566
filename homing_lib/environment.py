"""The task as a Gymnasium environment: the model's sections III.B-E and IV as one contract."""

from math import radians
from typing import Any, Literal

import gymnasium
import numpy as np

from homing_lib.arena import Arena
from homing_lib.features import HomeModel, difference_variance, histogram, similarity
from homing_lib.robot import Pose, Robot, World
from homing_lib.rooms import ROOMS, Room
from homing_lib.settings import Settings, UserError
from homing_lib.thresholds import stopping_thresholds

CONSTANT_COST = sum(1 / t for t in range(1, 101)) / 100
"""The mean of 1/t over the first 100 steps: what `step_cost = "constant"` charges a step."""


class HomingEnv(gymnasium.Env[Any, Any]):
    """A small robot, one snapshot of a home that it cannot see, and a way back that begins with a u-turn.

    | | |
    |---|---|
    | Actions | `Discrete(3)`: 0 Left_Forward, 1 Right_Forward, 2 Go_Forward (section III.D), as exact arcs |
    | Observation | `"image"`: the camera's RGB image, uint8 (size, size, 3); `"features"`: eq. (13), float64 (n,) |
    | Reward | eq. (16) less the wall penalty, see `reward` |
    | Terminated | the similarity NRB (eq. 15) reaches psi_upper (eq. 19) |
    | Truncated | `max_steps` steps without it |
    | At a wall | a step that an obstacle stops sets off a reflex: see `homing_lib.robot.Robot` |

    `info`, from `reset` and `step`:

    | key | |
    |---|---|
    | `similarity` | NRB of the view, in [0, 1] |
    | `pose` | (x, y, heading) in metres and radians: for records, never for steering |
    | `action` | the action that was driven, and is to be credited; differs from the command in a reflex |
    | `reflex` | the action that the next step will drive whatever is commanded, or -1 |
    | `at_wall` | stopped by an obstacle, or turning away from it, in this step |

    Before the first episode the robot takes its snapshots at home and surveys the room by a random drive (`survey`);
    `model` hands over an earlier survey. `reset(options={"start": (x, y, heading)})` overrides `start` once.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012, as Gymnasium declares it

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        observation: Literal["image", "features"] = "image",
        start: Pose | tuple[float, float, float] | Literal["uniform"] | None = None,
        home: Pose | tuple[float, float, float] | None = None,
        model: HomeModel | None = None,
        survey_seed: int = 0,
        render_mode: str | None = None,
        **changes: Any,
    ) -> None:
        """Build the world. Keyword arguments beyond those named are fields of `Settings`, e.g. `room="paper"`."""
        self.settings = settings = (settings or Settings()).with_changes(**changes)
        self.room = room_named(settings.room)
        self.home = Pose(*(home or self.room.home))
        self.render_mode = render_mode
        self._start = self.room.start if start is None else start
        self._observation = observation
        self._arena = Arena(self.room, settings)
        self.world: World = self._arena
        self.model = model
        self._survey_seed = survey_seed
        self._thresholds = stopping_thresholds(settings.multiplier)
        self._robot = Robot(self.world, settings, self.home)
        self.action_space = gymnasium.spaces.Discrete(3)
        size, n = settings.image_size, settings.n_features
        self.observation_space = (
            gymnasium.spaces.Box(0, 255, (size, size, 3), np.uint8)
            if observation == "image"
            else gymnasium.spaces.Box(0.0, 1.0, (n,), np.float64)
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Put the robot at the start. Seeds as Gymnasium prescribes."""
        super().reset(seed=seed)
        if self.model is None:
            self.model = survey(self.world, self.settings, self.home, np.random.default_rng(self._survey_seed))
        start = (options or {}).get("start", self._start)
        self._robot.place(self._free_pose() if start == "uniform" else self._checked(Pose(*start)))
        self._steps = 0
        observation = self._look()
        return observation, self._info(-1, False)

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive one action; see the class for what comes back."""
        before = self._similarity
        self._steps += 1
        driven, at_wall = self._robot.act(action, self.np_random)
        observation = self._look()
        gain = reward(self._steps, self._similarity, before, self._thresholds.lower, at_wall, self.settings)
        terminated = self._similarity >= self._thresholds.upper
        truncated = not terminated and self._steps >= self.settings.max_steps
        return observation, gain, terminated, truncated, self._info(driven, at_wall)

    def close(self) -> None:
        """Free Bullet's client."""
        self._arena.close()

    def _look(self) -> Any:
        assert self.model is not None
        if self._observation == "image":
            image = self._arena.image(self._robot.pose)
            self._similarity = similarity(self.model.features(histogram(image, self.settings.bin_size)))
            return np.ascontiguousarray(image[:, :, :3])
        features = self.model.features(self.world.histogram(self._robot.pose))
        self._similarity = similarity(features)
        return features

    def _info(self, driven: int, at_wall: bool) -> dict[str, Any]:
        reflex = self._robot.reflex
        return {
            "similarity": self._similarity,
            "pose": self._robot.pose,
            "action": driven,
            "reflex": -1 if reflex is None else reflex,
            "at_wall": at_wall,
        }

    def _free_pose(self) -> Pose:
        return free_pose(self.world, self.room, self.np_random)

    def _checked(self, pose: Pose) -> Pose:
        if self.world.clearance(pose.x, pose.y) < 0:
            raise UserError(f"start {tuple(pose)}: the robot does not fit there; choose a pose in free space")
        return pose


def reward(
    step: int, similarity: float, similarity_before: float, psi_lower: float, at_wall: bool, settings: Settings
) -> float:
    """Eq. (16): -1/t, plus 2 NRB_t - NRB_(t-1) while both reach psi_lower; less the penalty at a wall (V.A)."""
    gain = -1 / step if settings.step_cost == "1/t" else -CONSTANT_COST
    if settings.approach_reward and similarity >= psi_lower and similarity_before >= psi_lower:
        gain += 2 * similarity - similarity_before
    return gain - settings.wall_penalty if at_wall else gain


def survey(world: World, settings: Settings, home: Pose, rng: np.random.Generator) -> HomeModel:
    """What the robot does by itself before it learns: look at home, then drive about at random (section III.A-B, E9).

    It takes the snapshots (the first facing home, further ones `snapshot_angle_deg` to either side), then makes
    `survey_steps` uniformly random actions from there, reflex included, and estimates sigma^2 from all that it saw.
    """
    angle = radians(settings.snapshot_angle_deg)
    turns = (0.0, angle, -angle)[: settings.snapshots]
    snapshots = np.array([world.histogram(home._replace(heading=home.heading + turn)) for turn in turns])
    robot = Robot(world, settings, home)
    seen = np.empty((settings.survey_steps, snapshots.shape[1]))
    for step in range(settings.survey_steps):
        robot.act(int(rng.integers(3)), rng)
        seen[step] = world.histogram(robot.pose)
    floor = (settings.variance_floor_pixels / settings.image_size**2) ** 2
    return HomeModel(
        snapshots,
        difference_variance(seen, snapshots, variance=settings.variance, centre=settings.centre, floor=floor),
    )


def free_pose(world: World, room: Room, rng: np.random.Generator) -> Pose:
    """A pose drawn uniformly from those at which the body touches nothing."""
    while True:
        x, y = rng.uniform(0, room.size[0]), rng.uniform(0, room.size[1])
        if world.clearance(x, y) >= 0:
            return Pose(x, y, rng.uniform(-np.pi, np.pi))


def room_named(name: str) -> Room:
    """The room of this name. Raises UserError for one that does not exist."""
    if name not in ROOMS:
        raise UserError(f"room {name!r}: there is none of this name; known are {', '.join(ROOMS)}")
    return ROOMS[name]
