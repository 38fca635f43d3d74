"""Times of cases taken in turn, and lines through them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from halfstep.api import WARM_UP

Case = TypeVar("Case")


@dataclass(frozen=True)
class Times:
    """Median times of one case, ms."""

    wall: float
    device: float | None  # by the device's own timestamps, where it has them

    @property
    def best(self) -> float:
        """The device's time if there is one: it holds nothing of the host's work."""
        return self.wall if self.device is None else self.device


def interleaved(
    cases: Mapping[Case, Callable[[], float | None]],
    rounds: int,
    progress: Callable[[float], None] = lambda _: None,
) -> dict[Case, Times]:
    """Median times of ``cases``, each run once in every round, and ``WARM_UP`` times before.

    A machine that slows down so does it for all of them. A case returns the device's time in ms,
    or None if it has none; its wall time is taken here.
    """
    walls: dict[Case, list[float]] = {case: [] for case in cases}
    devices: dict[Case, list[float]] = {case: [] for case in cases}
    for turn in range(-WARM_UP, rounds):
        for case, run in cases.items():
            begin = time.perf_counter()
            device = run()
            wall = (time.perf_counter() - begin) * 1e3
            if turn >= 0:
                walls[case].append(wall)
                if device is not None:
                    devices[case].append(device)
        progress((turn + WARM_UP + 1) / (rounds + WARM_UP))
    return {
        case: Times(
            statistics.median(walls[case]),
            statistics.median(devices[case]) if devices[case] else None,
        )
        for case in cases
    }


@dataclass(frozen=True)
class Line:
    """A straight line fitted to points."""

    slope: float
    intercept: float
    r_squared: float


def line(x: Sequence[float], y: Sequence[float]) -> Line:
    """The least-squares line through points (x, y), at least two with different x."""
    slope, intercept = np.polyfit(x, y, 1)
    rest = np.asarray(y) - (slope * np.asarray(x) + intercept)
    spread = np.asarray(y) - np.mean(y)
    total = float(spread @ spread)
    return Line(float(slope), float(intercept), 1 - float(rest @ rest) / total if total else 1.0)
