"""What is bound to the resource variables of a shader: buffers, textures and samplers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bindable, Bound
from halfstep.device.handles import GpuDevice
from halfstep.device.textures import DEPTH, FILTERABLE, FORMATS, BoundSampler, BoundTexture
from halfstep.errors import AdapterError, HalfstepError, UsageError
from halfstep.testing import types
from halfstep.testing.module import Binding, Module
from halfstep.testing.types import FEATURES, SCALARS, DType, Texture, Type, dtype_of, leaves_of
from halfstep.testing.values import Resource, Values, array_of, conform, is_numpy, unmasked

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
_LIMITS = {"1d": "max-texture-dimension-1d", "3d": "max-texture-dimension-3d"}
_ACCESS = {"": "", "read": "read-only", "write": "write-only", "read_write": "read-write"}


@dataclass(frozen=True)
class Sampler:
    """What is bound to a ``sampler`` or ``sampler_comparison``.

    Attributes:
        filter: "nearest" takes a texel, "linear" the mean of texels.
        address: what is beyond an edge: "clamp-to-edge", "repeat" or "mirror-repeat".
        compare: of a ``sampler_comparison``, how WebGPU compares what it is given with a depth, as
            "less".
    """

    filter: str = "nearest"
    address: str = "clamp-to-edge"
    compare: str = ""

    def __post_init__(self) -> None:
        allowed = {"filter": _FILTERS, "address": _ADDRESSES, "compare": ("", *_COMPARISONS)}
        for name, values in allowed.items():
            value = getattr(self, name)
            if value not in values:
                told = ", ".join(one for one in values if one)
                raise UsageError(f"Sampler: {name}: {value!r} is none of {told}")


@dataclass(frozen=True)
class Given:
    """What is bound to a variable.

    Attributes:
        bound: as a device takes it.
        value: what the bytes that it then holds are, formed as what was given.
        dtype: what one value of it is in NumPy.
    """

    bound: Bindable
    value: Callable[[Bytes], Any]
    dtype: DType


def given(binding: Binding, value: Any, device: GpuDevice, adapter: str) -> Given:
    """What is bound to a variable that is given ``value``; ``adapter`` is the device's, by name.

    Raises:
        UsageError: it does not fit the type of the variable.
        AdapterError: the device has no such textures.
    """
    where, place = f"bindings: {binding.name}", (binding.group, binding.number)
    if isinstance(binding.type, types.Sampler):
        bound = _sampler(binding.type, value, where, *place)
        return Given(bound, lambda _: None, np.dtype(bool))
    if isinstance(binding.type, Texture):
        return _texture(binding, binding.type, value, device)
    check_features(binding.name, [binding.type], device, adapter)
    resource = Resource(binding.type, value, where)
    bound_ = Bound(*place, binding.kind, resource.raw)
    return Given(bound_, resource.value, dtype_of(binding.type))


def _sampler(type_: types.Sampler, value: Any, where: str, group: int, number: int) -> BoundSampler:
    if not isinstance(value, Sampler):
        raise UsageError(f"{where}: {type(value).__name__} is not a halfstep.testing.Sampler")
    if bool(value.compare) != type_.compares:
        wanted = "compares" if type_.compares else "does not compare"
        raise UsageError(f"{where}: the sampler {wanted}, and compare is {value.compare!r}")
    return BoundSampler(group, number, value.filter, value.address, value.compare)


def _texture(binding: Binding, type_: Texture, value: Any, device: GpuDevice) -> Given:
    where = f"bindings: {binding.name}"
    name, texels = _texels(type_, unmasked(value, where), where)
    _check_size(type_, texels, where, device.limits)
    feature = "" if name == DEPTH else FORMATS[name].feature
    if feature and (name != "bgra8unorm" or type_.access) and feature not in device.features:
        raise AdapterError(f"{where}: the device has no {feature}, which {name} needs")
    axes = _AXES[type_.dimension]
    channels = texels.shape[len(axes) :] or (1,)
    layers = texels.shape[: len(axes)]
    # In an array the first channel is red, in a format it may be blue.
    order = [2, 1, 0, 3] if name == "bgra8unorm" else slice(None)
    whole = texels.reshape(*[1] * (3 - len(layers)), *layers, *channels)[..., order]
    bound = BoundTexture(
        binding.group,
        binding.number,
        type_.dimension,
        name,
        _ACCESS[type_.access],
        texels.dtype != np.float32 or FILTERABLE in device.features,
        whole,
    )

    def value_of(raw: Bytes) -> Values:
        return raw.view(texels.dtype).reshape(whole.shape)[..., order].reshape(texels.shape)

    return Given(bound, value_of, texels.dtype)


def _texels(type_: Texture, value: Any, where: str) -> tuple[str, Values]:
    """The format that texels have, and the texels in its type."""
    axes = _AXES[type_.dimension]
    shape = array_of(value, where).shape
    if type_.format:
        name, wanted = type_.format, FORMATS[type_.format]
        _check_shape(shape, axes, (wanted.channels,), where)
        return name, _exactly(value, wanted.dtype, where)
    if type_.scalar == "depth":
        _check_shape(shape, axes, (), where)
        return DEPTH, _exactly(value, SCALARS["f32"], where)
    _check_shape(shape, axes, (1, 2, 4), where)
    channels = shape[len(axes)] if len(shape) > len(axes) else 1
    if is_numpy(value):
        for name, one in FORMATS.items():
            if (one.dtype, one.channels, one.scalar) == (value.dtype, channels, type_.scalar):
                return name, value
    dtype = SCALARS[type_.scalar]
    names = (n for n, f in FORMATS.items() if (f.dtype, f.channels) == (dtype, channels))
    return next(names), _exactly(value, dtype, where)


def _check_shape(
    shape: tuple[int, ...], axes: tuple[str, ...], channels: Collection[int], where: str
) -> None:
    alone, more = len(shape) == len(axes), len(shape) == len(axes) + 1
    fits = (alone and (not channels or 1 in channels)) or (more and shape[-1] in channels)
    if fits and 0 not in shape:
        return
    plain = ", ".join(axes)
    forms = [f"({plain})"] if not channels or 1 in channels else []
    counts = " or ".join(map(str, channels))
    forms += [f"({plain}, {counts} channels)"] if channels else []
    raise UsageError(f"{where}: shape {shape}, not {' or '.join(forms)}")


def _exactly(value: Any, dtype: DType, where: str) -> Values:
    """``value`` with a type of numbers that holds it."""
    flat = np.asarray(value).reshape(-1)
    return conform(flat if is_numpy(value) else flat.tolist(), dtype, where).reshape(
        np.shape(value)
    )


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


def used_by(
    module: Module, function: str, given: Collection[str], constants: Collection[str]
) -> list[str]:
    """The resource variables that a function needs, all of which are given.

    Raises:
        UsageError: it needs one that is not, or cannot be run.
    """
    module.check_use(function, constants)
    used = [binding.name for binding in module.bindings(function)]
    if missing := [name for name in used if name not in given]:
        raise UsageError(
            f"{module.name}: {function} uses {', '.join(missing)}, which bindings do not give"
        )
    return used


def check_bindings(
    module: Module, function: str, bindings: Mapping[str, Any], used: Sequence[str]
) -> None:
    """See that a function uses all that is bound.

    Raises:
        UsageError: it does not.
    """
    for name in bindings:
        if name not in used:
            raise UsageError(
                f"{module.name}: {function} uses no resource {name!r}; it uses "
                f"{', '.join(used) or 'none'}"
            )


def check_features(name: str, types_: Iterable[Type], device: GpuDevice, adapter: str) -> None:
    """See that a device has all scalars of some types; ``name`` is what uses them.

    ``adapter`` is the device's, by name.

    Raises:
        AdapterError: it has not.
    """
    for scalar in {leaf.scalar for type_ in types_ for leaf in leaves_of(type_)}:
        feature = FEATURES.get(scalar)
        if feature is not None and feature not in device.features:
            raise AdapterError(
                f"{name} uses {scalar}, and the device on {adapter} has no {feature}"
            )
