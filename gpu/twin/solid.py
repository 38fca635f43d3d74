"""Twin of ``solid.wgsl``: properties of a solid and its half-spaces along rays."""

from __future__ import annotations

import numpy as np

from halfstep.contract.layout import Flag
from halfstep.twin.lanes import I32, U32, Bools, Form
from halfstep.twin.normal import Vector, gradient
from halfstep.twin.piece import Piece
from halfstep.twin.root import outside_at_entry


def eye_inside(solid: np.void) -> bool:
    """Whether rays start at the eye and the solid contains it."""
    return bool(int(solid["flags"]) & Flag.EYE_INSIDE)


def near_cut(solid: np.void) -> bool:
    """Whether the near base plane, not the eye, cuts the solid."""
    return bool(int(solid["flags"]) & Flag.NEAR_CUT)


def starts_at_eye(solid: np.void) -> bool:
    """Whether rays start at the eye."""
    return bool(int(solid["flags"]) & Flag.STARTS_AT_EYE)


def eye_outside(solid: np.void) -> bool:
    """Whether F > 0 at the eye."""
    return bool(int(solid["flags"]) & Flag.EYE_OUTSIDE_QUADRIC)


def eye_sure(solid: np.void) -> bool:
    """Whether the flags about the eye hold for exact numbers, too."""
    return bool(int(solid["flags"]) & Flag.EYE_SURE)


def is_rechecked(solid: np.void) -> bool:
    """Whether integers are asked where float32 is not certain of the solid."""
    return bool(int(solid["flags"]) & Flag.RECHECKED)


def starts_outside(solid: np.void, form: Form, piece: Piece) -> Bools:
    """Whether F > 0 where the piece begins. The host tells it at the eye; elsewhere F decides."""
    from_eye = (piece.id_in == 0) & starts_at_eye(solid)
    return np.where(from_eye, eye_outside(solid), outside_at_entry(form, piece))


def starts_inside(solid: np.void, piece: Piece) -> Bools:
    """Whether the ray starts inside all half-spaces, at the eye or at a near base plane."""
    return eye_inside(solid) | (near_cut(solid) & (piece.id_in == 0))


def other_side(solid: np.void, inside: Bools) -> U32:
    """The side of a solid that is seen.

    0 is the outer side, 1 the inner side, 2 the inner side if the near base plane opens the solid.
    """
    return np.where(inside, np.uint32(2 if near_cut(solid) else 1), np.uint32(0))


def normal_of(half_space: np.void) -> Vector:
    """The unit normal of a half-space."""
    return Vector(*(np.asarray(component) for component in half_space["normal"]))


def slope_at(solid: np.void, x: I32, y: I32, position: I32) -> Vector:
    """Half the gradient of F at a position."""
    u = position.astype(np.float32) * solid["last_step"]
    return gradient(solid["gradient"], x.astype(np.float32), y.astype(np.float32), u)
