"""The studies: which settings, which seeds, and why. `runs.py` runs and stores them.

What the paper leaves open was searched once, on seeds 0-99 (`CALIBRATION`, then `finalists`), and became the defaults
of `Settings`. Everything that is judged runs on seeds from 1000 up. Further studies stand with those who judge by them:
why it learns in `mechanism`, what the reward does in `readings`, what it is worth in `opponents`.
"""

import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from typing import Any

import numpy as np
import pandas as pd

from homing_lib.settings import Settings
from homing_lib.study.measures import TRIAL_LIGHTS, episodes, shortest, totals, trials, views
from homing_lib.study.runs import DATA, Measure, Study, episodes_of, load_table

JUDGED = range(1000, 1050)

FRESH = range(2000, 2050)
"""For questions that were asked once the runs of `JUDGED` had been seen."""

CHOOSE, THEN = range(20), range(20, 100)
"""For choices: all candidates drive with the first, the best of them with the others."""

ROBOTS, ROOM_ROBOTS, CAMERA_ROBOTS = range(10_000, 11_500), range(10_000, 10_500), range(10_000, 10_050)
"""For what is judged: in the paper's room, in each other room, with the camera."""

ROOMS = ("paper", "divided", "attic", "hall", "cell", "workshop")
UNLIKE = ("attic", "hall", "cell", "workshop")  # the paper's; `divided` is that with a partition

_LISTED: dict[str, "Study | Later"] = {}


def study(
    name: str,
    reason: str,
    conditions: Mapping[str, Settings],
    seeds: Sequence[int] = JUDGED,
    measure: Measure | None = episodes,
    atlases: Sequence[Settings] = (),
) -> Study:
    """A `Study` on the list of those that `homing studies` shows and `make data` computes."""
    made = Study(name, reason, conditions, seeds, measure, atlases)
    _LISTED[name] = made
    return made


class Later:
    """A study that depends on the tables of others: calling this makes it. It is listed, after those that it needs."""

    def __init__(self, needs: Iterable[Any], make: Callable[[], Study]) -> None:
        self.needs, self._make = list(needs), cache(make)
        _LISTED[f"later {len(_LISTED)}"] = self

    def __call__(self) -> Study:
        """The study. Raises UserError if a table that it needs is not there."""
        return self._make()


def later(*needs: Any) -> Callable[[Callable[[], Study]], Later]:
    """Stands above a function that makes a study from the tables of those that it needs."""
    return lambda make: Later(needs, make)


def labelled(conditions: Iterable[Settings]) -> dict[str, Settings]:
    """Settings by what varies among them, as a text; `load_table` has it in columns."""
    every = [dict(settings) for settings in dict.fromkeys(conditions)]
    varied = [name for name in every[0] if len({str(values[name]) for values in every}) > 1]
    return {" ".join(f"{name}={values[name]}" for name in varied) or "all": Settings(**values) for values in every}


UNLEARNT = study(
    "unlearnt",
    "How many steps do random actions take in each room, and the climb? Who takes more than random actions in its last "
    "five episodes is lost.",
    labelled(
        Settings(images="atlas", room=room, controller=controller)
        for room in ROOMS
        for controller in ("random", "climb")
    ),
    ROOM_ROBOTS,
    totals,
)


def rows(table: Any, **settings: Any) -> Any:
    """Rows of a study's table with these settings, seeds in order. What does not vary in it is no column, and holds."""
    for name, value in settings.items():
        if name in table:
            table = table[table[name] == value]
    if table.empty:
        raise ValueError(f"no runs with {settings}")
    return table.sort_values("seed", kind="stable")


# --- What is judged --------------------------------------------------------------------------------------------------

_CAMERA = Settings()
_ATLAS = Settings(images="atlas")
_COARSER = _ATLAS.with_changes(atlas_spacing_m=0.03)
"""For studies that need several atlases: half as many views. Notebook 5 holds it against the camera, too."""

HEADLINE = study(
    "headline",
    "Five runs of twenty episodes as the paper reports them, every step kept, and five of uniformly random actions.",
    {"form 2": _CAMERA, "random": _CAMERA.with_changes(controller="random")},
    range(1000, 1005),
)

RULES = {
    "form 1": "hestenes-stiefel",
    "form 1, printed sign": "hestenes-stiefel:printed",
    "form 2": "fletcher-reeves",
    "form 3": "polak-ribiere",
} | {f"fixed {value:g}": f"fixed:{value:g}" for value in (0.0, 0.25, 0.5, 0.75, 0.9, 0.95, 1.0)}

CAMERA = study(
    "camera",
    "The headline in fifty runs, with the camera: what the lattices are held against. Other rules are left to them "
    "(`lambda-map`), but for those of `mechanism-camera`.",
    {"form 2": _CAMERA},
)

STEP_SIZES = (1.25e-4, 4e-4, 1.25e-3, 4e-3, 1.25e-2)

LAMBDA_MAP = study(
    "lambda-map",
    "Forms and fixed lambdas over step sizes, among them the three that the paper prints (E4): who is best at its own "
    "best step size, and who survives a large one?",
    {
        f"{label} @ {alpha:g}": _ATLAS.with_changes(lambda_rule=rule, alpha0=alpha)
        for label, rule in RULES.items()
        for alpha in STEP_SIZES
    },
)

AS_PRINTED: dict[str, dict[str, Any]] = {
    "E3 form 1": {"lambda_rule": "hestenes-stiefel"},
    "E3 form 1, printed sign": {"lambda_rule": "hestenes-stiefel:printed"},
    "E4 alpha_0 of the table": {"alpha0": 1.25e-2},
    "E4 alpha_0 of the text": {"alpha0": 1.25e-3},
    "E4 alpha_0 of the formula": {"alpha0": 1.25e-4},
    "E5 epsilon_0 at its bound": {"epsilon0": 1.0},
    "E9 sigma^2 about zero": {"centre": "zero"},
    "E9 sigma^2 per bin": {"variance": "per-bin"},
    "E9 sigma^2 per bin, about zero": {"variance": "per-bin", "centre": "zero"},
    "E12 features overwritten": {"overwrite_features": True},
    "E13 lambda 1 where undefined": {"lambda_rule": "fletcher-reeves:on_zero=1"},
    "E18 mixture as printed, tau 1": {"mixture": "literal", "tau0": 1.0},
    "E18 mixture as printed, tau .03": {"mixture": "literal", "tau0": 0.03},
    "E18 mixture normalised, tau .03": {"mixture": "normalised"},
    "E19 home masked": {"bootstrap_terminal": False},
    "E20 all actions updated": {"update": "all"},
    "theta_0 = 0": {"theta0": 0.0},
    "theta_0 = .1": {"theta0": 0.1},
}
"""Each reading of the print alone, as a change of the defaults."""

PRINTED = study(
    "printed",
    "What does each error of the print, and each reading of it, change? One at a time against the defaults.",
    {"default": _ATLAS} | {label: _ATLAS.with_changes(**changes) for label, changes in AS_PRINTED.items()},
)

PARTS = study(
    "parts",
    "What does each part of the model contribute? One at a time taken away or changed.",
    {
        "default": _COARSER,
        "no approach reward": _COARSER.with_changes(approach_reward=False),
        "constant cost": _COARSER.with_changes(step_cost="constant"),
        "no wall penalty": _COARSER.with_changes(wall_penalty=0.0),
        "wall penalty 1": _COARSER.with_changes(wall_penalty=1.0),
        "wall penalty 5": _COARSER.with_changes(wall_penalty=5.0),
        "no learning at walls": _COARSER.with_changes(learn_at_walls=False),
        "constant exploration and step size": _COARSER.with_changes(first_episode_share=1e6),
        "three snapshots": _COARSER.with_changes(snapshots=3),
        "bins of 6": _COARSER.with_changes(bin_size=6),
        "bins of 16": _COARSER.with_changes(bin_size=16),
        "30 degrees of view": _COARSER.with_changes(field_of_view_deg=30.0),
        "60 degrees of view": _COARSER.with_changes(field_of_view_deg=60.0),
        "wheels that slip by a tenth": _COARSER.with_changes(wheel_slip=0.1),
    },
)

AFTER = study(
    "after",
    "After learning: is home reached from everywhere, by a kidnapped robot, in another light?",
    {"20 episodes": _COARSER, "100 episodes": _COARSER.with_changes(episodes=100)},
    range(1000, 1020),
    trials,
    [_COARSER.with_changes(light=light) for light in TRIAL_LIGHTS],
)

ROBUST = study(
    "robust",
    "The same settings with a partition in the way, and in another room.",
    {
        f"{room}, {controller}": _COARSER.with_changes(room=room, controller=controller)
        for room in ("paper", "divided", "attic")
        for controller in ("sarsa", "random")
    },
)

LONG = study(
    "long",
    "Two hundred episodes: what do twenty leave undone?",
    {
        label: _ATLAS.with_changes(episodes=200, lambda_rule=RULES[label])
        for label in ("form 2", "fixed 0", "fixed 0.5", "fixed 0.9")
    },
)

REFERENCES = study(
    "references",
    "What does one do without learning: random actions, or a walk up the similarity (the snapshot-homing idea)?",
    {
        "learnt": _ATLAS,
        "random": _ATLAS.with_changes(controller="random"),
        "walk up the similarity": _ATLAS.with_changes(controller="climb"),
    },
)

SHORTEST = study(
    "shortest", "The least number of steps that the robot's actions allow.", {"shortest": _ATLAS}, JUDGED[:10], shortest
)

LATTICES = {
    "4 cm, 20 degrees": _ATLAS.with_changes(atlas_spacing_m=0.04, atlas_heading_deg=20),
    "3 cm, 15 degrees": _ATLAS.with_changes(atlas_spacing_m=0.03, atlas_heading_deg=15),
    "3 cm, 10 degrees": _COARSER,
    "2 cm, 10 degrees": _ATLAS,
}

LATTICE_RUNS = study(
    "lattice-runs",
    "Does learning on an atlas differ from learning with the camera (`camera`), and from which lattice on?",
    LATTICES,
)

LATTICE_VIEWS = study(
    "lattice-views",
    "How far does the similarity that an atlas gives stand from the camera's, at random poses?",
    LATTICES,
    range(1000, 1005),
    views,
)

# --- Calibration, on seeds that nothing is judged by -----------------------------------------------------------------

_CHOICES: dict[str, tuple[Any, ...]] = {
    "alpha0": (1.25e-4, 1.25e-3, 3e-3, 1.25e-2),
    "exploration": (0.01, 0.02, 0.03, 0.05, 0.1, "epsilon-greedy"),
    "wall_penalty": (0.1, 0.3, 1.0, 3.0),
    "variance": ("pooled", "per-bin"),
    "forward_m": (0.04, 0.06),
    "turn_deg": (20.0, 30.0, 45.0),
    "turn_advance_m": (0.03, 0.06),
}


def _candidates(count: int = 160) -> dict[str, Settings]:
    """Settings drawn at random from the choices above, by label."""
    rng = np.random.default_rng(0)
    drawn: dict[str, Settings] = {}
    while len(drawn) < count:
        values = {name: choices[rng.integers(len(choices))] for name, choices in _CHOICES.items()}
        label = " ".join(str(value) for value in values.values())
        exploration = values.pop("exploration")
        mixture, tau0 = (exploration, 0.03) if isinstance(exploration, str) else ("normalised", exploration)
        drawn[label] = _ATLAS.with_changes(mixture=mixture, tau0=tau0, **values)
    return drawn


CALIBRATION = study(
    "calibration",
    "What the paper leaves open, searched at random over the choices that its text and the robot allow: 160 settings, "
    "ten seeds each.",
    _candidates(),
    range(10),
    episodes,
)


def calibration_score(table: Any) -> Any:
    """The objective of the calibration: mean steps of episodes 11 to 20, a diverged episode counted as the step cap.

    table: of `CALIBRATION` or the finalists. Returns a series by condition, best first.
    """
    scores = {label: episodes_of(table, label)[:, 10:].mean() for label in sorted(table.condition.unique())}
    return pd.Series(scores).sort_values(kind="stable")


@later(CALIBRATION)
def finalists() -> Study:
    """The sixteen best of the calibration on ninety more seeds, since the best of many is flattered by luck."""
    best = calibration_score(load_table(CALIBRATION)).index[:16]
    return Study(
        "finalists",
        "The sixteen best settings of the calibration on ninety further seeds: the best of many is flattered by luck.",
        {label: CALIBRATION.conditions[label] for label in best},
        range(10, 100),
        episodes,
    )


def in_order() -> Iterator[Study]:
    """All studies, in whichever file they stand, each after those that it needs."""
    import homing_lib.study.questions
    from homing_lib.study import judges, mechanism, opponents, readings  # noqa: F401, which list theirs when imported

    for module in pkgutil.iter_modules(homing_lib.study.questions.__path__):
        import_module(f"homing_lib.study.questions.{module.name}")
    listed = sorted(_LISTED.values(), key=lambda one: isinstance(one, Later))
    order = TopologicalSorter({one: one.needs if isinstance(one, Later) else () for one in listed})
    return (one() if isinstance(one, Later) else one for one in order.static_order())


PAGE = DATA / "STUDIES.md"  # all studies on one page


def page() -> str:
    """That page, in Markdown: of each study the reason, the seeds, what is kept, and the settings of its conditions."""
    parts = [
        "# The studies",
        "Written by `make data` from [`homing_lib/study/studies.py`](../homing_lib/study/studies.py). A condition is "
        "the default settings (`homing settings`), changed as stated.",
    ]
    for one in in_order():
        seeds = f"{min(one.seeds)} to {max(one.seeds)}"
        scope = f"Seeds {seeds}, {len(one.conditions)} conditions. Kept of a run: {one.measured}."
        parts += [f"## {one.name}", one.reason, scope, _conditions(one)]
    return "\n\n".join(parts) + "\n"


def _conditions(of: Study) -> str:
    """The conditions of a study as a table; more than twenty as the values that each setting takes."""
    default = dict(Settings())
    every = [dict(settings) for settings in of.conditions.values()]
    taken = {name: sorted({values[name] for values in every}) for name in default}
    shared = [f"`{name} = {one}`" for name, (one, *more) in taken.items() if not more and one != default[name]]
    varied = {name: values for name, values in taken.items() if len(values) > 1}
    if len(every) > 20:
        rows = ["| setting | values |", "|---|---|"]
        rows += [f"| `{name}` | {', '.join(f'`{v}`' for v in values)} |" for name, values in varied.items()]
    else:
        rows = ["| condition | settings |", "|---|---|"]
        for label, values in zip(of.conditions, every, strict=True):
            changed = [f"`{name} = {values[name]}`" for name in varied if values[name] != default[name]]
            rows.append(f"| {label} | {', '.join(changed) or 'as by default'} |")
    return "\n".join([f"All with {', '.join(shared)}.\n"] * bool(shared) + rows)
