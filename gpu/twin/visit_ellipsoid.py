"""Twin of ``visit_ellipsoid.wgsl``: an uncut ellipsoid seen from outside."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.certificate import ellipsoid_certificate
from halfstep.twin.certify import NO_CERTIFICATE
from halfstep.twin.chosen import Chosen
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR
from halfstep.twin.root import ellipsoid_entry, ellipsoid_exit
from halfstep.twin.sight import Seen
from halfstep.twin.solid import slope_at


def visit_ellipsoid(
    solid: np.void,
    half_spaces: NDArray[np.void],  # noqa: ARG001 - as all visits
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a solid: only the discriminant decides."""
    at = chosen.offset(x, y)
    form = chosen.forms.form_at(solid["a"], solid["g"], solid["c"], at)
    root = leaving = ellipsoid_entry(form)
    if "exit" in facts:
        leaving = ellipsoid_exit(form)
    certificate = NO_CERTIFICATE
    if "error" in facts:
        certificate = ellipsoid_certificate(solid, at, chosen)
    sight = chosen.conveyor(root, leaving, int(solid["steps"]), facts)
    slope = slope_at(solid, x, y, sight.position) if "normal" in facts else NO_VECTOR
    return Seen(sight, slope, certificate)
