"""`Frame.error` holds: no pixel is further off, and nothing that is certain of a hit is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Floats
from halfstep.device.adapters import Adapter
from halfstep.host import camera as cameras
from halfstep.host import forms as quadrics
from halfstep.host import geometry
from halfstep.host import steps as steps_of_solids
from halfstep.run.gpu import Device
from halfstep.scene import Camera, Scene
from halfstep.twin import certify, forms, forms_fixed, keep, lanes
from tests import soundness
from tests.scenes_random import KINDS
from tests.soundness import (
    EXACT_STEPS,
    FAMILIES,
    FLOAT_STEPS,
    Case,
    Report,
    Shot,
    Tally,
    Way,
    judge,
    survey,
)


@pytest.mark.slow
def test_no_pixel_is_further_off_than_its_error(seed: int) -> None:
    report = survey(600_000, seed, None)
    everything, visible = report.total(), report.total("visible")
    assert everything.faults == []
    assert everything.hits > 0.2 * everything.judged > 240_000
    assert visible.certain_hits > 180_000
    assert everything.certain_misses > 180_000


@pytest.mark.parametrize("family", ["ordinary", "near", "near_cut"])
@pytest.mark.slow
def test_ordinary_pixels_are_certain_and_their_bound_is_tight(family: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    report = Report()
    for kind in KINDS * 4:
        report.add(
            Case(family, kind, FAMILIES[family](rng, kind)),
            [Way(12), Way(12, number_format="fixed32")],
            None,
        )
    tally = report.total()
    assert tally.faults == []
    assert tally.hits > 10_000
    assert tally.certified_hits >= 0.98
    assert tally.certified_misses >= 0.98
    if family == "ordinary":
        assert 1 <= report.median(12) <= 4


# ------------------------------------------------------------------------------ found once


def _scene(solid: dict[str, Any], camera: dict[str, Any], **tables: Any) -> Scene:
    solids = [{"color": [1.0, 1.0, 1.0], **solid}]
    return Scene.from_dict({"format": 1, "camera": camera, "solid": solids, **tables})


def _shifted_ball(shift: float) -> Scene:
    """A unit ball about the world's origin, written about a point ``shift`` away from it."""
    center = shift * np.array([0.48, -0.6, 0.64])
    one = float(center @ center) - 1
    solid = {
        "kind": "quadric",
        "coefficients": [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, *(-2 * center).tolist(), one],
        "origin": (-center).tolist(),
    }
    camera = {"center": [0.7, -4.0, 0.3], "look_at": [0.0, 0.0, 0.0], "fov_degrees": 35.0}
    return _scene(solid, camera)


def _up_along_the_view() -> Scene:
    """A ball smaller than a pixel in the corner of a picture whose `up` is 1e-7 from the view."""
    forward = np.array([0.48, -0.6, 0.64])
    up = forward + 1e-7 * np.array([0.6, 0.8, 0.1])
    camera = {
        "center": [0.0, 0.0, 0.0],
        "look_at": forward.tolist(),
        "up": up.tolist(),
        "fov_degrees": 70.0,
    }
    ball = {"kind": "sphere", "radius": 1.0, "origin": [0.0, 0.0, 0.0]}
    eye = cameras.view(_scene(ball, camera).camera, soundness.SIZE)
    ray = eye.directions(np.array(0), np.array(0))
    return _scene(ball | {"origin": (1e6 * ray + 0.5 * eye.camera_from_world[0]).tolist()}, camera)


def _judged(scene: Scene, size: tuple[int, int] = soundness.SIZE) -> Tally:
    shot, tally = Shot(scene, size), Tally()
    truth = shot.oracle().trace()
    for way in (Way(12), Way(24), Way(12, "article"), Way(24, number_format="fixed32")):
        judge(shot.render(way), truth, tally, str(way))
    assert tally.hits > 0
    return tally


def _rounded_right(camera: Camera) -> Floats:
    """What `camera._right` was: a cross product in floating point."""
    forward = np.subtract(camera.look_at, camera.center)
    right = np.cross(forward / np.linalg.norm(forward), camera.up)
    return np.asarray(right / np.linalg.norm(right))


@pytest.mark.parametrize("planted", [False, True])
def test_terms_of_a_quadric_that_cancel_are_counted(
    planted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if planted:
        monkeypatch.setattr(quadrics, "HOST_ROUNDINGS", 0.0)
    tally = _judged(_shifted_ball(1e6))
    assert bool(tally.faults) == planted
    assert tally.certified_hits > 0.9


@pytest.mark.parametrize("planted", [False, True])
def test_an_ellipsoid_far_from_its_origin_is_not_cut_off(
    planted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    square = 400.0815176623256
    linear = [11057917.121317916, 286530204.39935625, 1029624638.5367552]
    ball = {
        "kind": "quadric",
        "coefficients": [square, square, square, 0.0, 0.0, 0.0, *linear, 713822484553197.5],
        "origin": [13819.580051996993, 358089.77889499976, 1286768.5622580706],
    }
    camera = {
        "center": [-0.05865462210013645, 0.15073951447102665, 0.11759712572184998],
        "look_at": [-0.0009407335619682935, -0.0015663776792099, 0.002108898707345645],
        "up": [-0.7994807464168743, 0.41184961758969746, 0.33717980480666343],
        "fov_degrees": 37.07746001072956,
    }
    if planted:
        monkeypatch.setattr(geometry, "LEVEL_ROUNDING", 0.0)
    assert bool(_judged(_scene(ball, camera), (96, 72)).faults) == planted


@pytest.mark.parametrize("planted", [False, True])
def test_the_view_is_exact_however_up_points(
    planted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = _up_along_the_view()
    if planted:
        monkeypatch.setattr(cameras, "_right", _rounded_right)
    assert bool(_judged(scene).faults) == planted


# ------------------------------------------------------------------------------ planted faults


END_SIGNS = certify.end_signs


def _zero(at: Any) -> Any:
    return np.zeros(np.broadcast_shapes(at.x.shape, at.y.shape), np.float32)


def _no_line_errors(_c: Any, _b: Any, at: Any, _host_error: Any) -> Any:
    return certify.LineErrors(*[_zero(at)] * 2)


def _no_form_errors(_a: Any, _g: Any, _c: Any, at: Any, _host_error: Any) -> Any:
    return lanes.FormErrors(*[_zero(at)] * 3)


def _no_rounding(form: Any, _run: Any, last_step: np.float32) -> Any:
    return np.full(form.discriminant.shape, last_step)


def _sure_signs(form: Any, c: Any, b: Any, error: Any) -> Any:
    signs = END_SIGNS(form, c, b, error)
    sure = np.ones(signs.outside.shape, bool)
    return signs._replace(sure_value=sure, sure_slope=sure)


def _sure_order(ends: Any) -> Any:
    return np.ones(ends.error_in.shape, bool)


def _any_surface(certificate: Any, hit: Any, _surface: Any) -> Any:
    return certificate.sure & (certificate.hit == hit)


# Module, function, what a forgotten term makes of it; scenes, how and with which steps they are
# rendered to show it.
VISIBLE, ARTICLE, FIXED = Way(0), Way(0, "article"), Way(0, number_format="fixed32")
FAULTS = [
    (forms, "line_errors", _no_line_errors, "near_cut", VISIBLE, (20, 24, 30)),
    (forms, "form_errors", _no_form_errors, "near", VISIBLE, (20, 24, 30)),
    (certify, "curve_bound", _no_rounding, "ordinary", VISIBLE, EXACT_STEPS),
    (certify, "end_signs", _sure_signs, "magnified", VISIBLE, FLOAT_STEPS),
    (certify, "surely_ordered", _sure_order, "magnified", VISIBLE, FLOAT_STEPS),
    (keep, "confirms", _any_surface, "ordinary", ARTICLE, (1, 2, 3, 4)),
    (forms_fixed, "line_errors", _no_line_errors, "near_cut", FIXED, (30,)),
    (forms_fixed, "form_errors", _no_form_errors, "shifted", FIXED, (16, 30)),
    (certify, "curve_bound", _no_rounding, "ordinary", FIXED, (30,)),
    (certify, "end_signs", _sure_signs, "magnified", FIXED, FLOAT_STEPS),
]


@pytest.mark.parametrize(("module", "name", "fault", "family", "way", "steps"), FAULTS)
@pytest.mark.slow
def test_a_forgotten_term_is_a_violation(
    module: Any,
    name: str,
    fault: Any,
    family: str,
    way: Way,
    steps: tuple[int, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # In float32 at any number of steps, where the forms' rounding is the larger part of an error.
    monkeypatch.setattr(steps_of_solids, "FLOAT_STEPS", 30)
    faults = []
    for planted in (False, True):
        if planted:
            monkeypatch.setattr(module, name, fault)
        rng, report = np.random.default_rng(1998), Report()
        for kind in KINDS + KINDS[:5]:
            frames = [way._replace(steps=int(rng.choice(steps)))]
            report.add(Case(family, kind, FAMILIES[family](rng, kind)), frames, None)
        assert report.total().hits > 1000
        faults.append(bool(report.total().faults))
    assert faults == [False, True]


# ------------------------------------------------------------------------------ the shader


@pytest.mark.parametrize("number_format", soundness.FORMATS)
@pytest.mark.parametrize("method", ["visible", "article"])
@pytest.mark.parametrize("steps", [12, 24])
def test_the_shader_computes_the_same_bound(
    number_format: str, method: str, steps: int, adapter: Adapter, rng: np.random.Generator
) -> None:
    way = Way(steps, method, number_format)
    device = Device(adapter)
    finite = 0
    for count, kind in enumerate(KINDS * 2):
        family = ("near_cut", "magnified", "ordinary", "far")[count % 4]
        shot = Shot(FAMILIES[family](rng, kind), (70, 40))
        ours, expected = shot.render(way, device), shot.render(way)
        for name, values in expected.items():
            assert ours[name].tobytes() == values.tobytes(), (count, kind, family, name)
        finite += int((np.isfinite(expected["error"]) & (expected["solid"] >= 0)).sum())
    device.close()
    assert finite > 10_000
