"""Copies of groups that hide lights, in the records that shaders and the twin read.

A veil is the part of a copy that a bundle of rays to a light may hit.
"""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records

# Halvings that locate where a ray to a light crosses a surface. float32 holds these positions
# exactly.
VEIL_STEPS = 22


@dataclass(frozen=True)
class PackedVeils:
    """The veils of all lights with shadows."""

    views: Records  # (L,), for each light with shadows, in the order of `PackedShadows.views`
    records: Records  # the veils
    boxes: Records  # bounding boxes of the veils; no ray meets the last ones, which are padding
    copies: Records  # the copies that hide lights, as occluders without surfaces
    flat: Records  # their planes along rays to lights
    curved: Records  # their quadrics along rays to lights
    words: U32  # the lists of veils, and their programs
    most_surfaces: int  # the most surfaces of a veil
    levels: int  # the most levels that a program opens at once
    encloses: bool  # whether a light may be inside a copy
    has_hidden: bool  # whether some cells hide no light

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.views, self.records, self.boxes, self.copies, self.flat, self.curved
