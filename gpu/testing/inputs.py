"""Inputs that find faults: numbers over decades, special values, and near-ties."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from halfstep.contract.arrays import Array
from halfstep.errors import UsageError


def decades(
    rng: np.random.Generator,
    shape: int | tuple[int, ...],
    *,
    low: float = 1e-6,
    high: float = 1e6,
    dtype: DTypeLike = np.float32,
) -> Array:
    """Floats of either sign with magnitudes from ``low`` to ``high``, as many in each decade.

    Raises:
        UsageError: not 0 < low <= high, or they are no normal numbers of the type.
    """
    limits = np.finfo(np.dtype(dtype))
    if not float(limits.tiny) <= low <= high <= float(limits.max):
        raise UsageError(
            f"decades: {low:g} … {high:g} is not within {limits.tiny:g} … {limits.max:g} of "
            f"{limits.dtype}"
        )
    exponents = rng.uniform(np.log(low), np.log(high), shape)
    magnitudes = np.clip(np.exp(exponents).astype(dtype), limits.dtype.type(low), high)
    return np.where(rng.random(shape) < 0.5, magnitudes, -magnitudes)


def special_values(dtype: DTypeLike = np.float32, *, finite: bool = True) -> Array:
    """Numbers of a type at which arithmetic behaves differently.

    For a float: the zeros, 1 and its neighbours, 2, 0.5, the least normal number, the least and the
    greatest subnormal number, the greatest number, and the negatives of all. Without ``finite``
    also the infinities and a NaN, whose effects WGSL leaves to the device. For an integer: the
    numbers at which one more or less changes the sign or the number of bits.
    """
    type_ = np.dtype(dtype)
    if type_.kind == "b":
        return np.array([False, True])
    if type_.kind != "f":
        bits = 8 * type_.itemsize
        powers = [0, 1, bits // 2 - 1, bits // 2, bits - 2, bits - 1, bits]
        whole = {sign * (1 << k) + step for k in powers for step in (-1, 0, 1) for sign in (-1, 1)}
        limits = np.iinfo(type_)
        return np.array(sorted(n for n in whole if limits.min <= n <= limits.max), type_)
    floats = np.finfo(type_)
    least, normal = floats.smallest_subnormal, floats.smallest_normal
    above, below = np.nextafter(np.array([1, 1], type_), np.array([2, 0], type_))
    positive = np.array(
        [0, 0.5, below, 1, above, 2, least, normal - least, normal, floats.max]
        + [np.inf] * (not finite),
        type_,
    )
    both = np.concatenate([positive, -positive])
    return both if finite else np.append(both, np.array([np.nan], type_))


def near_ties(rng: np.random.Generator, values: ArrayLike, *, ulps: int = 2) -> Array:
    """Floats moved by 0 to ``ulps`` units in the last place either way.

    If a function changes its behaviour at ``values``, a wrong comparison or rounding shows at the
    result and hardly anywhere else.
    """
    moved = np.array(values)
    if moved.dtype.kind != "f":
        raise UsageError(f"near_ties: {moved.dtype} is not a float type")
    steps = rng.integers(-ulps, ulps + 1, moved.shape)
    for k in range(ulps):
        with np.errstate(all="ignore"):
            above, below = (np.nextafter(moved, moved.dtype.type(end)) for end in (np.inf, -np.inf))
        moved = np.where(steps > k, above, np.where(steps < -k, below, moved))
    return moved
