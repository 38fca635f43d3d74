"""No solid shows outside what its own points project to, at any distance, in any format."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Floats
from halfstep.scene import Camera, Scene
from tests.scenes_random import KINDS, random_solid
from tests.soundness import Shot, Way

Table = dict[str, Any]

SIZE = (48, 40)
WAYS = (
    Way(9),
    Way(20),
    Way(16, number_format="fixed32"),
    Way(8, "article"),
    Way(20, "article"),
    Way(12, "article", "fixed32"),
)
DRAWS = 8


def _solid(kind: str, rng: np.random.Generator, slender: float) -> tuple[Table, Floats]:
    """A bounded solid of reach 1 or so, and local points (N, 3) whose hull is no smaller.

    But for what lies between the points; ``slender``: lengths differ up to 10 to this.
    """
    a, b, c = (float(v) for v in 10.0 ** -rng.uniform(0, slender, 3))
    around = np.linspace(0, 2 * np.pi, 181)
    ring = np.column_stack([np.cos(around), np.sin(around), np.zeros(181)])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])

    def revolved(radius: Any) -> Floats:
        z = np.linspace(-b, c, 81)
        return np.concatenate([r * ring + [0, 0, h] for h, r in zip(z, radius(z), strict=True)])

    cuts: Table = {"z_min": -b, "z_max": c}
    if kind in ("sphere", "ellipsoid"):
        shape: Table = {"radius": a} if kind == "sphere" else {"semi_axes": [a, b, c]}
        axes = (a, a, a) if kind == "sphere" else (a, b, c)
        height = np.linspace(-1, 1, 91)
        ball = [np.sqrt(1 - h * h) * ring + [0, 0, h] for h in height]
        return {"kind": kind, **shape}, np.concatenate(ball) * axes
    if kind == "cylinder":
        return {"kind": kind, "radius": a, **cuts}, revolved(lambda z: a + 0 * z)
    if kind == "cone":
        return {"kind": kind, "slope": a, **cuts}, revolved(lambda z: a * np.abs(z))
    if kind == "hyperboloid_one_sheet":
        return (
            {"kind": kind, "waist": a, "c": b, **cuts},
            revolved(lambda z: a * np.sqrt(1 + (z / b) ** 2)),
        )
    if kind == "hyperboloid_two_sheets":
        return (
            {"kind": kind, "a": a, "c": c / 4, "z_min": -c / 2, "z_max": c},
            np.array([[0, 0, -c / 2], [0, 0, c], *(a * np.sqrt(15) * ring + [0, 0, c])]),
        )
    if kind == "paraboloid":
        return {"kind": kind, "a": a, "z_max": c}, np.array(
            [[0, 0, 0], *(a * np.sqrt(c) * ring + [0, 0, c]), *(a * np.sqrt(c) * ring)]
        )
    if kind == "box":
        return {"kind": kind, "size": [2 * a, 2 * b, 2 * c]}, corners * (a, b, c)
    if kind == "plane":
        # The bounds are a world box: the solid stands across a world axis.
        flat = corners * (a, b, 0)
        bounds = {"min": [-a, -b, -c], "max": [a, b, c]}
        return {"kind": kind, "bounds": bounds}, flat
    if kind == "polyhedron":
        solid = random_solid(kind, np.zeros(3), 1.0, rng)
        walls = [
            [x, y, z, d]
            for (x, y, z), d in zip([*np.eye(3), *-np.eye(3)], (a, b, c) * 2, strict=True)
        ]
        return {"kind": kind, "half_spaces": walls + solid["half_spaces"][6:]}, corners * (a, b, c)
    # A quadric of any signs within walls of its own.
    coefficients = [*rng.normal(size=9).tolist(), -1.0]
    walls = [[x, y, 0.0, d] for x, y, d in ((1, 0, a), (-1, 0, a), (0, 1, b), (0, -1, b))]
    return (
        {"kind": kind, "coefficients": coefficients, "z_min": -c, "z_max": c, "cut": walls},
        corners * (a, b, c),
    )


def _axes(camera: Camera) -> Floats:
    """Right, down and forward."""
    forward = np.subtract(camera.look_at, camera.center)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(forward, right), forward])


def _aimed(solid: Table, ratio: float, across: float, off: bool, rng: np.random.Generator) -> Scene:
    """The solid from ``ratio`` away, ``across`` pixels wide, at a pixel's centre or ``off`` it."""
    height = SIZE[1]
    pixel = 1 / (ratio * across)
    fov = float(np.clip(np.degrees(2 * np.arctan(pixel * height / 2)), 1e-9, 100))
    pixel = 2 * np.tan(np.radians(fov) / 2) / height
    forward, up = rng.normal(size=(2, 3))
    forward /= np.linalg.norm(forward)
    camera = {"center": [0.0] * 3, "look_at": forward.tolist(), "up": up.tolist()}
    right, down, _ = _axes(Camera.model_validate(camera))
    place = rng.integers(0, SIZE) - (np.array(SIZE) - 1) / 2
    place = place * pixel + off * rng.uniform(-0.7, 0.7, 2) * min(pixel, 1 / ratio)
    eye = -ratio * (forward + place[0] * right + place[1] * down)
    camera |= {"center": eye.tolist(), "look_at": (eye + ratio * forward).tolist()}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {**camera, "fov_degrees": fov},
            "solid": [{"color": [1.0, 1.0, 1.0], **solid}],
        }
    )


def _projected(scene: Scene, points: Floats) -> Floats:
    """Pixel coordinates (2, 2) of the least and the greatest that points project to."""
    camera, solid = scene.camera, scene.solids[0]
    world = points @ solid.world_from_local().T + solid.origin
    x, y, z = _axes(camera) @ (world - camera.center).T
    assert camera.fov_degrees is not None
    pixel = 2 * np.tan(np.radians(camera.fov_degrees) / 2) / SIZE[1]
    places = np.array([x, y]) / z / pixel + (np.array(SIZE)[:, None] - 1) / 2
    return np.array([places.min(axis=1), places.max(axis=1)])


@pytest.mark.parametrize("slender", [1.0, 6.0])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_no_solid_shows_outside_its_projection(
    kind: str, slender: float, rng: np.random.Generator
) -> None:
    hits = smaller = 0
    for draw in range(DRAWS):
        solid, points = _solid(kind, rng, slender)
        # Half of them are far smaller than a pixel.
        small = draw % 2 == 0
        across = 10.0 ** (rng.uniform(-9, -1) if small else rng.uniform(0, 1.2))
        scene = _aimed(solid, 10.0 ** rng.uniform(1, 12), across, draw % 4 > 1, rng)
        low, high = _projected(scene, points)
        shot = Shot(scene, SIZE)
        truth = shot.oracle().trace().solid >= 0
        for way in WAYS:
            frame = shot.render(way)
            hit = frame["solid"] >= 0
            j, i = np.nonzero(hit)
            places = np.column_stack([i, j])
            label = f"draw {draw} {way}: {scene.solids[0]!r}"
            assert np.all((places >= low - 1) & (places <= high + 1)), label
            assert not np.any(np.isfinite(frame["error"]) & (hit != truth)), label
            hits += len(places)
            smaller += small and len(places) > 0
    assert hits > (20 if slender == 1 else 2)
    assert smaller > 0 or slender > 1


@pytest.mark.parametrize("way", WAYS[:3], ids=str)
@pytest.mark.parametrize("kind", ["sphere", "ellipsoid", "cylinder", "box", "plane"])
@pytest.mark.parametrize("power", [3, 7, 12])
def test_a_dot_is_one_pixel(kind: str, power: int, way: Way, backend: str) -> None:
    """A solid around the middle of the picture that is far smaller than a pixel."""
    shapes: dict[str, Table] = {
        "sphere": {"radius": 1.0},
        "ellipsoid": {"semi_axes": [0.5, 1.0, 0.25]},
        "cylinder": {"radius": 1.0, "z_min": -1.0, "z_max": 1.0},
        "box": {"size": [1.0, 2.0, 3.0]},
        "plane": {"axis": [0, 1, 0], "bounds": {"min": [-1.0] * 3, "max": [1.0] * 3}},
    }
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.0, -(10.0**power), 0.0], "look_at": [0.0, 0.0, 0.0]},
            "solid": [{"kind": kind, "color": [1.0, 1.0, 1.0], **shapes[kind]}],
        }
    )
    frame = halfstep.render(
        scene,
        size=(37, 33),
        steps=way.steps,
        number_format=way.number_format,
        backend=backend,
        outputs=("solid", "depth", "error"),
    )
    assert np.argwhere(frame.solid >= 0).tolist() == [[16, 18]]
    # At 10^12 float64 knows where the solid is to a thousandth of its size; that may not suffice.
    certain = np.isfinite(frame.error)
    assert certain.sum() >= certain.size - (power == 12)
    depth = {"sphere": -1.0, "ellipsoid": -1.0, "cylinder": -1.0, "box": -1.0, "plane": 0.0}[kind]
    off = abs(frame.depth[16, 18] - (10.0**power + depth))
    assert off <= frame.error[16, 18]


@pytest.mark.parametrize("thin", [1e-3, 1e-5, 1e-7])
def test_a_needle_ends_at_its_tips(thin: float) -> None:
    """Beyond them, on its axis, G² - 4 A C is a small difference of large numbers."""
    size, hits = (49, 49), 0
    for turn in (0.0, 45.0, 90.0, 135.0):
        needle: Table = {"kind": "ellipsoid", "semi_axes": [thin, thin, 1.0]}
        scene = Scene.from_dict(
            {
                "format": 1,
                "camera": {
                    "center": [0.0, -30.0, 0.0],
                    "look_at": [0.0, 0.0, 0.0],
                    "fov_degrees": 10.0,
                },
                "solid": [
                    {**needle, "rotation_degrees": [0.0, turn, 0.0], "color": [1.0, 1.0, 1.0]}
                ],
            }
        )
        tip = np.array([np.sin(np.radians(turn)), np.cos(np.radians(turn))])
        reach = np.abs(tip) / 30 / (2 * np.tan(np.radians(5)) / size[1])
        shot = Shot(scene, size)
        for way in WAYS:
            shown = np.argwhere(shot.render(way)["solid"] >= 0) - np.array(size) // 2
            assert np.all(np.abs(shown[:, ::-1]) <= reach + 1), f"turned {turn}, {way}"
            hits += len(shown)
    assert hits > 150
