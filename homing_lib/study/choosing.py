"""Choices, of step sizes above all: made by halving, on seeds that nothing is judged by, and stored.

All candidates drive with a few seeds; the best of each group drive with the others; the best of these is chosen. What
counts is the mean of a robot's total steps, with an episode cut at `CUT`: else a single lost robot would choose.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

from homing_lib.settings import Settings
from homing_lib.study.measures import totals
from homing_lib.study.runs import Measure, Study, load_table
from homing_lib.study.studies import FIRST, THEN, Later, labelled, rows

STEP_SIZES = (1.25e-4, 4e-4, 1.25e-3, 4e-3, 1.25e-2)
"""A factor of about 3 apart. In no room does any rule choose the first or the last."""


def but_for_the_step_size(settings: Settings) -> str:
    """A group: candidates that are alike but for the step size compete."""
    return settings.with_changes(alpha0=Settings().alpha0).digest


class Choice:
    """Candidates in groups; those of a group compete.

    first, second: the two studies, data/<name>.parquet and data/<name>-best.parquet. candidates: settings, or what
    returns them once the studies that it `needs` are there. keep: how many of a group come to the second study, which
    takes the seeds `then`.
    """

    def __init__(
        self,
        name: str,
        reason: str,
        candidates: Sequence[Settings] | Callable[[], Sequence[Settings]],
        group: Callable[[Settings], Any] = but_for_the_step_size,
        *,
        measure: Measure = totals,
        keep: int = 2,
        seeds: Sequence[int] = FIRST,
        then: Sequence[int] = THEN,
        needs: Sequence[Any] = (),
    ) -> None:
        self._group = group

        def first() -> Study:
            every = candidates() if callable(candidates) else candidates
            return Study(name, f"{reason} All candidates.", labelled(every), seeds, measure)

        def second() -> Study:
            best = [settings for group in self._ranked(self.first()).values() for settings, _ in group[:keep]]
            best_only = f"{reason} The best {keep} of each in `{name}`, on further seeds."
            return Study(f"{name}-best", best_only, labelled(best), then, measure)

        first.__qualname__, second.__qualname__ = name, f"{name}-best"  # listed alike whichever file comes first
        self.first = Later(needs, first)
        self.second = Later([self.first], second)
        self._best = cache(lambda: self._ranked(self.second()))
        self._table = cache(lambda: load_table(self.second()))

    def _ranked(self, study: Study) -> dict[Any, list[tuple[Settings, float]]]:
        """Of each group, settings and scores, best first."""
        score = load_table(study).groupby("condition", observed=True).cut.mean()
        groups: dict[Any, list[tuple[Settings, float]]] = {}
        for label, settings in study.conditions.items():
            groups.setdefault(self._group(settings), []).append((settings, float(score[label])))
        return {group: sorted(some, key=lambda one: one[1]) for group, some in groups.items()}

    def best(self, like: Settings) -> Settings:
        """What was chosen in the group of these settings."""
        return self._best()[self._group(like)][0][0]

    def score(self, like: Settings) -> float:
        """Mean total steps of what was chosen, on the second seeds, episodes cut."""
        return self._best()[self._group(like)][0][1]

    def robots(self, like: Settings) -> Any:
        """Rows of what was chosen in the table of the second study, seeds in order."""
        chosen = self.best(like)
        return rows(self._table(), condition=next(k for k, one in self.second().conditions.items() if one == chosen))
