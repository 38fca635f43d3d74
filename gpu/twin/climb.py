"""Twin of ``climb.wgsl``: what a jet tells of F along a ray from a surface, in a cell of the ray.

In the first cell F is at least 0 at the beginning: either it is known to be, or the ray begins on F
and F counts from its value there. If F > 0 in all cells before, it is above 0 where the next one
begins. So a cell is passed if F climbs: if it is greater everywhere in the cell than at the
beginning. Values and their errors do not matter for this, slopes alone do.

Let t run from 0 to 2 in the cell, and let |S''/2 - bend| <= e there, as ``jets`` has it. S' at the
beginning is within 2e of slope - 2 bend. So

    F(t) - F(0) >= t (slope - slope_error - 2 bend - 2e + t (bend - e)),

which is linear in t but for its factor: F climbs to t if the bracket is positive at 0 and at t. At
2 it is slope - slope_error - 4e, at 1 it is slope - slope_error - bend - 3e.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.cells import Judged
from halfstep.twin.certify import EPSILON, ROOM
from halfstep.twin.jets import MEAN, STEEP, UNDEFINED, Jet, judged_jet, reach_of
from halfstep.twin.lanes import F32, Bools

_TWO, _THREE, _FOUR, _EIGHT = map(np.float32, (2, 3, 4, 8))


def known_to(jet: Jet) -> F32:
    """The largest error of the value in the middle of a cell."""
    return np.where((jet.state & STEEP) > 0, reach_of(jet), ROOM * jet.value_error)


def lowered_jet(jet: Jet, level: F32, error: F32) -> Jet:
    """F less a level that is known to an error."""
    value = jet.value - level
    return jet._replace(
        value=value, value_error=(jet.value_error + error) + EPSILON * np.abs(value)
    )


def is_sloped(jet: Jet) -> Bools:
    """Whether slopes are known in a cell."""
    return (jet.state & (STEEP | UNDEFINED)) == 0


def has_slope(jet: Jet) -> Bools:
    """Whether the sign of the slope in the middle of a cell is certain."""
    return is_sloped(jet) & (np.abs(jet.slope) > ROOM * jet.slope_error)


def climbing_jet(jet: Jet) -> Judged:
    """The properties of F in a cell at whose beginning F >= 0."""
    judged = judged_jet(jet)
    sloped = is_sloped(jet)
    sizes = np.abs(jet.slope) + np.abs(jet.bend)
    tilt = jet.slope - (ROOM * jet.slope_error + (_EIGHT * EPSILON) * sizes)
    # Slopes count on bends at all places, not on the mean of those on the way there.
    errors = np.where((jet.state & MEAN) > 0, _THREE, np.float32(1))
    off = ROOM * (errors * jet.bend_error)
    begins = sloped & (tilt > _TWO * (jet.bend + off))
    # Where F changes by less than its error but climbs, smaller cells may tell.
    flat = judged.vague & (jet.slope <= ROOM * jet.slope_error)
    return judged._replace(
        passed=judged.passed | (begins & (tilt > _FOUR * off)),
        ahead=judged.ahead | (begins & (tilt > jet.bend + _THREE * off)),
        vague=flat,
    )


def sinking_jet(jet: Jet) -> Judged:
    """The same, but ``single`` says that F < 0 somewhere in the cell, for certain."""
    judged = climbing_jet(jet)
    middle = jet.value < -known_to(jet)
    sinks = judged.defined & (middle | (is_sloped(jet) & judged.below))
    return judged._replace(single=sinks)
