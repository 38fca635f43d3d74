"""Calls of a function for all its rows, in parts that fit buffers of the device."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bindable, Bound, Compute, Held
from halfstep.errors import HalfstepError
from halfstep.testing import loops
from halfstep.testing.call import Call
from halfstep.testing.compiling import Located
from halfstep.testing.kernel import WORKGROUP, Kernel
from halfstep.testing.module import RESULT
from halfstep.testing.types import round_up, stride_of
from halfstep.testing.values import Values, pack, prefilled, unpack

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# Checks that no loop of a function was cut, given the source, the function, and bytes of `watch`.
CheckWatched = Callable[[str, str, Bytes], None]


def rows_at_once(kernel_: Kernel, limits: Mapping[str, int]) -> int:
    """The number of rows that buffers of a device with these limits hold."""
    size = min(limits["max-storage-buffer-binding-size"], limits["max-buffer-size"])
    most = limits["max-compute-workgroups-per-dimension"] * WORKGROUP
    return int(min([most, *(size // stride_of(type_) for type_ in kernel_.types)]))


def run_rows(
    compute: Compute, call: Call, at_once: int, check_watched: CheckWatched
) -> dict[str, Any]:
    """The answers: (rows, …) for those of rows, and the content of bound variables.

    Raises:
        UsageError: the text does not compile.
        DeviceError: the device was lost or the driver failed.
    """
    held = {name: compute.hold(one.bound) for name, one in call.bound.items()}
    found = []
    for first in range(0, call.rows, at_once):
        rows = min(at_once, call.rows - first)
        part = {name: array[first : first + rows] for name, array in call.flat.items()}
        found.append(_run_part(compute, call, list(held.values()), part, rows, check_watched))
    answers: dict[str, Any] = {
        name: np.concatenate([part[name] for part in found]) for name in call.kernel.answers
    }
    for name in call.returns or ():
        if name not in answers:
            answers[name] = call.bound[name].value(compute.read(held[name]))
    for one in held.values():
        one.destroy()
    return {name: answers[name] for name in call.returns or (RESULT,)}


def _run_part(
    compute: Compute,
    call: Call,
    held: Sequence[Held],
    values: Mapping[str, Values],
    rows: int,
    check_watched: CheckWatched,
) -> dict[str, Values]:
    kernel_, numbers = call.kernel, call.kernel.numbers
    bound: list[Bindable | Held] = list(held)
    if "rows" in numbers:
        raw = pack(kernel_.row, values, rows)
        bound.append(Bound(0, numbers["rows"], "read-only-storage", raw))
    if kernel_.given is not None:
        raw = prefilled(round_up(rows * stride_of(kernel_.given), 4))
        bound.append(Bound(0, numbers["results"], "storage", raw))
    if kernel_.watched:
        bound.append(loops.bound(numbers["watched"]))
    with Located(call.module, kernel_.entry_point, kernel_.function):
        raws = compute.run(
            kernel_.code,
            kernel_.entry_point,
            bound,
            (-(-rows // WORKGROUP), 1, 1),
            name=call.module.name,
            constants=call.constants,
        )
    if kernel_.watched:
        check_watched(call.module.name, kernel_.function, raws.pop())
    if kernel_.given is None:
        return {}
    return kernel_.row_answers(unpack(kernel_.given, raws[-1], rows))
