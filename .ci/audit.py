"""The rebuild of a hostile reader: two clean clones of what is committed, each under conditions of its own and without
network, build everything anew and repeat a sample of every study. What differs is named, with its cause.

    python .ci/audit.py [--full] [--seed N] [--runs N]     in the clone that is audited, by the Python of its .venv
"""

import argparse
import hashlib
import json
import os
import platform
import re
import secrets
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatch
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, NamedTuple

from inside import DIFFERS, NEAR, SAME, UNCHECKED, Row, cpu, worst


class Clone(NamedTuple):
    """A clone, and the conditions under which all commands run in it."""

    folder: Path
    variables: dict[str, str]
    umask: int
    before: list[str]  # what takes network and rights from a command, or gives it another date
    make: list[str]


BUILT = {
    "verdicts": ("data/findings.json", "judged anew"),
    "list of studies": ("data/STUDIES.md", "written anew"),
    "figures": ("figures/*.p[dn][fg]", "drawn anew"),
    "film": ("figures/film.gif", "filmed anew"),
    "notebooks": ("notebooks/executed/*.ipynb", "executed anew"),
    "demonstration": ("notebooks/executed/demo.html", "written anew"),
    "report": ("paper/report.pdf", "typeset anew"),
    "lectures": ("paper/lectures/*.pdf", "typeset anew"),
}
"""What is committed and built, by a pattern of its paths, and how. It is removed first, so that nothing just stays."""

ALSO_BUILT = (".build/site/**/*", ".build/lab/*.zip", ".build/summary", "paper/numbers.tex")
WRITABLE = ("data", "data/headline", "figures", "notebooks/executed", "paper", "paper/lectures")
"""Folders in which things are built. The others are read-only, and so is every file."""


# --- What is compared -------------------------------------------------------------------------------------------------


def git(folder: Path, *arguments: str) -> str:
    return subprocess.run(["git", "-C", folder, *arguments], stdout=subprocess.PIPE, check=True).stdout.decode()


def committed(folder: Path) -> dict[str, str]:
    """The hash of each committed file, as git has it, by its path."""
    entries = (entry.partition("\t") for entry in git(folder, "ls-tree", "-rz", "HEAD").split("\0") if entry)
    return {path: about.split()[2] for about, _, path in entries}


def content_hash(path: Path) -> str:
    """The hash that git gives to a file of this content; "" where there is none."""
    if not path.is_file():
        return ""
    content = os.fsencode(path.readlink()) if path.is_symlink() else path.read_bytes()
    return hashlib.sha1(b"blob %d\0%b" % (len(content), content)).hexdigest()


def differing(folder: Path) -> list[str]:
    """Files of a clone that are not, to the byte, what is committed; that are missing; or that nobody committed."""
    changed = [path for path, known in committed(folder).items() if content_hash(folder / path) != known]
    return sorted(changed + git(folder, "ls-files", "-z", "--others", "--exclude-standard").split("\0")[:-1])


def other_packages(lock: str, installed: Mapping[str, str]) -> list[str]:
    """Where what is installed, versions by name, is not what a lock file says for this Python: a text each."""
    from packaging.markers import Marker
    from packaging.utils import canonicalize_name

    have = {canonicalize_name(name): version for name, version in installed.items()}
    pins = re.findall(r"^([\w.-]+)==([^ ;\\\n]+)(?: *; *([^\\\n]+))?", lock, re.M)
    here = {canonicalize_name(name): pin for name, pin, where in pins if not where or Marker(where.strip()).evaluate()}
    return [f"{name} {have.get(name, 'missing')} for {pin}" for name, pin in here.items() if have.get(name) != pin]


# --- The clones -------------------------------------------------------------------------------------------------------

ALONE = ["unshare", "--user", "--map-user=65534", "--map-group=65534", "--net", "--"]
LATE = ["faketime", "-f", "+500d"]


def works(*command: str) -> bool:
    return bool(shutil.which(command[0])) and not subprocess.run(command, capture_output=True, check=False).returncode


def clones(place: Path) -> list[Clone]:
    """Two clones to be, whose conditions have nothing in common; without network and rights where that can be."""
    alone = next((how for how in (ALONE, ["unshare", "--net", "--"]) if works(*how, "true")), [])
    late = LATE if works(*LATE, "true") else []
    spoken = [name for name in subprocess.getoutput("locale -a").split() if re.match("tr|de|fr|pt|ja", name)]
    rest = {"PATH": os.environ["PATH"], "SOURCE_DATE_EPOCH": "86400", "PYTHONHASHSEED": "random"}
    one = {"LC_ALL": (*spoken, "C.UTF-8")[0], "TZ": "<+1245>-12:45", "HOME": str(place / "barred" / "home")}
    two = {"LC_ALL": "C", "TZ": "NST3:30NDT", "HOME": str(place / "home")}
    for variables, threads in ((one, "7"), (two, "2")):
        variables |= rest | dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), threads)
    second = place / "die zweite, größere"
    return [Clone(place / "one", one, 0o077, alone, ["make"]), Clone(second, two, 0o002, alone + late, ["make", "-j1"])]


def set_up(clone: Clone, built: Iterable[str]) -> None:
    """Clone what is committed, without what is built, read-only. Packages are those of this Python's environment."""
    git(Path(), "clone", "-q", str(Path.cwd()), str(clone.folder))
    files, environment = committed(clone.folder), clone.folder / ".venv"
    for path in (path for path in files if any(fnmatch(path, pattern) for pattern in built)):
        (clone.folder / path).unlink()
        if path.endswith(".md"):  # by which the library knows that it stands in a clone
            (clone.folder / path).touch()
    subprocess.run([base_python(), "-m", "venv", "--without-pip", environment], check=True)
    (packages,) = environment.glob("lib/python3.*/site-packages")
    shared = Path(sys.prefix, packages.relative_to(environment))
    # Nothing in the shared folder that leads to another library, as homing_lib.pth does, is read from there.
    paths = [os.path.relpath(folder, packages) for folder in (clone.folder, shared)]
    (packages / "clone.pth").write_text("\n".join(paths))
    (environment / "share").symlink_to(Path(sys.prefix, "share"))
    about = f"{sys.version_info.major}.{sys.version_info.minor} {clone.folder.resolve()}\n"
    (environment / ".ready").write_bytes(os.fsencode(about))  # or make would install packages
    (clone.folder / ".build").mkdir()
    folders = {folder for path in files for folder in Path(path).parents if folder.as_posix() not in WRITABLE}
    for there in (clone.folder / path for path in (*files, *folders)):
        if there.exists():
            there.chmod(there.stat().st_mode & 0o555)


def base_python() -> str:
    """The Python that this environment was made with."""
    return str(sys._base_executable)  # type: ignore[attr-defined]


def start(clone: Clone, *command: str, changed: Mapping[str, str] | None = None, **streams: Any) -> Any:
    """Run a command in a clone, under its conditions."""
    how = {"cwd": clone.folder, "env": clone.variables | (changed or {}), "umask": clone.umask, "check": False}
    return subprocess.run([*clone.before, *command], stdin=subprocess.DEVNULL, **how, **streams)


def build(clone: Clone, targets: Sequence[str], force: bool) -> Row:
    """Build everything in a clone. force: compute all runs first, from scratch."""
    make = [*clone.make, f"PYTHON={base_python()}"]
    steps = [[".venv/bin/python", "-m", "homing_lib", "film", "--out", "figures/film.gif"]]
    steps += [[*make, "data", "FORCE=1"]] * force
    steps += [[*make, *targets[:-1]], [*make, targets[-1]]]  # the lab packs the list of studies, once that is written
    log = Path(f"{clone.folder}.log")
    with log.open("wb") as lines:
        failed = any(start(clone, *step, stdout=lines, stderr=lines).returncode for step in steps)
    last = [line for line in log.read_text(errors="replace").splitlines() if re.match("homing: |make: ", line)][-1:]
    why = "".join(last) or f"see {log}"
    return Row(
        f"build in {clone.folder.name!r}", f"make {' '.join(targets)}", *((DIFFERS, why) if failed else ("done",))
    )


def ask(clone: Clone, what: str, *numbers: int, **changed: str) -> list[Row]:
    """What a clone answers."""
    command = (".venv/bin/python", ".ci/inside.py", what, *map(str, numbers))
    done = start(clone, *command, changed=changed, stdout=subprocess.PIPE)
    if done.returncode:
        return [Row(what, "", DIFFERS, "it could not be answered: see above")]
    return [Row(*row) for row in json.loads(done.stdout.splitlines()[-1])]


# --- What is found ----------------------------------------------------------------------------------------------------


def together(thing: str, how: str, rows: Sequence[Row]) -> Row:
    """Several rows in one: the worst of them."""
    exact = sum(row.found == SAME for row in rows)
    those = [f"{row.thing} ({row.why})" for row in rows if row.found in (UNCHECKED, DIFFERS)]
    return Row(thing, f"{how}; {exact} of {len(rows)} to the bit", worst(row.found for row in rows), ", ".join(those))


def files_compared(folders: Sequence[Path], kinds: Mapping[str, tuple[str, str]], cause: str) -> list[Row]:
    """The rows of all files of the clones, by their kinds; then of those that are built and not committed."""
    rows, changed = [], {path for folder in folders for path in differing(folder)}
    left = {*committed(folders[0]), *changed}
    for thing, (pattern, how) in kinds.items():
        group = {path for path in left if fnmatch(path, pattern)}
        left -= group
        wrong = sorted(group & changed)
        rows.append(Row(thing, f"{how}: {len(group)} files, to the byte", DIFFERS if wrong else SAME))
        for path in wrong:
            alike = len({content_hash(folder / path) for folder in folders}) == 1
            why = (cause or since(folders[0], path)) if alike else "conditions: it differs from clone to clone"
            rows.append(Row(path, "", DIFFERS, why))
    every = {path.relative_to(folder) for folder in folders for kind in ALSO_BUILT for path in folder.glob(kind)}
    other = [str(path) for path in sorted(every) if len({content_hash(folder / path) for folder in folders}) > 1]
    found = DIFFERS if other else SAME
    how = f"those of one clone beside the other's: {len(every)} files"
    return [*rows, Row("site, lab, numbers", how, found, ", ".join(other))]


def rendered(stored: Path, anew: Path) -> Row:
    """The row of the atlases that a clone has rendered, beside those of the same name that were there."""
    both = [path for path in anew.glob("*.npz") if (stored / path.name).exists()]
    other = [path.name for path in both if content_hash(path) != content_hash(stored / path.name)]
    return Row("atlases", f"{len(both)} rendered anew", DIFFERS if other else SAME, ", ".join(other))


def since(folder: Path, path: str) -> str:
    """What has changed since a file was committed, of what it may be made from."""
    if not (commit := git(folder, "log", "-1", "--format=%h", "--", path).strip()):
        return "it is built, and nobody committed it"
    made_from = ("homing_lib", "data", "notebooks/*.ipynb", "notebooks/demo", "paper/*.tex")
    changed = git(folder, "diff", "--name-only", commit, "HEAD", "--", *made_from).split()
    if not changed:
        return f"the file itself: what it is made from is as it was when it was committed ({commit})"
    return f"source: since it was committed ({commit}) {len(changed)} files have changed, such as {changed[0]}"


def other_processor() -> dict[str, str]:
    """Variables that make another processor of this one, for linear algebra, exponentials and compiled code."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    wide = " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))
    kernel = "Nehalem" if platform.machine() == "x86_64" else "ARMV8"
    return {"OPENBLAS_CORETYPE": kernel, "NPY_DISABLE_CPU_FEATURES": wide, "NUMBA_CPU_NAME": "generic"}


# --- All of it --------------------------------------------------------------------------------------------------------


def audit(full: bool, seed: int, count: int) -> list[Row]:
    """All rows of the table. count: of each study; without any, all is built and nothing computed again."""
    place = Path(".build", "audit").absolute()
    for folder, _, _ in os.walk(place):  # of an earlier audit, read-only
        Path(folder).chmod(0o700)
    shutil.rmtree(place, ignore_errors=True)
    (place / "home").mkdir(parents=True)
    (place / "barred").mkdir(0o500)  # no home can be made in it
    latex = works("latexmk", "--version") and works("kpsewhich", "lmodern.sty", "beamer.cls")
    with_latex, without = ("all", "lectures", "site", "lab"), ("notebooks", "demo", ".build/summary", "lab")
    built = {thing: how for thing, how in BUILT.items() if latex or thing not in ("report", "lectures")}
    installed = {one.name: one.version for one in distributions()}
    other = other_packages(Path("environment.lock").read_text(), installed)
    how = f"{len(installed)} versions beside environment.lock"
    rows = [Row("packages", how, DIFFERS if other else SAME, ", ".join(other))]
    rows += [Row(thing, "LaTeX is missing", UNCHECKED) for thing in BUILT if thing not in built]

    say("two clones")
    both = first, second = clones(place)
    if LATE[0] not in second.before:
        rows.append(Row("another date", "time zones differ, and SOURCE_DATE_EPOCH", UNCHECKED, "faketime is missing"))
    for clone in both:
        set_up(clone, [pattern for pattern, _ in built.values()])
        rows += ask(clone, "facts")
        print("  ".join(rows[-1][:2]), flush=True)
    stored, atlases = Path(".build", "atlas"), first.folder / ".build" / "atlas"
    shutil.copytree(stored, atlases) if stored.is_dir() and not full else atlases.mkdir()
    (second.folder / ".build" / "atlas").symlink_to(atlases)

    say("everything is built in both, side by side; what is said of it stands in .build/audit/*.log")
    with ThreadPoolExecutor(2) as pool:
        rows += pool.map(build, both, [with_latex if latex else without] * 2, [full, False])
    rows += ask(first, "prose")
    rows += [rendered(stored, atlases)] * full
    again = []
    if count:
        say(f"a sample of every study is computed again, drawn with seed {seed}")
        again += ask(first, "runs", seed, count)
        say("the same without the engine, in Python")
        (place / "without").mkdir()
        (place / "without" / "numba.py").write_text("raise ImportError('left out by the audit')\n")
        python = ask(second, "runs", seed, 4 if full else 1, PYTHONPATH=str(place / "without"))
        say("the same on another processor")
        processor = other_processor()
        slow = ", ".join(f"{name}={value}" for name, value in processor.items())
        again.append(together("runs without the engine", "in Python", python))
        again.append(together("runs, another processor", slow, ask(second, "runs", seed, 1, **processor)))
        again.append(together("words, another processor", slow, ask(second, "verdicts", **processor)))
    for path in () if full else atlases.glob("*.npz"):
        if not (stored / path.name).exists():  # rendered by the way, which took a minute
            stored.mkdir(exist_ok=True)
            shutil.copy(path, stored)
    near = any(row.found == NEAR for row in again if row.thing.startswith("study "))
    cause = f"packages: {', '.join(other)}" if other else f"processor: {cpu()}" if near else ""
    tables = "computed anew" if full else "as their manifests say"
    kinds = {**built, "tables and runs": ("data/*", tables), "all other files": ("*", "left as they were")}
    return [*rows, *files_compared([clone.folder for clone in both], kinds, cause), *again]


def say(what: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {what}", flush=True)


def main() -> int:
    """Print the table and a line to quote; returns the exit code."""
    parser = argparse.ArgumentParser(description="The rebuild of a hostile reader.")
    parser.add_argument("--full", action="store_true", help="compute all runs from scratch, and render all atlases")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**9), help="draws the sample")
    parser.add_argument("--runs", type=int, default=3, help="of each study; 0: only build")
    asked = parser.parse_args()
    began = time.monotonic()
    if loose := differing(Path.cwd()):
        say(f"{len(loose)} files here are not as committed, and are not what is audited: {', '.join(loose[:5])}")
    rows = audit(asked.full, asked.seed, asked.runs)
    for row in rows:
        print(f"{row.thing:32} {row.how:60} {row.found}{': ' * bool(row.why)}{row.why}")
    named = {found: [row.thing for row in rows if row.found == found] for found in (SAME, NEAR, UNCHECKED, DIFFERS)}
    wrong, same = named[DIFFERS], len(named[SAME] + named[NEAR])
    told = f"{len(wrong)} things differ, {', '.join(wrong)}; " * bool(wrong) + f"{same} things are the same"
    told += f" ({len(named[NEAR])} of them within the tolerance)" * bool(named[NEAR])
    told += f"; not checked: {', '.join(named[UNCHECKED])}" * bool(named[UNCHECKED])
    commit, minutes = git(Path(), "rev-parse", "--short=12", "HEAD").strip(), (time.monotonic() - began) / 60
    system = f"{platform.system()} {platform.machine()}, {cpu()}, Python {platform.python_version()}"
    how = "all runs" if asked.full else f"runs drawn with seed {asked.seed}"
    print(f"Audit of {commit} on {time.strftime('%Y-%m-%d')} ({system}; {how}; {minutes:.0f} minutes): {told}.")
    return 1 if wrong else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (subprocess.CalledProcessError, OSError) as error:
        sys.exit(f"audit: {error}")
    except KeyboardInterrupt:
        print("audit: interrupted; `make audit` starts anew", file=sys.stderr)
        sys.exit(130)
