"""Long arrays in parts that fit a cache, which the cores of this machine share out.

NumPy lets other threads run while it computes. Each part has its own place in the results, so these
do not depend on the number of threads.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from halfstep.contract.arrays import Array, Bools, Floats, Ints, Records

Item = TypeVar("Item")

# More threads would wait for Python, which only one of them runs at a time.
MOST_THREADS = 4
# Number of records that are written at once. With more, they do not stay in a cache meanwhile.
FILLED = 1 << 11


def in_parts(work: Callable[[slice], None], count: int, size: int) -> None:
    """Call ``work`` with slices of ``size`` that together have ``count`` places."""
    shared_out(work, [slice(first, first + size) for first in range(0, count, size)])


def shared_out(work: Callable[[Item], None], items: Sequence[Item]) -> None:
    """Call ``work`` with each of the items, in several threads if there are several cores."""
    Begun(work, items).finish()


class Begun:
    """Work on items that other threads have begun."""

    def __init__(self, work: Callable[[Item], None], items: Sequence[Item]) -> None:
        """Let other threads call ``work`` with items, if there are several cores."""
        others = min(_cores(), MOST_THREADS, len(items)) - 1
        self._rest = functools.partial(_all_of, work, iter(items))
        self._lock = threading.Lock()
        self._done: Future[None] | None = None  # what was left for the thread that asked first
        self._others: list[Future[None]] = []
        if others > 0:
            pool = ThreadPoolExecutor(others)
            self._others = [pool.submit(self._rest) for _ in range(others)]
            pool.shutdown(wait=False)

    def finish(self) -> None:
        """Call ``work`` with the items that are left, and wait for the other threads.

        It may be called again, and raises what ``work`` raised in any thread.
        """
        with self._lock:
            if self._done is None:
                self._done = Future()
                try:
                    self._rest()
                except BaseException as fault:
                    self._done.set_exception(fault)
                else:
                    self._done.set_result(None)
            for each in (self._done, *self._others):
                each.result()


def fill(records: Records, columns: Mapping[str, Array]) -> None:
    """Write members of records (N,), each a column (N, …).

    A record has more bytes than one of its members, so all members of some records are written
    before those of the next ones. One thread writes them: several would wait for Python, because
    each column of some records is short.
    """
    for first in range(0, len(records), FILLED):
        own = records[first : first + FILLED]
        for name, column in columns.items():
            own[name] = column[first : first + FILLED]


def _all_of(work: Callable[[Item], None], left: Iterable[Item]) -> None:
    """Work on what is left, of which other threads may take some, too."""
    for item in left:
        work(item)


def _cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# Indices of an array.
Places = Ints | slice


def at_places(array: Floats, places: Places) -> Floats:
    """The last axis of an array at some places."""
    return array[..., places] if isinstance(places, slice) else array.take(places, axis=-1)


def evenly(places: Ints) -> Places:
    """A slice if the places are equally far apart, because NumPy copies it faster."""
    if not len(places):
        return places
    first, step = int(places[0]), int(places[1] - places[0]) if len(places) > 1 else 1
    stop = first + step * len(places)
    same = step > 0 and np.array_equal(places, np.arange(first, stop, step))
    return slice(first, stop, step) if same else places


def places_in(holds: Bools) -> tuple[Ints, Ints]:
    """The row and the column of each place in a matrix where something holds, row by row.

    `np.nonzero` gives the same, several times as slowly for a matrix.
    """
    row, column = np.divmod(np.flatnonzero(holds), max(holds.shape[1], 1))
    return row, column
