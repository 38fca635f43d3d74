"""Twin of ``sight.wgsl``, and what an invocation holds of the solid that it has tried."""

from __future__ import annotations

from typing import NamedTuple

from halfstep.twin.certify import Certificate
from halfstep.twin.lanes import I32, U32, Bools
from halfstep.twin.normal import Vector


class Sight(NamedTuple):
    """What a ray sees of one solid; the exit is the point itself where none is asked for."""

    hit: Bools
    surface: I32  # 0 is F, half-spaces count from 1
    position: I32  # odd integer: u = position 2^-n
    left: Bools  # through a surface before the far base plane
    exit_position: I32


class Met(NamedTuple):
    """Which record of a region shows a point, `NO_REGION` where none does.

    The side is that of the surface there, the cell its place among those that the record lists.
    """

    region: U32
    side: I32
    cell: I32


class Claims(NamedTuple):
    """Grid points where two cells of a region are, and where none is between two."""

    overlap: I32
    gap: I32


class Seen(NamedTuple):
    """What a visit finds of a solid; slope and certificate are empty where no fact asks."""

    sight: Sight
    slope: Vector  # along the normal of the solid at the sight
    certificate: Certificate  # what is certain of the solid
    met: Met | None = None  # of a region
    claims: Claims | None = None  # of a region
    turned: U32 | None = None  # which side is seen, as of `other_side`; None is the outer one
