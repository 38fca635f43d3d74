"""A frame: the requested arrays, and the facts of how they were made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NotRequired, TypedDict

import numpy as np

from halfstep.contract.arrays import Array
from halfstep.errors import UsageError
from halfstep.frames.outputs import OUTPUTS, Lookup, Output
from halfstep.frames.paths import Paths, Table
from halfstep.frames.png import png


class Origin(TypedDict):
    """Everything that the arrays of a frame depend on."""

    version: str  # of Halfstep
    scene_title: str
    scene_sha256: str
    number_format: str
    method: str
    steps: list[int]  # halvings of each solid of the scene; 0 for a solid that is not seen
    adapter: str
    driver: str  # with its version


class Info(Origin):
    """How a frame was made."""

    wall_ms: float  # from the request to the arrays
    device_ms: NotRequired[float]  # only if the device has timestamps


class Frame:
    """One rendered picture: H rows of W pixels.

    Attributes:
        info: how the frame was made.

    Each of the following arrays is an attribute if it is among the outputs.
    """

    info: Info

    def __init__(
        self, arrays: Mapping[str, Array | Lookup], info: Info, paths: Paths | Table | None = None
    ) -> None:
        self._arrays = dict(arrays)
        self.info = info
        self._paths = paths

    def __getattr__(self, name: str) -> Array:
        if name not in OUTPUTS:
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

    def __getstate__(self) -> dict[str, object]:
        # Look up the arrays first: the scene and tables that lookups need are larger than arrays.
        arrays = {name: getattr(self, name) for name in self._arrays}
        return {"_arrays": arrays, "info": self.info, "_paths": None}

    def __dir__(self) -> Iterable[str]:
        return [*super().__dir__(), *self._arrays]

    def __repr__(self) -> str:
        first = next(iter(self._arrays.values()))
        height, width = (first.numbers if isinstance(first, Lookup) else first).shape[:2]
        outputs, adapter = ", ".join(self._arrays), self.info["adapter"]
        return f"<Frame of {width}x{height}: {outputs}; on {adapter}>"

    def _repr_png_(self) -> bytes | None:
        """The image for a notebook; None if it was not computed."""
        return png(self.image) if "image" in self._arrays else None

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the frame's arrays."""
        return tuple(self._arrays)

    def only(self, outputs: Iterable[str]) -> Frame:
        """The frame with only the arrays ``outputs``."""
        return Frame({name: self._arrays[name] for name in outputs}, self.info, self._paths)

    @property
    def knows_paths(self) -> bool:
        """Whether the frame can tell what a pixel shows; one that was pickled or copied cannot."""
        return self._paths is not None

    def path_table(self) -> Table | None:
        """What all pixels show, without the scene, as files keep it; None where it is not known."""
        return self._paths.table() if isinstance(self._paths, Paths) else self._paths

    def cell_path(self, row: int, column: int) -> list[str]:
        """What a pixel shows: a line for each level from the scene to the solid or the cell.

        The line of a copy names the group and the copy's place, or its row and column in a
        lattice. A pixel of the background gives no lines.

        Raises:
            IndexError: the frame has no such pixel.
            UsageError: the frame was pickled or copied, and so has lost its scene.
        """
        if self._paths is None:
            raise UsageError("this frame is a copy, which does not know the scene")
        return self._paths.at(row, column)


def _described(row: Output) -> str:
    """The line about an output in the docstring of `Frame`."""
    shape = "(H, W)" if row.components == 1 else f"(H, W, {row.components})"
    numbers = np.dtype(row.type).name
    return f"    {row.name}: {shape} {numbers}, {row.meaning}; where nothing is hit {row.miss}.\n"


if Frame.__doc__ is not None:  # `python -OO` removes docstrings
    Frame.__doc__ += "\n" + "".join(map(_described, OUTPUTS.values()))
