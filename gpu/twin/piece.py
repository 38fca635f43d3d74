"""Twin of ``piece.wgsl``: the piece of a ray inside all half-spaces of a solid.

An end of the piece is a linear root kept as the pair (c, b), u = -c/b, b < 0 where the ray enters
and b >= 0 where it leaves.  Which plane is entered last, left first, and whether anything remains
are signs of products: no division, and no cell that could swallow a thin plate.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.lanes import F32, I32, Bools


class Piece(NamedTuple):
    """The two ends; ``*_id`` counts half-spaces from 1, 0 is a base plane or the eye."""

    c_in: F32
    b_in: F32
    id_in: I32
    c_out: F32
    b_out: F32
    id_out: I32


def whole_interval(like: NDArray[np.generic], near_u: np.float32, far_u: np.float32) -> Piece:
    """The interval of the solid, u from ``near_u`` to ``far_u``, for pixels like ``like``."""
    one = np.ones(like.shape, np.float32)
    none = np.zeros(like.shape, np.int32)
    return Piece(near_u * one, -one, none, -far_u * one, one, none)


def clip(piece: Piece, c: F32, b: F32, number: int) -> Piece:
    """The part of ``piece`` inside c + b u <= 0.

    A half-space parallel to the ray (b = 0) that excludes it leaves the pair (c > 0, 0): before
    everything, so nothing remains.
    """
    enters = b < 0
    later = enters & (c * piece.b_in < piece.c_in * b)
    earlier = ~enters & (c * piece.b_out > piece.c_out * b)
    return Piece(
        np.where(later, c, piece.c_in),
        np.where(later, b, piece.b_in),
        np.where(later, np.int32(number), piece.id_in),
        np.where(earlier, c, piece.c_out),
        np.where(earlier, b, piece.b_out),
        np.where(earlier, np.int32(number), piece.id_out),
    )


def remains(piece: Piece) -> Bools:
    """Whether the piece is entered before it is left."""
    return piece.c_in * piece.b_out <= piece.c_out * piece.b_in


def from_the_eye(piece: Piece, near_u: np.float32) -> Piece:
    """The piece entered at its start whatever rounding says: the eye is inside all half-spaces."""
    one = np.ones(piece.c_in.shape, np.float32)
    return piece._replace(c_in=near_u * one, b_in=-one, id_in=np.zeros_like(piece.id_in))
