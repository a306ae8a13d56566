"""The list of studies: which settings, which seeds, and why. `sweep` computes them.

What the paper leaves open was searched once, on seeds 0-99 (`CALIBRATION`, then `FINALISTS`), and became the defaults
of `Settings`. Here stand the headline, those two, the lattices, and who does not learn; all others stand with the
question that they answer (`questions/`).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.settings import Settings
from homing_lib.study import questions
from homing_lib.study.measures import curve, totals, views
from homing_lib.study.runs import DATA, Measure, Study, load_table

HEADLINE_SEEDS = range(1000, 1005)

FIRST, THEN = range(20), range(20, 100)
"""For choices: all candidates drive with the first, the best of them with the others."""

ROBOTS, ROOM_ROBOTS, CAMERA_ROBOTS = range(10_000, 11_500), range(10_000, 10_500), range(10_000, 10_050)
"""For what is judged: in the paper's room, in each other room, with the camera."""

ROOMS = ("paper", "divided", "attic", "hall", "cell", "workshop")
"""Those that the studies are about. A new room is not among them by itself: each study would become another one, which
its stored table no longer fits."""

UNLIKE = tuple(room for room in ROOMS if room not in ("paper", "divided"))
"""Those unlike the paper's; `divided` is that with a partition."""

LISTED: dict[str, Study] = {}  # what `study` made, by name


def study(
    name: str,
    reason: str,
    conditions: Mapping[str, Settings] | Callable[[], Mapping[str, Settings]],
    seeds: Sequence[int],
    measure: Measure | None = None,
    atlases: Sequence[Settings] = (),
    deep: bool = False,
    needs: Sequence[Study] = (),
) -> Study:
    """A `Study` on the list of those that `homing studies` shows and `make data` computes, or checks if it is deep."""
    made = Study(name, reason, conditions, seeds, measure, atlases, deep, needs)
    LISTED[name] = made
    return made


def labelled(conditions: Iterable[Settings]) -> dict[str, Settings]:
    """Settings by what varies among them, as a text; `load_table` has it in columns."""
    every = {settings: dict(settings) for settings in conditions}
    varied = [name for name in Settings.model_fields if len({str(values[name]) for values in every.values()}) > 1]
    return {
        " ".join(f"{name}={values[name]}" for name in varied) or "all": settings for settings, values in every.items()
    }


def rows(table: Any, like: Settings | None = None, **values: Any) -> Any:
    """Rows of a study's table with the settings of `like`, and with these values, seeds in order.

    A setting that does not vary among the conditions of a study is no column, and holds. Raises ValueError for a name
    that is neither a column nor a setting, and where there are no such rows.
    """
    asked = {**dict(like or {}), **values}
    if unknown := asked.keys() - {*table} - {*Settings.model_fields}:
        raise ValueError(f"neither a column nor a setting: {', '.join(sorted(unknown))}")
    wanted = {name: value for name, value in asked.items() if name in table}
    for name, value in wanted.items():
        table = table[table[name] == value]
    if table.empty:
        raise ValueError(f"no runs with {wanted}")
    return table.sort_values("seed", kind="stable")


def column(table: Any, name: str, **values: Any) -> Array:
    """A column of those `rows`, one number per robot."""
    return np.asarray(rows(table, **values)[name].to_numpy(float))


# --- The headline, the lattices, and who does not learn --------------------------------------------------------------

_CAMERA = Settings()
_ATLAS = Settings(images="atlas")

HEADLINE = study(
    "headline",
    "Five runs of twenty episodes as the paper reports them, every step kept, and five of uniformly random actions.",
    {"form 2": _CAMERA, "random": _CAMERA.with_changes(controller="random")},
    HEADLINE_SEEDS,
)

LATTICES = {
    "4 cm, 20 degrees": _ATLAS.with_changes(atlas_spacing_m=0.04, atlas_heading_deg=20),
    "3 cm, 15 degrees": _ATLAS.with_changes(atlas_spacing_m=0.03, atlas_heading_deg=15),
    "3 cm, 10 degrees": _ATLAS.with_changes(atlas_spacing_m=0.03),
    "2 cm, 10 degrees": _ATLAS,
}

LATTICE_RUNS = study(
    "lattice-runs",
    "Does learning on an atlas differ from learning with the camera (`learns-camera`), and from which lattice on?",
    LATTICES,
    CAMERA_ROBOTS,
    totals,
)

LATTICE_VIEWS = study(
    "lattice-views",
    "How far does the similarity that an atlas gives stand from the camera's, at random poses?",
    LATTICES,
    HEADLINE_SEEDS,
    views,
)

UNLEARNT = study(
    "unlearnt",
    "How many steps do random actions take in each room, and the climb? Who diverged, or "
    "takes more than random actions in its last five episodes, is lost.",
    labelled(
        Settings(images="atlas", room=room, controller=controller)
        for room in ROOMS
        for controller in ("random", "climb")
    ),
    ROOM_ROBOTS,
    totals,
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


def drawn_from(choices: Mapping[str, tuple[Any, ...]], seed: Any, **fixed: Any) -> dict[str, Settings]:
    """160 settings, drawn at random from these choices, by label. fixed: what all of them have.

    A number for the exploration is the temperature of the normalised mixture.
    """
    rng, candidates = np.random.default_rng(seed), dict[str, Settings]()
    while len(candidates) < 160:
        values = {name: some[rng.integers(len(some))] for name, some in choices.items()} | fixed
        label = " ".join(str(value) for value in values.values())
        explores = values.pop("exploration")
        mixture, tau0 = (explores, 0.03) if isinstance(explores, str) else ("normalised", explores)
        candidates[label] = _ATLAS.with_changes(mixture=mixture, tau0=tau0, **values)
    return candidates


CALIBRATION = study(
    "calibration",
    "What the paper leaves open, searched at random over the choices that its text and the robot allow: 160 settings, "
    "ten seeds each.",
    drawn_from(_CHOICES, 0),
    range(10),
    curve,
)


def calibration_score(table: Any) -> Any:
    """The objective of the calibration: mean steps of episodes 11 to 20, a diverged episode counted as the step cap.

    table: of `CALIBRATION` or the finalists. Returns a series by condition, best first.
    """
    late = table[table.episode > 10]
    steps = late.steps.astype(float).fillna(Settings().max_steps)
    return steps.groupby(late.condition.astype(str)).mean().sort_values(kind="stable")


FINALISTS = study(
    "finalists",
    "The sixteen best settings of the calibration on ninety further seeds: the best of many is flattered by luck.",
    lambda: {label: CALIBRATION.conditions[label] for label in calibration_score(load_table(CALIBRATION)).index[:16]},
    range(10, 100),
    curve,
    needs=[CALIBRATION],
)


def load_questions() -> None:
    """Import every file of `questions/`, which lists its studies and judges."""
    for one in iter_modules(questions.__path__):
        import_module(f"{questions.__name__}.{one.name}")


def in_order() -> Iterator[Study]:
    """All studies, in whichever file they stand, each after those that it needs."""
    load_questions()
    listed = [LISTED[name] for name in sorted(LISTED)]  # whichever module was imported first
    return iter(TopologicalSorter({one: one.needs for one in listed}).static_order())


PAGE = DATA / "STUDIES.md"  # all studies on one page


def page() -> str:
    """All studies on one page of Markdown: reason, seeds, what is kept of a run, and settings of each condition."""
    parts = [
        "# The studies",
        "Written by `make data` from [`homing_lib/study/studies.py`](../homing_lib/study/studies.py) and the files in "
        "[`homing_lib/study/questions`](../homing_lib/study/questions). A condition is the default settings (`homing "
        "settings`), changed as stated.",
    ]
    for one in in_order():
        seeds = f"{min(one.seeds)} to {max(one.seeds)}"
        scope = f"Seeds {seeds}, {len(one.conditions)} conditions. Kept of a run: {one.definition()['measure']}."
        scope += " `make deep` computes it, nothing else." * one.deep
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
