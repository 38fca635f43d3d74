"""The ray of both twins of rays to lights; each of the two WGSL files declares its own."""

from __future__ import annotations

from typing import NamedTuple

from halfstep.twin.lanes import Bools
from halfstep.twin.values import Values


class Ray(NamedTuple):
    """A ray to a light, relative to an occluder: the variables of forms, and its two ends."""

    x: Values
    y: Values
    z: Values
    t: Values
    c_in: Values
    b_in: Values
    c_out: Values
    b_out: Values
    near: Bools  # it may hit the occluder
