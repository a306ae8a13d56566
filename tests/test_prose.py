"""Numbers in prose are those of the findings, and every sentence that rests on a verdict is named when that falls."""

import re

import nbformat
import pytest

from homing_lib.errors import UserError
from homing_lib.publish import prose
from homing_lib.study import findings
from homing_lib.study.findings import Comparison, Finding

FOUND = {
    "varying": Finding(
        "varying",
        "no",
        {
            "paper.total": Comparison(1.1534, 1.1049, 1.1951, "more", 1),
            "paper.home": Comparison(0.9345, 0.9, 0.957),
            "steps": Comparison(12345.6, 11999.5, 13000.4, "fewer"),
        },
    ),
    "C8": Finding("C8", "contradicted", {"restored.soon": Comparison(0.5, 0.4, 0.6, "below", 1)}),
}


@pytest.fixture
def found(monkeypatch):
    """Two questions that nobody asked."""
    findings.stored.cache_clear()
    monkeypatch.setattr(findings, "stored", lambda: FOUND)


@pytest.fixture
def written(found, monkeypatch, tmp_path):
    """Call it with texts, and they are all the prose there is."""
    monkeypatch.setattr(prose, "ROOT", tmp_path)

    def write(markdown="", latex="", cells=()):
        paths = [tmp_path / name for name in ("README.md", "report.tex", "one.ipynb")]
        paths[0].write_text(markdown, encoding="utf-8")
        paths[1].write_text(latex, encoding="utf-8")
        made = [nbformat.v4.new_markdown_cell(source, id=f"cell{place}") for place, source in enumerate(cells)]
        nbformat.write(nbformat.v4.new_notebook(cells=[*made, nbformat.v4.new_code_cell("# pin: none")]), paths[2])
        for name, path in zip(("MARKDOWN", "LATEX", "NOTEBOOKS"), paths, strict=True):
            monkeypatch.setattr(prose, name, (path,))
        return paths

    return write


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("varying.paper.total", "1.15 [1.10, 1.20]"),
        ("varying.paper.total|0", "1 [1, 1]"),
        ("varying.paper.total|v3", "1.153"),
        ("varying.paper.total|v", "1.15"),
        ("varying.paper.home|pct", "93 [90, 96] %"),
        ("varying.paper.home|vpct", "93 %"),
        ("varying.steps|0", "12,346 [12,000, 13,000]"),
    ],
)
def test_a_number_is_written_by_its_format(name, text, found):
    assert prose.number(name) == text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (r"\num{varing.paper.total}", ("'varing'", "varying, C8", "did you mean varying?")),
        (r"\num{varying.paper.totl}", ("varying: ", "'paper.totl'", "did you mean paper.total?")),
        (r"\num{varying}", ("varying",)),
        (r"\num{varying.steps|nice}", ("varying.steps|nice", "pct")),
        (r"It helps. \pin{varying}", ("report.tex: ", "'varying'", "=")),
    ],
)
def test_an_unknown_number_and_a_pin_without_a_word_are_refused_in_a_line(text, words, written):
    written(latex=text)
    with pytest.raises(UserError) as refusal:
        prose.macros(), prose.broken()
    assert str(refusal.value).isprintable()
    assert [word for word in words if word not in str(refusal.value)] == []


def test_numbers_are_filled_into_markdown_and_notebooks_and_only_what_changed_is_written(written):
    readme, _, notebook = written(
        "It takes <!--n varying.steps|0--><!--/n-->, or\n<!--n varying.paper.home|vpct-->12 %<!--/n-->; 5 > 4.",
        r"\num{varying.steps|0}",
        ["λ: <!--n C8.restored.soon|pct-->?<!--/n-->"],
    )
    assert prose.update() == [readme, notebook]
    assert readme.read_text(encoding="utf-8") == (
        "It takes <!--n varying.steps|0-->12,346 [12,000, 13,000]<!--/n-->, or\n"
        "<!--n varying.paper.home|vpct-->93 %<!--/n-->; 5 > 4."
    )
    cells = nbformat.read(notebook, as_version=4).cells
    assert cells[0].source == "λ: <!--n C8.restored.soon|pct-->50 [40, 60] %<!--/n-->"
    assert prose.update() == []
    assert prose.macros() == {"varying.steps|0": "12,346 [12,000, 13,000]"}


COMMAS = "<!-- pin: worth=in 0, within 60 in 2, printed.the letter, tau .03=more, C8=a -->"


def test_pins_are_read_from_markdown_and_latex_paragraph_by_paragraph(written):
    written(
        "First. <!-- pin: varying=no, C8=contradicted -->\n\nNothing.\n \n<!-- pin: C8=supported -->\nLast",
        "One \\pin{varying=no} and \\num{varying.steps|0}\nmore.\\pin{C8=contradicted}\n\n\\num{varying.paper.total}",
        ["A <!-- pin: varying.paper.total=more\nor so -->", "B", COMMAS],
    )
    assert [(one.where, one.pins, one.quoted) for one in prose.paragraphs()] == [
        ("README.md", {"varying": "no", "C8": "contradicted"}, []),
        ("README.md", {"C8": "supported"}, []),
        ("report.tex", {"varying": "no", "C8": "contradicted"}, ["varying.steps"]),
        ("report.tex", {}, ["varying.paper.total"]),
        ("one.ipynb, cell cell0", {"varying.paper.total": "more or so"}, []),
        (
            "one.ipynb, cell cell2",
            {"worth": "in 0, within 60 in 2", "printed.the letter, tau .03": "more", "C8": "a"},
            [],
        ),
    ]


def test_a_sentence_whose_verdict_fell_is_named_and_one_that_quotes_a_word_unpinned(written):
    written(
        "It does not help. <!-- pin: varying=no -->\n\nAll come home. <!-- pin: C8=supported, C99=yes -->",
        "It takes \\num{varying.paper.total} of the steps. \\pin{varying=no}\n\n"
        "\\pin{varying.steps=fewer} \\num{varying.steps|0} \\num{varying.paper.home}",
    )
    expected = [
        ("README.md: ", "C8 = 'supported'", "'contradicted'", ": All come home."),
        ("README.md: ", "C99 = 'yes'", "no such", ": All come home."),
        ("report.tex: ", "quotes varying.paper.total", "'more'", ": It takes"),
    ]
    for line, words in zip(prose.broken(), expected, strict=True):
        assert [word for word in words if word not in line] == []


# The prose of the repository


def test_every_number_of_the_repository_is_as_it_was_found():
    for path in (*prose.MARKDOWN, *prose.NOTEBOOKS):
        text = path.read_text(encoding="utf-8")
        assert prose.refreshed(text) == text, f"{path}: `homing numbers` fills them in"


def test_no_line_begins_with_a_number_since_its_mark_would_end_the_paragraph():
    texts = {path: path.read_text(encoding="utf-8") for path in prose.MARKDOWN}
    for path in prose.NOTEBOOKS:
        texts[path] = "\n\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells)
    assert [path.name for path, text in texts.items() if re.search("^<!--n ", text, re.M)] == []


def test_nothing_rests_on_what_was_not_found_and_flipping_any_verdict_names_the_sentences_that_rest_on_it(monkeypatch):
    assert prose.broken() == []
    words, every = findings.verdicts(), list(prose.paragraphs())
    monkeypatch.setattr(prose, "paragraphs", lambda: every)
    pinned = {key for one in every for key in one.pins}
    assert pinned >= {one.name for one in findings.questions().values() if not one.is_claim}
    for key in pinned:
        monkeypatch.setattr(findings, "verdicts", lambda flipped=words | {key: f"not {words[key]}"}: flipped)
        named = prose.broken()
        resting = [one.where for one in every if key in one.pins]
        assert [line.partition(f": rests on {key} = {words[key]!r}, found 'not ")[0] for line in named] == resting


JUDGES = re.compile(
    r"\b(takes? (?:fewer|more|the same) steps|helps|(?<!home )is worth|brings (?:it|the robot) home|does not learn|pays"
    r"|(?:is|are|was) (?:ahead|behind|better|worse|faster|slower|undecided)|told apart|does as well)\b"
)
"""Words of judgement, in what is no question."""


def judging(text):
    """Paragraphs with such a word in a sentence, but for questions, headings, quotations, code and what is pinned."""
    text = re.sub(r"```.*?```|^#.*$|^>.*$|^%.*$|``.*?''|“.*?”|\\\w*section{.*?}", "", text, flags=re.S | re.M)
    for part in re.split(r"\n\s*\n", text):
        plain = " ".join(part.split())
        sentences = re.split(r"(?<=[.?!:]) ", plain)
        judges = any(JUDGES.search(one) and not re.search(r"[Ww]hether|\?\W*$", one) for one in sentences)
        if judges and not re.search(r"<!-- pin: |\\pin\{", part):
            yield plain[:100]


def told():
    """Text of README, the notebooks of the study and the report, by where it stands; and what judges, to try this."""
    yield (
        "here",
        "A varying λ helps. <!-- pin: C8=a -->\n\nDoes it? Learning\nis worth it.\n\n# It helps\n\nDoes it help?",
    )
    yield "README.md", prose.MARKDOWN[0].read_text(encoding="utf-8")
    yield "report.tex", prose.REPORT.read_text(encoding="utf-8").partition(r"\begin{document}")[2]
    for path in prose.NOTEBOOKS:
        for cell in nbformat.read(path, as_version=4).cells if re.match(r"0[6-9]-", path.name) else ():
            if cell.cell_type == "markdown" and not cell.id.startswith(("exercise", "solution")):
                yield f"{path.name}, {cell.id}", cell.source


def test_no_paragraph_of_the_repository_judges_without_a_pin():
    assert [(where, found) for where, text in told() for found in judging(text)] == [
        ("here", "Does it? Learning is worth it.")
    ]


NO_PROSE = re.compile(
    r"```.*?```|`[^`]*`|<!--n .*?<!--/n-->|<!--.*?-->|\$\$.*?\$\$|\$[^$]*\$|\]\([^)]*\)|https?:\S+|\d+\.\d{4}/\S+"
    r"|\{@\{[^\n]*|(?<!\\)%[^\n]*|\\begin{(equation|tabbing|align)}.*?\\end{\1}"
    r"|\\(?!emph|paragraph|textbf|drawn)[a-zA-Z]+(\[[^]]*\])?(\{[^{}]*\})+",
    re.DOTALL,
)
NUMBER = r"(?<![\w.,(\\])(?:\d[\d,]*(?:\.\d+)?|\.\d+)"
RESULT = re.compile(
    rf"{NUMBER}(?:[~\s]|\\,)*(?:\\?%|per cent|(?:times|steps|trials|m|degrees)\b)"
    r"|\[\d*\.?\d+, ?\d*\.?\d+\]|(?<![\w.,(\\])\d*\.\d\d+"
)
"""What a typed result looks like: steps, times, shares, distances, intervals, two decimals."""
NO_RESULT = re.compile(
    r"95(\\,|\s)*\\?%|([25]0?,?000|[14]0,000|600|500|300) steps|99\\,\\%|1\.(15|3) times|\[0, ?1\]"
    r"|(10|20|45) degrees|(2|3|70)(\\,|\s)*\\?%(?=\s+(the|of))"
    r"|\.904|\.908|0?\.25|0?\.95|\.75|3\.1[123]|\d\.\d+ m( by| x|, with|\)|\n)"
    # Widths of intervals, caps, bars and times of a study; lattice, home, what a study sets; what the paper prints;
    # where lambda lies, lambdas and a psi of a task; versions of Python; sizes of rooms.
)


def typed(text):
    """What looks like a result in the prose of a text, and comes from no macro and no mark."""
    plain = NO_PROSE.sub(" ", text)
    return [
        plain[max(0, one.start() - 40) : one.end() + 20]
        for one in RESULT.finditer(plain)
        if not NO_RESULT.match(plain, one.start())
    ]


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("It takes 123 steps.", 1),
        (r"It takes 1.13 [1.09, 1.17] times the steps, .86 of them, and 7\,\% are lost.", 4),
        ("It takes <!--n learns.random|v0-->371<!--/n--> steps.", 0),
        (
            r"It takes \num{learns.random|v0} steps, at $\lambda = .95$, in 2,000 steps with 95\,\% intervals.",
            0,
        ),
    ],
)
def test_a_typed_result_is_found(text, count):
    assert len(typed(text)) == count


def test_no_result_is_typed_in_the_repository():
    assert [(where, found) for where, text in told() for found in typed(text)] == []
