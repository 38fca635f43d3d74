"""Whole shaders with the constructs of public WGSL, tested as their projects would test them.

Every test names a project and a file where its construct was seen. The code and the references are
our own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.testing import Kit, MismatchError, Sampler, unwritten

F32 = NDArray[np.float32]


def test_scaling_up_with_a_sampler(wgsl: Kit, rng: np.random.Generator) -> None:
    # Tolethrien/Aurora-renderer, src/aurora/urp/shaders/general/upscale.wgsl: the size of a
    # workgroup is an override, a texture is sampled into another.
    text = """
@group(0) @binding(0) var given: texture_2d<f32>;
@group(0) @binding(1) var made: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var smooth_: sampler;
override side: u32 = 8;
@compute @workgroup_size(side, side) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let size = textureDimensions(made);
  if (any(id.xy >= size)) { return; }
  let uv = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(size);
  textureStore(made, id.xy, textureSampleLevel(given, smooth_, uv, 0.0));
}"""
    given = rng.random((4, 6, 4)).astype(np.float16)
    for side, groups in ((8, (2, 1)), (4, (3, 2))):
        found = wgsl.kernel(
            text, "main",
            {"given": given, "smooth_": Sampler("linear"),
             "made": unwritten((8, 12, 4), np.float16)},
            workgroups=groups, constants={"side": side},
        )["made"]  # fmt: skip
        # A texel of the larger lies a quarter before or behind one of the smaller.
        padded = np.pad(given.astype(np.float64), ((1, 1), (1, 1), (0, 0)), mode="edge")
        y, x = np.indices((8, 12))
        near_y, near_x = (y + 1) // 2, (x + 1) // 2
        share_y, share_x = np.where(y % 2, 0.25, 0.75), np.where(x % 2, 0.25, 0.75)
        expected = sum(
            (np.abs(1 - down - share_y) * np.abs(1 - right - share_x))[..., None]
            * padded[near_y + down, near_x + right]
            for down in (0, 1)
            for right in (0, 1)
        )
        wgsl.compare_image(found, expected, atol=4e-3)


def test_a_ramp_in_halves(wgsl: Kit) -> None:
    # gaurav13407/BlackHole_Renderer, shaders/trace.wgsl: place in the picture as colours of halves.
    text = """
@group(0) @binding(0)
var picture: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let size = textureDimensions(picture);
  if (id.x >= size.x || id.y >= size.y) { return; }
  let uv = vec2<f32>(id.xy) / vec2<f32>(size);
  textureStore(picture, vec2<i32>(id.xy), vec4<f32>(uv, 0.25, 1.0));
}"""
    found = wgsl.kernel(
        text, "main", {"picture": unwritten((5, 10, 4), np.float16)}, workgroups=(2, 1)
    )["picture"]
    y, x = np.indices((5, 10))
    wgsl.compare_image(found, np.stack(np.broadcast_arrays(x / 10, y / 5, 0.25, 1), -1), ulp=1)
    with pytest.raises(MismatchError) as caught:
        wgsl.compare_image(found, np.stack(np.broadcast_arrays(y / 5, x / 10, 0.25, 1), -1), ulp=1)
    assert caught.value.census.failed > 30


SCAN = """
@group(0) @binding(0) var<storage, read> counts: array<u32>;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
var<workgroup> tree: array<u32, 128>;
@compute @workgroup_size(128) fn main(
  @builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>
) {
  let i = local.x;
  tree[i] = counts[group.x * 128u + i];
  for (var apart = 1u; apart < 128u; apart <<= 1u) {
    workgroupBarrier();
    if (i + 1u) % (2u * apart) == 0u { tree[i] += tree[i - apart]; }
  }
  workgroupBarrier();
  if i == 127u { tree[i] = 0u; }
  for (var apart = 64u; apart > 0u; apart >>= 1u) {
    workgroupBarrier();
    if (i + 1u) % (2u * apart) == 0u {
      let left = tree[i - apart];
      tree[i - apart] = tree[i];
      tree[i] += left;
    }
  }
  workgroupBarrier();
  sums[group.x * 128u + i] = tree[i];
}"""


def test_sums_before_each_by_a_tree(wgsl: Kit, rng: np.random.Generator) -> None:
    # bacpop/sparrowhawk, src/shaders/radix_prefix_wg.wgsl: up and down a tree in workgroup memory.
    counts = rng.integers(0, 1000, (6, 128), np.uint32)
    given = {"counts": counts.reshape(-1), "sums": unwritten(6 * 128, np.uint32)}
    expected = (np.cumsum(counts, axis=1) - counts).reshape(-1)
    wgsl.compare(wgsl.kernel(SCAN, "main", given, workgroups=6), {"sums": expected}, ulp=0)
    # Without the root the sums are those of all before.
    wrong = SCAN.replace("tree[i] = 0u;", "tree[i] = 1u;")
    with pytest.raises(MismatchError):
        wgsl.compare(wgsl.kernel(wrong, "main", given, workgroups=6), {"sums": expected})


def test_a_helper_with_workgroup_memory_and_barriers(wgsl: Kit, rng: np.random.Generator) -> None:
    # google-research/google-research, brush_splat/crates/brush-prefix-sum/src/shaders/
    # prefix_sum_helpers.wgsl: a function in another file has the barriers.
    helpers = """
const WIDE: u32 = 64u;
@group(0) @binding(0) var<storage, read_write> given: array<u32>;
@group(0) @binding(1) var<storage, read_write> made: array<u32>;
var<workgroup> shelf: array<u32, WIDE>;
fn scanned(id: u32, own: u32, value: u32) {
  shelf[own] = value;
  for (var back = 1u; back < WIDE; back = back * 2u) {
    workgroupBarrier();
    var sum = shelf[own];
    if (own >= back) { sum += shelf[own - back]; }
    workgroupBarrier();
    shelf[own] = sum;
  }
  if id < arrayLength(&made) { made[id] = shelf[own]; }
}"""
    main = """
@compute @workgroup_size(WIDE) fn main(
  @builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) own: u32
) {
  var value = 0u;
  if (id.x < arrayLength(&given)) { value = given[id.x]; }
  scanned(id.x, own, value);
}"""
    given = rng.integers(0, 9, 150, np.uint32)
    found = wgsl.kernel(
        [helpers, main], "main", {"given": given, "made": unwritten(150, np.uint32)}, workgroups=3
    )
    expected = np.concatenate([np.cumsum(given[k : k + 64]) for k in range(0, 150, 64)])
    wgsl.compare(found, {"given": given, "made": expected})


def test_steps_that_double(wgsl: Kit, rng: np.random.Generator) -> None:
    # craftlinks/Notebook, webgpu_compute/src/shaders/prefix-sum.wgsl: a uniform number tells the
    # step; source and destination change places.
    text = """
@group(0) @binding(0) var<storage, read> source: array<u32>;
@group(0) @binding(1) var<storage, read_write> target_: array<u32>;
@group(0) @binding(2) var<uniform> apart: u32;
@compute @workgroup_size(64) fn step_(@builtin(global_invocation_id) id: vec3u) {
  if (id.x >= arrayLength(&source)) { return; }
  var sum = source[id.x];
  if (id.x >= apart) { sum += source[id.x - apart]; }
  target_[id.x] = sum;
}"""
    values = rng.integers(0, 99, 200, np.uint32)
    sums = values
    for k in range(8):
        given = {"source": sums, "target_": unwritten(200, np.uint32), "apart": 1 << k}
        sums = wgsl.kernel(text, "step_", given, workgroups=4)["target_"]
    wgsl.compare(sums, np.cumsum(values))


def test_scattering_by_atomic_places(wgsl: Kit, rng: np.random.Generator) -> None:
    # AsherJingkongChen/gausplat-renderer, src/scene/gaussian_3d/render/forward/wgpu/kernel/
    # radix_sort_scatter_key.wgsl: constants that are declared later, places from atomic counters.
    text = """
struct Which { shift: u32 }
@group(0) @binding(0) var<storage, read> which: Which;
@group(0) @binding(1) var<storage, read_write> keys: array<u32>;
@group(0) @binding(2) var<storage, read_write> sorted: array<u32>;
@group(0) @binding(3) var<storage, read_write> places: array<atomic<u32>, DIGITS>;
const DIGITS: u32 = 1u << BITS;
const BITS: u32 = 4u;
@compute @workgroup_size(DIGITS, 1, 1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x < arrayLength(&keys) {
    let key = keys[id.x];
    sorted[atomicAdd(&places[(key >> which.shift) & (DIGITS - 1u)], 1u)] = key;
  }
}"""
    keys = rng.integers(0, 2**12, 500, np.uint32)
    digit = keys >> 4 & 15
    counts = np.bincount(digit, minlength=16)
    given = {"which": (4,), "keys": keys, "sorted": unwritten(500, np.uint32),
             "places": np.cumsum(counts) - counts}  # fmt: skip
    found = wgsl.kernel(text, "main", given, workgroups=32)
    wgsl.compare(found["places"], np.cumsum(counts))
    wgsl.compare(found["sorted"] >> 4 & 15, np.sort(digit))
    wgsl.compare(np.sort(found["sorted"]), np.sort(keys))


JACOBI = """
@group(0) @binding(0) var<storage, read> source: array<f32>;
@group(0) @binding(1) var<storage, read_write> even: array<f32>;
@group(0) @binding(2) var<uniform> size: vec4<f32>;
@group(0) @binding(3) var<storage, read_write> odd: array<f32>;
fn mean(own: u32, x: u32, y: u32, is_even: bool) -> f32 {
  let width = u32(size.x);
  let height = u32(size.y);
  let left = select(own, own - 1u, x > 0u);
  let right = select(own, own + 1u, x < width - 1u);
  let up = select(own, own - width, y > 0u);
  let down = select(own, own + width, y < height - 1u);
  if (is_even) { return 0.25 * (even[left] + even[right] + even[up] + even[down] - source[own]); }
  return 0.25 * (odd[left] + odd[right] + odd[up] + odd[down] - source[own]);
}
@compute @workgroup_size(8, 8) fn to_odd(@builtin(global_invocation_id) id: vec3<u32>) {
  if (id.x >= u32(size.x) || id.y >= u32(size.y)) { return; }
  let own = id.x + id.y * u32(size.x);
  odd[own] = mean(own, id.x, id.y, true);
}
@compute @workgroup_size(8, 8) fn to_even(@builtin(global_invocation_id) id: vec3<u32>) {
  if (id.x >= u32(size.x) || id.y >= u32(size.y)) { return; }
  let own = id.x + id.y * u32(size.x);
  even[own] = mean(own, id.x, id.y, false);
}"""


def test_rounds_of_a_solver_over_two_buffers(wgsl: Kit, rng: np.random.Generator) -> None:
    # AnuKritiW/WebGPU-FluidSim, src/shaders/pressure.wgsl: neighbours by select, round after round.
    source = rng.normal(size=(12, 10)).astype(np.float32)
    program = wgsl.program(
        JACOBI,
        {"source": source.reshape(-1), "size": [10.0, 12.0, 1.0, 0.0],
         "even": np.zeros(120, np.float32), "odd": unwritten(120, "f4")},
    )  # fmt: skip
    expected = np.zeros((12, 10))
    for k in range(20):
        program.dispatch("to_odd" if k % 2 == 0 else "to_even", (2, 2))
        edge = np.pad(expected, 1, mode="edge")
        around = edge[:-2, 1:-1] + edge[2:, 1:-1] + edge[1:-1, :-2] + edge[1:-1, 2:]
        expected = (around - source) / 4
    wgsl.compare(program.read("even"), expected.reshape(-1), atol=1e-5)
    with pytest.raises(MismatchError):
        wgsl.compare(program.read("odd"), expected.reshape(-1), atol=1e-5)


def test_differences_of_one_texture_taken_from_another(wgsl: Kit, rng: np.random.Generator) -> None:
    # JasonLai150/stablefluidsfire, src/shaders/gradient-subtract.wgsl: neighbours by textureLoad.
    text = """
@group(0) @binding(0) var speed: texture_2d<f32>;
@group(0) @binding(1) var height: texture_2d<f32>;
@group(0) @binding(2) var made: texture_storage_2d<rg32float, write>;
fn at(x: u32, y: u32) -> f32 {
  return textureLoad(height, min(vec2<u32>(x, y), textureDimensions(height) - 1u), 0).x;
}
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let slope = vec2(at(id.x + 1u, id.y) - at(id.x, id.y), at(id.x, id.y + 1u) - at(id.x, id.y));
  textureStore(made, id.xy, vec4<f32>(textureLoad(speed, id.xy, 0).xy - slope * 0.5, 0.0, 1.0));
}"""
    speed = rng.normal(size=(8, 16, 2)).astype(np.float32)
    height = rng.normal(size=(8, 16)).astype(np.float32)
    bound = {"speed": speed, "height": height, "made": unwritten((8, 16, 2), np.float32)}
    found = wgsl.kernel(text, "main", bound, workgroups=(2, 1))["made"]
    edge = np.pad(height.astype(np.float64), ((0, 1), (0, 1)), mode="edge")
    slope = np.stack([edge[:-1, 1:] - edge[:-1, :-1], edge[1:, :-1] - edge[:-1, :-1]], -1)
    wgsl.compare_image(found, speed - slope / 2, atol=1e-6)


def test_samples_beside_the_place(wgsl: Kit, rng: np.random.Generator) -> None:
    # sandydoo/flux, flux-next/flux-next/shader/solve_pressure.comp.wgsl: samples with an offset of
    # whole texels.
    text = """
@group(0) @binding(1) var way: sampler;
@group(1) @binding(0) var field: texture_2d<f32>;
@group(2) @binding(1) var made: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8, 1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let uv = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(textureDimensions(field));
  let l = textureSampleLevel(field, way, uv, 0.0, vec2<i32>(-1, 0)).x;
  let r = textureSampleLevel(field, way, uv, 0.0, vec2<i32>(1, 0)).x;
  textureStore(made, vec2<i32>(id.xy), vec4<f32>(r - l, 0.0, 0.0, 0.0));
}"""
    field = rng.integers(0, 100, (8, 8)).astype(np.float32)
    for address, mode in (("repeat", "wrap"), ("clamp-to-edge", "edge")):
        bound = {"way": Sampler(address=address), "field": field, "made": unwritten((8, 8), "f4")}
        found = wgsl.kernel(text, "main", bound)["made"]
        edge = np.pad(field, ((0, 0), (1, 1)), mode=mode)  # type: ignore[call-overload]
        wgsl.compare_image(found, edge[:, 2:] - edge[:, :-2])


BLUR = """
struct Params { reach: i32, flip: u32 }
@group(0) @binding(0) var way: sampler;
@group(0) @binding(1) var<uniform> params: Params;
@group(1) @binding(1) var given: texture_2d<f32>;
@group(1) @binding(2) var made: texture_storage_2d<rgba8unorm, write>;
var<workgroup> strip: array<vec3f, 32>;
@compute @workgroup_size(32) fn main(
  @builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u
) {
  let size = vec2i(textureDimensions(given));
  var at = vec2i(i32(local.x), i32(group.x));
  if (params.flip != 0u) { at = at.yx; }
  let uv = (vec2f(at) + 0.5) / vec2f(size);
  strip[local.x] = textureSampleLevel(given, way, uv, 0.0).rgb;
  workgroupBarrier();
  var sum = vec3f();
  for (var k = -params.reach; k <= params.reach; k++) {
    sum += strip[clamp(i32(local.x) + k, 0, 31)];
  }
  if (all(at < size)) {
    textureStore(made, at, vec4f(sum / f32(2 * params.reach + 1), 1.0));
  }
}"""


@pytest.mark.parametrize("flip", [0, 1])
def test_a_blur_through_workgroup_memory(wgsl: Kit, rng: np.random.Generator, flip: int) -> None:
    # webgpu/webgpu-samples, sample/imageBlur/blur.wgsl: vec3f in workgroup memory, a flag turns x
    # and y, 8-bit colours.
    given = rng.integers(0, 256, (32, 32, 4), np.uint8)
    bound = {
        "way": Sampler(), "params": (2, flip), "given": given,
        "made": unwritten((32, 32, 4), np.uint8),
    }  # fmt: skip
    found = wgsl.kernel(BLUR, "main", bound, workgroups=32)["made"]
    image = given[..., :3].astype(np.float64)
    image = image.transpose(1, 0, 2) if flip else image
    edge = np.pad(image, ((0, 0), (2, 2), (0, 0)), mode="edge")
    mean = np.mean([edge[:, k : k + 32] for k in range(5)], axis=0)
    mean = mean.transpose(1, 0, 2) if flip else mean
    expected = np.insert(np.rint(mean), 3, 255, axis=2).astype(np.uint8)
    # In the middle between two levels either is right.
    wgsl.compare_image(found, expected, atol=1, name="blur")
    assert (found != expected).mean() < 0.01


def test_one_number_for_two_bindings(wgsl: Kit, rng: np.random.Generator) -> None:
    # webgpu/webgpu-samples, sample/particles/probabilityMap.wgsl: two entry points have another
    # texture at the same place, and name a buffer that they do not use.
    text = """
struct Size { width: u32 }
@binding(0) @group(0) var<uniform> size: Size;
@binding(1) @group(0) var<storage, read> fine: array<f32>;
@binding(2) @group(0) var<storage, read_write> coarse: array<f32>;
@binding(3) @group(0) var photo: texture_2d<f32>;
@binding(3) @group(0) var chances: texture_storage_2d<rgba8unorm, write>;
@compute @workgroup_size(64) fn load(@builtin(global_invocation_id) id: vec3u) {
  _ = &fine;
  if (all(id.xy < vec2u(textureDimensions(photo)))) {
    coarse[id.x + id.y * size.width] = textureLoad(photo, vec2i(id.xy), 0).w;
  }
}
@compute @workgroup_size(64) fn halve(@builtin(global_invocation_id) id: vec3u) {
  if (all(id.xy < vec2u(textureDimensions(chances)))) {
    let k = 2u * (id.x + id.y * size.width);
    let four = vec4f(fine[k], fine[k + 1u], fine[k + size.width], fine[k + size.width + 1u]);
    coarse[id.x + id.y * size.width] = dot(four, vec4f(0.25));
    textureStore(chances, vec2i(id.xy), four);
  }
}"""
    photo = rng.integers(0, 256, (4, 8, 4), np.uint8)
    alpha = photo[..., 3].astype(np.float64) / 255
    state = {
        "size": (8,), "fine": alpha.reshape(-1).astype(np.float32), "photo": photo,
        "coarse": unwritten(32, np.float32), "chances": unwritten((2, 4, 4), np.uint8),
    }  # fmt: skip
    program = wgsl.program(text, state)
    program.dispatch("load", (1, 4))
    wgsl.compare(program.read("coarse"), alpha.reshape(-1), ulp=1)
    program.dispatch("halve", (1, 2))
    blocks = photo[..., 3].reshape(2, 2, 4, 2).transpose(0, 2, 1, 3).reshape(2, 4, 4)
    wgsl.compare_image(program.read("chances"), blocks)
    coarse = program.read("coarse").reshape(4, 8)[:2, :4]
    wgsl.compare_image(coarse, blocks.mean(-1) / 255, ulp=2)


TILED = """
struct Sizes { rows: u32, inner: u32, columns: u32, pad: u32 }
@group(0) @binding(0) var<storage, read> a: array<f32>;
@group(0) @binding(1) var<storage, read> b: array<f32>;
@group(0) @binding(2) var<storage, read_write> c: array<f32>;
@group(0) @binding(3) var<uniform> sizes: Sizes;
const SIDE: u32 = 8u;
var<workgroup> of_a: array<array<f32, SIDE>, SIDE>;
var<workgroup> of_b: array<array<f32, SIDE>, SIDE>;
@compute @workgroup_size(SIDE, SIDE, 1) fn main(
  @builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>
) {
  var sum = 0.0;
  for (var first = 0u; first < sizes.inner; first += SIDE) {
    of_a[local.y][local.x] = 0.0;
    of_b[local.y][local.x] = 0.0;
    if (id.y < sizes.rows && first + local.x < sizes.inner) {
      of_a[local.y][local.x] = a[id.y * sizes.inner + first + local.x];
    }
    if (id.x < sizes.columns && first + local.y < sizes.inner) {
      of_b[local.y][local.x] = b[(first + local.y) * sizes.columns + id.x];
    }
    workgroupBarrier();
    for (var k = 0u; k < SIDE; k++) { sum += of_a[local.y][k] * of_b[k][local.x]; }
    workgroupBarrier();
  }
  if (id.y < sizes.rows && id.x < sizes.columns) { c[id.y * sizes.columns + id.x] = sum; }
}"""


def test_a_product_of_matrices_by_tiles(wgsl: Kit, rng: np.random.Generator) -> None:
    # gukush/slim_volunteer, server/kernels/webgpu/block_matmul.wgsl: tiles of both factors.
    a, b = rng.normal(size=(19, 13)).astype("f4"), rng.normal(size=(13, 21)).astype("f4")
    given = {"a": a.reshape(-1), "b": b.reshape(-1), "c": unwritten(19 * 21, np.float32),
             "sizes": (19, 13, 21, 0)}  # fmt: skip
    expected = (a.astype(np.float64) @ b).reshape(-1)
    found = wgsl.kernel(TILED, "main", given, workgroups=(3, 3))
    wgsl.compare(found, {"c": expected}, atol=1e-5)
    wrong = TILED.replace("k < SIDE;", "k < SIDE - 1u;")
    with pytest.raises(MismatchError):
        wgsl.compare(
            wgsl.kernel(wrong, "main", given, workgroups=(3, 3)), {"c": expected}, atol=1e-5
        )


def test_how_many_workgroups_follow_from_what_is_alive(wgsl: Kit) -> None:
    # djeedai/bevy_hanabi, src/render/vfx_indirect.wgsl: one shader writes how many workgroups of
    # the next are run.
    text = """
struct Flock { alive: atomic<u32>, dead: u32 }
struct Groups { x: u32, y: u32, z: u32, pad: u32 }
@group(0) @binding(0) var<storage, read_write> flock: Flock;
@group(0) @binding(1) var<storage, read_write> groups: Groups;
@group(0) @binding(2) var<storage, read_write> ages: array<u32>;
@compute @workgroup_size(64) fn count(@builtin(global_invocation_id) id: vec3<u32>) {
  if (ages[id.x] > 0u) { atomicAdd(&flock.alive, 1u); }
}
@compute @workgroup_size(64) fn plan(@builtin(global_invocation_id) id: vec3<u32>) {
  if (id.x > 0u) { return; }
  groups.x = (atomicLoad(&flock.alive) + 63u) / 64u;
}
@compute @workgroup_size(64) fn grow(@builtin(global_invocation_id) id: vec3<u32>) {
  ages[id.x] += 1u;
}"""
    ages = np.zeros(512, np.uint32)
    ages[:150] = 7
    program = wgsl.program(text, {"flock": (0, 0), "groups": (0, 1, 1, 0), "ages": ages})
    program.dispatch("count", 8)
    program.dispatch("plan")
    assert program.read("groups").tolist() == (3, 1, 1, 0)
    program.dispatch("grow", indirect="groups")
    wgsl.compare(program.read("ages"), ages + (np.arange(512) < 192))


def test_shadows_of_several_lights(wgsl: Kit, rng: np.random.Generator) -> None:
    # iamwilhelm/use.gpu, packages/wgsl/wgsl/use/shadow.wgsl: layers of depths, compared.
    text = """
@group(0) @binding(1) var shadows: texture_depth_2d_array;
@group(0) @binding(2) var closer: sampler_comparison;
fn lit(uv: vec2<f32>, light: u32, level: f32) -> f32 {
  return textureSampleCompareLevel(shadows, closer, uv, light, level);
}"""
    depths = rng.random((3, 4, 4), np.float32)
    light, y, x = rng.integers(0, [[3], [4], [4]], (3, 200))
    given = {
        "uv": np.stack([(x + 0.5) / 4, (y + 0.5) / 4], 1).astype("f4"),
        "light": light.astype(np.uint32), "level": rng.random(200, np.float32),
    }  # fmt: skip
    for compare, beyond in (("less-equal", np.less_equal), ("greater", np.greater)):
        wgsl.check(
            text, "lit", lambda _, k, level, b=beyond: 1 * b(level, depths[k, y, x]), given,
            bindings={"shadows": depths, "closer": Sampler(compare=compare)},
        )  # fmt: skip


def test_soft_shadows_in_a_picture(wgsl: Kit, rng: np.random.Generator) -> None:
    # zlatnaspirala/matrix-engine-wgpu, src/shaders/fragment.wgsl.js: an override is the size of a
    # map of depths, of which nine texels are compared for each pixel.
    text = """
override mapSize: f32 = 1024.0;
@group(0) @binding(1) var depths: texture_depth_2d;
@group(0) @binding(2) var closer: sampler_comparison;
@fragment fn main(@location(0) uv: vec2f) -> @location(0) f32 {
  var seen = 0.0;
  for (var y = -1; y <= 1; y++) {
    for (var x = -1; x <= 1; x++) {
      seen += textureSampleCompare(depths, closer, uv + vec2f(vec2(x, y)) / mapSize, 0.5);
    }
  }
  return seen / 9.0;
}"""
    depths = rng.random((8, 8), np.float32)
    bound = {"depths": depths, "closer": Sampler(compare="less")}
    found = wgsl.image(text, "main", (8, 8), bound, constants={"mapSize": 8})
    edge = np.pad(depths > 0.5, 1, mode="edge")
    expected = sum(1.0 * edge[y : y + 8, x : x + 8] for y in range(3) for x in range(3)) / 9
    wgsl.compare_image(found, expected, ulp=1)
    with pytest.raises(MismatchError):
        wgsl.compare_image(wgsl.image(text, "main", (8, 8), bound), expected, ulp=1)


def test_slices_of_a_volume(wgsl: Kit, rng: np.random.Generator) -> None:
    # WujekPuchatek/dicom-viewer, src/rendering/shaders/shader.wgsl: a texture of three dimensions
    # is loaded by whole numbers.
    text = """
@group(0) @binding(1) var volume: texture_3d<f32>;
@group(0) @binding(2) var<uniform> slice: i32;
@fragment fn main(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
  let v = textureLoad(volume, vec3<i32>(vec2<i32>(at.xy), slice), 0).x;
  return vec4<f32>(v, v, v, 1.0);
}"""
    volume = rng.integers(0, 256, (5, 6, 7), np.uint8)
    for slice_ in range(5):
        found = wgsl.image(text, "main", (7, 6), {"volume": volume, "slice": slice_})
        wgsl.compare_image(found[..., 0], volume[slice_] / np.float32(255), ulp=1)


LIFE = """
@group(0) @binding(0) var now: texture_storage_2d<r32uint, read>;
@group(0) @binding(1) var next: texture_storage_2d<r32uint, write>;
fn alive(at: vec2<i32>, x: i32, y: i32) -> u32 {
  let size = vec2<i32>(textureDimensions(now));
  return textureLoad(now, (at + vec2<i32>(x, y) + size) % size).x;
}
@compute @workgroup_size(8, 8, 1) fn update(@builtin(global_invocation_id) id: vec3<u32>) {
  let at = vec2<i32>(id.xy);
  let n = alive(at, -1, -1) + alive(at, 0, -1) + alive(at, 1, -1) + alive(at, -1, 0)
    + alive(at, 1, 0) + alive(at, -1, 1) + alive(at, 0, 1) + alive(at, 1, 1);
  let lives = n == 3u || (n == 2u && alive(at, 0, 0) == 1u);
  textureStore(next, at, vec4<u32>(u32(lives)));
}"""


def neighbours(cells: NDArray[Any]) -> NDArray[Any]:
    """How many of the eight cells around each live, on a torus."""
    around = [(y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if (y, x) != (0, 0)]
    total = sum(np.roll(cells, shift, (0, 1)).astype(int) for shift in around)
    return np.asarray(total)


def life(cells: NDArray[Any]) -> NDArray[Any]:
    n = neighbours(cells)
    return ((n == 3) | ((n == 2) & (cells == 1))).astype(cells.dtype)


def test_life_in_textures(wgsl: Kit, rng: np.random.Generator) -> None:
    # lenlaw/compute_game_of_life_deterministic, assets/shaders/game_of_life.wgsl: one storage
    # texture is read, another written.
    cells = rng.integers(0, 2, (16, 24), np.uint32)
    given = {"now": cells, "next": unwritten((16, 24), np.uint32)}
    found = wgsl.kernel(LIFE, "update", given, workgroups=(3, 2))
    assert list(found) == ["next"]
    wgsl.compare_image(found["next"], life(cells))
    wrong = LIFE.replace("n == 2u &&", "n == 4u &&")
    with pytest.raises(MismatchError):
        wgsl.compare_image(
            wgsl.kernel(wrong, "update", given, workgroups=(3, 2))["next"], life(cells)
        )


def test_generations_of_life_in_buffers(wgsl: Kit, rng: np.random.Generator) -> None:
    # Zyteify/Game-of-Life, src/view/shaders/compute/copier_shader.wgsl: indices that wrap, a shader
    # that copies what another made.
    text = """
@group(0) @binding(0) var<uniform> grid: vec2u;
@group(1) @binding(0) var<storage, read_write> now: array<u32>;
@group(1) @binding(1) var<storage, read_write> next: array<u32>;
fn place(cell: vec2u) -> u32 { return (cell.y % grid.y) * grid.x + (cell.x % grid.x); }
fn live(cell: vec2u) -> u32 { return now[place(cell)]; }
@compute @workgroup_size(8, 8) fn grow(@builtin(global_invocation_id) id: vec3u) {
  let c = id.xy + grid;
  var n = 0u;
  for (var y = 0u; y < 3u; y++) {
    for (var x = 0u; x < 3u; x++) { n += live(c + vec2u(x, y) - 1u); }
  }
  let own = live(c);
  next[place(c)] = select(u32(n == 3u), u32(n == 3u || n == 4u), own == 1u);
}
@compute @workgroup_size(8, 8) fn copy(@builtin(global_invocation_id) id: vec3u) {
  now[place(id.xy)] = next[place(id.xy)];
}"""
    cells = rng.integers(0, 2, (16, 8), np.uint32)
    program = wgsl.program(
        text, {"grid": [8, 16], "now": cells.reshape(-1), "next": unwritten(128, np.uint32)}
    )
    for _ in range(10):
        program.dispatch("grow", (1, 2))
        program.dispatch("copy", (1, 2))
        cells = life(cells)
    wgsl.compare(program.read("now"), cells.reshape(-1))


def test_a_fractal_that_returns_early(wgsl: Kit) -> None:
    # KewlKris/fractals, src/fractal-renderer/src/graphics/shader.wgsl: a fragment shader that
    # returns from within a loop.
    text = """
@fragment fn main(@location(0) uv: vec2<f32>) -> @location(0) u32 {
  var z = (uv - 0.5) * vec2<f32>(3.2, 2.4);
  for (var k = 0u; k < 20u; k++) {
    if (dot(z, z) > 4.0) { return k; }
    z = vec2<f32>(z.x * z.x - z.y * z.y, 2.0 * z.x * z.y) + vec2<f32>(-0.8, 0.156);
  }
  return 20u;
}"""
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64 - 0.5, (np.arange(48) + 0.5) / 48 - 0.5)
    z = x * 3.2 + 1j * y * 2.4
    count, near = np.full(z.shape, 20), np.full(z.shape, np.inf)
    for k in range(20):
        outside = np.abs(z) > 2
        count = np.where(outside & (count == 20), k, count)
        near = np.minimum(near, np.where(count == 20, np.abs(np.abs(z) - 2), np.inf))
        near = np.where(outside & (count == k), np.minimum(near, np.abs(z) - 2), near)
        z = np.where(outside, z, z**2 - 0.8 + 0.156j)
    found = wgsl.image(text, "main", (64, 48))
    census = wgsl.compare_image(found, count.astype(np.uint32), margin=near / 2e-3)
    assert census.ambiguous < 60
    assert len(np.unique(found)) > 8


def test_a_sphere_by_marching(wgsl: Kit) -> None:
    # wrnrlr/slimshader, examples/sphere.wgsl: rays of a fragment shader march through distances.
    text = """
struct View { size: vec2<f32>, focus: f32 }
@group(0) @binding(0) var<uniform> view: View;
fn far(p: vec3<f32>) -> f32 { return min(length(p - vec3<f32>(0.0, 0.5, 5.0)) - 1.0, p.y + 1.0); }
fn march(o: vec3<f32>, d: vec3<f32>) -> f32 {
  var t = 0.0;
  for (var k = 0u; k < 200u; k++) {
    let step_ = far(o + t * d);
    t += step_;
    if (t > 50.0 || step_ < 1e-4) { break; };
  }
  return t;
}
@fragment fn main(@builtin(position) at: vec4<f32>) -> @location(0) f32 {
  let uv = (at.xy - 0.5 * view.size) / view.size.y;
  return march(vec3<f32>(), normalize(vec3<f32>(uv.x, -uv.y, view.focus)));
}"""
    width, height = 48, 32
    x, y = np.meshgrid((np.arange(width) + 0.5 - width / 2) / height,
                       (np.arange(height) + 0.5 - height / 2) / height)  # fmt: skip
    d = np.stack([x, -y, np.full_like(x, 1.5)], -1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    b = d @ [0, 0.5, 5]
    inside = b**2 - (0.25 + 25 - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        sphere = np.where(inside > 0, b - np.sqrt(inside), np.inf)
        floor = np.where(d[..., 1] < 0, -1 / d[..., 1], np.inf)
    exact = np.minimum(sphere, floor)
    found = wgsl.image(text, "main", (width, height), {"view": ([width, height], 1.5)})
    # Where a ray all but touches the sphere, or goes far, marching does not end at the surface.
    clear = (np.abs(inside) > 0.05) & (exact < 15)
    assert clear.mean() > 0.3
    wgsl.compare(found[clear], exact[clear], atol=2e-2)
    assert (found[exact > 60] > 50).all()


def test_edges_by_derivatives(wgsl: Kit) -> None:
    # sprunk-engine/sprunk-home, src/shaders/MsdfText.frag.wgsl: fine derivatives tell how large a
    # pixel is; what is outside is discarded.
    text = """
@group(0) @binding(0) var<uniform> zoom: f32;
@fragment fn main(@location(0) uv: vec2f) -> @location(0) vec4f {
  let field = (uv.x - 0.5) * zoom;
  let pixel = length(vec2f(dpdxFine(field), dpdyFine(field)));
  let alpha = smoothstep(-0.5, 0.5, field / pixel);
  if (alpha < 0.001) { discard; }
  return vec4f(1.0, 0.5, 0.25, alpha);
}"""
    found = wgsl.image(text, "main", (20, 4), {"zoom": 30.0})
    t = np.clip(np.arange(20) + 0.5 - 10 + 0.5, 0, 1)
    alpha = t * t * (3 - 2 * t)
    expected = np.where(alpha[:, None] < 0.001, 0, np.stack(
        np.broadcast_arrays(1, 0.5, 0.25, alpha), -1))  # fmt: skip
    wgsl.compare_image(found, np.broadcast_to(expected, (4, 20, 4)), atol=1e-4)


def test_a_buffer_in_each_of_three_groups(wgsl: Kit, rng: np.random.Generator) -> None:
    # gusjengis/Particle-Physics-Sim, src/shaders/2D_LOM.wgsl: one buffer a group.
    text = """
@group(0) @binding(0) var<storage, read_write> places: array<vec2<f32>>;
@group(1) @binding(0) var<storage, read_write> speeds: array<vec2<f32>>;
@group(2) @binding(0) var<storage, read_write> pushes: array<vec2<f32>>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let dt = 0.125;
  speeds[id.x] += pushes[id.x] * dt;
  places[id.x] += speeds[id.x] * dt;
}"""
    places, speeds, pushes = rng.integers(-50, 50, (3, 128, 2)).astype(np.float32)
    program = wgsl.program(text, {"places": places, "speeds": speeds, "pushes": pushes})
    for _ in range(3):
        program.dispatch("main", 2)
        speeds = speeds + pushes / 8
        places = places + speeds / 8
    wgsl.compare(program.read("places"), places)
    wgsl.compare(program.read("speeds"), speeds)


def test_records_with_padding_go_from_one_buffer_to_another(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    # luoluobuli/WebGPU-MPM-based-Snow-Simulation, src/lib/gpu/shaders/simulationStep.wgsl:
    # particles of several vec3 and numbers.
    text = """
struct World { step_: f32, pull: vec3f }
struct Grain { at: vec3f, mass: f32, speed: vec3f, age: u32 }
@group(0) @binding(0) var<uniform> world: World;
@group(1) @binding(0) var<storage, read> before: array<Grain>;
@group(1) @binding(1) var<storage, read_write> after: array<Grain>;
@compute @workgroup_size(256) fn fall(@builtin(global_invocation_id) id: vec3u) {
  if id.x >= arrayLength(&before) { return; }
  var grain = before[id.x];
  grain.speed += world.pull * world.step_;
  grain.at += grain.speed * world.step_;
  grain.age++;
  after[id.x] = grain;
}"""
    before = np.zeros(300, wgsl.struct(text, "Grain"))
    before["at"], before["speed"] = rng.integers(-9, 9, (2, 300, 3))
    before["mass"], before["age"] = 2, rng.integers(0, 99, 300)
    expected = before.copy()
    expected["speed"] += np.float32([0, 0, -8]) * np.float32(0.25)  # type: ignore[arg-type]
    expected["at"] += expected["speed"] * np.float32(0.25)
    expected["age"] += 1
    given = {"world": (0.25, [0, 0, -8]), "before": before, "after": np.zeros_like(before)}
    wgsl.compare(wgsl.kernel(text, "fall", given, workgroups=2), {"after": expected})


def test_numbers_alone_as_uniforms(wgsl: Kit, rng: np.random.Generator) -> None:
    # m96-chan/0xBitNet, packages/core/src/shaders/dequantize.wgsl: several uniforms of one number.
    text = """
struct Params { n: u32 }
@group(0) @binding(0) var<storage, read> sums: array<i32>;
@group(0) @binding(1) var<storage, read_write> values: array<f32>;
@group(0) @binding(2) var<uniform> of_weights: f32;
@group(0) @binding(3) var<uniform> of_inputs: f32;
@group(0) @binding(4) var<uniform> params: Params;
@compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if (id.x >= params.n) { return; }
  values[id.x] = f32(sums[id.x]) * of_weights * of_inputs;
}"""
    sums = rng.integers(-1000, 1000, 300, np.int32)
    found = wgsl.kernel(
        text, "main",
        {"sums": sums, "values": unwritten(300, np.float32), "of_weights": 0.1, "of_inputs": 0.3,
         "params": (290,)},
        workgroups=2,
    )["values"]  # fmt: skip
    wgsl.compare(found[:290], sums[:290] * 0.03, rtol=1e-6)
    wgsl.compare(found[290:], unwritten(10, np.float32))


def test_rows_of_weights_with_helpers_that_wait(wgsl: Kit, rng: np.random.Generator) -> None:
    # cryscan/web-rwkv, src/shaders/softmax.wgsl: helpers reduce workgroup memory of vec4, with a
    # barrier in each.
    text = """
@group(0) @binding(0) var<uniform> shape: vec2<u32>;
@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> output: array<vec4<f32>>;
const WIDE: u32 = 32u;
var<workgroup> notes: array<vec4<f32>, WIDE>;
fn largest(index: u32, apart: u32) {
  if index < apart { notes[index] = max(notes[index], notes[index + apart]); }
  workgroupBarrier();
}
fn total(index: u32, apart: u32) {
  if index < apart { notes[index] += notes[index + apart]; }
  workgroupBarrier();
}
@compute @workgroup_size(32) fn main(
  @builtin(local_invocation_index) index: u32, @builtin(workgroup_id) row: vec3<u32>
) {
  let first = row.x * shape.x;
  notes[index] = vec4<f32>(-1e30);
  for (var k = index; k < shape.x; k += WIDE) { notes[index] = max(notes[index], x[first + k]); }
  workgroupBarrier();
  largest(index, 16u); largest(index, 8u); largest(index, 4u);
  largest(index, 2u); largest(index, 1u);
  let four = notes[0];
  let most = max(max(four.x, four.y), max(four.z, four.w));
  workgroupBarrier();
  notes[index] = vec4<f32>();
  for (var k = index; k < shape.x; k += WIDE) { notes[index] += exp(x[first + k] - most); }
  workgroupBarrier();
  total(index, 16u); total(index, 8u); total(index, 4u); total(index, 2u); total(index, 1u);
  let sum = dot(notes[0], vec4<f32>(1.0));
  for (var k = index; k < shape.x; k += WIDE) {
    output[first + k] = exp(x[first + k] - most) / sum;
  }
}"""
    x = rng.normal(size=(5, 160)).astype(np.float32) * 4
    given = {"shape": [40, 5], "x": x.reshape(-1, 4), "output": unwritten((200, 4), np.float32)}
    e = np.exp(x.astype(np.float64) - x.max(1, keepdims=True))
    expected = (e / e.sum(1, keepdims=True)).reshape(-1, 4)
    found = wgsl.kernel(text, "main", given, workgroups=5)
    wgsl.compare(found, {"output": expected}, rtol=2e-5, atol=1e-9)
    wrong = text.replace("largest(index, 1u);", "").replace("total(index, 1u);", "")
    with pytest.raises(MismatchError):
        wgsl.compare(
            wgsl.kernel(wrong, "main", given, workgroups=5), {"output": expected}, rtol=2e-5
        )


def test_rows_times_columns_of_a_template(wgsl: Kit, rng: np.random.Generator) -> None:
    # audiovention/wgpu-mm, shaders/gemv/gemv_1.wgsl: sizes and the size of a workgroup are filled
    # in, and b lies in vec4.
    template = """
@group(0) @binding(0)
var<storage, read> a: array<f32>;
@group(0) @binding(1)
var<storage, read> b: array<vec4<f32>>;
@group(0) @binding(2)
var<storage, read_write> c: array<vec4<f32>>;
@compute @workgroup_size({{ wide }}, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  let row = id.x;
  let column = id.y;
  if (row >= {{ M }}u || column >= {{ N }}u / 4u) { return; }
  var sum = vec4<f32>();
  for (var k = 0u; k < {{ K }}u; k = k + 1u) {
    sum += vec4<f32>(a[row * {{ K }}u + k]) * b[k * ({{ N }}u / 4u) + column];
  }
  c[row * ({{ N }}u / 4u) + column] = sum;
}"""
    filled = {"M": 5, "N": 12, "K": 7, "wide": 4}

    def fill(text: str) -> str:
        for name, value in filled.items():
            text = text.replace(f"{{{{ {name} }}}}", str(value))
        return text

    a, b = rng.normal(size=(5, 7)).astype("f4"), rng.normal(size=(7, 12)).astype("f4")
    given = {"a": a.reshape(-1), "b": b.reshape(-1, 4), "c": unwritten((15, 4), np.float32)}
    found = wgsl.kernel(template, "main", given, workgroups=(2, 3), preprocess=fill)
    wgsl.compare(found, {"c": (a.astype(np.float64) @ b).reshape(-1, 4)}, atol=1e-5)
