"""The numbers of the report, the lectures, the README and the terminal, all computed from the stored runs. Nothing is
typed."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from homing_lib.agent import Run
from homing_lib.features import bins_per_channel
from homing_lib.publish import prose
from homing_lib.publish.tex import escaped, row, tex
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import errata, findings, runs, studies
from homing_lib.study.bootstrap import estimated, ratio
from homing_lib.study.measures import WINDOW
from homing_lib.study.runs import episode_matrix
from homing_lib.thresholds import stopping_thresholds

WELL_BELOW = 0.75
"""A ratio of mean steps counts as "well below" if it is no larger than this and its interval excludes 1."""

VERIFIED = ROOT / ".build" / "verified"


class Headline:
    """What runs of the agent say, and runs of a uniformly random policy of the same seeds.

    Steps are means per episode, with 95 % intervals, of the first and the last WINDOW episodes and of the random
    policy; `of_first` and `of_random` are the last as a share of these. The falls, of the parameter change and of the
    step size, are the last as a share of the first.
    """

    def __init__(self, learnt: Sequence[Run], random: Sequence[Run]) -> None:
        self.learnt, self.settings = learnt, learnt[0].settings
        self.window = window = min(WINDOW, self.settings.episodes // 2)
        self.steps = episode_matrix(learnt)
        self.chance_steps = episode_matrix(random).mean(axis=1)
        self.last_steps = self.steps[:, -window:].mean(axis=1)
        first_steps = self.steps[:, :window].mean(axis=1)
        self.first, self.last = estimated(first_steps), estimated(self.last_steps)
        self.random = estimated(self.chance_steps)
        self.of_first = ratio(self.last_steps, first_steps)
        self.of_random = ratio(self.last_steps, self.chance_steps)
        (self.reached, self.total), (self.random_reached, self.random_total) = _successes(learnt), _successes(random)
        self.diverged = sum(run.diverged > 0 for run in learnt)
        changes, rates = episode_matrix(learnt, "change"), self.settings.step_size_rates
        self.change_fall = float(np.nanmean(changes[:, -window:]) / np.nanmean(changes[:, :window]))
        self.rate_fall = float(rates[-window:].mean() / rates[:window].mean())

    @property
    def verdict(self) -> str:
        """ "well below", "below" or "not below": how the last episodes stand to the first and to the random policy."""
        ratios = self.of_first, self.of_random
        if any(not ratio.high < 1 for ratio in ratios):
            return "not below"
        return "well below" if all(ratio.value <= WELL_BELOW for ratio in ratios) else "below"


@cache
def stored_headline() -> Headline:
    """The headline of the runs stored under data/."""
    return Headline(*runs.load_study(studies.HEADLINE).values())


def conclusion(h: Headline) -> str:
    """The result in one sentence."""
    lead = {
        "well below": "The robot learns its way home:",
        "below": "The robot learns, though by less than the paper suggests:",
        "not below": "These runs do not show that the robot learns:",
    }[h.verdict]
    return (
        f"{lead} over {len(h.learnt)} runs of {h.settings.episodes} episodes, an episode takes {h.first:.0f} steps "
        f"at first (mean of the first {WINDOW} with its 95 % interval) and {h.last:.0f} at the end (last {WINDOW}); "
        f"a uniformly random policy in the same room takes {h.random:.0f}."
    )


def in_numbers(h: Headline) -> list[str]:
    """The end against the beginning and against chance, and how often home was reached: two sentences."""
    return [
        f"Last five against first five: {h.of_first:.2f} of the steps; against the random policy: "
        f"{h.of_random:.2f}. The end is {h.verdict} both.",
        f"Home was reached in {h.reached} of {h.total} episodes; {h.diverged} of {len(h.learnt)} runs diverged.",
    ]


def summary() -> str:
    """What `make` prints when all is done: the headline, and every verdict."""
    h = stored_headline()
    lines = [conclusion(h), *in_numbers(h)]
    if VERIFIED.exists():
        lines.append(VERIFIED.read_text(encoding="utf-8").strip())
    lines.append("What was asked, and what the paper claims (`homing claims NAME` has the numbers and the predicate):")
    for one in findings.stored().values():
        lines.append(f"{one.name:<10}{one.verdict:<52}{one.question.text}")
    return "\n".join(lines)


def judged(names: Sequence[str] = ()) -> str:
    """Questions and claims, by their names or all: verdict, predicate and every number, as plain text."""
    found = [findings.finding(name) for name in names or findings.stored()]
    return _paragraphs([findings.HOW]) + "\n\n" + "\n\n".join(map(findings.as_text, found))


def misprints() -> str:
    """Every erratum with its reading, effect and proof, a paragraph each, as plain text."""
    return _paragraphs(errata.ERRATA)


def _paragraphs(of: Iterable[object]) -> str:
    """Markdown as plain text of a terminal's width; names of tests are not broken."""
    plain = (re.sub(r"\*([^*]+)\*", r"\1", str(one).replace("**", "").replace("\n\n> ", "\0")) for one in of)
    return "\n\n".join(
        "\n".join(textwrap.fill(part, 100, break_long_words=False, break_on_hyphens=False) for part in text.split("\0"))
        for text in plain
    )


# --- LaTeX --------------------------------------------------------------------------------------------------------


def latex() -> str:
    """paper/numbers.tex: a macro for every number of the report and the lectures, and the bodies of the tables."""
    table_one, others = _tables_of_settings()
    macros = numbers(stored_headline()) | {
        "tableClaims": _verdicts(claims=True),
        "tableQuestions": _verdicts(claims=False),
        "tableErrata": "\n".join(map(_erratum, errata.ERRATA)),
        "tableOne": "\n".join(table_one),
        "tableSettings": "\n".join(others),
    }
    found = prose.macros({path.name: path.read_text(encoding="utf-8") for path in prose.LATEX})
    return "\n".join(
        [
            *(f"\\newcommand{{\\{name}}}{{{value}}}" for name, value in macros.items()),
            *(f"\\expandafter\\def\\csname num:{name}\\endcsname{{{value}}}" for name, value in found.items()),
            *(
                f"\\expandafter\\def\\csname found:{one.name}\\endcsname{{{tex(one.verdict)}}}"
                for one in findings.stored().values()
            ),
        ]
    )


def _verdicts(*, claims: bool) -> str:
    """Rows of questions or claims: name, text, verdict."""
    return "\n".join(
        row(one.name, one.question.text, one.verdict)
        for one in findings.stored().values()
        if one.question.is_claim == claims
    )


def _erratum(of: errata.Erratum) -> str:
    """A row: name, where, what is printed and why it cannot stand, how it is read here and what that does."""
    return row(of.name, of.where, f"{of.printed}. {of.wrong}.", f"{of.reading}. {errata.effect(of)}".strip())


def numbers(h: Headline) -> dict[str, str]:
    """The macros by name, without the backslash."""
    s = h.settings
    psi = stopping_thresholds(s.multiplier)
    rates = s.step_size_rates
    texts = {
        "numberOfRuns": f"{len(h.learnt)}",
        "numberOfEpisodes": f"{s.episodes}",
        "window": f"{WINDOW}",
        "firstSteps": f"{h.first:.0f}",
        "lastSteps": f"{h.last:.0f}",
        "randomSteps": f"{h.random:.0f}",
        "homeReached": f"{h.reached}",
        "homeTotal": f"{h.total}",
        "randomReached": f"{h.random_reached}",
        "randomTotal": f"{h.random_total}",
        "changeFall": f"{h.change_fall:.2f}",
        "rateFall": f"{h.rate_fall:.2f}",
        "rateMiddle": f"{rates[min(8, len(rates) - 1)]:.3f}",
        "rateLast": f"{rates[-1]:.3f}",
        "psiUpper": f"{psi.upper:.4f}",
        "psiLower": f"{psi.lower:.4f}",
        "multiplier": f"{s.multiplier:g}",
        "nFeatures": f"{s.n_features}",
        "nBins": f"{bins_per_channel(s.bin_size)}",
        "imageSize": f"{s.image_size}",
        "channelPixels": f"{s.image_size**2}",
        "fieldOfView": f"{s.field_of_view_deg:g}",
        "surveySteps": f"{s.survey_steps}",
        "wallPenalty": _shown(s.wall_penalty),
        "sigmaUsed": {"pooled": "one for all bins", "per-bin": "one per bin"}[s.variance]
        + {"mean": ", about the mean", "zero": ", about zero"}[s.centre],
        "mixtureUsed": {
            "normalised": "both distributions with equal weight",
            "literal": "as printed",
            "epsilon-greedy": "plain epsilon-greedy",
        }[s.mixture],
    }
    return {name: tex(text) for name, text in texts.items()}


def _successes(several: Sequence[Run]) -> tuple[int, int]:
    return sum(int(run.reached.sum()) for run in several), sum(run.settings.episodes for run in several)


def _tables_of_settings() -> tuple[list[str], list[str]]:
    """Rows of Table I, the settings described as "Table I, SYMBOL: ...": symbol, printed, ours, what it is.

    Then those of every other setting: name, printed, ours, source.
    """
    s, table_one, others = Settings(), [], []
    psi = stopping_thresholds(s.multiplier)
    ours = {
        "first_episode_share": f"{s.first_episode_share:g} EP = {s.first_episode:g}",
        "multiplier": f"{s.multiplier:g} and {s.multiplier - 1:g}: {psi.upper:.4f} and {psi.lower:.4f}",
    }
    for name, field in Settings.model_fields.items():
        described, extra = field.description or "", field.json_schema_extra
        printed = _shown(extra.get("printed") or "") if isinstance(extra, dict) else ""
        if match := _IN_TABLE_ONE.match(described):
            symbol, text = match["symbol"], match["text"] or "reward discount"
            if symbol is None:
                symbol, text = "psi_upper, psi_lower", "multipliers and stopping thresholds (eq. 19)"
            table_one.append(row(tex(symbol), printed, ours.get(name, _shown(field.default)), text))
        else:
            others.append(row(f"\\setting{{{escaped(name)}}}", printed, _shown(field.default), described))
    return table_one, others


_IN_TABLE_ONE = re.compile(r"(Table I, (?P<symbol>\w+)[^:]*|Eq\. \(19\))(: (?P<text>.*))?")


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}" if not 0 < abs(value) < 0.01 else re.sub(r"\.?0+e", "e", f"{value:e}")
    return {"True": "yes", "False": "no"}.get(str(value), str(value))
