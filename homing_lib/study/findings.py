"""Questions, and claims of the paper: how each is judged, what was found, and where that is stored.

A judge takes the tables of its studies and returns a verdict, in a word that its predicate names, and the comparisons
that it rests on. `make data` judges and stores (`data/findings.json`); all others read that. A new question is a new
file in `questions/`.
"""

import hashlib
import json
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

from homing_lib.errors import DamagedFile, UserError, nearest, shown
from homing_lib.features import Array
from homing_lib.storage import read_bytes, write_bytes
from homing_lib.study import bootstrap, choosing, measures, studies
from homing_lib.study.bootstrap import SAME_SHARE, Interval, Statistic, Word, mean, word_of
from homing_lib.study.runs import DATA, Study, fingerprint, load_table, missing
from homing_lib.study.studies import load_questions

FILE = DATA / "findings.json"

HOW = """**How it is judged.** Everything that is chosen, step sizes above all, is chosen on seeds below 100 (all
candidates drive with seeds 0 to 19, the best two with 20 to 99, and these decide), by total steps with each episode cut
at 500. What is judged runs on seeds from 10000 on. *Total* steps are those of a robot's twenty episodes, *late* ones
its mean of the last five; an episode that a diverged robot did not reach counts as the step cap. Ratios are of means,
those of late steps of interquartile means, which tell of the typical robot. A robot is *lost* if it diverged or takes,
in its last five episodes, more steps than random actions do in its room. Intervals are 95 % percentile intervals of
9,999 bootstrap samples, in which a seed brings all that it has done; of k comparisons that are judged together each is
that of 1 - .05/k. *The same*: the whole interval lies between 1/1.1 and 1.1 (of shares: within two points); else
*fewer* or *more*, if it leaves out 1; else *undecided*. A star marks what is judged together; it *tells* so
small a ratio from 1 in 80 of 100 such studies."""


class Comparison(NamedTuple):
    """One number of a finding: what it is, its interval, and the word that the interval allows ("" if none is asked).

    judged: of how many comparisons that are judged together it is one, its interval as wide as that asks; 0: beside.
    f"{comparison:.2f}" writes the interval."""

    value: float
    low: float
    high: float
    verdict: str = ""
    judged: int = 0

    @property
    def interval(self) -> Interval:
        """Without the word."""
        return Interval(self.value, self.low, self.high)

    @property
    def smallest_ratio(self) -> float:
        """Of a judged ratio: what such an interval tells from 1, in 80 of 100 studies."""
        together = max(self.judged, 1)
        return bootstrap.tells(np.log(self.high / self.low) / 2 / bootstrap.normal(1 - 0.025 / together), together)

    def __format__(self, each: str) -> str:
        return format(self.interval, each)


def of(found: Interval, word: str = "", *, judged: int = 0) -> Comparison:
    """A number with its word."""
    return Comparison(*found, word, int(judged))


def steps(
    ours: Array, theirs: Array, statistic: Statistic = mean, *, comparisons: int = 1, judged: int | None = None
) -> Comparison:
    """Steps as a multiple of others', one number per robot, the same seeds in order; judged, if there are several."""
    found = bootstrap.ratio(ours, theirs, statistic, comparisons)
    return of(found, word_of(found), judged=comparisons * (comparisons > 1) if judged is None else judged)


def shares(ours: Array, theirs: Array, *, comparisons: int = 1) -> Comparison:
    """By how much one share exceeds another; each robot's own, or whether it is so."""
    found = bootstrap.estimated(
        np.asarray(ours, dtype=float) - np.asarray(theirs, dtype=float), comparisons=comparisons
    )
    return of(found, word_of(found, (-SAME_SHARE, SAME_SHARE), 0.0), judged=comparisons * (comparisons > 1))


def estimate(values: Array, statistic: Statistic = mean, *, comparisons: int = 1) -> Comparison:
    """A statistic of numbers, one per robot, without a word."""
    return of(bootstrap.estimated(np.asarray(values, dtype=float), statistic, comparisons))


def bound(found: Interval, limit: float) -> str:
    """Whether a number lies, with its whole interval, "above" or "below" a limit; else "undecided"."""
    return "above" if found.low > limit else "below" if found.high < limit else "undecided"


def claim(word: str, supports: tuple[str, ...], contradicts: tuple[str, ...]) -> str:
    """What becomes of a claim that rests on one comparison, by its word."""
    return "supported" if word in supports else "contradicted" if word in contradicts else "inconclusive"


Judged = tuple[str, Mapping[str, Comparison]]


class Question(NamedTuple):
    """What is asked, or what the paper says; how it is decided; by what."""

    name: str
    text: str
    predicate: str
    studies: tuple[Any, ...]  # `Study`, or what makes one once its choices are known
    judge: Callable[..., Judged]

    @property
    def is_claim(self) -> bool:
        """Whether the paper says so, rather than that we ask."""
        return self.name[0] == "C" and self.name[1:].isdecimal()

    @property
    def tables(self) -> list[Study]:
        """The studies that its judge takes the tables of."""
        return [one if isinstance(one, Study) else one() for one in self.studies]


_QUESTIONS: dict[str, Question] = {}


def question(name: str, text: str, predicate: str, *studies: Any) -> Callable[[Callable[..., Judged]], Any]:
    """Stands above a judge. name: a word, or "C1", ... for a claim of the paper; predicate: what decides, and how."""

    def register(judge: Callable[..., Judged]) -> Callable[..., Judged]:
        if name in _QUESTIONS and _QUESTIONS[name].judge.__module__ != judge.__module__:
            raise ValueError(f"{name} is judged already, in {_QUESTIONS[name].judge.__module__}")
        _QUESTIONS[name] = Question(name, text, " ".join(predicate.split()), studies, judge)
        return judge

    return register


def questions() -> dict[str, Question]:
    """All questions, in the order of the article, then the claims by number, in whichever file they stand."""
    load_questions()
    return {name: one for name, one in sorted(_QUESTIONS.items(), key=lambda item: _place(item[1]))}


ORDER = ("printed", "learns", "home", "drives", "conjugate", "varying", "rooms", "worth")
"""Of the sections of the article; what is not in it comes after, by name."""


def _place(one: Question) -> tuple[bool, int, str]:
    if one.is_claim:
        return True, int(one.name[1:]), ""
    return False, ORDER.index(one.name) if one.name in ORDER else len(ORDER), one.name


@dataclass(frozen=True)
class Finding:
    """What was found. str() is a paragraph in Markdown, and one of the predicate."""

    name: str
    verdict: str
    comparisons: dict[str, Comparison]

    @property
    def question(self) -> Question:
        """What it answers."""
        return questions()[self.name]

    def __getitem__(self, name: str) -> Comparison:
        """A comparison, by its name."""
        if name not in self.comparisons:
            raise KeyError(f"{self.name}: no comparison {name!r}{nearest(name, self.comparisons)}")
        return self.comparisons[name]

    def __str__(self) -> str:
        asked = self.question
        rows = [f"**{asked.text}** **{self.verdict}**", "", f"> *Predicate*: {asked.predicate}"]
        return "\n".join(rows)


def table(which: Iterable[str]) -> str:
    """Verdicts as a table in Markdown, by the names of questions and claims."""
    rows = [f"| {one.name} | {one.question.text} | **{one.verdict}** |" for one in map(finding, which)]
    return "\n".join(["| | | |", "|---|---|---|", *rows])


def as_text(found: Finding) -> str:
    """A finding as plain text: verdict, predicate, and every comparison with its word; those that are
    judged together are starred."""
    asked, rows = found.question, []
    for name, one in found.comparisons.items():
        digits = ".0f" if abs(one.value) >= 20 else ".2f"
        is_ratio = one.verdict in get_args(Word) and one.low > 0
        tells = f", tells {one.smallest_ratio:.2f}" if one.judged and is_ratio else ""
        rows.append(f"  {'*' if one.judged else ' '} {name:44} {one:{digits}}  {one.verdict}{tells}".rstrip())
    return "\n".join([f"{found.name}: {asked.text} {found.verdict}", f"  Predicate: {asked.predicate}", *rows])


def judge(name: str) -> Finding:
    """Judge anew, from the stored tables. Raises UserError if they are not sound."""
    asked = questions()[name]
    verdict, comparisons = asked.judge(*map(load_table, asked.tables))
    return Finding(name, verdict, dict(comparisons))


def _made_from(asked: Question) -> str:
    """A hash of what a finding depends on: its tables and those that chose for it, all judges, and what judges use."""
    found = hashlib.sha256(fingerprint(_with_choices(asked.studies).values()).encode())
    names = (__name__, asked.judge.__module__, *(one.__name__ for one in (bootstrap, choosing, measures, studies)))
    for file in (*load_questions(), *(Path(str(sys.modules[name].__file__)) for name in names)):
        found.update(file.read_bytes())
    return found.hexdigest()[:16]


def _with_choices(studies: Iterable[Any]) -> dict[str, Study]:
    """These studies by their names, and all that they need."""
    found: dict[str, Study] = {}
    for one in studies:
        made = one if isinstance(one, Study) else one()
        found |= {made.name: made} | _with_choices(getattr(one, "needs", ()))
    return dict(sorted(found.items()))


def judge_all(progress: Callable[[Iterable[str]], Iterable[str]] = iter) -> None:
    """Judge whatever is not judged yet, or rests on other tables now, and store what was found."""
    before, now = _stored(), {}
    asked = questions()
    for name in progress(list(asked)):
        made_from = _made_from(asked[name])
        entry = before.get(name)
        if entry is None or entry["made from"] != made_from:
            found = judge(name)
            numbers = {
                key: [*(float(f"{end:.6g}") for end in one.interval), one.verdict, one.judged]
                for key, one in found.comparisons.items()
            }
            entry = {"verdict": found.verdict, "made from": made_from, "comparisons": numbers}
            entry["checksum"] = _checksum(entry)
        now[name] = entry
    lines = [
        f'"{name}": {{"verdict": {json.dumps(entry["verdict"])}, "made from": "{entry["made from"]}", '
        + f'"checksum": "{entry["checksum"]}", "comparisons": {{\n'
        + ",\n".join(f"  {json.dumps(key)}: {json.dumps(one)}" for key, one in entry["comparisons"].items())
        + "\n}}"
        for name, entry in now.items()
    ]
    content = ("{\n" + ",\n".join(lines) + "\n}\n").encode()
    if not FILE.exists() or FILE.read_bytes() != content:
        write_bytes(FILE, content)
        stored.cache_clear()


def _checksum(entry: Mapping[str, Any]) -> str:
    content = [entry[name] for name in ("verdict", "made from", "comparisons")]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _stored() -> dict[str, Any]:
    try:
        found = json.loads(read_bytes(FILE))
        for entry in found.values():
            if entry["checksum"] != _checksum(entry):
                raise ValueError("its content is not what was found")
    except FileNotFoundError:
        return {}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DamagedFile(f"{FILE}: damaged file ({error}); delete it, and `make data` judges anew") from None
    return dict(found)


@cache
def stored() -> dict[str, Finding]:
    """All that was found, by name. Raises UserError if it is not stored, or damaged."""
    found = _stored()
    if not found:
        raise missing(FILE, "missing; `make data` judges")
    return {
        name: Finding(name, entry["verdict"], {key: Comparison(*one) for key, one in entry["comparisons"].items()})
        for name, entry in found.items()
        if name in questions()
    }


def finding(name: str) -> Finding:
    """What was found about a question or claim, by its name. Raises UserError for a name that there is not."""
    if name not in stored():
        raise UserError(
            f"{shown(name)}: no such question or claim; there are {', '.join(stored())}{nearest(name, stored())}"
        )
    return stored()[name]


def verdicts() -> dict[str, str]:
    """Every word that prose may rest on: of each question and claim, and of each of its comparisons that has one."""
    words = {}
    for name, found in stored().items():
        words[name] = found.verdict
        words |= {f"{name}.{key}": one.verdict for key, one in found.comparisons.items() if one.verdict}
    return words
