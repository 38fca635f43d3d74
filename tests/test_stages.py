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

FUNCTIONS = [(FLOAT, function) for function in FLOAT.functions()]
FUNCTIONS += [
    (EXACT, function)
    for function in EXACT.functions()
    if function.file in ("polynomial_exact", "halve_incremental")
]

# A word or sign of a function, and what a slip would make of it.
FAULTS = [
    ("polynomial.offset", "f4(x)", "f4(x + 1)"),
    ("polynomial.quadratic", "k[4]", "k[3]"),
    ("polynomial.linear", "k[2]", "k[1]"),
    ("polynomial.quadratic_error", "6.0", "5.0"),
    ("polynomial.linear_error", "4.0", "3.0"),
    ("polynomial_exact.offset", "i64(y)", "i64(x.x)"),
    ("polynomial_exact.quadratic", "k[4]", "k[3]"),
    ("polynomial_exact.linear", "k[2]", "k[1]"),
    ("polynomial_exact.quadratic_error", "-61f", "-60f"),
    ("polynomial_exact.linear_error", "-61f", "-60f"),
    ("piece.whole_interval", "-far_u", "far_u"),
    ("piece.clip", "c * piece.b_in <", "c * piece.b_in <="),
    ("piece.clip", "c * piece.b_out >", "c * piece.b_out >="),
    ("piece.clip", "b < f4(0.0)", "b <= f4(0.0)"),
    ("piece.remains", "<=", "<"),
    ("piece.from_the_eye", "i4(0)", "piece.id_in"),
    ("root.outside_at_entry", "> f4(0.0)", ">= f4(0.0)"),
    ("root.outside_at_exit", "* piece.c_out +", "* piece.c_in +"),
    ("root.turns_within", ">= 4.0", "> 4.0"),
    ("root.turns_within", "slope_out >", "slope_out >="),
    ("root.quadric_entry", "& (a < f4(0.0))", "& (a <= f4(0.0))"),
    ("root.quadric_entry", "crosses | on_plane", "crosses & on_plane"),
    ("root.quadric_exit", "& (a > f4(0.0))", "& (a < f4(0.0))"),
    ("root.ellipsoid_entry", ">=", ">"),
    ("root.ellipsoid_exit", "-g", "g"),
    ("root.polyhedron_entry", "> i4(0)", ">= i4(0)"),
    ("root.polyhedron_exit", "-piece.c_out", "piece.c_out"),
    ("root.patch_entry", "b, c", "c, b"),
    ("root.choose", "outer.g, inner.g", "inner.g, outer.g"),
    ("halve.halve", "slope < f4(0.0)", "slope <= f4(0.0)"),
    ("halve.halve", "k < steps", "k + 1u < steps"),
    ("halve_incremental.halve", "value > f4(0.0)", "value >= f4(0.0)"),
    ("patch.facing", ">= f4(0.0)", "> f4(0.0)"),
    ("patch.bound", ">=", ">"),
    ("article.blocked_in", "line.b < f4(0.0)", "line.b <= f4(0.0)"),
    ("article.blocked_out", "line.b >= f4(0.0)", "line.b > f4(0.0)"),
    ("article.last_entered", "i32(j) + 1", "i32(j)"),
    ("article.first_left", "> found.value", ">= found.value"),
    ("article.cell_of", ">> u4(1u)", ">> u4(2u)"),
    ("article.grid_point", "- i4", "+ i4"),
    ("article.planes_in", "f4(-1.0)", "f4(1.0)"),
    ("article.planes_out", "i4(START)", "i4(cells)"),
    ("article.value_of", "+ c", "- c"),
    ("article.slope_of", "+ g", "- g"),
    ("article.visible_point", "piece.first < piece.last", "piece.first <= piece.last"),
    ("article.article_polyhedron", "k < steps", "k + 1u < steps"),
    ("article.article_quadric", "sign * a >=", "sign * a >"),
    ("article.article_patch", "j = 1u", "j = 2u"),
    ("nearest.depth_key", "1i << steps", "2i << steps"),
    ("nearest.count_key", "+ carry", ""),
    ("nearest.count_key", "shift >= 32u", "shift > 32u"),
    ("nearest.before", "surface < other_surface", "surface <= other_surface"),
    ("certify.bounded_interval", "far_u != 1.0", "far_u == 1.0"),
    ("certify.bounded_clip", "apart | idle", "apart & idle"),
    ("certify.bounded_from_the_eye", "f4(0.0)", "old.error_in"),
    ("certify.surely_ordered", "ends.error_out *", "ends.error_in *"),
    ("certify.line_bound", "size - error", "size + error"),
    ("certify.bounded_form", "g * g -", "g * g +"),
    ("certify.curve_bound", "run.g", "run.a"),
    ("certify.end_signs", "- form.g * b;", "+ form.g * b;"),
    ("certify.certify_ellipsoid", ">= f4(0.0)", "> f4(0.0)"),
    ("certify.certify_polyhedron", "!lost", "lost"),
    ("certify.certify_quadric", "on_entry & ordered", "on_entry"),
    ("certify.bounded_facing", "!differs", "differs"),
    ("certify.bounded_bound", "gap < -error", "gap > -error"),
    ("certify.certify_patch", "plane.missed |", "plane.missed &"),
    ("certify.confirms", "!hit | right", "hit | right"),
    ("certify.least_key", "- borrow", ""),
    ("certify.least_key", "key.low < off.low", "key.low <= off.low"),
    ("normal.dot_product", "a.y * b.y", "a.y * b.x"),
    ("normal.scaled", "a.z * s", "a.z"),
    ("normal.normalized", "select(fallback.x, a.x / safe, some)", "a.x / safe"),
    ("normal.gradient", "k[13]", "k[12]"),
    ("ray.ray_direction", "frame.down.z", "frame.down.y"),
    ("shade.power", "bit = 0u", "bit = 1u"),
    ("shade.shade", "- light.vector.w", "+ light.vector.w"),
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
            values[place] = numbers(rng, (ROWS, LINES, 4))
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
        special = _special(function, place, places[place], values[place], reach, rng)
        if special is not None:
            values[place] = special
    _together(function, values, reach, rng)
    return cast(module, function, values)


def _special(
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
    if name.startswith("error"):  # of at least one rounding
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
            return np.where(rng.random(shape) < 0.5, -1, value)
        case "far_u" if function.file == "certify":
            return np.where(block % 2, 1, np.abs(value[::BLOCK_ROWS][block]))
        case "far_u":
            return np.where(rng.random(shape) < 0.5, 1, value)
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
    function: Function, values: Arguments, reach: Array, rng: np.random.Generator
) -> None:
    """Arguments that belong together: coefficients and offsets, unit vectors, equal points."""
    if function.file == "polynomial_exact" and "k" in values:
        # Terms of each form sum to less than 2^60, as the host sees to; some are exact ties.
        powers = np.array([0, 1, 1, 2, 2, 2][: values["k"].shape[1]])
        largest = 2.0**57 / reach[:, None] ** powers
        values["k"] = np.rint(rng.uniform(-1, 1, values["k"].shape) * largest).astype(np.int64)
        values["k"][rng.random(values["k"].shape) < 0.2] = 0
        ties = rng.random(ROWS) < 0.2
        values["k"][ties, 1:] = 0
        values["k"][ties, 0] = (2 * rng.integers(2**23, 2**24, ties.sum()) + 1) << 30
    elif function.name == "before":
        for place in ("high", "low"):
            same = rng.random((ROWS, 4)) < 0.5
            values[f"other.{place}"] = np.where(
                same, values[f"key.{place}"], values[f"other.{place}"]
            )
        values["surface"], values["other_surface"] = rng.integers(0, 4, (2, ROWS, 4))
    elif function.name == "least_key":
        values["bound"] = np.abs(values["bound"])
    elif function.name == "normalized":
        units(rng, "fallback", values)
        nothing = rng.random((ROWS, 4)) < 0.1
        for axis in "xyz":
            values[f"a.{axis}"] = np.where(nothing, 0, values[f"a.{axis}"])
    elif function.name == "shade":
        units(rng, "normal", values)
        units(rng, "to_eye", values)
        for place in values:
            if "color" in place or place in ("finish.specular", "frame.ambient"):
                values[place] = np.abs(values[place])
            if place.endswith("vector"):
                values[place][:, 3] = rng.integers(0, 2, ROWS)
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
    ("module", "function"), FUNCTIONS, ids=[str(function) for _, function in FUNCTIONS]
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
