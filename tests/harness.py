"""Stage functions one at a time: on the device by a generated kernel, in NumPy by the twin.

A kernel calls one function of ``wgsl/``. Each invocation reads one row of arguments from a storage
buffer, so that no compiler folds them, and writes every component of the result as the words of a
vec4. Arguments and results are known from the text of the function and of its structures, so a
stage is tested by its name and its arguments alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.device import Adapter, open_device
from halfstep.formats import FIXED32, FLOAT32, FLOAT32_EXACT, Format
from halfstep.pack import SRGB_ENTRIES, srgb_table
from halfstep.source import stage
from halfstep.twin import certify, patch, piece, root

Array = NDArray[Any]
# Arguments by the place they go to, as ``piece.c_in``: (rows, ...) each.
Arguments = dict[str, Array]

# Words that a kernel leaves alone must be seen.
UNTOUCHED = 0xDEADBEEF
WORKGROUP = 64
# Room for half-spaces, and the lights: both are constants of a shader.
LINES = 8
LIGHTS = 2

# WGSL type -> (type in the buffer, NumPy scalar, shape, alignment, value of the stored `word`).
_STORED: dict[str, tuple[str, type[np.generic], tuple[int, ...], int, str]] = {
    "f4": ("vec4<f32>", np.float32, (4,), 16, "{}"),
    "i4": ("vec4<i32>", np.int32, (4,), 16, "{}"),
    "u4": ("vec4<u32>", np.uint32, (4,), 16, "{}"),
    "b4": ("vec4<u32>", np.uint32, (4,), 16, "({} != u4(0u))"),
    "f32": ("f32", np.float32, (), 4, "{}"),
    "i32": ("i32", np.int32, (), 4, "{}"),
    "u32": ("u32", np.uint32, (), 4, "{}"),
    "bool": ("u32", np.uint32, (), 4, "({} != 0u)"),
    "i64": ("i64", np.int64, (), 8, "{}"),
    "vec4<i64>": ("vec4<i64>", np.int64, (4,), 32, "{}"),
}
# WGSL type of a component of a result -> its words.
_WORDS = {
    "f4": ["bitcast<u4>({})"],
    "i4": ["bitcast<u4>({})"],
    "u4": ["{}"],
    "b4": ["select(u4(0u), u4(1u), {})"],
    "f32": ["bitcast<u4>(f4({}))"],
    "i64": ["bitcast<u4>(i4(i32({})))", "bitcast<u4>(i4(i32({} >> 32u)))"],
    "vec4<i64>": ["bitcast<u4>(i4({}))", "bitcast<u4>(i4({} >> u4(32u)))"],
}
_RESULTS = {
    "f4": np.float32,
    "i4": np.int32,
    "u4": np.uint32,
    "b4": np.bool_,
    "f32": np.float32,
    "i64": np.int64,
    "vec4<i64>": np.int64,
}
# The twin takes these as plain numbers, so rows are handed to it grouped by them.
_PLAIN = (
    *("steps", "shift", "spare", "number", "count", "cells"),
    *("eye_inside", "eye_outside", "eye_sure", "may_start_inside", "near_cut"),
)

_FUNCTION = re.compile(r"^fn (\w+)\((.*?)\) -> ([\w<>]+) \{", re.MULTILINE)
_STRUCT = re.compile(r"^struct (\w+) \{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
_MEMBER = re.compile(r"(\w+): ((?:[^<>,\n]|<[^>]*>)+)")


@dataclass(frozen=True)
class Function:
    """A stage function as its WGSL text declares it."""

    file: str
    name: str
    parameters: tuple[tuple[str, str], ...]
    result: str

    def __str__(self) -> str:
        return f"{self.file}.{self.name}"


@dataclass(frozen=True)
class Module:
    """Stage files that stand together in a shader of a number format."""

    format: Format
    files: tuple[str, ...]
    # Functions that read a variable of the frame: name -> the variable's members, with types.
    frame: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def text(self) -> str:
        """The files one after another, with the declarations they rely on."""
        shared = [
            f"const MAX_LINES: u32 = {LINES}u;",
            f"const LIGHTS: u32 = {LIGHTS}u;",
            "const HIGHLIGHTS: bool = true;",
            "const POINT_LIGHTS: bool = true;",
            "var<private> frame: Frame;",
            "var<private> lights: array<Light, LIGHTS>;",
            f"@group(0) @binding(2) var<uniform> srgb_table: array<vec4<u32>, {SRGB_ENTRIES}>;",
        ]
        return "\n".join([*shared, *map(stage, self.files)])

    def functions(self) -> list[Function]:
        """The functions of all files that work on pixels; the others serve them."""
        return [
            Function(file, name, tuple(_MEMBER.findall(parameters)), result)
            for file in self.files
            for name, parameters, result in _FUNCTION.findall(stage(file))
            if result != "u32"
        ]

    def resolved(self, type_: str) -> str:
        """A type without the names that mean another one in each number format."""
        integer = self.format.integer
        fixed = self.format is FIXED32
        names = {
            "Coefficient": "i64" if integer else "f32",
            "Value": "i32" if fixed else "f32",
            "v4": "i4" if fixed else "f4",
            "w4": "vec4<i64>" if fixed else "f4",
        }
        return re.sub(r"\w+", lambda word: names.get(word[0], word[0]), type_)

    def structures(self) -> dict[str, list[tuple[str, str]]]:
        """Members of every structure, with their types."""
        found = _STRUCT.findall(self.text())
        return {name: _MEMBER.findall(re.sub(r"//.*", "", body)) for name, body in found}


def _module(number_format: Format, *files: str, frame: Any = None) -> Module:
    shared = "layout", "piece", "root", "patch", "article", "nearest", "certify"
    return Module(number_format, ("lanes", *number_format.stages, *shared, *files), frame or {})


FLOAT = _module(
    FLOAT32,
    *("normal", "ray", "shade", "encode"),
    frame={
        "ray_direction": {f"frame.{name}": "f4" for name in ("first_ray", "right", "down")},
        "shade": {
            "frame.ambient": "f4",
            **{f"lights[{k}].{name}": "f4" for k in range(LIGHTS) for name in ("vector", "color")},
        },
    },
)
EXACT = _module(FLOAT32_EXACT)
FIXED = _module(FIXED32)


def leaves(module: Module, function: Function) -> dict[str, str]:
    """Where the arguments of a function go, with WGSL types."""
    places: dict[str, str] = {}
    for name, type_ in function.parameters:
        places |= dict(_leaves(module.structures(), name, type_))
    return places | dict(module.frame.get(function.name, {}))


def cast(module: Module, function: Function, arguments: Mapping[str, Array]) -> Arguments:
    """Arguments in the types that a row holds."""
    scalars = {place: _stored(module, t)[1] for place, t in leaves(module, function).items()}
    return {place: arguments[place].astype(scalar) for place, scalar in scalars.items()}


def _leaves(
    structures: Mapping[str, list[tuple[str, str]]], place: str, type_: str
) -> Iterator[tuple[str, str]]:
    if type_ == "ptr<function, Lines>":
        yield from ((f"{place}.c", "lines"), (f"{place}.b", "lines"))
    elif type_ in structures:
        for name, member in structures[type_]:
            yield from _leaves(structures, f"{place}.{name}", member)
    else:
        yield place, type_


def _stored(module: Module, type_: str) -> tuple[str, type[np.generic], tuple[int, ...], int, str]:
    if type_ == "lines":
        element, scalar, shape, alignment, value = _STORED[module.resolved("v4")]
        return f"array<{element}, {LINES}>", scalar, (LINES, *shape), alignment, value
    resolved = module.resolved(type_)
    if match := re.fullmatch(r"array<(\w+), (\d+)>", resolved):
        _, scalar, _, alignment, value = _STORED[match[1]]
        # Arrays of a type and of its alias are not the same to the compiler.
        return type_, scalar, (int(match[2]),), alignment, value
    return _STORED[resolved]


def _member(place: str) -> str:
    """The member of a row that holds an argument."""
    return re.sub(r"\W+", "_", place)


def _value(module: Module, place: str, type_: str) -> str:
    """WGSL expression of an argument, from the row."""
    structures = module.structures()
    if type_ == "ptr<function, Lines>":
        return "&lines"
    if type_ in structures:
        members = (_value(module, f"{place}.{n}", t) for n, t in structures[type_])
        return f"{type_}({', '.join(members)})"
    return _stored(module, type_)[4].format(f"row.{_member(place)}")


def _layout(module: Module, function: Function) -> tuple[list[str], np.dtype[np.void]]:
    """Members of the row's structure and its NumPy type; the widest alignments come first."""
    stored = {place: _stored(module, type_) for place, type_ in leaves(module, function).items()}
    order = sorted(stored, key=lambda place: -stored[place][3])
    packed = np.dtype([(_member(p), stored[p][1], stored[p][2]) for p in order])
    widest = max(alignment for *_, alignment, _ in stored.values())
    names = list(packed.names or ())
    dtype = np.dtype(
        {
            "names": names,
            "formats": [packed[name] for name in names],
            "offsets": [packed.fields[name][1] for name in names] if packed.fields else [],
            "itemsize": -(-packed.itemsize // widest) * widest,
        }
    )
    return [f"{_member(place)}: {stored[place][0]}," for place in order], dtype


def _words(module: Module, function: Function) -> list[tuple[str, str]]:
    """The result's words as expressions with ``{}`` for a component, which, and their types."""
    members = _leaves(module.structures(), "result", function.result)
    return [
        (word.replace("{}", place), t)
        for place, t in members
        for word in _WORDS[module.resolved(t)]
    ]


def kernel(module: Module, function: Function) -> str:
    """WGSL of an entry point that calls one function."""
    members, _ = _layout(module, function)
    words = [word for word, _ in _words(module, function)]
    before = [
        f"  {place} = row.{_member(place)};\n" for place in module.frame.get(function.name, ())
    ]
    if any(type_ == "ptr<function, Lines>" for _, type_ in function.parameters):
        before += [
            "  var lines: Lines;\n",
            "  for (var j = 0u; j < MAX_LINES; j++) {\n",
            "    lines[j] = Line(row.lines_c[j], row.lines_b[j]);\n",
            "  }\n",
        ]
    arguments = ", ".join(_value(module, place, type_) for place, type_ in function.parameters)
    stores = "".join(
        f"  results[ix * {len(words)}u + {k}u] = {word};\n" for k, word in enumerate(words)
    )
    return (
        f"struct Row {{\n  {' '.join(members)}\n}}\n"
        f"@group(0) @binding(0) var<storage, read> rows: array<Row>;\n"
        f"@group(0) @binding(1) var<storage, read_write> results: array<u4>;\n"
        f"@compute @workgroup_size({WORKGROUP})\n"
        f"fn call(@builtin(global_invocation_id) id: vec3<u32>) {{\n"
        "  let ix = id.x;\n"
        f"  if ix >= arrayLength(&rows) {{\n    return;\n  }}\n"
        f"  let row = rows[ix];\n"
        f"{''.join(before)}  let result = {function.name}({arguments});\n{stores}}}\n"
    )


class Runner:
    """Runs stage functions on a device."""

    def __init__(self, adapter: Adapter) -> None:
        self._device = open_device(adapter, features=("shader-int64",))
        table = np.repeat(srgb_table(), 4)
        self._table = self._device.create_buffer_with_data(data=table, usage="UNIFORM")

    def close(self) -> None:
        """Give the device back."""
        self._device.destroy()

    def run(
        self, module: Module, function: Function, arguments: Arguments, text: str | None = None
    ) -> NDArray[np.uint32]:
        """Words (rows, words, 4) of the results; ``text`` stands in for the module's own."""
        code = f"{text or module.text()}\n{kernel(module, function)}"
        pipeline = self._device.create_compute_pipeline(
            layout="auto",
            compute={
                "module": self._device.create_shader_module(code=code),
                "entry_point": "call",
            },
        )
        _, dtype = _layout(module, function)
        count = len(next(iter(arguments.values())))
        rows = np.zeros(count, dtype)
        for place, value in arguments.items():
            rows[_member(place)] = value
        shape = (count, len(_words(module, function)), 4)
        prefilled = np.full(shape, UNTOUCHED, np.uint32)
        buffers = [
            self._device.create_buffer_with_data(data=rows.view(np.uint8), usage="STORAGE"),
            self._device.create_buffer_with_data(data=prefilled, usage="STORAGE|COPY_SRC"),
        ]
        buffers += [self._table] * (function.file == "encode")
        entries = [
            {"binding": k, "resource": {"buffer": buffer}} for k, buffer in enumerate(buffers)
        ]
        group = self._device.create_bind_group(
            layout=pipeline.get_bind_group_layout(0), entries=entries
        )
        encoder = self._device.create_command_encoder()
        compute = encoder.begin_compute_pass()
        compute.set_pipeline(pipeline)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(-(-count // WORKGROUP))
        compute.end()
        self._device.queue.submit([encoder.finish()])
        return np.frombuffer(self._device.queue.read_buffer(buffers[1]), np.uint32).reshape(shape)


def twin(module: Module, function: Function, arguments: Arguments) -> NDArray[np.uint32]:
    """What the twin makes of the arguments, as the words that `Runner.run` returns."""
    members = _leaves(module.structures(), "result", function.result)
    types = [module.resolved(type_) for _, type_ in members]
    count = len(next(iter(arguments.values())))
    words = np.full((count, len(_words(module, function)), 4), UNTOUCHED, np.uint32)
    plain = _plain(module, function)
    keys = np.stack([np.zeros(count), *(arguments[place].astype(np.float64) for place in plain)])
    for key in np.unique(keys, axis=1).T:
        chosen = (keys == key[:, None]).all(axis=0)
        rows = {place: value[chosen] for place, value in arguments.items()}
        rows |= {place: rows[place].dtype.type(n) for place, n in zip(plain, key[1:], strict=True)}
        components = list(_flat(_call(module, function, rows)))
        assert len(components) == len(types), f"{function}: another number of components"
        parts = []
        for component, type_ in zip(components, types, strict=True):
            value = np.broadcast_to(component, (int(chosen.sum()), 4))
            assert value.dtype == _RESULTS[type_], f"{function}: {value.dtype} for {type_}"
            parts += [value.astype(np.uint32)] if value.dtype == bool else _split(value)
        words[chosen] = np.stack(parts, axis=1)
    return words


def _plain(module: Module, function: Function) -> list[str]:
    """The arguments that the twin takes as plain numbers."""
    names = (*_PLAIN, "far_u") if function.file == "certify" else _PLAIN
    scalars = ("i32", "u32", "f32", "bool")
    return [
        place
        for place, type_ in function.parameters
        if place in names and module.resolved(type_) in scalars
    ]


def _split(value: Array) -> list[NDArray[np.uint32]]:
    """The 32-bit words of numbers, the low one first."""
    words = np.ascontiguousarray(value).view(np.uint32).reshape(*value.shape, -1)
    return list(np.moveaxis(words, -1, 0))


def _flat(result: Any) -> Iterator[Array]:
    if isinstance(result, tuple):
        for component in result:
            yield from _flat(component)
    else:
        yield result


def _call(module: Module, function: Function, rows: Mapping[str, Any]) -> Any:
    """The twin's function of the same name; vectors are (rows, 4) there, numbers (rows, 1)."""
    twin_module = import_module(f"halfstep.twin.{function.file}")
    structures = module.structures()
    plain = _plain(module, function)

    def value(place: str, type_: str) -> Any:
        if type_ == "ptr<function, Lines>":
            line = piece.Line
            c, b = rows[f"{place}.c"], rows[f"{place}.b"]
            return [line(c[:, k], b[:, k]) for k in range(rows.get("count", LINES))]
        if type_ in structures:
            members = (value(f"{place}.{name}", member) for name, member in structures[type_])
            return _structure(twin_module, type_)(*members)
        if place in plain:
            number = rows[place]
            if type_ == "Value":
                return module.format.value(number)
            return {"bool": bool, "f32": np.float32}.get(type_, int)(number)
        if type_ == "b4":
            return rows[place] != 0
        if module.resolved(type_) in ("f4", "i4", "u4", "vec4<i64>"):
            return rows[place]
        return np.moveaxis(rows[place], 0, -1)[..., None]

    arguments = {place: value(place, type_) for place, type_ in function.parameters}
    frame = {
        place: np.moveaxis(rows[place], 0, -1)[..., None]
        for place in module.frame.get(function.name, ())
    }
    call: Callable[..., Any] = getattr(twin_module, function.name)
    adapted: Callable[..., Any] = _ADAPTED.get(function.file, _as_it_is)
    return adapted(call, arguments, frame, twin_module, module)


# Where the twin's arguments differ from the shader's.


def _as_it_is(call: Callable[..., Any], arguments: dict[str, Any], *_: Any) -> Any:
    return call(*arguments.values())


def _structure(module: Any, name: str) -> Any:
    """A structure of the twin, from the module that needs it or from the one that declares it."""
    owners = (module, piece, root, certify, patch)
    return next(getattr(owner, name) for owner in owners if hasattr(owner, name))


def _article(
    call: Callable[..., Any], arguments: dict[str, Any], _: Any, __: Any, module: Module
) -> Any:
    """The twin's list of lines knows its length; 2^-n needs no argument."""
    lines = "lines" in arguments
    left_out = ("last_step", *["count"] * lines)
    given = [value for name, value in arguments.items() if name not in left_out]
    if call.__name__ == "grid_point":
        given.append(module.format.value(0))
    return call(*given)


def _nearest(
    call: Callable[..., Any], arguments: dict[str, Any], _: Any, module: Any, *__: Any
) -> Any:
    """The start of an interval is one key."""
    if "start_high" in arguments:
        high, low = arguments.pop("start_high"), arguments.pop("start_low")
        *place, shift = arguments.values()
        return call(*place, module.Key(high, low), shift)
    return call(*arguments.values())


def _interval(call: Callable[..., Any], arguments: dict[str, Any], *_: Any) -> Any:
    """A new piece needs pixels to be of."""
    if next(iter(arguments)) == "near_u":
        return call(np.zeros((len(arguments["near_u"]), 4)), *arguments.values())
    return call(*arguments.values())


def _ray(
    call: Callable[..., Any], arguments: dict[str, Any], frame: dict[str, Any], *_: Any
) -> Any:
    members = {place.removeprefix("frame."): value for place, value in frame.items()}
    return call(members, *arguments.values())


def _shade(
    call: Callable[..., Any], arguments: dict[str, Any], frame: dict[str, Any], *_: Any
) -> Any:
    """The frame's lights are arguments."""
    if not frame:
        return call(*arguments.values())
    lights = [
        SimpleNamespace(vector=frame[f"lights[{k}].vector"], color=frame[f"lights[{k}].color"])
        for k in range(LIGHTS)
    ]
    return call(*arguments.values(), frame["frame.ambient"], lights)


def _encode(call: Callable[..., Any], arguments: dict[str, Any], *_: Any) -> Any:
    return call(srgb_table(), *arguments.values())


_ADAPTED: dict[str, Callable[..., Any]] = {
    "arithmetic": _article,
    "arithmetic_fixed": _article,
    "article": _article,
    "nearest": _nearest,
    "piece": _interval,
    "certify": _interval,
    "ray": _ray,
    "shade": _shade,
    "encode": _encode,
}
