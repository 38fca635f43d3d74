"""Twin of ``cross.wgsl``: the crossings of a surface of a region."""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify_region import is_vague, perhaps, shifted_form, surely
from halfstep.twin.chosen import Chosen
from halfstep.twin.crossings import (
    Crossing,
    convex,
    crossing,
    line_crossing,
    line_way,
    way_in,
    way_out,
)
from halfstep.twin.lanes import F32, Form
from halfstep.twin.piece import Line


def crossed(form: Form, steps: int, eye: int, chosen: Chosen) -> Crossing:
    """The crossing of a quadric."""
    bowl = convex(form)
    found = chosen.conveyor(way_in(bowl), way_out(bowl), steps, ("exit",))
    return crossing(form, found.position, found.exit_position, steps, eye)


def line_crossed(line: Line, steps: int, eye: int, chosen: Chosen) -> Crossing:
    """The crossing of a plane."""
    way = line_way(line)
    return line_crossing(line, chosen.conveyor(way, way, steps, ()).position, steps, eye)


def doubted(form: Form, by: F32, raised: bool, steps: int, eye: int, chosen: Chosen) -> Crossing:
    """The crossing of F + E if ``raised``, else of F - E."""
    vague = is_vague(form, by)
    never = np.int32((1 << steps) + 1)
    found = crossed(shifted_form(form, by if raised else -by), steps, eye, chosen)
    return surely(found, vague, never) if raised else perhaps(found, vague, never)
