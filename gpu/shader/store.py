"""Writes the WGSL function that stores the outputs of words, for the planes of a frame buffer."""

from __future__ import annotations

from halfstep.contract.planes import DEVICE_OUTPUTS, Kept, Plane
from halfstep.shader.needs import Needs


def stores(needs: Needs) -> str:
    """The function ``store_words``."""
    body = "".join(
        f"  store(PLANE_{name.upper()} + {number}u, place, {words});\n"
        for name, output in DEVICE_OUTPUTS.items()
        if name in needs.outputs and (not output.only_if or output.only_if in needs.facts)
        for number, words in enumerate(
            words for plane in output.planes for words in _words_of(plane)
        )
    )
    shown = ", shown: Shown" if "normal" in needs.facts else ""
    return (
        "// Stores the outputs of words of four pixels.\n"
        f"fn store_words(place: u32, nearest: Nearest{shown}) {{\n{body}}}\n"
    )


def _words_of(plane: Plane) -> list[str]:
    """The words of a plane's value, in order; none if it has no value."""
    if not plane.value:
        return []
    match plane.kept:
        case Kept.KEY:
            return [f"{plane.value}.high", f"{plane.value}.low"]
        case Kept.VECTOR:
            return [f"bitcast<u4>({plane.value}.{axis})" for axis in "xyz"]
        case Kept.FLOAT:
            return [f"bitcast<u4>({plane.value})"]
        case Kept.NUMBER:
            return [plane.value]
