"""A cache with a largest number of values."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from operator import methodcaller
from typing import TypeVar

from halfstep.errors import HalfstepError

# For a faulty shader, pytest shows only the test's own line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

K = TypeVar("K")
V = TypeVar("V")


class Kept(OrderedDict[K, V]):
    """Values by key. When there are too many, the least recently used one is dropped.

    Attributes:
        most: the largest number of values.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self.most = most

    def get_or_make(self, key: K, make: Callable[[], V]) -> V:
        """The value of ``key``; ``make`` makes it if it is not in the cache."""
        if key not in self:
            value = make()
            while len(self) >= self.most:
                self.popitem(last=False)
            self[key] = value
        self.move_to_end(key)
        return self[key]
