"""Twin of ``walks.wgsl``: the walks through a region: their input, leaps, aims and starts."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.program import (
    CELL_ENDS,
    CLOSES,
    HIDDEN,
    LEAF,
    OPENS,
    PLACE,
    POSITIVE,
    SIDE,
    TURN,
)
from halfstep.twin.chosen import Chosen, Offset
from halfstep.twin.crossings import Crossing, in_cells
from halfstep.twin.lanes import I32, Form, FormErrors
from halfstep.twin.walk import (
    ANY_CELL,
    LEAST,
    Held,
    Look,
    Path,
    Place,
    later,
    literal_at,
)


def look(crossings: Sequence[Crossing], path: Path, q: I32, only: I32) -> Look:
    """A region at grid points.

    Args:
        crossings: the crossings of its surfaces; one surface may have several.
        path: the program, and which crossings it reads.
        q: grid points.
        only: the cell that counts in each pixel, or ``ANY_CELL``.
    """
    nothing = Held(np.full(q.shape, LEAST), np.zeros(q.shape, np.int32))
    total, inner = nothing, nothing
    twice = nothing.until
    stack: list[Held] = []
    cell = np.full(q.shape, ANY_CELL)
    number = np.int32(0)
    for word in path.words.tolist():
        if word & OPENS:
            stack.append(inner)
            inner = nothing
        if word & LEAF:
            place = word & PLACE
            is_positive = bool(word & POSITIVE)
            crossing = crossings[(path.positive if is_positive else path.negative) + place]
            if path.over_cells:
                crossing = in_cells(crossing, path.wider != is_positive)
            e = literal_at(crossing, q, path.never, bool(word & TURN))
            inner = later(inner, Held(e, np.full(q.shape, word >> SIDE, np.int32)))
        if word & CLOSES:
            inner = later(stack.pop(), Held(~inner.until, inner.side))
        if word & CELL_ENDS:
            counts = (only == ANY_CELL) | (only == number)
            counts &= path.with_hidden or not word & HIDDEN
            holds = counts & (inner.until >= 0) & (cell == ANY_CELL)
            cell = np.where(holds, number, cell)
            # The second greatest of all e tells where two cells hold.
            both = np.maximum(twice, np.minimum(total.until, inner.until))
            twice = np.where(counts, both, twice)
            chosen = later(total, inner)
            total = Held(*(np.where(counts, *pair) for pair in zip(chosen, total, strict=True)))
            inner = nothing
            number += np.int32(1)
    return Look(total._replace(until=twice) if path.twice else total, cell)


def walk(crossings: Sequence[Crossing], path: Path, want: bool, begin: Place, only: I32) -> Place:
    """The first grid point from ``begin`` on where the region holds, or does not, as wanted.

    It is ``path.never`` or more if there is none. A walk that goes nowhere keeps the side of its
    place.
    """
    place = begin
    while True:
        seen = look(crossings, path, place.q, only)
        until = seen.held.until
        holds = until >= 0
        goes = (holds != want) & (place.q < path.never)
        if not goes.any():
            return Place(place.q, place.side, seen.cell)
        place = Place(
            np.where(goes, np.where(holds, until, ~until), place.q),
            np.where(goes, seen.held.side, place.side),
            place.cell,
        )


class Walk(IntEnum):
    """The walks, in order.

    They find where a ray enters the region; where it leaves the entered cell; where it enters two
    cells at once; where it enters any cell, shown or not, then leaves all cells, then enters a cell
    again; and for certificates, where it perhaps and surely enters and leaves.
    """

    ENTRY = 0
    BEYOND = 1
    OVERLAP = 2
    ANY = 3
    NONE = 4
    AGAIN = 5
    PERHAPS_IN = 6
    SURELY_IN = 7
    PERHAPS_OUT = 8
    SURELY_OUT = 9


def is_out(walk: Walk) -> bool:
    """Whether a walk leads out of a cell."""
    return walk == Walk.BEYOND or walk >= Walk.PERHAPS_OUT


def is_over_cells(walk: Walk) -> bool:
    """Whether a walk goes over cells, not grid points."""
    return walk in (Walk.PERHAPS_IN, Walk.PERHAPS_OUT)


def first_of(walk: Walk, region: np.void) -> int:
    """The grid point, or cell, where a walk begins."""
    first = int(region["first"])
    return max(first - 1, 0) if is_over_cells(walk) else first


class Crossed(IntEnum):
    """Kinds of crossings of a region: those of F, and for certificates those of F + E and F - E.

    The value times the number of surfaces is the number of crossings before those of a kind.
    """

    CROSSED = 0
    SURELY = 1
    PERHAPS = 2


_READ = {
    **dict.fromkeys(list(Walk)[: Walk.PERHAPS_IN], (Crossed.CROSSED, Crossed.CROSSED)),
    Walk.PERHAPS_IN: (Crossed.PERHAPS, Crossed.SURELY),
    Walk.SURELY_IN: (Crossed.SURELY, Crossed.PERHAPS),
    Walk.PERHAPS_OUT: (Crossed.SURELY, Crossed.PERHAPS),
    Walk.SURELY_OUT: (Crossed.PERHAPS, Crossed.SURELY),
}


def path_of(walk: Walk, words: NDArray[np.uint32], surfaces: int, steps: int) -> Path:
    """The input of a walk."""
    negative, positive = _READ[walk]
    over_cells = is_over_cells(walk)
    never = np.int32((1 << steps) + (0 if over_cells else 1))
    wider = over_cells and not is_out(walk)
    return Path(
        words,
        negative * surfaces,
        positive * surfaces,
        never,
        over_cells,
        wider,
        Walk.OVERLAP <= walk <= Walk.AGAIN,
        walk == Walk.OVERLAP,
    )


def place_at(q: int, shape: tuple[int, ...]) -> Place:
    """The position of a walk before it crosses a surface."""
    nothing = np.zeros(shape, np.int32)
    return Place(nothing + np.int32(q), nothing, nothing + ANY_CELL)


class Known(NamedTuple):
    """The form of a surface with its errors, and what the host knows of it at the eye."""

    form: Form
    errors: FormErrors
    eye: int


def known_plane(plane: np.void, at: Offset, chosen: Chosen) -> Known:
    """The form of a plane, with A = 0."""
    line = chosen.forms.line_at(plane["c"], plane["b"], at)
    errors = chosen.forms.line_errors(plane["c"], plane["b"], at, plane["host_error"])
    form = Form(np.zeros_like(line.c), line.b, line.c)
    return Known(form, FormErrors(np.zeros_like(errors.c), errors.b, errors.c), int(plane["eye"]))


def known_quadric(quadric: np.void, at: Offset, chosen: Chosen) -> Known:
    """The form of a quadric."""
    given = quadric["a"], quadric["g"], quadric["c"]
    errors = chosen.forms.form_errors(*given, at, quadric["host_error"])
    return Known(chosen.forms.form_at(*given, at), errors, int(quadric["eye"]))
