"""What renders bands of a frame: a Vulkan device, or NumPy where there is none."""

from __future__ import annotations

import warnings
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, runtime_checkable

import numpy as np

from halfstep.contract.arrays import Planes
from halfstep.contract.choices import BACKENDS
from halfstep.contract.layout import TILE
from halfstep.device.adapters import Facts, choose_adapter, is_requested
from halfstep.errors import AdapterError, UsageError
from halfstep.host.pack import Packed
from halfstep.host.steps import format_for
from halfstep.scene import Accuracy, Scene

# The twin has this many pixels in a band, so that its arrays stay small for any picture.
TWIN_PIXELS = 1 << 20


@runtime_checkable
class Backend(Protocol):
    """Renders bands, whole frames by one thread at a time.

    Attributes:
        facts: names of the adapter and of its driver.
        most_steps: halvings that a tolerance gets at most; None where the number format decides.
    """

    @property
    def facts(self) -> Facts: ...  # noqa: D102 - the class says it
    @property
    def most_steps(self) -> int | None: ...  # noqa: D102 - the class says it

    def check_usable(self) -> None:
        """See that bands can be rendered.

        Raises:
            UsageError: it is closed.
            DeviceError: its device is that of another process.
        """

    def turn(self) -> AbstractContextManager[None]:
        """Be alone with it for the bands of one frame."""

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:
        """Rows of pixels of a band of ``width`` pixels, a multiple of the tile."""

    def render_band(
        self, scene: Scene, packed: Packed, first_row: int, rows: int, outputs: frozenset[str]
    ) -> tuple[Planes, float | None]:
        """Outputs (rows, width, …) of a band, and the device's time in ms where it is known."""

    def close(self) -> None:
        """Give back what it holds, after the frame that is rendered at this moment."""


class NumPy:
    """The backend that needs no device."""

    most_steps = None

    def __init__(self) -> None:
        self.facts: Facts = {"adapter": "numpy", "driver": f"NumPy {np.__version__}"}
        self._closed = False

    def check_usable(self) -> None:
        """As of `Backend`."""
        if self._closed:
            raise UsageError("the renderer is closed")

    def turn(self) -> AbstractContextManager[None]:
        """Threads need not wait for one another."""
        return nullcontext()

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:  # noqa: ARG002 - of a device
        """As of `Backend`."""
        return max(TWIN_PIXELS // width // TILE, 1) * TILE

    def render_band(
        self, scene: Scene, packed: Packed, first_row: int, rows: int, outputs: frozenset[str]
    ) -> tuple[Planes, None]:
        """As of `Backend`."""
        from halfstep.run.twin import render_band

        return render_band(scene, packed, first_row, rows, outputs), None

    def close(self) -> None:
        """There is nothing to give back."""
        self._closed = True


def open_backend(backend: str, adapter: str | int | None, accuracy: Accuracy) -> Backend:
    """The backend of a name in `BACKENDS`; ``adapter`` is as for `choose_adapter`.

    Raises:
        UsageError: there is no such backend.
        AdapterError: no suitable adapter.
        DeviceError: the driver refuses.
    """
    if backend not in BACKENDS:
        raise UsageError(f"backend: {backend!r} is not one of {', '.join(BACKENDS)}")
    if backend == "numpy":
        return NumPy()
    from halfstep.run.gpu import Device

    try:
        return Device(choose_adapter(adapter), format_for(accuracy, accuracy.steps or 0))
    except AdapterError as error:
        if backend == "gpu" or is_requested(adapter):
            raise
        reason = str(error).splitlines()[0]
        warnings.warn(
            f"rendering with NumPy, slowly: {reason} (see `halfstep doctor`)", stacklevel=4
        )
        return NumPy()
