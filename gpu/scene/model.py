"""The scene: all its tables together, valid by construction.

Everything is checked, and one `SceneError` lists every fault as ``file: key.path: value rule``.
Lengths and positions are in scene units, angles in degrees, colours linear RGB in 0..1. Attribute
names are the TOML keys, except that the arrays of tables ``[[light]]``, ``[[material]]`` and
``[[solid]]`` are the tuples `Scene.lights`, `Scene.materials` and `Scene.solids`, and both kinds of
``key`` tuples called ``keyframes``.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, PrivateAttr, ValidationError, model_validator

from halfstep.errors import SceneError
from halfstep.scene.faults import Fault, Loc, describe, fault, hint, line, show
from halfstep.scene.keys import Animation, CameraKey, SolidKey
from halfstep.scene.placement import unit
from halfstep.scene.solids import SOLID_KINDS, BaseSolid, Bounds, Solid
from halfstep.scene.tables import Accuracy, Ambient, Camera, Image, Light, Material, Volume
from halfstep.scene.values import Sequence, Table, validation_error

FORMAT = 1
# As many as fit uniform memory, of which WebGPU asks a device for 64 KiB.
MAX_LIGHTS = 2048
_TURNTABLE = Animation(orbit_degrees=360.0)


def _known_format(value: int) -> int:
    if value != FORMAT:
        raise fault(f"{show(value)} is not {FORMAT}")
    return value


class Scene(Table):
    """A whole scene, valid by construction. Build it with `load` or `Scene.from_dict`."""

    format: Annotated[int, AfterValidator(_known_format)]
    title: str = ""
    camera: Camera
    animation: Animation | None = None
    image: Image = Image()
    accuracy: Accuracy = Accuracy()
    volume: Volume | None = None
    ambient: Ambient = Ambient()
    lights: Annotated[Sequence[Light], Field(max_length=MAX_LIGHTS)] = Field(
        default=(), alias="light"
    )
    materials: Sequence[Material] = Field(default=(), alias="material")
    solids: Annotated[Sequence[Solid], Field(min_length=1)] = Field(alias="solid")

    _name: str = PrivateAttr(default="scene")

    @model_validator(mode="after")
    def _names_agree(self) -> Self:
        faults = _name_faults(
            [(material.name, None) for material in self.materials],
            [(solid.name, solid.material) for solid in self.solids],
        )
        if faults:
            raise validation_error("Scene", faults)
        return self

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "scene") -> "Scene":
        """A scene from the mapping a TOML file holds.

        Args:
            mapping: the top-level table; arrays may be lists, tuples or NumPy arrays, numbers those
                of Python or NumPy.
            source: what the faults are said to be in, usually a file name; its stem becomes
                `name`.

        Raises:
            SceneError: with every fault of the scene.
        """
        return cls._from_plain(plain(mapping), source)

    @classmethod
    def _from_plain(cls, mapping: dict[str, Any], source: str) -> "Scene":
        """`from_dict` of a mapping that holds nothing of NumPy."""
        try:
            scene = cls.model_validate(mapping)
        except ValidationError as error:
            faults = described(error)
            # Names are compared once all tables are valid; a faulty one must not hide them.
            faults += _name_faults(*_raw_names(mapping))
            raise SceneError(
                *dict.fromkeys(line(source, loc, text) for loc, text in faults)
            ) from None
        scene._name = Path(source).stem  # noqa: SLF001 - its own class
        return scene

    @property
    def name(self) -> str:
        """Stem of the file the scene came from, or ``scene``."""
        return self._name

    @property
    def sha256(self) -> str:
        """Hex digest of the scene's canonical JSON; spelling out a default does not change it."""
        return self.sha256_with(self.solids_sha256)

    @property
    def solids_sha256(self) -> str:
        """Hex digest of the solids alone, which is most of the work where they are many."""
        return _digest(self.model_dump(by_alias=True, include={"solids"}))

    def sha256_with(self, solids_sha256: str) -> str:
        """`sha256`, given that of the solids: scenes that differ in their cameras share it."""
        content = self.model_dump(by_alias=True, exclude={"solids"})
        return _digest({**content, "solid": solids_sha256})

    def effective_lights(self) -> tuple[Light, ...]:
        """The lights to shade with: where the scene has none, a white one from the camera."""
        if self.lights:
            return self.lights
        towards = unit(np.subtract(self.camera.center, self.camera.look_at))
        return (Light(direction=(float(towards[0]), float(towards[1]), float(towards[2]))),)

    def effective_animation(self) -> Animation:
        """How the scene moves: where it does not say, the camera turns once about look_at."""
        return self.animation or _TURNTABLE

    def material_of(self, solid: BaseSolid) -> Material:
        """The finish of one of its solids; a bare color is a matt material."""
        if solid.color is not None:
            return Material(name="color", color=solid.color)
        return next(each for each in self.materials if each.name == solid.material)


def _digest(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


_Named = tuple[object, object]


def _raw_names(mapping: Mapping[str, Any]) -> tuple[list[_Named], list[_Named]]:
    """(name, material) of all materials and solids in a mapping that may be faulty anywhere."""

    def named(key: str) -> list[_Named]:
        tables = mapping.get(key, ())
        return [
            (table.get("name"), table.get("material"))
            if isinstance(table, Mapping)
            else (None,) * 2
            for table in (tables if isinstance(tables, list | tuple) else (None,))
        ]

    return named("material"), named("solid")


def _name_faults(materials: list[_Named], solids: Iterable[_Named]) -> list[Fault]:
    """Names given twice and materials that do not exist; what is no name is passed over.

    Of a material without a name nobody can say that it is not the one meant.
    """
    faults: list[Fault] = []
    known: dict[str, dict[str, int]] = {"material": {}, "solid": {}}
    all_named = all(isinstance(name, str) and name for name, _ in materials)
    for key, tables in (("material", materials), ("solid", solids)):
        first = known[key]
        for index, (name, material) in enumerate(tables):
            if isinstance(name, str) and name and first.setdefault(name, index) != index:
                text = f"{show(name)} is already the name of {key}[{first[name]}]"
                faults.append(((key, index, "name"), text))
            if (
                all_named
                and isinstance(material, str)
                and material
                and material not in known["material"]
            ):
                known_ones = hint(material, known["material"], "the scene has")
                text = f"{show(material)} is not a material of the scene; {known_ones}"
                faults.append(((key, index, "material"), text))
    return faults


# Scene tables by where they stand: the keys of a path without indices, with a solid's kind.
_TABLES: dict[tuple[str, ...], type[BaseModel]] = {
    (): Scene,
    ("camera",): Camera,
    ("animation",): Animation,
    ("animation", "key"): CameraKey,
    ("image",): Image,
    ("accuracy",): Accuracy,
    ("volume",): Volume,
    ("ambient",): Ambient,
    ("light",): Light,
    ("material",): Material,
    ("solid", "plane", "bounds"): Bounds,
    **{("solid", kind.model_fields["kind"].default): kind for kind in SOLID_KINDS},
    **{("solid", kind.model_fields["kind"].default, "key"): SolidKey for kind in SOLID_KINDS},
}


def described(error: ValidationError, root: Loc = ()) -> list[Fault]:
    """The faults of a validation with their key paths, in the order of the types' fields.

    Args:
        error: from validating a table of the scene.
        root: path of that table; empty for the scene itself.
    """
    errors = error.errors(include_url=False)
    above = {each["loc"][:length] for each in errors for length in range(len(each["loc"]))}
    return [
        describe({**each, "loc": (*root, *each["loc"])}, _TABLES)
        for each in errors
        # Pydantic counts only the valid entries of an array.
        if not (each["type"] == "too_short" and each["loc"] in above)
    ]


def plain(value: Any) -> Any:
    """A value as TOML would give it, with Python's numbers and lists in place of NumPy's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value
