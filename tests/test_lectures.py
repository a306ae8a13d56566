"""The lectures say what the data say: figures, numbers and verdicts come from them, and each slide has three lines."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = {
    path.stem: path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "paper/lectures").glob("*.tex"))
    if path.stem != "preamble"
}
FRAMES = {
    f"{name} {number}": frame
    for name, source in SOURCES.items()
    for number, frame in enumerate(re.findall(r"\\begin{frame}(.*?)\\end{frame}", source, re.DOTALL), start=1)
}
SAID = re.compile(r"\\say{(.*)}\n\s+{(.*)}\n\s+{(.*)}\n")
SHOWN = re.compile(r"\\(?:shown|across)(?:\[([\d. ]+)\])?{([\d.]+)}{([\w-]+)}")

DRAWN = re.compile(r"\\begin{tikzpicture}.*?\\end{tikzpicture}", re.DOTALL)
LAYOUT = re.compile(r"\\textcolor{[^}]*}|\\(?:vspace|begin|renewcommand|term|raisebox|\\)(?:{[^}]*}|\[[^\]]*\])*")
DATA = re.compile(r"\\(?:num|found|pin){[^}]*}")
NAMES = re.compile(r"(?:[Nn]otebook|[Tt]ask|[Ff]orms?|eq\.~)[ (]*\d(?: to \d)?|\b[CEQ]\d+\b|\\oldstylenums{\d+}")
MATHS = re.compile(r"\$[^$]*\$|\\\[.*?\\\]", re.DOTALL)


def typed(text: str) -> str:
    """What a frame says in words: without drawings, layout, figures, formulas, and names of parts."""
    for other in (DRAWN, SHOWN, DATA, LAYOUT, NAMES, MATHS):
        text = other.sub(" ", text)
    return text


def each(of):
    return pytest.mark.parametrize("what", of.values(), ids=of)


@each(FRAMES)
def test_each_slide_has_a_note_of_three_lines_that_fit_the_page(what):
    (lines,) = SAID.findall(what)
    assert what.count(r"\say") == 1
    for line in lines:
        assert 20 < len(line) <= 115, line
        assert line.count("{") == line.count("}"), line


@each(SOURCES)
def test_each_figure_is_one_that_a_notebook_draws_and_is_not_made_smaller(what):
    shown = SHOWN.findall(what)
    assert len(shown) == len(re.findall(r"\\(?:shown|across)\b", what)) > 0
    for _, scale, name in shown:
        assert (ROOT / f"figures/{name}.pdf").exists()
        assert float(scale) >= 1, "its labels are legible from the last row at the printed size or larger"


@each(FRAMES)
def test_numbers_come_from_the_data(what):
    assert set(re.findall(r"\d+(?:[.,]\d+)*", typed(what))) <= {"0", "1"}
    for formula in MATHS.findall(LAYOUT.sub(" ", DRAWN.sub(" ", what))):
        assert not re.search(r"[3-9]|\d\d|\d\.\d", formula), formula


@each(FRAMES)
def test_an_answer_comes_from_the_data_or_stands_on_a_slide_that_pins_verdicts(what):
    answers = re.findall(r"\\answer{((?:[^{}]|{[^}]*})*)}", what)
    typed = [one for one in answers if not re.fullmatch(r"\\[a-z]+[A-Z]\w*|\\(?:num|found){[^}]*}", one)]
    assert not typed or r"\pin{" in what


JUDGED = r"better|worse|comparable|faster|slower|superior|beats?|wins?|(?:partly |not )?reproduced|outperforms?"


@each(FRAMES)
def test_a_word_of_judgement_is_typed_in_questions_only_or_on_a_slide_that_pins_verdicts(what):
    if r"\pin{" in what:
        return
    for word in re.finditer(rf"\b(?:{JUDGED})\b", typed(what)):
        (end,) = re.findall(r"[.?!]", typed(what)[word.end() :])[:1]
        assert end == "?", typed(what)[word.start() : word.end() + 40]
