"""Shader text: code for what a frame needs and nothing else, and every combination compiles."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from halfstep.contract.classes import REGIONS, Class
from halfstep.contract.expressions import Operation
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT32_EXACT, Format
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.contract.stages import FACTS, STAGES, VISITS, files_of
from halfstep.device.adapters import Adapter, open_device
from halfstep.frames.outputs import OUTPUTS, device_outputs
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, bundled_scenes, load, with_overrides
from halfstep.shader.expand import marks
from halfstep.shader.fetch import fetches
from halfstep.shader.formulas import formulas
from halfstep.shader.library import definitions, joined, reached, stage
from halfstep.shader.needs import Needs
from halfstep.shader.source import bindings, compose, constants, stage_files
from halfstep.shader.store import stores
from tests.bundled import drawn_by_all
from tests.test_pack import SIZE

METHODS = ("visible", "article")
FORMATS = (FLOAT32, FLOAT32_EXACT, FIXED32)
ALL = frozenset(DEVICE_OUTPUTS.keys() | OUTPUT_BYTES)

QUADRICS = {Class.QUADRIC, Class.QUADRIC_INSIDE}
POLYHEDRA = {Class.POLYHEDRON, Class.POLYHEDRON_INSIDE}
LONG = {Class.REGION, Class.REGION_INSIDE}
POLYNOMIALS = {Class.POLYNOMIAL, Class.FORMULA}
# Function -> the classes one of which it is there for.
CALLED = {
    "visible": {
        "ellipsoid_entry": {Class.ELLIPSOID},
        "quadric_entry": QUADRICS,
        "polyhedron_entry": POLYHEDRA,
        "patch_entry": {Class.PATCH},
        "facing": {Class.PATCH},
        "clip": QUADRICS | POLYHEDRA,
        "whole_interval": QUADRICS | POLYHEDRA | POLYNOMIALS,
        "from_the_eye": {Class.QUADRIC_INSIDE, Class.POLYHEDRON_INSIDE, *POLYNOMIALS},
        "walked": {Class.POLYNOMIAL},
        "walked_formula": {Class.FORMULA},
        "choose": {Class.QUADRIC_INSIDE, Class.POLYHEDRON_INSIDE},
        "form_at": {Class.ELLIPSOID, *QUADRICS, *REGIONS},
        "crossing": REGIONS,
        "look": LONG,
    },
    "article": {
        "article_quadric": QUADRICS,
        "article_polyhedron": POLYHEDRA,
        "article_patch": {Class.PATCH},
        "facing": {Class.PATCH},
        "form_at": QUADRICS | REGIONS,
        "crossing": REGIONS,
        "look": LONG,
    },
}
# Two formulas with all operations.
PROGRAMS = (
    (
        Operation("number", (), 0),
        Operation("raised", (0,), 1),
        Operation("scaled", (1,), 2),
        Operation("negated", (2,)),
        Operation("sum", (3, 4)),
        Operation("difference", (5, 6)),
        Operation("product", (7, 8)),
        Operation("square", (9,)),
        Operation("checked", (10,)),
    ),
    (
        Operation("reciprocal", (0,)),
        Operation("root", (1,), 3),
        Operation("magnitude", (2,)),
        Operation("greatest", (3, 4)),
        Operation("least", (5, 6)),
        Operation("sine", (7,)),
        Operation("cosine", (8,)),
        Operation("exponential", (9,)),
        Operation("logarithm", (10,)),
    ),
)
NEEDS = Needs(
    classes=(Class.QUADRIC,),
    outputs=ALL,
    method="visible",
    format=FLOAT32,
    lights=2,
    point_lights=True,
    shininess_bits=6,
    short_keys=False,
    surfaces=8,
    levels=4,
    degree=4,
    pairs=2,
    programs=PROGRAMS,
    numbers=4,
    balls=True,
    planes=True,
)


NO_CASTERS: dict[str, Any] = {
    f"{of}_{kind}": False for of in ("cast", "body") for kind in ("polynomials", "formulas")
}
SHADOWED = replace(
    NEEDS,
    shadows=2,
    far_lights=1,
    curves=True,
    encloses=True,
    cast_polynomials=True,
    cast_formulas=True,
    bounces=1,
    body_polynomials=True,
    body_formulas=True,
    body_cells=True,
    body_pairs=2,
    flush=True,
    veils=True,
    veil_pairs=2,
)


@pytest.fixture(scope="module")
def device(adapter: Adapter) -> Iterator[Any]:
    device = open_device(adapter, features=("shader-int64", "subgroup"))
    yield device
    device.destroy()


def needs(scene: Scene, outputs: frozenset[str] = ALL) -> Needs:
    small = with_overrides(scene, size=SIZE, steps=12)
    return needs_of_frame(prepare(small), scene.accuracy.method, outputs)


def code(text: str) -> str:
    """The text without its comments."""
    return re.sub(r"//.*", "", text)


def functions(text: str) -> set[str]:
    """The functions that a shader has."""
    return set(re.findall(r"^fn (\w+)\(", text, re.MULTILINE))


@pytest.mark.parametrize("number_format", FORMATS, ids=lambda form: form.forms)
def test_files_of_a_shader_define_different_names(number_format: Format) -> None:
    """Of two definitions of one name a shader would take the last, and a stage not its own."""
    for chosen in [(), *((other,) for each in STAGES for other in each.others)]:
        files = files_of(number_format, chosen)
        names = Counter(item.name for file in files for item in definitions(stage(file)))
        assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", bundled_scenes())
def test_a_kernel_calls_what_its_solids_need(name: str, method: str) -> None:
    if method == "article" and name not in drawn_by_all():
        return
    need = needs(with_overrides(load(name), method=method), ALL - {"error", "vague"})
    called = functions(compose(need))
    for function, classes in CALLED[method].items():
        # A ball is a quadric, and half-spaces may cut solids with formulas.
        is_cut = (need.balls and function == "form_at") or (need.planes and function == "clip")
        assert (function in called) == (is_cut or bool(classes & set(need.classes))), function
    other = CALLED[METHODS[method == "visible"]].keys() - CALLED[method].keys()
    assert not other & set(called)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("klass", [Class.QUADRIC, Class.POLYHEDRON, Class.PATCH])
def test_code_of_a_method_is_there_for_it_alone(klass: Class, method: str) -> None:
    text = compose(replace(NEEDS, classes=(klass,), method=method))
    assert ("fn visible_point(" in text or "fn article_patch(" in text) == (method == "article")
    assert ("fn halved(" in text) == ("struct Root" in text) == (method == "visible")


@pytest.mark.parametrize("name", ["die", "nested_differences"])
def test_cells_have_one_shader_by_both_methods(name: str) -> None:
    packed = prepare(with_overrides(load(name), size=SIZE, steps=16))
    outputs = device_outputs(OUTPUTS)
    texts = {compose(needs_of_frame(packed, method, outputs)) for method in METHODS}
    assert len(texts) == 1


def test_a_shader_holds_code_of_its_own_solids_alone() -> None:
    """Nothing of a polyhedron, a plane or a quadric in a shader without one."""
    # No frame of theirs asks integers where float32 is uncertain.
    need = replace(NEEDS, outputs=NEEDS.outputs - {"vague"})
    sphere = code(compose(replace(need, classes=(Class.ELLIPSOID,))))
    box = code(compose(replace(need, classes=(Class.POLYHEDRON,))))
    for word in ("Piece", "clip(", "polyhedron", "quadric_entry", "Patch", "linear(", "FLAG_"):
        assert word not in sphere, word
    for word in ("quadratic", "ellipsoid", "quadric_entry", "gradient(", "Patch", "discriminant"):
        assert word not in box, word


@pytest.mark.parametrize("name", OUTPUTS)
def test_code_of_an_output_is_there_for_it_alone(name: str) -> None:
    need = replace(NEEDS, outputs=device_outputs([name]))
    text = compose(need)
    shaded = name in ("image", "color")
    in_words = need.outputs & DEVICE_OUTPUTS.keys()
    oriented = shaded or any("normal" in DEVICE_OUTPUTS[each].facts for each in in_words)
    assert ("fn encode(" in text) == (name == "image")
    assert ("fn shade(" in text) == ("lights" in text) == shaded
    assert ("fn gradient(" in text) == ("gradient(" in text) == oriented
    assert ("fn ray_direction(" in text) == oriented
    assert ("certify_quadric(" in text) == (name == "error")
    exits = name == "depth_exit"
    assert text.count("= begun(") == need.quads * (2 if exits else 1)
    assert ("quadric_exit" in functions(text)) == exits


@pytest.mark.parametrize("number_format", FORMATS, ids=lambda form: form.forms)
@pytest.mark.parametrize("klass", Class)
def test_code_of_a_number_format_is_there_for_it_alone(klass: Class, number_format: Format) -> None:
    for method in METHODS:
        if (method, klass) not in VISITS:
            continue
        need = replace(NEEDS, classes=(klass,), method=method, format=number_format)
        assert ("i64" in compose(need)) == number_format.integer
        assert set(number_format.stages) <= set(stage_files(need))
        for other in FORMATS:
            assert not set(other.stages) - set(number_format.stages) & set(stage_files(need))


@pytest.mark.slow
def test_no_built_in_leaves_the_device_a_choice(combined: set[str]) -> None:
    """Bits do not hang on the order of a dot product, a contracted mix or a power."""
    exact = {
        "abs",
        "any",
        "bitcast",
        "ceil",
        "clamp",
        "countLeadingZeros",
        "countOneBits",
        "countTrailingZeros",
        "floor",
        "max",
        "min",
        "round",
        "select",
    }
    moved = {"subgroupBroadcast", "textureLoad"}
    # Correctly rounded where bits are promised, as the canary sees.
    rounded = {"sqrt"}
    types = {"array", "f32", "i32", "i64", "u32", "u64", "vec2", "vec3", "vec4"}
    syntax = {"align", "binding", "builtin", "for", "group", "if", "return", "size"}
    # Most lines are in most shaders.
    text = code("\n".join(sorted({line for text in combined for line in text.splitlines()})))
    own = set(re.findall(r"\b(?:fn|struct|alias) (\w+)", text))
    used = set(re.findall(r"\b([a-z]\w*)(?:<[^()]*?>)? ?\(", text)) - own
    assert used - types - syntax - {"workgroup_size"} == exact | moved | rounded


@pytest.mark.parametrize("method", METHODS)
def test_from_pixel_to_key_fixed32_has_no_float(method: str) -> None:
    """Every operation that decides what a ray shows, and where, is one of integers."""
    for klass in Class:
        if (method, klass) not in VISITS or klass == Class.FORMULA:
            continue
        outputs = frozenset({"surface", "key", "exit"})
        # No surface of an order above two is drawn in integers.
        need = replace(NEEDS, classes=(klass,), method=method, format=FIXED32, pairs=0)
        need = replace(need, outputs=outputs)
        text = code(compose(need))
        # Members of records and 2^-n, which only float32 reads, are handed on.
        text = re.sub(r"struct \w+ \{.*?\n\}", "", text, flags=re.DOTALL)
        text = re.sub(r"last_step: f32|alias f4 = vec4<f32>;|const \w+: f32 = [^;]*;", "", text)
        fetch = re.search(r"fn \w+_at\(number: u32\)", text)
        assert fetch is not None
        kernel = fetch.start()
        assert not re.findall(r"\bf4\b|\bf32\b", text[:kernel]), klass
        assert not re.findall(r"\bf4\b|\bf32\(", text[kernel:]), klass


def test_names_of_a_scene_do_not_reach_the_shader(tmp_path: Path) -> None:
    name = "xyzzy */ } fn render() {}"
    text = Path(__file__).parents[1].joinpath("scenes", "figure.toml").read_text()
    plain, named = tmp_path / "plain.toml", tmp_path / "xyzzy.toml"
    plain.write_text(text)
    text = re.sub(r'^(title|name|material) = "(.*)"', rf'\1 = "{name} \2"', text, flags=re.M)
    assert text.count(name) >= 3
    named.write_text(text)
    for method in METHODS:
        shaders = [compose(needs(with_overrides(load(p), method=method))) for p in (plain, named)]
        assert shaders[0] == shaders[1]
        assert "xyzzy" not in shaders[1]


def test_a_solid_out_of_sight_asks_for_no_other_shader() -> None:
    """Turning the camera compiles nothing: one shader serves a scene."""
    scene = load("gallery")
    center = scene.camera.center
    away = {"look_at": [center[0] + 1.0, center[1] - 9.0, center[2] + 2.0]}
    assert needs(with_overrides(scene, camera=away), ALL) == needs(scene, ALL)


def combinations() -> Iterator[Needs]:
    """Every class with every method, number format and output, and all classes together.

    Each as it is where an invocation loads alone, and where those of a subgroup of four or eight
    load together, from storage or uniform memory. The latter not for each output alone.
    """
    for need in _combinations():
        yield need
        if len(need.outputs) <= 2 and "image" not in need.outputs:
            continue
        for broadcast, uniform in ((4, True), (8, False)):
            need = replace(need, broadcast=broadcast, uniform=uniform)
            yield replace(need, crowded=not uniform, dense=not uniform)


def _combinations() -> Iterator[Needs]:
    article_classes = (Class.QUADRIC, Class.POLYHEDRON, Class.PATCH)
    visible: list[tuple[Class, ...]] = [(), tuple(Class), *((klass,) for klass in Class)]
    article: list[tuple[Class, ...]] = [(), article_classes]
    article += [(klass,) for klass in article_classes]
    outputs = [ALL, *(frozenset({"tag", name}) for name in DEVICE_OUTPUTS.keys() | OUTPUT_BYTES)]
    for method, sets in (("visible", visible), ("article", article)):
        for classes, form, wanted in product(sets, FORMATS, outputs):
            if form is FIXED32:  # cannot draw formulas
                classes = tuple(klass for klass in classes if klass != Class.FORMULA)
            yield replace(NEEDS, classes=classes, method=method, format=form, outputs=wanted)
    wanted = frozenset({"surface", "image"})
    for classes, form in product(visible, (FLOAT32, FLOAT32_EXACT)):
        yield replace(NEEDS, classes=classes, format=form, outputs=wanted, short_keys=True)
    for lights, point_lights, bits in product((0, 1, 3), (False, True), (0, 6)):
        lit = replace(NEEDS, lights=lights, point_lights=point_lights, shininess_bits=bits)
        yield from (lit, replace(lit, parallel=True))
    for form, far, encloses in product(FORMATS, (0, 1, 2), (False, True)):
        bounces = int(form is not FIXED32)  # which cannot draw mirrors
        lit = replace(SHADOWED, format=form, bounces=bounces, veils=False, **NO_CASTERS)
        lit = replace(lit, veil_pairs=0, body_cells=False, body_pairs=0)
        yield replace(lit, far_lights=far, encloses=encloses, flush=far != 1)
        if form is not FIXED32:  # which cannot draw shadows of cells and polynomials
            yield replace(lit, far_lights=far, encloses=encloses, veils=True)
            yield replace(lit, far_lights=far, encloses=encloses, veils=True, veil_pairs=2)
            higher = replace(lit, cast_polynomials=True, body_polynomials=True)
            yield replace(higher, far_lights=far, encloses=encloses)
            higher = replace(lit, cast_formulas=True, body_formulas=True)
            yield replace(higher, far_lights=far, encloses=encloses)
            yield replace(lit, far_lights=far, encloses=encloses, body_cells=True)
            higher = replace(lit, body_cells=True, body_pairs=2)
            yield replace(higher, far_lights=far, encloses=encloses)
    for continued, classes in product((False, True), ((Class.PATCH,), (Class.REGION,))):
        counted = replace(SHADOWED, bounces=0, counted_rounds=64, continued=continued)
        yield replace(counted, classes=classes, outputs=ALL)
    for shadows, image in product((0, 2), (False, True)):
        wanted = frozenset({"tag", "image" if image else "color"})
        yield replace(SHADOWED, shadows=shadows, outputs=wanted, bounces=3, encloses=False)
    for curves, far in product((False, True), (1, 2)):
        wanted = frozenset({"shadow", "tag"})
        yield replace(SHADOWED, outputs=wanted, curves=curves, far_lights=far)


@pytest.fixture(scope="module")
def combined() -> set[str]:
    """The shaders of all combinations."""
    return {compose(need) for need in combinations()}


def test_every_combination_compiles(device: Any, combined: set[str]) -> None:
    for text in combined:
        device.create_shader_module(code=text)
    assert len(combined) > 1000


FILES = sorted(path.stem for path in Path(__file__).parents[1].joinpath("wgsl").glob("*.wgsl"))
# Files whose memory is that of another device, and outputs for which its blocks are as large.
WIDE = {
    "wide": ALL,
    "store_words_wide": ALL,
    "store_bytes_two": frozenset({"image", "tag"}),
    "store_bytes_four": frozenset({"image", "tag"}),
}
# Files that need another file in place of the usual one.
WITH = {"near_key_short": {"keys_short"}, "render": {"store_words_wide"}}
INTEGER = {"bernstein"}
EXACT = {"polynomial_exact", "forms_exact", "halve_incremental"}


def as_it_lies(name: str) -> str:
    """A file with what it needs of others and of Python, all unexpanded."""
    form = FLOAT32_EXACT if name in EXACT else FLOAT32
    if name.endswith("_fixed") or name in INTEGER:
        form = FIXED32
    classes = tuple(klass for klass in Class if form is not FIXED32 or klass != Class.FORMULA)
    if name in WIDE:
        # Blocks of regions are of one quad.
        classes = (Class.QUADRIC, Class.PATCH)[: 1 if name == "store_bytes_four" else 2]
    need = replace(NEEDS if name in WIDE else SHADOWED, classes=classes, format=form)
    if form is FIXED32:  # cannot draw shadows of cells and polynomials
        need = replace(need, veils=False, veil_pairs=0, body_cells=False, body_pairs=0)
        need = replace(need, **NO_CASTERS)
    if name in WIDE:
        need = replace(need, outputs=WIDE[name], broadcast=4)
    if name in ("search_together", "search_apart", "render"):
        need = replace(need, broadcast=4, crowded=True)
    method = "article" if name == "visit_article" else "visible"
    texts = [constants(need), formulas(need), fetches(need), stores(need)]
    for klass in Class:
        if (method, klass) in VISITS:
            file = VISITS[method, klass].file_in(form)
            texts.append(stage(file).replace(f"fn {file}(", f"fn visit_{klass.name.lower()}("))
    texts += [
        stage(file) for file in files_of(form, {name} | WITH.get(name, set())) if file != name
    ]
    own = f"{bindings(need)}const MAX_LINES: u32 = 8u;\n{stage(name)}"
    own_names = {item.name for item in definitions(own)}
    items = (item for text in texts for item in definitions(text))
    library = [item for item in items if item.name not in own_names]
    return joined(reached(library, own)) + own


@pytest.mark.parametrize("name", FILES)
def test_files_as_they_lie_are_wgsl(name: str, device: Any) -> None:
    whole = name.startswith(("canary", "probe"))
    text = stage(name) if whole else as_it_lies(name)
    device.create_shader_module(code=text)
    slip = text.replace("fn ", "fn fn ", 1) if "fn " in text else f"{text}}}"
    with pytest.raises(Exception, match="parsing error"):
        device.create_shader_module(code=slip)


@pytest.mark.parametrize("name", FILES)
def test_files_have_short_lines_and_marks_that_mean_something(name: str) -> None:
    text = stage(name)
    assert max(map(len, text.splitlines())) <= 100
    assert marks(text) <= set(FACTS)
    # Each mark is in the form that is looked for.
    assert text.count("//?") == len(re.findall(r"  //\? !?\w+(?: & !?\w+)*$", text, re.MULTILINE))
    assert text.count("each quad") == len(re.findall(r"^ *// each quad$", text, re.MULTILINE))


def test_every_fact_decides_on_something() -> None:
    """Only the fact that an output is written may decide on nothing: a finish need not ask."""
    written = {f"store_{name}" for name in ALL}
    assert {mark for name in FILES for mark in marks(stage(name))} | written == set(FACTS)


def test_every_file_is_in_the_readme() -> None:
    text = Path(__file__).parents[1].joinpath("wgsl", "README.md").read_text()
    assert set(re.findall(r"`(\w+)\.wgsl`", text)) == set(FILES)
