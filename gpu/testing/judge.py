"""Compares results of a device with the right ones; the fixture ``wgsl`` does so by `Judge`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import methodcaller
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from halfstep.contract.arrays import Bools
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.call import check_rtol
from halfstep.testing.census import (
    Census,
    MismatchError,
    Tolerance,
    differing,
    joined,
    take,
    within,
)
from halfstep.testing.images import checked_image, difference, path_of, store, stored
from halfstep.testing.results import keep, regenerates
from halfstep.testing.values import Values, conform, paired, spread

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", (MismatchError, HalfstepError))


class Judge:
    """Compares arrays, and keeps a census of each comparison if results are wanted."""

    def __init__(self, stack: Mapping[str, str]) -> None:
        """``stack``: adapter, driver and versions of the device, which a census tells."""
        self._stack = stack

    def compare(
        self,
        found: Any,
        expected: Any,
        *,
        name: str = "result",
        inputs: Mapping[str, Values] | None = None,
        ulp: int = 0,
        atol: float = 0.0,
        rtol: float = 0.0,
        margin: ArrayLike | None = None,
    ) -> Census:
        """Compare results of `Kit.kernel`, or any arrays (rows, …), as `Kit.check` does.

        Args:
            found: results of the device: an array, a number, a struct, or a mapping of these, which
                `Kit.kernel` returns. Each entry of a mapping has rows of its own.
            expected: the right results in the same form; one value may stand for all rows of an
                array.
            name: name of the comparison, for messages.
            inputs: name -> (rows, …), shown with the rows of an array that differ.
            ulp: as in `Kit.check`.
            atol: as in `Kit.check`.
            rtol: as in `Kit.check`.
            margin: the distance of each row of an array from its decision, (rows,).

        Raises:
            MismatchError: they differ.
            UsageError: the shapes or types do not fit.
        """
        tolerance = Tolerance(ulp, atol, rtol)
        parts = list(paired(found, expected))
        check_rtol(tolerance, name, [values.dtype for _, values, _ in parts])
        if isinstance(found, Mapping):
            if margin is not None or inputs:
                raise UsageError("found: a mapping has no rows for margin and inputs")
            censuses = [
                self._census(name, values, wanted, tolerance, member=member)
                for member, values, wanted in parts
            ]
            return self._judge(joined(censuses))
        [(_, values, wanted)] = parts
        rows = len(values)
        shown = {
            key: spread(np.asarray(value), rows, np.asarray(value).dtype, f"inputs: {key}")
            for key, value in (inputs or {}).items()
        }
        excused = within(margin, (rows,))
        return self._judge(self._census(name, values, wanted, tolerance, shown, excused))

    def compare_image(
        self,
        found: Any,
        expected: Any,
        *,
        name: str = "image",
        ulp: int = 0,
        atol: float = 0.0,
        rtol: float = 0.0,
        margin: ArrayLike | None = None,
    ) -> Census:
        """Compare a picture pixel by pixel; if results are kept, a PNG file shows the differences.

        Args:
            found: (height, width) or (height, width, channels), as from `Kit.image`.
            expected: the right picture; or the path of a stored answer, a NumPy file (.npy) or a
                PNG file of 8 bits (.png). A string is a path from the folder of the test. With
                ``--halfstep-regenerate`` pytest writes ``found`` there.
            name: name of the comparison, for messages.
            ulp: as in `Kit.check`, for every channel of every pixel.
            atol: see ulp.
            rtol: see ulp.
            margin: the distance of each pixel from its decision, (height, width); see `Kit.check`.

        Raises:
            MismatchError: they differ.
            UsageError: the shapes or types do not fit, or the stored answer does not exist.
            HalfstepError: a stored answer cannot be written.
        """
        tolerance, image = Tolerance(ulp, atol, rtol), checked_image(found)
        check_rtol(tolerance, name, [image.dtype])
        lead = image.shape[:2]
        excused = within(margin, lead)
        if (path := path_of(expected)) is not None:
            if regenerates():
                store(path, image)
            expected = stored(path)
        dtype = np.dtype((image.dtype, image.shape[2:]))
        wanted = conform(expected, dtype, "expected", rounded=True, any_axes=True)
        wanted = spread(wanted, lead, dtype, "expected")
        pixels, others = (one.reshape(-1, *image.shape[2:]) for one in (image, wanted))
        census = take(
            name,
            pixels,
            others,
            tolerance,
            inputs={},
            excused=excused,
            stack=self._stack,
            lead=lead,
            unit="pixel",
        )

        def picture() -> bytes:
            differs = differing(pixels, others, tolerance)
            masks = (mask.reshape(lead) for mask in (differs & ~excused, differs & excused))
            return difference(image, wanted, *masks)

        return self._judge(census, picture if census.differing else None)

    def _census(
        self,
        name: str,
        found: Values,
        expected: Values,
        tolerance: Tolerance,
        inputs: Mapping[str, Values] | None = None,
        excused: Bools | None = None,
        *,
        member: str = "",
    ) -> Census:
        return take(
            name,
            found,
            expected,
            tolerance,
            inputs=inputs or {},
            excused=within(None, (len(found),)) if excused is None else excused,
            stack=self._stack,
            member=member,
        )

    def _judge(self, census: Census, picture: Callable[[], bytes] | None = None) -> Census:
        keep(census.as_dict(), picture)
        if census.failed:
            raise MismatchError(census)
        return census
