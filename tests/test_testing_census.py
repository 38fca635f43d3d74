"""Differences are counted one by one: which rows, how far, and whether they are excused."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.errors import UsageError
from halfstep.testing import unwritten
from halfstep.testing.census import Census, Tolerance, take, within

STACK = {"adapter": "llvmpipe", "driver": "Mesa 1.2", "wgpu": "3.4", "wgpu_native": "5.6"}


def census(
    found: NDArray[Any],
    expected: NDArray[Any],
    *,
    margin: NDArray[Any] | None = None,
    inputs: dict[str, NDArray[Any]] | None = None,
    **tolerance: Any,
) -> Census:
    stack: dict[str, str] = STACK
    return take(
        "it", found, expected, Tolerance(**tolerance), inputs=inputs or {},
        excused=within(margin, len(found)), stack=stack,
    )  # fmt: skip


def f32(*values: float) -> NDArray[np.float32]:
    return np.array(values, np.float32)


def bits(*values: int) -> NDArray[np.float32]:
    return np.array(values, np.uint32).view(np.float32)


@pytest.mark.parametrize(
    ("found", "expected", "ulp"),
    [
        (0x3F800001, 0x3F800000, 1),
        (0x3F7FFFFF, 0x3F800000, 1),  # across a power of two
        (0xBF800003, 0xBF800000, 3),
        (0x80000000, 0x00000000, 1),  # the two zeros
        (0x80000001, 0x00000001, 3),  # across them
        (0x00800000, 0x00000000, 1 << 23),  # all subnormal numbers
        (0xFF7FFFFF, 0x7F7FFFFF, 0xFEFFFFFF),  # from the least to the greatest
    ],
)
def test_floats_are_counted_from_one_to_the_other(found: int, expected: int, ulp: int) -> None:
    for pair in ((found, expected), (expected, found)):
        result = census(bits(pair[0]), bits(pair[1]))
        assert (result.failed, result.worst_ulp, result.worst_row) == (1, ulp, 0)
        assert census(bits(pair[0]), bits(pair[1]), ulp=ulp).failed == 0
        assert census(bits(pair[0]), bits(pair[1]), ulp=ulp - 1).failed == 1


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_neighbours_of_any_float_type_are_one_apart(dtype: type[np.floating[Any]]) -> None:
    limits = np.finfo(dtype)
    values = np.array([0, 1, -1, limits.tiny, limits.max, 0.1, -limits.smallest_subnormal], dtype)
    above = np.nextafter(values, dtype(-np.inf))
    result = census(above, values)
    # Below +0 lies -0, and below that what nextafter gives.
    assert result.worst_ulp == 2
    assert result.worst_row == 0
    assert result.histogram == {"1 ulp": 6, "2…3 ulp": 1}


def test_one_nan_is_as_good_as_another() -> None:
    assert census(bits(0x7FC00000, 0xFFFFFFFF), bits(0x7F800001, 0x7FC00000)).failed == 0


@pytest.mark.parametrize(
    ("found", "expected", "label"),
    [
        (np.nan, 1, "NaN"),
        (1, np.nan, "NaN"),
        (np.inf, 3e38, "infinite"),
        (-np.inf, np.inf, "infinite"),
    ],
)
def test_what_is_not_finite_is_never_tolerated(found: float, expected: float, label: str) -> None:
    result = census(f32(found), f32(expected), ulp=1 << 31, atol=1e38, rtol=1.0)
    assert (result.failed, result.histogram) == (1, {label: 1})
    assert result.worst_row is None


def test_equal_infinities_are_equal() -> None:
    assert census(f32(np.inf, -np.inf), f32(np.inf, -np.inf)).failed == 0


@pytest.mark.parametrize(
    ("tolerance", "failed"),
    [
        ({}, [1, 2, 3]),
        ({"atol": 0.01}, [2, 3]),
        ({"rtol": 0.01}, [1, 3]),
        ({"atol": 0.01, "rtol": 0.01}, [3]),
        ({"ulp": 1 << 30, "atol": 1.0}, []),
    ],
)
def test_a_value_within_any_tolerance_is_right(
    tolerance: dict[str, Any], failed: list[int]
) -> None:
    found, expected = f32(1, 0.005, 100.5, 0.5), f32(1, 0, 100, 0)
    result = census(found, expected, **tolerance)
    assert [row.index for row in result.first] == failed
    assert result.differing == len(failed)


def test_with_a_tolerance_the_zeros_are_equal() -> None:
    assert census(f32(-0.0), f32(0.0)).failed == 1
    for tolerance in ({"ulp": 1}, {"atol": 1e-9}, {"rtol": 1e-9}):
        assert census(f32(-0.0), f32(0.0), **tolerance).failed == 0


@pytest.mark.parametrize("dtype", [np.int32, np.uint32, np.int64, np.uint64])
def test_integers_are_exact_but_for_an_absolute_tolerance(dtype: type[np.integer[Any]]) -> None:
    limits = np.iinfo(dtype)
    found = np.array([limits.max, limits.min, 5], dtype)
    expected = np.array([limits.min, limits.max, 7], dtype)
    result = census(found, expected, ulp=1 << 40, rtol=1e9)
    assert result.failed == 3
    assert result.histogram == {"integers": 3}
    assert result.first[0].distance == {"": f"by {int(limits.max) - int(limits.min)}"}
    assert [row.index for row in census(found, expected, atol=2).first] == [0, 1]
    assert census(found, expected, atol=1).failed == 3


def test_truth_has_no_tolerance() -> None:
    result = census(np.array([True, False]), np.array([True, True]), ulp=9, atol=9, rtol=9)
    assert (result.failed, result.histogram) == (1, {"bools": 1})


def test_rows_within_the_margin_are_ambiguous() -> None:
    found, expected = np.zeros(6, np.int32), np.array([0, 1, 1, 1, 1, 1], np.int32)
    margin = np.array([0, 0, 1, 1.001, np.inf, np.nan])
    result = census(found, expected, margin=margin)
    assert (result.differing, result.ambiguous, result.failed) == (5, 2, 3)
    assert [row.index for row in result.first] == [3, 4, 5]


@pytest.mark.parametrize("margin", [np.zeros(5), np.zeros((6, 1)), np.zeros(6, bool)])
def test_a_margin_of_another_shape_is_refused(margin: NDArray[Any]) -> None:
    with pytest.raises(UsageError) as caught:
        within(margin, 6)
    assert str(caught.value) == (
        f"margin: {margin.dtype} of shape {margin.shape}, not a number for each of 6 rows"
    )


@pytest.mark.parametrize("name", ["ulp", "atol", "rtol"])
@pytest.mark.parametrize("value", [-1, np.inf, np.nan, None, "one"])
def test_a_tolerance_is_a_finite_number(name: str, value: Any) -> None:
    with pytest.raises(UsageError) as caught:
        Tolerance(**{name: value})
    assert str(caught.value) == f"{name}: {value} is not a finite number >= 0"


@pytest.mark.parametrize(
    "dtype", [np.uint8, np.float16, np.float32, np.uint32, np.int64, np.float64]
)
def test_what_was_never_written_is_told(dtype: type[np.generic]) -> None:
    found = unwritten((10, 4), dtype)
    found[:7] = 1
    found[8, 1] = 1  # half a row is something else
    result = census(found, np.ones((10, 4), dtype))
    assert (result.failed, result.unwritten) == (3, 2)


RECORD = np.dtype([("at", np.float32, (2,)), ("hit", np.bool_), ("id", [("n", np.int32)])])


def test_a_census_of_structs_reads_well() -> None:
    expected = np.zeros(5000, RECORD)
    expected["at"] = 0.1, 3
    found = expected.copy()
    found["at"][17, 0] = np.nextafter(np.float32(0.1), np.float32(1))
    found["hit"][17] = True
    found["id"]["n"][[99, 100]] = 4, -4
    found["at"][101:4000, 1] = np.nan
    lines = np.arange(5000 * 9).reshape(5000, 9)
    text = str(census(found, expected, inputs={"x": np.arange(5000.0), "k": lines}))
    assert text == (
        "it: 3902 of 5000 rows differ (exact)\n"
        "  worst: 1 ulp in row 17\n"
        "  in at: 3900\n"
        "  in hit: 1\n"
        "  in id.n: 2\n"
        "  values by distance: 1 ulp: 1, NaN: 3899, bools: 1, integers: 2\n"
        "  row 17: x = 17.0, k = [153, 154, 155, 156, 157, 158, 159, 160, … 9 in all]\n"
        "    found at [0.10000001, 3.0]\n"
        "    expected at [0.1, 3.0] (1 ulp)\n"
        "    found hit True\n"
        "    expected hit False\n"
        "  row 99: x = 99.0, k = [891, 892, 893, 894, 895, 896, 897, 898, … 9 in all]\n"
        "    found id.n 4\n"
        "    expected id.n 0 (by 4)\n"
        "  row 100: x = 100.0, k = [900, 901, 902, 903, 904, 905, 906, 907, … 9 in all]\n"
        "    found id.n -4\n"
        "    expected id.n 0 (by 4)\n"
        "  row 101: x = 101.0, k = [909, 910, 911, 912, 913, 914, 915, 916, … 9 in all]\n"
        "    found at [0.1, nan]\n"
        "    expected at [0.1, 3.0] (NaN)\n"
        "  row 102: x = 102.0, k = [918, 919, 920, 921, 922, 923, 924, 925, … 9 in all]\n"
        "    found at [0.1, nan]\n"
        "    expected at [0.1, 3.0] (NaN)\n"
        "  and 3897 more\n"
        "  on llvmpipe, Mesa 1.2, wgpu 3.4, wgpu-native 5.6"
    )


def test_a_census_is_json() -> None:
    found = np.zeros(3, RECORD)
    found["at"][1] = np.nan, np.inf
    report = census(found, np.zeros(3, RECORD), inputs={"x": f32(1, -np.inf, 2)}).as_dict()
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["failed"] == 1
    assert report["stack"] == STACK
    assert report["first"] == [
        {
            "index": 1,
            "inputs": {"x": "-inf"},
            "found": {"at": ["nan", "inf"]},
            "expected": {"at": [0.0, 0.0]},
            "distance": {"at": "NaN"},
        }
    ]
