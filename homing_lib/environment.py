"""The task as a Gymnasium environment: the model's sections III.B-E and IV as one contract."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from math import isfinite
from operator import index
from typing import TYPE_CHECKING, Any, Literal

import gymnasium
import numpy as np

from homing_lib.atlas import Atlas, open_atlas, open_compact, require_camera
from homing_lib.errors import UserError, seed_of, shown
from homing_lib.features import CountedViews, HomeModel, histogram, similarity
from homing_lib.robot import Robot, wrapped
from homing_lib.rooms import Pose, room_named
from homing_lib.settings import Settings
from homing_lib.surfaces import Image
from homing_lib.survey import free_pose, surveys
from homing_lib.thresholds import stopping_thresholds
from homing_lib.top_view import draw

if TYPE_CHECKING:
    from homing_lib.arena import Arena

CONSTANT_COST = sum(1 / t for t in range(1, 101)) / 100  # what `step_cost = "constant"` charges per step
_SURVEYS: dict[tuple[Any, ...], list[HomeModel]] = {}  # of this process, by all that they depend on, and the threshold


class HomingEnv(gymnasium.Env[Any, Any]):
    """A small robot, one snapshot of a home that it cannot see, and a way back that begins with a u-turn.

    A Khepera, 70 mm across, stands in a room of 1.15 m x 1 m with a colour camera that looks ahead. From a start where
    nothing of the home is in sight, it must come back to where the view resembles its snapshot, in front of a
    television. Numbers in brackets are equations of Altahhan (2014); a name in `this type` is a field of
    `homing_lib.settings.Settings`, where its value and its source stand.

    ## Action space

    `Discrete(3)` (section III.D). Wheels roll without slip (but see `wheel_slip`), so that each action is an exact arc:

    | action | name          | centre moves        | robot turns   |
    |--------|---------------|---------------------|---------------|
    | 0      | Left_Forward  | `turn_advance_m`    | + `turn_deg`  |
    | 1      | Right_Forward | `turn_advance_m`    | - `turn_deg`  |
    | 2      | Go_Forward    | `forward_m`         | 0             |

    ## Observation space

    | `observation`     | space                                 | what                                                 |
    |-------------------|---------------------------------------|------------------------------------------------------|
    | "image" (default) | `Box(0, 255, (size, size, 3), uint8)` | the camera's RGB image, size = `image_size`          |
    | "features"        | `Box(0, 1, (n,), float64)`            | phi (8), (12), (13); n = 3 (round(256/b) + 1) m (14) |

    The features compare the histograms h of the view, bin by bin, with those of the snapshot, v, both as shares of the
    pixels (11); their mean is the similarity of the view to home.

        phi_i = exp(-(h_i - v_i)^2 / (2 sigma_i^2))    (12)        NRB = sum of phi_i / n    (15)

    At the first `reset` the robot takes its snapshot and surveys the room by a random drive of `survey_steps`, from
    which it has sigma^2 (9): `homing_lib.survey.survey`, with `survey_seed`. Environments of a process that agree in
    all that it depends on share it; `model` passes one in.

    ## Transition dynamics

    The pose follows the action's arc to its end, or to where the body touches something. A step that is stopped
    sets off the reactive behaviour (V.A): from the next step on, **whatever is commanded**, the robot turns in place by
    `turn_deg` per step to one random side, until its four front infra-red sensors see at least `clear_way_m` free.
    Such a turn counts as that side's action, which is to be credited: `info` says what was driven.

    ## Reward

        r_t = -1/t,    plus 2 NRB_t - NRB_(t-1) if both reach psi_lower    (16)

    less `wall_penalty` where `at_wall` (V.A); psi_lower (19) is from `multiplier` - `band`. `step_cost` changes the
    first, `approach_reward` drops the second part; `reward_scale` multiplies all but `terminal_bonus`, which home pays.

    ## Starting state

    `start`: any pose (x, y, heading) in metres and radians, anticlockwise from the x axis; "uniform", drawn anew for
    each episode from all free poses; or by default as the setting `start` says, the room's. A start may resemble home:
    the first step is driven all the same. `reset(options={"start": ...})` overrides it for one episode, also by "here":
    where the robot stands.

    ## Episode end

    An episode is `terminated` where NRB >= psi_upper = 1 - 1/(pi sqrt(`multiplier`)) (19), and `truncated` after
    `max_steps` steps without that.

    ## Info

    | key          | type  | of `reset` and `step`                                                             |
    |--------------|-------|-----------------------------------------------------------------------------------|
    | `similarity` | float | NRB of the view                                                                   |
    | `pose`       | Pose  | (x, y, heading), metres and radians: for records, never for steering              |
    | `action`     | int   | the action driven, and to be credited; -1 after `reset`                           |
    | `reflex`     | int   | the action that the next step will drive whatever is commanded; -1 without reflex |
    | `at_wall`    | bool  | stopped by an obstacle in this step, or turning away from it                      |

    ## In comparison with the published learner

    `homing_lib.agent.run(settings, seed, agent=...)` gives any object with three methods the same run as the published
    one. To compare fairly a learner that drives this environment by itself, say in which of these it differs:

    | what    | of `agent.run(settings, seed)`                                                                        |
    |---------|-------------------------------------------------------------------------------------------------------|
    | seeds   | `survey, agent, world = numpy.random.SeedSequence(seed).spawn(3)`: the first is `survey_seed` (0 here |
    |         | by default, so that all robots know home equally well), the second is the learner's own; the third    |
    |         | seeds the world: `reset(seed=int(world.generate_state(1)[0]))`, and a further `reset()` each episode  |
    | home    | is valued like any other view (`bootstrap_terminal`): it looks ahead from the last step of an episode |
    |         | too, where other learners take 0 if `terminated`                                                      |
    | rates   | step size and exploration fall from episode to episode (23), from `alpha0` and `epsilon0`             |
    | values  | begin at n NRB, since all weights begin at `theta0` = 1: far more than a step is paid                 |
    | walls   | are learnt from too (`learn_at_walls`)                                                                |
    | end     | after `episodes` episodes; one that is `truncated` counts with all of its steps                       |

    ## Arguments

    ```python
    >>> import gymnasium, homing_lib
    >>> env = gymnasium.make("homing/UTurn-v0", observation="features", images="compact", start="uniform")
    >>> phi, info = env.reset(seed=1)
    >>> phi.shape, info["action"], info["at_wall"]
    ((258,), -1, False)
    >>> env.close()

    ```

    `settings` is a whole `Settings`; any further keyword is one of its fields (for a specification that JSON can hold,
    `**settings.model_dump()`), e.g. `room="paper"`, `images="atlas"` (histograms from a lattice of poses, tens of
    thousands of steps a second; features only) or "compact" (the same from a file that ships with the library, on a
    coarser lattice: nothing is rendered, PyBullet is not needed). `home`: another pose at which the snapshot is taken.
    `render_mode="rgb_array"`: the room from above, uint8, 480 pixels wide, with home, the path so far and the robot;
    for this PyBullet is needed whatever the images are (without, `check_env(env, skip_render_check=True)`).

    `homes`: several such poses in place of `home`. The robot has a snapshot of each, and surveys the room once for all,
    from the first. It seeks one of them, at first the first: `seek(k)` says which, and features, reward and end speak
    of that one. So a tour is: `seek(k)`, then an episode from "here", again and again.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012, as Gymnasium declares it

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        observation: Literal["image", "features"] = "image",
        start: tuple[float, float, float] | Literal["uniform"] | None = None,
        home: tuple[float, float, float] | None = None,
        homes: Sequence[tuple[float, float, float]] | None = None,
        model: HomeModel | None = None,
        survey_seed: int | np.random.SeedSequence = 0,
        render_mode: str | None = None,
        **changes: Any,
    ) -> None:
        """Build the world; see the class. Raises UserError, in one line, for what cannot be."""
        if not isinstance(settings, Settings | None) or not isinstance(model, HomeModel | None):
            raise UserError("settings and model: must be Settings and a HomeModel; single settings go by their names")
        self.settings = settings = (settings or Settings()).with_changes(**changes)
        self.room = room_named(settings.room)
        size, n = settings.image_size, settings.n_features
        box = gymnasium.spaces.Box
        pixels, shares = box(0, 255, (size, size, 3), np.uint8), box(0.0, 1.0, (n,), np.float64)
        spaces: dict[str, gymnasium.Space[Any]] = {"image": pixels, "features": shares}
        if not isinstance(observation, str) or observation not in spaces:
            raise UserError(f"observation = {shown(observation)}: must be one of {', '.join(spaces)}")
        if observation == "image" and settings.images != "camera":
            held = f'observation = "image", the default: images = "{settings.images}" holds histograms only'
            raise UserError(f'{held}; choose observation="features", or images="camera", which needs PyBullet')
        if not isinstance(render_mode, str | None) or render_mode not in (None, *self.metadata["render_modes"]):
            raise UserError(f"render_mode = {shown(render_mode)}: must be rgb_array or None")
        if model is not None and model.n_features != n:
            raise UserError(f"model: has {model.n_features} features, the settings ask for {n} (eq. 14)")
        if homes is not None and not (homes and isinstance(homes, Sequence) and home is None and model is None):
            raise UserError("homes: must be a list of poses, and in place of home; a model speaks of one home only")
        self.action_space: gymnasium.Space[Any] = gymnasium.spaces.Discrete(3)
        self.observation_space: gymnasium.Space[Any] = spaces[observation]
        self.render_mode = render_mode
        self._sees_images, self._survey_seed = observation == "image", seed_of("survey_seed", survey_seed)
        self._psi_upper, self._psi_lower = stopping_thresholds(settings.multiplier, settings.band)
        self._top_view: Image | None = None
        self._under_way = self.closed = False

        self.world: Atlas | Arena
        if settings.images == "camera":
            from homing_lib import arena  # only where it is needed: it loads PyBullet

            self.world = arena.Arena(self.room, settings)
        elif settings.images == "atlas":
            self.world = open_atlas(self.room, settings)
        else:
            self.world = open_compact(self.room, settings)
        try:
            poses = homes or [self.room.home if home is None else home]
            self.homes = tuple(self.fitting_pose("home", pose) for pose in poses)
            self.models: list[HomeModel | None] = [model] * len(self.homes)
            self.seek(0)
            default = "uniform" if settings.start == "uniform" else self.room.start
            self.start = self.start_pose(default if start is None else start)
        except UserError:
            self.close()
            raise
        self.robot = Robot(self.world, settings, self.home)

    @property
    def model(self) -> HomeModel | None:
        """What the robot knows of the home that it seeks: None until it has surveyed the room."""
        return self.models[self.sought]

    @model.setter
    def model(self, model: HomeModel | None) -> None:
        self.models[self.sought] = model
        if isinstance(self.world, Atlas) and model is not None:
            self.views = CountedViews(model, self.world.most, self.world.pixels)

    def seek(self, number: int) -> None:
        """Let the robot seek another of the `homes`, 0, 1, ..., from the next `reset` on."""
        if number not in range(len(self.homes)):
            raise UserError(f"seek = {shown(number)}: must be one of the {len(self.homes)} homes, 0, 1, ...")
        self.sought, self._under_way = index(number), False
        self.home, self.model = self.homes[number], self.models[number]

    def surveyed(self, by: Callable[..., list[HomeModel]] | None = None) -> HomeModel:
        """`model`, from a survey where it is None. by: what makes those of all homes, by default `survey.surveys`."""
        if self.model is None:
            seen = repr(self.settings.of_scope("view", "lattice", "survey"))
            key = seen, repr(self.room), self.homes, repr(self._survey_seed), self._psi_upper
            if key not in _SURVEYS:
                rng = np.random.default_rng(self._survey_seed)
                models = (by or surveys)(self.world, self.settings, self.homes, rng)
                for model in models:
                    self._require_elsewhere(model)
                _SURVEYS[key] = models
            self.models = [*_SURVEYS[key]]
            self.model = _SURVEYS[key][self.sought]
        return self.model

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Put the robot at the start, drawn with the environment's generator if it is "uniform"."""
        self._require(under_way=False)
        if not isinstance(options, dict | None) or {*(options or {})} - {"start"}:
            raise UserError(f"options = {shown(options)}: must be None or {{'start': ...}}")
        super().reset(seed=seed)
        self.surveyed()
        start = self.start_of(options)
        self.robot.place(free_pose(self.world, self.room, self.np_random) if start == "uniform" else start)
        self._path = [self.robot.pose[:2]]
        self._steps, self._under_way = 0, True
        observation, self._similarity = self._look()
        return observation, self._info(-1, False)

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive one action, or the reflex."""
        self._require()
        if not (type(action) is int and 0 <= action <= 2) and not self.action_space.contains(action):
            raise UserError(f"action = {shown(action)}: must be 0, 1 or 2")
        self._steps += 1
        driven, at_wall = self.robot.act(int(action), self.np_random)
        before, (observation, nrb) = self._similarity, self._look()
        self._similarity, terminated = nrb, nrb >= self._psi_upper
        gain = reward(self._steps, nrb, before, self._psi_lower, at_wall, self.settings, home=terminated)
        truncated = not terminated and self._steps >= self.settings.max_steps
        self._path.append(self.robot.pose[:2])
        return observation, gain, terminated, truncated, self._info(driven, at_wall)

    def render(self) -> Image | None:
        """The room from above with home (a square), the path so far and the robot; None without a render mode."""
        self._require()
        if self.render_mode is None:
            gymnasium.logger.warn('render() needs a render mode: make the environment with render_mode="rgb_array"')
            return None
        if self._top_view is None:
            require_camera("render: the picture of the room from above")
            from homing_lib.arena import Arena

            with nullcontext(self.world) if isinstance(self.world, Arena) else Arena(self.room, self.settings) as world:
                self._top_view = world.top_view()
        radius_m = self.settings.body_diameter_m / 2
        return draw(self._top_view, self.room, radius_m, self._path, self.robot.pose, self.home)

    def close(self) -> None:
        """Free the simulator. Closing twice is harmless; anything else afterwards is refused."""
        if not isinstance(self.world, Atlas):
            self.world.close()
        self.closed, self._under_way = True, False

    def __reduce_ex__(self, protocol: Any) -> Any:
        """To be copied or pickled, which a simulator cannot be."""
        if not isinstance(self.world, Atlas):
            raise UserError('an environment with images="camera" cannot be copied or pickled; make another like it')
        return super().__reduce_ex__(protocol)

    def _require(self, *, under_way: bool = True) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("this environment is closed; make another")
        if under_way and not self._under_way:
            raise gymnasium.error.ResetNeeded("the first episode begins with reset()")

    def _look(self) -> tuple[Any, float]:
        """The observation from where the robot is, and its similarity."""
        assert self.model is not None
        if isinstance(self.world, Atlas):
            features = self.views.features(self.world.views[self.world.nearest(self.robot.pose)])
            return features, similarity(features)
        image = self.world.image(self.robot.pose)
        features = self.model.features(histogram(image, self.settings.bin_size))
        return np.ascontiguousarray(image[:, :, :3]) if self._sees_images else features, similarity(features)

    def _info(self, driven: int, at_wall: bool) -> dict[str, Any]:
        pose, reflex = self.robot.pose, -1 if self.robot.reflex is None else self.robot.reflex
        return {"similarity": self._similarity, "pose": pose, "action": driven, "reflex": reflex, "at_wall": at_wall}

    def _require_elsewhere(self, model: HomeModel) -> None:
        """UserError if home is everywhere: each of a hundred views from anywhere passes for it."""
        rng = np.random.default_rng(0)
        views = (self.world.histogram(free_pose(self.world, self.room, rng)) for _ in range(100))
        if all(similarity(model.features(view)) >= self._psi_upper for view in views):
            raise UserError("settings: every view passes for home; more light or a larger multiplier tells them apart")

    def start_pose(self, start: Any) -> Pose | Literal["uniform"]:
        """A start as it is, once it is known to be free. Raises UserError."""
        return "uniform" if isinstance(start, str) and start == "uniform" else self.fitting_pose("start", start)

    def start_of(self, options: dict[str, Any] | None) -> Pose | Literal["uniform"]:
        """Where an episode with these options begins. Raises UserError."""
        start = (options or {}).get("start", self.start)
        return self.robot.pose if isinstance(start, str) and start == "here" else self.start_pose(start)

    def fitting_pose(self, what: str, pose: Any) -> Pose:
        """The pose, heading wrapped, if the robot fits there. Raises UserError, which names `what`, if it does not."""
        try:
            x, y, heading = (float(value) for value in pose)
        except (TypeError, ValueError, OverflowError):
            raise UserError(f"{what} = {shown(pose)}: must be a pose (x, y, heading) in metres and radians") from None
        width, depth = self.room.size
        if not (0 <= x <= width and 0 <= y <= depth and isfinite(heading) and self.world.clearance(x, y) >= 0):
            where = f"choose a pose in free space of room {self.room.name!r}, {width:g} m x {depth:g} m"
            raise UserError(f"{what} = ({x:g}, {y:g}, {heading:g}): the robot does not fit there; {where}")
        return Pose(x, y, wrapped(heading))


def reward(
    step: int, similarity: float, before: float, psi_lower: float, at_wall: bool, settings: Settings, home: bool = False
) -> float:
    """Eq. (16), as `HomingEnv` states it. similarity, before: NRB_t, NRB_(t-1); home: the step ends there."""
    gain = -1 / step if settings.step_cost == "1/t" else -CONSTANT_COST
    if settings.approach_reward and similarity >= psi_lower and before >= psi_lower:
        gain += 2 * similarity - before
    if at_wall:
        gain -= settings.wall_penalty
    return settings.reward_scale * gain + (settings.terminal_bonus if home else 0.0)
