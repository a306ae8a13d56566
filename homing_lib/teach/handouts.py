"""The two archives of the lab: the students', who set it up from there, and the teacher's, with all solutions executed.

`python -m homing_lib.teach.handouts` puts them into .build/lab, from notebooks/lab.ipynb and notebooks/lab/.
"""

import logging
import re
import tempfile
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import nbformat

from homing_lib.publish.notebooks import NOTEBOOKS, Notebook, execute
from homing_lib.storage import ROOT, write_bytes
from homing_lib.study.runs import missing

LAB = NOTEBOOKS / "lab.ipynb"
GUIDE = NOTEBOOKS / "lab" / "teacher.md"
FOLDER = ROOT / ".build" / "lab"


def solutions() -> dict[str, str]:
    """The code of each solution by the id of the cell to fill, from the teacher's guide."""
    return dict(re.findall(r"^```python (\S+)\n(.*?)\n```$", _content(GUIDE).decode(), re.M | re.S))


def filled(answers: Mapping[str, str]) -> Notebook:
    """The lab with these answers, by the id of the cell; its last line, which checks, stays. Others stay blank."""
    notebook = nbformat.reads(_content(LAB).decode(), as_version=4)
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
        nbformat.write(filled(answers), source)
        copy, *_ = execute(str(source))
        notebook = nbformat.read(copy, as_version=4)
    notebook.cells = [cell for cell in notebook.cells if "injected-parameters" not in cell.metadata.get("tags", [])]
    return f"{nbformat.writes(notebook)}\n".encode()


def students() -> dict[str, bytes]:
    """What is in the students' archive, by name: the blank lab, and the library."""
    kinds = ".py", ".toml", ".atlas", ".mplstyle"
    library = [path for path in (ROOT / "homing_lib").rglob("*") if path.suffix in kinds]
    files = [*library, ROOT / "data" / "STUDIES.md", ROOT / "pyproject.toml", ROOT / "LICENSE"]
    packed = {path.relative_to(ROOT).as_posix(): _content(path) for path in files}
    return packed | {LAB.name: _content(LAB), "README.md": _content(GUIDE.with_name("README.md"))}


def teacher() -> dict[str, bytes]:
    """What is in the teacher's."""
    return {"README.md": _content(GUIDE), "lab-solved.ipynb": executed(solutions())}


def archive(folder: str, files: Mapping[str, bytes]) -> bytes:
    """A zip of one folder. The same files give the same bytes."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in sorted(files.items()):
            about = zipfile.ZipInfo(f"{folder}/{name}", (2026, 1, 1, 0, 0, 0))
            about.compress_type, about.create_system, about.external_attr = zipfile.ZIP_DEFLATED, 3, 0o644 << 16
            packed.writestr(about, content)
    return buffer.getvalue()


def _content(path: Path) -> bytes:
    if not path.exists():
        raise missing(path, "missing; restore it with git")
    return path.read_bytes()


if __name__ == "__main__":
    for name, files in {"lab": students(), "lab-teacher": teacher()}.items():
        write_bytes(FOLDER / f"{name}.zip", archive(name, files))
