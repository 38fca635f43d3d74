"""Every stage function alone: the device's bits are the twin's, and a planted fault is seen."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pytest

from halfstep.device import Adapter
from halfstep.source import stage
from tests.harness import (
    EXACT,
    FIXED,
    FLOAT,
    LINES,
    Arguments,
    Array,
    Function,
    Module,
    Runner,
    cast,
    leaves,
    twin,
)

# Rows come in blocks that share n, a shift and a number of half-spaces: every n from 1 to 30 and
# every shift from 0 to 63 is there.
BLOCKS = 64
BLOCK_ROWS = 48
ROWS = BLOCKS * BLOCK_ROWS
STEPS = np.repeat(1 + np.arange(BLOCKS) % 30, BLOCK_ROWS)

# Values that make products, sums and roots coincide exactly.
DYADIC = np.array([0, -0.0, 1, -1, 0.5, -0.5, 0.25, -0.25, 2, -2, 0.75, 2**-20, -(2**-20)])
# No magnitude below this: the product of three stays normal, as `setup.NEGLIGIBLE` sees to.
SMALLEST = -36

# What works on values is tested in either number format.
VALUES = ("piece", "root", "patch", "article", "certify")
FUNCTIONS = [(FLOAT, function) for function in FLOAT.functions()]
FUNCTIONS += [
    (EXACT, function)
    for function in EXACT.functions()
    if function.file in ("polynomial_exact", "forms_exact", "halve_incremental")
]
FUNCTIONS += [
    (FIXED, function)
    for function in FIXED.functions()
    if function.file in (*VALUES, "arithmetic_fixed", "forms_fixed", "halve_fixed")
]

# A word or sign of a function, and what a slip would make of it.
FAULTS = [
    ("arithmetic.product", "a * b", "a + b"),
    ("arithmetic.reduced", "return wide", "return -wide"),
    ("arithmetic.steps_from_middle", "* last_step", "+ last_step"),
    ("arithmetic_fixed.product", "w4(a) * w4(b)", "w4(a * b)"),
    ("arithmetic_fixed.reduced", "0x3FFFFFFFli", "0x3FFFFFFEli"),
    ("arithmetic_fixed.steps_from_middle", "30u", "29u"),
    ("forms.line_at", "linear(b, at)", "linear(c, at)"),
    ("forms.line_errors", "linear_error(b, at)", "linear_error(c, at)"),
    ("forms.form_at", "quadratic(g, at)", "quadratic(a, at)"),
    ("forms.form_errors", "quadratic_error(g, at)", "quadratic_error(a, at)"),
    ("forms_exact.line_at", "linear(b, at)", "linear(c, at)"),
    ("forms_exact.line_errors", "abs(line.b)", "abs(line.c)"),
    ("forms_exact.form_at", "quadratic(g, at)", "quadratic(a, at)"),
    ("forms_exact.form_errors", "abs(form.g)", "abs(form.a)"),
    ("forms_fixed.excess_bits", "u4(32u), u4(64u)", "u4(31u), u4(64u)"),
    ("forms_fixed.shifted", ">> u4(1u)", ">> u4(2u)"),
    ("forms_fixed.shifted_error", "u4(127u)", "u4(126u)"),
    (
        "forms_fixed.line_excess",
        "max(abs(linear(c, at)), abs(linear(b, at)))",
        "abs(linear(c, at))",
    ),
    ("forms_fixed.line_at", "shifted(linear(b, at)", "shifted(linear(c, at)"),
    ("forms_fixed.line_errors", "+ host_error", ""),
    ("forms_fixed.form_excess", "bend + bend + bend", "bend + bend"),
    ("forms_fixed.form_at", "shifted(quadratic(g, at)", "shifted(quadratic(a, at)"),
    ("forms_fixed.form_errors", "+ host_error", ""),
    ("halve_fixed.halve", "value > i4(0)", "value >= i4(0)"),
    ("halve_fixed.halve", "i4(1i << (k - 1u))", "i4(1i)"),
    ("polynomial.offset", "f4(x)", "f4(x + 1)"),
    ("polynomial.quadratic", "k[4]", "k[3]"),
    ("polynomial.linear", "k[2]", "k[1]"),
    ("polynomial.quadratic_error", "6.0", "5.0"),
    ("polynomial.linear_error", "4.0", "3.0"),
    ("polynomial_exact.offset", "i64(y)", "i64(x.x)"),
    ("polynomial_exact.quadratic", "k[4]", "k[3]"),
    ("polynomial_exact.linear", "k[2]", "k[1]"),
    ("polynomial_exact.quadratic_error", "-1f", "-2f"),
    ("polynomial_exact.linear_error", "-1f", "-2f"),
    ("piece.whole_interval", "-far_u", "far_u"),
    ("piece.clip", "piece.b_in) <", "piece.b_in) <="),
    ("piece.clip", "piece.b_out) >", "piece.b_out) >="),
    ("piece.clip", "line.b < v4(0)", "line.b <= v4(0)"),
    ("piece.remains", "<=", "<"),
    ("piece.from_the_eye", "i4(0)", "piece.id_in"),
    ("root.end_value", "product(form.g, b)", "product(form.g, c)"),
    ("root.outside_at_entry", "> w4(0)", ">= w4(0)"),
    ("root.outside_at_exit", "piece.c_out", "piece.c_in"),
    ("root.has_root", ">=", ">"),
    ("root.turns_within", "form.a > v4(0)", "form.a >= v4(0)"),
    ("root.turns_within", "piece.b_out) >", "piece.b_out) >="),
    ("root.quadric_entry", "& (form.a < v4(0))", "& (form.a <= v4(0))"),
    ("root.quadric_entry", "crosses | on_plane", "crosses & on_plane"),
    ("root.quadric_exit", "& (form.a > v4(0))", "& (form.a < v4(0))"),
    ("root.ellipsoid_entry", "form.g", "-form.g"),
    ("root.ellipsoid_exit", "-form.g", "form.g"),
    ("root.polyhedron_entry", "> i4(0)", ">= i4(0)"),
    ("root.polyhedron_exit", "-piece.c_out", "piece.c_out"),
    ("root.patch_entry", "plane.b, plane.c", "plane.c, plane.b"),
    ("root.choose", "outer.g, inner.g", "inner.g, outer.g"),
    ("halve.halve", "slope < f4(0.0)", "slope <= f4(0.0)"),
    ("halve.halve", "k < steps", "k + 1u < steps"),
    ("halve_incremental.halve", "value > f4(0.0)", "value >= f4(0.0)"),
    ("patch.facing", ">= product", "> product"),
    ("patch.bound", ">=", ">"),
    ("article.line_value", "line.b, u", "line.c, u"),
    ("article.blocked_in", "line.b < v4(0)", "line.b <= v4(0)"),
    ("article.blocked_out", "line.b >= v4(0)", "line.b > v4(0)"),
    ("article.last_entered", "i32(j) + 1", "i32(j)"),
    ("article.first_left", "> product(found.value", ">= product(found.value"),
    ("article.cell_of", ">> u4(1u)", ">> u4(2u)"),
    ("article.grid_point", "- i4", "+ i4"),
    ("article.further_than", "> product", "< product"),
    ("article.planes_in", "v4(-ONE)", "v4(ONE)"),
    ("article.planes_out", "i4(START)", "i4(cells)"),
    ("article.value_of", "+ product", "- product"),
    ("article.slope_of", "+ product", "- product"),
    ("article.visible_point", "piece.first < piece.last", "piece.first <= piece.last"),
    ("article.article_polyhedron", "k < steps", "k + 1u < steps"),
    ("article.article_quadric", "form.a >= v4(0)", "form.a > v4(0)"),
    ("article.article_patch", "j = 1u", "j = 2u"),
    ("nearest.depth_key", "1i << steps", "2i << steps"),
    ("nearest.count_key", "+ carry", ""),
    ("nearest.count_key", "shift >= 32u", "shift > 32u"),
    ("nearest.before", "surface < other_surface", "surface <= other_surface"),
    ("certify.size_of", "abs(f4(value))", "f4(value)"),
    ("certify.surely_apart", "errors.b *", "errors.c *"),
    ("certify.bounded_interval", "far_u != ONE", "far_u == ONE"),
    ("certify.bounded_clip", "apart | idle", "apart & idle"),
    ("certify.bounded_from_the_eye", "f4(0.0)", "old.error_in"),
    ("certify.surely_ordered", "ends.error_out *", "ends.error_in *"),
    ("certify.line_bound", "size - error", "size + error"),
    ("certify.bounded_form", "square - fourfold", "square + fourfold"),
    ("certify.curve_bound", "run.g", "run.a"),
    ("certify.end_signs", "- product(form.g, b);", "+ product(form.g, b);"),
    ("certify.certify_ellipsoid", ">= f4(0.0)", "> f4(0.0)"),
    ("certify.certify_polyhedron", "!lost", "lost"),
    ("certify.certify_quadric", "on_entry & ordered", "on_entry"),
    ("certify.bounded_facing", "!differs", "differs"),
    ("certify.bounded_bound", "gap < -error", "gap > -error"),
    ("certify.certify_patch", "tried.missed |", "tried.missed &"),
    ("certify.confirms", "!hit | right", "hit | right"),
    ("certify.least_key", "- borrow", ""),
    ("certify.least_key", "key.low < off.low", "key.low <= off.low"),
    ("normal.dot_product", "a.y * b.y", "a.y * b.x"),
    ("normal.scaled", "a.z * s", "a.z"),
    ("normal.or_else", "select(other.x, a.x, some)", "a.x"),
    ("normal.normalized", "f4(1.0) /", "f4(2.0) /"),
    ("normal.gradient", "k[13]", "k[12]"),
    ("ray.ray_direction", "frame.down.z", "frame.down.y"),
    ("shade.power", "bit = 0u", "bit = 1u"),
    ("shade.shade", "- light.vector.w", "+ light.vector.w"),
    ("shade.shade", "away = dot", "away = -dot"),
    ("encode.srgb_level", ">=", ">"),
    ("encode.encode", "u4(16u)", "u4(8u)"),
]


def numbers(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Float32 over decades, in order of 1, and ones that coincide."""
    wide = rng.choice([-1.0, 1.0], shape) * np.exp2(rng.uniform(SMALLEST, 0, shape))
    near = rng.uniform(-1, 1, shape)
    near = np.where(np.abs(near) < 2.0**SMALLEST, 0.0, near)
    kind = rng.random(shape)
    mixed = np.where(kind < 0.4, wide, np.where(kind < 0.65, near, rng.choice(DYADIC, shape)))
    return mixed.astype(np.float32)


def integers(rng: np.random.Generator, shape: tuple[int, ...], bits: int) -> Array:
    """Integers of up to ``bits`` bits, over decades, in order of the largest, and equal ones."""
    sign = rng.choice([-1.0, 1.0], shape)
    wide = sign * np.exp2(rng.uniform(0, bits, shape))
    near = rng.uniform(-1, 1, shape) * 2.0**bits
    equal = rng.choice(DYADIC[np.abs(DYADIC) <= 1], shape) * 2.0**bits
    kind = rng.random(shape)
    return np.rint(np.where(kind < 0.4, wide, np.where(kind < 0.65, near, equal))).astype(np.int64)


def whole(rng: np.random.Generator, shape: tuple[int, ...], limit: Array) -> Array:
    """Integers from -limit to limit, one limit for each row."""
    limit = limit.reshape(-1, *[1] * (len(shape) - 1))
    return np.rint(rng.uniform(-1, 1, shape) * limit).astype(np.int64)


def units(rng: np.random.Generator, place: str, arguments: Arguments) -> None:
    """Unit vectors in the three components of a place."""
    vectors = rng.normal(size=(3, ROWS, 4))
    vectors /= np.sqrt((vectors**2).sum(axis=0))
    for axis, component in zip("xyz", vectors, strict=True):
        arguments[f"{place}.{axis}"] = component.astype(np.float32)


def arguments_of(module: Module, function: Function, rng: np.random.Generator) -> Arguments:
    """``ROWS`` rows of arguments for a function."""
    places = leaves(module, function)
    reach = np.exp2(rng.integers(0, 17, ROWS))  # the largest pixel offset
    values: Arguments = {}
    for place, type_ in places.items():
        shape = (ROWS, 4) if type_ not in ("f32", "i32", "u32", "i64", "bool") else (ROWS,)
        if type_ == "lines":
            values[place] = _values(module, "line", rng, (ROWS, LINES, 4))
        elif type_ in ("v4", "w4", "Value"):
            shape = (ROWS,) if type_ == "Value" else (ROWS, 4)
            values[place] = _values(module, "wide" if type_ == "w4" else place, rng, shape)
        elif type_.startswith("array<"):
            size = int(type_.split(", ")[1].rstrip(">"))
            values[place] = numbers(rng, (ROWS, size))
        elif type_ in ("f4", "f32"):
            values[place] = numbers(rng, shape)
        elif type_ in ("b4", "bool"):
            values[place] = rng.integers(0, 2, shape)
        elif type_ in ("u4", "u32"):
            few = rng.choice([0, 1, 2**31, 2**32 - 1], shape)
            values[place] = np.where(rng.random(shape) < 0.5, few, rng.integers(0, 2**32, shape))
        else:
            values[place] = rng.integers(0, 4, shape)
    for place in values:
        special = _special(module, function, place, places[place], values[place], reach, rng)
        if special is not None:
            values[place] = special
    _together(module, function, values, reach, rng)
    return cast(module, function, values)


def _values(module: Module, place: str, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Values and products of values, in the format of a module.

    In integers |C|, |c|, |b| and |G| + 3 |A| have 29 bits, places on a ray 30, products 61.
    """
    if module is not FIXED:
        return numbers(rng, shape)
    name = place.split(".")[-1]
    bits = {"wide": 61, "a": 26, "g": 28, "u": 30, "near_u": 30, "far_u": 30}
    return integers(rng, shape, bits.get(name, 29))


def _special(
    module: Module,
    function: Function,
    place: str,
    type_: str,
    value: Array,
    reach: Array,
    rng: np.random.Generator,
) -> Array | None:
    """Values of an argument that means something by its name."""
    name = place.split(".")[-1]
    shape = value.shape
    if "error" in place and type_ in ("f4", "f32"):  # of at least one rounding
        if module is FIXED or function.file == "forms_exact":
            return np.exp2(rng.uniform(-1, 24, shape))
        return np.exp2(rng.uniform(-37, -4, shape))
    block = np.repeat(np.arange(BLOCKS), BLOCK_ROWS)
    match name:
        case "steps":
            return STEPS
        case "cells":
            return 1 << STEPS
        case "last_step":
            return 0.5**STEPS
        case "shift":
            return block
        case "number" if type_ == "i32":
            return 1 + block % 7
        case "spare":
            return np.minimum(np.minimum(block, 8), 30 - STEPS)
        case "count" if type_ == "u32":
            return 1 + block % LINES
        case "eye_inside" | "eye_outside":
            return block // 8 % 2
        case "eye_sure" | "near_cut":
            return block // 16 % 2
        case "may_start_inside":
            return block // 32 % 2
        case "position":
            return 2 * rng.integers(0, 1 << STEPS[:, None], shape) + 1 - (1 << STEPS[:, None])
        case "cell" | "first" | "last":
            anywhere = rng.integers(-1, (1 << STEPS[:, None]) + 1, shape)
            ends = np.where(rng.random(shape) < 0.5, -1, 1 << STEPS[:, None])
            return np.where(rng.random(shape) < 0.3, ends, anywhere)
        case "b_in" | "b_out":
            sign = -1 if name == "b_in" else 1
            return np.where(rng.random(shape) < 0.9, sign * np.abs(value), value)
        case "near_u":
            return np.where(rng.random(shape) < 0.5, -module.format.one, value)
        case "far_u" if function.file == "certify":
            return np.where(block % 2, module.format.one, np.abs(value[::BLOCK_ROWS][block]))
        case "far_u":
            return np.where(rng.random(shape) < 0.5, module.format.one, value)
        case "excess":
            return rng.integers(0, 33, shape)
        case "number" if type_ == "vec4<i64>":
            return integers(rng, shape, 61)
        case "size":
            return np.abs(integers(rng, shape, 61))
        case "x" | "y" if type_ in ("i4", "i32", "i64", "vec4<i64>") or place.startswith("at."):
            return whole(rng, shape, reach)
        case "i" | "j":
            return rng.integers(0, 2**17, shape)
        case "base":
            return np.minimum(np.abs(value), 1)
        case "exponent" | "shininess":
            return rng.choice([1, 2, 3, 40, 1023, 1024, *range(1, 1025)], shape)
        case _:
            return None


def _together(
    module: Module, function: Function, values: Arguments, reach: Array, rng: np.random.Generator
) -> None:
    """Arguments that belong together: coefficients and offsets, unit vectors, equal points."""
    polynomials = [p for p, t in function.parameters if t.startswith("array<Coefficient")]
    if module.format.integer and polynomials:
        # Terms of each form sum to less than 2^60, as the host sees to; some are exact ties.
        for place in polynomials:
            powers = np.array([0, 1, 1, 2, 2, 2][: values[place].shape[1]])
            largest = 2.0**57 / reach[:, None] ** powers
            shape = values[place].shape
            values[place] = np.rint(rng.uniform(-1, 1, shape) * largest).astype(np.int64)
            values[place][rng.random(shape) < 0.2] = 0
            ties = rng.random(ROWS) < 0.2
            values[place][ties, 1:] = 0
            values[place][ties, 0] = (2 * rng.integers(2**23, 2**24, ties.sum()) + 1) << 30
    elif function.name == "before":
        for place in ("high", "low"):
            same = rng.random((ROWS, 4)) < 0.5
            values[f"other.{place}"] = np.where(
                same, values[f"key.{place}"], values[f"other.{place}"]
            )
        values["surface"], values["other_surface"] = rng.integers(0, 4, (2, ROWS, 4))
    elif function.name == "least_key":
        values["bound"] = np.abs(values["bound"])
    elif function.name == "or_else":
        nothing = rng.random((ROWS, 4)) < 0.1
        for axis in "xyz":
            values[f"a.{axis}"] = np.where(nothing, 0, values[f"a.{axis}"])
    elif function.name == "normalized":
        units(rng, "a", values)
        for axis in "xyz":
            values[f"a.{axis}"] *= np.exp2(rng.integers(-20, 20, (ROWS, 1)))
    elif function.name == "shade":
        units(rng, "normal", values)
        units(rng, "direction", values)
        for place in values:
            if "color" in place or place in ("finish.specular", "frame.ambient"):
                values[place] = np.abs(values[place])
            if place.endswith("vector"):
                values[place][:, 3] = rng.integers(0, 2, ROWS)
        # A shader without a light that has a position holds no code for one.
        values["lights[0].vector"][:, 3] = 1
    elif function.file == "encode":
        for place in values:
            values[place] = _linear(rng, values[place])


def _linear(rng: np.random.Generator, value: Array) -> Array:
    """Linear light: any, beyond 0…1, and about the places where the level changes."""
    edges = (rng.integers(1, 256, value.shape) - 0.5) / 255
    place = np.where(edges <= 0.04045, edges / 12.92, ((edges + 0.055) / 1.055) ** 2.4)
    ulps = rng.integers(-2, 3, value.shape, np.int32)
    about = (place.astype(np.float32).view(np.int32) + ulps).view(np.float32)
    anything = rng.uniform(-0.5, 1.5, value.shape).astype(np.float32)
    kind = rng.random(value.shape)
    return np.where(kind < 0.5, about, np.where(kind < 0.8, anything, value)).astype(np.float32)


@pytest.fixture(scope="module")
def runner(adapter: Adapter) -> Iterator[Runner]:
    runner = Runner(adapter)
    yield runner
    runner.close()


@pytest.mark.parametrize(
    ("module", "function"),
    FUNCTIONS,
    ids=[f"{module.format.forms}-{function}" for module, function in FUNCTIONS],
)
def test_the_device_gives_the_bits_of_the_twin(
    module: Module, function: Function, runner: Runner, rng: np.random.Generator
) -> None:
    arguments = arguments_of(module, function, rng)
    found, expected = runner.run(module, function, arguments), twin(module, function, arguments)
    if wrong := np.argwhere(found != expected).tolist():
        row, word, lane = wrong[0]
        given = {place: value[row].tolist() for place, value in arguments.items()}
        pytest.fail(
            f"{len(wrong)} of {found.size} words differ, first: row {row}, word {word}, lane "
            f"{lane}: {found[row, word, lane]:#x} for {expected[row, word, lane]:#x} of {given}"
        )
    # Arguments that always give the same result test nothing.
    assert len(np.unique(found)) > 1


def test_every_function_has_a_planted_fault() -> None:
    assert {name for name, _, _ in FAULTS} == {str(function) for _, function in FUNCTIONS}


@pytest.mark.parametrize(("name", "old", "new"), FAULTS)
def test_a_fault_is_seen(
    name: str, old: str, new: str, runner: Runner, rng: np.random.Generator
) -> None:
    module, function = next(pair for pair in FUNCTIONS if str(pair[1]) == name)
    text = stage(function.file)
    body = re.search(rf"^fn {function.name}\(.*?^}}", text, re.MULTILINE | re.DOTALL)
    assert body is not None
    assert old in body[0]
    faulty = module.text().replace(body[0], body[0].replace(old, new, 1))
    arguments = arguments_of(module, function, rng)
    found = runner.run(module, function, arguments, faulty)
    assert (found != twin(module, function, arguments)).any()
