"""The solids that mirrors show, in the records that shaders and the twin read."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records

# Halvings for a ray from a mirror, as many as for shadows.
MIRROR_STEPS = 16


@dataclass(frozen=True)
class PackedMirrors:
    """K solids in the form in which rays from mirrors meet them."""

    frame: Records  # (1,), the grid of the world relative to the eye
    bodies: Records  # (K,)
    faces: Records
    balls: Records  # around the bodies, in their order, and before them around groups of them
    polynomials: Records | None  # of bodies, if some have one
    bounces: int  # how often a ray is reflected at most; at least 1

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.frame, self.bodies, self.faces, self.balls
