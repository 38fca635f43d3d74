"""Reads numbers and words of an element, and records the place of each fault."""

from __future__ import annotations

import re
from collections.abc import Sequence

from halfstep.models.markup import Document, Element, Value
from halfstep.models.source import MOST_FAULTS
from halfstep.scene.faults import show
from halfstep.scene.formula import MAX_ID
from halfstep.scene.values import LARGEST

_INTEGER = re.compile(r"[+-]?[0-9]+")
_FLOAT = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


class Fields:
    """Reads the keys of an element. A faulty key is recorded in the document, and read as None."""

    def __init__(self, document: Document, element: Element) -> None:
        self._document, self._element = document, element

    def value(self, key: str) -> Value | None:
        """The value of a key; None if it is missing or empty."""
        value = self._document.value(self._element, key)
        return value if value is None or value.text else None

    def fault(self, what: str) -> None:
        """Record a fault of the element."""
        self._document.fault(self._element, what)

    def text(self, key: str, default: str = "") -> str:
        """The text of a key."""
        value = self.value(key)
        return default if value is None else value.text

    def integer(self, key: str, *, least: int = 0, required: bool = True) -> int | None:
        """A whole number."""
        value = self._required(key) if required else self.value(key)
        if value is None:
            return None
        found = self.whole(value, [value.text], least)
        return found[0] if found else None

    def integers(self, key: str, *, least: int = 0) -> tuple[int, ...] | None:
        """Whole numbers separated by blanks."""
        value = self._required(key)
        return None if value is None else self.whole(value, value.text.split(), least)

    def floats(
        self, key: str, counts: Sequence[int], *, required: bool = True
    ) -> tuple[float, ...] | None:
        """Finite numbers separated by blanks. Their number must be one of ``counts``."""
        value = self._required(key) if required else self.value(key)
        if value is None:
            return None
        words = value.text.split()
        wrong = [word for word in words if not _FLOAT.fullmatch(word)]
        wrong = wrong or [word for word in words if not abs(float(word)) <= LARGEST]
        for word in wrong[:MOST_FAULTS]:
            rule = f"between {-LARGEST:g} and {LARGEST:g}" if _FLOAT.fullmatch(word) else "a number"
            self._document.fault(value, f"{show(word)} is not {rule}", value.text.index(word))
        if not wrong and len(words) not in counts:
            numbers = " or ".join(map(str, counts))
            self._document.fault(value, f"has {counted(words, 'number')}, not {numbers}")
            return None
        return None if wrong else tuple(map(float, words))

    def whole(self, value: Value, words: list[str], least: int) -> tuple[int, ...] | None:
        """Words of a value as whole numbers, each at least ``least``; None if one is faulty."""
        found: list[int] = []
        wrong = 0
        for word in words:
            is_number = _INTEGER.fullmatch(word) and len(word) < 20
            if is_number and least <= int(word) <= MAX_ID:
                found.append(int(word))
                continue
            rule = f"between {least} and {MAX_ID}" if is_number else "a whole number"
            self._document.fault(value, f"{show(word)} is not {rule}", value.text.index(word))
            wrong += 1
            if wrong == MOST_FAULTS:
                break
        return tuple(found) if len(found) == len(words) else None

    def _required(self, key: str) -> Value | None:
        value = self.value(key)
        if value is None:
            self.fault(f"{key}: missing")
        return value


def counted(things: Sequence[object], what: str) -> str:
    """The number of things in words: ``3 numbers``."""
    return f"{len(things)} {what}{'s' * (len(things) != 1)}"
