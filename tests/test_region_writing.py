"""Scenes written as TOML: what is read from the text is equal to what was written."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.scene import Scene, bundled_scenes, load
from tests.scenes_random import PLACES, random_scene
from tests.test_region_lattices import random_group
from tests.test_region_scene import scene as region_scene

Table = dict[str, Any]


def again(whole: Scene, folder: Path) -> Scene:
    """A scene as its file says it."""
    path = folder / f"{whole.name}.toml"
    path.write_text(whole.to_toml(), encoding="utf-8")
    return load(path)


@pytest.mark.parametrize("name", bundled_scenes())
def test_a_bundled_scene(name: str, tmp_path: Path) -> None:
    whole = load(name)
    read = again(whole, tmp_path)
    assert read == whole
    assert read.sha256 == whole.sha256


def test_random_scenes(rng: np.random.Generator, tmp_path: Path) -> None:
    """Solids of all kinds and numbers of all sizes, in full precision."""
    kinds = set()
    for place in PLACES * 8:
        whole = random_scene(rng, place).scene
        kinds |= {solid.kind for solid in whole.solids}
        assert again(whole, tmp_path) == whole
    assert len(kinds) == 11


def test_random_groups(rng: np.random.Generator, tmp_path: Path) -> None:
    groups = 0
    for _ in range(30):
        root = random_group("r", 3, rng)
        inside = [{"name": name, "cell": [{"color": [1, 1, 1]}]} for name in ("pin", "guide")]
        tables = {key: each for key, each in root.items() if key not in ("name", "group")}
        whole = Scene.from_dict(
            region_scene(**tables, group=[*inside, *root["group"]], solid=[])
            | {"place": [*root["place"], {"group": "pin"}]}
        )
        text = whole.to_toml()
        groups += text.count("group]]")
        read = again(whole, tmp_path)
        assert read == whole
        assert read.to_toml() == text
    assert groups > 100


EVERYTHING: Table = {
    "title": 'a "title" \\ with\ttabs,\nlines, \x7f, \x00 and größe 🙂',
    "animation": {
        "frames": 7,
        "fps": 12.5,
        "key": [{"at": 0, "center": [0, -9, 3]}, {"at": 1, "fov_degrees": 30}],
    },
    "image": {"width": 320, "background": [0.5, 0, 1e-300]},
    "accuracy": {"steps": 9, "method": "article"},
    "volume": {"min": [-1e15, -5, -5], "max": [5, 5, 1e15]},
    "ambient": {"color": [0, 0, 0]},
    "light": [{"direction": [1, -1e-9, 2]}, {"position": [-0.0, 0.1, 1 / 3]}],
    "material": [{"name": "a b.c", "color": [1, 1, 1], "shininess": 7}],
    "solid": [
        {"kind": "plane", "material": "a b.c", "bounds": {"min": [-1, -1, 0], "max": [1, 1, 0]}},
        {"kind": "box", "size": [1, 2, 3], "color": [0, 0, 0],
         "key": [{"at": 0.25, "origin": [0, 0, 1]}, {"at": 1, "rotation_degrees": [0, 0, 90]}]},
        {"kind": "sphere", "radius": 1, "color": [0, 0, 0], "cut": [[1, 0, 0, 0.5]], "z_min": 0},
    ],
}  # fmt: skip


@pytest.mark.parametrize("accuracy", [{"steps": 9}, {"tolerance": 1e-5}, {"tolerance_pixels": 2}])
def test_every_table(accuracy: Table, tmp_path: Path) -> None:
    whole = Scene.from_dict(region_scene(**{**EVERYTHING, "accuracy": accuracy}))
    read = again(whole, tmp_path)
    assert read == whole
    assert json.loads(read.model_dump_json()) == json.loads(whole.model_dump_json())
    # No zero loses its sign.
    assert str(read.lights[1].position) == str(whole.lights[1].position)
    named = set(tomllib.loads(whole.to_toml()))
    assert named == set(region_scene()) | set(EVERYTHING)


def test_the_text() -> None:
    """Defaults are left out; what says which table it is comes first."""
    keys = (halfstep.SolidKey(at=0, origin=(0, 0, 1)),)
    box = halfstep.Box(size=(1.0, 2.5, 1e-7), color=(1, 0, 0), name="box", keyframes=keys)
    rod = halfstep.Surface(kind="cylinder", radius=0.5, id=4)
    pin = halfstep.Group("pin", cells=[halfstep.Cell("rod", -rod, color=(1, 1, 1), id=2)])
    whole = halfstep.Scene(
        camera=halfstep.Camera(center=(0, -8, 3), look_at=(0, 0, 0)),
        solids=[box],
        cells=[halfstep.Cell("hidden", ~box, visible=False)],
        lattices=[
            halfstep.Lattice(
                kind="rectangular", pitch=[1, 1], groups={"P": pin, "%": pin}, rows=["P%", "P."]
            )
        ],
    )
    assert (
        whole.to_toml()
        == """\
format = 1

[camera]
center = [0, -8, 3]
look_at = [0, 0, 0]

[[solid]]
name = "box"
kind = "box"
color = [1, 0, 0]
size = [1, 2.5, 1e-07]

[[solid.key]]
at = 0
origin = [0, 0, 1]

[[part]]
name = "box"
kind = "box"
color = [1, 0, 0]
size = [1, 2.5, 1e-07]

[[part.key]]
at = 0
origin = [0, 0, 1]

[[cell]]
name = "hidden"
region = "~box"
visible = false

[[group]]
name = "pin"

[[group.surface]]
id = 4
kind = "cylinder"
radius = 0.5

[[group.cell]]
name = "rod"
id = 2
region = "-4"
color = [1, 1, 1]

[[lattice]]
kind = "rectangular"
groups = { P = "pin", "%" = "pin" }
pitch = [1, 1]
rows = ["P%", "P."]
"""
    )
