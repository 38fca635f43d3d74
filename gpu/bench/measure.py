"""Runs a benchmark part by part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from halfstep.bench import machine
from halfstep.bench.parts import PARTS, Bench
from halfstep.bench.report import Report
from halfstep.device.adapters import Adapter


def measure(
    adapter: Adapter,
    names: Sequence[str] = tuple(PARTS),
    rounds: int = 5,
    progress: Callable[[float], None] = lambda _: None,
) -> Report:
    """Run the parts ``names`` of the benchmark on ``adapter``; times are medians of ``rounds``.

    ``progress`` is called with the finished part of the work, 0…1.

    Raises:
        DeviceError: the device was lost or the driver failed.
        HalfstepError: a process that measures threads failed.
    """
    parts = []
    for done, name in enumerate(names):
        bench = Bench(adapter, rounds, partial(_report, progress, done, len(names)))
        parts.append(PARTS[name](bench))
    return Report(machine.facts(adapter), rounds, tuple(parts))


def _report(progress: Callable[[float], None], done: int, count: int, part: float) -> None:
    progress((done + part) / count)
