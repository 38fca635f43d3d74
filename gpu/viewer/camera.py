"""Moves a camera: functions that take a camera and return another.

A *place* is a point of the picture, in pixels from its upper left corner. A depth is along the view
axis, in scene units. If rays are parallel, depth has no effect.
"""

from __future__ import annotations

import math

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError
from halfstep.host.camera import View, view
from halfstep.scene import Camera
from halfstep.scene.placement import unit

# The largest angle by which a camera may look up or down, in radians.
STEEPEST = math.pi / 2 - 1e-3
# The least distance of a camera from look_at, in parts of their largest coordinate. At a smaller
# distance, rounding would visibly change the direction of view.
NEAREST = 2.0**-30

Size = tuple[int, int]
Place = tuple[float, float]


def distance(camera: Camera) -> float:
    """The distance from the centre of projection to look_at, which is the depth of look_at."""
    return math.dist(camera.center, camera.look_at)


def orbit(camera: Camera, turn: float, rise: float) -> Camera:
    """The camera turned about look_at. It stays upright and at the same distance.

    Args:
        camera: the camera before the turn.
        turn: angle in radians about the axis up, counter-clockwise seen from above.
        rise: angle in radians towards up.
    """
    up = unit(np.array(camera.up))
    arm = np.subtract(camera.center, camera.look_at)
    height = float(arm @ up)
    flat = arm - height * up
    length, across = math.hypot(*arm), math.hypot(*flat)
    elevation = min(max(math.atan2(height, across) + rise, -STEEPEST), STEEPEST)
    ahead = flat / across
    ahead = math.cos(turn) * ahead + math.sin(turn) * np.cross(up, ahead)
    moved = length * (math.cos(elevation) * ahead + math.sin(elevation) * up)
    return _with(camera, center=camera.look_at + moved)


def pan(camera: Camera, size: Size, start: Place, end: Place, depth: float) -> Camera:
    """The camera moved across the view, so that a point seen at ``start`` is then seen at ``end``.

    Args:
        camera: the camera before the move.
        size: (width, height) of the picture in pixels.
        start: the place where the pointer was.
        end: the place where the pointer is.
        depth: the depth of the point that moves with the pointer.
    """
    seen = view(camera, size)
    shift = _point(seen, start, depth) - _point(seen, end, depth)
    return _with(camera, center=camera.center + shift, look_at=camera.look_at + shift)


def zoom(camera: Camera, size: Size, place: Place, factor: float, depth: float) -> Camera:
    """The camera moved nearer to the point seen at ``place``, which stays at this place.

    Camera and look_at shrink towards that point. If rays are parallel, the camera stays in its
    plane and its ``orthographic_height`` shrinks.

    Args:
        camera: the camera before the move.
        size: (width, height) of the picture in pixels.
        place: the place of the pointer.
        factor: how much larger the point's surroundings become; less than 1 moves the camera away.
        depth: the depth of the point.
    """
    seen = view(camera, size)
    # If rays are parallel, take the point in the camera's own plane.
    point = _point(seen, place, 0.0 if seen.parallel else depth)
    nearer = 1.0 - 1.0 / factor
    if seen.parallel:
        assert camera.orthographic_height is not None  # because rays are parallel
        shift = nearer * (point - camera.center)
        height = camera.orthographic_height / factor
        ends = {"center": camera.center + shift, "look_at": camera.look_at + shift}
        return _with(camera, **ends, orthographic_height=height)
    center = camera.center + nearer * (point - camera.center)
    look_at = camera.look_at + nearer * (point - camera.look_at)
    return _with(camera, center=center, look_at=look_at)


def _point(seen: View, place: Place, depth: float) -> Floats:
    """The world point at a place and a depth."""
    right, down, forward = seen.camera_from_world
    across = (place[0] - seen.width / 2) * right + (place[1] - seen.height / 2) * down
    scale = seen.pixel if seen.parallel else seen.pixel * depth
    return np.asarray(seen.eye + depth * forward + scale * across)


def _with(camera: Camera, **keys: Floats | float) -> Camera:
    """The camera with other keys, or the same camera if these keys are not valid."""
    try:
        moved = Camera(**{**camera.model_dump(exclude_none=True), **keys})
    except SceneError:
        return camera
    reach = max(map(abs, (*moved.center, *moved.look_at)))
    return moved if distance(moved) >= NEAREST * reach else camera
