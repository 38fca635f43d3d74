"""Shaders begin as WGSL has it and see exactly what is bound; what cannot be run is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from halfstep.device.canary import fingerprint
from halfstep.errors import UsageError
from halfstep.testing import Kit, kit, unwritten
from halfstep.testing.kernel import kernel
from halfstep.testing.module import Module
from halfstep.testing.types import stride_of

# The types of memory, with what an invocation i finds in it and what it leaves there.
MEMORY = [
    ("atomic<u32>", "atomicLoad(&m)", "atomicStore(&m, 7u);"),
    ("array<atomic<i32>, 64>", "u32(atomicLoad(&m[i]))", "atomicStore(&m[i], 7);"),
    ("array<u32, 100>", "m[i] + m[i + 36u]", "m[i] = 7u; m[i + 36u] = 7u;"),
    ("array<array<atomic<u32>, 3>, N>", "atomicLoad(&m[i][2])", "atomicStore(&m[i][2], 7u);"),
    ("array<f32, COUNT * 2>", "u32(m[i + 64u])", "m[i + 64u] = 7.0;"),
    ("vec3<f32>", "u32(m.y)", "m = vec3(7.0);"),
    ("bool", "u32(m)", "m = true;"),
    ("array<mat2x3<f32>, 64>", "u32(m[i][1].z)", "m[i][1].z = 7.0;"),
    ("Part", "atomicLoad(&m.a) + m.b[i % 3u] + u32(m.c.x)",
     "atomicStore(&m.a, 7u); m.b[i % 3u] = 7u; m.c.x = true;"),
    ("array<Alias, 64>", "atomicLoad(&m[i].a) + m[i].b[2]",
     "atomicStore(&m[i].a, 7u); m[i].b[2] = 7u;"),
    ("Whole", "atomicLoad(&m.parts[i % 2u][i % 4u].a) + u32(m.d)",
     "atomicStore(&m.parts[i % 2u][i % 4u].a, 7u); m.d = 7.0;"),
]  # fmt: skip
TYPES = """
const N = 1u << 6u;
override COUNT = N;
struct Part { a: atomic<u32>, b: array<u32, 3>, c: vec2<bool> }
alias Alias = Part;
alias Parts = array<Alias, 4>;
struct Whole { parts: array<Parts, 2>, d: f32 }
struct In { @builtin(workgroup_id) w: vec3<u32>, @builtin(local_invocation_index) i: u32 }
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
"""
INDEX = "@builtin(local_invocation_index) i: u32"
PLACE = "@builtin(workgroup_id) w: vec3<u32>"
# Parameters of an entry point, and what begins it.
PARAMETERS = [
    (f"{INDEX}, {PLACE}", ""),
    (f"{PLACE}, // ,\n  @builtin(local_invocation_id) id: vec3<u32>, /* ) */\n", "let i = id.x;"),
    ("in: In", "let w = in.w; let i = in.i;"),
]
GROUPS = 64


def shader(type_: str, found: str, left: str, parameters: str, begin: str) -> str:
    return f"""{TYPES}
var<workgroup> m: {type_};
fn looked_at(i: u32) -> u32 {{ return {found}; }}
@compute @workgroup_size(COUNT / 2u, 2) fn main({parameters}) {{ {begin}
  let before = looked_at(i);
  workgroupBarrier();
  {left}
  out[w.x * COUNT + i] = before;
}}"""


@pytest.mark.parametrize(("parameters", "begin"), PARAMETERS)
@pytest.mark.parametrize(("type_", "found", "left"), MEMORY)
def test_workgroup_memory_begins_as_zeros(
    wgsl: Kit, type_: str, found: str, left: str, parameters: str, begin: str
) -> None:
    begin = begin.replace("id.x", "id.x + COUNT / 2u * id.y")
    given = {"out": unwritten(GROUPS * 64, np.uint32)}
    text = shader(type_, found, left, parameters, begin)
    for _ in range(2):
        out = wgsl.kernel(text, "main", given, workgroups=GROUPS)["out"]
        wgsl.compare(out, 0)


def test_it_would_not_without_the_kit(wgsl: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    if fingerprint(wgsl.device).workgroup_memory == "zero":
        pytest.skip("the driver clears workgroup memory")
    monkeypatch.setattr(kit, "clearing", lambda *_: [])
    given = {"out": unwritten(GROUPS * 64, np.uint32)}
    for case in MEMORY:
        text = shader(*case, *PARAMETERS[0])
        assert Kit(wgsl.device).kernel(text, "main", given, workgroups=GROUPS)["out"].any()


def test_a_shader_that_counts_on_zeros_counts_rightly(wgsl: Kit) -> None:
    text = """
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
var<workgroup> total: atomic<u32>;
fn unused(x: f32) -> f32 { return x; }
@compute @workgroup_size(16) fn main(@builtin(workgroup_id) w: vec3<u32>) {
  atomicAdd(&total, 1u);
  workgroupBarrier();
  out[w.x] = atomicLoad(&total);
}
@compute @workgroup_size(1) fn alone() { atomicAdd(&total, 1u); out[0] = atomicLoad(&total); }
"""
    given = {"out": np.zeros(8, np.uint32)}
    assert (wgsl.kernel(text, "main", given, workgroups=8)["out"] == 16).all()
    assert wgsl.kernel(text, "alone", given)["out"][0] == 1
    wgsl.check(text, "unused", lambda x: x, {"x": np.ones(3, np.float32)})


def test_of_a_shader_with_workgroup_memory_the_text_is_shown_as_it_is(wgsl: Kit) -> None:
    text = "var<workgroup> m: u32; @compute @workgroup_size(1) fn main() { m = 1.5; }"
    with pytest.raises(UsageError) as caught:
        wgsl.kernel(text, "main", {})
    message = str(caught.value)
    assert "WGSL:1:" in message
    assert text in message
    assert "halfstep" not in message


LENGTHS = """
enable f16;
struct Head { scale: vec4<f32>, data: array<f32> }
struct Small { count: u32, data: array<vec2<f32>> }
struct Halves { first: f16, data: array<f16> }
@group(0) @binding(0) var<storage, read_write> head: Head;
@group(0) @binding(1) var<storage, read_write> small: Small;
@group(0) @binding(2) var<storage, read_write> halves: Halves;
@group(0) @binding(3) var<storage, read_write> plain: array<f16>;
@group(0) @binding(4) var<storage, read_write> count: u32;
@compute @workgroup_size(1) fn of_head() {
  count = arrayLength(&head.data);
  for (var k = 0u; k < count; k++) { head.data[k] += f32(k); }
}
@compute @workgroup_size(1) fn of_small() { count = arrayLength(&small.data); }
@compute @workgroup_size(1) fn of_halves() {
  count = arrayLength(&halves.data);
  for (var k = 0u; k < count; k++) { halves.data[k] += halves.first; }
}
@compute @workgroup_size(1) fn of_plain() { count = arrayLength(&plain); }
"""


@pytest.mark.needs("f16")
@pytest.mark.parametrize("count", [4, 5, 6, 7, 8, 100])
def test_an_array_without_a_count_has_as_many_elements_as_it_is_given(
    wgsl: Kit, count: int
) -> None:
    data = np.arange(count, dtype=np.float32)
    head = {"scale": np.zeros(4, np.float32), "data": data}
    found = wgsl.kernel(LENGTHS, "of_head", {"head": head, "count": 0})
    wgsl.compare(found, {"head": head | {"data": 2 * data}, "count": count})
    small = {"count": 0, "data": np.zeros((count, 2), np.float32)}
    assert wgsl.kernel(LENGTHS, "of_small", {"small": small, "count": 0})["count"] == count
    if count % 2:
        halves = {"first": np.float16(2), "data": data.astype(np.float16)}
        found = wgsl.kernel(LENGTHS, "of_halves", {"halves": halves, "count": 0})
        wgsl.compare(found, {"halves": halves | {"data": data + 2}, "count": count})
    else:
        plain = {"plain": data.astype(np.float16), "count": 0}
        assert wgsl.kernel(LENGTHS, "of_plain", plain)["count"] == count


@pytest.mark.needs("f16")
@pytest.mark.parametrize(
    ("entry_point", "bindings", "message"),
    [
        ("of_head", {"head": {"scale": np.zeros(4, np.float32), "data": np.zeros(3, np.float32)}},
         "bindings: head.data: 3 elements make 28 bytes, and WebGPU binds a multiple of 4, here "
         "32 or more"),
        ("of_halves", {"halves": {"first": np.float16(0), "data": np.zeros(4, np.float16)}},
         "bindings: halves.data: 4 elements make 10 bytes, and WebGPU binds a multiple of 4, here "
         "4 or more"),
        ("of_plain", {"plain": np.zeros(3, np.float16)},
         "bindings: plain: 3 elements make 6 bytes, and WebGPU binds a multiple of 4, here 4 or "
         "more"),
    ],
)  # fmt: skip
def test_what_cannot_be_bound_exactly_is_refused(
    wgsl: Kit, entry_point: str, bindings: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.kernel(LENGTHS, entry_point, bindings | {"count": 0})
    assert str(caught.value) == message


@pytest.mark.needs("f16")
def test_a_function_is_called_once_for_each_row(wgsl: Kit) -> None:
    text = """
enable f16;
@group(0) @binding(0) var<storage, read_write> calls: atomic<u32>;
fn f(x: f16) -> u32 { return atomicAdd(&calls, 1u); }
"""
    for rows in (1, 2, 3, 65):
        x = np.zeros(rows, np.float16)
        found = wgsl.run(text, "f", {"x": x}, bindings={"calls": 0})
        assert sorted(found.tolist()) == list(range(rows))
    # A buffer has a multiple of 4 bytes, all of which are rows.
    assert stride_of(kernel(Module("text", text), "f", []).row) % 4 == 0


COUNT = """
@group(0) @binding(0) var<storage, read_write> d: array<u32>;
@compute @workgroup_size(1) fn main(
  @builtin(workgroup_id) w: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>
) { d[w.x + n.x * (w.y + n.y * w.z)] += 1u; }
"""


class Whole:
    """A whole number of one's own."""

    def __index__(self) -> int:
        return 3


@pytest.mark.parametrize(
    ("workgroups", "count"),
    [
        (0, 0),
        ((3, 0), 0),
        (3, 3),
        (np.int64(3), 3),
        (np.array(3), 3),
        (Whole(), 3),
        ((np.uint8(2), 3), 6),
        ([2, 3, 2], 12),
        (np.array([2, 3]), 6),
    ],
)
def test_workgroups_are_any_whole_numbers(wgsl: Kit, workgroups: Any, count: int) -> None:
    found = wgsl.kernel(COUNT, "main", {"d": np.zeros(16, np.uint32)}, workgroups=workgroups)
    assert found["d"].tolist() == [1] * count + [0] * (16 - count)


@pytest.mark.parametrize(
    "workgroups",
    [4.0, (4.0, 1), (2, 1.5), "4", None, True, -1, 65536, 2**70, (), (1, 1, 1, 1), {"x": 1}, [[1]]],
)
def test_workgroups_that_are_none_are_named(wgsl: Kit, workgroups: Any) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.kernel(COUNT, "main", {"d": np.zeros(16, np.uint32)}, workgroups=workgroups)
    assert str(caught.value) == (
        f"workgroups: {workgroups!r} is not 1 to 3 whole numbers of 0 to 65535"
    )


BESIDE = """
@group(0) @binding(0) var image: texture_2d<f32>;
@group(0) @binding(1) var smooth_: sampler;
@group(0) @binding(1) var<storage, read_write> d: array<f32>;
@group(0) @binding(0) var<storage, read> e: array<f32>;
override GAIN: f32;
override TWICE = 2.0 * GAIN;
override LIFT = 3.0;
@id(7) override SIZE: u32;
var<workgroup> together: array<f32, SIZE>;
fn twice(x: f32) -> f32 { return x + x; }
fn image_(image: f32) -> f32 { let smooth_ = image; return smooth_ + LIFT; }
fn looked_up(x: f32) -> f32 { return e[0] * x; }
fn loud(x: f32) -> f32 { return x * TWICE; }
fn coloured(x: f32) -> f32 { return textureLoad(image, vec2<u32>(), 0).x * x; }
@compute @workgroup_size(1) fn plain() { d[0] = twice(d[0]) + LIFT; }
@compute @workgroup_size(1) fn sized() { d[0] = f32(textureDimensions(image).x); }
@compute @workgroup_size(SIZE) fn wide() { d[0] = 1.0; }
@fragment fn fs(@location(0) at: vec2<f32>) -> @location(0) vec4<f32> {
  return textureSample(image, smooth_, at);
}
@vertex fn vs() -> @builtin(position) vec4<f32> { return vec4<f32>(); }
"""
X = np.arange(5, dtype=np.float32)


def test_what_a_function_does_not_use_does_not_matter(wgsl: Kit) -> None:
    wgsl.check(BESIDE, "twice", lambda x: x + x, {"x": X})
    wgsl.check(BESIDE, "image_", lambda x: x + 3, {"image": X})
    wgsl.check(BESIDE, "looked_up", lambda x: 2 * x, {"x": X}, bindings={"e": [2]})
    assert wgsl.kernel(BESIDE, "plain", {"d": X + 1})["d"][0] == 5


TOGETHER = (
    "in which invocations take part together; a function is run for each row alone, and `kernel` "
    "runs whole compute shaders"
)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.run(BESIDE, "coloured", {"x": X}),
         "coloured uses image, which bindings do not give"),
        (lambda k: k.kernel(BESIDE, "sized", {"d": X}),
         "sized uses image, which bindings do not give"),
        (lambda k: k.kernel(BESIDE, "sized", {"image": X}),
         "sized uses d, which bindings do not give"),
        (lambda k: k.run(BESIDE, "loud", {"x": X}),
         "loud uses the override GAIN, which has no value"),
        (lambda k: k.kernel(BESIDE, "wide", {"d": X}),
         "wide uses the override SIZE, which has no value"),
        (lambda k: k.run(BESIDE, "fs", {"at": X}),
         "fs is the entry point of a fragment shader; `image` draws with those"),
        (lambda k: k.kernel(BESIDE, "vs", {}),
         "vs is the entry point of a vertex shader; `image` draws with those"),
        (lambda k: k.run("var<workgroup> m: f32; fn f(x: f32) -> f32 { m = x; return m; }",
                         "f", {"x": X}),
         f"f uses m, {TOGETHER}"),
        (lambda k: k.run("fn g() { storageBarrier(); } fn f(x: f32) -> f32 { g(); return x; }",
                         "f", {"x": X}),
         f"f uses storageBarrier, {TOGETHER}"),
        (lambda k: k.run("fn f(x: f32) -> f32 { workgroupBarrier(); return x; }", "f", {"x": X}),
         f"f uses workgroupBarrier, {TOGETHER}"),
        (lambda k: k.run("fn f(x: f32) -> f32 { return fwidthFine(x); }", "f", {"x": X}),
         f"f uses fwidthFine, {TOGETHER}"),
        (lambda k: k.run("fn f(x: f32) -> f32 { return dpdx(x); }", "f", {"x": X}),
         f"f uses dpdx, {TOGETHER}"),
        (lambda k: k.run("fn arrayLength(x: f32) -> f32 { return x; }", "arrayLength", {"x": X}),
         "it declares arrayLength, and what runs it needs the arrayLength of WGSL"),
        (lambda k: k.run("alias u32 = f32; fn f(x: u32) -> u32 { return x; }", "f", {"x": X}),
         "it declares u32, and what runs it needs the u32 of WGSL"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_said_before_anything_runs(
    wgsl: Kit, call: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == f"WGSL: {message}"
    assert not ran


def test_subgroups_are_for_whole_shaders(wgsl: Kit) -> None:
    if "subgroup" not in wgsl.device.features:
        pytest.skip("the device has no subgroups")
    for call in ("subgroupAdd(x)", "quadSwapX(x)", "subgroupBroadcastFirst(x)"):
        with pytest.raises(UsageError) as caught:
            wgsl.run(f"fn f(x: f32) -> f32 {{ return {call}; }}", "f", {"x": X})
        assert str(caught.value) == f"WGSL: f uses {call[:-3]}, {TOGETHER}"


def test_an_override_with_a_value_has_it(wgsl: Kit) -> None:
    text = """
override GAIN: f32 = 2.0;
override WIDTH = 64u;
var<workgroup> w: array<f32, WIDTH>;
@group(0) @binding(0) var<storage, read_write> d: array<f32>;
@compute @workgroup_size(WIDTH) fn main(@builtin(local_invocation_index) i: u32) {
  w[i] = d[i] * GAIN;
  workgroupBarrier();
  d[i] = w[WIDTH - 1u - i];
}
fn loud(x: f32) -> f32 { return x * GAIN; }
"""
    d = np.arange(64, dtype=np.float32)
    wgsl.compare(wgsl.kernel(text, "main", {"d": d})["d"], 2 * d[::-1])
    wgsl.check(text, "loud", lambda x: 2 * x, {"x": d})
