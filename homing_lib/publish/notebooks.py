"""Execute notebooks so that the executed copy of an unchanged notebook is the same to the byte.

A notebook has one cell tagged `parameters`, which reads exactly

    profile = "full"  # or "quick"
    figures_dir = None  # a folder to save the figures in

so that by hand it shows its figures and writes nothing, and runs with notebooks/ as its working directory.
"""

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import nbformat
from traitlets.config import Config

import homing_lib
from homing_lib.errors import UserError
from homing_lib.storage import ROOT, atomic_write, missing, write_bytes

NOTEBOOKS = ROOT / "notebooks"
# As in the Makefile, so that a notebook run without make gives the same bytes.
REPRODUCIBLE = dict.fromkeys(("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
REPRODUCIBLE |= {"PYTHONHASHSEED": "0", "PYTHONUTF8": "1", "SOURCE_DATE_EPOCH": "1767225600"}

LONGEST_SOCKET = 90  # bytes of a path, of the 104 that all systems allow, less what Jupyter adds

Notebook = Any  # nbformat.NotebookNode: a dict whose keys are attributes too


def execute(
    name: str, profile: str = "full", output_dir: Path | None = None, figures_dir: Path | None = None
) -> list[Path]:
    """Run notebooks/<name>.ipynb (or any path) and return the files written: the executed copy, then the figures.

    The copy goes to output_dir (by default executed/ beside the notebook), the figures to figures_dir (../figures).
    Raises UserError with one line if one of them cannot be written, before anything is run, or if a cell fails; the
    copy of an earlier run then stays as it was.
    """
    from papermill.translators import PythonTranslator

    source = find(name)
    output_dir = (output_dir or source.parent / "executed").absolute()
    figures_dir = (figures_dir or source.parent.parent / "figures").resolve()
    for folder in (output_dir, figures_dir):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise UserError(f"{folder}: no folder to write to ({error.strerror})") from None

    with isolated() as scratch:
        drawn = scratch / "figures"  # its own, since another notebook may be writing to figures_dir
        drawn.mkdir()
        parameters = {"figures_dir": str(drawn)} | ({"profile": profile} if profile != "full" else {})
        executed = run_cells(source, parameters, scratch)
        figures = {figures_dir / path.name: path.read_bytes() for path in sorted(drawn.iterdir())}
    for path, content in figures.items():
        write_bytes(path, content)
    normalise(executed, nbformat.read(source, as_version=4))
    place = Path(os.path.relpath(figures_dir, source.parent.resolve())).as_posix()
    for cell in executed.cells:
        cell.source = cell.source.replace(*map(PythonTranslator.translate, (str(drawn), place)))
    copy = output_dir / source.name
    with atomic_write(copy) as part:
        nbformat.write(executed, part)
    return [copy, *figures]


def run_cells(source: Path, parameters: dict[str, str], scratch: Path) -> Notebook:
    """The notebook with what its cells give under these parameters. Raises UserError if one fails."""
    import papermill  # slow to import, and only needed here
    from nbclient.exceptions import DeadKernelError
    from papermill.exceptions import PapermillExecutionError

    # Files rather than ports where there can be such, since two kernels that start at once race for a port.
    sockets = str(scratch / "kernel")
    by_file = os.name != "nt" and len(os.fsencode(sockets)) <= LONGEST_SOCKET
    try:
        return papermill.execute_notebook(
            str(source),
            None,
            parameters=parameters,
            kernel_name="python3",
            language="python",
            cwd=str(source.parent),
            progress_bar=sys.stderr.isatty(),
            config=Config(KernelManager={"transport": "ipc", "ip": sockets} if by_file else {}),
            extra_arguments=["--log-level=CRITICAL"],  # the kernel calls its own shutdown an error
        )
    except PapermillExecutionError as error:
        what = f"{error.ename}: {error.evalue}".strip().splitlines()[0]
        line = error.source.strip().splitlines()[0]
        raise UserError(f"{source.name}, cell [{error.exec_count}] `{line}`: {what}") from None
    except DeadKernelError:
        raise UserError(f"{source.name}: its process died; short of memory?") from None


def find(name: str) -> Path:
    """The notebook of that name (with or without .ipynb) or at that path."""
    for path in (Path(name), NOTEBOOKS / name, NOTEBOOKS / f"{name}.ipynb"):
        if path.suffix == ".ipynb" and path.is_file():
            return path
    known = ", ".join(sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb")))
    raise UserError(f"no notebook '{name}'; there are: {known}") if known else missing(NOTEBOOKS, "no notebooks there")


def normalise(executed: Notebook, source: Notebook) -> None:
    """Take out what differs from run to run: times, paths, random ids, memory addresses, progress bars."""
    executed.metadata = source.metadata
    known_ids = {cell.get("id") for cell in source.cells}
    for position, cell in enumerate(executed.cells):
        if cell.get("id") not in known_ids:
            cell.id = f"cell-{position}"
        for key in ("papermill", "execution"):
            cell.metadata.pop(key, None)
        if cell.cell_type == "code":
            cell.outputs = _stable(cell.outputs)


def _stable(outputs: list[Notebook]) -> list[Notebook]:
    """Without stderr, widgets and addresses; stdout in one piece, however the kernel happened to cut it."""
    kept: list[Notebook] = []
    for output in outputs:
        data = output.get("data", {})
        if output.get("name") == "stderr" or any("widget" in kind for kind in data):
            continue
        for part, key in [(output, "text"), *((data, kind) for kind in data if kind.startswith("text/"))]:
            if isinstance(part.get(key), str):
                part[key] = re.sub(r" at 0x[0-9a-fA-F]+", "", part[key])
        if kept and output.output_type == kept[-1].output_type == "stream":
            kept[-1].text += output.text
        else:
            kept.append(output)
    return kept


@contextmanager
def isolated() -> Iterator[Path]:
    """While this lasts, Jupyter and kernels know this Python environment alone, and nothing of the user's own set-up.

    Yields a folder for what they write. Figures are drawn inline, to the same bytes.
    """
    # The sockets of a kernel must not have long paths, which temporary folders have on clusters.
    long = len(os.fsencode(tempfile.gettempdir())) > LONGEST_SOCKET - 20 and os.access("/tmp", os.W_OK)
    with tempfile.TemporaryDirectory(dir="/tmp" if long else None) as scratch:
        theirs = ("PYTHON", "IPYTHON", "JUPYTER")
        kept = {name: value for name, value in os.environ.items() if not name.startswith(theirs)}
        changed = dict(
            dict.fromkeys(("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"), scratch),
            JUPYTER_PATH=f"{sys.prefix}/share/jupyter",
            JUPYTER_PLATFORM_DIRS="1",
            MATPLOTLIBRC=os.devnull,
            MPLBACKEND="module://matplotlib_inline.backend_inline",
            PYDEVD_DISABLE_FILE_VALIDATION="1",
            PYTHONPATH=str(Path(homing_lib.__file__).parents[1]),  # the same library in the kernel as here
            **REPRODUCIBLE,
        )
        with patch.dict(os.environ, kept | changed, clear=True):
            yield Path(scratch)
