"""Provenance: what a picture was made of and by what, as a file can tell it.

It holds no times, so that the same scene, version and device give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

# A number, a string or a list of such, by name: what JSON can hold.
Provenance = dict[str, Any]

# Those entries of ``Frame.info`` that belong to the picture and not to the run that made it.
KEYS = (
    "version",
    "scene_title",
    "scene_sha256",
    "number_format",
    "method",
    "steps",
    "adapter",
    "driver",
)
# The name under which a file that has names holds it.
NAME = "Halfstep"


def provenance(info: Mapping[str, Any]) -> Provenance:
    """The provenance of a frame, from its ``info``."""
    return {key: info[key] for key in KEYS}


def software(facts: Provenance) -> str:
    """The program and its version, for the field that many kinds of files have for them."""
    return f"{NAME} {facts['version']}"


def to_text(facts: Provenance) -> str:
    """``facts`` as one line of ASCII, which every kind of file can hold."""
    return json.dumps(facts)


def from_text(text: str) -> Provenance | None:
    """What `to_text` was given; None for the text of another program."""
    try:
        facts = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return facts if isinstance(facts, dict) and facts.keys() >= set(KEYS) else None
