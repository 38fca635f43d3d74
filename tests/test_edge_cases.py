"""The cases that renderers are known to get wrong, one by one, on both back ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.host.prepare import prepare
from halfstep.scene import Scene, with_overrides
from tests.judge import DELTA_ON_SURFACE, OUTPUTS, Judge, Verdict

Table = dict[str, Any]

SIZE = (33, 25)
MIDDLE = (SIZE[1] // 2, SIZE[0] // 2)


def _scene(
    *solids: Table,
    center: tuple[float, ...] = (0.0, -8.0, 0.0),
    look_at: tuple[float, ...] = (0.0, 0.0, 0.0),
    fov: float = 45.0,
    volume: float | tuple[list[float], list[float]] | None = None,
) -> Scene:
    tables: Table = {
        "format": 1,
        "camera": {"center": [*center], "look_at": [*look_at], "fov_degrees": fov},
        "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
    }
    if isinstance(volume, tuple):
        tables["volume"] = {"min": volume[0], "max": volume[1]}
    elif volume is not None:
        tables["volume"] = {"min": [-volume] * 3, "max": [volume] * 3}
    return Scene.from_dict(tables)


def _frame(scene: Scene, backend: str, steps: int = 16, method: str = "visible") -> halfstep.Frame:
    return halfstep.render(
        scene, size=SIZE, steps=steps, method=method, backend=backend, outputs=OUTPUTS
    )


def _judged(scene: Scene, frame: halfstep.Frame, steps: int = 16, delta: float = 1e-3) -> Verdict:
    """The verdict on a frame, which has no faults."""
    verdict = Verdict()
    Judge(scene, SIZE, delta).visible(frame, steps, verdict, "")
    assert verdict.faults == []
    return verdict


_SPHERE: Table = {"kind": "sphere", "radius": 2.0}
_CUBE: Table = {"kind": "box", "size": [2.0, 2.0, 2.0]}


@pytest.mark.parametrize("solid", [{"kind": "sphere", "radius": 1.0}, _CUBE], ids=["sphere", "box"])
def test_an_eye_on_the_surface_looking_in_sees_the_other_side(solid: Table, backend: str) -> None:
    scene = _scene(solid, center=(0.0, -1.0, 0.0))
    frame = _frame(scene, backend)
    assert _judged(scene, frame, delta=DELTA_ON_SURFACE).hits == SIZE[0] * SIZE[1]
    assert frame.depth[MIDDLE] == pytest.approx(2.0, abs=2.0**-14)


@pytest.mark.parametrize("solid", [{"kind": "sphere", "radius": 1.0}, _CUBE], ids=["sphere", "box"])
def test_an_eye_on_the_surface_looking_out_is_at_its_exit(solid: Table, backend: str) -> None:
    # Another solid ahead, so that there is something between the base planes.
    scene = _scene(
        solid,
        {"kind": "sphere", "radius": 1.0, "origin": [0.0, -5.0, 0.0]},
        center=(0.0, -1.0, 0.0),
        look_at=(0.0, -2.0, 0.0),
    )
    frame = _frame(scene, backend)
    _judged(scene, frame, delta=DELTA_ON_SURFACE)
    assert np.all(frame.solid == 0)
    assert np.all(frame.depth <= 2.0**-12)


def test_a_camera_inside_a_sphere_sees_it_everywhere(backend: str) -> None:
    scene = _scene(_SPHERE, center=(0.5, -0.25, 0.1), fov=100.0)
    frame = _frame(scene, backend)
    assert _judged(scene, frame).hits == SIZE[0] * SIZE[1]
    assert np.all(frame.solid == 0)
    assert np.array_equal(frame.depth, frame.depth_exit)


def _tube(half_length: float) -> Table:
    """A cylinder along the world's y."""
    ends = {"z_min": -half_length, "z_max": half_length}
    return {"kind": "cylinder", "radius": 0.5, "axis": [0, 1, 0], **ends}


def test_down_the_bore(backend: str) -> None:
    """Along the axis of a tube the middle ray never meets its wall, but its end."""
    tube = _tube(4.0)
    inside = _scene(tube, center=(0.0, -3.0, 0.0))
    frame = _frame(inside, backend)
    assert _judged(inside, frame).hits == SIZE[0] * SIZE[1]
    assert frame.surface[MIDDLE] == 2
    assert frame.depth[MIDDLE] == pytest.approx(7.0, abs=2.0**-12)
    assert set(np.unique(frame.surface)) == {0, 2}

    outside = _scene(tube, center=(0.0, -8.0, 0.0))
    frame = _frame(outside, backend)
    _judged(outside, frame)
    assert frame.surface[MIDDLE] == 1
    assert set(np.unique(frame.surface)) == {-1, 1}


def test_a_cone_seen_at_its_apex(backend: str) -> None:
    """The apex in the middle of the middle pixel: a touch is a hit, its neighbours are exact."""
    upright: Table = {"kind": "cone", "slope": 0.5, "z_min": -2.0, "z_max": 2.0}
    scene = _scene(upright)
    frame = _frame(scene, backend)
    _judged(scene, frame)
    assert frame.surface[MIDDLE] in (0, -1)
    assert frame.surface[MIDDLE[0], MIDDLE[1] + 1] == -1
    assert frame.surface[MIDDLE[0] + 2, MIDDLE[1]] == 0

    # Cut at its apex, the cone begins where its plane and F meet: the plane is seen.
    pointing: Table = {**upright, "axis": [0.0, -1.0, 0.0], "z_min": -2.0, "z_max": 0.0}
    scene = _scene(pointing)
    frame = _frame(scene, backend)
    _judged(scene, frame)
    assert frame.surface[MIDDLE] == 2
    assert frame.surface[MIDDLE[0], MIDDLE[1] + 1] == 0
    assert frame.depth[MIDDLE] == pytest.approx(8.0, abs=2.0**-14)


def test_an_eye_at_the_apex_of_a_cone(backend: str) -> None:
    scene = _scene(
        {"kind": "cone", "slope": 0.5, "axis": [0.0, 1.0, 0.0], "z_min": -2.0, "z_max": 2.0},
        center=(0.0, 0.0, 0.0),
        look_at=(0.0, 1.0, 0.0),
        fov=90.0,
    )
    frame = _frame(scene, backend)
    judge = Judge(scene, SIZE)
    away = judge.oracle.stable_ids(DELTA_ON_SURFACE)
    assert np.array_equal(frame.solid[away], judge.truth.solid[away])
    assert frame.depth[MIDDLE] == pytest.approx(2.0, abs=2.0**-13)


def test_a_ray_along_an_asymptote(backend: str) -> None:
    """A = 0 exactly: in the plane x = 0 the rays y = -3 + t, z = ±t run along y² - z² = 0."""
    scene = _scene(
        {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 1.0},
        center=(0.0, -3.0, 0.0),
        # Slopes are multiples of 1/8, and 1 is among them.
        fov=float(2 * np.degrees(np.arctan(SIZE[1] / 16))),
        volume=([-2.0, -4.0, -2.0], [2.0, 4.0, 2.0]),
    )
    frame = _frame(scene, backend)
    _judged(scene, frame)
    for row in (MIDDLE[0] - 8, MIDDLE[0] + 8):
        assert frame.surface[row, MIDDLE[1]] == 0
        assert frame.depth[row, MIDDLE[1]] == pytest.approx(4 / 3, abs=2.0**-13)


def test_a_ray_along_a_generator_of_a_cylinder(backend: str) -> None:
    """A = 0 for every ray along the axis: F is a constant, negative, zero or positive."""
    tube = _tube(1.0)
    for offset, surface in ((0.25, 1), (0.75, -1)):
        scene = _scene(tube, center=(offset, -8.0, 0.0), look_at=(offset, 0.0, 0.0))
        frame = _frame(scene, backend)
        _judged(scene, frame)
        assert frame.surface[MIDDLE] == surface


@pytest.mark.parametrize("steps", [1, 4, 8, 16, 24, 30])
def test_a_thin_plate_loses_no_pixel(steps: int) -> None:
    """A plate 1e-4 of its width, at any number of halvings, also one that has no cell for it."""
    scene = _scene(
        {"kind": "box", "size": [4.0, 4e-4, 3.0], "rotation_degrees": [25.0, 0.0, 40.0]},
        {"kind": "cylinder", "radius": 1.0, "z_min": 1.0, "z_max": 1.0002, "axis": [0.3, 1.0, 0.5]},
        fov=28.0,
    )
    frame = _frame(scene, "numpy", steps)
    if steps >= 16:
        _judged(scene, frame, steps)
    judge = Judge(scene, SIZE)
    hits = judge.truth.solid >= 0
    lost = (hits != (frame.solid >= 0)) & judge.oracle.stable_ids(1e-3)
    assert hits.sum() > 200
    assert not lost.any()


@pytest.mark.parametrize("method", ["visible", "article"])
def test_a_face_in_the_near_base_plane_is_seen(backend: str, method: str) -> None:
    scene = _scene(_CUBE, center=(0.0, -5.0, 0.0), volume=1.0)
    frame = _frame(scene, backend, method=method)
    assert frame.surface[MIDDLE] == 3
    assert frame.depth[MIDDLE] == pytest.approx(4.0, abs=2.0**-13)
    assert np.array_equal(frame.surface, Judge(scene, SIZE).truth.surface)


@pytest.mark.parametrize("method", ["visible", "article"])
def test_a_patch_in_the_far_base_plane_is_seen(backend: str, method: str) -> None:
    patch: Table = {
        "kind": "plane",
        "origin": [0.0, 1.0, 0.0],
        "axis": [0.0, 1.0, 0.0],
        "bounds": {"min": [-0.7, 0.0, -0.9], "max": [0.8, 2.0, 0.6]},
    }
    scene = _scene(patch, center=(0.0, -5.0, 0.0), volume=1.0)
    frame = _frame(scene, backend, method=method)
    assert frame.solid[MIDDLE] == 0
    assert frame.depth[MIDDLE] == pytest.approx(6.0, abs=2.0**-13)
    assert np.array_equal(frame.solid, Judge(scene, SIZE).truth.solid)


def _slanted(
    forward: NDArray[np.float64], method: str, *, near: bool
) -> tuple[halfstep.Frame, tuple[int, int]]:
    """Frame, and solid and surface in its middle.

    A cube of a volume seen along ``forward``; a box face or a patch lies in a base plane of it.

    The base planes pass through corners, so that the surface is in one but for a rounding.
    """
    reach = float(np.abs(forward).sum())
    solid: Table = {"axis": [float(v) for v in forward]}
    if near:
        origin = (0.5 - reach) * forward
        solid |= {"kind": "box", "size": [0.6, 0.6, 1.0]}
    else:
        origin = reach * forward
        solid |= {"kind": "plane", "bounds": {"min": [-9.0] * 3, "max": [9.0] * 3}}
    solid["origin"] = [float(v) for v in origin]
    eye = tuple(float(v) for v in -8.0 * forward)
    frame = _frame(_scene(solid, center=eye, volume=1.0), "numpy", method=method)
    return frame, (int(frame.solid[MIDDLE]), int(frame.surface[MIDDLE]))


def _directions(rng: np.random.Generator) -> NDArray[np.float64]:
    directions = rng.normal(size=(40, 3))
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


@pytest.mark.parametrize("method", ["visible", "article"])
def test_a_face_in_a_slanted_near_base_plane_is_seen(method: str, rng: np.random.Generator) -> None:
    for forward in _directions(rng):
        frame, middle = _slanted(forward, method, near=True)
        assert middle == (0, 5)
        assert frame.depth[MIDDLE] == pytest.approx(8.0 - np.abs(forward).sum(), abs=2.0**-13)


@pytest.mark.parametrize("method", ["visible", "article"])
def test_a_patch_in_a_slanted_far_base_plane_is_seen(method: str, rng: np.random.Generator) -> None:
    missing = sum(_slanted(f, method, near=False)[1] != (0, 0) for f in _directions(rng))
    assert missing == 0


@pytest.mark.parametrize("method", ["visible", "article"])
def test_of_coplanar_solids_the_first_in_the_file_is_seen(backend: str, method: str) -> None:
    """Solids that share a face and a depth interval come to one depth, bit for bit."""
    wide: Table = {"kind": "box", "size": [3.0, 2.0, 1.0]}
    tall: Table = {"kind": "box", "size": [1.0, 2.0, 3.0]}
    for solids in ((wide, tall), (tall, wide)):
        scene = _scene(*solids)
        frame = _frame(scene, backend, method=method)
        shared = np.s_[MIDDLE[0] - 1 : MIDDLE[0] + 2, MIDDLE[1] - 1 : MIDDLE[1] + 2]
        assert np.all(frame.solid[shared] == 0)
        assert np.all(frame.surface[shared] == 3)
        assert np.array_equal(frame.solid, Judge(scene, SIZE).truth.solid)


def test_coplanar_solids_are_told_apart_alike_on_both_back_ends(backend: str) -> None:
    """With intervals of their own they may differ by half a cell: one of them is seen all over."""
    short: Table = {"kind": "box", "size": [3.0, 1.0, 3.0], "origin": [0.0, 0.5, 0.0]}
    long: Table = {"kind": "box", "size": [2.0, 2.0, 2.0], "origin": [0.0, 1.0, 0.0]}
    for solids in ((short, long), (long, short)):
        scene = _scene(*solids)
        frame = _frame(scene, backend)
        assert np.array_equal(frame.solid, _frame(scene, "numpy").solid)
        assert np.unique(frame.solid[MIDDLE[0] - 2 : MIDDLE[0] + 3, MIDDLE[1]]).size == 1


@pytest.mark.parametrize("volume", [None, 4.0])
def test_with_everything_behind_the_camera_the_frame_is_empty(
    backend: str, volume: float | None
) -> None:
    scene = _scene(_SPHERE, _CUBE, look_at=(0.0, -9.0, 0.0), volume=volume)
    frame = halfstep.render(scene, size=SIZE, steps=8, backend=backend)
    assert np.all(frame.solid == -1)
    assert np.all(frame.surface == -1)
    assert np.all(np.isnan(frame.depth))
    assert np.all(np.isnan(frame.depth_exit))
    assert np.all(frame.steps == 0)


def test_where_no_solid_has_a_point_there_is_the_background(backend: str) -> None:
    # x² + y² + z² + 1 <= 0
    imaginary = {"kind": "quadric", "coefficients": [1, 1, 1, 0, 0, 0, 0, 0, 0, 1]}
    scene = _scene(imaginary, volume=4.0)
    with halfstep.Renderer(scene, size=SIZE, outputs=("image", "depth"), backend=backend) as one:
        for _ in range(3):
            frame = one.render()
            assert np.all(frame.solid == -1)
            assert np.all(np.isnan(frame.depth))
            assert np.all(frame.image == frame.image[0, 0])


def test_a_ball_beside_the_eye_is_not_seen_behind_it(backend: str) -> None:
    """Lines through the eye meet an uncut ball at its side also where the ray does not."""
    scene = _scene(
        {"kind": "sphere", "radius": 1.0, "origin": [1.3, 0.2, 0.0]},
        center=(0.0, 0.0, 0.0),
        look_at=(0.0, 1.0, 0.0),
        fov=120.0,
    )
    frame = _frame(scene, backend)
    verdict = _judged(scene, frame)
    assert 0.1 < verdict.hits / verdict.rays < 0.6
    assert np.all(frame.solid[:, : MIDDLE[1]] == -1)


def test_the_base_planes_cut_a_sphere_open(backend: str) -> None:
    scene = _scene(_SPHERE, volume=([-2.0, -1.0, -2.0], [2.0, 1.0, 2.0]), fov=30.0)
    frame = _frame(scene, backend)
    verdict = _judged(scene, frame)
    # The middle ray is inside from one base plane to the other: nothing to show.
    assert frame.solid[MIDDLE] == -1
    assert verdict.hits > 50
    assert verdict.starts_inside > 10


@pytest.mark.parametrize("tilt", [0.0, 1e-17, 1e-42, 1e-300])
def test_a_plane_seen_edge_on_has_numbers_that_fit(tilt: float) -> None:
    """In the middle column it is as good as parallel to the rays; beside it, it is not."""
    box = {"min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0]}
    solid = {"kind": "plane", "axis": [1.0, 0.0, tilt], "color": [1.0, 1.0, 1.0], "bounds": box}
    camera = {"center": [0.0, -4.0, 0.0], "look_at": [0.0, 0.0, 0.0]}
    scene = Scene.from_dict({"format": 1, "camera": camera, "solid": [solid]})
    packed = prepare(with_overrides(scene, size=(41, 31)))
    for name in ("c", "b"):
        assert np.abs(packed.half_spaces[name]).max() < 2.0**66
    frame = halfstep.render(scene, size=(41, 31), backend="numpy")
    assert (frame.solid[:, np.arange(41) != 20] == -1).all()
    assert np.isinf(frame.error[5:-5, 20]).all()
