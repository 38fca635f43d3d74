"""How a camera moves: functions of one camera that give another.

A *place* is a point of the picture, in pixels from its upper left corner. A depth is planar, in
scene units; where rays are parallel it does not matter.
"""

from __future__ import annotations

import math

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError
from halfstep.host.camera import View, view
from halfstep.scene import Camera
from halfstep.scene.placement import unit

# How near to straight up or down a camera may look, in radians.
STEEPEST = math.pi / 2 - 1e-3
# How near the camera comes to what it looks at, in sizes of their coordinates: nearer than this
# rounding would be seen in the direction of view.
NEAREST = 2.0**-30

Size = tuple[int, int]
Place = tuple[float, float]


def distance(camera: Camera) -> float:
    """From the centre of projection to look_at, which is the depth of look_at."""
    return math.dist(camera.center, camera.look_at)


def orbit(camera: Camera, turn: float, rise: float) -> Camera:
    """The camera turned about look_at; it stays upright and as far away as it was.

    Args:
        camera: to start from.
        turn: radians about the axis up, counter-clockwise from above.
        rise: radians towards up.
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
    """The camera moved across the view, so that what was seen at ``start`` is seen at ``end``.

    Args:
        camera: to start from.
        size: (width, height) of the picture in pixels.
        start: where the pointer was.
        end: where it is.
        depth: of what moves with it.
    """
    seen = view(camera, size)
    shift = _point(seen, start, depth) - _point(seen, end, depth)
    return _with(camera, center=camera.center + shift, look_at=camera.look_at + shift)


def zoom(camera: Camera, size: Size, place: Place, factor: float, depth: float) -> Camera:
    """The camera nearer to what is seen at ``place``, which stays there.

    Camera and look_at shrink towards that point. Where rays are parallel, the picture gets smaller
    instead, and the camera stays in its plane.

    Args:
        camera: to start from.
        size: (width, height) of the picture in pixels.
        place: of the pointer.
        factor: by how much what is there grows; less than 1 is away from it.
        depth: of what is there.
    """
    seen = view(camera, size)
    # Where rays are parallel, the point in the camera's own plane.
    point = _point(seen, place, 0.0 if seen.parallel else depth)
    nearer = 1.0 - 1.0 / factor
    if seen.parallel:
        assert camera.orthographic_height is not None  # as rays are parallel
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
    """The camera with other keys, or as it was where a scene cannot have them."""
    try:
        moved = Camera(**{**camera.model_dump(exclude_none=True), **keys})
    except SceneError:
        return camera
    reach = max(map(abs, (*moved.center, *moved.look_at)))
    return moved if distance(moved) >= NEAREST * reach else camera
