"""A band of a frame in NumPy: the same stages in the same order as the shader of ``source``."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Planes
from halfstep.contract.classes import Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import TILE, Flag
from halfstep.contract.srgb import srgb_table
from halfstep.host.pack import Packed, frame_record
from halfstep.host.tiles import tile_lists
from halfstep.scene import Scene
from halfstep.twin import (
    article,
    certify,
    encode,
    nearest,
    normal,
    patch,
    piece,
    polynomial,
    ray,
    root,
    shade,
)
from halfstep.twin.lanes import F32, Form
from halfstep.twin.piece import Line

_FAR = np.uint32(0xFFFFFFFF)


class Sight(NamedTuple):
    """What the method ``visible`` finds of a solid; members as in ``article.Found``."""

    hit: NDArray[np.bool_]
    surface: NDArray[np.int32]
    position: NDArray[np.int32]
    left: NDArray[np.bool_]
    exit_position: NDArray[np.int32]


class Band:
    """The nearest visible points of the pixels of a band, and the solid being tried."""

    def __init__(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
    ) -> None:
        self.packed = packed
        self.first_row, self.outputs = first_row, outputs
        self.method = scene.accuracy.method
        self.frame = frame_record(scene, packed.setup, first_row, rows)[0]
        number_format = packed.format
        self.polynomial, self.forms = _stage(number_format.polynomial), _stage(number_format.forms)
        self.halve = _stage(number_format.halve)
        shape = self.shape = (rows, packed.setup.view.width)
        self.key = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.leaves = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.low = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.doubt = nearest.Key(np.full(shape, _FAR), np.full(shape, _FAR))
        self.bound = np.zeros(shape, np.float32)
        self.surface = np.zeros(shape, np.uint32)
        self.slope = normal.Vector(*(np.zeros(shape, np.float32) for _ in range(3)))
        self.depth = np.zeros(shape, np.float32)
        self.solid = np.zeros(shape, np.int64)  # row of ``packed.solids``
        self._tiles = _tiles_of(packed, first_row, rows)

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
        # A solid that a tile leaves out casts no doubt on what its rays see.
        tried = np.zeros((bottom - top, right - left), bool)
        for y, x in self._tiles[row]:
            tried[y * TILE - top :, x * TILE - left :][:TILE, :TILE] = True
        y, x = np.mgrid[top:bottom, left:right].astype(np.int32)
        x -= solid["center_x"]
        y += np.int32(self.first_row) - solid["center_y"]
        at = self.polynomial.offset(x, y)
        lines = [self.forms.line_at(row["c"], row["b"], at) for row in self._half_spaces(solid)]
        found: Sight | article.Found
        if self.method == "article":
            found = self._article(solid, klass, at, lines)
        else:
            found = self._visible(solid, klass, at, lines)
        found = found._replace(hit=found.hit & tried)
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
        certificate = self._certify(solid, klass, at) if "error" in self.outputs else None
        if certificate is not None and isinstance(found, article.Found):
            # In one cell the way in and the way out through a surface may stand for each other.
            same = certificate.inside == found.inside
            certificate = certificate._replace(sure=certificate.sure & same)
        nearer = self._keep(window, solid, found, slope, u, certificate, tried)
        self.solid[window][nearer] = row

    def _half_spaces(self, solid: np.void) -> NDArray[np.void]:
        start = int(solid["plane_start"])
        return self.packed.half_spaces[start : start + int(solid["plane_count"])]

    def _visible(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[Line]
    ) -> Sight:
        """The joint logic first, then one sequence (and one more for the exit)."""
        steps = int(solid["steps"])
        if klass is Class.PATCH:
            plane = patch.facing(lines[0], solid["near_u"], solid["far_u"])
            for line in lines[1:]:
                plane = patch.bound(plane, line)
            seen = leaving = root.patch_entry(plane)
        elif klass is Class.ELLIPSOID:
            form = self._form(solid, at)
            seen, leaving = root.ellipsoid_entry(form), root.ellipsoid_exit(form)
        else:
            seen, leaving = self._cut(solid, klass, at, lines)
        position = self._halved(seen, steps)
        exit_position = self._halved(leaving, steps) if "exit" in self.outputs else position
        return Sight(seen.hit, seen.surface, position, leaving.hit, exit_position)

    def _halved(self, seen: root.Root, steps: int) -> NDArray[np.int32]:
        """Positions of roots after exactly n halvings."""
        search = self.halve.begun(seen)
        for k in range(steps):
            search = self.halve.halved(search, k)
        return np.asarray(self.halve.reached(search, seen, steps))

    def _cut(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[Line]
    ) -> tuple[root.Root, root.Root]:
        """Visible root and exit of a solid with half-spaces or base planes across it."""
        flags = Flag(int(solid["flags"]))
        part = piece.whole_interval(at.x + 0 * at.y, solid["near_u"], solid["far_u"])
        for number, line in enumerate(lines, start=1):
            part = piece.clip(part, line, number)
        if flags & Flag.EYE_INSIDE:
            part = piece.from_the_eye(part, solid["near_u"])
        opened = np.full(part.id_in.shape, bool(flags & Flag.EYE_INSIDE))
        at_near = bool(flags & Flag.NEAR_CUT) & (part.id_in == 0)
        if klass in (Class.POLYHEDRON, Class.POLYHEDRON_INSIDE):
            inside = opened | at_near
            leaving = root.polyhedron_exit(part)
            return root.choose(inside, root.polyhedron_entry(part), leaving), leaving
        form = self._form(solid, at)
        outside = root.outside_at_entry(form, part)
        if flags & Flag.STARTS_AT_EYE:
            outside = np.where(part.id_in == 0, bool(flags & Flag.EYE_OUTSIDE_QUADRIC), outside)
        inside = opened | (at_near & ~outside)
        leaving = root.quadric_exit(form, part, ~outside)
        return root.choose(inside, root.quadric_entry(form, part, outside), leaving), leaving

    def _article(
        self, solid: np.void, klass: Class, at: polynomial.Offset, lines: list[Line]
    ) -> article.Found:
        """The paper's own sequences."""
        flags, steps = Flag(int(solid["flags"])), int(solid["steps"])
        base_planes = solid["near_u"], solid["far_u"]
        eye_inside = bool(flags & Flag.EYE_INSIDE)
        if klass is Class.PATCH:
            return article.article_patch(lines, *base_planes, steps)
        if klass in (Class.POLYHEDRON, Class.POLYHEDRON_INSIDE):
            return article.article_polyhedron(lines, *base_planes, eye_inside, steps)
        form = self._form(solid, at)
        outside = (form.a - form.g) + form.c > 0
        if flags & Flag.STARTS_AT_EYE:
            outside = np.full(form.a.shape, bool(flags & Flag.EYE_OUTSIDE_QUADRIC))
        return article.article_quadric(form, outside, lines, *base_planes, eye_inside, steps)

    def _keep(
        self,
        window: tuple[slice, slice],
        solid: np.void,
        found: Sight | article.Found,
        slope: normal.Vector,
        u: F32,
        certificate: certify.Certificate | None,
        tried: NDArray[np.bool_],
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
        if certificate is not None:
            confirmed = certify.confirms(certificate, found.hit, found.surface)
            spare = int(solid["spare"])
            low = certify.least_key(key, certificate.bound, steps, spare, shift)
            self._lower(self.low, window, low, confirmed & found.hit)
            whole = nearest.Key(*(np.broadcast_to(word, confirmed.shape) for word in start))
            self._lower(self.doubt, window, whole, tried & ~confirmed)
            self.bound[window][nearer] = certificate.bound[nearer]
        for component, value in zip(self.slope, slope, strict=True):
            component[window][nearer] = value[nearer]
        depth = solid["depth_middle"] + u * solid["depth_half"]
        self.depth[window][nearer] = depth[nearer]
        return np.asarray(nearer)

    @staticmethod
    def _lower(
        old: nearest.Key,
        window: tuple[slice, slice],
        key: nearest.Key,
        where: NDArray[np.bool_],
    ) -> None:
        """Keep the lesser of an old key and a new one in some pixels."""
        kept = nearest.Key(old.high[window], old.low[window])
        same = np.zeros(where.shape, np.uint32)
        lower = where & nearest.before(key, same, kept, same)
        old.high[window][lower] = key.high[lower]
        old.low[window][lower] = key.low[lower]

    def _certify(self, solid: np.void, klass: Class, at: polynomial.Offset) -> certify.Certificate:
        """What is certain of the solid in every pixel."""
        flags = Flag(int(solid["flags"]))
        near_u, far_u, last_step = solid["near_u"], solid["far_u"], solid["last_step"]
        near_cut = bool(flags & Flag.NEAR_CUT)
        number_format = self.packed.format
        article = self.method == "article"
        run = getattr(certify, number_format.article_run if article else number_format.run)
        lines = [self._bounded_line(row, at) for row in self._half_spaces(solid)]
        if klass is Class.PATCH:
            plane = certify.bounded_facing(*lines[0], near_u, far_u, near_cut)
            for line in lines[1:]:
                plane = certify.bounded_bound(plane, *line)
            return certify.certify_patch(plane, last_step)
        if klass is Class.ELLIPSOID:
            return certify.certify_ellipsoid(self._bounded_form(solid, at), run, last_step)
        ends = certify.bounded_interval(at.x + 0 * at.y, near_u, far_u, near_cut)
        for number, line in enumerate(lines, start=1):
            ends = certify.bounded_clip(ends, *line, number)
        eye_inside, eye_sure = bool(flags & Flag.EYE_INSIDE), bool(flags & Flag.EYE_SURE)
        if eye_inside:
            ends = certify.bounded_from_the_eye(ends, near_u)
        at_start = ends.piece.id_in == 0
        if klass in (Class.POLYHEDRON, Class.POLYHEDRON_INSIDE):
            opened = eye_inside | (near_cut & at_start)
            return certify.certify_polyhedron(ends, opened, eye_sure, last_step)
        return certify.certify_quadric(
            self._bounded_form(solid, at),
            ends,
            at_start & bool(flags & Flag.STARTS_AT_EYE),
            bool(flags & Flag.EYE_OUTSIDE_QUADRIC),
            eye_sure,
            eye_inside or near_cut,
            run,
            last_step,
        )

    def _form(self, solid: np.void, at: polynomial.Offset) -> Form:
        """F along the rays."""
        form: Form = self.forms.form_at(*(solid[name] for name in "agc"), at)
        return form

    def _bounded_line(self, row: np.void, at: polynomial.Offset) -> tuple[Line, certify.LineErrors]:
        """A half-space along the rays and its errors."""
        errors = self.forms.line_errors(row["c"], row["b"], at, row["host_error"])
        return self.forms.line_at(row["c"], row["b"], at), errors

    def _bounded_form(self, solid: np.void, at: polynomial.Offset) -> certify.BoundedForm:
        """F along the rays with its errors."""
        coefficients = (solid[name] for name in "agc")
        errors = self.forms.form_errors(*coefficients, at, solid["host_error"])
        return certify.bounded_form(self._form(solid, at), errors)

    def finish(self) -> Planes:
        """The requested outputs of all pixels."""
        planes: Planes = {"surface": self.surface}
        if "key" in self.outputs:
            planes["key"] = joined_key(*self.key)
        if "exit" in self.outputs:
            planes["exit"] = joined_key(*self.leaves)
        if "error" in self.outputs:
            planes["low"], planes["doubt"] = joined_key(*self.low), joined_key(*self.doubt)
            planes["bound"] = self.bound
        if not self.outputs & {"image", "color", "normal"}:
            return planes
        j, i = np.mgrid[: self.shape[0], : self.shape[1]].astype(np.int32)
        j += np.int32(self.first_row)
        some = self.surface > 0
        direction = ray.ray_direction(self.frame, i.astype(np.float32), j.astype(np.float32))
        to_eye = normal.Vector(-direction.x, -direction.y, -direction.z)
        unit = normal.normalized(normal.or_else(self.slope, to_eye))
        if "normal" in self.outputs:
            planes["normal"] = np.stack(
                [np.where(some, component, np.float32(0)) for component in unit], axis=-1
            )
        if self.outputs & {"image", "color"}:
            lit = self._shade(unit, direction) if len(self.packed.solids) else unit
            background = self.frame["background"]
            color = normal.Vector(*(np.where(some, lit[k], background[k]) for k in range(3)))
            planes["color"] = np.stack(color, axis=-1)
            if "image" in self.outputs:
                planes["image"] = image_of(planes["color"])
        return planes

    def _shade(self, unit: normal.Vector, direction: normal.Vector) -> normal.Vector:
        solids = self.packed.solids[self.solid]
        color = normal.Vector(*np.moveaxis(solids["color"], -1, 0))
        finish = shade.Finish(color, solids["specular"], solids["shininess"])
        lights = [shade.Light(row["vector"], row["color"]) for row in self.packed.lights]
        point = normal.scaled(direction, self.depth)
        return shade.shade(unit, direction, point, finish, self.frame["ambient"], lights)


def image_of(color: F32) -> NDArray[np.uint8]:
    """Pixels (H, W, 3) of linear colours (H, W, 3)."""
    words = encode.encode(srgb_table(), normal.Vector(*np.moveaxis(color, -1, 0)))
    return words.view(np.uint8).reshape(*words.shape, 4)[..., :3].copy()


def _tiles_of(packed: Packed, first_row: int, rows: int) -> list[list[tuple[int, int]]]:
    """The tiles, row and column, in whose lists the solids are, rows of ``packed.solids``."""
    starts, members = tile_lists(packed, packed.present, first_row, rows)
    across = -(-packed.setup.view.width // TILE)
    lists = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    tiles: list[list[tuple[int, int]]] = [[] for _ in packed.solids]
    for row, tile in zip(members.tolist(), (lists // len(packed.present)).tolist(), strict=True):
        tiles[row].append(divmod(tile, across))
    return tiles


def _stage(name: str) -> ModuleType:
    """A twin module that exists once for each number format."""
    return import_module(f"halfstep.twin.{name}")


def _replaced(old: normal.Vector, new: F32, where: NDArray[np.bool_]) -> normal.Vector:
    """``old`` with the constant vector ``new`` in some pixels."""
    return normal.Vector(*(np.where(where, new[axis], old[axis]) for axis in range(3)))


def render_band(
    scene: Scene,
    packed: Packed,
    first_row: int,
    rows: int,
    outputs: frozenset[str],
) -> Planes:
    """Outputs (rows, width, …) of picture rows ``first_row`` … ``first_row + rows - 1``.

    ``surface`` (0 where nothing is hit), ``key`` and ``exit`` uint64 depth keys, ``image`` uint8
    (…, 3), ``color`` and ``normal`` float32 (…, 3); for ``error`` uint64 keys ``low``,
    the least depth of what is certain, and ``doubt``, where what is not begins, and float32
    ``bound``, the error of the visible point in its u.
    """
    band = Band(scene, packed, first_row, rows, outputs)
    for row in range(len(packed.solids)):
        band.visit(row)
    return band.finish()
