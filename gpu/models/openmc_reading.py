"""Reads OpenMC's XML files into a `Geometry`, and reports all faults of the text at once.

Regions follow OpenMC's own Python reader: ``~`` binds closest, then intersection by juxtaposition,
then ``|``. Keys are attributes or children. The case of types and boundaries does not matter.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import numpy as np

from halfstep.models.fields import Fields, counted
from halfstep.models.markup import Document, Element, Value, read
from halfstep.models.openmc import (
    BOUNDARIES,
    OPEN_BOUNDARY,
    SURFACES,
    Cell,
    Geometry,
    Ints,
    Lattice,
    Surface,
    rotation_of,
)
from halfstep.models.regions import sides_of
from halfstep.scene.faults import SMALLEST_LENGTH, hint, show
from halfstep.scene.formula import MAX_FORMULA_BYTES, Formula, parse
from halfstep.scene.lattices import MAX_PLACES
from halfstep.scene.values import Array, Vector

_REGION_TOKEN = re.compile(r"[+-]?[0-9]+(?=[\s()|~]|$)|[()|~]|\s+")
_PLAIN_REGION = re.compile(r"(?:[+-]?[0-9]+(?:\s+|$))+")
_COLUMN = re.compile(r"column (\d+): ")
# A matrix whose numbers differ from a rotation's by more than this is not a rotation with rounded
# decimals.
_ROTATION_ROUNDING = 1e-4
# Of universes that contain themselves through others, so many are reported.
_MOST_CIRCLES = 8
ROOTS = ("geometry", "model")
# The most universes that may lie inside one another.
MAX_DEPTH = 30


def read_geometry(path: Path, given: str) -> Geometry:
    """Read the geometry in a ``geometry.xml`` or ``model.xml``, whatever the file is called.

    Args:
        path: path of the file; names of materials come from a ``materials.xml`` beside it.
        given: name of the file in messages.

    Raises:
        SceneError: the text has faults, all of which the message lists.
    """
    document = read(path, given)
    root = document.root
    if root.name not in ROOTS:
        document.fault(root, f"is no geometry of OpenMC, whose root is {' or '.join(ROOTS)}")
        document.check()
    geometries = [root] if root.name == "geometry" else [*root.find_all("geometry")]
    if len(geometries) != 1:
        document.fault(root, f"holds {len(geometries)} times geometry, not once")
        document.check()
    names = _names(document, root)
    materials = path.with_name("materials.xml")
    if root.name == "geometry" and materials.is_file() and materials != path:
        other = read(materials, str(materials))
        names = _names(other, Element("model", {}, 0, [other.root]))
        other.check()
    return _Reader(document, geometries[0]).geometry(path.name, names)


def _names(document: Document, root: Element) -> dict[int, str]:
    """The names of materials by number; those without a name are left out."""
    found: dict[int, str] = {}
    for materials in root.find_all("materials"):
        for material in materials.find_all("material"):
            fields = Fields(document, material)
            number, name = fields.integer("id"), fields.text("name")
            if number is not None and name:
                found[number] = name
    return found


class _Reader:
    """Reads one ``geometry`` element."""

    def __init__(self, document: Document, element: Element) -> None:
        self._document, self._element = document, element
        # The element of each surface, cell and lattice by number, whether it has faults or not.
        self._elements: dict[str, dict[int, Element]] = {"surface": {}, "cell": {}, "lattice": {}}
        self._in_universes: set[int] = set()
        # The universes in and around each lattice, and the values that name them.
        self._lattices: dict[int, set[int]] = {}
        self._in_lattices: list[tuple[Value, int]] = []
        # For each filled cell: the value that names its filling, the filling, the cell's universe.
        self._fills: list[tuple[Value, int, int]] = []

    def geometry(self, name: str, materials: dict[int, str]) -> Geometry:
        """Read the geometry.

        Raises:
            SceneError: the text has faults, all of which the message lists.
        """
        for element in self._element.find_all("dagmc_universe", "mesh"):
            self._document.fault(element, "is a mesh of another program, which is not read")
        found = [self._surface(each) for each in self._element.find_all("surface")]
        surfaces = {surface.id: surface for surface in found if surface is not None}
        cells = [self._cell(each) for each in self._element.find_all("cell")]
        lattices = [
            self._lattice(each) for each in self._element.find_all("lattice", "hex_lattice")
        ]
        if not self._elements["cell"] and not cells:
            self._document.fault(self._element, "has no cell")
        root = self._check_numbers()
        self._document.check()
        assert root is not None
        universes: dict[int, list[Cell]] = {}
        for cell in cells:
            assert cell is not None
            universes.setdefault(cell.universe, []).append(cell)
        geometry = Geometry(
            name=name,
            surfaces=surfaces,
            universes={number: tuple(own) for number, own in universes.items()},
            lattices={lattice.id: lattice for lattice in lattices if lattice is not None},
            root=root,
            materials=materials,
        )
        self._check_instances(geometry)
        self._document.check()
        return geometry

    def _number(self, fields: Fields, element: Element, what: str) -> int | None:
        """The id of an element, which must be unique among elements of its kind."""
        number = fields.integer("id", least=1 if what == "surface" else 0)
        if number is not None and self._elements[what].setdefault(number, element) is not element:
            fields.fault(f"id: {number} is already the id of another {what}")
        return number

    # ---------------------------------------------------------------------------- surfaces

    def _surface(self, element: Element) -> Surface | None:
        fields = Fields(self._document, element)
        number = self._number(fields, element, "surface")
        kind, boundary = fields.value("type"), fields.value("boundary")
        where = OPEN_BOUNDARY if boundary is None else boundary.text.lower()
        where = "reflective" if where == "reflect" else where
        if boundary is not None and where not in BOUNDARIES:
            allowed = hint(where, BOUNDARIES, "the boundaries are")
            self._document.fault(boundary, f"{show(boundary.text)} is not a boundary; {allowed}")
        if kind is None:
            fields.fault(f"type: missing; the types are {', '.join(SURFACES)}")
            return None
        name = kind.text.lower()
        if name not in SURFACES:
            allowed = hint(name, SURFACES, "the types are")
            self._document.fault(kind, f"{show(kind.text)} is not a type of surface; {allowed}")
            return None
        given = fields.floats("coeffs", [len(SURFACES[name])])
        if given is None or not self._is_sound(fields, name, given) or number is None:
            return None
        return Surface(number, name, given, where, fields.text("name"))

    def _is_sound(self, fields: Fields, kind: str, given: tuple[float, ...]) -> bool:
        """Whether coefficients describe a surface; a fault is recorded."""
        value = fields.value("coeffs")
        assert value is not None
        names = SURFACES[kind]
        if names[-1] in ("r", "r2") and given[-1] < SMALLEST_LENGTH:
            self._document.fault(value, f"{names[-1]} = {show(given[-1])} is not > 0")
            return False
        if kind.endswith("torus"):
            for name, length in zip(names[3:], given[3:], strict=True):
                if length < SMALLEST_LENGTH:
                    self._document.fault(value, f"{name} = {show(length)} is not > 0")
                    return False
            if given[5] > given[3]:
                text = f"C = {show(given[5])} is not <= A = {show(given[3])}"
                self._document.fault(value, f"{text}: a torus that crosses itself is not read")
                return False
        if kind in ("plane", "quadric"):
            linear = given[:-1]
            if not any(abs(each) >= SMALLEST_LENGTH for each in linear):
                self._document.fault(value, f"is 0 but for {names[-1]}, which is no surface")
                return False
        return True

    # ---------------------------------------------------------------------------- cells

    def _cell(self, element: Element) -> Cell | None:
        fields = Fields(self._document, element)
        number = self._number(fields, element, "cell")
        universe = fields.integer("universe", required=False) or 0
        if fields.value("surfaces") is not None:
            fields.fault("surfaces: is of OpenMC before 0.7; write region")
        content, fill = fields.value("material"), fields.value("fill")
        if content is None and fill is None:
            fields.fault("has neither material nor fill; one must be given")
        if content is not None and fill is not None:
            fields.fault("has material and fill; only one may be given")
        region = self._region(fields.value("region"))
        materials = () if content is None else self._materials(fields, content)
        self._in_universes.add(universe)
        filled = None if fill is None else fields.integer("fill")
        if filled is not None and fill is not None:
            self._fills.append((fill, filled, universe))
        place, turn = fields.value("translation"), fields.value("rotation")
        for value in (place, turn):
            if value is not None and fill is None:
                self._document.fault(value, "is of a cell that nothing fills")
        translation = fields.floats("translation", [3], required=False) or (0.0, 0.0, 0.0)
        rotation = self._rotation(fields, turn)
        if number is None:
            return None
        x, y, z = translation
        name = fields.text("name")
        return Cell(number, name, universe, region, materials, filled, (x, y, z), rotation)

    def _region(self, value: Value | None) -> Formula | None:
        if value is None:
            return None
        formula = self._formula(value)
        if formula is None:
            return None
        for surface, column in sides_of(formula):
            if surface not in self._elements["surface"]:
                self._document.fault(value, f"there is no surface {surface}", column)
        return formula

    def _formula(self, value: Value) -> Formula | None:
        if len(value.text) > MAX_FORMULA_BYTES:
            self._document.fault(value, f"longer than {MAX_FORMULA_BYTES} bytes")
            return None
        # Most regions have only these signs; any other text is searched for the place of a fault.
        index = len(value.text) if _PLAIN_REGION.fullmatch(value.text) else 0
        while index < len(value.text):
            match = _REGION_TOKEN.match(value.text, index)
            if match is None:
                run = re.match(r"[+-]?\w+|.", value.text[index:], re.DOTALL)
                assert run is not None
                what = "is no sign of a region; those are numbers, blanks, |, ~ and ( )"
                self._document.fault(value, f"{show(run[0])} {what}", index)
                return None
            index = match.end()
        try:
            return parse(re.sub(r"\s", " ", value.text))
        except ValueError as error:
            found = _COLUMN.match(str(error))
            what = _COLUMN.sub("", str(error), count=1)
            self._document.fault(value, what, int(found[1]) - 1 if found else 0)
            return None

    def _materials(self, fields: Fields, value: Value) -> tuple[int | None, ...]:
        words = value.text.split()
        if any(word.lower() == "void" for word in words):
            plain = [word for word in words if word.lower() != "void"]
            numbers = iter(fields.whole(value, plain, 0) or ())
            return tuple(None if word.lower() == "void" else next(numbers, None) for word in words)
        return fields.integers("material") or ()

    def _rotation(self, fields: Fields, value: Value | None) -> Array | None:
        numbers = fields.floats("rotation", [3, 9], required=False)
        if value is None or numbers is None:
            return None
        found = rotation_of(numbers)
        if np.abs(found @ found.T - np.eye(3)).max() > _ROTATION_ROUNDING:
            self._document.fault(value, "its nine numbers are no rotation")
            return None
        if np.linalg.det(found) < 0:
            self._document.fault(value, "its nine numbers are a reflection, which is not drawn")
            return None
        # Decimals in the file are rounded, so take the nearest rotation.
        left, _, right = np.linalg.svd(found)
        return found if len(numbers) == 3 else np.asarray(left @ right)

    # ---------------------------------------------------------------------------- lattices

    def _lattice(self, element: Element) -> Lattice | None:
        fields = Fields(self._document, element)
        number = self._number(fields, element, "lattice")
        outer, universes = fields.integer("outer", required=False), fields.integers("universes")
        for key, numbers in (
            ("outer", () if outer is None else (outer,)),
            ("universes", universes),
        ):
            value = fields.value(key)
            if value is not None and number is not None:
                found = dict.fromkeys(numbers or ())
                self._in_lattices += [(value, each) for each in found]
                self._lattices.setdefault(number, set()).update(found)
        is_hexagonal = element.name == "hex_lattice"
        parts = self._hexagonal(fields) if is_hexagonal else self._rectangular(fields)
        if parts is None or universes is None or number is None:
            return None
        shape, pitch, middle, cells, orientation = parts
        value = fields.value("universes")
        assert value is not None
        if len(universes) != len(cells):
            what = f"has {counted(universes, 'number')}; this lattice has {len(cells)}"
            self._document.fault(value, what)
            return None
        name = fields.text("name")
        contents = np.array(universes, np.int64)
        return Lattice(number, name, orientation, shape, pitch, middle, contents, cells, outer)

    def _pitch(self, fields: Fields, count: int) -> tuple[float, ...] | None:
        pitch = fields.floats("pitch", [count])
        if pitch is None or min(pitch) >= SMALLEST_LENGTH:
            return pitch
        value = fields.value("pitch")
        assert value is not None
        self._document.fault(value, f"{show(min(pitch))} is not > 0")
        return None

    def _rectangular(
        self, fields: Fields
    ) -> tuple[tuple[int, ...], Vector, Vector, Ints, None] | None:
        shape = fields.integers("dimension", least=1)
        if shape is None:
            return None
        value = fields.value("dimension")
        assert value is not None
        if len(shape) not in (2, 3):
            self._document.fault(value, f"has {counted(shape, 'number')}, not 2 or 3")
            return None
        if self._is_too_large(value, shape):
            return None
        pitch = self._pitch(fields, len(shape))
        corner = fields.floats("lower_left", [len(shape)])
        if pitch is None or corner is None:
            return None
        columns, rows, layers = (*shape, 0)[:3]
        sizes = zip(corner, shape, pitch, strict=True)
        middle = [low + count * size / 2 for low, count, size in sizes]
        z, y, x = np.mgrid[: max(layers, 1), :rows, :columns]
        # The file lists rows from the top.
        cells = np.stack([x, y[:, ::-1], z], axis=-1).reshape(-1, 3)
        return (columns, rows, layers), _three(pitch), _three(middle), cells, None

    def _hexagonal(
        self, fields: Fields
    ) -> tuple[tuple[int, ...], Vector, Vector, Ints, str] | None:
        rings = fields.integer("n_rings", least=1)
        layers = fields.integer("n_axial", least=1, required=False) or 0
        orientation = fields.text("orientation", "y").lower()
        if orientation not in ("x", "y"):
            value = fields.value("orientation")
            assert value is not None
            self._document.fault(value, f"{show(value.text)} is not x or y")
            return None
        count = 2 if layers else 1
        pitch = self._pitch(fields, count)
        center = fields.floats("center", [count + 1])
        if rings is None or pitch is None or center is None:
            return None
        value = fields.value("n_rings")
        assert value is not None
        if self._is_too_large(value, (3 * rings, rings, max(layers, 1))):
            return None
        layer = hexagon(rings, orientation)
        cells = np.concatenate(
            [np.insert(layer, 2, number, axis=1) for number in range(max(layers, 1))]
        )
        sizes = (pitch[0], pitch[0], *pitch[1:])
        return (rings, layers), _three(sizes), _three(center), cells, orientation

    def _is_too_large(self, value: Value, counts: Iterable[int]) -> bool:
        total = 1
        for count in counts:
            total *= count
        if total > MAX_PLACES:
            self._document.fault(value, f"is {total} elements, not <= {MAX_PLACES}")
        return total > MAX_PLACES

    # ---------------------------------------------------------------------------- numbers

    def _check_numbers(self) -> int | None:
        """Record missing numbers and universes that contain themselves; return the root."""
        used: set[int] = set()
        ways: dict[int, dict[int, Value]] = {number: {} for number in self._in_universes}
        for where, number in self._in_lattices:
            if number in ways:
                used.add(number)
            else:
                self._document.fault(where, f"there is no universe {number}")
        for where, number, around in self._fills:
            if number in ways:
                used.add(number)
                ways[around].setdefault(number, where)
            elif number in self._lattices:
                for inside in self._lattices[number] & ways.keys():
                    ways[around].setdefault(inside, where)
            else:
                self._document.fault(where, f"there is no universe and no lattice {number}")
        self._note_circles(ways)
        roots = sorted(ways.keys() - used)
        if len(roots) == 1 or not ways:
            return roots[0] if roots else None
        if roots:
            numbers = ", ".join(map(str, roots))
            what = f"universes {numbers} are in no cell and no lattice; one may be, the outermost"
        else:
            what = "each universe is in a cell or a lattice; one must be in none, the outermost"
        self._document.fault(self._element, what)
        return None

    def _note_circles(self, ways: dict[int, dict[int, Value]]) -> None:
        """Record fills by which a universe contains itself, or else too deep nesting."""
        for number, inside in ways.items():
            if number in inside:
                what = f"leads a universe into itself: {number} → {number}"
                self._document.fault(inside.pop(number), what)
        for _ in range(_MOST_CIRCLES):
            try:
                TopologicalSorter(ways).prepare()
            except CycleError as error:
                # The error lists every universe after one that it contains.
                cycle = [*reversed(error.args[1])]
                names = " → ".join(map(str, cycle))
                where = ways[cycle[0]].pop(cycle[1])
                self._document.fault(where, f"leads a universe into itself: {names}")
            else:
                break
        else:
            return
        levels: dict[int, int] = {}
        for number in TopologicalSorter(ways).static_order():
            levels[number] = 1 + max((levels[each] for each in ways[number]), default=0)
        if max(levels.values(), default=0) > MAX_DEPTH:
            what = f"{max(levels.values())} universes lie in one another, not <= {MAX_DEPTH}"
            self._document.fault(self._element, what)

    def _check_instances(self, geometry: Geometry) -> None:
        """Record cells whose number of materials differs from their number of instances."""
        counts = geometry.counted(geometry.root)
        for cell in geometry.cells:
            instances = counts.get(cell.id, 0)
            if len(cell.materials) > 1 and instances != len(cell.materials):
                element = self._elements["cell"][cell.id]
                value = self._document.value(element, "material")
                assert value is not None
                number = counted(cell.materials, "material")
                what = f"has {number}, but the cell is there {instances} times"
                self._document.fault(value, what)


def hexagon(rings: int, orientation: str) -> Ints:
    """Indices (N, 2) of the elements of one layer as in `Lattice.cells`, by rows from the top."""
    if orientation == "x":
        lengths = [*range(rings, 2 * rings), *range(2 * rings - 2, rings - 1, -1)]
        rows = [(rings - 1 - row, length) for row, length in enumerate(lengths)]
    else:
        begin = [*range(1, rings)]
        middle = [rings - row % 2 for row in range(2 * rings - 1)]
        lengths = [*begin, *middle, *reversed(begin)]
        rows = [(2 * (rings - 1) - row, length) for row, length in enumerate(lengths)]
    places = [(2 * k - (length - 1), y) for y, length in rows for k in range(length)]
    return np.array(places, np.int64)


def _three(numbers: Sequence[float]) -> Vector:
    x, y, z = (*numbers, 1.0)[:3]
    return x, y, z
