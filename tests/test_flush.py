"""Shadows where solids end in one surface: those behind it hide no light before it."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.host import light as host_light
from halfstep.host.prepare import prepare
from halfstep.scene import Scene, with_overrides
from tests.different import different, on_both

SIZE = (64, 48)
FACING = 0.05
Table = dict[str, Any]
# Solids that share a surface, and a point inside. All that faces a light is lit.
BOX: Table = {"kind": "box", "size": [2, 2, 1.4]}
DRUM: Table = {"kind": "cylinder", "radius": 0.7}
SPHERE: Table = {"kind": "sphere", "radius": 1}
LABEL: Table = {"kind": "plane", "bounds": {"min": [-0.5, -0.8, -1], "max": [0.5, 0.8, 1]}}
FLUSH: dict[str, list[Table]] = {
    "boxes": [{**BOX, "origin": [x, 0, 0]} for x in (-0.5, 0.5)],
    "drums": [{**DRUM, "z_min": -1, "z_max": 0.4}, {**DRUM, "z_min": -0.3, "z_max": 1}],
    "caps": [{**SPHERE, "cut": [[0, 0, 1, 0.5]]}, {**SPHERE, "cut": [[0, 0, -1, 0.5]]}],
    "label": [BOX, {**LABEL, "origin": [0, 0, 0.7]}],
    "label from behind": [
        BOX,
        {**LABEL, "origin": [0, 0, 0.7], "rotation_degrees": [180, 0, 0]},
    ],
    "twins": [SPHERE, SPHERE],
}


def turn_of(degrees: list[float]) -> Any:
    """The matrix of `rotation_degrees`."""
    found = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[one, one] = turn[two, two] = np.cos(angle)
        turn[two, one] = np.sin(angle)
        turn[one, two] = -turn[two, one]
        found = turn @ found
    return found


def in_copy(solid: Table, number: int) -> tuple[Table, Table]:
    """A solid as a group of one cell, and the place of the group."""
    looks: Table = {key: solid.pop(key) for key in ("color", "material") if key in solid}
    place: Table = {key: solid.pop(key) for key in ("origin", "rotation_degrees") if key in solid}
    cell: Table = {"region": "it", **looks}
    group: Table = {"name": f"group{number}", "part": [{"name": "it", **solid}], "cell": [cell]}
    return group, {"group": group["name"], **place}


def random_flush(
    rng: np.random.Generator, name: str, *, lamp: bool, count: int = 2, copies: int = 0
) -> Scene:
    """The solids, turned and moved together, seen from a random side, with ``count`` lights.

    So many of them are ``copies`` of groups.
    """
    # Bounds of planes are along the axes of the world.
    degrees = [0.0] * 3 if "label" in name else rng.uniform(-180, 180, 3).tolist()
    turn, place = turn_of(degrees), rng.normal(size=3) * 3
    solids = []
    for one in FLUSH[name]:
        origin = place + turn @ np.array(one.get("origin", [0, 0, 0]))
        solid = {"color": [0.7] * 3, "rotation_degrees": degrees, **one, "origin": origin.tolist()}
        if "bounds" in one:
            solid["bounds"] = {end: list(place + at) for end, at in one["bounds"].items()}
        solids.append(solid)
    placed = [in_copy(solid, number) for number, solid in enumerate(solids[:copies])]
    eye = rng.normal(size=3)
    eye = place + turn @ [eye[0], eye[1], abs(eye[2]) + 1] * 3
    towards = rng.normal(size=(count, 3)) + turn[:, 2] * 1.5
    lights = [
        {"position": (place + 6 * each).tolist()} if lamp else {"direction": each.tolist()}
        for each in towards
    ]
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": eye.tolist(), "look_at": place.tolist(), "fov_degrees": 30},
            "light": [{**each, "shadows": True} for each in lights],
            "solid": solids[copies:],
            "group": [group for group, _ in placed],
            "place": [place for _, place in placed],
        }
    )


def faced(scene: Scene, frame: halfstep.Frame) -> list[Any]:
    """For each light the pixels that surely face it."""
    view = prepare(with_overrides(scene, size=SIZE)).setup.view
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    points = view.eye + frame.depth[..., None] * view.directions(i, j)
    normal, found = frame.normal, []
    for light in scene.lights:
        way = np.array(light.direction or light.position)
        way = way - points if light.direction is None else way
        way = way / np.linalg.norm(way, axis=-1, keepdims=True)
        found.append((frame.solid >= 0) & ((normal * way).sum(axis=-1) > FACING))
    return found


def dark_and_lit(scene: Scene, **options: Any) -> tuple[int, int]:
    """How many pixels that face a light are dark, and how many are lit."""
    outputs = ("normal", "depth", "shadow")
    frame = halfstep.render(scene, size=SIZE, outputs=outputs, **options)
    dark = lit = 0
    for bit, own in enumerate(faced(scene, frame)):
        hidden = (frame.shadow >> bit & 1)[own]
        dark, lit = dark + int(hidden.sum()), lit + int((hidden == 0).sum())
    return dark, lit


# Cells need float32, and a patch is none.
SHADOWED = [
    *((name, 0, number_format) for name in FLUSH for number_format in ("float32", "fixed32")),
    *((name, copies, "float32") for name in list(FLUSH)[:3] for copies in (1, 2)),
]


@pytest.mark.parametrize("lamp", [False, True])
@pytest.mark.parametrize(("name", "copies", "number_format"), SHADOWED)
def test_what_faces_a_light_is_lit(
    name: str,
    copies: int,
    number_format: str,
    lamp: bool,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Solids are convex where they face a light. Were surfaces not shared, they would have dots."""
    options = {"backend": "numpy", "number_format": number_format, "steps": 14}
    scenes = [random_flush(rng, name, lamp=lamp, copies=copies) for _ in range(3)]
    counts = [dark_and_lit(scene, **options) for scene in scenes]
    assert sum(dark for dark, _ in counts) == 0
    assert sum(lit for _, lit in counts) > 1500
    monkeypatch.setattr(host_light, "shared_sides", nothing_shared)
    assert sum(dark_and_lit(scene, **options)[0] for scene in scenes) > 20


def nothing_shared(*_: Any) -> None:
    """What `shared_sides` finds where no surfaces are shared."""


def seen_in_mirrors(scene: Scene) -> tuple[int, int]:
    """How many pixels of mirrors show a solid, and how many the background."""
    frame = halfstep.render(scene, size=SIZE, outputs=("color",), backend="numpy", steps=14)
    shown = frame.solid >= 0
    background = np.isclose(frame.color, [0, 0.75, 0]).all(axis=-1) & shown
    return int((shown & ~background).sum()), int(background.sum())


@pytest.mark.parametrize(
    ("name", "copies"), [case[:2] for case in SHADOWED if case[2] == "float32"]
)
def test_mirrors_show_what_is_before_them(
    name: str, copies: int, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No ray from a convex solid meets it. Were surfaces not shared, some would."""
    scenes = [mirroring(random_flush(rng, name, lamp=False, copies=copies)) for _ in range(3)]
    counts = [seen_in_mirrors(scene) for scene in scenes]
    assert sum(solid for solid, _ in counts) == 0
    assert sum(background for _, background in counts) > 1000
    monkeypatch.setattr(host_light, "shared_sides", nothing_shared)
    assert sum(seen_in_mirrors(scene)[0] for scene in scenes) > 20


def mirroring(scene: Scene) -> Scene:
    """Black mirrors under a green sky."""
    tables = tomllib.loads(scene.to_toml())
    cells = (cell for group in tables.get("group", []) for cell in group["cell"])
    for solid in (*tables.get("solid", []), *cells):
        del solid["color"]
        solid["material"] = "mirror"
    tables["material"] = [{"name": "mirror", "color": [0, 0, 0], "specular": 0, "reflection": 0.75}]
    tables["image"] = {"background": [0, 1, 0]}
    for each in tables["light"]:
        del each["shadows"]
    return Scene.from_dict(tables)


@pytest.mark.parametrize(("number_format", "copies"), [("fixed32", 0), ("float32", 2)])
@pytest.mark.usefixtures("adapter")
def test_device_and_twin_are_equal(number_format: str, copies: int) -> None:
    """In one scene with a far light and a lamp inside a room whose floor a label lies on."""
    label = {**LABEL, "color": [0.2, 0.4, 0.7]}
    label["bounds"] = {"min": [1.7, -0.8, -1], "max": [2.7, 0.8, 1]}
    boxes: list[Table] = [{"material": "mirror", **one} for one in FLUSH["boxes"]]
    placed = [in_copy(solid, number) for number, solid in enumerate(boxes[:copies])]
    # Mirrors are drawn in float32 alone.
    share = 0.5 if number_format == "float32" else 0.0
    room = {"kind": "box", "size": [9, 9, 9], "origin": [0, 0, 4.5], "color": [0.7] * 3}
    tables = {
        "format": 1,
        "camera": {"center": [1, -3, 4], "look_at": [0, 0, 0.5], "fov_degrees": 50},
        "light": [
            {"position": [0.5, 0.4, 3], "shadows": True},
            {"direction": [0.3, 0.2, 1], "shadows": True},
        ],
        "material": [{"name": "mirror", "color": [0.3] * 3, "reflection": share}],
        "solid": [
            room,
            label,
            *({"material": "mirror", **one} for one in FLUSH["drums"]),
            *boxes[copies:],
        ],
        "group": [group for group, _ in placed],
        "place": [place for _, place in placed],
    }
    scene = Scene.from_dict(tables)
    outputs = ("image", "shadow", "surface")
    frames = on_both(scene, size=SIZE, outputs=outputs, number_format=number_format)
    on_label = frames[0].solid == 1
    assert on_label.sum() > 100
    assert (frames[0].shadow[on_label] & 1 == 0).mean() > 0.5  # the room has the lamp inside
    assert different(*frames) == []


AROUND: list[Table] = [
    {"kind": "sphere", "radius": 2},
    {"kind": "cylinder", "radius": 2, "z_min": -2, "z_max": 2},
    {"kind": "implicit", "formula": "x^4 + y^4 + z^4 - 16", "bounds": {"radius": 3}},
]


@pytest.mark.parametrize("solid", AROUND)
@pytest.mark.parametrize("backend", ["numpy", "gpu"])
@pytest.mark.usefixtures("adapter")
def test_a_lamp_shines_inside_of_solids_that_coincide(solid: Table, backend: str) -> None:
    """They are convex and around the eye, too, so all that is seen is lit."""
    placed = {**solid, "rotation_degrees": [10, 20, 30], "color": [0.5] * 3}
    tables = {
        "format": 1,
        "camera": {"center": [0.3, 0.2, 0.1], "look_at": [1, 2, 0.4], "fov_degrees": 80},
        "light": [{"position": [-0.3, 0.4, 0.2], "shadows": True}],
        "solid": [placed, placed],
    }
    frame = halfstep.render(tables, size=SIZE, outputs=("shadow",), backend=backend)
    assert (frame.solid == 0).all()
    assert (frame.shadow == 0).all()


HIGHER: dict[str, Table] = {
    "torus": {"kind": "torus", "major": 1.0, "minor": 0.35},
    "polynomial": {
        "kind": "implicit",
        "formula": "x^4 + y^4 + z^4 - 1",
        "bounds": {"min": [-1.2] * 3, "max": [1.2] * 3},
    },
    "formula": {
        "kind": "implicit",
        "formula": "sqrt(x^2 + y^2 + z^2 + 0.1) + 0.05*sin(3*x) - 1",
        "bounds": {"min": [-1.3] * 3, "max": [1.3] * 3},
    },
    "sheet": {
        "kind": "implicit",
        "formula": "z - 0.3*x^3 + 0.2*y^2*x",
        "sheet": True,
        "bounds": {"min": [-1] * 3, "max": [1] * 3},
    },
}
# Pieces of a solid whose union is the solid.
WHOLE: tuple[Table, ...] = ({}, {})
HALVES: tuple[Table, ...] = ({"cut": [[0, 0, 1, 0.2]]}, {"cut": [[0, 0, -1, 0.2]]})
PLACED: Table = {"origin": [0.1, 0.2, 0.3], "rotation_degrees": [20, 30, 40]}


def in_pieces(
    names: list[str], pieces: tuple[Table, ...], *, copies: int = 0, share: float = 0.0
) -> Scene:
    """Solids of an order above two in pieces, before two lights; as many are ``copies``."""
    solids = [
        {**HIGHER[name], **piece, **PLACED, "material": "own"} for name in names for piece in pieces
    ]
    placed = [in_copy(solid, number) for number, solid in enumerate(solids[:copies])]
    floor: Table = {"kind": "plane", "origin": [0, 0, -1.5], "color": [0.4, 0.4, 0.5]}
    floor["bounds"] = {"min": [-2.5, -2.5, -1.5], "max": [2.5, 2.5, -1.5]}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [3, -4, 3], "look_at": [0, 0, 0], "fov_degrees": 35},
            "light": [
                {"direction": [1, -1, 2], "shadows": True},
                {"position": [-3, -3, 4], "shadows": True},
            ],
            "material": [{"name": "own", "color": [0.7] * 3, "reflection": share}],
            "solid": [*solids[copies:], floor],
            "group": [group for group, _ in placed],
            "place": [place for _, place in placed],
        }
    )


@pytest.mark.parametrize(
    ("name", "pieces", "copies", "share"),
    [
        ("torus", WHOLE, 0, 0.5),
        ("torus", HALVES, 0, 0.5),
        ("torus", WHOLE, 1, 0.0),
        ("torus", HALVES, 2, 0.0),
        ("polynomial", WHOLE, 0, 0.5),
        ("formula", WHOLE, 0, 0.0),
        ("sheet", WHOLE, 0, 0.5),
    ],
)
def test_pieces_of_a_solid_look_like_the_solid(
    name: str,
    pieces: tuple[Table, ...],
    copies: int,
    share: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They have its shadows and mirror the same. Were surfaces not shared, they would have dots."""
    options: Table = {
        "size": (48, 36),
        "outputs": ("image", "shadow"),
        "backend": "numpy",
        "steps": 16,
    }
    whole = halfstep.render(in_pieces([name], ({},), share=share), **options)
    assert (whole.solid == 0).sum() > 250
    assert (whole.shadow[whole.solid == 0] == 0).sum() > 100

    def dots() -> int:
        frame = halfstep.render(in_pieces([name], pieces, copies=copies, share=share), **options)
        off = (frame.image.astype(int) - whole.image).max(axis=-1)
        return int(((frame.shadow != whole.shadow) | (abs(off) > 2)).sum())

    assert dots() == 0
    monkeypatch.setattr(host_light, "shared_sides", nothing_shared)
    assert dots() > 20


@pytest.mark.parametrize(
    ("names", "copies", "share"), [(["torus", "sheet"], 0, 0.5), (["torus"], 1, 0.0)]
)
@pytest.mark.usefixtures("adapter")
def test_device_and_twin_are_equal_in_pieces(names: list[str], copies: int, share: float) -> None:
    """Of solids, of a solid that coincides with a copy of a group, and in mirrors."""
    scene = in_pieces(names, WHOLE, copies=copies, share=share)
    outputs = ("image", "shadow", "surface", "error")
    frames = on_both(scene, size=(48, 36), outputs=outputs)
    assert (frames[0].surface >= 0).sum() > 500
    assert different(*frames) == []
