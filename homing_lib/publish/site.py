"""The site: the whole companion as pages that open from disk, ask nobody for anything, and need no JavaScript.

`homing site` writes .build/site from README, TEACHING, the executed notebooks, the verdicts and the docstrings, with
the demonstration, the report and whatever these pages show or hand out. Every page is a notebook, if need be of one
cell, that nbconvert puts into the template notebooks/site/; its mathematics becomes MathML on the way.
"""

import ast
import os
import re
import shutil
from collections.abc import Callable, Iterable
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import nbformat
from latex2mathml.converter import convert
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from pygments.formatters import HtmlFormatter
from traitlets.config import Config

import homing_lib
from homing_lib.publish import demo, report
from homing_lib.publish.notebooks import NOTEBOOKS, Notebook, isolated
from homing_lib.publish.where import draws, imports, in_words, looked_up
from homing_lib.settings import Settings
from homing_lib.storage import ROOT, present, write_bytes
from homing_lib.study import errata, findings

SITE = ROOT / ".build" / "site"
TEMPLATE = NOTEBOOKS / "site"
LESSONS = 4
"""The first notebooks, which teach: their code is shown, that of the later ones is folded away."""

DOORS = (
    ("index.html", "Home"),
    ("demo.html", "Play"),
    ("teaching.html", "Teach"),
    ("paper/report.pdf", "Report"),
    ("claims.html", "Claims"),
    ("errata.html", "Errata"),
    ("model.html", "Model"),
)
TEXTS = {"index.html": ROOT / "README.md", "teaching.html": NOTEBOOKS / "TEACHING.md"}
COPIED = (".pdf", ".png", ".gif", ".ipynb")
"""What comes along where a page links to it; a link to a source becomes plain text."""

HOMEWARDS = ("<h1>The homing companion</h1>", '<h1><a href="index.html">The homing companion</a></h1>')
"""The heading of the demonstration, and what it is in the site: the way back."""


def build() -> dict[str, bytes]:
    """Every file of the site by its name. The same inputs give the same bytes. Raises UserError."""
    css = HtmlFormatter(style="friendly").get_style_defs(".highlight pre")
    files = {
        "demo.html": text(demo.PAGE).replace(*HOMEWARDS).encode(),
        "page.css": (demo.palette() + text(TEMPLATE / "page.css") + css + "\n").encode(),
    }
    notebooks = {
        f"{source.stem}.html": nbformat.reads(text(NOTEBOOKS / "executed" / source.name), as_version=4)
        for source in sorted(NOTEBOOKS.glob("[0-9]*.ipynb"))
    }
    links = Links(notebooks)
    pages = {
        **{address: text(source) for address, source in TEXTS.items()},
        "claims.html": f"# Questions and claims\n\n{findings.HOW}\n\n{findings.table(findings.stored())}",
        "errata.html": f"# Slips of the printed paper\n\n{errata.table(errata.ERRATA)}",
        "model.html": model(),
    }
    chain = [(address, title(notebook)) for address, notebook in notebooks.items()]
    ends = [("index.html", "Home"), *chain, ("claims.html", "Claims")]
    with isolated():
        for address, markdown in pages.items():
            cell = nbformat.v4.new_markdown_cell(markdown, id="page")
            leads = partial(links.from_folder, TEXTS.get(address, ROOT / "README.md").parent)
            files |= converted(nbformat.v4.new_notebook(cells=[cell]), address, leads)
        for place, (address, notebook) in enumerate(notebooks.items(), start=1):
            describe(notebook)
            around = {"before": ends[place - 1], "after": ends[place + 1], "folded": place > LESSONS}
            files |= converted(notebook, address, partial(links.from_folder, NOTEBOOKS), **around)
    return files | {path.relative_to(ROOT).as_posix(): content(path) for path in links.copied}


def content(path: Path) -> bytes:
    return present(path, "missing; `make` builds it, and git has it").read_bytes()


def text(path: Path) -> str:
    return content(path).decode("utf-8")


# --- From a notebook to a page ---------------------------------------------------------------------------------------


class Links:
    """Where the links of the repository lead on the site. copied: the files that come along, at the same place as in
    the repository: what pages link to, as it is met, and the report with all that it links to.
    """

    def __init__(self, notebooks: Iterable[str]) -> None:
        self.pages = {source: address for address, source in TEXTS.items()} | {demo.PAGE: "demo.html"}
        for address in notebooks:
            for folder in (NOTEBOOKS, NOTEBOOKS / "executed"):
                self.pages[folder / address.replace(".html", ".ipynb")] = address
        self.copied = {ROOT / name for name in ("paper/report.pdf", *report.linked())}

    def from_folder(self, folder: Path, url: str) -> str:
        """The address on the site of what a page in this folder links to; "" for what the site does not have."""
        if re.match(r"#|\w+:", url):
            return url
        file, sign, place = url.partition("#")
        path = Path(os.path.normpath(folder / file))
        if path in self.pages:
            return self.pages[path] + sign + place
        if path.suffix not in COPIED:
            return ""
        self.copied.add(path)
        return path.relative_to(ROOT).as_posix()


class Renderer(IPythonRenderer):
    """Markdown as HTML: formulas as MathML, links within the site, tables that scroll by themselves."""

    def __init__(self, leads: Callable[[str], str]) -> None:
        super().__init__(escape=False)
        self.leads = leads

    def block_math(self, body: str) -> str:
        return mathml(body, display="block")

    def inline_math(self, body: str) -> str:
        return mathml(body, display="inline")

    def link(self, text: str, url: str, title: str | None = None) -> str:
        address = self.leads(url)
        return super().link(text, address, title) if address else text

    def image(self, text: str, url: str, title: str | None = None) -> str:
        return super().image(text, self.leads(url), title)

    def table(self, text: str) -> str:
        """On a phone, a table with sentences in its cells is read row by row: class `rows`."""
        longest = max(len(re.sub(r"<[^>]*>", "", cell)) for cell in re.findall(r"<td.*?</td>", text, re.S))
        kind = "wide rows" if longest > 120 else "wide"
        return f'<div class="{kind}" tabindex="0">\n<table>\n{text}</table>\n</div>\n'


def mathml(latex: str, display: str) -> str:
    """A formula; its bars are as high as the letters between them, and as near on either side."""
    bar = r"<mo[^>]*>(\||∥|&#x0007C;|&#x02016;|&#x02225;)</mo>"
    known = latex.replace("{aligned}", "{split}")  # the same within a formula, and the one that is converted
    return re.sub(bar, r'<mo stretchy="false" lspace="0" rspace="0">\1</mo>', convert(known, display=display))


def rendered(leads: Callable[[str], str], markdown: str) -> str:
    """Markdown as HTML, without its comments."""
    return MarkdownWithMath(renderer=Renderer(leads)).render(re.sub(r"<!--.*?-->", "", markdown, flags=re.S))


def converted(notebook: Notebook, address: str, leads: Callable[[str], str], **resources: Any) -> dict[str, bytes]:
    """The page and its images, by name. leads: where a link leads on the site, as in `Links.from_folder`."""
    exporter = HTMLExporter(
        template_name="site",
        extra_template_basedirs=[str(NOTEBOOKS)],
        filters={"markdown2html": partial(rendered, leads)},
        config=Config(ExtractOutputPreprocessor={"enabled": True}),
    )
    # Without the cells tagged "parameters", and papermill's "injected-parameters".
    notebook.cells = [cell for cell in notebook.cells if "parameters" not in str(cell.metadata.get("tags"))]
    resources |= {"address": address, "title": title(notebook), "doors": DOORS, "unique_key": Path(address).stem}
    html, resources = exporter.from_notebook_node(notebook, resources)
    return {address: html.encode(), **resources["outputs"]}


def title(notebook: Notebook) -> str:
    """Its first heading."""
    return notebook.cells[0].source.splitlines()[0].removeprefix("# ")


def describe(notebook: Notebook) -> None:
    """Give each cell the text that stands for its figure: its section, and what the function draws."""
    section, functions = "", imports(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            section = [section, *re.findall(r"^#+ (.*)", cell.source, re.M)][-1]
            continue
        named = [looked_up(node, functions) for node in ast.walk(ast.parse(cell.source)) if isinstance(node, ast.expr)]
        drawings = [in_words(function) for function in named if draws(function)]
        cell.metadata.alt = " ".join([f"Figure, “{section}”:", *drawings])


# --- Pages of our own ------------------------------------------------------------------------------------------------


def model() -> str:
    """The model's wing: the signatures and docstrings of its functions and classes, and every setting."""
    parts = ["# The model", "", "Every public function and class, by module, from the docstrings."]
    for path in sorted(Path(homing_lib.__file__).parent.glob("[a-z]*.py")):
        tree = ast.parse(text(path))
        parts += [f"## {path.stem}", documented(tree)]
        for node in public(tree):
            methods = public(node) if isinstance(node, ast.ClassDef) else []
            parts += [f"### {path.stem}.{node.name}", signature(node), documented(node)]
            parts += [part for method in methods for part in (signature(method), documented(method))]
    rows = [f"| `{name}` | `{field.default}` | {field.description} |" for name, field in Settings.model_fields.items()]
    parts += ["## Every setting", "\n".join(["| setting | default | what, and its source |", "|---|---|---|", *rows])]
    return "\n\n".join(parts)


Documented = ast.FunctionDef | ast.ClassDef


def public(parent: ast.Module | ast.ClassDef) -> list[Documented]:
    """Functions and classes for use elsewhere, in the order of the file."""
    return [node for node in parent.body if isinstance(node, Documented) and not node.name.startswith("_")]


def signature(node: Documented) -> str:
    """What a function takes and returns, as HTML; nothing for a class."""
    if isinstance(node, ast.ClassDef):
        return ""
    returned = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f'<pre class="signature">{escape(f"{node.name}({ast.unparse(node.args)}){returned}", quote=False)}</pre>'


def documented(node: ast.Module | Documented) -> str:
    """A docstring as HTML: paragraphs, and what is indented or a table as it stands."""
    html = []
    for part in (ast.get_docstring(node) or "").split("\n\n"):
        kind = "pre" if re.search(r"^[ |]|  ", part, re.M) else "p"
        marked = re.sub(r"`+([^`]+)`+", r"<code>\1</code>", escape(part, quote=False))
        html.append(f"<{kind}>{marked}</{kind}>")
    return "\n".join(html)


def write(folder: Path = SITE) -> None:
    """Write the site in place of the one that is there."""
    files = build()
    shutil.rmtree(folder, ignore_errors=True)
    for name, page in files.items():
        write_bytes(folder / name, page)
