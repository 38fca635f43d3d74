"""All that a kernel gives can be compared: numbers, structs, and mappings of them."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError

TEXT = """
struct Pair { a: f32, b: vec2<u32> }
struct Open { n: u32, scale: vec2<f32>, pairs: array<Pair> }
@group(0) @binding(0) var<storage, read_write> total: f32;
@group(0) @binding(1) var<storage, read_write> pair: Pair;
@group(0) @binding(2) var<storage, read_write> list: Open;
@group(0) @binding(3) var<storage, read_write> plain: array<i32>;
@compute @workgroup_size(1) fn main() {
  total = 3.0;
  pair = Pair(2.0, vec2(5u, 6u));
  list.n = 7u;
  list.pairs[1].b.y = 9u;
  plain[2] = -1;
}
"""


@pytest.fixture
def given(wgsl: Kit) -> dict[str, Any]:
    pairs = np.zeros(4, wgsl.struct(TEXT, "Pair"))
    return {
        "total": np.float32(0),
        "pair": {"a": np.float32(0), "b": np.zeros(2, np.uint32)},
        "list": {"n": 0, "scale": np.ones(2, np.float32), "pairs": pairs},
        "plain": np.zeros(3, np.int32),
    }


@pytest.fixture
def found(wgsl: Kit, given: dict[str, Any]) -> dict[str, Any]:
    return wgsl.kernel(TEXT, "main", given)


@pytest.fixture
def right(given: dict[str, Any]) -> dict[str, Any]:
    given["list"]["pairs"]["b"][1, 1] = 9
    return {
        "total": 3.0,
        "pair": (2.0, [5, 6]),
        "list": given["list"] | {"n": 7},
        "plain": [0, 0, -1],
    }


def test_every_part_and_the_whole_can_be_compared(
    wgsl: Kit, found: dict[str, Any], right: dict[str, Any]
) -> None:
    for name, value in found.items():
        census = wgsl.compare(value, right[name])
        assert (census.name, census.differing) == ("result", 0)
        wgsl.compare(value, value)
    census = wgsl.compare(found, right, name="all")
    assert (census.name, census.rows) == ("all", 1 + 1 + (1 + 2 + 4) + 3)


@pytest.mark.parametrize(
    ("name", "wrong", "rows", "shown"),
    [
        ("total", 4.0, 1, "row 0\n    found 3.0\n    expected 4.0 (4194304 ulp)"),
        ("pair", (2.0, [5, 7]), 1, "row 0\n    found b [5, 6]\n    expected b [5, 7] (by 1)"),
        ("plain", [0, 1, -1], 3, "row 1\n    found 0\n    expected 1 (by 1)"),
    ],
)
def test_what_differs_is_named(
    wgsl: Kit, found: dict[str, Any], name: str, wrong: Any, rows: int, shown: str
) -> None:
    with pytest.raises(MismatchError) as caught:
        wgsl.compare(found[name], wrong)
    assert caught.value.census.rows == rows
    assert f"1 of {rows} rows differ" in str(caught.value)
    assert shown in str(caught.value)


def test_of_a_mapping_each_part_is_named(
    wgsl: Kit, found: dict[str, Any], right: dict[str, Any]
) -> None:
    pairs = right["list"]["pairs"].copy()
    pairs["b"][1:3] += 1
    wrong = right | {"total": 3.5, "list": right["list"] | {"n": 8, "pairs": pairs}}
    with pytest.raises(MismatchError) as caught:
        wgsl.compare(found, wrong)
    census = caught.value.census
    assert (census.rows, census.failed) == (12, 4)
    assert census.members == {"total": 1, "list.n": 1, "list.pairs.b": 2}
    assert census.histogram == {"2^21… ulp": 1, "integers": 5}
    assert (census.worst_ulp, census.worst_row) == (2**21, 0)
    assert [(row.index, list(row.found)) for row in census.first] == [
        (0, ["total"]), (0, ["list.n"]), (1, ["list.pairs.b"]), (2, ["list.pairs.b"]),
    ]  # fmt: skip
    assert "\n  in list.pairs.b: 2\n" in str(caught.value)
    assert "\n    found list.n 7\n    expected list.n 8 (by 1)\n" in str(caught.value)


def test_a_tolerance_is_for_those_parts_that_can_use_it(wgsl: Kit) -> None:
    found = {"count": 3, "data": np.array([1.0, 2.0])}
    wgsl.compare(found, {"count": 3, "data": np.array([1.0, 2.001])}, rtol=0.01)
    with pytest.raises(MismatchError):
        wgsl.compare(found, {"count": 4, "data": np.array([1.0, 2.001])}, rtol=0.5)
    with pytest.raises(UsageError, match="rtol: result has no floats"):
        wgsl.compare({"count": 3, "more": {"n": 4}}, {"count": 3, "more": {"n": 4}}, rtol=0.5)


def test_lists_and_numbers_are_arrays(wgsl: Kit) -> None:
    wgsl.compare([1.0, 2.0], np.array([1.0, 2.0]))
    wgsl.compare(3, 3)
    wgsl.compare(True, np.True_)
    wgsl.compare([[1, 2], [3, 4]], [[1, 2], [3, 4]])
    wgsl.compare(np.full(8, 16, np.uint32), 16)
    with pytest.raises(MismatchError):
        wgsl.compare([1.0, 2.0], [1.0, 3.0])
    with pytest.raises(MismatchError):
        wgsl.compare(2, 3)


X = np.arange(4, dtype=np.float32)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.compare({"a": X}, {"b": X}),
         "expected: a is missing; the members are a"),
        (lambda k: k.compare({"a": X, "b": {"c": X}}, {"a": X, "b": X}),
         "b.expected: not a struct of c"),
        (lambda k: k.compare({"a": X}, {"a": X[:2]}), "a.expected: 2 rows, not 4"),
        (lambda k: k.compare(X[0], X), "expected: shape (4,), not one value"),
        (lambda k: k.compare({}, {}), "found: nothing to compare"),
        (lambda k: k.compare(X[:0], X[:0]), "found: nothing to compare"),
        (lambda k: k.compare({"a": X[:0]}, {"a": X[:0]}), "a.found: nothing to compare"),
        (lambda k: k.compare({"a": X}, {"a": X}, margin=X),
         "found: a mapping has no rows for margin and inputs"),
        (lambda k: k.compare(X, X, inputs={"y": X[:2]}), "inputs: y: 2 rows, not 4"),
        (lambda k: k.compare("abc", "abc"),
         "found: <U3 is not a type of numbers that a device has"),
        (lambda k: k.compare(None, None),
         "found: object is not a type of numbers that a device has"),
        (lambda k: k.compare([1j], [1j]),
         "found: complex128 is not a type of numbers that a device has"),
        (lambda k: k.compare(np.ma.masked_less(X, 1), X),
         "found: a masked array; give its rows that are not masked"),
        (lambda k: k.compare(X, np.ma.masked_less(X, 1)),
         "expected: a masked array; give its rows that are not masked"),
        (lambda k: k.run("fn f(x: f32) -> f32 { return x; }", "f",
                         {"x": np.ma.masked_less(X, 1)}),
         "inputs: x: a masked array; give its rows that are not masked"),
        (lambda k: k.compare(np.array([1]), np.array([1]), rtol=0.5),
         "rtol: result has no floats; atol is for whole numbers too"),
        (lambda k: k.check("fn f(x: u32) -> u32 { return x; }", "f", lambda x: x, {"x": 1},
                           rtol=0.5),
         "rtol: f has no floats; atol is for whole numbers too"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_is_named(wgsl: Kit, call: Any, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == message


def test_lists_of_no_shape_are_named(wgsl: Kit) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.compare([[1, 2], [3]], [[1, 2], [3]])
    assert re.match("found: not an array: ", str(caught.value))
