"""From a figure to its code and data: the notebook's cell that saves it, what that cell depends on, and what draws.

A notebook is read, not run. Of its statements up to the figure those count that the figure depends on: each gives a
name that a later one reads.
"""

import ast
import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from symtable import symtable
from typing import Any, NamedTuple

import nbformat
from matplotlib.figure import Figure

from homing_lib.errors import UserError, nearest, shown
from homing_lib.publish.notebooks import NOTEBOOKS, Notebook
from homing_lib.publish.prose import REPORT
from homing_lib.storage import ROOT
from homing_lib.study import findings
from homing_lib.study.runs import Study


class Drawn(NamedTuple):
    """A figure, and where it is saved: notebook, cell, and the statements on which it depends, the last one first."""

    notebook: Path
    cell: str
    statements: list[ast.stmt]
    imported: dict[str, Any]

    def calls(self) -> Iterator[tuple[ast.Call, Any]]:
        """Calls in these statements, with the function where it is one of the library."""
        for statement in self.statements:
            for node in ast.walk(statement):
                if isinstance(node, ast.Call):
                    yield node, looked_up(node.func, self.imported)

    @property
    def function(self) -> Any:
        """What draws it."""
        for _, function in self.calls():
            if draws(function):
                return inspect.unwrap(function)
        raise UserError(f"{self.notebook}: cell {self.cell}: no function that it calls is annotated `-> Figure`")

    @property
    def asked(self) -> list[str]:
        """The questions and claims whose findings it shows."""
        texts = [argument for call, _ in self.calls() for argument in call.args if isinstance(argument, ast.Constant)]
        return [name for name in findings.questions() if any(text.value == name for text in texts)]

    @property
    def studies(self) -> list[Study]:
        """The studies that it shows: those that its cell reads, then those of its questions."""
        nodes = [node for part in self.statements for node in ast.walk(part) if isinstance(node, ast.expr)]
        named = [looked_up(node, self.imported) for node in nodes]
        named += [one for name in self.asked for one in findings.questions()[name].studies]
        return list({one.name: one for one in named if isinstance(one, Study)}.values())


def origin(name: str) -> str:
    """What made a figure, as text. Raises UserError if there is none of this name.

    name: as in figures/ (fig4 for fig4-room), or its number in the report.
    """
    every, numbered = drawn(), in_report()
    name = _named(name, every, numbered)
    figure, function = every[name], every[name].function
    number = f", Figure {numbered.index(name) + 1} of the report" if name in numbered else ""
    lines = [
        f"{name}: figures/{name}.pdf and .png{number}",
        f"  cell      {figure.cell} of {figure.notebook.relative_to(ROOT)}; `homing notebook {figure.notebook.stem}`",
        f"  drawn by  {function.__name__} in {file_of(function)}, line {function.__code__.co_firstlineno}",
    ]
    for asked in figure.asked:
        lines.append(f"  judged in {file_of(findings.questions()[asked].judge)}; `homing claims {asked}`")
    for study in figure.studies:
        scope = f"{len(study)} runs, seeds {min(study.seeds)} to {max(study.seeds)}"
        lines.append(f"  data      {stored_in(study)}: {scope}; `homing data {study.name}`")
    return "\n".join(lines if figure.studies else [*lines, "  data      computed in the notebook"])


def file_of(function: Any) -> str:
    """Where a function is defined, from the root of the repository."""
    return Path(inspect.unwrap(function).__code__.co_filename).relative_to(ROOT).as_posix()


def stored_in(study: Study) -> str:
    """The table of a study, or the manifest of its complete runs, from the root of the repository."""
    return (study.table if study.measure else study.manifest).relative_to(ROOT).as_posix()


def in_report() -> list[str]:
    """The names of the report's figures, in order; "" for one that is typeset there."""
    report = REPORT.read_text(encoding="utf-8")
    return re.findall(r"^\\(?:drawn(?:\[\w+\])?{([\w-]+)}|begin{figure})", report, re.M)


def reported() -> dict[str, Drawn]:
    """The figures of the report that are drawn, in order, by name. Raises UserError for one that no notebook saves."""
    every, names = drawn(), [name for name in in_report() if name]
    for name in names:
        if name not in every:
            raise UserError(f"{REPORT}: no notebook saves a figure {name!r}{nearest(name, every)}")
    return {name: every[name] for name in names}


def _named(name: str, every: Mapping[str, Drawn], numbered: Sequence[str]) -> str:
    by_number = {str(place): one for place, one in enumerate(numbered, 1) if one}
    begun = (one for one in every if one == name or (name.startswith("fig") and one.startswith(f"{name}-")))
    if found := next(begun, by_number.get(name.removeprefix("fig"))):
        return found
    raise UserError(f"figure {shown(name)}: no notebook draws it; there are {', '.join(every)}{nearest(name, every)}")


def drawn() -> dict[str, Drawn]:
    """Every figure that a numbered notebook saves, by its name."""
    every: dict[str, Drawn] = {}
    for path in sorted(NOTEBOOKS.glob("[0-9]*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        imported, before = imports(notebook), list[ast.stmt]()
        for cell in notebook.cells:
            if cell.cell_type == "code":
                for statement in ast.parse(cell.source).body:
                    for name in _saves(statement):
                        every[name] = Drawn(path, cell.id, behind(statement, before), imported)
                    before.append(statement)
    return dict(sorted(every.items()))


def _saves(statement: ast.stmt) -> Iterator[str]:
    """The names under which a statement saves figures: the text beside `figures_dir`."""
    for node in ast.walk(statement):
        if isinstance(node, ast.Call) and any(isinstance(a, ast.Name) and a.id == "figures_dir" for a in node.args):
            yield from (str(a.value) for a in node.args if isinstance(a, ast.Constant))


def behind(last: ast.stmt, before: Sequence[ast.stmt]) -> list[ast.stmt]:
    """A statement and those that it depends on, backwards."""
    kept, (_, wanted) = [last], _names(last)
    for statement in reversed(before):
        given, read = _names(statement)
        if wanted & given:
            kept.append(statement)
            certain = isinstance(statement, ast.Assign | ast.FunctionDef)  # nothing that stood there before is left
            wanted = (wanted - given if certain else wanted) | read
    return kept


def _names(statement: ast.stmt) -> tuple[set[str], set[str]]:
    """The names of the notebook that a statement gives, and those that it reads, also in functions inside it."""
    outer = symtable(ast.unparse(statement), "a cell", "exec")
    given = {symbol.get_name() for symbol in outer.get_symbols() if symbol.is_assigned()}
    read = {symbol.get_name() for symbol in outer.get_symbols() if symbol.is_referenced()}
    inner = outer.get_children()
    while inner:
        scope = inner.pop()
        read |= {symbol.get_name() for symbol in scope.get_symbols() if symbol.is_global()}
        inner += scope.get_children()
    filled = [
        node.value
        for node in ast.walk(statement)
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store)
    ]
    return given | {base.id for base in filled if isinstance(base, ast.Name)}, read


def imports(notebook: Notebook) -> dict[str, Any]:
    """What a notebook imports of the library, by name; of an older copy, what there still is."""
    available: dict[str, Any] = {}
    for cell in notebook.cells:
        for node in ast.walk(ast.parse(cell.source)) if cell.cell_type == "code" else ():
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("homing_lib"):
                for alias in node.names:
                    with suppress(ModuleNotFoundError):
                        found = getattr(import_module(node.module), alias.name, None)
                        available[alias.asname or alias.name] = found or import_module(f"{node.module}.{alias.name}")
    return available


def looked_up(node: ast.expr, imported: dict[str, Any]) -> Any:
    """What `charts.worth` is in a notebook; None if it is nothing of the library."""
    if isinstance(node, ast.Attribute):
        return getattr(looked_up(node.value, imported), node.attr, None)
    return imported.get(node.id) if isinstance(node, ast.Name) else None


def draws(function: Any) -> bool:
    """Whether it returns a figure."""
    return getattr(function, "__annotations__", {}).get("return") in (Figure, "Figure")


def in_words(function: Any) -> str:
    """What a function draws: the first sentence of its docstring, without what that says of arguments."""
    (source,) = ast.parse(inspect.getsource(inspect.unwrap(function))).body  # `python -OO` has no docstrings
    docstring = ast.get_docstring(source) if isinstance(source, ast.FunctionDef) else ""
    drawn = re.sub(r"^The paper's Fig\. \d: ", "", docstring or "")
    return re.split(r"(?<!eq)\. |; |,? shape |\.?\n|\.$", drawn)[0] + "."
