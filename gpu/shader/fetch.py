"""Functions that fetch records, as the layout, the number format and the device want it.

Where invocations fetch together, each loads some words of a record, as 64 bits, and gives them to
all.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.classes import Class
from halfstep.contract.formats import Format
from halfstep.contract.layout import (
    APPEARANCE,
    BALL,
    BODY,
    BOX,
    CURVED,
    EXPRESSION,
    FACE,
    FLAT,
    HALF_SPACE,
    LIGHT_VIEW,
    LOCATION,
    MIRRORS,
    OCCLUDER,
    POLYNOMIAL,
    REGION,
    SLAB,
    SOLID,
    TILE_WORDS,
    VEIL,
    VEIL_CURVED,
    VEIL_FLAT,
    VEIL_VIEW,
    Record,
)
from halfstep.contract.powers import term_count
from halfstep.contract.program import GROUP
from halfstep.shader.needs import Needs

# Bytes that an invocation loads at once: four numbers of 64 bits, in as many loads as of 32.
FETCHED = 32

# What regions have in buffers of their own, in the order of the bindings.
REGION_RECORDS = {
    "regions": REGION,
    "flats": FLAT,
    "curves": CURVED,
    "appearances": APPEARANCE,
}


# Where points are, what hides lights, and what mirrors show.
PLACE_RECORDS = {"locations": LOCATION}
SHADOW_RECORDS = {
    "light_views": LIGHT_VIEW,
    "occluders": OCCLUDER,
    "slabs": SLAB,
    "boxes": BOX,
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
    "balls": BALL,
}
_NAMES = {"bodies": "body", "boxes": "box", "veil_boxes": "veil_box", "mirrors": "mirrors"}


def fetches(needs: Needs) -> str:
    """The functions ``solid_at``, ``half_space_at`` and ``tile_at``, with the struct of a tile."""
    functions = [
        _record_at(needs, SOLID, "solids", "solid"),
        _record_at(needs, HALF_SPACE, "half_spaces", "half_space"),
        _tile_at(needs),
    ]
    if "regions" in needs.facts:
        functions += [
            _record_at(needs, record, array, record.name.lower())
            for array, record in REGION_RECORDS.items()
        ]
        functions += [_words_at(needs), _anywhere(needs), _least_number(needs)]
    elif "mirrors" in needs.facts:
        functions.append(_anywhere(needs))
    if Class.POLYNOMIAL in needs.classes:
        record = POLYNOMIAL.counted(TERMS=term_count(needs.degree))
        functions.append(_record_at(needs, record, "polynomials", "polynomial"))
    if Class.FORMULA in needs.classes:
        record = EXPRESSION.counted(NUMBERS=needs.numbers)
        functions.append(_record_at(needs, record, "expressions", "expression"))
    placed: dict[str, Record] = {}
    placed |= PLACE_RECORDS if "places" in needs.facts else {}
    placed |= SHADOW_RECORDS if "shadows" in needs.facts else {}
    placed |= VEIL_RECORDS if "veils" in needs.facts else {}
    placed |= MIRROR_RECORDS if "mirrors" in needs.facts else {}
    for array, record in placed.items():
        name = _NAMES.get(array, array.removesuffix("s"))
        functions.append(_record_at(needs, record, array, name))
        if record in (BOX, BALL):
            functions.append(_alone(needs, record, array, name))
    return "\n".join(functions)


def _alone(needs: Needs, record: Record, array: str, name: str) -> str:
    """The function that fetches a record of eight floats at most for one invocation."""
    body = f"  return {array}[number];\n"
    if needs.broadcast > 1:
        words = iter(f"bitcast<f32>({half}.{axis})" for axis in "xyzw" for half in ("low", "high"))
        members = ""
        for field in record.fields:
            taken = ", ".join(next(words) for _ in range(int(field.count)))
            members += (
                f"    array<f32, {field.count}>({taken}),\n"
                if field.count != 1
                else f"    {taken},\n"
            )
        body = (
            f"  let piece = {array}[number];\n"
            "  let low = vec4<u32>(piece);\n"
            "  let high = vec4<u32>(piece >> vec4<u32>(32u));\n"
            f"  return {record.name}(\n{members}  );\n"
        )
    head = f"// A record of `{array}`, which each invocation fetches for itself.\n"
    return f"{head}fn {name}_alone(number: u32) -> {record.name} {{\n{body}}}\n"


def _tile_at(needs: Needs) -> str:
    """The function that fetches a tile: its place, and where its lists begin and the last ends."""
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
        f"  starts: array<u32, {count}>,  // of the lists, and where the last one ends\n}}\n\n"
        f"fn tile_at(number: u32) -> Tile {{\n{body}"
        f"  return Tile(\n    {words[0]},\n    array<u32, {count}>(\n{starts}    ),\n  );\n}}\n"
    )


def _words_at(needs: Needs) -> str:
    """The function that fetches a group of words of programs."""
    words = [f"programs[first + {k}u]" for k in range(GROUP)]
    body = f"  let first = number * {GROUP}u;\n"
    if needs.broadcast > 1:
        loaded = range(0, GROUP, needs.broadcast)
        body += "".join(f"  let words_{k} = programs[first + {k}u + lane];\n" for k in loaded)
        lanes = [k % needs.broadcast for k in range(GROUP)]
        words = [f"subgroupBroadcast(words_{k - n}, {n}u)" for k, n in enumerate(lanes)]
    listed = "".join(f"    {word},\n" for word in words)
    return (
        f"// A group of words of programs.\nfn words_at(number: u32) -> array<u32, {GROUP}> {{\n"
        f"{body}  return array<u32, {GROUP}>(\n{listed}  );\n}}\n"
    )


def _anywhere(needs: Needs) -> str:
    """The function that asks all invocations that fetch together, which must go on together."""
    found = "any(holds)" if needs.broadcast == 1 else "subgroupAny(any(holds))"
    return (
        "// Whether something holds in any pixel of the invocations that fetch together.\n"
        f"fn anywhere(holds: b4) -> bool {{\n  return {found};\n}}\n"
    )


def _least_number(needs: Needs) -> str:
    """The function that finds the least of numbers of invocations that must go on together."""
    found = "min(min(numbers.x, numbers.y), min(numbers.z, numbers.w))"
    if needs.broadcast > 1:
        found = f"subgroupMin({found})"
    return (
        "// The least number of all pixels of the invocations that fetch together.\n"
        f"fn least_number(numbers: u4) -> u32 {{\n  return {found};\n}}\n"
    )


def _record_at(needs: Needs, record: Record, array: str, name: str) -> str:
    """The function that fetches a record of an array."""
    body = f"  return {array}[number];\n" if needs.broadcast == 1 else _shared(needs, record, array)
    return f"// A record of `{array}`.\nfn {name}_at(number: u32) -> {record.name} {{\n{body}}}\n"


def _shared(needs: Needs, record: Record, array: str) -> str:
    """Statements that return a record that invocations fetch together."""
    dtype = record.dtype(needs.format)
    places = dict(dtype.fields or {})
    pieces = dtype.itemsize // FETCHED
    text = f"  let place = number * {pieces}u + lane;\n"
    for first in range(0, pieces, needs.broadcast):
        piece = f"piece_{first}"
        load = f"{piece} = {array}[place + {first}u];\n"
        # A load serves one invocation after another, so it pays to leave out most, not a few.
        if pieces - first > needs.broadcast // 2:
            text += f"  let {load}"
        else:
            text += f"  var {piece}: vec4<u64>;\n"
            text += f"  if lane < {pieces - first}u {{\n    {load}  }}\n"
        text += f"  let low_{first} = vec4<u32>({piece});\n"
        text += f"  let high_{first} = vec4<u32>({piece} >> vec4<u32>(32u));\n"

    def word(k: int) -> str:
        lane = k // 8 % needs.broadcast
        half = "high" if k % 2 else "low"
        return f"subgroupBroadcast({half}_{k // 8 - lane}.{'xyzw'[k % 8 // 2]}, {lane}u)"

    def scalar(type_: str, k: int) -> str:
        if type_ == "i64":
            # The mask: Mesa 22.3's lavapipe extends the sign of i64(u32).
            return f"((i64(bitcast<i32>({word(k + 1)})) << 32u) | (i64({word(k)}) & 0xFFFFFFFFli))"
        return word(k) if type_ == "u32" else f"bitcast<{type_}>({word(k)})"

    members = ""
    for field in record.fields:
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
    return text + f"  return {record.name}(\n{members}  );\n"


def _scalar(number_format: Format, type_: str) -> str:
    """The WGSL type of a member of a record."""
    names = {np.float32: "f32", np.int32: "i32", np.int64: "i64"}
    numbers = {
        "Coefficient": number_format.coefficient,
        "Value": number_format.value,
        "Length": number_format.length,
    }
    return names[numbers[type_]] if type_ in numbers else type_
