"""Makes a virtual environment with this package in it: `python environment.py FOLDER [LOCK]...`, from a clone's root.

With a LOCK it holds exactly the locked packages, those of all LOCKs, without one whatever pip finds for this Python.
"""

import ast
import os
import platform
import subprocess
import sys
from pathlib import Path

SOURCES = "index-url extra-index-url find-links no-index proxy cert client-cert trusted-host default-timeout timeout"
"""Options of pip that say where packages come from. Nothing else of a user's own set-up of pip counts: it may say that
packages go elsewhere, or that they are all to be compiled."""


def main(folder: str, *locks: str) -> None:
    """Make the environment anew, whatever stands there, and at the end write .ready, which says what it is for."""
    python = Path(folder, "bin", "python")
    subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
    environment = only_sources(python)
    wheel = sys.version_info[:2] == (3, 11) and platform.system() == "Linux" and platform.machine() == "x86_64"
    if locks:
        slow = "" if wheel else ", then PyBullet is compiled, which takes 7 minutes on two cores"
        print(f"{folder}: some 500 MB of packages are installed, a minute or two{slow}", flush=True)
        options = ["--only-binary", ":all:", *([] if wheel else ["--no-binary", "pybullet"]), "--require-hashes"]
        pip(python, environment, *options, *(part for lock in locks for part in ("-r", lock)))
        pip(python, environment, "--no-deps", "--no-build-isolation", "-e", ".")
    else:
        print(f"{folder}: some 400 MB of packages are installed, in some minutes", flush=True)
        if not wheel:
            print(
                "There is no PyBullet for this Python: nothing is rendered, and robots learn on a table of views",
                flush=True,
            )
        pip(python, environment, "-e", ".")
    # Where the package stands, seen from there. pip writes the whole path, which Python cannot read under LC_ALL=C if
    # it holds an accent, and which leads a copied folder to the library that it was copied from.
    (packages,) = Path(folder).glob("lib/python3.*/site-packages")
    (packages / "homing_lib.pth").write_text(os.path.relpath(".", packages))
    Path(folder, ".ready").write_bytes(b"%d.%d %s\n" % (*sys.version_info[:2], os.fsencode(Path.cwd())))


def only_sources(python: Path) -> dict[str, str]:
    """The environment variables for pip, with what the user has set of SOURCES in files or variables."""
    listed = subprocess.run([python, "-m", "pip", "config", "list"], stdout=subprocess.PIPE, text=True, check=False)
    known = dict(line.split("=", 1) for line in listed.stdout.splitlines())
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    for section in ("global", "install", ":env:"):
        for name in SOURCES.split():
            if (value := known.get(f"{section}.{name}")) is not None:
                environment[f"PIP_{name.upper().replace('-', '_')}"] = ast.literal_eval(value)
    return environment | {"PIP_CONFIG_FILE": os.devnull, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def pip(python: Path, environment: dict[str, str], *options: str) -> None:
    subprocess.run([python, "-m", "pip", "install", "-qq", *options], env=environment, check=True)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except subprocess.CalledProcessError:
        sys.exit("homing: the environment could not be made; see above")
    except KeyboardInterrupt:
        sys.exit(130)
