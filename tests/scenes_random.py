"""Random scenes of every kind, built as a user builds them: through `Scene.from_dict`.

Sizes run over 1e-6…1e6, distances over 2…1e6 sizes, both log-uniform. A scene is drawn for a
*place* of the camera, because a camera thrown anywhere is hardly ever inside a solid.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError
from halfstep.host.prepare import Solids, frame_setup
from halfstep.scene import PlanePatch, Scene, with_overrides

Table = dict[str, Any]

KINDS = (
    "sphere",
    "ellipsoid",
    "cylinder",
    "cone",
    "hyperboloid_one_sheet",
    "hyperboloid_two_sheets",
    "paraboloid",
    "quadric",
    "box",
    "polyhedron",
    "plane",
)
QUADRICS = KINDS[:8]
OPEN_ENDED = KINDS[2:8]
PLACES = ("outside", "close", "inside", "on the surface", "beyond a cut")


class Drawn(NamedTuple):
    """A scene and how large it is."""

    scene: Scene
    center: Floats  # (3,), about where its solids are
    size: float  # about how far they reach


def random_scene(
    rng: np.random.Generator,
    place: str,
    *,
    most: int = 8,
    kinds: tuple[str, ...] = KINDS,
    ratio: tuple[float, float] = (2.0, 1e6),
) -> Drawn:
    """A scene of 1 to ``most`` solids seen from ``place``.

    Args:
        rng: where the numbers come from.
        place: where the camera is, one of `PLACES`, as seen from the first solid.
        most: greatest number of solids.
        kinds: of the solids.
        ratio: distances in sizes, for the place "outside".
    """
    size = 10.0 ** rng.uniform(-6, 6)
    if place == "on the surface":
        solid, eye = _touched(size, rng)
        origin = np.array(solid["origin"])
        scene = _scene([solid, *_solids(rng, kinds, most - 1, origin, size)], origin, size, rng)
        return Drawn(_looking(scene, eye, origin, size, rng), origin, size)
    center = size * 10.0 ** rng.uniform(-1, 3) * _direction(rng)
    scene = _scene(_solids(rng, kinds, most, center, size), center, size, rng)
    find = {"inside": _point_inside, "beyond a cut": _point_beyond_a_cut}.get(place)
    found = None if find is None else find(scene, size, rng)
    low, high = (0.2, 2.0) if place == "close" else ratio
    distance = size * np.exp(rng.uniform(np.log(low), np.log(high)))
    eye = center + distance * _direction(rng) if found is None else found
    return Drawn(_looking(scene, eye, center, size, rng), center, size)


def intervals(scene: Scene, size: tuple[int, int]) -> tuple[float, float, Floats]:
    """Depths of the base planes, and each solid's interval length (K,), NaN where it is not seen.

    What the accuracy of a frame is stated in: its depth cells are these lengths times 2^-n.
    """
    constants = frame_setup(with_overrides(scene, size=size))
    length = np.full(len(scene.solids), np.nan)
    length[constants.solid] = constants.far * 2.0**-constants.level
    return constants.near, constants.far, length


# ------------------------------------------------------------------------------ solids


def _solids(
    rng: np.random.Generator, kinds: tuple[str, ...], most: int, center: Floats, size: float
) -> list[Table]:
    count = int(rng.integers(1, max(most, 1) + 1))
    return [
        random_solid(
            str(rng.choice(kinds)),
            center + 0.6 * size * rng.normal(size=3),
            size * float(rng.uniform(0.4, 1.0)),
            rng,
        )
        for _ in range(count)
    ]


def random_solid(kind: str, origin: Floats, size: float, rng: np.random.Generator) -> Table:
    """A solid of a kind that reaches about ``size`` from its origin, cut and turned at random."""

    def length(low: float = 0.3, high: float = 1.0) -> float:
        return float(size * rng.uniform(low, high))

    solid: Table = {"kind": kind, "origin": _list(origin)}
    if kind == "plane":
        reach = [length() for _ in range(6)]
        low = _list(origin - reach[:3])
        solid["bounds"] = {"min": low, "max": _list(origin + reach[3:])}
        return solid | {"axis": _list(rng.choice([rng.normal(size=3), np.eye(3)[1]]))}
    if kind == "polyhedron":
        normals = [*np.eye(3), *-np.eye(3), *rng.normal(size=(int(rng.integers(0, 12)), 3))]
        solid["half_spaces"] = [[*_list(n), length()] for n in normals]
    elif kind == "quadric":
        solid |= _quadric(size, rng)
    else:
        shapes: dict[str, Table] = {
            "sphere": {"radius": length()},
            "ellipsoid": {"semi_axes": [length(0.05), length(), length()]},
            "cylinder": {"radius": length(0.1)},
            "cone": {"slope": float(rng.uniform(0.1, 1.5))},
            "hyperboloid_one_sheet": {"waist": length(0.1, 0.6), "c": length()},
            "hyperboloid_two_sheets": {"a": length(), "c": length(0.1, 0.4)},
            "paraboloid": {"a": float(np.sqrt(length()))},
            "box": {"size": [2 * length(), 2 * length(), 2 * length(0.001)]},
        }
        solid |= shapes[kind]
    if kind in OPEN_ENDED and rng.random() < 0.7:
        solid |= {"z_min": -length(), "z_max": length()}
    if kind in QUADRICS and rng.random() < 0.4:
        cuts = rng.normal(size=(int(rng.integers(1, 4)), 3))
        solid["cut"] = [[*_list(normal), length(-0.3, 0.8)] for normal in cuts]
    return solid | _orientation(rng)


def _quadric(size: float, rng: np.random.Generator) -> Table:
    """Any quadric: definite, indefinite, or degenerate (parabolic, or without some variables)."""
    matrix, linear = rng.normal(size=(3, 3)), rng.normal(size=3)
    form = rng.random()
    if form < 0.4:
        matrix, linear = matrix @ matrix.T + 0.2 * np.eye(3), linear * 0.1
    elif form < 0.6:
        matrix[:, 2] = matrix[2] = 0.0
        linear[rng.integers(3)] = 0.0
    matrix = matrix + matrix.T
    terms = [*(np.diag(matrix) / 2), matrix[0, 1], matrix[0, 2], matrix[1, 2], *linear]
    one = -abs(rng.normal()) if form < 0.7 else rng.normal()
    scales = [size**-2] * 6 + [1 / size] * 3 + [1.0]
    coefficients = _list(np.array([*terms, one]) * scales)
    if rng.random() < 0.5:
        return {"coefficients": coefficients}
    walls = [[x, y, 0.0, size] for x, y in ((1.0, 0.5), (-1.0, 0.3), (0.1, 1.0), (-0.2, -1.0))]
    return {"coefficients": coefficients, "z_min": -size, "z_max": size, "cut": walls}


def _orientation(rng: np.random.Generator) -> Table:
    form = rng.random()
    if form < 0.1:
        return {}
    if form < 0.2:
        return {"rotation_degrees": _list(90.0 * rng.integers(-2, 3, 3))}
    if form < 0.6:
        return {"rotation_degrees": _list(rng.uniform(-180, 180, 3))}
    return {"axis": _list(rng.normal(size=3))}


# ------------------------------------------------------------------------------ cameras


def _touched(size: float, rng: np.random.Generator) -> tuple[Table, Floats]:
    """A solid in whole powers of two, and a point that lies exactly on it."""
    r = float(2.0 ** np.floor(np.log2(size)))
    a = float(2.0 ** np.floor(np.log2(size) / 2))
    octahedron = [[x, y, z, r] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    cases: list[tuple[Table, tuple[float, float, float]]] = [
        ({"kind": "sphere", "radius": r}, (0.0, r, 0.0)),
        ({"kind": "ellipsoid", "semi_axes": [r, 2 * r, r / 2]}, (0.0, 0.0, r / 2)),
        ({"kind": "cylinder", "radius": r, "z_min": -r, "z_max": r}, (-r, 0.0, r / 4)),
        ({"kind": "cylinder", "radius": r, "z_min": -r, "z_max": r}, (r / 4, r / 8, r)),
        ({"kind": "cone", "slope": 0.5, "z_min": -r, "z_max": r}, (0.0, r / 4, -r / 2)),
        ({"kind": "hyperboloid_one_sheet", "waist": r / 2, "c": r}, (r / 2, 0.0, 0.0)),
        ({"kind": "hyperboloid_two_sheets", "a": r, "c": r / 2}, (0.0, 0.0, -r / 2)),
        ({"kind": "paraboloid", "a": a, "z_max": a * a}, (a * a / 2, 0.0, a * a / 4)),
        ({"kind": "box", "size": [2 * r, r, r]}, (r / 4, r / 2, -r / 8)),
        ({"kind": "box", "size": [2 * r, r, r]}, (r, r / 2, r / 2)),
        ({"kind": "polyhedron", "half_spaces": octahedron}, (r / 4, r / 2, -r / 4)),
    ]
    solid, point = cases[rng.integers(len(cases))]
    origin = r * rng.integers(-8, 9, 3)
    return {"origin": _list(origin), **solid}, origin + np.array(point)


def _point_inside(scene: Scene, size: float, rng: np.random.Generator) -> Floats | None:
    """A world point inside the first solid, if one is found."""
    return _point(scene, size, rng, lambda F, f: (F <= 0) & (f <= 0).all(axis=1))


def _point_beyond_a_cut(scene: Scene, size: float, rng: np.random.Generator) -> Floats | None:
    """A world point inside the infinite surface of the first solid, but outside a plane."""
    return _point(scene, size, rng, lambda F, f: (F <= 0) & (f > 0).any(axis=1))


def _point(scene: Scene, size: float, rng: np.random.Generator, wanted: Any) -> Floats | None:
    solid = scene.solids[0]
    if isinstance(solid, PlanePatch):
        return None
    points = size * rng.uniform(-1.5, 1.5, (400, 3))
    rows = solid.half_spaces()
    f = points @ rows[:, :3].T - rows[:, 3]
    F = np.full(len(points), -1.0)
    if solid.kind in QUADRICS:
        p = np.column_stack([points, np.ones(len(points))])
        F = np.einsum("ni,ij,nj->n", p, solid.quadric(), p)
    found = points[wanted(F, f)]
    return found[0] @ solid.world_from_local().T + solid.origin if len(found) else None


def _looking(
    scene: Scene, eye: Floats, center: Floats, size: float, rng: np.random.Generator
) -> Scene:
    """The scene seen from ``eye``: everything in the picture, or some of it from nearby."""
    distance = float(np.linalg.norm(center - eye))
    if distance < 1.5 * size:
        look_at = eye + size * _direction(rng) + 0.7 * (center - eye)
        fov = float(rng.uniform(40, 110))
    else:
        look_at = center + 0.3 * size * rng.normal(size=3)
        fov = float(np.degrees(2 * np.arctan(rng.uniform(0.5, 1.5) * size / distance)))
    camera = {
        "center": _list(eye),
        "look_at": _list(look_at),
        "up": _list(rng.normal(size=3)),
        "fov_degrees": fov,
    }
    return with_overrides(scene, camera=camera)


def _scene(solids: list[Table], center: Floats, size: float, rng: np.random.Generator) -> Scene:
    """The solids, with a volume that may cut them; always with one where none is bounded."""
    tables: Table = {
        "format": 1,
        "camera": {"center": [0.0, -1.0, 0.0], "look_at": [0.0, 0.0, 0.0]},
        "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
    }
    low, high = center - size * rng.uniform(0.2, 2.0, 3), center + size * rng.uniform(0.2, 2.0, 3)
    volume = {"min": _list(low), "max": _list(high)}
    if rng.random() < 0.4:
        return Scene.from_dict(tables | {"volume": volume})
    scene = Scene.from_dict(tables)
    try:
        Solids.of(scene)
    except SceneError:
        return Scene.from_dict(tables | {"volume": volume})
    return scene


def _direction(rng: np.random.Generator) -> Floats:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _list(vector: Any) -> list[float]:
    return [float(v) for v in vector]
