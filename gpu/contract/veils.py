"""Copies of groups that hide lights, in the records that shaders and the twin read.

A veil is the part of a copy that a bundle of rays to a light may hit.
"""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records
from halfstep.contract.powers import BOUNDS, CLOCKS

# Halvings that locate where a ray to a light crosses a surface. float32 holds these positions
# exactly.
VEIL_STEPS = 22


def rounds_of_higher(pairs: int) -> int:
    """The most rounds of loops that crossings take of a surface of an order above two.

    It has ``pairs`` stretches in which F <= 0. Each root, and the rest behind the last one, begins
    anew, tries cells, is halved and looks for its bounds.
    """
    roots = 2 * pairs + 1
    return CLOCKS * pairs + roots * (VEIL_STEPS + BOUNDS + 6) + 6 * pairs + 4


@dataclass(frozen=True)
class PackedVeils:
    """The veils of all lights with shadows."""

    views: Records  # (L,), for each light with shadows, in the order of `PackedShadows.views`
    records: Records  # the veils
    boxes: Records  # bounding boxes of the veils; no ray meets the last ones, which are padding
    copies: Records  # the copies that hide lights, as occluders without surfaces
    flat: Records  # their planes along rays to lights
    curved: Records  # their quadrics along rays to lights
    higher: Records | None  # forms of their surfaces of an order above two, if there are some
    words: U32  # the lists of veils, and their programs
    most_crossings: int  # the most crossings of a veil's surfaces
    levels: int  # the most levels that a program opens at once
    encloses: bool  # whether a light may be inside a copy
    has_hidden: bool  # whether some cells hide no light
    degree: int = 0  # the highest degree of the polynomials of the scene, if some are ``higher``
    pairs: int = 0  # the most stretches in which one of ``higher`` is <= 0

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.views, self.records, self.boxes, self.copies, self.flat, self.curved
