"""Twin of ``visit_cut.wgsl``: a solid with half-spaces or base planes across it."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.certificate import polyhedron_certificate, quadric_certificate
from halfstep.twin.certify import NO_CERTIFICATE, bounded_clip, bounded_interval
from halfstep.twin.chosen import Chosen
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR, either
from halfstep.twin.piece import clip, from_the_eye, whole_interval
from halfstep.twin.root import (
    choose,
    polyhedron_entry,
    polyhedron_exit,
    quadric_entry,
    quadric_exit,
)
from halfstep.twin.sight import Seen
from halfstep.twin.solid import (
    eye_inside,
    near_cut,
    normal_of,
    other_side,
    slope_at,
    starts_inside,
    starts_outside,
)


def visit_cut(
    solid: np.void,
    half_spaces: NDArray[np.void],
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a solid: clip, joint logic, halve."""
    near_u, far_u = solid["near_u"], solid["far_u"]
    at = chosen.offset(x, y)
    like = x + 0 * y
    piece = whole_interval(like, near_u, far_u)
    ends = bounded_interval(like, near_u, far_u, near_cut(solid)) if "error" in facts else None
    normal_in = normal_out = NO_VECTOR
    for k in range(int(solid["plane_count"])):
        half_space = half_spaces[int(solid["plane_start"]) + k]
        number = k + 1
        line = chosen.forms.line_at(half_space["c"], half_space["b"], at)
        piece = clip(piece, line, number)
        if ends is not None:
            errors = chosen.forms.line_errors(
                half_space["c"], half_space["b"], at, half_space["host_error"]
            )
            ends = bounded_clip(ends, line, errors, number)
        if "normal" in facts:
            normal_in = either(piece.id_in == number, normal_of(half_space), normal_in)
            if "opened" in facts:
                normal_out = either(piece.id_out == number, normal_of(half_space), normal_out)
    certificate = NO_CERTIFICATE
    if ends is not None and "curved" in facts:
        certificate = quadric_certificate(solid, at, ends, chosen)
    elif ends is not None:
        certificate = polyhedron_certificate(solid, ends)
    if "opened" in facts and eye_inside(solid):
        piece = from_the_eye(piece, near_u)
    if "curved" in facts:
        form = chosen.forms.form_at(solid["a"], solid["g"], solid["c"], at)
        outside = starts_outside(solid, form, piece)
        root = leaving = quadric_entry(form, piece, outside)
        if "leaving" in facts:
            leaving = quadric_exit(form, piece, ~outside)
    else:
        root = leaving = polyhedron_entry(piece)
        if "leaving" in facts:
            leaving = polyhedron_exit(piece)
    if "opened" in facts:
        inside = starts_inside(solid, piece)
        if "curved" in facts:
            inside = inside & (eye_inside(solid) | ~outside)
        root = choose(inside, root, leaving)
        if "normal" in facts:
            normal_in = either(inside, normal_out, normal_in)
    turned = None
    if "opened" in facts:
        turned = other_side(solid, inside)
    sight = chosen.conveyor(root, leaving, int(solid["steps"]), facts)
    slope = normal_in
    if "normal" in facts and "curved" in facts:
        curve = slope_at(solid, x, y, sight.position)
        slope = either(sight.surface == 0, curve, normal_in)
    return Seen(sight, slope, certificate, turned=turned)
