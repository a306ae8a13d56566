"""The report says what the data say, in LaTeX that compiles."""

import re
from pathlib import Path

import numpy as np
import pytest

from homing_lib.agent import STEP_COLUMNS, Run
from homing_lib.publish import report
from homing_lib.publish.tex import tex
from homing_lib.settings import Settings
from homing_lib.study import errata, findings
from homing_lib.study.headline import Headline, conclusion, in_numbers

ROOT = Path(__file__).parent.parent


def runs(lengths_of_runs, **changes):
    """Runs of these episode lengths whose weights change by 1 a step."""
    made = []
    for seed, lengths in enumerate(lengths_of_runs):
        steps = np.zeros((sum(lengths), len(STEP_COLUMNS)))
        steps[:, STEP_COLUMNS.index("change")] = 1
        settings = Settings(episodes=20, **changes)
        made.append(Run(settings, seed, steps, np.array(lengths), np.ones(len(lengths), dtype=bool), 0))
    return made


RANDOM = runs([[200] * 20, [220] * 20, [180] * 20], controller="random")


def learner(early, late):
    return runs([[early + seed] * 10 + [late + seed] * 10 for seed in range(3)])


@pytest.mark.parametrize(
    ("early", "late", "verdict", "opening"),
    [
        (150, 50, "well below", "learns its way home"),
        (200, 149, "well below", "learns its way home"),
        (200, 152, "below", "learns, though"),
        (100, 90, "below", "learns, though"),
        (100, 100, "not below", "do not show"),
        (300, 250, "not below", "do not show"),  # better than at first, but no better than chance
    ],
)
def test_the_verdict_follows_from_both_comparisons(early, late, verdict, opening):
    h = Headline(learner(early, late), RANDOM)
    assert h.verdict == verdict
    assert opening in conclusion(h).partition(":")[0]
    assert f"{verdict} both" in in_numbers(h)[0]


def test_the_headline_is_what_the_runs_say():
    h = Headline(learner(150, 50), RANDOM)
    assert (h.first.value, h.last.value, h.random.value) == (151, 51, 200)
    assert h.of_first.value == pytest.approx(51 / 151)
    assert h.of_random.value == pytest.approx(51 / 200)
    assert (h.reached, h.total, h.diverged) == (60, 60, 0)
    assert h.change_fall == pytest.approx(51 / 151)


def test_a_run_that_diverged_counts_against_the_agent():
    good = learner(150, 50)
    lost = good[0]
    lost = Run(lost.settings, lost.seed, lost.steps[:150], lost.lengths[:1], lost.reached[:1], diverged=2)
    h = Headline([lost, *good[1:]], RANDOM)
    assert (h.diverged, h.reached, h.total) == (1, 41, 60)
    assert h.verdict == "not below"
    assert all("nan" not in text for text in report.numbers(h).values())


def test_every_number_that_the_report_and_the_lectures_use_is_defined_and_every_one_defined_is_used():
    defined = set(re.findall(r"^\\newcommand{\\(\w+)}", report.latex(), re.MULTILINE))
    sources = [path.read_text() for path in (ROOT / "paper").rglob("*.tex") if path.name != "numbers.tex"]
    bodies = "".join(source.partition(r"\begin{document}")[2] for source in sources)
    used = set(re.findall(r"\\([a-z]+[A-Z]\w*|verdicts?|conclusion|window|multiplier)", bodies)) - {"lVert", "rVert"}
    assert used == defined


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


def test_no_setting_is_left_out_of_the_tables_and_none_breaks_them():
    table_one, others = report.tables_of_settings()
    assert len(table_one) + len(others) == len(Settings.model_fields)
    assert [row.partition(" & ")[0] for row in table_one][:2] == ["EP", r"$\alpha_{0}$"]
    for row in [*table_one, *others]:
        assert len(re.findall(r"(?<!\\)&", row)) == 3
        assert is_latex(row), row


def figures_shown():
    """Name and notebook of each figure of the report."""
    return re.findall(
        r"\\drawn(?:\[\w+\])?{([\w-]+)}{([\w-]+)}", (ROOT / "paper/report.tex").read_text(encoding="utf-8")
    )


def test_every_figure_of_the_report_stands_there_once_and_its_caption_names_the_notebook_that_writes_it():
    sources = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "notebooks").glob("*.ipynb")}
    saved = re.compile(r'(?:figures_dir, |figures\.show\()\\"([\w-]+)\\"')
    written = {(name, notebook) for notebook, source in sources.items() for name in saved.findall(source)}
    assert len(figures_shown()) == len({*figures_shown()}) > 10
    assert {*figures_shown()} <= written


def test_the_text_refers_to_every_figure_and_table():
    source = (ROOT / "paper/report.tex").read_text(encoding="utf-8")
    labels = set(re.findall(r"\\label{([\w:-]+)}", source)) | {f"fig:{name}" for name, _ in figures_shown()}
    assert labels == set(re.findall(r"\\(?:eq)?ref{([\w:-]+)}", source))


def macros():
    return dict(re.findall(r"^\\newcommand{\\(\w+)}{(.*?)}$", report.latex(), re.MULTILINE | re.DOTALL))


def test_every_question_claim_and_erratum_has_a_row_of_the_report_and_a_line_in_the_terminal():
    tables = {name: [row.partition(" & ")[0] for row in text.splitlines()] for name, text in macros().items()}
    asked = list(findings.questions())
    assert tables["tableQuestions"] + tables["tableClaims"] == asked
    assert tables["tableErrata"] == [one.name for one in errata.ERRATA]
    assert is_latex(macros()["tableErrata"])
    assert [line.split()[0] for line in report.summary().splitlines()[-len(asked) :]] == asked


def test_the_last_live_check_is_part_of_the_summary(monkeypatch, tmp_path):
    monkeypatch.setattr(report, "VERIFIED", tmp_path / "verified")
    without = report.summary()
    report.VERIFIED.write_text("to the bit\n")
    assert [line for line in report.summary().splitlines() if line not in without.splitlines()] == ["to the bit"]


def test_findings_and_errata_are_told_in_plain_paragraphs_whose_tests_can_be_copied():
    told, slips = report.judged(), report.misprints()
    how, *each = re.split(r"\n\n(?=\w+: )", told)
    assert [re.match(r"(\w+): .*\n  Predicate: ", one)[1] for one in each] == list(findings.questions())
    assert report.judged(["C8"]).count("Predicate: ") == 1
    assert len(slips.split("\n\n")) == len(errata.ERRATA)
    assert "*" not in how + slips
    for proof in (proof for one in errata.ERRATA for proof in one.proofs if proof.startswith("tests/")):
        assert proof in slips
