"""The door: `homing`, or `python -m homing_lib`."""

import sys

from homing_lib.errors import UserError

try:
    from homing_lib.publish.cli import main
except KeyboardInterrupt:  # while much is being loaded
    sys.exit(130)
except UserError as error:  # a room that is not described right
    sys.exit(f"homing: {error}")

if __name__ == "__main__":
    sys.exit(main())
