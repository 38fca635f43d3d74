"""Twin of ``visit_article.wgsl``: a solid by the paper's own sequences."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.article import article_patch, article_polyhedron, article_quadric
from halfstep.twin.certificate import polyhedron_certificate, quadric_certificate
from halfstep.twin.certify import (
    NO_CERTIFICATE,
    Certificate,
    bounded_bound,
    bounded_clip,
    bounded_facing,
    bounded_interval,
    certify_patch,
)
from halfstep.twin.chosen import Chosen, Offset
from halfstep.twin.lanes import I32
from halfstep.twin.lines import line_of
from halfstep.twin.normal import NO_VECTOR, either, turned
from halfstep.twin.sight import Seen, Sight
from halfstep.twin.solid import (
    eye_inside,
    eye_outside,
    near_cut,
    normal_of,
    other_side,
    slope_at,
    starts_at_eye,
)


def visit_article(
    solid: np.void,
    half_spaces: NDArray[np.void],
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a solid."""
    near_u, far_u, steps = solid["near_u"], solid["far_u"], int(solid["steps"])
    start, count = int(solid["plane_start"]), int(solid["plane_count"])
    own = half_spaces[start : start + count]
    at = chosen.offset(x, y)
    lines = [chosen.forms.line_at(half_space["c"], half_space["b"], at) for half_space in own]
    if "patch" in facts:
        found = article_patch(lines, near_u, far_u, steps)
    elif "flat" in facts:
        found = article_polyhedron(lines, near_u, far_u, eye_inside(solid), steps)
    else:
        form = chosen.forms.form_at(solid["a"], solid["g"], solid["c"], at)
        outside = (form.a - form.g) + form.c > 0
        if starts_at_eye(solid):
            outside = np.full(outside.shape, eye_outside(solid))
        found = article_quadric(form, outside, lines, near_u, far_u, eye_inside(solid), steps)
    sight = Sight(found.hit, found.surface, found.position, found.left, found.exit_position)

    # Only now is it known which surface is seen.
    slope = NO_VECTOR
    if "normal" in facts and "patch" in facts:
        slope = turned(line_of(lines, 0).b > 0, normal_of(own[0]))
    elif "normal" in facts:
        if "curved" in facts:
            slope = slope_at(solid, x, y, found.position)
        for k in range(count):
            slope = either(found.surface == k + 1, normal_of(own[k]), slope)

    certificate = NO_CERTIFICATE
    if "error" in facts:
        certificate = _certificate(solid, own, at, chosen, facts)
        # In one cell, the entry and the exit through a surface may be confused.
        same = certificate.inside == found.inside
        certificate = certificate._replace(sure=certificate.sure & same)
    side = other_side(solid, found.inside)
    if "patch" in facts:
        side = (line_of(lines, 0).b > 0).astype(np.uint32)
    return Seen(sight, slope, certificate, turned=side)


def _certificate(
    solid: np.void,
    half_spaces: NDArray[np.void],
    at: Offset,
    chosen: Chosen,
    facts: Collection[str],
) -> Certificate:
    """The certificate of a solid with ``half_spaces``."""
    near_u, far_u = solid["near_u"], solid["far_u"]
    lines = []
    for half_space in half_spaces:
        c, b = half_space["c"], half_space["b"]
        errors = chosen.forms.line_errors(c, b, at, half_space["host_error"])
        lines.append((chosen.forms.line_at(c, b, at), errors))
    if "patch" in facts:
        bounded = bounded_facing(*lines[0], near_u, far_u, near_cut(solid))
        for line in lines[1:]:
            bounded = bounded_bound(bounded, *line)
        return certify_patch(bounded, solid["last_step"])
    ends = bounded_interval(at.x + 0 * at.y, near_u, far_u, near_cut(solid))
    for number, line in enumerate(lines, start=1):
        ends = bounded_clip(ends, *line, number)
    if "flat" in facts:
        return polyhedron_certificate(solid, ends)
    return quadric_certificate(solid, at, ends, chosen)
