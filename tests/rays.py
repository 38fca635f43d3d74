"""Rays of oracles in extended precision."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.scene import Light

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]
Wide = NDArray[np.longdouble]

LD = np.longdouble


def to_local(solid: Any, points: Wide, vectors: Wide) -> tuple[Wide, Wide]:
    """Points and vectors (N, 3) in a solid's own coordinates."""
    turn = solid.world_from_local().astype(LD)
    return (points - np.array(solid.origin, LD)) @ turn, vectors @ turn


def way_to(light: Light, points: Wide) -> tuple[Wide, Any]:
    """The vectors (N, 3) from points to a light, and how many of them lead there."""
    if light.position is not None:
        return np.array(light.position, LD) - points, LD(1)
    toward = np.array(light.direction, LD)
    return np.broadcast_to(toward / np.sqrt((toward**2).sum()), points.shape), LD(np.inf)


def unit(vectors: Wide) -> Wide:
    """The vectors (N, 3), of length 1."""
    return np.asarray(vectors / np.sqrt((vectors**2).sum(axis=1, keepdims=True)))


def reflected(directions: Wide, normals: Wide) -> Wide:
    """The directions (N, 3) that mirrors give to rays, of length 1; normals have any length."""
    normals = unit(normals)
    along = (directions * normals).sum(axis=1, keepdims=True)
    return unit(directions - 2 * along * normals)


def value_at(terms: Any, s: Any) -> Any:
    """Polynomials with coefficients (degree + 1, N) at distances (..., N), in their precision."""
    value = np.zeros_like(s)
    for term in terms[::-1]:
        value = value * s + term
    return value
