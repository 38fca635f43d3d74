"""The device outputs: one row for each.

A shader writes an output to planes of 32-bit words in the frame buffer. Shaders, frame buffer and
twin all read these rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from halfstep.contract.arrays import U32, Array
from halfstep.contract.keys import joined_key
from halfstep.contract.mirrors import MOST_BOUNCES


class Kept(Enum):
    """How the words of the frame buffer hold an array."""

    NUMBER = "a word"
    FLOAT = "the bits of a float32"
    KEY = "a depth key, its high word first"
    VECTOR = "the bits of three float32"

    @property
    def words(self) -> int:
        """Words of a pixel."""
        return {Kept.KEY: 2, Kept.VECTOR: 3}.get(self, 1)

    def array(self, words: U32) -> Array:
        """The array (rows, W, …) that the planes of words (n, rows, W) hold."""
        match self:
            case Kept.KEY:
                return joined_key(*words)
            case Kept.VECTOR:
                return np.stack([*words], axis=-1).view(np.float32)
            case Kept.FLOAT:
                return np.array(words[0]).view(np.float32)
            case Kept.NUMBER:
                return np.array(words[0])


@dataclass(frozen=True)
class Plane:
    """An array of an output.

    Attributes:
        name: name of the array.
        kept: how words hold it.
        value: what is stored, as shaders have it: a member of ``nearest`` or ``shown``, which the
            twin's `Nearest` and `Shown` have too, or a call; "" if the shader that has it stores
            it without the rows.
        is_least: True for the least value of all solids that were tried, False for the value of the
            visible solid.
    """

    name: str
    kept: Kept
    value: str = ""
    is_least: bool = False

    @property
    def member(self) -> str:
        """The member of the twin's `Nearest` or `Shown`."""
        return self.value.partition(".")[2]


@dataclass(frozen=True)
class DeviceOutput:
    """An output of a device.

    Attributes:
        planes: its arrays.
        facts: the facts that hold when it is requested.
        only_if: the fact without which nothing is stored; "" for none.
    """

    planes: tuple[Plane, ...]
    facts: frozenset[str]
    only_if: str

    @property
    def words(self) -> int:
        """Words of a pixel."""
        return sum(plane.kept.words for plane in self.planes)


def _output(*planes: Plane, facts: str = "", only_if: str = "") -> DeviceOutput:
    return DeviceOutput(planes, frozenset(facts.split()), only_if)


# In the order of the frame buffer. The twin has no output "unfinished", because it finishes, and no
# "verdict", which is all that shaders write that judge pixels again (`run.recheck`).
DEVICE_OUTPUTS = {
    "surface": _output(Plane("surface", Kept.NUMBER, "nearest.surface")),
    "key": _output(Plane("key", Kept.KEY, "nearest.key")),
    "exit": _output(Plane("exit", Kept.KEY, "nearest.leaves"), facts="exit leaving"),
    "color": _output(Plane("color", Kept.VECTOR, "shown.color"), facts="normal color"),
    "normal": _output(Plane("normal", Kept.VECTOR, "shown.normal"), facts="normal"),
    "error": _output(
        Plane("low", Kept.KEY, "nearest.low", is_least=True),
        Plane("doubt", Kept.KEY, "nearest.doubt", is_least=True),
        Plane("bound", Kept.FLOAT, "nearest.bound"),
        facts="error",
    ),
    "vague": _output(
        Plane("vague", Kept.KEY, "nearest.vague", is_least=True), facts="error recheck"
    ),
    "verdict": _output(
        Plane("verdict", Kept.NUMBER), Plane("place", Kept.NUMBER), Plane("within", Kept.FLOAT)
    ),
    "shadow": _output(Plane("shadow", Kept.NUMBER, "nearest.dark"), only_if="shadows"),
    # What hides lights from the points that mirrors show, bounce after bounce. A device keeps it
    # between parts of a frame.
    "mirrored": _output(
        *(Plane(f"mirrored_{bounce}", Kept.NUMBER) for bounce in range(MOST_BOUNCES)),
    ),
    "overlap": _output(
        Plane("overlap", Kept.KEY, "nearest.overlap", is_least=True), only_if="overlap"
    ),
    "gap": _output(Plane("gap", Kept.KEY, "nearest.gap", is_least=True), only_if="gap"),
    "unfinished": _output(Plane("unfinished", Kept.NUMBER, "unfinished()"), only_if="counted"),
}
# Outputs that are held in bytes, with the bytes of a pixel.
OUTPUT_BYTES = {"image": 3, "tag": 1}
PLANES = {plane.name: plane for output in DEVICE_OUTPUTS.values() for plane in output.planes}
