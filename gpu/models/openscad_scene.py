"""Converts OpenSCAD's calls to cells of a scene: solids joined by formulas.

Unions are taken apart, so that each part may have its own colour. A face made by subtraction has
the colour of the remaining part. Of a large model, parts that differ in their places alone are
copies of one group. All calls that Halfstep cannot draw are reported at once.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
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
from halfstep.scene.formula import AllOf, AnyOf, Formula, Leaf, Not, Sense, leaves, with_leaves
from halfstep.scene.hues import linear
from halfstep.scene.values import Array, Vector

# OpenSCAD's default colour.
COLOR = (0.976, 0.843, 0.173)
# With at most this many sides of surfaces, all cells lie in one group, where coinciding faces are
# one surface. With more, each part is a group, because a ray crosses all surfaces of a group.
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
_UNTURNED = np.eye(3)


@dataclass(frozen=True)
class _Part:
    """A region, its sRGB colour, None if the file gives none, and where its coordinates begin."""

    region: Formula
    color: tuple[float, ...] | None
    origin: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class _State:
    """The state that calls around a call set.

    Attributes:
        matrix: (4, 4), takes points of the call to points of the model.
        color: the colour of everything inside; the outermost colour applies.
        is_flat: whether the call lies in the plane z = 0, which is extruded.
        is_part: whether the call is inside of one that makes parts, which only a union is not.
    """

    matrix: Array
    color: tuple[float, ...] | None
    is_flat: bool
    is_part: bool


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
    parts = builder.parts(calls_of(source), _State(np.eye(4), None, is_flat=False, is_part=False))
    source.check()
    return builder.model(parts, look.clip)


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
        if name in _UNIONS:
            return self._inside(call, state)
        if name == "color":
            return self._inside(call, replace(state, color=state.color or self._color(call)))
        if name == "multmatrix":
            return self._moved(call, state)
        if not state.is_part:
            return self._placed(call, state)
        if name in ("difference", "intersection"):
            return self._combined(call, state)
        known = _FLAT if state.is_flat else _SOLIDS
        if name in known:
            return self._solid(call, known[name], state)
        if name == "linear_extrude" and not state.is_flat:
            return self._extruded(call, state)
        if name == "rotate_extrude" and not state.is_flat:
            return self._turned(call, state)
        what = "is flat, and not extruded" if name in _FLAT else "is not drawn"
        self._source.fault(call.at, f"{name} {what}")
        return []

    def _inside(self, call: Call, state: _State) -> list[_Part]:
        return [part for child in call.children for part in self.parts(child, state)]

    def _placed(self, call: Call, state: _State) -> list[_Part]:
        """The parts of a call that is not in another part, with an origin of their own."""
        x, y, z = state.matrix[:3, 3].tolist()
        matrix = state.matrix.copy()
        matrix[:3, 3] = 0.0
        inside = self.parts(call, replace(state, matrix=matrix, is_part=True))
        return [replace(part, origin=(x, y, z)) for part in inside]

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
        if not (matrix[:3, :3] == _UNTURNED).all() and _is_singular(matrix[:3, :3]):
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
        sides = self._sides(ends, state.matrix)
        return [replace(part, region=_all([part.region, *sides])) for part in inside]

    def _turned(self, call: Call, state: _State) -> list[_Part]:
        """The tori that circles give by a turn about the axis."""
        if call.arguments.get("angle") not in (None, 360.0) or solids.fragments(call):
            what = "rotate_extrude by less than a turn, or with flat sides, is not drawn"
            self._source.fault(call.at, what)
            return []
        try:
            placed = solids.Placement.of(state.matrix)
            flat = _State(np.eye(4), state.color, is_flat=True, is_part=True)
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
        return Sense(self._torus(torus), leaf.positive)

    def _torus(self, torus: TorusShape) -> int:
        """The number of the surface of a torus."""
        key = torus.model_dump_json().encode()
        number = self._numbers.setdefault(key, len(self.matrices) + 1)
        if number > len(self.matrices):
            self.matrices.append(np.zeros((4, 4)))
            self._tori[number] = torus
        return number

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
        return [_Part(_all(self._sides(matrices, state.matrix)), state.color)]

    def _sides(self, matrices: list[Array], placed: Array) -> list[Formula]:
        """The sides F <= 0 of the surfaces of ``matrices``, moved by ``placed``."""
        back = np.asarray(np.linalg.inv(placed), np.float64)
        return [Sense(self._surface(each, back), positive=False) for each in matrices]

    def _surface(self, matrix: Array, back: Array) -> int:
        """The number of the surface of ``matrix`` in coordinates that ``back`` takes to its own."""
        own = back.T @ matrix @ back
        own = (own + own.T) / 2
        if not matrix[:3, :3].any():
            own[:3, :3] = 0.0
        number = self._numbers.setdefault((own + 0.0).tobytes(), len(self.matrices) + 1)
        if number > len(self.matrices):
            self.matrices.append(own)
        return number

    def _at_home(self, part: _Part) -> _Part:
        """The part in coordinates of the model."""
        if not any(part.origin):
            return part
        back = np.eye(4)
        back[:3, 3] = np.negative(part.origin)

        def moved(leaf: Leaf) -> Formula:
            assert isinstance(leaf, Sense)
            assert isinstance(leaf.surface, int)
            if leaf.surface not in self._tori:
                return Sense(self._surface(self.matrices[leaf.surface - 1], back), leaf.positive)
            torus = self._tori[leaf.surface]
            origin = np.add(torus.origin, part.origin).tolist()
            return Sense(
                self._torus(torus.model_copy(update={"origin": (*origin,)})), leaf.positive
            )

        return _Part(with_leaves(part.region, moved), part.color)

    # ---------------------------------------------------------------------------- scene

    def model(self, parts: list[_Part], clip: Sequence[str]) -> Model:
        """The tables of cells for all parts that are not empty, cut by the texts of ``--clip``.

        Raises:
            SceneError: all parts are empty.
            UsageError: a text is no clip.
        """
        shown = self._shown(parts)
        sides = sum(count for *_, count in shown)
        if clip or sides <= MOST_TOGETHER:
            shown = self._shown([self._at_home(part) for part, *_ in shown])
        whole = hull(box for _, box, _ in shown)
        if whole is None:
            raise SceneError(f"{self._source.name}: {NOTHING}")
        kept = [part for part, *_ in shown]
        tints = dict.fromkeys(part.color or COLOR for part in kept)
        colors = {tint: f"color {number}" for number, tint in enumerate(tints, 1)}
        tables: Table = {
            "material": [
                {"name": text, "color": linear(color).tolist()} for color, text in colors.items()
            ]
        }
        left = clip_of(clip, 1 + len(self.matrices))
        if sides <= MOST_TOGETHER:
            tables |= self._group([_cell(part, colors, left) for part in kept], left)
        else:
            tables |= self._copies(kept, colors, left)
        return Model(self._source.name, tables, whole)

    def _shown(self, parts: list[_Part]) -> list[tuple[_Part, Array, int]]:
        """The parts that are not empty, with their boxes and the number of their sides."""
        known: dict[Formula, tuple[Array | None, int]] = {}
        found: list[tuple[_Part, Array, int]] = []
        for part in parts:
            if part.region not in known:
                known[part.region] = self._box(part.region), sum(1 for _ in leaves(part.region))
            box, count = known[part.region]
            if box is not None:
                found.append((part, box + part.origin, count))
        return found

    def _copies(
        self, parts: list[_Part], colors: Mapping[tuple[float, ...], str], clip: Clip
    ) -> Table:
        """The tables of groups, one for all parts that differ in their origins alone."""
        groups: dict[_Part, Table] = {}
        places: list[Table] = []
        for part in parts:
            key = replace(part, origin=(0.0, 0.0, 0.0))
            if key not in groups:
                cell = _cell(part, colors, clip)
                groups[key] = {"name": f"part {len(groups) + 1}", **self._group([cell], clip)}
            place: Table = {"group": groups[key]["name"]}
            places.append(place | ({"origin": list(part.origin)} if any(part.origin) else {}))
        return {"group": [*groups.values()], "place": places}

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


def _cell(part: _Part, colors: Mapping[tuple[float, ...], str], clip: Clip) -> Table:
    """The table of the cell of a part."""
    region = both(part.region, clip.region)
    return {"region": region, "material": colors[part.color or COLOR]}


def _is_singular(matrix: Array) -> bool:
    """Whether a matrix (3, 3) leaves no volume."""
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return bool(sizes[-1] <= SINGULAR * max(sizes[0], 1e-300))


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
