"""What `make audit` asks of a clone: `python .ci/inside.py facts|runs|verdicts|prose [SEED RUNS]`, in the clone.

Prints rows of the audit's table as JSON. The library that answers is that of the clone, which is made sure of.
"""

import json
import os
import platform
import re
import socket
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

SAME, NEAR, UNCHECKED, DIFFERS = "same", "same within the tolerance", "not checked", "DIFFERS"  # the worst comes last

OF_RUNS = {"to the bit": SAME, "within tolerance": NEAR, "not": DIFFERS}


class Row(NamedTuple):
    """A line of the table: what was checked, how, what was found; of a difference also the cause."""

    thing: str
    how: str
    found: str
    why: str = ""


def worst(found: Iterable[str]) -> str:
    return max(found, key=(SAME, NEAR, UNCHECKED, DIFFERS).index)


def cpu() -> str:
    """The name of the processor."""
    known = Path("/proc/cpuinfo")
    named = re.search(r"model name\s*: (.*)", known.read_text()) if known.exists() else None
    return named[1] if named else platform.machine()


# --- Runs -------------------------------------------------------------------------------------------------------------


def compare_rows(stored: Any, live: Any) -> str:
    """Rows of a stored table beside the same rows, computed again: "to the bit", "within tolerance" or "not".

    The tolerance is that of `sweep.compare`, far less than a step or an action.
    """
    import numpy as np

    from homing_lib.study.sweep import TOLERANCE

    with np.errstate(over="ignore"):  # as when the table was written
        pairs = [(stored[name].to_numpy(), live[name].astype(np.float32)) for name in live.dtype.names]
    if any(len(a) != len(b) for a, b in pairs):
        return "not"
    if all(np.array_equal(a, b, equal_nan=True) for a, b in pairs):
        return "to the bit"
    return "within tolerance" if all(np.allclose(a, b, TOLERANCE, TOLERANCE, True) for a, b in pairs) else "not"


def compare_run(study: Any, job: Any, live: Any) -> str:
    """A run of a study, computed again, beside what is stored, in the same words."""
    from homing_lib.storage import write_bytes
    from homing_lib.study import runs, sweep

    if study.measure is None:
        write_bytes(path := Path(".build", "audited.npz"), live)
        return sweep.compare(runs.load_one(study, job.settings, job.seeds[0]), runs.load(path))
    table = runs.load_table(study)
    label = next(label for label, settings in study.conditions.items() if settings == job.settings)
    return compare_rows(table[(table.condition == label) & (table.seed == job.seeds[0])], live)


def try_again(number: int, measure: Any, job: Any) -> tuple[int, Any, str]:
    """What is kept of a job's run, computed; or why it cannot be."""
    from homing_lib.errors import UserError
    from homing_lib.study import sweep

    try:
        return number, sweep._compute(measure, job)[1][job.seeds[0]], ""
    except UserError as error:
        return number, None, str(error)


def repeated(seed: int, count: int) -> list[Row]:
    """A random sample of the runs of each study, computed again and compared with what is stored."""
    import numpy as np
    from tqdm import tqdm

    from homing_lib import parallel
    from homing_lib.study import runs, studies

    rng, drawn, left = np.random.default_rng(seed), [], []
    for study in studies.in_order():
        if study.deep and not find_spec("torch"):
            left.append(Row(f"study {study.name}", "torch is missing; `make deep` has it", UNCHECKED))
            continue
        conditions = [*dict.fromkeys(study.conditions.values())]
        for _ in range(1 if any(settings.images == "camera" for settings in conditions) else count):
            settings, of = conditions[rng.integers(len(conditions))], int(study.seeds[rng.integers(len(study.seeds))])
            drawn.append((study, runs.Job(runs.path_of(study.folder, settings, of), settings, (of,))))
    again = parallel.results(try_again, [(number, study.measure, job) for number, (study, job) in enumerate(drawn)])
    found: dict[Any, list[tuple[str, str]]] = {}
    for number, live, problem in tqdm(again, "runs again", len(drawn), unit="run"):
        study, job = drawn[number]
        word = DIFFERS if problem else OF_RUNS[compare_run(study, job, live)]
        found.setdefault(study, []).append((word, problem))
    every = dict.fromkeys(study for study, _ in drawn)
    return left + [of_study(study, *zip(*found[study], strict=True)) for study in every]


def of_study(study: Any, words: Sequence[str], problems: Sequence[str]) -> Row:
    """The row of a study: the worst of its runs; of a difference, what made the stored ones that is otherwise here."""
    from homing_lib.study import runs

    then, found = runs.read_manifest(study)["made by"], worst(words)
    other = [f"{name} {now} for {then[name]}" for name, now in runs.MADE_BY.items() if now != then[name]]
    why = f"made by {', '.join(other)}" if other else f"by these versions: another processor than {cpu()}, or changed"
    why = next(filter(None, problems), why if found in (NEAR, DIFFERS) else "")
    return Row(f"study {study.name}", f"{len(words)} of {len(study)} runs computed again", found, why)


# --- Words, and conditions --------------------------------------------------------------------------------------------


def verdicts() -> list[Row]:
    """Every question and claim, judged again from the tables: its words, and its numbers to five digits."""
    import numpy as np
    from tqdm import tqdm

    from homing_lib.study import findings

    def alike(old: Any, now: Any) -> bool:
        return old[3:] == now[3:] and np.allclose(old[:3], now[:3], 1e-5, 1e-5, True)

    other = []
    for name, stored in tqdm(findings.stored().items(), "verdicts", unit="verdict"):
        now = findings.judge(name)
        same = now.verdict == stored.verdict and now.comparisons.keys() == stored.comparisons.keys()
        if not same or not all(alike(old, now[key]) for key, old in stored.comparisons.items()):
            other.append(name)
    return [Row("words of all verdicts", "judged anew", DIFFERS if other else SAME, ", ".join(other))]


def prose() -> list[Row]:
    """Sentences and the verdicts that they rest on; numbers between marks."""
    from homing_lib.publish import prose

    fallen = prose.broken()
    texts = {path.name: path.read_text(encoding="utf-8") for path in (*prose.MARKDOWN, *prose.NOTEBOOKS)}
    stale = [name for name, text in texts.items() if prose.refreshed(text) != text]
    return [
        Row("sentences", "beside the verdicts that they are pinned to", DIFFERS if fallen else SAME, "; ".join(fallen)),
        Row("numbers in prose", "filled in anew", DIFFERS if stale else SAME, ", ".join(stale)),
    ]


def facts() -> list[Row]:
    """The conditions, as a process in the clone meets them."""
    networks = " ".join(name for _, name in socket.if_nameindex())
    met = {
        "user": os.getuid(),
        "network": networks or "none",
        "source": "writable" if os.access("homing_lib", os.W_OK) else "read-only",
        "HOME": "there" if Path.home().exists() else "missing",
        "date": time.strftime("%Y-%m-%d %H:%M %z"),
    }
    isolated = networks in ("", "lo") and os.getuid() and not os.access("homing_lib", os.W_OK)
    found, why = ("met", "") if isolated else (UNCHECKED, "the system does not let a user unshare network and rights")
    return [Row(f"clone {Path.cwd().name!r}", ", ".join(f"{name} {value}" for name, value in met.items()), found, why)]


INSIDE: dict[str, Callable[..., list[Row]]] = {"facts": facts, "runs": repeated, "verdicts": verdicts, "prose": prose}


def answer(what: str, *numbers: int) -> list[Row]:
    """What a clone is asked, answered by the library of that clone and no other."""
    import homing_lib
    from homing_lib.errors import UserError
    from homing_lib.storage import ROOT

    if {Path(homing_lib.__file__).parents[1], ROOT} != {Path.cwd()}:
        sys.exit(f"audit: the library in {homing_lib.__file__} ran, not that of {Path.cwd()}")
    try:
        return INSIDE[what](*numbers)
    except UserError as error:
        return [Row(what, "", DIFFERS, str(error))]


if __name__ == "__main__":
    print(json.dumps(answer(sys.argv[1], *map(int, sys.argv[2:]))))
