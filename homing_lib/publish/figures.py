"""Figures as files and in notebooks. `charts`, `curves`, `forests` and `plans` draw them, in the style of `style`."""

from pathlib import Path

from matplotlib.figure import Figure

from homing_lib.errors import UserError, shown
from homing_lib.publish.style import house_style
from homing_lib.storage import ROOT, atomic_write
from homing_lib.study import findings


def save(figure: Figure, figures_dir: str | Path | None, name: str) -> None:
    """Write figures_dir/name.pdf and .png, each beside its place and then renamed. The same figure, the same bytes.

    Without a folder nothing is written: a notebook that is run by hand only shows its figures.
    """
    if not figures_dir:
        return
    for kind, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        with atomic_write(Path(figures_dir) / f"{name}.{kind}") as part, house_style():
            figure.savefig(part, format=kind, metadata=metadata)


def show(name: str, figure: Figure, figures_dir: str | Path | None) -> None:
    """In a notebook: the verdict on a question, its predicate, and its figure, which is saved under its name."""
    from IPython import display

    save(figure, figures_dir, name)
    display.display(display.Markdown(str(findings.finding(name))))  # type: ignore[no-untyped-call]


def stored(name: str) -> None:
    """Show in a notebook the stored figure of this name, where it cannot be drawn: it needs the camera."""
    from IPython import display

    path = ROOT / "figures" / f"{name}.png"
    print(f"This needs PyBullet, which this Python lacks. Drawn earlier: figures/{name}.png")
    if path.exists():
        display.display(display.Image(path))  # type: ignore[no-untyped-call]


def check_profile(profile: str) -> None:
    """Refuse a notebook's parameter that is not one of its two profiles. Raises UserError."""
    if profile not in ("full", "quick"):
        raise UserError(f"profile = {shown(profile)}: expected 'full' or 'quick'")
