"""Writes WGSL functions that fetch records, for a layout, a number format and a device.

If invocations fetch together, each loads some words of a record as 64-bit integers and broadcasts
them to the others.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from halfstep.contract.classes import SHORT
from halfstep.contract.formats import Format
from halfstep.contract.layout import (
    APPEARANCE,
    BODY,
    BOWL,
    BOX,
    CASTER,
    CURVED,
    EXPRESSION,
    FACE,
    FLAT,
    HALF_SPACE,
    HIGHER,
    HULL,
    LIGHT_VIEW,
    LOCATION,
    MIRRORS,
    OCCLUDER,
    POLYNOMIAL,
    REFLECTED,
    REGION,
    SHARED,
    SIDE,
    SLAB,
    SOLID,
    TILE_WORDS,
    VEIL,
    VEIL_CURVED,
    VEIL_FLAT,
    VEIL_VIEW,
    Field,
    Record,
)
from halfstep.contract.powers import caster_terms, term_count
from halfstep.contract.program import GROUP, NOTHING_KNOWN
from halfstep.shader.needs import Needs

# Bytes that an invocation loads at once: four 64-bit integers, which take as many loads as four
# 32-bit integers.
FETCHED = 32
# The same as words.
WIDE = FETCHED // 8
# Bytes of a texel, and the logarithm of the texels in a row of a texture that holds records.
TEXEL, ROW_BITS = 16, 12

# The arrays of regions, in the order of their bindings.
REGION_RECORDS = {
    "regions": REGION,
    "flats": FLAT,
    "curves": CURVED,
    "appearances": APPEARANCE,
}


# The members that a shader reads of a region to see whether to try it, of the solid that the region
# is, and of a quadric along rays: a fetch takes as long as it is.
OF_OUTLINE = ("left", "right", "top", "bottom", "near_high", "near_low")
OF_PLACED = (
    "center_x",
    "center_y",
    "depth_middle",
    "depth_half",
    "last_step",
    "steps",
    "key_high",
    "key_low",
    "key_shift",
    "spare",
    "flags",
    "surface",
)
OF_CURVED = ("a", "g", "c", "host_error", "eye")

# The arrays for positions of points, for shadows and for mirrors, in the order of their bindings.
PLACE_RECORDS = {"locations": LOCATION}
SHARED_RECORDS = {"shared_sides": SHARED}
SHADOW_RECORDS = {
    "light_views": LIGHT_VIEW,
    "occluders": OCCLUDER,
    "slabs": SLAB,
    "boxes": BOX,
    "sides": SIDE,
}
VEIL_RECORDS = {
    "veil_views": VEIL_VIEW,
    "veils": VEIL,
    "veil_boxes": BOX,
    "veiled": OCCLUDER,
    "veil_flats": VEIL_FLAT,
    "veil_curves": VEIL_CURVED,
}
MIRROR_RECORDS = {
    "mirrors": MIRRORS,
    "bodies": BODY,
    "faces": FACE,
    "hulls": HULL,
}
REFLECTED_RECORDS = {"reflected": REFLECTED, "bowls": BOWL}


def in_textures(needs: Needs) -> tuple[str, ...]:
    """The arrays of records that are textures, not buffers.

    llvmpipe loads from a buffer for one invocation after another, but texels for all at once.
    The records of tori and formulas that bound cells took longer.
    """
    if needs.broadcast == 1:
        return ()
    solids = () if needs.uniform else ("solids", "half_spaces")
    return (
        *solids,
        *REGION_RECORDS,
        *PLACE_RECORDS,
        *SHARED_RECORDS,
        *SHADOW_RECORDS,
        *VEIL_RECORDS,
        *MIRROR_RECORDS,
        *REFLECTED_RECORDS,
        "polynomials",
        "expressions",
    )


# The members of a box that a shader reads to find out whether it touches another one.
OF_TOUCHED = ("low", "high")
# The members of a body that a shader reads to find out whether a ray meets it first.
OF_TRIED = (
    *("second", "slope", "value", "flags", "surface", "face_start", "face_count"),
    *("center", "unit", "bound", "curve", "caster", "copy"),
)
_NAMES = {"bodies": "body", "boxes": "box", "veil_boxes": "veil_box", "mirrors": "mirrors"}


def fetches(needs: Needs) -> str:
    """The functions ``solid_at``, ``half_space_at``, ``tile_at`` and others that a shader needs."""
    functions = [
        _record_at(needs, SOLID, "solids", "solid"),
        _record_at(needs, HALF_SPACE, "half_spaces", "half_space"),
        _tile_at(needs),
    ]
    if "regions" in needs.facts:
        functions += _of_regions(needs)
    functions += [_anywhere(needs), _least_number(needs), _least_of_all(needs)]
    if "higher" in needs.facts:
        functions.append(_record_at(needs, HIGHER, "highers", "higher"))
    if needs.has_polynomials:
        record = POLYNOMIAL.counted(TERMS=term_count(needs.degree))
        functions.append(_record_at(needs, record, "polynomials", "polynomial"))
    if needs.has_formulas:
        record = EXPRESSION.counted(NUMBERS=needs.numbers)
        functions.append(_record_at(needs, record, "expressions", "expression"))
    for fact, array in (
        ("casters", "casters"),
        ("body_casters", "body_casters"),
        ("veil_higher", "veil_highers"),
    ):
        if fact in needs.facts:
            record = CASTER.counted(CASTER_TERMS=caster_terms(needs.degree))
            functions.append(_record_at(needs, record, array, array.removesuffix("s")))
    for array in ("cast_formulas", "body_formulas"):
        if array in needs.facts:
            record = EXPRESSION.counted(NUMBERS=needs.numbers)
            functions.append(_record_at(needs, record, array, array.removesuffix("s")))
    placed: dict[str, Record] = {}
    placed |= PLACE_RECORDS if "places" in needs.facts else {}
    placed |= SHARED_RECORDS if "flush" in needs.facts else {}
    placed |= SHADOW_RECORDS if "shadows" in needs.facts else {}
    placed |= VEIL_RECORDS if "veils" in needs.facts else {}
    placed |= MIRROR_RECORDS if "mirrors" in needs.facts else {}
    placed |= REFLECTED_RECORDS if "body_cells" in needs.facts else {}
    for array, record in placed.items():
        name = _NAMES.get(array, array.removesuffix("s"))
        functions.append(_record_at(needs, record, array, name))
        if record in (BOX, SIDE, SHARED):
            members = OF_TOUCHED if record is BOX else ()
            functions.append(_alone(needs, record, array, f"{name}_alone", members))
    if "mirrors" in needs.facts:
        functions.append(_record_at(needs, BODY, "bodies", "tried", OF_TRIED))
    return "\n".join(functions)


def _of_regions(needs: Needs) -> list[str]:
    """The functions that fetch what regions have, for all invocations or for each one alone."""
    functions: list[str] = []
    of_placed = (*OF_PLACED, "polynomial") if "higher" in needs.facts else OF_PLACED
    fetched: list[tuple[Record, str, str, Collection[str]]] = [
        (REGION, "regions", "region", ()),
        (REGION, "regions", "outline", OF_OUTLINE),
        (SOLID, "solids", "placed", of_placed),
        (FLAT, "flats", "flat", ()),
        (CURVED, "curves", "curved", OF_CURVED),
        (CURVED, "curves", "bent", ("gradient",)),
        (APPEARANCE, "appearances", "appearance", ()),
    ]
    for record, array, name, members in fetched:
        if "apart" in needs.facts:
            functions.append(_alone(needs, record, array, f"{name}_at", members))
        else:
            functions.append(_record_at(needs, record, array, name, members))
    functions += [_words_at(needs), _known_words(needs)]
    if needs.broadcast > 1:
        functions.append(_alone(needs, REGION, "regions", "outline_alone", OF_OUTLINE))
        functions.append(_of_all(needs))
    return functions


def _alone(
    needs: Needs, record: Record, array: str, name: str, members: Collection[str] = ()
) -> str:
    """The function by which one invocation alone fetches some members of a record, or all.

    Where others fetch together, the record is in a texture. Other members are zeros.
    """
    body = f"  return {array}[number];\n"
    if needs.broadcast > 1:
        wanted = members or [field.name for field in record.fields]
        begin, end = _span(needs, record, wanted)
        start, size = begin // TEXEL, record.dtype(needs.format).itemsize // TEXEL
        body = ""
        for k in range(start, -(-end // TEXEL)):
            body += f"  let at_{k} = {size}u * number + {k}u;\n"
            body += _load_texel(array, k)
        body += _members(needs, record, wanted, lambda k: f"texel_{k // 4}.{'xyzw'[k % 4]}")
    head = f"// A record of `{array}`, which each invocation fetches for itself.\n"
    return f"{head}fn {name}(number: u32) -> {record.name} {{\n{body}}}\n"


def _cast(type_: str, word: str) -> str:
    """A word as a value of a WGSL type."""
    return word if type_ == "u32" else f"bitcast<{type_}>({word})"


def _zero(field: Field) -> str:
    """The line of a member that is not fetched."""
    zeros = {"f32": "0.0", "i32": "0i", "u32": "0u"}
    zero = zeros.get(field.type, f"{field.type}()")
    return f"    {zero if field.count == 1 else f'array<{field.type}, {field.count}>()'},\n"


def _tile_at(needs: Needs) -> str:
    """The function that fetches a tile: its place, the starts of its lists, the end of the last."""
    count = len(needs.classes) + 1
    words = [f"tiles[first + {k}u]" for k in range(count + 1)]
    body = f"  let first = number * {TILE_WORDS}u;\n"
    if needs.broadcast > 1:
        loaded = range(0, count + 1, needs.broadcast)
        body += "".join(f"  let words_{k} = tiles[first + {k}u + lane];\n" for k in loaded)
        lanes = [k % needs.broadcast for k in range(count + 1)]
        words = [f"subgroupBroadcast(words_{k - n}, {n}u)" for k, n in enumerate(lanes)]
    starts = "".join(f"      {word},\n" for word in words[1:])
    return (
        f"// A tile of the picture.\nstruct Tile {{\n"
        "  place: u32,  // column, and row times 2^16, among the tiles\n"
        f"  starts: array<u32, {count}>,  // starts of the lists, and the end of the last\n}}\n\n"
        f"// The record of a tile.\nfn tile_at(number: u32) -> Tile {{\n{body}"
        f"  return Tile(\n    {words[0]},\n    array<u32, {count}>(\n{starts}    ),\n  );\n}}\n"
    )


def _words_at(needs: Needs) -> str:
    """The functions that fetch words of programs: those of a group, and all of a short program."""
    most = max(SHORT.values())
    found = _words(needs, GROUP)
    short = _words(needs, most)
    words = "".join(f"    select(0u, words[{k}], {k}u < count),\n" for k in range(most))
    return f"""// A group of words of programs.
fn words_at(number: u32) -> array<u32, {GROUP}> {{
{found}}}

// The words between two groups, and zeros behind them.
fn short_words_at(number: u32, end: u32) -> array<u32, {most}> {{
  let count = (end - number) * {GROUP}u;
{short.replace("return", "let words =")}  return array<u32, {most}>(
{words}  );
}}
"""


def _known_words(needs: Needs) -> str:
    """The function for the words of the known program."""
    known = needs.known or NOTHING_KNOWN
    most = max(SHORT.values())
    words = [*known.words, *[0] * (most - len(known.words))]
    listed = "".join(f"    {word}u,\n" for word in words)
    return f"""// The words of the known program, and zeros behind them.
fn known_words() -> array<u32, {most}> {{
  return array<u32, {most}>(
{listed}  );
}}
"""


def _words(needs: Needs, count: int) -> str:
    """Statements that return so many words of programs from a group on."""
    words = [f"programs[first + {k}u]" for k in range(count)]
    body = f"  let first = number * {GROUP}u;\n"
    if needs.broadcast > 1:
        loaded = range(0, count, needs.broadcast)
        body += "".join(f"  let words_{k} = programs[first + {k}u + lane];\n" for k in loaded)
        lanes = [k % needs.broadcast for k in range(count)]
        words = [f"subgroupBroadcast(words_{k - n}, {n}u)" for k, n in enumerate(lanes)]
    listed = "".join(f"    {word},\n" for word in words)
    return f"{body}  return array<u32, {count}>(\n{listed}  );\n"


def _anywhere(needs: Needs) -> str:
    """The functions that tell whether, and where, something holds in what fetches together.

    Such invocations must branch together.
    """
    # Broadcasts, because lavapipe of Mesa 22.3 goes through the invocations of a ballot in a loop.
    found, where = "any(holds)", "select(0u, 1u, holds)"
    if needs.broadcast > 1:
        found = f"({_joined(needs, 'some', '|')}) != 0u"
        where = _joined(needs, "bit", "|")
    return (
        "// Whether something holds in any pixel of the invocations that fetch together.\n"
        "fn anywhere(holds: b4) -> bool {\n"
        + ("" if needs.broadcast == 1 else "  let some = select(0u, 1u, any(holds));\n")
        + f"  return {found};\n}}\n\n"
        "// A bit for each invocation that fetches together: whether something holds there.\n"
        "fn invocations_where(holds: bool) -> u32 {\n"
        + ("" if needs.broadcast == 1 else "  let bit = select(0u, 1u << lane, holds);\n")
        + f"  return {where};\n}}\n"
    )


def _least_number(needs: Needs) -> str:
    """The function for the least number of all invocations that fetch together."""
    return (
        "// The least number of all pixels of the invocations that fetch together.\n"
        "fn least_number(numbers: u4) -> u32 {\n"
        "  let least = min(min(numbers.x, numbers.y), min(numbers.z, numbers.w));\n"
        f"  return {_least(needs, 'least')};\n}}\n"
    )


def _least_of_all(needs: Needs) -> str:
    """The function for the least vector of all invocations that fetch together."""
    text, names = "", ["values"]
    if needs.broadcast > 1:
        names = [f"from_{lane}" for lane in range(needs.broadcast)]
        for lane, name in enumerate(names):
            text += f"  let {name} = subgroupBroadcast(values, {lane}u);\n"
    # Selects, because llvmpipe takes longer for `min`, which must know NaN.
    while len(names) > 1:
        pairs = list(zip(names[::2], names[1::2], strict=True))
        names = [f"{one}_{other.removeprefix('from_')}" for one, other in pairs]
        for name, (one, other) in zip(names, pairs, strict=True):
            text += f"  let {name} = select({other}, {one}, {one} < {other});\n"
    return (
        "// The least components of the invocations that fetch together.\n"
        f"fn least_of_all(values: vec3<f32>) -> vec3<f32> {{\n{text}  return {names[0]};\n}}\n"
    )


def _least(needs: Needs, name: str) -> str:
    """The least value of a variable in all invocations that fetch together.

    lavapipe of Mesa 22.3 takes much longer for subgroupMin.
    """
    if needs.broadcast == 1 or "apart" in needs.facts:
        return name
    return _joined(needs, name, "min")


def _joined(needs: Needs, name: str, how: str) -> str:
    """What a variable has in all invocations that fetch together, joined in pairs."""
    values = [f"subgroupBroadcast({name}, {lane}u)" for lane in range(needs.broadcast)]
    joins = "({} | {})" if how == "|" else f"{how}({{}}, {{}})"
    while len(values) > 1:
        pairs = zip(values[::2], values[1::2], strict=True)
        values = [joins.format(*pair) for pair in pairs]
    return values[0]


def _of_all(needs: Needs) -> str:
    """The functions for what each of the invocations has that fetch together."""
    lanes = range(needs.broadcast)

    def vector(name: str, lane: int) -> str:
        parts = (f"subgroupBroadcast({name}.{axis}, {lane}u)" for axis in "xyzw")
        return f"u4({', '.join(parts)})"

    if needs.short_keys:
        keys = [vector("key", lane) for lane in lanes]
    else:
        keys = [f"Key({vector('key.high', k)}, {vector('key.low', k)})" for k in lanes]
    numbers = "".join(f"    subgroupBroadcast(number, {lane}u),\n" for lane in lanes)
    return f"""// The numbers of all invocations that fetch together.
fn numbers_of_all(number: i32) -> array<i32, BROADCAST> {{
  return array<i32, BROADCAST>(
{numbers}  );
}}

// The keys of all their pixels.
fn keys_of_all(key: NearestKey) -> array<NearestKey, BROADCAST> {{
  return array<NearestKey, BROADCAST>(
{"".join(f"    {key},{chr(10)}" for key in keys)}  );
}}
"""


def _record_at(
    needs: Needs, record: Record, array: str, name: str, members: Collection[str] = ()
) -> str:
    """The function that fetches a record of an array, or some members and zeros for the others."""
    body = f"  return {array}[number];\n"
    if needs.broadcast > 1:
        wanted = members or [field.name for field in record.fields]
        begin, end = _span(needs, record, wanted)
        is_texture = array in in_textures(needs)
        size = record.dtype(needs.format).itemsize
        load = _texels if is_texture else _pieces
        text, word = load(needs.broadcast, array, begin, end, size)
        body = text + _members(needs, record, wanted, word)
    what = "Some of a record" if members else "A record"
    return f"// {what} of `{array}`.\nfn {name}_at(number: u32) -> {record.name} {{\n{body}}}\n"


def _span(needs: Needs, record: Record, wanted: Collection[str]) -> tuple[int, int]:
    """The bytes of a record where the wanted members begin and end."""
    places = dict(record.dtype(needs.format).fields or {})
    ends = [(places[name][1], places[name][1] + places[name][0].itemsize) for name in wanted]
    return min(begin for begin, _ in ends), max(end for _, end in ends)


def _members(
    needs: Needs, record: Record, wanted: Collection[str], word: Callable[[int], str]
) -> str:
    """The statement that returns a record, from the text of each of its words by number."""
    places = dict(record.dtype(needs.format).fields or {})

    def scalar(type_: str, k: int) -> str:
        if type_ == "i64":
            # The mask is needed because lavapipe of Mesa 22.3 extends the sign in i64(u32).
            return f"((i64(bitcast<i32>({word(k + 1)})) << 32u) | (i64({word(k)}) & 0xFFFFFFFFli))"
        return _cast(type_, word(k))

    members = ""
    for field in record.fields:
        if field.name not in wanted:
            members += _zero(field)
            continue
        place = places[field.name][1] // 4
        type_, size = _scalar(needs.format, field.type), 1
        if type_ == "i64":
            size = 2
        values = [scalar(type_, place + size * k) for k in range(int(field.count))]
        if field.count == 1:
            members += f"    {values[0]},\n"
        else:
            elements = "".join(f"      {value},\n" for value in values)
            members += f"    array<{field.type}, {field.count}>(\n{elements}    ),\n"
    return f"  return {record.name}(\n{members}  );\n"


def _texels(
    broadcast: int, array: str, begin: int, end: int, size: int
) -> tuple[str, Callable[[int], str]]:
    """Statements that load the bytes from ``begin`` to ``end`` of a record from a texture.

    Also the text of each word of the record, by its number.
    """
    start, stop, stride = begin // TEXEL, -(-end // TEXEL), size // TEXEL
    text = ""
    for first in range(0, stop - start, broadcast):
        offset = f" + {start + first}u" if start + first else ""
        text += f"  let at_{first} = number * {stride}u{offset} + lane;\n"
        text += _load_texel(array, first)

    def word(k: int) -> str:
        texel, axis = divmod(k - start * TEXEL // 4, 4)
        lane = texel % broadcast
        return f"subgroupBroadcast(texel_{texel - lane}.{'xyzw'[axis]}, {lane}u)"

    return text, word


def _load_texel(array: str, name: int) -> str:
    """Statements that load the texel at the number that ``at_`` and ``name`` call."""
    row = f"{(1 << ROW_BITS) - 1}u"
    return (
        f"  let place_{name} = vec2<u32>(at_{name} & {row}, at_{name} >> {ROW_BITS}u);\n"
        f"  let texel_{name} = textureLoad({array}, place_{name}, 0);\n"
    )


def _pieces(
    broadcast: int, array: str, begin: int, end: int, size: int
) -> tuple[str, Callable[[int], str]]:
    """The same as `_texels`, from a buffer."""
    start, stop, stride = begin // FETCHED, -(-end // FETCHED), size // FETCHED
    loaded = {
        first: _words_each(stop - start - first, broadcast)
        for first in range(0, stop - start, broadcast)
    }
    text = ""
    for first, count in loaded.items():
        offset = f" + {start + first}u" if start + first else ""
        text += _load(array, f"number * {stride}u{offset}", first, count)

    def word(k: int) -> str:
        k -= start * FETCHED // 4
        first = k // 8 // broadcast * broadcast
        lane, axis = divmod(k // 2 - WIDE * first, loaded[first])
        component = "" if loaded[first] == 1 else "." + "xyzw"[axis]
        return f"subgroupBroadcast({'high' if k % 2 else 'low'}_{first}{component}, {lane}u)"

    return text, word


def _words_each(pieces: int, lanes: int) -> int:
    """The number of 64-bit words that each of ``lanes`` invocations loads of ``pieces`` pieces.

    A load serves one invocation after another, so each should load few words. All invocations load
    the same number, so that no branch is needed around a load.
    """
    return next((count for count in (1, 2) if count * lanes >= WIDE * pieces), WIDE)


def _load(array: str, start: str, first: int, count: int) -> str:
    """Statements that load pieces from ``start`` on, ``count`` words for each invocation."""
    if count == WIDE:
        text = f"  let piece_{first} = {array}[{start} + lane];\n"
        type_, shift = "vec4<u32>", "vec4<u32>(32u)"
    else:
        share = WIDE // count  # of a piece
        text = f"  let at_{first} = {start} + lane / {share}u;\n"
        place = f"lane % {share}u" if count == 1 else f"{count}u * (lane % {share}u)"
        text += f"  let word_{first} = {place};\n"
        words = [f"{array}[at_{first}][word_{first}{more}]" for more in ("", " + 1u")[:count]]
        type_, shift = ("vec2<u32>", "vec2<u32>(32u)") if count == 2 else ("u32", "32u")
        joined = f"vec2<u64>({', '.join(words)})" if count == 2 else words[0]
        text += f"  let piece_{first} = {joined};\n"
    text += f"  let low_{first} = {type_}(piece_{first});\n"
    return text + f"  let high_{first} = {type_}(piece_{first} >> {shift});\n"


def _scalar(number_format: Format, type_: str) -> str:
    """The WGSL type of a member of a record."""
    names = {np.float32: "f32", np.int32: "i32", np.int64: "i64"}
    numbers = {
        "Coefficient": number_format.coefficient,
        "Value": number_format.value,
        "Length": number_format.length,
    }
    return names[numbers[type_]] if type_ in numbers else type_
