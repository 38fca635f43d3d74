"""The events of rendercanvas that a view needs."""

from __future__ import annotations

import json
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
# What a page says of itself to rendercanvas, which takes any value and fails later.
OF_PAGES = {"_framefeedback": ("index", "timestamp"), "resize": ("pwidth", "pheight", "ratio")}
# No screen has so many pixels, and no wheel turns so far.
LARGEST = 1e6
# No picture has so large a number, and no clock shows so many milliseconds.
LATEST = 1e15


def is_whole(event: Mapping[str, Any]) -> bool:
    """Whether an event has all its members, with valid types and values."""
    names = FACTS.get(event["event_type"], ())
    return all(_fits(name, event.get(name)) for name in names)


def is_message(text: str) -> bool:
    """Whether a page's message is an object of JSON that rendercanvas can take."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return False
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        return False
    names = OF_PAGES.get(message["type"], ())
    return all(_fits(name, message.get(name)) for name in names)


def _fits(name: str, value: object) -> bool:
    match name:
        case "index" | "timestamp":
            return isinstance(value, int | float) and 0 <= value <= LATEST
        case "pwidth" | "pheight" | "ratio":
            return isinstance(value, int | float) and 0 < value <= LARGEST
        case "key":
            return isinstance(value, str)
        case "modifiers":
            return isinstance(value, tuple | list) and all(isinstance(each, str) for each in value)
    # This is False for NaN, and for integers too large for a float.
    return isinstance(value, int | float) and -LARGEST <= value <= LARGEST
