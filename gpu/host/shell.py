"""What is seen of a body: where rays enter it, and the parts of copies next to its sides.

A body is convex. So of the rays of a tile none enters it later than the latest one of the corners,
and none before the plane that touches it where another ray enters.
"""

from __future__ import annotations

import functools
from typing import NamedTuple, Self

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.layout import TILE
from halfstep.host.body import FLAT, Body
from halfstep.host.bounds import bounds_of_boxes, rectangles
from halfstep.host.camera import View
from halfstep.host.copies import Copies
from halfstep.host.setup import Setup
from halfstep.host.walls import DEEP, corner_rays, of_corners

# Rays must be in a body for this many steps of the coarsest copy before it hides what is behind.
STEPS = 2.0
# Rays that miss a body by this part of its diagonal are taken for some that touch it.
BESIDE = 2.0**-20
# A base plane cuts a body if it cuts off more than this part of where nothing is hidden.
CUT = 0.25
# A half-space narrows a box along axes with at least this part of its normal.
ALONG = 2.0**-8
# Boxes next to a bound are cut into so many parts along an axis, unless there are more of them.
PARTS, MOST_CUT = 8, 1 << 11


class Depths(NamedTuple):
    """Depths of tiles (R, C) before and behind which nothing of a body's cells is seen."""

    before: Floats
    behind: Floats  # infinite where it is not known


class Parts(NamedTuple):
    """What may be seen of P copies: boxes along axes of their own; none if an end is infinite."""

    boxes: Floats  # (2, 3, P)
    origin: Floats  # (3, P), world
    turns: Floats  # (3, 3, P), to the world


class Shell:
    """A body that is seen from outside."""

    def __init__(self, body: Body, setup: Setup, copies: Copies, steps: Ints) -> None:
        """For the copies of a frame; ``steps`` are the halvings of all its solids."""
        self._body, self._setup, self._copies = body, setup, copies
        longest = 2 * setup.depth_half[copies.row] / np.exp2(steps[copies.row])
        diagonal = float(np.linalg.norm(body.box[1] - body.box[0]))
        self._beside = BESIDE * diagonal
        self._deep = DEEP * diagonal + STEPS * float(longest.max(initial=0.0))

    @classmethod
    def of(cls, setup: Setup, copies: Copies, steps: Ints) -> Self | None:
        """The shell of the scene's body; None if it has none, or rays start within it."""
        body, view = copies.regions.body, setup.view
        if body is None:
            return None
        found = cls(body, setup, copies, steps)
        ends = np.indices((2, 2, 2)).reshape(3, 8).T
        nearest = view.depths(np.where(ends, body.box[1], body.box[0])).min()
        # What the near base plane cuts off of the body is far less than what is looked for.
        if nearest + found._deep * CUT < setup.near:
            return None
        if not all(np.isfinite(one.box).all() for one in copies.regions.programs):
            return None
        outside = ((view.eye < body.box[0]) | (view.eye > body.box[1])).any()
        outside = outside or any(_value(bound, view.eye) > 0 for bound in body.bounds)
        return found if outside or view.parallel else None

    def depths(self, first_tile: int, rows: int) -> Depths:
        """The depths between which the body is entered, in rows of tiles from the first one on."""
        view, body = self._setup.view, self._body
        start, direction = corner_rays(view, first_tile, rows)
        enters, leaves = _between(body.box, start, direction)
        enter, leave = enters.max(axis=0), leaves.min(axis=0)
        room = self._beside
        wider = body.box + np.array([[-room], [room]])
        before = of_corners(_between(wider, start, direction)[0]).min(axis=-1).max(axis=0)
        for bound in body.bounds:
            first, last = _crossed(bound, start, direction)
            enter, leave = np.maximum(enter, first), np.minimum(leave, last)
            touched = _touched(bound, view, first_tile, start, direction, room)
            before = np.maximum(before, touched)
        with np.errstate(invalid="ignore"):
            meets = (enter + self._deep < leave) & (enter > self._setup.near)
        behind = np.where(meets, enter + self._deep, np.inf)
        return Depths(np.maximum(before - self._deep, 0.0), of_corners(behind).max(axis=-1))

    @functools.cached_property
    def _seen(self) -> Parts:
        """What may be seen of each copy."""
        copies = self._copies
        boxes = np.stack([one.box for one in copies.regions.programs], axis=-1)
        boxes = boxes.take(copies.program, axis=-1)
        origin = copies.regions.origin.take(copies.copy, axis=-1)
        turns = copies.regions.world_from_local.take(copies.copy, axis=-1)
        return Parts(self._parts(boxes, origin, turns), origin, turns)

    def rectangles(self) -> Ints:
        """The pixels (R, 4) in which each copy may be seen: i0, i1, j0, j1. There may be none."""
        setup = self._setup
        return _around(self._seen, setup.rectangle[self._copies.row], setup.view)

    def in_tiles(self, copy: Ints, x: Ints, y: Ints) -> Ints:
        """`rectangles` of copies (P,) in a tile each, (P, 4).

        Args:
            copy: (P,), the copy.
            x: (P,), number of the tile from the left.
            y: (P,), and from the top of the picture.
        """
        view, found = self._setup.view, self._seen
        origin, turns = (each.take(copy, axis=-1) for each in found[1:])
        boxes, away = found.boxes.take(copy, axis=-1), origin - view.eye[:, None]
        right, down, forward = view.camera_from_world
        left, top = x * TILE, y * TILE
        seen = np.ones(len(copy), bool)
        for axis, first, pixel in ((right, view.x_first, left), (down, view.y_first, top)):
            for sign, edge in ((1, pixel - 0.5), (-1, pixel + TILE - 0.5)):
                # A half-space: normal · (point - eye) is at least so much.
                normal, least = sign * axis[:, None], sign * (first + edge * view.pixel)
                if not view.parallel:
                    normal, least = normal - least * forward[:, None], 0.0 * least
                least = least - (normal * away).sum(axis=0)
                normal = np.broadcast_to(normal, away.shape)
                boxes, some = _narrowed(boxes, np.einsum("ijk,ik->jk", turns, normal), least)
                seen &= some
        size = np.array([view.width, view.height])
        tiles = np.stack([left, left + TILE - 1, top, top + TILE - 1], axis=-1)
        tiles = np.minimum(tiles, size.repeat(2) - 1)
        pixels = _around(Parts(boxes, origin, turns), tiles, view)
        pixels[:, 1] = np.where(seen, pixels[:, 1], pixels[:, 0] - 1)
        return pixels

    def _parts(self, boxes: Floats, origin: Floats, turns: Floats) -> Floats:
        """Of each box (2, 3, R) what is next to sides of the body that are seen.

        Where nothing is, the least coordinates are infinite.
        """
        view, box = self._setup.view, self._body.box
        forward = view.camera_from_world[2]
        last = np.array([[0, 0], [view.width - 1, view.height - 1]])
        steepest = np.linalg.norm(view.directions(last[:, 0], last[:, 1]), axis=-1).max()
        room = self._deep * steepest
        found = np.stack([np.full(boxes.shape[1:], np.inf), np.full(boxes.shape[1:], -np.inf)])
        for axis in range(3):
            for end, sign in enumerate((-1.0, 1.0)):
                face = box[end, axis]
                if view.parallel:
                    faces = sign * forward[axis] < 0
                else:
                    faces = sign * (view.eye[axis] - face) > 0
                if not faces:
                    continue
                least = sign * (face - origin[axis]) - room
                (low, high), some = _narrowed(boxes, sign * turns[axis], least)
                found[0] = np.where(some, np.minimum(found[0], low), found[0])
                found[1] = np.where(some, np.maximum(found[1], high), found[1])
        for bound in self._body.bounds:
            if not view.parallel and _value(bound, view.eye) <= 0:
                continue
            part = self._beside_bound(bound, boxes, origin, turns, room)
            found = np.stack([np.minimum(found[0], part[0]), np.maximum(found[1], part[1])])
        return found

    def _beside_bound(
        self, bound: Floats, boxes: Floats, origin: Floats, turns: Floats, room: float
    ) -> Floats:
        """What of boxes (2, 3, R) is next to a bound, where that is turned to the eye."""
        found = np.stack([np.full(boxes.shape[1:], np.inf), np.full(boxes.shape[1:], -np.inf)])
        own = np.flatnonzero(self._may_be_beside(bound, boxes, origin, turns, room))
        # A box is cut along the axes in which the bound is curved.
        own_turns = turns.take(own, axis=-1)
        curved = np.einsum("aik,ab,bik->ik", own_turns, bound[:3, :3], own_turns)
        is_curved = (curved > FLAT * np.abs(bound[:3, :3]).max()).any(axis=-1)
        counts = np.where(is_curved, PARTS if len(own) <= MOST_CUT else 1, 1)
        place = np.indices(tuple(counts)).reshape(3, -1, 1)
        low, high = boxes.take(own, axis=-1)[:, :, None]
        size = (high - low) / counts[:, None, None]
        pieces = place.shape[1]
        parts = np.stack([low + size * place, low + size * (place + 1)])
        parts = parts.reshape(2, 3, pieces * len(own))
        of = np.tile(own, pieces)
        seen = self._may_be_beside(
            bound, parts, origin.take(of, axis=-1), turns.take(of, axis=-1), room
        )
        least, most = parts.reshape(2, 3, pieces, len(own))
        seen = seen.reshape(pieces, len(own))
        found[0][:, own] = np.where(seen, least, np.inf).min(axis=1)
        found[1][:, own] = np.where(seen, most, -np.inf).max(axis=1)
        return found

    def _may_be_beside(
        self, bound: Floats, boxes: Floats, origin: Floats, turns: Floats, room: float
    ) -> Bools:
        """Whether some point of each box (2, 3, P) is next to a bound that is turned to the eye."""
        view, bend = self._setup.view, bound[:3, :3]
        half = (boxes[1] - boxes[0]) / 2 + room
        middle = np.einsum("ijk,jk->ik", turns, (boxes[0] + boxes[1]) / 2) + origin
        bends = np.abs(np.einsum("aik,ab,bjk->ijk", turns, bend, turns))
        bends = np.einsum("ik,ijk,jk->k", half, bends, half)
        slope = np.einsum("ij,jk->ik", bend, middle) + bound[:3, 3:]
        value = ((slope + bound[:3, 3:]) * middle).sum(axis=0) + bound[3, 3]

        def reach(gradient: Floats) -> Floats:
            """How much a function changes in each box, to first order."""
            return np.asarray((np.abs(np.einsum("ijk,ik->jk", turns, gradient)) * half).sum(axis=0))

        beside = np.abs(value) <= 2 * reach(slope) + bends
        if view.parallel:
            forward = view.camera_from_world[2]
            turned = forward @ slope
            changes = reach(np.broadcast_to((bend @ forward)[:, None], slope.shape))
        else:
            away = middle - view.eye[:, None]
            turned = (away * slope).sum(axis=0)
            changes = reach(np.einsum("ij,jk->ik", bend, away) + slope) + bends
        return np.asarray(beside & (turned <= changes))


def _around(parts: Parts, whole: Ints, view: View) -> Ints:
    """Pixels (P, 4) around parts, of rectangles ``whole`` (P, 4)."""
    boxes, origin, turns = parts
    seen = (boxes[0] <= boxes[1]).all(axis=0)
    boxes = np.where(seen, boxes, 0.0)
    (i0, i1, j0, j1), some = rectangles(bounds_of_boxes(view, origin, turns, boxes), view)
    i0, j0 = np.maximum(i0, whole[:, 0]), np.maximum(j0, whole[:, 2])
    i1, j1 = np.minimum(i1, whole[:, 1]), np.minimum(j1, whole[:, 3])
    i1 = np.where(seen & some, i1, i0 - 1)
    return np.stack([i0, i1, j0, j1], axis=-1)


def _narrowed(boxes: Floats, normal: Floats, least: Floats) -> tuple[Floats, Bools]:
    """Boxes (2, 3, R) around what half-spaces leave of others, and whether something is left.

    A half-space is normal (3, R) · x >= least (R,).
    """
    most = np.maximum(normal * boxes[0], normal * boxes[1])
    total = most.sum(axis=0)
    along = np.where(np.abs(normal) > ALONG, normal, 1.0)
    place = (least - (total - most)) / along
    low = np.where(normal > ALONG, np.maximum(boxes[0], place), boxes[0])
    high = np.where(normal < -ALONG, np.minimum(boxes[1], place), boxes[1])
    some = total >= least
    return np.where(some, np.stack([low, high]), boxes), some


def _value(bound: Floats, point: Floats) -> float:
    return float(point @ bound[:3, :3] @ point + 2 * bound[:3, 3] @ point + bound[3, 3])


def _on_rays(bound: Floats, start: Floats, direction: Floats) -> tuple[Floats, Floats, Floats]:
    """a, b and c of F = a t² + 2 b t + c on rays (…, 3)."""
    of_direction = direction @ bound[:3, :3]
    slope = start @ bound[:3, :3] + bound[:3, 3]
    a = (of_direction * direction).sum(axis=-1)
    b = (slope * direction).sum(axis=-1)
    c = ((slope + bound[:3, 3]) * start).sum(axis=-1) + bound[3, 3]
    return a, b, c


def _between(box: Floats, start: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """The depths (3, …) between which rays (…, 3) are between opposite faces of a box."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (np.moveaxis((face - start) / direction, -1, 0) for face in box)
    along = np.isnan(one) | np.isnan(other)  # a ray in a face
    return (
        np.where(along, -np.inf, np.minimum(one, other)),
        np.where(along, np.inf, np.maximum(one, other)),
    )


def _crossed(bound: Floats, start: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """The depths (…) between which rays (…, 3) are where a convex F <= 0."""
    a, b, c = _on_rays(bound, start, direction)
    a = np.maximum(a, 0.0)
    square = b * b - a * c
    # No root is the difference of two numbers.
    root = np.copysign(np.sqrt(np.maximum(square, 0.0)), b)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = c / -(b + root), -(b + root) / a
    never = (square < 0) | np.isnan(one) | np.isnan(other)
    return (
        np.where(never, np.inf, np.minimum(one, other)),
        np.where(never, -np.inf, np.maximum(one, other)),
    )


def _touched(
    bound: Floats, view: View, first_tile: int, start: Floats, direction: Floats, room: float
) -> Floats:
    """A depth (R, C) before which no ray of a tile is within ``room`` of where a convex F <= 0.

    The plane that touches F = 0 where the ray amid the tile enters has all points with
    F <= 0 behind it. ``start`` and ``direction`` (2R, 2C, 3) are of the corners.
    """
    rows, columns = (size // 2 for size in start.shape[:2])
    i = (np.arange(columns) * TILE + TILE // 2)[None, :]
    j = ((first_tile + np.arange(rows)) * TILE + TILE // 2)[:, None]
    origin, along = view.eye + view.starts(i, j), view.directions(i, j)
    depth, _ = _crossed(bound, origin, along)
    known = np.isfinite(depth)
    point = origin + np.where(known, depth, 0.0)[..., None] * along
    normal = point @ bound[:3, :3] + bound[:3, 3]
    at_corners = np.concatenate([point, normal], axis=-1).repeat(2, axis=0).repeat(2, axis=1)
    point, normal = at_corners[..., :3], at_corners[..., 3:]
    above = ((start - point) * normal).sum(axis=-1) - room * np.linalg.norm(normal, axis=-1)
    falls = -(direction * normal).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        enter = np.where(above > 0, np.where(falls > 0, above / falls, np.inf), 0.0)
    return np.where(known, of_corners(enter).min(axis=-1), 0.0)
