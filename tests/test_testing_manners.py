"""What one would try first works, what would be silently otherwise is refused."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.device.adapters import describe
from halfstep.device.kept import Kept
from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError, decades
from halfstep.testing import kit as kit_module

TEXT = """
struct Ray { o: vec3<f32>, d: vec3<f32>, id: u32 }
@group(0) @binding(0) var<uniform> gain: vec4<f32>;
@group(0) @binding(1) var<storage, read> table: array<vec2<f32>>;
fn scale(x: f32, k: f32) -> f32 { return x * k; }
fn moved(p: vec3<f32>, m: mat3x3<f32>, by: vec3<f32>) -> vec3<f32> { return m * p + by; }
fn at(ray: Ray, t: f32) -> vec3<f32> { return ray.o + t * ray.d; }
fn pick(k: array<f32, 3>, i: u32) -> f32 { return k[i]; }
fn lit(x: f32) -> f32 { return x * gain.y + table[1].x; }
fn id(ray: Ray) -> u32 { return ray.id; }
fn same(x: f32) -> f32 { return x; }
fn hit(ray: Ray) -> bool { return ray.o.z > 0.0; }
"""
X = np.arange(4, dtype=np.float32)


def test_numbers_and_lists_of_python_are_rounded(wgsl: Kit) -> None:
    x = [0.1, 0.2, 0.3]
    found = wgsl.run(TEXT, "scale", {"x": x, "k": 0.1})
    expected = np.array(x, np.float32) * np.float32(0.1)
    np.testing.assert_array_equal(found, expected)
    bound = {"gain": [0.1, 0.2, 0.3, 0.4], "table": [(0.1, 0.2), (0.3, 0.4)]}
    wgsl.check(
        TEXT, "lit", lambda x: x * np.float32(0.2) + np.float32(0.3), {"x": X}, bindings=bound
    )
    bound["gain"] = (0.1, 0.2, 0.3, 0.4)
    wgsl.run(TEXT, "lit", {"x": X}, bindings=bound)


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (np.array([0.5, 0.1]),
         "inputs: x: float32 does not hold the float64 0.1 of row 1; convert it first"),
        (np.float64(0.1), "inputs: x: float32 does not hold the float64 0.1; convert it first"),
        (np.array([[0.5, 0.1]]),
         "inputs: x: float32 does not hold the float64 0.1 of row (0, 1); convert it first"),
        (1e39, "inputs: x: float32 does not hold the float64 1e+39; convert it first"),
        ([1.0, 1e300], "inputs: x: float32 does not hold the float64 1e+300 of row 1; "),
        (np.ma.masked_less(X, 1), "inputs: x: a masked array; give its rows that are not masked"),
    ],
)  # fmt: skip
def test_arrays_of_numpy_are_not(wgsl: Kit, x: Any, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, "same", {"x": x})
    assert str(caught.value).startswith(message)


def test_one_vector_or_matrix_stands_for_all_rows(wgsl: Kit, rng: np.random.Generator) -> None:
    p = rng.normal(size=(50, 3)).astype(np.float32)
    m = rng.normal(size=(3, 3)).astype(np.float32)
    by = np.array([1, 2, 3], np.float32)

    def moved(p: Any, m: Any, by: Any) -> Any:
        assert (m.shape, by.shape) == ((50, 3, 3), (50, 3))
        return (m.astype(np.float64) @ p[..., None])[..., 0] + by

    wgsl.check(TEXT, "moved", moved, {"p": p, "m": m, "by": by}, atol=1e-5)
    found = wgsl.run(TEXT, "moved", {"p": [1.0, 0, 0], "m": np.eye(3, dtype=np.float32), "by": by})
    assert found.tolist() == [[2, 2, 3]]
    k = np.array([5, 6, 7], np.float32)
    i = np.arange(3, dtype=np.uint32)
    assert wgsl.run(TEXT, "pick", {"k": k, "i": i}).tolist() == [5, 6, 7]
    ray = {"o": [0, 0, 1], "d": np.array([0, 0, 2], np.float32), "id": 0}
    t = np.array([0, 1, 2], np.float32)
    assert wgsl.run(TEXT, "at", {"ray": ray, "t": t})[:, 2].tolist() == [1, 3, 5]


def test_rows_of_several_axes(wgsl: Kit, rng: np.random.Generator) -> None:
    o = rng.normal(size=(4, 5, 3)).astype(np.float32)
    ray = {"o": o, "d": [0, 0, 1], "id": np.arange(20, dtype=np.uint32).reshape(4, 5)}
    seen: list[Any] = []

    def at(ray: Any, t: Any) -> Any:
        seen.append((ray["o"].shape, t.shape))
        return ray["o"] + t[..., None] * ray["d"]

    wgsl.check(TEXT, "at", at, {"ray": ray, "t": 2.0}, margin=lambda *_: np.full((4, 5), 9.0))
    assert seen == [((4, 5, 3), (4, 5))]
    assert wgsl.run(TEXT, "id", {"ray": ray}).shape == (4, 5)
    found = wgsl.run(TEXT, "at", {"ray": ray, "t": 2.0})
    np.testing.assert_array_equal(found, o + np.array([0, 0, 2], np.float32))


def test_a_row_is_told_by_its_place(wgsl: Kit) -> None:
    x = np.zeros((3, 4, 5), np.float32)
    x[1, 2, 3] = 7
    with pytest.raises(MismatchError) as caught:
        wgsl.check(TEXT, "same", np.zeros_like, {"x": x})
    message = str(caught.value)
    assert "same: 1 of 60 rows differ (exact)\n" in message
    assert "\n  row [1, 2, 3]: x = 7.0\n" in message
    assert caught.value.census.as_dict()["lead"] == [3, 4, 5]


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"x": np.zeros((2, 3), np.float32), "k": X[:3]},
         "inputs: not one number of rows: x has 2 × 3, k has 3"),
        ({"x": np.zeros((2, 0), np.float32), "k": 1.0},
         "inputs: not one number of rows: x has 2 × 0"),
    ],
)  # fmt: skip
def test_other_axes_are_named(wgsl: Kit, inputs: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, "scale", inputs)
    assert str(caught.value) == message


def test_a_reference_of_other_axes_is_named(wgsl: Kit) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.check(TEXT, "same", lambda x: x[:, :2], {"x": np.zeros((2, 3), np.float32)})
    assert str(caught.value) == "reference: 2 × 2 rows, not 2 × 3"


def test_a_reference_may_be_given_doubles(wgsl: Kit, rng: np.random.Generator) -> None:
    text = "struct P { a: f32, v: vec2<f32>, n: u32 } fn f(p: P, k: f32) -> f32 { return p.a * k; }"
    given = {"a": decades(rng, 100), "v": 0.0, "n": 3}
    types: list[Any] = []

    def reference(p: Any, k: Any) -> Any:
        types.append((p["a"].dtype, p["v"].dtype, p["n"].dtype, k.dtype))
        return p["a"] * k

    wgsl.check(text, "f", reference, {"p": given, "k": 0.1}, float64=True)
    wgsl.check(text, "f", reference, {"p": given, "k": 0.1})
    assert [[str(one) for one in row] for row in types] == [
        ["float64", "float64", "uint32", "float64"],
        ["float32", "float32", "uint32", "float32"],
    ]
    # One rounding, and two.
    cube = "fn f(x: f32) -> f32 { return x * x * x; }"
    x = {"x": decades(rng, 100)}
    assert wgsl.check(cube, "f", lambda x: x**3, x, float64=True, ulp=1).worst_ulp == 1


FLUSHING = """
fn flushed(x: f32) -> f32 { return select(x, 0.0, abs(x) < 1.1754944e-38); }
fn product(a: f32, b: f32) -> f32 { return flushed(flushed(a) * b); }
fn half_of(a: vec2<f32>) -> vec2<f32> { return vec2<f32>(flushed(a.x * 0.5), flushed(a.y * 0.5)); }
fn wrong(x: f32) -> f32 { return x * 1.5; }
fn keeps(x: f32) -> f32 { return x; }
"""
SMALL = np.array([1e-38, -1e-38, 1.2e-38, 1e-45, 1, -1, 0], np.float32)


def test_flushed_subnormals_are_excused_when_asked(wgsl: Kit) -> None:
    for function, reference in (
        ("flushed", lambda x: x),
        ("product", lambda a, b: a * b),
        ("half_of", lambda a: a * np.float32(0.5)),
    ):
        given: dict[str, Any] = {"x": SMALL}
        if function == "product":
            # The first has a subnormal factor and a normal product.
            given = {"a": SMALL, "b": np.float32(2)}
        elif function == "half_of":
            given = {"a": np.stack([SMALL, SMALL[::-1]], 1)}
        with pytest.raises(MismatchError):
            wgsl.check(FLUSHING, function, reference, given)
        census = wgsl.check(FLUSHING, function, reference, given, flush_subnormals=True)
        assert 0 < census.flushed == census.differing < len(SMALL)
        assert census.failed == 0
        assert census.as_dict()["flushed"] == census.flushed
        assert f"{census.flushed} of them right where subnormal numbers are zeros" in str(census)
    assert wgsl.check(FLUSHING, "keeps", lambda x: x, {"x": X}, flush_subnormals=True).flushed == 0


def test_nothing_else_is_excused_with_them(wgsl: Kit) -> None:
    with pytest.raises(MismatchError) as caught:
        wgsl.check(FLUSHING, "wrong", lambda x: x, {"x": SMALL}, flush_subnormals=True)
    # 1.2e-38, 1 and -1 are wrong whatever is flushed, and so are subnormal numbers that are not.
    assert caught.value.census.failed >= 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.check(TEXT, "id", lambda r: r["id"],
                           {"ray": {"o": [0, 0, 0], "d": [0, 0, 0], "id": 1}}, rtol=0.1),
         "rtol: id has no floats; atol is for whole numbers too"),
        (lambda k: k.check(TEXT, "hit", lambda r: r["o"][:, 2] > 0,
                           {"ray": {"o": [0, 0, 0], "d": [0, 0, 0], "id": 1}}, rtol=0.1),
         "rtol: hit has no floats; atol is for whole numbers too"),
        (lambda k: k.compare_image(np.zeros((2, 2), np.uint8), 0, rtol=0.1),
         "rtol: image has no floats; atol is for whole numbers too"),
        (lambda k: k.check(TEXT, "same", lambda x: np.ma.masked_less(x, 1), {"x": X}),
         "reference: a masked array; give its rows that are not masked"),
        (lambda k: k.check(TEXT, "same", lambda x: x, {"x": X},
                           margin=lambda x: np.ma.masked_less(x, 1)),
         "margin: a masked array; give its rows that are not masked"),
        (lambda k: k.check(TEXT, "lit", lambda x: x, {"x": X},
                           bindings={"gain": np.ma.masked_less(X, 1), "table": [[1, 2]]}),
         "bindings: gain: a masked array; give its rows that are not masked"),
        (lambda k: k.compare_image(np.ma.masked_less(np.ones((2, 2)), 1), 0),
         "found: a masked array; give its rows that are not masked"),
        (lambda k: k.compare_image(np.zeros((2, 2)), np.ma.masked_less(np.ones((2, 2)), 1)),
         "expected: a masked array; give its rows that are not masked"),
    ],
)  # fmt: skip
def test_what_would_silently_be_otherwise_is_refused(
    wgsl: Kit, call: Callable[[Kit], object], message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == message


PART = """
struct S { a: f32, b: array<f32, 3> }
fn bump(p: ptr<function, f32>) -> f32 { *p += 1.0; return *p; }
fn f(x: f32) -> f32 { BODY }
"""


@pytest.mark.parametrize(
    ("body", "given"),
    [
        ("var s = array<f32, 3>();\n return bump(&s[1]);", "&s[1]"),
        ("var s = S();\n return bump(&s.a);", "&s.a"),
        ("var s = S();\n return x + max(bump(&(s.b[2])), 1.0);", "&(s.b[2])"),
        ("var s = S(); let p: ptr<function, f32> = &s.b[0];\n return bump(p);", "p"),
    ],
)
def test_what_would_end_the_process_is_refused(wgsl: Kit, body: str, given: str) -> None:
    if not wgsl._compute.is_naga:
        pytest.skip("only naga ends the process")
    with pytest.raises(UsageError) as caught:
        wgsl.run(PART.replace("BODY", body), "f", {"x": X})
    assert str(caught.value) == (
        f"WGSL: line 5: bump is given {given}, a pointer to a part of a variable; naga, the "
        "compiler of wgpu-native, would end the process. A pointer to a whole variable can be given"
    )


def test_what_would_not_is_not(wgsl: Kit) -> None:
    text = """
@group(0) @binding(0) var<storage, read_write> counts: array<atomic<u32>, 4>;
struct S { a: f32, b: array<f32, 3> }
fn bump(p: ptr<function, f32>) -> f32 { *p += 1.0; return *p; }
fn whole(p: ptr<function, S>) -> f32 { return bump_of((*p).a); }
fn bump_of(x: f32) -> f32 { var y = x; let p = &y; return bump(p) + bump(&y); }
fn f(x: f32) -> f32 {
  var s = S(x, array<f32, 3>());
  let part = &s.b[1];
  *part = 1.0;
  let n = atomicAdd(&counts[1], 1u);
  return whole(&s) + *part + f32(n) * 0.0;
}
"""
    found = wgsl.run(text, "f", {"x": X}, bindings={"counts": [0, 0, 0, 0]})
    np.testing.assert_array_equal(found, 2 * X + 4)


def test_the_doctor_tells_types_and_subgroups(wgsl: Kit) -> None:
    told = describe()["features"]
    for name in ("shader-int64", "shader-f16", "shader-f64", "subgroup"):
        assert (name in told) == (name in wgsl.device.features)


def test_what_is_kept_is_bounded() -> None:
    kept: Kept[int, str] = Kept(3)
    made: list[int] = []

    def get(key: int) -> str:
        def make() -> str:
            made.append(key)
            return str(key)

        return kept.get_or_make(key, make)

    for key in (1, 2, 3, 1, 4, 1, 2):
        assert get(key) == str(key)
    # 2 was not used for longest when 4 came.
    assert made == [1, 2, 3, 4, 2]
    assert sorted(kept) == [1, 2, 4]


def test_a_kit_keeps_so_many_texts(wgsl: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kit_module, "KEPT", 4)
    monkeypatch.setattr("halfstep.device.compute.PIPELINES", 4)
    kit = Kit(wgsl.device)
    for k in range(10):
        text = f"fn f(x: f32) -> f32 {{ return x + {k}.0; }}"
        assert kit.run(text, "f", {"x": X}).tolist() == (X + k).tolist()
    assert [len(kept) for kept in (kit._modules, kit._kernels, kit._compute.pipelines)] == [4] * 3


def test_many_texts_cost_no_more_than_three_times_one(wgsl: Kit) -> None:
    x: NDArray[np.float32] = np.random.default_rng(1).random(1000, dtype=np.float32)
    one = "fn f(x: f32, k: f32) -> f32 { return x * k; }"

    def same(kit: Kit, k: int) -> None:
        kit.check(one, "f", lambda x, k: x * k, {"x": x, "k": np.float32(k)})

    def other(kit: Kit, k: int) -> None:
        text = f"fn f(x: f32) -> f32 {{ return x * {k}.0; }}"
        kit.check(text, "f", lambda x: x * np.float32(k), {"x": x})

    def seconds(run: Callable[[Kit, int], None]) -> float:
        kit, start = Kit(wgsl.device), time.process_time()
        for k in range(150):
            run(kit, k)
        return time.process_time() - start

    if "llvmpipe" not in wgsl.device.adapter_info["device"]:
        pytest.skip("the driver may keep no compiled shaders")
    # The first time the driver compiles, which it keeps on disk; what is judged is the kit.
    first = seconds(other) / seconds(same)
    # In pairs, as what else the machine does changes too.
    ratio = min(seconds(other) / seconds(same) for _ in range(3))
    logging.info("150 texts over one text: %.1f at first, %.1f again", first, ratio)
    assert ratio < 3
