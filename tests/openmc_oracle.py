"""Finds the cell of an OpenMC geometry that a point is in, without any code of Halfstep.

ElementTree reads the file, Python's own operators evaluate regions, and the search goes from the
outermost universe inward. A point nearer than `NEAR` to a surface or a lattice's wall is not sure.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NOWHERE = -1
# Of the size of the model.
NEAR = 1e-7


class Oracle:
    """A geometry and the search for points in it."""

    def __init__(self, path: Path, size: float) -> None:
        root = ElementTree.parse(path).getroot()
        for element in root.iter():
            # OpenMC knows no namespaces.
            element.tag = element.tag.rpartition("}")[2]
        geometry = root if root.tag == "geometry" else root.find("geometry")
        assert geometry is not None
        self._near = NEAR * size
        self._surfaces = {}
        for element in geometry.iter("surface"):
            text = _get(element, "coeffs").split()
            self._surfaces[int(_get(element, "id"))] = (
                _get(element, "type").lower(),
                [float(each) for each in text],
            )
        self._universes: dict[int, list[ElementTree.Element]] = {}
        self._lattices = {int(_get(each, "id")): each for each in geometry.iter("lattice")}
        self._lattices |= {int(_get(each, "id")): each for each in geometry.iter("hex_lattice")}
        used = set()
        for cell in geometry.iter("cell"):
            self._universes.setdefault(int(_get(cell, "universe") or 0), []).append(cell)
            used.add(int(_get(cell, "fill") or NOWHERE))
        for lattice in self._lattices.values():
            used |= {int(each) for each in _get(lattice, "universes").split()}
            used.add(int(_get(lattice, "outer") or NOWHERE))
        [self._root] = self._universes.keys() - used
        self.materials = {
            int(_get(cell, "id")): _get(cell, "material") for cell in geometry.iter("cell")
        }

    def locate(self, points: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """For points (N, 3) the id of the innermost cell, -1 for none, and whether it is sure."""
        found = np.full(len(points), NOWHERE)
        sure = np.ones(len(points), bool)
        self._into(self._root, points, np.arange(len(points)), found, sure)
        return found, sure

    def _into(
        self,
        universe: int,
        points: Floats,
        which: NDArray[np.int64],
        found: NDArray[np.int64],
        sure: NDArray[np.bool_],
    ) -> None:
        left = np.ones(len(points), bool)
        for cell in self._universes[universe]:
            inside, near = self._region(_get(cell, "region"), points)
            sure[which[near & left]] = False
            chosen = inside & left
            left &= ~inside
            if not chosen.any():
                continue
            fill = _get(cell, "fill")
            if not fill:
                found[which[chosen]] = int(_get(cell, "id"))
                continue
            local = points[chosen] - np.array(
                [float(each) for each in _get(cell, "translation").split()] or [0.0] * 3
            )
            local = local @ _rotation(_get(cell, "rotation")).T
            if int(fill) in self._universes:
                self._into(int(fill), local, which[chosen], found, sure)
            else:
                self._into_lattice(self._lattices[int(fill)], local, which[chosen], found, sure)

    def _region(self, text: str, points: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        near = np.zeros(len(points), bool)
        if not text:
            return ~near, near
        sides = {}
        for number in {int(each) for each in re.findall(r"\d+", text)}:
            value, slope = _function(*self._surfaces[number], points)
            sides[number] = value > 0
            near |= np.abs(value) < self._near * slope
        text = re.sub(r"\s+", " ", text.strip())
        text = re.sub(r"(?<=[\d)]) (?=[\d(~+-])", " & ", text)
        text = re.sub(r"(?<=\d)(?=\()|(?<=\))(?=[\d(~+-])", " & ", text)
        text = re.sub(r"-(\d+)", r"~S[\1]", text)
        text = re.sub(r"(?<!\[)\+?\b0*(\d+)\b(?!\])", r"S[\1]", text)
        return eval(text, {"S": sides}), near

    def _into_lattice(
        self,
        lattice: ElementTree.Element,
        points: Floats,
        which: NDArray[np.int64],
        found: NDArray[np.int64],
        sure: NDArray[np.bool_],
    ) -> None:
        numbers = [int(each) for each in _get(lattice, "universes").split()]
        outer = int(_get(lattice, "outer") or NOWHERE)
        pitch = [float(each) for each in _get(lattice, "pitch").split()]
        elements = _rectangular if lattice.tag == "lattice" else _hexagonal
        element, local, wall = elements(lattice, pitch, points)
        sure[which[wall < self._near]] = False
        universe = np.where(element < 0, outer, np.array(numbers)[element])
        for number in set(universe.tolist()) - {NOWHERE}:
            chosen = universe == number
            self._into(number, local[chosen], which[chosen], found, sure)


def _get(element: ElementTree.Element, key: str) -> str:
    value = element.get(key)
    return (element.findtext(key) or "" if value is None else value).strip()


def _function(kind: str, given: list[float], p: Floats) -> tuple[Floats, Floats]:
    """F of a surface at points, and the length of its gradient."""
    x, y, z = p.T
    axis = "xyz".find(kind[0])
    if kind in ("x-plane", "y-plane", "z-plane"):
        return p[:, axis] - given[0], np.ones(len(p))
    if kind == "plane":
        a, b, c, d = given
        return a * x + b * y + c * z - d, np.full(len(p), math.hypot(a, b, c))
    if kind == "quadric":
        a, b, c, d, e, f, g, h, j, k = given
        value = a * x * x + b * y * y + c * z * z + d * x * y + e * y * z + f * x * z
        slope = np.stack([2 * a * x + d * y + f * z + g, 2 * b * y + d * x + e * z + h,
                          2 * c * z + e * y + f * x + j])  # fmt: skip
        return value + g * x + h * y + j * z + k, np.linalg.norm(slope, axis=0)
    if kind.endswith("torus"):
        major, along, across = given[3:]
        q = p - given[:3]
        height = q[:, axis].copy()
        q[:, axis] = 0.0
        around = np.linalg.norm(q, axis=1)
        value = (height / along) ** 2 + ((around - major) / across) ** 2 - 1
        return value, 2 * np.hypot(height / along**2, (around - major) / across**2)
    if kind == "sphere":
        q = p - given[:3]
        return (q * q).sum(axis=1) - given[3] ** 2, 2 * np.linalg.norm(q, axis=1)
    if kind.endswith("cylinder"):
        middle = list(given[:2])
        middle.insert(axis, 0.0)
        q = p - middle
        q[:, axis] = 0.0
        return (q * q).sum(axis=1) - given[2] ** 2, 2 * np.linalg.norm(q, axis=1)
    assert kind.endswith("cone"), kind
    q = p - given[:3]
    weights = np.ones(3)
    weights[axis] = -given[3]
    return (weights * q * q).sum(axis=1), 2 * np.linalg.norm(weights * q, axis=1)


def _rotation(text: str) -> Floats:
    """The matrix (3, 3) from the outer to the inner coordinates."""
    numbers = [float(each) for each in text.split()]
    if len(numbers) == 9:
        return np.array(numbers).reshape(3, 3)
    if not numbers:
        return np.eye(3)
    phi, theta, psi = (-math.radians(each) for each in numbers)
    sine, cosine = math.sin, math.cos
    about_x = [[1, 0, 0], [0, cosine(phi), -sine(phi)], [0, sine(phi), cosine(phi)]]
    about_y = [[cosine(theta), 0, sine(theta)], [0, 1, 0], [-sine(theta), 0, cosine(theta)]]
    about_z = [[cosine(psi), -sine(psi), 0], [sine(psi), cosine(psi), 0], [0, 0, 1]]
    return np.array(about_z) @ about_y @ about_x


Found = tuple[NDArray[np.int64], Floats, Floats]


def _rectangular(lattice: ElementTree.Element, pitch: list[float], points: Floats) -> Found:
    """Index of each point's element in the text, -1 outside; the point in it; how far walls are."""
    shape = [int(each) for each in _get(lattice, "dimension").split()]
    corner = [float(each) for each in _get(lattice, "lower_left").split()]
    axes = len(shape)
    place = (points[:, :axes] - corner) / pitch
    index = np.floor(place).astype(int)
    local = points.copy()
    local[:, :axes] = (place - index - 0.5) * pitch
    wall = ((0.5 - np.abs(place - index - 0.5)) * pitch).min(axis=1)
    inside = ((index >= 0) & (index < shape)).all(axis=1)
    x, y, z = (*index.T, np.zeros(len(points), int))[:3]
    columns, rows = shape[:2]
    return np.where(inside, (z * rows + rows - 1 - y) * columns + x, -1), local, wall


def _hexagonal(lattice: ElementTree.Element, pitch: list[float], points: Floats) -> Found:
    rings, layers = int(_get(lattice, "n_rings")), int(_get(lattice, "n_axial") or 0)
    center = [float(each) for each in _get(lattice, "center").split()]
    flat = (points - [*center[:2], 0.0])[:, :2]
    if (_get(lattice, "orientation") or "y") == "x":
        flat = flat[:, ::-1]
    # Rows of the text, from the top, as they are with orientation y; for x read as columns.
    unit = np.array([pitch[0] * math.sqrt(0.75), pitch[0] / 2])
    best = np.full(len(flat), np.inf)
    nearest = np.zeros((len(flat), 2), int)
    guess = np.rint(flat / unit).astype(int)
    for dx in range(-2, 3):
        for dy in range(-2, 3):
            candidate = guess + np.array([dx, dy])
            distance = np.linalg.norm(flat - candidate * unit, axis=1)
            better = (candidate.sum(axis=1) % 2 == 0) & (distance < best)
            best[better], nearest[better] = distance[better], candidate[better]
    offset = flat - nearest * unit
    directions = np.array([[0.0, 1.0], [math.sqrt(0.75), 0.5], [-math.sqrt(0.75), 0.5]])
    wall = pitch[0] / 2 - np.abs(offset @ directions.T).max(axis=1)
    is_x = (_get(lattice, "orientation") or "y") == "x"
    order: dict[tuple[int, int], int] = {}
    if is_x:
        lengths = [*range(rings, 2 * rings), *range(2 * rings - 2, rings - 1, -1)]
        for row, length in enumerate(lengths):
            for k in range(length):
                order[rings - 1 - row, 2 * k - length + 1] = len(order)
    else:
        lengths = [*range(1, rings), *([rings, rings - 1] * rings)[:-1], *range(rings - 1, 0, -1)]
        for row, length in enumerate(lengths):
            for k in range(length):
                order[2 * k - length + 1, 2 * rings - 2 - row] = len(order)
    index = np.array([order.get((int(x), int(y)), -1) for x, y in nearest])
    local = points.copy()
    local[:, :2] = offset[:, ::-1] if is_x else offset
    if layers:
        height = (points[:, 2] - center[2]) / pitch[1] + layers / 2
        layer = np.floor(height).astype(int)
        local[:, 2] = (height - layer - 0.5) * pitch[1]
        wall = np.minimum(wall, (0.5 - np.abs(height - layer - 0.5)) * pitch[1])
        is_there = (layer >= 0) & (layer < layers) & (index >= 0)
        index = np.where(is_there, layer * len(order) + index, -1)
    return index, local, wall
