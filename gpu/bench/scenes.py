"""The scenes of the benchmark, generated so that they can have any size."""

from __future__ import annotations

import math
from typing import Any

from halfstep.scene import Scene

_COLORS = ((0.8, 0.5, 0.2), (0.2, 0.5, 0.8), (0.6, 0.7, 0.3), (0.7, 0.3, 0.4))
# The weight of what mirrors show.
_REFLECTION = 0.25
# Side of the square that holds the lattices of `equal_coverage`. Its area is the total area of
# their spheres.
_SIDE = 8.0


def overlapping() -> Scene:
    """Sixteen spheres and ellipsoids. Each hides a part of its neighbours."""
    solids: list[dict[str, Any]] = []
    for k in range(16):
        x, z = 1.5 * (k % 4) - 2.25, 1.5 * (k // 4) - 2.25
        solid: dict[str, Any] = {"origin": (x, 0.4 * (k % 3), z), "color": _COLORS[k % 4]}
        if k % 2:
            solid |= {"kind": "ellipsoid", "semi_axes": (1.2, 0.9, 1.0)}
        else:
            solid |= {"kind": "sphere", "radius": 1.1}
        solids.append(solid)
    return _seen(solids)


def covering(count: int = 16) -> Scene:
    """Spheres so large that every ray of a square picture meets each of them."""
    solids = [
        {"kind": "sphere", "radius": 20.0, "origin": (0.0, 0.1 * k, 0.0), "color": _COLORS[k % 4]}
        for k in range(count)
    ]
    return _seen(solids, distance=40.0)


def equal_coverage(count: int) -> Scene:
    """``count`` spheres in a lattice with the same total area at any number. Neighbours overlap."""
    columns = math.ceil(math.sqrt(count))
    across, down = _SIDE / columns, _SIDE / math.ceil(count / columns)
    radius = _SIDE / math.sqrt(math.pi * count)
    solids = [
        {
            "kind": "sphere",
            "radius": radius,
            "origin": (
                (k % columns + 0.5) * across - _SIDE / 2,
                0.5 * radius * math.sin(k),
                (k // columns + 0.5) * down - _SIDE / 2,
            ),
            "color": _COLORS[k % 4],
        }
        for k in range(count)
    ]
    return _seen(solids)


def mixed(count: int) -> Scene:
    """``count`` solids of eleven sorts in turn, in a lattice, with different rotations."""
    ends = {"z_min": -0.4, "z_max": 0.4}
    sorts: list[dict[str, Any]] = [
        {"kind": "sphere", "radius": 0.4},
        {"kind": "sphere", "radius": 0.4, "cut": [(1.0, 1.0, 1.0, 0.1)]},
        {"kind": "ellipsoid", "semi_axes": (0.4, 0.3, 0.2)},
        {"kind": "cylinder", "radius": 0.3, **ends},
        {"kind": "cone", "slope": 0.5, **ends},
        {"kind": "hyperboloid_one_sheet", "waist": 0.2, "c": 0.3, **ends},
        {"kind": "hyperboloid_two_sheets", "a": 0.2, "c": 0.1, **ends},
        {"kind": "paraboloid", "a": 0.5, "z_max": 0.4},
        {"kind": "box", "size": (0.6, 0.5, 0.4)},
        {
            "kind": "polyhedron",
            "half_spaces": [(1, 1, 1, 0.4), (-1, -1, 1, 0.4), (-1, 1, -1, 0.4), (1, -1, -1, 0.4)],
        },
        {"kind": "plane", "axis": (0.3, 0.4, 1.0)},
    ]
    columns = math.ceil(math.sqrt(count))
    solids = []
    for k in range(count):
        x, y = k % columns - columns / 2, k // columns - columns / 2
        solid = {**sorts[k % len(sorts)], "origin": (x, y, 0.0), "color": _COLORS[k % 4]}
        if solid["kind"] == "plane":
            solid["bounds"] = {"min": (x - 0.4, y - 0.4, -0.4), "max": (x + 0.4, y + 0.4, 0.4)}
        else:
            solid["rotation_degrees"] = (k % 360, 2 * k % 360, 3 * k % 360)
        solids.append(solid)
    return _seen(solids, distance=1.5 * columns)


def pins(side: int) -> Scene:
    """``side`` x ``side`` fuel rods in tubes: copies of a group with five surfaces."""
    group: dict[str, Any] = {
        "name": "pin",
        "surface": [
            {"id": 1, "kind": "cylinder", "radius": 0.41},
            {"id": 2, "kind": "cylinder", "radius": 0.42},
            {"id": 3, "kind": "cylinder", "radius": 0.48},
            {"id": 4, "kind": "plane", "origin": (0.0, 0.0, -2.0)},
            {"id": 5, "kind": "plane", "origin": (0.0, 0.0, 2.0)},
        ],
        "cell": [
            {"name": "fuel", "region": "-1 4 -5", "color": _COLORS[0]},
            {"name": "tube", "region": "2 -3 4 -5", "color": _COLORS[1]},
        ],
    }
    across = 1.26 * side
    camera = {
        "center": (0.9 * across, -1.2 * across, 0.8 * across + 2),
        "look_at": (0.0, 0.0, 0.0),
        "fov_degrees": 40.0,
    }
    lattice = {"kind": "rectangular", "pitch": (1.26, 1.26), "shape": (side, side), "group": "pin"}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": camera,
            "light": [{"direction": (1.0, -1.0, 2.0)}],
            "group": [group],
            "lattice": [lattice],
        }
    )


def channels(rings: int) -> Scene:
    """A block with 1 + 3 rings (rings + 1) channels side by side, which is one cell."""
    surfaces: list[dict[str, Any]] = [
        {"id": 1, "kind": "cylinder", "radius": rings + 1.0},
        {"id": 2, "kind": "plane", "origin": (0.0, 0.0, -float(rings))},
        {"id": 3, "kind": "plane", "origin": (0.0, 0.0, float(rings))},
    ]
    for j in range(-rings, rings + 1):
        for i in range(max(-rings, -rings - j), min(rings, rings - j) + 1):
            origin = (i + j / 2, math.sqrt(0.75) * j, 0.0)
            number = len(surfaces) + 1
            surfaces.append({"id": number, "kind": "cylinder", "radius": 0.35, "origin": origin})
    outside = " ".join(str(surface["id"]) for surface in surfaces[3:])
    camera = {
        "center": (1.6 * rings, -2.4 * rings, 3.2 * rings),
        "look_at": (0.0, 0.0, 0.0),
        "fov_degrees": 40.0,
    }
    return Scene.from_dict(
        {
            "format": 1,
            "camera": camera,
            "light": [{"direction": (1.0, -1.0, 2.0)}],
            "surface": surfaces,
            "cell": [{"region": f"-1 2 -3 {outside}", "color": _COLORS[0]}],
        }
    )


def torus() -> Scene:
    """A torus that covers a third of a picture."""
    solid = {"kind": "torus", "major": 1.0, "minor": 0.4, "color": _COLORS[0]}
    return _tilted([solid])


def torus_of_roots() -> Scene:
    """The torus of `torus` by a formula that is not a polynomial."""
    formula = "(sqrt(x^2 + y^2) - 1)^2 + z^2 - 0.16"
    return _tilted([_in_ball(formula, 1.5)])


def cubic() -> Scene:
    """Clebsch's diagonal cubic."""
    formula = (
        "81*(x^3+y^3+z^3) - 189*(x^2*y+x^2*z+y^2*x+y^2*z+z^2*x+z^2*y) + 54*x*y*z"
        " + 126*(x*y+x*z+y*z) - 9*(x^2+y^2+z^2) - 9*(x+y+z) + 1"
    )
    return _tilted([_in_ball(formula, 1.3)])


def gyroid() -> Scene:
    """A gyroid."""
    formula = "sin(4*x)*cos(4*y) + sin(4*y)*cos(4*z) + sin(4*z)*cos(4*x)"
    return _tilted([_in_ball(formula, 1.5)])


def _in_ball(formula: str, radius: float) -> dict[str, Any]:
    bounds = {"radius": radius}
    return {"kind": "implicit", "formula": formula, "bounds": bounds, "color": _COLORS[0]}


def _tilted(solids: list[dict[str, Any]]) -> Scene:
    """A scene of solids around the origin, seen from the side and from above."""
    camera = {"center": (1.6, -3.6, 2.6), "look_at": (0.0, 0.0, 0.0), "fov_degrees": 36.0}
    light = {"direction": (1.0, -1.0, 2.0)}
    return Scene.from_dict({"format": 1, "camera": camera, "light": [light], "solid": solids})


def mirroring(scene: Scene) -> Scene:
    """A scene of solids that all reflect a part of the light, once, besides their own colours."""
    tables = scene.model_dump(by_alias=True, exclude_none=True)
    materials: list[dict[str, Any]] = []
    for solid, table in zip(scene.solids, tables["solid"], strict=True):
        material = scene.material_of(solid).model_dump(exclude_none=True)
        table.pop("color", None)
        table["material"] = f"mirror_{len(materials)}"
        materials.append({**material, "name": table["material"], "reflection": _REFLECTION})
    image = {**tables["image"], "bounces": 1}
    return Scene.from_dict({**tables, "image": image, "material": materials})


def _seen(solids: list[dict[str, Any]], distance: float = 11.0) -> Scene:
    camera = {"center": (0.0, -distance, 0.0), "look_at": (0.0, 0.0, 0.0), "fov_degrees": 40.0}
    light = {"direction": (1.0, -1.0, 2.0)}
    return Scene.from_dict({"format": 1, "camera": camera, "light": [light], "solid": solids})
