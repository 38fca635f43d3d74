"""Polynomials, in the records that shaders and the twin read."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records


@dataclass(frozen=True)
class PackedPolynomials:
    """P visible solids whose surface is a polynomial."""

    records: Records  # (P,)
    half_spaces: Records  # of all solids
    degree: int  # the highest degree in the scene
    has_balls: bool  # whether some solid of the scene is cut by its bounding ball
