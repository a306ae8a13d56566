"""The lectures say what the data say: figures, numbers and verdicts come from them."""

import re

import pytest

from homing_lib.publish import prose
from homing_lib.storage import ROOT

SOURCES = {path.stem: path.read_text(encoding="utf-8") for path in prose.LECTURES}
FRAMES = {
    f"{name} {number}": frame
    for name, source in SOURCES.items()
    for number, frame in enumerate(re.findall(r"\\begin{frame}(.*?)\\end{frame}", source, re.DOTALL), start=1)
}
SHOWN = re.compile(r"\\(?:shown|across)(?:\[[\d. ]+\])?{([\d.]+)}{([\w-]+)}")
DRAWN = re.compile(r"\\begin{tikzpicture}.*?\\end{tikzpicture}", re.DOTALL)
LAYOUT = re.compile(r"\\textcolor{[^}]*}|\\(?:vspace|begin|renewcommand|term|raisebox|\\)(?:{[^}]*}|\[[^\]]*\])*")
DATA = re.compile(r"\\(?:num|given|found|pin){[^}]*}")
NAMES = re.compile(r"(?:[Nn]otebook|[Tt]ask|[Ff]orms?|eq\.~)[ (]*\d(?: to \d)?|\b[CEQ]\d+\b|\\oldstylenums{\d+}")
MATHS = re.compile(r"\$[^$]*\$|\\\[.*?\\\]", re.DOTALL)
JUDGED = re.compile(
    r"\b(?:better|worse|comparable|faster|slower|superior|beats?|wins?|(?:partly |not )?reproduced|outperforms?)\b"
)


def typed(text: str) -> str:
    """What a frame says in words: without drawings, layout, figures, formulas, and names of parts."""
    for other in (DRAWN, SHOWN, DATA, LAYOUT, NAMES, MATHS):
        text = other.sub(" ", text)
    return text


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_each_figure_is_one_that_a_notebook_draws_and_is_not_made_smaller(source):
    shown = SHOWN.findall(source)
    assert len(shown) == len(re.findall(r"\\(?:shown|across)\b", source)) > 0
    for scale, name in shown:
        assert (ROOT / f"figures/{name}.pdf").exists()
        assert float(scale) >= 1, "its labels are legible from the last row at the printed size or larger"


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_each_slide_has_a_note_and_its_numbers_come_from_the_data(frame):
    assert frame.count(r"\say") == 1
    assert set(re.findall(r"\d+(?:[.,]\d+)*", typed(frame))) <= {"0", "1"}
    for formula in MATHS.findall(LAYOUT.sub(" ", DRAWN.sub(" ", frame))):
        assert not re.search(r"[3-9]|\d\d|\d\.\d", formula), formula


@pytest.mark.parametrize("frame", [frame for frame in FRAMES.values() if r"\pin{" not in frame])
def test_a_slide_that_pins_no_verdict_judges_in_questions_only_and_takes_its_answers_from_the_data(frame):
    for answer in re.findall(r"\\answer{((?:[^{}]|{[^}]*})*)}", frame):
        assert re.fullmatch(r"\\(?:num|given|found){[^}]*}", answer)
    for word in JUDGED.finditer(typed(frame)):
        assert re.search(r"[.?!]", typed(frame)[word.end() :])[0] == "?", typed(frame)[word.start() :][:60]
