"""Twin of ``sight.wgsl``, and other results of trying a solid."""

from __future__ import annotations

from typing import NamedTuple

from halfstep.twin.certify import Certificate
from halfstep.twin.lanes import I32, U32, Bools
from halfstep.twin.normal import Vector


class Sight(NamedTuple):
    """The point of one solid that a ray sees, and the exit; without a need both are the same."""

    hit: Bools
    surface: I32  # 0 is F, half-spaces count from 1
    position: I32  # odd integer: u = position 2^-n
    left: Bools  # through a surface before the far base plane
    exit_position: I32


class Met(NamedTuple):
    """A point of a region: the region's record, or `NO_REGION`.

    With it, the side of the surface there, and the index of the cell in the record's list.
    """

    region: U32
    side: I32
    cell: I32


class Claims(NamedTuple):
    """Grid points in two cells of a region, and grid points in no cell, between two cells."""

    overlap: I32
    gap: I32


class Seen(NamedTuple):
    """The results of a visit; slope and certificate are empty if no fact asks for them."""

    sight: Sight
    slope: Vector  # along the normal of the solid at the sight
    certificate: Certificate  # the certificate of the solid
    met: Met | None = None  # the point of a region
    claims: Claims | None = None  # overlaps and gaps of a region
    turned: U32 | None = None  # the side that is seen, as `other_side` has it; None is the outer
