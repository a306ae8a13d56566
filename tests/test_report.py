"""The report says what the data say, in LaTeX that compiles, and leads from each figure to its code and data."""

import re
import zlib

import pytest

from homing_lib.errors import UserError
from homing_lib.publish import prose, report, where
from homing_lib.publish.tex import tex
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import errata, findings

SOURCE = prose.REPORT.read_text(encoding="utf-8")


def test_plain_text_becomes_latex():
    assert tex("alpha_0 = 1.25e-3, 95 % of sigma^2") == (r"$\alpha_{0}$ = $1.25\times10^{-3}$, 95\,\% of $\sigma^2$")
    assert tex("2 NRB_t - NRB_(t-1) until psi_lower") == (
        r"2 $\mathrm{NRB}_{t}$ $-$ $\mathrm{NRB}_{t-1}$ until $\psi_{\mathrm{lower}}$"
    )
    assert tex("psi_late of phi_abc and sigma_(t-1)") == r"$\psi_{\mathrm{late}}$ of $\phi_{abc}$ and $\sigma_{t-1}$"
    assert tex("`per_bin` & 100% #1") == r"\texttt{per\_bin} \& 100\,\% \#1"


def is_latex(text):
    """Whether no special sign stands outside of maths, and no letter is beyond TeX's."""
    return text.isascii() and not re.search(r"(?<!\\)[_^#%]", re.sub(r"\$[^$]*\$", "", text))


def test_table_one_has_a_row_for_each_of_its_settings_and_for_the_thresholds():
    rows = report.table_one()
    printed = [one.description.startswith(("Table I, ", "Eq. (19)")) for one in Settings.model_fields.values()]
    assert len(rows) == sum(printed)
    assert [row.partition(" & ")[0] for row in rows][:2] == ["EP", r"$\alpha_{0}$"]
    for row in rows:
        assert len(re.findall(r"(?<!\\)&", row)) == 3
        assert is_latex(row), row


@pytest.fixture(scope="module")
def latex():
    return report.latex()


@pytest.fixture(scope="module")
def macros(latex):
    return dict(re.findall(r"^\\newcommand{\\(\w+)}{(.*?)}$", latex, re.MULTILINE | re.DOTALL))


def test_every_number_that_the_report_and_the_lectures_use_is_defined_and_every_one_defined_is_used(macros, latex):
    bodies = "".join(path.read_text(encoding="utf-8").partition(r"\begin{document}")[2] for path in prose.LATEX)
    used = set(re.findall(r"\\([a-z]+[A-Z]\w*|window)", bodies)) - {"lVert", "rVert"}
    assert used == macros.keys()
    given = set(re.findall(r"\\given{([^}]*)}", bodies))
    assert given >= {"headline.first", "settings.episodes"}
    assert [name for name in given if rf"\csname given:{name}\endcsname{{" not in latex] == []  # or nothing is printed


def test_every_question_claim_and_erratum_has_a_row_of_the_report_and_a_line_in_the_terminal(macros):
    tables = {name: [row.partition(" & ")[0] for row in text.splitlines()] for name, text in macros.items()}
    asked = list(findings.questions())
    assert tables["tableQuestions"] + tables["tableClaims"] == asked
    assert tables["tableErrata"] == [
        one.name for one in errata.ERRATA if re.search(": (fewer|more)", errata.effect(one))
    ]
    assert is_latex(macros["tableErrata"])
    assert [line.split()[0] for line in report.summary().splitlines()[-len(asked) :]] == asked


def test_findings_and_errata_are_plain_paragraphs_whose_tests_can_be_copied():
    told, slips = report.judged(), report.misprints()
    assert re.findall(r"^(\w+): .*\n  Predicate: ", told, re.M) == list(findings.questions())
    assert report.judged(["C8"]).count("Predicate: ") == 1
    assert len(slips.split("\n\n")) == len(errata.ERRATA)
    assert "*" not in told.rpartition("\n\n")[2] + slips
    for proof in (proof for one in errata.ERRATA for proof in one.proofs if proof.startswith("tests/")):
        assert proof in slips


# --- Figures and links ------------------------------------------------------------------------------------------------


def test_the_text_refers_to_every_figure_and_table():
    labels = {*re.findall(r"\\label{([\w:-]+)}", SOURCE), *(f"fig:{name}" for name in where.reported())}
    assert labels == set(re.findall(r"\\(?:eq)?ref{([\w:-]+)}", SOURCE))


def test_a_figure_that_no_notebook_saves_is_refused_by_its_name(monkeypatch, tmp_path):
    (tmp_path / "report.tex").write_text("\\drawn{fig4-rom}{A caption.}\n\\drawn{learns}{Another.}\n")
    monkeypatch.setattr(where, "REPORT", tmp_path / "report.tex")
    with pytest.raises(UserError, match=r"report\.tex: .*'fig4-rom'.*did you mean fig4-room\?"):
        where.reported()


def test_links_of_the_report_lead_to_files_and_from_each_caption_to_code_and_data_and_no_viewer_needs_to_run_any():
    pdf = prose.REPORT.with_suffix(".pdf").read_bytes()
    streams = re.findall(rb"/FlateDecode[^>]*>>\s*stream\r?\n(.*?)endstream", pdf, re.DOTALL)
    objects = b"\n".join([pdf, *(zlib.decompressobj().decompress(stream) for stream in streams)])
    addresses = {address.decode() for address in re.findall(rb"/URI\s*\(([^)]*)\)", objects)}
    files = {address for address in addresses if not address.startswith("https://")}
    assert files == {f"../{path}" for path in report.linked()}
    assert [path for path in report.linked() if not (ROOT / path).is_file()] == []
    assert not re.search(rb"/S\s*/(Launch|GoToR)", objects)
    assert set(re.findall(rb"/D\s*\(made:([\w-]+)\)", objects)) == {name.encode() for name in where.reported()}
    assert {*re.findall(rb"/D\s*\((made:[\w-]+)\)", objects)} <= {*re.findall(rb"\((made:[\w-]+)\)\s*\d+ 0 R", objects)}


def test_the_report_has_a_text_for_those_who_do_not_see_a_figure():
    pdf = prose.REPORT.with_suffix(".pdf").read_bytes()
    streams = re.findall(rb"/FlateDecode[^>]*>>\s*stream\r?\n(.*?)endstream", pdf, re.DOTALL)
    content = b"".join(zlib.decompressobj().decompress(stream) for stream in streams)
    texts = [bytes.fromhex(text.decode()).decode("utf-16") for text in re.findall(rb"/Alt <(\w+)>", content)]
    assert sorted(texts) == sorted(where.in_words(one.function) for one in where.reported().values())
