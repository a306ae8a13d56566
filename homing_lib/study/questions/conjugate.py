"""How much conjugate gradient is left on the robot?"""

from itertools import islice
from typing import Any

import numpy as np

from homing_lib.features import Array
from homing_lib.lambdas import lambda_spec
from homing_lib.settings import Settings
from homing_lib.study.engine import run
from homing_lib.study.findings import Comparison, Judged, by_construction, compare_to_limit, estimate, question, side_of
from homing_lib.study.runs import Columns
from homing_lib.study.studies import CAMERA_ROBOTS, labelled, rows, study
from homing_lib.study.theorem import beta

AGREES = 1e-9
"""How far two directions that are the same may differ, relative to their length: rounding, over some hundred steps."""


class Watched:
    """A lambda rule that computes beside its own what conjugate gradient would do at the same steps.

    follows: of every step but an episode's first, two answers: does the update, of the action taken or of all, point
    where conjugate gradient does, if that was begun at the episode's first step, and if at the last restart, where
    lambda was reset to 0? A step's delta phi is the descent direction g; p = g + beta p_prev.
    """

    def __init__(self, name: str, update: str) -> None:
        self._form, self._rule, self._update = lambda_spec(name).name, lambda_spec(name).rule, update
        self._phi: Array = np.empty(0)
        self.follows: list[tuple[bool, bool]] = []

    def __call__(
        self, *, delta: float, phi: Array, delta_prev: float, phi_prev: Array, trace_prev: Array, discount: float
    ) -> float:
        if phi_prev is not self._phi:  # the second step of an episode: the first went along its own gradient
            self._strict = self._restarted = delta_prev * phi_prev
        self._phi = phi
        g, g_prev = delta * phi, delta_prev * phi_prev
        ratio = self._rule(
            delta=delta, phi=phi, delta_prev=delta_prev, phi_prev=phi_prev, trace_prev=trace_prev, discount=discount
        )
        lambda_t = min(max(0.0, ratio), 1.0)
        done = delta * (discount * lambda_t * trace_prev + phi)
        if self._update == "taken":
            done = (done.reshape(3, -1) * (phi.reshape(3, -1) != 0).any(axis=1, keepdims=True)).ravel()
        form: Any = self._form
        self._strict = g + beta(form, g, g_prev, self._strict) * self._strict
        self._restarted = g if ratio < 0 else g + beta(form, g, g_prev, self._restarted) * self._restarted
        self.follows.append((_agree(done, self._strict), _agree(done, self._restarted)))
        return ratio


def _agree(done: Array, wanted: Array) -> bool:
    return bool(np.linalg.norm(done - wanted) <= AGREES * np.linalg.norm(wanted))


def directions(settings: Settings, seed: int) -> Columns:
    """Where a run's updates point: those of the settings, of the action taken or of all.

    One row per episode: its `steps`; of them, those before the first whose lambda was reset (`unclipped`), those before
    the direction first leaves that of conjugate gradient (`until`), those that follow it in all (`follows`), and those
    that follow it since the last restart (`restarted`); and those whose lambda was reset to 0 and to 1 (`to_0`,
    `to_1`).
    """
    watched = Watched(settings.lambda_rule, settings.update)
    result = run(settings, seed, lambda_rule=watched)
    follows, table = iter(watched.follows), []
    # A rule that is undefined somewhere would be out of step with the episodes.
    assert result.diverged or len(watched.follows) == (result.lengths - 1).sum()
    for length, end in zip(result.lengths, result.ended, strict=True):
        reset, value = (result.column(name)[end - length : end] for name in ("clipped", "lambda"))
        strict, restarted = np.array([(True, True), *islice(follows, int(length) - 1)]).T
        until = np.logical_and.accumulate(strict).sum()
        unclipped = (~np.logical_or.accumulate(reset > 0)).sum()
        resets = [((reset > 0) & (value == bound)).sum() for bound in (0, 1)]
        table.append((length, unclipped, until, strict.sum(), restarted.sum(), *resets))
    names = ("steps", "unclipped", "until", "follows", "restarted", "to_0", "to_1")
    return dict(zip(names, np.array(table, dtype=float).reshape(-1, len(names)).T, strict=True))


UPDATES = ("taken", "all")

DIRECTIONS = study(
    "conjugate",
    "For how many steps of a run do the updates point where conjugate gradient does?",
    labelled(Settings(images="atlas", update=update) for update in UPDATES),
    CAMERA_ROBOTS,
    directions,
)


@question(
    "conjugate",
    "Is conjugate gradient what the robot does?",
    """Learning on. The share of a robot's steps that come before its episode first leaves the direction of conjugate
    gradient, under the paper's update: "hardly", if it is below 5 % with the whole interval; "mostly", if above 50 %;
    "in part", if between; else "undecided". Beside it: what follows conjugate gradient since the last restart, and what
    becomes of lambda.""",
    DIRECTIONS,
    order=5,
)
def conjugate(table: Any) -> Judged:
    found: dict[str, Comparison] = {}
    for update in UPDATES:
        sums = rows(table, update=update).groupby("seed").sum(numeric_only=True)
        shares = {name: (sums[name] / sums.steps).to_numpy(float) for name in ("until", "restarted", "to_0", "to_1")}
        found |= {f"{update}.{name}": estimate(share) for name, share in shares.items()}
        if update == "taken":
            found["taken.until"] = compare_to_limit(shares["until"], 0.05)
    until = found["taken.until"]
    verdict = {("below", "below"): "hardly", ("above", "below"): "in part", ("above", "above"): "mostly"}
    return verdict.get((side_of(until, 0.05), side_of(until, 0.5)), "undecided"), found


@question(
    "C1",
    "TD-conj, as the paper calls its learner, is TD(lambda) with the lambda of eq. (7).",
    """By construction, if with all weights updated no episode leaves the direction of conjugate gradient before its
    first reset of lambda; else contradicted.""",
    DIRECTIONS,
)
def equivalence(table: Any) -> Judged:
    every = rows(table, update="all")
    return by_construction((every.until >= every.unclipped).all()), {}
