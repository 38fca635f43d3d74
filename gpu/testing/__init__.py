"""WGSL tested against NumPy: a pytest plugin, and the classes and functions behind it.

    def test_twice(wgsl):
        x = halfstep.testing.decades(numpy.random.default_rng(1), 5000)
        wgsl.check("fn twice(x: f32) -> f32 { return x + x; }", "twice", lambda x: 2 * x, {"x": x})

The fixture ``wgsl`` is a `Kit` on a device of this machine. Without pytest, `Kit` takes any
wgpu.GPUDevice. Importing this package loads neither NumPy nor wgpu. Each name is loaded at its
first use, so the plugin costs nothing in a run that does not use it.
"""

from typing import TYPE_CHECKING

from halfstep.lazy import lazily

if TYPE_CHECKING:
    from halfstep.testing.census import Census, MismatchError
    from halfstep.testing.frames import FrameCensus, FrameMismatchError, assert_frames_match
    from halfstep.testing.inputs import decades, near_ties, special_values
    from halfstep.testing.kit import Kit
    from halfstep.testing.program import Program
    from halfstep.testing.textures import Sampler
    from halfstep.testing.values import unwritten

__all__ = [
    "Census",
    "FrameCensus",
    "FrameMismatchError",
    "Kit",
    "MismatchError",
    "Program",
    "Sampler",
    "assert_frames_match",
    "decades",
    "near_ties",
    "special_values",
    "unwritten",
]

_HOME = {
    "Census": "census",
    "FrameCensus": "frames",
    "FrameMismatchError": "frames",
    "Kit": "kit",
    "MismatchError": "census",
    "Program": "program",
    "Sampler": "textures",
    "assert_frames_match": "frames",
    "decades": "inputs",
    "near_ties": "inputs",
    "special_values": "inputs",
    "unwritten": "values",
}

# Hidden from type checkers, which would accept every misspelt name as a public one.
if not TYPE_CHECKING:
    __getattr__ = lazily(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
