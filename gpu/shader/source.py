"""Shader text, composed from the stages that a frame needs and nothing else.

Stage functions are plain WGSL files beside each other in ``halfstep.wgsl``.  The kernel that joins
them is written here, and takes from the files what it reaches: for every class of solids present
one loop over the tile's list, in which each solid is fetched once and tried on a block of pixels.

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

from halfstep.contract.layout import LANES, SOLID, TILE, TILE_WORDS
from halfstep.contract.srgb import SRGB_ENTRIES
from halfstep.shader.finish import declare_finish, finish_block
from halfstep.shader.library import Definition, definitions, reached, stage
from halfstep.shader.needs import UNIFORM_BYTES, Needs, byte_offsets, plane_offsets
from halfstep.shader.statements import FETCHED, each_quad, fetch, loop, quads, variables
from halfstep.shader.visits import declare_keep, declare_lines, declare_nearest, try_solid

# Half-spaces that a function of the article method takes when it is run alone. More would take
# long to compile: llvmpipe needs minutes for 128.
MAX_LINES = 8


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
    kernel = _joined_stages(needs)
    return "\n".join([*reached(_library(stage_names(needs)), kernel), kernel])


def compose_stages(needs: Needs) -> str:
    """The stage functions that a shader calls, each to be run alone.

    The article method's take the half-spaces of a solid as an array, which has room for MAX_LINES.
    """
    library = _library([*stage_names(needs), "lines"])
    room = f"const MAX_LINES: u32 = {MAX_LINES}u;\n"
    return "\n".join([*reached(library, _joined_stages(needs)), _bindings(needs), room])


def _joined_stages(needs: Needs) -> str:
    """The kernel that joins the stages."""
    parts = [_bindings(needs), declare_nearest(needs)]
    parts += [declare_keep(needs)] * bool(needs.classes)
    parts += [declare_lines(needs)] * (needs.method == "article" and bool(needs.classes))
    return "\n".join([*parts, declare_finish(needs), _kernel(needs)])


def _library(names: list[str]) -> list[Definition]:
    """What stage files define, in order."""
    return [item for name in names for item in definitions(stage(name))]


@functools.cache
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
        word = {1: "u32", 2: "u64", 4: "vec2<u64>"}[needs.stored]
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
    return "\n".join(lines) + "\n"


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
        + loop(
            "entry",
            f"first_{slot}",
            f"end_{slot}",
            f"{fetch(needs, SOLID, 'solids', 'tile_solids[entry]', 'solid')}"
            f"{each_quad(needs, x)}"
            "    let y = j - solid.center_y;\n"
            f"{try_solid(needs, klass)}",
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
        f"{each_quad(needs, i)}"
        "  let j = frame.first_row + i32(row);\n"
        f"{variables(needs, 'nearest', 'Nearest')}"
        f"{quads(needs, clear, offsets=False)}"
        f"{loops}"
        f"{finish_block(needs)}"
        "}\n"
    )
