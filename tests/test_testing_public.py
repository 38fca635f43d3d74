"""Functions with the constructs of public WGSL, tested as their projects would test them.

Every test names a project and a file where its construct was seen. The code and the references are
our own.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.testing import Kit, MismatchError, decades, near_ties

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]


def test_a_generator_in_a_private_struct(wgsl: Kit, rng: np.random.Generator) -> None:
    # alex-adler/alex-adler.github.io, ray/src/rng.wgsl: the state of a generator is private.
    text = """
struct Generator { word: u32, calls: u32 }
var<private> generator: Generator;
fn stir() -> u32 {
  generator.word ^= generator.word << 7u;
  generator.word ^= generator.word >> 9u;
  generator.word ^= generator.word << 8u;
  generator.calls++;
  return generator.word;
}
fn unit() -> f32 { return bitcast<f32>(0x3f800000u | (stir() >> 9u)) - 1.0; }
"""

    def unit(generator: Any) -> dict[str, Any]:
        word = generator["word"].astype(np.uint64)
        word = (word ^ word << np.uint64(7)) & np.uint64(0xFFFFFFFF)
        word ^= word >> np.uint64(9)
        word = (word ^ word << np.uint64(8)) & np.uint64(0xFFFFFFFF)
        result = (word >> np.uint64(9)) / 2.0**23
        return {
            "result": result,
            "generator": {"word": word.astype(np.uint32), "calls": generator["calls"] + 1},
        }

    given = {
        "word": rng.integers(1, 2**32, 500, np.uint32),
        "calls": np.arange(500, dtype=np.uint32),
    }
    returns = ("result", "generator")
    wgsl.check(text, "unit", unit, {"generator": given}, returns=returns)
    with pytest.raises(MismatchError):
        wgsl.check(
            text.replace(">> 9u;\n", ">> 10u;\n"),
            "unit",
            unit,
            {"generator": given},
            returns=returns,
        )


def test_a_hash_of_a_vector_through_a_helper(wgsl: Kit, rng: np.random.Generator) -> None:
    # mighdoll/wgsl-linker-rand-example, src/util.wgsl: vectors of u32 that wrap, mixed by a helper.
    text = """
fn crossed(v: vec3<u32>) -> vec3<u32> { return v + v.yzx * v.zxy; }
fn hashed(cell: vec3<u32>) -> vec3<u32> {
  var v = cell * 2246822519u + 3266489917u;
  v = crossed(v) ^ (v >> vec3<u32>(13u));
  return crossed(v);
}"""

    def crossed(v: U32) -> U32:
        return v + v[:, [1, 2, 0]] * v[:, [2, 0, 1]]

    def hashed(cell: U32) -> U32:
        v = cell * np.uint32(2246822519) + np.uint32(3266489917)
        return crossed(crossed(v) ^ (v >> np.uint32(13)))

    wgsl.check(text, "hashed", hashed, {"cell": rng.integers(0, 2**32, (500, 3), np.uint32)})


def test_products_of_constants_in_a_private_vector(wgsl: Kit) -> None:
    # webgpu/webgpu-samples, sample/cornell/common.wgsl: constants of products, a private vector.
    text = """
var<private> state: vec3u;
fn begin(id: vec3u, frame: vec3u) {
  const SPREAD = vec3(911 * 1013, 523 * 769 * 3, 331 * 467 * 7 * 2);
  state = (id * SPREAD) ^ frame;
}"""
    id_ = np.stack([np.arange(64), np.arange(64) * 3, np.arange(64) * 5], 1).astype(np.uint32)
    spread = np.array([911 * 1013, 523 * 769 * 3, 331 * 467 * 7 * 2], np.uint32)
    wgsl.check(
        text, "begin", lambda i, f: {"state": (i * spread) ^ f},
        {"id": id_, "frame": [7, 8, 9]}, returns=("state",),
    )  # fmt: skip


def test_the_nearest_of_a_runtime_array(wgsl: Kit, rng: np.random.Generator) -> None:
    # webgpu/webgpu-samples, sample/cornell/common.wgsl: structs go in and out, chosen by select.
    text = """
struct Wall { plane: vec4f, tint: vec3f, glow: f32 }
struct Ray { start: vec3f, dir: vec3f }
struct Hit { far: f32, wall: u32, at: vec3f }
@group(0) @binding(1) var<storage> walls: array<Wall>;
fn nearer(ray: Ray, wall: u32, best: Hit) -> Hit {
  let plane = walls[wall].plane;
  let far = -dot(plane, vec4(ray.start, 1)) / dot(plane.xyz, ray.dir);
  let hit = far > 0 && far < best.far;
  return Hit(
    select(best.far, far, hit),
    select(best.wall, wall, hit),
    select(best.at, ray.start + ray.dir * far, hit),
  );
}
fn reach(ray: Ray) -> Hit {
  var best = Hit();
  best.far = 1e20;
  best.wall = 0xffffffff;
  for (var k = 0u; k < arrayLength(&walls); k++) { best = nearer(ray, k, best); }
  return best;
}"""
    walls = np.zeros(6, wgsl.struct(text, "Wall"))
    for k in range(6):
        walls["plane"][k] = [*((1 - 2 * (k % 2)) * np.eye(3)[k // 2]), 1 + k / 10]
    start = rng.uniform(-0.5, 0.5, (400, 3)).astype(np.float32)
    toward = rng.normal(size=(400, 3)).astype(np.float32)

    def reach(ray: Any) -> Any:
        plane = walls["plane"].astype(np.float64)
        with np.errstate(divide="ignore"):
            far = -(ray["start"] @ plane[:, :3].T + plane[:, 3]) / (ray["dir"] @ plane[:, :3].T)
        far = np.where(far > 0, far, np.inf)
        wall = far.argmin(1)
        best = far.min(1)
        return {"far": best, "wall": wall.astype(np.uint32),
                "at": ray["start"] + ray["dir"] * best[:, None]}  # fmt: skip

    given = {"ray": {"start": start, "dir": toward}}
    wgsl.check(
        text, "reach", reach, given, bindings={"walls": walls}, float64=True, rtol=1e-5, atol=1e-5
    )
    with pytest.raises(MismatchError) as caught:
        wgsl.check(
            text.replace("k = 0u", "k = 1u"), "reach", reach, given,
            bindings={"walls": walls}, float64=True, rtol=1e-5, atol=1e-5,
        )  # fmt: skip
    assert caught.value.census.members["wall"] > 40


def test_a_curve_of_two_pieces_by_select(wgsl: Kit, rng: np.random.Generator) -> None:
    # zachbateman/bevy_egui, src/render/egui.wgsl: both pieces are computed, a mask chooses.
    text = """
fn decoded(levels: vec3<f32>) -> vec3<f32> {
  let is_low = levels < vec3<f32>(0.04045);
  let low = levels / 12.92;
  let high = pow((levels + 0.055) / 1.055, vec3<f32>(2.4));
  return select(high, low, is_low);
}"""

    def decoded(levels: F64) -> F64:
        return np.where(levels < 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)

    levels = rng.random((1000, 3), np.float32)
    wgsl.check(text, "decoded", decoded, {"levels": levels}, float64=True, rtol=2e-5)


def test_a_curve_of_two_pieces_by_mix_and_ceil(wgsl: Kit, rng: np.random.Generator) -> None:
    # pudnax/pilka, pilka_wgpu/src/renderer/blit.wgsl: ceil of a difference chooses the piece.
    text = """
fn encoded(light: vec4<f32>) -> vec4<f32> {
  let which = ceil(light.rgb - 0.0031308);
  let low = light.rgb * 12.92;
  let high = 1.055 * pow(light.rgb, vec3<f32>(0.4166667)) - 0.055;
  return vec4<f32>(mix(low, high, which), light.a);
}"""

    def encoded(light: F64) -> F64:
        rgb = light[:, :3]
        high = 1.055 * rgb**0.4166667 - 0.055
        return np.concatenate([np.where(rgb > 0.0031308, high, 12.92 * rgb), light[:, 3:]], 1)

    light = rng.random((1000, 4), np.float32) ** 4
    wgsl.check(text, "encoded", encoded, {"light": light}, float64=True, atol=2e-6, rtol=2e-6)


def test_a_uniform_number_alone(wgsl: Kit, rng: np.random.Generator) -> None:
    # williamhCode/neogurt, res/shaders/rect.wgsl: a uniform that is one f32.
    text = """
@group(1) @binding(0) var<uniform> exponent: f32;
fn bent(c: vec4f) -> vec4f {
  return vec4f(pow(c.r, exponent), pow(c.g, exponent), pow(c.b, exponent), c.a);
}"""
    c = rng.random((500, 4), np.float32)
    for exponent in (1.8, 2.2):
        wgsl.check(
            text, "bent", lambda c, e=exponent: np.concatenate([c[:, :3] ** e, c[:, 3:]], 1),
            {"c": c}, bindings={"exponent": exponent}, float64=True, rtol=1e-5, atol=1e-7,
        )  # fmt: skip


def test_a_distance_whose_radius_depends_on_the_quadrant(wgsl: Kit) -> None:
    # MrVintage710/bevy-saiko-ui, src/render/saiko.wgsl: components are chosen by signs.
    text = """
fn edge(p: vec2<f32>, half_size: vec2<f32>, radii: vec4<f32>) -> f32 {
  let side = select(radii.zw, radii.xy, p.x > 0.0);
  let r = select(side.y, side.x, p.y > 0.0);
  let q = abs(p) - half_size + r;
  return min(max(q.x, q.y), 0.0) + length(max(q, vec2<f32>(0.0))) - r;
}"""

    def edge(p: F64, half: F64, radii: F64) -> F64:
        side = np.where(p[..., 0] > 0, 0, 2) + np.where(p[..., 1] > 0, 0, 1)
        r = np.take_along_axis(radii, side[..., None], -1)[..., 0]
        q = np.abs(p) - half + r[..., None]
        return np.minimum(q.max(-1), 0) + np.hypot(*np.maximum(q, 0).T).T - r

    # The points of a picture.
    p = np.stack(np.meshgrid(np.linspace(-3, 3, 41), np.linspace(-2, 2, 31)), -1).astype(np.float32)
    given = {"p": p, "half_size": [2.0, 1.5], "radii": [0.1, 0.4, 0.7, 1.0]}
    census = wgsl.check(text, "edge", edge, given, float64=True, atol=1e-6)
    assert census.rows == 41 * 31
    with pytest.raises(MismatchError) as caught:
        wgsl.check(
            text.replace("p.y > 0.0", "p.y < 0.0"), "edge", edge, given, float64=True, atol=1e-6
        )
    assert len(caught.value.census.lead) == 2


def test_two_answers_through_pointers_and_none_returned(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    # playcanvas/engine, src/scene/shader-lib/wgsl/chunks/gsplat/vert/gsplatHelpers.js: a function
    # that returns nothing changes two vectors of its caller.
    text = """
fn spin(a: ptr<function, vec3f>, b: ptr<function, vec3f>, angle: f32) {
  let c = cos(angle);
  let s = sin(angle);
  let before = *a;
  *a = before * c + *b * s;
  *b = *b * c - before * s;
}"""

    def spin(a: F64, b: F64, angle: F64) -> tuple[F64, F64]:
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        return a * c + b * s, b * c - a * s

    a, b = rng.normal(size=(2, 300, 3)).astype(np.float32)
    given = {"a": a, "b": b, "angle": rng.uniform(-3, 3, 300).astype(np.float32)}
    # WGSL lets sine and cosine be off by 2^-11.
    options: dict[str, Any] = {"returns": ("a", "b"), "float64": True, "atol": 8 * 2.0**-11}
    wgsl.check(text, "spin", spin, given, **options)
    with pytest.raises(MismatchError) as caught:
        wgsl.check(text.replace("- before", "- *a"), "spin", spin, given, **options)
    assert list(caught.value.census.members) == ["b"]


def test_a_walk_with_a_stack_and_an_answer_through_a_pointer(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    # alanjian85/prisma, shaders/scene/scene.wgsl: a tree in storage, an array as stack.
    text = """
struct Node { low: f32, high: f32, right: u32, leaf: u32 }
struct Found { leaf: u32, visited: u32 }
@group(1) @binding(2) var<storage, read> nodes: array<Node>;
fn find(x: f32, found: ptr<function, Found>) -> bool {
  var stack = array<u32, 16>();
  var top = 1u;
  var node = 0u;
  var is_found = false;
  loop {
    (*found).visited++;
    if nodes[node].right == 0 || x < nodes[node].low || x >= nodes[node].high {
      if nodes[node].right == 0 && x >= nodes[node].low && x < nodes[node].high {
        (*found).leaf = nodes[node].leaf;
        is_found = true;
      }
      top--;
      node = stack[top];
    } else {
      stack[top] = nodes[node].right;
      top++;
      node++;
    }
    if node == 0 { break; }
  }
  return is_found;
}"""
    ends = np.sort(rng.uniform(0, 10, 9)).astype(np.float32)
    nodes: list[tuple[float, float, int, int]] = []

    def plant(first: int, last: int) -> None:
        place = len(nodes)
        nodes.append((ends[first], ends[last], 0, first))
        if last - first > 1:
            middle = (first + last) // 2
            plant(first, middle)
            nodes[place] = (ends[first], ends[last], len(nodes), 0)
            plant(middle, last)

    plant(0, 8)
    table = np.array(nodes, wgsl.struct(text, "Node"))

    x = np.append(near_ties(rng, rng.choice(ends, 200)), rng.uniform(-1, 11, 200))
    given = {"x": x.astype(np.float32), "found": (99, 0)}
    found = wgsl.run(text, "find", given, bindings={"nodes": table}, returns=("result", "found"))
    leaf = np.searchsorted(ends, x.astype(np.float32), side="right") - 1
    inside = (leaf >= 0) & (leaf < 8)
    assert 50 < inside.sum() < 390
    wgsl.compare(found["result"], inside, inputs={"x": x.astype(np.float32)})
    wgsl.compare(found["found"]["leaf"], np.where(inside, leaf, 99))
    # Where nothing is found the walk ends at the root; else it is at most as long as the tree.
    visited = found["found"]["visited"]
    assert ((visited == 1) == ~inside).all()
    assert visited.max() <= len(nodes)


def test_structs_within_structs_with_matrices(wgsl: Kit, rng: np.random.Generator) -> None:
    # DGriffin91/bevy_mod_bvh, assets/trace_gpu_types.wgsl: a vec3 before a number, nested structs.
    text = """
struct Span { start: i32, count: i32 }
struct Copy_ { turn: mat4x4<f32>, normal: vec3<f32>, sort: i32, span: Span }
@group(0) @binding(0) var<storage, read> copies: array<Copy_>;
fn placed(k: u32, p: vec3<f32>) -> vec4<f32> {
  let one = copies[k];
  let at = one.turn * vec4<f32>(p, 1.0);
  return vec4<f32>(at.xyz + one.normal * f32(one.sort), f32(one.span.start + one.span.count));
}"""
    copies = np.zeros(7, wgsl.struct(text, "Copy_"))
    copies["turn"] = rng.normal(size=(7, 4, 4))
    copies["normal"] = rng.normal(size=(7, 3))
    copies["sort"] = rng.integers(-3, 4, 7)
    copies["span"]["start"], copies["span"]["count"] = rng.integers(-9, 9, (2, 7))

    def placed(k: U32, p: F64) -> F64:
        one = copies[k]
        at = (one["turn"].astype(np.float64) @ np.insert(p, 3, 1, 1)[:, :, None])[:, :3, 0]
        at = at + one["normal"] * one["sort"][:, None]
        return np.insert(at, 3, one["span"]["start"] + one["span"]["count"], 1)

    given = {"k": rng.integers(0, 7, 200, np.uint32), "p": rng.normal(size=(200, 3)).astype("f4")}
    wgsl.check(text, "placed", placed, given, bindings={"copies": copies}, float64=True, atol=1e-5)


def test_fields_of_bits_that_are_summed(wgsl: Kit, rng: np.random.Generator) -> None:
    # linebender/vello, shader/shared/drawtag.wgsl: a tag holds small counts, which are added.
    text = """
const EMPTY = 0u;
struct Sums { paths: u32, clips: u32, words: u32 }
fn sums_of(tag: u32) -> Sums {
  var s: Sums;
  s.paths = u32(tag != EMPTY);
  s.clips = tag & 1u;
  s.words = extractBits(tag, 2u, 3u);
  return s;
}
fn added(a: Sums, b: Sums) -> Sums {
  return Sums(a.paths + b.paths, a.clips + b.clips, a.words + b.words);
}
fn of_two(tag: u32, before: Sums) -> Sums { return added(before, sums_of(tag)); }
"""

    def of_two(tag: U32, before: Any) -> tuple[Any, Any, Any]:
        return (
            before["paths"] + (tag != 0),
            before["clips"] + tag % 2,
            before["words"] + tag // 4 % 8,
        )

    tag = rng.integers(0, 64, 400, np.uint32)
    before = {name: rng.integers(0, 99, 400, np.uint32) for name in ("paths", "clips", "words")}
    wgsl.check(text, "of_two", of_two, {"tag": tag, "before": before})


def test_halves_unpacked_by_hand(wgsl: Kit) -> None:
    # OpenAgentsInc/openagents, crates/web/client/src/shaders/q8_0_dequant.wgsl: 16-bit floats from
    # the bits of words, where a device has none.
    text = """
fn half_value(bits: u32) -> f32 {
  let power = extractBits(bits, 10u, 5u);
  let part = f32(bits & 0x3ffu);
  let sign = select(1.0, -1.0, (bits & 0x8000u) != 0u);
  if power == 0u { return sign * part * exp2(-24.0); }
  return sign * (1024.0 + part) * exp2(f32(power) - 25.0);
}"""
    bits = np.arange(1 << 16, dtype=np.uint32)
    values = bits.astype(np.uint16).view(np.float16).astype(np.float32)
    finite = np.isfinite(values)
    census = wgsl.check(text, "half_value", lambda _: values[finite], {"bits": bits[finite]})
    assert census.rows == (1 << 16) - (1 << 11)


def test_floats_packed_in_words(wgsl: Kit, rng: np.random.Generator) -> None:
    # cryscan/web-rwkv, src/shaders/quant_vec_fp16.wgsl: four numbers in two words of halves.
    text = """
fn packed(x: vec4<f32>) -> vec2<u32> {
  return vec2<u32>(pack2x16float(x.xy), pack2x16float(x.zw));
}"""
    x = decades(rng, (500, 4), low=1e-3, high=1e4)

    def off(x: F32) -> F64:
        """How far the four are from the middle between two halves, of which either may be taken."""
        below = x.astype(np.float16).astype(np.float64)
        step = np.abs(np.spacing(x.astype(np.float16))).astype(np.float64)
        return (np.abs(np.abs(x - below) / step - 0.5) / 1e-4).min(axis=1)

    census = wgsl.check(
        text, "packed", lambda x: x.astype(np.float16).view(np.uint32), {"x": x}, margin=off
    )
    assert census.ambiguous < 20


def test_sums_of_vectors_with_fma(wgsl: Kit, rng: np.random.Generator) -> None:
    # huggingface/ratchet, crates/ratchet-core/kernel-templates/norm.wgsl: fma over vec4, then dot.
    text = """
alias Row = array<vec4<f32>, 8>;
fn spread_of(row: Row) -> vec2<f32> {
  var row_ = row;
  var sum = vec4<f32>();
  for (var k = 0; k < 8; k++) { sum += row_[k]; }
  let mean = dot(sum, vec4<f32>(1.0)) / 32.0;
  var squares = vec4<f32>();
  for (var k = 0; k < 8; k++) {
    let off = row_[k] - mean;
    squares = fma(off, off, squares);
  }
  return vec2<f32>(mean, dot(squares, vec4<f32>(1.0)) / 32.0);
}"""
    row = rng.normal(size=(300, 8, 4)).astype(np.float32)

    def spread_of(row: F64) -> F64:
        flat = row.reshape(len(row), -1)
        return np.stack([flat.mean(1), flat.var(1)], 1)

    wgsl.check(text, "spread_of", spread_of, {"row": row}, float64=True, rtol=1e-5, atol=1e-6)


def test_a_template_that_a_preprocessor_fills(wgsl: Kit, rng: np.random.Generator) -> None:
    # webonnx/wonnx, templates/endomorphism/softmax.wgsl: counts are filled in by a template engine.
    template = """
fn weights(x: array<f32, {{ count }}>) -> array<f32, {{ count }}> {
  var e = x;
  var most = e[0];
  for (var k = 1u; k < {{ count }}u; k++) { most = max(most, e[k]); }
  var sum = 0.0;
  for (var k = 0u; k < {{ count }}u; k++) { e[k] = exp(e[k] - most); sum += e[k]; }
  for (var k = 0u; k < {{ count }}u; k++) { e[k] /= sum; }
  return e;
}"""

    def weights(x: F64) -> F64:
        e = np.exp(x - x.max(1, keepdims=True))
        return e / e.sum(1, keepdims=True)

    for count in (3, 7):

        def filled(text: str, count: int = count) -> str:
            return text.replace("{{ count }}", str(count))

        wgsl.check(
            template, "weights", weights, {"x": rng.normal(size=(200, count)).astype(np.float32)},
            preprocess=filled, float64=True, rtol=1e-5,
        )  # fmt: skip


def test_files_that_import_others(wgsl: Kit, tmp_path: Path) -> None:
    # Azkellas/rust_wgpu_hot_reload, shaders/demo_raymarching/draw.wgsl: lines of #import.
    (tmp_path / "common.wgsl").write_text("const REACH = 4.0;\n")
    (tmp_path / "shape.wgsl").write_text(
        '#import "common.wgsl"\nfn ring(p: vec2<f32>) -> f32 { return abs(length(p) - REACH); }\n'
    )
    main = tmp_path / "draw.wgsl"
    main.write_text(
        '#import "shape.wgsl"\nfn shade(p: vec2<f32>) -> f32 { return ring(p) * 0.5; }\n'
    )

    def imported(text: str) -> str:
        lines = text.splitlines()
        return "\n".join(
            imported((tmp_path / line.split('"')[1]).read_text())
            if line.startswith("#import") else line
            for line in lines
        )  # fmt: skip

    p = np.random.default_rng(1).uniform(-6, 6, (200, 2)).astype(np.float32)
    wgsl.check(
        main, "shade", lambda p: np.abs(np.hypot(*p.T) - 4) / 2, {"p": p},
        preprocess=imported, float64=True, atol=1e-6,
    )  # fmt: skip


def test_a_loop_that_continues(wgsl: Kit) -> None:
    # mart-mihkel/julia, src/julia_shader.wgsl: loop with break and continuing.
    text = """
fn rounds(start: vec2<f32>, c: vec2<f32>, most: i32) -> i32 {
  var z = start;
  var n = 0;
  var size = dot(z, z);
  loop {
    if n == most || size >= 4.0 { break; }
    z = vec2<f32>(z.x * z.x - z.y * z.y, 2.0 * z.x * z.y) + c;
    continuing {
      size = dot(z, z);
      n++;
    }
  }
  return n;
}"""

    def orbit(start: F64, c: F64, most: Any) -> tuple[Any, F64]:
        """How many rounds, and how near to the edge the last number came that decided."""
        z = start[..., 0] + 1j * start[..., 1]
        n, near = np.zeros(z.shape, np.int32), np.full(z.shape, np.inf)
        for _ in range(int(np.max(most))):
            near = np.minimum(near, np.where(np.abs(z) < 3, np.abs(np.abs(z) ** 2 - 4), np.inf))
            inside = np.abs(z) ** 2 < 4
            n += inside
            z = np.where(inside, z**2 + c[..., 0] + 1j * c[..., 1], z)
        return n, near

    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 61), np.linspace(-1, 1, 41))
    given = {"start": np.stack([x, y], -1).astype(np.float32), "c": [-0.7, 0.3], "most": 12}
    census = wgsl.check(
        text, "rounds", lambda *a: orbit(*a)[0], given, float64=True,
        margin=lambda *a: orbit(*a)[1] / 1e-2,
    )  # fmt: skip
    assert census.ambiguous < 20
    with pytest.raises(MismatchError):
        wgsl.check(text.replace(">= 4.0", ">= 4.5"), "rounds", lambda *a: orbit(*a)[0], given,
                   float64=True)  # fmt: skip


def test_a_quotient_of_polynomials_of_a_vector(wgsl: Kit, rng: np.random.Generator) -> None:
    # teofum/node_thing, src/shaders/tone-map-aces.wgsl: a curve of constants, clamped.
    text = """
fn shoulder(x: vec3<f32>) -> vec3<f32> {
  let a = 1.9; let b = 0.07; let c = 1.7; let d = 0.5; let e = 0.2;
  return clamp((x * (a * x + b)) / (x * (c * x + d) + e), vec3(0.0), vec3(1.0));
}"""
    x = decades(rng, (500, 3), low=1e-3, high=1e3)

    def shoulder(x: F64) -> F64:
        return np.clip((x * (1.9 * x + 0.07)) / (x * (1.7 * x + 0.5) + 0.2), 0, 1)

    # Close to a root of the divisor the quotient is anything; negative light is none.
    wgsl.check(text, "shoulder", shoulder, {"x": np.abs(x)}, float64=True, rtol=1e-5)


def test_integers_in_floats_and_matrices_in_storage(wgsl: Kit, rng: np.random.Generator) -> None:
    # dakom/awsm-renderer, crates/renderer/src/render_passes/geometry/shader/geometry_wgsl/
    # bind_groups.wgsl: numbers of joints lie between weights, taken back by bitcast.
    text = """
@group(3) @binding(2) var<storage, read> joints: array<mat4x4<f32>>;
@group(3) @binding(3) var<storage, read> mixed: array<f32>;
fn bent(vertex: u32, p: vec3<f32>) -> vec3<f32> {
  var at = vec3<f32>();
  for (var k = 0u; k < 4u; k++) {
    let joint = bitcast<u32>(mixed[8u * vertex + 2u * k]);
    at += mixed[8u * vertex + 2u * k + 1u] * (joints[joint] * vec4<f32>(p, 1.0)).xyz;
  }
  return at;
}"""
    joints = rng.normal(size=(5, 4, 4)).astype(np.float32)
    number = rng.integers(0, 5, (50, 4), np.uint32)
    weight = rng.random((50, 4), np.float32)
    mixed = np.stack([number.view(np.float32), weight], -1).reshape(-1)

    def bent(vertex: U32, p: F64) -> F64:
        at = joints[number[vertex]].astype(np.float64) @ np.insert(p, 3, 1, 1)[:, None, :, None]
        return (weight[vertex][:, :, None] * at[..., :3, 0]).sum(1)

    given = {"vertex": np.arange(50, dtype=np.uint32), "p": rng.normal(size=(50, 3)).astype("f4")}
    bound = {"joints": joints, "mixed": mixed}
    wgsl.check(text, "bent", bent, given, bindings=bound, float64=True, atol=1e-5)


def test_a_helper_that_takes_what_a_fragment_shader_takes(wgsl: Kit) -> None:
    # jvchiappini/Motioner, src/shapes/shaders/rect.wgsl: a parameter is a struct of an entry point.
    text = """
struct Corner {
  @builtin(position) at: vec4<f32>, @location(0) tint: vec4<f32>, @location(1) size: f32
}
fn square(in: Corner, uv: vec2<f32>) -> vec4<f32> {
  let far = max(abs(uv.x), abs(uv.y)) - in.size;
  if far > 0.0 { return vec4<f32>(in.tint.rgb, 0.0); }
  return in.tint;
}
@fragment fn draw(in: Corner) -> @location(0) vec4<f32> { return square(in, in.at.xy); }
"""
    uv = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)), -1).astype("f4")
    corner = {"at": [0, 0, 0, 0], "tint": [0.1, 0.2, 0.3, 0.4], "size": 0.5}

    def square(_: Any, uv: F32) -> F32:
        alpha = np.where(np.abs(uv).max(-1) > 0.5, 0, np.float32(0.4))
        return np.stack(np.broadcast_arrays(0.1, 0.2, 0.3, alpha), -1).astype(np.float32)

    wgsl.check(text, "square", square, {"in": corner, "uv": uv})


def test_the_middle_of_three(wgsl: Kit, rng: np.random.Generator) -> None:
    # squeaktoy/hearth, crates/rend3-alacritty/src/glyph.wgsl: the median by min and max.
    text = """
fn middle(v: vec3<f32>) -> f32 { return max(min(v.x, v.y), min(max(v.x, v.y), v.z)); }
"""
    v = rng.choice(np.array([0, 0.25, 0.5, 1], np.float32), (500, 3))
    wgsl.check(text, "middle", lambda v: np.median(v, axis=1), {"v": v})


def test_an_override_with_a_number(wgsl: Kit) -> None:
    # sno2/gpulse, tests/spec-examples/0075.wgsl: an override with @id, used by an entry point.
    text = """
@id(42) override WIDE = 12u;
fn cell(k: u32) -> vec2<u32> { return vec2<u32>(k % WIDE, k / WIDE); }
@compute @workgroup_size(WIDE) fn main() { }
"""
    k = np.arange(100, dtype=np.uint32)
    for wide in (12, 5):
        constants = {"WIDE": wide} if wide != 12 else {}
        wgsl.check(
            text, "cell", lambda k, w=wide: np.stack([k % w, k // w], 1), {"k": k},
            constants=constants,
        )  # fmt: skip


def test_an_automaton_of_two_files(wgsl: Kit) -> None:
    # hankotanks/gridded_automata, src/lib/ca_caller.wgsl: a caller for a rule in another file.
    rule = """
struct Cell { state: u32, age: u32 }
fn step_(left: u32, own: u32, right: u32) -> Cell {
  let index = left * 4u + own * 2u + right;
  let state = (110u >> index) & 1u;
  return Cell(state, select(0u, 1u, state == own));
}"""
    caller = """
@group(0) @binding(0) var<storage, read> row: array<u32>;
@group(0) @binding(1) var<storage, read_write> next: array<u32>;
@compute @workgroup_size(32) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let n = arrayLength(&row);
  if (id.x >= n) { return; }
  next[id.x] = step_(row[(id.x + n - 1u) % n], row[id.x], row[(id.x + 1u) % n]).state;
}"""
    row = np.random.default_rng(3).integers(0, 2, 100, np.uint32)
    index = 4 * np.roll(row, 1) + 2 * row + np.roll(row, -1)
    given = {"row": row, "next": np.full(100, 9, np.uint32)}
    found = wgsl.kernel([rule, caller], "main", given, workgroups=4)
    wgsl.compare(found, {"next": 110 >> index & 1})
