"""Cells and copies of groups in POV-Ray's language: its own shapes, joined by the cells' formulas.

Only the kinds of surfaces and parts that the benchmark's scenes have are supported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.host.boxes import box_of
from halfstep.host.formulas import normal_form
from halfstep.scene import Material, Scene
from halfstep.scene.copies import Layout
from halfstep.scene.formula import AllOf, AnyOf, Formula, Name, Not, Sense
from halfstep.scene.groups import Fragment
from halfstep.scene.shapes import Placed
from halfstep.scene.solids import AnyPart
from halfstep.scene.surfaces import AnySurface

# A cylinder without ends extends this many times as far as its cell's bounding box.
LONG = 4.0


def objects(scene: Scene) -> Iterator[str]:
    """The visible cells of ``scene`` and of all copies of its groups."""
    for number, copies in enumerate(Layout(scene).copies()):
        assert not copies.within, "POV-Ray is given no regions around copies"
        group = copies.group
        yield f"#declare group_{number} = union {{"
        yield from _cells(scene, group)
        yield "}"
        for one in copies.maps:
            yield f"object {{ group_{number} {_matrix(one)} }}"


def _cells(scene: Scene, group: Fragment) -> Iterator[str]:
    functions = group.functions()
    matrices = np.array([function.matrix for function in functions])
    for cell, region in zip(group.cells, group.names().regions, strict=True):
        box = box_of(normal_form(region), matrices)
        if not cell.is_shown or cell.region is None or box is None:
            continue
        writer = _Writer(scene, group, box)
        shape = writer.text(cell.region)
        yield f"  object {{ {shape} {_bounds(box)} {finish(scene.material_of(cell), scene)} }}"


class _Writer:
    """Writes formulas of a group, which lie inside ``box`` (2, 3), as POV-Ray's solid geometry."""

    def __init__(self, scene: Scene, group: Fragment, box: Floats) -> None:
        self._scene, self._box = scene, box
        self._parts = {part.name: part for part in group.parts}
        self._surfaces = {surface.id: surface for surface in group.surfaces}
        self._cells = {cell.name: cell for cell in group.cells}

    def text(self, formula: Formula) -> str:
        """The text of a formula, which can stand inside an `object`."""
        match formula:
            case Sense(surface, positive):
                assert isinstance(surface, int)
                inside = self._surface(self._surfaces[surface])
                return f"object {{ {inside} inverse }}" if positive else inside
            case Name(of) if of in self._parts:
                return self._part(self._parts[str(of)])
            case Name(of):
                region = self._cells[str(of)].region
                assert region is not None
                return self.text(region)
            case Not(of):
                return f"object {{ {self.text(of)} inverse }}"
            case AllOf(of):
                return f"intersection {{ {' '.join(map(self.text, of))} }}"
            case AnyOf(of):
                return f"union {{ {' '.join(map(self.text, of))} }}"

    def _surface(self, surface: AnySurface) -> str:
        radius = getattr(surface, "radius", 0.0)
        match surface.kind:
            case "plane":
                shape = "plane { z, 0"
            case "sphere":
                shape = f"sphere {{ 0, {radius:.17g}"
            case "cylinder":
                far = math.ceil(LONG * np.abs(self._box).max())
                shape = f"cylinder {{ {-far}*z, {far}*z, {radius:.17g}"
            case kind:
                raise AssertionError(f"POV-Ray is given no surface of kind {kind}")
        return f"{shape} {placed(surface)} }}"

    def _part(self, part: AnyPart) -> str:
        look = ""
        if part.material is not None or part.color is not None:
            look = finish(self._scene.material_of(part), self._scene)
        match part.kind:
            case "box":
                half = vector([size / 2 for size in part.size])
                shape = f"box {{ -{half}, {half}"
            case "sphere":
                shape = f"sphere {{ 0, {part.radius:.17g}"
            case "cylinder":
                assert part.z_min is not None
                assert part.z_max is not None
                shape = f"cylinder {{ {part.z_min:.17g}*z, {part.z_max:.17g}*z, {part.radius:.17g}"
            case "cone":
                assert part.z_min is not None
                assert part.z_max is not None
                ends = (part.z_min, part.z_max)
                low, high = (f"{z:.17g}*z, {abs(part.slope * z):.17g}" for z in ends)
                shape = f"cone {{ {low}, {high}"
            case "polyhedron":
                rows = np.array(part.half_spaces())
                length = np.linalg.norm(rows[:, :3], axis=1)
                planes = (
                    f"plane {{ {vector(row[:3])}, {row[3] / size:.17g} }}"
                    for row, size in zip(rows, length, strict=True)
                )
                shape = f"intersection {{ {' '.join(planes)}"
            case kind:
                raise AssertionError(f"POV-Ray is given no part of kind {kind}")
        return f"{shape} {placed(part)} {look} }}"


def placed(thing: Placed) -> str:
    """The text of a rotation and a translation."""
    rotation, origin = thing.world_from_local(), np.array(thing.origin)
    return _matrix(np.column_stack([rotation, origin]))


def _matrix(map_: Floats) -> str:
    """The text of a rigid map (3, 4)."""
    if np.array_equal(map_[:, :3], np.eye(3)):
        return f"translate {vector(map_[:, 3])}"
    return f"matrix <{', '.join(f'{value:.17g}' for value in map_.T.ravel())}>"


def _bounds(box: Floats) -> str:
    return f"bounded_by {{ box {{ {vector(box[0])}, {vector(box[1])} }} }}"


def finish(material: Material, scene: Scene) -> str:
    """The text of a material without highlights: POV-Ray gives none for lights without shadows."""
    own = 1 - material.reflection
    ambient = vector([own * part for part in scene.ambient.color])
    return (
        f"pigment {{ rgb {vector(material.color)} }} finish {{ ambient rgb"
        f" {ambient} diffuse {own:.17g} reflection {material.reflection:.17g} }}"
    )


def vector(values: object) -> str:
    """The text of a vector."""
    return f"<{', '.join(f'{value:.17g}' for value in np.asarray(values).tolist())}>"
