"""Records and constants shared by the host and the shaders, declared once.

``python -m halfstep.contract.layout`` writes ``layout.wgsl`` from this module; a test regenerates
it. NumPy dtypes follow WGSL's rules for size and alignment in the storage address space.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntFlag
from pathlib import Path

import numpy as np

from halfstep.contract.formats import FLOAT32, Format
from halfstep.contract.stretches import PIECE_BITS, PIECES, ROW_BITS

# A workgroup renders a tile of TILE x TILE pixels. An invocation renders a block of it: some quads
# side by side, each of LANES pixels in a row.
TILE = 16
LANES = 4
# Words of a tile's record: its place, the start of the list of each class, the end of the last.
TILE_WORDS = 8


class Flag(IntFlag):
    """Flags of a solid for the whole frame, found in float64 on the host."""

    EYE_INSIDE = 1  # rays start at the eye, which the solid contains
    STARTS_AT_EYE = 2  # u = -1 is the eye
    EYE_OUTSIDE_QUADRIC = 4  # F(h) > 0, the indicator (9)
    NEAR_CUT = 8  # the near base plane, not the eye, cuts the solid
    EYE_SURE = 16  # the flags about the eye hold for exact numbers, too
    RECHECKED = 32  # where float32 is not certain of it, integers are asked


class Shade(IntFlag):
    """Flags of a solid that a ray to a light or from a mirror may hit."""

    CASTS = 1  # it hides the light
    AT_LAMP = 2  # distances along rays count from the lamp, which is near the solid or inside it
    ENCLOSES = 4  # the light may be inside the solid
    FLAT = 8  # a bounded plane, without an inside
    CONVEX = 16  # what leaves it does not meet it again
    SELF = 32  # it may hide the light from its own points, seen from outside


@dataclass(frozen=True)
class Field:
    """A member of a record: a scalar or vector type, repeated ``count`` times if above 1.

    The count may be the name of a constant that depends on the scene; see `Record.counted`.
    """

    name: str
    type: str
    count: int | str
    meaning: str


# A slab's two surface numbers count from 1 after the surface of F. The second is 0 if the slab has
# only one half-space.
SLAB_BITS = 16


# Records begin at multiples of this many bytes, so that shaders can load them as vec4<u64>.
ALIGNMENT = 32


@dataclass(frozen=True)
class Record:
    """A WGSL struct and its NumPy dtype."""

    name: str
    meaning: str
    fields: tuple[Field, ...]

    def counted(self, **constants: int) -> Record:
        """The record with the values of ``constants`` in place of their names."""
        fields = (
            replace(field, count=constants.get(str(field.count), field.count))
            for field in self.fields
        )
        return replace(self, fields=tuple(fields))

    def dtype(self, number_format: Format = FLOAT32) -> np.dtype[np.void]:
        """The dtype of the record in a number format. All counts must be numbers."""
        numbers: dict[str, type[np.generic]] = {
            "Coefficient": number_format.coefficient,
            "Value": number_format.value,
            "Length": number_format.length,
        }
        formats: list[np.dtype[np.generic] | tuple[np.dtype[np.generic], tuple[int, ...]]] = []
        offsets: list[int] = []
        end = 0
        for field in self.fields:
            scalar, width = numbers.get(field.type), 1
            if scalar is None:
                scalar, width = _TYPES[field.type]
            align, count = np.dtype(scalar).itemsize * width, int(field.count)
            offset = -(-end // align) * align
            shape = (count,) * (count > 1) + (width,) * (width > 1)
            formats.append((np.dtype(scalar), shape))
            offsets.append(offset)
            end = offset + np.dtype(scalar).itemsize * width * count
        size = -(-end // ALIGNMENT) * ALIGNMENT
        return np.dtype(
            {
                "names": [field.name for field in self.fields],
                "formats": formats,
                "offsets": offsets,
                "itemsize": size,
            }
        )

    def wgsl(self) -> str:
        """The struct declaration."""
        lines = [f"// {self.meaning}", f"struct {self.name} {{"]
        for field in self.fields:
            type_ = field.type if field.count == 1 else f"array<{field.type}, {field.count}>"
            align = f"@align({ALIGNMENT}) " if field is self.fields[0] else ""
            lines.append(f"  {align}{field.name}: {type_},  // {field.meaning}")
        return "\n".join([*lines, "}"])


# NumPy scalar and components of each WGSL type. Coefficient, Value and Length depend on the format.
_TYPES: dict[str, tuple[type[np.generic], int]] = {
    "f32": (np.float32, 1),
    "i32": (np.int32, 1),
    "u32": (np.uint32, 1),
    "vec4<f32>": (np.float32, 4),
}

FRAME = Record(
    "Frame",
    "Values that all pixels of a band share.",
    (
        Field("first_ray", "vec4<f32>", 1, "world direction through pixel (0, 0), or its start"),
        Field("right", "vec4<f32>", 1, "change of first_ray to the next pixel on the right"),
        Field("down", "vec4<f32>", 1, "change of first_ray to the next row"),
        Field("ambient", "vec4<f32>", 1, "linear RGB"),
        Field("background", "vec4<f32>", 1, "linear RGB"),
        Field("first_row", "i32", 1, "first picture row of the band"),
        Field("row_quads", "u32", 1, "groups of four pixels in a row of the band"),
        Field("plane_quads", "u32", 1, "groups of four pixels in the whole band"),
        Field("forward", "vec4<f32>", 1, "direction of all rays, if they are parallel"),
    ),
)

SOLID = Record(
    "Solid",
    "A visible solid: F = A u² + G u + C over its own interval of depth, u from -1 to 1.",
    (
        Field("a", "Coefficient", 6, "A as coefficients of 1, x, y, x², xy, y²"),
        Field("g", "Coefficient", 6, "G"),
        Field("c", "Coefficient", 6, "C"),
        Field("host_error", "f32", 1, "error of A, G and C from the set-up, in their units"),
        Field("gradient", "f32", 18, "half the gradient of F, world: [1, u][1, x, y][axis]"),
        Field("center_x", "i32", 1, "pixel where x = 0"),
        Field("center_y", "i32", 1, "pixel where y = 0"),
        Field(
            "near_u", "Value", 1, "u of the near base plane, -ONE where it does not cut the solid"
        ),
        Field("far_u", "Value", 1, "u of the far base plane, ONE where it does not cut the solid"),
        Field("depth_middle", "f32", 1, "planar depth at u = 0"),
        Field("depth_half", "f32", 1, "depth = depth_middle + u depth_half"),
        Field("last_step", "f32", 1, "2^-n"),
        Field("steps", "u32", 1, "n"),
        Field("key_high", "u32", 1, "depth key at u = -1, high word"),
        Field("key_low", "u32", 1, "low word"),
        Field("key_shift", "u32", 1, "a last step is 2^key_shift units of the key"),
        Field("spare", "u32", 1, "bits of the key below a last step"),
        Field("flags", "u32", 1, "FLAG_… bits"),
        Field("surface", "u32", 1, "number of its first surface in the scene, from 1"),
        Field("plane_start", "u32", 1, "its first half-space"),
        Field("plane_count", "u32", 1, "number of its half-spaces"),
        Field("color", "f32", 3, "color of its material, linear RGB"),
        Field("specular", "f32", 1, "weight of the highlight"),
        Field("shininess", "u32", 1, "exponent of the highlight"),
        Field("polynomial", "u32", 1, "its row among the polynomials, if it has one"),
    ),
)

HALF_SPACE = Record(
    "HalfSpace",
    "A half-space along a ray: inside where c + b u <= 0.",
    (
        Field("c", "Coefficient", 3, "coefficients of 1, x, y"),
        Field("b", "Coefficient", 3, "the same"),
        Field("normal", "f32", 3, "outward unit normal, world"),
        Field("host_error", "f32", 1, "error of c and b from the set-up, in their units"),
    ),
)

LIGHT = Record(
    "Light",
    "A light, relative to the eye.",
    (
        Field("vector", "vec4<f32>", 1, "direction to it (w = 0) or w times its position"),
        Field("color", "vec4<f32>", 1, "linear RGB"),
    ),
)

REGION = Record(
    "Region",
    "An excerpt: the part of a copy of a group that some tiles see; grid points are 0 to 2^n.",
    (
        Field("left", "i32", 1, "first column of its rectangle"),
        Field("right", "i32", 1, "last column"),
        Field("top", "i32", 1, "first row"),
        Field("bottom", "i32", 1, "last row"),
        Field("near_high", "u32", 1, "depth key where rays start, high word"),
        Field("near_low", "u32", 1, "low word"),
        Field("first", "i32", 1, "grid point where rays start"),
        Field("start_end", "i32", 1, "last cell that may lie before the near base plane, or -1"),
        Field("last", "i32", 1, "last grid point before the far base plane"),
        Field("last_sure", "i32", 1, "the same, surely"),
        Field("solid", "u32", 1, "its row among the solids"),
        Field("surfaces", "u32", 1, "surfaces of its group, planes first"),
        Field("planes", "u32", 1, "planes among them"),
        Field("flat_start", "u32", 1, "its first plane"),
        Field("curved_start", "u32", 1, "its first quadric"),
        Field("looks_start", "u32", 1, "appearance of its first cell; its surfaces follow"),
        Field("cells", "u32", 1, "cells that its group shows"),
        Field("list_start", "u32", 1, "its list: numbers of planes, of quadrics, of cells"),
        Field("flat_count", "u32", 1, "planes in the list"),
        Field("curved_count", "u32", 1, "quadrics in the list"),
        Field("cell_count", "u32", 1, "cells in the list"),
        Field("first_group", "u32", 1, "where its program begins, in groups of words"),
        Field("end_group", "u32", 1, "where it ends"),
    ),
)

FLAT = Record(
    "Flat",
    "A plane of a region along a ray: F = c + b u.",
    (
        Field("c", "Coefficient", 3, "coefficients of 1, x, y"),
        Field("b", "Coefficient", 3, "the same"),
        Field("normal", "f32", 3, "gradient of F, world, of unit length"),
        Field("host_error", "f32", 1, "error of c and b from the set-up, in their units"),
        Field("eye", "u32", 1, "EYE_…: what is known of F at the eye"),
    ),
)

CURVED = Record(
    "Curved",
    "A quadric of a region along a ray: F = A u² + G u + C.",
    (
        Field("a", "Coefficient", 6, "A as coefficients of 1, x, y, x², xy, y²"),
        Field("g", "Coefficient", 6, "G"),
        Field("c", "Coefficient", 6, "C"),
        Field("host_error", "f32", 1, "error of A, G and C from the set-up, in their units"),
        Field("eye", "u32", 1, "EYE_…: what is known of F at the eye"),
        Field("gradient", "f32", 18, "half the gradient of F, world: [1, u][1, x, y][axis]"),
    ),
)

APPEARANCE = Record(
    "Appearance",
    "The appearance of a cell, or of a face that a surface cuts.",
    (
        Field("color", "f32", 3, "linear RGB"),
        Field("specular", "f32", 1, "weight of the highlight"),
        Field("shininess", "u32", 1, "exponent of the highlight"),
        Field("reflection", "f32", 1, "share of what it mirrors"),
        Field("is_own", "u32", 1, "0 for a surface with the appearance of the cell, else 1"),
    ),
)

POLYNOMIAL = Record(
    "Polynomial",
    "The polynomial of a solid or of a surface: F = Σ term (u - middle)^j x^a y^b.",
    (
        Field("host_error", "f32", 1, "error of F from the set-up, in its units; in integers, all"),
        Field("rounding", "f32", 1, "error of F from rounding, of the sum of all |terms|"),
        Field("middle", "f32", 1, "u about which F is expanded"),
        Field("scale", "f32", 1, "scale of pixel offsets, so that |x| and |y| are at most 1"),
        Field("shift", "u32", 1, "it is 2^-shift"),
        Field("left", "i32", 1, "least offset of its rectangle"),
        Field("right", "i32", 1, "greatest offset"),
        Field("top", "i32", 1, "least offset down"),
        Field("bottom", "i32", 1, "greatest offset down"),
        Field("sheet", "u32", 1, "1 if F = 0 is shown from both sides, else 0"),
        Field("ball", "u32", 1, "number of the ball that bounds it, behind planes; 0 for none"),
        Field("axes", "f32", 9, "unit vectors of the camera, world: right, down, forward"),
        Field("tangents", "f32", 3, "tangents: right and down at x = y = 0; of x or y = 1"),
        Field(
            "stretch", "f32", 2, "width of x = 1 in halves of the interval: in the middle; per u"
        ),
        Field("terms", "Length", "TERMS", "as gpu/contract/powers.py orders them"),
    ),
)

HIGHER = Record(
    "Higher",
    "A surface of a region whose order is above two; its form has a record of its own.",
    (
        Field("form", "u32", 1, "its row among the polynomials, or among the formulas"),
        Field("pairs", "u32", 1, "the most intervals of grid points in which F <= 0"),
        Field("center_x", "i32", 1, "pixel where its x = 0"),
        Field("center_y", "i32", 1, "pixel where its y = 0"),
        Field("first", "i32", 1, "the first leaf in which a ray may cross it"),
        Field("start", "f32", 1, "u where that leaf begins"),
        Field("stop", "f32", 1, "u behind which it is not crossed"),
        Field("eye", "u32", 1, "EYE_…: what is known of F at the eye"),
        Field("is_formula", "u32", 1, "1 if its form is a formula that is no polynomial, else 0"),
        Field("low", "f32", 3, "least local coordinates within the bounds of such a formula"),
        Field("high", "f32", 3, "greatest local coordinates"),
    ),
)

EXPRESSION = Record(
    "Expression",
    "The formula of a solid or surface. A ray's points are level + u along, in local coordinates.",
    (
        Field("host_error", "f32", 1, "error of points from the set-up"),
        Field("scale", "f32", 1, "scale of pixel offsets, so that |x| and |y| are at most 1"),
        Field("left", "i32", 1, "least offset of its rectangle"),
        Field("right", "i32", 1, "greatest offset"),
        Field("top", "i32", 1, "least offset down"),
        Field("bottom", "i32", 1, "greatest offset down"),
        Field("sheet", "u32", 1, "1 if F = 0 is shown from both sides, else 0"),
        Field("ball", "u32", 1, "number of the ball that bounds it, behind planes; 0 for none"),
        Field("formula", "u32", 1, "number of its formula in the scene"),
        Field("value_error", "f32", 1, "error of the values of arcs, if its formula is tame"),
        Field("slope_error", "f32", 1, "error of their slopes, for each half width of a cell"),
        Field("bend_error", "f32", 1, "error of their bends, for its square"),
        Field("level_x", "f32", 3, "local coordinate at u = 0: coefficients of 1, x, y"),
        Field("level_y", "f32", 3, "the same"),
        Field("level_z", "f32", 3, "the same"),
        Field("along_x", "f32", 3, "its change to u = 1, likewise"),
        Field("along_y", "f32", 3, "the same"),
        Field("along_z", "f32", 3, "the same"),
        Field("axes", "f32", 9, "world from local"),
        Field("numbers", "f32", "NUMBERS", "numbers of the formula, in the order of operations"),
    ),
)

LOCATION = Record(
    "Location",
    "Positions of the points of a visible solid on the grid of the world, before a shift.",
    (
        Field("level", "Length", 9, "the point at u = 0, from the anchor: [1, x, y][axis]"),
        Field("along", "Length", 9, "its change to u = 1: [1, x, y][axis]"),
        Field("anchor", "i32", 3, "the anchor, on the grid"),
        Field("shift", "u32", 1, "bits of the integers below a unit of the grid"),
        Field("center_x", "i32", 1, "pixel where x = 0"),
        Field("center_y", "i32", 1, "pixel where y = 0"),
        Field("steps", "u32", 1, "n"),
        Field("last_step", "f32", 1, "2^-n"),
        Field("surface", "u32", 1, "number of the solid's first surface in the scene, from 1"),
        Field("count", "u32", 1, "how many surfaces it has"),
        Field("reflection", "f32", 1, "share of what it mirrors"),
        Field("body", "u32", 1, "number of the solid among bodies, from 1"),
        Field("flags", "u32", 1, "SHADE_… bits"),
    ),
)

LIGHT_VIEW = Record(
    "LightView",
    "A light with shadows: axes along its rays, or its position; and its occluders.",
    (
        Field("bit", "u32", 1, "its bit in the output shadow"),
        Field("axis", "u32", 1, "the axis of the world closest to its rays"),
        Field("sign", "i32", 1, "1 if the axis points to a far light or away from a lamp, else -1"),
        Field("shear_x", "i32", 1, "how far rays go along the next axis, in 2^-30"),
        Field("shear_y", "i32", 1, "the same along the axis after the next"),
        Field("origin", "i32", 3, "position of a lamp on the grid"),
        Field("first", "u32", 1, "its first occluder"),
        Field("end", "u32", 1, "the occluder behind its last"),
        Field("groups", "u32", 1, "box of its first group of occluders"),
        Field("far_groups", "u32", 1, "box of its first group of groups"),
        Field("sides", "u32", 1, "how many sides there are"),
    ),
)

OCCLUDER = Record(
    "Occluder",
    "An occluder, a solid that may hide a light: F and half-spaces along rays to the light.",
    (
        Field("a", "Value", 6, "A as coefficients of tz, tx, ty, x², xy, y²; for A, t is z"),
        Field("g", "Value", 6, "G"),
        Field("c", "Value", 6, "C; for C, z is t"),
        Field("end", "Value", 1, "1/v where the ray ends: at a lamp, or behind the solid"),
        Field("unit", "f32", 1, "one over the radius, in units of the grid"),
        Field("level", "u32", 1, "the radius is 2^level units"),
        Field("center", "i32", 3, "on the grid"),
        Field("axis", "u32", 1, "the axis of the world closest to rays to the light; as LightView"),
        Field("sign", "i32", 1, "the same"),
        Field("shear_x", "i32", 1, "the same"),
        Field("shear_y", "i32", 1, "the same"),
        Field("reach", "i32", 1, "how far a lamp is along the axis, in units of the grid, or 0"),
        Field("weight", "f32", 1, "1/reach"),
        Field("factor", "i32", 1, "the same as factor 2^-factor_shift, in 2^-28"),
        Field("factor_shift", "u32", 1, "see factor"),
        Field("flags", "u32", 1, "SHADE_… bits"),
        Field("bit", "u32", 1, "bit of the light in the output shadow"),
        Field("curve", "u32", 1, "number of the quadric among surfaces; 0 if it has none"),
        Field("caster", "u32", 1, "row of its form among casters, from 1; 0 if it has none"),
        Field("first", "u32", 1, "number of its first surface in the scene, from 1"),
        Field("count", "u32", 1, "how many surfaces it has"),
        Field("slab_start", "u32", 1, "its first slab"),
        Field("slab_count", "u32", 1, "how many it has"),
    ),
)

SIDE = Record(
    "Side",
    "A surface: bits of the lights that do not reach it whatever stands before them.",
    (
        Field("front", "u32", 1, "seen from outside"),
        Field("back", "u32", 1, "seen from inside"),
        Field("opened", "u32", 1, "seen from inside, which a base plane opens"),
        Field("curve", "u32", 1, "number of its solid among occluders, from 1, if it is quadric"),
    ),
)

SHARED = Record(
    "Shared",
    "A surface that several solids may share.",
    (
        Field("side", "u32", 1, "its side with F > 0, if something else has that too; else 0"),
        Field("count", "u32", 1, "how many of these records there are"),
    ),
)

SLAB = Record(
    "Slab",
    "Half-spaces of an occluder along rays to a light: where c + b v <= 0, and >= -width t.",
    (
        Field("c", "Value", 3, "coefficients of t, x, y"),
        Field("b", "Value", 3, "coefficients of z, x, y"),
        Field("width", "Value", 1, "distance of the two half-spaces, as a coefficient of t"),
        Field("numbers", "u32", 1, "the numbers of its two surfaces, SLAB_BITS each"),
    ),
)

CASTER = Record(
    "Caster",
    "The form of an occluder or a body of an order above two, and its coordinates along rays.",
    (
        Field("level", "f32", 3, "of the middle, or of a lamp that is near; the box is -1 to 1"),
        Field(
            "by_x", "f32", 3, "their changes for a radius: first axis across rays to a light, or x"
        ),
        Field("by_y", "f32", 3, "the same: second axis, or y"),
        Field("by_v", "f32", 3, "the same: along the rays, or z"),
        Field("shrink", "f32", 1, "1/v where the rays meet, at a lamp; else 0"),
        Field("rounding", "f32", 1, "error of F from rounding, of the sum of all |terms|"),
        Field("sheet", "u32", 1, "1 if F = 0 is shown from both sides, else 0"),
        Field("ball", "u32", 1, "1 if its quadric is a ball that bounds it, else 0"),
        Field("formula", "u32", 1, "row of its formula, from 1; 0 if it is a polynomial"),
        Field("center", "f32", 3, "middle of the box in its own coordinates, of a formula"),
        Field("size", "f32", 3, "half the box, likewise"),
        Field("pairs", "u32", 1, "of a surface of a copy: the most stretches in which F <= 0"),
        Field("off", "f32", 3, "error of F from the terms of each coordinate, over `rounding`"),
        Field("terms", "f32", "CASTER_TERMS", "as gpu/contract/powers.py orders them"),
    ),
)

VEIL_VIEW = Record(
    "VeilView",
    "The veils of a light with shadows.",
    (
        Field("first", "u32", 1, "its first veil"),
        Field("end", "u32", 1, "the one behind its last"),
    ),
)

VEIL = Record(
    "Veil",
    "A veil: the part of a copy of a group that a bundle of rays to a light may hit.",
    (
        Field("low", "f32", 2, "their least a and b over h, in radii"),
        Field("high", "f32", 2, "their greatest"),
        Field("copy", "u32", 1, "its row among the copies that hide lights"),
        Field("first", "i32", 1, "grid point before which it has nothing"),
        Field("last", "i32", 1, "grid point behind which it has nothing"),
        Field("flat_start", "u32", 1, "the first plane of the copy along rays to the light"),
        Field("curved_start", "u32", 1, "its first quadric"),
        Field("planes", "u32", 1, "planes of its group"),
        Field("list_start", "u32", 1, "its list: numbers of planes, of quadrics, of others"),
        Field("flat_count", "u32", 1, "planes in the list"),
        Field("curved_count", "u32", 1, "quadrics in the list"),
        Field("first_group", "u32", 1, "where its program begins, in groups of words"),
        Field("end_group", "u32", 1, "where it ends"),
        Field("higher_start", "u32", 1, "the first form of the copy's surfaces of a higher order"),
        Field("lower", "u32", 1, "surfaces of its group before these"),
        Field("higher_count", "u32", 1, "surfaces of a higher order in the list"),
    ),
)

VEIL_FLAT = Record(
    "VeilFlat",
    "A plane of a copy along rays to a light: F = c + b v.",
    (
        Field("c", "Value", 3, "coefficients of t, x, y"),
        Field("b", "Value", 3, "coefficients of z, x, y"),
    ),
)

VEIL_CURVED = Record(
    "VeilCurved",
    "A quadric of a copy along rays to a light: F = A v² + G v + C.",
    (
        Field("a", "Value", 6, "A as coefficients of tz, tx, ty, x², xy, y²; for A, t is z"),
        Field("g", "Value", 6, "G"),
        Field("c", "Value", 6, "C; for C, z is t"),
    ),
)

MIRRORS = Record(
    "Mirrors",
    "Values that all rays from mirrors share.",
    (
        Field("middle", "f32", 3, "of the grid of the world, from the eye"),
        Field("unit", "f32", 1, "of the grid"),
        Field("count", "u32", 1, "boxes"),
    ),
)

BODY = Record(
    "Body",
    "A solid or copy of a group that mirrors show, about its middle, along world axes, in radii.",
    (
        Field("second", "f32", 6, "half the second derivative of F: xx, yy, zz, xy, xz, yz"),
        Field("slope", "f32", 3, "half the gradient of F in the middle"),
        Field("value", "f32", 1, "F in the middle"),
        Field("flags", "u32", 1, "SHADE_… bits"),
        Field("surface", "u32", 1, "number of F among surfaces; those of its half-spaces follow"),
        Field("face_start", "u32", 1, "its first half-space"),
        Field("face_count", "u32", 1, "how many it has; a bounded plane has two"),
        Field("center", "i32", 3, "the middle, on the grid"),
        Field("unit", "f32", 1, "one over the radius, in units of the grid; a power of two"),
        Field("bound", "f32", 1, "how large its ball is, in that radius; at most 1"),
        Field("color", "f32", 3, "of its material, linear RGB"),
        Field("specular", "f32", 1, "weight of the highlight"),
        Field("shininess", "u32", 1, "exponent of the highlight"),
        Field("reflection", "f32", 1, "weight of the mirror image"),
        Field("curve", "u32", 1, "number of the quadric among surfaces; 0 if it has none"),
        Field("caster", "u32", 1, "row of its form, from 1; 0 if its order is two or less"),
        Field("copy", "u32", 1, "row of its cells, from 1; 0 if it is a solid"),
    ),
)

FACE = Record(
    "Face",
    "A half-space of a body: n.x + beyond <= 0.",
    (
        Field("normal", "f32", 3, "n, unit"),
        Field("beyond", "f32", 1, "distance of the middle outside it"),
    ),
)

REFLECTED = Record(
    "Reflected",
    "The cells of a body that is a copy of a group: their program and their surfaces.",
    (
        Field("count", "u32", 1, "how many numbers of surfaces the body has: cells times surfaces"),
        Field("surfaces", "u32", 1, "surfaces of its group, planes first"),
        Field("planes", "u32", 1, "planes among them"),
        Field("flat_start", "u32", 1, "its first plane, among the half-spaces of bodies"),
        Field("curved_start", "u32", 1, "its first quadric"),
        Field("looks_start", "u32", 1, "appearance of its first cell; its surfaces follow"),
        Field("cells", "u32", 1, "cells of its program"),
        Field("list_start", "u32", 1, "its list: numbers of planes, of quadrics, of others"),
        Field("flat_count", "u32", 1, "planes in the list"),
        Field("curved_count", "u32", 1, "quadrics in the list"),
        Field("higher_count", "u32", 1, "surfaces in the list of an order above two"),
        Field("higher_start", "u32", 1, "the first form of such a surface, among those of bodies"),
        Field("lower", "u32", 1, "surfaces of its group before these"),
        Field("first_group", "u32", 1, "where its program begins, in groups of words"),
        Field("end_group", "u32", 1, "where it ends"),
    ),
)

BOWL = Record(
    "Bowl",
    "A quadric of a copy of a group, about the middle of its body, as F of a body.",
    (
        Field("second", "f32", 6, "half the second derivative of F: xx, yy, zz, xy, xz, yz"),
        Field("slope", "f32", 3, "half the gradient of F in the middle"),
        Field("value", "f32", 1, "F in the middle"),
        Field("error", "f32", 1, "error of F from rounding, along a ray"),
    ),
)

HULL = Record(
    "Hull",
    "A box around a body, or around the boxes that follow, up to `next`.",
    (
        Field("center", "f32", 3, "on the grid"),
        Field("half", "f32", 3, "from there to its sides, in units of the grid"),
        Field("next", "u32", 1, "the box to look at after this one if no ray meets this one"),
        Field("body", "u32", 1, "number of the body, from 1; 0 for a box around boxes"),
    ),
)

BOX = Record(
    "Box",
    "The box of points that an occluder may hide from a light, in the light's axes.",
    (
        Field("low", "f32", 3, "least coordinates on the grid"),
        Field("high", "f32", 3, "greatest"),
        Field("first", "u32", 1, "first surface from whose points it does not hide the light"),
        Field("count", "u32", 1, "how many such surfaces there are"),
        Field("lit", "f32", 4, "where this affine function is positive, it hides nothing"),
    ),
)

RECORDS = (
    FRAME,
    SOLID,
    HALF_SPACE,
    LIGHT,
    REGION,
    FLAT,
    CURVED,
    APPEARANCE,
    POLYNOMIAL,
    HIGHER,
    EXPRESSION,
    LOCATION,
    LIGHT_VIEW,
    OCCLUDER,
    SIDE,
    SHARED,
    SLAB,
    CASTER,
    VEIL_VIEW,
    VEIL,
    VEIL_FLAT,
    VEIL_CURVED,
    MIRRORS,
    BODY,
    FACE,
    REFLECTED,
    BOWL,
    HULL,
    BOX,
)


def wgsl() -> str:
    """Text of ``layout.wgsl``."""
    lines = [
        "// Records and constants that host and device share, as `make layout` writes them.",
        "",
    ]
    lines += [f"const TILE: u32 = {TILE}u;", f"const LANES: u32 = {LANES}u;"]
    lines += [f"const FLAG_{flag.name}: u32 = {flag.value}u;" for flag in Flag]
    lines += [f"const SHADE_{shade.name}: u32 = {shade.value}u;" for shade in Shade]
    bits = {"ROW_BITS": ROW_BITS, "PIECE_BITS": PIECE_BITS, "PIECES": PIECES}
    lines += [f"const {name}: u32 = {value}u;" for name, value in bits.items()]
    lines.append(f"const SLAB_BITS: u32 = {SLAB_BITS}u;")
    for record in RECORDS:
        lines += ["", record.wgsl()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    import halfstep.wgsl

    Path(halfstep.wgsl.__path__[0], "layout.wgsl").write_text(wgsl())
