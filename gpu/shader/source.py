"""Shader text, composed from the stages that a frame needs and nothing else.

The text is that of the files in ``halfstep.wgsl``.  Three things decide what of it is there:

- A definition that nobody reaches from the entry point is left out (``library``).
- Files that define the same names stand for one another (``contract.stages``).
- Marks say what is there only where a fact holds, and what is repeated for each quad (``expand``).

Python writes no more than the bindings, constants, and the functions that fetch records.

What lavapipe asks for, measured, the last two for devices that a processor plays alone:

- A loop is left at the end of its body.  Tested at its beginning, the body runs once more for no
  invocation at all.
- All quads of a block are halved in one loop: an operation waits for the one before, and the others
  fill the gap.
- Loads and stores serve one invocation after another, each word with a test of its own, so words
  travel in pairs, as 64 bits.
- What is stored passes a select that LLVM does not take apart (``wide.wgsl``).  Otherwise it
  computes the words anew for each invocation.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

from halfstep.contract import program
from halfstep.contract.classes import Class
from halfstep.contract.layout import LANES, TILE, Record
from halfstep.contract.mirrors import MIRROR_STEPS
from halfstep.contract.powers import BOUNDS, CLOCKS, term_count
from halfstep.contract.shadows import GROUP
from halfstep.contract.srgb import SRGB_ENTRIES
from halfstep.contract.stages import STAGES, VISITS, Kind, files_of
from halfstep.contract.veils import VEIL_ROUNDS, VEIL_STEPS
from halfstep.shader.expand import expand
from halfstep.shader.fetch import (
    FETCHED,
    MIRROR_RECORDS,
    PLACE_RECORDS,
    REGION_RECORDS,
    SHADOW_RECORDS,
    VEIL_RECORDS,
    fetches,
)
from halfstep.shader.formulas import formulas
from halfstep.shader.library import Definition, definitions, joined, reached, stage
from halfstep.shader.needs import UNIFORM_BYTES, Needs, byte_offsets, plane_offsets

# Half-spaces that a function of the article method takes when it is run alone. More would take
# long to compile: llvmpipe needs minutes for 128.
MAX_LINES = 8

# Where the places of points, what hides lights, and what mirrors show are bound.
LOCATIONS = 15
SHADOW_BINDINGS = range(16, 16 + len(SHADOW_RECORDS))
MIRROR_BINDINGS = range(SHADOW_BINDINGS.stop, SHADOW_BINDINGS.stop + len(MIRROR_RECORDS))
# Where formulas of solids are bound.
EXPRESSIONS_BINDING = MIRROR_BINDINGS.stop
# Where is bound what copies of groups hide of lights.
VEIL_BINDINGS = range(EXPRESSIONS_BINDING + 1, EXPRESSIONS_BINDING + 1 + len(VEIL_RECORDS))

# What words of programs are made of.
WORD = ("PLACE", "LEAF", "POSITIVE", "TURN", "OPENS", "CLOSES", "CELL_ENDS", "HIDDEN", "SIDE")
# Files whose functions need what an invocation or a device holds.
_JOINING = {
    name
    for stage in STAGES
    if stage.kind in (Kind.BLOCK, Kind.DEVICE)
    for name in (stage.file, *stage.others)
}


def compose(needs: Needs) -> str:
    """The whole shader; its entry point is ``render``."""
    return bindings(needs) + joined(_definitions(needs))


def compose_stages(needs: Needs) -> str:
    """The stage functions that a shader calls, each to be run alone.

    The article method's take the half-spaces of a solid as an array, which has room for MAX_LINES.
    """
    called = {item.name for item in _definitions(needs)}
    alone = [name for name in stage_files(needs) if name not in _JOINING]
    texts = [constants(needs), *(_expanded(needs, name) for name in alone)]
    items = (item for text in texts for item in definitions(text) if item.name in called)
    return f"{bindings(needs)}const MAX_LINES: u32 = {MAX_LINES}u;\n{joined(items)}"


def stage_files(needs: Needs) -> list[str]:
    """The files that a shader may take functions from that can be run alone, in order."""
    return files_of(needs.format, {*needs.choices, "lines"})


def _definitions(needs: Needs) -> list[Definition]:
    """What a shader needs of constants, stages and fetches, in order."""
    *stages, render = files_of(needs.format, needs.choices)
    texts = [
        constants(needs),
        *(_expanded(needs, name) for name in stages),
        formulas(needs),
        fetches(needs),
        *_visits(needs),
        _expanded(needs, render),
    ]
    library = (item for text in texts for item in definitions(text))
    return reached(library, bindings(needs) + "render(")


def _expanded(needs: Needs, name: str) -> str:
    """The text of a stage as a shader needs it."""
    return expand(stage(name), needs.facts, needs.quads, {"DEGREE": needs.degree})


def _visits(needs: Needs) -> Iterator[str]:
    """How solids of each class are tried."""
    for klass in needs.classes:
        visit = VISITS[needs.method, klass]
        text = expand(stage(visit.file), needs.facts | visit.facts, needs.quads)
        yield text.replace(f"fn {visit.file}(", f"fn visit_{klass.name.lower()}(")


def constants(needs: Needs) -> str:
    """What depends on the frame and the device; a shader takes those that it needs."""
    across = TILE // (LANES * needs.quads)
    halvings = needs.format.article_run if needs.method == "article" else needs.format.run
    numbers = {
        "WORKGROUP": across * TILE,
        "BLOCKS": across,  # of a row of a tile
        "BLOCK": LANES * needs.quads,  # pixels
        "BROADCAST": needs.broadcast,
        "LIGHTS": needs.lights,
        "SHININESS_BITS": needs.shininess_bits,
        "SURFACES": needs.surfaces,
        "CROSSINGS": needs.surfaces * (3 if "error" in needs.facts else 1),
        "LEVELS": needs.levels,
        "DEGREE": needs.degree,
        "TERMS": term_count(needs.degree),
        "NUMBERS": needs.numbers,
        "CLOCKS": CLOCKS,
        "BOUNDS": BOUNDS,
        "CLASSES": len(needs.classes),
        "SHADOWS": needs.shadows,
        "FAR_LIGHTS": needs.far_lights,
        "GROUPED": GROUP,
        "BOUNCES": needs.bounces,
        "MIRROR_STEPS": MIRROR_STEPS,
        "VEIL_STEPS": VEIL_STEPS,
        **{name: getattr(program, name) for name in WORD},
    }
    numbers |= {f"LIST_{klass.name}": slot for slot, klass in enumerate(needs.classes)}
    numbers |= {f"PLANE_{name.upper()}": n for name, n in plane_offsets(needs.outputs).items()}
    numbers |= {f"BYTES_{name.upper()}": n for name, n in byte_offsets(needs.outputs).items()}
    lines = [f"const {name}: u32 = {number}u;" for name, number in numbers.items()]
    lines.append(f"const VEIL_ROUNDS: i32 = {VEIL_ROUNDS};")
    lines.append(f"const HALVINGS: Run = {halvings};")
    lines.append(f"const SEARCHES: Run = {needs.format.run};")
    return "".join(f"{line}\n" for line in lines)


@functools.cache
def binding_types(needs: Needs) -> dict[int, str]:
    """The bindings a shader declares: wgpu's type of buffer of each, by number."""
    records = "uniform" if needs.uniform else "read-only-storage"
    types = {0: "uniform", 1: records, 2: records, 3: "read-only-storage", 4: "read-only-storage"}
    if plane_offsets(needs.outputs)["total"]:
        types[5] = "storage"
    if byte_offsets(needs.outputs)["total"]:
        types[6] = "storage"
    if "color" in needs.facts:
        types[7] = "uniform"
    if "image" in needs.outputs:
        types[8] = "uniform"
    if needs.surfaces:  # bound for all shaders of a frame, if some of them read it or not
        types |= dict.fromkeys(range(9, 10 + len(REGION_RECORDS)), "read-only-storage")
    if needs.degree:  # likewise
        types[10 + len(REGION_RECORDS)] = "read-only-storage"
    if needs.programs:  # likewise
        types[EXPRESSIONS_BINDING] = "read-only-storage"
    types |= dict.fromkeys(_placed(needs), "read-only-storage")
    return types


def _placed(needs: Needs) -> dict[int, tuple[str, Record]]:
    """Arrays that shadows and mirrors need, by binding."""
    found: list[tuple[int, tuple[str, Record]]] = []
    for fact, first, records in (
        ("places", LOCATIONS, PLACE_RECORDS),
        ("shadows", SHADOW_BINDINGS.start, SHADOW_RECORDS),
        ("mirrors", MIRROR_BINDINGS.start, MIRROR_RECORDS),
        ("veils", VEIL_BINDINGS.start, VEIL_RECORDS),
    ):
        if fact in needs.facts:
            found += enumerate(records.items(), start=first)
    return dict(found)


def bindings(needs: Needs) -> str:
    """What is bound from outside."""
    solid, half_space, quad, space = "Solid", "HalfSpace", "vec4<u32>", "storage, read"
    if needs.broadcast > 1:
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
    if "color" in needs.facts:
        count = max(needs.lights, 1)
        lines.append(f"@group(0) @binding(7) var<uniform> lights: array<Light, {count}>;")
    if "image" in needs.outputs:
        # A word of each vec4, because uniform arrays have no smaller stride.
        table = f"var<uniform> srgb_table: array<vec4<u32>, {SRGB_ENTRIES}>"
        lines.append(f"@group(0) @binding(8) {table};")
    if "regions" in needs.facts:
        arrays = {
            name: record.name if needs.broadcast == 1 else "vec4<u64>"
            for name, record in REGION_RECORDS.items()
        }
        lines += [
            f"@group(0) @binding({number}) var<storage, read> {name}: array<{type_}>;"
            for number, (name, type_) in enumerate((arrays | {"programs": "u32"}).items(), start=9)
        ]
    if Class.POLYNOMIAL in needs.classes:
        polynomial = "Polynomial" if needs.broadcast == 1 else "vec4<u64>"
        binding = f"@group(0) @binding({10 + len(REGION_RECORDS)})"
        lines.append(f"{binding} var<storage, read> polynomials: array<{polynomial}>;")
    if Class.FORMULA in needs.classes:
        expression = "Expression" if needs.broadcast == 1 else "vec4<u64>"
        binding = f"@group(0) @binding({EXPRESSIONS_BINDING})"
        lines.append(f"{binding} var<storage, read> expressions: array<{expression}>;")
    for number, (name, record) in _placed(needs).items():
        type_ = record.name if needs.broadcast == 1 else "vec4<u64>"
        lines.append(f"@group(0) @binding({number}) var<storage, read> {name}: array<{type_}>;")
    return "\n".join(lines) + "\n"
