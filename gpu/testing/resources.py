"""Values for the resource variables of a shader: buffers, textures and samplers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bindable, Bound
from halfstep.device.handles import GpuDevice
from halfstep.errors import AdapterError, HalfstepError, UsageError
from halfstep.testing.module import Binding, Module
from halfstep.testing.textures import bound_sampler, bound_texture
from halfstep.testing.types import FEATURES, DType, Sampler, Texture, Type, dtype_of, leaves_of
from halfstep.testing.values import Resource

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)


@dataclass(frozen=True)
class Given:
    """A value for a resource variable.

    Attributes:
        bound: the resource in the form for a device.
        value: turns the resource's bytes after a run into the form of the given value.
        dtype: the NumPy type of one value in it.
        shown: gives the reference's argument: the array of a texture in its type, or a tuple of
            levels; a sampler; the content of a buffer in the form of `value`.
    """

    bound: Bindable
    value: Callable[[Bytes], Any]
    dtype: DType
    shown: Callable[[], Any]


def given(
    binding: Binding, value: Any, device: GpuDevice, adapter: str, *, argument: str = "bindings"
) -> Given:
    """The resource for a variable from a ``value`` in an ``argument`` of the kit.

    ``adapter`` is the name of the device's adapter.

    Raises:
        UsageError: the value does not fit the type of the variable.
        AdapterError: the device lacks that kind of texture.
    """
    where, place = f"{argument}: {binding.name}", (binding.group, binding.number)
    if isinstance(binding.type, Sampler):
        sampler = bound_sampler(binding.type, value, where, place)
        return Given(sampler, lambda _: None, np.dtype(bool), lambda: value)
    if isinstance(binding.type, Texture):
        levels, texture, value_of = bound_texture(binding.type, value, where, place, device)
        shown = tuple(levels) if isinstance(value, tuple) else levels[0]
        return Given(texture, value_of, levels[0].dtype, lambda: shown)
    check_features(binding.name, [binding.type], device, adapter)
    resource = Resource(binding.type, value, where)
    of_kind = "uniform" if binding.kind == "uniform" else "storage"
    most = min(
        device.limits[f"max-{of_kind}-buffer-binding-size"], device.limits["max-buffer-size"]
    )
    if len(resource.raw) > most:
        raise UsageError(
            f"{where}: {len(resource.raw):,} bytes, and a {of_kind} buffer of the device on "
            f"{adapter} has {most:,} at most"
        )
    bound_ = Bound(*place, binding.kind, resource.raw)
    dtype = dtype_of(binding.type)
    return Given(bound_, resource.value, dtype, lambda: resource.value(resource.raw))


def used_by(
    module: Module, function: str, given: Collection[str], constants: Collection[str]
) -> list[str]:
    """The resource variables that a function needs.

    Raises:
        UsageError: one of them is not ``given``, or the function cannot be run.
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
    """Check that a function uses every bound variable.

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
    """Check that a device has all scalars of some types, for a function or shader ``name``.

    ``adapter`` is the name of the device's adapter.

    Raises:
        AdapterError: it lacks a scalar.
    """
    for scalar in {leaf.scalar for type_ in types_ for leaf in leaves_of(type_)}:
        feature = FEATURES.get(scalar)
        if feature is not None and feature not in device.features:
            raise AdapterError(
                f"{name} uses {scalar}, and the device on {adapter} has no {feature}"
            )
