"""Limits of a valid scene: numbers of surfaces, formulas and copies, and what fits together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from halfstep.scene.algebraic import Algebraic, HigherShape
from halfstep.scene.bases import BaseSolid
from halfstep.scene.copies import Layout
from halfstep.scene.faults import Fault, Loc, show
from halfstep.scene.formula import MAX_LEVELS
from halfstep.scene.functions import function_count
from halfstep.scene.groups import Fragment
from halfstep.scene.lattices import MAX_PLACES
from halfstep.scene.region import Complement, Literal, Region
from halfstep.scene.tables import Accuracy, Image, Material

MAX_SURFACES = 4096
# Limit of lights with shadows: the output `shadow` has a bit for each.
MAX_SHADOWS = 32
# Limit of the literals of one cell, with those of the parts and cells that it names.
MAX_LITERALS = 1 << 16


# In float32, cells of polynomials need positions on a ray that it holds exactly: up to so many
# halvings.
MOST_STEPS_OF_CELLS = 22


def algebraic_faults(
    scene: Fragment, solids: Sequence[BaseSolid], accuracy: Accuracy
) -> list[Fault]:
    """Faults of ``[accuracy]`` for solids and cells that polynomials or formulas bound."""
    kinds = {"torus": "a torus", "implicit": "a formula"}
    of_cells = [shape for _, shape in _shapes_of_cells(scene, ())]
    found: list[object] = [solid for solid in solids if isinstance(solid, Algebraic)]
    known = {kinds[str(getattr(shape, "kind", ""))] for shape in found + of_cells}
    if not known:
        return []
    names = " and ".join(sorted(known))
    faults: list[Fault] = []
    is_float = accuracy.number_format == "float32"
    if not is_float:
        shown, loc = show(accuracy.number_format), ("accuracy", "number_format")
        if any(isinstance(solid, Algebraic) and not solid.has_polynomial for solid in solids):
            text = "a formula that is no polynomial"
            faults.append((loc, f"{shown} cannot draw {text}; use float32"))
        if of_cells:
            text = "cells of tori and formulas"
            faults.append((loc, f"{shown} cannot draw {text} yet; use float32"))
    if accuracy.method != "visible":
        text = f"{show(accuracy.method)} cannot tell the roots of {names} apart; use visible"
        faults.append((("accuracy", "method"), text))
    if accuracy.steps is not None and accuracy.steps > MOST_STEPS_OF_CELLS and is_float:
        text = f"{accuracy.steps} is not <= {MOST_STEPS_OF_CELLS}, the most with {names}"
        faults.append((("accuracy", "steps"), text))
    return faults


def has_algebraic(scene: Fragment, solids: Sequence[BaseSolid]) -> bool:
    """Whether a torus or a formula bounds a solid or a cell."""
    of_cells = next(_shapes_of_cells(scene, ()), None)
    return of_cells is not None or any(solid.is_algebraic for solid in solids)


def _shapes_of_cells(fragment: Fragment, loc: Loc) -> Iterator[tuple[Loc, HigherShape]]:
    """The surfaces and parts of a fragment whose order is above two."""
    for key, shapes in (("surface", fragment.surfaces), ("part", fragment.parts)):
        for index, shape in enumerate(shapes):
            given: object = shape
            if isinstance(given, HigherShape):
                yield (*loc, key, index), given
    for index, group in enumerate(fragment.groups):
        yield from _shapes_of_cells(group, (*loc, "group", index))


def limit_faults(scene: Fragment) -> list[Fault]:
    """Faults of a scene whose names are in order: limits, and surfaces that bound no cells."""
    faults = [*_of_group(scene, ())]
    for loc, shape in _shapes_of_cells(scene, ()):
        given: object = shape
        if isinstance(given, Algebraic) and given.is_sheet():
            faults.append(((*loc, "sheet"), "true: a part has an inside, and a sheet has none"))
    count = Layout(scene).count
    if count > MAX_PLACES:
        faults.append(((), f"{count} copies of groups is not <= {MAX_PLACES}"))
    return faults


def shadow_faults(scene: Fragment, has_shadows: Sequence[bool]) -> list[Fault]:
    """Faults of shadows that are not drawn; ``has_shadows`` tells it of each light."""
    lights = [index for index, shadows in enumerate(has_shadows) if shadows]
    faults: list[Fault] = []
    if len(lights) > MAX_SHADOWS:
        faults.append((("light",), f"{len(lights)} with shadows is not <= {MAX_SHADOWS}"))
    if not all(shape.has_polynomial for _, shape in _shapes_of_cells(scene, ())):
        kind = "cells of formulas that are no polynomials"
        text = f"true: shadows are not drawn of {kind} yet, and the scene has some"
        faults += [(("light", index, "shadows"), text) for index in lights]
    return [*faults, *_of_parts(scene, ())]


def shadow_format_faults(
    scene: Fragment,
    has_shadows: Sequence[bool],
    solids: Sequence[BaseSolid],
    accuracy: Accuracy,
) -> list[Fault]:
    """Faults of ``[accuracy]`` for shadows; ``has_shadows`` tells it of each light."""
    if not any(has_shadows) or accuracy.number_format == "float32":
        return []
    kinds = {
        "cells": has_cells(scene),
        "tori and formulas": any(isinstance(solid, Algebraic) for solid in solids),
    }
    shown, loc = show(accuracy.number_format), ("accuracy", "number_format")
    return [
        (loc, f"{shown} cannot draw shadows of {kind} yet; use float32")
        for kind, is_there in kinds.items()
        if is_there
    ]


def has_cells(scene: Fragment) -> bool:
    """Whether a scene shows cells, its own or those of groups."""
    return bool(scene.cells or scene.places or scene.lattices)


def mirror_faults(
    scene: Fragment,
    materials: Sequence[Material],
    image: Image,
    accuracy: Accuracy,
) -> list[Fault]:
    """Faults of mirrors that are not drawn."""
    faults: list[Fault] = []
    has_formulas = not all(shape.has_polynomial for _, shape in _shapes_of_cells(scene, ()))
    for index, material in enumerate(materials):
        loc = ("material", index, "reflection")
        if material.reflection == 0:
            continue
        shown = show(material.reflection)
        if image.bounces == 0:
            faults.append((loc, f"{shown}: image.bounces is 0, and a mirror needs 1 or more"))
        if has_formulas:
            text = "mirrors are not drawn of cells of formulas that are no polynomials yet"
            faults.append((loc, f"{shown}: {text}, and the scene has some"))
    reflects = any(material.reflection for material in materials)
    if reflects and accuracy.number_format != "float32":
        text = f"{show(accuracy.number_format)} cannot draw mirrors yet; use float32"
        faults.append((("accuracy", "number_format"), text))
    return faults


def _of_parts(fragment: Fragment, loc: Loc) -> Iterator[Fault]:
    for index, part in enumerate(fragment.parts):
        if not part.casts_shadow:
            yield (*loc, "part", index, "casts_shadow"), "false: a part casts none of its own"
    for index, group in enumerate(fragment.groups):
        yield from _of_parts(group, (*loc, "group", index))


def _of_group(fragment: Fragment, loc: Loc) -> Iterator[Fault]:
    count = sum(map(function_count, (*fragment.surfaces, *fragment.parts)))
    if count > MAX_SURFACES:
        yield loc, f"{count} surfaces, with those of the parts, is not <= {MAX_SURFACES}"
    else:
        sizes: dict[int, tuple[int, int]] = {}
        names = fragment.names()
        for index, region in enumerate(names.regions):
            yield from _of_region(region, (*loc, "cell", index, "region"), sizes)
        for index, place in enumerate(fragment.places):
            if place.within is not None:
                region = names.region(place.within)
                yield from _of_region(region, (*loc, "place", index, "within"), sizes)
    for index, group in enumerate(fragment.groups):
        yield from _of_group(group, (*loc, "group", index))


def _of_region(region: Region, loc: Loc, sizes: dict[int, tuple[int, int]]) -> Iterator[Fault]:
    levels, literals = _size(region, sizes)
    if levels > MAX_LEVELS:
        yield loc, f"{levels} nested levels, with the cells it names, is not <= {MAX_LEVELS}"
    if literals > MAX_LITERALS:
        what = "sides of surfaces, with the parts and cells it names"
        yield loc, f"{literals} {what}, is not <= {MAX_LITERALS}"


def _size(region: Region, sizes: dict[int, tuple[int, int]]) -> tuple[int, int]:
    """Nested levels and literals of a region; ``sizes`` keeps those of shared subregions."""
    if isinstance(region, Literal):
        return 0, 1
    if id(region) not in sizes:
        parts = (region.of,) if isinstance(region, Complement) else region.of
        found = [_size(part, sizes) for part in parts]
        levels = 1 + max((level for level, _ in found), default=0)
        sizes[id(region)] = levels, sum(literals for _, literals in found)
    return sizes[id(region)]
