"""Every number of the model in one place: frozen, validated, and each with its source.

A field's description opens with the equation or table that gives it, or with "declared" where the paper is silent, and
the reason where there is one. `printed` in a field's extra is what the paper prints, where it does.
"""

import hashlib
from collections.abc import Callable
from functools import partial
from math import radians
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from homing_lib.errors import UserError, nearest, shown
from homing_lib.features import Array, Centre, Variance, bins_per_channel
from homing_lib.lambdas import rule_named
from homing_lib.policy import Mixture, decrease_rate
from homing_lib.rooms import room_named
from homing_lib.sarsa import Update

CONTROLLERS = ["sarsa", "random", "climb"]  # and others, if `agent.register` has been told of them


def _known(controller: str) -> str:
    if controller not in CONTROLLERS:
        raise ValueError(f"must be one of {', '.join(CONTROLLERS)}{nearest(controller, CONTROLLERS)}")
    return controller


_Controller = Annotated[str, AfterValidator(_known)]
_Rule = Annotated[str, BeforeValidator(lambda text: str(rule_named(text)))]
_Room = Annotated[str, AfterValidator(lambda name: room_named(name).name)]


def _field(default: Any, about: str, printed: Any = None, scope: str = "", added: bool = False, **bounds: Any) -> Any:
    extra: dict[str, Any] = {"printed": printed, "scope": scope, "added": added}
    return Field(default, description=about, json_schema_extra=extra, **bounds)


_view = partial(_field, scope="view")  # what is seen, felt and touched at a pose depends on it
_lattice = partial(_field, scope="lattice")  # where an atlas has its poses
_survey = partial(_field, scope="survey")  # beyond these, what the robot knows of home before it learns
_added = partial(_field, added=True)  # added since runs were stored: its default is left out of dumps and digests


class Settings(BaseModel):
    """The model, its world and how an experiment is run. `Settings()` is the default; `with_changes` derives others.

    Values may be given as strings. Raises UserError, in one line, for an unknown field or a value out of range.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise UserError("; ".join(_one_line(problem) for problem in error.errors())) from None

    # --- Table I -------------------------------------------------------------------------------------------------
    episodes: int = _field(20, "Table I, EP: episodes of a run", "20", ge=1, le=1_000_000)
    alpha0: float = _field(
        1.25e-3,
        "Table I, alpha_0: initial step size. Three values are printed; calibration picked the one of section IV.A",
        "1.25e-2 (table), 1.25e-3 (text), 0.1/(2 EP^2) = 1.25e-4 (formula)",
        ge=1e-9,
    )
    epsilon0: float = _field(0.3, "Table I, epsilon_0: initial exploration, a probability", "0.3 EP = 6", ge=0, le=1)
    first_episode_share: float = _field(0.3, "Table I, ep_0: as a share of EP (eq. 23)", "0.3 EP = 6", ge=0, le=1e9)
    discount: float = _field(1.0, "Table I, gamma", "1", ge=0, le=1)
    snapshots: int = _survey(1, "Table I, m: views of home that the robot stores", "1", ge=1, le=3)
    bin_size: int = _view(3, "Table I, b: intensities per histogram bin (eq. 14)", "3", ge=1, le=128)
    multiplier: float = _field(12.0, "Eq. (19): that of psi_upper", "11 and 12: .904 and .908", ge=2, le=1e9)

    # --- The algorithm (Fig. 2) ----------------------------------------------------------------------------------
    lambda_rule: _Rule = _field("fletcher-reeves", "Eq. (7), Fig. 2: form 2; others: `lambdas.lambda_spec`", "form 2")
    theta0: float = _field(1.0, "Fig. 2: initial value of every weight", "1")
    traces: Literal["accumulating"] = _field("accumulating", "Eq. (17)", "accumulating")
    update: Update = _field("taken", "Eq. (18): weights of the taken action, or of all as is standard", "taken")
    bootstrap_terminal: bool = _field(True, "Fig. 2 has no terminal case: home is valued like any view", "True")
    overwrite_features: bool = _field(False, "Fig. 2 overwrites phi_t before keeping it: phi_(t-1) = phi_t", "True")

    # --- Exploration (section III.I) ------------------------------------------------------------------------------
    mixture: Mixture = _field(
        "epsilon-greedy", "Eq. (22); calibrated: eq. (21) alone; `normalised`: both components weigh alike", "literal"
    )
    tau0: float = _field(0.03, "Eq. (20), declared: initial tau; not for `epsilon-greedy`", ge=1e-6, le=1e6)

    # --- Reward (section III.E, V.A) -------------------------------------------------------------------------------
    step_cost: Literal["1/t", "constant"] = _field("1/t", "Eq. (16): 1/t; `constant`: its mean over t = 1..100", "1/t")
    approach_reward: bool = _field(True, "Eq. (16): 2 NRB_t - NRB_(t-1) while both reach psi_lower", "True")
    wall_penalty: float = _field(0.1, "V.A, declared, calibrated: per step at a wall; printed: high", ge=0, le=1e6)
    learn_at_walls: bool = _field(True, "V.A: learning goes on during the reactive behaviour", "True")
    reward_scale: float = _added(1.0, "Declared: factor of reward and penalty, not of the bonus", ge=-1e6, le=1e6)
    terminal_bonus: float = _added(0.0, "Declared: paid on reaching home, unscaled; printed: none", ge=-1e6, le=1e6)
    band: float = _added(1.0, "Section III.H: the multiplier of psi_upper less that of psi_lower", gt=0)

    # --- Features (section III.B) ------------------------------------------------------------------------------------
    variance: Variance = _survey(
        "pooled", "Eq. (12), calibrated: one for all bins; one per bin (eq. 8) makes home smaller than a step", "both"
    )
    centre: Centre = _survey("mean", "Eq. (9), declared: about the mean; `zero` is as printed", "zero")
    survey_steps: int = _survey(2000, "Eq. (9), T, declared: random steps that estimate sigma^2", ge=2, le=100_000)
    variance_floor_pixels: float = _survey(1.0, "Declared: least sigma, in pixels: no bin is lost", ge=1e-3, le=1e6)
    snapshot_angle_deg: float = _survey(20.0, "Declared: from the first snapshot to two further ones", ge=1, le=90)

    # --- Camera ---------------------------------------------------------------------------------------------------
    image_size: int = _view(64, "Declared: pixels on a side, the simulator's Khepera camera", ge=8, le=512)
    field_of_view_deg: float = _view(45.0, "Declared: the simulator's Khepera camera", ge=10, le=120)
    camera_height_m: float = _view(0.035, "Declared: on top of the 30 mm body", ge=0.001, le=0.3)
    camera_offset_m: float = _view(-0.010, "Declared: along the heading from the centre", ge=-0.03, le=0.03)
    light: float = _view(1.0, "Declared: brightness; others than 1 test robustness", ge=0.01, le=2)

    # --- Robot (Khepera II) and its three actions ---------------------------------------------------------------------
    wheel_base_m: float = _survey(0.053, "Declared: Khepera II", ge=0.001, le=0.07)
    body_diameter_m: float = _view(0.070, "Section IV: 70 mm in diameter", "70 mm", ge=0.001, le=0.2)
    forward_m: float = _survey(0.040, "Declared, calibrated: both wheels' way in one forward action", ge=0.001, le=0.2)
    turn_deg: float = _survey(20.0, "Declared, calibrated: rotation of one left or right action", ge=1, le=90)
    turn_advance_m: float = _survey(0.030, "Declared, calibrated: the centre's way in such an action", ge=0, le=0.2)
    infrared_range_m: float = _view(0.050, "Declared: Khepera II", ge=0.001, le=0.5)
    clear_way_m: float = _survey(0.045, "Declared: the reactive turn ends when all front sensors see this far", ge=0)
    wheel_slip: float = _survey(0.0, "Declared: standard deviation of a wheel's way, as a share of it", ge=0, le=0.5)

    # --- Experiment ------------------------------------------------------------------------------------------------
    room: _Room = _survey("paper", "Section IV: the room of 1.15 m x 1 m; in others the findings are tested")
    start: Literal["room", "uniform"] = _added("room", "Section IV: the room's; or drawn anew from all free poses")
    controller: _Controller = _field("sarsa", "Fig. 2, or what it is measured against", "sarsa")
    images: Literal["camera", "atlas", "compact"] = _survey(
        "camera",
        "Declared: rendered at every step, looked up on a lattice, or on the coarser one that ships with the library",
    )
    atlas_spacing_m: float = _lattice(0.02, "Declared: between neighbouring positions of the atlas", ge=0.005, le=0.1)
    atlas_heading_deg: int = _lattice(10, "Declared: between neighbouring headings of it, a divisor of 360", ge=1)
    max_steps: int = _field(2000, "Declared: a longer episode is cut, and counted as truncated", ge=1, le=1_000_000)

    @pydantic.model_validator(mode="after")
    def _consistent(self) -> "Settings":
        if self.clear_way_m > (reach := self.infrared_range_m):
            raise ValueError(f"clear_way_m = {self.clear_way_m}: must not exceed infrared_range_m = {reach}")
        if 360 % self.atlas_heading_deg:
            raise ValueError(f"atlas_heading_deg = {self.atlas_heading_deg}: must divide 360")
        if self.band >= self.multiplier:
            raise ValueError(f"band = {self.band:g}: must be less than multiplier = {self.multiplier:g}")
        return self

    @pydantic.model_serializer(mode="wrap")
    def _without_added_defaults(self, whole: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        return {name: value for name, value in whole(self).items() if value != _LEFT_OUT.get(name)}

    @property
    def first_episode(self) -> float:
        """ep_0 of eq. (23)."""
        return self.first_episode_share * self.episodes

    @property
    def n_features(self) -> int:
        """n of eq. (14): 258 for b = 3, m = 1 (Fig. 2 says about 256)."""
        return 3 * bins_per_channel(self.bin_size) * self.snapshots

    @property
    def wheel_commands_m(self) -> tuple[tuple[float, float], ...]:
        """The way of the (left, right) wheel for Left_Forward, Right_Forward and Go_Forward (section III.D)."""
        difference = radians(self.turn_deg) * self.wheel_base_m / 2
        slow, fast = self.turn_advance_m - difference, self.turn_advance_m + difference
        return (slow, fast), (fast, slow), (self.forward_m, self.forward_m)

    @property
    def step_size_rates(self) -> Array:
        """Eq. (23): the step size of each episode as a share of alpha_0, shape (episodes,)."""
        return np.array([decrease_rate(episode, self.first_episode) for episode in range(1, self.episodes + 1)])

    def of_scope(self, *scopes: str) -> dict[str, Any]:
        """The fields tagged "view", "lattice" or "survey", by name."""
        return {name: getattr(self, name) for name, extra in _EXTRAS.items() if extra["scope"] in scopes}

    def with_changes(self, **changes: Any) -> "Settings":
        """A validated copy with some fields changed."""
        return Settings(**{**self.model_dump(), **changes})

    @property
    def digest(self) -> str:
        """A short name of these settings: twelve hexadecimal digits of a hash over what `model_dump` has."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:12]


_EXTRAS: dict[str, Any] = {name: field.json_schema_extra for name, field in Settings.model_fields.items()}
_LEFT_OUT = {name: Settings.model_fields[name].default for name, extra in _EXTRAS.items() if extra["added"]}


def _one_line(problem: Any) -> str:
    name = ".".join(str(part) for part in problem["loc"])
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        like = nearest(name, Settings.model_fields)
        return f"setting {shown(name)[1:-1]}: there is none of this name; `homing settings` lists them{like}"
    return f"setting {name} = {shown(problem['input'])}: {message}" if name else f"settings: {message}"
