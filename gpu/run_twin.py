"""A band of a frame in NumPy: the same stages in the same order as the shader of ``source``."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.layout import TILE, Flag
from halfstep.pack import Class, Packed, frame_record, srgb_table
from halfstep.scene import Scene
from halfstep.twin import (
    article,
    encode,
    halve,
    halve_incremental,
    nearest,
    normal,
    patch,
    piece,
    polynomial,
    polynomial_exact,
    ray,
    root,
    shade,
)

Planes = dict[str, NDArray[Any]]

_FAR = np.uint32(0xFFFFFFFF)


class Band:
    """The nearest visible points of the pixels of a band, and the solid being tried."""

    def __init__(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        method: str,
        outputs: frozenset[str],
    ) -> None:
        self.packed = packed
        self.first_row, self.method, self.outputs = first_row, method, outputs
        self.frame = frame_record(scene, packed.setup, first_row, rows)[0]
        self.forms: ModuleType = polynomial_exact if packed.exact else polynomial
        self.halve = halve_incremental.halve if packed.exact else halve.halve
        shape = self.shape = (rows, packed.setup.view.width)
        self.key = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.leaves = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.surface = np.zeros(shape, np.uint32)
        self.slope = normal.Vector(*(np.zeros(shape, np.float32) for _ in range(3)))
        self.depth = np.zeros(shape, np.float32)
        self.solid = np.zeros(shape, np.int64)  # row of ``packed.solids``

    def visit(self, row: int) -> None:
        """Try a solid, a row of ``packed.solids``, on all pixels of the tiles it may be seen in."""
        solid, klass = self.packed.solids[row], Class(int(self.packed.classes[row]))
        i0, i1, j0, j1 = self.packed.setup.rectangle[self.packed.order[row]]
        rows, width = self.shape
        top = max((j0 - self.first_row) // TILE * TILE, 0)
        bottom = min(((j1 - self.first_row) // TILE + 1) * TILE, rows)
        left, right = i0 // TILE * TILE, min((i1 // TILE + 1) * TILE, width)
        if top >= bottom:
            return
        window = np.s_[top:bottom, left:right]
        y, x = np.mgrid[top:bottom, left:right].astype(np.int32)
        x -= solid["center_x"]
        y += np.int32(self.first_row) - solid["center_y"]
        at = self.forms.offset(x, y)
        lines = [
            article.Line(self.forms.linear(row["c"], at), self.forms.linear(row["b"], at))
            for row in self._half_spaces(solid)
        ]
        method = self._article if self.method == "article" else self._visible
        found = method(solid, klass, at, lines)
        u = found.position.astype(np.float32) * solid["last_step"]
        slope = normal.gradient(solid["gradient"], x.astype(np.float32), y.astype(np.float32), u)
        for number, half_space in enumerate(self._half_spaces(solid), start=1):
            if klass is not Class.PATCH:
                slope = _replaced(slope, half_space["normal"], found.surface == number)
            elif number == 1:
                away = lines[0].b > 0
                slope = _replaced(
                    _replaced(slope, half_space["normal"], ~away), -half_space["normal"], away
                )
        nearer = self._keep(window, solid, found, slope, u)
        self.solid[window][nearer] = row

    def _half_spaces(self, solid: np.void) -> NDArray[np.void]:
        start = int(solid["plane_start"])
        return self.packed.half_spaces[start : start + int(solid["plane_count"])]

    def _visible(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[article.Line]
    ) -> article.Found:
        """The joint logic first, then one sequence (and one more for the exit)."""
        steps = int(solid["steps"])
        if klass is Class.PATCH:
            (plane_c, plane_b), *bounds = lines
            plane = patch.facing(plane_c, plane_b, solid["near_u"], solid["far_u"])
            for line in bounds:
                plane = patch.bound(plane, line.c, line.b)
            seen = leaving = root.patch_entry(plane.hit, plane.c, plane.b)
        elif klass is Class.ELLIPSOID:
            forms = [self.forms.quadratic(solid[name], at) for name in "agc"]
            seen, leaving = root.ellipsoid_entry(*forms), root.ellipsoid_exit(*forms)
        else:
            seen, leaving = self._cut(solid, klass, at, lines)
        position = self.halve(seen, steps)
        exit_position = self.halve(leaving, steps) if "exit" in self.outputs else position
        return article.Found(seen.hit, seen.surface, position, leaving.hit, exit_position)

    def _cut(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[article.Line]
    ) -> tuple[root.Root, root.Root]:
        """Visible root and exit of a solid with half-spaces or base planes across it."""
        flags = Flag(int(solid["flags"]))
        part = piece.whole_interval(at.x + 0 * at.y, solid["near_u"], solid["far_u"])
        for number, line in enumerate(lines, start=1):
            part = piece.clip(part, line.c, line.b, number)
        if flags & Flag.EYE_INSIDE:
            part = piece.from_the_eye(part, solid["near_u"])
        opened = np.full(part.id_in.shape, bool(flags & Flag.EYE_INSIDE))
        at_near = bool(flags & Flag.NEAR_CUT) & (part.id_in == 0)
        if klass in (Class.POLYHEDRON, Class.POLYHEDRON_INSIDE):
            inside = opened | at_near
            leaving = root.polyhedron_exit(part)
            return root.choose(inside, root.polyhedron_entry(part), leaving), leaving
        a, g, c = (self.forms.quadratic(solid[name], at) for name in "agc")
        outside = root.outside_at_entry(a, g, c, part)
        if flags & Flag.STARTS_AT_EYE:
            outside = np.where(part.id_in == 0, bool(flags & Flag.EYE_OUTSIDE_QUADRIC), outside)
        inside = opened | (at_near & ~outside)
        leaving = root.quadric_exit(a, g, c, part, ~outside)
        return root.choose(inside, root.quadric_entry(a, g, c, part, outside), leaving), leaving

    def _article(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[article.Line]
    ) -> article.Found:
        """The paper's own sequences."""
        flags, steps = Flag(int(solid["flags"])), int(solid["steps"])
        base_planes = solid["near_u"], solid["far_u"]
        eye_inside = bool(flags & Flag.EYE_INSIDE)
        if klass is Class.PATCH:
            return article.article_patch(lines, *base_planes, steps)
        if klass in (Class.POLYHEDRON, Class.POLYHEDRON_INSIDE):
            return article.article_polyhedron(lines, *base_planes, eye_inside, steps)
        a, g, c = (self.forms.quadratic(solid[name], at) for name in "agc")
        outside = (a - g) + c > 0
        if flags & Flag.STARTS_AT_EYE:
            outside = np.full(a.shape, bool(flags & Flag.EYE_OUTSIDE_QUADRIC))
        return article.article_quadric(a, g, c, outside, lines, *base_planes, eye_inside, steps)

    def _keep(
        self,
        window: tuple[slice, slice],
        solid: np.void,
        found: article.Found,
        slope: normal.Vector,
        u: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """Keep the points that are nearer than the nearest so far; which they are."""
        steps, shift = int(solid["steps"]), int(solid["key_shift"])
        start = nearest.Key(solid["key_high"], solid["key_low"])
        key = nearest.depth_key(found.position, steps, start, shift)
        surface = solid["surface"] + found.surface.astype(np.uint32)
        old = nearest.Key(self.key.high[window], self.key.low[window])
        nearer = found.hit & nearest.before(key, surface, old, self.surface[window])
        self.key.high[window][nearer] = key.high[nearer]
        self.key.low[window][nearer] = key.low[nearer]
        self.surface[window][nearer] = surface[nearer]
        leaves = nearest.depth_key(found.exit_position, steps, start, shift)
        for words, exits in zip(self.leaves, leaves, strict=True):
            words[window][nearer] = np.where(found.left, exits, _FAR)[nearer]
        for component, value in zip(self.slope, slope, strict=True):
            component[window][nearer] = value[nearer]
        depth = solid["depth_middle"] + u * solid["depth_half"]
        self.depth[window][nearer] = depth[nearer]
        return np.asarray(nearer)

    def finish(self) -> Planes:
        """The requested outputs of all pixels."""
        planes: Planes = {"surface": self.surface}
        if "key" in self.outputs:
            planes["key"] = _joined(self.key)
        if "exit" in self.outputs:
            planes["exit"] = _joined(self.leaves)
        if not self.outputs & {"image", "color", "normal"}:
            return planes
        j, i = np.mgrid[: self.shape[0], : self.shape[1]].astype(np.int32)
        j += np.int32(self.first_row)
        some = self.surface > 0
        direction = ray.ray_direction(self.frame, i.astype(np.float32), j.astype(np.float32))
        forward = normal.normalized(direction, direction)
        to_eye = normal.Vector(-forward.x, -forward.y, -forward.z)
        unit = normal.normalized(self.slope, to_eye)
        if "normal" in self.outputs:
            planes["normal"] = np.stack(
                [np.where(some, component, np.float32(0)) for component in unit], axis=-1
            )
        if self.outputs & {"image", "color"}:
            lit = self._shade(unit, to_eye, direction) if len(self.packed.solids) else unit
            background = self.frame["background"]
            color = normal.Vector(*(np.where(some, lit[k], background[k]) for k in range(3)))
            planes["color"] = np.stack(color, axis=-1)
            if "image" in self.outputs:
                planes["image"] = encode.encode(srgb_table(), color)
        return planes

    def _shade(
        self, unit: normal.Vector, to_eye: normal.Vector, direction: normal.Vector
    ) -> normal.Vector:
        solids = self.packed.solids[self.solid]
        color = normal.Vector(*np.moveaxis(solids["color"], -1, 0))
        finish = shade.Finish(color, solids["specular"], solids["shininess"])
        lights = [shade.Light(row["vector"], row["color"]) for row in self.packed.lights]
        point = normal.scaled(direction, self.depth)
        return shade.shade(unit, to_eye, point, finish, self.frame["ambient"], lights)


def _replaced(
    old: normal.Vector, new: NDArray[np.float32], where: NDArray[np.bool_]
) -> normal.Vector:
    """``old`` with the constant vector ``new`` in some pixels."""
    return normal.Vector(*(np.where(where, new[axis], old[axis]) for axis in range(3)))


def _joined(key: nearest.Key) -> NDArray[np.uint64]:
    return (key.high.astype(np.uint64) << np.uint64(32)) | key.low


def render_band(
    scene: Scene,
    packed: Packed,
    first_row: int,
    rows: int,
    method: str,
    outputs: frozenset[str],
) -> Planes:
    """Outputs (rows, width, …) of picture rows ``first_row`` … ``first_row + rows - 1``.

    ``surface`` uint32 (0 where nothing is hit), ``key`` and ``exit`` uint64 depth keys, ``image``
    uint32 packed RGBA, ``color`` and ``normal`` float32 (…, 3).
    """
    band = Band(scene, packed, first_row, rows, method, outputs)
    for row in range(len(packed.solids)):
        band.visit(row)
    return band.finish()
