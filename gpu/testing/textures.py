"""Textures and samplers: made from arrays, and the faults of arrays that do not fit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.handles import GpuDevice
from halfstep.device.textures import (
    DEPTH,
    FILTERABLE,
    FORMATS,
    MULTISAMPLED,
    SAMPLES,
    BoundSampler,
    BoundTexture,
)
from halfstep.errors import AdapterError, HalfstepError, UsageError
from halfstep.testing import types
from halfstep.testing.types import SCALARS, Texture
from halfstep.testing.values import Values, array_of, conform, is_numpy, unmasked

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_ADDRESSES = ("clamp-to-edge", "repeat", "mirror-repeat")
_FILTERS = ("nearest", "linear")
_COMPARISONS = (
    *("never", "less", "equal", "less-equal", "greater", "not-equal", "greater-equal", "always"),
)
# The axes before the channels of a texel.
_AXES = {
    "1d": ("width",),
    "2d": ("height", "width"),
    "2d-array": ("layers", "height", "width"),
    "3d": ("depth", "height", "width"),
    "cube": ("6", "height", "width"),
    "cube-array": ("6 × cubes", "height", "width"),
}
# Axes that are half as long in each level as in the level before.
_HALVED = ("width", "height", "depth")
_LIMITS = {"1d": "max-texture-dimension-1d", "3d": "max-texture-dimension-3d"}
_ACCESS = {"": "", "read": "read-only", "write": "write-only", "read_write": "read-write"}


@dataclass(frozen=True)
class Sampler:
    """The value for a ``sampler`` or ``sampler_comparison``.

    Attributes:
        filter: "nearest" takes a texel, "linear" the mean of texels.
        address: the texel beyond an edge: "clamp-to-edge", "repeat" or "mirror-repeat".
        compare: for a ``sampler_comparison``, WebGPU's name of the comparison of the reference
            value with a depth, as "less".
        mipmap: "nearest" takes a level of the texture, "linear" the mean of two.
    """

    filter: str = "nearest"
    address: str = "clamp-to-edge"
    compare: str = ""
    mipmap: str = "nearest"

    def __post_init__(self) -> None:
        allowed = {
            "filter": _FILTERS,
            "address": _ADDRESSES,
            "compare": ("", *_COMPARISONS),
            "mipmap": _FILTERS,
        }
        for name, values in allowed.items():
            value = getattr(self, name)
            if value not in values:
                told = ", ".join(one for one in values if one)
                raise UsageError(f"Sampler: {name}: {value!r} is none of {told}")


def bound_sampler(
    type_: types.Sampler, value: Any, where: str, place: tuple[int, int]
) -> BoundSampler:
    """A sampler at a ``place``, (group, number).

    Raises:
        UsageError: ``value`` is no sampler, or only one of sampler and shader compares.
    """
    if not isinstance(value, Sampler):
        raise UsageError(f"{where}: {type(value).__name__} is not a halfstep.testing.Sampler")
    if bool(value.compare) != type_.compares:
        wanted = "compares" if type_.compares else "does not compare"
        raise UsageError(f"{where}: the sampler {wanted}, and compare is {value.compare!r}")
    return BoundSampler(*place, value.filter, value.address, value.compare, value.mipmap)


def bound_texture(
    type_: Texture, value: Any, where: str, place: tuple[int, int], device: GpuDevice
) -> tuple[list[Values], BoundTexture, Callable[[Bytes], Values]]:
    """A texture at a ``place``, (group, number).

    Args:
        type_: the type in the shader.
        value: an array, or a tuple with an array for each level.
        where: its name in messages.
        place: its (group, number).
        device: the device that will hold it.

    Returns:
        The levels in the type of the texture, the texture, and a function that turns the bytes of
        its first level into an array.

    Raises:
        UsageError: the value does not fit the type of the variable.
        AdapterError: the device lacks that kind of texture.
    """
    name, levels = _levels(type_, value, where)
    _check_size(type_, levels[0], where, device.limits)
    feature = "" if name == DEPTH else FORMATS[name].feature
    if feature and (name != "bgra8unorm" or type_.access) and feature not in device.features:
        raise AdapterError(f"{where}: the device has no {feature}, which {name} needs")
    axes = _axes_of(type_)
    # The first channel of an array is red. The first channel of a format may be blue.
    order = [2, 1, 0, 3] if name == "bgra8unorm" else slice(None)

    def whole(texels: Values) -> Values:
        if type_.is_multisampled:
            texels = np.moveaxis(texels, 2, 0)
        channels = texels.shape[len(axes) :] or (1,)
        layers = texels.shape[: len(axes)]
        return texels.reshape(*[1] * (3 - len(layers)), *layers, *channels)[..., order]

    first = levels[0]
    bound = BoundTexture(
        *place,
        type_.dimension,
        name,
        _ACCESS[type_.access],
        first.dtype != np.float32 or FILTERABLE in device.features,
        tuple(map(whole, levels)),
        type_.is_multisampled,
    )

    def value_of(raw: Bytes) -> Values:
        texels = raw.view(first.dtype).reshape(bound.levels[0].shape)
        return texels[..., order].reshape(first.shape)

    return levels, bound, value_of


def _axes_of(type_: Texture) -> tuple[str, ...]:
    """The axes of an array for the texture, before the channels."""
    more = (f"{SAMPLES} samples",) if type_.is_multisampled else ()
    return _AXES[type_.dimension] + more


def _levels(type_: Texture, value: Any, where: str) -> tuple[str, list[Values]]:
    """The format of the texels, and the texels of each level in its type."""
    if isinstance(value, list) and all(map(is_numpy, value)) and len({*map(np.shape, value)}) > 1:
        raise UsageError(
            f"{where}: arrays of different shapes; the levels of a texture are a tuple"
        )
    if not isinstance(value, tuple):
        name, texels = _texels(type_, unmasked(value, where), where)
        return name, [texels]
    if not value:
        raise UsageError(f"{where}: a tuple of no levels")
    if len(value) > 1 and (type_.access or type_.is_multisampled or type_.dimension == "1d"):
        kind = "storage" if type_.access else "1d"
        kind = "multisampled" if type_.is_multisampled else kind
        raise UsageError(f"{where}: {len(value)} levels, and WebGPU has one of a {kind} texture")
    found: list[tuple[str, Values]] = []
    for k, level in enumerate(value):
        place = f"{where}: level {k}"
        found.append(_texels(type_, unmasked(level, place), place))
        (first, largest), (name, texels) = found[0], found[-1]
        if name != first:
            raise UsageError(f"{place}: {name}, and level 0 is {first}")
        wanted = _halved(type_, largest.shape, k)
        if k and wanted == _halved(type_, largest.shape, k - 1):
            raise UsageError(f"{place}: level {k - 1} has one texel already, and is the last")
        if texels.shape != wanted:
            raise UsageError(f"{place}: shape {texels.shape}, not {wanted}")
    return found[0][0], [texels for _, texels in found]


def _halved(type_: Texture, shape: tuple[int, ...], level: int) -> tuple[int, ...]:
    """The shape of a level, if the first level has ``shape``."""
    axes = _axes_of(type_)
    sizes = (
        max(size >> level, 1) if axis in _HALVED else size
        for axis, size in zip(axes, shape, strict=False)
    )
    return (*sizes, *shape[len(axes) :])


def _texels(type_: Texture, value: Any, where: str) -> tuple[str, Values]:
    """The format of the texels, and the texels in its type."""
    axes = _axes_of(type_)
    shape = array_of(value, where).shape
    if type_.format:
        name, wanted = type_.format, FORMATS[type_.format]
        _check_shape(shape, axes, (wanted.channels,), where)
        return name, conform(value, wanted.dtype, where, any_axes=True, axis="texels")
    if type_.scalar == "depth":
        _check_shape(shape, axes, (), where)
        depths = conform(value, SCALARS["f32"], where, any_axes=True, axis="texels")
        if not (within := (depths >= 0) & (depths <= 1)).all():
            place = tuple(np.argwhere(~within)[0].tolist())
            raise UsageError(f"{where}: {depths[place]} at {place} is no depth, which are 0 to 1")
        return DEPTH, depths
    _check_shape(shape, axes, (1, 2, 4), where)
    channels = shape[len(axes)] if len(shape) > len(axes) else 1
    there = {
        name: one.dtype
        for name, one in FORMATS.items()
        if (one.channels, one.scalar) == (channels, type_.scalar)
        and (name in MULTISAMPLED or not type_.is_multisampled)
    }
    if is_numpy(value):
        for name, dtype in there.items():
            if dtype == value.dtype:
                return name, value
    # The widest format; no normalised format, because the values are not fractions of 1.
    name = max((n for n in there if "norm" not in n), key=lambda one: there[one].itemsize)
    return name, conform(value, there[name], where, any_axes=True, axis="texels")


def _check_shape(
    shape: tuple[int, ...], axes: Sequence[str], channels: Collection[int], where: str
) -> None:
    alone, more = len(shape) == len(axes), len(shape) == len(axes) + 1
    fits = (alone and (not channels or 1 in channels)) or (more and shape[-1] in channels)
    if (
        fits
        and 0 not in shape
        and all(
            size == int(axis.split()[0])
            for size, axis in zip(shape, axes, strict=False)
            if axis.endswith("samples")
        )
    ):
        return
    plain = ", ".join(axes)
    forms = [f"({plain})"] if not channels or 1 in channels else []
    counts = " or ".join(map(str, channels))
    forms += [f"({plain}, {counts} channels)"] if channels else []
    raise UsageError(f"{where}: shape {shape}, not {' or '.join(forms)}")


def _check_size(type_: Texture, texels: Values, where: str, limits: Mapping[str, int]) -> None:
    axes = _AXES[type_.dimension]
    most = limits[_LIMITS.get(type_.dimension, "max-texture-dimension-2d")]
    for axis, size in zip(axes, texels.shape, strict=False):
        limit = limits["max-texture-array-layers"] if axis[0] in "l6" else most
        if size > limit:
            raise UsageError(f"{where}: {axis} {size} is more than {limit}")
    if type_.dimension.startswith("cube"):
        count, height, width = texels.shape[:3]
        if count % 6 or (type_.dimension == "cube" and count != 6) or height != width:
            raise UsageError(
                f"{where}: shape {texels.shape}, and a cube has 6 squares, +x, -x, +y, -y, +z, -z"
            )
