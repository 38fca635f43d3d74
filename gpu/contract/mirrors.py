"""What mirrors show, as shaders and the twin read it."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records

# Halvings of what a ray from a mirror meets: as many as shadows ask for.
MIRROR_STEPS = 16


@dataclass(frozen=True)
class PackedMirrors:
    """Solids as rays from mirrors meet them."""

    frame: Records  # (1,), where the grid is from the eye
    bodies: Records  # (K,)
    faces: Records
    balls: Records  # (K,) around the bodies, and some more that nothing meets
    bounces: int  # how often a ray may go on, at least 1

    @property
    def arrays(self) -> tuple[Records, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.frame, self.bodies, self.faces, self.balls
