"""Polynomials as shaders and the twin read them."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records


@dataclass(frozen=True)
class PackedPolynomials:
    """P visible solids that polynomials bound."""

    records: Records  # (P,)
    half_spaces: Records  # of all solids
    degree: int  # the highest of the scene
    has_balls: bool  # a ball bounds some solid of the scene
