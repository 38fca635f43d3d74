"""Twin of ``verdict.wgsl``: what integers say of a ray and a solid."""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify import Certificate, confirms
from halfstep.twin.lanes import U32
from halfstep.twin.sight import Sight

# Verdicts: nothing is certain; the ray misses the solid; it first meets the surface with the number
# that a verdict has more than this.
UNSURE, MISSES, MEETS = 0, 1, 2


def verdict_of(certificate: Certificate, sight: Sight) -> U32:
    """What is certain, as a verdict."""
    met = sight.surface.astype(np.uint32) + np.uint32(MEETS)
    known = np.where(sight.hit, met, np.uint32(MISSES))
    return np.where(confirms(certificate, sight.hit, sight.surface), known, np.uint32(UNSURE))
