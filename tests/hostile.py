"""Abuse the project by chance; nothing is lost, no one misled: `python -m tests.hostile [CASES] [--seed N]`.

Cases are drawn, with a seed, from the settings' own schema, the command line, the stored files and how they may be
harmed, and what environment and learners take. Each must be accepted with sound numbers, refused in one line, or
repaired to the bytes that stood before. Everything happens in a temporary folder. The exit code is zero only if there
are no tracebacks, no hangs, and nothing was lost: no sound file harmed, nothing altered taken for sound.
"""

import argparse
import contextlib
import copy
import io
import json
import math
import os
import pickle
import random
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np
import pandas as pd

from homing_lib import agent, atlas, lambdas, sarsa, td
from homing_lib.environment import HomingEnv
from homing_lib.errors import UserError
from homing_lib.publish import cli
from homing_lib.rooms import PAPER
from homing_lib.settings import Settings
from homing_lib.storage import npz_bytes, read_arrays
from homing_lib.study import findings, measures, runs, studies, sweep, theorem
from homing_lib.study.questions import learns
from homing_lib.study.runs import Study

ROOT = Path(__file__).parent.parent
LIMIT_S = 60  # of one case; a hang beyond
LONGEST_LINE = 1000

QUICK = dict(episodes=1, survey_steps=20, max_steps=5)
COMPACT = Settings(images="compact", **QUICK)
TABLE = Study(
    "table",
    "To be harmed.",
    {"form 2": COMPACT, "random": COMPACT.with_changes(controller="random")},
    range(2),
    measures.curve,
)
WHOLE = replace(TABLE, name="whole", measure=None)
EARLIER = dict.fromkeys(runs.MADE_BY, "earlier")
"""What made the stored files: something that is not this version."""

Outcome = str  # "accepted", "refused in one line", "repaired"


class Lost(Exception):
    """A sound file is no more, or something altered was taken for sound."""


class Misled(Exception):
    """A refusal that is no one line, or says nothing."""


class Hang(BaseException):
    """It goes on for too long."""


def refusal(text: str) -> Outcome:
    """The outcome, if the text is one line that a user can read."""
    if not text.strip() or len(text.strip().splitlines()) != 1 or len(text) > LONGEST_LINE or "Traceback" in text:
        raise Misled(f"no refusal in one line: {text[:300]!r}")
    return "refused in one line"


# --- Values -------------------------------------------------------------------------------------------------------

NUMBERS = (
    *(0, 1, -1, 2, 0.5, 1e-3, 5e-324, 1e-160, 1e158, 1e307, -1e307, math.inf, -math.inf, math.nan, 10**9, 10**400),
    *("0", "-1", "1e999", "nan", "inf", "0x10", "1_0", "9" * 400, "9" * 5000, "٣", " 1 ", "1,5", ""),
)
OTHERS = (
    *(None, True, False, [], {}, (), b"\xff", "\x00", "a\nb", "\x1b[31m", "\ud800", "x" * 10_000, object(), 1j, len),
    *(np.int64(3), np.float64(0.5), np.bool_(True), np.arange(3), np.array([1]), np.array(1), np.ones(300), range(3)),
)


def value_for(rng: random.Random, name: str) -> Any:
    """A value for a setting: at or beyond its bounds, one of its choices, or anything."""
    field = Settings.model_fields[name]
    bounds = [getattr(one, kind) for one in field.metadata for kind in ("gt", "ge", "lt", "le") if hasattr(one, kind)]
    near = [bound * factor + offset for bound in bounds for factor in (1, 1.001, 0.999, -1) for offset in (0, 1, -1)]
    choices = [*get_args(field.annotation), field.default, f"{field.default}"]
    return rng.choice(rng.choice([near or choices, choices, NUMBERS, OTHERS]))


def finite(run: agent.Run) -> None:
    """That a run which was accepted has numbers, unless it says that it diverged."""
    if not np.isfinite(run.steps).all() and not run.diverged:
        raise Misled("accepted, and its numbers are not finite")


# --- Cases --------------------------------------------------------------------------------------------------------


class Campaign:
    """A temporary folder with sound stored files, and the cases that can befall them."""

    def __init__(self, folder: Path, rng: random.Random) -> None:
        self.folder, self.rng = folder, rng
        self.sound, self.here = folder / "sound", folder / "here"
        with self.stored_in(self.sound):
            before, runs.MADE_BY = runs.MADE_BY, EARLIER
            try:
                for study in (TABLE, WHOLE):
                    sweep.sweep(study, workers=1)
            finally:
                runs.MADE_BY = before
            (self.sound / "data" / "STUDIES.md").write_text(studies.page(), encoding="utf-8")
            self.results = {study.name: self._loaded(study) for study in (TABLE, WHOLE)}
        self.model = HomingEnv(COMPACT, observation="features")
        self.model.reset(seed=0)
        self.atlas: Path | None = None
        if atlas.camera_available():
            coarse = dict(images="atlas", image_size=16, atlas_spacing_m=0.1, atlas_heading_deg=120)
            atlas.open_atlas(PAPER, Settings(**coarse), folder / "atlas", workers=1)
            (self.atlas,) = (folder / "atlas").glob("*.npz")

    @contextlib.contextmanager
    def stored_in(self, folder: Path) -> Iterator[None]:
        """The project's data are here, and its studies are the two small ones."""
        names = [(runs, "DATA"), (runs, "SCRATCH"), (studies, "PAGE"), (studies, "in_order"), (studies, "HEADLINE")]
        names += [(findings, "FILE"), (findings, "questions")]
        before = [getattr(module, name) for module, name in names]
        runs.DATA, runs.SCRATCH = folder / "data", folder / "scratch"
        studies.PAGE, studies.in_order = folder / "data" / "STUDIES.md", lambda: iter([TABLE, WHOLE])
        studies.HEADLINE = WHOLE
        findings.FILE, findings.questions = folder / "data" / "findings.json", dict
        try:
            yield
        finally:
            for (module, name), value in zip(names, before, strict=True):
                setattr(module, name, value)

    def fresh(self) -> Path:
        """A copy of the sound files, to be harmed."""
        shutil.rmtree(self.here, ignore_errors=True)
        shutil.copytree(self.sound, self.here)
        return self.here

    def _loaded(self, study: Study) -> Any:
        return runs.load_table(study) if study.measure else runs.load_study(study)

    def _is_sound(self, study: Study, loaded: Any) -> bool:
        if study.measure:
            return bool(loaded.equals(self.results[study.name]))
        pairs = [
            (a, b) for label in loaded for a, b in zip(loaded[label], self.results[study.name][label], strict=True)
        ]
        return all(runs.compare(a, b) == "to the bit" and a.settings == b.settings for a, b in pairs)

    # Settings

    def settings(self) -> Outcome:
        """Some settings at once; what is accepted runs, and has numbers."""
        rng = self.rng
        changes = {rng.choice(list(Settings.model_fields)): 0 for _ in range(rng.choice([1, 1, 2, 3]))}
        changes = {name: value_for(rng, name) for name in changes}
        if rng.random() < 0.05:
            changes[rng.choice(["", "colour", "alpha", "a\nb", "x" * 5000, "\x1b"])] = 1
        images = rng.choice(["compact", "camera"]) if atlas.camera_available() else "compact"
        base: dict[str, Any] = {"images": images, "image_size": 16 if images == "camera" else 64}
        try:
            asked = Settings(**base | changes)
            if asked.images == "atlas":
                return "accepted"  # what it takes to build one is tested elsewhere
            few = {name: min(getattr(asked, name), most) for name, most in QUICK.items()}
            finite(agent.run(asked.with_changes(**few), rng.choice([0, 1, np.int64(3)])))
        except UserError as error:
            return refusal(str(error))
        return "accepted"

    # The command line

    def places(self) -> list[str]:
        """Where one might ask for a file to be stored. Never a device: as root, one could be lost."""
        odd = self.here / "odd"
        odd.mkdir()
        os.mkfifo(odd / "pipe.npz")
        (odd / "folder.npz").mkdir()
        (odd / "file").write_text("sound", encoding="utf-8")
        (odd / "link.npz").symlink_to(odd / "file")
        (odd / "dangling.npz").symlink_to(odd / "new.npz")
        (odd / "loop.npz").symlink_to(odd / "loop.npz")
        (odd / "to-folder.npz").symlink_to(odd)
        (odd / "to-pipe.npz").symlink_to(odd / "pipe.npz")
        names = ["pipe.npz", "folder.npz", "link.npz", "dangling.npz", "loop.npz", "to-folder.npz", "to-pipe.npz"]
        names += ["file/run.npz", "a b.npz", "ä.npz", "\udcff.npz", "x" * 300, "new/deep/run.npz", "a\nb.npz", "*.npz"]
        return ["", ".", "/", "..", "\0", str(odd), *(f"{odd}/{name}" for name in names)]

    def command_line(self) -> Outcome:
        """One command; its options are odd, its place is odd, or both."""
        rng, here = self.rng, self.fresh()
        places = self.places()
        kinds = {path: stat.S_IFMT(path.lstat().st_mode) for path in (here / "odd").iterdir()}
        quick = [f"--set={name}={value}" for name, value in ({"images": "compact"} | QUICK).items()]
        word = rng.choice(
            ["", "-", "--", "x", "headline", "tabel", "0", "\0", "a\nb", "\x1b[2J", "y" * 5000, "--help=1"]
        )
        number = rng.choice(["0", "-1", "1", "1.5", "1e3", "", "²", "٣", "9" * 30, "9" * 5000, "1000000", "nan", "\n"])
        setting = rng.choice(
            ["alpha0=1", "=1", "=", "alpha0", "alpha0==", "room=attik", "lambda_rule=0.5", "\0=1", word]
        )
        arguments = rng.choice(
            [
                lambda: ["run", *quick, "--out", rng.choice(places)],
                lambda: ["run", *quick, "--out", rng.choice(places), "--seed", rng.choice(["0", number])],
                lambda: ["run", *quick, "--set", setting],
                lambda: ["run", *quick, f"--seed={number}"],
                lambda: ["film", *quick, f"--episode={number}", f"--out={rng.choice(places)}"],
                lambda: ["film", "--set", setting, "--out", "x.txt"],
                lambda: ["sweep", rng.choice(["table", "whole", word]), f"--workers={rng.choice(['1', number])}"],
                lambda: ["sweep", rng.choice(["table", word]), "--cluster", ""],
                lambda: ["data", "--stamp", rng.choice(places)],
                lambda: ["notebook", rng.choice([word, *places])],
                lambda: [rng.choice(["settings", "studies"]), *([word] if rng.random() < 0.5 else [])],
                lambda: [word],
                lambda: [],
            ]
        )()
        code, errors = self.main(arguments)
        for path, kind in kinds.items():
            if stat.S_IFMT(path.lstat().st_mode) != kind:
                raise Lost(f"{path.name} was replaced by a file of another kind")
        for study in (TABLE, WHOLE):
            with self.stored_in(here):
                if not self._is_sound(study, self._loaded(study)):
                    raise Lost(f"the data, by {arguments}"[:300])
        return "accepted" if code == 0 else refusal(errors)

    def main(self, arguments: list[str]) -> tuple[int, str]:
        """A command in this process, in the temporary folder: its code, and its last line of errors."""
        out, errors = io.StringIO(), io.StringIO()
        work = self.here / "work"
        work.mkdir(exist_ok=True)
        quietly = contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors)
        with self.stored_in(self.here), quietly[0], quietly[1], contextlib.chdir(work):
            try:
                code = cli.main(arguments)
            except SystemExit as end:  # of --help
                code = int(end.code or 0)
        lines = [line for line in errors.getvalue().replace("\r", "\n").split("\n") if line and "it/s" not in line]
        said = [line for line in lines if not any(bar in line for bar in ("run/s", "s/run", "?run", "episode/s", "%|"))]
        return code, "\n".join(said)

    # Stored files

    def harm(self, path: Path) -> str:
        """Harm one file. Returns how."""
        rng, content = self.rng, path.read_bytes()
        others = [other for other in self.sound.rglob("*") if other.is_file()]

        def to(new: bytes) -> Callable[[], Any]:
            return lambda: path.write_bytes(new)

        def instead(make: Callable[[], Any]) -> Callable[[], Any]:
            return lambda: (path.unlink(), make())

        at = rng.randrange(len(content))
        cut = content[: rng.choice([0, 1, at, len(content) - 1])]
        flipped = bytes([*content[:at], content[at] ^ (1 << rng.randrange(8)), *content[at + 1 :]])
        ways: dict[str, Callable[[], Any]] = {
            "truncated": to(cut),
            "a bit flipped": to(flipped),
            "a block zeroed": to(content[:at] + bytes(min(64, len(content) - at)) + content[at + 64 :]),
            "longer": to(content + rng.choice([b"\0", b"\n", b"x" * 100, content])),
            "swapped": to(rng.choice(others).read_bytes()),
            "of another type": to(
                rng.choice([b"{}", b"[]", b"null", b"PK\x03\x04", b"PAR1", b"[" * 100_000, b'"' * 9])
            ),
            "not utf-8": to(b"\xff\xfe" + content),
            "a folder": instead(path.mkdir),
            "a pipe": instead(lambda: os.mkfifo(path)),
            "a dangling link": instead(lambda: path.symlink_to(path.parent / "nothing")),
            "a link to itself": instead(lambda: path.symlink_to(path)),
            "missing": path.unlink,
        }
        if path.suffix == ".npz" and "scratch" not in path.parts:  # of which nothing but a checksum is known
            ways["altered and whole"] = lambda: self._alter(path)
        if path.suffix == ".json":
            ways["altered JSON"] = lambda: self._alter_json(path)
        how = rng.choice(list(ways))
        ways[how]()
        return how

    def _alter(self, path: Path) -> None:
        """Another result under the same name, in a file that is whole."""
        about, arrays = read_arrays(path)
        name = self.rng.choice(list(arrays))
        array = arrays[name]
        doubled = np.concatenate([array, array]) if array.dtype.names else array * 2.0  # a table has named columns
        arrays[name] = self.rng.choice([array[::-1], array[:-1], np.zeros(3), doubled])
        path.write_bytes(npz_bytes(about, arrays))

    def _alter_json(self, path: Path) -> None:
        """Something else in the same place: a hash, the seeds, what made it, the conditions."""
        rng, manifest = self.rng, json.loads(path.read_bytes())
        key = rng.choice(["sha256", "seeds", "conditions", "made by", "measure"])
        if key == "sha256" and rng.random() < 0.7:
            name = rng.choice(list(manifest[key]))
            manifest[key][name] = rng.choice(["0" * 64, "", 5, None])
        elif rng.random() < 0.3:
            del manifest[key]
        else:
            manifest[key] = rng.choice([None, 0, [], {}, "x", [1], {"a": "b"}, {"a": 1}])
        path.write_text(json.dumps(manifest), encoding="utf-8")

    def stored_file(self) -> Outcome:
        """A stored file is harmed, or two: what is read is sound, or refused; a sweep, and the remedy, mend it."""
        here, rng = self.fresh(), self.rng
        study = rng.choice([TABLE, WHOLE])
        with self.stored_in(here):
            files = [study.manifest, *study.files]
            if study.measure and rng.random() < 0.5:
                files = [*files, *study.folder.glob("*.npz")]
                study.table.unlink()  # so that the single runs are asked for
            before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
            known = [path for path in files if path in before]
            harmed = {path: self.harm(path) for path in rng.sample(known, rng.choice([1, 1, 1, 2]))}
            told = ", ".join(f"{path.name} {how}" for path, how in harmed.items())
            outcome = self._read(study, told, "accepted")
            for _ in range(4):
                try:
                    sweep.sweep(study, workers=1)
                    break
                except UserError as error:
                    refusal(str(error))
                    outcome = "repaired"
                    named = [path for path in (*files, study.table) if str(error).startswith(f"{path}: ")]
                    if not named:
                        raise Lost(f"{told}: {error} names no stored file") from None
                    if named[0].is_dir() and not named[0].is_symlink():
                        named[0].rmdir()
                    else:
                        named[0].unlink(missing_ok=True)
            else:
                raise Lost(f"{told}: the remedy does not help")
            if self._read(study, told, "accepted") != "accepted":
                raise Lost(f"{told}: refused after the sweep that mended it")
            self._provenance(study, told, harmed)
            for path, content in before.items():
                if path not in harmed and path != study.manifest and path.read_bytes() != content:
                    raise Lost(f"{told}: {path.name} was sound, and is not the same")
        return outcome

    def _read(self, study: Study, told: str, so_far: Outcome) -> Outcome:
        try:
            loaded = self._loaded(study)
        except UserError as error:
            return refusal(str(error))
        if not self._is_sound(study, loaded):
            raise Lost(f"{told}: what was altered is taken for sound")
        return so_far

    def _provenance(self, study: Study, told: str, harmed: dict[Path, str]) -> None:
        """Who says that this version made what an earlier one did?"""
        manifest = study.manifest
        if manifest not in harmed:
            made_by = json.loads(manifest.read_bytes())["made by"]
            if made_by != EARLIER:
                raise Lost(f"{told}: false provenance {made_by}")

    def page_or_stamp(self) -> Outcome:
        """The page of studies or the stamp of the data is harmed, and `homing data` makes it anew."""
        here = self.fresh()
        page, stamp = here / "data" / "STUDIES.md", here / "stamp"
        self.main(["data", "--stamp", str(stamp)])
        before = {path: path.read_bytes() for path in (page, stamp)}
        path = self.rng.choice([page, stamp])
        how = self.harm(path)
        code, errors = self.main(["data", "--stamp", str(stamp)])
        if code:
            return refusal(errors)
        if any(path.read_bytes() != content for path, content in before.items()):
            raise Lost(f"{path.name} {how}: not made anew")
        return "repaired"

    def table_of_the_project(self) -> Outcome:
        """One of the committed tables, or its manifest, is harmed: it is refused, or read as it was."""
        study = self.rng.choice([studies.CALIBRATION, studies.LATTICE_RUNS, studies.UNLEARNT, learns.SHORTEST])
        folder = self.folder / "project"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        files = [study.table, study.table.with_suffix(".json")]
        before, runs.DATA = runs.DATA, folder
        try:
            for file in files:
                shutil.copy(file, folder)
            sound = pd.read_parquet(study.table)
            how = self.harm(self.rng.choice(list(folder.iterdir())))
            if not runs.load_table(study).equals(sound):
                raise Lost(f"{study.name}, {how}: taken for sound")
        except UserError as error:
            return refusal(str(error))
        finally:
            runs.DATA = before
        return "accepted"

    def atlas_file(self) -> Outcome:
        """A stored atlas or the one that comes along is harmed: it is refused, or read as it was."""
        mine = self.atlas if self.atlas and self.rng.random() < 0.6 else atlas.COMPACT
        path = self.folder / "harmed" / mine.name
        shutil.rmtree(path.parent, ignore_errors=True)
        path.parent.mkdir()
        shutil.copy(mine, path)
        how = self.harm(path)
        if mine == self.atlas:
            with contextlib.redirect_stderr(io.StringIO()) as errors:
                arrays = atlas._read(path)
            if arrays is None:
                return refusal(errors.getvalue() or "missing")
            _, sound = read_arrays(mine)
            same = all(np.array_equal(arrays[name], sound[name]) for name in sound)
        else:
            try:
                _, read = atlas.read_compact.__wrapped__(path)
            except UserError as error:
                return refusal(str(error))
            same = np.array_equal(read.counts, atlas.read_compact(mine)[1].counts)
        if not same:
            raise Lost(f"{mine.name}, {how}: taken for sound")
        return "accepted"

    # Interfaces

    def environment(self) -> Outcome:
        """What the environment is made with, and asked for, is odd or out of order."""
        rng = self.rng
        odd = rng.choice([*OTHERS, *NUMBERS])
        made: dict[str, Any] = {}
        if rng.random() < 0.7:
            options = ["start", "home", "model", "survey_seed", "settings", "observation", "render_mode"]
            made = {rng.choice(options): rng.choice([odd, [odd, 0.5, 0], "uniform"])}
        env: HomingEnv | None = None
        try:
            env = HomingEnv(**{"settings": COMPACT, "observation": "features"} | made)
            for _ in range(rng.randrange(1, 5)):
                odd = rng.choice([*OTHERS, *NUMBERS])
                act = rng.choice(
                    ["reset", "reset", "step", "step", "options", "place", "seed", "close", "copy", "pickle"]
                )
                self._act(env, act, odd)
        except (UserError, gymnasium.error.Error, gymnasium.error.ClosedEnvironmentError) as error:
            return refusal(str(error))
        finally:
            if env is not None:
                env.close()
        return "accepted"

    def _act(self, env: HomingEnv, act: str, odd: Any) -> None:
        match act:
            case "reset":
                env.reset(seed=self.rng.choice([None, 0, 3]))
            case "seed":
                env.reset(seed=odd)
            case "step":
                observation, reward, *_ = env.step(self.rng.choice([0, 1, 2, np.int64(1), odd]))
                if not (np.isfinite(observation).all() and math.isfinite(reward)):
                    raise Misled("a step that is no number")
            case "options":
                env.reset(options=self.rng.choice([odd, {"start": odd}, {"strat": 1}, {"start": (0.5, 0.5, 0)}]))
            case "place":
                env.place(self.rng.choice([odd, (0.5, odd, 0), (0.5, 0.5, 0)]))
            case "close":
                env.close()
            case "copy" | "pickle":
                other = copy.deepcopy(env) if act == "copy" else pickle.loads(pickle.dumps(env))
                other.close()

    def learner(self) -> Outcome:
        """What a learner is made with, or told, is odd; a refusal leaves its weights as they were."""
        rng, n = self.rng, 4
        odd = rng.choice([*OTHERS, *NUMBERS])
        kind = rng.choice([sarsa.LinearSarsa, sarsa.LinearQ, td.LinearTD, td.TrueOnlineTD, theorem.ConjugateTD])
        made: dict[str, Any] = {"step_size": 0.1, "discount": 0.9}
        if kind is not theorem.ConjugateTD:
            made["lambda_rule"] = rng.choice([lambdas.fletcher_reeves, lambdas.Fixed(0.5), lambda **_: odd])
        if rng.random() < 0.3:
            made[rng.choice(list(made))] = odd
        actions = () if issubclass(kind, td.LinearTD) else (2,)
        phi = np.array([rng.uniform(-1, 1) for _ in range(n)])
        arrays = [phi, phi[::-1], list(phi), phi[:3], phi[:, None], phi * math.nan, phi.astype(np.float32), odd]
        learner: Any = None
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            try:
                learner = kind(n, *actions, **made)
                for _ in range(3):
                    before = learner.weights.copy()
                    told, after, reward = rng.choice(arrays), rng.choice(arrays), rng.choice([0.5, -1, odd])
                    step = (told, reward, after) if not actions else (told, rng.choice([0, 1, odd]), reward, after, 0)
                    learner.update(*step, terminal=rng.random() < 0.2)
            except sarsa.Diverged:
                return "accepted"
            except (ValueError, TypeError, OverflowError) as error:
                if learner is not None and not np.array_equal(learner.weights, before, equal_nan=True):
                    raise Lost(f"{kind.__name__} refused a step and learnt from it: {error}") from None
                return refusal(str(error))
        if not np.isfinite(learner.weights).all():
            raise Misled(f"{kind.__name__}: weights that are no numbers, without a word")
        return "accepted"

    # Processes

    def process(self) -> Outcome:
        """A command in a process of its own, with a time limit: interrupted, or sent to a cluster that is none."""
        rng = self.rng
        quick = ["--set=images=compact", "--set=survey_steps=20", "--set=max_steps=5"]
        with socket.socket() as silent:
            silent.bind(("127.0.0.1", 0))
            silent.listen()
            if rng.random() < 0.4:
                port = silent.getsockname()[1]
                address = rng.choice([f"tcp://127.0.0.1:{port}", f"tls://127.0.0.1:{port}", "ucx://127.0.0.1:1", "\n"])
                program = (
                    "import sys\nfrom homing_lib.errors import UserError\nfrom homing_lib.parallel import results\n"
                    "try:\n list(results(len, [((),)], cluster=sys.argv[1]))\n"
                    "except UserError as error:\n sys.exit(f'homing: {error}')"
                )
                done = self._shell([sys.executable, "-c", program, address])
            else:
                command = [sys.executable, "-m", "homing_lib", "run", *quick, "--set=episodes=1000000"]
                done = self._shell(command, interrupt_after=rng.uniform(0.3, 4))
        code, errors = done
        if code == 0:
            raise Misled("accepted what cannot be")
        if code in (130, -signal.SIGINT) and not errors.strip():
            return "refused in one line"  # there was nothing to be said yet
        return refusal(errors.replace("\r", "\n").strip().splitlines()[-1] if "Traceback" not in errors else errors)

    def _shell(self, command: list[str], interrupt_after: float | None = None) -> tuple[int, str]:
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        try:
            if interrupt_after is not None:
                time.sleep(interrupt_after)
                process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            raise Hang(" ".join(command)[:200]) from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        return process.returncode, errors


SHARES = {
    "settings": 24,
    "command_line": 18,
    "stored_file": 16,
    "page_or_stamp": 4,
    "table_of_the_project": 6,
    "atlas_file": 6,
    "environment": 12,
    "learner": 14,
}
"""How often each kind of case is drawn; besides, one in two hundred is a process of its own."""


@contextlib.contextmanager
def limited() -> Iterator[None]:
    """Raise Hang in whatever takes too long in this process; processes that are started in it can be interrupted."""

    def stop(*_: Any) -> None:
        raise Hang(f"more than {LIMIT_S} s")

    before = signal.signal(signal.SIGALRM, stop)
    interrupts = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background
    signal.alarm(LIMIT_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        signal.signal(signal.SIGINT, interrupts)


def torment(folder: Path, cases: int, seed: int, processes: int | None = None) -> Counter[str]:
    """So many cases. Returns how often what came out; what went wrong is printed as it does."""
    rng, came = random.Random(seed), Counter[str]()
    campaign = Campaign(folder, rng)
    several = cases // 200 if processes is None else processes
    kinds = rng.choices(list(SHARES), list(SHARES.values()), k=cases - several) + ["process"] * several
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        for number, kind in enumerate(kinds):
            try:
                with limited(), contextlib.redirect_stderr(nowhere), contextlib.redirect_stdout(nowhere):
                    outcome = getattr(campaign, kind)()
            except Lost as error:
                outcome, told = "lost", str(error)
            except Hang as error:
                outcome, told = "hangs", str(error)
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt):
                    raise
                outcome, told = "tracebacks", "".join(traceback.format_exception(error)[-3:])
            if outcome in ("lost", "hangs", "tracebacks"):
                print(f"case {number}, seed {seed}, {kind}: {outcome}: {told[:1500]}", flush=True)
            came[outcome] += 1
    campaign.model.close()
    return came


def main() -> int:
    """Returns zero only if there were no tracebacks, no hangs, and nothing was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=int, nargs="?", default=1500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        came = torment(Path(folder), options.cases, options.seed)
    told = ("refused in one line", "repaired", "accepted", "tracebacks", "hangs", "lost")
    print(f"cases {sum(came.values())}: " + ", ".join(f"{name} {came[name]}" for name in told))
    return int(any(came[name] for name in ("tracebacks", "hangs", "lost")))


if __name__ == "__main__":
    sys.exit(main())
