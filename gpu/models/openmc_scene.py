"""Converts an OpenMC geometry to a scene with a group for each universe and each lattice.

The content of a lattice's element ends at the element's walls. If more of a universe would be seen,
an extra group has these walls and a cell that the universe fills. A lattice with an outer universe
gets as many more elements as the cell around it shows. If instances of a universe differ in
materials or visible cells, each such variant is a group.
"""

from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from halfstep.models.look import Look, Table, clip_of, degrees_of, plane
from halfstep.models.openmc import Cell, Geometry, Lattice, Surface
from halfstep.models.openmc_boxes import box_of_cell, element_box, extents
from halfstep.models.openmc_lattices import (
    Elements,
    as_one_layer,
    is_inside,
    is_outside,
    outer_walls,
    surrounded,
    table_of,
)
from halfstep.models.openmc_look import Shown
from halfstep.models.openmc_plots import Plot
from halfstep.models.regions import common, hull, moved, sides_of
from halfstep.models.shape import Model, end_of
from halfstep.scene.values import Array

# A cell with none of these keys is everywhere and has one material.
_BOUNDED = ("region", "fill")
_AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0]}


@dataclass(frozen=True)
class Built:
    """A group that was built.

    Attributes:
        name: name of the group.
        box: (2, 3), bounds its visible part.
        everywhere: the keys of the cell, if the universe is a single cell everywhere. Then there
            is no group, because only the surroundings bound the cell.
    """

    name: str
    box: Array
    everywhere: Table | None = None


def scene_tables(geometry: Geometry, look: Look, plot: Plot | None = None) -> Model:
    """The tables of a scene that shows the geometry, in the way of ``plot`` if it is given.

    Raises:
        UsageError: an option has an unknown name.
        SceneError: nothing is shown.
    """
    model = _Builder(geometry, look, plot).model(look)
    if plot is None:
        return model
    return replace(model, tables=plot.tables | model.tables, camera=plot.camera)


class _Builder:
    """Builds each group of a scene when it is first needed."""

    def __init__(self, geometry: Geometry, look: Look, plot: Plot | None) -> None:
        self._geometry, self._plot = geometry, plot
        self._shown = Shown(geometry, look, plot)
        self._boxes = {cell.id: box_of_cell(geometry, cell) for cell in geometry.cells}
        self._groups: dict[str, Table] = {}
        self._boxes_of_groups: dict[str, Array] = {}
        self._built: dict[object, Built | None] = {}
        self._empty = {number for number, box in self._boxes.items() if box is None}

    @functools.cached_property
    def _extents(self) -> dict[int, Array]:
        return extents(self._geometry, self._boxes)

    def model(self, look: Look) -> Model:
        """All tables of the scene."""
        geometry = self._geometry
        tables, boxes = self._universe_tables(geometry.root, {}, chosen=False)
        for number in sorted(self._empty):
            warnings.warn(f"{geometry.name}: cell {number}: its region is empty", stacklevel=2)
        texts = look.clip if self._plot is None else (*self._plot.clip, *look.clip)
        clip = clip_of(texts, 1 + max(geometry.surfaces, default=0))
        around = None if self._plot is None else self._plot.around
        ended = end_of(geometry.name, tables["cell"], boxes, clip, around)
        tables["surface"] += ended.surfaces
        tables["material"] = self._shown.materials
        tables["group"] = [*self._groups.values()]
        return Model(geometry.name, tables, ended.box)

    # ---------------------------------------------------------------------------- universes

    def _universe(self, number: int, offsets: dict[int, int], *, chosen: bool) -> Built | None:
        """The group of a universe.

        Args:
            number: number of the universe.
            offsets: the number of earlier instances of each cell with several materials.
            chosen: whether `--only` names a cell around the universe.

        Returns:
            the group, or None if nothing of the universe is seen.
        """
        key = ("universe", number, self._variant(number, offsets), chosen)
        if key not in self._built:
            tables, boxes = self._universe_tables(number, dict(offsets), chosen=chosen)
            box, name = hull(boxes), f"universe {number}"
            if (
                len(boxes) == 1
                and box is not None
                and tables["cell"][0].keys().isdisjoint(_BOUNDED)
            ):
                self._built[key] = Built(name, box, tables["cell"][0])
            else:
                self._built[key] = self._group(name, tables, box)
        return self._built[key]

    def _group(self, name: str, tables: Table, box: Array | None) -> Built | None:
        if box is None:
            return None
        variants = (f"{name}, variant {number}" for number in itertools.count(2))
        free = next(each for each in itertools.chain([name], variants) if each not in self._groups)
        self._groups[free] = {"name": free, **{key: each for key, each in tables.items() if each}}
        self._boxes_of_groups[free] = box
        return Built(free, box)

    def _variant(self, number: int, offsets: dict[int, int]) -> object:
        """A key: the materials of all instances in a universe of cells with several materials."""
        return tuple(
            (cell, self._materials[cell][offsets.get(cell, 0) :][:count])
            for cell, count in self._geometry.counted(number).items()
        )

    @functools.cached_property
    def _materials(self) -> dict[int, tuple[int | None, ...]]:
        return {cell.id: cell.materials for cell in self._geometry.cells}

    def _universe_tables(
        self, number: int, offsets: dict[int, int], *, chosen: bool
    ) -> tuple[Table, list[Array | None]]:
        """Tables of surfaces and cells of a universe, and boxes around each cell's visible part."""
        cells: list[Table] = []
        boxes: list[Array | None] = []
        names: set[str] = set()
        used: dict[int, None] = {}
        for cell in self._geometry.universes[number]:
            table: Table = {"id": cell.id}
            if cell.name and cell.name not in names:
                names.add(cell.name)
                table["name"] = cell.name
            if cell.region is not None:
                table["region"] = cell.region
                used |= dict.fromkeys(number for number, _ in sides_of(cell.region))
            inside = self._content(cell, table, offsets, chosen=chosen)
            box = common(self._boxes[cell.id], inside)
            if box is None:
                table.pop("fill", None)
                table["visible"] = False
            cells.append(table)
            boxes.append(box)
            self._advance(cell, offsets)
        surfaces = [surface_table(self._geometry.surfaces[each]) for each in sorted(used)]
        return {"surface": surfaces, "cell": cells}, boxes

    def _content(
        self, cell: Cell, table: Table, offsets: dict[int, int], *, chosen: bool
    ) -> Array | None:
        """Add a cell's material or filling to its table; return the box around its visible part."""
        if cell.fill is None:
            several = len(cell.materials) > 1
            material = cell.materials[offsets.get(cell.id, 0) if several else 0]
            table |= self._shown.finish(cell, material)
            seen = self._shown.is_seen(cell, material, chosen=chosen)
            return np.array([[-np.inf] * 3, [np.inf] * 3]) if seen else None
        if self._shown.is_hidden(cell):
            return None
        chosen = chosen or self._shown.is_chosen(cell)
        if cell.fill in self._geometry.universes:
            built = self._universe(cell.fill, offsets, chosen=chosen)
        else:
            built = self._lattice(self._geometry.lattices[cell.fill], offsets, chosen=chosen)
        if built is None:
            return None
        if built.everywhere is not None:
            table |= built.everywhere
            return built.box
        table["fill"] = built.name
        if any(cell.translation) or cell.rotation is not None:
            table["fill"] = self._moved(cell, built)
        return moved(built.box, cell.map[:, :3], cell.map[:, 3])

    def _moved(self, cell: Cell, built: Built) -> str:
        """The name of a new group that places a group where a cell moves it."""
        place: Table = {"group": built.name}
        if any(cell.translation):
            place["origin"] = list(cell.translation)
        if cell.rotation is not None:
            place["rotation_degrees"] = degrees_of(cell.rotation)
        group = self._group(f"{built.name} in cell {cell.id}", {"place": [place]}, built.box)
        assert group is not None
        return group.name

    def _advance(self, cell: Cell, offsets: dict[int, int]) -> None:
        """Add a cell and everything inside it to the number of earlier instances."""
        if len(cell.materials) > 1:
            offsets[cell.id] = offsets.get(cell.id, 0) + 1
        for inside, times in self._geometry.inside(cell):
            for number, count in self._geometry.counted(inside).items():
                offsets[number] = offsets.get(number, 0) + count * times

    # ---------------------------------------------------------------------------- lattices

    def _lattice(self, lattice: Lattice, offsets: dict[int, int], *, chosen: bool) -> Built | None:
        """The group of a lattice; None if nothing of it is seen."""
        variants = [self._variant(each, offsets) for each in np.unique(lattice.universes).tolist()]
        key = ("lattice", lattice.id, tuple(variants), chosen)
        if key in self._built:
            return self._built[key]
        names: list[str | None] = [None] * len(lattice.universes)
        own = dict(offsets)
        for element in lattice.order.tolist():
            number = int(lattice.universes[element])
            built = self._element(self._universe(number, own, chosen=chosen), lattice)
            if built is not None:
                names[element] = built.name
            for cell, count in self._geometry.counted(number).items():
                own[cell] = own.get(cell, 0) + count
        elements = Elements.of(lattice, names)
        tables: Table = {"lattice": [elements] if elements.groups else []}
        extent = self._extents.get(lattice.id)
        if lattice.outer is not None and extent is not None and is_outside(extent, lattice):
            outer = self._universe(lattice.outer, {}, chosen=chosen)
            if outer is not None:
                self._surround(tables, elements, outer, extent)
        boxes = [
            each.box(name, self._boxes_of_groups[name])
            for each in tables["lattice"]
            for name in each.names
        ]
        if tables.get("cell"):
            boxes.append(extent)
        box = hull(boxes)
        if extent is not None:
            box = common(box, extent)
        tables["lattice"] = [table_of(each) for each in tables["lattice"]]
        self._built[key] = self._group(f"lattice {lattice.id}", tables, box)
        return self._built[key]

    def _surround(self, tables: Table, inner: Elements, outer: Built, extent: Array) -> None:
        """Add the visible surroundings of a lattice to the tables of its group.

        Surroundings of one material become a cell. The jagged sides of a hexagonal lattice also
        need elements around them.
        """
        lattice, file = inner.lattice, self._geometry.name
        if outer.everywhere is None:
            element = self._element(outer, lattice)
            assert element is not None
            whole = surrounded(inner, element.name, extent, file)
            tables["lattice"] = [whole] if whole.groups else []
            return
        walls = outer_walls(lattice)
        surfaces = [*_walls(walls, lattice.center)]
        if lattice.orientation is not None:
            flat = as_one_layer(lattice)
            element = self._element(outer, flat)
            assert element is not None
            half = flat.pitch[2] / 2 if flat.layers else np.inf
            side = np.array([np.inf, np.inf, half])
            beside = common(extent, flat.center + np.array([-side, side]))
            if beside is not None:
                saw = surrounded(Elements.of(flat, []), element.name, beside, file)
                tables["lattice"] += [saw] if saw.groups else []
        if surfaces:
            sides = (f"{k} | -{k + 1}" for k in range(1, len(surfaces), 2))
            tables["surface"] = surfaces
            tables["cell"] = [{**outer.everywhere, "region": " | ".join(sides)}]

    def _element(self, built: Built | None, lattice: Lattice) -> Built | None:
        """A group that adds an element's walls around its content, if the content crosses them."""
        if built is None or (built.everywhere is None and is_inside(built.box, lattice.walls())):
            return built
        walls = lattice.walls()
        key = ("element", built.name, walls.tobytes())
        if key not in self._built:
            box = common(built.box, element_box(lattice))
            surfaces = [*_walls(walls)]
            sides = (f"-{k} {k + 1}" for k in range(1, 2 * len(walls), 2))
            inside = built.everywhere or {"name": "element", "fill": built.name}
            cell = {**inside, "region": " ".join(sides)}
            name = f"{built.name} in lattice {lattice.id}"
            self._built[key] = self._group(name, {"surface": surfaces, "cell": [cell]}, box)
        return self._built[key]


def _walls(walls: Array, middle: Array | None = None) -> Iterator[Table]:
    """Tables of pairs of planes; vectors (W, 3) lead from the middle to the first of each pair."""
    center = np.zeros(3) if middle is None else middle
    for index, wall in enumerate(walls):
        for number, origin in ((2 * index + 1, center + wall), (2 * index + 2, center - wall)):
            axis = np.flatnonzero(wall)
            if len(axis) == 1:
                yield plane(int(axis[0]), float(origin[axis[0]]), number)
            else:
                table = {"id": number, "kind": "plane", "axis": wall.tolist()}
                yield table | {"origin": origin.tolist()}


def surface_table(surface: Surface) -> Table:
    """The table of a surface."""
    *place, last = surface.coefficients
    table: Table = {"id": surface.id}
    match surface.kind.rpartition("-"):
        case (axis, "-", "plane"):
            return plane("xyz".index(axis), last, surface.id)
        case (_, _, "plane"):
            normal = np.array(place)
            table |= {"kind": "plane", "axis": place}
            place = (normal * (last / (normal @ normal))).tolist()
        case (_, _, "quadric"):
            a, b, c, d, e, f, g, h, j = place
            return table | {"kind": "quadric", "coefficients": [a, b, c, d, f, e, g, h, j, last]}
        case (_, _, "sphere"):
            table |= {"kind": "sphere", "radius": last}
        case (axis, _, "torus"):
            *place, major, along = place
            table |= {"kind": "torus", "major": major, "minor": [last, along]}
            table |= {"axis": _AXES[axis]} if axis in _AXES else {}
        case (axis, _, kind):
            table["kind"] = kind
            table |= {"radius": last} if kind == "cylinder" else {"slope": float(np.sqrt(last))}
            if axis in _AXES:
                table["axis"] = _AXES[axis]
            if kind == "cylinder":
                place.insert("xyz".index(axis), 0.0)
    if any(place):
        table["origin"] = place
    return table
