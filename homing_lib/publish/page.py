"""The demonstration: one HTML file that plays the random walk and the robot in a browser, from disk and offline.

`python -m homing_lib.publish.page` puts it together from notebooks/demo/: page.html, in which lines like
`<!-- learner.js -->` stand for the files of that name, and DATA for what the library knows.
"""

from pathlib import Path

from homing_lib.storage import ROOT

SOURCES = ROOT / "notebooks" / "demo"

CORE = ("random.js", "learner.js", "world.js", "agent.js", "own.js")
"""The model in JavaScript, in the order in which it is read; it needs no browser."""


def core(folder: Path = SOURCES) -> str:
    """The scripts of the model as one."""
    return "\n".join((folder / name).read_text(encoding="utf-8") for name in CORE)
