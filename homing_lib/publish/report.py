"""The numbers of the report, the lectures and the terminal, all computed from the stored runs. Nothing is typed."""

import re
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

from homing_lib.features import bins_per_channel
from homing_lib.publish import prose, where
from homing_lib.publish.tex import escaped, row, tex
from homing_lib.settings import Settings
from homing_lib.study import errata, findings, headline
from homing_lib.study.headline import Headline
from homing_lib.study.measures import WINDOW
from homing_lib.thresholds import stopping_thresholds


def summary() -> str:
    """The headline, and every verdict."""
    h = headline.stored()
    lines = [headline.conclusion(h), *headline.in_numbers(h)]
    lines.append("What was asked, and what the paper claims (`homing claims NAME` has the numbers and the predicate):")
    for one in findings.stored().values():
        lines.append(f"{one.name:<10}{one.verdict:<51}  {one.question.text}")
    return "\n".join(lines)


def judged(names: Sequence[str] = ()) -> str:
    """Questions and claims, by their names or all: verdict, predicate and every number, and last how it is judged, as
    plain text.
    """
    each = [f"{findings.as_text(findings.finding(name))}\n{_from(name)}" for name in names or findings.stored()]
    return "\n\n".join([*each, _paragraphs([findings.HOW])])


def _from(name: str) -> str:
    """Where a finding is judged, and from which tables."""
    asked = findings.questions()[name]
    tables = ", ".join(where.stored_in(study) for study in asked.studies)
    return f"  Judged in {where.file_of(asked.judge)}" + (f" from {tables}" if tables else "")


def misprints(names: Sequence[str] = ()) -> str:
    """Errata, by their names or all, with reading, effect and proof, a paragraph each, as plain text."""
    return _paragraphs(errata.chosen(names))


def _paragraphs(markdown: Iterable[object]) -> str:
    """Markdown as plain text of a terminal's width; names of tests are not broken."""
    texts = (re.sub(r"\*([^*]+)\*", r"\1", str(one).replace("**", "")) for one in markdown)
    wrapped = textwrap.TextWrapper(100, break_long_words=False, break_on_hyphens=False)
    return "\n\n".join(map(wrapped.fill, texts))


# --- LaTeX --------------------------------------------------------------------------------------------------------


def latex() -> str:
    """paper/numbers.tex: a macro for every number of the report and the lectures, and the bodies of the tables."""
    stored = findings.stored().values()
    figures = where.reported()
    tables = {
        "tableClaims": [
            row(one.name, one.question.text, one.verdict, _decides(one)) for one in stored if one.question.is_claim
        ],
        "tableQuestions": [
            row(one.name, one.question.text, one.verdict) for one in stored if not one.question.is_claim
        ],
        "tableErrata": [_erratum(one) for one in errata.ERRATA if errata.changes_steps(one)],
        "tableOne": table_one(),
        "tableFigures": [_figure(name, one) for name, one in figures.items()],
    }
    h = headline.stored()
    macros = numbers(h.settings) | {name: "\n".join(rows) for name, rows in tables.items()}
    named = {f"num:{name}": text for name, text in prose.macros().items()}
    named |= {f"given:{name}": tex(text) for name, text in given(h).items()}
    named |= {f"found:{one.name}": tex(one.verdict) for one in stored}
    named |= {f"made:{name}": _made(one) for name, one in figures.items()}
    named |= {f"alt:{name}": _as_pdf_text(where.in_words(one.function)) for name, one in figures.items()}
    return "\n".join(
        [
            *(f"\\newcommand{{\\{name}}}{{{value}}}" for name, value in macros.items()),
            *(f"\\expandafter\\def\\csname {name}\\endcsname{{{value}}}" for name, value in named.items()),
        ]
    )


def _decides(found: findings.Finding) -> str:
    """The comparisons of a finding that are judged, with their words."""
    judged = {name.replace(".", ", "): one for name, one in found.comparisons.items() if one.judged}
    return "; ".join(f"{name} {_rounded(one)} {one.verdict}".strip() for name, one in judged.items())


def _erratum(one: errata.Erratum) -> str:
    """A row: name, where, what is printed and why it cannot stand, how it is read here and what that does."""
    effect = errata.effect(one).partition(": ")[2]  # the caption says of what
    return row(one.name, one.where, f"{one.printed}. {one.wrong}.", f"{one.reading}; {effect}".strip())


def _figure(name: str, figure: where.Drawn) -> str:
    """A row: the figure, what draws it, the notebook's cell, and the tables; all are links to their files."""
    notebook, function = figure.notebook.stem, figure.function
    cells = [
        f"\\leavevmode\\hypertarget{{made:{name}}}{{\\ref{{fig:{name}}}}}",
        _file(where.file_of(function), f"{function.__module__.rpartition('.')[2]}.{function.__name__}"),
        f"{_file(f'notebooks/executed/{notebook}.ipynb', notebook.partition('-')[0])}, {escaped(figure.cell)}",
        ", ".join(_file(where.stored_in(study), study.name) for study in figure.studies) or "computed in the notebook",
    ]
    return " & ".join(cells) + r" \\"


def _made(figure: where.Drawn) -> str:
    """The end of a caption: the notebook, and the first data sets."""
    names = [study.name for study in figure.studies]
    data = ", ".join(names) if len(names) < 4 else f"{names[0]}, {names[1]} and {len(names) - 2} more"
    return escaped(f"{figure.notebook.stem}, data {data}" if names else figure.notebook.stem)


def _as_pdf_text(text: str) -> str:
    """A text in the hexadecimal digits in which a PDF has it."""
    return f"\ufeff{text}".encode("utf-16-be").hex()


def _file(path: str, text: str) -> str:
    return f"\\file{{{path}}}{{{escaped(text)}}}"


def linked() -> list[str]:
    """The files that the report's links lead to, from the root of the repository."""
    sources = (latex(), prose.REPORT.read_text(encoding="utf-8"))
    return sorted({path for text in sources for path in re.findall(r"\\file{([^}#]*)}", text)})


def numbers(s: Settings) -> dict[str, str]:
    """The macros by name, without the backslash: what follows from settings."""
    psi, rates = stopping_thresholds(s.multiplier), s.step_size_rates
    return {
        "window": f"{WINDOW}",
        "rateMiddle": f"{rates[8]:.3f}",
        "rateLast": f"{rates[-1]:.3f}",
        "psiUpper": f"{psi.upper:.4f}",
        "psiLower": f"{psi.lower:.4f}",
        "nFeatures": f"{s.n_features}",
        "nBins": f"{bins_per_channel(s.bin_size)}",
        "channelPixels": f"{s.image_size**2}",
    }


def given(h: Headline) -> dict[str, str]:
    """Numbers of the headline, and settings of its runs, by their names, as plain text."""
    found = {f"headline.{name}": _rounded(value) for name, value in vars(h).items() if name != "settings"}
    return found | {f"settings.{name}": _shown(value) for name, value in h.settings}


def table_one() -> list[str]:
    """Rows of Table I, the settings described as "Table I, SYMBOL: ...": symbol, printed, ours, what it is."""
    s, rows = Settings(), []
    psi = stopping_thresholds(s.multiplier)
    ours = {
        "first_episode_share": f"{s.first_episode_share:g} EP = {s.first_episode:g}",
        "multiplier": f"{s.multiplier:g} and {s.multiplier - 1:g}: {psi.upper:.4f} and {psi.lower:.4f}",
    }
    for name, field in Settings.model_fields.items():
        described, extra = field.description or "", field.json_schema_extra
        printed = _shown(extra.get("printed") or "") if isinstance(extra, dict) else ""
        if match := re.fullmatch(r"Table I, (\w+)[^:]*(?:: (.*))?", described):
            symbol, text = tex(match[1]), match[2] or "reward discount"
            rows.append(row(symbol, printed, ours.get(name, _shown(field.default)), text))
        elif described.startswith("Eq. (19)"):
            text = "multipliers and stopping thresholds (eq. 19)"
            rows.append(row(tex("psi_upper, psi_lower"), printed, ours[name], text))
    return rows


def _rounded(value: Any) -> str:
    """A whole number, a share, or an estimate with its interval: what is small has two decimals."""
    if isinstance(value, int):
        return str(value)
    return format(value, ".0f" if abs(getattr(value, "value", value)) >= 10 else ".2f")


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:g}" if not 0 < abs(value) < 0.01 else re.sub(r"\.?0+e", "e", f"{value:e}")
    return {"True": "yes", "False": "no"}.get(str(value), str(value))
