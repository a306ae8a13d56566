"""The door: `homing`, or `python -m homing_lib`."""

import sys

from homing_lib.publish.commands import main

if __name__ == "__main__":
    sys.exit(main())
