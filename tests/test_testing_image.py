"""Fragment shaders are drawn, and pictures compared with arrays and with stored answers."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imageio.v3 import imread

from halfstep.errors import DeviceError, UsageError
from halfstep.testing import Kit, MismatchError, Sampler

pytest_plugins = ["pytester"]

TEXT = """
struct Surface {
  @location(0) color: vec4<f32>, @location(2) id: u32, @builtin(frag_depth) far: f32
}
struct Corner { @builtin(position) at: vec4<f32>, @location(0) tint: vec3<f32> }
struct Given { @builtin(position) at: vec4<f32>, @location(1) uv: vec2f }
override ROUNDS = 3u;
@group(0) @binding(0) var<uniform> centre: vec2<f32>;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var way: sampler;
@group(1) @binding(0) var<storage, read_write> hits: atomic<u32>;

fn disc(at: vec2<f32>, r: f32) -> f32 { return length(at - centre) - r; }
@fragment fn plain(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> { return at; }
@fragment fn holed(@builtin(position) at: vec4<f32>) -> @location(0) f32 {
  let far = disc(at.xy, 5.0);
  if (far > 0.0) { discard; }
  return far;
}
@fragment fn place(in: Given) -> @location(0) vec2<f32> { return in.uv; }
@fragment fn parts(@builtin(position) at: vec4<f32>) -> Surface {
  var sum = 0u;
  for (var k = 0u; k < ROUNDS; k++) { sum += u32(at.x) + k; }
  return Surface(vec4<f32>(at.yx, 0.25, 1.0), sum, at.x / 32.0);
}
@fragment fn shown(@location(0) uv: vec2<f32>) -> @location(0) vec4<f32> {
  return textureSample(image, way, uv);
}
@fragment fn slope(@builtin(position) at: vec4<f32>) -> @location(0) vec2<f32> {
  return vec2<f32>(dpdx(at.x * 3.0), dpdyFine(at.y * at.x));
}
@fragment fn counted(@builtin(position) at: vec4<f32>) -> @location(0) u32 {
  return atomicAdd(&hits, 1u) * 0u + u32(at.x);
}
@vertex fn corner(@builtin(vertex_index) k: u32) -> Corner {
  let at = vec2<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0);
  return Corner(vec4<f32>(at, 0.0, 1.0), vec3<f32>(at * 0.5 + 0.5, centre.x));
}
@fragment fn tinted(@location(0) tint: vec3<f32>) -> @location(0) vec4<f32> {
  return vec4<f32>(tint, 1.0);
}
@fragment fn side(@builtin(front_facing) is_front: bool) -> @location(0) u32 {
  return u32(is_front);
}
@fragment fn three() -> @location(0) vec3<f32> { return vec3<f32>(); }
@fragment fn nothing() { }
@compute @workgroup_size(1) fn main() { }
"""
SIZE = 16, 12
X, Y = np.meshgrid(np.arange(16) + 0.5, np.arange(12) + 0.5)


def stacked(*channels: Any) -> Any:
    return np.stack(np.broadcast_arrays(*channels), axis=-1).astype(np.float32)


def test_every_pixel_is_drawn_at_its_centre(wgsl: Kit) -> None:
    found = wgsl.image(TEXT, "plain", SIZE)
    assert (found.shape, found.dtype) == ((12, 16, 4), np.float32)
    wgsl.compare_image(found, stacked(X, Y, 0, 1))


def test_a_number_alone_and_pixels_that_are_discarded(wgsl: Kit) -> None:
    found = wgsl.image(TEXT, "holed", SIZE, {"centre": [8.0, 6.0]})
    far = np.hypot(X - 8, Y - 6) - 5
    assert found.shape == (12, 16)
    wgsl.compare_image(found, np.where(far > 0, 0, far), atol=1e-6)
    assert 50 < (far <= 0).sum() < 100


def test_the_place_in_the_picture(wgsl: Kit) -> None:
    found = wgsl.image(TEXT, "place", SIZE)
    wgsl.compare_image(found, stacked(X / 16, Y / 12), atol=1e-6)


def test_the_front_is_seen(wgsl: Kit) -> None:
    wgsl.compare_image(wgsl.image(TEXT, "side", SIZE), np.uint32(1))


def test_several_parts_and_constants(wgsl: Kit) -> None:
    found = wgsl.image(TEXT, "parts", SIZE, constants={"ROUNDS": 5})
    assert list(found) == ["color", "id", "far"]
    wgsl.compare_image(found["color"], stacked(Y, X, 0.25, 1))
    wgsl.compare_image(found["id"], 5 * np.floor(X).astype(np.uint32) + 10)
    wgsl.compare_image(found["far"], X / 32, ulp=1)


def test_textures_and_derivatives(wgsl: Kit, rng: np.random.Generator) -> None:
    image = rng.integers(0, 256, (12, 16, 4), np.uint8)
    found = wgsl.image(TEXT, "shown", SIZE, {"image": image, "way": Sampler()})
    wgsl.compare_image(found, image / np.float32(255), ulp=1)
    slope = wgsl.image(TEXT, "slope", SIZE)
    wgsl.compare_image(slope[..., 0], 3.0)
    wgsl.compare_image(slope[..., 1], X, ulp=4)


def test_buffers_that_are_written(wgsl: Kit) -> None:
    wgsl.compare_image(
        wgsl.image(TEXT, "counted", SIZE, {"hits": 0}), np.floor(X).astype(np.uint32)
    )


def test_a_vertex_shader_of_ones_own(wgsl: Kit) -> None:
    found = wgsl.image(TEXT, "tinted", SIZE, {"centre": [0.5, 0]}, vertex="corner")
    wgsl.compare_image(found, stacked(X / 16, 1 - Y / 12, 0.5, 1), atol=1e-6)


def test_loops_that_the_driver_cuts_are_told(wgsl: Kit) -> None:
    if wgsl._loop_limit is None:
        pytest.skip("the driver ends no loops")
    with pytest.raises(DeviceError, match=r"the loops of parts used up the 65,535 rounds"):
        wgsl.image(TEXT, "parts", SIZE, constants={"ROUNDS": 70000})


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.image(TEXT, "three", SIZE),
         "WGSL: three: result: a vec3<f32> is nothing that a pixel holds exactly; numbers, vec2 "
         "and vec4 of f32, f16, u32 and i32 are"),
        (lambda k: k.image(TEXT, "nothing", SIZE), "WGSL: nothing gives no color and no depth"),
        (lambda k: k.image(TEXT, "main", SIZE),
         "WGSL: main is an entry point; `kernel` runs those"),
        (lambda k: k.image(TEXT, "disc", SIZE),
         "WGSL: disc has no @fragment, so it is not an entry point"),
        (lambda k: k.image(TEXT, "tinted", SIZE),
         "WGSL: tinted takes tint at location 0, a vec3<f32>; the kit's own triangle gives a "
         "vec2<f32>, the place in the picture, and `vertex` names a vertex shader that gives more"),
        (lambda k: k.image(TEXT, "tinted", SIZE, vertex="corner"),
         "WGSL: corner uses centre, which bindings do not give"),
        (lambda k: k.image(TEXT, "tinted", SIZE, vertex="plain"),
         "WGSL: plain is the entry point of a fragment shader; `image` draws with those"),
        (lambda k: k.image(TEXT, "plain", SIZE, {"centre": [1, 2]}),
         "WGSL: plain uses no resource 'centre'; it uses none"),
        (lambda k: k.image(TEXT, "plain", (16, 0)),
         "size: (16, 0) is not (width, height) of whole numbers from 1"),
        (lambda k: k.image(TEXT, "plain", 16),
         "size: 16 is not (width, height) of whole numbers from 1"),
        (lambda k: k.image(TEXT, "plain", (2.5, 2)),
         "size: (2.5, 2) is not (width, height) of whole numbers from 1"),
        (lambda k: k.image(TEXT, "plain", (2**20, 2)),
         "size: (1048576, 2) is more than the LIMIT pixels that the device draws"),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_named(
    wgsl: Kit, call: Callable[[Kit], object], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[object] = []
    monkeypatch.setattr("halfstep.testing.kit.draw", lambda *a, **_: drawn.append(a))
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    most = wgsl.device.limits["max-texture-dimension-2d"]
    assert str(caught.value) == message.replace("LIMIT", str(most))
    assert not drawn


def test_a_wrong_pixel_is_named(wgsl: Kit) -> None:
    wrong = TEXT.replace("{ return at; }", "{ return at + f32(all(floor(at.xy) == vec2f(3, 7))); }")
    expected = stacked(X, Y, 0, 1)
    with pytest.raises(MismatchError) as caught:
        wgsl.compare_image(wgsl.image(wrong, "plain", SIZE), expected, name="places")
    census = caught.value.census
    assert (census.rows, census.failed, census.lead) == (192, 1, (12, 16))
    assert str(census).startswith("places: 1 of 192 pixels differ (exact)\n  worst: ")
    assert "\n  pixel [7, 3]\n    found [4.5, 8.5, 1.0, 2.0]\n" in str(census)


def test_the_margin_of_a_pixel(wgsl: Kit) -> None:
    found = np.zeros((3, 4), np.float32)
    found[1, 2] = 1
    margin = np.full((3, 4), 5.0)
    with pytest.raises(MismatchError):
        wgsl.compare_image(found, 0, margin=margin)
    margin[1, 2] = 0.5
    assert wgsl.compare_image(found, 0, margin=margin).ambiguous == 1


def test_a_stored_answer(wgsl: Kit, tmp_path: Path) -> None:
    levels = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    floats = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
    from imageio.v3 import imwrite

    imwrite(tmp_path / "levels.png", levels)
    np.save(tmp_path / "floats.npy", floats)
    wgsl.compare_image(levels, tmp_path / "levels.png")
    wgsl.compare_image(floats, str(tmp_path / "floats.npy"))
    for image, name in ((levels, "levels.png"), (floats, "floats.npy")):
        other = image.copy()
        other[2, 1] += 1
        with pytest.raises(MismatchError) as caught:
            wgsl.compare_image(other, tmp_path / name)
        assert [row.index for row in caught.value.census.first] == [2 * 4 + 1]


@pytest.mark.parametrize(
    ("found", "expected", "message"),
    [
        (np.zeros((2, 2)), "answer.gif", "answer.gif: a stored answer ends with .npy or .png"),
        (np.zeros((2, 2)), Path("nowhere.npy"),
         "nowhere.npy: no such file; --halfstep-regenerate writes it"),
        (np.zeros(4), 0, "found: shape (4,), not (height, width) or more for channels"),
        (np.zeros((2, 0)), 0, "found: shape (2, 0), not (height, width) or more for channels"),
        (np.zeros((2, 2)), np.zeros((3, 2)), "expected: 3 × 2 rows, not 2 × 2"),
        (np.zeros((2, 2, 4)), np.zeros((2, 2, 3)), "expected: shape (2, 2, 3), not (rows, 4)"),
        (np.array([["a"]]), 0, "found: <U1 is not a type of numbers"),
        (np.zeros((2, 2), np.uint8), np.zeros((2, 2), bool),
         "expected: bool where uint8 is wanted"),
    ],
)  # fmt: skip
def test_pictures_that_cannot_be_compared_are_named(
    wgsl: Kit, found: Any, expected: Any, message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.compare_image(found, expected)
    assert str(caught.value) == message


def test_a_file_that_is_no_picture_is_named(wgsl: Kit, tmp_path: Path) -> None:
    for name in ("a.npy", "a.png"):
        (tmp_path / name).write_bytes(b"no picture")
        with pytest.raises(UsageError) as caught:
            wgsl.compare_image(np.zeros((2, 2), np.uint8), tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path / name}: ")


STORED = """
import numpy

FS = "@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) f32 { return at.x * at.y; }"

def test_stored(wgsl):
    found = wgsl.image(FS, "fs", (8, 4))
    wgsl.compare_image(found, "answers.npy")
    wgsl.compare_image(numpy.uint8(found), "answers.png")
"""


@pytest.mark.usefixtures("adapter")
def test_stored_answers_are_written_when_asked_and_never_in_ci(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    test = pytester.makepyfile(test_stored=STORED)
    npy, png_ = (pytester.path / f"answers{ending}" for ending in (".npy", ".png"))
    monkeypatch.setenv("CI", "true")
    result = pytester.runpytest_inprocess("--halfstep-regenerate")
    result.stderr.fnmatch_lines(
        ["*--halfstep-regenerate: not in continuous integration, and CI=true"]
    )
    assert not npy.exists()
    monkeypatch.delenv("CI")
    pytester.runpytest_inprocess("--halfstep-regenerate").assert_outcomes(passed=1)
    x, y = np.meshgrid(np.arange(8) + 0.5, np.arange(4) + 0.5)
    np.testing.assert_array_equal(np.load(npy), x * y)
    np.testing.assert_array_equal(imread(png_), np.uint8(x * y))
    # What is found then is compared with what was stored.
    test.write_text(STORED.replace("at.x * at.y", "at.x * at.y + f32(at.x > 7.0)"))
    result = pytester.runpytest_inprocess("--halfstep-results-path", "results")
    result.stdout.fnmatch_lines(["*image: 4 of 32 pixels differ (exact)"])
    [report] = (pytester.path / "results").glob("*.json")
    assert json.loads(report.read_text())["lead"] == [4, 8]
    picture = imread(report.with_suffix(".png"))
    assert picture.shape == (4, 3 * 8, 3)
    red = (picture[:, 16:] == (255, 0, 96)).all(axis=-1)
    np.testing.assert_array_equal(red, x > 7)


def test_a_png_file_holds_levels_alone(tmp_path: Path) -> None:
    from halfstep.testing.images import store

    with pytest.raises(UsageError) as caught:
        store(tmp_path / "a.png", np.zeros((2, 2), np.float32))
    assert str(caught.value) == (
        f"{tmp_path / 'a.png'}: a PNG file holds uint8 (height, width), (height, width, 3) or "
        "(height, width, 4), not float32 of shape (2, 2); .npy holds it"
    )
    store(tmp_path / "a.npy", np.zeros((2, 2), np.float32))
    assert np.load(io.BytesIO((tmp_path / "a.npy").read_bytes())).shape == (2, 2)
