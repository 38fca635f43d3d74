"""Every rule of the scene format: one breach with its whole message, beside a valid control."""

from __future__ import annotations

import copy
import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from halfstep.errors import HalfstepError, SceneError
from halfstep.scene import (
    MAX_HALF_SPACES,
    Accuracy,
    Box,
    Camera,
    Cone,
    Cylinder,
    Ellipsoid,
    Fragment,
    HyperboloidOneSheet,
    HyperboloidTwoSheets,
    Image,
    Light,
    Overrides,
    Paraboloid,
    PlanePatch,
    Polyhedron,
    Quadric,
    QuadricSolid,
    Scene,
    Sphere,
    as_scene,
    bundled_scenes,
    json_schema,
    load,
    with_overrides,
)
from halfstep.scene.values import Array

KINDS = (
    '"sphere", "ellipsoid", "cylinder", "cone", "hyperboloid_one_sheet", '
    '"hyperboloid_two_sheets", "paraboloid", "quadric", "box", "polyhedron", "plane", '
    '"torus", "implicit"'
)
# Those that all number formats and methods can draw.
EVERYWHERE = set(json.loads(f"[{KINDS}]")) - {"torus", "implicit"}
SPHERE: dict[str, Any] = {"kind": "sphere", "radius": 1, "color": [1, 0, 0]}
BOX: dict[str, Any] = {"kind": "box", "size": [1, 2, 3], "color": [1, 0, 0]}
PATCH: dict[str, Any] = {
    "kind": "plane",
    "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]},
    "color": [1, 0, 0],
}
CUBE = [[1, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1], [0, 0, 1, 1], [0, 0, -1, 1]]
BRASS: dict[str, Any] = {"name": "brass", "color": [0.8, 0.6, 0.2]}
VALID: dict[str, Any] = {
    "format": 1,
    "title": "control",
    "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0], "up": [0, 0, 1], "fov_degrees": 45},
    "animation": {"frames": 40, "fps": 30, "key": [{"at": 0, "center": [0, -9, 3]}]},
    "image": {"width": 320, "height": 240, "samples": 2, "background": [0, 0, 0]},
    "accuracy": {"tolerance_pixels": 0.25, "number_format": "fixed32", "method": "article"},
    "volume": {"min": [-5, -5, -5], "max": [5, 5, 5]},
    "ambient": {"color": [0.1, 0.2, 0.3]},
    "light": [{"direction": [1, -1, 2]}, {"position": [0, 0, 9], "color": [0.5, 0.5, 0.5]}],
    "material": [BRASS, {"name": "matt", "color": [1, 1, 1], "specular": 1, "shininess": 1024}],
    "solid": [
        {"name": "ball", **SPHERE, "z_min": -0.5, "z_max": 0.5, "cut": [[1, 0, 0, 0.5]]},
        {"kind": "ellipsoid", "semi_axes": [1, 2, 3], "material": "brass", "axis": [0, 0, -2]},
        {"kind": "cylinder", "radius": 1, "material": "matt", "rotation_degrees": [0, 90, 0]},
        {"kind": "cone", "slope": 1, "color": [1, 1, 1]},
        {"kind": "hyperboloid_one_sheet", "waist": 1, "c": 2, "color": [1, 1, 1]},
        {"kind": "hyperboloid_two_sheets", "a": 1, "c": 2, "color": [1, 1, 1]},
        {"kind": "paraboloid", "a": 1, "color": [1, 1, 1]},
        {"kind": "quadric", "coefficients": [1] * 10, "color": [1, 1, 1]},
        {**BOX, "key": [{"at": 0.5, "origin": [0, 0, 1], "rotation_degrees": [0, 0, 90]}]},
        {"kind": "polyhedron", "half_spaces": CUBE, "color": [1, 1, 1]},
        PATCH,
    ],
}


def changed(**tables: Any) -> dict[str, Any]:
    """The valid scene with top-level values replaced, or merged where both are tables."""
    scene = copy.deepcopy(VALID)
    for key, value in tables.items():
        both = isinstance(value, Mapping) and isinstance(scene.get(key), Mapping)
        scene[key] = {**scene[key], **value} if both else value
    return scene


def without(table: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in keys}


def one(solid: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    return changed(solid=[{**solid, **more}])


def faults_of(mapping: Mapping[str, Any]) -> tuple[str, ...]:
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(mapping, "x.toml")
    assert str(caught.value) == "\n".join(caught.value.faults)
    return caught.value.faults


def solid_of(table: Mapping[str, Any]) -> Any:
    return Scene.from_dict(one(table)).solids[0]


def test_the_control_is_valid() -> None:
    scene = Scene.from_dict(VALID, "folder/control.toml")
    assert scene.name == "control"
    kinds = [kind for kind in json.loads(f"[{KINDS}]") if kind in EVERYWHERE]
    assert [solid.kind for solid in scene.solids] == kinds
    assert [material.name for material in scene.materials] == ["brass", "matt"]
    assert scene.camera.center == (0.0, -8.0, 3.0)
    assert scene.accuracy.tolerance_pixels == 0.25


NOTHING = "has none of solid, cell, place, lattice; one must be given"
FRAGMENT = '"surface", "part", "cell", "group", "place", "lattice"'
RULES: list[tuple[dict[str, Any], str]] = [
    # The file as a whole.
    (without(VALID, "format"), "format: missing; the only format is 1"),
    (changed(format=2), "format: 2 is not 1"),
    (changed(format=True), "format: true is not an integer"),
    (changed(format=1.0), "format: 1.0 is not an integer; write 1"),
    (changed(title=3), "title: 3 is not a string"),
    (without(VALID, "camera"), "camera: missing"),
    (changed(camera=3), "camera: 3 is not a table"),
    (without(VALID, "solid"), NOTHING),
    (changed(solid=[]), NOTHING),
    (changed(solid=SPHERE), "solid: a table is not an array; write [[solid]]"),
    (changed(light="sun"), 'light: "sun" is not an array'),
    (changed(solids=[SPHERE]), 'solids: unknown key; did you mean "solid"?'),
    (changed(lights=[]), 'lights: unknown key; did you mean "light"?'),
    (
        changed(fog=1),
        'fog: unknown key; allowed are "format", "title", "camera", "animation", "image", '
        f'"accuracy", "volume", "ambient", "light", "material", "solid", {FRAGMENT}',
    ),
    (
        changed(**{"a b\x1b": 1}),
        '"a b\\u001b": unknown key; allowed are "format", "title", "camera", "animation", '
        f'"image", "accuracy", "volume", "ambient", "light", "material", "solid", {FRAGMENT}',
    ),
    (changed(image={2: 3}), "image: 2 is not a key, which is a string"),
    ({**VALID, 2: 3}, "2 is not a key, which is a string"),  # type: ignore[dict-item]
    # Materials that a solid may mean, whatever else is wrong with them.
    (changed(material=BRASS), "material: a table is not an array; write [[material]]"),
    (changed(material=[BRASS, {**BRASS, "name": 3}]), "material[1].name: 3 is not a string"),
    (changed(material=[BRASS, {**BRASS, "name": ""}]), 'material[1].name: "" is empty'),
    # Camera.
    (changed(camera={"center": 5}), "camera.center: 5 is not an array of 3 numbers"),
    (changed(camera={"center": [0, 1]}), "camera.center: [0, 1] has 2 numbers, not 3"),
    (changed(camera={"center": [0, 1, 2, 3]}), "camera.center: [0, 1, 2, 3] has 4 numbers, not 3"),
    (changed(camera={"center": [0, "1", 2]}), 'camera.center[1]: "1" is not a number'),
    (changed(camera={"center": [0, True, 2]}), "camera.center[1]: true is not a number"),
    (changed(camera={"center": [0, math.inf, 2]}), "camera.center[1]: inf is not finite"),
    (changed(camera={"center": [0, math.nan, 2]}), "camera.center[1]: nan is not finite"),
    (changed(camera={"center": [0, 2e16, 2]}), "camera.center[1]: 2e+16 is not <= 1e+15"),
    (changed(camera={"center": [0, -2e16, 2]}), "camera.center[1]: -2e+16 is not >= -1e+15"),
    (
        changed(camera={"center": [0, 1 << 9999, 2]}),
        "camera.center[1]: a huge integer is too large",
    ),
    (changed(camera={"look_at": [0, -8, 3]}), "camera.look_at: [0, -8, 3] equals center"),
    (
        changed(camera={"center": [0, 0, 0], "look_at": [0, 1e-16, 0]}),
        "camera.look_at: [0, 1e-16, 0] is not >= 1e-15 away from center",
    ),
    (changed(camera={"center": [1]}), "camera.center: [1] has 1 number, not 3"),
    (changed(camera={"center": ["a", "b"]}), 'camera.center: ["a", "b"] has 2 entries, not 3'),
    (
        changed(camera={"center": [-(10**400), 0, 0]}),
        "camera.center[0]: a huge integer is too small",
    ),
    (changed(camera={"up": [0, 0, 0]}), "camera.up: [0, 0, 0] is the zero vector"),
    (changed(camera={"up": [0, 1e-16, 0]}), "camera.up: [0, 1e-16, 0] is not >= 1e-15 long"),
    (
        changed(camera={"up": [0, 8, -3]}),
        "camera.up: [0, 8, -3] is parallel to the view, look_at - center",
    ),
    (
        changed(camera={"center": [0, 0, 9], "up": [0, 0, 1]}),
        "camera.up: [0, 0, 1] is parallel to the view, look_at - center",
    ),
    (changed(camera={"fov_degrees": 0}), "camera.fov_degrees: 0 is not > 0"),
    (changed(camera={"fov_degrees": 180}), "camera.fov_degrees: 180 is not < 180"),
    (changed(camera={"centre": [0, 0, 0]}), 'camera.centre: unknown key; did you mean "center"?'),
    # Animation.
    (changed(animation={"frames": 0}), "animation.frames: 0 is not >= 1"),
    (changed(animation={"frames": 100_001}), "animation.frames: 100001 is not <= 100000"),
    (changed(animation={"frames": 2.0}), "animation.frames: 2.0 is not an integer; write 2"),
    (changed(animation={"frames": 2.5}), "animation.frames: 2.5 is not an integer"),
    (changed(animation={"frames": "12"}), 'animation.frames: "12" is not an integer'),
    (changed(animation={"frames": math.inf}), "animation.frames: inf is not an integer"),
    (changed(animation={"fps": 0}), "animation.fps: 0 is not >= 0.1"),
    (changed(animation={"fps": 241}), "animation.fps: 241 is not <= 240"),
    (
        changed(animation={"orbit_degrees": 360}),
        "animation: has orbit_degrees and key; only one may be given",
    ),
    (
        changed(animation={"key": []}),
        "animation: has neither orbit_degrees nor key; one must be given",
    ),
    (
        changed(animation={"key": {"at": 0, "center": [0, 0, 0]}}),
        "animation.key: a table is not an array; write [[animation.key]]",
    ),
    (changed(animation={"key": [{"center": [0, 0, 0]}]}), "animation.key[0].at: missing"),
    (
        changed(animation={"key": [{"at": 1.5, "center": [0, 0, 0]}]}),
        "animation.key[0].at: 1.5 is not <= 1",
    ),
    (
        changed(animation={"key": [{"at": 0}]}),
        "animation.key[0]: has none of center, look_at, fov_degrees, orthographic_height; one must "
        "be given",
    ),
    (
        changed(animation={"key": [{"at": at, "fov_degrees": 40} for at in (0, 0.5, 0.5, 1)]}),
        "animation.key[2].at: 0.5 is not > 0.5, the key before",
    ),
    (
        changed(animation={"key": [{"at": at, "fov_degrees": 40} for at in (0.5, 0.5000001)]}),
        "animation.key[1].at: 0.5000001 is not 1e-06 after 0.5, the key before",
    ),
    (
        changed(animation={"key": [{"at": 0, "fov_degrees": 9}, {"at": 1, "fov_degrees": 0}]}),
        "animation.key[1].fov_degrees: 0 is not > 0",
    ),
    # Image.
    (changed(image={"width": 0}), "image.width: 0 is not >= 1"),
    (changed(image={"height": 16385, "samples": 1}), "image.height: 16385 is not <= 16384"),
    (changed(image={"width": 64.5}), "image.width: 64.5 is not an integer"),
    (changed(image={"samples": 9}), "image.samples: 9 is not <= 8"),
    (
        changed(image={"height": 8193}),
        "image.samples: 2 times height 8193 = 16386 is not <= 16384",
    ),
    (changed(image={"background": [0, 0, 2]}), "image.background[2]: 2 is not <= 1"),
    # Accuracy.
    (
        changed(accuracy={"steps": 4}),
        "accuracy: has tolerance_pixels and steps; only one may be given",
    ),
    (changed(accuracy={"tolerance_pixels": 0}), "accuracy.tolerance_pixels: 0 is not > 0"),
    (
        changed(accuracy={"number_format": "f16"}),
        'accuracy.number_format: "f16" is not "float32" or "fixed32"',
    ),
    (changed(accuracy={"method": 1}), 'accuracy.method: 1 is not "visible" or "article"'),
    # Volume, lights, materials.
    (
        changed(volume={"max": [5, -5, 5]}),
        "volume.max: [5, -5, 5] is not > min = [-5, -5, -5] in y",
    ),
    (changed(ambient={"color": [-1, 0, 0]}), "ambient.color[0]: -1 is not >= 0"),
    (changed(light=[{}]), "light[0]: has neither direction nor position; one must be given"),
    (
        changed(light=[{"direction": [1, 0, 0], "position": [1, 0, 0]}]),
        "light[0]: has direction and position; only one may be given",
    ),
    (changed(light=[{"direction": [0, 0, 0]}]), "light[0].direction: [0, 0, 0] is the zero vector"),
    (
        changed(material=[*VALID["material"], BRASS]),
        'material[2].name: "brass" is already the name of material[0]',
    ),
    (
        changed(material=[*VALID["material"], {"name": "", "color": [1, 1, 1]}]),
        'material[2].name: "" is empty',
    ),
    (changed(material=[*VALID["material"], {"name": "n"}]), "material[2].color: missing"),
    (
        changed(material=[VALID["material"][1], {**BRASS, "shininess": 40.5}]),
        "material[1].shininess: 40.5 is not an integer",
    ),
    (
        changed(material=[VALID["material"][1], {**BRASS, "shininess": 0}]),
        "material[1].shininess: 0 is not >= 1",
    ),
    (
        changed(material=[VALID["material"][1], {**BRASS, "specular": 1.5}]),
        "material[1].specular: 1.5 is not <= 1",
    ),
    # What all solids have.
    (changed(solid=[7]), "solid[0]: 7 is not a table"),
    (one(without(SPHERE, "kind")), f"solid[0].kind: missing; the kinds are {KINDS}"),
    (
        one(SPHERE, kind="spere"),
        'solid[0].kind: "spere" is not a kind of solid; did you mean "sphere"?',
    ),
    (
        one(SPHERE, kind="helix"),
        f'solid[0].kind: "helix" is not a kind of solid; the kinds are {KINDS}',
    ),
    (one(SPHERE, kind=[1]), f"solid[0].kind: [1] is not a kind of solid; the kinds are {KINDS}"),
    (one(SPHERE, radus=1), 'solid[0].radus: unknown key; did you mean "radius"?'),
    (
        one(SPHERE, sphere=1),
        'solid[0].sphere: unknown key; allowed are "name", "origin", "axis", '
        '"rotation_degrees", "material", "color", "key", "casts_shadow", "z_min", "z_max", '
        '"cut", "kind", "radius"',
    ),
    (
        one(BOX, z_min=0),
        'solid[0].z_min: unknown key; allowed are "name", "origin", "axis", '
        '"rotation_degrees", "material", "color", "key", "casts_shadow", "kind", "size"',
    ),
    (
        one(SPHERE, axis=[0, 0, 1], rotation_degrees=[0, 0, 1]),
        "solid[0]: has axis and rotation_degrees; only one may be given",
    ),
    (one(SPHERE, axis=[0, 0, 0]), "solid[0].axis: [0, 0, 0] is the zero vector"),
    (
        one(SPHERE, key={"at": 0, "origin": [0, 0, 0]}),
        "solid[0].key: a table is not an array; write [[solid.key]]",
    ),
    (
        one(SPHERE, key=[{"at": 0, "origin": [0, 0]}]),
        "solid[0].key[0].origin: [0, 0] has 2 numbers, not 3",
    ),
    (
        one(SPHERE, key=[{"at": 0}]),
        "solid[0].key[0]: has none of origin, rotation_degrees; one must be given",
    ),
    (
        one(SPHERE, key=[{"at": at, "origin": [0, 0, at]} for at in (1, 0)]),
        "solid[0].key[1].at: 0 is not > 1, the key before",
    ),
    (
        one(SPHERE, axis=[0, 0, 1], key=[{"at": 0, "rotation_degrees": [0, 0, 0]}]),
        "solid[0].key[0].rotation_degrees: the solid has axis; write rotation_degrees instead",
    ),
    (one(SPHERE, material="brass"), "solid[0]: has material and color; only one may be given"),
    (one(without(SPHERE, "color")), "solid[0]: has neither material nor color; one must be given"),
    (
        one(without(SPHERE, "color"), material="bras"),
        'solid[0].material: "bras" is not a material of the scene; did you mean "brass"?',
    ),
    (
        one(without(SPHERE, "color"), material="steel"),
        'solid[0].material: "steel" is not a material of the scene; the scene has "brass", "matt"',
    ),
    (
        changed(solid=[{**SPHERE, "name": "a"}, {**BOX, "name": "a"}]),
        'solid[1].name: "a" is already the name of solid[0]',
    ),
    # Each kind.
    (one(without(SPHERE, "radius")), "solid[0].radius: missing"),
    (one(SPHERE, radius=-1), "solid[0].radius: -1 is not > 0"),
    (one(SPHERE, radius=1e-16), "solid[0].radius: 1e-16 is not >= 1e-15"),
    (one(SPHERE, radius=1e16), "solid[0].radius: 1e+16 is not <= 1e+15"),
    (one(BOX, size=[1, 0, 1]), "solid[0].size[1]: 0 is not > 0"),
    (one(VALID["solid"][1], semi_axes=[1, 2]), "solid[0].semi_axes: [1, 2] has 2 numbers, not 3"),
    (one(VALID["solid"][3], slope=0), "solid[0].slope: 0 is not > 0"),
    (one(SPHERE, z_min=1, z_max=1), "solid[0].z_max: 1 is not > z_min = 1"),
    (one(SPHERE, cut=[[1, 0, 0]]), "solid[0].cut[0]: [1, 0, 0] has 3 numbers, not 4"),
    (
        one(SPHERE, cut=[[1, 0, 0, 1], [0, 0, 0, 1]]),
        "solid[0].cut[1]: normal [0, 0, 0] is the zero vector",
    ),
    (
        one(SPHERE, z_min=0, cut=[[1, 0, 0, 1]] * MAX_HALF_SPACES),
        "solid[0].cut: 256 half-spaces with z_min and z_max is not <= 255",
    ),
    (one(SPHERE, cut=[[1, 0, 0, 1]] * 256), "solid[0].cut: length 256 is not <= 255"),
    (
        one(VALID["solid"][7], coefficients=[0] * 9 + [1]),
        "solid[0].coefficients: [0, 0, 0, 0, 0, 0, 0, 0, 0, 1] is 0 but for the last, which is "
        "no surface",
    ),
    (one(VALID["solid"][9], half_spaces=CUBE[:3]), "solid[0].half_spaces: length 3 is not >= 4"),
    (
        one(VALID["solid"][9], half_spaces=CUBE * 43),
        "solid[0].half_spaces: length 258 is not <= 255",
    ),
    (
        one(VALID["solid"][9], half_spaces=CUBE[:5]),
        "solid[0].half_spaces: these 5 half-spaces do not enclose a bounded solid",
    ),
    (
        one(VALID["solid"][9], half_spaces=[*CUBE, [1, 0, 0, -2]]),
        "solid[0].half_spaces: no point lies inside all 7 half-spaces",
    ),
    (
        one(VALID["solid"][9], half_spaces=[*CUBE, [1, 0, 0, -1.000001]]),
        "solid[0].half_spaces: no point lies inside all 7 half-spaces",
    ),
    (one(without(PATCH, "bounds")), "solid[0].bounds: missing"),
    (
        one(PATCH, bounds={"min": [0, 0, 0], "max": [1, -1, 0]}),
        "solid[0].bounds.max: [1, -1, 0] is not >= min = [0, 0, 0] in y",
    ),
    (one(PATCH, bounds={"min": [0, 0, 0]}), "solid[0].bounds.max: missing"),
    (
        one(PATCH, bounds={"min": [0, 0, 0], "max": [1, 0, 0]}),
        "solid[0].bounds: the plane does not meet this box in an area",
    ),
    (
        one(PATCH, axis=[1, 0, 1], origin=[9, 0, 0]),
        "solid[0].bounds: the plane does not meet this box in an area",
    ),
]


def test_a_bad_entry_does_not_make_an_array_short() -> None:
    bad = one({"kind": "quadric", "coefficients": ["1", *range(9)], "color": [1, 0, 0]})
    assert faults_of(bad) == ('x.toml: solid[0].coefficients[0]: "1" is not a number',)
    four = [[1, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], 5]
    bad = one({"kind": "polyhedron", "half_spaces": four, "color": [1, 0, 0]})
    assert faults_of(bad) == ("x.toml: solid[0].half_spaces[3]: 5 is not an array of 4 numbers",)


def test_numbers_may_be_those_of_numpy() -> None:
    numpy = {
        **VALID,
        "format": np.int64(1),
        "camera": {
            "center": [np.float32(0), np.int8(-8), np.array(3)],
            "look_at": np.zeros(3, np.float32),
            "fov_degrees": np.float32(50),
        },
        "image": {"width": np.uint16(640), "samples": np.array(2)},
    }
    plain = {
        **VALID,
        "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0], "fov_degrees": 50},
        "image": {"width": 640, "samples": 2},
    }
    assert Scene.from_dict(numpy).sha256 == Scene.from_dict(plain).sha256
    camera = {"center": [np.float32(1), np.int64(2), 3], "fov_degrees": np.float32(40)}
    shown = with_overrides(Scene.from_dict(plain), camera=camera, steps=np.int64(7))  # type: ignore[arg-type]
    assert (shown.camera.center, shown.camera.fov_degrees, shown.accuracy.steps) == (
        (1, 2, 3),
        40,
        7,
    )
    bad = changed(camera={"fov_degrees": np.array([1.0, 2.0])})
    assert faults_of(bad) == ("x.toml: camera.fov_degrees: [1, 2] is not a number",)


@pytest.mark.parametrize(("mapping", "fault"), RULES, ids=[fault for _, fault in RULES])
def test_a_broken_rule(mapping: dict[str, Any], fault: str) -> None:
    assert faults_of(mapping) == (f"x.toml: {fault}",)


def test_all_faults_at_once() -> None:
    scene = changed(
        camera={"fov_degrees": 200, "center": [0, 0, 0], "look_at": [0, 0, 4]},
        light=[{"direction": [0, 0, 0]}, {"colour": [1, 1, 1], "position": [0, 0, 0]}],
        material=[{**BRASS, "specular": -1}, BRASS],
        solid=[
            {**without(SPHERE, "color"), "radius": -1, "z_min": 2, "z_max": 1, "material": "tin"},
            {"kind": "ball"},
            {**SPHERE, "name": "s"},
            {**BOX, "name": "s"},
        ],
    )
    assert faults_of(scene) == (
        "x.toml: camera.up: [0, 0, 1] is parallel to the view, look_at - center",
        "x.toml: camera.fov_degrees: 200 is not < 180",
        "x.toml: light[0].direction: [0, 0, 0] is the zero vector",
        'x.toml: light[1].colour: unknown key; did you mean "color"?',
        "x.toml: material[0].specular: -1 is not >= 0",
        "x.toml: solid[0].z_max: 1 is not > z_min = 2",
        "x.toml: solid[0].radius: -1 is not > 0",
        f'x.toml: solid[1].kind: "ball" is not a kind of solid; the kinds are {KINDS}',
        'x.toml: material[1].name: "brass" is already the name of material[0]',
        'x.toml: solid[0].material: "tin" is not a material of the scene; the scene has "brass"',
        "x.toml: solid[1]: has neither material nor color; one must be given",
        'x.toml: solid[3].name: "s" is already the name of solid[2]',
    )


def test_types_check_names_when_built_directly() -> None:
    camera = Camera(center=(0.0, -8.0, 0.0), look_at=(0.0, 0.0, 0.0))
    ball = Sphere(radius=1.0, material="tin")
    with pytest.raises(SceneError) as caught:
        Scene(camera=camera, solids=(ball,))
    assert caught.value.faults == (
        'scene: solid[0].material: "tin" is not a material of the scene; the scene has none',
    )


def test_defaults() -> None:
    scene = Scene.from_dict(
        {"format": 1, "camera": {"center": [0, -5, 0], "look_at": [0, 0, 0]}, "solid": [SPHERE]}
    )
    assert (scene.name, scene.title, scene.volume, scene.lights) == ("scene", "", None, ())
    assert (scene.camera.up, scene.camera.fov_degrees) == ((0.0, 0.0, 1.0), 45.0)
    assert (scene.image.width, scene.image.height, scene.image.samples) == (640, 480, 1)
    assert scene.image.background == (0.02, 0.02, 0.03)
    accuracy = scene.accuracy
    assert (accuracy.tolerance_pixels, accuracy.tolerance, accuracy.steps) == (0.5, None, None)
    assert (accuracy.number_format, accuracy.method) == ("float32", "visible")
    assert scene.ambient.color == (0.1, 0.1, 0.1)
    assert scene.effective_lights() == (Light(direction=(0.0, -1.0, 0.0)),)
    finish = scene.material_of(scene.solids[0])
    assert (finish.color, finish.specular, finish.shininess) == ((1.0, 0.0, 0.0), 0.0, 40)


def test_given_lights_replace_the_default_one() -> None:
    scene = Scene.from_dict(VALID)
    assert scene.effective_lights() is scene.lights
    assert scene.material_of(scene.solids[1]) is scene.materials[0]


def test_limits_are_allowed() -> None:
    Scene.from_dict(changed(image={"width": 16384, "height": 1, "samples": 1}))
    Scene.from_dict(changed(image={"width": 2048, "height": 2048, "samples": 8}))
    Scene.from_dict(one(SPHERE, radius=1e-15, origin=[1e15, -1e15, 0]))
    Scene.from_dict(one(SPHERE, radius=1e15, cut=[[1, 0, 0, 1]] * MAX_HALF_SPACES))
    for key, value in (("steps", 30), ("steps", 1), ("tolerance", 1e-9)):
        scene = Scene.from_dict({**VALID, "accuracy": {key: value}})
        assert getattr(scene.accuracy, key) == value
        assert scene.accuracy.tolerance_pixels is None


def test_frozen() -> None:
    scene = Scene.from_dict(VALID)
    with pytest.raises(ValidationError):
        scene.title = "other"  # type: ignore[misc]


# ------------------------------------------------------------------------------ solids


def side(solid: QuadricSolid, point: Array) -> float:
    homogeneous = np.append(point, 1.0)
    return float(homogeneous @ solid.quadric() @ homogeneous)


def test_quadrics_are_their_formulas(rng: np.random.Generator) -> None:
    look: dict[str, Any] = {"color": (1.0, 1.0, 1.0)}
    a, b, c = 0.7, 1.3, 2.1
    k = tuple(float(x) for x in rng.normal(size=10))
    for x, y, z in rng.normal(size=(50, 3)):
        p, r2 = np.array([x, y, z]), x * x + y * y
        monomials = (x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, 1.0)
        expected: list[tuple[QuadricSolid, float]] = [
            (Sphere(radius=a, **look), r2 + z * z - a * a),
            (
                Ellipsoid(semi_axes=(a, b, c), **look),
                (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1,
            ),
            (Cylinder(radius=a, **look), r2 - a * a),
            (Cone(slope=a, **look), r2 - a * a * z * z),
            (HyperboloidOneSheet(waist=a, c=c, **look), r2 / a**2 - (z / c) ** 2 - 1),
            (HyperboloidTwoSheets(a=a, c=c, **look), r2 / a**2 - (z / c) ** 2 + 1),
            (Paraboloid(a=a, **look), r2 / a**2 - z),
            (Quadric(coefficients=k, **look), float(np.dot(k, monomials))),
        ]
        for solid, value in expected:
            assert side(solid, p) == pytest.approx(value, rel=1e-12, abs=1e-12)
            assert np.array_equal(solid.quadric(), solid.quadric().T)


def test_half_spaces_are_in_the_order_of_surface_numbers() -> None:
    cut = solid_of({**SPHERE, "cut": [[1, 2, 3, 4]], "z_max": 5, "z_min": -6})
    assert cut.half_spaces().tolist() == [[0, 0, -1, 6], [0, 0, 1, 5], [1, 2, 3, 4]]
    assert solid_of({**SPHERE, "z_max": 5}).half_spaces().tolist() == [[0, 0, 1, 5]]
    assert solid_of(SPHERE).half_spaces().shape == (0, 4)
    assert solid_of(PATCH).half_spaces().tolist() == [
        [0, 0, 1, 0],
        [1, 0, 0, 1],
        [-1, 0, 0, 1],
        [0, 1, 0, 1],
        [0, -1, 0, 1],
    ]
    box = solid_of(BOX)
    assert isinstance(box, Box)
    assert box.half_spaces().tolist() == [
        [-1, 0, 0, 0.5],
        [1, 0, 0, 0.5],
        [0, -1, 0, 1],
        [0, 1, 0, 1],
        [0, 0, -1, 1.5],
        [0, 0, 1, 1.5],
    ]
    polyhedron = solid_of(VALID["solid"][9])
    assert isinstance(polyhedron, Polyhedron)
    assert polyhedron.half_spaces().tolist() == CUBE


def test_rotation_order() -> None:
    turned = solid_of({**SPHERE, "rotation_degrees": [90, 0, 90]}).world_from_local()
    # About X first (y to z), then about Z (x to y, y to -x), both exact.
    assert turned.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize("angle", [-720.0, -270.0, -45.0, 0.0, 30.0, 90.0, 135.0, 359.0, 1e6])
def test_rotation_about_z(angle: float) -> None:
    turned = solid_of({**SPHERE, "rotation_degrees": [0, 0, angle]}).world_from_local()
    radians = math.radians(math.fmod(angle, 360.0))
    expected = [math.cos(radians), math.sin(radians), 0.0]
    assert turned[:, 0] == pytest.approx(expected, abs=1e-12)
    assert turned @ turned.T == pytest.approx(np.eye(3), abs=1e-15)


def test_axis_is_reached_by_the_shortest_rotation(rng: np.random.Generator) -> None:
    special = [[0, 0, 1], [0, 0, -1], [1e-9, 0, -1], [1e-300, 1e-200, -1], [3, 4, 0], [0, 1e-8, 1]]
    for axis in [*special, *(rng.normal(size=(100, 3)) * 1e3).tolist()]:
        turned = solid_of({**SPHERE, "axis": axis}).world_from_local()
        unit = np.array(axis) / math.hypot(*axis)
        assert turned[:, 2] == pytest.approx(unit, abs=1e-15)
        assert turned @ turned.T == pytest.approx(np.eye(3), abs=4e-15)
        assert np.linalg.det(turned) == pytest.approx(1.0, abs=4e-15)
        # Shortest: the rotation's angle, from its trace, is the angle from Z to the axis.
        assert (np.trace(turned) - 1.0) / 2.0 == pytest.approx(unit[2], abs=4e-15)
    half_turn = solid_of({**SPHERE, "axis": [0, 0, -3]}).world_from_local()
    assert half_turn.tolist() == [[1, 0, 0], [0, -1, 0], [0, 0, -1]]


def test_a_patch_ignores_bounds_along_its_normal() -> None:
    elsewhere = {"min": [-1, -1, 7], "max": [1, 1, 8]}
    flat = solid_of({**PATCH, "bounds": elsewhere})
    assert isinstance(flat, PlanePatch)
    assert flat.tested_axes() == (0, 1)
    assert solid_of({**PATCH, "axis": [1, 0, 1e-3]}).tested_axes() == (0, 1, 2)
    assert solid_of({**PATCH, "rotation_degrees": [0, 90, 0]}).tested_axes() == (1, 2)
    # Slightly tilted, the same plane does not meet that box.
    assert faults_of(one(PATCH, bounds=elsewhere, axis=[0, 0.01, 1])) == (
        "x.toml: solid[0].bounds: the plane does not meet this box in an area",
    )


# ------------------------------------------------------------------------------ identity


def test_sha256_knows_values_not_spelling() -> None:
    short = {"format": 1, "camera": {"center": [0, -5, 0], "look_at": [0, 0, 0]}, "solid": [SPHERE]}
    long = {
        "solid": [{**SPHERE, "radius": 1.0, "origin": [0, 0, 0], "cut": []}],
        "accuracy": {"tolerance_pixels": 0.5},
        "image": {"width": 640},
        "light": [],
        "camera": {"look_at": [0, 0, 0], "center": [0, -5, 0.0], "up": [0, 0, 1]},
        "format": 1,
    }
    scene = Scene.from_dict(short, "a.toml")
    assert scene.sha256 == Scene.from_dict(long, "b.toml").sha256
    assert len(scene.sha256) == 64
    assert scene.sha256 != Scene.from_dict({**short, "title": "t"}).sha256
    assert scene.sha256 != with_overrides(scene, steps=4).sha256


# ------------------------------------------------------------------------------ overrides


def test_overrides_replace_and_keep() -> None:
    scene = Scene.from_dict(VALID, "a.toml")
    new = with_overrides(
        scene,
        size=(64, 48),
        samples=1,
        steps=9,
        number_format="float32",
        method="visible",
        camera={"center": [0, -9, 0]},
    )
    assert (new.image.width, new.image.height, new.image.samples) == (64, 48, 1)
    assert new.image.background == scene.image.background
    assert (new.accuracy.steps, new.accuracy.tolerance_pixels) == (9, None)
    assert (new.accuracy.number_format, new.accuracy.method) == ("float32", "visible")
    assert (new.camera.center, new.camera.look_at) == ((0.0, -9.0, 0.0), scene.camera.look_at)
    assert new.name == "a"
    assert new.solids is scene.solids
    assert scene == Scene.from_dict(VALID, "a.toml")
    assert with_overrides(scene) == scene


def test_overrides_take_numpy_numbers_and_whole_cameras() -> None:
    scene = Scene.from_dict(VALID)
    size: Any = np.array([64, 48])
    new = with_overrides(
        scene,
        size=size,
        tolerance=np.float32(0.25).item(),
        camera={"center": np.array([1.0, 2.0, 3.0])},
    )
    assert (new.image.width, new.image.height, new.accuracy.tolerance) == (64, 48, 0.25)
    assert new.camera.center == (1.0, 2.0, 3.0)
    camera = Camera(center=(0.0, 0.0, 9.0), look_at=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    assert with_overrides(scene, camera=camera).camera is camera


OVERRIDES: list[tuple[dict[str, Any], str]] = [
    ({"steps": 31}, "steps: 31 is not <= 30"),
    ({"steps": 2.5}, "steps: 2.5 is not an integer"),
    ({"tolerance": 0}, "tolerance: 0 is not > 0"),
    ({"tolerance_pixels": math.nan}, "tolerance_pixels: nan is not finite"),
    ({"steps": 3, "tolerance": 1.0}, "accuracy: has tolerance and steps; only one may be given"),
    ({"number_format": "f16"}, 'number_format: "f16" is not "float32" or "fixed32"'),
    ({"method": "fast"}, 'method: "fast" is not "visible" or "article"'),
    ({"samples": 0}, "samples: 0 is not >= 1"),
    ({"size": 5}, "size: 5 is not an array of 2 integers"),
    ({"size": (4, 0)}, "size[1]: 0 is not >= 1"),
    ({"size": (9000, 9)}, "samples: 2 times width 9000 = 18000 is not <= 16384"),
    ({"camera": 5}, "camera: 5 is not a table"),
    ({"camera": {"fov_degrees": 0}}, "camera.fov_degrees: 0 is not > 0"),
    ({"camera": {"centre": [0, 0, 1]}}, 'camera.centre: unknown key; did you mean "center"?'),
    ({"camera": {"up": [0, 1]}}, "camera.up: [0, 1] has 2 numbers, not 3"),
]


@pytest.mark.parametrize(("options", "fault"), OVERRIDES, ids=[fault for _, fault in OVERRIDES])
def test_a_bad_override(options: dict[str, Any], fault: str) -> None:
    with pytest.raises(SceneError) as caught:
        with_overrides(Scene.from_dict(VALID), **options)
    assert caught.value.faults == (fault,)


def test_every_option_is_a_key_of_a_table() -> None:
    keys = Image.model_fields.keys() | Accuracy.model_fields.keys() | {"size", "shadows"}
    assert Overrides.__annotations__.keys() <= keys


def test_an_option_that_is_not_there() -> None:
    options: Any = {"stpes": 3, "size": (4, 3), "albedo": 1}
    with pytest.raises(TypeError) as caught:
        with_overrides(Scene.from_dict(VALID), **options)
    assert str(caught.value).startswith("albedo, stpes: no such option; there are size, samples, ")


def test_all_bad_overrides_at_once() -> None:
    with pytest.raises(SceneError) as caught:
        with_overrides(
            Scene.from_dict(VALID), size=(0, 1), steps=0, camera={"look_at": (0.0, -8.0, 3.0)}
        )
    assert caught.value.faults == (
        "camera.look_at: [0, -8, 3] equals center",
        "size[0]: 0 is not >= 1",
        "steps: 0 is not >= 1",
    )


# ------------------------------------------------------------------------------ files


def message(path: str | Path) -> str:
    with pytest.raises(SceneError) as caught:
        load(path)
    assert isinstance(caught.value, HalfstepError)
    assert caught.value.exit_code == 2
    return str(caught.value)


SMALLEST = (
    "format = 1\ncamera.center = [0, -5, 0]\ncamera.look_at = [0, 0, 0]\n"
    '[[solid]]\nkind = "sphere"\nradius = 1\ncolor = [1, 1, 1]\n'
)


def test_load_reads_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(SMALLEST)
    assert load(path) == load(str(path))
    assert load(path).name == "mine"


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    plain, marked = tmp_path / "plain.toml", tmp_path / "marked.toml"
    plain.write_text(SMALLEST)
    marked.write_text(SMALLEST, encoding="utf-8-sig")
    assert marked.read_bytes()[:4] == b"\xef\xbb\xbff"
    assert load(marked).sha256 == load(plain).sha256


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"format = ", "line 1, column 10: Invalid value"),
        (
            b"format = 1\n[camera\n",
            "line 2, column 8: Expected ']' at the end of a table declaration",
        ),
        (b"title = 'a", 'line 1, column 11: Expected "\'"'),
        (b'format = 1\ntitle = "\xff"\n', "line 2, column 10: not UTF-8 text"),
        (b"\xef\xbb\xbfformat = ", "line 1, column 10: Invalid value"),
        (b"\xef\xbb\xbfformat = \xff", "line 1, column 10: not UTF-8 text"),
        ("format = 1\n".encode("utf-16"), "line 1, column 1: not UTF-8 text"),
        (b"x = " + b"[" * 2000 + b"]" * 2000, "nested too deeply"),
    ],
)
def test_bad_toml_is_one_line(content: bytes, fault: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    assert message(path) == f"bad.toml: {fault}"


def test_faults_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "figure.toml"
    path.write_text('format = 2\n[camera]\ncenter = [1, 2]\n[[solid]]\nkind = "box"\n')
    assert message(path).splitlines() == [
        "figure.toml: format: 2 is not 1",
        "figure.toml: camera.center: [1, 2] has 2 numbers, not 3",
        "figure.toml: camera.look_at: missing",
        "figure.toml: solid[0].size: missing",
        "figure.toml: solid[0]: has neither material nor color; one must be given",
    ]


@pytest.mark.parametrize("given", [None, 0, {}], ids=str)
def test_what_is_no_path_is_not_loaded(given: Any) -> None:
    with pytest.raises(SceneError) as caught:
        load(given)
    assert str(caught.value).endswith(" is not a path or a bundled name")


def test_what_stands_for_a_scene(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(SMALLEST)
    scene = load(path)
    assert as_scene(scene) is scene
    assert as_scene(path) == as_scene(str(path)) == scene
    assert as_scene(tomllib.loads(SMALLEST)).sha256 == scene.sha256
    assert as_scene(MappingProxyType(tomllib.loads(SMALLEST))).name == "scene"
    assert as_scene("figure") == load("figure")


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ("nowhere/x.toml", "nowhere/x.toml: no such file"),
        ({**VALID, "format": 2}, "scene: format: 2 is not 1"),
        ({}, "scene: format: missing; the only format is 1\nscene: camera: missing\n"
         f"scene: {NOTHING}"),
        (5, "scene: 5 is not a scene, a path, a bundled name or a mapping"),
        (None, "scene: None is not a scene, a path, a bundled name or a mapping"),
        ([VALID], "scene: [a table] is not a scene, a path, a bundled name or a mapping"),
        (b"figure", "scene: b'figure' is not a scene, a path, a bundled name or a mapping"),
    ],
)  # fmt: skip
def test_what_stands_for_none(given: Any, fault: str) -> None:
    with pytest.raises(SceneError) as caught:
        as_scene(given)
    assert str(caught.value) == fault


def test_what_is_no_scene_file(tmp_path: Path) -> None:
    assert message("nowhere/x.toml") == "nowhere/x.toml: no such file"
    assert message("a\0.toml") == "'a\\x00.toml': cannot be read: embedded null byte"
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    assert message(folder) == f"{folder}: cannot be read: Is a directory"
    picture = tmp_path / "picture.png"
    picture.touch()
    assert message(picture) == f"{picture}: not a scene file; its name must end in .toml"
    assert message("figur") == (
        'figur: no such file or bundled scene; did you mean "figure"? '
        "(`halfstep scenes` lists them all)"
    )


# ------------------------------------------------------------------------------ bundled


def test_bundled_scenes_have_titles() -> None:
    titles = bundled_scenes()
    assert list(titles) == sorted(titles)
    assert {"figure", "gallery", "crowd", "far", "tiny", "huge"} <= titles.keys()
    assert {f"one_{kind}" for kind in json.loads(f"[{KINDS}]")} <= titles.keys()
    assert all(titles.values())
    assert len(set(titles.values())) == len(titles)


@pytest.mark.parametrize("name", bundled_scenes())
def test_bundled_scene_is_valid(name: str) -> None:
    scene = load(name)
    assert scene.name == name
    fragments: list[Fragment] = [scene, *scene.groups]
    tables = [*scene.solids, *(each for it in fragments for each in (*it.parts, *it.cells))]
    used = {each.material for each in tables if each.material is not None}
    assert used == {material.name for material in scene.materials}
    assert not any(group.groups for group in scene.groups)


def test_the_crowd_is_a_thousand_of_all_kinds() -> None:
    scene = load("crowd")
    assert len(scene.solids) == 1000
    assert {solid.kind for solid in scene.solids} == EVERYWHERE


def test_the_gallery_shows_every_kind() -> None:
    assert {solid.kind for solid in load("gallery").solids} == EVERYWHERE


def test_json_schema() -> None:
    schema = json_schema()
    json.dumps(schema, allow_nan=False)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert set(schema["properties"]) == {*VALID, *json.loads(f"[{FRAGMENT}]")}
    assert schema["required"] == ["format", "camera"]
    solid = schema["properties"]["solid"]["items"]
    assert set(solid["discriminator"]["mapping"]) == set(json.loads(f"[{KINDS}]"))
    half_spaces = schema["$defs"]["Polyhedron"]["properties"]["half_spaces"]
    assert (half_spaces["minItems"], half_spaces["maxItems"]) == (4, MAX_HALF_SPACES)
    sphere = schema["$defs"]["Sphere"]
    assert sphere["properties"]["cut"]["maxItems"] == MAX_HALF_SPACES
    assert sphere["additionalProperties"] is False
    assert sphere["properties"]["radius"]["maximum"] == 1e15
