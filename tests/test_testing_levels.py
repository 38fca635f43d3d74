"""Textures of several levels and of several samples: every texel is where it was given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.device.textures import FORMATS, MULTISAMPLED
from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError, Sampler, unwritten
from tests.test_testing_textures import some

F32 = NDArray[np.float32]


LEVELS: list[tuple[str, str, tuple[int, ...]]] = [
    ("texture_2d<f32>", "textureLoad(t, c.yx, c.w)", (5, 12)),
    ("texture_2d<u32>", "textureLoad(t, c.yx, c.w)", (8, 8)),
    ("texture_2d_array<i32>", "textureLoad(t, c.zy, c.x, c.w)", (3, 4, 7)),
    ("texture_3d<f32>", "textureLoad(t, c.zyx, c.w)", (3, 9, 2)),
    ("texture_depth_2d", "vec4<f32>(textureLoad(t, c.yx, c.w))", (6, 5)),
    ("texture_depth_2d_array", "vec4<f32>(textureLoad(t, c.zy, c.x, c.w))", (3, 5, 6)),
]


def pyramid(
    rng: np.random.Generator, type_: str, shape: tuple[int, ...]
) -> tuple[NDArray[Any], ...]:
    """Levels down to one texel, each of numbers of its own."""
    found, size = [], list(shape)
    keeps = "array" in type_
    while True:
        if "f32" in type_ or "depth" in type_:
            found.append(rng.random(size, np.float32))
        else:
            found.append(rng.integers(0, 100, size, np.uint32 if "u32" in type_ else np.int32))
        if max(size[keeps:]) == 1:
            return tuple(found)
        size = [s if keeps and k == 0 else max(s // 2, 1) for k, s in enumerate(size)]


@pytest.mark.parametrize(("type_", "load", "shape"), LEVELS)
def test_every_level(
    wgsl: Kit, rng: np.random.Generator, type_: str, load: str, shape: tuple[int, ...]
) -> None:
    scalar = "f32" if "depth" in type_ else type_[-4:-1]
    text = f"""
@group(0) @binding(0) var t: {type_};
fn texel(c: vec4<i32>) -> {scalar} {{ return {load}.x; }}
fn levels(x: u32) -> u32 {{ return textureNumLevels(t) + x; }}
fn size(k: u32) -> vec3<u32> {{ return vec3<u32>(textureDimensions(t, k){
        ", 0u" * (type_[:10] != "texture_3d")
    }); }}
"""
    levels = pyramid(rng, type_, shape)
    at, expected = [], []
    for k, level in enumerate(levels):
        places = np.indices(level.shape).reshape(len(shape), -1).T
        at.append(np.pad(places, ((0, 0), (0, 4 - len(shape)))))
        at[-1][:, 3] = k
        expected.append(level.reshape(-1))
    given, bound = {"c": np.concatenate(at)}, {"t": levels}
    wanted = np.concatenate(expected)
    assert len(levels) == 1 + int(np.log2(max(shape[-2:])))
    wgsl.check(text, "texel", lambda _: wanted, given, bindings=bound)
    # A level in place of another is found.
    with pytest.raises(MismatchError):
        wgsl.check(text, "texel", lambda _: wanted[::-1], given, bindings=bound)
    assert wgsl.run(text, "levels", {"x": 0}, bindings=bound).tolist() == [len(levels)]
    sizes = [level.shape[-1:-4:-1] for level in levels]
    if "3d" not in type_:
        sizes = [(*size[:2], 0) for size in sizes]
    # One after another: lavapipe of Mesa 22.3 asks for the level of the first of 8 invocations.
    for k, size in enumerate(sizes):
        wgsl.check(text, "size", lambda _, size=size: [size], {"k": k}, bindings=bound)
    # Not all levels need be there.
    few = {"t": levels[:2]}
    assert wgsl.run(text, "levels", {"x": 0}, bindings=few).tolist() == [2]
    assert wgsl.run(text, "levels", {"x": 0}, bindings={"t": levels[:1]}).tolist() == [1]


SAMPLING = """
@group(0) @binding(0) var t: texture_2d<f32>;
@group(0) @binding(1) var way: sampler;
fn at(level: f32) -> f32 { return textureSampleLevel(t, way, vec2<f32>(0.5), level).x; }
fn by_slope(slope: f32) -> f32 {
  return textureSampleGrad(t, way, vec2<f32>(0.5), vec2<f32>(slope, 0.0), vec2<f32>()).x;
}
@fragment fn seen(@location(0) uv: vec2<f32>) -> @location(0) f32 {
  return textureSample(t, way, uv * 2.0).x;
}
"""


@pytest.mark.parametrize("mipmap", ["nearest", "linear"])
def test_between_levels(wgsl: Kit, mipmap: str) -> None:
    levels = tuple(np.full((8 >> k, 8 >> k), 10.0**k, np.float16) for k in range(4))
    level = np.linspace(-1, 5, 100, dtype=np.float32)
    bound = {"t": levels, "way": Sampler(mipmap=mipmap)}

    def at(level: F32) -> Any:
        place = np.clip(level.astype(np.float64), 0, 3)
        if mipmap == "nearest":
            return 10 ** np.floor(place + 0.5)
        low = np.floor(place)
        return 10**low + (place - low) * (10 ** np.minimum(low + 1, 3) - 10**low)

    # The share of a level is rounded, to 1/256 of lavapipe.
    wgsl.check(
        SAMPLING, "at", at, {"level": level}, bindings=bound, rtol=0.04,
        margin=lambda level: np.abs((level + 0.5) % 1 - 0.5) / 0.01,
    )  # fmt: skip
    other = {"t": levels, "way": Sampler(mipmap="linear" if mipmap == "nearest" else "nearest")}
    with pytest.raises(MismatchError):
        wgsl.check(SAMPLING, "at", at, {"level": level}, bindings=other, rtol=0.04)
    slope = np.array([1 / 8, 1 / 4, 1 / 2, 1], np.float32)
    wgsl.check(SAMPLING, "by_slope", lambda _: [1, 10, 100, 1000], {"slope": slope}, bindings=bound)
    # Two texels of the first level to a pixel.
    picture = wgsl.image(SAMPLING, "seen", (8, 8), bound)
    wgsl.compare_image(picture, np.full((8, 8), 10))


def test_the_levels_of_a_cube(wgsl: Kit, rng: np.random.Generator) -> None:
    text = """
@group(0) @binding(0) var sky: texture_cube<f32>;
@group(0) @binding(1) var way: sampler;
fn seen(toward: vec3<f32>, level: f32) -> f32 {
  return textureSampleLevel(sky, way, toward, level).x;
}"""
    levels = tuple(
        np.repeat(rng.random(6, np.float32), size**2).reshape(6, size, size) for size in (4, 2, 1)
    )
    toward = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    given = {
        "toward": np.tile(toward, (3, 1)).astype(np.float32),
        "level": np.repeat(np.arange(3), 6).astype(np.float32),
    }
    expected = np.concatenate([level[:, 0, 0] for level in levels])
    bound = {"sky": levels, "way": Sampler()}
    wgsl.check(text, "seen", lambda *_: expected, given, bindings=bound)


@pytest.mark.parametrize("format_", [*sorted(MULTISAMPLED - {"bgra8unorm"}), "depth"])
def test_every_sample(wgsl: Kit, rng: np.random.Generator, format_: str) -> None:
    is_depth = format_ == "depth"
    one = FORMATS["r32float" if is_depth else format_]
    type_ = f"texture_multisampled_2d<{one.scalar}>"
    load = "textureLoad(t, c.yx, c.z)"
    if is_depth:
        type_, load = "texture_depth_multisampled_2d", f"vec4<f32>({load})"
    text = f"""
@group(0) @binding(0) var t: {type_};
fn texel(c: vec3<u32>) -> vec4<{one.scalar}> {{ return {load}; }}
fn size(x: u32) -> vec3<u32> {{
  return vec3<u32>(textureDimensions(t), textureNumSamples(t)) + x;
}}"""
    shape = (5, 7, 4, one.channels)
    texels = rng.random(shape, np.float32) if is_depth else some(rng, shape, format_)
    values = texels / np.float32(255) if "norm" in format_ else texels
    expected = np.zeros((5 * 7 * 4, 4), np.float32 if one.scalar == "f32" else one.dtype)
    expected[:, 3] = 1
    expected[:, : one.channels] = values.reshape(-1, one.channels)
    if is_depth:
        expected[:] = values.reshape(-1, 1)
    at = np.indices(shape[:3]).reshape(3, -1).T
    bound = {"t": texels[..., 0] if one.channels == 1 else texels}
    ulp = 1 if "norm" in format_ else 0
    wgsl.check(text, "texel", lambda _: expected, {"c": at}, bindings=bound, ulp=ulp)
    assert wgsl.run(text, "size", {"x": 0}, bindings=bound).tolist() == [[7, 5, 4]]
    # One sample in place of another is found.
    swapped = {"t": bound["t"][:, :, [0, 2, 1, 3]]}
    with pytest.raises(MismatchError):
        wgsl.check(text, "texel", lambda _: expected, {"c": at}, bindings=swapped, ulp=ulp)


RESOLVE = """
@group(0) @binding(0) var many: texture_multisampled_2d<f32>;
@group(0) @binding(1) var made: texture_storage_2d<r32float, write>;
@compute @workgroup_size(4, 4) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if (any(id.xy >= textureDimensions(many))) { return; }
  var sum = 0.0;
  for (var k = 0u; k < textureNumSamples(many); k++) { sum += textureLoad(many, id.xy, k).x; }
  textureStore(made, id.xy, vec4<f32>(sum / 4.0));
}
@fragment fn seen(@builtin(position) at: vec4<f32>) -> @location(0) f32 {
  return textureLoad(many, vec2<u32>(at.xy), 2u).x;
}"""


def test_samples_in_whole_shaders(wgsl: Kit, rng: np.random.Generator) -> None:
    many = rng.integers(0, 100, (6, 9, 4)).astype(np.float32)
    given = {"many": many, "made": unwritten((6, 9), np.float32)}
    found = wgsl.kernel(RESOLVE, "main", given, workgroups=(3, 2))
    wgsl.compare_image(found["made"], many.mean(axis=2))
    wgsl.compare_image(wgsl.image(RESOLVE, "seen", (9, 6), {"many": many}), many[..., 2])
    program = wgsl.program(RESOLVE, given)
    program.dispatch("main", (3, 2))
    wgsl.compare_image(program.read("made"), many.mean(axis=2))


TEXT = """
@group(0) @binding(0) var flat_: texture_2d<f32>;
@group(0) @binding(1) var line: texture_1d<f32>;
@group(0) @binding(2) var many: texture_multisampled_2d<u32>;
@group(0) @binding(3) var made: texture_storage_2d<r32float, write>;
@group(0) @binding(4) var lights: texture_multisampled_2d<f32>;
fn a(x: f32) -> f32 { return x + textureLoad(flat_, vec2<u32>(), 1).x; }
fn b(x: f32) -> f32 { return x + textureLoad(line, 0u, 1).x; }
fn c(x: f32) -> f32 { return x + f32(textureLoad(many, vec2<u32>(), 1u).x); }
fn d(x: f32) -> f32 { textureStore(made, vec2<u32>(), vec4<f32>(x)); return x; }
fn e(x: f32) -> f32 { return x + textureLoad(lights, vec2<u32>(), 1u).x; }
"""


def zeros(*shape: int) -> F32:
    return np.zeros(shape, np.float32)


@pytest.mark.parametrize(
    ("function", "name", "value", "message"),
    [
        ("a", "flat_", (), "a tuple of no levels"),
        ("a", "flat_", (zeros(4, 4), zeros(2, 1)), "level 1: shape (2, 1), not (2, 2)"),
        ("a", "flat_", (zeros(4, 4), zeros(4, 4)), "level 1: shape (4, 4), not (2, 2)"),
        ("a", "flat_", (zeros(5, 3, 2), zeros(2, 1)),
         "level 1: r32float, and level 0 is rg32float"),
        ("a", "flat_", (zeros(4, 4), zeros(2, 2).astype(np.uint8)),
         "level 1: r8unorm, and level 0 is r32float"),
        ("a", "flat_", (zeros(2, 2), zeros(1, 1), zeros(1, 1)),
         "level 2: level 1 has one texel already, and is the last"),
        ("a", "flat_", (zeros(4, 4), zeros(2)),
         "level 1: shape (2,), not (height, width) or (height, width, 1 or 2 or 4 channels)"),
        ("a", "flat_", (zeros(4, 4), np.ma.masked_less(zeros(2, 2), 1)),
         "level 1: a masked array; give its rows that are not masked"),
        ("a", "flat_", [zeros(4, 4), zeros(2, 2)],
         "arrays of different shapes; the levels of a texture are a tuple"),
        ("b", "line", (zeros(4), zeros(2)), "2 levels, and WebGPU has one of a 1d texture"),
        ("c", "many", (np.zeros((2, 2, 4), np.uint8), np.zeros((1, 1, 4), np.uint8)),
         "2 levels, and WebGPU has one of a multisampled texture"),
        ("d", "made", (zeros(2, 2), zeros(1, 1)),
         "2 levels, and WebGPU has one of a storage texture"),
        ("c", "many", np.zeros((2, 2, 2), np.uint8),
         "shape (2, 2, 2), not (height, width, 4 samples) or (height, width, 4 samples, 1 or 2 or "
         "4 channels)"),
        ("c", "many", np.full((2, 2, 4), 70000), "uint16 does not hold the int64 70000 of texel "),
        ("e", "lights", np.full((2, 2, 4, 2), 0.1, np.float32),
         "float16 does not hold the float32 0.10000000149011612 of texel (0, 0, 0, 0); convert "),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    wgsl: Kit, function: str, name: str, value: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, function, {"x": 1.0}, bindings={name: value})
    assert str(caught.value).startswith(f"bindings: {name}: {message}")
    assert not ran
