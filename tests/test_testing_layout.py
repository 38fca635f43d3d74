"""Every part of every type lies where the device looks for it, and comes back from where it is put.

Two shaders take a type apart and put it together, scalar by scalar; which scalar is which is known
here from the names and numbers alone, not from sizes and alignments.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pytest

from halfstep.testing import Kit, module, types
from halfstep.testing.types import (
    FEATURES,
    SCALARS,
    Array,
    Matrix,
    Scalar,
    Struct,
    Type,
    Vector,
    dtype_of,
)

ROWS = 3

STRUCTS = """
struct Mixed { a: f32, b: vec3<f32>, c: f32, d: vec2<u32>, e: bool, f: vec3<bool>, g: mat3x3<f32> }
struct Wide { a: u32, b: i64, c: vec3<f64>, d: f32, e: vec3<i64>, f: f16, g: mat3x2<f64> }
struct Narrow { a: f16, b: vec3<f16>, c: f16, d: vec2<f16>, e: mat2x3<f16>, f: bool }
struct Padded { @size(32) a: f32, @align(64) b: vec2<i32>, c: array<vec3<u32>, 2> }
struct Nested { a: f32, b: array<Mixed, 2>, c: Narrow, d: array<array<Padded, 2>, 2>, e: bool }
"""
# Shapes of matrices; a shader with all of them for every float would take seconds to compile.
SHAPES = {
    "f32": list(product((2, 3, 4), (2, 3, 4))),
    "f16": [(2, 3), (3, 3), (4, 2)],
    "f64": [(2, 3), (3, 3), (4, 2)],
}
# All types that are made of one scalar, as the members of a struct.
EVERY = {
    scalar: [
        *(scalar, f"array<{scalar}, 5>", f"array<vec3<{scalar}>, 3>"),
        *(f"vec{n}<{scalar}>" for n in (2, 3, 4)),
        *(f"mat{c}x{r}<{scalar}>" for c, r in SHAPES.get(scalar, [])),
        *(scalar, f"array<array<vec2<{scalar}>, 3>, 2>"),
    ]
    for scalar in SCALARS
}
STRUCTS += "".join(
    f"struct Every_{scalar} {{ {', '.join(f'm{k}: {t}' for k, t in enumerate(members))} }}\n"
    for scalar, members in EVERY.items()
)


def declared(text: str) -> str:
    """What a type stands on: of the structs those that it is made of."""
    structs = {re.split(r"\W", line)[1]: line for line in STRUCTS.strip().splitlines()}
    used: dict[str, str] = {}
    words = [text]
    while words:
        names = set(re.findall(r"\w+", words.pop())) & structs.keys() - used.keys()
        used |= {name: structs[name] for name in names}
        words += [structs[name].partition("{")[2] for name in names]
    lines = [line for name, line in structs.items() if name in used]
    enable = ["enable f16;"] if re.search(r"\bf16\b", "".join([text, *lines])) else []
    return "\n".join([*enable, *lines, ""])


def typed(text: str) -> Any:
    """A case of a type, with the scalars that not every device has."""
    scalars = set(re.findall(r"\w+", declared(text) + text)) & FEATURES.keys()
    return pytest.param(text, marks=pytest.mark.needs(*scalars), id=text)


TYPES = [
    *SCALARS,
    *(f"vec3<{scalar}>" for scalar in SCALARS),
    *(f"Every_{scalar}" for scalar in SCALARS),
    *("mat3x3<f32>", "mat4x2<f16>", "array<mat3x3<f32>, 2>", "array<vec2<bool>, 3>"),
    *("Mixed", "Wide", "Narrow", "Padded", "Nested", "array<Mixed, 3>", "array<Wide, 2>"),
]


class Part(NamedTuple):
    """A scalar of a type."""

    access: str  # what stands after a value in WGSL
    scalar: str
    path: tuple[Any, ...] = ()  # indices in NumPy, one after the other, from (rows, …) to (rows,)


def parts(type_: Type) -> Iterator[Part]:
    """All scalars of a type, in the order in which a constructor takes them."""
    match type_:
        case Scalar(name):
            yield Part("", name)
        case Vector(scalar, count):
            for k in range(count):
                yield Part(f"[{k}]", scalar.name, ((..., k),))
        case Matrix(scalar, columns, rows):
            for c, r in product(range(columns), range(rows)):
                yield Part(f"[{c}][{r}]", scalar.name, ((..., r, c),))
        case Array(element, int(count)):
            for k, part in product(range(count), list(parts(element))):
                path = ((slice(None), k), *part.path)
                yield Part(f"[{k}]{part.access}", part.scalar, path)
        case Struct(_, members):
            for member in members:
                for part in parts(member.type):
                    path = (member.name, *part.path)
                    yield Part(f".{member.name}{part.access}", part.scalar, path)


def shaders(text: str, type_: Type) -> tuple[str, int]:
    """Functions that take a value apart into f32s and put it together from them."""
    scalars = list(parts(type_))

    def read(part: Part) -> str:
        value = f"value{part.access}"
        return f"select(0f, 1f, {value})" if part.scalar == "bool" else f"f32({value})"

    def write(k: int, part: Part) -> str:
        value = f"parts[{k}]"
        made = f"({value} != 0f)" if part.scalar == "bool" else f"{part.scalar}({value})"
        return f"  value{part.access} = {made};\n"

    count = len(scalars)
    reads = ", ".join(map(read, scalars))
    writes = "".join(write(k, part) for k, part in enumerate(scalars))
    code = (
        f"{declared(text)}alias T = {text};\n"
        f"fn apart(value: T) -> array<f32, {count}> {{\n"
        f"  return array<f32, {count}>({reads});\n}}\n"
        f"fn together(parts: array<f32, {count}>) -> T {{\n  var value: T;\n{writes}"
        "  return value;\n}\n"
    )
    return code, count


def numbered(type_: Type) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """A value of three rows in which no two scalars are equal, and its parts in order."""
    scalars = list(parts(type_))
    numbers = 1 + np.arange(ROWS * len(scalars), dtype=np.float32).reshape(ROWS, -1)
    values = np.zeros(ROWS, dtype_of(type_))
    for k, part in enumerate(scalars):
        if part.scalar == "bool":
            numbers[:, k] = numbers[:, k] % 3 != 0
        view: Any = values
        for index in part.path:
            view = view[index]
        view[...] = numbers[:, k]
    return values, numbers


@pytest.mark.parametrize("text", [typed(text) for text in TYPES])
def test_every_part_is_in_its_place(wgsl: Kit, text: str) -> None:
    type_ = module.Module("types", f"{declared(text)}var<private> a: {text};").variable("a")
    code, _ = shaders(text, type_)
    values, numbers = numbered(type_)
    np.testing.assert_array_equal(wgsl.run(code, "apart", {"value": values}), numbers)
    np.testing.assert_array_equal(wgsl.run(code, "together", {"parts": numbers}), values)


def test_a_wrong_layout_is_seen(wgsl: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "array<vec3<f32>, 3>"
    type_ = module.Module("types", f"var<private> a: {text};").variable("a")
    code, _ = shaders(text, type_)
    values, numbers = numbered(type_)
    np.testing.assert_array_equal(wgsl.run(code, "together", {"parts": numbers}), values)
    # A slip: vectors of three lie next to each other.
    monkeypatch.setattr(types, "stride_of", types.size_of)
    assert (Kit(wgsl.device).run(code, "together", {"parts": numbers}) != values).any()


def test_a_buffer_holds_what_is_bound_to_it(wgsl: Kit) -> None:
    text = """
struct Item { at: vec3<f32>, id: u32 }
struct List { count: u32, items: array<Item> }
struct Lens { scale: mat2x3<f32>, shift: vec3<f32> }
@group(0) @binding(0) var<storage, read_write> list: List;
@group(0) @binding(1) var<storage, read> points: array<vec3<f32>>;
@group(1) @binding(0) var<uniform> lens: Lens;
@group(1) @binding(1) var<storage, read_write> total: atomic<u32>;
@group(1) @binding(2) var<storage, read_write> four: array<f32, 4>;
@compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
  if id.x >= list.count { return; }
  list.items[id.x] = Item(points[id.x] + lens.shift + lens.scale * vec2(1.0, 10.0), id.x + 1u);
  atomicAdd(&total, id.x);
  four[id.x] = 2.0 * four[id.x];
}
"""
    item = wgsl.struct(text, "Item")
    points = np.arange(15, dtype=np.float32).reshape(5, 3)
    scale = np.array([[1, 2], [3, 4], [5, 6]], np.float32)
    shift = np.array([100, 200, 300], np.float32)
    found = wgsl.kernel(
        text,
        "main",
        {
            "list": {"count": 4, "items": np.zeros(5, item)},
            "points": points,
            "lens": {"scale": scale, "shift": shift},
            "total": 7,
            "four": np.array([1, 2, 3, 4], np.float32),
        },
        workgroups=2,
    )
    assert set(found) == {"list", "total", "four"}
    assert found["total"] == 7 + 0 + 1 + 2 + 3
    assert found["four"].tolist() == [2, 4, 6, 8]
    items = found["list"]["items"]
    assert found["list"]["count"] == 4
    assert items["id"].tolist() == [1, 2, 3, 4, 0]
    expected = points[:4] + shift + scale @ np.array([1, 10], np.float32)
    np.testing.assert_array_equal(items["at"][:4], expected)
    assert not items["at"][4].any()


@pytest.mark.needs("f16")
@pytest.mark.parametrize("rows", [1, 2, 3, 63, 64, 65, 1000])
def test_any_number_of_rows(wgsl: Kit, rows: int) -> None:
    code = "enable f16; fn half_of(x: f16) -> f16 { return x * 0.5h; }"
    x = np.arange(rows, dtype=np.float16)
    np.testing.assert_array_equal(wgsl.run(code, "half_of", {"x": x}), x / np.float16(2))


def test_rows_beyond_one_dispatch_are_run_in_parts(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    kit = Kit(wgsl.device)
    limits = dict(wgsl.device.limits)
    limits["max-storage-buffer-binding-size"] = 4 * 100
    small = type("Small", (), {"limits": limits, "features": wgsl.device.features})()
    monkeypatch.setattr(kit, "device", small)
    x = np.arange(1001, dtype=np.uint32)
    found = kit.run("fn square(x: u32) -> u32 { return x * x; }", "square", {"x": x})
    np.testing.assert_array_equal(found, x * x)
