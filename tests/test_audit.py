"""The audit passes what is as it was committed, and fails for one byte of a figure, table or run, a pin, a package."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from homing_lib import parallel
from homing_lib.publish import prose
from homing_lib.settings import Settings
from homing_lib.storage import ROOT
from homing_lib.study import measures, runs, studies, sweep
from homing_lib.study.runs import Study

pytestmark = pytest.mark.skipif(os.name == "nt" or not shutil.which("git"), reason="of clones, by git, on POSIX")

sys.path.insert(0, str(ROOT / ".ci"))
import audit
import inside


def flip(path: Path, at: int = -1) -> None:
    """One bit of a file."""
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


# --- A toy clone, audited from first to last -------------------------------------------------------------------------

FILES = {
    ".gitignore": ".venv\n.build\n",
    **{f".ci/{name}": (ROOT / ".ci" / name).read_text(encoding="utf-8") for name in ("audit.py", "inside.py")},
    "Makefile": "all lectures site lab notebooks demo .build/summary:\n\t@.venv/bin/python -m homing_lib $@\n",
    "README.md": "It learns. <!-- pin: learns=yes -->\n",
    "environment.lock": f"numpy=={version('numpy')} \\\n    --hash=sha256:0\nnone==1 ; python_version < '3'\n",
    "data/STUDIES.md": "studies",
    "data/table.parquet": "numbers",
    "figures/a.pdf": "a figure",
    "figures/film.gif": "a film",
    "homing_lib/__init__.py": "",
    "homing_lib/errors.py": "class UserError(Exception):\n    pass\n",
    "homing_lib/storage.py": "from pathlib import Path\nROOT = Path(__file__).parent.parent\n",
    "homing_lib/publish/prose.py": """
from homing_lib.storage import ROOT
MARKDOWN, NOTEBOOKS, refreshed = [], [], str
def broken():
    return [] if "learns=yes" in (ROOT / "README.md").read_text() else ["README.md: learns"]
""",
    "homing_lib/__main__.py": """
import os, sys
from pathlib import Path
Path("figures").mkdir(exist_ok=True)
for path, text in {"data/STUDIES.md": "studies", "figures/a.pdf": "a figure", "figures/film.gif": "a film"}.items():
    Path(path).unlink(missing_ok=True)
    Path(path).write_text(text)
print("writable" if os.access("homing_lib", os.W_OK) else "read-only")
""",
}


def commit(folder: Path) -> None:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.example")
    for arguments in (("init", "-q"), ("add", "-A"), (*who, "commit", "-q", "--allow-empty", "-m", "all")):
        subprocess.run(["git", "-C", folder, *arguments], check=True, capture_output=True)


@pytest.fixture
def toy(tmp_path):
    """A repository of a few files, all of which is built by a program of ten lines."""
    for name, text in FILES.items():
        path = tmp_path / "toy" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    commit(tmp_path / "toy")
    return tmp_path / "toy"


def audited(folder: Path) -> tuple[int, str]:
    command = [sys.executable, ".ci/audit.py", "--runs", "0"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, encoding="utf-8")
    assert done.stderr == ""
    return done.returncode, done.stdout


def test_what_is_rebuilt_as_it_was_committed_passes_in_clones_that_cannot_change_the_source(toy):
    code, told = audited(toy)
    assert code == 0
    assert re.search(r": \d+ things are the same(; not checked: .*)?\.$", told.strip())
    if os.getuid() or "user 65534" in told:
        assert (toy / ".build" / "audit" / "one.log").read_text().count("read-only") >= 2


def test_one_byte_of_a_figure_a_turned_pin_or_another_package_makes_it_fail_and_is_named(toy):
    (toy / "figures" / "a.pdf").write_text("a figurE")
    (toy / "README.md").write_text("It learns. <!-- pin: learns=no -->\n")
    (toy / "environment.lock").write_text("numpy==0.1\n")
    commit(toy)
    code, told = audited(toy)
    assert code == 1
    for thing, why in {
        "packages": f"numpy {version('numpy')} for 0.1",
        "sentences": "README.md: learns",
        "figures/a.pdf": f"packages: numpy {version('numpy')} for 0.1",
    }.items():
        assert re.search(rf"^{thing} .*DIFFERS: {re.escape(why)}$", told, re.M)
    assert "4 things differ, packages, sentences, figures, figures/a.pdf;" in told.splitlines()[-1]


def test_any_committed_file_that_is_changed_removed_or_added_is_named(toy):
    assert audit.differing(toy) == []
    flip(toy / "data" / "table.parquet")
    (toy / "figures" / "a.pdf").unlink()
    (toy / "figures" / "b.pdf").touch()
    assert audit.differing(toy) == ["data/table.parquet", "figures/a.pdf", "figures/b.pdf"]


def test_of_a_file_that_differs_it_is_said_whether_its_source_has_changed_since(toy):
    assert audit.since(toy, "figures/a.pdf").startswith("the file itself")
    assert "nobody committed" in audit.since(toy, "figures/b.pdf")
    (toy / "homing_lib" / "__init__.py").write_text("changed = True")
    commit(toy)
    assert audit.since(toy, "figures/a.pdf").endswith("1 files have changed, such as homing_lib/__init__.py")


# --- Runs, tables, prose and packages --------------------------------------------------------------------------------

QUICK = Settings(images="compact", episodes=1, survey_steps=20, max_steps=5)
TABLE = Study("table", "To be repeated.", {"sarsa": QUICK}, range(2), measures.totals)
WHOLE = Study("whole", "To be repeated.", {"sarsa": QUICK}, range(1))


@pytest.fixture
def data(tmp_path, monkeypatch):
    """The folder of the data of two small studies, stored, which are all that there are."""
    monkeypatch.setattr(runs, "DATA", tmp_path / "data")
    monkeypatch.setattr(runs, "SCRATCH", tmp_path / "scratch")
    for study in (TABLE, WHOLE):
        sweep.sweep(study, workers=1)
    monkeypatch.setattr(studies, "in_order", lambda: iter([TABLE, WHOLE]))
    monkeypatch.setattr(parallel, "results", lambda function, jobs: [function(*job) for job in jobs])
    monkeypatch.chdir(ROOT)
    return tmp_path / "data"


def found() -> list[tuple[str, str]]:
    return [(row.thing, row.found) for row in inside.answer("runs", 0, 8)]


def vouch(path: Path, manifest: Path) -> None:
    """Let the manifest have the checksum of what the file holds now, as a forger would."""
    told = json.loads(manifest.read_bytes())
    told["sha256"][path.name] = runs.sha256(path)
    manifest.write_text(json.dumps(told))


def test_runs_computed_again_are_those_stored_to_the_bit(data):
    assert found() == [("study table", inside.SAME), ("study whole", inside.SAME)]


@pytest.mark.parametrize("file", ["table.parquet", "whole/*.npz"])
def test_one_byte_of_a_table_or_run_is_a_difference_by_its_checksum(data, file):
    (path,) = data.glob(file)
    flip(path, len(path.read_bytes()) // 2)
    (row,) = inside.answer("runs", 0, 8)
    assert row.found == inside.DIFFERS
    assert str(path) in row.why


def test_a_number_of_a_table_forged_with_its_checksum_is_found_by_computing_it_again(data):
    path = data / "table.parquet"
    table = pd.read_parquet(path)
    table["total"] += 1
    table.to_parquet(path, index=False)
    vouch(path, TABLE.manifest)
    assert found() == [("study table", inside.DIFFERS), ("study whole", inside.SAME)]


def test_a_step_of_a_run_forged_with_its_checksum_is_found_by_driving_it_again(data):
    (job,) = WHOLE.jobs()
    run = runs.load(job.path)
    run.steps[-1, 0] += 1
    job.path.write_bytes(runs.content_of(run))
    vouch(job.path, WHOLE.manifest)
    assert found() == [("study table", inside.SAME), ("study whole", inside.DIFFERS)]


@pytest.mark.parametrize(
    ("other", "word"), [(1.0, "to the bit"), (1 + 2e-7, "within tolerance"), (1.001, "not"), (np.nan, "not")]
)
def test_rows_are_compared_as_32_bit_numbers_and_last_bits_fall_within_the_tolerance(other, word):
    live = np.rec.fromarrays([np.array([10.0, np.nan])], dtype=[("steps", float)])
    stored = pd.DataFrame({"steps": np.array([10.0 * other, np.nan], np.float32)})
    assert inside.compare_rows(stored, live) == word
    assert inside.compare_rows(stored[:1], live) == "not"


def test_prose_whose_pin_is_turned_round_or_whose_number_was_typed_is_a_difference(tmp_path, monkeypatch):
    page = tmp_path / "README.md"
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "MARKDOWN", (page,))
    monkeypatch.setattr(prose, "LATEX", ())
    monkeypatch.setattr(prose, "NOTEBOOKS", ())
    number = prose.number("learns.random|v0")
    text = f"<!-- pin: learns=yes -->\n**It does**, in <!--n learns.random|v0-->{number}<!--/n-->."
    page.write_text(text)
    assert [row.found for row in inside.prose()] == [inside.SAME, inside.SAME]
    page.write_text(text.replace("=yes", "=no"))
    assert [row.found for row in inside.prose()] == [inside.DIFFERS, inside.SAME]
    page.write_text(text.replace("<!--/n-->", "1<!--/n-->"))
    assert [row.found for row in inside.prose()] == [inside.SAME, inside.DIFFERS]


def test_a_package_of_another_version_or_missing_is_named_unless_its_marker_excludes_this_python():
    lock = "A_b==1.0 \\\n    --hash=sha256:0\nc==2 ; python_version >= '3'\nd==3 ; python_version < '3' \\\n    --hash"
    assert audit.other_packages(lock, {"a-B": "1.0", "C": "2", "e": "5"}) == []
    assert audit.other_packages(lock, {"a-b": "1.1"}) == ["a-b 1.1 for 1.0", "c missing for 2"]


def test_of_several_rows_the_worst_counts():
    rows = [
        inside.Row("one", "", inside.SAME),
        inside.Row("two", "", inside.NEAR),
        inside.Row("three", "", inside.DIFFERS, "why"),
    ]
    assert audit.together("all", "how", rows[:2]) == ("all", "how; 1 of 2 to the bit", inside.NEAR, "")
    assert audit.together("all", "how", rows)[2:] == (inside.DIFFERS, "three (why)")
