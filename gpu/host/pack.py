"""Per-frame constants as the records that the shaders and the twin read."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import F32, U32, Bools, Floats, Ints, Records
from halfstep.contract.classes import Class
from halfstep.contract.expressions import PackedExpressions
from halfstep.contract.formats import FIXED32, Format
from halfstep.contract.keys import SPARE_BITS
from halfstep.contract.layout import Flag
from halfstep.contract.mirrors import PackedMirrors
from halfstep.contract.polynomials import PackedPolynomials
from halfstep.contract.regions import PackedRegions
from halfstep.contract.shadows import PackedShadows
from halfstep.contract.veils import PackedVeils
from halfstep.host.edges import monomials_of
from halfstep.host.forms import FAINT, fixed_point_scale
from halfstep.host.geometry import Geometry
from halfstep.host.light import Lit, locations
from halfstep.host.numbers import Numbers, numbers_of
from halfstep.host.pack_expressions import pack_expressions
from halfstep.host.pack_polynomials import pack_higher, pack_polynomials
from halfstep.host.pack_regions import Appearances, appearances, pack_regions
from halfstep.host.precise import with_precise_weights
from halfstep.host.regions import NO_MATERIAL
from halfstep.host.setup import START_BITS, Setup
from halfstep.host.sharing import fill
from halfstep.host.steps import Steps, format_for
from halfstep.scene import Scene

# A tile's record has its place, the start of each list, and the end of the last list.
MOST_CLASSES = layout.TILE_WORDS - 2
# Rows: the class of a solid seen whole and from outside. Columns: its class whole, cut, and seen
# from inside.
_CLASS_SEEN = np.array(
    [
        [Class.ELLIPSOID, Class.QUADRIC, Class.QUADRIC_INSIDE],
        [Class.QUADRIC, Class.QUADRIC, Class.QUADRIC_INSIDE],
        [Class.QUADRIC_INSIDE] * 3,
        [Class.POLYHEDRON, Class.POLYHEDRON, Class.POLYHEDRON_INSIDE],
        [Class.POLYHEDRON_INSIDE] * 3,
        [Class.PATCH] * 3,
        [Class.REGION, Class.REGION, Class.REGION_INSIDE],
        [Class.REGION_INSIDE] * 3,
        [Class.POLYNOMIAL] * 3,
        [Class.FORMULA] * 3,
    ],
    np.int64,
)
# The article method has one class for all quadrics and one for all polyhedra.
_ARTICLE_CLASS = np.array(
    [
        Class.QUADRIC,
        Class.QUADRIC,
        Class.QUADRIC,
        Class.POLYHEDRON,
        Class.POLYHEDRON,
        Class.PATCH,
        Class.REGION,
        Class.REGION_INSIDE,
        Class.POLYNOMIAL,
        Class.FORMULA,
    ],
    np.int64,
)

# Classes that another class can stand for.
_CLOSED = {
    Class.POLYHEDRON: Class.POLYHEDRON_INSIDE,
    Class.QUADRIC: Class.QUADRIC_INSIDE,
    Class.ELLIPSOID: Class.QUADRIC_INSIDE,
}

_FRAME, _LIGHT = layout.FRAME.dtype(), layout.LIGHT.dtype()


@dataclass(frozen=True)
class Surfaces:
    """The numbers and materials of a scene's surfaces."""

    numbers: Numbers
    color: F32  # (K, 3), of each solid's material
    specular: F32  # (K,)
    shininess: U32  # (K,)
    normal: F32  # (M, 3), normal of each half-space, world
    outside_class: Ints  # (K,), class of each solid seen whole and from outside
    appearances: Appearances | None  # appearances of cells and their faces


@dataclass(frozen=True)
class Packed:
    """One frame: V visible solids ordered by class, then by place in the scene."""

    setup: Setup
    surfaces: Surfaces
    steps: Steps  # halvings of each solid, in the order of ``setup``
    order: Ints  # (V,), row of each solid in ``setup``
    classes: Ints  # (V,)
    format: Format
    solids: Records
    half_spaces: Records
    key_bits: int  # depth key = t 2^key_bits
    lights: Records
    # If possible, the needs of shaders are those of the whole scene, so that a solid that leaves
    # the picture needs no new shader.
    present: tuple[Class, ...]  # classes that the scene's solids have, in this frame or otherwise
    shininess_bits: int  # bits of the largest exponent of a highlight, 0 if no material shines
    most_half_spaces: int  # the most half-spaces of a solid
    solid_count: int  # of the scene
    surface_count: int  # of the scene
    regions: PackedRegions | None  # the copies of groups, if there are any
    polynomials: PackedPolynomials | None  # the polynomials of solids, if there are any
    expressions: PackedExpressions | None  # the other formulas of solids, if there are any
    locations: Records | None = None  # (V,), positions of the points of solids, if needed
    shadows: PackedShadows | None = None  # the occluders, if lights have shadows
    mirrors: PackedMirrors | None = None  # the bodies, if there are mirrors
    veils: PackedVeils | None = None  # the veils, if copies of groups hide lights
    shared: Records | None = None  # sides of surfaces that solids share, if there are some


def surfaces(scene: Scene, geometry: Geometry) -> Surfaces:
    """Number the surfaces of ``scene`` and look up the material of each solid."""
    per_solid, alone = geometry.plane_count + 1, geometry.solid_count
    balls = geometry.in_balls
    per_solid[balls] += 1  # the number of a ball comes behind those of the half-spaces
    regions = geometry.regions
    if regions is not None:
        per_solid[alone:] = regions.faces[regions.of]
    first = 1 + np.cumsum(per_solid) - per_solid
    owner = np.repeat(np.arange(alone), per_solid[:alone])
    materials = [scene.material_of(solid) for solid in scene.solids]
    # Cells have their own materials.
    materials += [NO_MATERIAL] * (geometry.count - alone)
    normals = np.einsum(
        "ijn,jn->ni",
        np.take(geometry.world_from_local, geometry.plane_solid, axis=-1),
        geometry.planes[:3],
    )
    number = np.zeros(len(owner) + 1, np.int32)
    number[0] = -1
    of = geometry.plane_solid
    place = np.arange(len(of)) - geometry.plane_start[of]
    number[first[of] + 1 + place] = geometry.plane_number
    number[first[balls] + 1 + geometry.plane_count[balls]] = 1
    # Edges of the screen rectangle are not seen and have no normal.
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Surfaces(
        numbers=numbers_of(
            scene,
            solid=np.append(-1, owner).astype(np.int32),
            surface=number,
            first=first,
            count=int(per_solid.sum()),
            regions=regions,
        ),
        color=np.array([material.color for material in materials], np.float32).reshape(-1, 3),
        specular=np.array([material.specular for material in materials], np.float32),
        shininess=np.array([material.exponent for material in materials], np.uint32),
        normal=_clear(normals / np.where(length > 0, length, 1.0)).astype(np.float32),
        outside_class=_outside_classes(geometry),
        appearances=None if regions is None else appearances(scene, regions),
    )


def pack(
    scene: Scene,
    geometry: Geometry,
    tables: Surfaces,
    setup: Setup,
    steps: Steps,
    lit: Lit | None = None,
) -> Packed:
    """Records of the frame ``setup`` with ``steps`` halvings for each solid."""
    count = steps.count
    classes, outside = _classes(tables, setup), tables.outside_class
    if scene.accuracy.method == "article":
        classes, outside = _ARTICLE_CLASS[classes], _ARTICLE_CLASS[outside]
    classes, outside = _fewer(classes, outside)
    # Numbers of 16 bits or less are sorted in linear time.
    order = np.argsort(classes.astype(np.uint8), kind="stable")
    number_format = format_for(scene.accuracy, int(count.max(initial=0)))
    veils = None if lit is None else lit.veils
    words = np.zeros(0, np.uint32) if lit is None else lit.words
    regions = None
    if tables.appearances is not None:
        regions = pack_regions(setup, tables.appearances, count, number_format, words)
    keys = _keys(setup, count)
    offsets = monomials_of(setup.offsets.T + layout.TILE).T  # tiles reach beyond rectangles
    solids = _solids(tables, setup, steps, number_format, keys, offsets)
    half_spaces = _half_spaces(tables, setup, number_format, offsets)
    polynomials = _polynomials(scene, setup, half_spaces, number_format)
    expressions = pack_expressions(setup, half_spaces)
    if (np.diff(order) != 1).any():
        solids = solids.take(order)  # a fancy index copies member by member
    looks = np.zeros(0, np.int64) if tables.appearances is None else tables.appearances.start
    return Packed(
        setup=setup,
        surfaces=tables,
        steps=steps,
        order=order,
        classes=classes[order],
        format=number_format,
        solids=solids,
        half_spaces=half_spaces,
        key_bits=keys.bits,
        lights=_lights(scene, setup),
        present=_present(classes, outside),
        shininess_bits=_largest_exponent(tables).bit_length(),
        most_half_spaces=int(geometry.plane_count.max(initial=0)),
        solid_count=len(tables.numbers.first),
        surface_count=tables.numbers.count,
        regions=None
        if regions is None
        else _with_higher(
            regions,
            pack_higher(setup, count),
            polynomials,
            expressions,
        ),
        polynomials=polynomials,
        expressions=expressions,
        locations=None if lit is None else locations(lit, setup, order, solids, number_format),
        shadows=None if lit is None or lit.shadows is None else lit.shadows.packed(number_format),
        mirrors=None
        if lit is None or lit.mirrors is None
        else lit.mirrors.packed(setup.view, looks),
        veils=veils,
        shared=None if lit is None else lit.shared,
    )


def _with_higher(
    regions: PackedRegions,
    higher: Records | None,
    polynomials: PackedPolynomials | None,
    expressions: PackedExpressions | None,
) -> PackedRegions:
    """Copies of groups with their surfaces of an order above two."""
    if higher is None:
        return regions
    pairs = int(higher["pairs"].max(initial=0))
    return replace(
        regions, higher=higher, polynomials=polynomials, expressions=expressions, pairs=pairs
    )


class _Keys(NamedTuple):
    """The scale of depth keys."""

    bits: int  # depth key = t 2^bits
    spare: int  # bits below a last step


def _keys(setup: Setup, count: Ints) -> _Keys:
    """The scale of the depth keys of solids that have ``count`` halvings."""
    longest = int((setup.level + np.maximum(count + 1, START_BITS)).max(initial=0))
    # Spare bits for error bounds finer than a step, if the key and 32-bit counts leave room.
    spare = min(SPARE_BITS, 63 - longest, 30 - int(count.max(initial=1)))
    return _Keys(longest + spare, spare)


def _solids(
    tables: Surfaces,
    setup: Setup,
    steps: Steps,
    number_format: Format,
    keys: _Keys,
    offsets: Floats,
) -> Records:
    """Records of the solids in the order of ``setup``; ``offsets`` are largest monomials (V, 6)."""
    solids = np.zeros(setup.count, _types(number_format)[0])
    # Copies of groups come last, and have no quadric themselves.
    alone = len(setup.a)
    own = solids[:alone]
    quadratic = {"a": setup.a, "g": setup.g, "c": setup.c}
    host_error = setup.host_error
    if number_format.integer:
        sums = [(np.abs(form) * offsets[:alone]).sum(axis=1) for form in quadratic.values()]
        unit = fixed_point_scale(np.max(sums, axis=0))
        quadratic = {name: np.rint(form * unit) for name, form in quadratic.items()}
        host_error = host_error * unit[:, 0]
    for name, form in quadratic.items():
        own[name] = form
    own["host_error"] = host_error
    own["gradient"] = setup.gradient.reshape(-1, 18)
    start = (setup.start * 2.0**keys.bits).astype(np.uint64)
    facts = {
        Flag.EYE_INSIDE: setup.eye_inside,
        Flag.STARTS_AT_EYE: setup.starts_at_eye,
        Flag.EYE_OUTSIDE_QUADRIC: setup.eye_outside_quadric,
        Flag.NEAR_CUT: setup.near_cut,
        Flag.EYE_SURE: setup.eye_sure,
        Flag.RECHECKED: _rechecked(setup),
    }
    fill(
        solids,
        {
            "center_x": setup.center[:, 0],
            "center_y": setup.center[:, 1],
            "near_u": _value(setup.near_u, number_format),
            "far_u": _value(setup.far_u, number_format),
            "depth_middle": setup.depth_middle,
            "depth_half": setup.depth_half,
            "last_step": np.exp2(-steps.count),
            "steps": steps.count,
            "key_high": start >> np.uint64(32),
            "key_low": start & np.uint64(0xFFFFFFFF),
            "key_shift": keys.bits - (setup.level + steps.count + 1),
            # Plain numbers, because NumPy takes longer for members of an enumeration.
            "flags": np.asarray(sum(int(flag) * holds for flag, holds in facts.items())),
            "surface": tables.numbers.first[setup.solid],
            "plane_start": setup.plane_start,
            "plane_count": setup.plane_count,
            "color": tables.color.take(setup.solid, axis=0),
            "specular": tables.specular[setup.solid],
            "shininess": tables.shininess[setup.solid],
        },
    )
    solids["spare"] = keys.spare
    if setup.polynomials is not None:
        row = setup.polynomials.row
        solids["polynomial"][row] = np.arange(len(row))
    if setup.copies is not None and setup.copies.higher is not None:
        owner = setup.copies.higher.owner
        row = setup.copies.row
        solids["polynomial"][row] = np.searchsorted(owner, np.arange(len(row)))
    if setup.formulas is not None:
        row = setup.formulas.row
        solids["polynomial"][row] = np.arange(len(row))
    return solids


def _rechecked(setup: Setup) -> Bools:
    """The solids (V,) of which integers are asked where float32 is not certain."""
    found = np.zeros(setup.count, bool)
    if setup.polynomials is not None:
        found[setup.polynomials.row] = True
    return found


def in_integers(packed: Packed, scene: Scene) -> Packed:
    """The records that polynomials of solids of a scene need for their search in integers.

    Solids keep their rows and their halvings.
    """
    setup = packed.setup
    alone = replace(setup, copies=None)
    offsets = monomials_of(setup.offsets.T + layout.TILE).T
    keys = _Keys(packed.key_bits, int(packed.solids["spare"].max(initial=0)))
    solids = _solids(packed.surfaces, alone, packed.steps, FIXED32, keys, offsets)
    half_spaces = _half_spaces(packed.surfaces, setup, FIXED32, offsets)
    return replace(
        packed,
        format=FIXED32,
        solids=solids.take(packed.order),
        half_spaces=half_spaces,
        polynomials=_polynomials(scene, alone, half_spaces, FIXED32),
        expressions=None,
    )


def _polynomials(
    scene: Scene, setup: Setup, half_spaces: Records, number_format: Format
) -> PackedPolynomials | None:
    """Records of the polynomials of a frame; None if the scene has none."""
    found = pack_polynomials(setup, half_spaces, number_format)
    if found is None or number_format is not FIXED32:
        return found
    return with_precise_weights(found, scene, setup)


def _half_spaces(tables: Surfaces, setup: Setup, number_format: Format, offsets: Floats) -> Records:
    """Records of the half-spaces; ``offsets`` are those of `_solids`."""
    half_spaces = np.zeros(len(setup.plane), _types(number_format)[1])
    plane_c, plane_b = setup.plane_c, setup.plane_b
    plane_host_error = setup.plane_host_error
    if number_format.integer:
        owner = np.repeat(np.arange(setup.count), setup.plane_count)
        sums = [(np.abs(form) * offsets[owner, :3]).sum(axis=1) for form in (plane_c, plane_b)]
        unit = fixed_point_scale(np.max(sums, axis=0))
        plane_c, plane_b = np.rint(plane_c * unit), np.rint(plane_b * unit)
        plane_host_error = plane_host_error * unit[:, 0]
    half_spaces["c"], half_spaces["b"] = plane_c, plane_b
    half_spaces["normal"] = tables.normal.take(setup.plane, axis=0)
    half_spaces["host_error"] = plane_host_error
    return half_spaces


def _largest_exponent(tables: Surfaces) -> int:
    """The largest exponent of all highlights, 0 if no material shines."""
    largest = tables.shininess.max(initial=0)
    if tables.appearances is not None:
        largest = max(largest, tables.appearances.records["shininess"].max(initial=0))
    return int(largest)


@functools.cache
def _types(number_format: Format) -> tuple[np.dtype[np.void], np.dtype[np.void]]:
    """The dtypes of the records of solids and of half-spaces."""
    return layout.SOLID.dtype(number_format), layout.HALF_SPACE.dtype(number_format)


def _classes(tables: Surfaces, setup: Setup) -> Ints:
    inside = setup.eye_inside | setup.near_cut
    # The class of a whole ellipsoid asks only the discriminant, and would also find roots behind
    # the eye. A solid seen from inside is cut as well, so the sum is up to two.
    cut = setup.near_cut | setup.starts_at_eye | (setup.far_u != 1.0)
    column = np.add(cut, inside, dtype=np.int64)
    return np.asarray(_CLASS_SEEN[tables.outside_class[setup.solid], column])


def _fewer(classes: Ints, outside: Ints) -> tuple[Ints, Ints]:
    """The classes, some joined: code for solids that rays may start in also works for others.

    Regions compile long, so they share one class if one of them needs it. If there are more classes
    than a tile's record has lists, polyhedra share one, then quadrics, then ellipsoids.
    """
    table = np.arange(len(Class))
    seen = np.bincount(np.append(classes, outside), minlength=len(Class)) > 0
    if seen[Class.REGION_INSIDE]:
        table[Class.REGION], seen[Class.REGION] = Class.REGION_INSIDE, False
    for closed, opened in _CLOSED.items():
        if seen.sum() > MOST_CLASSES:
            table[closed] = opened
            seen[opened] |= seen[closed]
            seen[closed] = False
    return table[classes], table[outside]


def _present(classes: Ints, outside: Ints) -> tuple[Class, ...]:
    """The classes that solids have in this frame or seen from outside, in order."""
    count = np.bincount(classes, minlength=len(Class)) + np.bincount(outside, minlength=len(Class))
    found = tuple(klass for klass, seen in zip(Class, count.tolist(), strict=True) if seen)
    # Tiles have at least one list, if need be of a class that no solid has.
    return found or (Class.POLYHEDRON,)


def _outside_classes(geometry: Geometry) -> Ints:
    """The class of each solid seen from outside and between the base planes."""
    kinds = [geometry.is_patch, geometry.is_ellipsoid, geometry.has_quadric]
    classes = [Class.PATCH, Class.ELLIPSOID, Class.QUADRIC]
    found = np.select(kinds, classes, Class.POLYHEDRON)
    found[geometry.solid_count :] = Class.REGION
    if geometry.polynomials is not None:
        found[geometry.polynomials.solid] = Class.POLYNOMIAL
    if geometry.expressions is not None:
        found[geometry.expressions.solid] = Class.FORMULA
    return found


def _value(u: Floats, number_format: Format) -> Floats:
    """Positions u on a ray as values of the format; storing them rounds."""
    return u if number_format.value is np.float32 else np.rint(u * number_format.one)


def _lights(scene: Scene, setup: Setup) -> Records:
    # Lights with shadows come first, in the order of their bits.
    lights = sorted(scene.effective_lights(), key=lambda light: not light.shadows)
    records = np.zeros(len(lights), _LIGHT)
    # The largest distance of parallel rays from the middle of the picture.
    aside = setup.view.pixel * (setup.view.width + setup.view.height) if setup.view.parallel else 0
    for light, vector, color in zip(lights, records["vector"], records["color"], strict=True):
        if light.direction is not None:
            direction = np.array(light.direction)
            vector[:3] = direction / np.sqrt(direction.dot(direction))
        else:
            place = np.array(light.position) - setup.view.eye
            # The greatest length becomes about 1, so that no square is subnormal or infinite.
            vector[3] = 2.0 ** -np.ceil(np.log2(max(np.abs(place).max(), setup.far, aside)))
            vector[:3] = place * vector[3]
        color[:3] = light.color
    return records


def frame_record(scene: Scene, setup: Setup, first_row: int, rows: int) -> Records:
    """The ``Frame`` record of a band of ``rows`` picture rows from ``first_row`` on."""
    view = setup.view
    right, down, _ = view.camera_from_world
    record = np.zeros(1, _FRAME)
    corner = np.array(0), np.array(0)
    # All vectors at once, because NumPy takes as long for one.
    vectors = _clear(np.array([view.directions(*corner), right, down, scene.image.background]))
    vectors[1:3] *= view.pixel
    first, record["right"][0, :3], record["down"][0, :3], record["background"][0, :3] = vectors
    if view.parallel:
        record["forward"][0, :3] = first
        record["first_ray"][0, :3] = _clear(view.starts(*corner))
    else:
        record["first_ray"][0, :3] = first
    record["ambient"][0, :3] = scene.ambient.color
    tiles_x = -(-view.width // layout.TILE)
    tiles_y = -(-rows // layout.TILE)
    record["first_row"] = first_row
    record["row_quads"] = tiles_x * layout.TILE // layout.LANES
    record["plane_quads"] = record["row_quads"] * tiles_y * layout.TILE
    return record


def _clear(vectors: Floats) -> Floats:
    """Unit vectors or colours without components below `FAINT`."""
    return np.where(np.abs(vectors) < FAINT, 0.0, vectors)
