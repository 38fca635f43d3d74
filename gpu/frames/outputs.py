"""The outputs: one row for each array that a frame can have.

A row gives the meaning of the array, its sources, and how it is compared and written. Other code
reads everything about outputs from these rows: what a device computes for them, how two frames are
compared, the channels of an EXR file, the grey levels of a PNG file, the tables of the READMEs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import I32, Array, Bools, Floats, Planes
from halfstep.contract.keys import FAR_KEY
from halfstep.errors import UsageError
from halfstep.host.pack import Packed


class Judged(Enum):
    """How `check` compares an output with the twin's where a device need not give every bit."""

    DECIDED = "it follows from decisions: it is equal unless one of them is within rounding"
    SHADED = "it follows from shading: it may differ by one of 256 levels"
    NOT = "it says how sure a device is, or has no bound: it is compared bit for bit or not at all"


class Levels(Enum):
    """The levels by which a PNG file shows an output."""

    IMAGE = "8 bits, as it is"
    SRGB = "sRGB, cut off at 1"
    NUMBER = "number"
    NUMBER_FROM_1 = "number + 1"
    UNIT = "32768 + 32767 n"
    SPREAD = "1…65535, from the least to the greatest"


class Lookup(NamedTuple):
    """An array that is looked up from surface numbers (H, W) when it is first used."""

    find: Callable[[Array], Array]
    numbers: Array

    def found(self) -> Array:
        """The array."""
        return self.find(self.numbers)


@dataclass(frozen=True)
class Band:
    """The planes of a band from a device or the twin, and values that several outputs share."""

    planes: Planes
    packed: Packed
    first_row: int

    @property
    def number(self) -> Array:
        """Surface numbers (rows, W), 0 where nothing is hit."""
        return self.planes["surface"]

    @cached_property
    def hit(self) -> Bools:
        """Where something is hit (rows, W)."""
        return np.asarray(self.number > 0)

    @cached_property
    def t(self) -> Floats:
        """Fraction (rows, W) of the ray up to the far base plane, NaN where nothing is hit."""
        return self.fraction("key")

    @cached_property
    def depth(self) -> Floats:
        """Depth (rows, W) along the view axis in scene units, NaN where nothing is hit."""
        return self.t * self.packed.setup.far

    def fraction(self, plane: str) -> Floats:
        """t (rows, W) of the depth keys in a plane, NaN where nothing is hit."""
        return np.where(self.hit, self.planes[plane].astype(np.float64) * self.unit, np.nan)

    @property
    def unit(self) -> float:
        """t of one unit of a depth key."""
        return float(2.0**-self.packed.key_bits)


def _depth_exit(band: Band) -> Floats:
    far = band.packed.setup.far
    has_not_left = band.hit & (band.planes["exit"] == FAR_KEY)
    return np.where(has_not_left, far, band.fraction("exit") * far)


def _position(band: Band) -> Floats:
    view = band.packed.setup.view
    j, i = np.mgrid[: band.number.shape[0], : band.number.shape[1]]
    return np.ascontiguousarray(view.points(i, j + band.first_row, band.depth))


def _error(band: Band) -> Floats:
    """The bound (rows, W) of the depth error in scene units; inf where it is not certified.

    The true depth is at most the depth of the visible point plus its error bound, and at least the
    least depth of any certified point. A solid whose root is not certified makes the bound of a
    pixel infinite, unless the solid's whole interval lies behind the visible point.
    """
    packed, planes = band.packed, band.planes
    setup = packed.setup
    half = _by_solid(packed, setup.solid, 2.0 ** -(setup.level + 1.0))
    rounding = _by_solid(packed, setup.solid, setup.depth_error)
    solid = packed.surfaces.numbers.rows(band.number)
    t = planes["key"].astype(np.float64) * band.unit
    above = planes["bound"].astype(np.float64) * half[solid]
    below = t - planes["low"].astype(np.float64) * band.unit
    doubt = planes["doubt"].astype(np.float64) * band.unit
    # Where every root is certified, ``doubt`` is the greatest key, which lies behind everything.
    clear = (planes["doubt"] == FAR_KEY) | (doubt > t + above)
    depth_ulp = 2.0**-51 * setup.far
    error = np.maximum(above, below) * setup.far + rounding[solid] + depth_ulp
    return np.where(clear, np.where(band.hit, error, 0.0), np.inf)


def _claims(band: Band, name: str) -> Floats:
    """Depths (rows, W) of the plane ``name``, overlap or gap; NaN where a ray has none."""
    if band.packed.regions is None:
        return np.full(band.number.shape, np.nan)
    key = band.planes[name]
    depth = key.astype(np.float64) * band.unit * band.packed.setup.far
    return np.where(key == FAR_KEY, np.nan, depth)


def _shadow(band: Band) -> Array:
    none = np.zeros(band.number.shape, np.uint32)
    return none if band.packed.shadows is None else band.planes["shadow"]


def _steps(band: Band) -> Lookup:
    steps, numbers = steps_by_solid(band.packed), band.packed.surfaces.numbers
    return Lookup(lambda number: np.asarray(steps[numbers.rows(number)]), band.number)


def steps_by_solid(packed: Packed) -> I32:
    """Halvings (K + 1,) of the scene's K solids: 0 for a solid not seen, a last 0 for no solid."""
    seen = packed.setup.solid[packed.order]
    return _by_solid(packed, seen, packed.solids["steps"].astype(np.int32))


def _by_solid(packed: Packed, solids: Array, values: Array) -> Array:
    """A table (K + 1,) of ``values`` by solid: 0 for other solids, a last 0 for no solid."""
    table = np.zeros(packed.solid_count + 1, values.dtype)
    table[solids] = values
    return table


@dataclass(frozen=True)
class Output:
    """One array of a frame.

    Attributes:
        name: the attribute of ``Frame``.
        type: the type of its numbers.
        meaning: its meaning in words, with the unit.
        miss: its value where nothing is hit.
        of: computes the array from a band.
        sources: the device outputs that the array needs, besides the surface.
        components: numbers in a pixel; with more than one the array is (H, W, components).
        judged: how two frames are compared.
        levels: how a PNG file shows it.
        channels: its channels in an EXR file, one for each component; () leaves it out.
        averaged: True for the mean over a pixel's samples, False for the pixel's centre.
    """

    name: str
    type: type[np.generic]
    meaning: str
    miss: str
    of: Callable[[Band], Array | Lookup]
    sources: tuple[str, ...] = ()
    components: int = 1
    judged: Judged = Judged.DECIDED
    levels: Levels = Levels.SPREAD
    channels: tuple[str, ...] = ()
    averaged: bool = False


_ROWS = (
    Output(
        name="image",
        type=np.uint8,
        components=3,
        meaning="sRGB",
        miss="background",
        sources=("image",),
        of=lambda band: band.planes["image"],
        judged=Judged.SHADED,
        levels=Levels.IMAGE,
        averaged=True,
    ),
    Output(
        name="color",
        type=np.float32,
        components=3,
        meaning="linear RGB, not clipped",
        miss="background",
        sources=("color",),
        of=lambda band: band.planes["color"],
        judged=Judged.SHADED,
        levels=Levels.SRGB,
        channels=("R", "G", "B"),
        averaged=True,
    ),
    Output(
        name="solid",
        type=np.int32,
        meaning="index in the file, where cells follow the solids; always there",
        miss="−1",
        of=lambda band: Lookup(band.packed.surfaces.numbers.solids, band.number),
        levels=Levels.NUMBER_FROM_1,
        channels=("id",),
    ),
    Output(
        name="surface",
        type=np.int32,
        meaning="number of the surface within the solid, or the group of the cell",
        miss="−1",
        of=lambda band: Lookup(band.packed.surfaces.numbers.surfaces, band.number),
        levels=Levels.NUMBER_FROM_1,
        channels=("surface",),
    ),
    Output(
        name="t",
        type=np.float64,
        meaning="fraction of the ray from the camera to the far base plane",
        miss="NaN",
        sources=("key",),
        of=lambda band: band.t,
        channels=("t",),
    ),
    Output(
        name="depth",
        type=np.float64,
        meaning="depth along the view axis, scene units",
        miss="NaN",
        sources=("key",),
        of=lambda band: band.depth,
        channels=("Z",),
    ),
    Output(
        name="depth_exit",
        type=np.float64,
        meaning="depth where the ray leaves the solid it hit, the paper's P2; the far base plane "
        "if it has not left by then; `depth` if it started inside",
        miss="NaN",
        sources=("exit",),
        of=_depth_exit,
        judged=Judged.NOT,
        channels=("ZBack",),
    ),
    Output(
        name="position",
        type=np.float64,
        components=3,
        meaning="world coordinates",
        miss="NaN",
        sources=("key",),
        of=_position,
        channels=("P.X", "P.Y", "P.Z"),
    ),
    Output(
        name="normal",
        type=np.float32,
        components=3,
        meaning="unit, out of the solid; towards the viewer for a plane",
        miss="0",
        sources=("normal",),
        of=lambda band: band.planes["normal"],
        judged=Judged.SHADED,
        levels=Levels.UNIT,
        channels=("N.X", "N.Y", "N.Z"),
    ),
    Output(
        name="error",
        type=np.float64,
        meaning="guaranteed bound of abs(`depth` − exact depth); inf if the hit is not certain",
        miss="0, or inf if the miss is not certain",
        sources=("key", "error"),
        of=_error,
        judged=Judged.NOT,
        channels=("error",),
    ),
    Output(
        name="steps",
        type=np.int32,
        meaning="halvings spent on the solid that was hit",
        miss="0",
        of=_steps,
        levels=Levels.NUMBER,
        channels=("steps",),
    ),
    Output(
        name="place",
        type=np.int32,
        meaning="number of the copy of a group, counted depth first in the order of the file",
        miss="−1, also outside of copies",
        of=lambda band: Lookup(band.packed.surfaces.numbers.places, band.number),
        levels=Levels.NUMBER_FROM_1,
        channels=("place",),
    ),
    Output(
        name="cell",
        type=np.int32,
        meaning="id of the cell",
        miss="−1, also for solids",
        of=lambda band: Lookup(band.packed.surfaces.numbers.cells, band.number),
        levels=Levels.NUMBER_FROM_1,
        channels=("cell",),
    ),
    Output(
        name="material",
        type=np.int32,
        meaning="id of the material",
        miss="−1, also without a material",
        of=lambda band: Lookup(band.packed.surfaces.numbers.materials, band.number),
        levels=Levels.NUMBER_FROM_1,
        channels=("material",),
    ),
    Output(
        name="shadow",
        type=np.uint32,
        meaning="bit k is set if the k-th light with shadows does not reach the point",
        miss="0",
        sources=("shadow",),
        of=_shadow,
        levels=Levels.NUMBER,
        channels=("shadow",),
    ),
    Output(
        name="overlap",
        type=np.float64,
        meaning="depth where the ray is first in two cells of a copy of a group, visible or not",
        miss="NaN without an overlap, hit or not",
        sources=("overlap",),
        of=lambda band: _claims(band, "overlap"),
        judged=Judged.NOT,
        channels=("overlap",),
    ),
    Output(
        name="gap",
        type=np.float64,
        meaning="depth where the ray first leaves all cells of a copy that it enters again",
        miss="NaN without a gap, hit or not",
        sources=("gap",),
        of=lambda band: _claims(band, "gap"),
        judged=Judged.NOT,
        channels=("gap",),
    ),
)
# Outputs that need all cells, also those that are not shown.
OF_HIDDEN = frozenset({"overlap", "gap"})
# All outputs by name, in the order of a frame's arrays.
OUTPUTS = {row.name: row for row in _ROWS}


def check_outputs(outputs: Iterable[str]) -> tuple[str, ...]:
    """``outputs`` in the order of `OUTPUTS`, with ``solid``.

    Raises:
        UsageError: a name is not an output.
    """
    if not isinstance(outputs, Iterable):
        raise UsageError(f"outputs: {outputs!r} is not an array of names")
    if isinstance(outputs, str):
        outputs = (outputs,)
    wanted = {*outputs, "solid"}
    unknown = sorted(wanted - OUTPUTS.keys(), key=str)
    if unknown:
        raise UsageError(
            f"outputs: {', '.join(map(repr, unknown))} unknown; known are {', '.join(OUTPUTS)}"
        )
    return tuple(name for name in OUTPUTS if name in wanted)


def device_outputs(outputs: Iterable[str]) -> frozenset[str]:
    """The device outputs that the Frame arrays ``outputs`` need."""
    return frozenset({"surface"}.union(*(OUTPUTS[name].sources for name in outputs)))


def arrays_of(
    outputs: Iterable[str], planes: Planes, packed: Packed, first_row: int = 0
) -> dict[str, Array | Lookup]:
    """The Frame arrays of a band, from the planes of a device or the twin."""
    band = Band(planes, packed, first_row)
    return {name: OUTPUTS[name].of(band) for name in outputs}
