"""OpenSCAD's solids as inequalities F <= 0, which all hold inside.

With 0 fragments, or with 9 and more, a solid is round, as authors of models intend. With any number
between, a cylinder is a prism and a sphere has rings of flat faces, placed as in OpenSCAD.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from halfstep.models.openscad import Call
from halfstep.scene import TorusShape
from halfstep.scene.values import Array

# With this many fragments or more, a circle is round.
ROUND = 9
# A face's corners must lie in its plane, and other corners behind it, to this part of the size.
FLAT = 1e-7


class Refusal(Exception):  # noqa: N818 - it becomes an error of the file
    """A call that Halfstep cannot draw; the message tells why."""


class Empty(Exception):  # noqa: N818 - not an error: OpenSCAD shows nothing
    """A solid without a point, which is not shown."""


def half_space(normal: Sequence[float] | Array, distance: float) -> Array:
    """The matrix (4, 4) of n·x <= d, for a normal n and a distance d."""
    found = np.zeros((4, 4))
    found[:3, 3] = found[3, :3] = np.array(normal) / 2
    found[3, 3] = -distance
    return found


def cube(call: Call) -> list[Array]:
    """``cube(size = [x, y, z], center = false)``."""
    return _sides(call, 3, "three")


def square(call: Call) -> list[Array]:
    """``square(size = [x, y], center = false)``, a prism without ends along z."""
    return _sides(call, 2, "two")


def _sides(call: Call, axes: int, word: str) -> list[Array]:
    """Half-spaces normal to the first ``axes`` axes."""
    size = _argument(call, "size", 0, 1.0)
    sides = [_number(each) for each in size] if isinstance(size, list) else [_number(size)] * axes
    if len(sides) != axes:
        raise Refusal(f"size is not one number or {word}")
    _above_zero(*sides)
    middle = np.zeros(axes) if _argument(call, "center", 1, False) else np.array(sides) / 2
    found = []
    for axis, side in enumerate(sides):
        normal = np.eye(3)[axis]
        found.append(half_space(-normal, side / 2 - middle[axis]))
        found.append(half_space(normal, side / 2 + middle[axis]))
    return found


def sphere(call: Call) -> list[Array]:
    """``sphere($fn = 0, r = 1)``, also with the diameter ``d``."""
    radius = _radius(call, "r", "d", 0, 1.0)
    _above_zero(radius)
    count = fragments(call)
    if not count:
        return [np.diag([1.0, 1.0, 1.0, -(radius**2)])]
    rings = (count + 1) // 2
    angles = math.pi * (np.arange(rings) + 0.5) / rings
    ring = radius * np.sin(angles)
    heights = radius * np.cos(angles)
    found = [half_space([0, 0, 1], heights[0]), half_space([0, 0, -1], -heights[-1])]
    for k in range(rings - 1):
        found += _frustum(count, (heights[k + 1], heights[k]), (ring[k + 1], ring[k]))
    return found


def cylinder(call: Call) -> list[Array]:
    """``cylinder($fn = 0, h = 1, r1 = 1, r2 = 1, center = false)``, also cones."""
    height = _number(_argument(call, "h", 0, 1.0))
    both = _radius(call, "r", "d", -1, 1.0)
    lower = _radius(call, "r1", "d1", 1, both)
    upper = _radius(call, "r2", "d2", 2, both)
    _above_zero(height, max(lower, upper))
    if min(lower, upper) < 0:
        raise Refusal("a radius is below 0")
    low = -height / 2 if _argument(call, "center", 3, False) else 0.0
    ends = [half_space([0, 0, -1], -low), half_space([0, 0, 1], low + height)]
    count = fragments(call)
    if count:
        return [*ends, *_frustum(count, (low, low + height), (lower, upper))]
    slope = (upper - lower) / height
    # The radius is slope · z + start.
    start = lower - slope * low
    side = np.diag([1.0, 1.0, -(slope**2), -(start**2)])
    side[2, 3] = side[3, 2] = -slope * start
    return [*ends, side]


def _frustum(count: int, heights: tuple[float, float], radii: tuple[float, float]) -> list[Array]:
    """The sides between two regular polygons whose corners lie at 0°, 360° / n and so on."""
    (low, high), (lower, upper) = heights, radii
    inner = math.cos(math.pi / count)
    found = []
    for k in range(count):
        angle = 2 * math.pi * (k + 0.5) / count
        slope = (upper - lower) * inner / (high - low)
        normal = [math.cos(angle), math.sin(angle), -slope]
        found.append(half_space(normal, lower * inner - slope * low))
    return found


def polyhedron(call: Call) -> list[Array]:
    """``polyhedron(points = […], faces = […])``, which must be convex."""
    points = _points(_argument(call, "points", 0, None), 3)
    faces = call.arguments.get("faces", call.arguments.get("triangles"))
    if not isinstance(faces, list) or not faces:
        raise Refusal("has no faces")
    middle, size = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    found = []
    sides: Counter[frozenset[bytes]] = Counter()
    for face in faces:
        numbers = [int(_number(each)) for each in face] if isinstance(face, list) else []
        if len(numbers) < 3 or not all(0 <= number < len(points) for number in numbers):
            raise Refusal("a face has not the numbers of three points")
        corners = points[numbers]
        places = [corner.tobytes() for corner in corners + 0.0]
        sides.update(map(frozenset, zip(places, places[1:] + places[:1], strict=True)))
        # The sum of the cross products of a face's sides is normal to it, for any corners.
        normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        length = float(np.linalg.norm(normal))
        if length <= 1e-12 * size**2:
            continue
        normal = normal / length
        normal = normal if normal @ (corners.mean(axis=0) - middle) > 0 else -normal
        away = points @ normal - float((corners @ normal).max())
        is_flat = np.ptp(corners @ normal) <= FLAT * size
        if away.max() > FLAT * size or not is_flat:
            raise Refusal("is not convex, or a face is not flat")
        found.append(half_space(normal, float((corners @ normal).max())))
    # An edge joins two faces; a side of no length is none.
    if any(count % 2 for edge, count in sides.items() if len(edge) == 2):
        raise Refusal("is not closed: an edge is of one face alone")
    planes = np.array([plane[:3, 3] for plane in found])
    if len(found) < 4 or np.linalg.matrix_rank(planes, tol=FLAT) < 3:
        raise Empty
    return found


def circle(call: Call) -> list[Array]:
    """``circle($fn = 0, r = 1)``, without ends along z."""
    radius = _radius(call, "r", "d", 0, 1.0)
    _above_zero(radius)
    count = fragments(call)
    if count:
        return _frustum(count, (0.0, 1.0), (radius, radius))
    return [np.diag([1.0, 1.0, 0.0, -(radius**2)])]


def polygon(call: Call) -> list[Array]:
    """``polygon(points = […], paths = undef)``, which must be convex; without ends along z."""
    points = _points(_argument(call, "points", 0, None), 2)
    paths = call.arguments.get("paths")
    if isinstance(paths, list) and paths:
        if len(paths) > 1:
            raise Refusal("has holes, or several paths")
        numbers = [int(_number(each)) for each in paths[0]] if isinstance(paths[0], list) else []
        if not numbers or not all(0 <= number < len(points) for number in numbers):
            raise Refusal("a path has not the numbers of points")
        points = points[numbers]
    sides = np.roll(points, -1, axis=0) - points
    area = float((points[:, 0] * sides[:, 1] - points[:, 1] * sides[:, 0]).sum())
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    if abs(area) <= 1e-12 * size**2:
        raise Empty
    found, turns = [], 0.0
    for corner, side in zip(points, sides * math.copysign(1.0, area), strict=True):
        length = math.hypot(*side)
        if length <= 1e-12 * size:
            continue
        normal = np.array([side[1], -side[0]]) / length
        if (points @ normal - corner @ normal).max() > FLAT * size:
            raise Refusal("is not convex")
        found.append(half_space([*normal, 0.0], float(corner @ normal)))
        turns += 1
    return found


@dataclass(frozen=True)
class Placement:
    """A map that turns, moves and scales, the same in all directions."""

    matrix: Array  # (4, 4)
    scale: float

    @classmethod
    def of(cls, matrix: Array) -> Self:
        """The placement of a matrix.

        Raises:
            Refusal: the matrix does more.
        """
        linear = matrix[:3, :3]
        scale = float(abs(np.linalg.det(linear))) ** (1 / 3)
        if np.abs(linear.T @ linear - scale**2 * np.eye(3)).max() > FLAT * scale**2:
            raise Refusal("that is stretched or sheared is not drawn")
        return cls(matrix, scale)

    def torus(self, matrix: Array) -> TorusShape:
        """The torus of an ellipse along x and y, F <= 0 of a matrix (4, 4), turned about y.

        OpenSCAD turns the plane's y to z.

        Raises:
            Refusal: it is no ellipse along x and y, or reaches over the axis.
        """
        bends = np.diag(matrix)[:2]
        if bends.min() <= 0 or matrix[0, 1] != 0:
            raise Refusal("of what is no circle is not drawn")
        middle = -matrix[:2, 3] / bends
        level = float((bends * middle**2).sum() - matrix[3, 3])
        across, along = np.sqrt(level / bends)
        if across > abs(middle[0]) * (1 + FLAT):
            raise Refusal("of a circle that reaches over the axis is not drawn")
        major = abs(float(middle[0])) * self.scale
        origin = self.matrix[:3] @ [0.0, 0.0, middle[1], 1.0]
        return TorusShape(
            major=major,
            minor=(min(float(across) * self.scale, major), float(along) * self.scale),
            origin=(float(origin[0]), float(origin[1]), float(origin[2])),
            axis=tuple((self.matrix[:3, 2] / self.scale).tolist()),
        )


def fragments(call: Call) -> int:
    """The number of flat sides in place of a round one; 0 if the solid stays round."""
    count = _number(call.arguments.get("$fn", 0.0))
    return 0 if count <= 0 or count >= ROUND else max(int(count), 3)


def _argument(call: Call, name: str, position: int, default: Any) -> Any:
    if name in call.arguments:
        value = call.arguments[name]
    elif 0 <= position < len(call.given):
        value = call.given[position]
    else:
        return default
    return default if value is None else value


def _radius(call: Call, name: str, diameter: str, position: int, default: float) -> float:
    if call.arguments.get(diameter) is not None:
        return _number(call.arguments[diameter]) / 2
    return _number(_argument(call, name, position, default))


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, float | int) or not math.isfinite(value):
        raise Refusal(f"{value!r} is not a finite number")
    return float(value)


def _above_zero(*numbers: float) -> None:
    # OpenSCAD warns about other sizes and shows nothing.
    if min(numbers) <= 0:
        raise Empty


def _points(value: Any, count: int) -> Array:
    if not isinstance(value, list) or len(value) < 3:
        raise Refusal("has not three points")
    rows = [each if isinstance(each, list) else [] for each in value]
    if any(len(row) != count for row in rows):
        raise Refusal(f"a point has not {count} numbers")
    return np.array([[_number(each) for each in row] for row in rows])
