"""The `homing` command."""

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from homing_lib.errors import RESUMES, UserError, shown
from homing_lib.parallel import quieten
from homing_lib.settings import Settings
from homing_lib.storage import atomic_write, write_bytes


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code. A user's mistake is one line on standard error."""
    quieten()
    try:
        options = _parser().parse_args(arguments)
        options.command(options)
        sys.stdout.flush()
    except BrokenPipeError:  # who reads, `head` for instance, has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + 13  # as of those whom SIGPIPE ends
    except (UserError, OSError) as error:
        print(f"homing: {_one_line(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"homing: interrupted; {RESUMES}", file=sys.stderr)
        return 130
    return 0


def _one_line(error: Exception) -> str:
    """What went wrong, without what would break the line, fill the screen or steer the terminal."""
    if isinstance(error, OSError) and error.filename:
        told = f"{os.fsdecode(error.filename)}: cannot be used ({error.strerror}); move it away or choose another"
    else:
        told = str(error)
    line = "".join(letter if letter.isprintable() else "?" for letter in " ".join(told.split()))
    return line if len(line) <= 800 else f"{line[:500]}...{line[-297:]}"


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UserError(f"{message}; see `{self.prog} --help`")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="homing", description="A robot that learns its way home, and its study.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, function: Any, text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=text, description=text)
        added.set_defaults(command=function)
        return added

    run = command("run", _run, "one experiment, with the camera; prints a summary")
    run.add_argument("--out", type=Path, metavar="FILE.npz", help="store the run")
    film = command("film", _film, "an episode as MP4 or GIF: robot's view, room from above, similarity and lambda")
    for to, seed, whose in ((run, 0, ""), (film, 1000, ", of the stored runs")):
        to.add_argument("--seed", type=_seed, default=seed, help=f"by default {seed}{whose}")
        to.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="change a setting; repeatable")
    film.add_argument("--episode", type=int, metavar="N", help="1, 2, ...; by default the last of the run")
    film.add_argument("--out", type=Path, default=Path("film.mp4"), metavar="FILE", help="by default film.mp4")
    run.add_argument("--as-printed", action="store_true", help="start from the paper's letter, not from our choices")
    command("settings", _settings, "every setting, its default and its source")
    data = command("data", _data, "check the stored runs and compute those that are missing")
    data.add_argument("--stamp", type=Path, help="write a hash of the data here, if it changed")
    data.add_argument("--force", action="store_true", help="compute all runs from scratch")
    sweep = command("sweep", _sweep, "compute what is missing of one study")
    sweep.add_argument("study", help="one that `homing studies` lists")
    sweep.add_argument("--force", action="store_true", help="compute all its runs from scratch")
    where = sweep.add_mutually_exclusive_group()
    where.add_argument(
        "--workers", type=_workers, default=-1, help="processes on this machine; by default -1, one per core"
    )
    where.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="use the workers of this Dask scheduler instead: `dask scheduler --host 127.0.0.1` prints its address, "
        "`dask worker --nthreads 1 ADDRESS` starts one worker; without `--host` the scheduler serves whoever reaches "
        "this machine, and asks for no password; elsewhere this same version must be installed",
    )
    command("studies", _studies, "every study, its reason, its size")
    command("verify", _verify, "repeat a stored run live and compare it to the bit")
    notebook = command("notebook", _notebook, "execute a notebook and list what it wrote")
    notebook.add_argument("name")
    notebook.add_argument("--profile", choices=("full", "quick"), default="full")
    notebook.add_argument("--output-dir", type=Path)
    notebook.add_argument("--figures-dir", type=Path)
    numbers = command("numbers", _numbers, "fill the findings' numbers into README, lessons and notebooks")
    numbers.add_argument("--latex", action="store_true", help="print numbers and tables of the report instead")
    command("summary", partial(_print, "summary"), "the headline, and every verdict")
    claims = command("claims", _claims, "questions and claims: verdict, predicate, and every number")
    claims.add_argument("names", nargs="*", metavar="NAME", help="such as varying or C8; by default all")
    command("errata", partial(_print, "misprints"), "every slip of the printed paper: reading, effect and proof")
    return parser


def _seed(text: str) -> int:
    if not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(
            f"{shown(text)}: must be 0, 1, 2, ...{', of at most 18 digits' * (len(text) > 18)}"
        )
    return int(text)


def _workers(text: str) -> int:
    if text != "-1" and (not text.isdecimal() or text.strip("0") == ""):
        raise argparse.ArgumentTypeError(f"{shown(text)}: must be 1, 2, ... processes, or -1 for one per core")
    most = 4 * (os.cpu_count() or 1)
    if len(text) > 9 or int(text) > most:
        raise argparse.ArgumentTypeError(
            f"{shown(text)}: must be at most {most}, four per core, or -1 for one per core"
        )
    return int(text)


def _run(options: argparse.Namespace) -> None:
    from tqdm import tqdm

    from homing_lib import agent
    from homing_lib.study import runs
    from homing_lib.study.questions.printed import LETTER

    settings = changed_settings(options.set, LETTER if options.as_printed else Settings())
    with atomic_write(options.out) if options.out else nullcontext() as part:
        if part:
            part.touch()  # tried before any work is done
        # Late, so that it does not stand beside a refusal.
        with tqdm(total=settings.episodes, desc="episodes", unit="episode", delay=1) as bar:
            result = agent.run(settings, options.seed, after_episode=lambda _: bar.update())
        if part:
            part.write_bytes(runs.content_of(result))
    print(f"steps per episode: {' '.join(str(length) for length in result.lengths)}")
    print(f"home reached in {result.reached.sum()} of {settings.episodes} episodes")
    if result.diverged:
        print(f"diverged in episode {result.diverged}")


def _film(options: argparse.Namespace) -> None:
    from homing_lib.publish.film import film

    film(changed_settings(options.set), options.seed, options.episode, options.out)


def changed_settings(changes: Sequence[str], settings: Settings | None = None) -> Settings:
    """Settings, by default ours, changed by texts like "alpha0=0.003". Raises UserError."""
    for change in changes:
        if not change.partition("=")[0].strip() or "=" not in change:
            raise UserError(f"--set {shown(change)[1:-1]}: expected NAME=VALUE")
    return (settings or Settings()).with_changes(**dict(change.split("=", 1) for change in changes))


def _settings(_: argparse.Namespace) -> None:
    for name, field in Settings.model_fields.items():
        print(f"{name:24} {field.default!s:16} {field.description}")


def _data(options: argparse.Namespace) -> None:
    from tqdm import tqdm

    from homing_lib.study import findings, runs, studies, sweep

    for _ in sweep.compute(force=options.force):
        pass
    findings.judge_all(partial(tqdm, desc="verdicts", unit="verdict", delay=1, leave=False))
    contents = {studies.PAGE: studies.page()}
    if options.stamp:
        contents[options.stamp] = runs.fingerprint(studies.in_order()) + "\n"
    for path, text in contents.items():
        if not path.is_file() or path.read_bytes() != text.encode():
            write_bytes(path, text.encode())


def _verify(_: argparse.Namespace) -> None:
    from homing_lib.study import studies, sweep

    print(sweep.verify(studies.HEADLINE))


def _sweep(options: argparse.Namespace) -> None:
    from homing_lib.study.sweep import compute

    how = {"workers": options.workers, "cluster": options.cluster, "force": options.force}
    for study, done in compute([options.study], **how):
        print(f"{study.name}: {done} runs computed, {len(study)} stored")


def _studies(_: argparse.Namespace) -> None:
    from homing_lib.study import studies

    for study in studies.in_order():
        print(f"{study.name:24} {len(study.conditions):4} conditions x {len(study.seeds):4} seeds  {study.reason}")


def _notebook(options: argparse.Namespace) -> None:
    from homing_lib.publish import notebooks

    for path in notebooks.execute(options.name, options.profile, options.output_dir, options.figures_dir):
        print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _numbers(options: argparse.Namespace) -> None:
    from homing_lib.publish import prose, report

    if options.latex:
        print(report.latex())
        return
    for path in prose.update():
        print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    for line in [*prose.broken(), *prose.unpinned()]:
        print(f"homing: {line}", file=sys.stderr)


def _claims(options: argparse.Namespace) -> None:
    from homing_lib.publish import report

    print(report.judged(options.names))


def _print(what: str, _: argparse.Namespace) -> None:
    from homing_lib.publish import report

    print(getattr(report, what)())
