"""The `homing` command: a verb for all that is computed, built or looked up. What is slow to load, a verb loads."""

import io
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from homing_lib.errors import RESUMES, UserError, shown
from homing_lib.storage import atomic_write, write_bytes

if TYPE_CHECKING:
    from homing_lib.settings import Settings


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code. A user's mistake is one line on standard error."""
    prepare_streams()
    code = 0
    try:
        # Not click's own `main`, which ends with a code of its own when the reader of a pipe has gone.
        with homing.make_context("homing", list(sys.argv[1:] if arguments is None else arguments)) as context:
            homing.invoke(context)
        sys.stdout.flush()
    except click.exceptions.Exit as end:  # of --help
        code = end.exit_code
    except BrokenPipeError:  # the reader, `head` for instance, has had enough
        code = 128 + 13  # as if SIGPIPE had ended it
    except (click.UsageError, UserError, OSError) as error:
        print(f"homing: {_one_line(error)}", file=sys.stderr)
        code = 1
    except KeyboardInterrupt:
        print(f"homing: interrupted; {RESUMES}", file=sys.stderr)
        code = 130
    try:
        sys.stdout.flush()
    except OSError:  # given up, or Python would try once more when it ends, and complain
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def prepare_streams() -> None:
    """Let the standard streams take whatever is printed.

    One that is closed leads nowhere, so that no file which is opened later takes its number and with it what other
    libraries print. A letter that the encoding of an output lacks is printed as its number.
    """
    for name, mode in {"stdin": "r", "stdout": "w", "stderr": "w"}.items():
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115, for good
        elif mode == "w" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _one_line(error: Exception) -> str:
    """What went wrong, without what would break the line, fill the screen or steer the terminal."""
    if isinstance(error, click.UsageError):
        message = f"{error.format_message()} See `{error.ctx.command_path if error.ctx else 'homing'} --help`"
    elif isinstance(error, OSError) and error.filename:
        message = f"{os.fsdecode(error.filename)}: cannot be used ({error.strerror}); move it away or choose another"
    elif isinstance(error, OSError):
        message = f"the output cannot be written ({error.strerror or error})"
    else:
        message = str(error)
    line = "".join(letter if letter.isprintable() else "?" for letter in " ".join(message.split()))
    return line if len(line) <= 800 else f"{line[:500]}...{line[-297:]}"


class _Verbs(click.Group):
    """Commands in the order of this file."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.commands)


@click.group(cls=_Verbs, no_args_is_help=False)
def homing() -> None:
    """A robot that learns its way home, and its study."""


# --- Runs and data ---------------------------------------------------------------------------------------------------

SEED = click.IntRange(0, 10**18 - 1)
_changes = click.option("--set", "changes", multiple=True, metavar="NAME=VALUE", help="Change a setting; repeatable.")


def changed_settings(changes: Iterable[str], settings: "Settings | None" = None) -> "Settings":
    """Settings, by default ours, changed by texts like "alpha0=0.003". Raises UserError."""
    from homing_lib.settings import Settings

    pairs = [change.partition("=") for change in changes]
    for name, equals, value in pairs:
        if not name.strip() or not equals:
            raise UserError(f"--set {shown(name + equals + value)[1:-1]}: expected NAME=VALUE")
    return (settings or Settings()).with_changes(**{name: value for name, _, value in pairs})


@homing.command()
@click.option("--seed", type=SEED, default=0, metavar="N", show_default=True)
@_changes
@click.option("--out", type=Path, metavar="FILE.npz", help="Store the run.")
@click.option("--as-printed", is_flag=True, help="Start from the paper's letter, not from our choices.")
def run(seed: int, changes: tuple[str, ...], out: Path | None, as_printed: bool) -> None:
    """One experiment, with the camera or on an atlas (--set images=compact); prints a summary."""
    from tqdm import tqdm

    from homing_lib import agent
    from homing_lib.study import runs
    from homing_lib.study.questions.printed import LETTER

    settings = changed_settings(changes, LETTER if as_printed else None)
    with atomic_write(out) if out else nullcontext() as part:
        if part:
            part.touch()  # tried before any work is done
        # Late, so that it does not stand beside a refusal.
        with tqdm(total=settings.episodes, desc="episodes", unit="episode", delay=1) as bar:
            result = agent.run(settings, seed, after_episode=lambda _: bar.update())
        if part:
            part.write_bytes(runs.content_of(result))
    print(f"steps per episode: {' '.join(str(length) for length in result.lengths)}")
    print(f"home reached in {result.reached.sum()} of {settings.episodes} episodes")
    if result.diverged:
        print(f"diverged in episode {result.diverged}")


@homing.command()
@click.option("--seed", type=SEED, default=1000, metavar="N", help="By default 1000, of the stored runs.")
@_changes
@click.option("--episode", type=int, metavar="N", help="The other one: 2, 3, ...; by default the last of the run.")
@click.option("--tour", is_flag=True, help="Instead a late tour of three homes, when as many tours were learnt.")
@click.option("--out", type=Path, default=Path("film.mp4"), metavar="FILE", show_default=True)
def film(seed: int, changes: tuple[str, ...], episode: int | None, tour: bool, out: Path) -> None:
    """The first episode beside another, as MP4 or GIF: robot's view, room from above, similarity and lambda."""
    from homing_lib.publish import film

    film.film(changed_settings(changes), seed, episode, out, tour=tour)


@homing.command()
def settings() -> None:
    """Every setting, its default and its source."""
    from homing_lib.settings import Settings

    for name, field in Settings.model_fields.items():
        print(f"{name:24} {field.default!s:16} {field.description}")


WORKERS = "Processes on this machine; by default -1, one per core."


@homing.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--force", is_flag=True, help="Compute all their runs from scratch.")
@click.option("--workers", type=click.IntRange(-1, 4 * (os.cpu_count() or 1)), default=-1, metavar="N", help=WORKERS)
@click.option("--stamp", type=Path, help="Write a hash of all data here, if it changed.")
def data(names: tuple[str, ...], force: bool, workers: int, stamp: Path | None) -> None:
    """Check the stored runs and compute those that are missing.

    With the NAMEs of studies (`homing studies` lists them), of these alone. Without, of all studies; then every
    question is judged whose data have changed.
    """
    from tqdm import tqdm

    from homing_lib.study import findings, runs, studies, sweep

    if workers == 0:
        raise click.UsageError("--workers 0: nobody would compute; -1 is one per core.")
    if names and stamp:
        raise click.UsageError("--stamp is of all data: not together with a NAME.")
    for study, done in sweep.compute(names, workers=workers, force=force):
        if names:
            print(f"{study.name}: {done} runs computed, {len(study)} stored", flush=True)
    if names:
        return
    findings.judge_all(lambda asked: tqdm(asked, desc="verdicts", unit="verdict", delay=1, leave=False))
    contents = {studies.PAGE: studies.page()}
    if stamp:
        contents[stamp] = runs.fingerprint(studies.in_order()) + "\n"
    for path, text in contents.items():
        if not path.is_file() or path.read_bytes() != text.encode():
            write_bytes(path, text.encode())


@homing.command()
def studies() -> None:
    """Every study, its reason and its size."""
    from homing_lib.study import studies

    for study in studies.in_order():
        print(f"{study.name:24} {len(study.conditions):4} conditions x {len(study.seeds):4} seeds  {study.reason}")


@homing.command()
def verify() -> None:
    """Repeat a stored run live and compare it to the bit."""
    from homing_lib.atlas import require_camera
    from homing_lib.study import studies, sweep

    require_camera("the stored run, whose views were rendered,")
    print(sweep.verify(studies.HEADLINE))


# --- What was found --------------------------------------------------------------------------------------------------


@homing.command()
def summary() -> None:
    """The headline, and every verdict."""
    from homing_lib.publish import report

    print(report.summary())


@homing.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
def claims(names: tuple[str, ...]) -> None:
    """Questions and claims, such as varying or C8, by default all: verdict, predicate, and every number."""
    from homing_lib.publish import report

    print(report.judged(names))


@homing.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
def errata(names: tuple[str, ...]) -> None:
    """Slips of the printed paper, such as E3, by default all: reading, effect and proof."""
    from homing_lib.publish import report

    print(report.misprints(names))


@homing.command()
@click.argument("figure")
def where(figure: str) -> None:
    """What made a FIGURE: notebook, cell and function, studies and seeds.

    FIGURE is a name in figures/, such as drives-after (or fig4 for fig4-room), or its number in the report.
    """
    from homing_lib.publish.where import origin

    print(origin(figure))


# --- What is built ---------------------------------------------------------------------------------------------------


@homing.command()
@click.argument("name")
@click.option("--profile", type=click.Choice(["full", "quick"]), default="full", show_default=True)
@click.option("--output-dir", type=Path, help="Of the copy; by default executed/ beside it.")
@click.option("--figures-dir", type=Path, help="By default figures/.")
def notebook(name: str, profile: str, output_dir: Path | None, figures_dir: Path | None) -> None:
    """Execute a notebook, by its name or its path, and list what it wrote."""
    from homing_lib.publish import notebooks

    print_paths(notebooks.execute(name, profile, output_dir, figures_dir))


@homing.command()
@click.option("--latex", is_flag=True, help="Print numbers and tables of the report instead.")
def numbers(latex: bool) -> None:
    """Fill the findings' numbers into README, lessons and notebooks, and name each sentence that no longer holds."""
    from homing_lib.publish import prose, report

    if latex:
        print(report.latex())
        return
    print_paths(prose.update())
    for line in prose.broken():
        print(f"homing: {line}", file=sys.stderr)


@homing.command()
def demo() -> None:
    """The demonstration: one page that plays the walk and the robot in any browser."""
    from homing_lib.publish import demo

    demo.write()
    print_paths([demo.PAGE])


@homing.command()
def site() -> None:
    """All of it as pages to read from disk, from what `make` has built."""
    from homing_lib.publish import site

    site.write()
    print_paths([site.SITE / "index.html"])


def print_paths(paths: Iterable[Path]) -> None:
    for path in paths:
        print(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
