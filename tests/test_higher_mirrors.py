"""Tori and polynomials that mirror and are mirrored: the oracle, device and twin."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.source import compose
from tests.different import differing
from tests.higher_shadows import random_lit
from tests.mirror_sweeps import HIGHER, caught, count, higher, reflected
from tests.mirrored import assert_slip_is_seen, below, counted, mirroring

SMALL = (64, 48)
CHROME = {"name": "chrome", "color": [0.8, 0.8, 0.85], "reflection": 0.75, "specular": 0.5}
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}
LIGHTS = [
    {"direction": [-1, -1.5, 2], "shadows": True, "color": [0.7, 0.7, 0.6]},
    {"position": [3, -4, 5], "shadows": True, "color": [0.3, 0.3, 0.4]},
]
# A genus that the ball cuts, and a sheet in a box.
CUBES = {"kind": "implicit", "formula": "x^4 + y^4 + z^4 - x^2 - y^2 - z^2 + 0.4"}
SADDLE = {"kind": "implicit", "formula": "x^3 - 2*x*y + z^2 - 0.2", "sheet": True}


def room(bounces: int = 2) -> Scene:
    """A ring and a polynomial in a ball that mirror, and a ring and a sheet on a floor."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [1, -8, 4], "look_at": [0, 0, 0.5]},
            "image": {"background": [0.1, 0.15, 0.3], "bounces": bounces},
            "light": LIGHTS,
            "material": [CHROME],
            "solid": [
                {"kind": "plane", "bounds": {"min": [-6, -6, -1], "max": [6, 6, 1]},
                 "material": "chrome"},
                {"kind": "torus", "major": 1, "minor": 0.35, "origin": [-1.2, 0, 1.2],
                 "rotation_degrees": [60, 20, 0], "cut": [[0, 1, 0.2, 0.8]], "material": "chrome"},
                {"kind": "torus", "major": 0.8, "minor": [0.3, 0.2], "origin": [-0.8, -1.5, 0.6],
                 "rotation_degrees": [90, 0, 20], **GRAY},
                {**CUBES, "bounds": {"radius": 1.0}, "origin": [1.4, -0.4, 1.2],
                 "rotation_degrees": [10, 0, 30], "material": "chrome"},
                {**SADDLE, "bounds": {"min": [-1, -1, -0.5], "max": [1, 1, 1]},
                 "origin": [0.6, 1.9, 1.1], **GRAY},
                {"kind": "sphere", "radius": 0.4, "origin": [0.5, -2.2, 0.4], **GRAY},
            ],
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "hits"), [("linked_rings", 150), ("clebsch_cubic", 100), ("dupin_cyclide", 30)]
)
def test_bundled_scenes(name: str, hits: int) -> None:
    total = counted(count, [mirroring(halfstep.load(name), 2)], SMALL)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.hits > hits


def test_a_room_of_all() -> None:
    total = counted(count, [mirroring(room(), 2)], (128, 96))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 3000


def test_random_scenes(rng: np.random.Generator) -> None:
    total = counted(count, [mirroring(random_lit(rng), 2) for _ in range(2)], SMALL)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2e-3 * total.hits + 2
    assert total.hits > 1000


@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_what_is_mirrored_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    shown = [reflected(rng, kind, distance) for kind in HIGHER for _ in range(2)]
    total = counted(count, [*shown, higher(rng, distance)], (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2e-3 * total.hits + 2
    assert total.hits > 500


def test_a_ring_does_not_mirror_itself_where_it_is_convex() -> None:
    """No speckle at any scale: what is reflected on the outer half leaves the ring."""
    for scale in (1e-6, 1.0, 1e6):
        ring = {"kind": "torus", "major": scale, "minor": 0.3 * scale, **GRAY}
        eye = [0.5 * scale, -2.5 * scale, 4 * scale]
        camera = {"center": eye, "look_at": [0, 0, 0], "fov_degrees": 40.0}
        scene = mirroring(Scene.from_dict({"format": 1, "camera": camera, "solid": [ring]}))
        (first, *_), (solid, _, unsure) = caught(with_overrides(scene, size=(160, 120)))
        frame = halfstep.render(scene, size=(160, 120), backend="numpy", outputs=("position",))
        place = frame.position / scale
        outer = (first >= 0) & (np.hypot(place[..., 0], place[..., 1]) > 1.01)
        assert (solid[outer] == -1).all()
        assert not unsure[outer].any()
        assert outer.sum() > 2000


def beside_a_wire() -> Scene:
    """A floor that mirrors a ring so thin that float32 does not know whether rays pass it."""
    wire = {"kind": "torus", "major": 1.0, "minor": 1e-4, "origin": [0, 0, 2], **GRAY}
    return below(wire, CHROME)


def test_doubt_is_told() -> None:
    """Where it is not certain what a mirror shows, `error` is infinite."""
    outputs = ("image", "error")
    scene = with_overrides(beside_a_wire(), size=(96, 72))
    frame = halfstep.render(scene, backend="numpy", outputs=outputs)
    alone = halfstep.render(scene, backend="numpy", outputs=("error",))
    doubted = np.isinf(frame.error) & np.isfinite(alone.error)
    _, (_, _, unsure) = caught(scene)
    np.testing.assert_array_equal(doubted, unsure & np.isfinite(alone.error))
    assert (frame.solid[doubted] == 0).all()
    assert 4 < doubted.sum() < 900
    assert counted(count, [scene], SMALL).wrong == 0


# ------------------------------------------------------------------------------ device and twin


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin(rng: np.random.Generator) -> None:
    assert differing(room(), ("color", "shadow", "error")) == []
    assert differing(mirroring(random_lit(rng), 2), ("color", "shadow", "error")) == []
    assert differing(with_overrides(room(), shadows=False), ("image",)) == []
    assert differing(beside_a_wire(), ("color", "error")) == []


@pytest.mark.usefixtures("adapter")
def test_what_only_a_mirror_shows() -> None:
    """A ring behind the camera."""
    wall = {"kind": "plane", "axis": [0, 1, 0], "bounds": {"min": [-4, -1, -4], "max": [4, 1, 4]}}
    ring = {
        "kind": "torus",
        "major": 1.0,
        "minor": 0.3,
        "origin": [0, -9, 1],
        "rotation_degrees": [80, 0, 0],
        **GRAY,
    }
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -6, 1], "look_at": [0, 0, 1]},
            "material": [CHROME],
            "solid": [{**wall, "material": "chrome"}, ring],
        }
    )
    _, (solid, _, _) = caught(with_overrides(scene, size=SMALL))
    assert (solid == 1).sum() > 50
    assert differing(scene, ("color", "error")) == []


@pytest.mark.usefixtures("adapter")
def test_tiles_that_see_no_mirror() -> None:
    """From the second frame on they have shaders of their own."""
    tables = room(1).model_dump(by_alias=True, exclude_none=True)
    tables["material"] = [*tables["material"], {"name": "dull", **GRAY}]
    floor, *others = tables["solid"]
    tables["solid"] = [{**floor, "material": "dull"}, *others]
    scene = with_overrides(Scene.from_dict(tables), size=(128, 96))
    expected = halfstep.render(scene, backend="numpy", outputs=("color",))
    with halfstep.Renderer(scene, backend="gpu", outputs=("color",)) as renderer:
        for _ in range(3):
            np.testing.assert_array_equal(renderer.render().color, expected.color)


# A scene, a word of the kernel, and what a slip would make of it.
FAULTS = [
    (beside_a_wire, "place = select(place, meeting_0.u, has_caster);", ""),
    (room, "root.surface = select(root.surface, meeting_0.face, has_caster);", ""),
    (room, "select(inside, meeting_0.inside, has_caster)", "inside"),
    (beside_a_wire, "slope_0 = either(on_f, bend_at(caster, at_0), slope_0);", ""),
    (beside_a_wire, "at_0 = further(glance_0.base, glance_0.along, spotted_0.place);", ""),
    (beside_a_wire, "spotted_0.surface == u4(body.curve)", "spotted_0.surface == u4(body.surface)"),
    (beside_a_wire, "select(doubt, f4(NO_DOUBT), sure)", "doubt"),
    (beside_a_wire, "vague_0 | (spotted_0.doubt <= spotted_0.distance)", "vague_0"),
    (beside_a_wire, "nearest_0.doubt = either_key(vague_0, FIRST, old);", ""),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    scene: Callable[[], Scene],
    old: str,
    new: str,
    adapter: Adapter,
    plant: Callable[[str, str], list[str]],
) -> None:
    assert_slip_is_seen(scene(), old, new, adapter, plant)


def test_mirrors_of_other_solids_hold_no_code_of_polynomials() -> None:
    scene = mirroring(with_overrides(halfstep.load("figure"), size=SMALL))
    text = compose(needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"})))
    assert "spot_first(" in text
    for word in ("Caster", "Meeting", "vague_0", "place: f4", "doubt: f4"):
        assert word not in text
