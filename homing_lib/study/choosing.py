"""Choices, of step sizes above all: made by halving, on seeds that nothing is judged by, and stored.

All candidates drive with a few seeds; the best of each group drive with the others; the best of these is chosen. What
counts is the mean of a robot's total steps, with an episode cut at `CUT`: else a single lost robot would choose.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

from homing_lib.settings import Settings
from homing_lib.study.measures import totals
from homing_lib.study.runs import Measure, Study, load_table
from homing_lib.study.studies import FIRST, THEN, labelled, rows, study

STEP_SIZES = (1.25e-4, 4e-4, 1.25e-3, 4e-3, 1.25e-2)
"""A factor of about 3 apart. In no room does any rule choose the first or the last."""

Candidates = Mapping[Any, Sequence[Settings]]
"""By the names of groups, of which the candidates of each compete."""


class Choice:
    """Candidates in groups; those of a group compete.

    first, second: the two studies, data/<name>.parquet and data/<name>-best.parquet. candidates: by the names of their
    groups, or what returns them once the studies that it `needs` are there. keep: how many of a group come to the
    second study, which takes the seeds `then`.
    """

    def __init__(
        self,
        name: str,
        reason: str,
        candidates: Candidates | Callable[[], Candidates],
        *,
        measure: Measure = totals,
        keep: int = 2,
        seeds: Sequence[int] = FIRST,
        then: Sequence[int] = THEN,
        needs: Sequence[Study] = (),
    ) -> None:
        self._groups = cache(candidates if callable(candidates) else lambda: candidates)

        def every() -> dict[str, Settings]:
            return labelled(one for several in self._groups().values() for one in several)

        def best() -> dict[str, Settings]:
            return labelled(one for ranked in self._ranked(self.first).values() for one, _ in ranked[:keep])

        best_only = f"{reason} The best {keep} of each in `{name}`, on further seeds."
        self.first = study(name, f"{reason} All candidates.", every, seeds, measure, needs=needs)
        self.second = study(f"{name}-best", best_only, best, then, measure, needs=[self.first])
        self._best = cache(lambda: self._ranked(self.second))
        self._table = cache(lambda: load_table(self.second))

    def _ranked(self, study: Study) -> dict[Any, list[tuple[Settings, float]]]:
        """Of each group, settings and scores, best first."""
        means = load_table(study).groupby("condition", observed=True).cut.mean()
        score = {settings: float(means[label]) for label, settings in study.conditions.items()}
        return {
            group: sorted(((one, score[one]) for one in some if one in score), key=lambda one: one[1])
            for group, some in self._groups().items()
        }

    def best(self, group: Any) -> Settings:
        """What was chosen in a group."""
        return self._best()[group][0][0]

    def score(self, group: Any) -> float:
        """Mean total steps of what was chosen, on the second seeds, episodes cut."""
        return self._best()[group][0][1]

    def robots(self, group: Any) -> Any:
        """Rows of what was chosen in the table of the second study, seeds in order."""
        chosen = self.best(group)
        return rows(self._table(), condition=next(k for k, one in self.second.conditions.items() if one == chosen))
