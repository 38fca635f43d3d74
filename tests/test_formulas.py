"""Formulas that are no polynomials, as a user renders them, against an oracle of intervals."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest

import halfstep
from halfstep.contract.expressions import Operation, is_tame
from halfstep.device.adapters import Adapter
from halfstep.frames.outputs import OUTPUTS
from halfstep.host.prepare import prepare
from halfstep.host.roundings import counted
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.scene.expression import parsed
from halfstep.scene.programs import compiled
from halfstep.scene.ranges import Range, is_positive, range_of, slopes_of
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from halfstep.twin.expression import Formula, expression_jet, trace_of
from halfstep.twin.jets import Jet
from tests.formula_oracle import FormulaOracle
from tests.formula_surfaces import FORMULAS, solid_of
from tests.polynomial_oracle import CLAIMED, FALSE, Count, with_fault
from tests.test_polynomials import scene_of

ALL = tuple(OUTPUTS)
BOX = {"min": [-1, -1, -1], "max": [1, 1, 1]}


@pytest.mark.parametrize("name", FORMULAS)
def test_what_is_certain_is_true_and_most_is_certain(name: str, rng: np.random.Generator) -> None:
    count = Count()
    for ball, distance in ((False, 3.5), (True, 3.0), (False, 0.4)):
        away = rng.normal(size=3)
        center = distance * FORMULAS[name].reach * away / np.linalg.norm(away)
        accuracy = {"steps": int(rng.integers(8, 21))}
        scene = scene_of(solid_of(name, ball=ball), center, accuracy=accuracy)
        frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
        FormulaOracle(scene, FORMULAS[name].function).judge(frame, count, name)
    assert count.wrong == []
    assert count.left < count.pixels / 100
    assert count.hits > 500
    assert count.certain_misses > 500
    assert count.certain_hits >= 0.98 * count.hits, str(count)


@pytest.mark.parametrize("fault", FALSE)
def test_the_judge_sees_a_fault(fault: str) -> None:
    scene = scene_of(solid_of("gyroid"), (2, -3, 1.5))
    frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
    hit = (frame.solid >= 0) & np.isfinite(frame.error)
    changed = with_fault(frame, fault)
    count = Count()
    FormulaOracle(scene, FORMULAS["gyroid"].function).judge(changed, count, fault)
    assert len(count.wrong) > 0.3 * hit.sum()


# Formulas with every operation; on the second axis of some the argument has kinks or ends.
JETS = [
    "sin(3*x)*cos(2*y) + z/(2 + x^2)",
    "exp(-x^2 - 2*y) - exp(z)/4",
    "log(2 + x*y) + sqrt(x^2 + y^2 + 0.01) - z^3",
    "abs(x) + max(y, z) - min(x*y, z) - 0.3",
    "sqrt(x^2 + y^2) - 0.5",
    "tan(x/3) - (y + 2)^-2 + (z + 2)^1.5",
    "x^5 - 3*x^4*y + z^2 - 7*x",
    "sin(3*x)*cos(2*y) - cos(z)^2/2 + sin(4*(x - y)*cos(z))",
    "x*sin(5*y + cos(7*z)) - 2 - 3*sin(z)*sin(2*x)*cos(y)",
]


def cells_of(text: str, rng: np.random.Generator) -> Iterator[tuple[Jet, Callable[[Any], Any]]]:
    """Jets of a formula in random cells of random rays, and F in mpmath, s from -1 to 1."""
    made = compiled(parsed(text, {}))
    form: Any = {"numbers": np.zeros(16, np.float32), "host_error": np.float32(0)}
    form["numbers"][: len(made.numbers)] = made.numbers
    for _ in range(40):
        level, along = rng.uniform(-1, 1, (2, 3)).astype(np.float32)
        for axis, name in enumerate("xyz"):
            form[f"level_{name}"] = np.array([level[axis], 0, 0], np.float32)
            form[f"along_{name}"] = np.array([along[axis], 0, 0], np.float32)
        if is_tame(made.program):
            points = np.zeros((2, 3, 3))
            points[:, :, 0] = level, along
            errors = counted(made.program, made.numbers, points[0], points[1], 0.0)
            for name, error in zip(("value", "slope", "bend"), errors, strict=True):
                form[f"{name}_error"] = np.float32(error)
        m, h = np.float32(rng.uniform(-1, 1)), np.float32(2.0 ** -rng.uniform(0, 14))
        zero = np.zeros((1, 1), np.float32)
        trace = trace_of(form, zero, zero)
        jet = expression_jet(
            Formula(form, made.program),
            trace,
            np.zeros((1, 1), bool),
            zero + m,
            zero + h,
        )

        def value(s: Any, level: Any = level, along: Any = along, m: Any = m, h: Any = h) -> Any:
            u = mpmath.mpf(float(m)) + s * mpmath.mpf(float(h))
            point = [
                mpmath.mpf(float(a)) + u * mpmath.mpf(float(b))
                for a, b in zip(level, along, strict=True)
            ]
            return exactly(text, *point)

        yield jet, value


@pytest.mark.parametrize("text", JETS)
def test_jets_hold_what_they_claim(text: str, rng: np.random.Generator) -> None:
    """Against 200 bits, at places all over a cell; where F is smooth, also its derivatives."""
    count = known = 0
    for jet, value in cells_of(text, rng):
        v, d, c, e, f, r = (mpmath.mpf(float(part[0, 0])) for part in jet[:6])
        state = int(jet.state[0, 0])
        if state & 4:
            continue
        known += 1
        with mpmath.workprec(200):
            for s in [0, -1, 1, *rng.uniform(-1, 1, 3)]:
                found = value(s)
                if state & 2:
                    assert abs(found - v) <= 1.03 * (e + abs(d) + f + abs(c) + r)
                else:
                    assert abs(found - (v + d * s + c * s * s)) <= 1.03 * (
                        e + f * abs(s) + r * s * s
                    )
                if not state & 7:
                    is_mean = bool(state & 8)
                    bend = mpmath.diff(value, s, 2) / 2
                    assert abs(bend - c) <= 1.03 * (3 if is_mean else 1) * r + mpmath.mpf(2) ** -90
                    slope = mpmath.diff(value, s)
                    most = f + (3 if is_mean else 2) * abs(s) * r
                    assert abs(slope - d - 2 * s * c) <= 1.03 * most
                count += 1
    assert known > 15
    assert count > 100


@pytest.mark.parametrize(
    ("text", "tame"),
    [
        ("sin(4*x)*cos(4*y) + sin(4*y)*cos(4*z) + sin(4*z)*cos(4*x)", True),
        ("cos(x)^2 + 3*z*sin(y - x*cos(z)) - 1", True),
        ("(x - cos(4*z))^2 + (y - sin(4*z))^2 - 0.06", False),
        ("sin(x*y)", False),
        ("sin(x) + exp(y)", False),
    ],
)
def test_tame_formulas_grow_no_faster_than_the_coordinates(text: str, tame: bool) -> None:
    assert is_tame(compiled(parsed(text, {})).program) == tame


def exactly(text: str, x: Any, y: Any, z: Any) -> Any:
    """A formula in mpmath; decimal numbers are exact."""
    code = re.sub(r"\d+\.?\d*", lambda match: f"mpf('{match[0]}')", text.replace("^", "**"))
    names = {
        name: getattr(mpmath, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt", "mpf")
    }
    return eval(code, {**names, "abs": abs, "min": min, "max": max, "x": x, "y": y, "z": z})


@pytest.mark.parametrize("text", JETS)
def test_ranges_hold_all_values(text: str, rng: np.random.Generator) -> None:
    made = compiled(parsed(text, {}))
    low = rng.uniform(-1, 0.8, (3, 50))
    high = low + np.exp2(rng.uniform(-12, 0, 50))
    found = range_of(
        made.program, made.numbers, [Range(*ends) for ends in zip(low, high, strict=True)]
    )
    finite = np.isfinite(found.low) & np.isfinite(found.high)
    assert finite.sum() > 10
    for share in rng.random((8, 3)):
        x, y, z = low + share[:, None] * (high - low)
        for k in np.flatnonzero(finite):
            value = exactly(text, *(mpmath.mpf(float(a[k])) for a in (x, y, z)))
            assert found.low[k] <= value <= found.high[k]


@pytest.mark.parametrize("text", JETS)
def test_slopes_hold_all_changes(text: str, rng: np.random.Generator) -> None:
    """Between two points of a box, F changes by slopes in their ranges times the distances."""
    made = compiled(parsed(text, {}))
    low = rng.uniform(-1, 0.8, (3, 400))
    high = low + np.exp2(rng.uniform(-12, -1, 400))
    slopes = slopes_of(*made, [Range(*ends) for ends in zip(low, high, strict=True)])
    one, two = low + rng.random((2, 3, 400)) * (high - low)
    values = [range_of(*made, [Range(axis, axis) for axis in points]) for points in (one, two)]
    ends = [[each.low * way, each.high * way] for each, way in zip(slopes, two - one, strict=True)]
    least, greatest = (pick(ends, axis=1).sum(axis=0) for pick in (np.min, np.max))
    known = np.isfinite(least) & np.isfinite(greatest)
    assert known.sum() > 100
    room = 1e-12 * (np.abs(least) + np.abs(greatest))
    assert (values[1].high - values[0].low >= least - room)[known].all()
    assert (values[1].low - values[0].high <= greatest + room)[known].all()
    # And by no more than they must.
    assert (slopes[0].high - slopes[0].low)[known].min() < 1


FROM = (2.1, -3.2, 1.5)
MIXED = "sqrt(x) + 1/y + log(z) - (x^2 + 0.1)^0.7"


@pytest.mark.parametrize("scale", [1e-8, 1e-3, 1e3, 5e8])
def test_a_torus_that_crosses_itself_is_known_at_any_size(scale: float) -> None:
    table = {"kind": "torus", "major": scale, "minor": [1.5 * scale, scale], "color": [1, 1, 1]}
    center = (3 * scale, -6 * scale, 3 * scale)
    frame = halfstep.render(scene_of(table, center), outputs=CLAIMED, backend="numpy")
    assert (frame.solid >= 0).sum() > 500
    assert np.isfinite(frame.error).mean() > 0.99


def test_a_torus_that_crosses_itself_is_solid() -> None:
    """Its section through the axis shows no hole."""
    table = {
        "kind": "torus",
        "major": 1,
        "minor": [1.5, 1],
        "color": [1, 1, 1],
        "cut": [[0, 1, 0, 0]],
    }
    scene = scene_of(table, (0.3, 7, 0.2))
    frame = halfstep.render(scene, outputs=(*CLAIMED, "position"), backend="numpy", steps=14)
    hit = frame.solid >= 0
    assert hit.sum() > 300
    assert np.isfinite(frame.error[hit]).mean() > 0.98
    face = hit & (frame.surface == 1)
    x, y, z = frame.position[face].T
    assert np.abs(y).max() < 1e-3
    assert ((np.abs(x) - 1) ** 2 / 2.25 + z**2 < 1.001).all()
    view = prepare(scene).setup.view
    i, j = np.meshgrid(np.arange(64), np.arange(48))
    along = view.directions(i, j)
    at = -view.eye[1] / along[..., 1]
    x, z = view.eye[0] + at * along[..., 0], view.eye[2] + at * along[..., 2]
    inside = (np.abs(x) - 1) ** 2 / 2.25 + z**2 < 0.999
    np.testing.assert_array_equal(face & inside, inside)


# Together they take all ways through the visit and through the choice of formulas.
WAYS = {
    "cut": scene_of({**solid_of("gyroid"), "cut": [[1, 0.2, 0, 0.3]]}, FROM),
    "sheet": scene_of({**solid_of("quotient"), "sheet": True}, FROM),
    "inside a ball": with_overrides(
        scene_of(solid_of("waves", ball=True), (0.3, 0.2, -0.7)),
        camera={"look_at": [0.4, 0.5, 1], "fov_degrees": 90.0},
    ),
    "without a value": scene_of({"kind": "implicit", "formula": MIXED, "bounds": BOX}, FROM),
    "parallel rays": with_overrides(
        scene_of(solid_of("sqrt_torus"), FROM), camera={"orthographic_height": 3.0}
    ),
    "two of them": Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": FROM, "look_at": [0, 0, 0]},
            "accuracy": {"steps": 12},
            "image": {"width": 64, "height": 48},
            "solid": [
                {**solid_of("joined"), "origin": [-1, 0, 0], "rotation_degrees": [10, 20, 30]},
                {**solid_of("quotient"), "origin": [1.5, 0.5, 0]},
                {"kind": "sphere", "radius": 0.7, "origin": [1, -1, 1], "color": [1, 1, 1]},
            ],
        }
    ),
}
# A word of the visit or of what it calls, what a slip would make of it, and where it is seen.
FAULTS = [
    ("surety_of", "jet.value > off", "jet.value < off", "error", "sheet"),
    ("walked_formula", "judged_jet(jet)", "judged_jet(negated_jet(jet))", "solid", "sheet"),
    ("finished_formula", "(value > f4(0.0))", "(value < f4(0.0))", "depth", "cut"),
    ("finished_formula", "near.value > f4(0.0)", "near.value < f4(0.0)", "depth", "sheet"),
    ("finished_formula", "f4(last_step), capped", "f4(0.25), capped", "depth", "cut"),
    ("finished_formula", "abs(value) > least", "abs(value) < least", "depth", "cut"),
    ("cap_begun", "value > f4(0.0)", "value < f4(0.0)", "depth", "cut"),
    ("cap_begun", "f4(0.0))", "f4(0.0)) | capped", "depth", "inside a ball"),
    ("expression_near", "opposite_jet(turned, jet)", "jet", "depth", "inside a ball"),
    ("finished_formula", "half * 0.5, some", "half * 0.5, b4(true)", "depth", "cut"),
    ("formula_near", "form.formula == 0u", "form.formula == 1u", "depth", "two of them"),
    ("finished_formula", "u < high", "u < low", "depth", "cut"),
    ("surety_of", "-reach, reach", "reach, -reach", "error", "sheet"),
    ("slope_of_formula", "trace.x.level + u", "trace.y.level + u", "normal", "sheet"),
    ("formula_grade", "form.formula == 0u", "form.formula == 1u", "normal", "two of them"),
    ("slope_of_formula", "form.axes[1]", "form.axes[3]", "normal", "two of them"),
    ("track_of", "y * level[2]", "y * level[1]", "depth", "sheet"),
    ("trace_of", "form.along_y", "form.along_x", "depth", "sheet"),
    ("expression_value", "trace.z.level", "trace.y.level", "depth", "cut"),
    ("expression_jet", "opposite_jet(turned, jet)", "jet", "depth", "inside a ball"),
    ("outline_of_formula", "form.left, form.right", "form.right, form.left", "solid", "sheet"),
    ("jet_on", "track.level_size, track.along_size", "m, m", "error", "sheet"),
    ("visit_formula", "!inside, begin, end, last", "inside, begin, end, last", "exit", "cut"),
    ("visit_formula", "first <= f4(0.0)", "first > f4(0.0)", "error", "sheet"),
    ("formula_jet", "form.formula == 0u", "form.formula == 1u", "depth", "two of them"),
    ("formula_value", "form.formula == 1u", "form.formula == 0u", "depth", "two of them"),
]


def arrays(way: str, outputs: tuple[str, ...], backend: Any) -> list[bytes]:
    """The bits of the outputs of a frame."""
    frame = halfstep.render(WAYS[way], outputs=outputs, backend=backend)
    return [getattr(frame, name).tobytes() for name in outputs]


@pytest.mark.parametrize("way", WAYS)
def test_the_device_gives_the_bits_of_the_twin(way: str, adapter: Adapter) -> None:
    assert adapter is not None
    found, expected = arrays(way, ALL, "gpu"), arrays(way, ALL, "numpy")
    differs = zip(ALL, found, expected, strict=True)
    assert [name for name, one, other in differs if one != other] == []


@pytest.mark.parametrize(("function", "old", "new", "output", "way"), FAULTS)
def test_a_fault_is_seen(
    function: str,
    old: str,
    new: str,
    output: str,
    way: str,
    adapter: Adapter,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert adapter is not None

    def faulty(needs: Needs) -> str:
        text = compose(needs)
        start = text.index(f"fn {function}(")
        assert old in text[start:]
        return text[:start] + text[start:].replace(old, new, 1)

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
    outputs = ("depth_exit" if output == "exit" else output,)
    assert arrays(way, outputs, "gpu") != arrays(way, outputs, "numpy")


def test_cameras_and_numbers_compile_nothing() -> None:
    """Nor does a parameter that comes to be equal to another number."""

    def needs(scene: Scene) -> Needs:
        return needs_of_frame(prepare(scene), "visible", frozenset({"image"}))

    table = {"kind": "implicit", "formula": "sin(a*x) + b*cos(2*y)/(a + 3) - z", "bounds": BOX}
    scenes = [
        scene_of({**table, "parameters": parameters}, center)
        for parameters in ({"a": 1, "b": 0.5}, {"a": 2, "b": 2}, {"a": 0, "b": -3})
        for center in ((3, -4, 2), (0.1, 0.2, 0.3), (100, 0, 0))
    ]
    assert len({needs(scene) for scene in scenes}) == 1


def test_no_text_of_a_scene_reaches_a_shader() -> None:
    table = {
        "kind": "implicit",
        "formula": "sin(xyzzy * x) - 0.123456789",
        "parameters": {"xyzzy": 2},
        "bounds": BOX,
    }
    text = compose(
        needs_of_frame(prepare(scene_of(table, (3, 4, 5))), "visible", frozenset(["image"]))
    )
    assert "fn formula_jet_0(" in text
    assert "xyzzy" not in text
    assert "0.1234" not in text


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("x^2*y", ["square", "product"]),
        ("3 - x", ["negated", "raised"]),
        ("x/4", ["scaled"]),
        ("2/x", ["reciprocal", "scaled"]),
        ("x^0.5", ["root"]),
        ("x^-3", ["square", "product", "reciprocal"]),
        ("x^2.5", ["logarithm", "scaled", "exponential"]),
        ("2^x", ["scaled", "exponential"]),
        ("x^y", ["logarithm", "product", "exponential"]),
        ("tan(x)", ["cosine", "reciprocal", "sine", "product"]),
        ("sin(x) + sin(x)", ["sine", "sum"]),
        ("100000*x + 1", ["scaled", "checked", "raised"]),
    ],
)
def test_formulas_become_operations(text: str, names: list[str]) -> None:
    program = compiled(parsed(text, {})).program
    assert [step.name for step in program] == names
    assert isinstance(program[0], Operation)


@pytest.mark.parametrize(
    ("text", "undefined"),
    [("sqrt(x^2 + y^2)", 0.0), ("sqrt(x)", 4.0), ("sqrt(abs(x)*exp(y) + 2)", 0.0)],
)
def test_roots_of_what_is_never_negative_are_defined(text: str, undefined: float) -> None:
    made = compiled(parsed(text, {}))
    [root] = [step for step in made.program if step.name == "root"]
    assert made.numbers[root.number] == undefined


@pytest.mark.parametrize(
    "formula", ["sqrt(x) - y", "log(x) - y", "1/x - y", "abs(x)^1e6 - y", "exp(99*x) - exp(98*y)"]
)
def test_where_a_formula_has_no_value_pixels_are_flagged(formula: str) -> None:
    table = {"kind": "implicit", "formula": formula, "bounds": BOX}
    frame: Any = halfstep.render(
        scene_of(table, (2.1, -3.2, 1.5)), outputs=(*CLAIMED, "color", "normal"), backend="numpy"
    )
    assert np.isinf(frame.error).any()
    assert np.isfinite(frame.color).all()
    assert np.isfinite(frame.normal).all()
    assert np.isfinite(frame.depth[frame.solid >= 0]).all()


@pytest.mark.parametrize("name", FORMULAS)
def test_no_solid_with_a_point_is_told_to_be_empty(name: str, rng: np.random.Generator) -> None:
    """Small boxes about points of the surface, and the same without the surface."""
    values = {key: Fraction(value) for key, value in FORMULAS[name].parameters.items()}
    made = compiled(parsed(FORMULAS[name].formula, values))
    empty = 0
    for _ in range(30):
        middle = rng.uniform(-1.4, 1.4, 3)
        half = 2.0 ** -rng.uniform(1, 6)
        corners = middle + half * rng.uniform(-1, 1, (200, 3))
        points = [Range(axis, axis) for axis in corners.T]
        some = (range_of(made.program, made.numbers, points).high < 0).any()
        found = is_positive(made.program, made.numbers, (middle - half, middle + half), None)
        assert not (found and some)
        empty += found
    assert empty > 0
    assert not is_positive(made.program, made.numbers, (-np.ones(3), np.ones(3)), 1.0)
