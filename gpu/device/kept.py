"""What is kept for the next use, but not without end."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from operator import methodcaller
from typing import TypeVar

from halfstep.errors import HalfstepError

# Of what is wrong with a shader pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

K = TypeVar("K")
V = TypeVar("V")


class Kept(OrderedDict[K, V]):
    """Values by key, of which the one that was not used for longest goes when there are too many.

    Attributes:
        most: how many there are at most.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self.most = most

    def get_or_make(self, key: K, make: Callable[[], V]) -> V:
        """The value of a key, made where it is not here."""
        if key not in self:
            value = make()
            while len(self) >= self.most:
                self.popitem(last=False)
            self[key] = value
        self.move_to_end(key)
        return self[key]
