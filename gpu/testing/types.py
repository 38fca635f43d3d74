"""Types of WGSL, and the positions of their parts in a buffer.

Sizes and alignments are those of the WGSL specification, "Memory Layout". The same rules give them
for naga's types i64, u64 and f64. A bool cannot be in a buffer; a u32, 0 or 1, stands for it there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

DType = np.dtype[Any]

# Name in WGSL -> type in NumPy.
SCALARS: dict[str, DType] = {
    "bool": np.dtype(np.bool_),
    "f32": np.dtype(np.float32),
    "i32": np.dtype(np.int32),
    "u32": np.dtype(np.uint32),
    "f16": np.dtype(np.float16),
    "f64": np.dtype(np.float64),
    "i64": np.dtype(np.int64),
    "u64": np.dtype(np.uint64),
}
# Scalar -> the feature that a device needs for it.
FEATURES = {
    "f16": "shader-f16",
    "f64": "shader-f64",
    "i64": "shader-int64",
    "u64": "shader-int64",
}


# Every type keeps its text in ``written``, because naga treats an alias as a type of its own.


@dataclass(frozen=True)
class Scalar:
    """One number or truth value."""

    name: str
    atomic: bool = False
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Vector:
    """2 to 4 scalars; in NumPy an axis."""

    scalar: Scalar
    count: int
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Matrix:
    """2 to 4 columns, which are vectors; in NumPy (rows, columns), so that ``m @ v`` is right."""

    scalar: Scalar
    columns: int
    rows: int
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Array:
    """Elements one after another; without a count, as many as its buffer holds."""

    element: Type
    count: int | None
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Member:
    """A member of a struct; attributes may give it more bytes than its type needs."""

    name: str
    type: Type
    offset: int  # bytes from the start of the struct
    align: int
    size: int


@dataclass(frozen=True)
class Struct:
    """Named members; in NumPy a structured type with the same names and no padding."""

    name: str
    members: tuple[Member, ...]
    written: str = field(default="", compare=False)


Type = Scalar | Vector | Matrix | Array | Struct


@dataclass(frozen=True)
class Pointer:
    """A parameter through which a function reaches a variable of its caller.

    Attributes:
        space: address space of the variable.
        target: type of the variable.
        access: for a variable in storage, "read" or "read_write".
    """

    space: str
    target: Type
    access: str = ""


@dataclass(frozen=True)
class Texture:
    """Texels that a shader reads or writes.

    Attributes:
        dimension: WebGPU's name: "1d", "2d", "2d-array", "3d", "cube" or "cube-array".
        scalar: type of a channel in the shader; "depth" for a texture of depths.
        format: format of a storage texture, else "".
        access: access of a storage texture: "read", "write" or "read_write".
        is_multisampled: whether a texel has several samples.
    """

    dimension: str
    scalar: str
    format: str = ""
    access: str = ""
    is_multisampled: bool = False
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Sampler:
    """A sampler, which tells how a texture is sampled; it may compare depths."""

    compares: bool
    written: str = field(default="", compare=False)


@dataclass(frozen=True)
class Leaf:
    """All scalars of a type that the same names of members lead to.

    Attributes:
        path: the names.
        offset: bytes from the start of the type.
        scalar: name of the scalar in WGSL.
        shape: shape of the array of scalars, outer arrays first.
        strides: bytes along each axis.
    """

    path: tuple[str, ...]
    offset: int
    scalar: str
    shape: tuple[int, ...] = ()
    strides: tuple[int, ...] = ()


def size_of(type_: Type) -> int:
    """Bytes of a value; for an array without a count, of one element."""
    match type_:
        case Scalar(name):
            return 4 if name == "bool" else SCALARS[name].itemsize
        case Vector(scalar, count):
            return count * size_of(scalar)
        case Matrix(_, columns):
            return columns * stride_of(_column(type_))
        case Array(element, count):
            return stride_of(element) * (1 if count is None else count)
        case Struct(_, members):
            return round_up(members[-1].offset + members[-1].size, align_of(type_))


def align_of(type_: Type) -> int:
    """The alignment of a value in bytes."""
    match type_:
        case Scalar():
            return size_of(type_)
        case Vector(scalar, count):
            # A vec3 has the alignment of a vec4.
            return (2 if count == 2 else 4) * size_of(scalar)
        case Matrix():
            return align_of(_column(type_))
        case Array(element):
            return align_of(element)
        case Struct(_, members):
            return max(member.align for member in members)


def stride_of(type_: Type) -> int:
    """Bytes from one element of an array to the next."""
    return round_up(size_of(type_), align_of(type_))


def dtype_of(type_: Type) -> DType:
    """The NumPy type of a value; for an array without a count, of one element."""
    match type_:
        case Scalar(name):
            return SCALARS[name]
        case Vector(scalar, count):
            return np.dtype((dtype_of(scalar), (count,)))
        case Matrix(scalar, columns, rows):
            return np.dtype((dtype_of(scalar), (rows, columns)))
        case Array(element, count):
            dtype = dtype_of(element)
            if count is None:
                return dtype
            return np.dtype((dtype.base, (count, *dtype.shape)))
        case Struct(_, members):
            return np.dtype([(member.name, dtype_of(member.type)) for member in members])


def leaves_of(type_: Type) -> Iterator[Leaf]:
    """The scalars of a value, in order; for an array without a count, of one element."""
    match type_:
        case Scalar(name):
            yield Leaf((), 0, name)
        case Vector(scalar, count):
            yield Leaf((), 0, scalar.name, (count,), (size_of(scalar),))
        case Matrix(scalar, columns, rows):
            steps = size_of(scalar), stride_of(_column(type_))
            yield Leaf((), 0, scalar.name, (rows, columns), steps)
        case Array(element, None):
            yield from leaves_of(element)
        case Array(element, int(count)):
            stride = stride_of(element)
            for leaf in leaves_of(element):
                shape, strides = (count, *leaf.shape), (stride, *leaf.strides)
                yield Leaf(leaf.path, leaf.offset, leaf.scalar, shape, strides)
        case Struct(_, members):
            for member in members:
                for leaf in leaves_of(member.type):
                    path, offset = (member.name, *leaf.path), member.offset + leaf.offset
                    yield Leaf(path, offset, leaf.scalar, leaf.shape, leaf.strides)


def text_of(type_: Type) -> str:
    """The text of the type in the source, or else its WGSL."""
    match type_:
        case _ if type_.written:
            return type_.written
        case Scalar(name, atomic):
            return f"atomic<{name}>" if atomic else name
        case Vector(scalar, count):
            return f"vec{count}<{scalar.name}>"
        case Matrix(scalar, columns, rows):
            return f"mat{columns}x{rows}<{scalar.name}>"
        case Array(element, count):
            return f"array<{text_of(element)}{'' if count is None else f', {count}'}>"
        case Struct(name):
            return name


def struct_of(name: str, members: list[tuple[str, Type, int, int]]) -> Struct:
    """A struct of members (name, type, alignment, size); 0 stands for the type's own."""
    placed: list[Member] = []
    end = 0
    for member, type_, align, size in members:
        align, size = align or align_of(type_), size or size_of(type_)
        offset = round_up(end, align)
        placed.append(Member(member, type_, offset, align, size))
        end = offset + size
    return Struct(name, tuple(placed))


def round_up(size: int, align: int) -> int:
    """The least multiple of ``align`` that is not below ``size``."""
    return -(-size // align) * align


def _column(matrix: Matrix) -> Vector:
    return Vector(matrix.scalar, matrix.rows)
