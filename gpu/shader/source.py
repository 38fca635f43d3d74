"""Composes shader text from the stages that a frame needs, and nothing else.

The text comes from the files in ``halfstep.wgsl``. Three rules choose its parts:

- A definition that the entry point does not reach is left out (``library``).
- Of the files that define the same names, a shader takes one (``contract.stages``).
- Marks keep lines only if a fact holds, and repeat statements for each quad (``expand``).

Python writes only the bindings, the constants, the scene's formulas (``formulas``) and the
functions that fetch records (``fetch``) and store outputs of words (``store``).

Four rules make lavapipe fast, measured. The last two apply to software adapters only:

- A loop tests its condition at the end of its body. llvmpipe runs a loop that tests first once
  more, with every invocation masked.
- One loop halves all quads of a block. An operation waits for the one before it, and operations on
  the other quads fill the gap.
- llvmpipe loads and stores for one invocation after another, and tests its mask for each word. So
  words are loaded and stored in pairs, as 64-bit integers.
- Stored words pass a select that LLVM cannot remove (``wide.wgsl``). Without it, LLVM computes the
  words again for each invocation.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

from halfstep.contract import program
from halfstep.contract.classes import SHORT, Class
from halfstep.contract.layout import LANES, TILE, Record
from halfstep.contract.mirrors import MIRROR_STEPS
from halfstep.contract.powers import (
    BOUNDS,
    CAST_STEPS,
    CLOCKS,
    MADE,
    MADE_OF_FORMULA,
    OFFSET_BITS,
    PLACE_HALVINGS,
    SEARCH_HALVINGS,
    SLOPE_HALVINGS,
    caster_terms,
    term_count,
)
from halfstep.contract.shadows import GROUP
from halfstep.contract.srgb import SRGB_ENTRIES
from halfstep.contract.stages import STAGES, VISITS, Kind, files_of
from halfstep.contract.veils import VEIL_STEPS, rounds_of_higher
from halfstep.shader.expand import expand
from halfstep.shader.fetch import (
    FETCHED,
    MIRROR_RECORDS,
    PLACE_RECORDS,
    REFLECTED_RECORDS,
    REGION_RECORDS,
    SHADOW_RECORDS,
    SHARED_RECORDS,
    VEIL_RECORDS,
    fetches,
    in_textures,
)
from halfstep.shader.formulas import formulas
from halfstep.shader.library import Definition, definitions, joined, reached, stage
from halfstep.shader.needs import UNIFORM_BYTES, Needs, byte_offsets, plane_offsets
from halfstep.shader.store import stores

# The most half-spaces of a solid when a function of the article method runs alone. llvmpipe would
# compile 128 for minutes.
MAX_LINES = 8

# The bindings for positions of points, for shadows and for mirrors.
LOCATIONS = 15
SHADOW_BINDINGS = range(16, 16 + len(SHADOW_RECORDS))
MIRROR_BINDINGS = range(SHADOW_BINDINGS.stop, SHADOW_BINDINGS.stop + len(MIRROR_RECORDS))
# The binding for formulas of solids.
EXPRESSIONS_BINDING = MIRROR_BINDINGS.stop
# The binding for surfaces of regions of an order above two.
HIGHERS_BINDING = EXPRESSIONS_BINDING + 1
# The bindings for veils.
VEIL_BINDINGS = range(HIGHERS_BINDING + 1, HIGHERS_BINDING + 1 + len(VEIL_RECORDS))
# The binding for forms of solids that may hide lights.
CASTERS_BINDING = VEIL_BINDINGS.stop
# The binding for forms of bodies.
BODY_CASTERS_BINDING = CASTERS_BINDING + 1
# The binding for formulas of solids that may hide lights.
CAST_FORMULAS_BINDING = CASTERS_BINDING + 2
# The bindings for cells of bodies.
BODY_CELLS_BINDINGS = range(CASTERS_BINDING + 3, CASTERS_BINDING + 3 + len(REFLECTED_RECORDS))
# The binding for sides of surfaces that solids share.
SHARED_BINDING = BODY_CELLS_BINDINGS.stop
# The binding for forms of surfaces of copies that may hide lights.
VEIL_HIGHERS_BINDING = SHARED_BINDING + 1
# The binding for formulas of bodies.
BODY_FORMULAS_BINDING = SHARED_BINDING + 2

# The type of a binding that is a texture.
TEXTURE = "texture"

# The constants of `contract.program` that shaders need.
WORD = (
    "PLACE",
    "LEAF",
    "POSITIVE",
    "TURN",
    "OPENS",
    "CLOSES",
    "CELL_ENDS",
    "HIDDEN",
    "SIDE",
    "NUMBER",
)
# Files whose functions cannot run alone: they need an invocation's variables or device memory.
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
    """The text of the stage functions that a shader calls and that can run alone.

    Functions of the article method take a solid's half-spaces as an array of MAX_LINES.
    """
    called = {item.name for item in _definitions(needs)}
    alone = [name for name in stage_files(needs) if name not in _JOINING]
    texts = [constants(needs), *(_expanded(needs, name) for name in alone)]
    items = (item for text in texts for item in definitions(text) if item.name in called)
    return f"{bindings(needs)}const MAX_LINES: u32 = {MAX_LINES}u;\n{joined(items)}"


def stage_files(needs: Needs) -> list[str]:
    """The stage files of a shader, in order, in the variant whose functions can run alone."""
    return files_of(needs.format, {*needs.choices, "lines"})


def _definitions(needs: Needs) -> list[Definition]:
    """The constants, stages, formulas, fetches, stores and visits that a shader needs, in order."""
    *stages, render = files_of(needs.format, needs.choices)
    texts = [
        constants(needs),
        *(_expanded(needs, name) for name in stages),
        formulas(needs),
        fetches(needs),
        stores(needs),
        *_visits(needs),
        _expanded(needs, render),
    ]
    library = (item for text in texts for item in definitions(text))
    return reached(library, bindings(needs) + "render(")


def _expanded(needs: Needs, name: str) -> str:
    """The expanded text of a stage."""
    terms = caster_terms(needs.degree)
    pairs = max(needs.pairs, needs.veil_pairs, needs.body_pairs)
    bounds = {"DEGREE": needs.degree, "PAIRS": pairs, "CASTER_TERMS": terms}
    bounds["BROADCAST"] = needs.broadcast
    return expand(stage(name), needs.facts, needs.quads, bounds)


def _visits(needs: Needs) -> Iterator[str]:
    """The text of the visit of each class, renamed after the class."""
    for klass in needs.classes:
        visit = VISITS[needs.method, klass]
        words = {"WORDS": visit.words}
        if klass == Class.REGION_KNOWN:
            known = needs.known or program.NOTHING_KNOWN
            words = {"WORDS": len(known.words), "flats": known.planes, "curves": known.quadrics}
        file = visit.file_in(needs.format)
        text = expand(stage(file), needs.facts | visit.facts, needs.quads, words)
        yield text.replace(f"fn {file}(", f"fn visit_{klass.name.lower()}(")


def constants(needs: Needs) -> str:
    """Constants that depend on the frame and the device. A shader keeps those that it uses."""
    across = TILE // (LANES * needs.quads)
    halvings = needs.format.article_run if needs.method == "article" else needs.format.run
    known = needs.known or program.NOTHING_KNOWN
    crossings = needs.surfaces * (3 if "error" in needs.facts else 1)
    numbers = {
        "WORKGROUP": (across * TILE, "invocations of a workgroup, which renders a tile"),
        "BLOCKS": (across, "blocks in a row of a tile"),
        "BLOCK": (LANES * needs.quads, "pixels of a block, which an invocation renders"),
        "BROADCAST": (needs.broadcast, "invocations that share a load"),
        "LIGHTS": (needs.lights, "lights to shade with"),
        "SHININESS_BITS": (needs.shininess_bits, "bits of the largest exponent of a highlight"),
        "SURFACES": (needs.surfaces, "the most surfaces of an excerpt"),
        "CROSSINGS": (crossings, "the most crossings of a region"),
        "LEVELS": (needs.levels, "the most levels that a program opens at once"),
        "WORDS": (max(SHORT.values()), "the most words of a short program"),
        "KNOWN_PLANES": (known.planes, "planes of the program that this shader holds"),
        "KNOWN_QUADRICS": (known.quadrics, "quadrics of that program"),
        "DEGREE": (needs.degree, "the highest degree of a polynomial"),
        "TERMS": (term_count(needs.degree), "terms of a polynomial"),
        "CASTER_TERMS": (caster_terms(needs.degree), "terms of a polynomial in x, y and z"),
        "PAIRS": (
            max(needs.pairs, needs.veil_pairs, needs.body_pairs),
            "the most pairs of ends of a surface of an order above two",
        ),
        "NUMBERS": (needs.numbers, "constants that a formula has room for"),
        "CLOCKS": (CLOCKS, "the most cells that a pixel tries"),
        "OFFSET_BITS": (OFFSET_BITS, "bits of the lower part of a weight that is multiplied"),
        "SEARCH_HALVINGS": (SEARCH_HALVINGS, "the most halvings of a search in integers"),
        "PLACE_HALVINGS": (PLACE_HALVINGS, "halvings that lead to any place"),
        "SLOPE_HALVINGS": (SLOPE_HALVINGS, "halvings before a slope is asked of an interval"),
        "BOUNDS": (BOUNDS, "the most error bounds that a pixel tries"),
        "MADE": (MADE, "halvings of the interval down to a ray's first cell"),
        "MADE_OF_FORMULA": (MADE_OF_FORMULA, "the same for a formula that is no polynomial"),
        "CLASSES": (len(needs.classes), "classes of solids"),
        "SHADOWS": (needs.shadows, "lights with shadows"),
        "FAR_LIGHTS": (needs.far_lights, "far lights among these, which come first"),
        "GROUPED": (GROUP, "occluders in a group"),
        "CHOSEN": (max(2 * needs.shadows, 1), "words for the occluders to try, two for each light"),
        "BOUNCES": (needs.bounces, "the most reflections of a ray"),
        "MIRROR_STEPS": (MIRROR_STEPS, "halvings for a ray from a mirror"),
        "CAST_STEPS": (CAST_STEPS, "halvings of the rest of a ray to a light"),
        "VEIL_STEPS": (VEIL_STEPS, "halvings for a crossing of a veil"),
        "HIGHER_ROUNDS": (
            rounds_of_higher(max(needs.veil_pairs, needs.body_pairs)),
            "the most rounds for a surface of an order above two of a veil or of a cell in mirrors",
        ),
        **{name: (getattr(program, name), "of a word of a program") for name in WORD},
    }
    for slot, klass in enumerate(needs.classes):
        numbers[f"LIST_{klass.name}"] = slot, "index of the list of this class in a tile"
    for name, first in plane_offsets(needs.outputs).items():
        numbers[f"PLANE_{name.upper()}"] = first, "first plane of this output"
    for name, first in byte_offsets(needs.outputs).items():
        numbers[f"BYTES_{name.upper()}"] = first, "bytes of a pixel before this output"
    lines = [f"const {name}: u32 = {n}u;  // {meaning}" for name, (n, meaning) in numbers.items()]
    meaning = "after so many, no more veils and no cells in mirrors are tried"
    lines.append(f"const COUNTED_ROUNDS: i32 = {needs.counted_rounds};  // {meaning}")
    lines.append(f"const HALVINGS: Run = {halvings};  // roundings of the method's halvings")
    lines.append(f"const SEARCHES: Run = {needs.format.run};  // roundings of the conveyor")
    return "".join(f"{line}\n" for line in lines)


@functools.cache
def binding_types(needs: Needs) -> dict[int, str]:
    """wgpu's buffer type of each binding that a shader declares, or ``TEXTURE``, by number."""
    textures = in_textures(needs)
    records = "uniform" if needs.uniform else _read_from("solids" in textures)
    types = {0: "uniform", 1: records, 2: records, 3: "read-only-storage", 4: "read-only-storage"}
    if plane_offsets(needs.outputs)["total"]:
        types[5] = "storage"
    if byte_offsets(needs.outputs)["total"]:
        types[6] = "storage"
    if "color" in needs.facts:
        types[7] = "uniform"
    if "image" in needs.outputs:
        types[8] = "uniform"
    if needs.surfaces:  # bound for all shaders of a frame, whether they read it or not
        read_from = [_read_from(name in textures) for name in (*REGION_RECORDS, "programs")]
        types |= dict(enumerate(read_from, start=9))
    if needs.degree:  # likewise
        types[10 + len(REGION_RECORDS)] = _read_from("polynomials" in textures)
    if needs.pairs:  # likewise
        types[HIGHERS_BINDING] = "read-only-storage"
    if needs.programs:  # likewise
        types[EXPRESSIONS_BINDING] = _read_from("expressions" in textures)
    for fact, number, name in (
        ("casters", CASTERS_BINDING, "casters"),
        ("body_casters", BODY_CASTERS_BINDING, "body_casters"),
        ("cast_formulas", CAST_FORMULAS_BINDING, "cast_formulas"),
        ("veil_higher", VEIL_HIGHERS_BINDING, "veil_highers"),
        ("body_formulas", BODY_FORMULAS_BINDING, "body_formulas"),
    ):
        if fact in needs.facts:
            types[number] = _read_from(name in textures)
    types |= {number: _read_from(name in textures) for number, (name, _) in _placed(needs).items()}
    return types


def _read_from(is_texture: bool) -> str:
    return TEXTURE if is_texture else "read-only-storage"


def _placed(needs: Needs) -> dict[int, tuple[str, Record]]:
    """Name and record of each array that shadows and mirrors need, by binding."""
    found: list[tuple[int, tuple[str, Record]]] = []
    for fact, first, records in (
        ("places", LOCATIONS, PLACE_RECORDS),
        ("flush", SHARED_BINDING, SHARED_RECORDS),
        ("shadows", SHADOW_BINDINGS.start, SHADOW_RECORDS),
        ("mirrors", MIRROR_BINDINGS.start, MIRROR_RECORDS),
        ("veils", VEIL_BINDINGS.start, VEIL_RECORDS),
        ("body_cells", BODY_CELLS_BINDINGS.start, REFLECTED_RECORDS),
    ):
        if fact in needs.facts:
            found += enumerate(records.items(), start=first)
    return dict(found)


def bindings(needs: Needs) -> str:
    """The declarations of the bindings."""
    solid, half_space, quad, space = "Solid", "HalfSpace", "vec4<u32>", "storage, read"
    if needs.broadcast > 1:
        solid, half_space, quad = "vec4<u64>", "vec4<u64>", "vec2<u64>"
    if needs.uniform:
        solid = half_space = f"vec4<u64>, {UNIFORM_BYTES // FETCHED}"
        space = "uniform"
    lines = [
        "@group(0) @binding(0) var<uniform> frame: Frame;",
        _records(needs, 1, "solids", solid, space),
        _records(needs, 2, "half_spaces", half_space, space),
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
        # The table uses one word of each vec4: elements of uniform arrays take 16 bytes or more.
        table = f"var<uniform> srgb_table: array<vec4<u32>, {SRGB_ENTRIES}>"
        lines.append(f"@group(0) @binding(8) {table};")
    if "regions" in needs.facts:
        arrays = {
            name: record.name if needs.broadcast == 1 else "vec4<u64>"
            for name, record in REGION_RECORDS.items()
        }
        lines += [
            _records(needs, number, name, type_)
            for number, (name, type_) in enumerate((arrays | {"programs": "u32"}).items(), start=9)
        ]
    special = (
        ("higher" in needs.facts, HIGHERS_BINDING, "highers", "Higher"),
        (needs.has_polynomials, 10 + len(REGION_RECORDS), "polynomials", "Polynomial"),
        (needs.has_formulas, EXPRESSIONS_BINDING, "expressions", "Expression"),
        ("casters" in needs.facts, CASTERS_BINDING, "casters", "Caster"),
        ("body_casters" in needs.facts, BODY_CASTERS_BINDING, "body_casters", "Caster"),
        ("cast_formulas" in needs.facts, CAST_FORMULAS_BINDING, "cast_formulas", "Expression"),
        ("veil_higher" in needs.facts, VEIL_HIGHERS_BINDING, "veil_highers", "Caster"),
        ("body_formulas" in needs.facts, BODY_FORMULAS_BINDING, "body_formulas", "Expression"),
    )
    for is_there, number, name, type_ in special:
        if is_there:
            element = type_ if needs.broadcast == 1 else "vec4<u64>"
            lines.append(_records(needs, number, name, element))
    for number, (name, record) in _placed(needs).items():
        type_ = record.name if needs.broadcast == 1 else "vec4<u64>"
        lines.append(_records(needs, number, name, type_))
    return "\n".join(lines) + "\n"


def _records(
    needs: Needs, number: int, name: str, element: str, space: str = "storage, read"
) -> str:
    """The declaration of an array of records, which may be a texture."""
    binding = f"@group(0) @binding({number})"
    if name in in_textures(needs):
        return f"{binding} var {name}: texture_2d<u32>;"
    return f"{binding} var<{space}> {name}: array<{element}>;"
