"""Measures times of cases in turn, and fits lines to them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from halfstep.frames.renderer import WARM_UP

Case = TypeVar("Case")


@dataclass(frozen=True)
class Times:
    """Median times of one case, ms."""

    wall: float
    device: float | None  # by the device's own timestamps; None if it has none

    @property
    def best(self) -> float:
        """The device time, which excludes the host's work, or the wall time if there is none."""
        return self.wall if self.device is None else self.device


def interleaved(
    cases: Mapping[Case, Callable[[], float | None]],
    rounds: int,
    progress: Callable[[float], None] = lambda _: None,
    *,
    turn: float = 0.0,
) -> dict[Case, Times]:
    """Median times of ``cases``, after ``WARM_UP`` rounds that do not count.

    Every round runs each case once, so that a machine that slows down affects all of them. A case
    returns its device time in ms, or None; its wall time is measured here. With ``turn``, in ms, a
    round repeats each case until it has run that long. The state in which other cases leave the
    caches then hardly matters.
    """
    times: dict[Case, list[tuple[float, float | None]]] = {case: [] for case in cases}
    for done in range(-WARM_UP, rounds):
        for case, run in cases.items():
            taken = [_timed(run)]
            while sum(wall for wall, _ in taken) < turn:
                taken.append(_timed(run))
            if done >= 0:
                times[case] += taken
        progress((done + WARM_UP + 1) / (rounds + WARM_UP))
    return {case: _medians(taken) for case, taken in times.items()}


def _timed(run: Callable[[], float | None]) -> tuple[float, float | None]:
    """Wall time and device time of a run in ms."""
    begin = time.perf_counter()
    device = run()
    return (time.perf_counter() - begin) * 1e3, device


def _medians(taken: list[tuple[float, float | None]]) -> Times:
    devices = [device for _, device in taken if device is not None]
    return Times(
        statistics.median(wall for wall, _ in taken),
        statistics.median(devices) if devices else None,
    )


@dataclass(frozen=True)
class Line:
    """A straight line fitted to points."""

    slope: float
    intercept: float
    r_squared: float


def line(x: Sequence[float], y: Sequence[float]) -> Line:
    """The least-squares line through points (x, y). At least two must have different x."""
    slope, intercept = np.polyfit(x, y, 1)
    rest = np.asarray(y) - (slope * np.asarray(x) + intercept)
    spread = np.asarray(y) - np.mean(y)
    total = float(spread @ spread)
    return Line(float(slope), float(intercept), 1 - float(rest @ rest) / total if total else 1.0)
