"""Twin of ``root.wgsl``: the joint logic, which tells the root that a ray shows.

The answer is a convex quadratic (or a line) whose first crossing from + to - is the root that is
seen, so that one sequence of halvings finds it.  Signs of F and F' at the ends of the piece are
signs of products, because the ends are pairs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32, Bools, Form
from halfstep.twin.patch import Patch
from halfstep.twin.piece import Piece, remains
from halfstep.twin.values import Products, Values, product, reduced


class Root(NamedTuple):
    """The first + to - crossing of a v² + g v + c, v = -u if flipped. The halvings find it."""

    hit: Bools
    surface: I32  # 0 is F, half-spaces count from 1
    a: Values
    g: Values
    c: Values
    flipped: Bools


def end_value(form: Form, c: Values, b: Values) -> Products:
    """F at the end (c, b) of a piece, times b² and the reduction of products."""
    sloped = reduced(product(form.a, c) - product(form.g, b))
    return product(sloped, c) + product(reduced(product(form.c, b)), b)


def outside_at_entry(form: Form, piece: Piece) -> Bools:
    """Whether F > 0 where the piece begins."""
    return end_value(form, piece.c_in, piece.b_in) > 0


def outside_at_exit(form: Form, piece: Piece) -> Bools:
    """Whether F > 0 where the piece ends."""
    return end_value(form, piece.c_out, piece.b_out) > 0


def has_root(form: Form) -> Bools:
    """Whether F has a root somewhere on the line."""
    return product(form.g, form.g) >= product(form.a + form.a, form.c + form.c)


def turns_within(form: Form, piece: Piece) -> Bools:
    """For a > 0: whether F has two roots, maybe equal, between ends where it is positive."""
    bend = form.a + form.a
    falls = product(bend, piece.c_in) < product(form.g, piece.b_in)
    rises = product(form.g, piece.b_out) > product(bend, piece.c_out)
    return (form.a > 0) & falls & rises & has_root(form)


def quadric_entry(form: Form, piece: Piece, outside: Bools) -> Root:
    """The entry of a ray that starts outside the solid, (18); ``outside``: F > 0 at entry."""
    crosses = outside & (~outside_at_exit(form, piece) | turns_within(form, piece))
    on_plane = ~outside & (piece.id_in > 0)
    flipped = crosses & (form.a < 0)
    return Root(
        remains(piece) & (crosses | on_plane),
        np.where(on_plane, piece.id_in, 0),
        np.where(on_plane, np.zeros_like(form.a), np.abs(form.a)),
        np.where(on_plane, piece.b_in, form.g),
        np.where(on_plane, piece.c_in, np.where(flipped, -form.c, form.c)),
        flipped,
    )


def quadric_exit(form: Form, piece: Piece, inside: Bools) -> Root:
    """The exit of a ray that is in the solid, (19); ``inside``: F <= 0 at entry."""
    within = inside & turns_within(Form(-form.a, -form.g, -form.c), piece)
    crosses = outside_at_exit(form, piece) | within
    on_plane = ~crosses & (piece.id_out > 0)
    flipped = crosses & (form.a > 0)
    return Root(
        remains(piece) & (crosses | on_plane),
        np.where(on_plane, piece.id_out, 0),
        np.where(on_plane, np.zeros_like(form.a), np.abs(form.a)),
        np.where(on_plane, -piece.b_out, -form.g),
        np.where(on_plane, -piece.c_out, np.where(flipped, form.c, -form.c)),
        flipped,
    )


def ellipsoid_entry(form: Form) -> Root:
    """The entry of a ray into an uncut ellipsoid from outside: only the discriminant decides."""
    shape = np.shape(form.a)
    never = np.zeros(shape, bool)
    return Root(has_root(form), np.zeros(shape, np.int32), form.a, form.g, form.c, never)


def ellipsoid_exit(form: Form) -> Root:
    """The exit of a ray from an uncut ellipsoid that it entered from outside."""
    shape = np.shape(form.a)
    always = np.ones(shape, bool)
    return Root(has_root(form), np.zeros(shape, np.int32), form.a, -form.g, form.c, always)


def polyhedron_entry(piece: Piece) -> Root:
    """The entry of a ray that starts outside a polyhedron: the plane entered last."""
    return Root(
        remains(piece) & (piece.id_in > 0),
        piece.id_in,
        np.zeros_like(piece.c_in),
        piece.b_in,
        piece.c_in,
        np.zeros(piece.c_in.shape, bool),
    )


def polyhedron_exit(piece: Piece) -> Root:
    """The exit of a ray from a polyhedron: the plane left first."""
    return Root(
        remains(piece) & (piece.id_out > 0),
        piece.id_out,
        np.zeros_like(piece.c_out),
        -piece.b_out,
        -piece.c_out,
        np.zeros(piece.c_out.shape, bool),
    )


def patch_entry(plane: Patch) -> Root:
    """The root where a ray hits a patch."""
    none = np.zeros(plane.c.shape, np.int32)
    never = np.zeros(none.shape, bool)
    return Root(plane.hit, none, np.zeros_like(plane.c), plane.b, plane.c, never)


def choose(inside: Bools, outer: Root, inner: Root) -> Root:
    """``inner`` for the pixels whose ray starts inside the solid, else ``outer``."""
    return Root(*(np.where(inside, i, o) for o, i in zip(outer, inner, strict=True)))
