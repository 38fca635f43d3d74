"""Pieces of WGSL that kernels are written with: loops, and what is done for each quad of a block.

The block's quads, four pixels each, are written out, with NTH in a name or a number standing for
the quad: arrays indexed by a loop cost a compiler more and the device most.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.formats import Format
from halfstep.contract.layout import Record
from halfstep.shader.needs import Needs

# Bytes that an invocation loads at once: four numbers of 64 bits, in as many loads as of 32.
FETCHED = 32


def vector(template: str) -> str:
    """A Vector whose components are ``template`` with AXIS replaced by x, y and z."""
    return f"Vector({', '.join(template.replace('AXIS', axis) for axis in 'xyz')})"


def quads(needs: Needs, body: str, *, offsets: bool = True) -> str:
    """``body`` for every quad of the block, with its pixels' offset as ``at``."""
    at = "    let at = offset(x_NTH, y);\n" * offsets
    return each_quad(needs, f"    {{\n{at}{body}    }}\n")


def each_quad(needs: Needs, template: str) -> str:
    """``template`` for every quad of the block, with its number for NTH."""
    return "".join(template.replace("NTH", str(quad)) for quad in range(needs.quads))


def variables(needs: Needs, name: str, type_: str) -> str:
    """A variable for every quad of the block."""
    return each_quad(needs, f"    var {name}_NTH: {type_};\n")


def fetch(needs: Needs, record: Record, array: str, index: str, name: str) -> str:
    """Statements that fetch a record of an array."""
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


def loop(counter: str, first: str, end: str, body: str) -> str:
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
