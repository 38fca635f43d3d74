"""Shader text, composed from the stages that a frame needs and nothing else.

Stage functions are plain WGSL files beside each other in ``halfstep.wgsl``.  This module writes the
kernel that joins them and takes from the files what the kernel reaches: for every class of solids
present one loop over the tile's list, in which each solid is fetched once and tried on a block of
pixels.  The block's quads, four pixels each, are written out, with NTH in a name or a number
standing for the quad: arrays indexed by a loop cost a compiler more and the device most.

What lavapipe asks for, measured, the last two for devices that a processor plays alone:

- A loop is left at the end of its body.  Tested at its beginning, the body runs once more for no
  invocation at all.
- All quads of a block are halved in one loop: an operation waits for the one before, and the others
  fill the gap.
- Loads and stores serve one invocation after another, each word with a test of its own, so words
  travel in pairs, as 64 bits.
- What is stored passes a select that LLVM does not take apart (``whole``).  Otherwise it computes
  the words anew for each invocation.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from halfstep.formats import Format
from halfstep.layout import HALF_SPACE, LANES, SOLID, TILE, TILE_WORDS, Record
from halfstep.pack import SRGB_ENTRIES, Class

# Device outputs in the order of their planes, with the number of 32-bit words of a pixel, and those
# of bytes, with how many a pixel has.
OUTPUT_WORDS = {"surface": 1, "key": 2, "exit": 2, "color": 3, "normal": 3, "error": 5}
OUTPUT_BYTES = {"image": 3, "tag": 1}
# A tag is the number of a surface, where a scene has no more than this.
MOST_TAGS = 255

# Bytes that an invocation loads at once: four numbers of 64 bits, in as many loads as of 32.
FETCHED = 32
# Most bytes of what is bound as uniform memory: every device has so many.
UNIFORM_BYTES = 1 << 16

CURVED = frozenset({Class.ELLIPSOID, Class.QUADRIC, Class.QUADRIC_INSIDE})
INSIDE = frozenset({Class.QUADRIC_INSIDE, Class.POLYHEDRON_INSIDE})


@dataclass(frozen=True)
class Needs:
    """All that a shader's text depends on; equal needs share one compiled pipeline."""

    classes: tuple[Class, ...]
    outputs: frozenset[str]  # of OUTPUT_WORDS and OUTPUT_BYTES
    method: str  # "visible" or "article"
    format: Format
    lights: int
    point_lights: bool
    shininess_bits: int  # of the largest exponent of a highlight, 0 where nothing shines
    short_keys: bool  # depth keys fit a word
    max_lines: int  # most half-spaces of a solid; the article method keeps them all at hand
    # So many invocations of a subgroup fetch records together: each loads some words, as 64 bits,
    # and gives them to all.  A device that a processor plays does a load for one invocation after
    # another, and all invocations of a tile want the same record.
    together: int = 1
    # Solids and half-spaces are few enough for uniform memory, of which such a device has less, but
    # where a load takes a third of the time; for records fetched together only.
    uniform: bool = False

    @property
    def shaded(self) -> bool:
        """Whether colours are needed."""
        return bool(self.outputs & {"image", "color"})

    @property
    def oriented(self) -> bool:
        """Whether normals are needed."""
        return self.shaded or "normal" in self.outputs

    @property
    def leaving(self) -> bool:
        """Whether it is needed where a ray leaves the solid it hit."""
        return "exit" in self.outputs

    @property
    def quads(self) -> int:
        """Quads of a block: more of them share what is fetched of a solid, and compile longer."""
        return 2 if self.method == "visible" and not self.certified else 1

    @property
    def wide_pixels(self) -> bool:
        """Whether the bytes of a block are stored as words of 64 bits."""
        return self.together > 1 and self.quads > 1

    @property
    def certified(self) -> bool:
        """Whether bounds of the error are needed."""
        return "error" in self.outputs


def plane_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """First plane of each output of words, and the number of planes under ``"total"``."""
    return _offsets(OUTPUT_WORDS, outputs)


def byte_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """Bytes a pixel has of outputs of bytes before each one, and of all under ``"total"``."""
    return _offsets(OUTPUT_BYTES, outputs)


def _offsets(sizes: dict[str, int], outputs: frozenset[str]) -> dict[str, int]:
    offsets, end = {}, 0
    for name, size in sizes.items():
        if name in outputs:
            offsets[name] = end
            end += size
    return offsets | {"total": end}


@functools.cache
def stage(name: str) -> str:
    """Text of the WGSL file of a stage."""
    return files("halfstep.wgsl").joinpath(f"{name}.wgsl").read_text(encoding="utf-8")


def stage_names(needs: Needs) -> list[str]:
    """The files that a shader may take code from, in order."""
    return [
        "lanes",
        *needs.format.stages,
        "layout",
        "piece",
        "root",
        "patch",
        "article",
        "nearest",
        "certify",
        "normal",
        "ray",
        "shade",
        "encode",
    ]


def compose(needs: Needs) -> str:
    """The whole shader; its entry point is ``render``."""
    keep = [_keep(needs)] * bool(needs.classes)
    kernel = "\n".join([_bindings(needs), _nearest(needs), *keep, _finish(needs), _kernel(needs)])
    library = [item for name in stage_names(needs) for item in definitions(stage(name))]
    return "\n".join([*_reached(library, kernel), kernel])


@dataclass(frozen=True)
class Definition:
    """A function, struct, constant or alias of a stage file, with the comment above it."""

    name: str  # of a function with a bracket, so that no member is taken for it
    text: str
    words: frozenset[str]  # identifiers in its code, and those of calls with their bracket


_DEFINITION = re.compile(
    r"^(?://.*\n)*(?:(fn|struct) (\w+)[\s\S]*?^\}|(?:const|alias) (\w+)[^;]*;)\n", re.MULTILINE
)


@functools.cache
def definitions(text: str) -> tuple[Definition, ...]:
    """What a stage file defines, in order."""
    return tuple(
        Definition(f"{name}(" if kind == "fn" else name or constant, match[0], _words(match[0]))
        for match in _DEFINITION.finditer(text)
        for kind, name, constant in [match.groups()]
    )


def _words(text: str) -> frozenset[str]:
    words = re.findall(r"\b[A-Za-z_]\w*\(?", re.sub(r"//.*", "", text))
    return frozenset(words) | {word.rstrip("(") for word in words}


def _reached(library: list[Definition], kernel: str) -> list[str]:
    """The texts of the definitions that the kernel needs, directly or not, in order."""
    by_name = {item.name: item for item in library}
    reached: set[str] = set()
    wanted = by_name.keys() & _words(kernel)
    while wanted:
        reached |= wanted
        words = {word for name in wanted for word in by_name[name].words}
        wanted = (by_name.keys() & words) - reached
    return [item.text for item in library if item.name in reached]


def binding_types(needs: Needs) -> dict[int, str]:
    """The bindings a shader declares: wgpu's type of buffer of each, by number."""
    records = "uniform" if needs.uniform else "read-only-storage"
    types = {0: "uniform", 1: records, 2: records, 3: "read-only-storage", 4: "read-only-storage"}
    if plane_offsets(needs.outputs)["total"]:
        types[5] = "storage"
    if byte_offsets(needs.outputs)["total"]:
        types[6] = "storage"
    if needs.shaded:
        types[7] = "uniform"
    if "image" in needs.outputs:
        types[8] = "uniform"
    return types


def _bindings(needs: Needs) -> str:
    solid, half_space, quad, space = "Solid", "HalfSpace", "vec4<u32>", "storage, read"
    if needs.together > 1:
        solid, half_space, quad = "vec4<u64>", "vec4<u64>", "vec2<u64>"
    if needs.uniform:
        solid = half_space = f"vec4<u64>, {UNIFORM_BYTES // FETCHED}"
        space = "uniform"
    lines = [
        "@group(0) @binding(0) var<uniform> frame: Frame;",
        f"@group(0) @binding(1) var<{space}> solids: array<{solid}>;",
        f"@group(0) @binding(2) var<{space}> half_spaces: array<{half_space}>;",
        "@group(0) @binding(3) var<storage, read> tiles: array<u32>;",
        "@group(0) @binding(4) var<storage, read> tile_solids: array<u32>;",
    ]
    if plane_offsets(needs.outputs)["total"]:
        lines.append(f"@group(0) @binding(5) var<storage, read_write> planes: array<{quad}>;")
    if byte_offsets(needs.outputs)["total"]:
        word = "u64" if needs.wide_pixels else "u32"
        lines.append(f"@group(0) @binding(6) var<storage, read_write> pixels: array<{word}>;")
    if needs.shaded:
        lines += [
            f"@group(0) @binding(7) var<uniform> lights: array<Light, {max(needs.lights, 1)}>;",
            f"const LIGHTS: u32 = {needs.lights}u;",
            f"const SHININESS_BITS: u32 = {needs.shininess_bits}u;",
            f"const POINT_LIGHTS: bool = {str(needs.point_lights).lower()};",
        ]
    if "image" in needs.outputs:
        # A word of each vec4, because uniform arrays have no smaller stride.
        table = f"var<uniform> srgb_table: array<vec4<u32>, {SRGB_ENTRIES}>"
        lines.append(f"@group(0) @binding(8) {table};")
    if needs.method == "article":
        lines.append(f"const MAX_LINES: u32 = {needs.max_lines}u;")
    return "\n".join(lines) + "\n"


def _vector(template: str) -> str:
    """A Vector whose components are ``template`` with AXIS replaced by x, y and z."""
    return f"Vector({', '.join(template.replace('AXIS', axis) for axis in 'xyz')})"


# The members of Nearest: (condition, declaration, value at first, value of a new point).
def _members(needs: Needs) -> list[tuple[str, str, str]]:
    far = "Key(u4(0xFFFFFFFFu), u4(0xFFFFFFFFu))"

    def nearer_key(name: str) -> str:
        words = (f"select(old.{name}.{word}, {name}.{word}, nearer)" for word in ("high", "low"))
        return f"Key({', '.join(words)})"

    members = [
        ("key: u4", "u4(0xFFFFFFFFu)", "select(old.key, key, nearer)")
        if needs.short_keys
        else ("key: Key", far, nearer_key("key")),
        ("surface: u4", "u4(0u)", "select(old.surface, surface, nearer)"),
    ]
    zero = "Vector(f4(0.0), f4(0.0), f4(0.0))"
    if needs.leaving:
        members.append(("leaves: Key", far, nearer_key("leaves")))
    if needs.certified:
        members.append(("low: Key", far, _lower_key("low", "confirmed & hit")))
        members.append(("doubt: Key", far, _lower_key("doubt", "!confirmed")))
        value = "select(old.bound, certificate.bound, nearer)"
        members.append(("bound: f4", "f4(0.0)", value))
    if needs.oriented:
        value = _vector("select(old.slope.AXIS, slope.AXIS, nearer)")
        members.append(("slope: Vector", zero, value))
    if needs.shaded:
        value = ", ".join(
            f"select(old.color.{axis}, f4(solid.color[{k}]), nearer)"
            for k, axis in enumerate("xyz")
        )
        members.append(("color: Vector", zero, f"Vector({value})"))
    if needs.shaded and needs.shininess_bits:
        value = "select(old.specular, f4(solid.specular), nearer)"
        members.append(("specular: f4", "f4(0.0)", value))
        value = "select(old.shininess, u4(solid.shininess), nearer)"
        members.append(("shininess: u4", "u4(0u)", value))
    if needs.shaded and needs.point_lights:
        depth = "solid.depth_middle + (f4(position) * solid.last_step) * solid.depth_half"
        members.append(("depth: f4", "f4(0.0)", f"select(old.depth, {depth}, nearer)"))
    return members


def _lower_key(name: str, where: str) -> str:
    """The lesser of an old key and a new one, the latter only in some pixels."""
    lower = f"{where} & before({name}, u4(0u), old.{name}, u4(0u))"
    words = (f"select(old.{name}.{word}, {name}.{word}, {lower})" for word in ("high", "low"))
    return f"Key({', '.join(words)})"


def _nearest(needs: Needs) -> str:
    members = _members(needs)
    body = "".join(f"  {declaration},\n" for declaration, _, _ in members)
    return (
        f"// The nearest visible point so far.\nstruct Nearest {{\n{body}}}\n\n"
        f"fn nothing() -> Nearest {{\n  return Nearest({', '.join(m[1] for m in members)});\n}}\n"
    )


def _keep(needs: Needs) -> str:
    """The function that replaces the nearest point where a nearer one was found."""
    parameters = ["old: Nearest", "solid: Solid", "hit: b4", "number: i4", "position: i4"]
    interval = "solid.steps, solid.key_high, solid.key_low, solid.key_shift"
    key, before = f"depth_key(position, {interval})", "before"
    if needs.short_keys:
        key, before = (
            "short_key(position, solid.steps, solid.key_low, solid.key_shift)",
            "short_before",
        )
    extra = ""
    if needs.leaving:
        parameters += ["left: b4", "exit_position: i4"]
        extra = (
            f"  let exit_key = depth_key(exit_position, {interval});\n"
            "  let leaves = Key(select(u4(0xFFFFFFFFu), exit_key.high, left),"
            " select(u4(0xFFFFFFFFu), exit_key.low, left));\n"
        )
    if needs.oriented:
        parameters.append("slope: Vector")
    if needs.certified:
        parameters.append("certificate: Certificate")
        extra += (
            "  let confirmed = confirms(certificate, hit, number);\n"
            "  let low = least_key(key, certificate.bound, solid.steps, solid.spare,"
            " solid.key_shift);\n"
            "  let doubt = Key(u4(solid.key_high), u4(solid.key_low));\n"
        )
    values = ",\n    ".join(member[2] for member in _members(needs))
    return (
        "// Keeps a point if it is nearer than the nearest so far.\n"
        f"fn keep({', '.join(parameters)}) -> Nearest {{\n"
        f"  let key = {key};\n"
        "  let surface = u4(solid.surface) + u4(number);\n"
        f"  let nearer = hit & {before}(key, surface, old.key, old.surface);\n"
        f"{extra}  return Nearest(\n    {values},\n  );\n"
        "}\n"
    )


_EYE_OUTSIDE = "b4((solid.flags & FLAG_EYE_OUTSIDE_QUADRIC) != 0u)"
_STARTS_AT_EYE = "b4((solid.flags & FLAG_STARTS_AT_EYE) != 0u)"
_EYE_INSIDE = "((solid.flags & FLAG_EYE_INSIDE) != 0u)"
_NEAR_CUT = "b4((solid.flags & FLAG_NEAR_CUT) != 0u)"

_LINE = "line_at(half_space.c, half_space.b, at)"
_LINE_ERRORS = "line_errors(half_space.c, half_space.b, at, half_space.host_error)"
_FORM = "    let form = form_at(solid.a, solid.g, solid.c, at);\n"
# At the eye the sign of F is known from the host; elsewhere it is that of F at the entry.
_OUTSIDE = f"""\
    let from_eye = (piece.id_in == i4(0)) & {_STARTS_AT_EYE};
    let outside = select(outside_at_entry(form, piece), {_EYE_OUTSIDE}, from_eye);
"""


def _visit(needs: Needs, klass: Class) -> str:
    """Statements that try one solid of a class on the block."""
    if needs.certified:
        return _certify(needs, klass) + _sight(needs, klass)
    return _sight(needs, klass)


def _sight(needs: Needs, klass: Class) -> str:
    """Statements that find the visible point of one solid and keep it."""
    if needs.method == "article":
        return _article(needs, klass)
    if klass is Class.PATCH:
        return _visible_patch(needs)
    if klass is Class.ELLIPSOID:
        return _seen(needs, _FORM, "ellipsoid_entry(form)", "ellipsoid_exit(form)", _GRADIENT)
    return _visible_cut(needs, klass)


def _quads(needs: Needs, body: str, *, offsets: bool = True) -> str:
    """``body`` for every quad of the block."""
    at = "    let at = offset(x_NTH, y);\n" * offsets
    return _each_quad(needs, f"    {{\n{at}{body}    }}\n")


def _each_quad(needs: Needs, template: str) -> str:
    """``template`` for every quad of the block, with its number for NTH."""
    return "".join(template.replace("NTH", str(quad)) for quad in range(needs.quads))


def _variables(needs: Needs, name: str, type_: str) -> str:
    """A variable for every quad of the block."""
    return _each_quad(needs, f"    var {name}_NTH: {type_};\n")


def _fetch(needs: Needs, record: Record, array: str, index: str, name: str) -> str:
    """A statement that fetches a record of a storage array."""
    if needs.together == 1:
        return f"    let {name} = {array}[{index}];\n"
    dtype = record.dtype(needs.format)
    places = dict(dtype.fields or {})
    pieces = dtype.itemsize // FETCHED
    text = f"    let {name}_place = ({index}) * {pieces}u + lane;\n"
    for first in range(0, pieces, needs.together):
        piece = f"{name}_{first}"
        load = f"{piece} = {array}[{name}_place + {first}u];\n"
        # A load serves one invocation after another, so it pays to leave out most, not a few.
        if pieces - first > needs.together // 2:
            text += f"    let {load}"
        else:
            text += f"    var {piece}: vec4<u64>;\n"
            text += f"    if lane < {pieces - first}u {{\n      {load}    }}\n"
        text += f"    let {piece}_low = vec4<u32>({piece});\n"
        text += f"    let {piece}_high = vec4<u32>({piece} >> vec4<u32>(32u));\n"

    def word(k: int) -> str:
        lane = k // 8 % needs.together
        half = "high" if k % 2 else "low"
        return f"subgroupBroadcast({name}_{k // 8 - lane}_{half}.{'xyzw'[k % 8 // 2]}, {lane}u)"

    def scalar(type_: str, k: int) -> str:
        if type_ == "i64":
            # The mask: Mesa 22.3's lavapipe extends the sign of i64(u32).
            return f"((i64(bitcast<i32>({word(k + 1)})) << 32u) | (i64({word(k)}) & 0xFFFFFFFFli))"
        return word(k) if type_ == "u32" else f"bitcast<{type_}>({word(k)})"

    members = []
    for field in record.fields:
        place = places[field.name][1] // 4
        type_, size = _scalar(needs.format, field.type), 1
        if type_ == "i64":
            size = 2
        values = ", ".join(scalar(type_, place + size * k) for k in range(field.count))
        members.append(
            f"array<{field.type}, {field.count}>({values})" if field.count > 1 else values
        )
    return text + f"    let {name} = {record.name}({', '.join(members)});\n"


def _scalar(number_format: Format, type_: str) -> str:
    """The WGSL type of a member of a record."""
    names = {np.float32: "f32", np.int32: "i32", np.int64: "i64"}
    numbers = {"Coefficient": number_format.coefficient, "Value": number_format.value}
    return names[numbers[type_]] if type_ in numbers else type_


def _loop(counter: str, first: str, end: str, body: str) -> str:
    """``body`` for every value of ``counter`` from ``first`` to below ``end``."""
    return (
        f"    if {first} < {end} {{\n"
        f"    var {counter} = {first};\n"
        "    loop {\n"
        f"{body}"
        f"      {counter}++;\n"
        f"      if {counter} >= {end} {{\n"
        "        break;\n"
        "      }\n"
        "    }\n"
        "    }\n"
    )


def _half_spaces(needs: Needs, first: int, body: str) -> str:
    """A loop over the solid's half-spaces, each tried on all quads."""
    fetch = _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start + k", "half_space")
    return _loop("k", f"{first}u", "solid.plane_count", fetch + _quads(needs, body))


def per_root(needs: Needs, roots: tuple[str, ...], template: str) -> str:
    """``template`` for every quad of the block and every root, with ROOT in it for its name."""
    return _each_quad(needs, "".join(template.replace("ROOT", root) for root in roots))


def conveyor(needs: Needs, roots: tuple[str, ...]) -> str:
    """Statements that halve ``roots`` of all quads, n times each, to the position of each."""
    begin = "    var search_ROOT_NTH = begun(ROOT_NTH);\n"
    halving = "      search_ROOT_NTH = halved(search_ROOT_NTH, k);\n"
    end = "    let ROOT_position_NTH = reached(search_ROOT_NTH, ROOT_NTH, solid.steps);\n"
    return (
        per_root(needs, roots, begin)
        + _loop("k", "0u", "solid.steps", per_root(needs, roots, halving))
        + per_root(needs, roots, end)
    )


_PLANE_NORMAL = (
    "Vector(f4(half_space.normal[0]), f4(half_space.normal[1]), f4(half_space.normal[2]))"
)
_GRADIENT = "gradient(solid.gradient, f4(x_NTH), f32(y), f4(position) * solid.last_step)"


def _seen(needs: Needs, body: str, root: str, leaving: str, slope: str, normals: str = "") -> str:
    """Statements that halve the seen root and keep the point.

    The expressions ``root`` and ``leaving`` may use what the statements ``body`` define for a quad,
    ``slope``, the normal of what is met there, what ``normals`` do.
    """
    roots = {"root": root} | ({"leaving": leaving} if needs.leaving else {})
    text = "".join(_variables(needs, name, "Root") for name in roots)
    found = "".join(f"    {name}_NTH = {value};\n" for name, value in roots.items())
    text += _quads(needs, body + found) + conveyor(needs, tuple(roots))
    arguments = ["nearest_NTH", "solid", "root_NTH.hit", "root_NTH.surface", "position"]
    if needs.leaving:
        arguments += ["leaving_NTH.hit", "leaving_position_NTH"]
    arguments += [slope] * needs.oriented + ["certificate_NTH"] * needs.certified
    kept = f"    nearest_NTH = keep({', '.join(arguments)});\n"
    kept = "    let position = root_position_NTH;\n" + normals * needs.oriented + kept
    return text + _quads(needs, kept, offsets=False)


def _visible_patch(needs: Needs) -> str:
    turned = _vector("select(own_normal.AXIS, -own_normal.AXIS, patch_NTH.away)")
    own = _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own")
    if needs.oriented:
        own += f"    let own_normal = {_PLANE_NORMAL.replace('half_space', 'own')};\n"
    facing = "    patch_NTH = facing(line_at(own.c, own.b, at), solid.near_u, solid.far_u);\n"
    return (
        own
        + _variables(needs, "patch", "Patch")
        + _quads(needs, facing)
        + _half_spaces(needs, 1, f"      patch_NTH = bound(patch_NTH, {_LINE});\n")
        + _seen(needs, "", "patch_entry(patch_NTH)", "root_NTH", turned)
    )


def _visible_cut(needs: Needs, klass: Class) -> str:
    """A solid with half-spaces or base planes across it: clip, joint logic, halve."""
    curved, opened = klass in CURVED, klass in INSIDE
    text = _variables(needs, "piece", "Piece")
    # Normals of the planes where the pieces begin and end; the latter show from inside.
    ends = ["in", *["out"] * opened] if needs.oriented else []
    text += "".join(_variables(needs, f"normal_{end}", "Vector") for end in ends)
    text += _quads(needs, "    piece_NTH = whole_interval(solid.near_u, solid.far_u);\n")
    clip = f"      let piece = clip(piece_NTH, {_LINE}, i32(k) + 1);\n      piece_NTH = piece;\n"
    for end in ends:
        turned = _vector(
            f"select(normal_{end}_NTH.AXIS, normal.AXIS, piece.id_{end} == i4(i32(k) + 1))"
        )
        clip += f"      normal_{end}_NTH = {turned};\n"
    if ends:
        clip = f"      let normal = {_PLANE_NORMAL};\n" + clip
    text += _half_spaces(needs, 0, clip)

    row = "    let piece = piece_NTH;\n"
    if opened:
        row = "    let clipped = piece_NTH;\n    var piece = clipped;\n"
        row += (
            f"    if {_EYE_INSIDE} {{\n      piece = from_the_eye(clipped, solid.near_u);\n    }}\n"
        )
    if curved:
        row += _FORM + _OUTSIDE
    entry, leaving = "polyhedron_entry(piece)", "polyhedron_exit(piece)"
    if curved:
        entry = "quadric_entry(form, piece, outside)"
        leaving = "quadric_exit(form, piece, !outside)"
    if opened:
        at_near = f"{_NEAR_CUT} & (piece.id_in == i4(0))" + " & !outside" * curved
        row += f"    let inside = b4({_EYE_INSIDE}) | ({at_near});\n"
        entry = f"choose(inside, {entry}, {leaving})"
    if opened and needs.oriented:
        shown = _vector("select(normal_in_NTH.AXIS, normal_out_NTH.AXIS, inside)")
        row += f"    normal_in_NTH = {shown};\n"
    if not curved:
        return text + _seen(needs, row, entry, leaving, "normal_in_NTH")
    mixed = _vector("select(normal_in_NTH.AXIS, curved.AXIS, root_NTH.surface == i4(0))")
    normals = f"    let curved = {_GRADIENT};\n    let slope = {mixed};\n"
    return text + _seen(needs, row, entry, leaving, "slope", normals)


def _certify(needs: Needs, klass: Class) -> str:
    """Statements that give every quad what is certain of it."""
    text = _variables(needs, "certificate", "Certificate")
    near_cut, last_step = "(solid.flags & FLAG_NEAR_CUT) != 0u", "solid.last_step"
    run = needs.format.article_run if needs.method == "article" else needs.format.run
    form = (
        "    let form = bounded_form(form_at(solid.a, solid.g, solid.c, at),"
        " form_errors(solid.a, solid.g, solid.c, at, solid.host_error));\n"
    )
    if klass is Class.PATCH:
        own = f"{_LINE}, {_LINE_ERRORS}".replace("half_space", "own_line")
        facing = (
            f"      bounded_NTH = bounded_facing({own}, solid.near_u, solid.far_u, {near_cut});\n"
        )
        text += _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own_line")
        text += _variables(needs, "bounded", "BoundedPatch")
        text += _quads(needs, facing)
        text += _half_spaces(
            needs,
            1,
            f"      bounded_NTH = bounded_bound(bounded_NTH, {_LINE}, {_LINE_ERRORS});\n",
        )
        return text + _quads(
            needs,
            f"    certificate_NTH = certify_patch(bounded_NTH, {last_step});\n",
            offsets=False,
        )
    if klass is Class.ELLIPSOID:
        return text + _quads(
            needs, form + f"    certificate_NTH = certify_ellipsoid(form, {run}, {last_step});\n"
        )
    text += _variables(needs, "bounded", "BoundedPiece")
    text += _quads(
        needs,
        f"    bounded_NTH = bounded_interval(solid.near_u, solid.far_u, {near_cut});\n",
        offsets=False,
    )
    text += _half_spaces(
        needs,
        0,
        f"      bounded_NTH = bounded_clip(bounded_NTH, {_LINE}, {_LINE_ERRORS}, i32(k) + 1);\n",
    )
    eye_sure = "(solid.flags & FLAG_EYE_SURE) != 0u"
    row = (
        f"    if {_EYE_INSIDE} {{\n"
        "      bounded_NTH = bounded_from_the_eye(bounded_NTH, solid.near_u);\n"
        "    }\n"
        "    let at_start = bounded_NTH.piece.id_in == i4(0);\n"
    )
    if klass in CURVED:
        row += form + (
            f"    certificate_NTH = certify_quadric(form, bounded_NTH, at_start & {_STARTS_AT_EYE}"
            f", (solid.flags & FLAG_EYE_OUTSIDE_QUADRIC) != 0u, {eye_sure},"
            f" (solid.flags & (FLAG_EYE_INSIDE | FLAG_NEAR_CUT)) != 0u, {run}, {last_step});\n"
        )
    else:
        row += (
            f"    let opened = b4({_EYE_INSIDE}) | ({_NEAR_CUT} & at_start);\n"
            f"    certificate_NTH = certify_polyhedron(bounded_NTH, opened, {eye_sure},"
            f" {last_step});\n"
        )
    return text + _quads(needs, row)


def _article(needs: Needs, klass: Class) -> str:
    """The paper's own sequences, a quad at a time."""
    half_space = _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start + k", "half_space")
    row = (
        "    var lines: Lines;\n"
        "    for (var k = 0u; k < solid.plane_count; k++) {\n"
        f"{half_space}"
        f"      lines[k] = {_LINE};\n"
        "    }\n"
    )
    base_planes = "&lines, solid.plane_count, solid.near_u, solid.far_u"
    if klass is Class.PATCH:
        row += f"    let found = article_patch({base_planes}, solid.steps);\n"
    elif klass in CURVED:
        row += _FORM
        row += (
            "    let first = (form.a - form.g) + form.c;\n"
            f"    let outside = select(first > v4(0), {_EYE_OUTSIDE}, {_STARTS_AT_EYE});\n"
            f"    let found = article_quadric(form, outside, {base_planes}, {_EYE_INSIDE},"
            " solid.steps, solid.last_step);\n"
        )
    else:
        row += (
            f"    let found = article_polyhedron({base_planes}, {_EYE_INSIDE}, solid.steps,"
            " solid.last_step);\n"
        )
    row += "    let position = found.position;\n"
    # In one cell the way in and the way out through a surface may stand for each other.
    if needs.certified:
        row += (
            "    let same = certificate_NTH.inside == found.inside;\n"
            "    certificate_NTH.sure = certificate_NTH.sure & same;\n"
        )
    arguments = ["nearest_NTH", "solid", "found.hit", "found.surface", "position"]
    if needs.leaving:
        arguments += ["found.left", "found.exit_position"]
    if needs.oriented:
        row += _article_slope(needs, klass)
        arguments.append("slope")
    arguments += ["certificate_NTH"] * needs.certified
    return _quads(needs, row + f"    nearest_NTH = keep({', '.join(arguments)});\n")


def _article_slope(needs: Needs, klass: Class) -> str:
    """The normal of the surface found: the article method knows it only at the end."""
    if klass is Class.PATCH:
        own = _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start", "own")
        normal = _PLANE_NORMAL.replace("half_space", "own")
        turned = _vector("select(normal.AXIS, -normal.AXIS, lines[0].b > v4(0))")
        return f"{own}    let normal = {normal};\n    let slope = {turned};\n"
    first = _GRADIENT if klass in CURVED else "Vector(f4(0.0), f4(0.0), f4(0.0))"
    turned = _vector("select(slope.AXIS, normal.AXIS, found.surface == i4(i32(k) + 1))")
    half_space = _fetch(needs, HALF_SPACE, "half_spaces", "solid.plane_start + k", "half_space")
    return (
        f"    var slope = {first};\n"
        "    for (var k = 0u; k < solid.plane_count; k++) {\n"
        f"{half_space}"
        f"      let normal = {_PLANE_NORMAL};\n"
        f"      slope = {turned};\n"
        "    }\n"
    )


_WHOLE = """\
// Four words as two of 64 bits, by a select that no compiler can prove idle.
fn whole(words: vec4<u32>) -> vec2<u64> {
  let low = vec2<u64>(words.xz) & vec2<u64>(0xFFFFFFFFlu);
  let wide = (vec2<u64>(words.yw) << vec2<u32>(32u)) | low;
  return select(wide, vec2<u64>(0lu), vec2<bool>(frame.plane_quads == 0u));
}

"""
_PACKED_IMAGE = """\
// Three bytes of each of four pixels.
fn packed_image(pixels: u4) -> vec3<u32> {
  return vec3<u32>(
    pixels.x | (pixels.y << 24u),
    (pixels.y >> 8u) | (pixels.z << 16u),
    (pixels.z >> 16u) | (pixels.w << 8u),
  );
}

"""
_PACKED_TAGS = """\
// A byte of each of four pixels.
fn packed_tags(surface: u4) -> u32 {
  let tags = (surface & u4(255u)) << u4(0u, 8u, 16u, 24u);
  return (tags.x | tags.y) | (tags.z | tags.w);
}

"""


def _finish(needs: Needs) -> str:
    """The function that turns the nearest point of four pixels into the outputs."""
    planes = plane_offsets(needs.outputs)
    values: dict[str, list[str]] = {
        "surface": ["nearest.surface"],
        "key": ["nearest.key.high", "nearest.key.low"],
        "exit": ["nearest.leaves.high", "nearest.leaves.low"],
        "color": [f"bitcast<u4>(color.{axis})" for axis in "xyz"],
        "error": [
            "nearest.low.high",
            "nearest.low.low",
            "nearest.doubt.high",
            "nearest.doubt.low",
            "bitcast<u4>(nearest.bound)",
        ],
        "normal": [f"bitcast<u4>(select(f4(0.0), normal.{axis}, some))" for axis in "xyz"],
    }
    stored = "whole" if needs.together > 1 else ""
    stores = "".join(
        f"  planes[place + {planes[name] + k}u * frame.plane_quads] = {stored}({value});\n"
        for name in OUTPUT_WORDS
        if name in needs.outputs
        for k, value in enumerate(values[name])
    )
    body = ""
    if needs.oriented:
        body += (
            "  let some = nearest.surface > u4(0u);\n"
            "  let direction = ray_direction(f4(i), f32(j));\n"
            "  let to_eye = Vector(-direction.x, -direction.y, -direction.z);\n"
            "  let normal = normalized(or_else(nearest.slope, to_eye));\n"
        )
    if needs.shaded:
        gloss = "nearest.specular, nearest.shininess" if needs.shininess_bits else "f4(0.0), u4(0u)"
        point = "scaled(direction, nearest.depth)" if needs.point_lights else "direction"
        mixed = _vector("select(f4(frame.background.AXIS), lit.AXIS, some)")
        body += (
            f"  let finish = Finish(nearest.color, {gloss});\n"
            f"  let lit = shade(normal, direction, {point}, finish);\n"
            f"  let color = {mixed};\n"
        )
    found = " -> u4" if "image" in needs.outputs else ""
    encoded = "  return encode(color);\n" if found else ""
    return (
        _PACKED_IMAGE * ("image" in needs.outputs)
        + _PACKED_TAGS * ("tag" in needs.outputs)
        + _WHOLE * (needs.together > 1)
        + "// Writes the outputs of words of four pixels, and returns the colours of an image.\n"
        f"fn finish(nearest: Nearest, i: i4, j: i32, place: u32){found} {{\n"
        f"{body}{stores}{encoded}"
        "}\n"
    )


def _finish_block(needs: Needs) -> str:
    """Statements that write the outputs of a block."""
    image = "image" in needs.outputs
    text = _each_quad(
        needs,
        "  let colors_NTH = " * image + "finish(nearest_NTH, i_NTH, j, place + NTHu);\n",
    )
    quads = range(needs.quads)
    if image:
        text += _each_quad(needs, "  let packed_NTH = packed_image(colors_NTH);\n")
        words = [f"packed_{quad}.{axis}" for quad in quads for axis in "xyz"]
        text += _store_bytes(needs, "image", words)
    if "tag" in needs.outputs:
        words = [f"packed_tags(nearest_{quad}.surface)" for quad in quads]
        text += _store_bytes(needs, "tag", words)
    return text


def _store_bytes(needs: Needs, name: str, words: list[str]) -> str:
    """Statements that store ``words`` as the block's part of an output of bytes."""
    before = byte_offsets(needs.outputs)[name]
    first = f"{before}u * frame.plane_quads + {OUTPUT_BYTES[name]}u * place"
    if not needs.wide_pixels:
        return "".join(f"  pixels[{first} + {k}u] = {word};\n" for k, word in enumerate(words))
    words = [*words, *["0u"] * (len(words) % 4)]
    text = ""
    for k in range(0, len(words), 4):
        text += f"  let {name}_{k // 2} = whole(vec4<u32>({', '.join(words[k : k + 4])}));\n"
    for k in range(needs.quads * OUTPUT_BYTES[name] // 2):
        text += f"  pixels[({first}) / 2u + {k}u] = {name}_{k // 2 * 2}.{'xy'[k % 2]};\n"
    return text


def _tile_word(needs: Needs, k: int) -> str:
    """Word ``k`` of the tile's record."""
    if needs.together == 1:
        return f"tiles[record + {k}u]"
    lane = k % needs.together
    return f"subgroupBroadcast(words_{k - lane}, {lane}u)"


def _kernel(needs: Needs) -> str:
    x = "    let x_NTH = i_NTH - i4(solid.center_x);\n"
    loops = "".join(
        f"  let first_{slot} = {_tile_word(needs, slot + 1)};\n"
        f"  let end_{slot} = {_tile_word(needs, slot + 2)};\n"
        + _loop(
            "entry",
            f"first_{slot}",
            f"end_{slot}",
            f"{_fetch(needs, SOLID, 'solids', 'tile_solids[entry]', 'solid')}"
            f"{_each_quad(needs, x)}"
            "    let y = j - solid.center_y;\n"
            f"{_visit(needs, klass)}",
        )
        for slot, klass in enumerate(needs.classes)
    )
    width = LANES * needs.quads
    across = TILE // width
    parameters = (
        "@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32"
    )
    lane = f"  let record = group.x * {TILE_WORDS}u;\n"
    if needs.together > 1:
        parameters += ", @builtin(subgroup_invocation_id) invocation: u32"
        lane += f"  let lane = invocation % {needs.together}u;\n"
        for first in range(0, TILE_WORDS, needs.together):
            lane += f"  let words_{first} = tiles[record + {first}u + lane];\n"
    clear = "    nearest_NTH = nothing();\n"
    i = "  let i_NTH = i4(i32(column)) + i4(NTH) * i4(i32(LANES)) + i4(0, 1, 2, 3);\n"
    return (
        "// One workgroup renders one tile, one invocation a block of it.\n"
        f"@compute @workgroup_size({across * TILE})\n"
        f"fn render({parameters}) {{\n"
        f"{lane}"
        f"  let tile = {_tile_word(needs, 0)};\n"
        f"  let column = (tile & 0xFFFFu) * TILE + local % {across}u * {width}u;\n"
        f"  let row = (tile >> 16u) * TILE + local / {across}u;\n"
        "  let place = row * frame.row_quads + column / LANES;\n"
        f"{_each_quad(needs, i)}"
        "  let j = frame.first_row + i32(row);\n"
        f"{_variables(needs, 'nearest', 'Nearest')}"
        f"{_quads(needs, clear, offsets=False)}"
        f"{loops}"
        f"{_finish_block(needs)}"
        "}\n"
    )
