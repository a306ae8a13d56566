"""What `atlas`, `features` and `robot` say, compiled: where a robot is, what it sees, and how it drives on an atlas.

See `compiled`, which drives whole episodes with it.
"""

from math import atan2, cos, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numba import config, njit

KEPT = bool(getattr(config, "CACHE_DIR", ""))
compiled = njit(cache=KEPT, nogil=True, error_model="numpy")  # which divides by 0 as NumPy does
inlined = njit(nogil=True, error_model="numpy", inline="always")

OUTSIDE_M = -0.1  # as in `atlas`


class World(NamedTuple):
    """An atlas and what a robot makes of its views (`features.CountedViews`).

    views: pixels in each bin, shape (lattice poses, bins); front_m: the least of what the front sensors read there;
    position, clearance_m: shape (nx, ny); values, start, centre: phi_i = values[start_i + |count_i - centre_i|].
    """

    views: Any
    front_m: Any
    position: Any
    clearance_m: Any
    x0: float
    y0: float
    heading0: float
    per_metre: float
    per_radian: float
    headings: int
    values: Any
    start: Any
    centre: Any


class Body(NamedTuple):
    """The robot. commands_m, turns_m: metres that the (left, right) wheels roll for an action, and for a turn of the
    reflex, shapes (3, 2) and (2, 2).
    """

    commands_m: Any
    turns_m: Any
    wheel_base_m: float
    slip: float
    clear_way_m: float


@compiled
def clearance(world: Any, x: Any, y: Any) -> Any:
    nx, ny = world.clearance_m.shape
    u, v = (x - world.x0) * world.per_metre, (y - world.y0) * world.per_metre
    if not (0 <= u < nx - 1 and 0 <= v < ny - 1):
        return OUTSIDE_M
    i, j = int(u), int(v)
    u, v = u - i, v - j
    c = world.clearance_m
    return (1 - u) * ((1 - v) * c[i, j] + v * c[i, j + 1]) + u * ((1 - v) * c[i + 1, j] + v * c[i + 1, j + 1])


@compiled
def nearest(world: Any, x: Any, y: Any, heading: Any) -> Any:
    """The number of the nearest lattice pose; -1 where the robot cannot stand."""
    i, j = round((x - world.x0) * world.per_metre), round((y - world.y0) * world.per_metre)
    nx, ny = world.position.shape
    if not (0 <= i < nx and 0 <= j < ny) or world.position[i, j] < 0:
        return -1
    return world.position[i, j] + round((heading - world.heading0) * world.per_radian) % world.headings


@compiled
def _sum(a: Any) -> Any:
    """NumPy's pairwise sum."""
    n = len(a)
    if n > 128:
        half = n // 2
        half -= half % 8
        return _sum(a[:half]) + _sum(a[half:])
    if n < 8:
        total = 0.0
        for value in a:
            total += value
        return total
    s0, s1, s2, s3, s4, s5, s6, s7 = a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]
    end = n - n % 8
    for k in range(8, end, 8):
        s0 += a[k]
        s1 += a[k + 1]
        s2 += a[k + 2]
        s3 += a[k + 3]
        s4 += a[k + 4]
        s5 += a[k + 5]
        s6 += a[k + 6]
        s7 += a[k + 7]
    total = ((s0 + s1) + (s2 + s3)) + ((s4 + s5) + (s6 + s7))
    for k in range(end, n):
        total += a[k]
    return total


@inlined
def look(world: Any, number: Any, phi: Any) -> Any:
    """Write the features of a lattice pose into phi, and return their mean, the similarity."""
    view, values, start, centre = world.views[number], world.values, world.start, world.centre
    for first in range(0, len(phi), len(view)):
        for k in range(len(view)):
            i = first + k
            phi[i] = values[np.uint64(start[i] + abs(np.int32(view[k]) - centre[i]))]
    return _sum(phi) / len(phi)


@compiled
def _wrapped(angle: Any) -> Any:
    return atan2(sin(angle), cos(angle)) if abs(angle) > pi else angle


@compiled
def _arc(x: Any, y: Any, heading: Any, left: Any, right: Any, wheel_base: Any) -> Any:
    turn = (right - left) / wheel_base
    half = turn / 2
    chord = (left + right) / 2 * (sin(half) / half if half != 0 else 1.0)
    direction = heading + half
    return x + chord * cos(direction), y + chord * sin(direction), _wrapped(heading + turn)


@inlined
def _drive(world: Any, x: Any, y: Any, heading: Any, left: Any, right: Any, wheel_base: Any) -> Any:
    """The pose in the end, and whether an obstacle stopped the robot."""
    advance = abs(left + right) / 2
    if advance == 0 or clearance(world, x, y) > advance:
        return _arc(x, y, heading, left, right, wheel_base), False
    for blocked in (0.25, 0.5, 0.75, 1.0):
        to_x, to_y, _ = _arc(x, y, heading, blocked * left, blocked * right, wheel_base)
        if clearance(world, to_x, to_y) < 0:
            break
    else:
        return _arc(x, y, heading, left, right, wheel_base), False
    free = blocked - 0.25
    for _ in range(10):
        middle = (free + blocked) / 2
        to_x, to_y, _ = _arc(x, y, heading, middle * left, middle * right, wheel_base)
        if clearance(world, to_x, to_y) < 0:
            blocked = middle
        else:
            free = middle
    return _arc(x, y, heading, free * left, free * right, wheel_base), True


@inlined
def act(world: Any, body: Any, pose: Any, reflex: Any, action: Any, rng: Any) -> Any:
    """One step: pose, number of the nearest lattice pose (-1: none), action driven, reflex to come, if at a wall."""
    if reflex < 0:
        left, right = body.commands_m[action, 0], body.commands_m[action, 1]
    else:
        action = reflex
        left, right = body.turns_m[reflex, 0], body.turns_m[reflex, 1]
    if body.slip != 0:
        left = left * (1 + body.slip * rng.standard_normal())
        right = right * (1 + body.slip * rng.standard_normal())
    pose, stopped = _drive(world, pose[0], pose[1], pose[2], left, right, body.wheel_base_m)
    number = nearest(world, pose[0], pose[1], pose[2])
    at_wall = stopped or reflex >= 0
    if stopped:
        reflex = 0 if rng.random() < 0.5 else 1
    elif reflex >= 0 and number >= 0 and world.front_m[number] >= body.clear_way_m:
        reflex = -1
    return pose, number, action, reflex, at_wall


@compiled
def wander(world: Any, body: Any, pose: Any, rng: Any, seen: Any) -> Any:
    """A survey's random drive: writes the number of the lattice pose after each step. False: it came where none is."""
    reflex = -1
    for step in range(len(seen)):
        pose, seen[step], _, reflex, _ = act(world, body, pose, reflex, rng.integers(0, 3), rng)
        if seen[step] < 0:
            return False
    return True
