"""Textures as public WGSL has them: handed to helpers, of several levels, of several samples.

Every test names a project and a file where its construct was seen. The code and the references are
our own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.testing import Kit, MismatchError, Sampler

F32 = NDArray[np.float32]


def test_a_helper_that_is_handed_a_texture_and_its_sampler(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    # MagnusThor/demolishedWebGPU, example/shaders/compute/textureHelpers.ts: a helper takes the
    # texture and the sampler, and turns the place around.
    text = """
fn turned(picture: texture_2d<f32>, way: sampler, uv: vec2<f32>) -> vec4<f32> {
  return textureSampleLevel(picture, way, -uv, 0.0);
}"""
    picture = rng.integers(0, 256, (4, 8, 4), np.uint8)
    cell = rng.integers(0, 4, (200, 2))
    uv = ((cell + 0.5) / (8, 4)).astype(np.float32)

    def turned(picture: Any, way: Sampler, _: F32) -> Any:
        assert way.address == "repeat"
        return picture[3 - cell[:, 1], 7 - cell[:, 0]] / np.float32(255)

    given = {"picture": picture, "way": Sampler(address="repeat"), "uv": uv}
    wgsl.check(text, "turned", turned, given, ulp=1)
    with pytest.raises(MismatchError):
        wgsl.check(text.replace("-uv", "uv"), "turned", turned, given, ulp=1)


def test_a_picture_of_the_mean_of_samples(wgsl: Kit, rng: np.random.Generator) -> None:
    # nannou-org/nannou, nannou_wgpu/src/texture/reshaper/shaders/fs_msaa16.wgsl: a fragment shader
    # loads every sample of the texel that it is at, and adds them up.
    text = """
struct Color { @location(0) color: vec4<f32> }
@group(0) @binding(0) var many: texture_multisampled_2d<f32>;
@fragment fn resolved(@location(0) uv: vec2<f32>) -> Color {
  let texel = vec2<i32>(vec2<f32>(textureDimensions(many)) * uv);
  var sum = textureLoad(many, texel, 0);
  sum += textureLoad(many, texel, 1);
  sum += textureLoad(many, texel, 2);
  sum += textureLoad(many, texel, 3);
  return Color(sum * 0.25);
}"""
    many = rng.integers(0, 256, (9, 7, 4, 4), np.uint8)
    expected = many.mean(axis=2) / 255
    wgsl.compare_image(wgsl.image(text, "resolved", (7, 9), {"many": many}), expected, atol=1e-6)
    planted = text.replace("texel, 3", "texel, 2")
    with pytest.raises(MismatchError):
        wgsl.compare_image(
            wgsl.image(planted, "resolved", (7, 9), {"many": many}), expected, atol=1e-6
        )


def test_a_picture_of_one_level(wgsl: Kit, rng: np.random.Generator) -> None:
    # feng3d-labs/webgpu, examples/src/webgpu/samplerParameters/showTexture.wgsl: a level is loaded
    # by its number, its size is a power of two.
    text = """
override SIZE = 16u;
@group(0) @binding(0) var picture: texture_2d<f32>;
@group(0) @binding(1) var<uniform> level: u32;
@fragment fn shown(@location(0) uv: vec2<f32>) -> @location(0) f32 {
  let size = f32(SIZE >> level);
  return textureLoad(picture, vec2<i32>(uv * size), i32(level)).x;
}"""
    levels = tuple(rng.random((16 >> k, 16 >> k), np.float32) for k in range(5))
    for k, level in enumerate(levels):
        bound = {"picture": levels, "level": k}
        expected = np.kron(level, np.ones((1 << k, 1 << k), np.float32))
        wgsl.compare_image(wgsl.image(text, "shown", (16, 16), bound), expected)
        if k:
            planted = text.replace("i32(level)", "0")
            with pytest.raises(MismatchError):
                wgsl.compare_image(wgsl.image(planted, "shown", (16, 16), bound), expected)
