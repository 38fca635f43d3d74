"""The least distance of surfaces side by side is that of closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.host.thin import least_distance

Floats = NDArray[np.float64]


def round_surface(axis: Floats | None, radius: float, center: Floats) -> Floats:
    second = np.eye(3) if axis is None else np.eye(3) - np.outer(axis, axis)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = second
    matrix[:3, 3] = matrix[3, :3] = -second @ center
    matrix[3, 3] = center @ second @ center - radius**2
    return matrix


def plane(normal: Floats, place: float) -> Floats:
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = matrix[3, :3] = normal / 2
    matrix[3, 3] = -place
    return matrix


@pytest.mark.parametrize("seed", range(8))
def test_distance_of_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    center, gap = rng.uniform(-0.5, 0.5, 3), float(10 ** rng.uniform(-5, -1))
    for pair in (
        [plane(axis, 0.2), -3.0 * plane(axis, 0.2 + gap)],
        [round_surface(None, 0.4, center), 7.0 * round_surface(None, 0.4 + gap, center)],
        [round_surface(axis, 0.4, center), 0.1 * round_surface(axis, 0.4 + gap, center)],
    ):
        others = [round_surface(None, 0.9, center + 1), plane(np.roll(axis, 1), 0.3)]
        found = least_distance(np.stack([*others, *pair], axis=-1), 2.0)
        assert found == pytest.approx(gap, rel=1e-4)


def test_surfaces_apart_have_none() -> None:
    rng = np.random.default_rng(5)
    surfaces = [round_surface(None, 0.5, rng.uniform(-1, 1, 3)) for _ in range(5)]
    assert least_distance(np.stack(surfaces, axis=-1), 1.0) == np.inf


@pytest.mark.parametrize("seed", range(4))
def test_films_between_planes_and_what_is_round(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal, along = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    center, gap = rng.uniform(-0.3, 0.3, 3), float(10 ** rng.uniform(-5, -1))
    film = plane(normal, normal @ center + 0.4 + gap)
    for axis in (None, along):
        pair = [film, 3.0 * round_surface(axis, 0.4, center)]
        found = least_distance(np.stack(pair, axis=-1), 1.5)
        assert found == pytest.approx(gap, rel=1e-4)
        # From the other side of the plane a gap is left, too.
        pair[0] = -2.0 * plane(normal, normal @ center - 0.4 + gap)
        assert least_distance(np.stack(pair, axis=-1), 1.5) == pytest.approx(gap, rel=1e-4)
    # A cylinder across the plane, one beyond the box, and one that touches it leave none.
    for other in (
        round_surface(normal, 0.4, center),
        round_surface(along, 0.4, center + 5 * normal),
        round_surface(along, 0.4 + gap, center),
    ):
        found = least_distance(np.stack([film, other], axis=-1), 1.5)
        assert found == np.inf
