"""Compute shaders that run one after another over buffers that stay on the device."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import index, methodcaller
from typing import Any, SupportsIndex

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bindable, Bound, Compute, Held, Indirect
from halfstep.device.handles import GpuDevice
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.resources import Given

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# Runs an entry point with bound resources on a grid of workgroups.
Dispatch = Callable[[str, Sequence[Bindable | Held], tuple[int, int, int] | Indirect], list[Bytes]]


class Program:
    """Buffers and textures on a device, and the compute shaders of a source that use them.

    `Kit.program` makes one.
    """

    def __init__(
        self,
        given: Mapping[str, Given],
        compute: Compute,
        used: Callable[[str], list[str]],
        dispatch: Dispatch,
    ) -> None:
        """``used`` gives the resources that an entry point uses; ``dispatch`` runs it."""
        self._given, self._compute = given, compute
        self._used, self._dispatch = used, dispatch
        self._held = {name: compute.hold(one.bound) for name, one in given.items()}

    def dispatch(
        self,
        entry_point: str,
        workgroups: SupportsIndex | Sequence[SupportsIndex] | None = None,
        *,
        indirect: str | None = None,
        offset: int = 0,
    ) -> None:
        """Run an entry point.

        Args:
            entry_point: a function with @compute.
            workgroups: numbers of workgroups along x, y and z; 1 by default.
            indirect: instead of ``workgroups``, the name of a buffer with the three numbers. The
                entry point must not write to this buffer.
            offset: bytes before the three numbers in that buffer.

        Raises:
            UsageError, AdapterError, DeviceError: as `Kit.check`.
        """
        used = self._used(entry_point)
        grid: tuple[int, int, int] | Indirect
        if indirect is None:
            grid = grid_of(1 if workgroups is None else workgroups, self._compute.device)
        elif workgroups is not None:
            raise UsageError(f"workgroups: {workgroups!r}, and indirect tells how many there are")
        else:
            grid = self._indirect(entry_point, indirect, offset, used)
        self._dispatch(entry_point, [self._held[name] for name in used], grid)

    def read(self, name: str) -> Any:
        """The content of a buffer or storage texture, in the form of the value given before.

        Raises:
            UsageError: no buffer or storage texture has that name.
            DeviceError: the device was lost or the driver failed.
        """
        there = [n for n, one in self._given.items() if one.bound.is_written]
        if name not in there:
            raise UsageError(
                f"read: nothing that can be written to is called {name!r}; there is "
                f"{', '.join(there) or 'none'}"
            )
        return self._given[name].value(self._compute.read(self._held[name]))

    def _indirect(self, entry_point: str, name: str, offset: int, used: Sequence[str]) -> Indirect:
        bound = self._given[name].bound if name in self._given else None
        if not isinstance(bound, Bound) or bound.kind == "uniform":
            raise UsageError(f"indirect: {name!r} is no storage buffer of the program")
        if bound.is_written and name in used:
            raise UsageError(
                f"indirect: {entry_point} may write to {name}, which holds how many workgroups run"
            )
        whole = isinstance(offset, int | np.integer)
        if not whole or offset < 0 or offset % 4 or offset + 12 > len(bound.raw):
            raise UsageError(
                f"offset: {offset!r} is not a multiple of 4 of 0 to {len(bound.raw) - 12}"
            )
        return Indirect(self._held[name], offset)


def grid_of(
    workgroups: SupportsIndex | Sequence[SupportsIndex], device: GpuDevice
) -> tuple[int, int, int]:
    """The numbers of workgroups along x, y and z.

    Raises:
        UsageError: they are no whole numbers, or more than the device can run.
    """
    largest = device.limits["max-compute-workgroups-per-dimension"]
    try:
        counts = [index(count) for count in np.atleast_1d(np.asarray(workgroups))]
    except (TypeError, ValueError):
        counts = []
    if not 1 <= len(counts) <= 3 or not all(0 <= count <= largest for count in counts):
        raise UsageError(
            f"workgroups: {workgroups!r} is not 1 to 3 whole numbers of 0 to {largest}"
        )
    x, y, z = *counts, *[1] * (3 - len(counts))
    return x, y, z
