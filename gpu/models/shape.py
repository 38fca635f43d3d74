"""Converts a model's tables to a scene: adds camera and lights, bounds it, hides empty cells."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from halfstep.errors import SceneError
from halfstep.host.formulas import normal_form
from halfstep.host.higher import higher_of
from halfstep.host.merging import cells_with_points
from halfstep.models.look import PLACE, Clip, Look, Table, both, camera_of, lights_of, plane
from halfstep.scene import Fragment, Scene
from halfstep.scene.formula import Formula, Sense
from halfstep.scene.values import LARGEST, Array

# Along an axis without an end, this part of the model's size is shown on each side of the middle.
OPEN_PART = 0.25
# The volume is larger than the model by this part of its size, so no face lies in a base plane.
VOLUME_MARGIN = 2.0**-10
# Cells of a model touch everywhere. A ray near such a place may cross a cell within one step, so
# steps must be small.
TOLERANCE_PIXELS = 0.02
NOTHING = "nothing of it is shown"
FragmentT = TypeVar("FragmentT", bound=Fragment)


@dataclass(frozen=True)
class Model:
    """The tables of a scene without camera and lights.

    Attributes:
        name: name of the file, for people.
        tables: the tables of the scene by their keys.
        box: (2, 3), bounds everything that is shown.
        camera: keys of the file's camera; None if it has none.
    """

    name: str
    tables: Table
    box: Array
    camera: Table | None = None


def scene_of(model: Model, look: Look) -> Scene:
    """The scene of a model, with the requested camera, by default a view from three quarters.

    Raises:
        SceneError: there is more in it than a scene may hold, it is too large, or nothing is shown.
    """
    if not np.abs(model.box).max() <= LARGEST:
        raise SceneError(f"{model.name}: it is not within {LARGEST:g} of its origin")
    camera = camera_of(look, model.box, model.camera)
    margin = VOLUME_MARGIN * max(float(np.ptp(model.box, axis=0).max()), 1e-9)
    mapping: Table = {
        "format": 1,
        "title": model.name,
        "camera": camera,
        "light": lights_of(camera),
        "ambient": {"color": [0.12, 0.12, 0.12]},
        "image": {"background": [1.0, 1.0, 1.0]},
        "accuracy": {"tolerance_pixels": TOLERANCE_PIXELS},
        "volume": {
            "min": (model.box[0] - margin).tolist(),
            "max": (model.box[1] + margin).tolist(),
        },
        **{key: tables for key, tables in model.tables.items() if tables},
    }
    if look.color_by == PLACE:
        mapping["image"] = {**mapping["image"], "color_by": PLACE}
    scene = without_empty(Scene.from_dict(mapping, model.name))
    if not _is_something_shown(scene):
        raise SceneError(f"{model.name}: {NOTHING}")
    return scene


def without_empty(fragment: FragmentT) -> FragmentT:
    """A scene or group in which empty cells are invisible.

    A clip may leave nothing of a cell, or only a face without thickness.
    """
    groups = tuple(map(without_empty, fragment.groups))
    shown = np.array([cell.is_shown for cell in fragment.cells], np.bool_)
    if not shown.any():
        return fragment.model_copy(update={"groups": groups})
    functions = fragment.functions()
    matrices = np.array([function.matrix for function in functions]).reshape(-1, 4, 4)
    regions = [normal_form(region) for region in fragment.names().regions]
    kept = cells_with_points(matrices, regions, shown, higher_of(functions))
    if kept.issuperset(np.flatnonzero(shown).tolist()):
        return fragment.model_copy(update={"groups": groups})
    cells = tuple(
        cell.model_copy(update={"visible": False}) if shown[ix] and ix not in kept else cell
        for ix, cell in enumerate(fragment.cells)
    )
    return fragment.model_copy(update={"groups": groups, "cells": cells})


def _is_something_shown(fragment: Fragment) -> bool:
    return any(cell.is_shown for cell in fragment.cells) or any(
        map(_is_something_shown, fragment.groups)
    )


@dataclass(frozen=True)
class Ended:
    """The bounds of a model.

    Attributes:
        surfaces: tables of the planes that cut it.
        box: (2, 3), bounds everything that is shown.
    """

    surfaces: list[Table]
    box: Array


def end_of(
    name: str,
    cells: Sequence[Table],
    boxes: Sequence[Array | None],
    clip: Clip,
    around: Array | None = None,
) -> Ended:
    """Hide the cells around a model; cut all others by the clip and along axes without an end.

    A cell is around the model if it has no end along an axis along which other cells end.

    Args:
        name: name of the file, for people.
        cells: tables of the outermost cells; they are changed.
        boxes: bounds each cell's visible part; None if the cell is not seen.
        clip: the part of the model to keep.
        around: (2, 3), the part of the world that is shown, if known. It bounds all cells that
            have no end, so no cell counts as around the model.

    Raises:
        SceneError: nothing is shown.
    """
    seen = [ix for ix, box in enumerate(boxes) if box is not None]
    found = np.array([boxes[ix] for ix in seen]).reshape(-1, 2, 3)
    has_end = np.isfinite(found).all(axis=1)
    is_outside = (~has_end & has_end.any(axis=0)).any(axis=1) & (around is None)
    for place, ix in enumerate(seen):
        if is_outside[place]:
            axes = ", ".join("xyz"[axis] for axis in np.flatnonzero(~has_end[place]))
            number = cells[ix].get("id", "")
            warnings.warn(
                f"{name}: cell {number}: nothing ends it along {axes}; it is not shown",
                stacklevel=2,
            )
            cells[ix].pop("fill", None)
            cells[ix]["visible"] = False
    left = found[~is_outside]
    if not len(left):
        raise SceneError(f"{name}: {NOTHING}")
    box = np.array([left[:, 0].min(axis=0), left[:, 1].max(axis=0)])
    surfaces, region = [*clip.surfaces], clip.region
    for axis, side, distance in _missing_ends(box) if around is None else _open_ends(box, around):
        number = clip.first + len(surfaces)
        surfaces.append(plane(axis, distance, number))
        region = both(region, Sense(number, positive=side == 0))
        box[side, axis] = distance
    is_open = ~has_end[~is_outside].any(axis=0) & (around is None)
    for axis in np.flatnonzero(is_open).tolist():
        low, high = box[:, axis]
        warnings.warn(
            f"{name}: nothing ends it along {'xyz'[axis]}; shown is {low:g} to {high:g}",
            stacklevel=2,
        )
    for place, ix in enumerate(seen):
        if not is_outside[place] and region is not None:
            own: Formula | None = cells[ix].get("region")
            cells[ix]["region"] = both(own, region)
    if around is not None:
        box = np.array([np.maximum(box[0], around[0]), np.minimum(box[1], around[1])])
        if (box[0] > box[1]).any():
            raise SceneError(f"{name}: {NOTHING}")
    return Ended(surfaces, box)


def _open_ends(box: Array, around: Array) -> list[tuple[int, int, float]]:
    """The planes of `_missing_ends`, at the ends of the part of the world that is shown."""
    sides, axes = np.nonzero(np.isinf(box))
    pairs = zip(sides.tolist(), axes.tolist(), strict=True)
    return [(axis, side, float(around[side, axis])) for side, axis in pairs]


def _missing_ends(box: Array) -> list[tuple[int, int, float]]:
    """Axis, side and coordinate of the planes that must bound a box along axes without an end."""
    sizes = np.ptp(np.where(np.isfinite(box), box, 0.0), axis=0)[np.isfinite(box).all(axis=0)]
    reach = OPEN_PART * float(sizes.max(initial=0.0)) or 1.0
    found: list[tuple[int, int, float]] = []
    for axis in range(3):
        low, high = box[:, axis].tolist()
        if np.isinf(low):
            found.append((axis, 0, (0.0 if np.isinf(high) else high - reach) - reach))
        if np.isinf(high):
            found.append((axis, 1, (0.0 if np.isinf(low) else low + reach) + reach))
    return found
