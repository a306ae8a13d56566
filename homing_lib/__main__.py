"""The door: `homing`, or `python -m homing_lib`."""

import sys

try:
    from homing_lib.publish.commands import main
except KeyboardInterrupt:  # while much is being loaded
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(main())
