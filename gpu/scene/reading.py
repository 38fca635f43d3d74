"""Scenes from files, from names and from mappings."""

import importlib.resources
import os
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from halfstep.errors import SceneError
from halfstep.scene.faults import hint, one_line, show, syntax_fault
from halfstep.scene.model import Scene
from halfstep.text import decoded

# What stands for a scene: a Scene, a file, the name of a bundled scene, or a file's mapping.
SceneLike = Scene | str | os.PathLike[str] | Mapping[str, Any]


def load(path_or_name: str | os.PathLike[str]) -> Scene:
    """A scene from a TOML file, or a bundled one by its name.

    Args:
        path_or_name: a path that ends in ``.toml``, or one of `bundled_scenes`.

    Raises:
        SceneError: there is no such scene, or it has faults, all of which the error lists.
    """
    if not isinstance(path_or_name, str | os.PathLike):
        raise SceneError(f"scene: {show(path_or_name)} is not a path or a bundled name")
    given = os.fspath(path_or_name)
    path = Path(given)
    if path.suffix == ".toml":
        return _parse(path.name, _read(path, given))
    bundled = _bundled_files()
    if given in bundled:
        return _parse(f"{given}.toml", bundled[given].read_bytes())
    with suppress(OSError):  # as of too long a name, up to Python 3.13
        if path.exists():
            raise SceneError(f"{given}: not a scene file; its name must end in .toml")
    meant = hint(given, sorted(bundled), "bundled are")
    raise SceneError(
        f"{given}: no such file or bundled scene; {meant} (`halfstep scenes` lists them all)"
    )


def as_scene(given: SceneLike) -> Scene:
    """The scene that ``given`` stands for.

    Args:
        given: a `Scene`, which is returned as it is; what `load` takes; or what `Scene.from_dict`
            takes, whose faults read ``scene: solid[2].radius: -1 is not > 0``.

    Raises:
        SceneError: there is no such scene, or it has faults, all of which the error lists.
    """
    if isinstance(given, Scene):
        return given
    if isinstance(given, str | os.PathLike):
        return load(given)
    if isinstance(given, Mapping):
        return Scene.from_dict(given)
    raise SceneError(f"scene: {show(given)} is not a scene, a path, a bundled name or a mapping")


def bundled_scenes() -> dict[str, str]:
    """Names of the bundled scenes and their titles, sorted by name."""
    return {
        name: str(tomllib.loads(file.read_text(encoding="utf-8")).get("title", ""))
        for name, file in sorted(_bundled_files().items())
    }


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scene file. Rules between two keys are not in it."""
    schema = Scene.model_json_schema(by_alias=True)
    # Only a scene from Python may leave `format` out.
    schema["required"] = ["format", *schema["required"]]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _bundled_files() -> dict[str, Traversable]:
    folder = importlib.resources.files("halfstep.scenes")
    return {
        file.name.removesuffix(".toml"): file
        for file in folder.iterdir()
        if file.name.endswith(".toml")
    }


def _read(path: Path, given: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        # The path holds a NUL.
        raise SceneError(f"{given!r}: cannot be read: {error}") from None


def _parse(source: str, content: bytes) -> Scene:
    """A scene from the bytes of a TOML file that faults call `source`."""
    try:
        text = decoded(content)
    except ValueError as error:
        raise SceneError(f"{source}: {error}") from None
    try:
        # tomllib gives no values of NumPy.
        return Scene._from_plain(tomllib.loads(text), source)  # noqa: SLF001 - of this room
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{source}: {syntax_fault(str(error), text)}") from None
    except RecursionError:
        raise SceneError(f"{source}: nested too deeply") from None
    except ValueError as error:
        # An integer has more digits than Python converts.
        raise SceneError(f"{source}: {one_line(str(error))}") from None
