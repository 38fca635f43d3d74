"""The twin renders a band in NumPy with the stages of ``shader.source``, in the same order."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from halfstep.contract.arrays import Array, Bools, Bytes, Ints, Planes
from halfstep.contract.classes import REGIONS, STRETCHED, Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import LANES, TILE
from halfstep.contract.planes import DEVICE_OUTPUTS, Kept
from halfstep.contract.srgb import srgb_table
from halfstep.contract.stages import VISITS
from halfstep.contract.stretches import rows_of
from halfstep.host.excerpts import lists_of
from halfstep.host.pack import Packed, frame_record, in_integers
from halfstep.run import recheck
from halfstep.run.needs import needs_of, needs_of_judge
from halfstep.run.recheck import Answers, Asked
from halfstep.scene import Scene
from halfstep.twin import bounce, encode, finish, finish_regions, keep, shadows
from halfstep.twin.chosen import Chosen, chosen_for, module
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import F32, U32
from halfstep.twin.normal import Vector
from halfstep.twin.place import Point
from halfstep.twin.reflected import Cells
from halfstep.twin.region import NO_REGION, NOTHING_MET
from halfstep.twin.shade import Light
from halfstep.twin.sight import Seen
from halfstep.twin.veils import try_veils
from halfstep.twin.verdict import verdict_of
from halfstep.twin.visit_polynomial_fixed import visit_polynomial_fixed


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
        """``chosen``: stages to use in place of those of the number format."""
        self.lists = lists_of(packed, first_row, rows, outputs)
        needs = needs_of(packed, self.lists, scene.accuracy.method, outputs)
        self._packed, self._first_row, self._outputs = packed, first_row, outputs
        self._method, self._facts = needs.method, needs.facts
        self._chosen = chosen or chosen_for(packed.format, needs.method)
        self._keys: Any = module("keys_short" if needs.short_keys else "keys")
        self._frame = frame_record(scene, packed.setup, first_row, rows)[0]
        self._shape = rows, packed.setup.view.width
        self._nearest = _each(_filled, keep.nothing(self._keys), shape=self._shape)

    def visit(self) -> None:
        """Try each solid and region of the tiles' lists on all tiles that list it."""
        lists, classes = self.lists, self.lists.classes
        tile, slot = np.divmod(
            np.repeat(np.arange(len(lists.starts) - 1), np.diff(lists.starts)), len(classes)
        )
        is_stretched = np.isin(classes, [*STRETCHED])[slot]
        row = np.where(is_stretched, rows_of(lists.members), lists.members)
        order = np.lexsort([row, slot])
        found = np.stack([slot[order], row[order]])
        first = np.flatnonzero(np.diff(found, axis=1, prepend=-1).any(axis=0))
        for entries in np.split(order, first[1:]) if len(order) else []:
            self._try(classes[slot[entries[0]]], lists.members[entries], tile[entries])

    def _try(self, klass: Class, members: U32, tiles: Ints) -> None:
        """Try a solid, or a region by its record, on the pixels of some tiles.

        ``members`` (T,) has the members of the tiles' lists.
        """
        rows, width = self._shape
        top, left = np.divmod(tiles, -(-width // TILE))
        down, right = np.divmod(np.arange(TILE * TILE), TILE)
        # The tiles lie one below the other in one array of pixels.
        shape = len(tiles) * TILE, TILE
        j = (top[:, None] * TILE + down).reshape(shape).astype(np.int32)
        i = (left[:, None] * TILE + right).reshape(shape).astype(np.int32)
        visit = VISITS[self._method, klass]
        facts = self._facts | visit.facts
        file = visit.file_in(self._packed.format)
        run = getattr(module(file), file)
        rest: tuple[Any, ...] = (self._packed.half_spaces,)
        row = member = int(members[0])
        regions = self.lists.regions
        region: tuple[Any, ...] = ()
        if klass in REGIONS:
            assert regions is not None
            region, rest = (member, regions.records[member]), (regions,)
            row = int(regions.records[member]["solid"])
        elif klass in STRETCHED:
            row = int(rows_of(members[:1])[0])
        if klass == Class.POLYNOMIAL:
            rest = (self._packed.polynomials,)
        elif klass == Class.FORMULA:
            rest = (self._packed.expressions,)
        solid = self._packed.solids[row]
        x = i - solid["center_x"]
        y = j + np.int32(self._first_row) - solid["center_y"]
        own: tuple[Any, ...] = ()
        if klass in STRETCHED:
            own = (np.repeat(members, TILE)[:, None],)
        seen: Seen = run(*region, solid, *rest, x, y, *own, self._chosen, facts)
        claims = seen.claims
        # Tiles at the right and lower edge have pixels outside the picture.
        here = np.minimum(j, rows - 1), np.minimum(i, width - 1)
        old = _each(_part, self._nearest, window=here)
        new = keep.keep(
            old,
            solid,
            seen.sight,
            seen.slope,
            seen.certificate,
            NOTHING_MET if seen.met is None else seen.met,
            np.zeros(x.shape, np.uint32) if seen.turned is None else seen.turned,
            self._keys,
            facts,
        )
        if claims is not None:
            record = region[1]
            new = new._replace(
                overlap=keep.sooner_key(new.overlap, claims.overlap, record, solid),
                gap=keep.sooner_key(new.gap, claims.gap, record, solid),
            )
        shown = (j < rows) & (i < width)
        _each(_put, self._nearest, new, window=(j[shown], i[shown]), shown=shown)

    def _darkened(self, nearest: Nearest, points: Point) -> Nearest:
        """Nearest points, with the lights that do not reach them as bits of ``dark``."""
        hidden = self._packed.shadows
        if hidden is None or "shadows" not in self._facts:
            return nearest
        beams = module(self._packed.format.beam)
        veils = self._packed.veils
        of_copies = None
        if veils is not None and self.lists.regions is not None:
            of_copies = partial(
                try_veils,
                veils=veils,
                words=self.lists.regions.words,
                nearest=nearest,
                points=points,
                beams=beams,
                shared=self._packed.shared,
                facts=self._facts,
            )
        dark = shadows.find_shadows(
            hidden, nearest, points, beams, self._facts, self._packed.shared, of_copies
        )
        if "shadow_doubts" in self._facts:
            nearest = shadows.doubted_where(dark, nearest)
        return nearest._replace(dark=dark.bits)

    @property
    def _cells(self) -> Cells | None:
        """What mirrors read of the scene's cells, if it has some."""
        regions = self.lists.regions
        return None if regions is None else Cells(regions.words, regions.appearances)

    def _lights(self) -> list[Light]:
        """The lights of the frame. Those with shadows come first."""
        hidden = self._packed.shadows if "shadows" in self._facts else None
        dark = 0 if hidden is None else len(hidden.views)
        rows = enumerate(self._packed.lights)
        return [Light(row["vector"], row["color"], ix < dark) for ix, row in rows]

    def finish(self) -> Planes:
        """The requested outputs of all pixels."""
        self._finish_regions()
        found = self._found()
        planes: Planes = {}
        for name in self._outputs & DEVICE_OUTPUTS.keys() | {"surface"}:
            for plane in DEVICE_OUTPUTS[name].planes:
                value = found[plane.member]
                if plane.kept is Kept.KEY:
                    value = joined_key(*value)
                elif plane.kept is Kept.VECTOR:
                    value = np.stack(value, axis=-1)
                planes[plane.name] = value
        if "image" in self._outputs:
            planes["image"] = image_of(np.stack(found["color"], axis=-1))
        return planes

    def _found(self) -> dict[str, Any]:
        """Values (rows, width) of all pixels by name: of `Nearest`, and of the finish stage."""
        nearest = self._nearest
        if self._facts.isdisjoint({"normal", "places"}):
            return nearest._asdict()
        j, i = np.mgrid[: self._shape[0], : self._shape[1]].astype(np.int32)
        j += np.int32(self._first_row)
        points = None
        if self._packed.locations is not None and "places" in self._facts:
            beams = module(self._packed.format.beam)
            points = shadows.find_points(self._packed.locations, nearest, i, j, beams)
            nearest = self._darkened(nearest, points.point)
        if "normal" not in self._facts:
            return nearest._asdict()
        lights = self._lights()
        shown = finish.finish(nearest, i, j, self._frame, lights, self._facts)
        if points is not None and self._packed.mirrors is not None and "mirrors" in self._facts:
            asked = bounce.Asked(
                self._packed.mirrors,
                self._frame,
                lights,
                self._chosen,
                self._facts,
                self._darkened,
                self._cells,
                self._packed.shared,
            )
            color, nearest = bounce.follow_mirrors(asked, nearest, points, shown.color, i, j)
            shown = shown._replace(color=color)
        return nearest._asdict() | shown._asdict()

    def _finish_regions(self) -> None:
        """Look up the appearance of each copy of a group, on the pixels that show the copy."""
        regions, shown = self.lists.regions, self._nearest.met.region
        for number in np.unique(shown[shown != NO_REGION]).tolist():
            assert regions is not None
            region = regions.records[number]
            j, i = (places.astype(np.int32) for places in np.nonzero(shown == number))
            new = finish_regions.finish_region(
                region,
                self._packed.solids[int(region["solid"])],
                regions,
                _each(_part, self._nearest, window=(j, i)),
                i,
                j + np.int32(self._first_row),
                self._facts,
            )
            every = np.ones(len(j), bool)
            _each(_put, self._nearest, new, window=(j, i), shown=every)


def image_of(color: F32) -> Bytes:
    """sRGB pixels (H, W, 3), uint8, of linear colours (H, W, 3)."""
    words = encode.encode(srgb_table(), Vector(*np.moveaxis(color, -1, 0)))
    return words.view(np.uint8).reshape(*words.shape, 4)[..., :3].copy()


def _each(function: Callable[..., Any], *values: Any, **named: Any) -> Any:
    """Apply ``function`` to each array of nested named tuples that have the same members."""
    if not isinstance(values[0], tuple):
        return function(*values, **named)
    parts = [_each(function, *members, **named) for members in zip(*values, strict=True)]
    return type(values[0])(*parts)


def _filled(value: Array, shape: tuple[int, int]) -> Array:
    return np.full(shape, value)


def _part(whole: Array, window: tuple[Array, Array]) -> Array:
    return whole[window]


def _put(whole: Array, part: Array, window: tuple[Array, Array], shown: Bools) -> None:
    whole[window] = np.broadcast_to(part, shown.shape)[shown]


def render_band(
    scene: Scene,
    packed: Packed,
    first_row: int,
    rows: int,
    outputs: frozenset[str],
) -> Planes:
    """Outputs (rows, width, …) of picture rows ``first_row`` … ``first_row + rows - 1``.

    ``surface`` is 0 where nothing is hit. ``key`` and ``exit`` are uint64 depth keys, ``image`` is
    uint8 (…, 3), ``color`` and ``normal`` are float32 (…, 3). ``error`` gives three planes: uint64
    keys ``low``, the least depth of a certain point, and ``doubt``, the least depth of an uncertain
    one, and float32 ``bound``, the error bound of the visible point in its own u.
    """
    asks = recheck.is_possible(packed, outputs)
    band = Band(scene, packed, first_row, rows, outputs | recheck.READ if asks else outputs)
    band.visit()
    planes = band.finish()
    if asks:
        judge = partial(judged, first_row)
        recheck.settled(planes, packed, band.lists, partial(in_integers, packed, scene), judge)
        for name in recheck.READ - outputs:
            del planes[name]
    return planes


def judged(first_row: int, packed: Packed, asked: Asked) -> Answers:
    """What integers say of quads of a band that begins in the row ``first_row``.

    ``packed``: the records of `in_integers`.
    """
    known = packed.polynomials
    assert known is not None
    facts = needs_of_judge(packed).facts
    chosen = chosen_for(packed.format, "visible")
    answers = recheck.no_answers(asked)
    owner = np.repeat(asked.row, recheck.GROUP)
    for row in np.unique(asked.row).tolist():
        own = np.flatnonzero(owner == row)
        solid, place = packed.solids[row], asked.place[own, None]
        i = (place & np.uint32(0xFFFF)).astype(np.int32) * LANES + np.arange(LANES, dtype=np.int32)
        j = (place >> np.uint32(16)).astype(np.int32) + np.int32(first_row)
        at = i - solid["center_x"], j - solid["center_y"]
        seen = visit_polynomial_fixed(solid, known, *at, asked.member[own, None], chosen, facts)
        answers.verdict[own] = verdict_of(seen.certificate, seen.sight)
        answers.position[own] = seen.sight.position
        answers.bound[own] = seen.certificate.bound
    return answers
