"""The real parts: a room in PyBullet with a robot's camera, its infra-red sensors and contact, each asked by pose.

Nothing is simulated between two questions: the robot is placed, and Bullet says what it sees and touches. This is the
only module that loads PyBullet; where that is missing, importing it raises UserError with the remedy.
"""

import os
import tempfile
import weakref
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from homing_lib.errors import UserError
from homing_lib.features import Array, histogram
from homing_lib.robot import INFRARED_ANGLES_DEG
from homing_lib.rooms import Ball, Box, Cone, Pose, Room, Texture
from homing_lib.settings import Settings
from homing_lib.storage import write_bytes
from homing_lib.surfaces import Image, Mesh, ball_mesh, box_sides, cone_mesh, joined, paint, quad


@contextmanager
def _quiet() -> Iterator[None]:
    """Bullet greets on the process's own output, below Python's."""
    keep = os.dup(2)
    with Path(os.devnull).open("w") as sink:
        os.dup2(sink.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(keep, 2)
        os.close(keep)


try:
    with _quiet():
        import pybullet
except ImportError:
    raise UserError(
        'the camera needs PyBullet, which is not installed; choose images="compact" (an environment then needs '
        'observation="features"), which runs everywhere, or build it: `pip install pybullet` (some minutes where there '
        "is no wheel, and a C++ compiler)"
    ) from None

_BODY_HEIGHT_M, _LARGEST_CLEARANCE_M = 0.03, 0.1
_ROBOT_GROUP = 64  # the robot's collision group, beyond those that Bullet gives by itself: infra-red rays pass it by


class Arena(AbstractContextManager["Arena"]):
    """A room and the robot's body in it. Use as a context manager, or `close()` it: it holds a Bullet client."""

    def __init__(self, room: Room, settings: Settings) -> None:
        self.room, self.settings = room, settings
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RuntimeError("PyBullet gave no physics client: too many are open; close() those no longer used")
        self._ours = {"physicsClientId": self._client}
        self._free = weakref.finalize(self, pybullet.disconnect, self._client)  # at the latest when nobody holds it
        self.body_names: dict[int, str] = {}
        self._colliders: list[int] = []
        with tempfile.TemporaryDirectory() as folder:
            self._texture_folder = Path(folder)
            self._build()
        self._obstacles = [(body, *self._surroundings(body)) for body in self._colliders if body != self._robot]
        self._projection = pybullet.computeProjectionMatrixFOV(settings.field_of_view_deg, 1.0, 0.005, 4.0)
        ambient = {"lightAmbientCoeff": settings.light, "lightDiffuseCoeff": 0.0, "lightSpecularCoeff": 0.0}
        above = {"lightDirection": (0.0, 0.0, 1.0), "lightColor": (1.0, 1.0, 1.0), "shadow": 0}
        self._image_options = {**ambient, **above, "renderer": pybullet.ER_TINY_RENDERER, **self._ours}

    # --- What the robot sees ---------------------------------------------------------------------------------------

    def image(self, pose: Pose) -> Image:
        """The camera's image at a pose: shape (size, size, 4), RGB and an unused fourth channel."""
        return self._render(pose, pybullet.ER_NO_SEGMENTATION_MASK)[0]

    def histogram(self, pose: Pose) -> Array:
        """Scaled histograms of the image at a pose (eq. 11), shape (3 B,)."""
        return histogram(self.image(pose), self.settings.bin_size)

    def visible(self, pose: Pose) -> set[str]:
        """Names of all that at least one pixel of the image at a pose shows, by Bullet's segmentation mask."""
        mask = self._render(pose, 0)[1]
        return {self.body_names[body] for body in np.unique(mask) if body >= 0}

    def _render(self, pose: Pose, flags: int) -> tuple[Image, Any]:
        s = self.settings
        forward_x, forward_y = cos(pose.heading), sin(pose.heading)
        eye = (pose.x + s.camera_offset_m * forward_x, pose.y + s.camera_offset_m * forward_y, s.camera_height_m)
        target = (eye[0] + forward_x, eye[1] + forward_y, eye[2])
        return self._picture(s.image_size, s.image_size, (eye, target, (0.0, 0.0, 1.0)), self._projection, flags)

    def _picture(self, width: int, height: int, look: Any, projection: Any, flags: int = 0) -> tuple[Image, Any]:
        """Colours, shape (height, width, 4), and Bullet's segmentation mask. look: from where, where to, up."""
        *_, image, _, mask = pybullet.getCameraImage(
            width, height, pybullet.computeViewMatrix(*look), projection, flags=flags, **self._image_options
        )
        if isinstance(image, tuple):  # a PyBullet that was built without NumPy
            image = np.frombuffer(bytearray(image), np.uint8)
        return image.reshape(height, width, 4), mask

    def top_view(self, pixels: int = 480) -> Image:
        """The room from above with the same textures, shape (height, pixels, 3): x to the right, y upwards."""
        (width, depth), distance = self.room.size, 6.0
        look = (width / 2, depth / 2, distance), (width / 2, depth / 2, 0.0), (0.0, 1.0, 0.0)
        right = width / 2 * 0.02 / distance
        top = right * depth / width
        projection = pybullet.computeProjectionMatrix(-right, right, -top, top, 0.02, 8.0)
        return np.ascontiguousarray(self._picture(pixels, round(pixels * depth / width), look, projection)[0][:, :, :3])

    def perspective(self, pixels: int = 640) -> Image:
        """The room obliquely from above, shape (height, pixels, 3)."""
        width, depth = self.room.size
        look = (-0.8 * width, -1.2 * depth, 1.9), (width / 2, depth / 2, self.room.wall_height / 3), (0.0, 0.0, 1.0)
        projection = pybullet.computeProjectionMatrixFOV(32.0, 4 / 3, 0.05, 8.0)
        return np.ascontiguousarray(self._picture(pixels, round(pixels * 3 / 4), look, projection)[0][:, :, :3])

    # --- What it touches and feels --------------------------------------------------------------------------------

    def clearance(self, x: float, y: float) -> float:
        """Metres between the body centred at x, y and the nearest obstacle, negative inside one; at most .1."""
        upright = (0.0, 0.0, 0.0, 1.0)
        pybullet.resetBasePositionAndOrientation(self._robot, (x, y, _BODY_HEIGHT_M / 2), upright, **self._ours)
        nearest = _LARGEST_CLEARANCE_M
        for obstacle, x0, y0, x1, y1 in self._obstacles:
            if x0 <= x <= x1 and y0 <= y <= y1:
                points = pybullet.getClosestPoints(self._robot, obstacle, nearest, **self._ours)
                nearest = min((nearest, *(point[8] for point in points)))
        return nearest

    def _surroundings(self, obstacle: int) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 of a rectangle outside which the body has its largest clearance from this obstacle."""
        low, high = pybullet.getAABB(obstacle, **self._ours)
        reach = self.settings.body_diameter_m / 2 + _LARGEST_CLEARANCE_M + 0.01  # and Bullet's own margins
        return low[0] - reach, low[1] - reach, high[0] + reach, high[1] + reach

    def infrared(self, pose: Pose) -> Array:
        """What the eight sensors read: metres from the body's edge to the nearest surface, at most their range."""
        radius = self.settings.body_diameter_m / 2
        reach = radius + self.settings.infrared_range_m
        directions = [pose.heading + radians(angle) for angle in INFRARED_ANGLES_DEG]
        (x, y, _), z = pose, _BODY_HEIGHT_M / 2
        starts, ends = ([(x + r * cos(d), y + r * sin(d), z) for d in directions] for r in (radius, reach))
        # Not its own body, which stands where it was last asked for a clearance.
        hits = pybullet.rayTestBatch(starts, ends, collisionFilterMask=~_ROBOT_GROUP, **self._ours)
        return np.array([hit[2] for hit in hits]) * self.settings.infrared_range_m

    # --- Building -----------------------------------------------------------------------------------------------------

    def _build(self) -> None:
        room, (width, depth), height, thick = self.room, self.room.size, self.room.wall_height, 0.1
        self._body("floor", room.floor, quad((0, 0, 0), (width, 0, 0), (0, depth, 0)))
        # Each wall: its lower left corner and the way to the right, as seen from inside, and the box behind it.
        walls = {
            "east": ((width, depth, 0), (0, -depth, 0), (width + thick / 2, depth / 2), (thick / 2, depth)),
            "north": ((0, depth, 0), (width, 0, 0), (width / 2, depth + thick / 2), (width, thick / 2)),
            "west": ((0, 0, 0), (0, depth, 0), (-thick / 2, depth / 2), (thick / 2, depth)),
            "south": ((width, 0, 0), (-width, 0, 0), (width / 2, -thick / 2), (width, thick / 2)),
        }
        for name, (corner, right, centre, half) in walls.items():
            collider = self._shape(pybullet.GEOM_BOX, (*centre, height / 2), halfExtents=(*half, height / 2))
            self._body(f"{name} wall", room.walls[name], quad(corner, right, (0, 0, height)), collider)
        for number, picture in enumerate(room.pictures, start=1):
            lower_left, along = (np.array(v, dtype=float) for v in walls[picture.wall][:2])
            length = float(np.linalg.norm(along))
            along /= length
            from_left = length - picture.along if picture.wall in ("east", "south") else picture.along
            lower_left += along * (from_left - picture.size[0] / 2) + 0.002 * np.cross(along, (0, 0, 1))
            lower_left[2] = picture.height - picture.size[1] / 2
            mesh = quad(lower_left, along * picture.size[0], (0, 0, picture.size[1]))
            self._body(f"picture {number}", picture.texture, mesh)
        for thing in room.objects:
            match thing:
                case Box():
                    halves = tuple(side / 2 for side in thing.size)
                    collider = self._shape(pybullet.GEOM_BOX, (thing.x, thing.y, halves[2]), halfExtents=halves)
                    front, *others = box_sides(thing)
                    self._body(thing.name, thing.texture, joined(others), collider)
                    self._body(thing.name, thing.front or thing.texture, front)
                case Ball(radius=radius):
                    collider = self._shape(pybullet.GEOM_SPHERE, (thing.x, thing.y, radius), radius=radius)
                    self._body(thing.name, thing.texture, ball_mesh(thing), collider)
                case Cone():
                    mesh = cone_mesh(thing)
                    collider = self._shape(pybullet.GEOM_MESH, (0, 0, 0), vertices=mesh.vertices)
                    self._body(thing.name, thing.texture, mesh, collider)
        radius = self.settings.body_diameter_m / 2
        body = self._shape(pybullet.GEOM_CYLINDER, (0, 0, 0), radius=radius, height=_BODY_HEIGHT_M)
        # A body without a visual shape shows its collision shape; this triangle below the floor keeps it unseen.
        nothing = Mesh([(0.0, 0.0, -1.0)] * 3, [0, 1, 2], [(0.0, 0.0)] * 3)
        self._robot = self._body("robot", room.floor, nothing, body)
        pybullet.setCollisionFilterGroupMask(self._robot, -1, _ROBOT_GROUP, -1, **self._ours)

    def _shape(self, kind: int, centre: Sequence[float], **size: Any) -> int:
        return int(pybullet.createCollisionShape(kind, collisionFramePosition=centre, **size, **self._ours))

    def _body(self, name: str, texture: Texture, mesh: Mesh, collider: int = -1) -> int:
        of_mesh = {"vertices": mesh.vertices, "indices": mesh.triangles, "uvs": mesh.uvs}
        of_mesh["normals"] = [(0.0, 0.0, 1.0)] * len(mesh.vertices)
        visual = pybullet.createVisualShape(pybullet.GEOM_MESH, **of_mesh, **self._ours)
        shapes = {"baseVisualShapeIndex": visual, "baseCollisionShapeIndex": collider}
        body: int = pybullet.createMultiBody(**shapes, **self._ours)
        path = self._texture_folder / f"{body}.png"
        # Not by imwrite, whose libpng has words of its own for a full disk.
        write_bytes(path, cv2.imencode(".png", paint(texture, self.room.texture_seed, name)[:, :, ::-1])[1].tobytes())
        image = pybullet.loadTexture(str(path), **self._ours)
        pybullet.changeVisualShape(body, -1, textureUniqueId=image, **self._ours)
        self.body_names[body] = name
        if collider >= 0:
            self._colliders.append(body)
        return body

    def close(self) -> None:
        """Free the Bullet client. Closing twice is harmless."""
        self._free()
        self._client = self._ours["physicsClientId"] = -1  # others may have its number next

    def __exit__(self, *_: object) -> None:
        self.close()
