"""The printed rules, taken literally, against the oracle: where they are wrong, and we are not.

They live only here. (13)-(19) run as printed, in float64, on the paper's own ray: t = 1 at the far
base plane P, t(k+1) = t(k) + xi(k) 2^-k over 0..2.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Bools, Floats
from halfstep.host.camera import view
from halfstep.host.prepare import frame_setup
from halfstep.scene import PlanePatch, QuadricSolid, Scene, with_overrides
from tests.judge import OUTPUTS
from tests.oracle import Oracle

Table = dict[str, Any]

SIZE = (160, 120)
STEPS = 16


class Ray(NamedTuple):
    """F(t) = a t² + b t + c along each ray from h (t = 0) to the far base plane (t = 1)."""

    a: Floats
    b: Floats
    c: Floats

    def at(self, t: Floats) -> Floats:
        """F at t."""
        return (self.a * t + self.b) * t + self.c


class Literal(NamedTuple):
    """What the printed iteration ends with."""

    found: Bools
    near: Floats  # t of P1
    far: Floats  # t of P2


def literal_quadric(ray: Ray, steps: int) -> Literal:
    """(16)-(19) as printed: phase one on the sign of a difference, then P1 and P2."""
    above = ray.c > 0
    t = np.ones(ray.c.shape)
    near, far = t.copy(), t.copy()
    found = np.zeros(ray.c.shape, bool)
    for k in range(steps):
        # (16) fails at the sample that finds the surface; from then on (18) and (19) rule.
        now = ~found & ((ray.at(t) > 0) != above)
        near, far = np.where(now, t, near), np.where(now, t, far)
        found |= now
        step = 2.0 ** -(k + 1)
        difference = ray.at(t) - ray.at(t - 2.0**-steps)
        seeks = np.where(above, difference <= 0, difference > 0)  # (17)
        t = t + np.where(seeks, step, -step)
        outside_near = np.where(above, ray.at(near) > 0, ray.at(near) <= 0)  # (18)
        near = near + np.where(outside_near, step, -step)
        # (19): for F_h > 0 mirrored, for F_h < 0 "the same as (18)".
        forward = ray.at(far) <= 0
        far = far + np.where(forward, step, -step)
    return Literal(found, near, far)


def corrected_far_point(ray: Ray, steps: int) -> Floats:
    """P2 with the column F_h < 0 of (19) mirrored too, and the sign of F' before it is found."""
    sign = np.where(ray.c > 0, 1.0, -1.0)
    t = np.ones(ray.c.shape)
    for k in range(steps):
        same = (ray.at(t) > 0) == (ray.c > 0)
        back = same & (sign * (2 * ray.a * t + ray.b) >= 0)
        t = t + np.where(back, -1.0, 1.0) * 2.0 ** -(k + 1)
    return t


def _rays(scene: Scene) -> tuple[Ray, float]:
    """The whole rays of every pixel in the first solid's coordinates, and the far depth."""
    eye, solid = view(scene.camera, SIZE), scene.solids[0]
    assert isinstance(solid, QuadricSolid)
    far = frame_setup(with_overrides(scene, size=SIZE)).far
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    rotation, matrix = solid.world_from_local(), solid.quadric()
    h = np.append((eye.eye - solid.origin) @ rotation, 1.0)
    v = np.zeros((*i.shape, 4))
    v[..., :3] = far * eye.directions(i, j) @ rotation
    a = np.einsum("...i,ij,...j->...", v, matrix, v)
    return Ray(a, 2 * v @ matrix @ h, np.full(i.shape, h @ matrix @ h)), far


def _scene(solid: Table, center: list[float], fov: float, volume: float | None) -> Scene:
    tables: Table = {
        "format": 1,
        "camera": {"center": center, "look_at": [0.0, 0.1, 0.2], "fov_degrees": fov},
        "solid": [{"color": [1.0, 1.0, 1.0], **solid}],
    }
    if volume is not None:
        tables["volume"] = {"min": [-volume] * 3, "max": [volume] * 3}
    return Scene.from_dict(tables)


@pytest.mark.parametrize(
    ("solid", "center"),
    [
        ({"kind": "cone", "slope": 0.9, "z_min": 0.1, "z_max": 2.0}, [0.5, -0.7, -1.8]),
        (
            {
                "kind": "hyperboloid_two_sheets",
                "a": 0.5,
                "c": 0.6,
                "z_min": 0.2,
                "z_max": 2.0,
            },
            [0.3, -0.6, -2.0],
        ),
        (
            {"kind": "hyperboloid_one_sheet", "waist": 0.3, "c": 0.4, "z_min": 0.4, "z_max": 2.0},
            [0.4, -1.0, -2.2],
        ),
    ],
    ids=["cone", "two sheets", "one sheet"],
)
def test_literal_19_loses_the_second_root(solid: Table, center: list[float]) -> None:
    """An eye inside the infinite surface but outside the solid: F_h < 0, A < 0, two roots ahead."""
    scene = _scene(solid, center, 80.0, None)
    truth = Oracle(scene, SIZE).trace()
    ray, far = _rays(scene)
    assert ray.c.max() < 0
    # The point seen on F is the second root: the ray left through the first, behind a plane.
    second = (truth.surface == 0) & (ray.a < 0)
    hits = int((truth.solid >= 0).sum())
    assert second.sum() > 0.05 * hits, f"{second.sum()} of {hits}"

    literal = literal_quadric(ray, STEPS)
    cell = far * 2.0**-STEPS
    off = np.abs(literal.far * far - truth.depth)
    # The cell that P2 shares with P1 may hold both roots.
    lost = off[second] > 2 * cell
    sys.stdout.write(f"{solid['kind']}: P2 lost on {lost.mean():.2%} of {second.sum()} rays\n")
    assert lost.mean() > 0.998
    right = np.abs(corrected_far_point(ray, STEPS) * far - truth.depth)[second] <= 2 * cell
    assert right.mean() > 0.998
    for method in ("visible", "article"):
        frame = halfstep.render(
            scene, size=SIZE, steps=STEPS, method=method, backend="numpy", outputs=OUTPUTS
        )
        assert np.mean((frame.surface == truth.surface)[second]) == 1.0
        assert np.nanmax(np.abs(frame.depth - truth.depth)[second]) < cell


def test_without_a_test_of_t_there_are_hits_beyond_the_far_base_plane() -> None:
    """(15) stands for planes only: a root with 1 < t < 2 lies behind P, and is taken."""
    cases: list[Table] = [
        {"kind": "sphere", "radius": 1.8},
        {"kind": "cylinder", "radius": 0.8, "axis": [0.3, 1.0, 0.2]},
        {"kind": "cone", "slope": 0.4, "axis": [0.4, 1.0, 0.3]},
        {"kind": "hyperboloid_one_sheet", "waist": 0.5, "c": 0.7, "axis": [0.2, 1.0, 0.5]},
        {"kind": "hyperboloid_two_sheets", "a": 0.5, "c": 0.6, "axis": [0.1, 1.0, 0.4]},
        {"kind": "paraboloid", "a": 0.7, "axis": [0.2, 1.0, -0.3]},
    ]
    rays = beyond = 0
    for solid in cases:
        scene = _scene(solid, [2.5, -6.0, 1.5], 50.0, 1.5)
        truth = Oracle(scene, SIZE).trace()
        ray, _ = _rays(scene)
        # Rays that start in the solid at the near base plane are another matter.
        outside = ray.c > 0
        literal = literal_quadric(ray, STEPS)
        false = outside & literal.found & (truth.solid < 0)
        far_away = false & (literal.near > 1.0)
        beyond += int(far_away.sum())
        rays += int(outside.sum())
        for method in ("visible", "article"):
            frame = halfstep.render(
                scene, size=SIZE, steps=STEPS, method=method, backend="numpy", outputs=OUTPUTS
            )
            assert not np.any(frame.solid[far_away] >= 0), f"{solid['kind']}, {method}"
    sys.stdout.write(f"{beyond} of {rays} rays hit beyond P\n")
    assert 0.002 < beyond / rays < 0.1, f"{beyond} of {rays}"


@pytest.mark.parametrize("steps", [8, 16, 24])
def test_literal_14_rejects_every_hit_of_an_axis_parallel_patch(steps: int) -> None:
    """A patch across an axis has no thickness there, and a rounded point is never exactly in it."""
    scene = _scene(
        {
            "kind": "plane",
            "origin": [0.0, 0.3, 0.0],
            "axis": [0.0, 1.0, 0.0],
            "bounds": {"min": [-1.0, 0.3, -1.0], "max": [1.5, 0.3, 1.2]},
        },
        [2.0, -5.0, 1.3],
        40.0,
        1.7,
    )
    patch = scene.solids[0]
    assert isinstance(patch, PlanePatch)
    truth = Oracle(scene, SIZE).trace()
    eye = view(scene.camera, SIZE)
    far = frame_setup(with_overrides(scene, size=SIZE)).far
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    v = far * eye.directions(i, j)
    t = np.ones(i.shape)
    for k in range(steps):
        # (13): F = 0.3 - y is positive at h.
        ahead = patch.origin[1] - (eye.eye[1] + v[..., 1] * t) > 0
        t = t + np.where(ahead, 1.0, -1.0) * 2.0 ** -(k + 1)
    point = eye.eye + t[..., None] * v
    low, high = np.array(patch.bounds.min), np.array(patch.bounds.max)
    accepted = np.all((low <= point) & (point <= high), axis=-1)  # (14)
    hits = truth.solid == 0
    assert hits.sum() > 2000
    assert not np.any(accepted & hits)

    for method in ("visible", "article"):
        frame = halfstep.render(
            scene, size=SIZE, steps=steps, method=method, backend="numpy", outputs=OUTPUTS
        )
        differ = (frame.solid == 0) != hits
        # The article tests (14) at a point that is up to half a cell off.
        assert np.mean(differ) <= (0.0 if method == "visible" else 2.0**-steps * SIZE[0])
