"""Shadows of cells of tori and polynomials: bits against the oracle, device and twin, doubts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host.pack import Packed
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.run.veils import UNFINISHED, Drawn, draw_all
from halfstep.scene import Scene, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from tests.different import different, on_both
from tests.shadow_sweeps import Count
from tests.veil_sweeps import count, random_cells

SMALL = (48, 36)
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}
OUTPUTS = ("shadow", "error")
# A place in the tube of the hoop.
IN_THE_HOOP = (0.487, 0.086, 1.273)


def judged(scenes: list[Scene], size: tuple[int, int] = SMALL) -> Count:
    """Counts of frames of the twin."""
    total = Count()
    for scene in scenes:
        count(scene, total, size, backend="numpy")
    sys.stdout.write(f"{total}\n")
    return total


def groove(*, lamp: Any = (-3, -4, 5)) -> Scene:
    """A block with a groove like a ring, a hoop over it, on a solid floor; a sun and a lamp."""
    hoop = {"name": "hoop", "kind": "torus", "major": 0.5, "minor": 0.12, "origin": [0, 0, 1.2]}
    floor = {"kind": "plane", "bounds": {"min": [-4, -4, -2], "max": [4, 4, 2]}}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [2, -8, 5], "look_at": [0, 0, 0], "fov_degrees": 35},
            "light": [
                {"direction": [1, -1, 2], "shadows": True},
                {"position": list(lamp), "shadows": True},
            ],
            "part": [
                {"name": "block", "kind": "box", "size": [3, 3, 1]},
                {"name": "ring", "kind": "torus", "major": 1, "minor": 0.3, "origin": [0, 0, 0.5]},
                {**hoop, "rotation_degrees": [70, 20, 0]},
            ],
            "cell": [{"region": "block - ring", **GRAY}, {"region": "hoop", **GRAY}],
            "solid": [{**floor, **GRAY, "origin": [0, 0, -0.5]}],
        }
    )


# ------------------------------------------------------------------------------ the oracle


def test_a_groove_has_the_shadows_of_the_oracle() -> None:
    total = judged([groove(), groove(lamp=(0.2, 0.3, 0.6)), groove(lamp=IN_THE_HOOP)])
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.open <= 0.02 * total.hits
    assert total.dark > 400
    assert total.hits - total.dark > 400


def test_a_bundled_scene() -> None:
    total = judged([with_overrides(halfstep.load("tokamak"), shadows=True)], (40, 30))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.dark > 60
    assert total.hits - total.dark > 60


@pytest.mark.parametrize("kind", ["far", "lamp", "amid"])
def test_random_cells(kind: str, rng: np.random.Generator) -> None:
    """Cells of quadrics, tori and polynomials, also in copies, and solids hide each other's."""
    total = judged([random_cells(rng, kind, bent=True) for _ in range(2)], (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.dark > 40
    assert total.hits - max(total.dark, total.open) > 40


def test_a_ring_in_a_group_does_not_hide_the_light_from_itself() -> None:
    """No acne at any scale: what is lit along the axis is its whole upper half."""
    for scale in (1e-6, 1.0, 1e6):
        ring = {"name": "r", "kind": "torus", "major": scale, "minor": 0.3 * scale}
        eye = [0.5 * scale, -2.5 * scale, 4 * scale]
        scene = Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": eye, "look_at": [0, 0, 0], "fov_degrees": 40},
                "light": [{"direction": [0, 0, 1], "shadows": True}],
                "part": [ring],
                "cell": [{"region": "r", **GRAY}],
            }
        )
        outputs = ("shadow", "normal", "error", "depth")
        frame = halfstep.render(scene, size=SMALL, backend="numpy", outputs=outputs)
        hit, up = np.isfinite(frame.depth), frame.normal[..., 2]
        assert not (frame.shadow > 0)[hit & (up > 1e-3)].any()
        assert (frame.shadow > 0)[hit & (up < -1e-3)].all()
        assert (hit & (up > 1e-3)).sum() > 300
        assert np.isfinite(frame.error[hit]).mean() > 0.95


# ------------------------------------------------------------------------------ what is not sure


def test_doubt_is_told() -> None:
    """Some rays to lights graze the groove or the hoop, and some points lie on its rim."""
    scene = with_overrides(groove(), steps=16)
    frames = [
        halfstep.render(scene, size=(96, 72), backend="numpy", shadows=shadows, outputs=OUTPUTS)
        for shadows in (True, False)
    ]
    doubted = np.isinf(frames[0].error) & np.isfinite(frames[1].error)
    assert 4 < doubted.sum() < 80


def test_a_side_that_light_grazes_is_uncertain() -> None:
    """If the light passes along a side, rounding tells whether it faces the light."""
    slab: dict[str, Any] = {"kind": "implicit", "formula": "z", "rotation_degrees": [30, 20, 50]}
    slab |= {"name": "slab", "bounds": {"min": [-1, -1, -0.5], "max": [1, 1, 0.5]}}
    shares = []
    for above in (0.0, 1e-3, -1e-3):
        table: dict[str, Any] = {
            "format": 1,
            "camera": {"center": [0, -3, 4], "look_at": [0, 0, 0], "fov_degrees": 40},
            "part": [slab],
            "cell": [{"region": "slab", **GRAY}],
        }
        toward = Scene.from_dict(table).parts[0].world_from_local() @ [0.8, 0.6, above]
        table["light"] = [{"direction": toward.tolist(), "shadows": True}]
        outputs = ("shadow", "surface", "error")
        scene = Scene.from_dict(table)
        frame = halfstep.render(scene, size=(24, 18), backend="numpy", outputs=outputs)
        upper = frame.surface == 0
        assert upper.sum() > 60
        shares.append(float(np.isinf(frame.error[upper]).mean()))
        if above:
            assert ((frame.shadow[upper] > 0) == (above < 0)).mean() > 0.95
    assert shares[0] == 1
    assert max(shares[1:]) < 0.05


# ------------------------------------------------------------------------------ device and twin


def differing(scene: Scene, **options: Any) -> list[str]:
    """Outputs of which the device and the twin differ in a bit."""
    frames = on_both(scene, size=(64, 48), outputs=OUTPUTS, **options)
    assert all((frames[1].shadow & bit).any() for bit in (1, 2))
    return different(*frames)


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    """The lamp is in the hoop, so its light comes from inside of a cell."""
    assert differing(groove(lamp=IN_THE_HOOP)) == []


def test_a_fault_in_the_kernel_is_seen(
    adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    old = "may_be != surely"
    texts = plant(old, "may_be == surely")
    assert differing(groove(lamp=IN_THE_HOOP), adapter=adapter.summary.index) == ["error"]
    assert any(old in text for text in texts)


def test_frames_in_parts_have_the_doubts_of_all_parts() -> None:
    """Each part tries some of the veils, and is not certain of some of these."""
    packed = prepare(with_overrides(groove(), size=SMALL))
    assert packed.veils is not None
    count = len(packed.veils.records)
    needs = needs_of_frame(packed, "visible", frozenset(OUTPUTS))

    def draw(part: Packed, _wanted: Needs, _clears: bool) -> Drawn:
        """A frame of one pixel for each veil, of which only single veils are tried to the end."""
        assert part.veils is not None
        view = part.veils.views
        tried = np.isin(np.arange(count), [k for a, b in view.tolist() for k in range(a, b)])
        doubt = np.where(tried, np.uint64(7), np.uint64(9))
        return {"doubt": doubt, UNFINISHED: np.array([tried.sum() > 1])}, None

    planes, _ = draw_all(packed, needs, draw, "")
    assert count > 2
    assert (planes["doubt"] == 7).all()


def test_cells_of_quadrics_hold_no_code_of_them() -> None:
    scene = with_overrides(halfstep.load("die"), shadows=True, size=SMALL)
    for outputs in ({"image", "tag"}, {"shadow", "error"}):
        text = compose(needs_of_frame(prepare(scene), "visible", frozenset(outputs)))
        assert "draw_veil(" in text
        for word in ("Course", "all_crossed", "unsure_0", "PERHAPS_MEETS"):
            assert word not in text
