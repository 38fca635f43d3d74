"""What a WGSL text declares is read as the compiler reads it; what cannot be read is named."""

from __future__ import annotations

import pytest

from halfstep.errors import UsageError
from halfstep.shader.library import stage
from halfstep.testing.module import Module
from halfstep.testing.parse import declarations
from halfstep.testing.tokens import tokens_of
from halfstep.testing.types import (
    Array,
    Matrix,
    Member,
    Pointer,
    Scalar,
    Struct,
    Type,
    Vector,
    size_of,
)

F32, I32, U32, BOOL = map(Scalar, ("f32", "i32", "u32", "bool"))

TEXT = """
enable f16;
// fn in_a_line() -> f32 {
/* fn in_a_block() -> f32 { /* nested // */ } */
const SIDE: u32 = 1u + 2u; // a constant; with a semicolon
const CELLS = SIDE * (8u >> 1u);
override SCALE: f32 = 2.0;
alias Real = f32;
alias Grid = array<array<Real, SIDE>, CELLS>;
struct Point { x: Real, y: Real }
struct Row {
  @size(16) id: u32,
  @align(16) at: Point,
  ok: bool, // no host shares it
}
var<private> seed: u32 = 1u;
var<private> unknown = 1.0;
var<workgroup> shared_row: array<f32, 64>;
@group(0) @binding(3) var<uniform> lens: mat3x2<f32>;
@group(1) @binding(0x2u) var<storage, read_write> out: array<Row>;
@group(1) @binding(3) var<storage> table: array<vec4<u32>>;
@group(2) @binding(0) var picture: texture_external;

@must_use
fn helper(a: vec2<f32>, @builtin(position) b: vec4f) -> @location(0) vec2<f32> {
  if a.x < b.x { return a; }
  return a + vec2(SCALE) + lens * vec3f(1.0);
}
fn many(grid: Grid, p: ptr<function, array<Point, 2>>, row: Row,) -> array<bool, SIDE> {
  _ = helper(vec2f(0.0), vec4f(0.0));
  return array<bool, SIDE>();
}
fn silent(a: f32) {}
fn odd(a: f32, b: texture_external) -> f32 { return a; }
fn far(a: ptr<workgroup, f32>) -> f32 { return *a; }
@compute @workgroup_size(64) fn main() { seed = SIDE; }
"""


@pytest.fixture
def module() -> Module:
    return Module("text", TEXT)


def test_comments_are_no_code() -> None:
    text = "a // b */ c\n/* d /* e */ f // */ g /**/ h//"
    assert tokens_of(text, "text") == ["a", "g", "h"]
    assert not {"in_a_line", "in_a_block"} & declarations(TEXT).keys()


def test_a_signature_has_the_types_that_are_written(module: Module) -> None:
    point = Struct("Point", (Member("x", F32, 0, 4, 4), Member("y", F32, 4, 4, 4)))
    parameters, shared, result = module.signature("many")
    assert shared == {}
    assert parameters == {
        "grid": Array(Array(F32, 3), 12),
        "p": Pointer("function", Array(point, 2)),
        "row": Struct(
            "Row",
            (
                Member("id", U32, 0, 4, 16),
                Member("at", point, 16, 16, 8),
                Member("ok", BOOL, 24, 4, 4),
            ),
        ),
    }
    assert result == Array(BOOL, 3)
    assert size_of(module.struct("Row")) == 32
    parameters, _, result = module.signature("helper")
    assert list(parameters.values()) == [Vector(F32, 2), Vector(F32, 4)]
    assert result == Vector(F32, 2)


@pytest.mark.parametrize(
    ("text", "type_"),
    [
        ("f64", Scalar("f64")),
        ("vec3i", Vector(I32, 3)),
        ("vec4<u32>", Vector(U32, 4)),
        ("vec2h", Vector(Scalar("f16"), 2)),
        ("vec3<bool>", Vector(BOOL, 3)),
        ("mat4x3f", Matrix(F32, 4, 3)),
        ("mat2x4<f16>", Matrix(Scalar("f16"), 2, 4)),
        ("array<vec3<i64>, 0x10u>", Array(Vector(Scalar("i64"), 3), 16)),
        ("array<f32>", Array(F32, None)),
        ("atomic<u32>", Scalar("u32", atomic=True)),
    ],
)
def test_types(text: str, type_: Type) -> None:
    assert Module("text", f"var<private> a: {text};").variable("a") == type_


def test_resources_have_places_and_kinds(module: Module) -> None:
    assert module.resources() == ["lens", "out", "table", "picture"]
    assert [module.binding(name)[1:4] for name in ("lens", "out", "table")] == [
        (0, 3, "uniform"),
        (1, 2, "storage"),
        (1, 3, "read-only-storage"),
    ]


def test_what_a_function_reaches_is_known(module: Module) -> None:
    assert module.reached("helper") == {"helper", "SCALE", "lens"}
    assert module.reached("many") >= {"helper", "lens", "Grid", "Row", "Point", "SIDE", "CELLS"}
    assert "out" not in module.reached("many")
    assert module.reached("main") == {"main", "seed", "SIDE"}
    assert module.private() == ["seed", "unknown"]


def test_a_name_of_something_within_a_function_is_not_what_it_reaches() -> None:
    module = Module(
        "text",
        """
        @group(0) @binding(0) var<storage, read> counts: array<u32>;
        struct Sums { counts: f32, finish: f32 }
        struct Nested { Sums: Sums }
        fn finish(x: f32) -> u32 { return counts[0]; }
        fn scaled(finish: f32, s: Sums) -> f32 { return finish * s.counts; }
        fn twice(counts: u32) -> u32 { let finish = counts; return finish + finish; }
        fn both(s: Sums) -> f32 { return scaled(f32(finish(s.finish)), s); }
        fn inner(n: Nested) -> f32 { return n.Sums.counts; }
        """,
    )
    assert module.reached("scaled") == {"scaled", "Sums"}
    assert module.reached("twice") == {"twice"}
    assert module.reached("both") == {"both", "scaled", "Sums", "finish", "counts"}
    assert module.reached("inner") == {"inner", "Nested", "Sums"}


@pytest.mark.parametrize(
    ("body", "reaches"),
    [
        ("let t = 1u; return t;", False),
        ("var t = 1u; return t;", False),
        ("var<function> t: u32 = 1u; return t;", False),
        ("const t = 1u; return t;", False),
        ("let t = t[0]; return t;", True),
        ("{ let t = 1u; } return t[0];", True),
        ("if x > 1u { let t = 1u; return t; } return x;", False),
        ("if x > 1u { let t = 1u; } else { return t[0]; } return x;", True),
        ("for (var t = 0u; t < x; t++) { let y = t; } return x;", False),
        ("for (var t = 0u; t < x; t++) { } return t[0];", True),
        ("for (var t = 0u; t < x; t++) { for (var u = t; u < x; u++) { } } return t[0];", True),
        ("loop { let t = x; continuing { break if t > 1u; } } return x;", False),
        ("loop { let t = x; if t > 1u { break; } } return t[0];", True),
        ("var y = array(1u, 2u); let z = y[t[0]]; return z;", True),
        ("let t = array(x, x); return t[0];", False),
        ("switch x { case 1u { let t = x; return t; } default { return t[0]; } }", True),
        ("switch x { case 1u { let t = x; return t; } default { return x; } }", False),
        ("@diagnostic(off, t) { let y = x; } return x;", False),
        ("var s: S; return s.t;", False),
        ("let p: ptr<function, u32> = &x; return x; /* t */", False),
    ],
)
def test_a_local_is_known_from_its_statement_to_the_end_of_its_block(
    body: str, reaches: bool
) -> None:
    text = f"""
        @group(0) @binding(0) var<storage, read> t: array<u32>;
        struct S {{ t: u32 }}
        fn f(x: u32) -> u32 {{ {body} }}
    """
    assert ("t" in Module("text", text).reached("f")) == reaches


def test_names_beyond_ascii_and_all_ends_of_lines_are_read() -> None:
    text = "const क\u0940 = 2; // a\rconst b = 3; // c\u2028const d = 4;"
    assert list(declarations(text)) == ["क\u0940", "b", "d"]


def test_a_comment_that_is_not_closed_is_told_with_its_line() -> None:
    module = Module("text", "fn f(x: f32) -> f32 {\r\n return x; }\n/* /* */\nfn g() {}")
    with pytest.raises(UsageError) as caught:
        module.signature("f")
    assert str(caught.value) == "text: the comment that begins in line 3 is not closed"


def test_names_that_are_declared_anew_for_a_run_begin_as_no_other() -> None:
    assert Module("text", "fn f() {}").prefix == "halfstep_"
    text = "fn halfstep_call(x: f32) {} struct halfstep2_Row { x: f32 }"
    assert Module("text", text).prefix == "halfstep3_"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: m.signature("nothing"),
         "text: there is no function 'nothing'; there are helper, many, silent, odd, far, main"),
        (lambda m: m.signature("main"),
         "text: main is an entry point; `kernel` runs those"),
        (lambda m: m.signature("silent"),
         "text: silent returns nothing, so there is nothing to compare"),
        (lambda m: m.signature("odd"),
         "text: odd: parameter b: a texture_external is not supported"),
        (lambda m: m.signature("far"),
         "text: far: parameter a: a pointer into workgroup, which the rows of a function would "
         "share; `kernel` runs whole compute shaders"),
        (lambda m: m.check_entry_point("helper"),
         "text: helper has no @compute, so it is not an entry point"),
        (lambda m: m.variable("unknown"),
         "text: variable unknown: its declaration states no type"),
        (lambda m: m.variable("Point"),
         "text: there is no variable 'Point'; there are seed, unknown, shared_row, lens, out, "
         "table, picture"),
        (lambda m: m.struct("Real"),
         "text: there is no struct 'Real'; there are Point, Row"),
        (lambda m: m.binding("seed"),
         "text: variable seed has no @group and @binding"),
        (lambda m: m.binding("picture"),
         "text: variable picture: a texture_external is not supported"),
        (lambda _: Module("text", "var<private> a: array<f32, N>;").variable("a"),
         "text: variable a: N is not a constant that can be worked out here"),
        (lambda _: Module("text", "override N = 2u; var<private> a: array<f32, N>;").variable("a"),
         "text: variable a: N is not a constant that can be worked out here"),
        (lambda _: Module("text", "fn u32() {} var<private> a: u32;").variable("a"),
         "text: variable a: u32 is not a type that a buffer can hold"),
        (lambda _: Module("text", "struct S { @size(8) a: vec3<f32> }").struct("S"),
         "text: S.a: @size(8), and its type has 12 bytes"),
        (lambda _: Module("text", "struct S { @align(2) a: f32 }").struct("S"),
         "text: S.a: @align(2) is not a power of two from 4"),
        (lambda _: Module("text", "struct S { @align(12) a: f32 }").struct("S"),
         "text: S.a: @align(12) is not a power of two from 4"),
        (lambda _: Module("text", "@fragment fn fs() -> f32 {}").signature("fs"),
         "text: fs is the entry point of a fragment shader; `image` draws with those"),
        (lambda _: Module("text", "@vertex fn vs() {}").check_entry_point("vs"),
         "text: vs is the entry point of a vertex shader; `image` draws with those"),
        (lambda _: Module("text", "var<private> a: vec4<vec2<f32>>;").variable("a"),
         "text: variable a: vec2<f32> is not a scalar"),
        (lambda _: Module("text", "var<private> a: array<f32, 4 / 0>;").variable("a"),
         "text: variable a: 4 / 0 is not a constant that can be worked out here"),
        (lambda _: Module("text", "var<private> a: array<f32, 0>;").variable("a"),
         "text: variable a: an array has 0 elements"),
        (lambda _: Module("text", "var<private> a: array<f32, 4000000000>;").variable("a"),
         "text: variable a: NumPy has no such array: invalid shape in fixed-type tuple: dimension "
         "does not fit into a C int."),
        (lambda _: Module("text", f"var<private> a: {'array<' * 65}f32{', 1>' * 65};").variable(
            "a"), "text: variable a: NumPy has no such array: invalid shape in fixed-type tuple."),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(module: Module, call: object, message: str) -> None:
    assert callable(call)
    with pytest.raises(UsageError) as caught:
        call(module)
    assert str(caught.value) == message


@pytest.mark.parametrize("text", ["", "fn f(", "struct", "@", "var<", "}{", "fn f() -> {"])
def test_no_text_is_too_broken_to_look_for_a_function_in(text: str) -> None:
    with pytest.raises(UsageError, match="there is no function"):
        Module("text", text).signature("g")


def test_every_stage_file_is_read() -> None:
    for name in ("article", "certify", "piece", "root", "shade"):
        text = stage(name)
        found = declarations(text)
        assert {d.name for d in found.values() if d.kind == "fn"} == {
            line.split("(")[0].removeprefix("fn ")
            for line in text.splitlines()
            if "fn " in line[:3]
        }
