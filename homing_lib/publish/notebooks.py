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

import nbformat
from traitlets.config import Config

from homing_lib.errors import UserError
from homing_lib.storage import ROOT, atomic_write, write_bytes
from homing_lib.study.runs import missing

NOTEBOOKS = ROOT / "notebooks"
PARAMETERS = ('profile = "full"', "figures_dir = None")
# As in the Makefile, so that a notebook run without make gives the same bytes.
REPRODUCIBLE = dict.fromkeys(("MKL_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
REPRODUCIBLE |= {"PYTHONHASHSEED": "0", "SOURCE_DATE_EPOCH": "1767225600"}

Notebook = Any  # nbformat.NotebookNode: a dict whose keys are attributes too


def execute(
    name: str, profile: str = "full", output_dir: Path | None = None, figures_dir: Path | None = None
) -> list[Path]:
    """Run notebooks/<name>.ipynb (or any path) and return the files written: the executed copy, then the figures.

    The copy goes to output_dir (by default executed/ beside the notebook), the figures to figures_dir (../figures).
    Raises UserError with one line if a cell fails; the copy of an earlier run then stays as it was.
    """
    import papermill  # slow to import, and only needed here
    from nbclient.exceptions import DeadKernelError
    from papermill.exceptions import PapermillExecutionError

    source = find(name)
    output_dir = (output_dir or source.parent / "executed").absolute()
    figures_dir = (figures_dir or source.parent.parent / "figures").resolve()
    for folder in (output_dir, figures_dir):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"{folder}: no folder to write to ({error.strerror})") from None

    with isolated() as scratch:
        drawn = Path(scratch, "figures")  # its own, since another notebook may be writing to figures_dir
        drawn.mkdir()
        parameters = {"figures_dir": str(drawn)} | ({"profile": profile} if profile != "full" else {})
        # Files rather than ports where there are such, since two kernels that start at once race for a port.
        channel = {} if os.name == "nt" else {"transport": "ipc", "ip": f"{scratch}/kernel"}
        try:
            executed = papermill.execute_notebook(
                str(source),
                None,
                parameters=parameters,
                kernel_name="python3",
                language="python",
                cwd=str(source.parent),
                progress_bar=sys.stderr.isatty(),
                config=Config(KernelManager=channel),
                extra_arguments=["--log-level=CRITICAL"],  # the kernel calls its own shutdown an error
            )
        except PapermillExecutionError as error:
            what = f"{error.ename}: {error.evalue}".strip().splitlines()[0]
            line = error.source.strip().splitlines()[0]
            raise UserError(f"{source.name}, cell [{error.exec_count}] `{line}`: {what}") from None
        except DeadKernelError:
            raise UserError(f"{source.name}: its process died; short of memory?") from None
        figures = {figures_dir / path.name: path.read_bytes() for path in sorted(drawn.iterdir())}
        for path, content in figures.items():
            write_bytes(path, content)

    normalise(executed, nbformat.read(source, as_version=4))
    place = Path(os.path.relpath(figures_dir, source.parent.resolve())).as_posix()
    for cell in executed.cells:
        cell.source = cell.source.replace(str(drawn), place)
    copy = output_dir / source.name
    with atomic_write(copy) as part:
        nbformat.write(executed, part)
    return [copy, *figures]


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


def problems(source: Path) -> list[str]:
    """What keeps a source notebook from being one: stored results, no stable cell ids, no `parameters` cell."""
    notebook = nbformat.read(source, as_version=nbformat.NO_CONVERT)
    if (notebook.nbformat, notebook.nbformat_minor) < (4, 5):
        return [f"{source.name}: format {notebook.nbformat}.{notebook.nbformat_minor} has no cell ids; save it as 4.5"]
    found = []
    if any(cell.get("outputs") or cell.get("execution_count") for cell in notebook.cells):
        remedy = f"jupyter nbconvert --clear-output --inplace {source.name}"
        found.append(f"{source.name}: has outputs; clear them: {remedy}")
    tagged = [cell.source for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    if len(tagged) != 1 or any(line not in tagged[0] for line in PARAMETERS):
        found.append(f"{source.name}: needs one cell tagged 'parameters' that says: {'; '.join(PARAMETERS)}")
    return found


@contextmanager
def isolated() -> Iterator[str]:
    """While this lasts, Jupyter and kernels know this Python environment alone, and nothing of the user's own set-up.

    Yields a folder for what they write. Figures are drawn inline, to the same bytes.
    """
    import matplotlib

    with tempfile.TemporaryDirectory() as scratch:
        before = os.environ.copy()
        os.environ.pop("PYTHONSTARTUP", None)  # which IPython runs in kernels, too
        os.environ.update(
            dict.fromkeys(("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"), scratch),
            JUPYTER_PATH=f"{sys.prefix}/share/jupyter",
            JUPYTER_PLATFORM_DIRS="1",
            MATPLOTLIBRC=f"{matplotlib.get_data_path()}/matplotlibrc",
            MPLBACKEND="module://matplotlib_inline.backend_inline",
            PYDEVD_DISABLE_FILE_VALIDATION="1",
            **REPRODUCIBLE,
        )
        try:
            yield scratch
        finally:
            os.environ.clear()
            os.environ.update(before)
