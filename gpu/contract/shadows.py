"""What hides lights, as shaders and the twin read it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from halfstep.contract.arrays import Records


class Kind(IntEnum):
    """Occluders that run the same code; a light has a list of each."""

    CURVED = 0
    FLAT = 1  # a polyhedron
    PATCH = 2


@dataclass(frozen=True)
class PackedShadows:
    """Lights with shadows, first those far away, then lamps; and what may hide them."""

    locations: Records  # (V,), in the order of ``Packed.solids``
    views: Records  # (L,)
    occluders: Records  # of one light after another, by kind
    sides: Records
    boxes: Records  # of each occluder, and some more that are never touched
    far_lights: int  # of the L
    kinds: frozenset[tuple[Kind, bool]]  # that there are, and whether of a lamp
    encloses: bool  # a light may be inside an occluder

    @property
    def arrays(self) -> tuple[Records, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.locations, self.views, self.occluders, self.sides, self.boxes
