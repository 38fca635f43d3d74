"""Textures, samplers and pointers into buffers are given to the parameters of a function."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError, Sampler, unwritten

F32 = NDArray[np.float32]

TEXT = """
alias Picture = texture_2d<f32>;
@group(0) @binding(2) var<uniform> gain: f32;
@group(0) @binding(3) var t: texture_2d<f32>;

fn texel(x: i32, picture: Picture, y: i32) -> f32 {
  return gain * textureLoad(picture, vec2<i32>(x, y), 0).x;
}
fn between(uv: vec2<f32>, picture: texture_2d<f32>, way: sampler) -> f32 {
  return textureSampleLevel(picture, way, uv, 0.0).x;
}
fn difference(a: texture_2d<i32>, b: texture_2d<i32>, at: vec2<u32>) -> i32 {
  return textureLoad(a, at, 0).x - textureLoad(b, at, 0).x;
}
fn lit(shadows: texture_depth_2d, closer: sampler_comparison, uv: vec2<f32>, depth: f32) -> f32 {
  return textureSampleCompareLevel(shadows, closer, uv, depth);
}
fn mean(many: texture_multisampled_2d<f32>, at: vec2<u32>) -> f32 {
  var sum = 0.0;
  for (var k = 0u; k < 4u; k++) { sum += textureLoad(many, at, k).x; }
  return sum / 4.0;
}
fn level(picture: texture_2d<f32>, k: u32) -> f32 {
  return textureLoad(picture, vec2<u32>(0u), k).x;
}
fn width(picture: texture_1d<f32>) -> u32 { return textureDimensions(picture); }
fn step_(picture: texture_2d<f32>, x: ptr<function, f32>) {
  *x += textureLoad(picture, vec2<u32>(1u, 0u), 0).x;
}
fn both(t: texture_2d<f32>, x: f32) -> f32 { return x + hidden() + hides(t, 0.0); }
fn hidden() -> f32 { return textureLoad(t, vec2<u32>(), 0).x; }
fn hides(t: texture_2d<f32>, x: f32) -> f32 { return x + textureLoad(t, vec2<u32>(), 0).x; }
fn flat_(t: texture_2d<f32>, way: sampler, x: f32) -> f32 {
  return textureSample(t, way, vec2<f32>(x)).x;
}
"""


STORE = """
var<private> seed: f32;
fn put(made: texture_storage_2d<r32float, write>, at: vec2<u32>, value: f32) -> f32 {
  textureStore(made, at, vec4<f32>(2.0 * value));
  return value + seed;
}
fn size(made: texture_storage_2d<r32float, write>) -> vec2<u32> { return textureDimensions(made); }
"""


def image(rng: np.random.Generator) -> F32:
    return rng.random((4, 6), np.float32)


def test_a_texture_among_arguments(wgsl: Kit, rng: np.random.Generator) -> None:
    picture = image(rng)
    y, x = np.indices(picture.shape)
    given = {"x": x, "y": y, "picture": picture}
    seen: list[Any] = []

    def texel(x: Any, picture: F32, y: Any) -> F32:
        seen.append(picture)
        return 2 * picture[y, x]

    census = wgsl.check(TEXT, "texel", texel, given, bindings={"gain": 2.0})
    assert census.rows == 24
    # The reference has the array, and cannot change it.
    assert seen[0].dtype == np.float32
    assert not seen[0].flags.writeable
    wrong = {**given, "picture": picture[::-1]}
    with pytest.raises(MismatchError):
        wgsl.check(TEXT, "texel", lambda *_: 2 * picture, wrong, bindings={"gain": 2.0})
    with pytest.raises(MismatchError):
        wgsl.check(
            TEXT.replace("(x, y), 0", "(y, x), 0"), "texel", texel, given, bindings={"gain": 2.0}
        )


def test_bytes_are_shown_to_a_reference_as_they_are(wgsl: Kit) -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(4, 6)
    given = {"x": [0, 1, 5], "y": [0, 1, 3], "picture": picture.tolist()}

    def texel(x: Any, picture: Any, y: Any) -> Any:
        assert picture.dtype == np.float32
        return picture[y, x]

    wgsl.check(TEXT, "texel", texel, given, bindings={"gain": 1.0})

    def of_bytes(x: Any, picture: Any, y: Any) -> Any:
        assert picture.dtype == np.uint8
        return picture[y, x] / np.float32(255)

    given["picture"] = picture
    wgsl.check(TEXT, "texel", of_bytes, given, bindings={"gain": 1.0}, ulp=1)


def test_a_reference_in_doubles_has_texels_in_doubles(wgsl: Kit, rng: np.random.Generator) -> None:
    picture = image(rng)

    def texel(x: Any, picture: Any, y: Any) -> Any:
        assert picture.dtype == np.float64
        return 3 * picture[y, x]

    given = {"x": [0, 5], "y": [1, 3], "picture": picture}
    bound = {"gain": 3.0}
    wgsl.check(TEXT, "texel", texel, given, bindings=bound, float64=True)
    small = {"x": 0, "y": 0, "picture": np.full((1, 1), 1e-40, np.float32)}
    census = wgsl.check(
        TEXT, "texel", lambda x, p, y: 3 * p[y, x], small, bindings=bound, flush_subnormals=True
    )
    assert census.rows == 1


def test_a_texture_with_its_sampler(wgsl: Kit, rng: np.random.Generator) -> None:
    picture = image(rng).astype(np.float16)
    place = rng.uniform(0.5, 5.5, 200)
    uv = np.stack([place / 6, np.full(200, 0.5 / 4)], 1).astype(np.float32)

    def between(uv: F32, picture: Any, way: Sampler) -> Any:
        assert way.filter == "linear"
        return np.interp(uv[:, 0] * 6, np.arange(6) + 0.5, picture[0])

    given = {"uv": uv, "picture": picture, "way": Sampler("linear")}
    wgsl.check(TEXT, "between", between, given, atol=1 / 256)
    with pytest.raises(MismatchError):
        wgsl.check(
            TEXT, "between", lambda uv, p, _: between(uv, p, Sampler("linear")),
            {**given, "way": Sampler()}, atol=1 / 256,
        )  # fmt: skip


def test_two_textures_are_not_taken_for_each_other(wgsl: Kit, rng: np.random.Generator) -> None:
    a, b = rng.integers(-99, 99, (2, 5, 5), np.int32)
    at = np.stack(np.meshgrid(np.arange(5), np.arange(5)), -1)
    given = {"a": a, "b": b, "at": at}
    wgsl.check(TEXT, "difference", lambda a, b, _: a - b, given)
    with pytest.raises(MismatchError):
        wgsl.check(TEXT.replace("(a, at", "(b, at"), "difference", lambda a, b, _: a - b, given)


def test_depths_samples_and_levels(wgsl: Kit, rng: np.random.Generator) -> None:
    depths, depth = rng.random((1, 8), np.float32), rng.random(8, np.float32)
    uv = np.stack([(np.arange(8) + 0.5) / 8, np.full(8, 0.5)], 1).astype(np.float32)
    given = {"shadows": depths, "closer": Sampler(compare="less"), "uv": uv, "depth": depth}
    wgsl.check(TEXT, "lit", lambda shadows, _, __, d: 1 * (d < shadows[0]), given)
    many = rng.integers(0, 9, (3, 2, 4)).astype(np.float32)
    at = np.stack(np.meshgrid(np.arange(2), np.arange(3)), -1)
    wgsl.check(TEXT, "mean", lambda many, _: many.mean(axis=2), {"many": many, "at": at})
    levels = tuple(rng.random((4 >> k, 4 >> k), np.float32) for k in range(3))
    given = {"picture": levels, "k": np.arange(3)}
    wgsl.check(TEXT, "level", lambda picture, k: [picture[n][0, 0] for n in k], given)


def test_a_function_of_a_texture_alone_has_one_row(wgsl: Kit) -> None:
    found = wgsl.run(TEXT, "width", {"picture": np.zeros(7, np.float32)})
    assert found.tolist() == [7]


def test_a_storage_texture_comes_back(wgsl: Kit, rng: np.random.Generator) -> None:
    at = np.stack(np.meshgrid(np.arange(4), np.arange(3)), -1)
    value = rng.random((3, 4), np.float32)
    given = {"made": unwritten((3, 4), np.float32), "at": at, "value": value, "seed": 1.0}
    if wgsl._compute.is_naga:
        with pytest.raises(UsageError) as caught:
            wgsl.run(STORE, "put", given)
        for part in ("put", "WGSL:3:1", "Image store parameters are invalid", "Not a global"):
            assert part in str(caught.value)
        return
    returns = ("made", "result")

    def put(_: F32, __: Any, value: F32, seed: F32) -> dict[str, F32]:
        return {"made": 2 * value, "result": value + seed}

    wgsl.check(STORE, "put", put, given, returns=returns)
    with pytest.raises(MismatchError):
        wgsl.check(STORE.replace("2.0 * value", "3.0 * value"), "put", put, given, returns=returns)
    # Every run begins with what was given.
    np.testing.assert_array_equal(
        wgsl.run(STORE, "put", given, returns=("made",))["made"], 2 * value
    )


def test_with_a_pointer_of_each_row(wgsl: Kit, rng: np.random.Generator) -> None:
    picture, x = image(rng), rng.random(50, np.float32)
    given = {"picture": picture, "x": x}
    wgsl.check(TEXT, "step_", lambda picture, x: (x + picture[0, 1],), given, returns=("x",))


def test_a_parameter_may_hide_a_variable(wgsl: Kit, rng: np.random.Generator) -> None:
    picture = image(rng)
    given = {"t": picture, "x": [1.0, 2.0]}
    wgsl.check(TEXT, "hides", lambda t, x: x + t[0, 0], given)


POINTERS = """
struct Box { low: vec3<f32>, high: vec3<f32> }
fn inside(box: ptr<uniform, Box>, x: vec3<f32>) -> bool {
  return all(x >= (*box).low) && all(x <= (*box).high);
}
fn pick(table: ptr<storage, array<f32>>, k: u32) -> f32 { return (*table)[k]; }
fn count(k: u32, counts: ptr<storage, array<atomic<u32>>, read_write>) -> u32 {
  atomicAdd(&(*counts)[k], 1u);
  return arrayLength(counts);
}
"""


def test_pointers_into_buffers(wgsl: Kit, rng: np.random.Generator) -> None:
    if wgsl._compute.is_naga:
        with pytest.raises(UsageError) as caught:
            wgsl.run(POINTERS, "pick", {"table": np.ones(3, np.float32), "k": 0})
        assert str(caught.value) == (
            "WGSL: line 3: inside takes a pointer into uniform; naga, the compiler of "
            "wgpu-native, knows those into function and private alone"
        )
        return
    x = rng.random((100, 3), np.float32)
    box = {"low": np.full(3, 0.2, np.float32), "high": np.full(3, 0.9, np.float32)}
    wgsl.check(
        POINTERS, "inside", lambda box, x: ((x >= box["low"]) & (x <= box["high"])).all(axis=1),
        {"box": box, "x": x},
    )  # fmt: skip
    table, k = rng.random(9, np.float32), rng.integers(0, 9, 100)
    wgsl.check(POINTERS, "pick", lambda table, k: table[k], {"table": table, "k": k})
    wgsl.check(
        POINTERS, "count",
        lambda k, counts: {"result": len(counts), "counts": np.bincount(k, minlength=9)},
        {"k": k, "counts": np.zeros(9, np.uint32)}, returns=("result", "counts"),
    )  # fmt: skip
    with pytest.raises(MismatchError):
        wgsl.check(
            POINTERS, "count", lambda k, _: (np.bincount(k, minlength=9) + 1,),
            {"k": k, "counts": np.zeros(9, np.uint32)}, returns=("counts",),
        )  # fmt: skip


PICTURE = np.zeros((2, 2), np.float32)


@pytest.mark.parametrize(
    ("function", "inputs", "message"),
    [
        ("texel", {"x": 0, "y": 0}, "WGSL: texel: inputs do not give picture"),
        ("texel", {"x": 0, "y": 0, "picture": np.zeros(3, np.float32)},
         "inputs: picture: shape (3,), not (height, width) or (height, width, 1 or 2 or 4 "
         "channels)"),
        ("texel", {"x": 0, "y": 0, "picture": np.zeros((2, 2))},
         None),
        ("texel", {"x": 0, "y": 0, "picture": np.full((2, 2), 0.1)},
         "inputs: picture: float32 does not hold the float64 0.1 of texel (0, 0); convert it "
         "first"),
        ("between", {"uv": [0, 0], "picture": PICTURE, "way": "linear"},
         "inputs: way: str is not a halfstep.testing.Sampler"),
        ("both", {"t": PICTURE, "x": 1.0},
         "WGSL: both has a parameter t, and uses what is declared as t too; which is meant cannot "
         "be told"),
        ("flat_", {"t": PICTURE, "way": Sampler(), "x": 1.0},
         "WGSL: flat_ uses textureSample, in which invocations take part together; a function is "
         "run for each row alone, and `kernel` runs whole compute shaders"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    wgsl: Kit, function: str, inputs: Any, message: str | None
) -> None:
    bound = {"gain": 1.0} if function == "texel" else {"t": PICTURE} if function == "both" else {}
    if message is None:
        # A float32 holds these.
        wgsl.run(TEXT, function, inputs, bindings=bound)
        return
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, function, inputs, bindings=bound)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("returns", "message"),
    [
        (("picture",), "WGSL: texel: returns: nothing can be written to picture"),
        (("nothing",), "WGSL: texel: returns: there is no 'nothing'; there is result"),
    ],
)
def test_an_answer_that_is_none_is_named(wgsl: Kit, returns: Any, message: str) -> None:
    given = {"x": 0, "y": 0, "picture": PICTURE}
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, "texel", given, bindings={"gain": 1.0}, returns=returns)
    assert str(caught.value) == message


def test_a_place_in_one_of_several_texts_is_told(wgsl: Kit) -> None:
    if not wgsl._compute.is_naga:
        pytest.skip("only naga refuses the pointer")
    second = "\n\nfn f(a: f32, p: ptr<workgroup, f32>) -> f32 { return a; }"
    with pytest.raises(UsageError) as caught:
        wgsl.run(["fn g() {}\n", second], "g", {})
    assert str(caught.value) == (
        "WGSL 2: line 3: f takes a pointer into workgroup; naga, the compiler of wgpu-native, "
        "knows those into function and private alone"
    )
