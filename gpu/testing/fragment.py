"""Fragment shaders: their inputs and outputs, and the triangle that draws them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.device.picture import Drawing, Drawn
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.module import Module
from halfstep.testing.parse import Named
from halfstep.testing.tokens import Tokens, written
from halfstep.testing.types import Scalar, Type, Vector, text_of

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_FORMATS = {"f32": "32float", "f16": "16float", "u32": "32uint", "i32": "32sint"}
_CHANNELS = {1: "r", 2: "rg", 4: "rgba"}
DEPTH = "frag_depth"


@dataclass(frozen=True)
class Output:
    """An output of a fragment shader.

    Attributes:
        name: name of the member, or "" if the shader returns no struct.
        location: location of a color; None for a depth.
        format: format of the texture that it is drawn into.
        channels: number of channels; 0 for a scalar.
    """

    name: str
    location: int | None
    format: str
    channels: int


@dataclass(frozen=True)
class Fragment:
    """An entry point with @fragment.

    Attributes:
        name: its name.
        outputs: its outputs.
    """

    name: str
    outputs: tuple[Output, ...]

    def drawing(self, code: str, vertex: str) -> Drawing:
        """The drawing of it on the triangle of a vertex shader."""
        colors = {one.location: one.format for one in self.outputs if one.location is not None}
        return Drawing(code, vertex, self.name, colors, len(colors) < len(self.outputs))

    def picture(self, drawn: Drawn) -> Any:
        """The picture: (H, W) or (H, W, channels), or a mapping of these by member."""
        found = {}
        for one in self.outputs:
            if one.location is None:
                found[one.name] = drawn.depth
            else:
                color = drawn.colors[one.location]
                found[one.name] = color if one.channels else color[..., 0]
        [first, *more] = found.values()
        return found if more else first


def fragment_of(module: Module, entry_point: str) -> Fragment:
    """An entry point with its outputs.

    Raises:
        UsageError: it has no output, or one that no texture can hold.
    """
    declaration = module.declared[entry_point]
    where = f"{module.name}: {entry_point}"
    parts = list(_parts(module, declaration.type, declaration.of_result))
    outputs = tuple(_output(module, part, where) for part in parts if _is_output(part))
    if not outputs:
        raise UsageError(f"{where} gives no color and no depth")
    return Fragment(entry_point, outputs)


def triangle(module: Module, entry_point: str) -> tuple[str, str]:
    """The name of a vertex shader that covers the picture, and its text.

    It gives the fragment shader, for each ``vec2<f32>`` at a location, the position in the picture:
    (0, 0) is the upper left corner, (1, 1) the lower right one.

    Raises:
        UsageError: the fragment shader takes another type at a location.
    """
    declaration, own = module.declared[entry_point], module.prefix
    members = ""
    for part in declaration.parts:
        for given in _parts(module, part.type, part.attributes, part.name):
            if "location" not in given.attributes:
                continue
            location = module.number(given.attributes["location"], f"{module.name}: {entry_point}")
            type_ = module.type(given.type, f"{module.name}: {entry_point}: {given.name}")
            if type_ != Vector(Scalar("f32"), 2) or "interpolate" in given.attributes:
                raise UsageError(
                    f"{module.name}: {entry_point} takes {given.name} at location {location}, a "
                    f"{text_of(type_)}; the kit's own triangle gives a vec2<f32>, the place in the "
                    "picture, and `vertex` names a vertex shader that gives more"
                )
            members += f"  @location({location}) {own}{location}: vec2<f32>,\n"
    places = "".join(f", {own}uv" for _ in range(members.count("@location")))
    text = (
        f"struct {own}Corner {{\n  @builtin(position) {own}at: vec4<f32>,\n{members}}}\n"
        f"@vertex fn {own}corner(@builtin(vertex_index) {own}k: u32) -> {own}Corner {{\n"
        # Counterclockwise: the front of the triangle is seen.
        f"  let {own}uv = 2.0 * vec2<f32>(f32({own}k >> 1u), f32({own}k & 1u));\n"
        f"  let {own}at = vec4<f32>({own}uv.x * 2.0 - 1.0, 1.0 - {own}uv.y * 2.0, 0.0, 1.0);\n"
        f"  return {own}Corner({own}at{places});\n}}\n"
    )
    return f"{own}corner", text


def size_of_picture(size: Any, largest: int) -> tuple[int, int]:
    """Width and height.

    Raises:
        UsageError: they are no whole numbers, or larger than the device can draw.
    """
    array = np.asarray(size)
    if array.shape != (2,) or array.dtype.kind not in "iu" or not (array >= 1).all():
        raise UsageError(f"size: {size!r} is not (width, height) of whole numbers from 1")
    if (array > largest).any():
        raise UsageError(f"size: {size!r} is more than the {largest} pixels that the device draws")
    width, height = array.tolist()
    return width, height


def _parts(
    module: Module, type_: Tokens, attributes: dict[str, Tokens], name: str = ""
) -> Iterator[Named]:
    """A parameter or result as parts: itself, or the members of its struct."""
    declaration = module.declared.get(str(type_[0])) if type_ else None
    if declaration is not None and declaration.kind == "alias":
        yield from _parts(module, declaration.type, attributes, name)
    elif declaration is not None and declaration.kind == "struct":
        yield from declaration.parts
    elif type_:
        yield Named(name, type_, attributes)


def _is_output(part: Named) -> bool:
    return "location" in part.attributes or _is_depth(part)


def _is_depth(part: Named) -> bool:
    return written(part.attributes.get("builtin", ())).startswith(DEPTH)


def _output(module: Module, part: Named, where: str) -> Output:
    what = f"{where}: {part.name or 'result'}"
    if _is_depth(part):
        return Output(part.name, None, "", 0)
    location = module.number(part.attributes["location"], what)
    type_: Type = module.type(part.type, what)
    count = type_.count if isinstance(type_, Vector) else 1
    scalar = type_.scalar if isinstance(type_, Vector) else type_
    if not isinstance(scalar, Scalar) or scalar.name not in _FORMATS or count == 3:
        raise UsageError(
            f"{what}: a {text_of(type_)} is nothing that a pixel holds exactly; numbers, vec2 and "
            "vec4 of f32, f16, u32 and i32 are"
        )
    channels = count if isinstance(type_, Vector) else 0
    return Output(part.name, location, _CHANNELS[count] + _FORMATS[scalar.name], channels)
