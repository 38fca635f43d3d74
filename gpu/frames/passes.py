"""A frame prepared by the host, and how its rendered bands of rows become arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Array
from halfstep.contract.layout import TILE
from halfstep.frames.outputs import Lookup, arrays_of, device_outputs
from halfstep.host.pack import Packed
from halfstep.run.backend import Backend
from halfstep.scene import Scene


@dataclass(frozen=True)
class Pass:
    """Arrays of a frame that one pass renders."""

    names: tuple[str, ...]
    samples: int  # k, for k x k samples in each pixel
    packed: Packed


@dataclass(frozen=True)
class Prepared:
    """A frame for which the host has done its part.

    Attributes:
        scene: the scene, with all overrides.
        outputs: names of the arrays, in the order of the frame.
        passes: the pass of the pixel centres, then the pass of the samples if any output needs it.
        solids_sha256: digest of the scene's solids.
        begin: when the host began the frame, in seconds of time.perf_counter.
    """

    scene: Scene
    outputs: tuple[str, ...]
    passes: tuple[Pass, ...]
    solids_sha256: str
    begin: float

    @property
    def packed(self) -> Packed:
        """Records of the pass of the pixel centres."""
        return self.passes[0].packed


def render_pass(
    backend: Backend, scene: Scene, one: Pass
) -> tuple[dict[str, Array | Lookup], list[float]]:
    """The arrays of a pass, and the device time of each band in ms; no times if not measured."""
    bands: list[Mapping[str, Array | Lookup]] = []
    times: list[float] = []
    for arrays, milliseconds in _bands(backend, scene, one):
        bands.append(arrays)
        if milliseconds is not None:
            times.append(milliseconds)
    return {name: _joined([band[name] for band in bands]) for name in one.names}, times


def _bands(
    backend: Backend, scene: Scene, one: Pass
) -> Iterator[tuple[Mapping[str, Array | Lookup], float | None]]:
    """The arrays of one band after another, from the top."""
    view, samples = one.packed.setup.view, one.samples
    wanted = ("color",) if samples > 1 else one.names
    outputs = device_outputs(wanted)
    if one.packed.shadows is None:
        outputs -= {"shadow"}
    if one.packed.regions is None:
        outputs -= {"overlap", "gap"}
    # A band has whole pixels, and whole tiles of samples.
    unit = TILE * samples
    rows = max(backend.band_rows(view.width, outputs) // unit, 1) * unit
    for first in range(0, view.height, rows):
        count = min(rows, view.height - first)
        planes, milliseconds = backend.render_band(scene, one.packed, first, count, outputs)
        if samples > 1:
            yield _averaged(planes["color"], samples, one.names), milliseconds
        else:
            yield arrays_of(wanted, planes, one.packed, first), milliseconds


def _joined(bands: list[Array | Lookup]) -> Array | Lookup:
    """One array of bands, the first on top."""
    if len(bands) == 1:
        return bands[0]
    lookups = [band for band in bands if isinstance(band, Lookup)]
    if lookups:
        return Lookup(lookups[0].find, np.concatenate([band.numbers for band in lookups]))
    return np.concatenate([band for band in bands if not isinstance(band, Lookup)])


def _averaged(color: Array, samples: int, names: tuple[str, ...]) -> dict[str, Array]:
    """Image and colour of a band: the samples of a pixel are averaged in linear light."""
    height, width = color.shape[0] // samples, color.shape[1] // samples
    # Adding one sample of all pixels at a time is four times as fast as a mean over two axes.
    total = np.zeros((height, width, 3))
    for i, j in np.ndindex(samples, samples):
        total += color[i::samples, j::samples]
    linear = (total / samples**2).astype(np.float32)
    arrays: dict[str, Array] = {"color": linear}
    if "image" in names:
        from halfstep.run.twin import image_of

        arrays["image"] = image_of(linear)
    return {name: arrays[name] for name in names}
