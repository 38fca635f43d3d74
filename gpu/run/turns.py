"""Turns with what one thread at a time may use."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from halfstep.device.adapters import check_process, is_forked
from halfstep.errors import UsageError


class Turns(ABC):
    """What threads use one after another, each for a whole frame, until it is closed."""

    def __init__(self) -> None:
        # A lock that the same thread can take again: a signal handler or a finalizer, which may
        # come at any time, finds its own thread in the middle of a turn. It must not wait for it.
        self._lock = threading.RLock()
        self._taken = False
        self._closed = False

    def check_usable(self) -> None:
        """See that turns can be had.

        Raises:
            UsageError: it is closed.
            DeviceError: this process was forked from the one whose device it is.
        """
        if self._closed:
            raise UsageError("the renderer is closed")
        check_process()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Be alone in what is done inside; until then, wait for other threads.

        Raises:
            UsageError: it is closed, or this thread is in the middle of a turn.
            DeviceError: this process was forked from the one whose device it is.
        """
        check_process()
        with self._lock:
            if self._taken:
                raise UsageError(
                    "the renderer is in the middle of another frame of this thread; a signal "
                    "handler or a finalizer cannot have one of it"
                )
            self._taken = True
            try:
                if self._closed:
                    raise UsageError("the renderer is closed")
                yield
            finally:
                self._taken = False
                if self._closed:
                    self._give_back()

    def close(self) -> None:
        """Give everything back once no thread is in its turn, at once if none is.

        Called in the middle of a turn of the same thread, it leaves that to the end of the turn. A
        forked process gives nothing back: all is its parent's.
        """
        self._closed = True
        if not is_forked():
            with self._lock:
                if not self._taken:
                    self._give_back()

    @abstractmethod
    def _give_back(self) -> None:
        """Give everything back; once more does nothing."""
