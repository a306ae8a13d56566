"""What a renderer is given: painted textures, and the meshes of walls and things, in room coordinates."""

import hashlib
from collections.abc import Sequence
from functools import cache
from itertools import product
from math import cos, pi, sin
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from homing_lib.features import Array
from homing_lib.rooms import Ball, Box, Cone, Texture

Image = NDArray[np.uint8]

_COLOUR_SHARE, _PERSISTENCE = 0.35, 0.4
_TEXELS = 256  # along a side of a painted surface


@cache
def paint(texture: Texture, seed: int, name: str) -> Image:
    """A painted surface, shape (256, 256, 3). The same texture, seed and name give the same bytes."""
    rng = np.random.default_rng(int.from_bytes(hashlib.sha256(f"{seed} {name} {texture}".encode()).digest()[:8]))
    base = np.clip(np.array(texture.rgb), 0.02, 0.98)
    logit = np.log(base / (1 - base)) + np.zeros((_TEXELS, _TEXELS, 3))

    def noise(cells: int) -> Array:
        """Light and dark shared by the channels, and some colour of each, at unit variance."""
        shared, own = rng.standard_normal((cells, cells, 1)), rng.standard_normal((cells, cells, 3))
        return np.sqrt(1 - _COLOUR_SHARE) * shared + np.sqrt(_COLOUR_SHARE) * own

    cells, strength = texture.patches, texture.contrast
    while cells <= _TEXELS // 4:
        logit += strength * cv2.resize(noise(cells), (_TEXELS, _TEXELS), interpolation=cv2.INTER_LINEAR)
        cells, strength = 2 * cells, strength * _PERSISTENCE
    if texture.picture:
        row, column = np.mgrid[0:_TEXELS, 0:_TEXELS] / _TEXELS
        sky = (row < 0.6)[:, :, None]
        sun = ((row - 0.42) ** 2 + (column - 0.65) ** 2 < 0.03)[:, :, None]
        logit += np.where(sky, [-0.4, 0.3, 1.3], [-0.6, 0.8, -1.4]) + sun * np.array([2.6, 1.6, -1.6])
    logit += texture.grain * noise(_TEXELS)
    return np.rint(255 / (1 + np.exp(-logit))).astype(np.uint8)


class Mesh(NamedTuple):
    """A textured surface in room coordinates; triangles are seen from the side from which they run anticlockwise."""

    vertices: list[tuple[float, float, float]]
    triangles: list[int]
    uvs: list[tuple[float, float]]


def joined(meshes: Sequence[Mesh]) -> Mesh:
    whole = Mesh([], [], [])
    for mesh in meshes:
        whole.triangles.extend(index + len(whole.vertices) for index in mesh.triangles)
        whole.vertices.extend(mesh.vertices)
        whole.uvs.extend(mesh.uvs)
    return whole


def quad(corner: ArrayLike, right: ArrayLike, up: ArrayLike) -> Mesh:
    """Two triangles: Bullet's own boxes would show about 2 x 2 cells of a texture."""
    a, r, u = (np.array(v, dtype=float) for v in (corner, right, up))
    vertices = [(float(v[0]), float(v[1]), float(v[2])) for v in (a, a + r, a + r + u, a + u)]
    return Mesh(vertices, [0, 1, 2, 0, 2, 3], [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def box_sides(box: Box) -> list[Mesh]:
    """Front (towards -x), back, the two ends and the top."""
    length, width, height = box.size
    x0, x1, y0, y1 = box.x - length / 2, box.x + length / 2, box.y - width / 2, box.y + width / 2
    up = (0, 0, height)
    return [
        quad((x0, y1, 0), (0, -width, 0), up),
        quad((x1, y0, 0), (0, width, 0), up),
        quad((x0, y0, 0), (length, 0, 0), up),
        quad((x1, y1, 0), (-length, 0, 0), up),
        quad((x0, y0, height), (length, 0, 0), (0, width, 0)),
    ]


def cone_mesh(cone: Cone) -> Mesh:
    sides = 16
    angles = [2 * pi * side / sides for side in range(sides + 1)]
    rim = [(cone.x + cone.radius * cos(a), cone.y + cone.radius * sin(a), 0.0) for a in angles]
    triangles = [index for side in range(sides) for index in (side, side + 1, sides + 1 + side)]
    uvs = [(i / sides, 0.0) for i in range(sides + 1)] + [((i + 0.5) / sides, 1.0) for i in range(sides)]
    return Mesh(rim + [(cone.x, cone.y, cone.height)] * sides, triangles, uvs)


def ball_mesh(ball: Ball) -> Mesh:
    mesh, r = Mesh([], [], []), ball.radius
    rings, sides = 6, 12
    for ring, side in product(range(rings + 1), range(sides + 1)):
        down, around = pi * ring / rings, 2 * pi * side / sides
        flat = r * sin(down)
        mesh.vertices.append((ball.x + flat * cos(around), ball.y + flat * sin(around), r + r * cos(down)))
        mesh.uvs.append((side / sides, ring / rings))
        if ring < rings and side < sides:
            first, below = (row * (sides + 1) + side for row in (ring, ring + 1))
            mesh.triangles.extend((first, below, first + 1, first + 1, below, below + 1))
    return mesh
