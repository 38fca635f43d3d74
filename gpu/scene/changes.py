"""Changed copies of scenes: options in place of the scene's own values, animations, one moment."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, TypedDict, TypeVar, Unpack, cast

import numpy as np
from pydantic import ValidationError

from halfstep.errors import SceneError
from halfstep.scene.bases import BaseSolid
from halfstep.scene.faults import Fault, Loc, line, show
from halfstep.scene.groups import Fragment, Place
from halfstep.scene.keys import Animation, SolidKey
from halfstep.scene.limits import (
    algebraic_faults,
    mirror_faults,
    shadow_faults,
    shadow_format_faults,
)
from halfstep.scene.model import Scene
from halfstep.scene.solids import NO_PATCH, Implicit, PlanePatch, box_cuts_area
from halfstep.scene.tables import ACCURACY_KEYS, VIEW_KEYS, Camera, Light
from halfstep.scene.values import Table, described, plain

Moving = TypeVar("Moving", bound=BaseSolid | Place)

# A camera, or the keys that differ from another one.
CameraLike = Camera | Mapping[str, object]


class Overrides(TypedDict, total=False):
    """Options of a rendering that replace values of the scene; None stands for no option.

    Each option but ``size`` and ``shadows`` has the name of the key that it replaces in the scene's
    ``[image]`` or ``[accuracy]``.
    """

    size: tuple[int, int] | None  # (width, height) in pixels
    samples: int | None  # k for k x k samples in each pixel of image and color, 1…8
    # Each of the next three replaces whichever of the three the scene has.
    steps: int | None  # halvings of every ray and solid, 1…30
    tolerance_pixels: float | None  # largest depth error in widths of a pixel at that depth
    tolerance: float | None  # largest depth error in scene units
    number_format: str | None  # "float32" or "fixed32"
    # "visible", the joint logic first, or "article", the paper's own sequence.
    method: str | None
    shadows: bool | None  # of all lights of the scene


def with_overrides(
    scene: Scene,
    *,
    camera: CameraLike | None = None,
    **overrides: Unpack[Overrides],
) -> Scene:
    """The scene with other values; only these are checked again.

    Args:
        scene: not changed.
        camera: a camera, or keys that replace keys of the scene's camera.
        overrides: options by name.

    Raises:
        SceneError: with every fault; each begins with its option, as ``steps: 31 is not <= 30``.
        TypeError: an option is unknown.
    """
    given, options = _keys(overrides)
    if camera is None and not given:
        return scene
    faults: list[Fault] = []
    changes: dict[str, Table] = {}

    def replace(key: str, data: object, options: Mapping[str, Loc]) -> None:
        """Validate a new table `key`; `options`: the option that each of its keys came from."""
        try:
            changes[key] = type(getattr(scene, key)).model_validate(data)
        except ValidationError as error:
            for loc, text in described(error, type(getattr(scene, key)), (key,)):
                if len(loc) > 1 and loc[1] in options:
                    loc = (*options[str(loc[1])], *loc[2:])
                faults.append((loc, text))

    if isinstance(camera, Mapping):
        new = _given(camera)
        replace("camera", {**_kept(scene.camera, new, VIEW_KEYS), **new}, {})
    elif camera is not None:
        replace("camera", camera, {})

    if "size" in given:
        faults.append((("size",), f"{show(given['size'])} is not an array of 2 integers"))
    for key, table in (("image", scene.image), ("accuracy", scene.accuracy)):
        new = {name: given[name] for name in given if name in type(table).model_fields}
        if new:
            replace(key, {**_kept(table, new, ACCURACY_KEYS), **new}, options)

    lights, found = _lights(scene, given.get("shadows"))
    changed = scene.model_copy(update={**changes, "lights": lights})
    faults = [*faults, *found] or _unfit(changed, given)
    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    return changed


def _unfit(scene: Scene, given: Mapping[str, object]) -> list[Fault]:
    """Faults of the options that are ``given``: those that do not fit the solids of the scene."""
    found = algebraic_faults(scene, scene.solids, scene.accuracy)
    lights = [each.shadows for each in scene.lights]
    found += shadow_format_faults(scene, lights, scene.solids, scene.accuracy)
    found += mirror_faults(scene, scene.materials, scene.image, scene.accuracy)
    return [(loc[1:] if loc[1] in given else loc, text) for loc, text in found]


def _lights(scene: Scene, shadows: object) -> tuple[tuple[Light, ...], list[Fault]]:
    """The lights of a scene, all with shadows or all without, and the faults of that."""
    if shadows is None:
        return scene.lights, []
    if not isinstance(shadows, bool):
        return scene.lights, [(("shadows",), f"{show(shadows)} is not true or false")]
    lights = tuple(light.model_copy(update={"shadows": shadows}) for light in scene.lights)
    found = shadow_faults(scene, [shadows] * len(lights))
    return lights, [(("shadows",), text) for text in dict.fromkeys(text for _, text in found)]


def _keys(overrides: Overrides) -> tuple[dict[str, Any], dict[str, Loc]]:
    """The given options as keys of tables, and for each key the option that it comes from.

    A size that is not two numbers stays under the key ``size``.

    Raises:
        TypeError: an option is unknown.
    """
    names = Overrides.__annotations__.keys()
    unknown = sorted(overrides.keys() - names)
    if unknown:
        raise TypeError(f"{', '.join(unknown)}: no such option; there are {', '.join(names)}")
    given = _given(overrides)
    options: dict[str, Loc] = {name: (name,) for name in Overrides.__annotations__}
    size = given.get("size")
    if isinstance(size, list) and len(size) == 2:
        del given["size"]
        given |= _given({"width": size[0], "height": size[1]})
        options |= {"width": ("size", 0), "height": ("size", 1)}
    return given, options


def _kept(table: Table, new: Mapping[str, object], one_of: Collection[str]) -> dict[str, Any]:
    """The keys that a table keeps beside new keys; of the keys ``one_of`` only one may stand."""
    kept = table.model_dump(exclude_none=True)
    if new.keys().isdisjoint(one_of):
        return kept
    return {name: kept[name] for name in kept if name not in one_of}


def with_animation(scene: Scene, *, frames: int | None = None, fps: float | None = None) -> Scene:
    """The scene with an animation: its own, or else a full turn of the camera about look_at.

    Args:
        scene: not changed.
        frames: replaces `Animation.frames`.
        fps: replaces `Animation.fps`.

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
        scene: not changed.
        camera: the keys of its camera that differ.
        place: gives, for the keys of a solid, part or place, the origin, the rotation_degrees or
            both at that moment.

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
    faults += _formula_faults(scene.solids, solids, ("solid",))
    faults += _part_faults(scene, place, ())
    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    changes: dict[str, Any] = {"camera": view, "animation": None, "solids": solids}
    return scene.model_copy(update={**changes, **_still_inside(scene, place)})


def _formula_faults(old: Sequence[object], new: Sequence[object], loc: Loc) -> Iterator[Fault]:
    """Formulas that have no meaning with the parameters that keys give them."""
    for index, (before, now) in enumerate(zip(old, new, strict=True)):
        if isinstance(now, Implicit) and now is not before:
            try:
                now.check()
            except ValueError as error:
                yield (*loc, index, "formula"), str(error)


def _part_faults(
    fragment: Fragment, place: Callable[[tuple[SolidKey, ...]], Mapping[str, Any]], loc: Loc
) -> Iterator[Fault]:
    """The same of all parts of a scene or group."""
    yield from _formula_faults(fragment.parts, _at_rest(fragment.parts, place), (*loc, "part"))
    for index, group in enumerate(fragment.groups):
        yield from _part_faults(group, place, (*loc, "group", index))


def _still_inside(
    fragment: Fragment, place: Callable[[tuple[SolidKey, ...]], Mapping[str, Any]]
) -> dict[str, Any]:
    """The moving tables of a scene or group, at rest."""
    groups = tuple(
        group.model_copy(update=changes) if (changes := _still_inside(group, place)) else group
        for group in fragment.groups
    )
    found = {
        "parts": _at_rest(fragment.parts, place),
        "places": _at_rest(fragment.places, place),
        "groups": groups,
    }
    # A table that does not move stays the same object.
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
        changes: dict[str, Any] = {}
        if each.keyframes:
            state = place(each.keyframes)
            changes = each.at_rest(state) if isinstance(each, Implicit) else {**state}
            changes["keyframes"] = ()
        found.append(cast("Moving", each.model_copy(update=changes)) if changes else each)
    return tuple(found)


def _given(options: Mapping[str, object]) -> dict[str, Any]:
    """The options that are given, as `plain` has them."""
    return {key: value for key, value in plain(options).items() if value is not None}
