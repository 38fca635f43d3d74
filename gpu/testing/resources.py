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
from halfstep.errors import AdapterError, HalfstepError, UsageError
from halfstep.testing.module import Binding, Module
from halfstep.testing.textures import bound_sampler, bound_texture
from halfstep.testing.types import FEATURES, DType, Sampler, Texture, Type, dtype_of, leaves_of
from halfstep.testing.values import Resource

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)


@dataclass(frozen=True)
class Given:
    """What is bound to a variable.

    Attributes:
        bound: as a device takes it.
        value: what the bytes that it then holds are, formed as what was given.
        dtype: what one value of it is in NumPy.
        shown: gives what a reference is given of it: the arrays of a texture in its type, as a
            tuple if they are levels; a sampler; what a buffer holds as `value` forms it.
    """

    bound: Bindable
    value: Callable[[Bytes], Any]
    dtype: DType
    shown: Callable[[], Any]


def given(
    binding: Binding, value: Any, device: GpuDevice, adapter: str, *, argument: str = "bindings"
) -> Given:
    """What is bound to a variable that is given ``value``, in an ``argument``.

    ``adapter`` is the device's, by name.

    Raises:
        UsageError: it does not fit the type of the variable.
        AdapterError: the device has no such textures.
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
