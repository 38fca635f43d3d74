"""Generated inputs are what they say: over decades, at the turns of arithmetic, next to ties."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import decades, near_ties, special_values


@pytest.mark.parametrize(
    ("dtype", "low", "high"),
    [
        (np.float32, 1e-6, 1e6),
        (np.float32, 2.0**-126, float(np.finfo(np.float32).max)),
        (np.float64, 1e-300, 1e300),
        (np.float16, 0.001, 1000.0),
        (np.float32, 3.0, 3.0),
    ],
)
def test_every_decade_is_as_likely(
    rng: np.random.Generator, dtype: Any, low: float, high: float
) -> None:
    values = decades(rng, (100, 200), low=low, high=high, dtype=dtype)
    assert values.dtype == dtype
    magnitudes = np.abs(values.astype(np.float64))
    assert magnitudes.min() >= float(dtype(low))
    assert magnitudes.max() <= high
    assert 0.45 < (values < 0).mean() < 0.55
    if low < high:
        middle = np.sqrt(low) * np.sqrt(high)
        assert 0.45 < (magnitudes < middle).mean() < 0.55


@pytest.mark.parametrize(
    ("low", "high", "dtype", "range_"),
    [
        (0.0, 1.0, np.float32, "0 … 1"),
        (2.0, 1.0, np.float32, "2 … 1"),
        (1.0, 1e6, np.float16, "1 … 1e+06"),
    ],
)
def test_what_a_type_does_not_hold_is_refused(
    rng: np.random.Generator, low: float, high: float, dtype: Any, range_: str
) -> None:
    with pytest.raises(UsageError) as caught:
        decades(rng, 3, low=low, high=high, dtype=dtype)
    assert str(caught.value).startswith(f"decades: {range_} is not within ")


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_special_floats(dtype: Any) -> None:
    limits = np.finfo(dtype)
    values = special_values(dtype)
    assert values.dtype == dtype
    assert np.isfinite(values).all()
    for value in (1, limits.max, limits.tiny, limits.smallest_subnormal, 1 + limits.eps):
        assert {value, -value} <= set(values.tolist())
    assert {bool(np.signbit(value)) for value in values[values == 0]} == {False, True}
    more = special_values(dtype, finite=False)
    assert np.isnan(more).sum() == 1
    assert np.isinf(more).sum() == 2


@pytest.mark.parametrize("dtype", [np.int32, np.uint32, np.int64, np.uint64])
def test_special_integers(dtype: Any) -> None:
    limits = np.iinfo(dtype)
    values = special_values(dtype)
    assert values.dtype == dtype
    assert {0, 1, limits.min, limits.max, 2, 3} <= set(values.tolist())
    assert special_values(np.bool_).tolist() == [False, True]


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_near_ties_are_a_few_units_off(rng: np.random.Generator, dtype: Any) -> None:
    ties = np.repeat(np.array([1, -1, 0.1, 1000], dtype), 1000)
    moved = near_ties(rng, ties, ulps=2)
    assert moved.dtype == dtype
    off = np.rint((moved.astype(np.float64) - ties) / np.spacing(np.abs(ties))).astype(int)
    # Below a power of two units are half as large.
    assert set(np.unique(off[2000:])) == {-2, -1, 0, 1, 2}
    assert len(np.unique(moved)) == 20
    assert (near_ties(rng, ties, ulps=0) == ties).all()


def test_near_ties_are_of_floats(rng: np.random.Generator) -> None:
    with pytest.raises(UsageError) as caught:
        near_ties(rng, [1, 2])
    assert str(caught.value) == "near_ties: int64 is not a float type"
