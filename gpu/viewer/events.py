"""Events of rendercanvas, as far as a view needs them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# The facts that each kind has, beside those that no view reads.
FACTS = {
    "pointer_down": ("x", "y", "button", "modifiers"),
    "pointer_move": ("x", "y"),
    "pointer_up": ("x", "y"),
    "wheel": ("x", "y", "dy"),
    "key_down": ("key", "modifiers"),
    "close": (),
}
# No screen has so many pixels, and no wheel turns so far.
LARGEST = 1e6


def is_whole(event: Mapping[str, Any]) -> bool:
    """Whether an event has its facts, and they are what they should be."""
    names = FACTS.get(event["event_type"], ())
    return all(_fits(name, event.get(name)) for name in names)


def _fits(name: str, value: object) -> bool:
    match name:
        case "key":
            return isinstance(value, str)
        case "modifiers":
            return isinstance(value, tuple | list) and all(isinstance(each, str) for each in value)
    # Neither NaN nor a number too large for a float is between the two.
    return isinstance(value, int | float) and -LARGEST <= value <= LARGEST
