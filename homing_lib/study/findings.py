"""Questions, and claims of the paper: how each is judged, what was found, and where that is stored.

A judge takes the tables of its studies and returns a verdict, in a word that its predicate names, and the comparisons
that it rests on. `make data` judges and stores (`data/findings.json`); all others read that. A new question is a new
file in `questions/`, which says itself where it stands among the others.
"""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from homing_lib.errors import DamagedFile, UserError, nearest, shown
from homing_lib.features import Array
from homing_lib.storage import missing, read_bytes, write_bytes
from homing_lib.study import bootstrap, runs
from homing_lib.study.bootstrap import SAME_SHARE, Interval, Statistic, mean, word_of
from homing_lib.study.runs import DATA, Study, fingerprint, load_table
from homing_lib.study.studies import load_questions

FILE = DATA / "findings.json"

HOW = """**How it is judged.** Choices are made on seeds below 100. Step sizes and the best fixed lambda: all candidates
drive with seeds 0 to 19, the best two with 20 to 99, and these decide, by total steps with each episode cut at 500.
What is judged runs on seeds from 10000 on. *Total* steps are those of a robot's twenty episodes, *late* ones its mean
of the last five; an episode that a diverged robot did not reach counts as the step cap. Ratios are of means, those of
late steps of interquartile means, which tell of the typical robot. A robot is *lost* if it diverged or takes, in its
last five episodes, more steps than random actions do in its room. Intervals are 95 % percentile intervals of 9,999
bootstrap samples, in which a seed brings all that it has done (what robots of other seeds take, as chance, enters as a
known mean); of k comparisons that are judged together each is that of 1 - .05/k. *The same*: the whole interval lies
between 1/1.1 and 1.1 (of shares: within two points); else *fewer* or *more*, if it leaves out 1 (of shares: 0); else
*undecided*: these robots do not settle it. A star marks what is judged together."""


class Comparison(NamedTuple):
    """One number of a finding: what it is, its interval, and the word that the interval allows ("" if none is asked).

    judged: of how many comparisons that are judged together it is one, its interval as wide as that asks; 0: it stands
    beside them. f"{comparison:.2f}" writes the interval.
    """

    value: float
    low: float
    high: float
    verdict: str = ""
    judged: int = 0

    @property
    def interval(self) -> Interval:
        """Without the word."""
        return Interval(self.value, self.low, self.high)

    def __format__(self, each: str) -> str:
        return format(self.interval, each)


# What a judge makes of the robots. comparisons: how many are judged together, this one among them; 0: it stands beside.


def compare_steps(
    ours: ArrayLike, theirs: ArrayLike, statistic: Statistic = mean, *, comparisons: int = 0
) -> Comparison:
    """Steps as a multiple of others', one number per robot, the same seeds in order: fewer, more, or the same."""
    interval = bootstrap.ratio(ours, theirs, statistic, max(comparisons, 1))
    return Comparison(*interval, word_of(interval), comparisons)


def compare_to_first(numbers: Mapping[str, Array], statistic: Statistic = mean) -> dict[str, Comparison]:
    """By label, all but the first: numbers, one per robot, as a multiple of the first's."""
    (_, first), *others = numbers.items()
    return {label: compare_steps(ours, first, statistic) for label, ours in others}


def against_first(compared: Mapping[str, Comparison], label: str) -> tuple[str, str]:
    """Of those, a ratio to the first with its interval as a text, and its word; the first is 1."""
    one = compared.get(label)
    return (f"{one:.2f}", one.verdict) if one else ("1", "")


def compare_shares(ours: ArrayLike, theirs: ArrayLike, *, comparisons: int = 0) -> Comparison:
    """By how much one share exceeds another; each robot's own, or whether it is so."""
    difference = np.asarray(ours, dtype=float) - np.asarray(theirs, dtype=float)
    interval = bootstrap.estimated(difference, comparisons=max(comparisons, 1))
    return Comparison(*interval, word_of(interval, (-SAME_SHARE, SAME_SHARE), 0.0), comparisons)


def compare_to_limit(values: ArrayLike, limit: float, *, comparisons: int = 1) -> Comparison:
    """The mean of numbers, one per robot, and on which side of a limit it lies."""
    interval = bootstrap.estimated(values, comparisons=max(comparisons, 1))
    return Comparison(*interval, side_of(interval, limit), comparisons)


def estimate(values: ArrayLike) -> Comparison:
    """The mean of numbers, one per robot, without a word."""
    return Comparison(*bootstrap.estimated(values))


def exact(value: float) -> Comparison:
    """A number that no robot stands behind."""
    return Comparison(value, value, value)


def side_of(interval: Interval | Comparison, limit: float, above: str = "above", below: str = "below") -> str:
    """On which side of a limit a number lies with its whole interval, in these words; else "undecided"."""
    return above if interval.low > limit else below if interval.high < limit else "undecided"


OF_A_CLAIM = ("supported", "contradicted", "inconclusive")
OF_A_QUESTION = ("yes", "no", "undecided")


def verdict_of(
    words: Iterable[str],
    supporting: Sequence[str],
    contradicting: Sequence[str],
    verdicts: tuple[str, str, str] = OF_A_CLAIM,
) -> str:
    """What the words of some comparisons make together: the second verdict if one of them contradicts, the first if all
    support, else the third.
    """
    words = {*words}
    if words & {*contradicting}:
        return verdicts[1]
    return verdicts[0] if words <= {*supporting} else verdicts[2]


def by_construction(holds: bool) -> str:
    """The verdict on what is arithmetic."""
    return "by construction" if holds else "contradicted"


Judged = tuple[str, Mapping[str, Comparison]]


class Question(NamedTuple):
    """What is asked, or what the paper says; how it is decided; by what."""

    name: str
    text: str
    predicate: str
    studies: tuple[Study, ...]
    order: float
    judge: Callable[..., Judged]

    @property
    def is_claim(self) -> bool:
        """Whether the paper says so, rather than that we ask."""
        return self.name[0] == "C" and self.name[1:].isdecimal()


REGISTERED: dict[str, Question] = {}  # what `question` made, by name


def question(name: str, text: str, predicate: str, *studies: Study, order: float = math.inf) -> Callable[..., Any]:
    """Stands above a judge. name: a word, or "C1", ... for a claim of the paper; predicate: what decides, and how.

    order: its place among the questions, as in the article; without one it comes after them, by name. Claims come last,
    by number.
    """

    def register(judge: Callable[..., Judged]) -> Callable[..., Judged]:
        if name in REGISTERED and REGISTERED[name].judge.__module__ != judge.__module__:
            raise ValueError(f"{name} is judged already, in {REGISTERED[name].judge.__module__}")
        REGISTERED[name] = Question(name, text, " ".join(predicate.split()), studies, order, judge)
        return judge

    return register


def questions() -> dict[str, Question]:
    """All questions, then the claims, in whichever file they stand."""
    load_questions()
    in_order = sorted(REGISTERED.values(), key=lambda one: (one.is_claim, one.order, len(one.name), one.name))
    return {one.name: one for one in in_order}


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
        """A comparison, by its name. Raises UserError if there is none."""
        if name not in self.comparisons:
            raise UserError(f"{self.name}: no comparison {name!r}{nearest(name, self.comparisons)}")
        return self.comparisons[name]

    def __str__(self) -> str:
        return f"**{self.question.text}** **{self.verdict}**\n\n> *Predicate*: {self.question.predicate}"


def table(which: Iterable[str]) -> str:
    """Verdicts as a table in Markdown, by the names of questions and claims."""
    rows = [f"| {one.name} | {one.question.text} | **{one.verdict}** |" for one in map(finding, which)]
    return "\n".join(["| | | |", "|---|---|---|", *rows])


def as_text(found: Finding) -> str:
    """A finding as plain text: verdict, predicate, and every comparison with its word; those that are judged together
    are starred.
    """
    rows = [f"{found.name}: {found.question.text} {found.verdict}", f"  Predicate: {found.question.predicate}"]
    for name, one in found.comparisons.items():
        digits = ".0f" if abs(one.value) >= 20 else ".2f"
        rows.append(f"  {'*' if one.judged else ' '} {name:44} {one:{digits}}  {one.verdict}".rstrip())
    return "\n".join(rows)


def judge(name: str) -> Finding:
    """Judge anew, from the stored tables. Raises UserError if they are not sound."""
    asked = questions()[name]
    verdict, comparisons = asked.judge(*map(load_table, asked.studies))
    return Finding(name, verdict, dict(comparisons))


def _made_from(asked: Question) -> str:
    """A hash of all that a finding depends on: its tables, those that chose for it, and all judges and what they use,
    which is the model and the study.
    """
    content = fingerprint(_with_choices(asked.studies).values()) + runs.MADE_BY["homing_lib"]
    return hashlib.sha256(content.encode()).hexdigest()[:16]


def _with_choices(some: Iterable[Study]) -> dict[str, Study]:
    """These studies by their names, and all that they need."""
    every: dict[str, Study] = {}
    for one in some:
        every |= {one.name: one} | _with_choices(one.needs)
    return dict(sorted(every.items()))


def judge_all(progress: Callable[[Iterable[str]], Iterable[str]] = iter) -> None:
    """Judge whatever is not judged yet, or rests on other tables now, and store what was found."""
    before, now, asked = _stored(), {}, questions()
    for name in progress(list(asked)):
        made_from = _made_from(asked[name])
        kept = before.get(name)
        now[name] = kept if kept and kept["made from"] == made_from else _entry(judge(name), made_from)
    content = ("{\n" + ",\n".join(_as_json(name, entry) for name, entry in now.items()) + "\n}\n").encode()
    if not FILE.exists() or FILE.read_bytes() != content:
        write_bytes(FILE, content)
        stored.cache_clear()


def _entry(judged: Finding, made_from: str) -> dict[str, Any]:
    """What is stored of a finding: its numbers to six digits."""
    numbers = {key: [*(float(f"{end:.6g}") for end in one[:3]), *one[3:]] for key, one in judged.comparisons.items()}
    entry = {"verdict": judged.verdict, "made from": made_from, "comparisons": numbers}
    return entry | {"checksum": _checksum(entry)}


def _as_json(name: str, entry: Mapping[str, Any]) -> str:
    """An entry of the file, a comparison a line, so that a difference can be read."""
    comparisons = ",\n".join(f"  {json.dumps(key)}: {json.dumps(one)}" for key, one in entry["comparisons"].items())
    head = ", ".join(f'"{key}": {json.dumps(entry[key])}' for key in ("verdict", "made from", "checksum"))
    return f'"{name}": {{{head}, "comparisons": {{\n{comparisons}\n}}}}'


def _checksum(entry: Mapping[str, Any]) -> str:
    content = [entry[name] for name in ("verdict", "made from", "comparisons")]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _stored() -> dict[str, Any]:
    try:
        entries = json.loads(read_bytes(FILE))
        for entry in entries.values():
            if entry["checksum"] != _checksum(entry):
                raise ValueError("its content is not what was found")
    except FileNotFoundError:
        return {}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise DamagedFile(f"{FILE}: damaged file ({error}); delete it, and `make data` judges anew") from None
    return dict(entries)


@cache
def stored() -> dict[str, Finding]:
    """All that was found, by name. Raises UserError if it is not stored, or damaged."""
    entries = _stored()
    if not entries:
        raise missing(FILE, "missing; `make data` judges")
    return {
        name: Finding(name, entry["verdict"], {key: Comparison(*one) for key, one in entry["comparisons"].items()})
        for name, entry in entries.items()
        if name in questions()
    }


def finding(name: str) -> Finding:
    """What was found about a question or claim. Raises UserError for a name that there is not, or is not judged."""
    known = stored()
    if name in known:
        return known[name]
    if name in questions():
        raise UserError(f"{name}: not judged yet; `make data` judges")
    raise UserError(f"{shown(name)}: no such question or claim; there are {', '.join(known)}{nearest(name, known)}")


def verdicts() -> dict[str, str]:
    """Every word that prose may rest on: of each question and claim, and of each of its comparisons that has one."""
    words = {}
    for name, found in stored().items():
        words[name] = found.verdict
        words |= {f"{name}.{key}": one.verdict for key, one in found.comparisons.items() if one.verdict}
    return words
