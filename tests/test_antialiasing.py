"""Samples: edges cover what the solids do, and memory does not grow with their number."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.contract.arrays import Floats
from halfstep.frames.frame import Frame
from halfstep.host.camera import View, view
from halfstep.run import gpu as run_gpu
from halfstep.scene import Scene

SIZE = (90, 70)
# The sphere stands off the view axis, where its outline is an ellipse.
CENTER, RADIUS = np.array([0.4, 0.0, -0.3]), 1.3
LINES = 400  # in a pixel, along which its coverage is exact


def scene(solid: dict[str, Any]) -> Scene:
    """White in any light before black, so that linear colour is coverage."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": (0, -6, 0), "look_at": (0, 0, 0)},
            "image": {"width": SIZE[0], "height": SIZE[1], "background": (0, 0, 0)},
            "accuracy": {"steps": 16},
            "ambient": {"color": (1, 1, 1)},
            "light": [{"direction": (0, -1, 0), "color": (0, 0, 0)}],
            "solid": [{"color": (1, 1, 1), **solid}],
        }
    )


SPHERE = scene({"kind": "sphere", "radius": RADIUS, "origin": CENTER})


def sphere_coverage() -> Floats:
    """The part of each pixel (H, W) that sees the sphere, in float64.

    A ray with direction v from the eye meets a sphere about c if (v·c)² >= v² (c² - r²): along a
    line in the picture, a quadratic in the column.
    """
    seen = view(SPHERE.camera, SIZE)
    to_center = seen.camera_from_world @ (CENTER - seen.eye)
    level = to_center @ to_center - RADIUS**2
    # Rays to the left end of each line; the first pixel's centre is half a pixel from its sides.
    rows = (np.arange(SIZE[1] * LINES) + 0.5) / LINES
    start = np.ones((len(rows), 3))
    start[:, 0] = seen.x_first - 0.5 * seen.pixel
    start[:, 1] = seen.y_first + (rows - 0.5) * seen.pixel
    step = np.array([seen.pixel, 0.0, 0.0])

    def product(p: Floats, q: Floats) -> Floats:
        return np.asarray((p @ to_center) * (q @ to_center) - level * (p * q).sum(axis=-1))

    a, b, c = product(step, step), product(start, step), product(start, start)
    assert a < 0  # the outline is an ellipse
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    left, right = (b - root) / -a, (b + root) / -a
    columns = np.arange(SIZE[0])
    covered = np.clip(right[:, None], columns, columns + 1)
    covered = covered - np.clip(left[:, None], columns, columns + 1)
    return np.asarray(covered.reshape(SIZE[1], LINES, SIZE[0]).mean(axis=1))


def rectangle_coverage(seen: View, low: Floats, high: Floats) -> Floats:
    """The part of each pixel (H, W) within tangents ``low``…``high`` (x, y)."""
    first = np.array([seen.x_first, seen.y_first])
    near, far = (low - first) / seen.pixel + 0.5, (high - first) / seen.pixel + 0.5
    parts = [
        np.clip(far[k], np.arange(n), np.arange(n) + 1)
        - np.clip(near[k], np.arange(n), np.arange(n) + 1)
        for k, n in enumerate(SIZE)
    ]
    return np.multiply.outer(parts[1], parts[0])


def linear(image: NDArray[np.uint8]) -> Floats:
    """Linear values of sRGB."""
    value = image / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def mean_along_edges(frame: Frame, exact: Floats) -> tuple[float, float]:
    """Mean distance from the exact coverage of pixels on the edge: of color and of image."""
    edge = (exact > 0) & (exact < 1)
    assert edge.sum() > 50
    errors = [
        np.abs(each - exact)[edge] for each in (frame.color[..., 0], linear(frame.image)[..., 0])
    ]
    return float(errors[0].mean()), float(errors[1].mean())


@pytest.mark.parametrize("samples", [1, 2, 4, 8])
def test_a_silhouette_covers_what_the_sphere_does(backend: str, samples: int) -> None:
    frame = halfstep.render(SPHERE, samples=samples, outputs=("image", "color"), backend=backend)
    exact = sphere_coverage()
    color, image = mean_along_edges(frame, exact)
    # An edge at any place between two samples of k: a quarter of their distance on average.
    assert color <= 1 / (4 * samples)
    assert image <= 1 / (4 * samples) + 1 / 255
    assert color > 0.02 / samples, "suspiciously good"
    # No side is favoured: the samples lie in the middle of their part of the pixel, 1/k wide.
    rows, columns = np.indices(exact.shape)
    for place in (rows, columns):
        found, expected = (np.average(place, weights=w) for w in (frame.color[..., 0], exact))
        assert abs(found - expected) < 0.1 / samples
    inside, outside = exact == 1, exact == 0
    assert (frame.image[inside] == 255).all()
    assert (frame.image[outside] == 0).all()


def test_edges_along_the_grid_are_covered_too(backend: str) -> None:
    """The worst edges: whole columns of samples fall on the same side."""
    errors = []
    for shift in (np.arange(8) + 0.5) / 8:
        seen = view(SPHERE.camera, SIZE)
        # Edges between two columns of samples and between two rows, six units away.
        low, high = np.array([20.0, 15.0]), np.array([71.0, 52.0])
        first = np.array([seen.x_first, seen.y_first])
        low, high = (6 * (first + seen.pixel * (each + shift / 4)) for each in (low, high))
        patch = {
            "kind": "plane",
            "axis": (0, -1, 0),
            # Rows count downwards.
            "bounds": {"min": (low[0], 0, -high[1]), "max": (high[0], 0, -low[1])},
        }
        frame = halfstep.render(
            scene(patch), samples=4, outputs=("image", "color"), backend=backend
        )
        errors.append(mean_along_edges(frame, rectangle_coverage(seen, low / 6, high / 6)))
    color, image = np.mean(errors, axis=0)
    assert 0.9 / 16 < color < 1.01 / 16
    assert image <= 1 / 16 + 1 / 255


@pytest.mark.slow
def test_memory_does_not_grow_with_the_samples(
    backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1 << 22)

    def peak(samples: int) -> int:
        tracemalloc.start()
        halfstep.render(
            SPHERE, size=(128, 384), samples=samples, outputs=("image",), backend=backend
        )
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(1)  # what is made once
    few, many = peak(4), peak(8)
    assert few > 10 * 128 * 384  # the arrays are traced
    assert many < 2 * few  # not four times as much
