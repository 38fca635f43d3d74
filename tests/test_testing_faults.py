"""Eight sorts of planted faults, each caught by a census that names the rows; no false alarm."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.testing import Census, Kit, MismatchError, decades, near_ties, unwritten

F32 = NDArray[np.float32]
ROWS = 5000


def rows_of(census: Census) -> list[int]:
    return [row.index for row in census.first]


def first(mask: NDArray[np.bool_]) -> list[int]:
    """The rows that a census shows of those that are wrong, which are some and not all."""
    assert 0 < mask.sum() < len(mask)
    return np.flatnonzero(mask)[:5].tolist()


def caught(excinfo: pytest.ExceptionInfo[MismatchError], wrong: NDArray[np.bool_]) -> Census:
    """The census, which has exactly the wrong rows and says so."""
    census = excinfo.value.census
    assert (census.failed, rows_of(census)) == (wrong.sum(), first(wrong))
    text = str(excinfo.value)
    assert f"{wrong.sum()} of {len(wrong)} rows differ" in text
    assert all(f"\n  row {row}: " in text for row in rows_of(census))
    return census


def test_a_wrong_operator(wgsl: Kit, rng: np.random.Generator) -> None:
    right = "fn mixed(a: f32, b: f32) -> f32 { return a + b; }"
    a = decades(rng, ROWS)
    b = np.where(rng.random(ROWS) < 0.01, decades(rng, ROWS), np.float32(0))
    given = {"a": a, "b": b}
    wgsl.check(right, "mixed", np.add, given)
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(right.replace("a + b", "a - b"), "mixed", np.add, given)
    # What is too small to change a changes nothing.
    caught(excinfo, a - b != a + b)


def test_a_loop_that_is_one_off(wgsl: Kit, rng: np.random.Generator) -> None:
    right = """
fn total(k: array<u32, 8>, count: u32) -> u32 {
  var sum = 0u;
  for (var i = 0u; i < count; i++) { sum += k[i]; }
  return sum;
}"""
    k = rng.integers(0, 2, (ROWS, 8), dtype=np.uint32)
    count = rng.integers(0, 8, ROWS, dtype=np.uint32)

    def total(k: NDArray[np.uint32], count: NDArray[np.uint32]) -> NDArray[np.uint32]:
        return np.where(np.arange(8) < count[:, None], k, 0).sum(axis=1).astype(np.uint32)

    given = {"k": k, "count": count}
    wgsl.check(right, "total", total, given)
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(right.replace("i < count", "i <= count"), "total", total, given)
    caught(excinfo, k[np.arange(ROWS), count] != 0)


def test_swapped_operands(wgsl: Kit, rng: np.random.Generator) -> None:
    right = "fn apart(a: vec3<i32>, b: vec3<i32>) -> vec3<i32> { return a - b; }"
    a, b = rng.integers(0, 2, (2, ROWS, 3), dtype=np.int32)
    wgsl.check(right, "apart", np.subtract, {"a": a, "b": b})
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(right.replace("a - b", "b - a"), "apart", np.subtract, {"a": a, "b": b})
    caught(excinfo, (a != b).any(axis=1))


def test_a_missing_clamp(wgsl: Kit, rng: np.random.Generator) -> None:
    right = "fn level(x: f32) -> u32 { return u32(clamp(x, 0.0, 1.0) * 255.0 + 0.5); }"
    x = rng.uniform(0, 1.05, ROWS).astype(np.float32)

    def level(x: F32) -> NDArray[np.uint32]:
        return (np.clip(x, 0, 1) * np.float32(255) + np.float32(0.5)).astype(np.uint32)

    wgsl.check(right, "level", level, {"x": x})
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(right.replace("clamp(x, 0.0, 1.0)", "x"), "level", level, {"x": x})
    caught(excinfo, (x * np.float32(255) + np.float32(0.5)).astype(np.uint32) > 255)


def test_a_wrong_offset_in_a_struct(wgsl: Kit, rng: np.random.Generator) -> None:
    # Records as a host writes them, a vec3 and then a number in 16 bytes.
    records = np.zeros(ROWS, [("toward", np.float32, 3), ("power", np.float32)])
    records["power"] = rng.integers(0, 2, ROWS)
    right = """
@group(0) @binding(0) var<storage, read> words: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> powers: array<f32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x < arrayLength(&words) { powers[id.x] = words[id.x][3]; }
}"""
    given = {
        "words": records.view(np.float32).reshape(ROWS, 4),
        "powers": unwritten(ROWS, np.float32),
    }
    groups = -(-ROWS // 64)
    found = wgsl.kernel(right, "main", given, workgroups=groups)
    wgsl.compare(found["powers"], records["power"])
    found = wgsl.kernel(right.replace("[3]", "[2]"), "main", given, workgroups=groups)
    with pytest.raises(MismatchError) as excinfo:
        wgsl.compare(found["powers"], records["power"], inputs={"record": records})
    caught(excinfo, records["power"] != 0)


def test_an_output_that_is_not_written(wgsl: Kit, rng: np.random.Generator) -> None:
    right = """
@group(0) @binding(0) var<storage, read> x: array<u32>;
@group(0) @binding(1) var<storage, read_write> y: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x < arrayLength(&x) { y[id.x] = 2u * x[id.x]; }
}"""
    x = rng.integers(0, 1000, ROWS, dtype=np.uint32)
    given = {"x": x, "y": unwritten(ROWS, np.uint32)}
    groups = -(-ROWS // 64)
    found = wgsl.kernel(right, "main", given, workgroups=groups)
    wgsl.compare(found["y"], 2 * x)
    wrong = right.replace("id.x < arrayLength(&x)", "id.x < arrayLength(&x) && x[id.x] != 7u")
    found = wgsl.kernel(wrong, "main", given, workgroups=groups)
    with pytest.raises(MismatchError) as excinfo:
        wgsl.compare(found["y"], 2 * x, inputs={"x": x})
    census = caught(excinfo, x == 7)
    assert census.unwritten == census.failed
    assert f"\n  {census.failed} of them never written\n" in str(census)


def test_a_nan(wgsl: Kit, rng: np.random.Generator) -> None:
    right = "fn root(x: f32) -> f32 { return sqrt(max(x, 0.0)); }"
    x = rng.uniform(-0.01, 1, ROWS).astype(np.float32)

    def root(x: F32) -> F32:
        return np.sqrt(np.maximum(x, 0))

    wgsl.check(right, "root", root, {"x": x}, ulp=4)
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(right.replace("max(x, 0.0)", "x"), "root", root, {"x": x}, ulp=4, atol=1e30)
    census = caught(excinfo, x < 0)
    assert census.histogram["NaN"] == census.failed


def test_one_bad_row_in_a_million(wgsl: Kit) -> None:
    x = np.arange(1_000_000, dtype=np.uint32)
    text = "fn square(x: u32) -> u32 { return x * x; }"
    wgsl.check(text, "square", lambda x: x * x, {"x": x})
    wrong = text.replace("return", "if x == 123456u { return x * x + 1u; }\n  return")
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(wrong, "square", lambda x: x * x, {"x": x})
    census = caught(excinfo, x == 123456)
    assert census.first[0].inputs == {"x": 123456}


SIDE = "fn side(a: f32, b: f32, c: f32) -> bool { return a * b + c > 0.0; }"


def side(a: F32, b: F32, c: F32) -> NDArray[np.bool_]:
    """On which side c is of -a·b, contracted."""
    return a.astype(np.float64) * b + c > 0


def distance(a: F32, b: F32, c: F32) -> NDArray[np.float64]:
    """Of the decision from its tie, in units of two roundings."""
    product = a.astype(np.float64) * b
    return np.abs(product + c) / (2.0**-24 * (np.abs(product) + np.abs(product + c)))


def test_a_flipped_sign_within_the_margin_is_ambiguous(wgsl: Kit, rng: np.random.Generator) -> None:
    a, b = decades(rng, (2, ROWS), low=1e-3, high=1e3)
    given = {"a": a, "b": b, "c": near_ties(rng, -(a * b), ulps=1)}
    with pytest.raises(MismatchError):
        wgsl.check(SIDE, "side", side, given)
    census = wgsl.check(SIDE, "side", side, given, margin=distance)
    assert 0 < census.ambiguous == census.differing < ROWS


def test_a_flipped_sign_outside_the_margin_is_a_failure(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    a, b = decades(rng, (2, ROWS), low=1e-3, high=1e3)
    given = {"a": a, "b": b, "c": near_ties(rng, -(a * b), ulps=1)}
    given["c"][::100] *= np.float32(1.01)
    wrong = SIDE.replace("a * b + c > 0.0", "a * b + c > abs(c) * 0.1")
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(wrong, "side", side, given, margin=distance)
    census = excinfo.value.census
    assert census.ambiguous > 0
    assert census.failed > 0
    assert all(distance(*row.inputs.values()) > 1 for row in census.first)
