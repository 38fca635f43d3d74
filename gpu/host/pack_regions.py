"""Copies of groups as the records that the shaders and the twin read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import U32, Floats, Ints, Records
from halfstep.contract.formats import Format
from halfstep.contract.regions import PackedRegions
from halfstep.errors import SceneError
from halfstep.host.copies import MOST_KEPT, Batch, Copies, Piece
from halfstep.host.edges import monomials_of
from halfstep.host.forms import FAINT, Linear, fixed_point_scale, length
from halfstep.host.memory import Memory
from halfstep.host.regions import NO_MATERIAL, Regions
from halfstep.host.setup import BASE_PLANE_SLACK, Setup
from halfstep.host.sharing import Begun, fill
from halfstep.host.words import Excerpts
from halfstep.scene import Material, Scene
from halfstep.scene.hues import colors_of
from halfstep.scene.solids import Part

# Error of a base plane, in u, beyond its slack.
BASE_PLANE_ERROR = 2.0**-19
# As many as fit a buffer, of which WebGPU asks a device for 128 MiB.
MOST_APPEARANCES = (128 << 20) // layout.APPEARANCE.dtype().itemsize


@dataclass(frozen=True)
class Appearances:
    """Appearances of the cells, then of the surfaces, of one program after another.

    If colours depend on the copy, each copy has appearances of its own.
    """

    records: Records
    start: Ints  # (I,), first appearance of each copy
    # Whole programs as numbers, by program and whether their lists have surfaces of an order above
    # two; see `written`.
    written: dict[tuple[int, bool], Excerpts] = field(default_factory=dict)
    memory: Memory = field(default_factory=Memory)


def appearances(scene: Scene, regions: Regions) -> Appearances:
    """The appearances of all cells and surfaces."""
    rows: list[tuple[Material, bool]] = []
    start: list[int] = []
    for owned in regions.owned:
        start.append(len(rows))
        cells = [owned.group.cells[ix] for ix in owned.program.cells.tolist()]
        rows += [
            (scene.material_of(cell) if cell.is_shown else NO_MATERIAL, True) for cell in cells
        ]
        functions = owned.group.functions() if owned.group.parts else ()
        for ix in owned.program.functions.tolist():
            # Functions of regions that cut the copy come behind the group's own.
            owner = functions[ix].owner if ix < len(functions) else None
            if isinstance(owner, Part) and (owner.material or owner.color) is not None:
                rows.append((scene.material_of(owner), True))
            else:
                rows.append((NO_MATERIAL, False))
    records = np.zeros(len(rows), layout.APPEARANCE.dtype())
    records["color"] = [material.color for material, _ in rows]
    records["specular"] = [material.specular for material, _ in rows]
    records["shininess"] = [material.exponent for material, _ in rows]
    records["reflection"] = [material.reflection for material, _ in rows]
    records["is_own"] = [is_own for _, is_own in rows]
    first = np.array(start, np.int64)
    if scene.image.color_by == "place":
        return _by_place(scene, regions, records, first)
    return Appearances(records, first[regions.of])


def _by_place(scene: Scene, regions: Regions, records: Records, first: Ints) -> Appearances:
    """The appearances of each copy, whose cells have the colour of its number.

    Cells of the scene itself are in no copy, and keep their colours.
    """
    counts = np.diff(first, append=len(records))[regions.of]
    total = int(counts.sum())
    if total > MOST_APPEARANCES:
        raise SceneError(
            f"{scene.name}: image.color_by: cells and surfaces in all copies are {total:,}, not <= "
            f"{MOST_APPEARANCES:,}"
        )
    start = np.cumsum(counts) - counts
    copy = np.repeat(np.arange(regions.count), counts)
    within = np.arange(total) - start[copy]
    found = records[first[regions.of][copy] + within]
    cells = np.array([len(one.cells) for one in regions.programs], np.int64)[regions.of]
    painted = (within < cells[copy]) & (regions.number[copy] >= 0)
    found["color"][painted] = colors_of(regions.number)[copy[painted]]
    return Appearances(found, start)


def pack_regions(
    setup: Setup, looks: Appearances, steps: Ints, number_format: Format, words: U32
) -> PackedRegions:
    """Records of the copies in ``setup`` with ``steps`` (V,) halvings for each solid.

    ``words`` are those of programs that do not depend on the frame.
    """
    copies = setup.copies
    assert copies is not None
    # They take the longest, so other threads begin with them.
    surfaces = _surfaces(copies, setup, number_format, looks.memory)
    regions = copies.regions
    program = copies.program
    records = np.zeros(len(copies.row), layout.REGION.dtype(number_format))
    row = copies.row
    points = np.exp2(steps[row])

    def grid(u: Floats) -> Floats:
        """Positions u on a ray as grid points, not rounded."""
        return (u + 1) / 2 * points

    near_u, far_u, slack = setup.near_u[row], setup.far_u[row], BASE_PLANE_SLACK
    near_cut, far_cut = setup.near_cut[row], far_u != 1.0
    room = slack + BASE_PLANE_ERROR
    # Rays start two grid cells earlier, so that they surely start before the first cell.
    begin, end = np.floor(grid(copies.span[0])) - 2, np.ceil(grid(copies.span[1])) + 2
    last = np.ceil(grid(far_u))
    last_seen = np.where(far_cut, np.clip(last, 0, points), np.minimum(end, points))
    programs = regions.programs
    fill(
        records,
        {
            "first": np.clip(np.where(near_cut, np.ceil(grid(near_u)), begin), 0, points),
            "start_end": np.where(near_cut, np.floor(grid(near_u + room)), -1),
            "last": last_seen,
            "last_sure": np.where(far_cut, np.floor(grid(far_u - room)), last_seen),
            **dict(zip(("left", "right", "top", "bottom"), setup.rectangle[row].T, strict=True)),
            "flat_start": copies.first_plane,
            "curved_start": copies.first_curved,
            "surfaces": np.array([one.count for one in programs])[program],
            "planes": np.array([one.planes for one in programs])[program],
            "cells": np.array([len(one.cells) for one in programs])[program],
            "looks_start": looks.start[copies.copy],
        },
    )
    return PackedRegions(
        records=records,
        surfaces=surfaces,
        words=words,
        appearances=looks.records,
        most_surfaces=0,
        levels=max(one.formula.whole.levels for one in programs),
        has_hidden=any(one.formula.hidden.any() for one in programs),
    )


def _surfaces(
    copies: Copies, setup: Setup, number_format: Format, memory: Memory
) -> Callable[[], tuple[Records, Records]]:
    """Records of planes and of quadrics, in the order of the copies.

    If there are many, other threads write them until they are asked for.
    """
    count = int(copies.planes.sum())
    flat = memory.records("planes", count, layout.FLAT.dtype(number_format))
    curved = memory.records("quadrics", copies.count - count, layout.CURVED.dtype(number_format))

    def write(piece: Piece) -> None:
        for batch in copies.batches_of(piece):
            records = flat if isinstance(batch.forms, Linear) else curved
            _write(records, batch, copies, setup, number_format)

    if copies.count <= MOST_KEPT:
        for piece in copies.pieces:
            write(piece)
        return lambda: (flat, curved)
    begun = Begun(write, copies.pieces)

    def finished() -> tuple[Records, Records]:
        begun.finish()
        return flat, curved

    return finished


def _write(
    records: Records,
    batch: Batch,
    copies: Copies,
    setup: Setup,
    number_format: Format,
) -> None:
    """Write the forms of surfaces, their errors, and the ``EYE_…`` of each."""
    found, rows, owner = batch.forms, batch.rows, copies.row[batch.of]
    if isinstance(found, Linear):
        forms = {"c": found.c, "b": found.b}
        size = length(found.normal)
        normal = found.normal / np.where(size > 0, size, 1.0)
        records["normal"][rows] = np.where(np.abs(normal) < FAINT, 0.0, normal).T
    else:
        forms = {"a": found.a, "g": found.g, "c": found.c}
        # Numbers side by side are rounded faster than those that are written apart.
        records["gradient"][rows] = found.gradient.reshape(18, -1).astype(np.float32).T
    error = found.error
    if number_format.integer:
        offsets = monomials_of(setup.offsets[owner].T + layout.TILE)
        sums = [(np.abs(form) * offsets[: len(form)]).sum(axis=0) for form in forms.values()]
        unit = fixed_point_scale(np.max(sums, axis=0))[:, 0]
        forms = {name: np.rint(form * unit) for name, form in forms.items()}
        error = error * unit
    for name, form in forms.items():
        records[name][rows] = form.T
    records["host_error"][rows] = error
    at_eye = setup.starts_at_eye[owner]
    records["eye"][rows] = 0
    if at_eye.any():
        value = copies.value[batch.places]
        records["eye"][rows] = np.where(at_eye, np.where(value > 0, 2, 1), 0)
