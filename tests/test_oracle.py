"""The oracle against itself at 400 bits, against sampling, and against cases done by hand.

The reference below shares no formula with the oracle: it works in the world, finds each quadratic
by interpolation, and decides which piece of a ray is inside by testing the middles of the pieces.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Floats
from halfstep.scene import Scene, Solid
from tests.oracle import ESCALATE, MP, Double, DoubleDouble, Extended, Oracle, Trace
from tests.scenes_random import KINDS

Table = dict[str, Any]

SIZE = (32, 24)


def _scene(
    solids: list[Table],
    center: Any = (0.0, -8.0, 0.0),
    look_at: Any = (0.0, 0.0, 0.0),
    fov_degrees: float = 45.0,
    volume: Table | None = None,
) -> Scene:
    tables: Table = {
        "format": 1,
        "camera": {
            "center": [float(v) for v in center],
            "look_at": [float(v) for v in look_at],
            "fov_degrees": fov_degrees,
        },
        "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
    }
    if volume is not None:
        tables["volume"] = volume
    return Scene.from_dict(tables)


def _at(
    solid: Table, center: Any, i: float, j: float, *, volume: Table | None = None
) -> tuple[int, float, float, float]:
    """Surface, depth, depth_exit and margin of one pixel of a 5×5 picture, 90° wide."""
    scene = _scene([solid], center=center, fov_degrees=90.0, volume=volume)
    trace = Oracle(scene, (5, 5)).trace((i, j))
    return (
        int(trace.surface),
        float(trace.depth),
        float(trace.depth_exit),
        float(trace.margin),
    )


# ------------------------------------------------------------------------------ reference


def _rotation(solid: Solid) -> Any:
    """world_from_local as a matrix: Rz·Ry·Rx, or the shortest turn of Z onto the axis."""
    if solid.axis is not None:
        axis = MP.matrix(solid.axis)
        axis /= MP.norm(axis)
        if axis[2] == -1:
            return MP.diag([1, -1, -1])
        x, y, z = axis
        skew = MP.matrix([[0, 0, x], [0, 0, y], [-x, -y, 0]])
        return MP.eye(3) + skew + skew * skew / (1 + z)
    rotation = MP.eye(3)
    for axis, degrees in enumerate(solid.rotation_degrees or (0.0, 0.0, 0.0)):
        a, b = [k for k in range(3) if k != axis]
        turn = MP.eye(3)
        turn[a, a] = turn[b, b] = MP.cospi(MP.mpf(degrees) / 180)
        sine = MP.sinpi(MP.mpf(degrees) / 180) * (-1 if axis == 1 else 1)
        turn[b, a], turn[a, b] = sine, -sine
        rotation = turn * rotation
    return rotation


def _surface_values(solid: Solid, p: Any) -> list[tuple[int, Any]]:
    """(surface number, value) of everything that bounds a solid, at a local point; <= 0 inside."""
    x, y, z = p
    if solid.kind == "box":
        return [
            (2 * axis + 1 + side, sign * p[axis] - solid.size[axis] / 2)
            for axis in range(3)
            for side, sign in enumerate((-1, 1))
        ]
    if solid.kind == "polyhedron":
        rows = enumerate(solid.rows, start=1)
        return [(k, a * x + b * y + c * z - d) for k, (a, b, c, d) in rows]
    assert solid.kind != "plane"
    planes = [] if solid.z_min is None else [solid.z_min - z]
    planes += [] if solid.z_max is None else [z - solid.z_max]
    planes += [a * x + b * y + c * z - d for a, b, c, d in solid.cut]
    return [(0, _quadric_value(solid, x, y, z)), *enumerate(planes, start=1)]


def _quadric_value(solid: Solid, x: Any, y: Any, z: Any) -> Any:
    """F by the table of kinds; for numbers of `MP` and for arrays."""
    if solid.kind == "sphere":
        return (x / solid.radius) ** 2 + (y / solid.radius) ** 2 + (z / solid.radius) ** 2 - 1
    if solid.kind == "ellipsoid":
        a, b, c = solid.semi_axes
        return (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1
    if solid.kind == "cylinder":
        return (x / solid.radius) ** 2 + (y / solid.radius) ** 2 - 1
    if solid.kind == "cone":
        return x * x + y * y - (solid.slope * z) ** 2
    if solid.kind == "hyperboloid_one_sheet":
        return (x / solid.waist) ** 2 + (y / solid.waist) ** 2 - (z / solid.c) ** 2 - 1
    if solid.kind == "hyperboloid_two_sheets":
        return (x / solid.a) ** 2 + (y / solid.a) ** 2 - (z / solid.c) ** 2 + 1
    if solid.kind == "paraboloid":
        return (x / solid.a) ** 2 + (y / solid.a) ** 2 - z
    assert solid.kind == "quadric"
    xx, yy, zz, xy, xz, yz, u, v, w, one = solid.coefficients
    return (
        xx * x * x + yy * y * y + zz * z * z + xy * x * y + xz * x * z + yz * y * z
        + (u * x + v * y + w * z + one)
    )  # fmt: skip


@dataclass(frozen=True)
class _Reference:
    """Solid, surface, depth and depth_exit of one ray; -1 and nan for a miss."""

    solid: int
    surface: int
    depth: Any
    depth_exit: Any


_MISS = _Reference(-1, -1, MP.nan, MP.nan)


class _World:
    """A scene in 400 bits."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self.scene, self.size = scene, size
        camera = scene.camera
        self.eye = MP.matrix(camera.center)
        forward = MP.matrix(camera.look_at) - self.eye
        self.forward = forward / MP.norm(forward)
        right = self._cross(self.forward, MP.matrix(camera.up))
        self.right = right / MP.norm(right)
        self.down = self._cross(self.forward, self.right)
        self.k = MP.tan(MP.mpf(camera.fov_degrees) * MP.pi / 360)
        self.rotations = [_rotation(solid) for solid in scene.solids]
        # Without a volume no bounded solid is cut; the far base plane lies beyond them all.
        self.near, self.far = MP.mpf(0), MP.mpf(10) ** 12
        if scene.volume is not None:
            low, high = scene.volume.min, scene.volume.max
            depths = [
                (self.forward.T * (MP.matrix([x, y, z]) - self.eye))[0]
                for x in (low[0], high[0])
                for y in (low[1], high[1])
                for z in (low[2], high[2])
            ]
            self.near, self.far = max(MP.mpf(0), min(depths)), max(depths)

    @staticmethod
    def _cross(a: Any, b: Any) -> Any:
        return MP.matrix(
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        )

    def direction(self, i: float, j: float) -> Any:
        width, height = self.size
        x = ((2 * MP.mpf(i) + 1) / width - 1) * self.k * width / height
        y = ((2 * MP.mpf(j) + 1) / height - 1) * self.k
        return self.forward + x * self.right + y * self.down

    def trace(self, i: float, j: float) -> _Reference:
        hits = [self.trace_solid(k, i, j) for k in range(len(self.scene.solids))]
        return min((hit for hit in hits if hit.solid >= 0), key=lambda h: h.depth, default=_MISS)

    def trace_solid(self, index: int, i: float, j: float) -> _Reference:
        solid, rotation = self.scene.solids[index], self.rotations[index]
        direction = self.direction(i, j)
        offset = self.eye - MP.matrix(solid.origin)
        start, step = rotation.T * offset, rotation.T * direction
        if solid.kind == "plane":
            return self._trace_patch(index, start[2], step[2], direction, rotation)

        def values(t: Any) -> list[tuple[int, Any]]:
            return _surface_values(solid, [start[k] + t * step[k] for k in range(3)])

        crossings = []
        middle = MP.mpf(float(-(start.T * step)[0] / (step.T * step)[0]))
        samples = [values(middle + d) for d in (-1, 0, 1)]
        for (number, low), (_, mid), (_, high) in zip(*samples, strict=True):
            A, B, C = (high + low) / 2 - mid, (high - low) / 2, mid
            if abs(A) < MP.mpf(2) ** -250 * (abs(low) + abs(high)):
                roots = [-C / B] if B != 0 else []
            else:
                D = B * B - 4 * A * C
                roots = [(-B + s * MP.sqrt(D)) / (2 * A) for s in (-1, 1)] if D >= 0 else []
            crossings += [(middle + root, number) for root in roots]
        inner = sorted(c for c in crossings if self.near < c[0] < self.far)
        ends = [(self.near, -1), *inner, (self.far, -1)]
        inside = [
            all(value <= 0 for _, value in values((a + b) / 2)) for (a, _), (b, _) in pairwise(ends)
        ]
        if True not in inside:
            return _MISS
        first = inside.index(True)
        last = inside.index(False, first) if False in inside[first:] else len(inside)
        if first == 0:
            depth, surface = ends[last]
            return _Reference(index, surface, depth, depth) if surface >= 0 else _MISS
        return _Reference(index, ends[first][1], ends[first][0], ends[last][0])

    def _trace_patch(
        self, index: int, height: Any, slope: Any, direction: Any, rotation: Any
    ) -> _Reference:
        solid = self.scene.solids[index]
        assert solid.kind == "plane"
        if slope == 0:
            return _MISS
        t = -height / slope
        point = self.eye + t * direction
        for axis in range(3):
            others = [abs(rotation[k, 2]) for k in range(3) if k != axis]
            if max(others) > MP.mpf("1e-9") and not (
                solid.bounds.min[axis] <= point[axis] <= solid.bounds.max[axis]
            ):
                return _MISS
        return _Reference(index, 0, t, t) if self.near <= t <= self.far else _MISS


# ------------------------------------------------------------------------------ random scenes


def _shape(kind: str, size: float, rng: np.random.Generator, bounded: bool) -> Table:
    """A solid of a kind that reaches about `size` from its origin."""

    def length(low: float = 0.3, high: float = 1.0) -> float:
        return float(size * rng.uniform(low, high))

    shapes: dict[str, Table] = {
        "sphere": {"radius": length()},
        "ellipsoid": {"semi_axes": [length(), length(), length()]},
        "cylinder": {"radius": length()},
        "cone": {"slope": float(rng.uniform(0.2, 1.5))},
        "hyperboloid_one_sheet": {"waist": length(0.2, 0.6), "c": length()},
        "hyperboloid_two_sheets": {"a": length(), "c": length(0.1, 0.4)},
        "paraboloid": {"a": float(np.sqrt(length()))},
        "quadric": {"coefficients": [*map(float, rng.normal(size=10))]},
        "box": {"size": [2 * length(), 2 * length(), 2 * length(0.01)]},
    }
    solid: Table = {"kind": kind, "origin": [float(v) for v in size * rng.normal(size=3)]}
    if kind == "plane":
        low = [o - length() for o in solid["origin"]]
        high = [o + length() for o in solid["origin"]]
        solid["bounds"] = {"min": low, "max": high}
    elif kind == "polyhedron":
        normals = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(4, 3))])
        solid["half_spaces"] = [[*map(float, n), length()] for n in normals]
    else:
        solid |= shapes[kind]
    if kind == "quadric":
        scales = [size**-2] * 6 + [1 / size] * 3 + [1.0]
        solid["coefficients"] = [c * s for c, s in zip(solid["coefficients"], scales, strict=True)]
    if kind in ("quadric", "cylinder") or (kind in KINDS[3:7] and bounded):
        solid |= {"z_min": -length(), "z_max": length()}
        if kind == "quadric":
            corners = [[x, y, 0.0, size] for x, y in ((1.0, 0.5), (-1.0, 0.3), (0.1, 1.0))]
            solid["cut"] = [*corners, [-0.2, -1.0, 0.1, size]]
    elif kind in KINDS[:8] and rng.random() < 0.3:
        solid["cut"] = [[*map(float, rng.normal(size=3)), length(-0.5, 0.5)]]
    if kind != "plane" and rng.random() < 0.5:
        solid["rotation_degrees"] = [float(v) for v in rng.uniform(-180, 180, 3)]
    else:
        solid["axis"] = [float(v) for v in rng.normal(size=3)]
    return solid


def _random_scene(kind: str, rng: np.random.Generator) -> Scene:
    """One solid, of size 1e-3..1e3, seen from within to 1e6 of its sizes away."""
    size = float(10 ** rng.uniform(-3, 3))
    near, far = ((0.01, 0.3), (0.3, 3.0), (3.0, 1e6))[rng.choice(3, p=(0.2, 0.2, 0.6))]
    distance = size * float(np.exp(rng.uniform(np.log(near), np.log(far))))
    bounded = bool(rng.random() < 0.5)
    solid = _shape(kind, size, rng, bounded)
    toward = rng.normal(size=3)
    center = np.array(solid["origin"]) + distance * toward / np.linalg.norm(toward)
    look_at = np.array(solid["origin"]) + 0.2 * size * rng.normal(size=3)
    volume = None
    if kind in KINDS[3:7] or rng.random() < 0.3:
        volume = {
            "min": [o - size * float(rng.uniform(0.2, 2)) for o in solid["origin"]],
            "max": [o + size * float(rng.uniform(0.2, 2)) for o in solid["origin"]],
        }
    fov = float(np.degrees(2 * np.arctan(1.2 * size / distance)))
    return _scene([solid], center, look_at, min(fov, 100.0), volume)


def _differences(trace: Trace, pixels: tuple[Floats, Floats], world: _World) -> list[str]:
    """Every ray on which the oracle and the reference disagree, in words."""
    wrong = []
    for n, (i, j) in enumerate(zip(*pixels, strict=True)):
        true = world.trace(i, j)
        ids = int(trace.solid[n]), int(trace.surface[n])
        text = f"({i!r}, {j!r}): {ids}, margin {trace.margin[n]:.1e}, reference {true}"
        if ids != (true.solid, true.surface):
            wrong.append(text)
        elif true.solid >= 0:
            grazing = max(1.0, ESCALATE / max(float(trace.margin[n]), 1e-30))
            for ours, exact in ((trace.depth, true.depth), (trace.depth_exit, true.depth_exit)):
                error = abs(float(MP.mpf(float(ours[n])) - exact))
                if error > 1e-12 * float(exact) * grazing:
                    wrong.append(f"{text}, off by {error:.1e}")
    return wrong


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_random_rays_agree_with_400_bits(kind: str) -> None:
    seed = KINDS.index(kind)
    rng = np.random.default_rng(seed)
    hits = inside = rays = 0
    for _ in range(20):
        scene = _random_scene(kind, rng)
        pixels = rng.uniform(0, SIZE[0], 14), rng.uniform(0, SIZE[1], 14)
        trace = Oracle(scene, SIZE).trace(pixels)
        assert _differences(trace, pixels, _World(scene, SIZE)) == [], f"seed {seed}"
        hits += int(np.sum(trace.solid >= 0))
        inside += int(np.sum(trace.depth == trace.depth_exit))
        rays += 14
    assert rays * 0.1 < hits < rays, f"{hits} of {rays} hit"
    assert inside >= 5, f"{inside} of {rays} rays start inside"


@pytest.mark.parametrize("kind", KINDS)
def test_float64_is_right_wherever_its_margin_says_so(kind: str) -> None:
    """Whole pictures in float64 alone against the same in double-double alone."""
    seed = 300 + KINDS.index(kind)
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(8):
        oracle = Oracle(_random_scene(kind, rng), SIZE)
        i, j = (v.ravel().astype(np.float64) for v in np.mgrid[0 : SIZE[0], 0 : SIZE[1]])
        plain, extended = (oracle.trace_in(level, (i, j)) for level in (Double, Extended))
        sure = plain.margin >= ESCALATE
        for name in ("solid", "surface"):
            wrong = sure & (getattr(plain, name) != getattr(extended, name))
            assert not wrong.any(), f"seed {seed}: {np.argwhere(wrong)}"
        hits += int(np.sum(plain.solid >= 0))
    assert hits > 500, f"{hits} hits"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_ties_are_decided_as_400_bits_do(kind: str) -> None:
    """Pairs of pixels a rounding apart, on either side of a silhouette or an edge."""
    seed = 100 + KINDS.index(kind)
    rng = np.random.default_rng(seed)
    pairs = escalated = 0
    for _ in range(4):
        scene = _random_scene(kind, rng)
        oracle = Oracle(scene, SIZE)
        # Lines from pixel to pixel whose ends differ are halved until doubles run out.
        i, j = rng.uniform(0, SIZE[0], (2, 40)), rng.uniform(0, SIZE[1], (2, 40))
        ends = [oracle.trace((i[side], j[side])).surface for side in range(2)]
        chosen = np.flatnonzero(ends[0] != ends[1])[:6]
        i, j, first = i[:, chosen], j[:, chosen], ends[0][chosen]
        for _ in range(54):
            middle = i.mean(axis=0), j.mean(axis=0)
            same = oracle.trace(middle).surface == first
            i = np.where([same, ~same], middle[0], i)
            j = np.where([same, ~same], middle[1], j)
        pixels = i.ravel(), j.ravel()
        trace = oracle.trace(pixels)
        assert _differences(trace, pixels, _World(scene, SIZE)) == [], f"seed {seed}"
        pairs += i.shape[1]
        escalated += int(np.sum(trace.margin < ESCALATE))
    assert pairs >= 10, f"{pairs} pairs"
    assert escalated >= pairs, f"{escalated} of {2 * pairs} rays near a tie"


def test_nearest_of_many_agrees_with_400_bits() -> None:
    rng = np.random.default_rng(7)
    solids = [_shape(kind, 1.0, rng, bounded=True) for kind in KINDS]
    volume = {"min": [-4.0] * 3, "max": [4.0] * 3}
    scene = _scene(solids, (5.0, -6.0, 3.0), (0.3, 0.0, 0.5), 30.0, volume)
    pixels = rng.uniform(0, SIZE[0], 80), rng.uniform(0, SIZE[1], 80)
    trace = Oracle(scene, SIZE).trace(pixels)
    assert _differences(trace, pixels, _World(scene, SIZE)) == []
    assert len(set(trace.solid.tolist())) >= 8


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "plane"])
@pytest.mark.slow
def test_points_along_rays_are_inside_where_the_oracle_says(kind: str) -> None:
    """Samples of the solid's own inequalities, 400 to a ray."""
    seed = 200 + KINDS.index(kind)
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(10):
        solid = _shape(kind, 1.0, rng, bounded=True)
        center = np.array(solid["origin"]) + rng.normal(size=3) * 2.0
        volume = {"min": [-9.0] * 3, "max": [9.0] * 3}
        scene = _scene([solid], center, solid["origin"], 70.0, volume)
        oracle, world = Oracle(scene, SIZE), _World(scene, SIZE)
        trace = oracle.trace()
        depth = oracle.near_depth + (np.arange(400) + 0.5) / 400 * (
            oracle.far_depth - oracle.near_depth
        )
        rotation = np.array(world.rotations[0].tolist(), dtype=np.float64)
        axes = np.array([list(v) for v in (world.right, world.down, world.forward)], np.float64)
        j, i = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
        k = float(world.k)
        x = ((2 * i + 1) / SIZE[0] - 1) * k * SIZE[0] / SIZE[1]
        y = ((2 * j + 1) / SIZE[1] - 1) * k
        direction = np.stack([x, y, np.ones_like(x)], axis=-1) @ axes
        point = center + depth[:, None, None, None] * direction - np.array(solid["origin"])
        local = np.moveaxis(point @ rotation, -1, 0)
        values = [np.asarray(value, np.float64) for _, value in _surface_values(
            scene.solids[0], local)]  # fmt: skip
        inside = np.max(values, axis=0) <= 0
        starts = trace.depth == trace.depth_exit
        entry = np.where(starts, oracle.near_depth, trace.depth)
        ahead = depth[:, None, None] - trace.depth_exit
        between = (depth[:, None, None] > entry) & (ahead < 0)
        hit = trace.solid >= 0
        assert np.all(inside[between]), f"seed {seed}"
        assert not np.any(inside[(depth[:, None, None] < entry) & hit]), f"seed {seed}"
        missed = inside[:, ~hit]
        # Inside from one base plane to the other, a ray leaves nothing to show.
        assert np.all(missed.all(axis=0) | ~missed.any(axis=0)), f"seed {seed}"
        hits += int(hit.sum())
    assert hits > 200, f"{hits} hits"


# ------------------------------------------------------------------------------ by hand


def test_sphere_head_on() -> None:
    sphere = {"kind": "sphere", "origin": [0.0, 0.0, 0.0], "radius": 2.0}
    surface, depth, leave, _ = _at(sphere, (0, -8, 0), 2, 2)
    assert (surface, depth, leave) == (0, 6.0, 10.0)


@pytest.mark.parametrize("size", [5, 7, 9])
def test_a_dot_far_below_a_pixel_costs_no_digit(size: int) -> None:
    radius = 1e-6
    oracle = Oracle(_scene([{"kind": "sphere", "radius": radius}], fov_degrees=90.0), (size, size))
    middle = np.array([size // 2])
    trace = oracle.trace_in(Double, (middle, middle))
    assert trace.solid.tolist() == [0]
    assert abs(trace.depth[0] - (8.0 - radius)) <= 2 * np.spacing(8.0)


def test_sphere_tangent_is_a_hit_and_a_tie() -> None:
    # Directions of a 5x5 picture 90° wide are multiples of 0.4; 3-4-5: the ray of slope 0.75
    # touches the sphere of radius 3 from 5 away, at depth 4·4/5.
    sphere = {"kind": "sphere", "origin": [0.0, 0.0, 0.0], "radius": 3.0}
    i = 2 + 0.75 / 0.4
    assert i == 3.875
    surface, depth, _, margin = _at(sphere, (0, -5, 0), i, 2)
    assert (surface, margin) == (0, 0.0)
    assert depth == pytest.approx(3.2, abs=1e-14)
    assert _at(sphere, (0, -5, 0), np.nextafter(i, 9), 2)[0] == -1
    assert _at(sphere, (0, -5, 0), np.nextafter(i, 0), 2)[0] == 0


def test_cube_corner_is_the_plane_of_smallest_number() -> None:
    # Seen along its diagonal, the corner of a cube lies in the middle of the picture.
    cube = {"kind": "box", "origin": [0.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0]}
    surface, depth, leave, margin = _at(cube, (5, 5, 5), 2, 2)
    assert (surface, margin) == (2, 0.0)
    assert (depth, leave) == pytest.approx((4 * 3**0.5, 6 * 3**0.5), rel=1e-15)


def test_cone_apex() -> None:
    # Two nappes along the view: the ray down the axis is inside from eye to far base plane.
    cone = {"kind": "cone", "origin": [0.0, 0.0, 0.0], "slope": 0.5, "axis": [0.0, 1.0, 0.0]}
    volume = {"min": [-4.0, -4.0, -4.0], "max": [4.0, 4.0, 4.0]}
    assert _at(cone, (0, -8, 0), 2, 2, volume=volume)[0] == -1
    # Upright, that ray meets the apex alone: a touch.
    upright = {**cone, "axis": [0.0, 0.0, 1.0]}
    surface, depth, leave, margin = _at(upright, (0, -8, 0), 2, 2, volume=volume)
    assert (surface, depth, leave, margin) == (0, 8.0, 8.0, 0.0)
    assert _at(upright, (0, -8, 0), 2.25, 2, volume=volume)[0] == -1


def test_ray_along_an_asymptote() -> None:
    # In the plane x = 0 the ray y = -3 + t, z = t of slope 1 has A = 0 for y² - z² <= 1:
    # F = 8 - 6t, a single root at t = 4/3, then inside for ever.
    waist = {
        "kind": "hyperboloid_one_sheet",
        "origin": [0.0, 0.0, 0.0],
        "waist": 1.0,
        "c": 1.0,
    }
    volume = {"min": [-2.0, -4.0, -2.0], "max": [2.0, 4.0, 2.0]}
    surface, depth, leave, _ = _at(waist, (0, -3, 0), 2, 2 - 1 / 0.4, volume=volume)
    assert surface == 0
    assert depth == pytest.approx(4 / 3, rel=1e-15)
    assert leave == 7.0


def test_parallel_to_a_paraboloid_axis() -> None:
    # F = x² + y² - z along the axis is linear; the eye looks down it from inside, below or above.
    bowl = {"kind": "paraboloid", "origin": [0.0, 0.0, 0.0], "a": 1.0, "axis": [0.0, -1.0, 0.0]}
    volume = {"min": [-9.0, -9.0, -9.0], "max": [9.0, 9.0, 9.0]}
    assert _at(bowl, (0.5, -8, 0), 2, 2, volume=volume)[0] == 0
    surface, depth, leave, _ = _at(bowl, (0, -8, 0), 2, 2, volume=volume)
    assert (surface, depth, leave) == (0, 8.0, 8.0)


def test_eye_on_a_face_looks_through_the_solid() -> None:
    cube = {"kind": "box", "origin": [0.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0]}
    surface, depth, leave, margin = _at(cube, (0, -1, 0), 2, 2)
    assert (surface, depth, leave, margin) == (4, 2.0, 2.0, 0.0)


def test_face_on_the_near_base_plane_is_seen() -> None:
    cube = {"kind": "box", "origin": [0.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0]}
    for volume in (None, {"min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0]}):
        surface, depth, leave, _ = _at(cube, (0, -5, 0), 2, 2, volume=volume)
        assert (surface, depth, leave) == (3, 4.0, 6.0)


def test_near_base_plane_cuts_a_sphere_open() -> None:
    sphere = {"kind": "sphere", "origin": [0.0, 0.0, 0.0], "radius": 2.0}
    volume = {"min": [-2.0, -1.0, -2.0], "max": [2.0, 1.0, 2.0]}
    # The ray in the middle is inside from one base plane to the other; one beside it leaves at F.
    assert _at(sphere, (0, -8, 0), 2, 2, volume=volume)[0] == -1
    scene = _scene([sphere], volume=volume)
    oracle = Oracle(scene, (200, 200))
    assert (oracle.near_depth, oracle.far_depth) == (7.0, 9.0)
    trace = oracle.trace()
    both = trace.depth == trace.depth_exit
    assert both.any()
    assert np.all((trace.depth[both] >= 7) & (trace.depth[both] <= 9))


def test_exit_beyond_the_far_base_plane_is_far() -> None:
    sphere = {"kind": "sphere", "origin": [0.0, 0.0, 0.0], "radius": 2.0}
    volume = {"min": [-2.0, -3.0, -2.0], "max": [2.0, 1.0, 2.0]}
    assert _at(sphere, (0, -8, 0), 2, 2, volume=volume)[:3] == (0, 6.0, 9.0)


def test_patch_bounds_are_closed_and_both_sides_are_seen() -> None:
    patch = {
        "kind": "plane",
        "origin": [0.0, 0.0, 0.0],
        "axis": [0.0, 1.0, 0.0],
        "bounds": {"min": [-2.0, 5.0, -2.0], "max": [2.0, 6.0, 2.0]},
    }
    # The bound along the normal does not count. The ray of slope 0.4 lands on x = 2.
    for center in ((0, -5, 0), (0, 5, 0)):
        assert _at(patch, center, 2, 2)[:3] == (0, 5.0, 5.0)
        assert _at(patch, center, 3.25, 2)[0] == -1
    edge = {**patch, "bounds": {"min": [-2.5, 0.0, -2.5], "max": [2.5, 0.0, 2.5]}}
    surface, _, _, margin = _at(edge, (0, -5, 0), 3.25, 2)
    assert (surface, margin) == (0, 0.0)
    assert _at(edge, (0, -5, 0), np.nextafter(3.25, 4), 2)[0] == -1


def test_first_of_two_coincident_solids_is_seen() -> None:
    cube = {"kind": "box", "origin": [0.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0]}
    long_cube = {**cube, "size": [2.0, 2.0, 4.0]}
    oracle = Oracle(_scene([cube, long_cube]), (40, 40))
    trace = oracle.trace()
    front = trace.depth == 7.0
    assert np.sum(front & (trace.solid == 0)) > 100
    assert np.all(trace.margin[front & (trace.solid == 0)] == 0)
    alone = oracle.trace_solid(1)
    assert np.all((trace.solid == 1) == ((alone.solid >= 0) & (trace.solid != 0)))
    assert np.all(alone.solid[alone.solid >= 0] == 1)


def test_stable_ids_set_edges_aside_and_nothing_else() -> None:
    cube = {"kind": "box", "origin": [0.0, 0.0, 0.0], "size": [2.0, 2.0, 2.0]}
    oracle = Oracle(_scene([cube], (4.0, -7.0, 3.0)), (80, 60))
    ids = oracle.trace().surface
    stable = oracle.stable_ids(0.5)
    inner = np.ones_like(stable)
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        inner &= np.roll(ids, step, axis) == ids
    # Only the tip of a corner can pass between the pixels.
    assert np.sum(~stable[inner]) <= 7
    assert 100 < np.sum(~stable) < 600
    assert np.all(oracle.stable_ids(1e-9))


# ------------------------------------------------------------------------------ parts


def test_screen_boxes_lose_nothing() -> None:
    rng = np.random.default_rng(11)
    hits = 0
    for _ in range(6):
        solids = [_shape(kind, 1.0, rng, bounded=True) for kind in KINDS]
        scene = _scene(solids, rng.normal(size=3) * 6, fov_degrees=60.0)
        oracle, whole = Oracle(scene, (64, 48)), Oracle(scene, (64, 48))
        assert sum(body._screen_box is not None for body in oracle._solids) >= 4
        for body in whole._solids:
            body._screen_box = None
        np.testing.assert_array_equal(oracle.trace().solid, whole.trace().solid)
        hits += int(np.sum(oracle.trace().solid >= 0))
    assert hits > 5000, f"{hits} hits"


def test_default_base_planes_touch_the_bounded_solids() -> None:
    ball = {"kind": "sphere", "origin": [0.0, 0.0, 0.0], "radius": 1.0}
    cap = {**ball, "cut": [[0.0, 1.0, 0.0, 0.5]]}
    cone = {"kind": "cone", "origin": [0.0, 3.0, 0.0], "slope": 0.5, "z_min": 0.0, "z_max": 2.0}
    rod = {"kind": "cylinder", "origin": [0.0, 0.0, 0.0], "radius": 0.2}
    wedge = {
        "kind": "polyhedron",
        "origin": [0.0, 0.0, 0.0],
        "half_spaces": [[0, 0, 1, 1], [0, 0, -1, 1], [1, 0, 0, 1], [-1, 1, 0, 2], [-1, -1, 0, 2]],
    }
    for solids, interval in (
        ([ball], (7.0, 9.0)),
        ([wedge], (5.0, 11.0)),
        ([cap], (7.0, 8.5)),
        ([ball, cone], (7.0, 12.0)),
        ([ball, rod], (7.0, 9.0)),
    ):
        oracle = Oracle(_scene(solids), SIZE)
        assert (oracle.near_depth, oracle.far_depth) == pytest.approx(interval, rel=1e-12)
    along_view = {**rod, "axis": [0.3, 1.0, 0.0]}
    trace = Oracle(_scene([ball, along_view]), (200, 200)).trace()
    assert np.nanmin(trace.depth) >= 7.0
    assert np.any(trace.solid == 1)


def test_double_double_has_a_hundred_bits() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=(2, 200)) * 2.0 ** rng.integers(-40, 40, (2, 200))
    a, b = (DoubleDouble(v, v * rng.uniform(-1, 1, 200) * 2.0**-54) for v in values)

    def exact(x: DoubleDouble) -> list[Any]:
        return [MP.mpf(float(hi)) + MP.mpf(float(lo)) for hi, lo in zip(x.hi, x.lo, strict=True)]

    for x, y in combinations((a, b, a * a), 2):
        for got, want in (
            (x + y, [p + q for p, q in zip(exact(x), exact(y), strict=True)]),
            (x * y, [p * q for p, q in zip(exact(x), exact(y), strict=True)]),
            (x / y, [p / q for p, q in zip(exact(x), exact(y), strict=True)]),
        ):
            scale = [abs(p) for p in want]
            error = [abs(g - w) / s for g, w, s in zip(exact(got), want, scale, strict=True)]
            assert max(error) < 2.0**-98
