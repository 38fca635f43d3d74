"""The events of rendercanvas that a view needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# The members of each kind of event that a view reads.
FACTS = {
    "pointer_down": ("x", "y", "button", "modifiers"),
    "pointer_move": ("x", "y"),
    "pointer_up": ("x", "y"),
    "wheel": ("x", "y", "dy"),
    "key_down": ("key", "modifiers"),
    "close": (),
}
# No screen has this many pixels, and no wheel turns this far.
LARGEST = 1e6


def is_whole(event: Mapping[str, Any]) -> bool:
    """Whether an event has all its members, with valid types and values."""
    names = FACTS.get(event["event_type"], ())
    return all(_fits(name, event.get(name)) for name in names)


def _fits(name: str, value: object) -> bool:
    match name:
        case "key":
            return isinstance(value, str)
        case "modifiers":
            return isinstance(value, tuple | list) and all(isinstance(each, str) for each in value)
    # This is False for NaN, and for integers too large for a float.
    return isinstance(value, int | float) and -LARGEST <= value <= LARGEST
