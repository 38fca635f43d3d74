"""Frames compared bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.frames.frame import Frame
from halfstep.scene import Scene


def on_both(scene: Scene, **options: Any) -> tuple[Frame, Frame]:
    """The frames of the device and of the twin; options as of `halfstep.render`."""
    return (
        halfstep.render(scene, backend="gpu", **options),
        halfstep.render(scene, backend="numpy", **options),
    )


def different(found: Frame, expected: Frame, *, names: Iterable[str] | None = None) -> list[str]:
    """The arrays of two frames that are not the same bits: of ``names``, or of all outputs."""
    unlike = []
    for name in expected.outputs if names is None else names:
        one, other = (np.ascontiguousarray(getattr(each, name)) for each in (found, expected))
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        if one.tobytes() != other.tobytes():
            unlike.append(name)
    return unlike


def differing(
    scene: Scene,
    outputs: Iterable[str] = ("color",),
    *,
    size: tuple[int, int] = (64, 48),
    **options: Any,
) -> list[str]:
    """The outputs of which the device and the twin differ in a bit."""
    return different(*on_both(scene, size=size, outputs=tuple(outputs), **options))


def same_without(
    scene: Scene,
    patched: Callable[[pytest.MonkeyPatch], None],
    outputs: tuple[str, ...],
    backend: str = "numpy",
) -> bool:
    """Whether a frame, which has many hits, is the same bits as one with a part ``patched`` out."""
    some = halfstep.render(scene, backend=backend, outputs=outputs)
    with pytest.MonkeyPatch.context() as patch:
        patched(patch)
        every = halfstep.render(scene, backend=backend, outputs=outputs)
    assert (every.solid >= 0).sum() > 4000
    return not different(some, every)
