"""The site opens from disk and asks nobody for anything: every page, picture, link and formula of it is there."""

import inspect
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

from homing_lib.errors import UserError
from homing_lib.publish import charts, demo, site

NOTEBOOKS = sorted(path.stem for path in site.NOTEBOOKS.glob("[0-9]*.ipynb"))
PAGES = sorted([*(f"{name}.html" for name in NOTEBOOKS), *site.TEXTS, "claims.html", "errata.html", "model.html"])


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    return site.build()


@pytest.fixture(scope="module")
def pages(files) -> dict[str, BeautifulSoup]:
    return {name: BeautifulSoup(files[name], "html.parser") for name in PAGES}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The site as it is written, in place of an older one."""
    folder = tmp_path_factory.mktemp("site") / "site"
    folder.mkdir()
    (folder / "stale.html").touch()
    site.write(folder)
    return folder


def test_the_site_is_all_its_pages_within_thirty_megabytes(files):
    assert sorted(name for name in files if name.endswith(".html")) == sorted([*PAGES, "demo.html"])
    assert sum(map(len, files.values())) <= 30_000_000


def test_what_the_report_links_is_there_as_it_is_in_a_clone(files):
    assert {*site.report.linked()} <= files.keys()
    assert {"paper/report.pdf", "data/learns.parquet", "homing_lib/publish/curves.py"} <= files.keys()


def test_written_a_second_time_it_is_the_same_to_the_byte_and_nothing_of_an_older_one_stays(files, folder):
    assert {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.*")} == files


def test_without_docstrings_as_under_python_oo_a_figure_keeps_its_words(monkeypatch):
    words = site.in_words(charts.conjugate)
    monkeypatch.setattr(inspect.unwrap(charts.conjugate), "__doc__", None)
    assert site.in_words(charts.conjugate) == words
    assert len(words.split()) > 3


def test_no_page_loads_anything_from_elsewhere_and_none_runs_a_script(files, pages):
    for name, page in pages.items():
        loaded = [tag[key] for tag in page.find_all() for key in ("src", "srcset", "data", "poster") if tag.get(key)]
        loaded += [tag["href"] for tag in page.find_all("link")]
        loaded += re.findall(r"url\(([^)]*)\)", str(page))
        assert not [address for address in loaded if ":" in address.removeprefix("data:")], name
        assert not page.find_all(["script", "iframe", "object", "embed"])
    assert not re.search(rb"url\(|@import", files["page.css"])


def test_every_link_leads_to_a_file_of_the_site_and_to_a_place_in_it_or_out_by_a_click(files, pages):
    for name, page in pages.items():
        for link in page.find_all(["a", "img", "link"]):
            address = link.get("href") or link["src"]
            if address.startswith(("https://", "data:")):
                continue
            file, _, place = address.partition("#")
            assert (file or name) in files, f"{name}: {address}"
            if place and (file or name) in pages:
                assert pages[file or name].find(id=place), f"{name}: {address}"


@pytest.mark.parametrize("address", site.TEXTS)
def test_a_text_of_the_repository_keeps_its_links_to_what_the_site_has(address, pages):
    """Notebooks, lessons, slides and the demonstration in its state; a link to a source is plain text."""
    source = site.TEXTS[address]
    linked = re.findall(r"\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", site.text(source), flags=re.S))
    kept = {link["href"] for link in pages[address].find_all("a")} | {
        image["src"] for image in pages[address].find_all("img")
    }
    for link in linked:
        file, sign, place = link.partition("#")
        target = (source.parent / file).resolve()
        if link.startswith("https:"):
            assert link in kept
        elif target == demo.PAGE or target.suffix in (".ipynb", ".pdf", ".png", ".gif"):
            name = target.relative_to(site.ROOT).as_posix()
            name = f"{target.stem}.html" if target.stem in NOTEBOOKS else "demo.html" if target == demo.PAGE else name
            assert name + sign + place in kept, link
    assert {"paper/report.pdf", "teaching.html", "demo.html"} <= kept


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_shows_all_its_figures_each_with_words_for_it(name, files, pages):
    notebook = nbformat.read(site.NOTEBOOKS / "executed" / f"{name}.ipynb", as_version=4)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    drawn = [output for output in outputs if "image/png" in output.get("data", {})]
    shown = pages[f"{name}.html"].find_all("img")
    assert len(shown) == len(drawn) == len({image["src"] for image in shown})
    assert all(files[image["src"]].startswith(b"\x89PNG") for image in shown)
    assert all(len(image["alt"].split("”: ")[1].split()) >= 3 for image in shown)


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_every_formula_is_mathml_and_no_dollar_is_left(name, pages):
    notebook = nbformat.read(site.NOTEBOOKS / "executed" / f"{name}.ipynb", as_version=4)
    texts = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    prose = re.sub(r"```.*?```|`[^`]*`", "", "\n".join(texts), flags=re.S)
    blocks = len(re.findall(r"\$\$.+?\$\$", prose, re.S))
    page = BeautifulSoup(str(pages[f"{name}.html"]), "html.parser")
    formulas = page.find_all("math")
    assert sum(formula.get("display") == "block" for formula in formulas) == blocks
    assert len(formulas) >= blocks + len(re.findall(r"\$[^$]+\$", prose.replace("$$", "")))
    assert not [formula for formula in formulas if re.search(r"[\\&]", formula.get_text())]
    for code in page.find_all(["pre", "code"]):
        code.decompose()
    assert "$" not in page.get_text()


def test_headings_go_down_by_one_and_every_page_says_its_language_and_title(pages):
    assert len({page.title.get_text() for page in pages.values()}) == len(pages)
    for name, page in pages.items():
        levels = [int(heading.name[1]) for heading in page.find_all(re.compile(r"^h\d$"))]
        assert (levels[0], levels.count(1)) == (1, 1), name
        assert all(after <= before + 1 for before, after in pairwise(levels)), name
        assert page.html["lang"] == "en"
        assert all(image.get("alt") for image in page.find_all("img"))
        ids = Counter(tag["id"] for tag in page.find_all(id=True))
        assert not [one for one, times in ids.items() if times > 1], name


def test_the_later_notebooks_fold_their_code_and_the_lessons_show_it(pages):
    folded = [bool(pages[f"{name}.html"].select("details.code")) for name in NOTEBOOKS]
    assert folded == [False] * site.LESSONS + [True] * (len(NOTEBOOKS) - site.LESSONS)


def test_the_demonstration_leads_back_to_the_first_page(files):
    assert b'<h1><a href="index.html">' in files["demo.html"]


def test_each_claim_and_erratum_is_a_row_of_as_many_cells_as_the_head(pages):
    for name, count in {"claims.html": len(site.findings.questions()), "errata.html": len(site.errata.ERRATA)}.items():
        head, *rows = pages[name].table.find_all("tr")
        assert len(rows) == count
        assert {len(row.find_all("td")) for row in rows} == {len(head.find_all("th"))}


def test_the_page_of_the_model_has_what_its_modules_offer_and_every_setting(pages):
    page = pages["model.html"]
    headings = {heading.get_text().rstrip("¶") for heading in page.find_all("h3")}
    assert {"lambdas.fletcher_reeves", "sarsa.LinearSarsa", "environment.HomingEnv", "arena.Arena"} <= headings
    assert not [name for name in headings if name.split(".")[1].startswith("_")]
    assert "Eq. (7), form 2" in page.get_text()
    assert [row.td.get_text() for row in page.table.find_all("tr")[1:]] == list(site.Settings.model_fields)


def test_what_is_not_there_is_named_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setitem(site.TEXTS, "teaching.html", tmp_path / "TEACHING.md")
    with pytest.raises(UserError, match=r"TEACHING\.md: missing; `make` builds it"):
        site.build()


@pytest.mark.parametrize("name", PAGES)
def test_in_a_browser_a_page_fits_a_phone_and_a_wall_and_complains_of_nothing(chromium, folder, name):
    chromium.said.clear()
    chromium.asked.clear()
    chromium.open((folder / name).as_uri())
    for width in (390, 1920):
        chromium.resize(width, 900)
        assert chromium("document.documentElement.scrollWidth") <= width
        sizes = chromium("[...document.querySelectorAll('math')].map((m) => parseFloat(getComputedStyle(m).fontSize))")
        assert min(sizes, default=16) >= 13
    assert chromium.said == []
    elsewhere = {address for address in chromium.asked if not address.startswith(folder.as_uri())}
    assert elsewhere <= {"about:blank", "data:,"}
