"""Rounds of loops that an invocation takes, counted on the host before a device runs them.

A driver may end the loops of an invocation early without a word (``device.probe.loop_limit``). A
loop of k iterations takes k rounds, and one more where it is tested first: every count here has
that one.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import Ints
from halfstep.contract.classes import Class
from halfstep.contract.mirrors import MIRROR_STEPS
from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.contract.regions import PackedRegions
from halfstep.contract.veils import VEIL_ROUNDS, PackedVeils
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.shader.needs import Needs


def rounds_of_solids(needs: Needs, packed: Packed) -> Ints:
    """The most rounds (V,) that each solid of a frame takes of an invocation that tries it."""
    steps = packed.solids["steps"].astype(np.int64) + 1
    planes = packed.solids["plane_count"].astype(np.int64) + 1
    rounds = steps + planes
    if needs.method == "article":
        # A patch tries its bounds at one point. Sequences I and O try all planes of another solid
        # at every halving, and at six points more. The normals of planes are read last.
        is_patch = packed.classes == Class.PATCH
        rounds += planes * np.where(is_patch, 2, 2 * steps + 7)
        if "error" in needs.outputs:  # the other method certifies in the loop that clips
            rounds += planes
    # One walk through cells and one finish, twice for the exit, and the bounds that are tried.
    walks = 2 if "exit" in needs.outputs else 1
    tried = (BOUNDS + 1) * ("error" in needs.outputs)
    of_polynomial = packed.classes == Class.POLYNOMIAL
    rounds[of_polynomial] += (walks * (CLOCKS + 1 + steps) + tried)[of_polynomial]
    # A formula tries both sides of a bound and both ends in rounds of their own, and has one for
    # each axis; where there are several, each of these asks all of them.
    of_formula = packed.classes == Class.FORMULA
    asked = walks * (CLOCKS + 1 + steps) + 2 * tried + 8
    rounds[of_formula] += (asked * (1 + 2 * len(needs.programs)))[of_formula]
    # It is come to in its list, and again where places of points are asked for.
    return np.asarray(rounds + 1 + ("places" in needs.facts))


def rounds_of_regions(needs: Needs, packed: Packed, regions: PackedRegions) -> Ints:
    """The most rounds (E,) that each record of a region takes of an invocation that tries it."""
    records = regions.records
    steps = packed.solids["steps"][records["solid"]].astype(np.int64) + 1
    flat, curved, cells, faces = (
        records[f"{name}_count"].astype(np.int64) for name in ("flat", "curved", "cell", "face")
    )
    surfaces, certified = flat + curved, "error" in needs.facts
    groups = records["end_group"].astype(np.int64) - records["first_group"]
    # All surfaces are crossed, with errors twice more, and looked up for normals and looks once for
    # all pixels that show the region.
    rounds = surfaces * (steps + 2) + 2
    rounds += certified * surfaces * (2 * steps + 5)
    rounds += 2 * surfaces + cells + faces + 5
    # A leap ends where a surface is crossed, a quadric at two places; a walk looks once more where
    # it begins and where it ends.
    looks = 2 * curved + flat + 2
    walks = 6 if certified else 2
    rounds += walks * (looks * (groups + 2) + 2)
    return np.asarray(
        rounds + 3
    )  # the last: to come to it in its list, and to see whether to try it


def rounds_of_finish(needs: Needs) -> int:
    """The most rounds that an invocation takes to shade its block."""
    return needs.quads * needs.light_rounds


def rounds_of_light(needs: Needs, packed: Packed) -> int:
    """The most rounds that an invocation takes for shadows and mirrors: it tries all solids."""
    of_shadows = of_mirrors = 0
    if packed.shadows is not None and "shadows" in needs.facts:
        # A box may be looked at alone, and so may that of its group, and of that one's.
        slabs = packed.shadows.occluders["slab_count"].astype(np.int64)
        of_shadows = int((slabs + 5).sum()) + 2 * len(packed.shadows.views)
    if packed.veils is not None and "veils" in needs.facts:
        of_shadows += _rounds_of_veils(packed.veils, needs.broadcast)
    if packed.mirrors is not None and "mirrors" in needs.facts:
        faces = packed.mirrors.bodies["face_count"].astype(np.int64)
        of_mirrors = int((faces + MIRROR_STEPS + 5).sum())
    bounces = needs.bounces if of_mirrors else 0
    return of_shadows + bounces * (of_mirrors + of_shadows + needs.quads * needs.light_rounds + 1)


def _rounds_of_veils(veils: PackedVeils, together: int) -> int:
    """The most rounds that an invocation takes for shadows of copies.

    It looks at all boxes, ``together`` at once, in two loops.
    """
    return VEIL_ROUNDS + 2 * (len(veils.records) // together) + 4 * len(veils.views)


def exceed(needs: Needs, packed: Packed, lists: Lists, granted: int) -> bool:
    """Whether an invocation of some tile may take more than ``granted`` rounds."""
    rounds = rounds_of_members(needs, packed, lists)
    left = granted - rounds_of_finish(needs) - rounds_of_light(needs, packed)
    total = np.zeros(len(rounds) + 1, np.int64)
    np.cumsum(rounds, out=total[1:])
    edges = lists.starts[:: max(len(needs.classes), 1)].astype(np.int64)
    return int(np.diff(total[edges]).max(initial=0)) > left


def rounds_of_members(needs: Needs, packed: Packed, lists: Lists) -> Ints:
    """The most rounds that each member of the lists of tiles takes."""
    if lists.regions is None:
        return rounds_of_solids(needs, packed)[lists.members]
    slot = np.repeat(np.arange(len(lists.starts) - 1) % len(needs.classes), np.diff(lists.starts))
    is_region = np.isin(needs.classes, (Class.REGION, Class.REGION_INSIDE))[slot]
    rounds = np.empty(len(lists.members), np.int64)
    regions = rounds_of_regions(needs, packed, lists.regions)
    rounds[is_region] = regions[lists.members[is_region]]
    rounds[~is_region] = rounds_of_solids(needs, packed)[lists.members[~is_region]]
    return rounds
