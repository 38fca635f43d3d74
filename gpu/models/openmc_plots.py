"""Reads plots of OpenMC: the camera, the visible cells and their colours.

Only those keys of a plot are read that Halfstep can draw. OpenMC's angles of view are horizontal. A
slice is drawn by parallel rays, with everything before the plane cut away.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from halfstep.errors import UsageError
from halfstep.models.fields import Fields
from halfstep.models.look import COLORS, VIEWS, Table
from halfstep.models.markup import Document, Element, read
from halfstep.scene.hues import linear
from halfstep.scene.values import Array

SLICE, SOLID, WIRES = "slice", "solid_raytrace", "wireframe_raytrace"
_OLD_NAMES = {"phong": SOLID, "projection": WIRES}
FOV_DEGREES = 70.0
SIZE = (400, 400)
# For a slice along two axes: the third axis, and the side of the plane away from the viewer.
_BASES = {"xy": ("z", "<=", -1), "xz": ("y", ">=", 1), "yz": ("x", "<=", -1)}
# The thickness of the part that is kept behind the plane, in parts of the width. It is small, so
# that the background shows where the plane meets no cell.
_THICKNESS = 2.0**-17
WHITE = [1.0, 1.0, 1.0]
# Light by which every face shows its material's own colour.
_FLAT = {"ambient": {"color": WHITE}, "light": [{"direction": [0, 0, 1], "color": [0, 0, 0]}]}


@dataclass(frozen=True)
class Plot:
    """One plot.

    Attributes:
        title: its title for people.
        kind: `SLICE`, `SOLID` or `WIRES`.
        color_by: ``material`` or ``cell``.
        colors: linear RGB by the number of a material or cell.
        opaque: numbers of the materials or cells that are seen; None for all except void.
        camera: keys of the scene's camera.
        tables: other tables of the scene: the image, and lights if they are not at the camera.
        clip: conditions of the part that is kept, in the form of ``--clip``.
        mask: the materials or cells that keep their colours; None keeps all colours.
        around: (2, 3), the part of the world that a slice shows.
    """

    title: str
    kind: str
    color_by: str
    colors: dict[int, list[float]]
    camera: Table
    tables: Table
    opaque: frozenset[int] | None = None
    clip: tuple[str, ...] = ()
    mask: Mask | None = None
    around: Array | None = None

    @property
    def shows_void(self) -> bool:
        """Whether the plot shows cells without a material."""
        return self.kind == SLICE


@dataclass(frozen=True)
class Mask:
    """A slice shows all materials or cells except ``components`` in one colour."""

    components: frozenset[int]
    color: list[float]


def read_plot(path: Path, given: str, number: int) -> Plot:
    """Read a plot in a model, or in the ``plots.xml`` beside a geometry.

    Args:
        path: path of the model or geometry.
        given: name of the file in messages.
        number: id of the plot.

    Raises:
        UsageError: there is no such plot, or Halfstep cannot draw its kind.
        SceneError: the text has faults, all of which the message lists.
    """
    document = read(path, given)
    plots = [*document.root.find_all("plots")]
    if document.root.name == "geometry":
        document = read(path.with_name("plots.xml"), str(path.with_name("plots.xml")))
        plots = [document.root]
    elements = [element for each in plots for element in each.find_all("plot")]
    numbers = {Fields(document, each).integer("id"): each for each in elements}
    if number not in numbers:
        known = ", ".join(str(each) for each in numbers) or "none"
        raise UsageError(f"--plot: there is no plot {number} in {document.name}; there are {known}")
    plot = _plot(document, numbers[number], number)
    document.check()
    if plot.kind == WIRES:
        warnings.warn(f"{plot.title} is of wires; it is drawn solid", stacklevel=2)
    return plot


def _plot(document: Document, element: Element, number: int) -> Plot:
    fields = Fields(document, element)
    kind = fields.text("type", "slice").lower()
    kind = _OLD_NAMES.get(kind, kind)
    title = f"plot {number} of {document.name}"
    if kind not in (SLICE, SOLID, WIRES):
        raise UsageError(f"--plot: {title} is a {kind}; drawn are slices and those traced by rays")
    color_by = fields.text("color_by", "cell").lower()
    if color_by not in COLORS[:2]:
        fields.fault(f"color_by: {color_by} is neither cell nor material")
    colors = _colors(document, element)
    size = SIZE
    if fields.value("pixels") is not None and (pixels := fields.integers("pixels", least=1)):
        if len(pixels) == 2:
            size = pixels[0], pixels[1]
        else:
            fields.fault("pixels: are not two numbers")
    plot = Plot(title, kind, color_by, colors, {}, {})
    if kind == SLICE:
        return _slice(document, element, plot, size)
    return _raytrace(fields, plot, size)


def _raytrace(fields: Fields, plot: Plot, size: tuple[int, int]) -> Plot:
    width, height = size
    camera: Table = {
        "center": fields.floats("camera_position", [3]),
        "look_at": fields.floats("look_at", [3], required=False) or (0.0, 0.0, 0.0),
        "up": fields.floats("up", [3], required=False) or (0.0, 0.0, 1.0),
    }
    if fields.value("field_of_view") is not None:
        warnings.warn(
            f"{plot.title}: OpenMC passes over field_of_view; horizontal_field_of_view is its name",
            stacklevel=2,
        )
    across = fields.floats("horizontal_field_of_view", [1], required=False) or (FOV_DEGREES,)
    if not 0 < across[0] < 180:
        fields.fault(f"horizontal_field_of_view: {across[0]:g} is not between 0 and 180")
        across = (FOV_DEGREES,)
    parallel = fields.floats("orthographic_width", [1], required=False) or (0.0,)
    if parallel[0] < 0:
        fields.fault(f"orthographic_width: {parallel[0]:g} is not >= 0")
    elif parallel[0]:
        camera["orthographic_height"] = parallel[0] * height / width
    else:
        up = math.tan(math.radians(across[0]) / 2) * height / width
        camera["fov_degrees"] = math.degrees(2 * math.atan(up))
    light = fields.floats("light_position", [3], required=False)
    opaque = fields.integers("opaque_ids") if fields.value("opaque_ids") is not None else None
    image = {"width": width, "height": height, "background": _rgb(fields, "background") or WHITE}
    tables: Table = {"image": image}
    if light is not None:
        tables["light"] = [{"position": list(light)}]
    return replace(
        plot,
        camera=camera,
        tables=tables,
        opaque=None if opaque is None else frozenset(opaque),
    )


def _slice(document: Document, element: Element, plot: Plot, size: tuple[int, int]) -> Plot:
    fields = Fields(document, element)
    basis = fields.text("basis", "xy").lower()
    if basis not in _BASES:
        fields.fault(f"basis: {basis} is none of {', '.join(_BASES)}")
        basis = "xy"
    origin = fields.floats("origin", [3]) or (0.0, 0.0, 0.0)
    extent = fields.floats("width", [2]) or (1.0, 1.0)
    if min(extent) <= 0:
        fields.fault(f"width: {min(extent):g} is not > 0")
        extent = (1.0, 1.0)
    columns, rows = size
    # Halfstep's pixels are square, so the number of rows may differ.
    square = max(round(columns * extent[1] / extent[0]), 1)
    if square != rows:
        message = f"{plot.title} has pixels that are not square; it is drawn {columns}x{square}"
        warnings.warn(message, stacklevel=2)
    direction, up = VIEWS[basis]
    center = np.array(origin) + max(extent) * np.array(direction)
    letter, side, sign = _BASES[basis]
    axis = "xyz".index(letter)
    behind = origin[axis] + sign * _THICKNESS * max(extent)
    # A box larger than the visible part of the plane.
    reach = np.full(3, max(extent))
    around = np.array([origin - reach, origin + reach])
    around[:, axis] = sorted((origin[axis], behind))
    mask = None
    for table in element.find_all("mask"):
        of_mask = Fields(document, table)
        components = of_mask.integers("components") or ()
        mask = Mask(frozenset(components), _rgb(of_mask, "background") or WHITE)
    other = ">=" if side == "<=" else "<="
    return replace(
        plot,
        camera={
            "center": center.tolist(),
            "look_at": list(origin),
            "up": list(up),
            "orthographic_height": extent[1],
        },
        tables={
            "image": {
                "width": columns,
                "height": square,
                "background": _rgb(fields, "background") or WHITE,
            },
            **_FLAT,
        },
        clip=(f"{letter} {side} {origin[axis]!r} & {letter} {other} {behind!r}",),
        mask=mask,
        around=around,
    )


def _colors(document: Document, element: Element) -> dict[int, list[float]]:
    found: dict[int, list[float]] = {}
    for color in element.find_all("color"):
        fields = Fields(document, color)
        number, rgb = fields.integer("id"), _rgb(fields, "rgb")
        if number is not None and rgb is not None:
            found[number] = rgb
    return found


def _rgb(fields: Fields, key: str) -> list[float] | None:
    """The linear RGB of a colour given by three numbers 0…255."""
    if fields.value(key) is None:
        return None
    numbers = fields.integers(key)
    if numbers is None:
        return None
    if len(numbers) != 3 or max(numbers) > 255:
        fields.fault(f"{key}: is not three numbers 0…255")
        return None
    return linear(np.array(numbers) / 255).tolist()
