"""Copies of groups of cells as shaders and the twin read them."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records


@dataclass(frozen=True)
class PackedRegions:
    """Visible copies of groups, or what tiles see of them."""

    records: Records  # of R copies, in the order of ``Setup.copies``, or of their excerpts
    flat: Records
    curved: Records
    appearances: Records
    words: U32  # what excerpts list, and their programs
    most_surfaces: int  # of an excerpt
    levels: int  # that a program opens at once
    has_hidden: bool  # programs have cells that are not shown
    higher: Records | None = None  # surfaces of an order above two, if the scene has some
    polynomials: Records | None = None  # theirs, and those of solids
    pairs: int = 0  # the most that one of them has

    @property
    def arrays(self) -> tuple[Records | U32, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.records, self.flat, self.curved, self.appearances, self.words
