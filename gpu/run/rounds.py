"""The host counts the loop rounds of an invocation before the device runs them.

A driver may end the loops of an invocation early and report nothing (``device.probe.loop_limit``).
A loop of k iterations takes k rounds, or k + 1 if its condition is tested first. Every count here
assumes k + 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Ints
from halfstep.contract.classes import REGIONS, Class
from halfstep.contract.formats import FIXED32
from halfstep.contract.layout import LANES
from halfstep.contract.mirrors import MIRROR_STEPS, PackedReflected
from halfstep.contract.powers import (
    BOUNDS,
    CAST_STEPS,
    CLOCKS,
    PLACE_HALVINGS,
    SEARCH_HALVINGS,
    SLOPE_HALVINGS,
)
from halfstep.contract.regions import PackedRegions
from halfstep.contract.stretches import rows_of
from halfstep.contract.veils import PackedVeils, rounds_of_higher
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.shader.needs import Needs


def rounds_of_solids(needs: Needs, packed: Packed) -> Ints:
    """The most rounds (V,) that an invocation takes to try each of the frame's V solids."""
    steps = packed.solids["steps"].astype(np.int64) + 1
    planes = packed.solids["plane_count"].astype(np.int64) + 1
    rounds = steps + planes
    if needs.method == "article":
        # A patch tests its half-spaces at one point. For other solids, sequences I and O test all
        # half-spaces at every halving and at six points more. Reading their normals comes last.
        is_patch = packed.classes == Class.PATCH
        rounds += planes * np.where(is_patch, 2, 2 * steps + 7)
        if "error" in needs.outputs:  # the method visible certifies in its clipping loop
            rounds += planes
    # Rounds of one walk through cells and one finish, twice if the exit is asked for, and one
    # round for each error bound that is tried.
    walks = 2 if "exit" in needs.outputs else 1
    tried = (BOUNDS + 1) * ("error" in needs.outputs)
    if Class.POLYNOMIAL in needs.classes:
        of_polynomial = packed.classes == Class.POLYNOMIAL
        asked = walks * (CLOCKS + 1 + steps) + tried
        if needs.format is FIXED32:
            # The four roots of half-spaces and a ball, F at both ends, and a slope about each.
            asked = walks * (SEARCH_HALVINGS + 1 + steps) + 6 * (PLACE_HALVINGS + 1)
            asked += 2 * (SLOPE_HALVINGS + 1)
        rounds[of_polynomial] += asked[of_polynomial]
    # A formula takes a round for each side of an error bound, for each end of the interval and for
    # each axis. Each halving may take a jet, and a look whether the jet tells the next one; those
    # of caps come before. If there are several programs, each of these rounds asks every program.
    if Class.FORMULA in needs.classes:
        of_formula = packed.classes == Class.FORMULA
        asked = walks * (CLOCKS + 4 + 4 * steps) + 2 * tried + 8
        rounds[of_formula] += (asked * (1 + 2 * len(needs.programs)))[of_formula]
    # One round comes to the solid in the tile's list, and one more if places of points are needed.
    return np.asarray(rounds + 1 + ("places" in needs.facts))


class _Tried(NamedTuple):
    """What the rounds depend on that records of regions (E,) take."""

    steps: Ints
    flat: Ints  # planes, quadrics and cells in the list
    curved: Ints
    cells: Ints
    groups: Ints  # groups of words
    inside: Bools  # rays may start inside

    @classmethod
    def of(cls, packed: Packed, regions: PackedRegions) -> _Tried:
        """That of each record."""
        records = regions.records
        flat, curved, cells = (
            records[f"{name}_count"].astype(np.int64) for name in ("flat", "curved", "cell")
        )
        return cls(
            packed.solids["steps"][records["solid"]].astype(np.int64),
            flat,
            curved,
            cells,
            records["end_group"].astype(np.int64) - records["first_group"],
            packed.classes[records["solid"]] == Class.REGION_INSIDE,
        )

    @property
    def most(self) -> _Tried:
        """One record that takes no fewer rounds than any."""
        return _Tried(*(each.max(initial=0, keepdims=True) for each in self))


def rounds_of_regions(needs: Needs, packed: Packed, regions: PackedRegions) -> Ints:
    """The most rounds (E,) that an invocation takes to try each of the E records of regions."""
    return _rounds_of_records(needs, regions, _Tried.of(packed, regions))


def _rounds_of_records(needs: Needs, regions: PackedRegions, tried: _Tried) -> Ints:
    """The most rounds (E,) for what E of the records have."""
    records = regions.records
    _, flat, curved, cells, groups, inside = tried
    steps, certified = tried.steps + 1, "error" in needs.facts
    surfaces = flat + curved
    # Every surface is crossed once, and twice more for `error`. Every surface is looked up for
    # normals and appearances once for all pixels that show the region.
    rounds = surfaces * (steps + 2) + 2
    rounds += certified * surfaces * (2 * steps + 5)
    rounds += surfaces + cells + 6
    # A walk leaps from crossing to crossing: two for a quadric, one for a plane, which is two where
    # F > 0 is not asked of what F <= 0 is. It looks once more at its begin and at its end.
    looks = 2 * curved + (1 + certified) * flat + 2
    if regions.higher is not None:
        # A surface of an order above two tries cells, halves each root and looks for its bounds.
        # Each root, and the rest behind the last one, begins anew.
        counts = regions.words[records["list_start"].astype(np.int64) + surfaces + cells]
        higher, pairs = counts.astype(np.int64), regions.pairs
        roots = 2 * pairs + 1
        asked = CLOCKS * pairs + roots * (steps + 2 * BOUNDS + 4)
        # A formula asks for both sides of a bound in turn, and for each axis. If there are several
        # programs, each of these rounds asks every program.
        asked *= 1 + 2 * len(needs.programs) if needs.higher_formulas else 1
        rounds += higher * (asked + 6 * pairs + 16)
        looks += higher * 2 * pairs
    rounds += _walks(needs, inside) * (looks * (groups + 2) + 1) + 1
    # Three come to the record in the tile's list, and decide whether to try it.
    return np.asarray(rounds + 3)


def _walks(needs: Needs, inside: Bools) -> Ints:
    """How many walks there are through each of some copies, ``inside`` of which rays may start."""
    facts = needs.facts
    count = np.where(inside | ("leaving" in facts), 2, 1)
    if "claims" in facts:
        count = np.full(len(inside), 6)
    if "error" in facts:
        count = np.where("claims" in facts, 6, 2) + np.where(inside, 4, 2)
    return np.asarray(count)


def rounds_of_finish(needs: Needs) -> int:
    """The most rounds that an invocation takes to shade its block, whatever it shows."""
    # Where it shows no region, it looks for one in each list, and looks one up.
    of_regions = 8 + needs.surfaces if needs.has_regions else 0
    return needs.quads * needs.light_rounds + of_regions


def rounds_of_light(needs: Needs, packed: Packed) -> int:
    """The most rounds that an invocation takes for shadows and mirrors, which try all solids."""
    of_shadows = of_mirrors = 0
    if packed.shadows is not None and "shadows" in needs.facts:
        # An occluder, its box, and those of its group and of that group's group take a round each.
        slabs = packed.shadows.occluders["slab_count"].astype(np.int64)
        of_shadows = int((slabs + 6).sum()) + 2 * len(packed.shadows.views)
        # Each quadric that is shown, before each light.
        shown = min(packed.solid_count, LANES * needs.quads * needs.broadcast)
        of_shadows += (shown + 1) * (len(packed.shadows.views) + 2)
        casters = packed.shadows.casters
        if casters is not None:
            # If there are several programs, each round of a formula asks every program.
            asks = 1 + 2 * len(needs.programs) if needs.cast_formulas else 1
            of_form = (CLOCKS + 1) * asks + 2
            of_shadows += len(casters) * (needs.quads * of_form + 1)
    if packed.mirrors is not None and "mirrors" in needs.facts:
        # All boxes, and the half-spaces of all bodies to find what is met, and to look at it.
        faces = packed.mirrors.bodies["face_count"].astype(np.int64)
        of_mirrors = 2 * len(packed.mirrors.hulls) + 2 * int((faces + 5).sum()) + MIRROR_STEPS
        of_mirrors += needs.quads * needs.light_rounds + 1
        if packed.mirrors.casters is not None:
            # Cells and halvings to find what is met, and a round each time to fetch a form.
            asks = 1 + 2 * len(needs.programs) if needs.body_formulas else 1
            asked = needs.quads * ((CLOCKS + CAST_STEPS + 1) * asks + 2) + 2 * asks + 4
            of_mirrors += len(packed.mirrors.casters) * asked
    of_cells, beyond = _rounds_of_cells(needs, packed), 0
    if needs.counted_rounds:
        beyond = _rounds_beyond(needs, packed)
        of_cells = min(of_cells, needs.counted_rounds + beyond)
    bounces = _bounces(needs, packed)
    of_cells += (1 + bounces) * _rounds_of_boxes(needs, packed)
    return (1 + bounces) * of_shadows + bounces * of_mirrors + of_cells


def _bounces(needs: Needs, packed: Packed) -> int:
    """How often an invocation follows rays from mirrors."""
    return needs.bounces if packed.mirrors is not None and "mirrors" in needs.facts else 0


def left_for_cells(needs: Needs, packed: Packed, granted: int, together: int) -> int:
    """The rounds after which an invocation tries no more veils, and no more cells in mirrors.

    0 if it takes fewer for all. They are about half of the rounds ``granted``, and a power of two,
    so that scenes share shaders. A driver may count the rounds of ``together`` invocations that
    branch one by one.
    """
    of_cells = _rounds_of_cells(needs, packed)
    if not of_cells:
        return 0
    room = granted // 2 // together - _rounds_beyond(needs, packed)
    room -= (1 + _bounces(needs, packed)) * _rounds_of_boxes(needs, packed)
    left = 1 << (max(room, 1).bit_length() - 1)
    return left if of_cells > left else 0


def _rounds_of_cells(needs: Needs, packed: Packed) -> int:
    """The most rounds for all veils of all lights and all copies in mirrors, as shaders count."""
    bounces = _bounces(needs, packed)
    veils, copies = _veils(needs, packed), _copies(needs, packed)
    of_veils = 0 if veils is None else _rounds_of_veils(needs, veils)
    of_copies = 0 if copies is None else int(_rounds_of_copies(needs, copies, whole=True).sum())
    return (1 + bounces) * of_veils + bounces * of_copies


def _rounds_beyond(needs: Needs, packed: Packed) -> int:
    """The most rounds that veils and copies in mirrors take after the rounds have run out."""
    veils, copies = _veils(needs, packed), _copies(needs, packed)
    of_veils = 0 if veils is None else _rounds_beyond_veils(needs, veils)
    of_copies = 0
    if copies is not None:
        of_copies = int(_rounds_of_copies(needs, copies, whole=False).max(initial=0))
    return max(of_veils, of_copies)


def _veils(needs: Needs, packed: Packed) -> PackedVeils | None:
    return packed.veils if "veils" in needs.facts else None


def _copies(needs: Needs, packed: Packed) -> PackedReflected | None:
    if packed.mirrors is None or "body_cells" not in needs.facts:
        return None
    return packed.mirrors.reflected


def _rounds_of_copies(needs: Needs, reflected: PackedReflected, *, whole: bool) -> Ints:
    """The most rounds (I,) that an invocation takes for each copy of a group in one bounce.

    Without the ``whole``, each walk takes one look.
    """
    copies = reflected.copies
    names = ("flat_count", "curved_count", "higher_count", "cells", "first_group", "end_group")
    flat, curved, higher, cells, first, end = (copies[name].astype(np.int64) for name in names)
    # A walk as in `rounds_of_regions`: in and out, and for `error` twice more. All surfaces are
    # crossed and looked at, and for `error` looked at once more.
    certified = "error" in needs.facts
    looks = 2 * curved + (1 + certified) * flat + 2 * reflected.pairs * higher + 2
    looks = looks if whole else np.ones_like(looks)
    walks = needs.quads * (6 if certified else 2)
    surfaces = (2 + certified * needs.quads) * (flat + curved)
    surfaces += (rounds_of_higher(reflected.pairs) + certified * reflected.pairs + 4) * higher
    return np.asarray(surfaces + cells + walks * (looks * (end - first + 2) + 2) + 12)


def _rounds_of_boxes(needs: Needs, packed: Packed) -> int:
    """The most rounds for the boxes of all veils, of which invocations look at some together."""
    veils = _veils(needs, packed)
    if veils is None:
        return 0
    return 2 * (len(veils.records) // needs.broadcast) + 4 * len(veils.views)


def _rounds_of_veils(needs: Needs, veils: PackedVeils) -> int:
    """The most rounds for all veils of all lights, as the shader counts them."""
    flat, curved, higher = _counts_of_veils(veils)
    # As in `rounds_of_regions`. A surface of an order above two may be crossed at each of its ends,
    # and for certificates in other places.
    looks = 2 * curved + flat + 2 * veils.pairs * higher + 2
    looks = _walks_of_veils(needs) * looks * _rounds_of_look(veils)
    return int((flat + curved + 6 + rounds_of_higher(veils.pairs) * higher + looks).sum())


def _rounds_beyond_veils(needs: Needs, veils: PackedVeils) -> int:
    """The most rounds that a veil takes after the rounds have run out."""
    flat, curved, higher = _counts_of_veils(veils)
    surfaces = flat + curved + rounds_of_higher(veils.pairs) * higher
    return int((surfaces + 6 + _walks_of_veils(needs) * _rounds_of_look(veils)).max())


def _counts_of_veils(veils: PackedVeils) -> list[Ints]:
    """The planes, quadrics and other surfaces (N,) of each veil."""
    return [veils.records[f"{of}_count"].astype(np.int64) for of in ("flat", "curved", "higher")]


def _rounds_of_look(veils: PackedVeils) -> Ints:
    """The rounds (N,) of one look at each veil's region."""
    return veils.records["end_group"].astype(np.int64) - veils.records["first_group"] + 2


def _walks_of_veils(needs: Needs) -> int:
    """How many walks there are through a veil: a light inside needs another one.

    Two more tell whether the answer of each is certain.
    """
    walks = 2 if "encloses" in needs.facts else 1
    return needs.quads * walks * (3 if {"veil_higher", "error"} <= needs.facts else 1)


def exceed(needs: Needs, packed: Packed, lists: Lists, granted: int) -> Bools:
    """The tiles (T,) of which an invocation may take more than ``granted`` rounds."""
    left = granted - rounds_of_finish(needs) - rounds_of_light(needs, packed)
    edges = _edges(lists)
    counts = np.diff(edges)
    longest = int(counts.max(initial=0))
    if longest * _most_rounds(needs, packed, lists.regions) <= left:
        return np.zeros(len(counts), bool)  # most frames need no sums
    total = _sums(rounds_of_members(needs, packed, lists))
    return np.asarray(np.diff(total[edges]) > left)


def _most_rounds(needs: Needs, packed: Packed, regions: PackedRegions | None) -> int:
    """A number of rounds that no member of a list exceeds."""
    most = int(rounds_of_solids(needs, packed).max(initial=0))
    if regions is None:
        return most
    tried = _Tried.of(packed, regions)
    # Lists of higher surfaces are looked up record by record.
    rounds = _rounds_of_records(needs, regions, tried if regions.higher is not None else tried.most)
    return max(most, int(rounds.max(initial=0)))


def fits(needs: Needs, packed: Packed, lists: Lists, granted: int) -> Bools:
    """Of the M members of the tiles' lists, those that come first in each and take no more.

    None of a tile's do whose first takes more than ``granted`` rounds.
    """
    left = granted - rounds_of_finish(needs) - rounds_of_light(needs, packed)
    edges = _edges(lists)
    total = _sums(rounds_of_members(needs, packed, lists))
    before = np.repeat(total[edges[:-1]], np.diff(edges))
    return np.asarray(total[1:] - before <= left)


def _edges(lists: Lists) -> Ints:
    """Where the members of each of T tiles begin, and the last ones end (T + 1,)."""
    return lists.starts[:: max(len(lists.classes), 1)].astype(np.int64)


def _sums(rounds: Ints) -> Ints:
    """The sums of the first of them, from none to all."""
    return np.concatenate([[0], np.cumsum(rounds)])


def rounds_of_members(needs: Needs, packed: Packed, lists: Lists) -> Ints:
    """The most rounds (M,) that each of the M members of the tiles' lists takes."""
    if lists.regions is None:
        return rounds_of_solids(needs, packed)[rows_of(lists.members)]
    slot = np.repeat(np.arange(len(lists.starts) - 1) % len(lists.classes), np.diff(lists.starts))
    is_region = np.isin(lists.classes, [*REGIONS])[slot]
    rounds = np.empty(len(lists.members), np.int64)
    regions = rounds_of_regions(needs, packed, lists.regions)
    rounds[is_region] = regions[lists.members[is_region]]
    rounds[~is_region] = rounds_of_solids(needs, packed)[rows_of(lists.members[~is_region])]
    return rounds
