"""Preselection hides nothing, and little that could be left out passes it."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import halfstep
from halfstep.host.bounds import Bounds, bounds
from halfstep.host.camera import View
from halfstep.host.geometry import Geometry
from halfstep.host.prepare import Solids, frame_setup
from halfstep.host.setup import Setup
from halfstep.scene import QuadricSolid, Scene, with_overrides
from tests.judge import OUTPUTS, Judge, Verdict
from tests.oracle import Oracle
from tests.scenes_random import KINDS, PLACES, random_scene

SIZE = (96, 72)
DELTA = 1e-2
# What an uncut solid is: closed forms of their own, no oblique cut.
CLOSED_FORMS = tuple(kind for kind in KINDS if kind not in ("quadric", "plane"))


def _constants(scene: Scene, size: tuple[int, int] = SIZE) -> tuple[Geometry, View, Setup]:
    solids = Solids.of(scene)
    constants = frame_setup(with_overrides(scene, size=size), solids=solids)
    return solids.geometry, constants.view, constants


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.slow
def test_every_hit_is_within_its_rectangle_and_its_interval(
    place: str, rng: np.random.Generator
) -> None:
    hits = 0
    for number in range(25):
        scene = random_scene(rng, place, most=4).scene
        judge = Judge(scene, SIZE)
        geometry, eye, constants = _constants(scene)
        box = bounds(geometry, eye)
        for index in range(len(scene.solids)):
            trace = judge.oracle.trace_solid(index)
            hit = (trace.surface >= 0) & judge.oracle.stable_ids(DELTA, solid=index)
            if not hit.any():
                continue
            hits += int(hit.sum())
            assert index in constants.solid, f"scene {number}: solid {index} was left out"
            row = int(np.flatnonzero(constants.solid == index)[0])
            i0, i1, j0, j1 = constants.rectangle[row]
            j, i = np.nonzero(hit)
            assert i0 <= i.min(), f"scene {number}, solid {index}"
            assert i.max() <= i1, f"scene {number}, solid {index}"
            assert j0 <= j.min(), f"scene {number}, solid {index}"
            assert j.max() <= j1, f"scene {number}, solid {index}"
            start = constants.start[row] * constants.far
            length = constants.far * 2.0 ** -constants.level[row]
            room = 2.0**-30 * length
            # A ray that has not left by the far base plane leaves beyond the solid's bounds or not.
            leaves = trace.depth_exit[hit & (trace.depth_exit < constants.far)]
            for depth in (trace.depth[hit], leaves):
                if depth.size:
                    assert start - room <= depth.min(), f"scene {number}, solid {index}"
                    assert depth.max() <= start + length + room, f"scene {number}, solid {index}"
                    assert box.depth[0, index] - room <= depth.min()
                    assert depth.max() <= box.depth[1, index] + room
    assert hits > 20_000, f"{hits} hits"


def _everything(geometry: Geometry, _view: View) -> Bounds:
    """Bounds that leave nothing out."""
    depth = np.repeat([[-np.inf], [np.inf]], geometry.count, axis=1)
    return Bounds(depth, np.repeat(depth[None], 2, axis=0))


@pytest.mark.parametrize("method", ["visible", "article"])
def test_frames_without_preselection_are_the_same(
    method: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same solids and surfaces but for ties, though every constant is a different one."""
    ties = hits = 0
    for number in range(24):
        scene = random_scene(rng, "outside", most=6, ratio=(2.0, 30.0)).scene

        def frame(scene: Scene = scene) -> halfstep.Frame:
            return halfstep.render(
                scene, size=SIZE, steps=20, method=method, backend="numpy", outputs=OUTPUTS
            )

        selected = frame()
        with monkeypatch.context() as context:
            context.setattr("halfstep.host.setup.bounds", _everything)
            everything = frame()
        differ = (selected.solid != everything.solid) | (selected.surface != everything.surface)
        hits += int((selected.solid >= 0).sum())
        if differ.any():
            j, i = np.nonzero(differ)
            stable = Judge(scene, SIZE).oracle.stable_ids(DELTA, (i, j))
            assert not stable.any(), f"scene {number}: {np.column_stack([i, j])[stable]}"
            ties += i.size
    sys.stdout.write(f"{hits} hits, {ties} ties\n")
    assert hits > 20_000
    assert ties < 1e-3 * hits


@pytest.mark.slow
def test_uncut_solids_have_tight_bounds(rng: np.random.Generator) -> None:
    """Medians: depth extent 1.00, rectangle 1.00 of what hits fill."""
    areas, extents = [], []
    size = (192, 144)
    for kind in CLOSED_FORMS:
        found = 0
        while found < 6:
            drawn = random_scene(rng, "outside", most=1, kinds=(kind,), ratio=(3.0, 1e4))
            scene = drawn.scene
            solid = scene.solids[0]
            if scene.volume is not None or (isinstance(solid, QuadricSolid) and solid.cut):
                continue
            geometry, eye, constants = _constants(scene, size)
            trace = Oracle(scene, size).trace()
            j, i = np.nonzero(trace.solid >= 0)
            if (
                i.size < 500
                or min(i.min(), j.min()) == 0
                or i.max() == size[0] - 1
                or j.max() == size[1] - 1
            ):
                continue
            found += 1
            i0, i1, j0, j1 = constants.rectangle[0]
            filled = (np.ptp(i) + 1) * (np.ptp(j) + 1)
            areas.append((i1 - i0 + 1) * (j1 - j0 + 1) / filled)
            extent = np.nanmax(trace.depth_exit) - np.nanmin(trace.depth)
            extents.append(np.ptp(bounds(geometry, eye).depth[:, 0]) / extent)
    sys.stdout.write(f"areas {np.quantile(areas, [0.5, 0.95])}, extents {np.median(extents)}\n")
    assert np.median(areas) <= 1.02
    assert np.quantile(areas, 0.95) <= 1.1
    assert 0.999 <= np.median(extents) <= 1.03


def test_a_formula_in_a_ball_has_the_bounds_of_the_ball(rng: np.random.Generator) -> None:
    """A cut one has those of what is left of the box around it."""
    formula = {"kind": "implicit", "formula": "sin(3*x) + cos(4*y) - z", "bounds": {"radius": 0.7}}
    polynomial = formula | {"formula": "x^3 + y^3 - z^3 - 0.1"}
    ball, cut = {"kind": "sphere", "radius": 0.7}, {"cut": [(0, 0, 1, 0.1)]}
    for _ in range(20):
        place = {"axis": rng.normal(size=3).tolist(), "origin": rng.normal(size=3).tolist()}
        place["color"] = (1, 0, 0)
        camera = {"center": (0, -9, rng.normal()), "look_at": (0, 0, 0)}
        solids = [one | place for one in (ball, formula, polynomial, formula | cut)]
        scene = Scene.from_dict({"format": 1, "camera": camera, "solid": solids})
        geometry, eye, constants = _constants(scene)
        box = bounds(geometry, eye)
        for index in (1, 2):
            np.testing.assert_allclose(box.depth[:, index], box.depth[:, 0], rtol=1e-13)
            np.testing.assert_allclose(box.tangent[..., index], box.tangent[..., 0], atol=1e-13)
        assert len(set(constants.level[:3].tolist())) == 1
        assert geometry.hulls.point_ix.tolist() == [3]
        assert geometry.is_ellipsoid.tolist() == [True, False, False, False]


def test_a_needle_seen_in_its_middle_is_drawn_right() -> None:
    """An ellipsoid 1.2 long and 6e-5 thick, of which the volume and the picture leave 2e-4."""
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.0, -0.2, 0.0], "look_at": [0.0, 0.0, 0.0], "fov_degrees": 0.05},
            "solid": [
                {"kind": "ellipsoid", "semi_axes": [3e-5, 3e-5, 0.6], "color": [1.0, 1.0, 1.0]}
            ],
            "volume": {"min": [-1e-4, -1e-4, -1e-4], "max": [1e-4, 1e-4, 1e-4]},
        }
    )
    frame = halfstep.render(scene, size=SIZE, steps=16, backend="numpy", outputs=OUTPUTS)
    verdict = Verdict()
    Judge(scene, SIZE).visible(frame, 16, verdict, "needle")
    assert verdict.hits > 1000
    assert verdict.wrong == 0, str(verdict)
