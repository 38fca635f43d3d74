"""The solids that hide lights, in the records that shaders and the twin read.

A light is a far light, in a direction, or a lamp, at a position. A solid that may hide it is its
occluder.
"""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records
from halfstep.contract.expressions import PackedExpressions

# Neighbouring occluders in a group. A group has a bounding box around their bounding boxes.
GROUP = 8
# If no light has more occluders than this, shaders test all boxes and use no groups. They have one
# bit for each.
MANY = GROUP**2


@dataclass(frozen=True)
class PackedShadows:
    """L lights with shadows, far lights before lamps, and the solids that may hide them."""

    views: Records  # (L,)
    occluders: Records  # one light after another; each light begins at a multiple of GROUP^2
    slabs: Records
    boxes: Records  # of occluders, of groups, of groups of groups; no ray meets the last box
    sides: Records  # by the number of a surface of a solid; 0 is none
    casters: Records | None  # forms of occluders of an order above two, if there are some
    formulas: PackedExpressions | None  # those of them that are no polynomials, if there are some
    far_lights: int  # how many of the L lights are far away
    curves: bool  # whether an occluder has a quadric
    many: bool  # whether a light has more than MANY occluders
    encloses: bool  # whether a light may be inside an occluder

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.views, self.occluders, self.slabs, self.boxes, self.sides
