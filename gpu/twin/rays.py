"""What both twins of rays to lights share; each of the WGSL files has its own."""

from __future__ import annotations

from typing import NamedTuple

from halfstep.twin.lanes import Bools
from halfstep.twin.values import Values


class Ray(NamedTuple):
    """A ray to a light about an occluder: what forms are polynomials in, and its two ends."""

    x: Values
    y: Values
    z: Values
    t: Values
    c_in: Values
    b_in: Values
    c_out: Values
    b_out: Values
    near: Bools  # it may meet the occluder
