"""Reads surfaces of SURFER: a formula in a ball, with camera, lights and a finish.

A ``.jsurf`` file is a Java properties file. It uses three spaces: those of the camera, of the ball,
whose radius is 1, and of the formula. Scenes use the last one, so that the formula stays unchanged
and the ball gets another radius.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.errors import SceneError, UsageError
from halfstep.models.look import Look, Table, camera_of
from halfstep.models.source import Source
from halfstep.scene import Scene
from halfstep.scene.expression import CONSTANTS
from halfstep.scene.faults import show
from halfstep.scene.hues import linear
from halfstep.scene.values import LARGEST, Array

# SURFER's pictures are square.
SIDE = 640
LIGHTS = 8
MOST_SHININESS = 1024
# The largest error of a rotation: SURFER accumulates it in single precision while a user turns it.
ROUNDING = 1e-3
CAMERAS = ("ORTHOGRAPHIC_CAMERA", "PERSPECTIVE_CAMERA")
# The default camera, one radius before the middle of the ball.
_BEFORE = "1 0 0 0  0 1 0 0  0 0 1 -1  0 0 0 1"
_IDENTITY = "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1"
_ESCAPES = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}
_KEY = re.compile(r"(?:[^\\=:\s]|\\.)*", re.DOTALL)
_BETWEEN = re.compile(r"[ \t\f]*[=:]?[ \t\f]*")
_PARAMETER = "surface_parameter_"


class Property(NamedTuple):
    """A value, and the indices in the text of each of its characters and of its end."""

    value: str
    places: list[int]


# A formula has at most 4096 characters, and a file some tens of keys.
MAX_BYTES = 1 << 18


def decoded(content: bytes) -> str:
    """The text of a properties file, which is Latin-1 with escapes for all other characters."""
    return content.decode("latin-1")


def scene_of(source: Source, look: Look) -> Scene:
    """The scene that shows a surface as SURFER does.

    Both sides of a surface get the colour of its front.

    Raises:
        SceneError: the file has faults, all of which the message lists.
        UsageError: an option does not apply to these files.
    """
    for option, value in (
        ("--color-by", look.color_by),
        ("--hide", look.hide),
        ("--only", look.only),
        ("--clip", look.clip),
        ("--plot", look.plot is not None),
    ):
        if value:
            raise UsageError(f"{option}: is not for surfaces of SURFER")
    return _Reading(source).scene(look)


def properties_of(source: Source) -> dict[str, Property]:
    """The properties of a text by key. If a key occurs again, the last one counts."""
    found: dict[str, Property] = {}
    for text, places in _lines(source.text):
        key = _KEY.match(text)
        assert key is not None
        between = _BETWEEN.match(text, key.end())
        assert between is not None
        name = _unescaped(key[0], places[: key.end() + 1]).value
        found[name] = _unescaped(text[between.end() :], places[between.end() :])
    return found


def _lines(text: str) -> Iterator[tuple[str, list[int]]]:
    """The lines that are not empty or comments, continued lines joined, and each one's indices."""
    parts: list[str] = []
    places = [0]
    for match in re.finditer(r"[^\r\n]*(?:\r\n|\r|\n|$)", text):
        line = match[0].rstrip("\r\n")
        start = len(line) - len(line.lstrip(" \t\f"))
        if not parts and line[start : start + 1] in ("", "#", "!"):
            continue
        # An even number of backslashes is left before, so those of this line alone decide.
        is_continued = (len(line) - len(line[start:].rstrip("\\")) - start) % 2
        places[-1:] = range(match.start() + start, match.start() + len(line) + 1 - is_continued)
        parts += filter(None, [line[start : len(line) - is_continued]])
        if not is_continued:
            yield "".join(parts), places
            parts, places = [], [0]
    if parts:
        yield "".join(parts), places


def _unescaped(text: str, places: list[int]) -> Property:
    characters: list[str] = []
    kept: list[int] = []
    for match in re.finditer(r"\\u([0-9a-fA-F]{4})|\\(.)|(.)", text, re.DOTALL):
        code, escaped, plain = match.groups()
        characters.append(chr(int(code, 16)) if code else _ESCAPES.get(escaped, escaped) or plain)
        kept.append(places[match.start()])
    return Property("".join(characters), [*kept, places[len(text)]])


def _is_constant(name: str) -> bool:
    return name in CONSTANTS


def _renamed(formula: Property, name: str, other: str) -> Property:
    """A formula with the name ``name`` replaced by ``other``, except in exponents of numbers."""
    value, places = formula
    for match in reversed([*re.finditer(rf"(?<![\w.]){name}(?!\w)", value)]):
        start, end = match.span()
        value = value[:start] + other + value[end:]
        places = places[:start] + len(other) * [places[start]] + places[end:]
    return Property(value, places)


@dataclass(frozen=True)
class _Finish:
    """The reflection of a material.

    Attributes:
        color: sRGB.
        ambient: the part of ambient light that it reflects.
        diffuse: the part of the lights' light that it reflects diffusely.
        specular: the part of the lights' light in highlights.
        shininess: the exponent of highlights.
    """

    color: list[float]
    ambient: float
    diffuse: float
    specular: float
    shininess: float


class _Reading:
    """Reads a file, and records its faults in its source."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._properties = properties_of(source)
        self._formula = Property("", [])

    def scene(self, look: Look) -> Scene:
        """The scene of the file, seen by the requested camera.

        Raises:
            SceneError: the file has faults, all of which the message lists.
        """
        name = self._source.name
        to_ball = self._matrix("transform_matrix") @ self._matrix("rotation_matrix")
        to_ball = to_ball @ self._camera_matrix()
        to_formula = self._matrix("surface_transform_matrix")
        scale = self._number("scale_factor", 0.0, low=-9.0, high=9.0)
        to_formula[:3, :3] *= 10.0**scale
        radius = self._similar(to_formula, "surface_transform_matrix")
        if np.abs(to_formula[:3, 3]).max() > ROUNDING * radius:
            self._fault("surface_transform_matrix", "it moves, which is not read")
        whole = to_formula @ to_ball
        size = self._similar(to_ball, "rotation_matrix") * radius
        finish = self._finish()
        tables: Table = {
            "format": 1,
            "title": self._text("surface_title", name),
            "ambient": {"color": 3 * [float(linear(finish.ambient))]},
            "image": {
                "width": SIDE,
                "height": SIDE,
                "background": linear(self._color("background_color", 1.0)).tolist(),
            },
            "light": self._lights(whole, finish),
            "material": [
                {
                    "name": "front",
                    "color": linear(finish.color).tolist(),
                    "specular": min(finish.specular / (finish.diffuse or 1.0), 1.0),
                    "shininess": min(max(round(finish.shininess), 1), MOST_SHININESS),
                }
            ],
            "solid": [self._solid(radius)],
        }
        camera = self._camera(whole, size)
        self._source.check()
        box = np.array([3 * [-radius], 3 * [radius]])
        tables["camera"] = camera_of(look, box, camera)
        try:
            return Scene.from_dict(tables, name)
        except SceneError as error:
            raise SceneError(*map(self._as_in_file, error.faults)) from None

    # ---------------------------------------------------------------------------- parts

    def _solid(self, radius: float) -> Table:
        """The table of the surface in its ball."""
        if "surface_equation" not in self._properties:
            self._source.fault(0, "surface_equation: missing")
        parameters = {
            key.removeprefix(_PARAMETER): self._number(key, 0.0, -LARGEST, LARGEST)
            for key in self._properties
            if key.startswith(_PARAMETER)
        }
        formula = self._properties.get("surface_equation", Property("x", []))
        for name in filter(_is_constant, [*parameters]):
            # Formulas of scenes have a constant of this name, so the parameter gets another name.
            other = next(new for k in range(1, 99) if (new := name + k * "_") not in parameters)
            formula = _renamed(formula, name, other)
            parameters[other] = parameters.pop(name)
        self._formula = formula
        return {
            "kind": "implicit",
            "material": "front",
            "formula": formula.value,
            "parameters": parameters,
            "bounds": {"radius": radius},
            "sheet": True,
        }

    def _camera_matrix(self) -> Array:
        """The matrix (4, 4) from camera space to the space on which ``rotation_matrix`` acts."""
        matrix = self._matrix("camera_transform", _BEFORE)
        self._similar(matrix, "camera_transform")
        if not abs(np.linalg.det(matrix)) > 0:
            return np.eye(4)
        return np.asarray(np.linalg.inv(matrix))

    def _camera(self, whole: Array, size: float) -> Table:
        """The table of the camera, in the space of the formula."""
        kind = self._text("camera_type", CAMERAS[0])
        if kind not in CAMERAS:
            self._fault("camera_type", f"{show(kind)} is none of {', '.join(CAMERAS)}")
        height = self._number("camera_height", 2.0, low=1e-9, high=1e9)
        angle = self._number("camera_fov_y", 60.0, low=1e-3, high=179.0)
        center = whole[:3, 3]
        table: Table = {
            "center": center.tolist(),
            "look_at": (center - whole[:3, 2]).tolist(),
            "up": (whole[:3, 1] / size).tolist(),
        }
        if kind == CAMERAS[0]:
            return {**table, "orthographic_height": height * size}
        return {**table, "fov_degrees": angle}

    def _lights(self, whole: Array, finish: _Finish) -> list[Table]:
        """The tables of the lights that are on. The file gives their positions in camera space."""
        found = []
        for number in range(LIGHTS):
            key = f"light_status_{number}"
            status = self._text(key, "OFF").upper()
            if status not in ("ON", "OFF"):
                self._fault(key, f"{show(status)} is neither ON nor OFF")
            place = self._numbers(f"light_position_{number}", [0.0, 0.0, 0.0])
            color = self._color(f"light_color_{number}", 1.0)
            power = self._number(f"light_intensity_{number}", 1.0, low=0.0) * finish.diffuse
            if status == "ON" and power > 0:
                position = whole[:3, :3] @ place + whole[:3, 3]
                colors = [min(power * each, 1.0) for each in color]
                found.append({"position": position.tolist(), "color": colors})
        return found

    def _finish(self) -> _Finish:
        # Older files misspell this key.
        older = "front_material_specular_iIntensity"
        specular = older if older in self._properties else "front_material_specular_intensity"
        return _Finish(
            self._color("front_material_color", 0.8),
            self._number("front_material_ambient_intensity", 0.4, low=0.0, high=1.0),
            self._number("front_material_diffuse_intensity", 0.8, low=0.0, high=1.0),
            self._number(specular, 0.5, low=0.0, high=1.0),
            self._number("front_material_shininess", 30.0, low=0.0),
        )

    # ---------------------------------------------------------------------------- values

    def _text(self, key: str, otherwise: str) -> str:
        return self._properties[key].value if key in self._properties else otherwise

    def _number(
        self, key: str, otherwise: float, low: float = -math.inf, high: float = math.inf
    ) -> float:
        [number] = self._numbers(key, [otherwise], low, high)
        return number

    def _color(self, key: str, otherwise: float) -> list[float]:
        return self._numbers(key, 3 * [otherwise], 0.0, 1.0)

    def _matrix(self, key: str, otherwise: str = _IDENTITY) -> Array:
        """A matrix (4, 4), given by rows."""
        numbers = self._numbers(key, [float(word) for word in otherwise.split()])
        matrix = np.array(numbers).reshape(4, 4)
        if not np.array_equal(matrix[3], [0, 0, 0, 1]):
            self._fault(key, "its last row is not 0 0 0 1")
            return np.eye(4)
        return matrix

    def _numbers(
        self,
        key: str,
        otherwise: list[float],
        low: float = -math.inf,
        high: float = math.inf,
    ) -> list[float]:
        """The numbers of a key, or ``otherwise``, which also sets how many there must be."""
        if key not in self._properties:
            return otherwise
        words = self._properties[key].value.split()
        if len(words) != len(otherwise):
            self._fault(key, f"has {len(words)} numbers, not {len(otherwise)}")
            return otherwise
        found = []
        for word in words:
            try:
                number = float(word)
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                self._fault(key, f"{show(word)} is not a number")
                return otherwise
            if not low <= number <= high:
                limits = f">= {low:g}" if math.isinf(high) else f"between {low:g} and {high:g}"
                self._fault(key, f"{word} is not {limits}")
                return otherwise
            found.append(number)
        return found

    def _similar(self, matrix: Array, key: str) -> float:
        """The scale of a matrix that scales, turns and moves. Any other matrix is a fault."""
        linear_part = matrix[:3, :3]
        scale = float(np.cbrt(np.linalg.det(linear_part)))
        if scale > 0:
            rest = linear_part @ linear_part.T / scale**2 - np.eye(3)
            if np.abs(rest).max() <= ROUNDING:
                return scale
        self._fault(key, "it is no rotation, enlarged or not")
        return 1.0

    def _fault(self, key: str, what: str) -> None:
        place = self._properties[key].places[0] if key in self._properties else 0
        self._source.fault(place, f"{key}: {what}")

    def _as_in_file(self, fault: str) -> str:
        """A fault of the scene, rewritten as a fault of the file."""
        places = self._formula.places
        match = re.search(r"solid\[0\]\.(\w+)\.?(\w*): (?:column (\d+): )?(.*)", fault, re.DOTALL)
        if match is None:
            return fault
        key, name, column, what = match.groups()
        if key == "parameters":
            key = f"{_PARAMETER}{name}"
            return self._source.line(self._properties[key].places[0], f"{key}: {what}")
        if key == "bounds":
            what = "no point of the surface is in the ball"
        at = places[min(int(column or 1) - 1, len(places) - 1)]
        return self._source.line(at, f"surface_equation: {what}")
