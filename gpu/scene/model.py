"""The scene: all its tables together, valid by construction.

Everything is checked, and one `SceneError` lists every fault as ``file: key.path: value rule``.
Lengths and positions are in scene units, angles in degrees, colours linear RGB in 0..1. Attribute
names are the TOML keys, except that the arrays of tables ``[[light]]``, ``[[material]]``,
``[[solid]]``, ``[[cell]]`` and so on are the tuples `Scene.lights`, `Scene.materials`,
`Scene.solids` and `Scene.cells`, and all kinds of ``key`` tuples called ``keyframes``.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from halfstep.errors import SceneError
from halfstep.scene.bases import BaseSolid
from halfstep.scene.copies import Layout
from halfstep.scene.faults import Fault, fault, line, show
from halfstep.scene.gathering import with_what_is_named
from halfstep.scene.groups import Cell, Fragment
from halfstep.scene.keys import Animation
from halfstep.scene.limits import (
    algebraic_faults,
    has_algebraic,
    limit_faults,
    mirror_faults,
    shadow_faults,
    shadow_format_faults,
)
from halfstep.scene.names import get, name_faults
from halfstep.scene.placement import unit
from halfstep.scene.solids import Solid
from halfstep.scene.tables import (
    VIEW_KEYS,
    Accuracy,
    Ambient,
    Camera,
    Image,
    Light,
    Material,
    Volume,
)
from halfstep.scene.values import Sequence, Table, described, plain, validation_error
from halfstep.scene.writing import text_of

FORMAT = 1
# Every scene has one of these.
_SHOWN = ("solid", "cell", "place", "lattice")
# Context of a validation whose caller checks the names itself.
_OF_A_FILE: Mapping[str, object] = {}
# Keys that are left out of the digest of a scene without them.
_NEW_KEYS = ("surface", "part", "cell", "group", "place", "lattice")
_NEW_CAMERA_KEYS = {"orthographic_height"}
_NEW_SOLID_KEYS = {"casts_shadow"}
_NEW_LIGHT_KEYS = {"shadows"}
# So many lights fit the 64 KiB of uniform memory that WebGPU demands of a device.
MAX_LIGHTS = 2048
_TURNTABLE = Animation(orbit_degrees=360.0)


def _known_format(value: int) -> int:
    if value != FORMAT:
        raise fault(f"{show(value)} is not {FORMAT}")
    return value


class _Tables(Table):
    """The tables of a scene but its solids and those that a group has too."""

    format: Annotated[int, AfterValidator(_known_format)] = FORMAT
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
    solids: Sequence[Solid] = Field(default=(), alias="solid")

    @field_validator("animation")
    @classmethod
    def _moves_this_camera(
        cls, animation: Animation | None, info: ValidationInfo
    ) -> Animation | None:
        camera = info.data.get("camera")
        if animation is None or camera is None:
            return animation
        own, other = VIEW_KEYS if camera.orthographic_height is None else VIEW_KEYS[::-1]
        faults = [
            (("key", index, other), f"is of another camera than one with {own}")
            for index, key in enumerate(animation.keyframes)
            if getattr(key, other) is not None
        ]
        if faults:
            raise validation_error("animation", faults)
        return animation


class Scene(Fragment, _Tables):
    """A whole scene, valid by construction: made by `load`, `Scene.from_dict`, or from tables.

    ``Scene(camera=Camera(…), solids=[…], cells=[…])`` raises a `SceneError` with all its faults.
    """

    source: ClassVar[str] = "scene"

    if TYPE_CHECKING:

        def __init__(self, *, camera: Camera, **tables: Any) -> None: ...

    _name: str = PrivateAttr(default="scene")

    @model_validator(mode="after")
    def _agrees(self, info: ValidationInfo) -> Self:
        if info.context is not _OF_A_FILE:
            faults = self.other_faults(self) or self._limit_faults()
            if faults:
                raise validation_error("Scene", faults)
        return self

    @property
    def has_algebraic(self) -> bool:
        """Whether a torus or a formula bounds a solid or a cell."""
        return has_algebraic(self, self.solids)

    def _limit_faults(self) -> list[Fault]:
        return [
            *limit_faults(self),
            *shadow_faults(self, [each.shadows for each in self.lights]),
            *shadow_format_faults(
                self, [each.shadows for each in self.lights], self.solids, self.accuracy
            ),
            *algebraic_faults(self, self.solids, self.accuracy),
            *mirror_faults(self, self.materials, self.image, self.accuracy),
        ]

    @classmethod
    def other_faults(cls, given: object) -> list[Fault]:
        """Faults between the tables of a scene, or of the mapping it was to be made from."""
        try:
            given = with_what_is_named(given) if isinstance(given, Mapping) else given
        except PydanticCustomError:
            return []
        faults = name_faults(given)
        if not any(get(given, key) for key in _SHOWN):
            faults.append(((), f"has none of {', '.join(_SHOWN)}; one must be given"))
        return faults

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "scene") -> "Scene":
        """A scene from the mapping a TOML file holds.

        Args:
            mapping: the top-level table; arrays may be lists, tuples or NumPy arrays, numbers those
                of Python or NumPy.
            source: the faults begin with it; usually a file name, whose stem becomes
                `name`.

        Raises:
            SceneError: with every fault of the scene.
        """
        return cls._from_plain(plain(mapping), source)

    @classmethod
    def _from_plain(cls, mapping: dict[str, Any], source: str) -> "Scene":
        """`from_dict` of a mapping that holds nothing of NumPy."""
        faults: list[Fault] = []
        if "format" not in mapping:
            faults.append((("format",), f"missing; the only format is {FORMAT}"))
        scene = None
        try:
            scene = cls.model_validate(mapping, by_name=False, context=_OF_A_FILE)
        except ValidationError as error:
            faults += described(error, cls)
        # Only the mapping tells the columns of formulas in the file; the scene has new texts.
        faults += cls.other_faults(mapping)
        if scene is not None and not faults:
            faults += scene._limit_faults()  # noqa: SLF001 - its own class
        if scene is None or faults:
            raise SceneError(*dict.fromkeys(line(source, loc, text) for loc, text in faults))
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
        """Hex digest of the solids alone; with many solids it takes most of the time."""
        new = set() if any(not each.casts_shadow for each in self.solids) else _NEW_SOLID_KEYS
        left_out = {"solids": {"__all__": new}}
        return _digest(self.model_dump(by_alias=True, include={"solids"}, exclude=left_out))

    def sha256_with(self, solids_sha256: str) -> str:
        """`sha256`, given `solids_sha256`, which scenes that differ in their cameras share."""
        new: dict[str, Any] = {"solids": True}
        if self.camera.orthographic_height is None:
            new["camera"] = _NEW_CAMERA_KEYS
        if self.animation is not None and self.camera.orthographic_height is None:
            new["animation"] = {"keyframes": {"__all__": _NEW_CAMERA_KEYS}}
        if not any(light.shadows for light in self.lights):
            new["lights"] = {"__all__": _NEW_LIGHT_KEYS}
        content = self.model_dump(by_alias=True, exclude=new)
        _forget_shadows(content)
        content = {key: each for key, each in content.items() if each or key not in _NEW_KEYS}
        for material in content["material"]:
            if material["id"] is None:
                del material["id"]
            if not material["reflection"]:
                del material["reflection"]
        if content["image"]["bounces"] == 1:
            del content["image"]["bounces"]
        if self.image.color_by == "material":
            del content["image"]["color_by"]
        return _digest({**content, "solid": solids_sha256})

    def effective_lights(self) -> tuple[Light, ...]:
        """The lights to shade with; if the scene has none, a white light from the camera."""
        if self.lights:
            return self.lights
        towards = unit(np.subtract(self.camera.center, self.camera.look_at))
        return (Light(direction=(float(towards[0]), float(towards[1]), float(towards[2]))),)

    def effective_animation(self) -> Animation:
        """The scene's animation; without one, the camera turns once about look_at."""
        return self.animation or _TURNTABLE

    def material_of(self, thing: BaseSolid | Cell) -> Material:
        """The material of a solid, cell or part that has one; a bare color is a matt material."""
        if thing.color is not None:
            return Material(name="color", color=thing.color)
        return next(each for each in self.materials if each.name == thing.material)

    def layout(self) -> Layout:
        """The copies of its groups."""
        return Layout(self)

    def to_toml(self) -> str:
        """The text of a scene file that loads to an equal scene; defaults are left out."""
        return text_of(self)


def _forget_shadows(content: dict[str, Any]) -> None:
    """Remove ``casts_shadow`` from a dump: that of parts, and that of cells if it is true."""
    for part in content["part"]:
        del part["casts_shadow"]
    for cell in content["cell"]:
        if cell["casts_shadow"]:
            del cell["casts_shadow"]
    for group in content["group"]:
        _forget_shadows(group)


def _digest(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
