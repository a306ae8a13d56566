"""The room from above, with home, the way so far and the robot: what `HomingEnv.render` and films show."""

from collections.abc import Sequence
from math import pi
from typing import Any

import cv2
import numpy as np

from homing_lib.rooms import Pose, Room
from homing_lib.surfaces import Image

_WHITE, _YELLOW, _BLACK = (255, 255, 255), (255, 220, 0), (0, 0, 0)


def draw(top_view: Image, room: Room, radius_m: float, path: Sequence[Any], pose: Pose, home: Pose) -> Image:
    """A copy of `Arena.top_view`, shape (height, width, 3), with home, the path so far and the robot."""
    frame = top_view.copy()
    scale = frame.shape[1] / room.size[0]

    def pixel(x: float, y: float) -> tuple[int, int]:
        return round(x * scale), round((room.size[1] - y) * scale)

    corners = [pixel(*home.ahead(1.4 * radius_m, turn * pi / 4)) for turn in (1, 3, 5, 7)]
    cv2.polylines(frame, [np.array(corners)], True, _WHITE, 2, cv2.LINE_AA)
    cv2.line(frame, pixel(*home[:2]), pixel(*home.ahead(radius_m)), _WHITE, 2, cv2.LINE_AA)
    cv2.polylines(frame, [np.array([pixel(*at) for at in path])], False, _YELLOW, 2, cv2.LINE_AA)
    cv2.circle(frame, pixel(*pose[:2]), round(radius_m * scale), _YELLOW, -1, cv2.LINE_AA)
    cv2.line(frame, pixel(*pose[:2]), pixel(*pose.ahead(radius_m)), _BLACK, 2, cv2.LINE_AA)
    return frame
