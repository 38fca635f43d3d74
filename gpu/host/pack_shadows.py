"""Occluders as the records that the shaders and the twin read."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Floats, Ints, Records, never_change
from halfstep.contract.expressions import PackedExpressions, is_tame
from halfstep.contract.formats import FIXED32, FLOAT32, Format
from halfstep.contract.layout import Shade
from halfstep.contract.shadows import GROUP, MANY, PackedShadows
from halfstep.host.casters import Caster
from halfstep.host.expressions import Expressions
from halfstep.host.forms import FAINT
from halfstep.host.occluders import Occluder, Shadows
from halfstep.host.roundings import counted

# Integer coefficients are scaled so that no value of a form exceeds 2^VALUE_BITS, with a radius of
# 2^RADIUS_BITS.
VALUE_BITS, RADIUS_BITS = 29, 28
# The largest magnitudes, in radii, of hh, ah, bh, aa, ab, bb, and of h, a, b.
QUADRATIC_REACH = np.array([1.0, 2.0, 2.0, 4.0, 4.0, 4.0])
LINEAR_REACH = np.array([1.0, 2.0, 2.0])
# Boxes are wider than solids by so many units, because float32 holds 24 bits of 30, and shears.
BOX_MARGIN = 2.0**9
# The coordinates of a box that nothing touches, and of an infinite end.
NOWHERE = 3e38
# Half the spacing of floats at 1, and room for the rounding of bounds themselves.
EPSILON, ROOM = 2.0**-24, 1.03
# Points of rays of which a formula is asked lie in its box, made larger by this factor.
COUNTED = 1 + 2.0**-7
# Number of boxes behind the last one: the most invocations of a subgroup.
SPARE_BOXES = 16


class ShadowTables:
    """Records of the occluders of a scene's lights, which do not depend on the camera."""

    def __init__(self, shadows: Shadows) -> None:
        self.shadows = shadows

    def packed(self, number_format: Format) -> PackedShadows:
        """The records of frames in a number format."""
        return self._packed(number_format is FIXED32)

    @functools.cache  # noqa: B019 - two entries, and they last as long as the scene
    def _packed(self, integer: bool) -> PackedShadows:
        shadows = self.shadows
        views, occluders, slabs, boxes, sides = self._tables(integer)
        every = (one.caster for hiding in shadows.occluders for one in hiding)
        casting = [each for each in every if each is not None]
        casters = caster_records(casting)
        formulas = caster_formulas(casting, shadows.expressions)
        never_change([views, occluders, slabs, boxes, sides, casters])
        return PackedShadows(
            views=views,
            occluders=occluders,
            slabs=slabs,
            boxes=boxes,
            sides=sides,
            far_lights=shadows.far_lights,
            curves=any(one.has_quadric for hiding in shadows.occluders for one in hiding),
            many=max(map(len, shadows.occluders)) > MANY,
            encloses=any(one.encloses for hiding in shadows.occluders for one in hiding),
            casters=casters,
            formulas=formulas,
        )

    def _tables(self, integer: bool) -> tuple[Records, Records, Records, Records, Records]:
        """Views, occluders, slabs, boxes and sides in a number format."""
        number_format, shadows = FIXED32 if integer else FLOAT32, self.shadows
        every = [one for hiding in shadows.occluders for one in hiding]
        lengths = np.array([len(hiding) for hiding in shadows.occluders])
        rooms = np.maximum(-(-lengths // GROUP**2), 1) * GROUP**2
        firsts, room = np.cumsum(rooms) - rooms, int(rooms.sum())
        places = np.arange(len(every)) + np.repeat(firsts - np.cumsum(lengths) + lengths, lengths)
        views = np.zeros(len(shadows.lights), layout.LIGHT_VIEW.dtype())
        views["first"], views["end"] = firsts, firsts + lengths
        views["groups"] = room + firsts // GROUP
        views["far_groups"] = room + room // GROUP + firsts // GROUP**2
        for record, bit, (axes, place) in zip(views, shadows.lights, shadows.views, strict=True):
            record["bit"] = 1 << bit
            record["axis"], record["sign"] = axes.axis, axes.sign
            record["shear_x"], record["shear_y"] = axes.shear
            record["origin"] = place
        sides = _sides(shadows)
        views["sides"] = len(sides)
        occluders = np.zeros(room, layout.OCCLUDER.dtype(number_format))
        counts = np.array([len(one.slabs) for one in every], np.int64)
        occluders["slab_count"][places] = counts
        occluders["slab_start"][places] = np.cumsum(counts) - counts
        slabs = np.zeros(counts.sum(), layout.SLAB.dtype(number_format))
        has_caster = np.array([one.caster is not None for one in every], bool)
        occluders["caster"][places] = np.where(has_caster, np.cumsum(has_caster), 0)
        bits = np.repeat(views["bit"], lengths)
        for place, one, bit in zip(places, every, bits, strict=True):
            record = occluders[place]
            fill(record, one, shadows, integer=integer)
            record["bit"] = bit
            own = slabs[record["slab_start"] :][: len(one.slabs)]
            scale = _scales(one, integer)
            scaled = one.slabs * scale[:, None, None], one.widths * scale
            c_b, own["width"] = (np.rint(part) for part in scaled) if integer else scaled
            own["c"], own["b"] = c_b[:, 0], c_b[:, 1]
            numbers = one.numbers.astype(np.uint32)
            own["numbers"] = numbers[:, 0] | (numbers[:, 1] << np.uint32(layout.SLAB_BITS))
        return views, occluders, slabs, self._boxes(occluders, places), sides

    def _boxes(self, occluders: Records, places: Ints) -> Records:
        """The boxes of occluders, which are at ``places`` among their records, and of groups."""
        shadows, room = self.shadows, len(occluders)
        ends = np.cumsum([room, room // GROUP, room // GROUP**2])
        boxes = np.zeros(ends[-1] + SPARE_BOXES, layout.BOX.dtype())
        boxes["low"], boxes["high"] = NOWHERE, -NOWHERE
        every = [one for hiding in shadows.occluders for one in hiding]
        if not every:
            return boxes
        spans = np.array([one.box for one in every])
        is_far = np.repeat(
            np.arange(len(shadows.occluders)) < shadows.far_lights,
            [len(hiding) for hiding in shadows.occluders],
        )
        # For lamps, the way across over the way along has a margin already.
        margin = BOX_MARGIN * np.array([[-1.0], [1.0]]) * np.ones(3)
        spans += np.where(is_far[:, None, None], margin, margin * [0.0, 0.0, 1.0])
        spans = np.clip(spans, -NOWHERE, NOWHERE)
        boxes["low"][places], boxes["high"][places] = spans[:, 0], spans[:, 1]
        boxes["lit"][places] = [one.beyond for one in every]
        never = (occluders["flags"] & Shade.SELF) == 0
        for name in ("first", "count"):
            boxes[name][:room] = np.where(never, occluders[name], 0)
        inner = boxes[:room]
        for begin, end in itertools.pairwise(ends):
            outer = boxes[begin:end]
            outer["low"] = inner["low"].reshape(-1, GROUP, 3).min(axis=1)
            outer["high"] = inner["high"].reshape(-1, GROUP, 3).max(axis=1)
            inner = outer
        return boxes


def fill(record: np.void, one: Occluder, shadows: Shadows, *, integer: bool) -> None:
    """Write the record of an occluder."""
    forms = _scaled_forms(one.forms, integer)
    record["a"], record["g"], record["c"] = forms
    record["end"] = np.rint(one.end * 2.0**RADIUS_BITS) if integer else one.end
    record["unit"], record["level"] = 2.0**-one.level, one.level
    record["center"] = one.center
    record["axis"], record["sign"] = one.axes.axis, one.axes.sign
    record["shear_x"], record["shear_y"] = one.axes.shear
    if one.reach:
        record["reach"], record["weight"] = one.reach, 1 / one.reach
        # The record holds 2^28/reach with 30 bits.
        shift = 29 - RADIUS_BITS + math.ceil(math.log2(one.reach))
        record["factor"] = np.rint(2.0 ** (RADIUS_BITS + shift) / one.reach)
        record["factor_shift"] = shift
    flags = Shade.CASTS * bool(shadows.casts[one.solid])
    flags |= Shade.AT_LAMP * one.at_lamp | Shade.ENCLOSES * one.encloses
    record["flags"] = flags | Shade.FLAT * one.is_patch | Shade.SELF * one.hides_itself
    record["curve"] = _curve(one, shadows)
    record["first"] = shadows.world.first_surface[one.solid]
    record["count"] = shadows.world.surface_count[one.solid]


def _curve(one: Occluder, shadows: Shadows) -> int:
    """The number of the quadric of an occluder among surfaces, 0 if it has none."""
    first = int(shadows.world.first_surface[one.solid])
    if one.caster is not None and one.caster.is_in_ball:
        return first + int(shadows.world.surface_count[one.solid]) - 1
    return first if one.has_quadric else 0


def _sides(shadows: Shadows) -> Records:
    """Which lights do not reach surfaces of solids (1 + S,), whatever stands before them."""
    world, solids = shadows.world, shadows.solid_count
    count = 1 + int(world.surface_count[:solids].sum())
    sides = np.zeros(count, layout.SIDE.dtype())
    for light, hiding in zip(shadows.lights, shadows.occluders, strict=True):
        bit = np.uint32(1 << light)
        for place, one in enumerate(hiding, start=1):
            first = int(world.first_surface[one.solid])
            if shadows.casts[one.solid] and one.caster is None and not one.encloses | one.is_patch:
                own = sides[first : first + int(world.surface_count[one.solid])]
                own["back"] |= bit
            # The surface of a bounded plane has the number of its first side.
            rows = (one.numbers + first - one.is_patch)[one.numbers > 0]
            lit = one.lit[one.numbers > 0]
            sides["front"][rows[~lit]] |= bit
            sides["back"][rows[lit]] |= bit
            sides["opened"][rows[lit]] |= bit
            sides["curve"][_curve(one, shadows)] = place
    sides[0] = 0
    return sides


def _scaled_forms(forms: Floats, integer: bool) -> Floats:
    """A, G, C (3, 6) as coefficients of a number format."""
    if not integer:
        return forms
    largest = float((np.abs(forms) * QUADRATIC_REACH).sum(axis=1).max())
    return np.asarray(np.rint(forms * _integer_scale(largest)))


def _scales(one: Occluder, integer: bool) -> Floats:
    """The factor (S,) that takes the coefficients of each slab to a number format."""
    if not integer:
        return np.ones(len(one.slabs))
    largest = (np.abs(one.slabs) * LINEAR_REACH).sum(axis=2).max(axis=1, initial=0.0)
    # The second half-space is as far from the first as the slab is wide.
    return np.array([_integer_scale(float(each)) for each in largest + np.abs(one.widths)])


def _integer_scale(largest: float) -> float:
    """The factor that takes values of at most ``largest``, in radii, to almost 2^VALUE_BITS."""
    return 2.0**VALUE_BITS * (1 - 2.0**-10) / largest if largest > 0 else 1.0


def caster_records(casters: Sequence[Caster]) -> Records | None:
    """Records of casters; None if there are none."""
    if not casters:
        return None
    record = layout.CASTER.counted(CASTER_TERMS=len(casters[0].terms))
    records = np.zeros(len(casters), record.dtype())
    for name, column in zip(("level", "by_x", "by_y", "by_v"), range(4), strict=True):
        records[name] = [one.axes[column] for one in casters]
    records["shrink"] = [one.shrink for one in casters]
    records["rounding"] = [ROOM * EPSILON * (6 * one.degree + 5) for one in casters]
    records["sheet"] = [one.is_sheet for one in casters]
    records["ball"] = [one.is_in_ball for one in casters]
    is_formula = np.array([one.formula is not None for one in casters])
    records["formula"] = np.where(is_formula, np.cumsum(is_formula), 0)
    records["center"] = [one.center for one in casters]
    records["size"] = [one.size for one in casters]
    records["pairs"] = [one.pairs for one in casters]
    records["off"] = np.array([one.off for one in casters]) / records["rounding"][:, None]
    records["terms"] = [np.where(np.abs(one.terms) < FAINT, 0.0, one.terms) for one in casters]
    return records


def caster_formulas(
    casters: Sequence[Caster], known: Expressions | None
) -> PackedExpressions | None:
    """Records of the casters that are no polynomials, in their order; None if there are none."""
    forms = [one.formula for one in casters if one.formula is not None]
    if not forms or known is None:
        return None
    records = np.zeros(len(forms), layout.EXPRESSION.counted(NUMBERS=known.numbers).dtype())
    of_formulas = (one for one in casters if one.formula is not None)
    for record, one, form in zip(records, of_formulas, forms, strict=True):
        record["host_error"] = one.point_error
        record["formula"] = known.programs.index(form.program)
        record["numbers"][: len(form.numbers)] = form.numbers
        if is_tame(form.program):
            # The coefficients of x and y are counted with the others.
            along = np.diag(one.size * COUNTED)
            level = np.diag(np.abs(one.center)) + along
            errors = counted(form.program, form.numbers, level, along, one.point_error)
            record["value_error"], record["slope_error"], record["bend_error"] = errors
    never_change([records])
    none = np.zeros(0, layout.HALF_SPACE.dtype())
    return PackedExpressions(records, none, known.programs, known.numbers, has_balls=False)
