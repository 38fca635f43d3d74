"""Provenance: the scene, program and device that made a picture, as a file records them.

Provenance has no times, so the same scene, version and device give the same bytes.
"""

from __future__ import annotations

import json
from typing import cast

from halfstep.frames.frame import Info, Origin


class Provenance(Origin, total=False):
    """The facts that a file records: the origin of its picture, and facts about the file."""

    outputs: list[str]
    range: list[float]  # the numbers that 1 and 65535 stand for in a PNG file
    frames_range: list[int]  # first and last frame of an animation
    fps: float


# The key of the provenance in files whose metadata have keys.
NAME = "Halfstep"


def provenance(info: Info) -> Provenance:
    """The provenance of a frame, from its ``info``."""
    return {
        "version": info["version"],
        "scene_title": info["scene_title"],
        "scene_sha256": info["scene_sha256"],
        "number_format": info["number_format"],
        "method": info["method"],
        "steps": info["steps"],
        "adapter": info["adapter"],
        "driver": info["driver"],
    }


def software(facts: Provenance) -> str:
    """The program and its version, for the field "software" of many types of files."""
    return f"{NAME} {facts['version']}"


def to_text(facts: Provenance) -> str:
    """``facts`` as one line of ASCII, which every type of file can hold."""
    return json.dumps(facts)


def from_text(text: str) -> Provenance | None:
    """The facts in a text of `to_text`; None for the text of another program."""
    try:
        facts = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if isinstance(facts, dict) and facts.keys() >= Origin.__required_keys__:
        return cast(Provenance, facts)
    return None
