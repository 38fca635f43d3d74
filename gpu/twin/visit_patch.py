"""Twin of ``visit_patch.wgsl``: a bounded plane, seen from both sides."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.certify import NO_CERTIFICATE, bounded_bound, bounded_facing, certify_patch
from halfstep.twin.chosen import Chosen
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR, turned
from halfstep.twin.patch import bound, facing
from halfstep.twin.root import patch_entry
from halfstep.twin.sight import Seen
from halfstep.twin.solid import near_cut, normal_of


def visit_patch(
    solid: np.void,
    half_spaces: NDArray[np.void],
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a solid: the plane, then its bounds."""
    near_u, far_u = solid["near_u"], solid["far_u"]
    at = chosen.offset(x, y)
    start = int(solid["plane_start"])
    own = half_spaces[start]
    line = chosen.forms.line_at(own["c"], own["b"], at)
    patch = facing(line, near_u, far_u)
    bounded = None
    if "error" in facts:
        errors = chosen.forms.line_errors(own["c"], own["b"], at, own["host_error"])
        bounded = bounded_facing(line, errors, near_u, far_u, near_cut(solid))
    for k in range(1, int(solid["plane_count"])):
        half_space = half_spaces[start + k]
        line = chosen.forms.line_at(half_space["c"], half_space["b"], at)
        patch = bound(patch, line)
        if bounded is not None:
            errors = chosen.forms.line_errors(
                half_space["c"], half_space["b"], at, half_space["host_error"]
            )
            bounded = bounded_bound(bounded, line, errors)
    root = patch_entry(patch)
    certificate = NO_CERTIFICATE
    if bounded is not None:
        certificate = certify_patch(bounded, solid["last_step"])
    sight = chosen.conveyor(root, root, int(solid["steps"]), facts)
    slope = turned(patch.away, normal_of(own)) if "normal" in facts else NO_VECTOR
    return Seen(sight, slope, certificate, turned=patch.away.astype(np.uint32))
