"""SURFER's ``.jsurf`` files: where a surface is seen, judged by matrices multiplied here."""

from __future__ import annotations

import math
import re
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.cli import main
from halfstep.errors import SceneError, UsageError
from halfstep.models import Look, load
from halfstep.models.source import Source
from halfstep.models.surfer import MAX_BYTES, decoded, properties_of
from halfstep.scene import Implicit, Scene

Floats = NDArray[np.float64]

TURN = (0.31, -0.62, 1.13)  # about x, y and z
SCALE = 0.37
FORMULA = "x^3 + b*y^2*x - a*z + 0.2*e"
VALUES = {"a": 0.7, "b": 1.25, "e": 0.5}


def rotation(x: float, y: float, z: float) -> Floats:
    """(4, 4), about x, then y, then z."""
    whole = np.eye(4)
    for axis, angle in enumerate((x, y, z)):
        turn = np.eye(4)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = math.cos(angle)
        turn[second, first] = math.sin(angle)
        turn[first, second] = -turn[second, first]
        whole = turn @ whole
    return whole


def words(matrix: Floats) -> str:
    return " ".join(map(repr, matrix.ravel().tolist()))


def text_of(**changed: str) -> str:
    """A file; ``changed`` replaces and adds properties."""
    moved = np.eye(4)
    moved[:3, 3] = 0.1, -0.2, -1.5
    properties = {
        "surface_equation": FORMULA,
        **{f"surface_parameter_{name}": f"{value}" for name, value in VALUES.items()},
        "rotation_matrix": words(rotation(*TURN)),
        "camera_transform": words(moved),
        "camera_type": "ORTHOGRAPHIC_CAMERA",
        "camera_height": "2.0",
        "scale_factor": f"{SCALE}",
        "front_material_color": "0.5 0.25 1.0",
        "front_material_shininess": "30.0",
        "light_status_2": "ON",
        "light_position_2": "0.5 1.0 2.0",
        "light_intensity_2": "0.6",
        "light_color_2": "1.0 0.5 0.0",
        "light_status_3": "OFF",
        "background_color": "1.0 1.0 1.0",
        **changed,
    }
    return "".join(f"{key}={value}\n" for key, value in properties.items())


def opened(folder: Path, text: str, look: Look | None = None) -> Scene:
    path = folder / "surface.jsurf"
    path.write_text(text, encoding="latin-1")
    return load(path, look)


def from_camera() -> Floats:
    """(4, 4), points of the camera's space to those of the formula."""
    moved = np.eye(4)
    moved[:3, 3] = -0.1, 0.2, 1.5
    return np.diag([10**SCALE, 10**SCALE, 10**SCALE, 1.0]) @ rotation(*TURN) @ moved


def formula_at(points: Floats) -> Floats:
    x, y, z = points.T
    return np.asarray(x**3 + VALUES["b"] * y**2 * x - VALUES["a"] * z + 0.2 * VALUES["e"])


@pytest.mark.parametrize("kind", ["ORTHOGRAPHIC_CAMERA", "PERSPECTIVE_CAMERA"])
def test_points_are_where_the_file_puts_them(tmp_path: Path, kind: str) -> None:
    scene = opened(tmp_path, text_of(camera_type=kind, camera_fov_y="70.0"))
    width, height = 96, 80
    frame = halfstep.render(
        scene, size=(width, height), steps=16, backend="numpy", outputs=("position", "error")
    )
    hit = (frame.solid >= 0) & np.isfinite(frame.error)
    rows, columns = np.nonzero(hit)
    assert len(rows) > 1000
    points = frame.position[hit]
    # Every point is on the surface, and in the ball.
    assert np.abs(formula_at(points)).max() < 0.002
    assert np.linalg.norm(points, axis=1).max() < 10**SCALE * 1.0001
    # Every point is on the ray of its pixel in the space of the camera, which looks along -z.
    x, y, z, _ = np.linalg.inv(from_camera()) @ np.vstack([points.T, np.ones(len(points))])
    assert z.max() < 0
    half = 1.0 if kind == "ORTHOGRAPHIC_CAMERA" else -math.tan(math.radians(35)) * z
    across = half * (2 * (columns + 0.5) - width) / height
    above = half * (height - 2 * (rows + 0.5)) / height
    assert np.abs(x - across).max() < 1e-5
    assert np.abs(y - above).max() < 1e-5
    # The first point of a ray is shown: F has one sign from the ball to there.
    start = np.zeros((3, len(points)))
    start[:2] = (across, above) if kind == "ORTHOGRAPHIC_CAMERA" else 0.0
    eye = (from_camera() @ np.vstack([start, np.ones(len(points))]))[:3].T
    for part in np.linspace(0.01, 0.99, 99):
        between = eye + part * (points - eye)
        inside = np.linalg.norm(between, axis=1) < 10**SCALE
        near = eye + 0.999 * (points - eye)
        same = formula_at(between) * formula_at(near) > 0
        assert (same | ~inside).mean() > 0.995, part


def test_looks(tmp_path: Path) -> None:
    scene = opened(tmp_path, text_of(front_material_specular_iIntensity="0.4"))
    [light] = scene.lights
    assert light.position is not None
    expected = from_camera() @ [0.5, 1.0, 2.0, 1.0]
    assert np.allclose(light.position, expected[:3])
    assert np.allclose(light.color, [0.48, 0.24, 0.0])
    [material] = scene.materials
    # 0.5 on a screen is 0.214 of its light.
    assert np.allclose(material.color, [0.2140, 0.0509, 1.0], atol=1e-4)
    assert (material.specular, material.shininess) == (0.5, 30)
    assert scene.image.background == (1.0, 1.0, 1.0)
    assert (scene.image.width, scene.image.height) == (640, 640)


def test_a_parameter_may_be_named_as_a_constant(tmp_path: Path) -> None:
    [solid] = opened(tmp_path, text_of()).solids
    assert isinstance(solid, Implicit)
    assert solid.parameters == {"a": 0.7, "b": 1.25, "e_": 0.5}
    [solid] = opened(
        tmp_path, text_of(surface_equation="2e1*x + e*1.5e+1 + e_*a - b", surface_parameter_e_="1")
    ).solids
    assert isinstance(solid, Implicit)
    assert solid.formula == "2e1*x + e__*1.5e+1 + e_*a - b"


def test_cameras_of_options(tmp_path: Path) -> None:
    scene = opened(tmp_path, text_of(), Look(eye=(0.0, -9.0, 1.0), fov_degrees=20.0))
    assert (scene.camera.center, scene.camera.fov_degrees) == ((0.0, -9.0, 1.0), 20.0)
    assert opened(tmp_path, text_of(), Look(view="xy")).camera.up == (0.0, 1.0, 0.0)
    for look, option in ((Look(clip=("x > 0",)), "--clip"), (Look(hide=("void",)), "--hide")):
        with pytest.raises(UsageError, match=f"{option}: is not for surfaces of SURFER"):
            opened(tmp_path, text_of(), look)


def test_an_imported_scene_is_the_same(tmp_path: Path) -> None:
    scene = opened(tmp_path, text_of())
    path = tmp_path / "surface.jsurf"
    assert main(["import", str(path), "-o", str(tmp_path / "surface.toml")]) == 0
    assert load(tmp_path / "surface.toml").sha256 == scene.sha256


def test_properties_are_those_of_java() -> None:
    text = (
        "\ufeff".encode().decode("latin-1")
        + "# a comment \\\n! another\n\n  a = 1 2 \\\n    3\nb:\\u0041\\t\\=x\r\nc   d=e\n"
        "key\\ with\\:signs=v\nempty\nlast=1\rlast=2"
    )
    assert {key: each.value for key, each in properties_of(Source("", text[3:])).items()} == {
        "a": "1 2 3",
        "b": "A\t=x",
        "c": "d=e",
        "key with:signs": "v",
        "empty": "",
        "last": "2",
    }
    for each in properties_of(Source("", text)).values():
        assert len(each.places) == len(each.value) + 1


FAULTS = [
    ({"surface_equation": "x + w"}, 'line 1, column 22: surface_equation: "w" is unknown'),
    ({"surface_equation": "(x"}, 'line 1, column 18: surface_equation: "(" is not closed'),
    ({"surface_equation": "x \\\n  + y + % z"}, 'line 2, column 9: surface_equation: "%" has no'),
    ({"surface_equation": "x^11 + y"}, "line 1, column 19: surface_equation: degree 11 is not"),
    ({"surface_equation": "x^2 + 9"}, "surface_equation: no point of the surface is in the ball"),
    ({"surface_parameter_a": "one"}, 'surface_parameter_a: "one" is not a number'),
    ({"surface_parameter_2": "1"}, 'surface_parameter_2: "2" is not a name'),
    ({"scale_factor": "1 2"}, "scale_factor: has 2 numbers, not 1"),
    ({"scale_factor": "NaN"}, 'scale_factor: "NaN" is not a number'),
    ({"scale_factor": "40"}, "scale_factor: 40 is not between -9 and 9"),
    ({"rotation_matrix": "1 0 0"}, "rotation_matrix: has 3 numbers, not 16"),
    ({"rotation_matrix": words(np.diag([1, 1, -1, 1.0]))}, "rotation_matrix: it is no rotation"),
    ({"rotation_matrix": words(np.diag([1, 2, 1, 1.0]))}, "rotation_matrix: it is no rotation"),
    ({"camera_transform": words(np.zeros((4, 4)))}, "camera_transform: its last row is not"),
    ({"camera_type": "FISH_EYE"}, 'camera_type: "FISH_EYE" is none of ORTHOGRAPHIC_CAMERA'),
    ({"camera_height": "-2"}, "camera_height: -2 is not between 1e-09 and 1e+09"),
    ({"light_status_2": "DIM"}, 'light_status_2: "DIM" is neither ON nor OFF'),
    ({"light_intensity_2": "-1"}, "light_intensity_2: -1 is not >= 0"),
    ({"front_material_color": "0 0 2"}, "front_material_color: 2 is not between 0 and 1"),
]


@pytest.mark.parametrize(("changed", "fault"), FAULTS)
def test_faults(tmp_path: Path, changed: dict[str, str], fault: str) -> None:
    with pytest.raises(SceneError) as caught:
        opened(tmp_path, text_of(**changed))
    assert caught.value.faults[0].startswith("surface.jsurf: line ")
    assert fault in str(caught.value)


def test_all_faults_are_told_at_once(tmp_path: Path) -> None:
    text = text_of(scale_factor="x", camera_height="0").replace("surface_equation", "equation")
    with pytest.raises(SceneError) as caught:
        opened(tmp_path, text)
    told = [re.sub(r".*?column \d+: ", "", fault) for fault in caught.value.faults]
    assert told == [
        "surface_equation: missing",
        "camera_height: 0 is not between 1e-09 and 1e+09",
        'scale_factor: "x" is not a number',
    ]


def test_a_long_file_is_refused_soon(tmp_path: Path) -> None:
    path = tmp_path / "long.jsurf"
    begin = "#surfer\nsurface_equation="
    start = time.process_time()
    fault = r"^long\.jsurf: line \d+, column \d+: surface_equation"
    for text in ("(", "9", "-", "x\\\n", "\\\n", "\na=b"):
        whole = begin + text * MAX_BYTES
        path.write_text(whole[:MAX_BYTES], encoding="utf-8")
        with pytest.raises(SceneError, match=fault):
            load(path)
    assert time.process_time() - start < 30
    path.write_text(whole, encoding="utf-8")
    with pytest.raises(SceneError, match=r"^long\.jsurf: larger than 256 KiB$"):
        load(path)


def test_any_bytes_are_text_or_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(7).integers(0, 256, 4000, dtype=np.uint8).tobytes()
    (tmp_path / "noise.jsurf").write_bytes(noise)
    with pytest.raises(SceneError, match="surface_equation: missing"):
        load(tmp_path / "noise.jsurf")
    assert decoded(b"surface_title=Fl\xe4che") == "surface_title=Fläche"
    with pytest.raises(SceneError, match="no such file"):
        load(tmp_path / "none.jsurf")
