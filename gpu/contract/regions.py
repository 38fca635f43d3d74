"""Copies of groups of cells, in the records that shaders and the twin read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records
from halfstep.contract.expressions import PackedExpressions
from halfstep.contract.polynomials import PackedPolynomials


@dataclass(frozen=True)
class PackedRegions:
    """Visible copies of groups, or their excerpts: the parts that single tiles see."""

    records: Records  # of R copies, in the order of ``Setup.copies``, or of their excerpts
    # Planes and quadrics. Other threads may still write them, and the call waits for these.
    surfaces: Callable[[], tuple[Records, Records]]
    appearances: Records
    words: U32  # the lists of excerpts, and their programs
    most_surfaces: int  # the most surfaces of an excerpt
    levels: int  # the most levels that a program opens at once
    has_hidden: bool  # whether programs have cells that are not shown
    higher: Records | None = None  # surfaces of an order above two, if the scene has some
    polynomials: PackedPolynomials | None = None  # of these surfaces, and of solids
    expressions: PackedExpressions | None = None  # other formulas of both
    pairs: int = 0  # the most pairs of ends that one such surface has

    @property
    def flat(self) -> Records:
        """The planes of the copies."""
        return self.surfaces()[0]

    @property
    def curved(self) -> Records:
        """The quadrics of the copies."""
        return self.surfaces()[1]

    @property
    def arrays(self) -> tuple[Records | U32, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.records, self.flat, self.curved, self.appearances, self.words
