"""The judge of hits: closed forms in float64, decided again in double-double near a tie.

It shares no code with the renderer and reads only the scene's types. Everything that is constant
within a frame (rotations, tan(fov/2), base planes, the camera seen from a solid) is computed from
the scene's own doubles with 400 bits. Along a ray the unknown is s, planar depth less that of the
middle of the solid, so neither the solid's distance nor its place in the world costs a digit:

    F(s) = A s² + 2B s + C       A, B, C quadratic in the pixel offset (x, y)
    f(s) = b s + c               for a half-space; b, c affine in (x, y)

A solid is {F <= 0 and every f <= 0}, closed. Every decision is the sign of a number v that comes
with a *scale*, the sum of the magnitudes it was made of: its error is a few units of rounding
times the scale. The margin |v|/scale of each ray is the least over its decisions. Where that is
below `ESCALATE` in float64 (whose error stays under 1e-14 of the scale, counting some 50 roundings)
the pixel is decided again in double-double (error under 1e-29); there, what is below `TIE` is a
tie, decided by the closed rules below, and the margin is 0:

* a touch is a hit; of two planes crossed at once the one of smaller number is seen; where a plane
  and F meet, the plane; of two solids at one depth, the first in the file;
* a plane that coincides with a base plane is crossed at the base plane, so a face lying on the
  near base plane is seen; a ray that starts at the eye, on the surface, starts inside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations, product
from typing import Any, Self

import numpy as np
from mpmath.ctx_mp import MPContext
from numpy.typing import ArrayLike, NDArray

from halfstep.contract.arrays import Bools, Floats
from halfstep.scene import Camera, Scene, Solid

Ints = NDArray[np.int32]
# A 400-bit number of `MP`, which has no static type.
Exact = Any
# Values along rays: Floats in the first pass, DoubleDouble in the second.
Number = Any

MP = MPContext()
MP.prec = 400

ESCALATE = 1e-11
TIE = 1e-24
# Terms that cancel to less than this part of their sum are an exact zero, such as cos(90°).
_VANISHING = MP.mpf(2) ** -300
# Rays solved at once: temporaries of one chunk stay in cache.
_CHUNK = 16384


@dataclass(frozen=True)
class Trace:
    """What rays hit; arrays share the shape of the pixels asked for.

    Attributes:
        solid: int32, index in file order, -1 where nothing is hit.
        surface: int32, 0 for F or the patch, half-spaces from 1; -1 where nothing is hit.
        depth: float64, planar depth of the visible point, scene units; NaN where nothing is hit.
        depth_exit: float64, planar depth where the ray leaves the solid it hit; NaN on a miss.
        margin: float64, least |v|/scale over the decisions; 0 for a tie.
    """

    solid: Ints
    surface: Ints
    depth: Floats
    depth_exit: Floats
    margin: Floats


class Oracle:
    """Exact hits of one scene at one picture size.

    Args:
        scene: a validated scene.
        size: (width, height) in pixels; the scene's where None.
        interval: planar depths (near, far) of the base planes, for a scene without a volume whose
            unbounded solids are to be cut exactly where a renderer cuts them. Where None: those of
            the volume, or of the tight world box of all bounded solids.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] | None = None,
        interval: tuple[float, float] | None = None,
    ) -> None:
        self.size = size or (scene.image.width, scene.image.height)
        view = _View(scene.camera, self.size)
        boxes = [_world_box(solid) for solid in scene.solids]
        near, far = _base_planes(scene, view, boxes) if interval is None else interval
        self.near_depth, self.far_depth = float(near), float(far)
        # A box around the bounded solids cuts none of them, and must not do so by rounding.
        uncut = (MP.mpf(0), 2 * MP.mpf(far))
        self._solids = [
            _Body(
                solid,
                view,
                uncut if scene.volume is None and box is not None else (near, far),
                _screen_box(box, view),
            )
            for solid, box in zip(scene.solids, boxes, strict=True)
        ]

    def trace(self, pixels: tuple[ArrayLike, ArrayLike] | None = None) -> Trace:
        """Nearest hits over all solids.

        Args:
            pixels: (i, j), columns and rows of any one shape, fractions allowed (a pixel's centre
                is at its integer index); all pixels, shaped (H, W), where None.
        """
        return self._trace(range(len(self._solids)), pixels)

    def trace_solid(self, index: int, pixels: tuple[ArrayLike, ArrayLike] | None = None) -> Trace:
        """Hits of one solid as if it were alone, between the base planes of the whole scene."""
        return self._trace((index,), pixels)

    def stable_ids(
        self,
        delta: float,
        pixels: tuple[ArrayLike, ArrayLike] | None = None,
        solid: int | None = None,
    ) -> Bools:
        """True where solid and surface stay the same at the four points (i ± delta, j ± delta).

        Args:
            delta: in pixels.
            pixels: as for `trace`.
            solid: judge this solid alone; the whole scene where None.
        """
        i, j = _pixels(self.size, pixels)
        indices = range(len(self._solids)) if solid is None else (solid,)
        middle = self._trace(indices, (i, j))
        stable = np.ones(i.shape, dtype=np.bool_)
        for di, dj in product((-delta, delta), repeat=2):
            beside = self._trace(indices, (i + di, j + dj))
            stable &= (beside.solid == middle.solid) & (beside.surface == middle.surface)
        return stable

    def trace_in(self, level: type[Double], pixels: tuple[ArrayLike, ArrayLike] | None) -> Trace:
        """Nearest hits by one pass alone, whatever the margins."""
        i, j = _pixels(self.size, pixels)
        out = _blank(i.size)
        self._fill(out, np.arange(i.size), range(len(self._solids)), i.ravel(), j.ravel(), level)
        return _shaped(out, i.shape)

    def _trace(self, indices: Sequence[int], pixels: tuple[ArrayLike, ArrayLike] | None) -> Trace:
        i, j = _pixels(self.size, pixels)
        shape, i, j = i.shape, i.ravel(), j.ravel()
        out = _blank(i.size)
        self._fill(out, np.arange(i.size), indices, i, j, Double)
        self._fill(out, np.flatnonzero(out.margin < ESCALATE), indices, i, j, Extended)
        return _shaped(out, shape)

    def _fill(
        self,
        out: Trace,
        rays: NDArray[np.intp],
        indices: Sequence[int],
        i: Floats,
        j: Floats,
        level: type[Double],
    ) -> None:
        """Decide some of the rays in one pass; `out` is written in place."""
        if self.far_depth <= 0:
            return
        with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
            for start in range(0, rays.size, _CHUNK):
                part = rays[start : start + _CHUNK]
                nearest = _Nearest(part.size, level)
                for index in indices:
                    body = self._solids[index]
                    seen = body.inside_screen_box(i[part], j[part])
                    if seen.size:
                        hit = body.solve(i[part[seen]], j[part[seen]], level)
                        nearest.merge(seen, index, body.middle, hit)
                hits, middle = nearest.solid >= 0, nearest.middle
                out.solid[part] = nearest.solid
                out.surface[part] = nearest.surface
                out.depth[part] = np.where(hits, level.head(nearest.s + middle), np.nan)
                out.depth_exit[part] = np.where(hits, level.head(nearest.leave + middle), np.nan)
                out.margin[part] = nearest.margin


def _blank(count: int) -> Trace:
    solid, surface = np.full((2, count), -1, dtype=np.int32)
    depth, depth_exit = np.full((2, count), np.nan)
    return Trace(solid, surface, depth, depth_exit, np.full(count, np.inf))


def _shaped(flat: Trace, shape: tuple[int, ...]) -> Trace:
    return Trace(*(getattr(flat, field.name).reshape(shape) for field in fields(Trace)))


def trace(
    scene: Scene,
    size: tuple[int, int] | None = None,
    pixels: tuple[ArrayLike, ArrayLike] | None = None,
) -> Trace:
    """`Oracle.trace` of a new oracle."""
    return Oracle(scene, size).trace(pixels)


def trace_solid(
    scene: Scene,
    index: int,
    size: tuple[int, int] | None = None,
    pixels: tuple[ArrayLike, ArrayLike] | None = None,
) -> Trace:
    """`Oracle.trace_solid` of a new oracle."""
    return Oracle(scene, size).trace_solid(index, pixels)


def stable_ids(
    scene: Scene,
    size: tuple[int, int] | None = None,
    delta: float = 1e-3,
    pixels: tuple[ArrayLike, ArrayLike] | None = None,
) -> Bools:
    """`Oracle.stable_ids` of a new oracle."""
    return Oracle(scene, size).stable_ids(delta, pixels)


def near_depth(scene: Scene) -> float:
    """Planar depth of the near base plane, scene units, 0 at the least."""
    return Oracle(scene).near_depth


def far_depth(scene: Scene) -> float:
    """Planar depth of the far base plane, scene units."""
    return Oracle(scene).far_depth


# ------------------------------------------------------------------------------ arithmetic


@dataclass(eq=False)
class DoubleDouble:
    """Numbers as unevaluated sums hi + lo of float64, |lo| <= ulp(hi)/2; about 105 bits."""

    hi: Floats
    lo: Floats

    # NumPy leaves array·DoubleDouble to the reflected methods below.
    __array_ufunc__ = None

    def __neg__(self) -> Self:
        return type(self)(-self.hi, -self.lo)

    def __add__(self, other: Self | Floats | float) -> Self:
        hi, lo = _parts(other)
        s, e = _two_sum(self.hi, hi)
        t, f = _two_sum(self.lo, lo)
        s, e = _fast_two_sum(s, e + t)
        return type(self)(*_fast_two_sum(s, e + f))

    __radd__ = __add__

    def __sub__(self, other: Self | Floats | float) -> Self:
        return self + (-other)

    def __mul__(self, other: Self | Floats | float) -> Self:
        hi, lo = _parts(other)
        p, e = _two_product(self.hi, hi)
        return type(self)(*_fast_two_sum(p, e + (self.hi * lo + self.lo * hi)))

    __rmul__ = __mul__

    def __truediv__(self, other: Self) -> Self:
        first = self.hi / other.hi
        rest = self - other * first
        second = rest.hi / other.hi
        third = (rest - other * second).hi / other.hi
        return type(self)(*_fast_two_sum(first, second)) + third

    def __getitem__(self, key: Any) -> Self:
        return type(self)(self.hi[key], self.lo[key])

    def __setitem__(self, key: Any, value: Self) -> None:
        self.hi[key], self.lo[key] = value.hi, value.lo


def _parts(value: DoubleDouble | Floats | float) -> tuple[Any, Any]:
    return (value.hi, value.lo) if isinstance(value, DoubleDouble) else (value, 0.0)


def _fast_two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    s = a + b
    return s, b - (s - a)


def _two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


def _two_product(a: Any, b: Any) -> tuple[Any, Any]:
    p = a * b
    a_hi, a_lo = _split(a)
    b_hi, b_lo = _split(b)
    return p, ((a_hi * b_hi - p) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo


def _split(a: Any) -> tuple[Any, Any]:
    t = 134217729.0 * a  # 2^27 + 1
    hi = t - (t - a)
    return hi, a - hi


class Double:
    """The first pass: numbers are float64 arrays."""

    # A number below this part of its scale counts as zero.
    tolerance = 0.0

    @staticmethod
    def constant(value: Exact) -> Number:
        return np.float64(value)

    @staticmethod
    def full(count: int, value: float | Number) -> Number:
        return np.full(count, value)

    @staticmethod
    def head(value: Number) -> Floats:
        """The float64 nearest the value; its sign is the value's."""
        return np.asarray(value, dtype=np.float64)

    @staticmethod
    def where(mask: Bools, a: Number, b: Number) -> Number:
        return np.where(mask, a, b)

    @staticmethod
    def sqrt(value: Number) -> Number:
        return np.sqrt(np.maximum(value, 0.0))

    @staticmethod
    def difference(a: Floats | float, b: Floats | float) -> Number:
        return a - b


class Extended(Double):
    """The second pass: numbers are DoubleDouble."""

    tolerance = TIE

    @staticmethod
    def constant(value: Exact) -> Number:
        hi = float(value)
        return DoubleDouble(np.asarray(hi), np.asarray(float(MP.mpf(value) - hi)))

    @staticmethod
    def full(count: int, value: float | Number) -> Number:
        hi, lo = _parts(value)
        return DoubleDouble(np.full(count, hi), np.full(count, lo))

    @staticmethod
    def head(value: Number) -> Floats:
        return np.asarray(value.hi)

    @staticmethod
    def where(mask: Bools, a: Number, b: Number) -> Number:
        (a_hi, a_lo), (b_hi, b_lo) = _parts(a), _parts(b)
        return DoubleDouble(np.where(mask, a_hi, b_hi), np.where(mask, a_lo, b_lo))

    @staticmethod
    def sqrt(value: Number) -> Number:
        positive = value.hi > 0
        hi = np.where(positive, value.hi, 1.0)
        root = np.sqrt(hi)
        # One Newton step from a float64 root doubles its digits.
        rest = value - DoubleDouble(*_two_product(root, root))
        s, e = _fast_two_sum(root, rest.hi / (2.0 * root))
        return DoubleDouble(np.where(positive, s, 0.0), np.where(positive, e, 0.0))

    @staticmethod
    def difference(a: Floats | float, b: Floats | float) -> Number:
        return DoubleDouble(*_two_sum(a, -b))


# ------------------------------------------------------------------------------ the view, exactly


Vector = list[Exact]


def _vector(values: Iterable[float]) -> Vector:
    return [MP.mpf(value) for value in values]


def _total(terms: Iterable[Exact]) -> Exact:
    """Sum in which exact cancellation is seen through the rounding of 400 bits."""
    terms = list(terms)
    total = MP.fsum(terms)
    return total if abs(total) > _VANISHING * MP.fsum(terms, absolute=True) else MP.mpf(0)


def _dot(a: Vector, b: Vector) -> Exact:
    return _total(x * y for x, y in zip(a, b, strict=True))


def _cross(a: Vector, b: Vector) -> Vector:
    return [
        _total((a[1] * b[2], -a[2] * b[1])),
        _total((a[2] * b[0], -a[0] * b[2])),
        _total((a[0] * b[1], -a[1] * b[0])),
    ]


def _scaled(a: Vector, factor: Exact) -> Vector:
    return [x * factor for x in a]


def _sum(*vectors: Vector) -> Vector:
    return [_total(column) for column in zip(*vectors, strict=True)]


def _unit(a: Vector) -> Vector:
    return _scaled(a, 1 / MP.sqrt(_dot(a, a)))


class _View:
    """The camera: eye and axes in the world, and the distance of pixels at unit depth."""

    def __init__(self, camera: Camera, size: tuple[int, int]) -> None:
        self.width, self.height = size
        self.eye = _vector(camera.center)
        self.forward = _unit(_sum(_vector(camera.look_at), _scaled(self.eye, -1)))
        self.right = _unit(_cross(self.forward, _vector(camera.up)))
        self.down = _cross(self.forward, self.right)
        # Of parallel rays the distance of pixels is the same at any depth.
        self.parallel = camera.orthographic_height is not None
        if self.parallel:
            self.pitch = MP.mpf(camera.orthographic_height) / self.height
        else:
            self.pitch = 2 * MP.tan(MP.radians(MP.mpf(camera.fov_degrees)) / 2) / self.height

    def in_camera(self, point: Vector) -> Vector:
        """Right, down and depth of a world point."""
        offset = _sum(point, _scaled(self.eye, -1))
        return [_dot(axis, offset) for axis in (self.right, self.down, self.forward)]

    def ray_steps(self, i: int, j: int, depth: Exact) -> tuple[list[Vector], list[Vector]]:
        """Where the ray of pixel (i, j) is at a depth, from the eye, and its direction per depth.

        Each with its changes per column and row.
        """
        per_column = _scaled(self.right, self.pitch)
        per_row = _scaled(self.down, self.pitch)
        across = MP.mpf(2 * i + 1 - self.width) / 2
        along = MP.mpf(2 * j + 1 - self.height) / 2
        aside = _sum(_scaled(per_column, across), _scaled(per_row, along))
        if self.parallel:
            none = _vector((0, 0, 0))
            start = _sum(aside, _scaled(self.forward, depth))
            return [start, per_column, per_row], [self.forward, none, none]
        directions = [_sum(self.forward, aside), per_column, per_row]
        return [_scaled(step, depth) for step in directions], directions


def _base_planes(
    scene: Scene, view: _View, boxes: list[tuple[Floats, Floats] | None]
) -> tuple[Exact, Exact]:
    """Planar depths of the near and far base planes; (0, 0) where there is nothing to see."""
    corners: list[Vector]
    if scene.volume is not None:
        sides = zip(scene.volume.min, scene.volume.max, strict=True)
        corners = [_vector(corner) for corner in product(*sides)]
    else:
        bounded = [box for box in boxes if box is not None and np.all(box[0] <= box[1])]
        if not bounded:
            return MP.mpf(0), MP.mpf(0)
        low = np.min([box[0] for box in bounded], axis=0)
        high = np.max([box[1] for box in bounded], axis=0)
        corners = [_vector(corner) for corner in product(*zip(low, high, strict=True))]
    depths = [view.in_camera(corner)[2] for corner in corners]
    return max(min(depths), MP.mpf(0)), max(depths)


def _pixels(
    size: tuple[int, int], pixels: tuple[ArrayLike, ArrayLike] | None
) -> tuple[Floats, Floats]:
    if pixels is None:
        j, i = np.mgrid[0 : size[1], 0 : size[0]]
    else:
        i, j = np.broadcast_arrays(*map(np.asarray, pixels))
    return i.astype(np.float64), j.astype(np.float64)


# ------------------------------------------------------------------------------ solids, exactly


@dataclass(frozen=True)
class _Quadric:
    """F(p) = p·Mp + 2q·p + k."""

    matrix: list[Vector]
    linear: Vector
    constant: Exact


def _rotation(solid: Solid) -> list[Vector]:
    """Rows of world_from_local."""
    if solid.axis is not None:
        x, y, z = _unit(_vector(solid.axis))
        if x == 0 and y == 0:
            sign = MP.sign(z)
            return [_vector((1, 0, 0)), [MP.mpf(0), sign, MP.mpf(0)], [MP.mpf(0), MP.mpf(0), sign]]
        # 1/(1+z) cancels for an axis near -Z; (1-z)/(x²+y²) is the same number.
        h = (1 - z) / (x * x + y * y)
        return [[1 - h * x * x, -h * x * y, x], [-h * x * y, 1 - h * y * y, y], [-x, -y, z]]
    if solid.rotation_degrees is not None:
        (sx, sy, sz), (cx, cy, cz) = zip(
            *(_sine_cosine(angle) for angle in solid.rotation_degrees), strict=True
        )
        return [
            [cz * cy, _total((cz * sy * sx, -sz * cx)), _total((cz * sy * cx, sz * sx))],
            [sz * cy, _total((sz * sy * sx, cz * cx)), _total((sz * sy * cx, -cz * sx))],
            [-sy, cy * sx, cy * cx],
        ]
    return [_vector(row) for row in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]


def _sine_cosine(degrees: float) -> tuple[Exact, Exact]:
    # Reduced in degrees, which is exact: quarter turns give exact zeros.
    turn = MP.mpf(degrees) % 360
    quarters, rest = divmod(turn, 90)
    s, c = (MP.sin(MP.radians(rest)), MP.cos(MP.radians(rest))) if rest else (MP.mpf(0), MP.mpf(1))
    return ((s, c), (c, -s), (-s, -c), (-c, s))[int(quarters)]


def _quadric(solid: Solid) -> _Quadric | None:
    """F of a solid in its own coordinates; None for polyhedra and patches."""

    def of_revolution(xy: Exact, z: Exact, one: Exact, half_z: Exact = 0) -> _Quadric:
        zero = MP.mpf(0)
        matrix = [[xy, zero, zero], [zero, xy, zero], [zero, zero, MP.mpf(z)]]
        return _Quadric(matrix, [zero, zero, MP.mpf(half_z)], MP.mpf(one))

    if solid.kind == "sphere":
        return of_revolution(MP.mpf(1), 1, -(MP.mpf(solid.radius) ** 2))
    if solid.kind == "ellipsoid":
        diagonal = [1 / MP.mpf(a) ** 2 for a in solid.semi_axes]
        matrix = [[diagonal[r] if r == c else MP.mpf(0) for c in range(3)] for r in range(3)]
        return _Quadric(matrix, _vector((0, 0, 0)), MP.mpf(-1))
    if solid.kind == "cylinder":
        return of_revolution(MP.mpf(1), 0, -(MP.mpf(solid.radius) ** 2))
    if solid.kind == "cone":
        return of_revolution(MP.mpf(1), -(MP.mpf(solid.slope) ** 2), 0)
    if solid.kind == "hyperboloid_one_sheet":
        return of_revolution(1 / MP.mpf(solid.waist) ** 2, -1 / MP.mpf(solid.c) ** 2, -1)
    if solid.kind == "hyperboloid_two_sheets":
        return of_revolution(1 / MP.mpf(solid.a) ** 2, -1 / MP.mpf(solid.c) ** 2, 1)
    if solid.kind == "paraboloid":
        return of_revolution(1 / MP.mpf(solid.a) ** 2, 0, 0, -MP.mpf(1) / 2)
    if solid.kind == "quadric":
        xx, yy, zz, xy, xz, yz, x, y, z, one = _vector(solid.coefficients)
        matrix = [[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, zz]]
        return _Quadric(matrix, [x / 2, y / 2, z / 2], one)
    return None


def _half_spaces(solid: Solid) -> list[Vector]:
    """Rows n, d of n·p <= d in the solid's own coordinates, in the order of surface numbers."""
    if solid.kind == "polyhedron":
        return [_vector(row) for row in solid.rows]
    rows: list[Vector] = []
    if solid.kind == "box":
        for axis, size in enumerate(solid.size):
            for sign in (-1, 1):
                normal = [MP.mpf(sign) if axis == other else MP.mpf(0) for other in range(3)]
                rows.append([*normal, MP.mpf(size) / 2])
    elif solid.kind != "plane":
        if solid.z_min is not None:
            rows.append(_vector((0, 0, -1, -solid.z_min)))
        if solid.z_max is not None:
            rows.append(_vector((0, 0, 1, solid.z_max)))
        rows.extend(_vector(row) for row in solid.cut)
    return rows


# ------------------------------------------------------------------------------ rays and one solid


@dataclass(frozen=True)
class _Hits:
    """A solid's hits; s and leave are depths from its middle, scale the error scale of s."""

    surface: Ints
    s: Number
    scale: Floats
    leave: Number
    margin: Floats


class _Polynomial:
    """c0 + c1 x + c2 y (+ c3 x² + c4 xy + c5 y²) with the scale of its value."""

    def __init__(self, coefficients: list[Exact]) -> None:
        self._exact = {level: list(map(level.constant, coefficients)) for level in _LEVELS}
        self._scale = [abs(float(c)) for c in coefficients]

    def __call__(self, x: Number, y: Number, level: type[Double]) -> tuple[Number, Floats]:
        scale = self._sum(self._scale, np.abs(level.head(x)), np.abs(level.head(y)))
        return self._sum(self._exact[level], x, y), scale

    @staticmethod
    def _sum(c: list[Any], x: Number, y: Number) -> Any:
        if len(c) == 3:
            return x * c[1] + y * c[2] + c[0]
        return (x * c[3] + y * c[4] + c[1]) * x + (y * c[5] + c[2]) * y + c[0]


_LEVELS: tuple[type[Double], ...] = (Double, Extended)


class _Body:
    """One solid, or a patch, seen by one camera: polynomials in the pixel offset (x, y)."""

    def __init__(
        self,
        solid: Solid,
        view: _View,
        interval: tuple[Exact, Exact],
        screen_box: tuple[float, float, float, float] | None,
    ) -> None:
        near, far = map(MP.mpf, interval)
        origin = _vector(solid.origin)
        right, down, depth = view.in_camera(origin)
        self.middle = float(min(max(depth, near), far))
        middle = MP.mpf(self.middle)
        self._start = near - middle
        self._end = far - middle
        # At the eye a ray that starts on a plane starts inside, and shows its exit.
        self._near_is_base_plane = near > 0 or view.parallel
        self._screen_box = screen_box

        # The pixel nearest the solid's origin: offsets from it are small where it is seen. The
        # centre of pixel i is i + 1/2 from the edge of the picture.
        self._column, self._row = (
            int(min(max(MP.nint(side / width + (count - 1) / 2), 0), count - 1))
            if (width := view.pitch * (1 if view.parallel else depth)) > 0
            else count // 2
            for side, count in ((right, view.width), (down, view.height))
        )
        points, directions = view.ray_steps(self._column, self._row, middle)
        offset = _sum(view.eye, _scaled(origin, -1))
        rotation = _rotation(solid)
        columns = [[row[axis] for row in rotation] for axis in range(3)]

        def local(vector: Vector) -> Vector:
            return [_dot(axis, vector) for axis in columns]

        # p + w s is the ray in the solid's own coordinates; each is a triple 1, x, y.
        w = [local(direction) for direction in directions]
        p = [local(_sum(offset, points[0])), local(points[1]), local(points[2])]
        self._is_patch = solid.kind == "plane"
        if solid.kind == "plane":
            world = [_sum(view.eye, points[0]), points[1], points[2]]
            self._planes = [_plane(_vector((0, 0, 1, 0)), p, w)]
            normal = columns[2]
            for axis, (low, high) in enumerate(
                zip(solid.bounds.min, solid.bounds.max, strict=True)
            ):
                others = [abs(normal[k]) for k in range(3) if k != axis]
                if max(others) <= 1e-9:
                    continue
                for sign, bound in ((-1, -low), (1, high)):
                    row = [MP.mpf(sign) if axis == k else MP.mpf(0) for k in range(3)]
                    self._planes.append(_plane([*row, MP.mpf(bound)], world, directions))
        else:
            self._planes = [_plane(row, p, w) for row in _half_spaces(solid)]
        quadric = _quadric(solid)
        self._quadric = None if quadric is None else _along_rays(quadric, p, w)

    def inside_screen_box(self, i: Floats, j: Floats) -> NDArray[np.intp]:
        """Indices of the pixels that could see the solid."""
        if self._screen_box is None:
            return np.arange(i.size)
        left, right, top, bottom = self._screen_box
        return np.flatnonzero((i >= left) & (i <= right) & (j >= top) & (j <= bottom))

    def solve(self, i: Floats, j: Floats, level: type[Double]) -> _Hits:
        """Hits of pixels (N,)."""
        # A fractional pixel index less an integer one need not fit float64.
        x, y = level.difference(i, self._column), level.difference(j, self._row)
        if self._is_patch:
            return self._solve_patch(x, y, level)
        span = self._clip(x, y, level)
        if self._quadric is None:
            return span.as_hits()
        coefficients = [polynomial(x, y, level) for polynomial in self._quadric]
        return _cross_quadric(span, coefficients, level)

    def _clip(self, x: Number, y: Number, level: type[Double]) -> _Span:
        span = _Span(
            level.head(x).size, level.constant(self._start), level.constant(self._end), level
        )
        for number, (offset, slope) in enumerate(self._planes, start=1):
            span.clip(number, offset(x, y, level), slope(x, y, level), self._near_is_base_plane)
        span.close()
        return span

    def _solve_patch(self, x: Number, y: Number, level: type[Double]) -> _Hits:
        (offset, slope), *bounds = self._planes
        (c, c_scale), (b, b_scale) = offset(x, y, level), slope(x, y, level)
        s, scale, parallel = _crossing((c, c_scale), (b, b_scale), level)
        start, end = level.constant(self._start), level.constant(self._end)
        start_scale, end_scale = abs(float(level.head(start))), abs(float(level.head(end)))
        decisions = [(start - s, scale + start_scale), (s - end, scale + end_scale)]
        for offset, slope in bounds:
            (c_j, c_j_scale), (b_j, b_j_scale) = offset(x, y, level), slope(x, y, level)
            error = c_j_scale + np.abs(level.head(s)) * b_j_scale
            decisions.append((b_j * s + c_j, error + np.abs(level.head(b_j)) * scale))
        outside = [_ratio(level.head(value), error) for value, error in decisions]
        # The clearest "outside" settles a miss, however close to a tie the rest is.
        worst = np.max(outside, axis=0)
        hit = ~parallel & (worst <= level.tolerance)
        margin = np.where(hit, np.min(np.abs(outside), axis=0), worst)
        beside = _ratio(np.abs(level.head(c)), c_scale + max(start_scale, end_scale) * b_scale)
        if level is Double:
            beside = np.where(b_scale > 0, 0.0, beside)
        margin = np.where(parallel, beside, margin)
        surface = np.where(hit, 0, -1).astype(np.int32)
        return _Hits(surface, s, scale, s, margin)


def _plane(row: Vector, p: list[Vector], w: list[Vector]) -> tuple[_Polynomial, _Polynomial]:
    """Offset c and slope b along rays p + w s of n·p <= d, given as n, d."""
    normal = row[:3]
    at_zero = [_dot([*normal, row[3]], [*p[0], MP.mpf(-1)]), _dot(normal, p[1]), _dot(normal, p[2])]
    return _Polynomial(at_zero), _Polynomial([_dot(normal, step) for step in w])


def _along_rays(
    quadric: _Quadric, p: list[Vector], w: list[Vector]
) -> tuple[_Polynomial, _Polynomial, _Polynomial]:
    """A, B, C of F = A s² + 2B s + C along rays p + w s, each a triple 1, x, y."""

    def form(u: Vector, v: Vector) -> list[Exact]:
        return [u[r] * quadric.matrix[r][c] * v[c] for r in range(3) for c in range(3)]

    def line(u: Vector) -> list[Exact]:
        return [a * b for a, b in zip(quadric.linear, u, strict=True)]

    # Both orders of a product of different terms; M is symmetric.
    pairs = [((0, 0),), ((0, 1), (1, 0)), ((0, 2), (2, 0)), ((1, 1),), ((1, 2), (2, 1)), ((2, 2),)]
    a = [_total(t for r, c in pair for t in form(w[r], w[c])) for pair in pairs]
    b_terms = [[t for r, c in pair for t in form(p[r], w[c])] for pair in pairs]
    c_terms = [[t for r, c in pair for t in form(p[r], p[c])] for pair in pairs]
    for step in range(3):
        b_terms[step] += line(w[step])
        c_terms[step] += [2 * t for t in line(p[step])]
    c_terms[0].append(quadric.constant)
    return (
        _Polynomial(a),
        _Polynomial(list(map(_total, b_terms))),
        _Polynomial(list(map(_total, c_terms))),
    )


def _ratio(value: Floats, scale: Floats) -> Floats:
    """value/scale, 0 where both are 0."""
    return value / np.where(scale > 0, scale, 1.0)


def _crossing(
    offset: tuple[Number, Floats], slope: tuple[Number, Floats], level: type[Double]
) -> tuple[Number, Floats, Bools]:
    """Where c + b s = 0, the scale of its error, and whether the ray is parallel to the plane."""
    (c, c_scale), (b, b_scale) = offset, slope
    magnitude = np.abs(level.head(b))
    parallel = magnitude <= level.tolerance * b_scale
    s = -c / level.where(parallel, level.full(parallel.size, 1.0), b)
    scale = (c_scale + np.abs(level.head(s)) * b_scale) / np.where(parallel, 1.0, magnitude)
    return s, scale, parallel


class _Span:
    """The part of each ray between the base planes and inside all half-spaces.

    Attributes:
        first, last: its ends, as depths from the solid's middle.
        first_scale, last_scale: the scales of their errors.
        entry, exit: the numbers of the planes at its ends, 0 for a base plane.
        live: whether it is not empty.
        margin: of `live`.
        entry_margin: of which plane, or none, the ray enters through.
        exit_margin: of which plane, or none, the ray leaves through.
    """

    def __init__(self, count: int, start: Number, end: Number, level: type[Double]) -> None:
        self.level = level
        self.first, self.last = level.full(count, start), level.full(count, end)
        self.first_scale = np.full(count, abs(float(level.head(start))))
        self.last_scale = np.full(count, abs(float(level.head(end))))
        self.entry = np.zeros(count, dtype=np.int32)
        self.exit = np.zeros(count, dtype=np.int32)
        self.live = np.ones(count, dtype=np.bool_)
        self.margin = np.full(count, np.inf)
        self.entry_margin = np.full(count, np.inf)
        self.exit_margin = np.full(count, np.inf)
        self._start, self._start_scale = start, self.first_scale
        # How clearly the last plane entered, if any, lies beyond the start.
        self._beyond_start = np.full(count, -np.inf)
        # The clearest reason for the span to be empty: no tie of the ray matters then.
        self._empty_by = np.zeros(count)
        self._reach = np.maximum(self.first_scale, self.last_scale)

    def clip(
        self,
        number: int,
        offset: tuple[Number, Floats],
        slope: tuple[Number, Floats],
        near_is_base_plane: bool,
    ) -> None:
        """Cut by one half-space c + b s <= 0."""
        level, tolerance = self.level, self.level.tolerance
        s, scale, parallel = _crossing(offset, slope, level)
        side = self._side_of_parallel(offset, slope)
        beside = parallel & (side > tolerance)
        self.live &= ~beside
        self._empty_by = np.where(beside, np.maximum(side, self._empty_by), self._empty_by)
        self.margin = np.where(parallel, np.minimum(self.margin, np.abs(side)), self.margin)

        falling = level.head(slope[0]) < 0
        entering, leaving = falling & ~parallel, ~falling & ~parallel
        later = _ratio(level.head(s - self.first), scale + self.first_scale)
        beyond = _ratio(level.head(s - self._start), scale + self._start_scale)
        at_base_plane = (self.entry == 0) & (later >= -tolerance) & near_is_base_plane
        enters = entering & ((later > tolerance) | at_base_plane)
        _keep_runner_up(self.entry_margin, entering & (self.entry > 0), enters, later)
        self._beyond_start = np.where(
            entering, np.maximum(self._beyond_start, beyond), self._beyond_start
        )
        self.first = level.where(enters, s, self.first)
        self.first_scale = np.where(enters, scale, self.first_scale)
        self.entry[enters] = number

        earlier = _ratio(level.head(self.last - s), scale + self.last_scale)
        at_end = (self.exit == 0) & (earlier >= -tolerance)
        exits = leaving & ((earlier > tolerance) | at_end)
        _keep_runner_up(self.exit_margin, leaving, exits, earlier)
        self.last = level.where(exits, s, self.last)
        self.last_scale = np.where(exits, scale, self.last_scale)
        self.exit[exits] = number

    def _side_of_parallel(
        self, offset: tuple[Number, Floats], slope: tuple[Number, Floats]
    ) -> Floats:
        """The half-space over its scale anywhere between the base planes, for b = 0."""
        side = _ratio(self.level.head(offset[0]), offset[1] + self._reach * slope[1])
        if self.level is Double:
            # A slope that is 0 in float64, yet made of numbers that are not, may have either sign.
            return np.where(slope[1] > 0, 0.0, side)
        return side

    def close(self) -> None:
        """Decide which spans are empty, once all half-spaces have cut them."""
        level = self.level
        length = _ratio(level.head(self.last - self.first), self.first_scale + self.last_scale)
        self.live &= length >= -level.tolerance
        self._empty_by = np.maximum(self._empty_by, -length)
        self.margin = np.where(self.live, np.minimum(self.margin, np.abs(length)), self._empty_by)
        self.entry_margin = np.minimum(self.entry_margin, np.abs(self._beyond_start))

    def as_hits(self) -> _Hits:
        """Hits of a solid without F."""
        starts = self.entry == 0
        surface = np.where(starts, np.where(self.exit == 0, -1, self.exit), self.entry)
        surface = np.where(self.live, surface, -1).astype(np.int32)
        s = self.level.where(starts, self.last, self.first)
        scale = np.where(starts, self.last_scale, self.first_scale)
        margin = np.minimum(self.entry_margin, np.where(starts, self.exit_margin, np.inf))
        margin = np.where(self.live, np.minimum(self.margin, margin), self.margin)
        return _Hits(surface, s, scale, self.last, margin)


def _keep_runner_up(margin: Floats, compared: Bools, wins: Bools, lead: Floats) -> None:
    """Keep, in place, the lead of the best plane so far over the second, for one plane more."""
    margin[compared] = np.where(wins, np.abs(lead), np.minimum(margin, np.abs(lead)))[compared]


def _cross_quadric(
    span: _Span, coefficients: list[tuple[Number, Floats]], level: type[Double]
) -> _Hits:
    """Hits of F <= 0 within a span: F at both ends, and its extremum between them."""
    (a, a_scale), (b, b_scale), (c, c_scale) = coefficients
    zero = level.full(span.live.size, 0.0)
    first = level.where(span.live, span.first, zero)
    last = level.where(span.live, span.last, zero)
    tolerance = level.tolerance

    def scale_at(s: Floats) -> Floats:
        return (a_scale * np.abs(s) + 2.0 * b_scale) * np.abs(s) + c_scale

    def side_at(s: Number, s_scale: Floats) -> tuple[Floats, Floats]:
        """F over its scale, and half of F', at s."""
        slope = a * s + b
        scale = scale_at(level.head(s)) + 2.0 * np.abs(level.head(slope)) * s_scale
        return _ratio(level.head((slope + b) * s + c), scale), level.head(slope)

    F_first, slope_first = side_at(first, span.first_scale)
    F_last, slope_last = side_at(last, span.last_scale)
    inside_first, inside_last = F_first <= tolerance, F_last <= tolerance
    dips = (slope_first < 0) & (slope_last > 0)
    bulges = (slope_first > 0) & (slope_last < 0)
    discriminant = b * b - a * c
    heads = [np.abs(level.head(v)) for v in (a, b, c)]
    disc = _ratio(
        level.head(discriminant), 2.0 * heads[1] * b_scale + heads[0] * c_scale + heads[2] * a_scale
    )

    # A quadratic enters once, where F' < 0, and leaves once, where F' > 0, whatever the sign of A.
    root = level.sqrt(discriminant)
    rising = level.head(b) > 0
    one = level.full(span.live.size, 1.0)

    def over(above: Number, below: Number) -> Number:
        return above / level.where(level.head(below) == 0, one, below)

    enter = level.where(rising, over(-b - root, a), over(c, root - b))
    leave = level.where(rising, over(c, -b - root), over(root - b, a))

    starts = span.entry == 0
    found = ~inside_first & (inside_last | (dips & (disc >= -tolerance)))
    left = inside_first & (~inside_last | (bulges & (disc > tolerance)))
    by_plane = np.where(starts, np.where(left, 0, np.where(span.exit == 0, -1, span.exit)), -1)
    surface = np.where(found, 0, np.where(inside_first & ~starts, span.entry, by_plane))
    surface = np.where(span.live, np.where(found | inside_first, surface, -1), -1)

    exit_at = level.where(left | (found & ~inside_last), leave, last)
    at_root = found | (starts & left)
    s = level.where(
        found, enter, level.where(inside_first & ~starts, first, level.where(left, leave, last))
    )
    distance = np.abs(level.head(s))
    slope_at_root = 2.0 * level.head(root)
    root_scale = distance + scale_at(distance) / np.where(slope_at_root > 0, slope_at_root, 1.0)
    end_scale = np.where(starts, span.last_scale, span.first_scale)
    scale = np.where(at_root, root_scale, end_scale)

    margin = np.abs(F_first)
    shows_last = (~inside_first & ~dips) | (inside_first & starts)
    margin = np.where(shows_last, np.minimum(margin, np.abs(F_last)), margin)
    shows_extremum = (~inside_first & ~inside_last & dips) | (
        inside_first & starts & inside_last & bulges
    )
    margin = np.where(shows_extremum, np.minimum(margin, np.abs(disc)), margin)
    # Where the ray enters F clearly inside its span, it does not matter how the span began; where
    # it clearly misses F, it does not matter either whether the span is empty.
    margin = np.where(found, np.minimum(margin, span.margin), margin)
    of_span = np.minimum(span.margin, span.entry_margin)
    of_span = np.where(starts, np.minimum(of_span, span.exit_margin), of_span)
    margin = np.where(inside_first, np.minimum(margin, of_span), margin)
    margin = np.where(span.live, margin, span.margin)
    return _Hits(surface.astype(np.int32), s, scale, exit_at, margin)


class _Nearest:
    """The nearest hits of a chunk of rays."""

    def __init__(self, count: int, level: type[Double]) -> None:
        self._level = level
        self.solid = np.full(count, -1, dtype=np.int32)
        self.surface = np.full(count, -1, dtype=np.int32)
        self.middle = np.zeros(count)
        self.s = level.full(count, 0.0)
        self.leave = level.full(count, 0.0)
        self.margin = np.full(count, np.inf)
        self._scale = np.zeros(count)

    def merge(self, rays: NDArray[np.intp], index: int, middle: float, hit: _Hits) -> None:
        """Take the hits of one solid, seen by these rays, where they are nearer."""
        level = self._level
        hits = hit.surface >= 0
        other = self.solid[rays] >= 0
        s = self.s[rays]
        apart = np.abs(middle - self.middle[rays])
        scale = apart + np.abs(level.head(hit.s)) + np.abs(level.head(s))
        scale += hit.scale + self._scale[rays]
        ahead = (s - hit.s) + level.difference(self.middle[rays], np.full(rays.size, middle))
        lead = _ratio(level.head(ahead), scale)
        margin = np.where(hits & other, np.abs(lead), np.inf)
        margin = np.minimum(margin, hit.margin)
        margin = np.where(margin <= level.tolerance, 0.0, margin)
        self.margin[rays] = np.minimum(self.margin[rays], margin)

        wins = hits & (~other | (lead > level.tolerance))
        at = rays[wins]
        self.solid[at] = index
        self.surface[at] = hit.surface[wins]
        self.middle[at] = middle
        self.s[at] = hit.s[wins]
        self._scale[at] = hit.scale[wins]
        self.leave[at] = hit.leave[wins]


# ------------------------------------------------------------------------------ boxes, float64


def _world_box(solid: Solid) -> tuple[Floats, Floats] | None:
    """Tight world box (min, max) of a solid, (inf, -inf) if it is empty; None if unbounded."""
    quadric = _quadric(solid)
    rotation = _floats(_rotation(solid))
    if solid.kind == "plane":
        normal, rotation = rotation[:, 2], np.eye(3)
        rows = [[*normal, 0.0], [*-normal, 0.0]]
        for axis in range(3):
            if np.abs(np.delete(normal, axis)).max() > 1e-9:
                unit = np.eye(3)[axis]
                rows.append([*unit, solid.bounds.max[axis] - solid.origin[axis]])
                rows.append([*-unit, solid.origin[axis] - solid.bounds.min[axis]])
        planes = np.array(rows)
    else:
        planes = _floats(_half_spaces(solid)).reshape(-1, 4)
        planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    if quadric is None:
        points = _vertices(planes)
    else:
        F = _float_matrix(quadric)
        if not _is_bounded(F, planes):
            return None
        points = np.concatenate([_vertices(planes), *_tangent_points(F, planes, rotation)])
        points = points[_quadric_side(F, points) <= 1e-9]
    points = points[np.all(_plane_sides(planes, points) <= 1e-9, axis=1)]
    if not len(points):
        return np.full(3, np.inf), np.full(3, -np.inf)
    world = points @ rotation.T
    return world.min(axis=0) + solid.origin, world.max(axis=0) + solid.origin


def _floats(rows: Iterable[Iterable[Exact]]) -> Floats:
    return np.array([[float(value) for value in row] for row in rows])


def _float_matrix(quadric: _Quadric) -> Floats:
    """Symmetric 4×4 matrix of F over (x, y, z, 1)."""
    F = np.zeros((4, 4))
    F[:3, :3] = _floats(quadric.matrix)
    F[:3, 3] = F[3, :3] = _floats([quadric.linear])[0]
    F[3, 3] = float(quadric.constant)
    return F


def _quadric_side(F: Floats, points: Floats) -> Floats:
    """F over the sum of the magnitudes of its terms, (N,)."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    terms = homogeneous[:, :, None] * F * homogeneous[:, None, :]
    return _ratio(terms.sum(axis=(1, 2)), np.abs(terms).sum(axis=(1, 2)))


def _plane_sides(planes: Floats, points: Floats) -> Floats:
    """Distances from unit planes over the sizes they were made of, (N, m)."""
    reach = np.abs(points).sum(axis=1, keepdims=True) + np.abs(planes[:, 3])
    return _ratio(points @ planes[:, :3].T - planes[:, 3], reach)


def _vertices(planes: Floats) -> Floats:
    """Vertices (v, 3) of an intersection of half-spaces with unit normals, with repetitions.

    They are the ends of its edges: the line in which two planes meet, clipped by all the others.
    """
    found = [np.empty((0, 3))]
    normals, offsets = planes[:, :3], planes[:, 3]
    for k in range(len(planes)):
        along = np.cross(normals[k], normals[k + 1 :])
        square = (along**2).sum(axis=1)
        regular = square > 1e-20
        along, square, other = along[regular], square[regular, None], planes[k + 1 :][regular]
        foot = offsets[k] * np.cross(other[:, :3], along) - other[:, 3:] * np.cross(
            normals[k], along
        )
        foot /= square
        slope, room = along @ normals.T, offsets - foot @ normals.T
        # A plane through the line, the two it lies in among them, does not clip it.
        size = np.abs(foot).sum(axis=1, keepdims=True) + np.abs(offsets)
        crosses = np.abs(slope) > 1e-12
        step = room / np.where(crosses, slope, 1.0)
        last = np.where(crosses & (slope > 0), step, np.inf).min(axis=1)
        first = np.where(crosses & (slope < 0), step, -np.inf).max(axis=1)
        slack = 1e-9 * (size.max(axis=1) / np.sqrt(square[:, 0]))
        edge = (first <= last + slack) & np.all(crosses | (room >= -1e-9 * size), axis=1)
        for end in (first, last):
            kept = edge & np.isfinite(end)
            found.append(foot[kept] + end[kept, None] * along[kept])
    return np.concatenate(found)


def _tangent_points(F: Floats, planes: Floats, rotation: Floats) -> Iterable[Floats]:
    """Where F = 0, alone or within one or two of the planes, is extreme along a world axis.

    A compact solid attains its extent at such points or at vertices. Where the extent is attained
    along a whole curve, the curve's own extremes along an arbitrary direction stand for it.
    """
    arbitrary = np.array([0.48, -0.6, 0.64])
    for count in range(3):
        for subset in combinations(range(len(planes)), count):
            normals = planes[list(subset), :3]
            _, singular, rows = np.linalg.svd(normals.reshape(-1, 3))
            if count and singular.min() < 1e-12:
                continue
            basis = rows[count:].T
            foot = np.linalg.pinv(normals) @ planes[list(subset), 3] if count else np.zeros(3)
            within = np.zeros((4, 4 - count))
            within[:3, :-1], within[:3, -1], within[3, -1] = basis, foot, 1.0
            restricted = within.T @ F @ within
            for direction in (*rotation, arbitrary):
                yield _extremes(restricted, basis.T @ direction) @ basis.T + foot


def _extremes(F: Floats, direction: Floats) -> Floats:
    """Points (0 to 2, d) of F = 0 in d dimensions whose gradient is along a direction."""
    none = np.empty((0, len(direction)))
    if np.abs(direction).max() < 1e-9:
        return none
    # M y - λ g = -q is a line of (y, λ) unless the extreme is attained along a curve.
    size = np.abs(F[:-1, :-1]).max()
    pencil = np.column_stack([F[:-1, :-1], -direction * (size if size > 0 else 1.0)])
    _, singular, rows = np.linalg.svd(pencil)
    if singular.min() <= 1e-12 * singular.max():
        return none
    foot = (np.linalg.pinv(pencil) @ -F[:-1, -1])[:-1]
    along = rows[-1, :-1]
    p, w = np.append(foot, 1.0), np.append(along, 0.0)
    a, b, c = w @ F @ w, p @ F @ w, p @ F @ p
    if abs(a) * (p @ p) <= 1e-14 * np.abs(F).max():
        steps = np.array([-c / (2 * b)]) if b != 0 else np.zeros(1)
    else:
        steps = (-b + np.array([-1.0, 1.0]) * np.sqrt(max(b * b - a * c, 0.0))) / a
    return foot + steps[:, None] * along


def _is_bounded(F: Floats, planes: Floats) -> bool:
    """Whether {F <= 0 and all half-spaces} has no direction to infinity.

    The directions tried are those in which such a cone can end, the axes of the quadric, and a
    few thousand spread over the sphere.
    """
    matrix, linear = F[:3, :3], F[:3, 3]
    axes = np.linalg.eigh(matrix)[1].T
    normals = planes[:, :3]
    tried = [axes, np.random.default_rng(1998).normal(size=(4096, 3))]
    tried += [np.cross(normals[[a]], normals[[b]]) for a, b in combinations(range(len(planes)), 2)]
    for normal in normals:
        # Where the asymptotic cone meets the plane through its apex.
        basis = np.linalg.svd(normal[None, :])[2][1:]
        small = basis @ matrix @ basis.T
        values, vectors = np.linalg.eigh(small)
        if values[0] <= 0 <= values[1]:
            u, v = np.sqrt(values[1]), np.sqrt(-values[0])
            tried.append(np.array([[u, v], [u, -v]]) @ vectors.T @ basis)
        tried.append(vectors.T @ basis)
    directions = np.concatenate(tried)
    length = np.linalg.norm(directions, axis=1)
    directions = directions[length > 1e-12] / length[length > 1e-12, None]
    directions = np.concatenate([directions, -directions])
    size = np.abs(matrix).max()
    bend = np.einsum("ni,ij,nj->n", directions, matrix, directions)
    tilt = np.linalg.norm(directions @ matrix, axis=1)
    flat = (np.abs(bend) <= 1e-12 * size) & (tilt <= 1e-12 * size)
    recedes = np.where(flat, directions @ linear <= 1e-12 * np.abs(F).max(), bend <= 1e-12 * size)
    recedes &= np.all(directions @ normals.T <= 1e-12, axis=1)
    return not recedes.any()


def _screen_box(
    box: tuple[Floats, Floats] | None, view: _View
) -> tuple[float, float, float, float] | None:
    """Least and greatest i, then j, that can see a world box, a pixel wider; None for all."""
    if box is None:
        return None
    if not np.all(box[0] <= box[1]):
        return (0.0, -1.0, 0.0, -1.0)
    slack = 1e-6 * np.abs(box[1] - box[0]).max()
    corners = [
        [float(v) for v in view.in_camera(_vector(corner))]
        for corner in product(*zip(box[0] - slack, box[1] + slack, strict=True))
    ]
    right, down, depth = np.array(corners).T
    if view.parallel:
        depth = np.ones_like(depth)
    if depth.min() <= 0:
        return None
    pitch = float(view.pitch)
    i = right / (depth * pitch) + (view.width - 1) / 2
    j = down / (depth * pitch) + (view.height - 1) / 2
    return (i.min() - 1, i.max() + 1, j.min() - 1, j.max() + 1)
