"""The sRGB table, depth keys and integer coefficients, each against its meaning."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.contract.formats import FRACTION_BITS
from halfstep.contract.layout import TILE
from halfstep.contract.srgb import srgb_table
from halfstep.host.prepare import prepare
from halfstep.scene import load, with_overrides
from halfstep.twin import encode, nearest
from tests.bundled import drawn_by_all

SIZE = (160, 120)


def level_of(linear: NDArray[np.float64]) -> NDArray[np.int64]:
    """The nearest of 256 levels, from the definition of sRGB."""
    light = np.clip(linear, 0.0, 1.0)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.floor(255 * encoded + 0.5).astype(np.int64)


def test_srgb_is_rounded_correctly_where_levels_change() -> None:
    edges = (np.arange(1, 256) - 0.5) / 255
    linear = np.where(edges <= 0.04045, edges / 12.92, ((edges + 0.055) / 1.055) ** 2.4)
    ulps = np.arange(-4, 5, dtype=np.int32)
    values = (linear.astype(np.float32).view(np.int32)[:, None] + ulps).view(np.float32)
    levels = encode.srgb_level(srgb_table(), values)
    np.testing.assert_array_equal(levels, level_of(values.astype(np.float64)))
    assert set(levels.ravel().tolist()) == set(range(256))


def test_srgb_is_rounded_correctly_anywhere(rng: np.random.Generator) -> None:
    values = np.concatenate(
        [
            rng.uniform(-0.1, 1.1, 50_000),
            np.exp2(rng.uniform(-30, 1, 50_000)),
            [0, -0.0, 1, 2, -1, 1e30, np.nextafter(1, 0)],
        ]
    ).astype(np.float32)
    levels = encode.srgb_level(srgb_table(), values)
    np.testing.assert_array_equal(levels, level_of(values.astype(np.float64)))


@pytest.mark.parametrize("steps", [None, 1, 17, 30])
@pytest.mark.parametrize("name", drawn_by_all())
@pytest.mark.filterwarnings("ignore:.*the tolerance needs more than")
@pytest.mark.slow
def test_depth_keys_are_exact(name: str, steps: int | None, rng: np.random.Generator) -> None:
    packed = prepare(with_overrides(load(name), size=SIZE, steps=steps))
    assert len(packed.solids) > 0
    for row, record in zip(packed.order, packed.solids, strict=True):
        n, level = int(record["steps"]), int(packed.setup.level[row])
        ends = [1 - 2**n, -1, 1, 2**n - 1]
        positions = np.array([*ends, *(2 * rng.integers(0, 2**n, 4) + 1 - 2**n)], np.int32)
        start = nearest.Key(record["key_high"], record["key_low"])
        key = nearest.depth_key(positions, n, start, int(record["key_shift"]))
        for position, high, low in zip(*map(np.ndarray.tolist, (positions, *key)), strict=True):
            t = Fraction(float(packed.setup.start[row]))
            t += Fraction(position + 2**n, 2 ** (level + n + 1))
            assert Fraction((high << 32) + low, 2**packed.key_bits) == t
            assert 0 <= t <= 1
    assert packed.key_bits < 64


@pytest.mark.parametrize("name", drawn_by_all())
def test_integer_forms_do_not_overflow(name: str) -> None:
    packed = prepare(with_overrides(load(name), size=SIZE, steps=24))
    assert packed.format.integer
    powers = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    for row, record in zip(packed.order, packed.solids, strict=True):
        i0, i1, j0, j1 = packed.setup.rectangle[row].tolist()
        # Whole tiles are computed.
        columns = i0 // TILE * TILE, i1 // TILE * TILE + TILE - 1
        rows = j0 // TILE * TILE, j1 // TILE * TILE + TILE - 1
        x = max(abs(column - int(record["center_x"])) for column in columns)
        y = max(abs(row - int(record["center_y"])) for row in rows)
        first = int(record["plane_start"])
        planes = packed.half_spaces[first : first + int(record["plane_count"])]
        forms = [record[letter] for letter in "agc"]
        forms += [plane[letter] for plane in planes for letter in "cb"]
        for form in forms:
            terms = (
                abs(k) * x**p * y**q
                for k, (p, q) in zip(form.tolist(), powers[: len(form)], strict=True)
            )
            assert sum(terms) <= 2**FRACTION_BITS + 2**50


def test_solids_are_ordered_by_class_then_by_place_in_the_scene() -> None:
    packed = prepare(with_overrides(load("gallery"), size=SIZE))
    rows = list(
        zip(packed.classes.tolist(), packed.setup.solid[packed.order].tolist(), strict=True)
    )
    assert rows == sorted(rows)
    assert len(packed.present) >= 4
