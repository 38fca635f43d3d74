"""Textures of every format and dimension go in and come back; samplers do what NumPy does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.device.textures import FORMATS
from halfstep.errors import AdapterError, UsageError
from halfstep.testing import Kit, MismatchError, Sampler, unwritten

F32 = NDArray[np.float32]
FULL = {"u1": 255, "i1": 127, "u2": 65535, "i2": 32767}


def seen(texels: NDArray[Any], format_: str) -> NDArray[Any]:
    """What a shader sees of texels (…, channels) of a format."""
    if "norm" not in format_:
        return texels.astype(np.float32) if "float" in format_ else texels
    return np.maximum(texels / np.float32(FULL[texels.dtype.str[1:]]), np.float32(-1))


def some(rng: np.random.Generator, shape: tuple[int, ...], format_: str) -> NDArray[Any]:
    dtype: np.dtype[Any] = FORMATS[format_].dtype
    if dtype.kind == "f":
        return rng.normal(size=shape).astype(dtype)
    limits = np.iinfo(dtype)
    return rng.integers(limits.min, limits.max, shape, dtype, endpoint=True)


def four(values: NDArray[Any]) -> NDArray[Any]:
    """Texels (…, channels) as a shader loads them: without channels 0, and 1 for alpha."""
    result = np.zeros((*values.shape[:-1], 4), values.dtype)
    result[..., 3] = 1
    result[..., : values.shape[-1]] = values
    return result


SAMPLED = [name for name in FORMATS if name != "bgra8unorm"]


@pytest.mark.parametrize("format_", SAMPLED)
def test_a_shader_sees_the_texels_that_it_is_given(
    wgsl: Kit, rng: np.random.Generator, format_: str
) -> None:
    one = FORMATS[format_]
    if one.feature and one.feature not in wgsl.device.features:
        pytest.skip(f"the device has no {one.feature}")
    text = f"""
@group(0) @binding(0) var image: texture_2d<{one.scalar}>;
fn texel(at: vec2<u32>) -> vec4<{one.scalar}> {{ return textureLoad(image, at, 0); }}
fn size(x: u32) -> vec2<u32> {{ return textureDimensions(image) + x; }}
"""
    texels = some(rng, (5, 7, one.channels), format_)
    at = np.stack(np.meshgrid(np.arange(7), np.arange(5)), -1).astype(np.uint32)
    given = {"image": texels}
    expected = four(seen(texels, format_))
    ulp = 1 if "norm" in format_ else 0
    wgsl.check(text, "texel", lambda _: expected, {"at": at}, bindings=given, ulp=ulp)
    assert wgsl.run(text, "size", {"x": 0}, bindings=given).tolist() == [[7, 5]]
    if one.channels == 1:
        given = {"image": texels[:, :, 0]}
        wgsl.check(text, "texel", lambda _: expected, {"at": at}, bindings=given, ulp=ulp)


STORED = [
    "rgba8unorm", "rgba8snorm", "rgba8uint", "rgba8sint", "rgba16uint", "rgba16sint",
    "rgba16float", "r32uint", "r32sint", "r32float", "rg32uint", "rg32sint", "rg32float",
    "rgba32uint", "rgba32sint", "rgba32float", "bgra8unorm", "r8unorm", "rg16float",
]  # fmt: skip


@pytest.mark.parametrize("format_", STORED)
def test_a_storage_texture_comes_back(wgsl: Kit, rng: np.random.Generator, format_: str) -> None:
    one = FORMATS[format_]
    tier = "texture-adapter-specific-format-features"
    needed = {one.feature or tier} if format_ in STORED[-3:] else set()
    if needed - set(wgsl.device.features):
        pytest.skip(f"the device has no {needed}")
    text = f"""
@group(0) @binding(0) var given: texture_2d<{one.scalar}>;
@group(0) @binding(1) var made: texture_storage_2d<{format_}, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
  let size = textureDimensions(made);
  if (any(id.xy >= size)) {{ return; }}
  textureStore(made, size - id.xy - 1u, textureLoad(given, id.xy, 0));
}}
"""
    texels = some(rng, (9, 11, one.channels), format_)
    if format_.endswith("snorm"):
        texels = np.maximum(texels, -127)
    shape = texels.shape if one.channels > 1 else texels.shape[:2]
    bound = {"given": texels, "made": unwritten(shape, one.dtype)}
    found = wgsl.kernel(text, "main", bound, workgroups=(2, 2))["made"]
    np.testing.assert_array_equal(found, texels[::-1, ::-1].reshape(shape))


DIMENSIONS: list[tuple[str, str, tuple[int, ...]]] = [
    ("texture_1d<f32>", "textureLoad(t, c.x, 0)", (6,)),
    ("texture_2d<f32>", "textureLoad(t, c.yx, 0)", (5, 6)),
    ("texture_2d_array<f32>", "textureLoad(t, c.zy, c.x, 0)", (3, 5, 6)),
    ("texture_3d<f32>", "textureLoad(t, c.zyx, 0)", (3, 5, 6)),
    ("texture_depth_2d", "vec4<f32>(textureLoad(t, c.yx, 0))", (5, 6)),
    ("texture_depth_2d_array", "vec4<f32>(textureLoad(t, c.zy, c.x, 0))", (3, 5, 6)),
]


@pytest.mark.parametrize(("type_", "load", "shape"), DIMENSIONS)
def test_every_dimension(
    wgsl: Kit, rng: np.random.Generator, type_: str, load: str, shape: tuple[int, ...]
) -> None:
    text = f"""
alias Texels = {type_};
@group(1) @binding(3) var t: Texels;
fn texel(c: vec3<i32>) -> f32 {{ return {load}.x; }}
"""
    texels = rng.random(shape, np.float32)
    axes = np.indices(shape).reshape(len(shape), -1)
    at = np.zeros((axes.shape[1], 3), np.int32)
    at[:, : len(shape)] = axes.T
    bound = {"t": texels}
    wgsl.check(text, "texel", lambda _: texels.reshape(-1), {"c": at}, bindings=bound)
    with pytest.raises(MismatchError):
        wgsl.check(text, "texel", lambda _: texels.reshape(-1)[::-1], {"c": at}, bindings=bound)


@pytest.mark.parametrize("dimension", ["1d", "2d", "2d_array", "3d"])
def test_every_dimension_of_storage(wgsl: Kit, dimension: str) -> None:
    at, shape = {
        "1d": ("id.x", (4,)),
        "2d": ("id.xy", (3, 4)),
        "2d_array": ("id.xy, id.z", (2, 3, 4)),
        "3d": ("id", (2, 3, 4)),
    }[dimension]
    text = f"""
@group(0) @binding(0) var t: texture_storage_{dimension}<r32uint, write>;
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
  textureStore(t, {at}, vec4<u32>(id.x + 10u * id.y + 100u * id.z));
}}"""
    found = wgsl.kernel(text, "main", {"t": unwritten(shape, np.uint32)}, workgroups=shape[::-1])
    parts = np.indices(shape)[::-1]
    expected = sum(10**k * part for k, part in enumerate(parts))
    wgsl.compare(found["t"], expected)


def test_texels_that_are_read_and_written(wgsl: Kit, rng: np.random.Generator) -> None:
    text = """
@group(0) @binding(0) var t: texture_storage_2d<r32float, read_write>;
@compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  textureStore(t, id.xy, textureLoad(t, id.xy) * 2.0);
}"""
    texels = rng.random((3, 4), np.float32)
    found = wgsl.kernel(text, "main", {"t": texels}, workgroups=(4, 3))
    wgsl.compare(found, {"t": 2 * texels})


SAMPLING = """
@group(0) @binding(0) var image: texture_2d<f32>;
@group(0) @binding(1) var way: sampler;
fn at(uv: vec2<f32>) -> vec4<f32> { return textureSampleLevel(image, way, uv, 0.0); }
"""


def sampled(texels: NDArray[Any], uv: F32, *, linear: bool, repeats: bool) -> F32:
    """What a sampler gives of texels (H, W, C), in double precision."""
    height, width, _ = texels.shape
    place = uv.astype(np.float64) * (width, height) - 0.5 * linear
    low = np.floor(place).astype(int)
    share = (place - low) * linear
    total = np.zeros((len(uv), texels.shape[2]))
    for right in (0, 1):
        for down in (0, 1):
            x, y = low[:, 0] + right, low[:, 1] + down
            x = x % width if repeats else np.clip(x, 0, width - 1)
            y = y % height if repeats else np.clip(y, 0, height - 1)
            weight = np.abs(1 - right - share[:, 0]) * np.abs(1 - down - share[:, 1])
            total += weight[:, None] * texels[y, x]
    return total.astype(np.float32)


@pytest.mark.parametrize("repeats", [False, True])
@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.float16, np.float32])
def test_samplers(
    wgsl: Kit, rng: np.random.Generator, linear: bool, repeats: bool, dtype: Any
) -> None:
    if linear and dtype == np.float32 and "float32-filterable" not in wgsl.device.features:
        pytest.skip("the device has no float32-filterable")
    texels = (rng.random((4, 8, 4)) * (255 if dtype == np.uint8 else 1)).astype(dtype)
    values = texels / np.float32(255) if dtype == np.uint8 else texels.astype(np.float32)
    uv = rng.uniform(-1, 2, (500, 2)).astype(np.float32)
    way = Sampler("linear" if linear else "nearest", "repeat" if repeats else "clamp-to-edge")

    def reference(uv: F32) -> F32:
        return sampled(values, uv, linear=linear, repeats=repeats)

    # WebGPU lets a device weigh texels in steps of 1/256 and coarser; lavapipe takes those.
    census = wgsl.check(
        SAMPLING, "at", reference, {"uv": uv}, bindings={"image": texels, "way": way},
        atol=2 / 256 if linear else 1e-6,
        margin=lambda uv: np.abs((uv * (8, 4) + 0.5) % 1 - 0.5).min(axis=1) / 1e-5,
    )  # fmt: skip
    assert census.ambiguous < 5
    with pytest.raises(MismatchError):
        wgsl.check(
            SAMPLING, "at", reference, {"uv": uv}, atol=2 / 256,
            bindings={"image": texels, "way": Sampler("nearest" if linear else "linear")},
        )  # fmt: skip


def test_a_sampler_that_compares_depths(wgsl: Kit, rng: np.random.Generator) -> None:
    text = """
@group(0) @binding(0) var shadow: texture_depth_2d;
@group(0) @binding(1) var closer: sampler_comparison;
fn lit(uv: vec2<f32>, depth: f32) -> f32 {
  return textureSampleCompareLevel(shadow, closer, uv, depth);
}"""
    depths = rng.random((8, 8), np.float32)
    cell = rng.integers(0, 8, (300, 2))
    uv, depth = ((cell + 0.5) / 8).astype(np.float32), rng.random(300, np.float32)
    bound = {"shadow": depths, "closer": Sampler(compare="less")}
    given = {"uv": uv, "depth": depth}
    wgsl.check(
        text, "lit", lambda _, d: 1 * (d < depths[cell[:, 1], cell[:, 0]]), given, bindings=bound
    )


def test_the_faces_of_a_cube(wgsl: Kit) -> None:
    text = """
@group(0) @binding(0) var sky: texture_cube<f32>;
@group(0) @binding(1) var way: sampler;
fn seen(toward: vec3<f32>) -> f32 { return textureSampleLevel(sky, way, toward, 0.0).x; }
"""
    faces = np.repeat(np.arange(6, dtype=np.float32), 4).reshape(6, 2, 2)
    toward = np.array([[k == a for k in range(3)] for a in (0, 1, 2)], np.float32)
    toward = np.stack([toward, -toward], 1).reshape(6, 3)
    bound = {"sky": faces, "way": Sampler()}
    wgsl.check(text, "seen", lambda _: np.arange(6), {"toward": toward}, bindings=bound)


def test_python_lists_are_textures_too(wgsl: Kit) -> None:
    text = SAMPLING.replace("textureSampleLevel(image, way, uv, 0.0)", "textureLoad(image, 0u, 0)")
    text = text.replace("0u", "vec2<u32>(1u, 0u)")
    bound = {"image": [[0.1, 0.2], [0.3, 0.4]]}
    found = wgsl.run(text, "at", {"uv": [0.0, 0.0]}, bindings=bound)
    assert found.tolist() == [[np.float32(0.2), 0, 0, 1]]


STORE = """
@group(0) @binding(0) var t: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(1) var u: texture_2d<u32>;
@group(0) @binding(2) var cube: texture_cube<f32>;
@group(0) @binding(3) var way: sampler;
@group(0) @binding(4) var depth: texture_depth_2d;
@group(0) @binding(5) var closer: sampler_comparison;
@group(0) @binding(6) var many: texture_multisampled_2d<f32>;
fn store(x: f32) -> f32 { textureStore(t, vec2<u32>(), vec4<f32>(x)); return x; }
fn load(x: f32) -> f32 { return f32(textureLoad(u, vec2<u32>(), 0).x); }
fn sky(x: f32) -> f32 { return textureSampleLevel(cube, way, vec3<f32>(x), 0.0).x; }
fn lit(x: f32) -> f32 { return textureSampleCompareLevel(depth, closer, vec2<f32>(x), x); }
fn flat_(x: f32) -> f32 { return textureSample(cube, way, vec3<f32>(x)).x; }
fn lots(x: f32) -> f32 { return textureLoad(many, vec2<u32>(), 0).x; }
"""
FACES = np.zeros((6, 2, 2), np.float32)
DEPTHS = np.zeros((2, 2), np.float32)


@pytest.mark.parametrize(
    ("function", "bindings", "message"),
    [
        ("store", {"t": np.zeros((2, 2, 3), np.uint8)},
         "bindings: t: shape (2, 2, 3), not (height, width, 4 channels)"),
        ("store", {"t": np.zeros((2, 2, 4))}, "bindings: t: float64 where uint8 is wanted"),
        ("store", {"t": np.zeros((0, 2, 4), np.uint8)},
         "bindings: t: shape (0, 2, 4), not (height, width, 4 channels)"),
        ("load", {"u": np.zeros((2, 2), np.float32)},
         "bindings: u: float32 where uint32 is wanted"),
        ("load", {"u": np.zeros(5, np.uint8)},
         "bindings: u: shape (5,), not (height, width) or (height, width, 1 or 2 or 4 channels)"),
        ("load", {"u": [[1, 2], [3]]}, None),
        ("load", {"u": np.full((2, 2), -1)},
         "bindings: u: uint32 does not hold the int64 -1 of texel (0, 0); convert it "
         "first"),
        ("load", {"u": np.zeros((1, 20000), np.uint8)}, "bindings: u: width 20000 is more than "),
        ("load", {"u": np.ma.masked_less(np.ones((2, 2), np.uint8), 1)},
         "bindings: u: a masked array; give its rows that are not masked"),
        ("sky", {"cube": np.zeros((5, 2, 2), np.float32), "way": Sampler()},
         "bindings: cube: shape (5, 2, 2), and a cube has 6 squares, +x, -x, +y, -y, +z, -z"),
        ("sky", {"cube": FACES, "way": "linear"},
         "bindings: way: str is not a halfstep.testing.Sampler"),
        ("sky", {"cube": FACES, "way": Sampler(compare="less")},
         "bindings: way: the sampler does not compare, and compare is 'less'"),
        ("sky", {"cube": FACES}, "WGSL: sky uses way, which bindings do not give"),
        ("lit", {"depth": DEPTHS, "closer": Sampler()},
         "bindings: closer: the sampler compares, and compare is ''"),
        ("lit", {"depth": DEPTHS[..., None], "closer": Sampler(compare="less")},
         "bindings: depth: shape (2, 2, 1), not (height, width)"),
        ("lit", {"depth": [[1, -0.5]], "closer": Sampler(compare="less")},
         "bindings: depth: -0.5 at (0, 1) is no depth, which are 0 to 1"),
        ("lit", {"depth": [[1, 0], [np.nan, 0]], "closer": Sampler(compare="less")},
         "bindings: depth: nan at (1, 0) is no depth, which are 0 to 1"),
        ("flat_", {"cube": FACES, "way": Sampler()},
         "WGSL: flat_ uses textureSample, in which invocations take part together; "),
        ("lots", {"many": DEPTHS},
         "bindings: many: shape (2, 2), not (height, width, 4 samples) or (height, width, "
         "4 samples, 1 or 2 or 4 channels)"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    wgsl: Kit, function: str, bindings: Any, message: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        wgsl.run(STORE, function, {"x": 1.0}, bindings=bindings)
    assert str(caught.value).startswith(message or "bindings: u: not an array: ")
    assert not ran


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sampler("cubic"), "Sampler: filter: 'cubic' is none of nearest, linear"),
        (lambda: Sampler(address="clamp"),
         "Sampler: address: 'clamp' is none of clamp-to-edge, repeat, mirror-repeat"),
        (lambda: Sampler(compare="<"), "Sampler: compare: '<' is none of never, less, equal, "
         "less-equal, greater, not-equal, greater-equal, always"),
    ],
)  # fmt: skip
def test_a_sampler_that_is_none_is_named(make: Callable[[], Sampler], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        make()
    assert str(caught.value) == message


def test_a_format_that_the_device_lacks_is_named(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    kit = Kit(wgsl.device)
    poor = type("Poor", (), {"features": frozenset[str](), "limits": wgsl.device.limits})()
    monkeypatch.setattr(kit, "device", poor)
    image = np.zeros((2, 2), np.uint16)
    with pytest.raises(AdapterError) as caught:
        kit.run(SAMPLING, "at", {"uv": [0, 0]}, bindings={"image": image, "way": Sampler()})
    assert str(caught.value) == (
        "bindings: image: the device has no texture-format16bit-norm, which r16unorm needs"
    )


def test_a_wrong_texel_is_found(wgsl: Kit) -> None:
    text = """
@group(0) @binding(0) var made: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  var x = vec4<f32>(id.xyxy);
  if (all(id.xy == vec2<u32>(5u, 3u))) { x.z += 1.0; }
  textureStore(made, id.xy, x);
}"""
    found = wgsl.kernel(text, "main", {"made": unwritten((8, 8, 4), np.float32)})["made"]
    x, y = np.meshgrid(np.arange(8), np.arange(8))
    expected = np.stack([x, y, x, y], -1)
    with pytest.raises(MismatchError) as caught:
        wgsl.compare(found.reshape(64, 4), expected.reshape(64, 4))
    assert [row.index for row in caught.value.census.first] == [3 * 8 + 5]
