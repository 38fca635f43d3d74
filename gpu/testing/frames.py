"""Two frames of one scene compared pixel by pixel.

lavapipe and NumPy give the same bits. In the number format fixed32 all devices make the same
decisions. In float32 a device that contracts a·b + c may decide otherwise if the value is within
rounding of zero. A pixel that differs there is ambiguous. A pixel is also ambiguous if both depths
are right within their error bounds. Any other pixel that differs is a failure. A replay in float64
tells which decisions are within rounding; without a replay, the output ``error`` of either frame
does.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Array, Bools, Bytes, Floats
from halfstep.device.adapters import LAVAPIPE
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, Judged
from halfstep.testing.census import as_text, plain
from halfstep.testing.results import keep

# If the decisions of a pixel are the same, its shading may differ by so much: one 8-bit level.
LEVEL = 1 / 255
# Pixels that a census shows.
SHOWN = 5

_AMBIGUOUS = (255, 176, 0)
_FAILED = (255, 0, 96)


@dataclass(frozen=True)
class Replay:
    """The results of a replay; arrays (H, W) as those of a ``Frame``.

    Attributes:
        depth: planar depth, NaN where a ray hits nothing.
        error: bound of a device's error of the depth; inf where a decision is within rounding.
    """

    depth: Floats
    error: Floats


@dataclass(frozen=True)
class Pixel:
    """A pixel that is a failure, with the found and expected values of the arrays that differ."""

    column: int
    row: int
    found: dict[str, Any]
    expected: dict[str, Any]


@dataclass(frozen=True)
class FrameCensus:
    """All differences of two frames.

    Attributes:
        exact: whether all bits had to be the same.
        ambiguous: (H, W), True for pixels that differ and may differ.
        failed: (H, W), True for pixels that differ and must not differ.
        arrays: name -> number of pixels that differ in the array.
        first: the first failures.
        stack: adapter and driver of each frame.
    """

    exact: bool
    ambiguous: Bools
    failed: Bools
    arrays: dict[str, int]
    first: tuple[Pixel, ...]
    stack: dict[str, str]

    @property
    def equal(self) -> bool:
        """Whether no pixel is a failure."""
        return not (self.failed.any() or self.ambiguous.any())

    def as_dict(self) -> dict[str, Any]:
        """The census for JSON."""
        height, width = self.failed.shape
        return {
            "size": [width, height],
            "exact": self.exact,
            "pixels": self.failed.size,
            "ambiguous": int(self.ambiguous.sum()),
            "failed": int(self.failed.sum()),
            "arrays": self.arrays,
            "first": [plain(vars(pixel)) for pixel in self.first],
            "stack": self.stack,
        }

    def __str__(self) -> str:
        """The census for people."""
        failed, ambiguous = int(self.failed.sum()), int(self.ambiguous.sum())
        how = "every bit counts" if self.exact else f"{ambiguous} more are within rounding"
        lines = [f"{failed} of {self.failed.size} pixels differ ({how})"]
        lines += [f"  {name}: {count} pixels" for name, count in self.arrays.items() if count]
        for pixel in self.first:
            lines.append(f"  pixel {pixel.column}, {pixel.row}")
            for name, value in pixel.found.items():
                lines.append(f"    {name} {as_text(value)}, not {as_text(pixel.expected[name])}")
        if failed > len(self.first):
            lines.append(f"  and {failed - len(self.first)} pixels more")
        lines.append("  found on {found}, expected from {expected}".format(**self.stack))
        return "\n".join(lines)


class FrameMismatchError(AssertionError):
    """Two frames differ; its text is the census.

    Attributes:
        census: what differs.
    """

    def __init__(self, census: FrameCensus) -> None:
        super().__init__(str(census))
        self.census = census


# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", (FrameMismatchError, UsageError))


def assert_frames_match(found: Frame, expected: Frame, *, exact: bool | None = None) -> FrameCensus:
    """Compare two frames of one scene; the census if they match.

    Args:
        found: a frame.
        expected: the right frame.
        exact: whether every bit of every array must be the same; by default if both frames are from
            lavapipe or NumPy. If not, the rules above hold, in the module's docstring.

    Raises:
        FrameMismatchError: they do not match.
        UsageError: they have different sizes or outputs.
    """
    census = compare_frames(found, expected, exact=exact)
    keep(census.as_dict(), None if census.equal else lambda: picture_file(found, expected, census))
    if census.failed.any():
        raise FrameMismatchError(census)
    return census


def compare_frames(
    found: Frame, expected: Frame, *, exact: bool | None = None, replay: Replay | None = None
) -> FrameCensus:
    """The census of two frames; arguments and exceptions are those of `assert_frames_match`.

    ``replay`` judges the pixels that differ, in place of the outputs ``error``. For frames without
    these outputs it tells where another surface may be shown: a decision there is within rounding.
    """
    _check_alike(found, expected)
    if exact is None:
        exact = is_exact(found) and is_exact(expected)
    pairs = {name: (getattr(found, name), getattr(expected, name)) for name in found.outputs}
    differs = {name: _differs(*pair) for name, pair in pairs.items()}
    if exact:
        failed = _any(differs, differs)
        ambiguous = np.zeros_like(failed)
    else:
        decided = _any(differs, _judged(Judged.DECIDED))
        ambiguous = decided & _within_bounds(found, expected, replay)
        off = {
            name: _off_by_a_level(*pairs[name]) for name in _judged(Judged.SHADED) if name in pairs
        }
        off["nothing"] = np.zeros_like(decided)
        shaded = _any(off, off) & ~decided
        if "surface" not in pairs:  # another surface may be shown, and only the replay tells
            excused = _within_bounds(found, expected, replay)
            ambiguous |= shaded & excused
            shaded &= ~excused
        failed = (decided & ~ambiguous) | shaded
    places = np.argwhere(failed)[:SHOWN].tolist()
    return FrameCensus(
        exact=exact,
        ambiguous=ambiguous,
        failed=failed,
        arrays={name: int(mask.sum()) for name, mask in differs.items() if mask.any()},
        first=tuple(_pixel(j, i, pairs, differs) for j, i in places),
        stack={
            word: f"{frame.info['adapter']}, {frame.info['driver']}"
            for word, frame in (("found", found), ("expected", expected))
        },
    )


def is_exact(frame: Frame) -> bool:
    """Whether the frame is from a device that promises every bit: NumPy or lavapipe."""
    adapter: str = frame.info["adapter"]
    return adapter == "numpy" or adapter.startswith(LAVAPIPE)


def picture_file(found: Frame, expected: Frame, census: FrameCensus) -> bytes:
    """A PNG file of three pictures side by side: found, expected, and the differences.

    In the third the found picture is dark, failures are red and ambiguous pixels yellow. Frames
    without the output image have only the third.
    """
    from halfstep.frames.png import png

    height, width = census.failed.shape
    pictures: list[Bytes] = []
    places: Bytes = np.full((height, width, 3), 32, np.uint8)
    if "image" in expected.outputs:
        pictures = [found.image, expected.image]
        places = expected.image // 4
    for mask, color in ((census.ambiguous, _AMBIGUOUS), (census.failed, _FAILED)):
        places = np.where(mask[..., None], np.array(color, np.uint8), places)
    return png(np.concatenate([*pictures, places], axis=1))


def _judged(how: Judged) -> list[str]:
    """The outputs that are compared in a way."""
    return [name for name, output in OUTPUTS.items() if output.judged is how]


def _check_alike(found: Frame, expected: Frame) -> None:
    if found.solid.shape != expected.solid.shape:
        sizes = (f"{shape[1]}x{shape[0]}" for shape in (found.solid.shape, expected.solid.shape))
        raise UsageError(f"frames of different sizes: {' and '.join(sizes)}")
    if set(found.outputs) != set(expected.outputs):
        odd = sorted(set(found.outputs) ^ set(expected.outputs))
        raise UsageError(f"only one of the frames has {', '.join(odd)}")


def _differs(found: Array, expected: Array) -> Bools:
    """Pixels (H, W) with different bits; every NaN is equal to every NaN."""
    bits = f"u{found.itemsize}"
    same = np.ascontiguousarray(found).view(bits) == np.ascontiguousarray(expected).view(bits)
    if found.dtype.kind == "f":
        same |= np.isnan(found) & np.isnan(expected)
    return _by_pixel(~same)


def _off_by_a_level(found: Array, expected: Array) -> Bools:
    """Pixels (H, W) whose shading differs by more than `LEVEL`."""
    if found.dtype == np.uint8:
        return _by_pixel(np.abs(found.astype(int) - expected) > 1)
    return _by_pixel(~(np.abs(found - expected) <= LEVEL * np.maximum(np.abs(expected), 1)))


def _within_bounds(found: Frame, expected: Frame, replay: Replay | None) -> Bools:
    """Pixels (H, W) whose two depths may both be right, by their error bounds."""
    integers = {frame.info["number_format"] for frame in (found, expected)} == {"fixed32"}
    if integers:
        return np.zeros(found.solid.shape, bool)
    if "error" not in found.outputs:
        return np.zeros(found.solid.shape, bool) if replay is None else np.isinf(replay.error)
    own = found.error
    if replay is not None:
        own = np.where(np.isinf(own), replay.error, own)
    room = own + (expected if replay is None else replay).error
    if "depth" not in found.outputs:
        return np.isinf(room)
    # The difference is NaN where one is a hit and the other is not.
    depth = (expected if replay is None else replay).depth
    return np.asarray(np.isinf(room) | (np.abs(found.depth - depth) <= room))


def _by_pixel(mask: Bools) -> Bools:
    return np.any(mask, axis=-1) if mask.ndim > 2 else mask


def _any(masks: Mapping[str, Bools], names: Iterable[str]) -> Bools:
    """Where any of the masks with these names is true."""
    return np.logical_or.reduce([masks[name] for name in names if name in masks])


def _pixel(
    row: int, column: int, pairs: Mapping[str, tuple[Array, Array]], differs: Mapping[str, Bools]
) -> Pixel:
    odd = [name for name, mask in differs.items() if mask[row, column]]
    found, expected = ({name: pairs[name][k][row, column] for name in odd} for k in (0, 1))
    return Pixel(column, row, found, expected)
