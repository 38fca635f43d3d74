"""The solids that mirrors show, in the records that shaders and the twin read."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import U32, Records
from halfstep.contract.expressions import PackedExpressions

# Halvings for a ray from a mirror, as many as for shadows.
MIRROR_STEPS = 16
# The most reflections of a ray that a scene may ask for.
MOST_BOUNCES = 8
# Above all numbers of bodies.
NO_BODY = 0xFFFFFFFF


@dataclass(frozen=True)
class PackedReflected:
    """The cells of bodies that are copies of groups."""

    copies: Records  # of all copies
    bowls: Records  # their quadrics; their planes are among the faces of bodies
    words: U32  # their lists, and their programs
    most_crossings: int  # the most crossings of the surfaces of a group
    levels: int  # the most levels that a program opens at once
    degree: int  # the highest degree of the scene's polynomials, if a surface has one; else 0
    pairs: int  # the most stretches of a ray in which a polynomial of a surface is <= 0

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.copies, self.bowls


@dataclass(frozen=True)
class PackedMirrors:
    """K solids and copies of groups in the form in which rays from mirrors meet them."""

    frame: Records  # (1,), the grid of the world relative to the eye
    bodies: Records  # (K,)
    faces: Records
    hulls: Records  # around the bodies, in their order, and before them around groups of them
    # Of bodies of an order above two, and then of the surfaces of copies, if there are some.
    casters: Records | None
    formulas: PackedExpressions | None  # of those that have no polynomial
    bounces: int  # how often a ray is reflected at most; at least 1
    reflected: PackedReflected | None  # the cells of bodies, if some are copies of groups

    @property
    def arrays(self) -> tuple[Records, ...]:
        """The content of the device's buffers, in the order of the bindings."""
        return self.frame, self.bodies, self.faces, self.hulls
