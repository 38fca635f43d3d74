"""Tori and formulas as a user renders them, against an oracle that counts roots in rationals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.frames.outputs import OUTPUTS
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.scene.animation import scene_at
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from tests.algebraic_surfaces import SURFACES, solid_of, torus_of
from tests.polynomial_oracle import CLAIMED, FALSE, Count, PolynomialOracle, with_fault
from tests.polynomial_soundness import PLACES, drawn, judged, random_scene

# Surfaces of degree 2 to 10, with and without singular points and caps.
FEW = (
    "sphere",
    "clebsch",
    "kummer",
    "dupin",
    "steiner",
    "heart",
    "barth_sextic",
    "quaste",
    "torus",
)
SIZE = (64, 48)


def scene_of(solid: dict[str, Any], center: Any, **tables: Any) -> Scene:
    """A scene of one solid about the origin."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": list(center), "look_at": [0, 0, 0]},
            "image": {"width": SIZE[0], "height": SIZE[1]},
            "accuracy": {"steps": 12},
            "solid": [{"color": [0.7, 0.3, 0.15], **solid}],
            **tables,
        }
    )


def torus(**keys: Any) -> dict[str, Any]:
    """A torus."""
    return {"kind": "torus", "major": 1.0, "minor": 0.4, **keys}


@pytest.mark.parametrize("name", FEW)
def test_what_is_certain_is_true(name: str, rng: np.random.Generator) -> None:
    counts = {(name, place): Count() for place in PLACES}
    judged(drawn, counts, rng, pairs=3 * len(PLACES) * 48 * 36)
    assert [count.wrong for count in counts.values() if count.wrong] == []
    outside = counts[name, "outside"]
    assert outside.certain_hits > 50
    assert outside.certain_misses > 1000
    # Seen from the surface itself, float64 cannot tell, and there are too many for rationals.
    others = [count for (_, place), count in counts.items() if place != "on a surface"]
    assert all(count.left < count.pixels / 4 for count in others)


@pytest.mark.parametrize("name", SURFACES)
def test_most_hits_are_certain(name: str, rng: np.random.Generator) -> None:
    count = Count()
    for _ in range(2):
        away = rng.normal(size=3)
        center = 3.5 * SURFACES[name].reach * away / np.linalg.norm(away)
        scene = scene_of(solid_of(name), center)
        frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
        PolynomialOracle(scene, SURFACES[name].function).judge(frame, count, name)
    assert count.wrong == []
    assert count.hits > 50
    least = 0.8 if name == "barth_decic" else 0.98
    assert count.certain_hits >= least * count.hits, str(count)


@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_certain_misses_of_a_ball_are_misses(number_format: str) -> None:
    """A solid that fills its ball, magnified 1e3 to 1e6 times at the ball's silhouette."""
    rng = np.random.default_rng(3)
    count = Count()
    for _ in range(60):
        away, radius = rng.uniform(3, 30), rng.uniform(0.5, 1.5)
        beside, turn = np.arcsin(radius / away), rng.uniform(0, 2 * np.pi)
        toward = [np.sin(beside) * np.cos(turn), np.cos(beside), np.sin(beside) * np.sin(turn)]
        center = np.array([0.0, -away, 0.0])
        camera = {"center": center.tolist(), "look_at": (center + toward).tolist()}
        solid = {"kind": "implicit", "formula": "x + y - 100", "bounds": {"radius": radius}}
        scene = Scene.from_dict(
            {
                "format": 1,
                "image": {"width": 48, "height": 36},
                "camera": {**camera, "fov_degrees": 10.0 ** rng.uniform(-4.5, -2)},
                "accuracy": {"steps": int(rng.integers(8, 17)), "number_format": number_format},
                "solid": [{**solid, "color": [1, 1, 1]}],
            }
        )
        frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
        PolynomialOracle(scene, lambda x, y, z: x + y - 100 + 0 * z).judge(frame, count, "ball")
    assert count.wrong == []
    assert count.certain_hits > 0.9 * count.hits > 40_000
    assert count.certain_misses > 0.99 * (count.pixels - count.hits)


@pytest.mark.parametrize("fault", FALSE)
def test_the_judge_sees_a_fault(fault: str) -> None:
    scene = scene_of(solid_of("clebsch"), (2, -3, 1.5))
    frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
    changed = with_fault(frame, fault)
    count = Count()
    PolynomialOracle(scene, SURFACES["clebsch"].function).judge(changed, count, fault)
    assert count.exact > 0
    assert len(count.wrong) > 0.5 * count.exact


def roots_of(scene: Scene, function: Any, i: int, j: int) -> np.ndarray[Any, Any]:
    """Depths of all real roots on a ray, by the eigenvalues of a companion matrix."""
    oracle = PolynomialOracle(scene, function)
    terms = oracle.terms_at(i, j)
    found = np.roots([float(term) for term in reversed(terms)])
    real = found[np.abs(found.imag) < 1e-7].real + oracle.middle
    return np.sort(real[real > 0])


def test_rays_leave_a_torus_where_they_do() -> None:
    table, surface = torus_of(1.0, 0.4)
    scene = scene_of(table, (1.4, -2.6, 1.1), accuracy={"steps": 16})
    frame = halfstep.render(scene, outputs=("solid", "depth", "depth_exit"), backend="numpy")
    hits = np.argwhere(frame.solid >= 0)
    step = 2 * prepare(scene).setup.depth_half[0] * 2.0**-16
    tried = thin = 0
    for j, i in hits[::7]:
        roots = roots_of(scene, surface.function, int(i), int(j))
        if len(roots) < 2 or np.diff(roots).min() < 20 * step:
            thin += 1
            continue
        tried += 1
        assert abs(frame.depth[j, i] - roots[0]) < step
        assert abs(frame.depth_exit[j, i] - roots[1]) < step
    assert tried > 100
    assert thin < tried / 10


def test_a_camera_inside_sees_the_way_out() -> None:
    table, surface = torus_of(1.0, 0.4)
    scene = scene_of(table, (1.05, 0.1, -0.05), accuracy={"steps": 14})
    scene = with_overrides(scene, camera={"look_at": [1.1, 2.0, 0.3], "fov_degrees": 90.0})
    frame = halfstep.render(
        scene, outputs=("solid", "depth", "depth_exit", "error"), backend="numpy"
    )
    assert (frame.solid == 0).all()
    assert np.isfinite(frame.error).mean() > 0.98
    np.testing.assert_array_equal(frame.depth, frame.depth_exit)
    for j, i in [(0, 0), (20, 30), (47, 63)]:
        first = roots_of(scene, surface.function, i, j)[0]
        assert abs(frame.depth[j, i] - first) <= frame.error[j, i]


def test_a_sheet_is_seen_from_both_sides_and_has_no_caps() -> None:
    scene = scene_of({**solid_of("clebsch"), "sheet": True}, (2, -3, 1.5))
    frame = halfstep.render(scene, outputs=(*CLAIMED, "normal", "depth_exit"), backend="numpy")
    hit = frame.solid >= 0
    assert set(np.unique(frame.surface)) == {-1, 0}
    directions = prepare(scene).setup.view.directions(*np.mgrid[:64, :48].transpose(0, 2, 1))
    assert ((frame.normal * directions).sum(axis=-1)[hit] < 0).all()
    np.testing.assert_array_equal(frame.depth, frame.depth_exit)
    count = Count()
    PolynomialOracle(scene, SURFACES["clebsch"].function).judge(frame, count, "sheet")
    assert count.wrong == []
    assert count.certain_hits > 500


def test_normals_are_those_of_the_gradient() -> None:
    scene = scene_of(torus(rotation_degrees=[20, 30, 40], origin=[0.1, 0.2, 0.3]), (2, -3, 2))
    frame = halfstep.render(
        with_overrides(scene, steps=18), outputs=("solid", "position", "normal"), backend="numpy"
    )
    solid = scene.solids[0]
    hit = frame.solid >= 0
    local = (frame.position[hit] - solid.origin) @ solid.world_from_local()
    x, y, z = local.T
    around = np.hypot(x, y)
    expected = np.stack([x * (1 - 1 / around), y * (1 - 1 / around), z], axis=-1)
    expected = expected / np.linalg.norm(expected, axis=1, keepdims=True)
    error = np.abs(frame.normal[hit] - expected @ solid.world_from_local().T).max(axis=1)
    assert len(error) > 500
    assert np.quantile(error, 0.99) < 1e-3


def test_a_volume_cuts_what_it_does_not_hold() -> None:
    volume = {"min": [-2, -0.3, -1], "max": [2, 0.6, 1]}
    scene = scene_of(torus(), (0.2, -4, 0.3), volume=volume)
    frame = halfstep.render(scene, outputs=("solid", "depth"), backend="numpy")
    setup = prepare(scene).setup
    hit = frame.solid >= 0
    assert hit.any()
    slack = 1e-5 * setup.far
    assert (frame.depth[hit] >= setup.near - slack).all()
    assert (frame.depth[hit] <= setup.far + slack).all()


# Together they take all ways through the visit.
WAYS = (
    scene_of(torus(cut=[[1, 0.2, 0, 0.3], [0, 0, 1, 0.1]]), (1.8, -3, 1.6)),
    scene_of({**solid_of("clebsch"), "sheet": True}, (2, -3, 1.5)),
    with_overrides(
        scene_of(torus(cut=[[0, 1, 0, 0.9]]), (1.05, 0.1, -0.05)),
        camera={"look_at": [0.7, 2.0, 0.3], "fov_degrees": 100.0},
    ),
    scene_of({**solid_of("clebsch"), "bounds": {"radius": 1.2}}, (2, -3, 1.5)),
    with_overrides(
        scene_of({**solid_of("clebsch"), "bounds": {"radius": 4}}, (0.4, -0.2, 0.6)),
        camera={"look_at": [1, 1, 1], "fov_degrees": 100.0},
    ),
)


def differences(scene: Scene, backend: Any) -> int:
    """Arrays of a frame in which the device differs from the twin."""
    frame = halfstep.render(scene, outputs=OUTPUTS, backend=backend)
    expected = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
    pairs = ((getattr(frame, name), getattr(expected, name)) for name in OUTPUTS)
    return sum(one.tobytes() != other.tobytes() for one, other in pairs)


@pytest.mark.parametrize("scene", WAYS, ids=["cut", "sheet", "inside", "ball", "inside a ball"])
def test_the_device_gives_the_bits_of_the_twin(scene: Scene, adapter: Adapter) -> None:
    assert adapter is not None
    assert differences(scene, "gpu") == 0


CUT, SHEET, INSIDE, BALL, IN_BALL = WAYS
# A scene, a word of the visit, and what a slip would make of it.
FAULTS = [
    (INSIDE, "x_0 <= i4(outline.right)", "x_0 < i4(outline.right)"),
    (CUT, "solid.plane_start + k", "solid.plane_start"),
    (SHEET, "f32(y) * outline.scale", "f32(y + 1) * outline.scale"),
    (SHEET, "opposite(inside, curve)", "opposite(!inside, curve)"),
    (SHEET, "some & !on_entry", "some & on_entry"),
    (CUT, "select(-piece_0.c_out, piece_0.c_in, on_entry)", "-piece_0.c_out"),
    (SHEET, "turned(inside & b4(is_sheet), bend)", "bend"),
    (CUT, "either(on_entry, normal_in_0, normal_out_0)", "normal_out_0"),
    (CUT, "opposite(!inside, curve)", "curve"),
    (SHEET, "left_at, position, stays", "left_at, position, inside"),
    (SHEET, "abs(first) > start_error", "abs(first) < start_error"),
    (BALL, "chord.enter > start", "chord.enter < start"),
    (IN_BALL, "leaves, enters, on_entry", "enters, leaves, on_entry"),
    (BALL, "-ball.a, ball.a, on_entry", "ball.a, -ball.a, on_entry"),
    (BALL, "-ball.g, leaves", "ball.g, leaves"),
    (BALL, "y, position), slope_0)", "y, position + 2), slope_0)"),
    (IN_BALL, "chord.sure & !chord.met", "chord.sure & chord.met"),
    (SHEET, "sure_miss, sure_root, cell.met", "sure_root, sure_miss, cell.met"),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_visit_is_seen(
    scene: Scene, old: str, new: str, adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert adapter is not None
    changed: list[bool] = []

    def faulty(needs: Needs) -> str:
        text = compose(needs)
        start = text.index("fn visit_polynomial(")
        changed.append(old in text[start:])
        return text[:start] + text[start:].replace(old, new, 1)

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
    assert differences(scene, "gpu")
    assert any(changed)


def test_neither_cameras_nor_numbers_of_a_formula_ask_for_another_shader() -> None:
    def needs(scene: Scene) -> Needs:
        return needs_of_frame(prepare(scene), "visible", frozenset({"image"}))

    table = {
        "kind": "implicit",
        "formula": "a*x^4 + y^2 + z^2 - b",
        "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]},
    }
    scenes = [
        scene_of({**table, "parameters": parameters}, center)
        for parameters in ({"a": 1, "b": 0.5}, {"a": 0, "b": 0.1}, {"a": -2.5, "b": 0})
        for center in ((3, -4, 2), (0.1, 0.2, 0.3), (100, 0, 0))
    ]
    assert len({needs(scene) for scene in scenes}) == 1
    assert len({compose(needs(scene)) for scene in scenes}) == 1


FORMULAS = [
    ("x^2 + y^2 +", 'column 11: nothing stands after "+"'),
    ("(x + 1", 'column 1: "(" is not closed'),
    ("x + 1)", 'column 6: ")" closes nothing'),
    ("2 x", 'column 3: an operator is missing before "x"'),
    ("x = y = z", 'column 7: only one "=" may be there'),
    ("x ? y", 'column 3: "?" has no meaning here'),
    ("radius - x", 'column 1: "radius" is unknown; there are '),
    ("__import__('os')", "column 12: "),
    ("x.real", 'column 2: "." has no meaning here'),
    ("sin + x", 'column 1: "sin" is a function; write sin(…)'),
    ("max(x)", 'column 1: "max" takes 2, not 1'),
    ("x / (1 - 1)", "column 3: division by zero"),
    ("sqrt(-1) * x", 'column 1: "sqrt" of -1 is no number'),
    ("x + 1e200", "column 5: a number is beyond 1e+100"),
    ("x * exp(-500)", "column 5: a number is not 0 and below 1e-100"),
    ("x^6 * y^5", "column 5: degree 11 is not <= 10"),
    ("1 + pi = e", "it is the same everywhere, which is no surface"),
    ("", "the formula is empty"),
    ("1e20*sin(x) + y", "1e+20 is not within 1e-30 to 4e+12, the range of numbers in a formula"),
    ("sin(x)*1e-40 + y", "1e-40 is not within 1e-30 to 4e+12, the range of numbers in a formula"),
    ("+".join(f"sin({k}*x)" for k in range(1, 100)), "is not <= 256 operations, the most"),
    ("(" * 65 + "x" + ")" * 65, "column 65: more than 64 nested levels"),
    ("x" + "+x" * 2048, "4097 characters is not <= 4096"),
    ("+".join(["x"] * 1026), "more than 1024 operations"),
]


@pytest.mark.parametrize(("formula", "text"), FORMULAS)
def test_faults_of_formulas_say_where(formula: str, text: str) -> None:
    bounds = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    with pytest.raises(halfstep.SceneError) as caught:
        scene_of({"kind": "implicit", "formula": formula, "bounds": bounds}, (3, 4, 5))
    [fault] = caught.value.faults
    assert fault.startswith("scene: solid[0].formula: ")
    assert text in fault


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (
            {"major": 1e9, "minor": 2e9},
            "minor: 2000000000 is > major = 1000000000: lengths of a torus",
        ),
        ({"major": 1, "minor": [0.1]}, "minor: [0.1] is neither a number nor an array of 2"),
        ({"major": -1, "minor": 0.1}, "major: -1 is not > 0"),
        ({"minor": 0.1}, "major: missing"),
    ],
)
def test_faults_of_tori(keys: dict[str, Any], text: str) -> None:
    with pytest.raises(halfstep.SceneError) as caught:
        scene_of({"kind": "torus", **keys}, (3, 4, 5))
    assert any(f"solid[0].{text}" in fault for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"parameters": {"x": 1}}, 'solid[0].parameters.x: "x" has a meaning of its own'),
        ({"parameters": {"2a": 1}}, 'solid[0].parameters.2a: "2a" is not a name'),
        ({"bounds": {"min": [0, 0, 0], "max": [1, 0, 1]}}, "solid[0].bounds.max: [1, 0, 1] is not"),
        ({"bounds": None}, "solid[0].bounds: "),
        ({"bounds": {"radius": 0}}, "solid[0].bounds.radius: 0 is not > 0"),
        ({"bounds": {"min": [0, 0, 0]}}, "solid[0].bounds: has neither min and max nor radius"),
        (
            {"formula": "x^2 + y^2 + 0.01", "bounds": {"radius": 3}},
            "solid[0].bounds: nothing of the solid is in them, where the formula is positive",
        ),
        (
            {"formula": "sin(x) + cosine - 2*y", "parameters": {"cosine": 7}},
            "solid[0].bounds: nothing of the solid is in them, where the formula is positive",
        ),
        (
            {"formula": "9 - x^2 - y^2 - z^2", "bounds": {"radius": 2}},
            "solid[0].bounds: nothing of the solid is in them, where the formula is positive",
        ),
        (
            {"bounds": {"min": [0] * 3, "max": [1] * 3, "radius": 1}},
            "solid[0].bounds: has min and max and radius; a box has no radius",
        ),
    ],
)
def test_faults_of_what_goes_with_a_formula(keys: dict[str, Any], text: str) -> None:
    table = {"kind": "implicit", "formula": "x", "bounds": {"min": [-1] * 3, "max": [1] * 3}}
    with pytest.raises(halfstep.SceneError) as caught:
        scene_of({**table, **keys}, (3, 4, 5))
    assert any(text in fault for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [
        ("method", "article", '"article" cannot tell the roots of a torus apart; use visible'),
        ("steps", 23, "23 is not <= 22, the most with a torus"),
    ],
)
def test_what_tori_cannot_have_is_said(option: str, value: Any, text: str) -> None:
    with pytest.raises(halfstep.SceneError) as caught:
        with_overrides(scene_of(torus(), (3, 4, 5)), **{option: value})
    assert caught.value.faults == (f"{option}: {text}",)
    accuracy = {option: value} if option == "steps" else {"steps": 9, option: value}
    with pytest.raises(halfstep.SceneError) as caught:
        scene_of(torus(), (3, 4, 5), accuracy=accuracy)
    assert caught.value.faults == (f"scene: accuracy.{option}: {text}",)


@pytest.mark.parametrize("name", ["torus", "clebsch", "kummer"])
def test_parallel_rays_see_the_first_root(name: str, rng: np.random.Generator) -> None:
    """From outside, and from places where rays start in the solid."""
    count = Count()
    for distance in (3.0, 0.4):
        table, surface = torus_of(1.0, 0.4) if name == "torus" else (solid_of(name), SURFACES[name])
        away = rng.normal(size=3)
        scene = scene_of(table, distance * away / np.linalg.norm(away))
        scene = with_overrides(scene, camera={"orthographic_height": 3.0})
        frame = halfstep.render(scene, outputs=(*CLAIMED, "normal"), backend="numpy")
        PolynomialOracle(scene, surface.function).judge(frame, count, name)
        hit = (frame.solid >= 0) & (frame.surface == 0)
        forward = prepare(scene).setup.view.camera_from_world[2]
        if distance > 1:  # where rays start outside, normals point back
            assert (frame.normal[hit] @ forward < 1e-3).all()
    assert count.wrong == []
    assert count.hits > 1000
    assert count.certain_hits > 0.98 * count.hits, str(count)


MOVING = {
    "kind": "implicit",
    "formula": "a*x^2 + y^2 + z^2 = b / a",
    "parameters": {"a": 2, "b": 1},
    "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]},
    "key": [{"at": 0, "a": 1}, {"at": 0.5, "a": 3, "origin": [0, 0, 1]}, {"at": 1, "a": 1}],
}


QUARTER = {"frames": 5, "orbit_degrees": 90.0}


def test_parameters_move(tmp_path: Any) -> None:
    scene = scene_of(MOVING, (3, 4, 5), animation=QUARTER)
    solids: list[Any] = [scene_at(scene, frame).solids[0] for frame in range(5)]
    values = [solid.parameters["a"] for solid in solids]
    assert values[0] == values[4] == 1
    assert values[2] == 3
    assert 1 < values[1] == values[3] < 3
    assert all(solid.parameters["b"] == 1 for solid in solids)
    assert all(solid.origin == (0, 0, 1) for solid in solids)
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml())
    assert halfstep.load(path) == scene


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ([{"at": 0, "c": 1}], "scene: solid[0].parameters.c: missing; key[0] has it"),
        ([{"at": 0, "a": "1"}], 'scene: solid[0].key[0].a: "1" is not a number'),
        ([{"at": 0}], "scene: solid[0].key: has none of origin, rotation_degrees, parameter"),
        (
            [{"at": 0, "a": -1}, {"at": 1, "a": 1}],
            "scene: frame 2: solid[0].formula: column 23: division by zero",
        ),
    ],
)
def test_faults_of_moving_parameters(keys: list[dict[str, Any]], text: str) -> None:
    def frame() -> Scene:
        return scene_at(scene_of({**MOVING, "key": keys}, (3, 4, 5), animation=QUARTER), 2)

    with pytest.raises(halfstep.SceneError) as caught:
        frame()
    assert any(fault.startswith(text) for fault in caught.value.faults), caught.value.faults


@pytest.mark.parametrize("place", PLACES)
def test_random_scenes_load_from_their_own_text(
    place: str, rng: np.random.Generator, tmp_path: Any
) -> None:
    scene, _ = random_scene(rng, "kummer", place)
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml())
    assert halfstep.load(path) == scene
