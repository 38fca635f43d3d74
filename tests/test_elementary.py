"""The functions of formulas have the errors that they state, measured against mpmath."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from halfstep.twin import elementary
from halfstep.twin.elementary import (
    GROWTH_ERROR,
    LARGEST_ANGLE,
    LARGEST_EXPONENT,
    LOGARITHM_ERROR,
    SMALLEST_ARGUMENT,
    TURN_ERROR,
)

COUNT = 4000
# Devices may contract a·b + c, or divide with 2.5 ulp: what is measured leaves this much room.
ROOM = 0.75


def angles(rng: np.random.Generator) -> Any:
    """Angles over decades, and next to multiples of a quarter turn."""
    decades = np.exp2(rng.uniform(-20, 13, COUNT)) * rng.choice([-1, 1], COUNT)
    turns = rng.integers(-5200, 5200, COUNT) * (np.pi / 2) + rng.normal(size=COUNT) * 1e-3
    return np.concatenate([decades, turns])


def exponents(rng: np.random.Generator) -> Any:
    """Exponents over decades, and next to multiples of half of ln 2."""
    decades = np.exp2(rng.uniform(-20, np.log2(80), COUNT)) * rng.choice([-1, 1], COUNT)
    edges = (rng.integers(-200, 200, COUNT) + 0.5) * np.log(2) / 2
    return np.concatenate([decades, edges + rng.normal(size=COUNT) * 1e-4])


def arguments(rng: np.random.Generator) -> Any:
    """Numbers over decades, about 1, and about the root of 2."""
    about = np.exp2(rng.integers(-20, 20, COUNT)) * rng.choice([1, 2**0.5], COUNT)
    return np.concatenate(
        [np.exp2(rng.uniform(-40, 100, COUNT)), about * (1 + rng.normal(size=COUNT) * 1e-3)]
    )


@pytest.mark.parametrize(
    ("name", "exact", "draw", "absolute", "relative"),
    [
        ("sine_of", mpmath.sin, angles, TURN_ERROR, 0),
        ("cosine_of", mpmath.cos, angles, TURN_ERROR, 0),
        ("exponential_of", mpmath.exp, exponents, 0, GROWTH_ERROR),
        ("logarithm_of", mpmath.log, arguments, LOGARITHM_ERROR, LOGARITHM_ERROR),
    ],
)
def test_errors_are_those_stated(
    name: str,
    exact: Callable[..., Any],
    draw: Callable[..., Any],
    absolute: float,
    relative: float,
    rng: np.random.Generator,
) -> None:
    x = draw(rng).astype(np.float32)
    limit = {mpmath.exp: LARGEST_EXPONENT, mpmath.log: np.inf}.get(exact, LARGEST_ANGLE)
    x = x[np.abs(x) <= limit]
    if exact is mpmath.log:
        x = x[x >= SMALLEST_ARGUMENT]
    found = getattr(elementary, name)(x)
    worst = 0.0
    for argument, value in zip(x.tolist(), found.tolist(), strict=True):
        truth = exact(mpmath.mpf(argument))
        off = abs(mpmath.mpf(value) - truth)
        worst = max(worst, float(off / (absolute + relative * abs(truth))))
    assert 0.2 < worst < ROOM, worst
