"""Every stage function alone: the device's bits are the twin's, and a planted fault is seen."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple, get_origin, get_type_hints

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.contract import program as words
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT32_EXACT, Format
from halfstep.contract.layout import Flag, Shade
from halfstep.contract.powers import (
    BOUNDS,
    CAST_STEPS,
    CLOCKS,
    OFFSET_BITS,
    PLACE_HALVINGS,
    SEARCH_HALVINGS,
    SLOPE_HALVINGS,
    WEIGHT_BITS,
    solid_terms,
    term_count,
)
from halfstep.contract.srgb import SRGB_ENTRIES, srgb_quads, srgb_table
from halfstep.contract.stages import FACTS, STAGES, VISITS, Kind, files_of
from halfstep.contract.veils import VEIL_STEPS
from halfstep.device.canary import fingerprint
from halfstep.shader.library import definitions, reached, stage
from halfstep.shader.source import WORD
from halfstep.testing import Kit, MismatchError, near_ties
from halfstep.testing.census import leaves
from halfstep.testing.module import Module
from halfstep.testing.types import Pointer, dtype_of
from halfstep.twin import keys
from halfstep.twin.chosen import Chosen, chosen_for
from halfstep.twin.nearest import Key
from halfstep.twin.piece import Line
from halfstep.twin.polynomial import Offset
from halfstep.twin.reflect import NEVER
from halfstep.twin.shade import Light
from halfstep.twin.values import Value
from tests.flushing import flushing

Array = NDArray[Any]

hints_of = functools.cache(get_type_hints)

# The twin takes what all pixels of a solid share as plain numbers, so rows come in blocks that
# share them: every number of steps from 1 to 30 and every shift from 0 to 63 is there.
BLOCKS = 64
BLOCK_ROWS = 48
ROWS = BLOCKS * BLOCK_ROWS
BLOCK = np.repeat(np.arange(BLOCKS), BLOCK_ROWS)
STEPS = 1 + BLOCK % 30

# Of regions: surfaces, and words and levels of programs.
SURFACES, WORDS, LEVELS = 4, 12, 4
# Of polynomials.
DEGREE = 3
# Of ends of a surface of an order above two.
PAIRS = 2

# Colours and weights of light are never negative; zeros without a sign are what Mesa keeps.
LIT = ("ambient", "specular")
SHADERS = ("shade", "finish")

# Records of what hides lights, and files of functions that read them.
SHADOWED = (
    *("location.", "occluder.", "slab.", "body.", "face.", "hull."),
    *("veil.", "flat.", "caster."),
)
SHADOWS = ("place", "beam", "beam_fixed", "shadow", "mirror", "veil")

# Values that make products, sums and roots coincide exactly.
DYADIC = np.array([0, -0.0, 1, -1, 0.5, -0.5, 0.25, -0.25, 2, -2, 0.75, 2**-20, -(2**-20)])
# No magnitude below this: the product of three stays normal, as `setup.NEGLIGIBLE` sees to.
SMALLEST = -36
# Bits of 64-bit numbers, of 32-bit values, and of those that have other bits than most.
WIDE_BITS, VALUE_BITS, BITS = 61, 29, {"a": 26, "g": 28, "u": 30, "near_u": 30, "far_u": 30}

# What differs between formats, and is tested in each; the rest is tested once.
OF_FORMAT = {
    FLOAT32: ("arithmetic", "polynomial", "forms", "halve", "beam"),
    FLOAT32_EXACT: ("polynomial_exact", "forms_exact", "halve_incremental"),
    FIXED32: ("arithmetic_fixed", "forms_fixed", "halve_fixed", "beam_fixed", "bernstein"),
}
ON_VALUES = tuple(stage.file for stage in STAGES if stage.kind is Kind.VALUES)
ALIKE = tuple(stage.file for stage in STAGES if stage.kind is Kind.NUMBERS)


def _files(number_format: Format) -> list[str]:
    """The files whose functions are tested in a number format."""
    files = files_of(number_format, {"lines"})
    own = [name for name in files if name in OF_FORMAT[number_format]]
    if number_format is not FLOAT32_EXACT:
        differs = {name for names in OF_FORMAT.values() for name in names}
        own += [n for n in files if n in {*ON_VALUES, "lines"} - differs]
    return own + [*ALIKE, "keys_short"] * (number_format is FLOAT32)


FILES = {number_format: _files(number_format) for number_format in OF_FORMAT}


class Function(NamedTuple):
    """A function of a stage file, in a number format."""

    format: Format
    file: str
    name: str

    def __str__(self) -> str:
        return f"{self.file}.{self.name}"


FUNCTIONS = [
    Function(number_format, file, item.name.removesuffix("("))
    for number_format, names in FILES.items()
    for file in names
    for item in definitions(stage(file))
    if item.name.endswith("(")
]


TABLE = f"@group(0) @binding(0) var<uniform> srgb_table: array<vec4<u32>, {SRGB_ENTRIES}>;\n"


def _module(number_format: Format, *chosen: str) -> Module:
    """The stage files of a number format, with the declarations that they rely on."""
    shared = f"""
const MAX_LINES: u32 = 8u;
const LIGHTS: u32 = 2u;
const SHADOWS: u32 = 1u;
const VEIL_STEPS: u32 = {VEIL_STEPS}u;
const SHININESS_BITS: u32 = 11u;
const HALVINGS: Run = {number_format.run};
const SEARCHES: Run = {number_format.run};
const SURFACES: u32 = {SURFACES}u;
const CROSSINGS: u32 = {3 * SURFACES}u;
const LEVELS: u32 = {LEVELS}u;
const DEGREE: u32 = {DEGREE}u;
const PAIRS: u32 = {PAIRS}u;
const TERMS: u32 = {term_count(DEGREE)}u;
const CASTER_TERMS: u32 = {solid_terms(DEGREE)}u;
const CAST_STEPS: u32 = {CAST_STEPS}u;
const NUMBERS: u32 = 4u;
const CLOCKS: u32 = {CLOCKS}u;
const BOUNDS: u32 = {BOUNDS}u;
const OFFSET_BITS: u32 = {OFFSET_BITS}u;
const SEARCH_HALVINGS: u32 = {SEARCH_HALVINGS}u;
const PLACE_HALVINGS: u32 = {PLACE_HALVINGS}u;
const SLOPE_HALVINGS: u32 = {SLOPE_HALVINGS}u;
{"".join(f"const {name}: u32 = {getattr(words, name)}u;{chr(10)}" for name in WORD)}
var<private> programs: array<u32, {WORDS}>;
var<private> frame: Frame;
var<private> lights: array<Light, LIGHTS>;
"""
    alone = {name for item in STAGES if item.kind in ALONE for name in (item.file, *item.others)}
    # Short keys are never kept together with what needs long ones.
    alone -= {"keep", "finish"} if chosen else set()
    # Mirrors and shadows of cells and polynomials are for float32.
    of_floats = {"mirror", "meet", "reflect", "veil", "trace", "cast", "veil_higher"}
    alone -= of_floats if number_format is FIXED32 else set()
    files = [name for name in files_of(number_format, {"lines", *chosen}) if name in alone]
    return Module("the stages", "\n".join([shared, TABLE, *map(stage, files)]))


ALONE = (Kind.VALUES, Kind.NUMBERS)
MODULES = {number_format: _module(number_format) for number_format in FILES}
SHORT_KEYS = _module(FLOAT32, "keys_short")
BINDINGS = {"srgb_table": srgb_quads()}


def module_of(function: Function) -> Module:
    """The stages that a function is tested with."""
    return SHORT_KEYS if function.file == "keys_short" else MODULES[function.format]


def text_of(function: Function, slip: str = "") -> str:
    """What a function needs of its module, and a slip: the rest would be parsed for each anew."""
    needed = reached(definitions(module_of(function).text), f"{function.name}( {slip} {slip}(")
    table = TABLE if function.file == "encode" else ""
    return table + "".join(item.text for item in needed)


# The arguments of a function that a seed draws, and what the twin makes of them.
Drawn = Callable[[Function, int], tuple[dict[str, Array], Array]]

# A word or sign of a function, and what a slip would make of it.
FAULTS = [
    ("arithmetic.product", "a * b", "a + b"),
    ("arithmetic.reduced", "return wide", "return -wide"),
    ("arithmetic.discriminant_error", "4.0", "3.0"),
    ("arithmetic_fixed.discriminant_error", "5.0", "4.0"),
    ("arithmetic.steps_from_middle", "* last_step", "+ last_step"),
    ("arithmetic_fixed.product", "w4(a) * w4(b)", "w4(a * b)"),
    ("arithmetic_fixed.reduced", "0x3FFFFFFFli", "0x3FFFFFFEli"),
    ("arithmetic_fixed.steps_from_middle", "30u", "29u"),
    ("forms.line_at", "linear(b, at)", "linear(c, at)"),
    ("forms.line_errors", "linear_error(b, at)", "linear_error(c, at)"),
    ("forms.form_at", "quadratic(g, at)", "quadratic(a, at)"),
    ("forms.form_errors", "quadratic_error(g, at)", "quadratic_error(a, at)"),
    ("forms_exact.line_at", "linear(b, at)", "linear(c, at)"),
    ("forms_exact.line_errors", "abs(line.b)", "abs(line.c)"),
    ("forms_exact.form_at", "quadratic(g, at)", "quadratic(a, at)"),
    ("forms_exact.form_errors", "abs(form.g)", "abs(form.a)"),
    ("forms_fixed.excess_bits", "u4(32u), u4(64u)", "u4(31u), u4(64u)"),
    ("forms_fixed.shifted", ">> u4(1u)", ">> u4(2u)"),
    ("forms_fixed.shifted_error", "u4(255u)", "u4(254u)"),
    (
        "forms_fixed.line_excess",
        "max(abs(linear(c, at)), abs(linear(b, at)))",
        "abs(linear(c, at))",
    ),
    ("forms_fixed.line_at", "shifted(linear(b, at)", "shifted(linear(c, at)"),
    ("forms_fixed.line_errors", "+ host_error", ""),
    ("forms_fixed.form_excess", "bend + bend + bend", "bend + bend"),
    ("forms_fixed.form_at", "shifted(quadratic(g, at)", "shifted(quadratic(a, at)"),
    ("forms_fixed.form_errors", "+ host_error", ""),
    ("halve_fixed.begun", "root.c, root.g", "root.g, root.c"),
    ("halve_fixed.halved", "old.value <= i4(0)", "old.value < i4(0)"),
    ("halve_fixed.halved", "i4(1i << k)", "i4(1i)"),
    ("halve_fixed.reached", "-search.position", "search.position"),
    ("polynomial.offset", "f4(x)", "f4(x + 1)"),
    ("polynomial.quadratic", "k[4]", "k[3]"),
    ("polynomial.linear", "k[2]", "k[1]"),
    ("polynomial.quadratic_error", "6.0", "5.0"),
    ("polynomial.linear_error", "4.0", "3.0"),
    ("polynomial_exact.offset", "i64(y)", "i64(x.x)"),
    ("polynomial_exact.quadratic", "k[4]", "k[3]"),
    ("polynomial_exact.linear", "k[2]", "k[1]"),
    ("polynomial_exact.quadratic_error", "-1f", "-2f"),
    ("polynomial_exact.linear_error", "-1f", "-2f"),
    ("piece.whole_interval", "-far_u", "far_u"),
    ("piece.clip", "piece.b_in) <", "piece.b_in) <="),
    ("piece.clip", "piece.b_out) >", "piece.b_out) >="),
    ("piece.clip", "line.b < v4(0)", "line.b <= v4(0)"),
    ("piece.remains", "<=", "<"),
    ("piece.from_the_eye", "i4(0)", "piece.id_in"),
    ("root.end_value", "product(form.g, b)", "product(form.g, c)"),
    ("root.outside_at_entry", "> w4(0)", ">= w4(0)"),
    ("root.outside_at_exit", "piece.c_out", "piece.c_in"),
    ("root.has_root", ">=", ">"),
    ("root.turns_within", "form.a > v4(0)", "form.a >= v4(0)"),
    ("root.turns_within", "piece.b_out) >", "piece.b_out) >="),
    ("root.quadric_entry", "& (form.a < v4(0))", "& (form.a <= v4(0))"),
    ("root.quadric_entry", "crosses | on_plane", "crosses & on_plane"),
    ("root.quadric_exit", "& (form.a > v4(0))", "& (form.a < v4(0))"),
    ("root.ellipsoid_entry", "form.g", "-form.g"),
    ("root.ellipsoid_exit", "-form.g", "form.g"),
    ("root.polyhedron_entry", "> i4(0)", ">= i4(0)"),
    ("root.polyhedron_exit", "-piece.c_out", "piece.c_out"),
    ("root.patch_entry", "plane.b, plane.c", "plane.c, plane.b"),
    ("root.choose", "outer.g, inner.g", "inner.g, outer.g"),
    ("halve.begun", "root.c + root.c", "root.c"),
    ("halve.halved", "bend >= old", "bend > old"),
    ("halve.halved", "126u - k", "125u - k"),
    ("halve.reached", "1u << steps", "2u << steps"),
    ("halve_incremental.begun", "root.c, root.g", "root.g, root.c"),
    ("halve_incremental.halved", "old.value <= f4(0.0)", "old.value < f4(0.0)"),
    ("halve_incremental.reached", "-search.position", "search.position"),
    ("patch.facing", ">= product", "> product"),
    ("patch.bound", ">=", ">"),
    ("lines.line_of", "[j]", "[0]"),
    ("article.line_value", "line.b, u", "line.c, u"),
    ("article.blocked_in", "line.b < v4(0)", "line.b <= v4(0)"),
    ("article.blocked_out", "line.b >= v4(0)", "line.b > v4(0)"),
    ("article.last_entered", "i32(j) + 1", "i32(j)"),
    ("article.first_left", "> product(found.value", ">= product(found.value"),
    ("article.cell_of", ">> u4(1u)", ">> u4(2u)"),
    ("article.grid_point", "- i4", "+ i4"),
    ("article.further_than", "> product", "< product"),
    ("article.planes_in", "v4(-ONE)", "v4(ONE)"),
    ("article.planes_out", "i4(START)", "i4(cells)"),
    ("article.value_of", "+ product", "- product"),
    ("article.slope_of", "+ product", "- product"),
    ("article.visible_point", "piece.first < piece.last", "piece.first <= piece.last"),
    ("article.article_polyhedron", "k < steps", "k + 1u < steps"),
    ("article.article_quadric", "form.a >= v4(0)", "form.a > v4(0)"),
    ("article.article_patch", "j = 1u", "j = 2u"),
    ("nearest.depth_key", "1i << steps", "2i << steps"),
    ("nearest.either_key", "other.low, chosen.low", "chosen.low, other.low"),
    ("nearest.lesser_key", "some & before", "some | before"),
    ("keys.key_at", "solid.key_high, solid.key_low", "solid.key_low, solid.key_high"),
    ("keys.is_nearer", "other_surface)", "surface)"),
    ("keys.either_nearest", "chosen, other", "other, chosen"),
    ("keys_short.key_at", "+ u4(solid.key_low)", ""),
    ("keys_short.is_nearer", "key < other)", "key <= other)"),
    ("keys_short.either_nearest", "other, chosen, some", "chosen, other, some"),
    ("solid.eye_inside", "FLAG_EYE_INSIDE", "FLAG_NEAR_CUT"),
    ("solid.near_cut", "FLAG_NEAR_CUT", "FLAG_EYE_INSIDE"),
    ("solid.starts_at_eye", "!= 0u", "== 0u"),
    ("solid.eye_outside", "!= 0u", "== 0u"),
    ("solid.eye_sure", "FLAG_EYE_SURE", "FLAG_NEAR_CUT"),
    ("solid.is_rechecked", "FLAG_RECHECKED", "FLAG_EYE_SURE"),
    ("solid.starts_outside", "== i4(0)", "!= i4(0)"),
    ("solid.starts_outside", "eye_outside(solid)", "!eye_outside(solid)"),
    ("solid.starts_inside", "near_cut(solid)) &", "near_cut(solid)) |"),
    ("solid.normal_of", "normal[2]", "normal[1]"),
    ("solid.slope_at", "* solid.last_step", ""),
    ("certificate.ends_from_eye", "eye_inside", "near_cut"),
    ("certificate.form_with_errors", "solid.host_error", "0.0"),
    ("certificate.ellipsoid_certificate", "solid.last_step", "2.0 * solid.last_step"),
    ("certificate.quadric_certificate", "eye_inside(solid) | near_cut(solid)", "eye_inside(solid)"),
    ("certificate.quadric_certificate", "b4(starts_at_eye(solid))", "b4(true)"),
    ("certificate.polyhedron_certificate", "eye_sure(solid)", "eye_inside(solid)"),
    ("keep.keep", "sight.hit & is_nearer", "is_nearer"),
    ("keep.keep", "confirmed & sight.hit", "confirmed"),
    ("keep.keep", "!confirmed", "confirmed"),
    ("keep.keep", "b4(is_rechecked(solid))", "b4(false)"),
    ("verdict.verdict_of", "+ 2u", "+ 1u"),
    ("keep.keep", "sight.left, left_at", "sight.hit, left_at"),
    ("keep.keep", "old.shininess", "u4(0u)"),
    ("keep.sooner_key", "q <= i4", "q < i4"),
    ("keep.keep", "+ u * solid.depth_half", "- u * solid.depth_half"),
    ("finish.finish", "> u4(0u)", ">= u4(0u)"),
    ("finish.finish", "-direction.y", "direction.y"),
    ("finish.finish", "nearest.depth", "f4(1.0)"),
    ("finish.finish", "ray.x + point.x", "point.x"),
    ("nearest.count_key", "+ carry", ""),
    ("nearest.count_key", "shift >= 32u", "shift > 32u"),
    ("nearest.before", "surface < other_surface", "surface <= other_surface"),
    ("certify.size_of", "abs(f4(value))", "f4(value)"),
    ("certify.surely_apart", "errors.b *", "errors.c *"),
    ("certify.bounded_interval", "far_u != ONE", "far_u == ONE"),
    ("certify.bounded_clip", "apart | idle", "apart & idle"),
    ("certify.bounded_from_the_eye", "f4(0.0)", "old.error_in"),
    ("certify.surely_ordered", "ends.error_out *", "ends.error_in *"),
    ("certify.line_bound", "size - error", "size + error"),
    ("certify.bounded_form", "square - fourfold", "square + fourfold"),
    ("certify.curve_bound", "run.g", "run.a"),
    ("certify.end_signs", "- product(form.g, b);", "+ product(form.g, b);"),
    ("certify.certify_ellipsoid", ">= f4(0.0)", "> f4(0.0)"),
    ("certify.certify_polyhedron", "!lost", "lost"),
    ("certify.certify_quadric", "on_entry & ordered", "on_entry"),
    ("certify.bounded_facing", "!differs", "differs"),
    ("certify.bounded_bound", "gap < -error", "gap > -error"),
    ("certify.certify_patch", "tried.missed |", "tried.missed &"),
    ("certify.confirms", "!hit | right", "hit | right"),
    ("certify.least_key", "- borrow", ""),
    ("certify.least_key", "key.low < off.low", "key.low <= off.low"),
    ("normal.dot_product", "a.y * b.y", "a.y * b.x"),
    ("normal.scaled", "a.z * s", "a.z"),
    ("normal.or_else", "a, other)", "other, a)"),
    ("normal.either", "other.y, chosen.y", "other.y, chosen.x"),
    ("normal.turned", "-a.z", "a.z"),
    ("normal.normalized", "f4(1.0) /", "f4(2.0) /"),
    ("normal.gradient", "k[13]", "k[12]"),
    ("ray.ray_direction", "frame.down.z", "frame.down.y"),
    ("shade.power", "bit = 0u", "bit = 1u"),
    ("shade.seen", "light > f4(FAINT)", "light < f4(FAINT)"),
    ("shade.shade", "- light.vector.w", "+ light.vector.w"),
    ("shade.shade", "away = dot", "away = -dot"),
    ("encode.srgb_level", ">=", ">"),
    ("encode.encode", "u4(16u)", "u4(8u)"),
    ("arithmetic.moved", "c + by", "c - by"),
    ("arithmetic_fixed.moved", "ceil", "floor"),
    ("crossings.convex", "-form.g", "form.g"),
    ("crossings.way_in", "b4(false)", "b4(true)"),
    ("crossings.way_out", "-form.g", "form.g"),
    ("crossings.line_way", "line.b > v4(0)", "line.b < v4(0)"),
    ("crossings.point_after", "+ i4(1)", ""),
    ("crossings.begins", "eye == EYE_INSIDE", "eye == EYE_OUTSIDE"),
    ("crossings.is_outside", "< i4(0)", "<= i4(0)"),
    ("crossings.turned_if", "~high", "high"),
    ("crossings.ends_of", "is_outside(crossing)", "!is_outside(crossing)"),
    ("crossings.crossing", "bowl.c <= v4(0)", "bowl.c < v4(0)"),
    ("crossings.crossing", "first | last | turns", "first | last"),
    ("crossings.line_crossing", "line.c - line.b", "line.c + line.b"),
    ("crossings.in_cells", "!= outside", "== outside"),
    ("walk.until_at", "q < high", "q <= high"),
    ("walk.literal_at", "!= b4(turn)", "== b4(turn)"),
    ("walk.reads", "== place", "!= place"),
    ("walk.turn_of", "outside !=", "outside =="),
    ("walk.later", "second.until > first.until", "second.until >= first.until"),
    ("walk.either_held", "yes.until", "no.until"),
    ("certify_region.spread", "run.g", "run.c"),
    ("certify_region.shifted_form", "moved(form.c, by)", "form.c"),
    ("certify_region.is_vague", "by >", "by <"),
    ("certify_region.surely", "i4(never), vague", "i4(0), vague"),
    ("certify_region.perhaps", "i4(0), vague", "i4(never), vague"),
    ("certify_region.part_of", "q >= ends.high", "q > ends.high"),
    ("certify_region.settled", "inside | outside", "inside & outside"),
    ("certify_region.certify_region", "between.point - shown.q", "shown.q - between.point"),
    ("region.either_met", "other.side, chosen.side", "chosen.side, other.side"),
    ("region.shows_surface", ">> u4(1u)", ">> u4(0u)"),
    ("solid.other_side", "1u, 2u", "2u, 1u"),
    ("beam_fixed.coordinate", "+ half)", ")"),
    ("beam_fixed.affine", "* by_y", "* by_x"),
    ("beam_fixed.point_at", "m[2], m[5], m[8]", "m[2], m[5], m[7]"),
    ("beam.coordinate", "+ along", "- along"),
    ("beam.affine", "* by_y", "* by_x"),
    ("beam.point_at", "m[2], m[5], m[8]", "m[2], m[5], m[7]"),
    ("place.is_own", "< u4", "<= u4"),
    ("place.either_point", "other.y, chosen.y", "chosen.y, other.y"),
    ("place.point_from", "i4(from_z)", "i4(from_y)"),
    ("place.sheared", "30u", "29u"),
    ("place.beam_of", "point.x, is_y", "point.z, is_y"),
    ("beam.times", "a * b", "a + b"),
    ("beam.far_ray", "f4(2.0)", "f4(3.0)"),
    ("beam.light_ray", "h + h", "h"),
    ("beam.second_order", "k[4]", "k[3]"),
    ("beam.first_order", "k[2]", "k[1]"),
    ("beam_fixed.in_radii", "134217728li", "0li"),
    ("beam_fixed.times", "w4(b)", "w4(a)"),
    ("beam_fixed.radii_of", ">> 1u", ">> 2u"),
    ("beam_fixed.within", "-most", "most"),
    ("beam_fixed.start_on", "BEFORE", "0li"),
    ("beam_fixed.far_ray", "abs(y) <=", "abs(y) >"),
    ("beam_fixed.light_ray", "size + size)", "size)"),
    ("beam_fixed.second_order", "k[5]", "k[4]"),
    ("beam_fixed.first_order", "k[2]", "k[1]"),
    ("shadow.curve_along", "occluder.g, ray, ray.z", "occluder.g, ray, ray.t"),
    ("shadow.far_curve", "occluder.g[2]", "occluder.g[1]"),
    ("shadow.slab_along", "slab.b, ray, ray.z", "slab.b, ray, ray.t"),
    ("shadow.whole_ray", "ray.c_out", "ray.c_in"),
    ("shadow.is_met", "!outside_at_exit", "outside_at_exit"),
    ("shadow.rest_of", "+ form.g", "- form.g"),
    ("shadow.starts_beyond", "> product", ">= product"),
    ("shadow.ends_beyond", "> product", ">= product"),
    ("shadow.is_met_again", "< v4(0)", "<= v4(0)"),
    ("shadow.comes_out", "-form.g", "form.g"),
    ("shadow.far_slab", "slab.b[0]", "slab.b[1]"),
    ("shadow.second_along", "-line.c", "line.c"),
    ("shadow.first_number", "- 1u", "- 2u"),
    ("shadow.second_number", ">> SLAB_BITS", ">> 15u"),
    ("shadow.between", "-slope, later", "slope, later"),
    ("mirror.mirrored", "f4(2.0)", "f4(1.0)"),
    ("mirror.further", "u * along.z", "u * along.y"),
    ("mirror.over_slope", "< f4(LEAST_COMPONENT)", "> f4(LEAST_COMPONENT)"),
    ("mirror.over_slopes", "along.z", "along.y"),
    ("mirror.common_stay", "second.leaves <", "second.leaves >"),
    ("mirror.stay_between", "middle - reach", "middle + reach"),
    ("mirror.stay_in", "hull.half[1]", "hull.half[0]"),
    ("mirror.may_meet", "stay.enters <=", "stay.enters >"),
    ("mirror.glance_at", "start < f4(body.bound)", "start > f4(body.bound)"),
    ("mirror.from_middle_of", "c[0], c[1]", "c[1], c[0]"),
    ("mirror.is_left", "turned == u4(0u)", "turned != u4(0u)"),
    ("mirror.place_of_root", "select(v, -v", "select(-v, v"),
    ("mirror.bent", "m[5] * a.z", "m[4] * a.z"),
    ("mirror.gradient_of", "q[2]", "q[1]"),
    ("mirror.curve_of", "f4(2.0) *", ""),
    ("mirror.normal_of_face", "face.normal[1]", "face.normal[2]"),
    ("mirror.face_of", "+ face.beyond", "- face.beyond"),
    ("mirror.piece_of", "f4(1.0), i4(0)", "f4(2.0), i4(0)"),
    ("mirror.point_on", "round(spot.z", "floor(spot.z"),
    ("veil.veil_curve", "curve.g, ray, ray.z", "curve.g, ray, ray.t"),
    ("veil.veil_line", "flat.b, ray, ray.z", "flat.b, ray, ray.t"),
    ("veil.brought_near", "0x80800000u", "0x80000000u"),
    ("veil.is_behind", "veil.high[1]", "veil.high[0]"),
    ("veil.point_ahead", "passed + i4(1)", "passed"),
    ("veil.point_ahead", "min(v, radius)", "v"),
    ("veil.line_ahead", "line.c, line.b, on_line", "line.b, line.c, on_line"),
    ("veil.form_ahead", "form.g, rest.b", "form.g, rest.c"),
    ("veil.cell_with", "+ cells,", "- cells,"),
    ("veil.flat_crossed", "-line.c /", "line.c /"),
    ("veil.curve_crossed", "4.0 * bowl.a", "2.0 * bowl.a"),
    ("veil.curve_crossed", "half * BEHIND_ALL", "half"),
    ("veil.points_to_surface", "ceil", "floor"),
    ("veil.points_to_surface", "v4(MOST_BESIDE)", "v4(1)"),
    ("veil.value_at_start", "+ form.c", "- form.c"),
    ("veil.is_faced", "-rest.b, back", "rest.b, back"),
    ("veil_higher.course_of", "way.begin, start, on_curve", "start, way.begin, on_curve"),
    ("veil_higher.points_size", "trace.y.level_size", "trace.x.level_size"),
    ("veil_higher.curve_ahead", "f32(DEGREE) * off", "off"),
    ("veil_higher.curve_ahead", "powers[0], curve", "powers[1], curve"),
    ("veil_higher.faced_side", "slope, -slope", "-slope, slope"),
    ("veil_higher.knows_side", "abs(curve.powers[0])", "curve.powers[0]"),
    ("veil_higher.place_on", "VEIL_LAST_STEP + VEIL_LAST_STEP", "VEIL_LAST_STEP"),
    ("veil_higher.first_on", "- i4(1)", ""),
    ("veil_higher.found_on", "f4(end) - 0.5", "f4(end)"),
    ("veil_higher.before_on", "f4(end) - 1.0", "f4(end)"),
    ("veil_higher.behind_on", "ceil", "floor"),
    ("veil_higher.found_ends", "ends.points[k]", "ends.points[0]"),
    ("veil_higher.unsure_ends", "before_on(first", "behind_on(first"),
    ("shadow.is_away", "turned != u4(0u)", "turned == u4(0u)"),
    ("shadow.is_hidden", "turned == u4(1u)", "turned == u4(2u)"),
    ("region.is_within", "y <= region.bottom", "y < region.bottom"),
    ("region.position_before", "+ 1)", ")"),
    ("region.plane_normal", "plane.normal[2]", "plane.normal[1]"),
    ("region.outward", "== i4(1)", "== i4(0)"),
    ("cross.crossed", "k < steps", "k + 1u < steps"),
    ("cross.line_crossed", "k < steps", "k + 1u < steps"),
    ("cross.doubted", "select(-by, by, raised)", "by"),
    ("taylor.on_rays", "row * y", "row * y * y"),
    ("taylor.sizes_on_rays", "abs(x)", "x"),
    ("taylor.slopes_on_rays", "slope_y * x + slope_row", "slope_y * x + row"),
    ("taylor.slopes_on_rays", "slope_x * x + f32(DEGREE - a)", "slope_x * x + f32(a)"),
    ("taylor.slopes_on_rays", "in_u * u + f32(DEGREE - j)", "in_u * u + f32(j)"),
    ("taylor.value_at", "j < DEGREE", "j + 1u < DEGREE"),
    ("taylor.slope_at_most", "f32(DEGREE - j)", "f32(j)"),
    ("taylor.about", "var j = k", "var j = 0u"),
    ("taylor.about", "scale * h", "scale"),
    ("taylor.curve_value", "u - curve.middle", "u"),
    ("taylor.curve_error", "+ curve.host_error", ""),
    ("taylor.opposite", "-curve.powers[j], some", "-curve.powers[0], some"),
    ("taylor.cap_or", "powers[1], b", "powers[1], c"),
    ("cells.judged_of", "size_1 < twice", "size_1 < size_2"),
    ("cells.judged_of", "f32(j) * size", "size"),
    ("cells.judged_of", "last < -error", "last < error"),
    ("cells.judged_of", "last <= f4", "last < f4"),
    ("cells.largest_at", "u4(steps)", "u4(steps + 1u)"),
    ("cells.cells_from", "first < i4", "first <= i4"),
    ("cells.span_of", "min(right, stop)", "right"),
    ("cells.judged_of", "dips & (t[1] >", "dips & (t[1] <"),
    ("cells.cells_about", "NEARLY_ONE", "1.0"),
    ("cells.next_cell", "center <= span.middle", "center > span.middle"),
    ("cells.next_cell", "old.size + 1", "old.size + 2"),
    ("cells.next_cell", "high <= span.low", "high < span.low"),
    ("cells.next_cell", "right >= stop", "right > stop"),
    ("cells.next_cell", "leaf | judged.vague", "leaf"),
    ("cells.next_cell", "& judged.defined", ""),
    ("cells.clocked", "- curve.middle", "+ curve.middle"),
    ("cells.walked", "!cell.going", "cell.going"),
    ("cells.middle_of", "- 1, i4(0)", ", i4(0)"),
    ("cells.half_of", "some & far", "far"),
    ("cells.begin_of", "- 1.0", ""),
    ("cells.half_width", "i4(1)", "i4(2)"),
    ("cells.leaf_begun", "steps - 1u", "steps"),
    ("cells.leaf_in", "u < start", "u < stop"),
    ("cells.leaf_in", "(f4(half) <= own) &", ""),
    ("cells.position_in", "1 - (1i << steps)", "1 + (1i << steps)"),
    ("cells.bound_in", "reach * 4.0", "reach * 2.0"),
    ("cells.bound_in", "bound == f4(UNBOUNDED)", "bound != f4(0.0)"),
    ("algebraic.line_place", "f4(-1.0)", "f4(-2.0)"),
    ("algebraic.line_slack", "size - error", "size + error"),
    ("algebraic.finished", "cap.seen & !found.met", "cap.seen"),
    ("algebraic.finished", "select(start, cap.start", "select(cap.start, start"),
    ("algebraic.chord_of", "min(far, near)", "max(far, near)"),
    ("algebraic.root_slack", "reach * reach", "reach"),
    ("algebraic.later_slack", "u > other", "u < other"),
    ("algebraic.begun_cell", "i4(0), found.first", "i4(1), found.first"),
    ("algebraic.outline_of", "form.left, form.right", "form.right, form.left"),
    ("algebraic.world_slope", "form.axes[4]", "form.axes[3]"),
    ("bernstein.shifted_product", ">> 1u", ">> 2u"),
    ("bernstein.shifted_product", "<< u4(OFFSET_BITS - shift)", "<< u4(OFFSET_BITS)"),
    ("bernstein.shifted_row", "(a >> OFFSET_BITS)", "(a >> 15u)"),
    ("bernstein.weights_on_rays", "shifted_row(row, down, shift)", "shifted_row(row, down, 1u)"),
    ("bernstein.weights_on_rays", "total, right", "total, vec4<i64>(down)"),
    ("bernstein.opposite_weights", "-weights[j], some", "-weights[0], some"),
    ("bernstein.either_weights", "other[j], chosen[j]", "chosen[j], other[j]"),
    ("bernstein.halves_of", "far[i - k] + far[i - k + 1u]", "far[i - k] + far[i - k]"),
    ("bernstein.halves_of", "near[k] = far[0]", "near[k] = far[1]"),
    ("bernstein.weight_at", "- 1u - k", "- k"),
    ("bernstein.weight_at", "place == i4(END)", "place != i4(END)"),
    ("bernstein.steepest_weight", "0.5 *", "1.5 *"),
    ("bernstein.slope_about", "slack < room", "slack > room"),
    ("bernstein.place_of", "k < PLACE_HALVINGS - 1u", "k < PLACE_HALVINGS - 2u"),
    ("bernstein.line_place_of", "i4(0), b, c", "i4(0), c, b"),
    ("bernstein.stretch_begin", "PIECES - 1u", "PIECES - 2u"),
    ("bernstein.stretch_end", "2u - 1u", "2u - 2u"),
    ("bernstein.leaf_from", "min(place, i4(END - 1))", "place"),
    ("bernstein.leaf_until", "END - 1", "END"),
    ("bernstein.gap_between", "* PLACE_UNIT", "* SLOPE_UNIT"),
    ("bernstein.begun_search", "b4(true)", "b4(false)"),
    ("bernstein.next_search", "found[j] > more", "found[j] > -more"),
    ("bernstein.next_search", "found[j] < -more", "found[j] < more"),
    ("bernstein.next_search", "is_leaf | vague", "is_leaf"),
    ("bernstein.next_search", "at_stop, covers", "at_stop, !covers"),
    ("bernstein.next_search", "falls & is_sure", "falls"),
    ("bernstein.next_search", "cell.size + 1", "cell.size + 2"),
    ("bernstein.next_search", "<= start", "< start"),
    ("bernstein.next_search", "weights, again)", "old.weights, again)"),
    ("bernstein.sought_cell", "& !search.cell.going;", "& search.cell.going;"),
    ("bernstein.sought_cell", "SEARCH_HALVINGS", "1u"),
    ("bernstein.narrowed_root", "middle > vec4<i64>(0li)", "middle >= vec4<i64>(error)"),
    ("bernstein.narrowed_root", "middle < vec4<i64>(-error)", "middle < vec4<i64>(error)"),
    ("bernstein.rooted_leaf", "i4(0), cell.size", "i4(1), cell.size"),
    ("bernstein.rooted_leaf", "k < steps", "k + 1u < steps"),
    ("bernstein.bound_of", "- leaf - 1", "- leaf"),
    ("bernstein.is_before", "ball.c - ball.g", "ball.c + ball.g"),
    ("bernstein.later_place", "other_slack, slack, gap", "slack, other_slack, gap"),
    ("bernstein.slopes_of_weights", "slope_y * x + slope_row", "slope_y * x + row"),
    ("bernstein.slopes_of_weights", "value[i + 1u] - value[i]", "value[i + 1u] + value[i]"),
    ("higher.ended", "ends.points[k], point", "point, ends.points[k]"),
    ("higher.pair_of", "ends.total > before + i4(1)", "ends.total > before"),
    ("higher.closed_trail", "point, closes & !now", "point, closes & now"),
    ("higher.opened_trail", "trail.inside, here", "trail.was, here"),
    ("higher.higher_curve", "f32(y)", "-f32(y)"),
    ("higher.is_about", "x <= i4", "x < i4"),
    ("higher.begun_trail", "EYE_INSIDE", "EYE_UNKNOWN"),
    ("higher.room_about", "< -error", "< error"),
    ("higher.cell_behind", "right < stop", "right > stop"),
    ("higher.tried_search", "leaf & judged.below &", "judged.below &"),
    ("higher.rooted_search", "leaf + i4(1), met", "leaf, met"),
    (
        "higher.ended_search",
        "trail.since + i4(1), left_open & !trail.was",
        "trail.since, left_open",
    ),
    ("higher.all_crossed", "opposite(", "opposite(!"),
    ("elementary.angle_of", "+ 0.5)", "+ 0.25)"),
    ("elementary.turned_sine", "& i4(1)", "& i4(2)"),
    ("elementary.sine_of", ", 0)", ", 2)"),
    ("elementary.cosine_of", ", 1)", ", 3)"),
    ("elementary.exponential_of", "i4(127)", "i4(126)"),
    ("elementary.logarithm_of", "mantissa * 0.5", "mantissa * 0.25"),
    ("elementary.reciprocal_of", "select(x, f4(SMALLEST", "select(x, f4(-SMALLEST"),
    ("elementary.product_of", "a * b", "a + b"),
    ("elementary.root_of", "max(x, f4(0.0))", "abs(x)"),
    ("jets.fitted", "known & (size", "(size"),
    ("jets.checked_jet", "b4(true)", "b4(false)"),
    ("jets.bend_at_most", "+ jet.bend_error", ""),
    ("jets.steepest", "2.0 *", "3.0 *"),
    ("jets.reach_of", "ROOM *", ""),
    ("jets.coordinate_jet", "6.0 * abs(m)", "6.0 * m"),
    ("jets.number_jet", "EPSILON * abs(k)", "abs(k)"),
    ("jets.jet_of_value", "u4(STEEP)", "u4(0u)"),
    ("jets.raised_jet", "abs(k) + abs(jet.value)", "abs(k)"),
    ("jets.scaled_jet", "k * a.bend", "k * a.slope"),
    ("jets.negated_jet", "-a.bend", "a.bend"),
    ("jets.opposite_jet", "-a.slope", "a.slope"),
    ("jets.sum_jet", "a.state | b.state", "a.state"),
    ("jets.difference_jet", "negated_jet(b)", "b"),
    ("jets.product_jet", "tilt_a * tilt_b", "tilt_a * tilt_a"),
    ("jets.product_jet", "steepest(b)", "steepest(a)"),
    ("jets.square_jet", "4.0 *", "3.0 *"),
    ("jets.composed", "outer.second_change * (steep", "outer.first_change * (steep"),
    ("jets.composed", "known & (most", "(most"),
    ("jets.turned_jet", "f4(2.0)", "f4(1.0)"),
    ("jets.sine_jet", "cosine_of(a.value)", "sine_of(a.value)"),
    ("jets.cosine_jet", "-sine_of", "sine_of"),
    ("jets.exponential_jet", "largest - value", "largest + value"),
    ("jets.logarithm_jet", "-0.5", "0.5"),
    ("jets.reciprocal_jet", "-square", "square"),
    ("jets.root_jet", "a.value < change", "a.value < -change"),
    ("jets.root_jet", "0.375", "0.25"),
    ("jets.either_jet", "other.state, chosen.state", "chosen.state, other.state"),
    ("jets.magnitude_jet", "negated_jet(a), a)", "a, a)"),
    ("jets.greatest_jet", "apart.value < -reach", "apart.value < reach"),
    ("jets.least_jet", "negated_jet(b)", "b"),
    ("jets.judged_jet", "low + low", "low"),
    ("jets.judged_jet", "runs | bends", "runs"),
    ("jets.judged_jet", "let thrice = 3.0", "let thrice = 2.0"),
    ("jets.judged_jet", "ROOM * thrice, is_mean", "ROOM * thrice, !is_mean"),
    ("jets.judged_jet", "least - jet.slope", "least + jet.slope"),
    ("arcs.arc_of", "a.slope, f4(0.0)", "a.slope, a.bend"),
    ("arcs.jet_of_arc", "slope_error * h", "slope_error + h"),
    ("arcs.jet_of_arc", "u4(MEAN)", "u4(0u)"),
    ("arcs.jet_of_arc", "h > f4(WIDEST_ARC)", "h < f4(WIDEST_ARC)"),
    ("algebraic.first_place", "PIECES - 1u", "PIECES - 2u"),
    ("algebraic.last_place", "+ 1u", "+ 2u"),
    ("trace.far_track", "by_v - shrink", "by_v + shrink"),
    ("trace.far_trace", "ray.y / ahead", "ray.y"),
    ("trace.lamp_track", "-((right", "((right"),
    ("trace.lamp_trace", "k.by_v[2], ray.x", "k.by_v[1], ray.x"),
    ("trace.size_of_track", "abs(track.along)", "track.along"),
    ("trace.moved_track", "abs(start)", "start"),
    ("trace.moved_trace", "trace.z, start", "trace.y, start"),
    ("trace.longest_change", "abs(trace.y.along)", "trace.y.along"),
    ("trace.narrowed_way", "max(one, two)", "min(one, two)"),
    ("trace.boxed_way", "trace.y, least", "trace.x, least"),
    ("cast.powers_along", "line[0] * z.level + term", "line[0] + term"),
    ("cast.powers_along", "plane[b - 1u - i] * y.along", "plane[b - 1u - i] * y.level"),
    ("cast.sizes_along", "abs(k[term])", "k[term]"),
    ("cast.slope_size", "bend * trace.y.level_size", "trace.y.level_size"),
    ("cast.rest_of_powers", "f4(0.0), some", "p[0], some"),
    ("cast.shaded", "(powers[0] < -error)", "(powers[0] > error)"),
    ("cast.rest_of_ray", "on_f | encloses", "on_f"),
    ("cast.cast_of", "== u4(1u)", "== u4(2u)"),
    ("reflect.course_along", "glance.start, on_curve", "way.end, on_curve"),
    ("reflect.grid_point_beyond", "floor(", "ceil("),
    ("reflect.u_before", "0.5 /", "1.0 /"),
    ("reflect.rest_along", "+ form.g", "- form.g"),
    ("reflect.value_along", "+ form.c", "- form.c"),
    ("reflect.error_of_face", "+ 2.0", "+ 1.0"),
    ("reflect.flat_doubted", "line.c + by", "line.c - by"),
    ("reflect.curve_doubted", "f4(by)", "f4(-by)"),
    ("reflect.encounter", "NEVER - 1", "NEVER"),
    ("reflect.encounter", "entry.side, beyond.side", "beyond.side, entry.side"),
    ("reflect.encounter", "sure | !asked", "sure & asked"),
    ("meet.glance_track", "+ ahead) + level", "+ ahead) - level"),
    ("meet.glance_trace", "k.by_v[2], b, d", "k.by_v[1], b, d"),
    ("meet.slopes_in", "plane_z * y + line_z", "plane_z * y"),
    ("meet.placed", "c[2] * spot.z", "c[1] * spot.z"),
    ("meet.turned_back", "b[2] * slope.z", "b[1] * slope.z"),
    ("meet.bend_at", "at.x, at.y", "at.y, at.x"),
    ("meet.passage_of", "!on_ball & !own", "!on_ball"),
    ("meet.passage_of", "glance.start + form.g)", "glance.start - form.g)"),
    ("meet.begins_inside", "is_sheet | ", "is_sheet & "),
    ("meet.meeting_at", "passage.id_in, on_entry", "passage.id_in, on_exit"),
    ("meet.meeting_of", "turned == u4(0u), on_f", "turned != u4(0u), on_f"),
    ("meet.meeting_of", "select(-curve.powers[0]", "select(curve.powers[0]"),
    ("cast.cast_of", "inside | cell.met | rest.beside", "inside | cell.met"),
    ("arcs.most_bent", "+ a.rest", ""),
    ("arcs.number_arc", "f4(k), f4(0.0)", "f4(k), f4(k)"),
    ("arcs.checked_arc", "return a;", "return negated_arc(a);"),
    ("arcs.raised_arc", "a.value + k", "a.value - k"),
    ("arcs.scaled_arc", "k * a.bend", "k * a.slope"),
    ("arcs.negated_arc", "-a.bend", "a.bend"),
    ("climb.known_to", "u4(STEEP)", "u4(KINKED)"),
    ("climb.lowered_jet", "jet.value - level", "jet.value + level"),
    ("climb.is_sloped", "STEEP | UNDEFINED", "STEEP"),
    ("climb.has_slope", "abs(jet.slope)", "jet.slope"),
    ("climb.climbing_jet", "tilt > 4.0 * off", "tilt > 3.0 * off"),
    ("climb.sinking_jet", "middle | (is_sloped", "middle & (is_sloped"),
    ("arcs.sum_arc", "a.rest + b.rest", "a.rest - b.rest"),
    ("arcs.difference_arc", "a.bend - b.bend", "a.bend + b.bend"),
    ("arcs.product_arc", "bend_b * around_a", "bend_a * around_a"),
    ("arcs.square_arc", "4.0 *", "3.0 *"),
    ("arcs.turned_arc", "(0.5 * around)", "around"),
    ("arcs.turned_arc", "2.0 * abs(value)", "abs(value)"),
    ("arcs.sine_arc", "cosine_of(a.value)", "sine_of(a.value)"),
    ("arcs.cosine_arc", "-sine_of", "sine_of"),
    ("grades.chained", "first, a.y", "first, a.x"),
    ("grades.either_grade", "other.z, chosen.z", "chosen.z, other.z"),
    ("grades.number_grade", "f4(0.0)", "f4(1.0)"),
    ("grades.checked_grade", "f4(1.0)", "f4(2.0)"),
    ("grades.raised_grade", "value + k", "value - k"),
    ("grades.scaled_grade", "f4(k), a)", "a.value, a)"),
    ("grades.negated_grade", "-a.y", "a.y"),
    ("grades.sum_grade", "a.z + b.z", "a.z - b.z"),
    ("grades.difference_grade", "negated_grade(b)", "b"),
    ("grades.product_grade", "a.value, b.y", "a.value, b.z"),
    ("grades.square_grade", "+ a.value, a", ", a"),
    ("grades.reciprocal_grade", "-product_of", "product_of"),
    ("grades.root_grade", "value + value", "value"),
    ("grades.magnitude_grade", "negated_grade(a), a)", "a, a)"),
    ("grades.greatest_grade", "a.value < b.value", "a.value > b.value"),
    ("grades.least_grade", "b.value < a.value", "b.value > a.value"),
    ("grades.sine_grade", "cosine_of", "sine_of"),
    ("grades.cosine_grade", "-sine_of", "sine_of"),
    ("grades.exponential_grade", "value, value, a", "value, a.value, a"),
    ("grades.logarithm_grade", "reciprocal_of(a.value)", "a.value"),
]


def inputs_of(function: Function, rng: np.random.Generator) -> dict[str, Array]:
    """``ROWS`` rows of the arguments of a function, and of the variables that it reads."""
    module = module_of(function)
    types = dict(module.signature(function.name).parameters)
    needed = module.reached(function.name)
    types |= {name: module.variable(name) for name in module.private() if name in needed}
    draw = Draw(function, rng)
    inputs = {}
    for name, type_ in types.items():
        target = type_.target if isinstance(type_, Pointer) else type_
        inputs[name] = np.zeros(ROWS, dtype_of(target))
        for place, leaf in leaves(inputs[name], name):
            leaf[...] = draw.values(place, leaf)
    draw.fit(inputs)
    return inputs


class Draw:
    """Draws arguments of a function."""

    def __init__(self, function: Function, rng: np.random.Generator) -> None:
        self._function, self._rng = function, rng
        self._one = function.format.one
        self._errors: dict[str, Array] = {}
        self._reach = np.exp2(rng.integers(0, 17, ROWS))  # the largest pixel offset

    def values(self, place: str, leaf: Array) -> Array:
        """Values for a number, vector or array of every row; ``place`` is as "piece.c_in"."""
        name = place.rpartition(".")[2]
        values = self._special(place, name, leaf)
        if values is None:
            values = self._usual(name, leaf)
        # Pixels have places of their own; what else is one number or a record's is of a solid.
        records = ("solid.", "half_space.", "plane.", "look.", "form.", "higher.", *SHADOWED)
        is_record = place.startswith(records)
        is_record |= self._function.file == "veil" and place.startswith("curve.")
        own = name in ("y", "j") or (leaf.ndim > 1 and not is_record)
        return values if own else values[::BLOCK_ROWS][BLOCK]

    def _usual(self, name: str, leaf: Array) -> Array:
        """Values by their type."""
        rng, shape = self._rng, leaf.shape
        match leaf.dtype.name:
            case "bool":
                return rng.integers(0, 2, shape).astype(bool)
            case "uint32":
                few = rng.choice(np.array([0, 1, 2**31, 2**32 - 1]), shape)
                return np.where(rng.random(shape) < 0.7, few, rng.integers(0, 2**32, shape))
            case "float32":
                near = rng.uniform(-1, 1, shape)
                near = np.where(np.abs(near) < 2.0**SMALLEST, 0.0, near)
                return self._mixed(np.exp2(rng.uniform(SMALLEST, 0, shape)), near, 1, DYADIC)
            case _:
                bits = WIDE_BITS if leaf.itemsize == 8 else BITS.get(name, VALUE_BITS)
                scale = 2.0**bits
                wide, near = np.exp2(rng.uniform(0, bits, shape)), rng.uniform(-1, 1, shape)
                return np.rint(self._mixed(wide, near * scale, scale, DYADIC[np.abs(DYADIC) <= 1]))

    def _mixed(self, wide: Array, near: Array, scale: float, equal: Array) -> Array:
        """Magnitudes over decades, values in order of the scale, and some that coincide."""
        kind = self._rng.random(wide.shape)
        coinciding = self._rng.choice(equal, wide.shape) * scale
        signed = np.where(self._rng.random(wide.shape) < 0.5, wide, -wide)
        return np.where(kind < 0.4, signed, np.where(kind < 0.65, near, coinciding))

    def _special(self, place: str, name: str, leaf: Array) -> Array | None:
        """Values of what means something by its name; None of what does not."""
        rng, shape, one = self._rng, leaf.shape, self._one
        cells = 1 << (STEPS if leaf.ndim == 1 else STEPS[:, None])
        if self._function.file == "bernstein":
            of_weights = self._of_weights(name, leaf)
            if of_weights is not None:
                return of_weights
        of_shadows = self._function.file in SHADOWS and self._of_shadows(place, name, leaf)
        if isinstance(of_shadows, np.ndarray):
            return of_shadows
        match name:
            case "steps":
                return STEPS
            case "cells":
                return cells
            case "pairs":
                return rng.integers(1, PAIRS, shape, endpoint=True)
            case "total":
                return rng.integers(0, 2 * PAIRS + 2, shape)
            case "clocks":
                return rng.integers(1, 9, shape)
            case "since":
                return np.where(rng.random(shape) < 0.5, -2, rng.integers(-1, cells, shape))
            case "leaf" | "following" if leaf.dtype == np.int32:
                return rng.integers(0, cells, shape)
            case "first" if place == "higher.first":
                return np.where(rng.random(shape) < 0.5, 0, rng.integers(0, cells, shape))
            case "start" | "stop" if place.startswith("higher."):
                return np.rint(rng.uniform(0, 8, shape)) / 8 * (-1 if name == "start" else 1)
            case "number" if self._function.name == "pair_of":
                return rng.integers(0, PAIRS, shape)
            case "k" if leaf.ndim == 1:
                return STEPS - 1
            case "v":
                return (2 * rng.integers(0, cells, shape) + 1 - cells) / cells
            case "last_step":
                return 0.5**STEPS
            case "shift" | "key_shift":
                return BLOCK
            case "flags":
                return rng.integers(0, 2 * max(Flag), shape)
            case "spare":
                return np.minimum(np.minimum(BLOCK, 8), 30 - STEPS)
            case "count" | "number" if leaf.ndim == 1:
                return rng.integers(1, 8, shape, endpoint=True)
            case "number" | "surface" | "id_in" | "id_out" if leaf.itemsize == 4:
                return rng.integers(0, 4, shape)
            case "position" | "exit_position":
                return 2 * rng.integers(0, cells, shape) + 1 - cells
            case "low" | "high":
                point = rng.integers(0, cells + 2, shape)
                return (
                    point
                    if place.startswith("ends")
                    else np.where(rng.random(shape) < 0.3, ~point, point)
                )
            case "q" | "begin" | "cell" | "point" if self._function.name == "encounter":
                # Few, about the last, so that some are the same.
                return NEVER - rng.integers(0, 4, shape)
            case "q" | "enters" | "leaves":
                return rng.integers(0, cells + 2, shape)
            case "never":
                return (1 << STEPS) + 1
            case "only":
                return rng.integers(-1, 2, shape)
            case "eye":
                return rng.integers(0, 3, shape)
            case "beyond":
                return rng.choice([0, 4], shape)
            case "state":
                return rng.integers(0, 16, shape)
            case "least":
                return np.abs(self._usual(name, leaf))
            case "a" | "g" | "c" if self._function.file == "cast" and place[:9] == "occluder.":
                # Rays meet the ball where float32 holds the square of the place.
                return rng.choice([-1, 1], shape) * rng.uniform(0.1, 1, shape)
            case "t" if self._function.file in ("trace", "cast", "veil_higher"):
                # Ways to lamps are no shorter than a part of the way to the solid.
                value = self._usual(name, leaf)
                return np.where(value > 0, np.maximum(value, 2.0**-4), value)
            case "second" if self._function.file == "meet":
                # Rays meet a ball where float32 holds the square of the place.
                return rng.uniform(0.1, 1, shape)
            case "x" | "y" | "z" if place.startswith("glance.along."):
                return rng.choice([-1, 1], shape) * rng.uniform(0.1, 1, shape)
            case "face_count" | "curve" | "turned" if self._function.file == "meet":
                return rng.integers(0, 3, shape)
            case "quarters" | "more":
                return rng.integers(-9, 10, shape)
            case "rest" if self._function.name == "turned_sine":
                return rng.uniform(-0.79, 0.79, shape)
            case "x" if self._function.file == "elementary":
                return rng.choice([-1, 1], shape) * np.exp2(rng.uniform(-45, 14, shape))
            case "m" | "h" if self._function.name == "about":
                # Powers of these up to DEGREE, times another number, stay normal.
                value = self._usual(name, leaf)
                return np.where(value == 0, 0, np.copysign(np.maximum(abs(value), 2**-16), value))
            case "until":
                few = rng.integers(-3, 4, shape)
                return np.where(rng.random(shape) < 0.5, few, self._usual(name, leaf))
            case "side":
                return rng.integers(0, 16, shape)
            case "word":
                of_words = rng.choice([words.LEAF, words.LEAF | words.TURN, words.TURN, 0], shape)
                return of_words | rng.integers(0, 3, shape)
            case "place" if self._function.name == "reads":
                return rng.integers(0, 3, shape)
            case "left" | "right" | "top" | "bottom":
                return rng.integers(-3, 4, shape)
            case "by":
                return np.exp2(rng.uniform(-20, 30, shape))
            case "cell" | "first" | "last":
                ends = np.where(rng.random(shape) < 0.5, -1, cells)
                return np.where(rng.random(shape) < 0.3, ends, rng.integers(-1, cells + 1, shape))
            case "near_u" | "far_u":
                end = -one if name == "near_u" else one
                return np.where(rng.random(shape) < 0.5, end, self._usual(name, leaf))
            case "b_in" | "b_out":
                value = self._usual(name, leaf)
                sign = -1 if name == "b_in" else 1
                return np.where(rng.random(shape) < 0.9, sign * np.abs(value), value)
            case "size" if leaf.dtype == np.int32:
                return np.minimum(rng.integers(0, 31, shape), STEPS[:, None])
            case "size":
                return np.abs(self._usual(name, leaf))
            case "base":
                return np.minimum(np.abs(self._usual(name, leaf)), 1)
            case "bound":
                return 4 * np.abs(self._usual(name, leaf))
            case "excess":
                return rng.integers(0, 33, shape)
            case "j" if self._function.file == "lines":
                return BLOCK % 8
            case "i" | "j":
                return rng.integers(0, 2**17, shape)
            case _ if self._function.name in SHADERS and (
                "color" in place or name in LIT or "background" in place
            ):
                return np.abs(self._usual(name, leaf))
            case "exponent" | "shininess":
                return rng.choice([1, 2, 3, 40, 1023, 1024, *range(1, 1025)], shape)
            case "x" | "y" if place.startswith("at.") or leaf.dtype.kind == "i":
                reach = self._reach if leaf.ndim == 1 else self._reach[:, None]
                return np.rint(rng.uniform(-1, 1, shape) * reach)
            case _ if "error" in place and leaf.dtype.kind == "f":
                return self._error(place, leaf)
            case _ if leaf.dtype == np.int64 and name in "agcbk":
                return self._coefficients(leaf)
            case _ if self._function.file == "encode":
                return self._light(leaf)
            case _:
                return None

    def _of_weights(self, name: str, leaf: Array) -> Array | None:
        """The same of weights of Bernstein's polynomials, and of places and leaves on rays."""
        rng, shape, most = self._rng, leaf.shape, 2.0**WEIGHT_BITS
        end = 1 << (PLACE_HALVINGS - 1)
        cells = 1 << (STEPS if leaf.ndim == 1 else STEPS[:, None])
        match name:
            case "k":
                values = np.rint(rng.uniform(-1, 1, shape) * most / term_count(DEGREE))
                return np.where(rng.random(shape) < 0.2, 0, values)
            case "shift":
                return BLOCK % (OFFSET_BITS + 1)
            case "error":
                # A whole search that is in doubt takes long.
                bits = 34 if self._function.name == "sought_cell" else 4
                return np.rint(most * np.exp2(-rng.uniform(bits, 46, shape)))
            case "at_stop" | "a" | "b" if leaf.itemsize == 8:
                small = rng.choice([1, 2.0**-20], shape)
                return np.rint(rng.uniform(-1, 1, shape) * small * most)
            case _ if leaf.itemsize == 8:
                values = rng.uniform(-1, 1, shape) * rng.choice([1, 2.0**-20], (ROWS, 1, 4))
                kind = rng.random((ROWS, 1, 4))
                ordered = np.sort(values, axis=1)
                values = np.where(kind < 0.4, ordered[:, ::-1], values)
                return np.rint(np.where(kind > 0.8, ordered, values) * most)
            case "place" | "later" | "earlier":
                ends = rng.choice([-end, end], shape)
                return np.where(rng.random(shape) < 0.1, ends, rng.integers(-end, end, shape))
            case "start" | "stop":
                return rng.integers(0, cells, shape)
            case "low" | "high":
                return rng.integers(0, cells + 1, shape)
            case "gap" | "slack" | "other_slack":
                size = np.exp2(rng.uniform(-30, 0, shape))
                return size * (rng.choice([-1, 1], shape) if name == "gap" else 1)
        return None

    def _of_shadows(self, place: str, name: str, leaf: Array) -> Array | None:
        """The same of what is on the grid of the world, and before lights."""
        rng, shape = self._rng, leaf.shape
        match name:
            case "axis":
                return rng.integers(0, 3, shape)
            case "sign":
                return rng.choice([-1, 1], shape)
            case "shear_x" | "shear_y" | "shear":
                return rng.integers(-(2**30), 2**30, shape, endpoint=True)
            case "u" if leaf.dtype == np.int64:
                return rng.integers(-(2**20), 2**20, shape, endpoint=True)
            case "level" if leaf.dtype == np.uint32:
                return rng.integers(0, 30, shape)
            case "unit":
                return np.exp2(-rng.integers(0, 30, shape).astype(np.float64))
            case "level" | "along" if leaf.dtype == np.int64:
                return rng.integers(-(2**23), 2**23, shape)
            case "level" | "along" if leaf.dtype == np.float32:
                return rng.uniform(-512, 512, shape)
            case "x" | "y" if leaf.dtype == np.float32 and place in "xy":
                return rng.integers(-999, 999, shape)
            case "shift":
                return rng.integers(0, 25, shape)
            case "factor":
                return rng.integers(2**29, 2**30, shape)
            case "factor_shift":
                return rng.integers(20, 32, shape)
            case "reach":
                return np.where(rng.random(shape) < 0.3, 0, rng.integers(0, 2**30, shape))
            case "weight":
                return np.exp2(rng.uniform(-30, 0, shape))
            case "anchor" | "center" | "x" | "y" | "z" | "units" if leaf.dtype == np.int32 and (
                self._function.file == "place" or place.startswith("occluder.")
            ):
                few = rng.integers(-9, 10, shape)
                return np.where(rng.random(shape) < 0.1, few, rng.integers(-(2**29), 2**29, shape))
            case "a" | "b" | "v" if place.startswith("beam."):
                size = np.exp2(rng.uniform(0, 30, shape))
                return np.rint(size * rng.choice([-1, 1], shape))
            case "flags":
                return rng.integers(0, 2 * max(Shade), shape)
            case "radius":
                return np.exp2(rng.integers(0, 29, shape).astype(np.float64))
            case "turned":
                return rng.integers(0, 3, shape)
            case "first" | "count" | "surface":
                return rng.integers(0, 5, shape)
            case "most":
                return np.abs(self._usual(name, leaf))
            case "v" if leaf.dtype == np.int32:
                size = np.exp2(rng.uniform(0, 30, shape))
                return np.rint(size * rng.choice([-1, 1], shape))
            case "v" if leaf.dtype == np.int64:
                return rng.integers(-(2**30), 2**30, shape)
        return None

    def _error(self, place: str, leaf: Array) -> Array:
        """Errors of at least one rounding; in integers a form has one, of 16 bits."""
        fixed = self._function.format is FIXED32
        units = fixed or self._function.file == "forms_exact"
        values = np.exp2(self._rng.uniform(*((-1, 24) if units else (-37, -4)), leaf.shape))
        if not fixed or self._function.file == "forms_fixed":
            return values
        values = (values.astype(np.float32).view(np.uint32) & 0xFFFFFF00).view(np.float32)
        form = re.sub(r"(errors)\.\w|(error)_[agc]", r"\1\2", place)
        return self._errors.setdefault(form, values)

    def _coefficients(self, leaf: Array) -> Array:
        """Integers whose terms sum to less than 2^60, as the host sees to; some are exact ties."""
        rng, shape = self._rng, leaf.shape
        powers = np.array([0, 1, 1, 2, 2, 2][: shape[1]])
        values = np.rint(rng.uniform(-1, 1, shape) * 2.0**57 / self._reach[:, None] ** powers)
        values[rng.random(shape) < 0.2] = 0
        ties = rng.random(ROWS) < 0.2
        values[ties] = 0
        values[ties, 0] = (2 * rng.integers(2**23, 2**24, ties.sum()) + 1) * 2.0**30
        return values

    def _light(self, leaf: Array) -> Array:
        """Linear light: any, beyond 0…1, and about the places where the level changes."""
        rng, shape = self._rng, leaf.shape
        level = (rng.integers(1, 256, shape) - 0.5) / 255
        edges = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
        anything = rng.uniform(-0.5, 1.5, shape)
        kind = rng.random(shape)
        usual = np.where(kind < 0.8, anything, self._usual("", leaf))
        return np.where(kind < 0.5, near_ties(rng, edges.astype(np.float32)), usual)

    def fit(self, inputs: dict[str, Array]) -> None:
        """Make what is drawn alone fit together."""
        rng = self._rng
        if self._function.name == "or_else":
            nothing = rng.random((ROWS, 4)) < 0.1
            for axis in "xyz":
                inputs["a"][axis][nothing] = 0
        elif self._function.name == "crossing":
            # Of some forms F is 0 at the first grid point.
            ties = (rng.random(ROWS) < 0.2)[BLOCK]
            form = inputs["form"]
            form["c"][ties] = form["g"][ties] - form["a"][ties]
        elif self._function.name == "normalized":
            self._make_unit(inputs["a"], np.exp2(rng.integers(-20, 20, (ROWS, 1))))
        elif self._function.name == "brought_near":
            for axis in "xyz":
                inputs["ray"][axis] *= np.exp2(rng.integers(0, 20, (ROWS, 4)))
        elif self._function.name == "mirrored":
            self._make_unit(inputs["direction"], np.exp2(rng.integers(-9, 9, (ROWS, 1))))
            self._make_unit(inputs["normal"])
        elif self._function.name == "shade":
            self._make_unit(inputs["normal"])
            self._make_unit(inputs["direction"])
            inputs["lights"]["vector"][..., 3] = rng.integers(0, 2, (ROWS, 2))
        elif self._function.name == "finish":
            self._make_unit(inputs["nearest"]["slope"])
            nothing = rng.random((ROWS, 4)) < 0.1
            for axis in "xyz":
                inputs["nearest"]["slope"][axis][nothing] = 0
            frame = inputs["frame"]
            for name, scale in (("first_ray", 1.0), ("right", 2e-5), ("down", 2e-5)):
                frame[name] = scale * rng.uniform(0.2, 1, frame[name].shape)
            inputs["lights"]["vector"][..., 3] = rng.integers(0, 2, (ROWS, 2))

    def _make_unit(self, vectors: Array, length: Array | float = 1) -> None:
        """Make (ROWS,) structs of x, y and z vectors of a length."""
        axes = self._rng.normal(size=(3, ROWS, 4))
        axes *= length / np.sqrt((axes**2).sum(axis=0))
        for axis, values in zip("xyz", axes, strict=True):
            vectors[axis] = values


def twin_of(function: Function, inputs: Mapping[str, Array]) -> Array:
    """What the twin's function of the same name makes of the inputs, block by block."""
    call = getattr(import_module(f"halfstep.twin.{function.file}"), function.name)
    hints = hints_of(call)
    results = np.zeros(ROWS, dtype_of(module_of(function).signature(function.name).result))
    for first in range(0, ROWS, BLOCK_ROWS):
        block = slice(first, first + BLOCK_ROWS)
        given = {name: values[block] for name, values in inputs.items()}
        like = np.zeros((BLOCK_ROWS, 4), function.format.value)
        arguments = [
            _argument(name, hints[name], given, like, function)
            for name in signature(call).parameters
        ]
        found = zip(leaves(results[block]), _parts(call(*arguments)), strict=True)
        for (place, target), part in found:
            assert part.dtype == target.dtype, f"{function}{place}: {part.dtype}"
            target[...] = part[:, 0] if part.ndim > target.ndim else part
    return results


def _argument(
    name: str, hint: Any, given: Mapping[str, Array], like: Array, function: Function
) -> Any:
    """An argument of a function of the twin, from those of the shader's; they differ in these."""
    match name:
        case "chosen" if hint is Chosen:
            return chosen_for(function.format, "visible")
        case "keys":
            return keys
        case "room":
            return 2 * PAIRS
        case "facts":
            return FACTS
        case "like":
            return like
        case "start" if "start_high" in given:
            return Key(given["start_high"][0], given["start_low"][0])
        case "table":
            return srgb_table()
        case "lines":
            lines = given["lines"]
            lines = lines[:, : given["count"][0] if "count" in given else lines.shape[1]]
            return [Line(lines["c"][:, k], lines["b"][:, k]) for k in range(lines.shape[1])]
        case "frame":
            return {key: _columns(given["frame"][key]) for key in given["frame"].dtype.fields or ()}
        case "ambient":
            return _columns(given["frame"]["ambient"])
        case "lights":
            vectors, colors = (given["lights"][key] for key in ("vector", "color"))
            return [Light(_columns(vectors[:, k]), _columns(colors[:, k]), k < 1) for k in (0, 1)]
        case _:
            return _as_twin(given[name], hint)


def _as_twin(values: Array, hint: Any) -> Any:
    """Rows as what the twin's annotation says: a struct, a plain number or an array of pixels."""
    if hint is np.void:
        return values[0]
    if hint is Any:
        hint = next(one for one in (Key, Offset) if one._fields == values.dtype.names)
    if isinstance(hint, type) and issubclass(hint, tuple):
        members = hints_of(hint).items()
        return hint(*(_as_twin(values[name], member) for name, member in members))
    if get_origin(hint) is list:
        return [values[:, k] for k in range(values.shape[1])]
    if hint in (int, bool):
        return hint(values[0])
    if hint in (np.float32, np.int64, Value):
        return values[0]
    if values.ndim == 1:
        return values[:, None]
    return values if values.shape[1] == 4 else _columns(values)


def _columns(values: Array) -> Array:
    """Rows (rows, n) of n numbers as n columns of pixels, (n, rows, 1)."""
    return values.T[..., None]


def _parts(result: Any) -> Iterator[Array]:
    """The arrays that the twin's structs are made of, in order."""
    if isinstance(result, tuple):
        for part in result:
            yield from _parts(part)
    elif isinstance(result, list):
        yield np.stack(result, axis=1)
    else:
        yield np.asarray(result)


@pytest.fixture(scope="module")
def drawn(wgsl: Kit) -> Drawn:
    """Draws the arguments of a function once, for its bits and its faults.

    The twin keeps or flushes subnormal numbers as the device does. Frames have the same bits in
    both cases (`tests/test_subnormals.py`), stages may not: a highlight below `shade.FAINT` can be
    subnormal, and is seen as none.
    """
    flushes = fingerprint(wgsl.device).subnormals == "flushed"

    @functools.cache
    def drawn(function: Function, seed: int) -> tuple[dict[str, Array], Array]:
        inputs = inputs_of(function, np.random.default_rng(seed))
        with flushing() if flushes else nullcontext():
            return inputs, twin_of(function, inputs)

    return drawn


def check(
    kit: Kit, function: Function, inputs: Mapping[str, Array], expected: Array, text: str
) -> None:
    """Compare a function of the shader with what the twin makes of the inputs."""
    bindings = BINDINGS if function.file == "encode" else None
    kit.check(text, function.name, lambda *_, **__: expected, inputs, bindings=bindings)


@pytest.mark.parametrize(
    "function", FUNCTIONS, ids=[f"{function.format.forms}-{function}" for function in FUNCTIONS]
)
def test_the_device_gives_the_bits_of_the_twin(
    function: Function, wgsl: Kit, drawn: Drawn, seed: int
) -> None:
    inputs, expected = drawn(function, seed)
    # Arguments that always give the same result test nothing.
    assert len({row.tobytes() for row in expected}) > 1
    check(wgsl, function, inputs, expected, text_of(function))


def test_no_stage_is_left_out() -> None:
    tested = {file for files in FILES.values() for file in files}
    there = {path.stem for path in (Path(__file__).parents[1] / "wgsl").glob("*.wgsl")}
    visits = {name for visit in VISITS.values() for name in visit.files}
    assert visits <= there
    joining = {
        name for item in STAGES if item.kind not in ALONE for name in (item.file, *item.others)
    }
    assert joining <= there
    # What fetches the half-spaces, and what is no stage.
    assert there - tested - visits - joining == {
        "lines_fetched",
        "canary",
        "canary_int64",
        "probe_rounds",
        "probe_subgroup",
    }


def test_every_function_has_a_planted_fault() -> None:
    assert {name for name, _, _ in FAULTS} == {str(function) for function in FUNCTIONS}


@pytest.mark.parametrize(("name", "old", "new"), FAULTS)
def test_a_fault_is_seen(name: str, old: str, new: str, wgsl: Kit, drawn: Drawn, seed: int) -> None:
    function = next(function for function in FUNCTIONS if str(function) == name)
    text = text_of(function, new)
    pattern = rf"^fn {function.name}\(.*?^}}"
    body = re.search(pattern, text, re.MULTILINE | re.DOTALL)
    assert body is not None
    assert old in body[0]
    faulty = text.replace(body[0], body[0].replace(old, new, 1))
    inputs, expected = drawn(function, seed)
    with pytest.raises(MismatchError):
        check(wgsl, function, inputs, expected, faulty)
