"""Facts about a device that only a small kernel can find."""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from halfstep.contract.arrays import Array
from halfstep.device.compute import Bound, Compute

# Numbers of rounds that the kernel tries, around powers of two, where counters overflow.
_EDGES = 1 << np.arange(8, 21)
ASKED = np.concatenate([_EDGES - 1, _EDGES, _EDGES + 1]).astype(np.uint32)
# The most rounds that the kernel tries. Work is split below this number on every device.
MOST_ROUNDS = int(ASKED.max())


def loop_limit(compute: Compute) -> int | None:
    """Rounds after which the driver ends loops; None if it runs `MOST_ROUNDS`.

    lavapipe of Mesa 22.3 ends all loops of an invocation after 65,535 rounds. It counts the rounds
    of all invocations in the same vector together.

    Raises:
        DeviceError: the device is lost or out of memory.
    """
    bound = [
        Bound(0, 0, "read-only-storage", ASKED.view(np.uint8)),
        Bound(0, 1, "storage", np.zeros(8 * len(ASKED), np.uint8)),
    ]
    found = _run(compute, "probe_rounds", "count_rounds", bound, len(ASKED))[::2]
    cut = found < ASKED
    return int(found[cut].min()) if cut.any() else None


def subgroup_size(compute: Compute) -> int:
    """The number of invocations in a subgroup. Adapters report only a range.

    Raises:
        DeviceError: the device is lost or out of memory.
    """
    bound = [Bound(0, 0, "storage", np.zeros(512, np.uint8))]
    return int(_run(compute, "probe_subgroup", "ask", bound, 1).min())


def _run(
    compute: Compute, name: str, entry_point: str, bound: list[Bound], workgroups: int
) -> Array:
    """The words that a kernel writes to its buffer of kind "storage"."""
    code = files("halfstep.wgsl").joinpath(f"{name}.wgsl").read_text(encoding="utf-8")
    [found] = compute.run(code, entry_point, bound, (workgroups, 1, 1), name=f"{name}.wgsl")
    return found.view(np.uint32)
