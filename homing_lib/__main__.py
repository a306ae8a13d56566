"""The door: `homing`, or `python -m homing_lib`. It alone knows all wings; nothing knows it."""

import sys

try:
    from homing_lib.publish.cli import homing, main, print_paths
except KeyboardInterrupt:  # while much is being loaded
    sys.exit(130)


@homing.command()
def lab() -> None:
    """The lab for a class: .build/lab/lab.zip for students, lab-teacher.zip with the solutions."""
    from homing_lib.teach import handouts

    print("homing: executing the solutions, which takes one to two minutes", file=sys.stderr, flush=True)
    print_paths(handouts.write())


if __name__ == "__main__":
    sys.exit(main())
