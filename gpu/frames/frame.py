"""What a render gives: the arrays that were asked for, and facts about how they were made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.errors import UsageError
from halfstep.frames.png import png
from halfstep.host.pack import Packed, Surfaces

Array = NDArray[Any]
Planes = dict[str, NDArray[Any]]

# Frame array -> device outputs that it is made of.
SOURCES: dict[str, tuple[str, ...]] = {
    "image": ("image",),
    "color": ("color",),
    "solid": (),
    "surface": (),
    "t": ("key",),
    "depth": ("key",),
    "depth_exit": ("exit",),
    "position": ("key",),
    "normal": ("normal",),
    "error": ("key", "error"),
    "steps": (),
}
# Arrays averaged over the samples of a pixel; all others are those of its centre.
AVERAGED = ("image", "color")

_NOT_LEFT = np.uint64(0xFFFFFFFFFFFFFFFF)


class Lookup(NamedTuple):
    """An array that is a table's entries at surface numbers (H, W), looked up when it is wanted."""

    table: Array
    numbers: Array

    def found(self) -> Array:
        """The array."""
        return np.asarray(self.table[self.numbers])


class Frame:
    """One rendered picture: H rows of W pixels.

    Attributes, each computed only if it was among the outputs:
        image: (H, W, 3) uint8, sRGB.
        color: (H, W, 3) float32, linear RGB, not clipped.
        solid: (H, W) int32, index in file order, -1 where nothing is hit; always there.
        surface: (H, W) int32, number of the surface within the solid, -1.
        t: (H, W) float64, fraction of the ray from h to the far base plane; NaN.
        depth: (H, W) float64, planar depth in scene units; NaN.
        depth_exit: (H, W) float64, planar depth where the ray leaves the solid it hit, the paper's
            P2: the far base plane if it has not left by then, ``depth`` if it starts inside; NaN.
        position: (H, W, 3) float64, world; NaN.
        normal: (H, W, 3) float32, unit, outward (towards the viewer for a patch); 0.
        error: (H, W) float64, guaranteed bound of |depth - exact depth| in scene units; inf where
            the hit could not be certified; where nothing is hit 0, or inf if that is not certain.
            ``twin.certify`` has the derivation.
        steps: (H, W) int32, halvings spent on the solid that was hit; 0.
        info: dict of adapter, driver, number_format, method, steps (of every solid), device_ms
            (where the device has timestamps), wall_ms, scene_title, scene_sha256, version.
    """

    info: dict[str, Any]

    def __init__(self, arrays: Mapping[str, Array | Lookup], info: dict[str, Any]) -> None:
        self._arrays = dict(arrays)
        self.info = info

    def __getattr__(self, name: str) -> Array:
        if name not in SOURCES:
            raise AttributeError(f"Frame has no attribute {name!r}")
        if name not in self._arrays:
            raise AttributeError(
                f"{name!r} was not computed; name it in outputs (this frame has: "
                f"{', '.join(sorted(self._arrays))})"
            )
        array = self._arrays[name]
        if isinstance(array, Lookup):
            array = self._arrays[name] = array.found()
        return array

    def __dir__(self) -> Iterable[str]:
        return [*super().__dir__(), *self._arrays]

    def __repr__(self) -> str:
        first = next(iter(self._arrays.values()))
        height, width = (first.numbers if isinstance(first, Lookup) else first).shape[:2]
        outputs, adapter = ", ".join(self._arrays), self.info["adapter"]
        return f"<Frame of {width}x{height}: {outputs}; on {adapter}>"

    def _repr_png_(self) -> bytes | None:
        """The image as a notebook shows it, None where it was not computed."""
        return png(self.image) if "image" in self._arrays else None

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the arrays that are there."""
        return tuple(self._arrays)

    def only(self, outputs: Iterable[str]) -> Frame:
        """The frame with some of its arrays."""
        return Frame({name: self._arrays[name] for name in outputs}, self.info)


def check_outputs(outputs: Iterable[str]) -> tuple[str, ...]:
    """``outputs`` in the order of ``SOURCES``, with ``solid``.

    Raises:
        UsageError: a name is not an output.
    """
    if not isinstance(outputs, Iterable):
        raise UsageError(f"outputs: {outputs!r} is not an array of names")
    if isinstance(outputs, str):
        outputs = (outputs,)
    wanted = {*outputs, "solid"}
    unknown = sorted(wanted - SOURCES.keys(), key=str)
    if unknown:
        raise UsageError(
            f"outputs: {', '.join(map(repr, unknown))} unknown; known are {', '.join(SOURCES)}"
        )
    return tuple(name for name in SOURCES if name in wanted)


def device_outputs(outputs: Iterable[str]) -> frozenset[str]:
    """What a device must compute for the Frame arrays ``outputs``."""
    return frozenset({"surface"}.union(*(SOURCES[name] for name in outputs)))


def arrays_of(
    outputs: Iterable[str], planes: Planes, packed: Packed, tables: Surfaces, first_row: int = 0
) -> dict[str, Array | Lookup]:
    """Frame arrays of a band from what a device or the twin computed."""
    number = planes["surface"]
    setup = packed.setup
    arrays: dict[str, Array | Lookup] = {}
    for name in outputs:
        if name == "image":
            arrays[name] = planes["image"]
        elif name in ("color", "normal"):
            arrays[name] = planes[name]
        elif name == "solid":
            arrays[name] = Lookup(tables.solid, number)
        elif name == "surface":
            arrays[name] = Lookup(tables.number, number)
        elif name == "t":
            arrays[name] = _fraction(planes["key"], number, packed)
        elif name == "depth":
            arrays[name] = _fraction(planes["key"], number, packed) * setup.far
        elif name == "depth_exit":
            leaves = planes["exit"]
            inside = _fraction(leaves, number, packed) * setup.far
            arrays[name] = np.where((number > 0) & (leaves == _NOT_LEFT), setup.far, inside)
        elif name == "position":
            depth = _fraction(planes["key"], number, packed) * setup.far
            j, i = np.mgrid[: number.shape[0], : number.shape[1]]
            directions = setup.view.directions(i, j + first_row)
            position = setup.view.eye + depth[..., None] * directions
            arrays[name] = np.ascontiguousarray(position)
        elif name == "error":
            arrays[name] = _error(planes, packed, tables)
        elif name == "steps":
            arrays[name] = Lookup(steps_by_solid(packed, tables)[tables.solid], number)
    return arrays


def steps_by_solid(packed: Packed, tables: Surfaces) -> NDArray[np.int32]:
    """Halvings (K + 1,) of the scene's solids, 0 of one that is not seen, and a last 0 for none."""
    seen = packed.setup.solid[packed.order]
    return _by_solid(tables, seen, packed.solids["steps"].astype(np.int32))


def _by_solid(tables: Surfaces, solids: NDArray[np.int64], values: Array) -> Array:
    """Values of some of the scene's K solids as (K + 1,): 0 for the others, and at -1 for none."""
    table = np.zeros(len(tables.first) + 1, values.dtype)
    table[solids] = values
    return table


def _fraction(
    key: NDArray[np.generic], number: NDArray[np.integer[Any]], packed: Packed
) -> NDArray[np.float64]:
    """t of depth keys, NaN where nothing is hit."""
    t = key.astype(np.float64) * 2.0**-packed.key_bits
    return np.where(number > 0, t, np.nan)


def _error(planes: Planes, packed: Packed, tables: Surfaces) -> NDArray[np.float64]:
    """Bound of the depth error from what is certain of every solid in the pixel.

    The true depth is at most that of the visible point and its bound, and at least the least depth
    that any certain point can have.  A solid of which nothing is certain spoils a pixel unless its
    whole interval lies behind.
    """
    setup = packed.setup
    half = _by_solid(tables, setup.solid, 2.0 ** -(setup.level + 1.0))
    rounding = _by_solid(tables, setup.solid, setup.depth_error)
    number = planes["surface"]
    solid = tables.solid[number]
    unit = 2.0**-packed.key_bits
    t = planes["key"].astype(np.float64) * unit
    above = planes["bound"].astype(np.float64) * half[solid]
    below = t - planes["low"].astype(np.float64) * unit
    doubt = planes["doubt"].astype(np.float64) * unit
    # A pixel without doubt holds the greatest key, which lies behind everything.
    clear = (planes["doubt"] == _NOT_LEFT) | (doubt > t + above)
    depth_ulp = 2.0**-51 * setup.far
    error = np.maximum(above, below) * setup.far + rounding[solid] + depth_ulp
    return np.where(clear, np.where(number > 0, error, 0.0), np.inf)
