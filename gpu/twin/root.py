"""Twin of ``root.wgsl``: the joint logic, which crossing of which surface a ray shows.

The answer is a convex quadratic (or a line) whose first crossing from + to - is the root that is
seen, so that one sequence of halvings finds it.  Signs of F and F' at the ends of the piece are
signs of products, because the ends are pairs (BASEPLANE.md section 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.piece import Piece, remains


class Root(NamedTuple):
    """The first + to - crossing of a v² + g v + c, v = -u if flipped: what the halvings find."""

    hit: Bools
    surface: I32  # 0 is F, half-spaces count from 1
    a: F32
    g: F32
    c: F32
    flipped: Bools


def outside_at_entry(a: F32, g: F32, c: F32, piece: Piece) -> Bools:
    """F > 0 where the piece begins; F is taken times the square of the entry's slope."""
    value = (a * piece.c_in - g * piece.b_in) * piece.c_in + c * (piece.b_in * piece.b_in)
    return value > 0


def outside_at_exit(a: F32, g: F32, c: F32, piece: Piece) -> Bools:
    """F > 0 where the piece ends."""
    value = (a * piece.c_out - g * piece.b_out) * piece.c_out + c * (piece.b_out * piece.b_out)
    return value > 0


def turns_within(a: F32, g: F32, c: F32, piece: Piece) -> Bools:
    """For a > 0: F has both its roots between ends where it is positive, even if they coincide."""
    slope_in = (a + a) * piece.c_in - g * piece.b_in
    slope_out = g * piece.b_out - (a + a) * piece.c_out
    return (a > 0) & (slope_in < 0) & (slope_out > 0) & (g * g >= np.float32(4) * (a * c))


def quadric_entry(a: F32, g: F32, c: F32, piece: Piece, outside: Bools) -> Root:
    """Where a ray that starts outside the solid enters it, (18); ``outside``: F > 0 at entry."""
    crosses = outside & (~outside_at_exit(a, g, c, piece) | turns_within(a, g, c, piece))
    on_plane = ~outside & (piece.id_in > 0)
    flipped = crosses & (a < 0)
    return Root(
        remains(piece) & (crosses | on_plane),
        np.where(on_plane, piece.id_in, 0),
        np.where(on_plane, np.float32(0), np.abs(a)),
        np.where(on_plane, piece.b_in, g),
        np.where(on_plane, piece.c_in, np.where(flipped, -c, c)),
        flipped,
    )


def quadric_exit(a: F32, g: F32, c: F32, piece: Piece, inside: Bools) -> Root:
    """Where a ray that is in the solid leaves it, (19); ``inside``: F <= 0 at entry."""
    within = inside & turns_within(-a, -g, -c, piece)
    crosses = outside_at_exit(a, g, c, piece) | within
    on_plane = ~crosses & (piece.id_out > 0)
    flipped = crosses & (a > 0)
    return Root(
        remains(piece) & (crosses | on_plane),
        np.where(on_plane, piece.id_out, 0),
        np.where(on_plane, np.float32(0), np.abs(a)),
        np.where(on_plane, -piece.b_out, -g),
        np.where(on_plane, -piece.c_out, np.where(flipped, c, -c)),
        flipped,
    )


def ellipsoid_entry(a: F32, g: F32, c: F32) -> Root:
    """Where a ray enters an uncut ellipsoid from outside: only the discriminant decides."""
    shape = np.shape(a)
    return Root(
        g * g >= np.float32(4) * (a * c), np.zeros(shape, np.int32), a, g, c, np.zeros(shape, bool)
    )


def ellipsoid_exit(a: F32, g: F32, c: F32) -> Root:
    """Where a ray leaves an uncut ellipsoid it entered from outside."""
    shape = np.shape(a)
    return Root(
        g * g >= np.float32(4) * (a * c), np.zeros(shape, np.int32), a, -g, c, np.ones(shape, bool)
    )


def polyhedron_entry(piece: Piece) -> Root:
    """Where a ray that starts outside a polyhedron enters it: the plane entered last."""
    return Root(
        remains(piece) & (piece.id_in > 0),
        piece.id_in,
        np.zeros_like(piece.c_in),
        piece.b_in,
        piece.c_in,
        np.zeros(piece.c_in.shape, bool),
    )


def polyhedron_exit(piece: Piece) -> Root:
    """Where a ray leaves a polyhedron: the plane left first."""
    return Root(
        remains(piece) & (piece.id_out > 0),
        piece.id_out,
        np.zeros_like(piece.c_out),
        -piece.b_out,
        -piece.c_out,
        np.zeros(piece.c_out.shape, bool),
    )


def patch_entry(hit: Bools, c: F32, b: F32) -> Root:
    """Where a ray meets a patch that it passes from + to -."""
    none = np.zeros(c.shape, np.int32)
    return Root(hit, none, np.zeros_like(c), b, c, np.zeros(c.shape, bool))


def choose(inside: Bools, outer: Root, inner: Root) -> Root:
    """``inner`` for the pixels whose ray starts inside the solid, else ``outer``."""
    return Root(*(np.where(inside, i, o) for o, i in zip(outer, inner, strict=True)))
