"""No warning of NumPy reaches a user: values beyond floating point are meant or do not occur.

Warnings are errors here, as in many test suites; those of Halfstep itself say what is not met.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.errors import SceneError
from halfstep.scene import Scene, with_overrides
from halfstep.tune.measure import tune
from tests.scenes_random import KINDS, random_solid

Table = dict[str, Any]

SHAPES = ((1, 300), (300, 1), (1, 1), (2, 1), (17, 3))
FIELDS_OF_VIEW = (1e-3, 0.1, 45.0, 120.0, 179.9)
AXES = [*np.eye(3).tolist(), *(-np.eye(3)).tolist()]
# Whole and half numbers put eyes on planes and rays in them; the others end the allowed ranges.
EXTREME = (1e-15, 1e-10, 1e-5, 1e5, 1e10, 1e15)
EVERYTHING = ("image", "color", "depth", "depth_exit", "position", "normal", "error")


def _scene(*solids: Table, **tables: Any) -> Scene:
    coloured = [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids]
    return Scene.from_dict({"format": 1, "solid": coloured, **tables})


def _render(scene: Scene, shape: tuple[int, int], **options: Any) -> halfstep.Frame:
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.filterwarnings("ignore", "the tolerance needs more", UserWarning)
        frame = halfstep.render(scene, size=shape, backend="numpy", outputs=EVERYTHING, **options)
        hit = frame.solid >= 0
        assert np.isfinite(frame.color).all()
        assert np.isfinite(frame.normal).all()
        assert np.isfinite(frame.depth[hit]).all()
        assert np.isfinite(frame.position[hit]).all()
    return frame


@pytest.mark.parametrize("shape", [(1, 2048), (1, 16384), (16384, 1), (1, 1)])
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_a_narrow_picture(shape: tuple[int, int], number_format: str) -> None:
    """No ray of a picture one pixel wide meets the sides of a patch, on which the eye may look."""
    patch = {"kind": "plane", "bounds": {"min": [-11, -7, 0], "max": [11, 5, 0]}}
    camera = {"center": [0, -15, 6.2], "look_at": [0, 0.3, 1.6], "fov_degrees": 34}
    frame = _render(_scene(patch, camera=camera), shape, number_format=number_format)
    assert (frame.solid >= 0).any() == (shape[1] > 1)


def test_a_plane_along_all_rays() -> None:
    """The eye beside it is told no depth where it is reached."""
    box: Table = {"kind": "box", "size": [2.0, 20.0, 2.0]}
    for height in (1.0, 0.5, 1e-300, 0.0):
        camera = {"center": [0.0, -10.0, height], "look_at": [0.0, 1.0, height]}
        for shape in SHAPES:
            _render(_scene(box, camera=camera), shape)


@pytest.mark.parametrize("method", ["visible", "article"])
@pytest.mark.parametrize("power", [9, 12, 14])
def test_far_away_all_errors_are_finite_or_infinite(power: int, method: str) -> None:
    """Nothing is known of a cut solid at 10^12; in integers products of its errors overflowed."""
    solid = {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 2.7, "z_min": -2.0, "z_max": 3.0}
    volume = {"min": [-2.0, -1.0, -0.4], "max": [2.1, 1.0, 1.0]}
    camera = {
        "center": [-(10.0**power), -2219.9, -2.6],
        "look_at": [-1.0, -0.5, -2.0],
        "up": [0.5, 0.4, 0.1],
        "fov_degrees": 90.0,
    }
    for number_format in ("float32", "fixed32"):
        for steps in (8, 20):
            scene = _scene(solid, camera=camera, volume=volume)
            _render(scene, (17, 3), number_format=number_format, steps=steps, method=method)


def _number(rng: np.random.Generator, wild: float) -> float:
    return float(rng.choice(EXTREME) if rng.random() < wild else rng.choice([0.5, 1.0, 2.0, 3.0]))


def _point(rng: np.random.Generator, wild: float) -> list[float]:
    signs = rng.integers(-1, 2, 3)
    return [float(sign) * _number(rng, wild) for sign in signs]


def _aligned(kind: str, rng: np.random.Generator, wild: float) -> Table:
    """A solid of round numbers along the axes, or of random ones."""
    length = [_number(rng, wild) for _ in range(6)]
    if rng.random() < 0.3:
        return random_solid(kind, np.zeros(3), 1.0, rng)
    half_spaces = [[*axis, d] for axis, d in zip(AXES, length, strict=True)]
    coefficients = [float(rng.integers(-1, 2)) * _number(rng, wild) for _ in range(10)]
    shapes: dict[str, Table] = {
        "sphere": {"radius": length[0]},
        "ellipsoid": {"semi_axes": length[:3]},
        "cylinder": {"radius": length[0]},
        "cone": {"slope": length[0]},
        "hyperboloid_one_sheet": {"waist": length[0], "c": length[1]},
        "hyperboloid_two_sheets": {"a": length[0], "c": length[1]},
        "paraboloid": {"a": length[0]},
        "quadric": {"coefficients": coefficients},
        "box": {"size": length[:3]},
        "polyhedron": {"half_spaces": half_spaces},
        "plane": {"bounds": {"min": [-v for v in length[:3]], "max": length[3:]}},
    }
    solid = {"kind": kind, **shapes[kind]}
    if kind in KINDS[:8]:
        solid |= {"z_min": -length[4]} if rng.random() < 0.6 else {}
        solid |= {"z_max": length[5]} if rng.random() < 0.6 else {}
        cuts = [[*AXES[rng.integers(6)], _number(rng, wild)] for _ in range(rng.integers(0, 3))]
        solid |= {"cut": cuts}
    return solid


@pytest.mark.parametrize("wild", [0.0, 0.15, 0.35])
@pytest.mark.slow
def test_scenes_of_round_and_of_extreme_numbers(wild: float, rng: np.random.Generator) -> None:
    rendered = hits = 0
    for number in range(150):
        solids = [_aligned(str(rng.choice(KINDS)), rng, wild) for _ in range(rng.integers(1, 4))]
        away = 10.0 ** float(rng.choice([0, 0, 1, 3, 12]))
        center = [float(np.clip(away * c, -1e15, 1e15)) for c in _point(rng, wild)]
        tables: Table = {
            "camera": {
                "center": center,
                "look_at": _point(rng, wild),
                "up": AXES[rng.integers(6)],
                "fov_degrees": float(rng.choice(FIELDS_OF_VIEW)),
            },
            "volume": {"min": [-_number(rng, wild)] * 3, "max": [_number(rng, wild)] * 3},
            "light": [{"position": _point(rng, wild)}, {"direction": AXES[rng.integers(6)]}],
        }
        try:
            scene = _scene(*solids, **tables)
        except SceneError:
            continue
        shape = SHAPES[rng.integers(len(SHAPES))]
        options = {
            "number_format": str(rng.choice(["float32", "fixed32"])),
            "method": str(rng.choice(["visible", "article"])),
            str(rng.choice(["tolerance", "tolerance_pixels"])): 10.0 ** rng.uniform(-12, 12),
        }
        try:
            frame = _render(scene, shape, **options)
        except (RuntimeWarning, AssertionError) as fault:
            raise AssertionError(f"scene {number} {shape} {options}: {scene!r}") from fault
        rendered += 1
        hits += int((frame.solid >= 0).any())
    assert rendered > 60
    assert hits > 10


def test_tuning_a_narrow_picture() -> None:
    patch = {"kind": "plane", "bounds": {"min": [-11, -7, 0], "max": [11, 5, 0]}}
    camera = {"center": [0, -15, 6.2], "look_at": [0, 0.3, 1.6], "fov_degrees": 34}
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        report = tune(
            _scene(patch, camera=camera), size=(1, 128), steps=(4, 8), repeats=1, backend="numpy"
        )
    assert report.rows


def test_points_beside_the_solid_that_is_asked_where_it_is() -> None:
    camera = {"center": (16.0, -55.0, 34.6), "look_at": (3.2, -9.0, -13.7), "fov_degrees": 36.0}
    scene = with_overrides(halfstep.load("figure"), size=(28, 152), shadows=True, camera=camera)
    frame = halfstep.render(scene, outputs=("color", "shadow"), backend="numpy")
    assert (frame.solid >= 0).any()
