"""A device may keep subnormal numbers or flush them to zero: a frame has the same bits.

What a device that flushes them computes is what the twin computes on a processor that does.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS
from halfstep.host import halfspaces, pack
from halfstep.scene import Scene, bundled_scenes
from halfstep.twin import normal, shade
from halfstep.twin.lanes import F32
from tests.bundled import drawn_by_all, drawn_by_the_article
from tests.extremes import extremes
from tests.flushing import flushing
from tests.scenes_random import PLACES, random_scene
from tests.test_conformance import METHODS, differences

Table = dict[str, Any]

SIZE = (31, 23)  # with rays through the middle
# Of many solids and copies some are enough: the twin tries one by one.
CLOSE = {"assembly_17x17": {"fov_degrees": 2.0}, "crowd": {"fov_degrees": 4.0}}
# Of cells and crowds, a quarter of the rays are.
FEW = {"assembly_17x17", "bracket", "crowd", "nested_differences", "nut_and_bolt", "tokamak"}
FORMATS = ("float32", "fixed32")
SCENES = 40
LEAST = 1e-45  # of numbers drawn


def render(scene: Scene, **options: Any) -> Frame:
    options = {"size": SIZE, "backend": "numpy", "outputs": OUTPUTS} | options
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*the tolerance needs more than")
        return halfstep.render(scene, **options)


def flushed(scene: Scene, kept: Frame | None = None, **options: Any) -> dict[str, int]:
    """Arrays of a frame, ``kept``, that flushing changes, and how many values of each."""
    kept = kept or render(scene, **options)
    with flushing():
        frame = render(scene, **options)
    return differences(frame, kept)


def test_the_processor_flushes() -> None:
    tiny, subnormal = (np.full(64, value, np.float32) for value in (1e-20, 1e-40))
    with flushing():
        assert not (tiny * tiny).any()
        assert not (subnormal * np.float32(1e10)).any()
    assert (tiny * tiny).all()
    assert (subnormal * np.float32(1e10)).all()


@pytest.mark.parametrize("scene", bundled_scenes())
@pytest.mark.slow
def test_a_bundled_scene(scene: str) -> None:
    loaded = halfstep.load(scene)
    for number_format in FORMATS if scene in drawn_by_all() else FORMATS[:1]:
        options: Table = {"number_format": number_format, "camera": CLOSE.get(scene)}
        if scene in FEW:
            options["size"] = (21, 15)
        assert flushed(loaded, **options) == {}


# In fixed32 floats only shade, and both methods shade alike.
@pytest.mark.parametrize("scene", drawn_by_the_article())
@pytest.mark.slow
def test_a_bundled_scene_by_the_article(scene: str) -> None:
    assert flushed(halfstep.load(scene), method="article", camera=CLOSE.get(scene)) == {}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.slow
def test_the_ends_of_every_range(method: str) -> None:
    for name, _, views in extremes():
        for number in {*range(0, len(views), 3), len(views) - 1}:
            view = views[number]
            found = flushed(view.scene, method=method, steps=view.steps)
            assert found == {}, f"{name}, view {number}"


def drawn(rng: np.random.Generator, count: int) -> list[float]:
    """Numbers from 0 to 1, most of them faint."""
    values = 10.0 ** rng.uniform(np.log10(LEAST), 0, count)
    return np.where(rng.random(count) < 0.2, 0.0, values).tolist()


def drawn_vector(rng: np.random.Generator) -> list[float]:
    """A vector of about unit length whose components are faint but for one, or two."""
    vector = np.array(drawn(rng, 3)) * rng.choice([-1, 1], 3)
    vector[rng.integers(3)] = 1.0
    return vector.tolist()


def lit_scenes(rng: np.random.Generator) -> Iterator[Scene]:
    """Ordinary solids in faint colours and lights, or with faint components of vectors."""
    for number in range(SCENES):
        scene, _, size = random_scene(rng, PLACES[number % len(PLACES)], most=4)
        tables: Table = scene.model_dump(exclude_none=True, by_alias=True)
        eye = np.array(tables["camera"]["center"])
        bright = number % 2

        def color(bright: int = bright) -> list[float]:
            return rng.uniform(0, 1, 3).tolist() if bright else drawn(rng, 3)

        tables["ambient"] = {"color": color()}
        tables["image"] |= {"background": color()}
        tables["material"] = [
            {
                "name": f"m{k}",
                "color": color(),
                "specular": color()[0],
                "shininess": int(rng.integers(1, 1025)),
            }
            for k in range(3)
        ]
        tables["light"] = [
            {"color": color()}
            | ({"direction": vector} if rng.random() < 0.5 else {"position": eye + size * vector})
            for vector in (np.array(drawn_vector(rng)) for _ in range(rng.integers(1, 4)))
        ]
        for solid in tables["solid"]:
            solid.pop("color")
            solid["material"] = f"m{rng.integers(3)}"
            if bright:
                solid.pop("rotation_degrees", None)
                solid["axis"] = drawn_vector(rng)
        yield Scene.from_dict(tables)


def shaped_scenes(rng: np.random.Generator) -> Iterator[Scene]:
    """Quadrics, half-spaces and planes with faint coefficients."""
    for number in range(SCENES):
        coefficients = np.array(drawn(rng, 10)) * rng.choice([-1, 1], 10)
        if number % 2:
            coefficients[:3], coefficients[9] = 1.0, -1.0
        white = {"color": [1.0, 1.0, 1.0]}
        quadric = {"kind": "quadric", "coefficients": coefficients.tolist()}
        bounds = {"min": [-1.0] * 3, "max": [1.0] * 3}
        yield Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [0.0, -4.0, 0.0], "look_at": [0.0, 0.0, 0.0]},
                "volume": {"min": [-2.0] * 3, "max": [2.0] * 3},
                "solid": [
                    quadric | white | {"cut": [[*drawn_vector(rng), 0.5]]},
                    {"kind": "plane", "axis": drawn_vector(rng), "bounds": bounds} | white,
                ],
            }
        )


def formed_scenes(rng: np.random.Generator) -> Iterator[Scene]:
    """Polynomials and other formulas with faint numbers, and halvings to the end."""
    for number in range(SCENES // 2):
        least = 1e-30 if number % 2 else LEAST  # smaller ones are refused
        a, b, c, d = np.maximum(drawn(rng, 4), least) * rng.choice([-1, 1], 4)
        far = f"{a:.3e}*x*y*z + {b:.3e}*x^2 + {c:.3e}*z^3 + {d:.3e}*y"
        formula = f"(x^2 + y^2 + z^2)^{rng.integers(1, 6)} - 1 + {far}"
        if number % 2:
            formula = (
                f"exp(x^2 + y^2 + z^2) - 2 + sin({a:.3e}*x) + sqrt(abs({b:.3e}*z)) + {c:.3e}*y"
            )
        white = {"color": [1.0, 1.0, 1.0]}
        solid = {"kind": "implicit", "formula": formula, "bounds": {"radius": 2.0}} | white
        yield Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [0.0, -4.0, 0.0], "look_at": [0.0, 0.0, 0.0]},
                "accuracy": {"steps": int(rng.choice([12, 17, 22]))},
                "solid": [solid],
            }
        )


@pytest.mark.parametrize("scenes", [lit_scenes, shaped_scenes, formed_scenes])
@pytest.mark.slow
def test_faint_numbers_in_a_scene(scenes: Any, rng: np.random.Generator) -> None:
    hits = count = 0
    for number, scene in enumerate(scenes(rng)):
        count += 1
        for method in METHODS[:1] if scenes is formed_scenes else METHODS:
            kept = render(scene, method=method)
            assert flushed(scene, kept, method=method) == {}, f"scene {number}"
        hits += int((kept.solid >= 0).sum())
    assert count >= SCENES // 2
    assert hits > count * SIZE[0] * SIZE[1] / 10


@pytest.mark.parametrize("scenes", [lit_scenes, shaped_scenes, formed_scenes])
@pytest.mark.usefixtures("adapter")
def test_faint_numbers_on_a_device(scenes: Any, rng: np.random.Generator) -> None:
    for number, scene in enumerate(islice(scenes(rng), 3)):
        found, expected = render(scene, backend="gpu", steps=12), render(scene, steps=12)
        assert differences(found, expected) == {}, f"scene {number}"


def unit_vectors(rng: np.random.Generator) -> normal.Vector:
    """Of vectors of all lengths from 1e-30 to 1."""
    components: F32 = (10.0 ** rng.uniform(-30, 0, (6, 10_000))).astype(np.float32)
    a, other = normal.Vector(*components[:3]), normal.Vector(*components[3:])
    nothing = np.zeros(10_000, np.float32)
    return normal.normalized(normal.or_else(a, other._replace(x=nothing + np.float32(1))))


def flushed_vectors() -> int:
    kept = unit_vectors(np.random.default_rng(1998))
    with flushing():
        vectors = unit_vectors(np.random.default_rng(1998))
    return int((np.array(vectors) != np.array(kept)).sum())


def test_unit_vectors() -> None:
    assert flushed_vectors() == 0


@pytest.mark.parametrize(
    ("module", "bound", "scenes", "arrays"),
    [
        (shade, "FAINT", lit_scenes, {"color"}),
        (pack, "FAINT", lit_scenes, {"color", "normal"}),
        (halfspaces, "NEGLIGIBLE", shaped_scenes, {"solid", "t"}),
    ],
)
@pytest.mark.slow
def test_without_a_bound_frames_differ(
    module: Any, bound: str, scenes: Any, arrays: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, bound, getattr(module, bound) * 0)
    found: set[str] = set()
    with np.errstate(all="ignore"):
        for scene in scenes(np.random.default_rng(1998)):
            found |= flushed(scene).keys()
    assert found >= arrays


def test_without_a_bound_unit_vectors_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(normal, "VANISHING", np.float32(0))
    with np.errstate(all="ignore"):
        assert flushed_vectors() > 100
