"""What a run costs a study, its share of a survey, set-up and measure included: compiled, and in Python.

The study is one of the rules that drive in every room, on the same seeds. Both ways make the same runs.
"""

from collections.abc import Callable, Iterator
from time import perf_counter, process_time
from unittest.mock import patch

import numpy as np

from homing_lib import agent, environment
from homing_lib.atlas import camera_available
from homing_lib.settings import Settings
from homing_lib.study import engine, measures, rules
from homing_lib.study.questions import varying

SEEDS, BLOCKS = range(3), 4
ATLAS = Settings(images="atlas" if camera_available() else "compact")
ROBOTS = range(1000)


def seconds(settings: Settings) -> float:
    """Processor time of a run, mean of all; no survey is known beforehand."""
    environment._SURVEYS.clear()
    conditions = [settings.with_changes(lambda_rule=rule) for rule in varying.RULES_IN_ROOMS]
    start = process_time()
    for seed in SEEDS:
        for condition in conditions:
            measures.totals(condition, seed)
    return (process_time() - start) / (len(SEEDS) * len(conditions))


def in_python(settings: Settings) -> float:
    """The same without the engine."""
    with patch.object(measures, "run", agent.run):
        return seconds(settings)


def written_out(*, delta, phi, delta_prev, phi_prev, discount, **_):  # type: ignore[no-untyped-def]
    """Form 2 as a reader writes it."""
    return delta * (phi @ phi) / (discount * delta_prev * (phi_prev @ phi_prev))


def half(*, delta, delta_prev, **_):  # type: ignore[no-untyped-def]
    """Half of the trace while the errors agree in sign."""
    return 0.5 if delta * delta_prev > 0 else 0.0


def upwards(*, delta, **_):  # type: ignore[no-untyped-def]
    """Some of the trace after a good surprise."""
    return 0.3 * (delta > 0)


def rows() -> Iterator[tuple[str, float, str, float | None]]:
    """(name, value, unit, largest value allowed or None)."""
    if engine.load() is None:
        yield "the engine: numba is not installed", np.nan, "", None
        return
    start = perf_counter()
    rules.compare({"written out": written_out, "half": half, "upwards": upwards}, ROBOTS)
    yield f"{len(ROBOTS)} robots for each of three new rules, on all cores", perf_counter() - start, "s", 10
    for update in ("taken", "all"):
        settings = ATLAS.with_changes(update=update)
        ways: dict[str, Callable[[Settings], float]] = {"engine": seconds, "Python": in_python}
        seconds(settings)  # its rules are compiled, and the atlas read
        best = dict.fromkeys(ways, np.inf)
        for _ in range(BLOCKS):
            for name, way in ways.items():
                best[name] = min(best[name], way(settings))
        yield f"run of twenty episodes, update {update}, in Python", 1e3 * best["Python"], "ms", None
        yield f"runs of twenty episodes, update {update}, by the engine", 1 / best["engine"], "per s", None
        yield f"run, update {update}: engine / Python", best["engine"] / best["Python"], "", 0.15
