"""Signs of tori in blocks of pixels: points in them have these signs, and frames stay the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import F32, Bools, Floats, Ints
from halfstep.host.excerpts import lists_of
from halfstep.host.pack import Packed
from halfstep.host.prepare import prepare
from halfstep.host.signs import PIECES
from halfstep.host.tori import Tori
from halfstep.scene import Scene

OUTPUTS = ("image", "solid", "cell", "depth")
PERSPECTIVE: dict[str, Any] = {"fov_degrees": 45}
PARALLEL: dict[str, Any] = {"orthographic_height": 5}
TORI = [(1.5, 0.9, 0.9), (1.4, 0.4, 0.8), (1.2, 0.3, 0.2), (0.5, 0.8, 0.9)]


def nested(camera: dict[str, Any], **tables: Any) -> Scene:
    """Cells between tori in each other, and a plane that cuts them."""
    surfaces = [
        {
            "id": 1 + k,
            "kind": "torus",
            "major": major,
            "minor": minor,
            "origin": [0.05 * k, 0, 0],
            "rotation_degrees": [4 * k, 20, 0],
        }
        for k, (major, *minor) in enumerate(TORI)
    ]
    colors = np.eye(3).tolist()
    regions = ["-1 2 -5", "-2 3 -5", "-3 -5"]
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [2, -6, 3.5], "look_at": [0, 0, 0], **camera},
            "image": {"width": 208, "height": 160},
            "surface": [*surfaces, {"id": 5, "kind": "plane", "axis": [1, 1, 0.2]}],
            "cell": [{"region": one, "color": c} for one, c in zip(regions, colors, strict=True)],
            **tables,
        }
    )


def measures(points: Floats, lengths: Floats) -> Floats:
    """F of tori (4, P) at points (3, …, P), less than 0 inside."""
    x, y, z = points
    major, across, along = lengths.reshape(3, *[1] * (points.ndim - 2), -1)
    return np.asarray(((np.hypot(x, y) - major) / across) ** 2 + (z / along) ** 2 - 1)


@pytest.mark.parametrize("camera", [PERSPECTIVE, PARALLEL])
def test_points_have_the_signs_that_are_known(
    camera: dict[str, Any], rng: np.random.Generator
) -> None:
    copies = prepare(nested(camera)).setup.copies
    assert copies is not None
    assert copies.higher is not None
    tori = copies.higher.tori
    count = 4000
    number = rng.integers(0, len(tori.major), count)
    assert len(tori.major) == 3
    x, y = rng.uniform(-60, 60, count), rng.uniform(-50, 50, count)
    across, down = rng.uniform(0, 8, (2, count))
    begin, end = np.sort(rng.uniform(-1, 1, (2, count)), axis=0)
    end = begin + (end - begin) * rng.random(count) ** 2
    edges = begin + (end - begin) * np.arange(PIECES + 1)[:, None] / PIECES
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges, axis=0) / 2
    places = np.concatenate([np.stack([x, y, across, down]), middle, half]).astype(np.float32)
    inside, outside = tori.signs(number, places)
    assert min(inside.mean(), outside.mean()) > 0.01
    # Points of the rays, from the records of the frame's own surfaces.
    ends = np.moveaxis(tori.ends.astype(np.float64)[..., number], 1, 0)
    lengths = np.array(TORI)[number].T
    for _ in range(60):
        dx, dy, du = np.round(rng.uniform(-1.3, 1.3, (3, count))).clip(-1, 1)
        one, other = (
            each[0] + each[1] * (x + dx * across) + each[2] * (y + dy * down) for each in ends
        )
        u = middle + du * half
        points = one[:, None] * (1 - u) / 2 + other[:, None] * (1 + u) / 2
        found = measures(points, lengths)
        assert (found[inside] < 0).all()
        assert (found[outside] > 0).all()


def test_records_of_tori_have_the_points_of_rays() -> None:
    """They are those of the world, turned into the coordinates of the torus."""
    scene = nested(PERSPECTIVE)
    setup = prepare(scene).setup
    copies = setup.copies
    assert copies is not None
    assert copies.higher is not None
    tori, row = copies.higher.tori, int(copies.row[0])
    i0, j0 = setup.center[row].tolist()
    for k, surface in enumerate(scene.surfaces[:3]):
        turn, origin = surface.world_from_local(), np.array(surface.origin)
        for u, end in ((-1, 0), (1, 1)):
            depth = np.array(setup.depth_middle[row] + u * setup.depth_half[row])
            i, j = np.array(i0 + 7), np.array(j0 - 5)
            expected = (setup.view.points(i, j, depth) - origin) @ turn
            one, by_x, by_y = tori.ends[:, end, :, k].astype(np.float64)
            assert one + 7 * by_x - 5 * by_y == pytest.approx(expected, abs=1e-5)


def unknown(self: Tori, number: Ints, places: F32) -> tuple[Bools, Bools]:
    """No sign is known."""
    del self
    nothing = np.zeros((PIECES, len(number)), bool)
    assert places.shape[1] == len(number)
    return nothing, nothing


def same(scene: Scene) -> bool:
    """Whether a frame is the same bits as without signs of tori."""
    some = halfstep.render(scene, backend="numpy", outputs=OUTPUTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tori, "signs", unknown)
        every = halfstep.render(scene, backend="numpy", outputs=OUTPUTS)
    assert (every.solid >= 0).mean() > 0.1
    return all(
        np.array_equal(getattr(some, name), getattr(every, name), equal_nan=name == "depth")
        for name in OUTPUTS
    )


def words_of(packed: Packed) -> int:
    """Groups of words of the programs that all tiles try."""
    regions = lists_of(packed, 0, packed.setup.view.height, frozenset({"image"})).regions
    assert regions is not None
    first, end = (regions.records[name].astype(np.int64) for name in ("first_group", "end_group"))
    return int((end - first).sum())


@pytest.mark.parametrize("camera", [PERSPECTIVE, PARALLEL])
def test_frames_are_the_same_with_fewer_surfaces(camera: dict[str, Any]) -> None:
    scene = nested(camera)
    packed = prepare(scene)
    some = words_of(packed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tori, "signs", unknown)
        assert some < 0.9 * words_of(packed)
    assert same(scene)


def test_slips_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("halfstep.host.tori.MARGIN", -1.0)
    assert not same(nested(PERSPECTIVE))
