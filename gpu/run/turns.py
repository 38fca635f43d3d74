"""Turns: threads use a device one after another."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager

from halfstep.device.adapters import check_process, is_forked
from halfstep.errors import UsageError


class Turns(ABC):
    """Something that threads use one after another, each for a whole frame, until it is closed."""

    def __init__(self) -> None:
        # The same thread can take this lock again. A signal handler or a finalizer may run in the
        # middle of a turn of its own thread, and would otherwise wait for itself forever.
        self._lock = threading.RLock()
        self._taken = False
        self._closed = False

    def check_usable(self) -> None:
        """Check that turns can be taken.

        Raises:
            UsageError: the object is closed.
            DeviceError: this process was forked from the process that opened the device.
        """
        if self._closed:
            raise UsageError("the renderer is closed")
        check_process()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Wait for other threads, then keep them out until the context ends.

        Raises:
            UsageError: the object is closed, or this thread is in the middle of a turn.
            DeviceError: this process was forked from the process that opened the device.
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
        """Give everything back as soon as no thread is in a turn.

        If the calling thread is in a turn, the end of that turn gives everything back. A forked
        process gives nothing back, because the device belongs to its parent.
        """
        self._closed = True
        if not is_forked():
            with self._lock:
                if not self._taken:
                    self._give_back()

    @abstractmethod
    def _give_back(self) -> None:
        """Give everything back. A second call does nothing."""
