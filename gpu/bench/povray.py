"""Renders the same picture by POV-Ray, if it is installed."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from halfstep.bench.povray_cells import finish, objects, placed, vector
from halfstep.host.geometry import build
from halfstep.host.world import solid_boxes
from halfstep.scene import (
    Ellipsoid,
    Implicit,
    PlanePatch,
    QuadricSolid,
    Scene,
    Solid,
    Sphere,
    Torus,
)
from halfstep.scene.expression import Node

# POV-Ray needs a bound of the gradient. No formula of the benchmark is steeper than this.
STEEPEST = 8.0
_TRACE = re.compile(r"Trace Time:.*\((\d+\.\d+) seconds\)")


class NoPovrayError(Exception):
    """POV-Ray is not installed, or does not render; the message tells which."""


def version() -> str:
    """The name and version that POV-Ray reports.

    Raises:
        NoPovrayError: POV-Ray is not installed.
    """
    if shutil.which("povray") is None:
        raise NoPovrayError("POV-Ray is not installed")
    done = subprocess.run(["povray", "--version"], capture_output=True, text=True)
    named = re.search(r"^POV-Ray \S+", done.stdout + done.stderr, re.MULTILINE)
    return named[0] if named else "POV-Ray"


def trace_time(
    scene: Scene, size: tuple[int, int], threads: int, picture: Path | None = None
) -> float:
    """The time in ms that POV-Ray reports for tracing ``scene``, without parsing and writing.

    Args:
        scene: the scene; `text` says which kinds of solids it may have.
        size: (width, height) in pixels.
        threads: the most threads that POV-Ray may use.
        picture: path for a PNG file; None writes none.

    Raises:
        NoPovrayError: POV-Ray is not installed or fails.
    """
    version()
    width, height = size
    output = "-F" if picture is None else f"+FN +O{picture}"
    with tempfile.TemporaryDirectory(prefix="halfstep-") as folder:
        source = Path(folder) / "scene.pov"
        source.write_text(text(scene, width / height))
        done = subprocess.run(
            [
                *("povray", f"+I{source}", f"+W{width}", f"+H{height}", f"+WT{threads}"),
                *("-D", "-A", *output.split()),
            ],
            cwd=folder,
            capture_output=True,
            text=True,
        )
    found = _TRACE.search(done.stderr)
    if done.returncode or found is None:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise NoPovrayError(f"povray does not render: {last}")
    return float(found[1]) * 1e3


def text(scene: Scene, aspect: float) -> str:
    """The text of a scene in POV-Ray's language.

    The scene may have cells, and solids that have an end; tori, and formulas in a ball, without
    rotation. Polynomials become ``poly``, solved by Sturm's theorem, and other formulas
    ``isosurface``. Lights have shadows where the scene's have, so that both programs compute the
    same picture, but for highlights.
    """
    camera = scene.camera
    assert camera.fov_degrees is not None
    levels = scene.image.bounces + 1 if any(each.reflection for each in scene.materials) else 1
    lines = [
        "#version 3.7;",
        f"global_settings {{ assumed_gamma 1 max_trace_level {levels} ambient_light rgb 1 }}",
        f"background {{ rgb {vector(scene.image.background)} }}",
        # POV-Ray's axes are left-handed. A negative right vector makes them right-handed.
        f"camera {{ perspective location {vector(camera.center)} sky {vector(camera.up)}"
        f" up y right {-aspect:.17g}*x angle {_horizontal(camera.fov_degrees, aspect):.17g}"
        f" look_at {vector(camera.look_at)} }}",
    ]
    for light in scene.lights:
        place: tuple[float, ...] | None = light.position
        far = ""
        if light.direction is not None:
            place, far = tuple(1e6 * part for part in light.direction), " parallel point_at 0"
        lines.append(
            f"light_source {{ {vector(place)} rgb {vector(light.color)}{far}"
            f"{'' if light.shadows else ' shadowless'} }}"
        )
    is_joined = [_is_joined(solid) for solid in scene.solids]
    boxes = solid_boxes(build(scene)) if any(is_joined) else np.empty((0, 0, 0))
    for ix, solid in enumerate(scene.solids):
        look = finish(scene.material_of(solid), scene)
        if is_joined[ix]:
            low, high = boxes[..., ix]
            # What has no thickness is bounded by what has some.
            room = 1e-6 * float(np.abs(boxes[..., ix]).max())
            low, high = low - room, high + room
            bounds = f"bounded_by {{ box {{ {vector(low)}, {vector(high)} }} }}"
            lines.append(f"{_joined(solid)} {placed(solid)} {bounds} {look} }}")
        else:
            lines.append(f"{_shape(solid)} translate {vector(solid.origin)} {look} }}")
    lines += objects(scene)
    return "\n".join(lines) + "\n"


def _is_joined(solid: Solid) -> bool:
    """Whether a solid is written as what its quadric and half-spaces have in common."""
    if isinstance(solid, Torus | Implicit):
        return False
    is_turned = not np.array_equal(solid.world_from_local(), np.eye(3))
    return not isinstance(solid, Sphere | Ellipsoid) or bool(is_turned or len(solid.half_spaces()))


def _joined(solid: Solid) -> str:
    """The beginning of the text of what a quadric and half-spaces have in common."""
    rows = solid.half_spaces()
    lengths = np.linalg.norm(rows[:, :3], axis=1)
    planes = [
        f"plane {{ {vector(row[:3])}, {row[3] / length:.17g}"
        for row, length in zip(rows, lengths, strict=True)
    ]
    if isinstance(solid, PlanePatch):
        bounds = " ".join(f"{plane} }}" for plane in planes[1:])
        return f"{planes[0]} clipped_by {{ intersection {{ {bounds} }} }}"
    parts = [f"{plane} }}" for plane in planes]
    q = solid.quadric() if isinstance(solid, QuadricSolid) else np.zeros((4, 4))
    if q.any():
        squares, products = q[[0, 1, 2], [0, 1, 2]], 2 * q[[0, 0, 1], [1, 2, 2]]
        terms = ", ".join(map(vector, (squares, products, 2 * q[:3, 3])))
        parts.insert(0, f"quadric {{ {terms}, {q[3, 3]:.17g} }}")
    return f"intersection {{ {' '.join(parts)}"


def _shape(solid: Solid) -> str:
    """The beginning of a solid's text, up to its placement."""
    match solid:
        case Sphere():
            return f"sphere {{ 0, {solid.radius:.17g}"
        case Ellipsoid():
            return f"sphere {{ 0, 1 scale {vector(solid.semi_axes)}"
        case Torus():
            # The axis of POV-Ray's torus is y, and must become z.
            return f"torus {{ {solid.major:.17g}, {solid.minor[0]:.17g} rotate 90*x"
    assert isinstance(solid, Implicit)
    ball = f"sphere {{ 0, {solid.bounds.radius:.17g} }}"
    if solid.has_polynomial:
        terms, degree = solid.polynomial(), solid.degree()
        values = [
            float(terms.get((i, j, k), 0))
            for i in range(degree, -1, -1)
            for j in range(degree - i, -1, -1)
            for k in range(degree - i - j, -1, -1)
        ]
        return f"intersection {{ poly {{ {degree}, {vector(tuple(values))} sturm }} {ball}"
    function = _function(solid.expression())
    steepest = f"max_gradient {STEEPEST:.17g}"
    return f"isosurface {{ function {{ {function} }} contained_by {{ {ball} }} {steepest}"


def _function(node: Node) -> str:
    """A formula in POV-Ray's language."""
    if node.kind == "number":
        return f"({float(node.value):.17g})"
    if node.kind == "coordinate":
        return "xyz"[int(node.value)]
    parts = [_function(operand) for operand in node.operands]
    if node.kind == "^":
        return f"pow({parts[0]}, {parts[1]})"
    if len(node.kind) == 1:
        return f"({parts[0]} {node.kind} {parts[1]})"
    return f"{node.kind}({', '.join(parts)})"


def _horizontal(vertical_degrees: float, aspect: float) -> float:
    """The horizontal angle of view in degrees."""
    half = math.tan(math.radians(vertical_degrees) / 2) * aspect
    return 2 * math.degrees(math.atan(half))
