"""Twin of ``piece.wgsl``: the piece of a ray inside all half-spaces of a solid.

An end of the piece is a linear root kept as the pair (c, b), u = -c/b, b < 0 where the ray enters
and b >= 0 where it leaves.  Which plane is entered last, left first, and whether anything remains
are signs of products: no division, and no cell that could swallow a thin plate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.lanes import I32, Bools
from halfstep.twin.values import Value, Values, one_of, product


class Line(NamedTuple):
    """A half-space along the ray; a point is inside if c + b u <= 0."""

    c: Values
    b: Values


class Piece(NamedTuple):
    """The two ends; ``*_id`` counts half-spaces from 1, 0 is a base plane or the eye."""

    c_in: Values
    b_in: Values
    id_in: I32
    c_out: Values
    b_out: Values
    id_out: I32


def whole_interval(like: NDArray[np.generic], near_u: Value, far_u: Value) -> Piece:
    """The interval of the solid, u from ``near_u`` to ``far_u``, for pixels like ``like``."""
    one = np.full(like.shape, one_of(near_u))
    none = np.zeros(like.shape, np.int32)
    near, far = np.full(like.shape, near_u), np.full(like.shape, far_u)
    return Piece(near, -one, none, -far, one, none)


def clip(piece: Piece, line: Line, number: int) -> Piece:
    """The part of ``piece`` inside the half-space.

    A half-space parallel to the ray (b = 0) that excludes it leaves the pair (c > 0, 0): before
    everything, so nothing remains.
    """
    enters = line.b < 0
    later = enters & (product(line.c, piece.b_in) < product(piece.c_in, line.b))
    earlier = ~enters & (product(line.c, piece.b_out) > product(piece.c_out, line.b))
    return Piece(
        np.where(later, line.c, piece.c_in),
        np.where(later, line.b, piece.b_in),
        np.where(later, np.int32(number), piece.id_in),
        np.where(earlier, line.c, piece.c_out),
        np.where(earlier, line.b, piece.b_out),
        np.where(earlier, np.int32(number), piece.id_out),
    )


def remains(piece: Piece) -> Bools:
    """Whether the piece is entered before it is left."""
    return product(piece.c_in, piece.b_out) <= product(piece.c_out, piece.b_in)


def from_the_eye(piece: Piece, near_u: Value) -> Piece:
    """The piece that starts at the eye, which is inside all half-spaces despite rounding."""
    start = whole_interval(piece.id_in, near_u, near_u)
    return piece._replace(c_in=start.c_in, b_in=start.b_in, id_in=start.id_in)
