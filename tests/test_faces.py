"""Half-spaces given twice, planes written as quadrics, and solids without thickness."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Floats
from halfstep.frames.frame import Frame
from halfstep.host.camera import view
from halfstep.host.faces import Faces, alone, distinct, slab_of
from halfstep.host.geometry import build
from halfstep.scene import MAX_HALF_SPACES, Scene

Table = dict[str, Any]

SIZE = (64, 48)
FORMATS = (("float32", 10), ("float32", 20), ("fixed32", 14))
METHODS = ("visible", "article")
OUTPUTS = ("solid", "surface", "depth", "depth_exit", "normal", "error")


def _scene(*solids: Table, eye: Any = (3.0, -6.0, 4.0), volume: float | None = None) -> Scene:
    tables: Table = {
        "format": 1,
        "camera": {"center": list(eye), "look_at": [0.0, 0.0, 0.0]},
        "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
    }
    if volume is not None:
        tables["volume"] = {"min": [-volume] * 3, "max": [volume] * 3}
    return Scene.from_dict(tables)


def _frame(scene: Scene, form: tuple[str, int], method: str = "visible") -> Frame:
    return halfstep.render(
        scene,
        size=SIZE,
        number_format=form[0],
        steps=form[1],
        method=method,
        backend="numpy",
        outputs=OUTPUTS,
    )


def _numbers(solid: Table) -> list[int]:
    """Which half-spaces of the file are left."""
    return build(_scene(solid, volume=9.0)).plane_number.tolist()


# ------------------------------------------------------------------------------ repetitions


def _exactly_distinct(rows: list[list[int]]) -> list[int]:
    """Of half-spaces with one normal, the tightest; of equal ones the first."""
    best: dict[tuple[Fraction, ...], tuple[Fraction, int]] = {}
    for number, row in enumerate(rows):
        length = max(map(abs, row[:3]))
        normal = tuple(Fraction(n, length) for n in row[:3])
        own = Fraction(row[3], length), number
        best[normal] = min(best.get(normal, own), own)
    return sorted(number for _, number in best.values())


def test_of_one_normal_the_tightest_is_left_and_of_equals_the_first(
    rng: np.random.Generator,
) -> None:
    dropped = 0
    given, expected = [], []
    for _ in range(400):
        rows = rng.integers(-2, 3, (int(rng.integers(1, 20)), 4))
        rows = rows[np.any(rows[:, :3] != 0, axis=1)] * rng.integers(1, 8)
        number = np.arange(len(rows))
        given.append(alone(rows.astype(np.float64), number, np.zeros(len(rows))))
        expected.append(_exactly_distinct(rows.tolist()))
        dropped += len(rows) - len(expected[-1])
    for faces, found, numbers in zip(given, distinct(given), expected, strict=True):
        assert found.number.tolist() == numbers, faces.rows
        sizes = [
            np.abs(rows[:, :3]).max(axis=1, keepdims=True) for rows in (found.rows, faces.rows)
        ]
        assert np.allclose(found.rows / sizes[0], (faces.rows / sizes[1])[numbers])
    assert dropped > 200


def _rounded(row: Floats, rng: np.random.Generator) -> Floats:
    """The same half-space as another program might write it."""
    form = rng.integers(4)
    if form == 0:
        return row
    if form == 1:
        return row * float(rng.uniform(0.01, 100))
    if form == 2:
        return np.array([float(f"{v:.15g}") for v in row / np.linalg.norm(row[:3])])
    return row * (1 + rng.integers(-4, 5, 4) * 2.0**-53)


def _polyhedron(rng: np.random.Generator) -> Table:
    normals = [*np.eye(3), *-np.eye(3), *rng.normal(size=(4, 3))]
    rows = [[*normal.tolist(), float(rng.uniform(0.5, 1.2))] for normal in normals]
    return {"kind": "polyhedron", "half_spaces": rows}


def _cylinder(rng: np.random.Generator) -> Table:
    cut = [[*rng.normal(size=3).tolist(), float(rng.uniform(0.3, 0.8))] for _ in range(2)]
    return {"kind": "cylinder", "radius": 1.0, "z_min": -1.0, "z_max": 1.0, "cut": cut}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("form", FORMATS, ids=str)
@pytest.mark.parametrize("kind", ["polyhedron", "cylinder"])
def test_a_face_given_again_changes_nothing(
    kind: str, form: tuple[str, int], method: str, rng: np.random.Generator
) -> None:
    hits = 0
    for _ in range(4):
        solid = _polyhedron(rng) if kind == "polyhedron" else _cylinder(rng)
        key = "half_spaces" if kind == "polyhedron" else "cut"
        own = build(_scene(solid)).planes.T * [1, 1, 1, -1]
        more = [_rounded(row, rng).tolist() for row in own[rng.integers(0, len(own), 12)]]
        looser = own[rng.integers(0, len(own), 4)] + [0, 0, 0, 0.5]
        again = {**solid, key: solid[key] + more + looser.tolist()}
        turn = {"rotation_degrees": rng.uniform(-180, 180, 3).tolist()}
        expected, frame = (_frame(_scene(each | turn), form, method) for each in (solid, again))
        for name in ("solid", "surface", "depth", "depth_exit", "normal"):
            ours, theirs = getattr(frame, name), getattr(expected, name)
            assert np.array_equal(ours, theirs, equal_nan=name.startswith("depth")), name
        certain = np.isfinite(expected.error)
        assert np.array_equal(np.isfinite(frame.error), certain)
        assert certain.mean() > 0.99
        hits += int((frame.solid >= 0).sum())
    assert hits > 500


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_a_face_has_the_number_of_the_first_in_the_file(
    form: tuple[str, int], method: str, rng: np.random.Generator
) -> None:
    """Faces of a box in any order, each up to four times and multiplied by anything."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    for _ in range(3):
        order = rng.permutation(np.repeat(np.arange(6), rng.integers(1, 5, 6)))
        factors = rng.choice([1.0, 3.0, 0.1, 7.7], len(order))
        rows = np.column_stack([axes[order], np.ones(len(order))]) * factors[:, None]
        frame = _frame(_scene({"kind": "polyhedron", "half_spaces": rows.tolist()}), form, method)
        box = _frame(_scene({"kind": "box", "size": [2.0, 2.0, 2.0]}), form, method)
        # A box counts -x, +x, -y, …
        of_box = [int(np.flatnonzero(order == k)[0]) + 1 for k in (3, 0, 4, 1, 5, 2)]
        assert np.array_equal(
            frame.surface, np.array([*of_box, -1])[box.surface - 1 * (box.surface > 0)]
        )
        assert np.isfinite(frame.error).all()
        assert len(np.unique(frame.surface)) == 4


def test_what_differs_by_more_than_rounding_is_a_face() -> None:
    cylinder: Table = {"kind": "cylinder", "radius": 1.0, "z_min": -1.0, "z_max": 1.0}
    assert _numbers(cylinder | {"cut": [[0, 0, 1, 1]]}) == [1, 2]
    assert _numbers(cylinder | {"cut": [[0, 0, 3, 3]]}) == [1, 2]
    assert _numbers(cylinder | {"cut": [[0, 0, 1, 2]]}) == [1, 2]
    assert _numbers(cylinder | {"cut": [[0, 0, 7.7, 5.5]]}) == [1, 3]
    assert _numbers(cylinder | {"cut": [[0, 0, 1, 1 - 2.0**-53]]}) == [1, 2]
    assert _numbers(cylinder | {"cut": [[0, 0, 1, 1 - 1e-12]]}) == [1, 3]
    assert _numbers(cylinder | {"cut": [[0, 1e-12, 1, 1]]}) == [1, 2, 3]
    assert _numbers(cylinder | {"cut": [[0, 0, -2, 2], [1, 0, 0, 0.5]]}) == [1, 2, 4]
    # Through the origin there is no scale but 0.
    assert _numbers(
        {"kind": "sphere", "radius": 1.0, "z_max": 0.0, "cut": [[0, 0, 1, 1e-300]]}
    ) == [1]


def test_cuts_that_repeat_the_ends_leave_the_bounds_tight() -> None:
    cylinder: Table = {"kind": "cylinder", "radius": 1.0, "z_min": -1.0, "z_max": 1.0}
    again = {"cut": [[0, 0, 5, 5], [0, 0, -1, 1]]}
    geometry = build(_scene(cylinder | again, cylinder | {"cut": [[0, 0, 1, 0.5]]}))
    assert geometry.is_loose.tolist() == [False, True]


# ------------------------------------------------------------------------------ no thickness


def _meets_square(scene: Scene, normal: Floats, sides: Floats) -> tuple[Floats, Floats]:
    """Depth (H, W) of the plane through the origin, and how far inside a square it is met."""
    eye = view(scene.camera, SIZE)
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    rays = eye.directions(i, j)
    depth = -(eye.eye @ normal) / (rays @ normal)
    point = eye.eye + depth[..., None] * rays
    return depth, 1 - np.abs(point @ sides.T).max(axis=-1)


@pytest.mark.parametrize("form", FORMATS, ids=str)
@pytest.mark.parametrize("factor", [1.0, 3.0, 0.7])
def test_a_flat_polyhedron_is_seen_whole(
    form: tuple[str, int], factor: float, rng: np.random.Generator
) -> None:
    hits = 0
    for _ in range(6):
        normal, first, second = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        axes = [normal, -factor * normal, first, -first, second, -second]
        rows = [
            [*axis.tolist(), float(d)] for axis, d in zip(axes, [0, 0, 1, 1, 1, 1], strict=True)
        ]
        eye = rng.normal(size=3)
        eye *= 6 / np.linalg.norm(eye)
        scene = _scene({"kind": "polyhedron", "half_spaces": rows}, eye=eye.tolist())
        frame = _frame(scene, form)
        depth, within = _meets_square(scene, normal, np.array([first, second]))
        assert np.all(frame.surface[within > 1e-4] == (1 if eye @ normal > 0 else 2))
        assert np.all(frame.solid[within < -1e-4] == -1)
        hit = frame.solid >= 0
        # A last step, and what float32 rounds.
        assert np.abs(frame.depth - depth)[hit].max(initial=0.0) < 8 * (2.0 ** -form[1] + 1e-5)
        assert np.isfinite(frame.error[within < -1e-4]).all()
        hits += int(hit.sum())
    assert hits > 400


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_cuts_may_leave_a_disc(form: tuple[str, int]) -> None:
    disc: Table = {"kind": "cylinder", "radius": 1.0, "z_max": 0.5, "cut": [[0.0, 0.0, -3.0, -1.5]]}
    scene = _scene(disc, volume=2.0)
    frame = _frame(scene, form)
    eye = view(scene.camera, SIZE)
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    rays = eye.directions(i, j)
    point = eye.eye + ((0.5 - eye.eye[2]) / rays[..., 2])[..., None] * rays
    radius = np.hypot(point[..., 0], point[..., 1])
    assert np.all(frame.surface[radius < 1 - 1e-4] == 1)
    assert np.all(frame.solid[radius > 1 + 1e-4] == -1)


@pytest.mark.parametrize("gap", [1e-9, 0.0, -1e-9])
def test_an_eye_beside_a_flat_polyhedron_sees_it_or_says_so(gap: float) -> None:
    rows = [[1, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1], [0, 0, 1, 0], [0, 0, -2, 0]]
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.0, 0.0, gap], "look_at": [0.3, 0.2, gap - np.copysign(1, gap)]},
            "solid": [{"kind": "polyhedron", "color": [1.0, 1.0, 1.0], "half_spaces": rows}],
        }
    )
    for form in FORMATS:
        frame = _frame(scene, form)
        assert np.all((frame.solid == 0) | np.isinf(frame.error))


# ------------------------------------------------------------------------------ planes as quadrics


def _coefficients(normal: Any, center: float, square: float, scale: float = 1.0) -> list[float]:
    """Of scale ((n·x - center)² - square)."""
    a, b, c = (float(v) for v in normal)
    terms = [a * a, b * b, c * c, 2 * a * b, 2 * a * c, 2 * b * c]
    terms += [-2 * center * n for n in (a, b, c)]
    return [scale * v for v in [*terms, center * center - square]]


def test_which_quadrics_are_slabs() -> None:
    def rows(coefficients: list[float]) -> Any:
        slab = slab_of(coefficients)
        return None if slab is None else (slab.rows, slab.is_empty)

    assert rows(_coefficients([0, 0, 1], 0, 0)) == ([[0, 0, 1, 0], [0, 0, -1, 0]], False)
    assert rows(_coefficients([0, 2, 0], 6, 0, 0.5)) == ([[0, 1, 0, 3], [0, -1, 0, -3]], False)
    assert rows(_coefficients([0, 0, 1], 1, 4)) == ([[0, 0, 1, 3], [0, 0, -1, 1]], False)
    assert rows(_coefficients([1, 0, -2], 1, 4)) == (
        [[-0.5, 0, 1, 0.5], [0.5, 0, -1, 1.5]],
        False,
    )
    assert rows(_coefficients([1, 2, 3], 0, -1)) == ([], True)
    # All of space.
    assert rows(_coefficients([1, 2, 3], 0, -1, -1)) == ([], False)
    assert rows(_coefficients([1, 2, 3], 5, 0, -1)) == ([], False)
    # Two half-spaces; a wedge and its complement; a cylinder; a half-space; a line.
    assert rows(_coefficients([0, 0, 1], 0, 1, -1)) is None
    assert rows([0, 0, 0, 0, 1, 0, 0, 0, 0, 0]) is None
    assert rows([0, 0, 1, 0, 0, 0, 1, 0, 0, 0]) is None
    assert rows([1, 1, 0, 0, 0, 0, 0, 0, 0, -1]) is None
    assert rows([0, 0, 0, 0, 0, 0, 0, 0, 1, 0]) is None
    assert rows([1, 1, 0, 0, 0, 0, 0, 0, 0, 0]) is None


def test_a_square_in_rounded_numbers_is_a_plane(rng: np.random.Generator) -> None:
    for _ in range(100):
        normal, center = rng.normal(size=3), float(rng.normal())
        slab = slab_of(_coefficients(normal, center, 0.0, float(rng.uniform(0.1, 9))))
        assert slab is not None
        assert not slab.is_empty
        (*ahead, d), behind = slab.rows
        assert behind == [*(-v for v in ahead), -d]
        assert np.array(ahead) * normal[np.abs(normal).argmax()] == pytest.approx(normal, rel=1e-14)
        # The same numbers with another sign may have two sides: they are left to F.
        assert slab.blur == 0 or slab_of(_coefficients(normal, center, 0.0, -1.0)) is None


def _plane_depth(scene: Scene, normal: Floats, height: float) -> Floats:
    eye = view(scene.camera, SIZE)
    j, i = np.mgrid[: SIZE[1], : SIZE[0]]
    return np.asarray((height - eye.eye @ normal) / (eye.directions(i, j) @ normal))


def _base_planes(scene: Scene, reach: float) -> tuple[float, float]:
    corners = [[x, y, z] for x in (-reach, reach) for y in (-reach, reach) for z in (-reach, reach)]
    depths = view(scene.camera, SIZE).depths(np.array(corners))
    return float(depths.min()), float(depths.max())


@pytest.mark.parametrize("form", FORMATS, ids=str)
def test_a_double_plane_is_a_plane(form: tuple[str, int], rng: np.random.Generator) -> None:
    hits = 0
    for normal in ([0, 0, 1], [1, 2, 2], *rng.normal(size=(3, 3))):
        height = float(rng.uniform(-0.5, 0.5))
        solid = {"kind": "quadric", "coefficients": _coefficients(normal, height, 0.0)}
        scene = _scene(solid, volume=1.5)
        frame = _frame(scene, form)
        depth = _plane_depth(scene, np.array(normal, float), height)
        near, far = _base_planes(scene, 1.5)
        edge = 1e-4 * far
        assert np.all(frame.surface[(depth > near + edge) & (depth < far - edge)] == 0)
        assert np.all(frame.solid[(depth < near - edge) | (depth > far + edge)] == -1)
        hit = frame.solid >= 0
        assert np.abs(frame.depth - depth)[hit].max() < far * (2.0 ** -form[1] + 1e-5)
        hits += int(hit.sum())
    assert hits > 2000


@pytest.mark.parametrize("form", FORMATS, ids=str)
@pytest.mark.parametrize("thick", [1.0, 1e-2, 1e-5])
def test_a_slab_is_seen_in_its_nearer_plane(thick: float, form: tuple[str, int]) -> None:
    hits = 0
    for normal in ([0, 0, 1], [1, -2, 2], [3, 1, 0]):
        square = Fraction(thick) ** 2 / 4 * sum(n * n for n in normal)
        # Exact in binary, or it is a quadric as any other.
        half = float(np.float32(np.sqrt(float(square))))
        solid = {"kind": "quadric", "coefficients": _coefficients(normal, 0.0, half * half)}
        scene = _scene(solid, volume=1.5)
        frame = _frame(scene, form)
        unit = np.array(normal) / np.linalg.norm(normal)
        toward = np.copysign(half / np.linalg.norm(normal), scene.camera.center @ unit)
        enters, leaves = (_plane_depth(scene, unit, float(h)) for h in (toward, -toward))
        near, _ = _base_planes(scene, 1.5)
        depth = np.where(enters >= near, enters, leaves)
        hit = (frame.solid >= 0) & np.isfinite(frame.error)
        assert np.all(frame.surface[hit] == 0)
        assert np.all(np.abs(frame.depth - depth)[hit] <= frame.error[hit] + 1e-12)
        hits += int(hit.sum())
    assert hits > 1000


@pytest.mark.parametrize("form", FORMATS, ids=str)
@pytest.mark.parametrize("square", [0.0, -1.0])
@pytest.mark.parametrize("eye", [(3.0, -6.0, 4.0), (0.1, 0.2, 0.3)])
def test_of_all_of_space_nothing_is_seen_but_its_cuts(
    eye: tuple[float, ...], square: float, form: tuple[str, int]
) -> None:
    """A ray starts inside and has not left by the far base plane."""
    space: Table = {"kind": "quadric", "coefficients": _coefficients([0, 0, 1], 0, square, -1)}
    for method in METHODS:
        frame = _frame(_scene(space, eye=eye, volume=1.5), form, method)
        assert np.all(frame.solid == -1)
        assert np.all(frame.error == 0)
    walls = [[1, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]]
    cut = {"z_min": -1.0, "z_max": 1.0, "cut": walls}
    frame = _frame(_scene(space | cut, eye=eye, volume=4.0), form)
    box = _frame(_scene({"kind": "box", "size": [2.0] * 3}, eye=eye, volume=4.0), form)
    assert np.array_equal(frame.solid, box.solid)
    # -x, +x, -y, +y, -z, +z as z_min, z_max, cuts
    assert np.array_equal(
        frame.surface, np.array([4, 3, 6, 5, 1, 2, -1])[box.surface - (box.surface > 0)]
    )
    assert np.array_equal(np.isfinite(frame.error), np.isfinite(box.error))


@pytest.mark.parametrize("method", METHODS)
def test_crossing_planes_look_alike_in_both_formats(method: str) -> None:
    """x z <= 0: two of the four wedges between the planes."""
    for coefficients in ([0, 0, 0, 0, 1, 0, 0, 0, 0, 0], [0, 0, 0, 0, -1, 0, 0, 0, 0, 0]):
        scene = _scene({"kind": "quadric", "coefficients": coefficients}, volume=1.5)
        frames = [_frame(scene, form, method) for form in (("float32", 16), ("fixed32", 16))]
        certain = np.isfinite(frames[0].error) & np.isfinite(frames[1].error)
        assert certain.mean() > 0.95
        assert np.array_equal(frames[0].solid[certain], frames[1].solid[certain])
        assert np.mean(frames[0].solid != frames[1].solid) < 0.01
        assert (frames[0].solid >= 0).mean() > 0.1


# ------------------------------------------------------------------------------ how many


@pytest.mark.parametrize(
    ("method", "backend"), [("visible", "numpy"), ("visible", "gpu"), ("article", "numpy")]
)
@pytest.mark.slow
def test_as_many_half_spaces_as_are_allowed(
    method: str, backend: str, request: pytest.FixtureRequest
) -> None:
    """Planes that touch a ball, as many as a solid may have, and as many cuts of a slab."""
    if backend == "gpu":
        request.getfixturevalue("adapter")
    turn = np.arange(MAX_HALF_SPACES) * np.pi * (3 - np.sqrt(5))
    z = 1 - (2 * np.arange(MAX_HALF_SPACES) + 1) / MAX_HALF_SPACES
    ring = np.sqrt(1 - z * z)
    rows = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), z, np.ones(len(z))])
    scene = _scene(
        {"kind": "polyhedron", "half_spaces": rows.tolist()},
        {"kind": "quadric", "coefficients": _coefficients([0, 0, 1], 0, 1), "cut": rows.tolist()},
    )
    frame = halfstep.render(
        scene, size=(24, 18), steps=12, method=method, backend=backend, outputs=OUTPUTS
    )
    hit = frame.solid >= 0
    assert hit.sum() > 20
    rays = view(scene.camera, (24, 18)).directions(*np.mgrid[:24, :18]).transpose(1, 0, 2)
    point = np.array(scene.camera.center) + frame.depth[..., None] * rays
    room = (point @ rows[:, :3].T - 1).max(axis=-1)
    assert np.abs(room[hit]).max() < 8 * 2.0**-11
    seen = rows[frame.surface[hit] - 1]
    off = np.einsum("nk,nk->n", point[hit], seen[:, :3]) - 1
    assert np.abs(off).max() < 8 * 2.0**-11


def _alone(rows: Any) -> Faces:
    return alone(np.array(rows, float), np.arange(len(rows)), np.zeros(len(rows)))


def test_opposites_with_nothing_between_become_exact() -> None:
    (found,) = distinct([_alone([[1, 2, 3, 0.1], [0, 0, 1, 1], [-3, -6, -9, -0.3]])])
    assert found.two_sided.tolist() == [True, False, True]
    assert np.array_equal(found.rows[0], -found.rows[2])
    assert found.blur[0] == found.blur[2] > 0 == found.blur[1]
    (found,) = distinct([_alone([[1, 2, 3, 0.1], [-3, -6, -9, -0.3 + 1e-9]])])
    assert not found.two_sided.any()
