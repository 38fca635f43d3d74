"""A backend renders bands of a frame: a Vulkan device, or NumPy where no device is found."""

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

# A band of the twin has about this many pixels, so that the arrays of any picture stay small.
TWIN_PIXELS = 1 << 20


@runtime_checkable
class Backend(Protocol):
    """Renders bands. One thread at a time renders all bands of a frame.

    Attributes:
        facts: the names of the adapter and of its driver.
        most_steps: the most halvings that a tolerance may use; None if only the number format
            limits them.
    """

    @property
    def facts(self) -> Facts: ...  # noqa: D102 - the class says it
    @property
    def most_steps(self) -> int | None: ...  # noqa: D102 - the class says it

    def check_usable(self) -> None:
        """Check that the backend can render.

        Raises:
            UsageError: the backend is closed.
            DeviceError: the device belongs to another process.
        """

    def turn(self) -> AbstractContextManager[None]:
        """Keep other threads out while the bands of one frame are rendered."""

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:
        """The number of rows in a band of ``width`` pixels, a multiple of the tile's height."""

    def render_band(
        self, scene: Scene, packed: Packed, first_row: int, rows: int, outputs: frozenset[str]
    ) -> tuple[Planes, float | None]:
        """Outputs (rows, width, …) of a band, and the device time in ms; None if not measured."""

    def close(self) -> None:
        """Free the device once the frame that is being rendered is done."""


class NumPy:
    """The backend that needs no device."""

    most_steps = None

    def __init__(self) -> None:
        self.facts: Facts = {"adapter": "numpy", "driver": f"NumPy {np.__version__}"}
        self._closed = False

    def check_usable(self) -> None:
        """See `Backend`."""
        if self._closed:
            raise UsageError("the renderer is closed")

    def turn(self) -> AbstractContextManager[None]:
        """Return a context that lets every thread in: the twin has no state to protect."""
        return nullcontext()

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:  # noqa: ARG002 - of a device
        """See `Backend`."""
        return max(TWIN_PIXELS // width // TILE, 1) * TILE

    def render_band(
        self, scene: Scene, packed: Packed, first_row: int, rows: int, outputs: frozenset[str]
    ) -> tuple[Planes, None]:
        """See `Backend`."""
        from halfstep.run.twin import render_band

        return render_band(scene, packed, first_row, rows, outputs), None

    def close(self) -> None:
        """Refuse further frames. NumPy holds nothing that must be freed."""
        self._closed = True


def open_backend(backend: str, adapter: str | int | None, accuracy: Accuracy) -> Backend:
    """Open the backend with a name of `BACKENDS`; `choose_adapter` describes ``adapter``.

    Raises:
        UsageError: no backend has this name.
        AdapterError: no adapter is suitable.
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
