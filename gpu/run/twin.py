"""A band of a frame in NumPy: the same stages in the same order as the shader of ``source``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.classes import Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import TILE
from halfstep.contract.srgb import srgb_table
from halfstep.contract.stages import VISITS
from halfstep.host.pack import Packed, frame_record
from halfstep.host.tiles import tile_lists
from halfstep.run.needs import needs_of
from halfstep.scene import Scene
from halfstep.twin import encode, finish, keep, shadows
from halfstep.twin.chosen import Chosen, chosen_for, module
from halfstep.twin.lanes import F32
from halfstep.twin.normal import Vector
from halfstep.twin.shade import Light
from halfstep.twin.sight import Seen

Planes = dict[str, NDArray[Any]]


class Band:
    """The nearest visible points of the pixels of a band."""

    def __init__(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
        chosen: Chosen | None = None,
    ) -> None:
        """``chosen``: other stages than those of the number format."""
        needs = needs_of(packed, scene.accuracy.method, outputs)
        self._packed, self._first_row, self._outputs = packed, first_row, outputs
        self._method, self._facts = needs.method, needs.facts
        self._chosen = chosen or chosen_for(packed.format, needs.method)
        self._keys: Any = module("keys_short" if needs.short_keys else "keys")
        self._frame = frame_record(scene, packed.setup, first_row, rows)[0]
        self._shape = rows, packed.setup.view.width
        self._nearest = _each(_filled, keep.nothing(self._keys), shape=self._shape)
        self._tiles = _tiles_of(packed, first_row, rows)

    def visit(self, row: int) -> None:
        """Try a solid, a row of ``packed.solids``, on all pixels of the tiles it may be seen in."""
        solid, klass = self._packed.solids[row], Class(int(self._packed.classes[row]))
        i0, i1, j0, j1 = self._packed.setup.rectangle[self._packed.order[row]]
        rows, width = self._shape
        top = max((j0 - self._first_row) // TILE * TILE, 0)
        bottom = min(((j1 - self._first_row) // TILE + 1) * TILE, rows)
        left, right = i0 // TILE * TILE, min((i1 // TILE + 1) * TILE, width)
        if top >= bottom:
            return
        window = np.s_[top:bottom, left:right]
        tried = np.zeros((bottom - top, right - left), bool)
        for y, x in self._tiles[row]:
            tried[y * TILE - top :, x * TILE - left :][:TILE, :TILE] = True
        j, i = np.mgrid[window].astype(np.int32)
        x = i - solid["center_x"]
        y = j + np.int32(self._first_row) - solid["center_y"]
        visit = VISITS[self._method, klass]
        facts = self._facts | visit.facts
        run = getattr(module(visit.file), visit.file)
        is_region = klass in (Class.REGION, Class.REGION_INSIDE)
        rest = self._packed.regions if is_region else self._packed.half_spaces
        seen: Seen = run(solid, rest, x, y, self._chosen, facts)
        old = _each(_part, self._nearest, window=window)
        new = keep.keep(
            old,
            solid,
            seen.sight,
            seen.slope,
            seen.certificate,
            seen.paint,
            np.zeros(x.shape, np.uint32) if seen.turned is None else seen.turned,
            self._keys,
            facts,
        )
        # A tile whose list leaves out a solid keeps nothing of it.
        _each(np.copyto, old, new, where=tried)

    def finish(self) -> Planes:
        """The requested outputs of all pixels."""
        nearest, outputs = self._nearest, self._outputs
        planes: Planes = {"surface": nearest.surface}
        if "key" in outputs:
            planes["key"] = joined_key(*nearest.key)
        if "exit" in outputs:
            planes["exit"] = joined_key(*nearest.leaves)
        if "error" in outputs:
            planes["low"], planes["doubt"] = joined_key(*nearest.low), joined_key(*nearest.doubt)
            planes["bound"] = nearest.bound
        if self._facts.isdisjoint({"normal", "shadows"}):
            return planes
        j, i = np.mgrid[: self._shape[0], : self._shape[1]].astype(np.int32)
        j += np.int32(self._first_row)
        hidden = self._packed.shadows if "shadows" in self._facts else None
        if hidden is not None:
            beams = module(self._packed.format.beam)
            points = shadows.find_points(hidden, nearest, i, j, beams)
            nearest = nearest._replace(dark=shadows.find_shadows(hidden, nearest, points, beams))
        if "shadow" in outputs:
            planes["shadow"] = nearest.dark
        if "normal" not in self._facts:
            return planes
        dark = 0 if hidden is None else len(hidden.views)
        lights = [
            Light(row["vector"], row["color"], ix < dark)
            for ix, row in enumerate(self._packed.lights)
        ]
        shown = finish.finish(nearest, i, j, self._frame, lights, self._facts)
        if "normal" in outputs:
            planes["normal"] = np.stack(shown.normal, axis=-1)
        if "color" in self._facts:
            planes["color"] = np.stack(shown.color, axis=-1)
        if "image" in outputs:
            planes["image"] = image_of(planes["color"])
        return planes


def image_of(color: F32) -> NDArray[np.uint8]:
    """Pixels (H, W, 3) of linear colours (H, W, 3)."""
    words = encode.encode(srgb_table(), Vector(*np.moveaxis(color, -1, 0)))
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


def _each(function: Callable[..., Any], *values: Any, **named: Any) -> Any:
    """``function`` of each array of structs of the twin that are formed alike."""
    if not isinstance(values[0], tuple):
        return function(*values, **named)
    parts = [_each(function, *members, **named) for members in zip(*values, strict=True)]
    return type(values[0])(*parts)


def _filled(value: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    return np.full(shape, value)


def _part(whole: NDArray[Any], window: tuple[slice, slice]) -> NDArray[Any]:
    return whole[window]


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
