"""Scenes with something in place of what they say."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import ValidationError

from halfstep.errors import SceneError
from halfstep.scene.faults import Fault, Loc, line, show
from halfstep.scene.groups import Fragment, Place
from halfstep.scene.keys import Animation, SolidKey
from halfstep.scene.model import Scene
from halfstep.scene.solids import NO_PATCH, BaseSolid, PlanePatch, box_cuts_area
from halfstep.scene.tables import ACCURACY_KEYS, Camera
from halfstep.scene.values import Table, described, plain

Moving = TypeVar("Moving", bound=BaseSolid | Place)


def with_overrides(
    scene: Scene,
    *,
    size: tuple[int, int] | None = None,
    steps: int | None = None,
    tolerance_pixels: float | None = None,
    tolerance: float | None = None,
    number_format: str | None = None,
    method: str | None = None,
    samples: int | None = None,
    camera: Camera | Mapping[str, Any] | None = None,
) -> Scene:
    """The scene with what is given in place of what it says; only that is checked again.

    Args:
        scene: left as it is.
        size: (width, height) in pixels.
        steps: as `Accuracy.steps`. At most one of this and the next two may be given, and it
            replaces whichever of the three the scene has.
        tolerance_pixels: as `Accuracy.tolerance_pixels`.
        tolerance: as `Accuracy.tolerance`.
        number_format: as `Accuracy.number_format`.
        method: as `Accuracy.method`.
        samples: as `Image.samples`.
        camera: a camera, or keys that replace those of the scene's camera.

    Raises:
        SceneError: with every fault, each beginning with the option it is in, as
            ``steps: 31 is not <= 30``.
    """
    faults: list[Fault] = []
    changes: dict[str, Table] = {}

    def replace(key: str, data: object, options: Mapping[str, Loc]) -> None:
        """Validates a new table `key`; `options` are the options that its own keys came from."""
        try:
            changes[key] = type(getattr(scene, key)).model_validate(data)
        except ValidationError as error:
            for loc, text in described(error, type(getattr(scene, key)), (key,)):
                if len(loc) > 1 and loc[1] in options:
                    loc = (*options[str(loc[1])], *loc[2:])
                faults.append((loc, text))

    if isinstance(camera, Mapping):
        replace("camera", {**scene.camera.model_dump(), **_given(camera)}, {})
    elif camera is not None:
        replace("camera", camera, {})

    image = _given({"samples": samples})
    if size is not None and _is_pair(size):
        image |= _given({"width": size[0], "height": size[1]})
    elif size is not None:
        faults.append((("size",), f"{show(size)} is not an array of 2 integers"))
    if image:
        sides: dict[str, Loc] = {"width": ("size", 0), "height": ("size", 1)}
        replace("image", {**scene.image.model_dump(), **image}, {**sides, "samples": ("samples",)})

    accuracy = _given(
        {
            "tolerance_pixels": tolerance_pixels,
            "tolerance": tolerance,
            "steps": steps,
            "number_format": number_format,
            "method": method,
        }
    )
    if accuracy:
        kept = scene.accuracy.model_dump(exclude_none=True)
        if not accuracy.keys().isdisjoint(ACCURACY_KEYS):
            kept = {key: value for key, value in kept.items() if key not in ACCURACY_KEYS}
        replace("accuracy", {**kept, **accuracy}, {key: (key,) for key in accuracy})

    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    return scene.model_copy(update=changes)


def with_animation(scene: Scene, *, frames: int | None = None, fps: float | None = None) -> Scene:
    """The scene with an animation: its own, or else a full turn of the camera about look_at.

    Args:
        scene: left as it is.
        frames: as `Animation.frames`, in place of the animation's.
        fps: as `Animation.fps`, in place of the animation's.

    Raises:
        SceneError: with every fault, as ``frames: 0 is not >= 1``.
    """
    own = scene.effective_animation()
    given = _given({"frames": frames, "fps": fps})
    try:
        animation = Animation.model_validate({**own.model_dump(by_alias=True), **given})
    except ValidationError as error:
        faults = described(error, Animation, ("animation",))
        raise SceneError(*(line("", loc[1:], text) for loc, text in faults)) from None
    return scene.model_copy(update={"animation": animation})


def still(
    scene: Scene,
    camera: Mapping[str, Any],
    place: Callable[[tuple[SolidKey, ...]], Mapping[str, Any]],
) -> Scene:
    """One moment of an animated scene, as a scene that stands still.

    Args:
        scene: left as it is.
        camera: the keys of its camera that differ.
        place: of the keys of a solid, a part or a place, its origin, its rotation_degrees or both.

    Raises:
        SceneError: with every fault of the camera or of a solid at its place.
    """
    faults: list[Fault] = []
    view, solids = scene.camera, _at_rest(scene.solids, place)
    if camera:
        try:
            view = Camera.model_validate({**view.model_dump(), **camera})
        except ValidationError as error:
            faults += described(error, Camera, ("camera",))
    for index, solid in enumerate(solids):
        if isinstance(solid, PlanePatch) and solid is not scene.solids[index]:
            normal = solid.world_from_local()[:, 2]
            if not box_cuts_area(solid.bounds, np.array(solid.origin), normal):
                faults.append((("solid", index, "bounds"), NO_PATCH))
    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    changes: dict[str, Any] = {"camera": view, "animation": None, "solids": solids}
    return scene.model_copy(update={**changes, **_still_inside(scene, place)})


def _still_inside(
    fragment: Fragment, place: Callable[[tuple[SolidKey, ...]], Mapping[str, Any]]
) -> dict[str, Any]:
    """What of a scene or group moves, standing still."""
    groups = tuple(
        group.model_copy(update=changes) if (changes := _still_inside(group, place)) else group
        for group in fragment.groups
    )
    found = {
        "parts": _at_rest(fragment.parts, place),
        "places": _at_rest(fragment.places, place),
        "groups": groups,
    }
    # What does not move stays the same object.
    return {
        name: tables
        for name, tables in found.items()
        if any(new is not old for new, old in zip(tables, getattr(fragment, name), strict=True))
    }


def _at_rest(
    moving: tuple[Moving, ...], place: Callable[[tuple[SolidKey, ...]], Mapping[str, Any]]
) -> tuple[Moving, ...]:
    found: list[Moving] = []
    for each in moving:
        changes = {**place(each.keyframes), "keyframes": ()} if each.keyframes else {}
        found.append(cast("Moving", each.model_copy(update=changes)) if changes else each)
    return tuple(found)


def _is_pair(value: object) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and len(value) == 2


def _given(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that are given, as `plain` has them."""
    return {key: value for key, value in plain(options).items() if value is not None}
