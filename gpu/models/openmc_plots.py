"""Plots of OpenMC that are traced by rays: where the camera is, what is seen, and in which colours.

Of a plot's keys those are read that Halfstep can draw. Angles of view are horizontal there.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

from halfstep.errors import UsageError
from halfstep.models.fields import Fields
from halfstep.models.look import COLORS, Table, linear
from halfstep.models.markup import Document, Element, read
from halfstep.scene.values import Vector

SOLID, WIRES = "solid_raytrace", "wireframe_raytrace"
_OLD_NAMES = {"phong": SOLID, "projection": WIRES}
FOV_DEGREES = 70.0
SIZE = (400, 400)


@dataclass(frozen=True)
class Plot:
    """One plot.

    Attributes:
        title: what it is called, for people.
        is_solid: solids are drawn, not their edges.
        color_by: ``material`` or ``cell``.
        colors: linear RGB by the number of a material or cell.
        opaque: numbers of the materials or cells that are seen; None for all but void.
        camera: keys of the scene's camera.
        image: keys of the scene's image.
        light: position of the light, None where it shines from the camera.
    """

    title: str
    is_solid: bool
    color_by: str
    colors: dict[int, list[float]]
    opaque: frozenset[int] | None
    camera: Table
    image: Table
    light: Vector | None


def read_plot(path: Path, given: str, number: int) -> Plot:
    """A plot of a model, or of the ``plots.xml`` beside a geometry.

    Args:
        path: of the model or geometry.
        given: how messages call it.
        number: id of the plot.

    Raises:
        UsageError: there is no such plot, or it is of a kind that is not drawn.
        SceneError: with every fault of its text.
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
    if not plot.is_solid:
        warnings.warn(f"{plot.title} is of wires; it is drawn solid", stacklevel=2)
    return plot


def _plot(document: Document, element: Element, number: int) -> Plot:
    fields = Fields(document, element)
    kind = fields.text("type", "slice").lower()
    kind = _OLD_NAMES.get(kind, kind)
    title = f"plot {number} of {document.name}"
    if kind not in (SOLID, WIRES):
        raise UsageError(f"--plot: {title} is a {kind}; drawn are those traced by rays")
    if fields.value("orthographic_width") is not None:
        raise UsageError(f"--plot: {title} has parallel rays, which are not drawn")
    color_by = fields.text("color_by", "cell").lower()
    if color_by not in COLORS[:2]:
        fields.fault(f"color_by: {color_by} is neither cell nor material")
    width, height = SIZE
    if fields.value("pixels") is not None and (pixels := fields.integers("pixels", least=1)):
        if len(pixels) == 2:
            width, height = pixels
        else:
            fields.fault("pixels: are not two numbers")
    across = fields.floats("field_of_view", [1], required=False) or (FOV_DEGREES,)
    if not 0 < across[0] < 180:
        fields.fault(f"field_of_view: {across[0]:g} is not between 0 and 180")
        across = (FOV_DEGREES,)
    up = math.tan(math.radians(across[0]) / 2) * height / width
    light = fields.floats("light_position", [3], required=False)
    opaque = fields.integers("opaque_ids") if fields.value("opaque_ids") is not None else None
    return Plot(
        title=title,
        is_solid=kind == SOLID,
        color_by=color_by,
        colors=_colors(document, element),
        opaque=None if opaque is None else frozenset(opaque),
        camera={
            "center": fields.floats("camera_position", [3]),
            "look_at": fields.floats("look_at", [3], required=False) or (0.0, 0.0, 0.0),
            "up": fields.floats("up", [3], required=False) or (0.0, 0.0, 1.0),
            "fov_degrees": math.degrees(2 * math.atan(up)),
        },
        image={
            "width": width,
            "height": height,
            "background": _rgb(fields, "background") or [1.0, 1.0, 1.0],
        },
        light=None if light is None else (light[0], light[1], light[2]),
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
    """A colour of three numbers 0…255 as light."""
    if fields.value(key) is None:
        return None
    numbers = fields.integers(key)
    if numbers is None:
        return None
    if len(numbers) != 3 or max(numbers) > 255:
        fields.fault(f"{key}: is not three numbers 0…255")
        return None
    return [linear(each / 255) for each in numbers]
