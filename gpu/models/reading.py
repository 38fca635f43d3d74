"""Reads scenes from files of any type: Halfstep's, and those of other programs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from halfstep.errors import UsageError
from halfstep.models import openmc_scene, openscad_scene, surfer
from halfstep.models.findings import Report
from halfstep.models.look import Look
from halfstep.models.openmc_check import RAYS, Checker, box_around
from halfstep.models.openmc_plots import read_plot
from halfstep.models.openmc_reading import read_geometry
from halfstep.models.shape import scene_of
from halfstep.models.source import read_source
from halfstep.scene import Scene, SceneLike, reading

# Endings of the files of other programs.
ENDINGS = (".xml", ".csg", ".jsurf")


def is_model(path_or_name: object) -> bool:
    """Whether a path names a file of another program."""
    return (
        isinstance(path_or_name, str | os.PathLike) and Path(path_or_name).suffix.lower() in ENDINGS
    )


def is_geometry(path_or_name: object) -> bool:
    """Whether a path names a geometry of OpenMC, which can be checked for overlaps."""
    return is_model(path_or_name) and Path(str(path_or_name)).suffix.lower() == ".xml"


def load(
    path_or_name: str | os.PathLike[str],
    look: Look | None = None,
    begin: Callable[[str], None] = lambda _: None,
) -> Scene:
    """Load a scene from a file, or a bundled scene by its name.

    Args:
        path_or_name: a path that ends in ``.toml`` or in an ending of another program's files, such
            as ``geometry.xml``; or one of `bundled_scenes`.
        look: the look of a file of another program.
        begin: is called with each work that begins, such as "reading geometry.xml".

    Raises:
        SceneError: the scene is not found, or it has faults, all of which the message lists.
        UsageError: the file cannot take an option of ``look``. Files of Halfstep take none.
    """
    if is_model(path_or_name):
        path, given, seen = Path(path_or_name), os.fspath(path_or_name), look or Look()
        making = f"making the scene of {path.name}"
        begin(f"reading {path.name}")
        match path.suffix.lower():
            case ".csg":
                source = read_source(path, given)
                begin(making)
                model = openscad_scene.scene_tables(source, seen)
            case ".jsurf":
                text = read_source(path, given, surfer.decoded, surfer.MAX_BYTES)
                return surfer.scene_of(text, seen)
            case _:
                geometry = read_geometry(path, given)
                plot = None if seen.plot is None else read_plot(path, given, seen.plot)
                begin(making)
                model = openmc_scene.scene_tables(geometry, seen, plot)
        return scene_of(model, seen)
    if look is not None and look != Look():
        raise UsageError(
            f"{path_or_name}: sets its own look; these options are for files of other programs"
        )
    begin(f"reading {path_or_name}")
    return reading.load(path_or_name)


def as_scene(given: SceneLike) -> Scene:
    """The scene of ``given``; see `halfstep.scene.as_scene`. Also reads files of other programs."""
    if isinstance(given, str | os.PathLike) and is_model(given):
        return load(given)
    return reading.as_scene(given)


def check(
    path: str | os.PathLike[str],
    *,
    rays: int = RAYS,
    points: int = 0,
    begin: Callable[[str], None] = lambda _: None,
) -> Report:
    """Find overlaps and gaps in a geometry of OpenMC.

    Args:
        path: path of the file.
        rays: from each of six sides come rays × rays rays.
        points: the number of random points in the bounding box to test as well.
        begin: is called with each work that begins.

    Raises:
        SceneError: the text has faults, all of which the message lists.
    """
    name = Path(path).name
    begin(f"reading {name}")
    geometry = read_geometry(Path(path), os.fspath(path))
    begin(f"checking {name}")
    return Checker(geometry, box_around(geometry)).check(rays, points)
