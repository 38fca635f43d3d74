"""Converts OpenSCAD's calls to cells of a scene: solids joined by formulas.

Unions are taken apart, so that each part may have its own colour. A face made by subtraction has
the colour of the remaining part. All calls that Halfstep cannot draw are reported at once.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from halfstep.errors import SceneError, UsageError
from halfstep.host.higher import Higher
from halfstep.models import openscad_solids as solids
from halfstep.models.look import Clip, Look, Table, both, clip_of
from halfstep.models.openscad import Call, calls_of
from halfstep.models.regions import box_of_region, hull, sides_of
from halfstep.models.shape import NOTHING, Model
from halfstep.models.source import Source
from halfstep.scene import TorusShape
from halfstep.scene.formula import AllOf, AnyOf, Formula, Leaf, Not, Sense, with_leaves
from halfstep.scene.hues import linear
from halfstep.scene.values import Array

# OpenSCAD's default colour.
COLOR = (0.976, 0.843, 0.173)
# With at most this many sides of surfaces, all cells lie in one group, where coinciding faces are
# one surface. With more, each cell is a group, because a ray crosses all surfaces of a group.
MOST_TOGETHER = 160
# A matrix that shrinks more than this is singular.
SINGULAR = 1e-12
_SOLIDS: dict[str, Callable[[Call], list[Array]]] = {
    "cube": solids.cube,
    "sphere": solids.sphere,
    "cylinder": solids.cylinder,
    "polyhedron": solids.polyhedron,
}
_FLAT: dict[str, Callable[[Call], list[Array]]] = {
    "square": solids.square,
    "circle": solids.circle,
    "polygon": solids.polygon,
}
_UNIONS = ("union", "group", "render")


@dataclass(frozen=True)
class _Part:
    """A region, and its sRGB colour; None if the file gives none."""

    region: Formula
    color: tuple[float, ...] | None


@dataclass(frozen=True)
class _State:
    """The state that calls around a call set.

    Attributes:
        matrix: (4, 4), takes points of the call to points of the model.
        color: the colour of everything inside; the outermost colour applies.
        is_flat: whether the call lies in the plane z = 0, which is extruded.
    """

    matrix: Array
    color: tuple[float, ...] | None
    is_flat: bool


def scene_tables(source: Source, look: Look) -> Model:
    """The tables of a scene that shows the model.

    Raises:
        SceneError: Halfstep cannot draw some calls, all of which the message lists; or nothing is
            shown.
        UsageError: an option does not apply to these files.
    """
    for option, value in (
        ("--color-by", look.color_by),
        ("--hide", look.hide),
        ("--only", look.only),
        ("--plot", look.plot is not None),
    ):
        if value:
            raise UsageError(f"{option}: is of geometry of OpenMC")
    builder = _Builder(source)
    parts = builder.parts(calls_of(source), _State(np.eye(4), None, is_flat=False))
    source.check()
    return builder.model(parts, clip_of(look.clip, 1 + len(builder.matrices)))


class _Builder:
    """Builds the surfaces and cells of a file."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self.matrices: list[Array] = []
        self._tori: dict[int, TorusShape] = {}
        self._numbers: dict[bytes, int] = {}

    # ---------------------------------------------------------------------------- calls

    def parts(self, call: Call, state: _State) -> list[_Part]:
        """The parts that a call shows. A call that cannot be drawn is recorded as a fault."""
        name = call.name
        known = _FLAT if state.is_flat else _SOLIDS
        if name in known:
            return self._solid(call, known[name], state)
        if name in _UNIONS:
            return self._inside(call, state)
        if name == "color":
            return self._inside(call, replace(state, color=state.color or self._color(call)))
        if name == "multmatrix":
            return self._moved(call, state)
        if name in ("difference", "intersection"):
            return self._combined(call, state)
        if name == "linear_extrude" and not state.is_flat:
            return self._extruded(call, state)
        if name == "rotate_extrude" and not state.is_flat:
            return self._turned(call, state)
        what = "is flat, and not extruded" if name in _FLAT else "is not drawn"
        self._source.fault(call.at, f"{name} {what}")
        return []

    def _inside(self, call: Call, state: _State) -> list[_Part]:
        return [part for child in call.children for part in self.parts(child, state)]

    def _combined(self, call: Call, state: _State) -> list[_Part]:
        each = [self.parts(child, state) for child in call.children]
        if not each:
            return []
        first, others = each[0], [_any([part.region for part in own]) for own in each[1:]]
        if call.name == "difference":
            cut = [Not(other) for other in others if other is not None]
            return [replace(part, region=_all([part.region, *cut])) for part in first]
        regions = [other for other in others if other is not None]
        if len(regions) < len(others):
            return []
        return [replace(part, region=_all([part.region, *regions])) for part in first]

    def _moved(self, call: Call, state: _State) -> list[_Part]:
        given = call.given[0] if call.given else call.arguments.get("m")
        try:
            matrix = np.array(given, np.float64)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or (matrix[3, :3] != 0).any():
            self._source.fault(call.at, "multmatrix has no matrix of four rows of four numbers")
            return []
        matrix = matrix / matrix[3, 3] if matrix[3, 3] else np.zeros((4, 4))
        if state.is_flat:
            # A flat shape stays in its plane, as in OpenSCAD.
            matrix[2], matrix[:, 2] = 0.0, 0.0
            matrix[2, 2] = 1.0
        sizes = np.linalg.svd(matrix[:3, :3], compute_uv=False)
        if sizes[-1] <= SINGULAR * max(sizes[0], 1e-300):
            where = self._source.line(call.at, "multmatrix is singular: nothing of it is shown")
            warnings.warn(where, stacklevel=2)
            return []
        return self._inside(call, replace(state, matrix=state.matrix @ matrix))

    def _color(self, call: Call) -> tuple[float, ...] | None:
        given = call.given[0] if call.given else call.arguments.get("c")
        if not isinstance(given, list) or not all(isinstance(each, float) for each in given):
            return None
        # OpenSCAD writes -1 for no colour.
        numbers = given[:3]
        return tuple(min(each, 1.0) for each in numbers) if min(numbers, default=-1) >= 0 else None

    def _extruded(self, call: Call, state: _State) -> list[_Part]:
        arguments = call.arguments
        scale, twist = arguments.get("scale", 1.0), arguments.get("twist", 0.0)
        scales = scale if isinstance(scale, list) else [scale]
        if twist not in (None, 0.0) or any(each not in (None, 1.0) for each in scales):
            self._source.fault(call.at, "linear_extrude with twist or scale is not drawn")
            return []
        height = arguments.get("height", call.given[0] if call.given else 100.0)
        if not isinstance(height, float) or not np.isfinite(height):
            self._source.fault(call.at, "linear_extrude has no height")
            return []
        direction = arguments.get("v")
        if isinstance(direction, list) and direction[:2] != [0.0, 0.0]:
            self._source.fault(call.at, "linear_extrude along another axis than z is not drawn")
            return []
        if height <= 0:
            return []
        low = -height / 2 if arguments.get("center") else 0.0
        ends = [
            solids.half_space([0, 0, -1], -low),
            solids.half_space([0, 0, 1], low + height),
        ]
        inside = self._inside(call, replace(state, is_flat=True))
        sides = [self._side(matrix, state.matrix) for matrix in ends]
        return [replace(part, region=_all([part.region, *sides])) for part in inside]

    def _turned(self, call: Call, state: _State) -> list[_Part]:
        """The tori that circles give by a turn about the axis."""
        if call.arguments.get("angle") not in (None, 360.0) or solids.fragments(call):
            what = "rotate_extrude by less than a turn, or with flat sides, is not drawn"
            self._source.fault(call.at, what)
            return []
        try:
            placed = solids.Placement.of(state.matrix)
            flat = _State(np.eye(4), state.color, is_flat=True)
            return [
                replace(
                    part, region=with_leaves(part.region, lambda leaf: self._ring(leaf, placed))
                )
                for part in self._inside(call, flat)
            ]
        except solids.Refusal as refusal:
            self._source.fault(call.at, f"rotate_extrude {refusal}")
            return []

    def _ring(self, leaf: Leaf, placed: solids.Placement) -> Formula:
        """The side of a torus, from the side of the circle that is turned."""
        assert isinstance(leaf, Sense)
        assert isinstance(leaf.surface, int)
        torus = placed.torus(self.matrices[leaf.surface - 1])
        key = torus.model_dump_json().encode()
        number = self._numbers.setdefault(key, len(self.matrices) + 1)
        if number > len(self.matrices):
            self.matrices.append(np.zeros((4, 4)))
            self._tori[number] = torus
        return Sense(number, leaf.positive)

    def _solid(
        self, call: Call, shape: Callable[[Call], list[Array]], state: _State
    ) -> list[_Part]:
        try:
            matrices = shape(call)
        except solids.Refusal as refusal:
            self._source.fault(call.at, f"{call.name} {refusal}")
            return []
        except solids.Empty:
            return []
        return [_Part(_all([self._side(each, state.matrix) for each in matrices]), state.color)]

    def _side(self, matrix: Array, placed: Array) -> Formula:
        """The side F <= 0 of the surface of ``matrix``, moved by ``placed``."""
        back = np.linalg.inv(placed)
        own = back.T @ matrix @ back
        own = (own + own.T) / 2
        if not matrix[:3, :3].any():
            own[:3, :3] = 0.0
        number = self._numbers.setdefault((own + 0.0).tobytes(), len(self.matrices) + 1)
        if number > len(self.matrices):
            self.matrices.append(own)
        return Sense(number, positive=False)

    # ---------------------------------------------------------------------------- scene

    def model(self, parts: list[_Part], clip: Clip) -> Model:
        """The tables of cells for all parts that are not empty.

        Raises:
            SceneError: all parts are empty.
        """
        name = self._source.name
        colors: dict[tuple[float, ...], str] = {}
        cells: list[Table] = []
        boxes: list[Array] = []
        for part in parts:
            box = self._box(part.region)
            if box is None:
                continue
            color = part.color or COLOR
            finish = colors.setdefault(color, f"color {len(colors) + 1}")
            cells.append({"region": both(part.region, clip.region), "material": finish})
            boxes.append(box)
        whole = hull(boxes)
        if whole is None:
            raise SceneError(f"{name}: {NOTHING}")
        tables: Table = {
            "material": [
                {"name": text, "color": linear(color).tolist()} for color, text in colors.items()
            ]
        }
        sides = sum(1 for cell in cells for _ in sides_of(cell["region"]))
        if sides <= MOST_TOGETHER:
            tables |= self._group(cells, clip)
        else:
            names = [f"part {number}" for number in range(1, len(cells) + 1)]
            tables["group"] = [
                {"name": text, **self._group([cell], clip)}
                for text, cell in zip(names, cells, strict=True)
            ]
            tables["place"] = [{"group": text} for text in names]
        return Model(name, tables, whole)

    def _box(self, region: Formula) -> Array | None:
        matrices = {number: self.matrices[number - 1] for number, _ in sides_of(region)}
        tori = {number: Higher.of(self._tori[number]) for number in matrices.keys() & self._tori}
        return box_of_region(region, matrices, tori)

    def _group(self, cells: list[Table], clip: Clip) -> Table:
        """The tables of cells and of the surfaces that they use."""
        used = {number for cell in cells for number, _ in sides_of(cell["region"])}
        own = sorted(number for number in used if number <= len(self.matrices))
        surfaces = [
            {"id": number, **self._tori[number].model_dump(exclude_defaults=True), "kind": "torus"}
            if number in self._tori
            else _surface(self.matrices[number - 1], number)
            for number in own
        ]
        return {"surface": [*surfaces, *clip.surfaces], "cell": cells}


def _surface(matrix: Array, number: int) -> Table:
    """The table of a surface."""
    if not matrix[:3, :3].any():
        normal, distance = 2 * matrix[:3, 3], -matrix[3, 3]
        table: Table = {"id": number, "kind": "plane", "axis": normal.tolist()}
        origin = normal * (distance / (normal @ normal))
        return table | ({"origin": origin.tolist()} if origin.any() else {})
    m: Any = matrix.tolist()
    coefficients = [m[0][0], m[1][1], m[2][2], 2 * m[0][1], 2 * m[0][2], 2 * m[1][2]]
    coefficients += [2 * m[0][3], 2 * m[1][3], 2 * m[2][3], m[3][3]]
    return {"id": number, "kind": "quadric", "coefficients": coefficients}


def _all(regions: list[Formula]) -> Formula:
    """The intersection of regions, with nested intersections flattened."""
    members = [
        part for each in regions for part in (each.of if isinstance(each, AllOf) else (each,))
    ]
    return members[0] if len(members) == 1 else AllOf(tuple(members))


def _members(region: Formula) -> tuple[Formula, ...]:
    return region.of if isinstance(region, AllOf) else (region,)


def _any(regions: list[Formula]) -> Formula | None:
    if not regions:
        return None
    return regions[0] if len(regions) == 1 else AnyOf(tuple(regions))
