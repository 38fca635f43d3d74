"""Veils as the records that the shaders and the twin read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import U32, Floats, Ints, never_change
from halfstep.contract.powers import solid_degree
from halfstep.contract.program import GROUP
from halfstep.contract.veils import PackedVeils
from halfstep.host.formulas import Excerpt
from halfstep.host.occluders import Shadows
from halfstep.host.pack_shadows import BOX_MARGIN, NOWHERE, SPARE_BOXES, caster_records, fill
from halfstep.host.veils import Veiled

# Members of records that tell the position of an excerpt.
WRITTEN = (
    *("first_group", "end_group", "list_start"),
    *("flat_count", "curved_count", "higher_count"),
)


def pack_veils(shadows: Shadows, veiled: tuple[tuple[Veiled, ...], ...]) -> PackedVeils | None:
    """The records of veils for the lights of ``shadows``; None if there are no veils."""
    every = [one for before in veiled for one in before]
    if not any(one.veils for one in every):
        return None
    views = np.zeros(len(veiled), layout.VEIL_VIEW.dtype())
    counts = [sum(len(one.veils) for one in before) for before in veiled]
    views["end"] = np.cumsum(counts)
    views["first"] = views["end"] - counts
    flat, flat_start = _joined([one.planes for one in every])
    curved, curved_start = _joined([one.quadrics for one in every])
    flats = np.zeros(len(flat), layout.VEIL_FLAT.dtype())
    flats["c"], flats["b"] = flat[:, 0], flat[:, 1]
    curves = np.zeros(len(curved), layout.VEIL_CURVED.dtype())
    for place, name in enumerate("agc"):
        curves[name] = curved[:, place]

    veils = [(row, veil) for row, one in enumerate(every) for veil in one.veils]
    owner = np.array([row for row, _ in veils], np.int64)
    records = np.zeros(len(veils), layout.VEIL.dtype())
    records["low"] = [veil.low for _, veil in veils]
    records["high"] = [veil.high for _, veil in veils]
    records["first"] = [veil.first for _, veil in veils]
    records["last"] = [veil.last for _, veil in veils]
    records["copy"] = owner
    records["flat_start"], records["curved_start"] = flat_start[owner], curved_start[owner]
    records["planes"] = np.array([len(one.planes) for one in every])[owner]
    programs = Programs()
    higher = [each for one in every for each in one.higher]
    before = np.cumsum([0, *(len(one.higher) for one in every)])[:-1]
    records["higher_start"] = before[owner]
    lower = [len(one.planes) + len(one.quadrics) for one in every]
    records["lower"] = np.array(lower)[owner]
    written = [
        programs.add(veil.excerpt, len(every[row].planes), lower[row]) for row, veil in veils
    ]
    for name, column in zip(WRITTEN, np.array(written, np.uint32).T, strict=True):
        records[name] = column

    # For lamps, the way across over the way along has a margin already.
    margins = np.array([[0.0, 0.0, BOX_MARGIN], [BOX_MARGIN] * 3])
    far = sum(len(before) for before in veiled[: shadows.far_lights])
    margin = margins[(owner < far).astype(np.int64)]
    spans = np.array([veil.box for _, veil in veils])
    spans = np.clip(spans + np.stack([-margin, margin], axis=1), -NOWHERE, NOWHERE)
    boxes = np.zeros(len(veils) + SPARE_BOXES, layout.BOX.dtype())
    boxes["low"], boxes["high"] = NOWHERE, -NOWHERE
    boxes["low"][: len(veils)], boxes["high"][: len(veils)] = spans[:, 0], spans[:, 1]

    copies = np.zeros(len(every), layout.OCCLUDER.dtype())
    for record, one in zip(copies, every, strict=True):
        fill(record, one.occluder, shadows, integer=False)
    excerpts = [veil.excerpt for _, veil in veils]
    casters = caster_records(higher)
    never_change([views, records, boxes, copies, flats, curves, casters])
    return PackedVeils(
        views=views,
        records=records,
        boxes=boxes,
        copies=copies,
        flat=flats,
        curved=curves,
        higher=casters,
        words=programs.words,
        most_crossings=max(one.crossings for one in excerpts),
        levels=max(one.levels for one in excerpts),
        encloses=any(one.occluder.encloses for one in every),
        has_hidden=any(one.has_hidden for one in every),
        degree=solid_degree(len(higher[0].terms)) if higher else 0,
        pairs=max((one.pairs for one in higher), default=0),
    )


def _joined(parts: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Arrays one after another, and the start of each."""
    counts = np.array([len(part) for part in parts], np.int64)
    return np.concatenate(parts), np.cumsum(counts) - counts


class Programs:
    """Excerpts of formulas as words, each excerpt once."""

    def __init__(self, start: int = 0) -> None:
        """``start``: how many words are before them, a multiple of `GROUP`."""
        self._parts: list[U32] = [np.zeros(0, np.uint32)]
        self._length = start
        self._known: dict[tuple[bytes, bytes, int, int], tuple[int, ...]] = {}

    def add(self, excerpt: Excerpt, planes: int, lower: int) -> tuple[int, ...]:
        """The members ``WRITTEN`` for an excerpt.

        Its program has ``planes`` planes, and ``lower`` surfaces of at most second order.
        """
        key = excerpt.words.tobytes(), excerpt.surfaces.tobytes(), planes, lower
        if key not in self._known:
            begin, words = self._length, len(excerpt.words)
            end = -(-(begin + words) // GROUP) * GROUP
            ends = np.searchsorted(excerpt.surfaces, [0, planes, lower]).tolist()
            counts = np.diff([*ends, len(excerpt.surfaces)]).tolist()
            self._known[key] = begin // GROUP, end // GROUP, end, *counts
            parts = [excerpt.words, np.zeros(end - begin - words, np.uint32)]
            parts.append(excerpt.surfaces.astype(np.uint32))
            length = sum(map(len, parts))
            parts.append(np.zeros(-length % GROUP, np.uint32))
            self._parts += parts
            self._length += length + len(parts[-1])
        return self._known[key]

    @property
    def words(self) -> U32:
        """The words of all excerpts."""
        return np.concatenate(self._parts)
