"""What a text declares and what a run declares do not get in each other's way, nor do locals."""

from __future__ import annotations

import numpy as np
import pytest

from halfstep.testing import Kit

X = np.arange(1, 6, dtype=np.float32)


@pytest.mark.parametrize(
    "text",
    [
        "@group(0) @binding(0) var<storage, read> t: array<f32>;\n"
        "fn f(x: f32) -> f32 { let t = x * 2.0; return t; }",
        "@group(0) @binding(0) var<storage, read> t: array<f32>;\n"
        "fn f(t: f32) -> f32 { return t * 2.0; }",
        "@group(0) @binding(0) var t: sampler;\nfn f(x: f32) -> f32 { let t = x; return t * 2.0; }",
        "const t = 5.0;\nfn f(x: f32) -> f32 { const t = 2.0; return t * x; }",
        "struct t { a: f32 }\nfn f(x: f32) -> f32 { let t = 2.0; return t * x; }",
        "fn t(a: f32) -> f32 { workgroupBarrier(); return a; }\n"
        "fn f(x: f32) -> f32 { let t = 2.0; return t * x; }",
        "struct x { x: f32 }\nfn f(x: x) -> x { var y = x; y.x *= 2.0; return y; }",
        "override t: f32;\nfn f(x: f32) -> f32 { for (var t = 0; t < 1; t++) { } return x * 2.0; }",
        "var<workgroup> t: f32;\nstruct S { t: f32 }\n"
        "fn f(x: f32) -> f32 { let s = S(x); return s.t * 2.0; }",
    ],
)
def test_a_local_hides_what_the_module_declares(wgsl: Kit, text: str) -> None:
    given = {"x": X} if "(x" in text else {"t": X}
    if "struct x" in text:
        found = wgsl.run(text, "f", {"x": {"x": X}})["x"]
    else:
        found = wgsl.run(text, "f", given)
    wgsl.compare(found, 2 * X)


def test_a_local_hides_a_constant_of_its_own_type(wgsl: Kit) -> None:
    text = "const N = 4u;\nfn f(N: array<f32, N>) -> f32 { let M = 1u; return N[M]; }"
    a = np.arange(12, dtype=np.float32).reshape(3, 4)
    wgsl.check(text, "f", lambda a: a[:, 1], {"N": a})


@pytest.mark.parametrize("name", ["select", "bitcast", "any", "min", "atomicStore", "all"])
def test_a_function_may_have_the_name_of_one_of_wgsl(wgsl: Kit, name: str) -> None:
    text = f"""
struct Hit {{ hit: bool, far: array<bool, 2>, sides: vec2<bool> }}
var<workgroup> unused: u32;
fn {name}(a: f32, b: f32) -> f32 {{ return a - b; }}
fn f(x: f32, old: Hit) -> Hit {{
  return Hit({name}(x, 2.0) > 0.0, array<bool, 2>(old.hit, x > 1.0), old.sides);
}}"""
    sides = np.array([[True, False]] * 5)
    old = {"hit": X > 3, "far": sides, "sides": sides}
    wgsl.check(
        text,
        "f",
        lambda x, old: (x > 2, np.stack([old["hit"], x > 1], axis=1), old["sides"]),
        {"x": X, "old": old},
    )
    wgsl.check(text, name, lambda a, b: a - b, {"a": X, "b": 2 * X})


@pytest.mark.parametrize("word", ["value", "result", "source", "ix", "rows", "halfstep_value"])
def test_any_name_may_be_used(wgsl: Kit, word: str) -> None:
    text = f"""
struct {word} {{ {word}: array<bool, 2> }}
fn halfstep_call({word}: f32) -> array<{word}_s, 2> {{
  let hit = array<bool, 2>({word} > 2.0, {word} > 3.0);
  return array<{word}_s, 2>(halfstep_rows(hit), halfstep_rows(hit));
}}
alias {word}_s = {word};
const halfstep_ix = 1;
fn halfstep_rows(hit: array<bool, 2>) -> {word}_s {{ return {word}_s(hit); }}
var<private> halfstep_Row: f32;
"""
    expected = np.repeat(np.stack([X > 2, X > 3], axis=1)[:, None], 2, axis=1)
    found = wgsl.run(text, "halfstep_call", {word: X})
    wgsl.compare(found[word], expected)


def test_types_whose_names_look_alike_are_told_apart(wgsl: Kit) -> None:
    text = """
alias B = array<bool, 2>;
struct array_bool_2_ { a: bool, b: u32 }
struct S { a: B, b: array<bool, 2>, c: array_bool_2_ }
fn f(s: S) -> S { return S(s.b, s.a, array_bool_2_(!s.c.a, s.c.b + 1u)); }
"""
    yes, no = np.array([[True, False]] * 3), np.array([[False, True]] * 3)
    given = {"a": yes, "b": no, "c": {"a": yes[:, 0], "b": np.arange(3, dtype=np.uint32)}}
    wgsl.check(
        text,
        "f",
        lambda s: (s["b"], s["a"], (~s["c"]["a"], s["c"]["b"] + np.uint32(1))),
        {"s": given},
    )
