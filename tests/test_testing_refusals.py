"""What cannot be done is told in words, before anything runs, whatever a person tries."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit, Sampler

TEXT = """
override GAIN: f32 = 2.0;
override COUNT: u32 = 2u;
override EACH: u32 = 8u / COUNT;
struct Box { a: f32, n: u32 }
@group(0) @binding(0) var<storage, read_write> d: array<f32>;
@group(0) @binding(1) var<uniform> box: Box;
@group(0) @binding(2) var<storage, read_write> m: array<mat3x3<f32>, 2>;
@group(0) @binding(3) var<storage, read_write> grid: array<u32, 3>;
fn f(x: f32) -> f32 { return GAIN * x + 0.0 * f32(EACH); }
fn put() { d[0] = 9.0; }
fn both(d: ptr<function, f32>) { put(); *d += 1.0; }
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  d[id.x] = box.a * d[id.x];
}
@compute @workgroup_size(1) fn turn() { m[0] = m[1]; }
@compute @workgroup_size(4096) fn large() { d[0] = 1.0; }
@fragment fn seen(@location(0) uv: vec2<f32>) -> @location(0) vec4<f32> { return uv.xyxy; }
@vertex fn corner(@builtin(vertex_index) k: u32) -> @builtin(position) vec4<f32> {
  return vec4<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
"""
X = np.arange(4, dtype=np.float32)
BOX = {"a": 1.0, "n": 1}


def twice(x: Any) -> Any:
    return 2 * x


def program(k: Kit) -> Any:
    return k.program(TEXT, {"d": X, "box": BOX, "grid": [1, 1, 1]})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.check(TEXT, "f", 2 * X, {"x": X}), "reference: ndarray is no function"),
        (lambda k: k.check(TEXT, "f", twice, {"x": X}, margin=2), "margin: int is no function"),
        (lambda k: k.check(TEXT, "f", twice, {"x": X}, preprocess="x"),
         "preprocess: str is no function"),
        (lambda k: k.run(TEXT, "f", {"x": X}, returns=1), "returns: 1 is not a tuple of names"),
        (lambda k: k.run(TEXT, "f", {"x": X}, returns={"result"}),
         "returns: {'result'} is not a tuple of names"),
        (lambda k: k.run(TEXT, "f", {"x": X}, constants={"GAIN": np.nan}),
         "constants: GAIN: nan is not finite, and WebGPU takes no other"),
        (lambda k: k.run(TEXT, "f", {"x": X}, constants={"GAIN": np.float32(np.inf)}),
         "constants: GAIN: inf is not finite, and WebGPU takes no other"),
        (lambda k: k.kernel(TEXT, "turn", {"m": np.zeros((2, 3, 4), np.float32)}),
         "bindings: m: shape (2, 3, 4), not (2, 3, 3)"),
        (lambda k: k.kernel(TEXT, "main", {"d": np.zeros((2, 3), np.float32), "box": BOX}),
         "bindings: d: shape (2, 3), not (elements)"),
        (lambda k: k.kernel(TEXT, "main", {"d": [1, 0.1], "box": {"a": [1, 2], "n": 1}}),
         "bindings: box.a: shape (2,), not one value"),
        (lambda k: k.kernel(TEXT, "main", {"d": X, "box": {"a": 1.0, "n": -1}}),
         "bindings: box.n: uint32 does not hold the int64 -1; convert it first"),
        (lambda k: k.kernel(TEXT, "main", {"d": np.full(3, 0.1), "box": BOX}),
         "bindings: d: float32 does not hold the float64 0.1 of element 0; convert it first"),
        (lambda k: program(k).dispatch("main", 2, indirect="grid"),
         "workgroups: 2, and indirect tells how many there are"),
        (lambda k: program(k).dispatch("main", indirect="grid", offset="0"),
         "offset: '0' is not a multiple of 4 of 0 to 0"),
        (lambda k: program(k).dispatch("main", indirect="grid", offset=0.0),
         "offset: 0.0 is not a multiple of 4 of 0 to 0"),
        (lambda k: k.run(TEXT, "both", {"d": [1.0]}, bindings={"d": X}, returns=("d",)),
         "WGSL: both has a parameter d, and uses what is declared as d too; which is meant cannot "
         "be told"),
        (lambda k: k.kernel(TEXT, "seen", {}),
         "WGSL: seen is the entry point of a fragment shader; `image` draws with those"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(wgsl: Kit, call: Callable[[Kit], Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == message


LINEAR = """
@group(0) @binding(0) var t: texture_2d<u32>;
@group(0) @binding(1) var s: texture_2d<f32>;
@group(0) @binding(2) var way: sampler;
fn smooth_(x: f32) -> f32 { return textureSampleLevel(s, way, vec2<f32>(x), 0.0).x; }
"""


@pytest.mark.parametrize(
    ("call", "start", "words"),
    [
        # The shader's fault, by its name; naga, Dawn and Tint have words of their own.
        (lambda k: k.kernel(TEXT, "large", {"d": X}), "WGSL: large: ", "4096"),
        (lambda k: k.image(TEXT, "seen", (2, 2), vertex="corner"),
         "WGSL: seen: ", "not provided|location 0"),
        (lambda k: k.run(TEXT, "f", {"x": X}, constants={"COUNT": 0}),
         "WGSL: f: ", "Division by zero|8 / 0"),
    ],
)  # fmt: skip
def test_what_the_device_refuses_is_told_of_the_shader(
    wgsl: Kit, call: Callable[[Kit], Any], start: str, words: str
) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        call(wgsl)
    assert str(caught.value).startswith(start)
    assert "While calling" not in str(caught.value)


def test_floats_that_a_device_does_not_filter_are_told(wgsl: Kit) -> None:
    if not wgsl._compute.is_naga:
        pytest.skip("Dawn opens no second device on an adapter")
    import wgpu

    device = wgpu.gpu.request_adapter_sync().request_device_sync()
    bound = {"s": np.eye(2, dtype=np.float32), "way": Sampler("linear")}
    with pytest.raises(UsageError) as caught:
        Kit(device).run(LINEAR, "smooth_", {"x": 0.5}, bindings=bound)
    assert str(caught.value).startswith("WGSL: smooth_: ")
    assert "Non-filterable float textures can't be sampled" in str(caught.value)


def test_a_buffer_beyond_what_the_device_has_is_named(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = {**wgsl.device.limits, "max-storage-buffer-binding-size": 64}
    small = type("Small", (), {"features": wgsl.device.features, "limits": limits})()
    kit = Kit(wgsl.device)
    monkeypatch.setattr(kit, "device", small)
    given = {"d": np.zeros(17, np.float32), "box": BOX}
    with pytest.raises(UsageError) as caught:
        kit.kernel(TEXT, "main", given)
    assert str(caught.value).startswith("bindings: d: 68 bytes, and a storage buffer of the device")
    assert str(caught.value).endswith(" has 64 at most")
