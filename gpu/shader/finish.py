"""The part of a kernel that turns the nearest points of a block into outputs."""

from __future__ import annotations

from halfstep.shader.needs import OUTPUT_BYTES, OUTPUT_WORDS, Needs, byte_offsets, plane_offsets
from halfstep.shader.statements import each_quad, vector

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


def declare_finish(needs: Needs) -> str:
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
        mixed = vector("select(f4(frame.background.AXIS), lit.AXIS, some)")
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


def finish_block(needs: Needs) -> str:
    """Statements that write the outputs of a block."""
    image = "image" in needs.outputs
    text = each_quad(
        needs,
        "  let colors_NTH = " * image + "finish(nearest_NTH, i_NTH, j, place + NTHu);\n",
    )
    quads = range(needs.quads)
    if image:
        text += each_quad(needs, "  let packed_NTH = packed_image(colors_NTH);\n")
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
    if needs.stored == 1:
        return "".join(f"  pixels[{first} + {k}u] = {word};\n" for k, word in enumerate(words))
    padded = [*words, *["0u"] * (len(words) % 4)]
    text = ""
    for k in range(0, len(words), needs.stored):
        if k % 4 == 0:
            text += f"  let {name}_{k} = whole(vec4<u32>({', '.join(padded[k : k + 4])}));\n"
        value = f"{name}_{k // 4 * 4}" + f".{'xy'[k // 2 % 2]}" * (needs.stored == 2)
        text += f"  pixels[({first} + {k}u) / {needs.stored}u] = {value};\n"
    return text
