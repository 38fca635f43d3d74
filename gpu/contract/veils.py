"""What hides lights of copies of groups of cells, as shaders and the twin read it."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records

# Halvings of where a ray to a light crosses a surface: float32 holds all places of so many.
VEIL_STEPS = 22
# Rounds of loops that an invocation takes for them at most: drivers end loops after some. Most take
# some hundred.
VEIL_ROUNDS = 1 << 15


@dataclass(frozen=True)
class PackedVeils:
    """What rays to lights meet of copies of groups: a veil for rays that are close together."""

    views: Records  # (L,), of each light with shadows, in the order of `PackedShadows.views`
    records: Records
    boxes: Records  # of each record; behind the last are some that are never touched
    copies: Records  # before lights, as occluders without surfaces
    flat: Records  # planes along rays to lights
    curved: Records  # and quadrics
    words: U32  # what veils list, and their programs
    most_surfaces: int  # of a veil
    levels: int  # that a program opens at once
    encloses: bool  # a light may be inside a copy
    has_hidden: bool  # some cells hide no light

    @property
    def arrays(self) -> tuple[Records, ...]:
        """What devices have in buffers, in the order of the bindings."""
        return self.views, self.records, self.boxes, self.copies, self.flat, self.curved
