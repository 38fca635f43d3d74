"""Copies of groups of cells as shaders and the twin read them."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records


@dataclass(frozen=True)
class PackedRegions:
    """R visible copies of groups, in the order of ``Setup.copies``."""

    records: Records  # (R,)
    flat: Records
    curved: Records
    words: U32
    appearances: Records
    most_surfaces: int  # of a program of the scene
    levels: int  # that a program of the scene opens at once

    @property
    def arrays(self) -> tuple[Records | U32, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.records, self.flat, self.curved, self.appearances, self.words
