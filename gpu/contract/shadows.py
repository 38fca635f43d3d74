"""What hides lights, as shaders and the twin read it."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records

# Occluders side by side whose boxes have a box around them.
GROUP = 8
# Of fewer occluders all boxes are looked at.
MANY = 64


@dataclass(frozen=True)
class PackedShadows:
    """Lights with shadows, first those far away, then lamps; and what may hide them."""

    views: Records  # (L,)
    occluders: Records  # of one light after another, each light's from a multiple of GROUP^2 on
    slabs: Records
    boxes: Records  # of each occluder, of GROUPs, of GROUPs of these; the last is never touched
    far_lights: int  # of the L
    curves: bool  # an occluder has a quadric
    many: bool  # a light has more than MANY of them
    encloses: bool  # a light may be inside an occluder

    @property
    def arrays(self) -> tuple[Records, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.views, self.occluders, self.slabs, self.boxes
