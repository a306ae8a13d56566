"""Prose that cannot drift: people write the sentences, numbers come from the findings, and pins name what they rest on.

A number is named as `question.comparison|format`: varying.paper.taken.fixed0.total, worth.paper.room.20|2. Formats: the
decimals, or pct for per cent; a v before it leaves the interval out (drives.paper.frozen.home|vpct). In LaTeX it is
\\num{...}; in Markdown it stands between marks, which `homing numbers` fills:

    <!--n varying.paper.taken.fixed0.total-->1.15 [1.11, 1.18]<!--/n-->

A pin names verdicts: \\pin{varying=no} in LaTeX, <!-- pin: varying=no, drives=both together --> in Markdown. It stands
in the paragraph that rests on them. A paragraph that quotes a comparison with a word must pin that word.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import nbformat

from homing_lib.errors import UserError
from homing_lib.publish.tex import tex
from homing_lib.storage import ROOT, write_bytes
from homing_lib.study import findings

REPORT = ROOT / "paper" / "report.tex"
LECTURES = tuple(sorted(path for path in (ROOT / "paper" / "lectures").glob("*.tex") if path.name != "preamble.tex"))
LATEX = (REPORT, *LECTURES)
MARKDOWN = (ROOT / "README.md", ROOT / "notebooks" / "TEACHING.md")
NOTEBOOKS = tuple(sorted((ROOT / "notebooks").glob("*.ipynb")))

_MARKED = re.compile(r"<!--n ([^>]*?)-->(.*?)<!--/n-->", re.DOTALL)
_IN_TEX = re.compile(r"\\num\{([^}]*)\}")
_PINS = re.compile(r"<!-- pin: (.*?) -->|\\pin\{([^}]*)\}", re.DOTALL)


def number(name: str) -> str:
    """A number of the findings as a text, by its name and format. Raises UserError if there is none."""
    key, _, form = name.partition("|")
    question, _, comparison = key.partition(".")
    one, alone = findings.finding(question)[comparison], form.startswith("v")
    form = form.removeprefix("v") or "2"
    if form == "pct":
        value, low, high = (f"{100 * end:.0f}" for end in one.interval)
        return f"{value} %" if alone else f"{value} [{low}, {high}] %"
    if not form.isdecimal():
        raise UserError(f"number {name}: a format is some decimals, or pct, with or without a v before it")
    value, low, high = (f"{end:,.{form}f}" for end in one.interval)
    return value if alone else f"{value} [{low}, {high}]"


def refreshed(text: str) -> str:
    """Markdown with its numbers as they are now."""
    return _MARKED.sub(lambda mark: f"<!--n {mark[1]}-->{number(mark[1])}<!--/n-->", text)


def macros() -> dict[str, str]:
    """What \\num needs for the numbers of report and lectures: the text of each."""
    names = {name for path in LATEX for name in _quoted(path.read_text(encoding="utf-8"))}
    return {name: tex(number(name)) for name in sorted(names)}


def _quoted(text: str) -> list[str]:
    """The names of the numbers in a text, of Markdown or LaTeX."""
    return [" ".join(name.split()) for name in (*(mark[0] for mark in _MARKED.findall(text)), *_IN_TEX.findall(text))]


class Paragraph(NamedTuple):
    """A paragraph of prose: where it stands, how it begins, the verdicts it rests on, the comparisons it quotes."""

    where: str
    begins: str
    pins: dict[str, str]
    quoted: list[str]


def paragraphs() -> Iterator[Paragraph]:
    """All of README, lessons, notebooks, report and lectures that has pins or numbers."""
    for path in (*MARKDOWN, *LATEX):
        yield from _of_text(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    for path in NOTEBOOKS:
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "markdown":
                yield from _of_text(f"{path.relative_to(ROOT).as_posix()}, cell {cell.id}", cell.source)


def _of_text(where: str, text: str) -> Iterator[Paragraph]:
    for part in re.split(r"\n\s*\n", text):
        pins: dict[str, str] = {}
        for found in _PINS.finditer(part):
            for pin in re.split(r",\s+(?=\w+[.=])", found[1] or found[2]):  # names and words may have commas, too
                key, equals, word = " ".join(pin.split()).partition("=")
                if not equals:
                    raise UserError(f"{where}: pin {pin.strip()!r} must be a verdict's name, =, and its word")
                pins[key] = word
        quoted = [name.partition("|")[0] for name in _quoted(part)]
        if pins or quoted:
            yield Paragraph(where, " ".join(_PINS.sub("", _MARKED.sub(r"\2", part)).split())[:80], pins, quoted)


def broken() -> list[str]:
    """Paragraphs that rest on what was not found, or quote a comparison that has a word without a pin: a line each."""
    words = findings.verdicts()
    lines = []
    for one in paragraphs():
        fallen = [(key, word, words.get(key, "no such verdict")) for key, word in one.pins.items()]
        what = [f"rests on {key} = {word!r}, found {found!r}" for key, word, found in fallen if word != found]
        loose = [key for key in dict.fromkeys(one.quoted) if key in words and key not in one.pins]
        what += [f"quotes {key} and does not pin it ({words[key]!r})" for key in loose]
        lines += [f"{one.where}: {each}: {one.begins}" for each in what]
    return lines


def update() -> list[Path]:
    """Fill in all numbers of README, lessons and notebooks; the files that changed."""
    changed = []
    for path in (*MARKDOWN, *NOTEBOOKS):
        before = path.read_text(encoding="utf-8")
        after = refreshed(before)
        if after != before:
            write_bytes(path, after.encode())
            changed.append(path)
    return changed
