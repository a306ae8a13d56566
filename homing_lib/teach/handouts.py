"""The two archives of the lab: the students', who set it up from there, and the teacher's, with all solutions executed.

`homing lab` puts them into .build/lab, from notebooks/lab.ipynb and notebooks/lab/.
"""

import logging
import re
import tempfile
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import nbformat

from homing_lib.errors import UserError
from homing_lib.publish.notebooks import NOTEBOOKS, Notebook, execute
from homing_lib.storage import ROOT, present, write_bytes

LAB = NOTEBOOKS / "lab.ipynb"
GUIDE = NOTEBOOKS / "lab" / "teacher.md"
FOLDER = ROOT / ".build" / "lab"


def write(folder: Path = FOLDER) -> list[Path]:
    """Write both archives; return their paths. Raises UserError for what is missing, filled in or unsolved."""
    archives = {"lab": students(), "lab-teacher": teacher()}
    for name, files in archives.items():
        write_bytes(folder / f"{name}.zip", archive(name, files))
    return [folder / f"{name}.zip" for name in archives]


def students() -> dict[str, bytes]:
    """What is in the students' archive, by name: the blank lab, and the library.

    Raises UserError unless the cells to fill in, which have `...`, are those that the teacher's guide solves.
    """
    kinds = ".py", ".toml", ".mplstyle", ".atlas"
    library = [path for path in (ROOT / "homing_lib").rglob("*") if path.suffix in kinds]
    files = [*library, ROOT / "data" / "STUDIES.md", ROOT / "pyproject.toml", ROOT / "LICENSE"]
    packed = {path.relative_to(ROOT).as_posix(): present(path).read_bytes() for path in files}
    blank, solved = filled({}), {*solutions()}
    to_fill = {cell.id for cell in blank.cells if cell.cell_type == "code" and "..." in cell.source}
    if filled_in := sorted(solved & {cell.id for cell in blank.cells} - to_fill):
        raise UserError(f"{LAB}: {', '.join(filled_in)}: an answer where students fill in theirs; put `...` there")
    if odd := sorted(to_fill ^ solved):
        raise UserError(f"{GUIDE}: {', '.join(odd)}: each cell to fill in has one solution of its name; mend these")
    return packed | {LAB.name: _written(blank), "README.md": present(GUIDE.with_name("README.md")).read_bytes()}


def teacher() -> dict[str, bytes]:
    """What is in the teacher's archive, by name: the guide, and the solved lab."""
    return {"README.md": present(GUIDE).read_bytes(), "lab-solved.ipynb": executed(solutions())}


def solutions() -> dict[str, str]:
    """The code of each solution by the id of the cell to fill, from the teacher's guide."""
    return dict(re.findall(r"^```python (\S+)\n(.*?)\n```$", present(GUIDE).read_text(encoding="utf-8"), re.M | re.S))


def filled(answers: Mapping[str, str]) -> Notebook:
    """The lab with these answers, by the id of the cell; its last line, which checks, stays. Others stay blank."""
    notebook = nbformat.read(present(LAB), as_version=4)
    for cell in notebook.cells:
        if cell.id in answers:
            cell.source = f"{answers[cell.id]}\n\n{cell.source.splitlines()[-1]}"
    return notebook


def executed(answers: Mapping[str, str]) -> bytes:
    """The lab with these answers, run to its last cell."""
    logging.getLogger("papermill").setLevel(logging.ERROR)  # it misses a cell of parameters, of which the lab has none
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch, "lab", LAB.name)
        source.parent.mkdir()
        source.write_bytes(_written(filled(answers)))
        copy, *_ = execute(str(source))
        notebook = nbformat.read(copy, as_version=4)
    notebook.cells = [cell for cell in notebook.cells if "injected-parameters" not in cell.metadata.get("tags", [])]
    return _written(notebook)


def archive(folder: str, files: Mapping[str, bytes]) -> bytes:
    """A zip of one folder. The same files give the same bytes."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in sorted(files.items()):
            about = zipfile.ZipInfo(f"{folder}/{name}", (2026, 1, 1, 0, 0, 0))
            about.compress_type, about.create_system, about.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
            packed.writestr(about, content)
    return buffer.getvalue()


def _written(notebook: Notebook) -> bytes:
    return f"{nbformat.writes(notebook)}\n".encode()
