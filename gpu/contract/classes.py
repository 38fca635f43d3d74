"""Classes of solids: solids of one class run the same code."""

from __future__ import annotations

from enum import IntEnum


class Class(IntEnum):
    """The class of a solid. A shader has one loop for each class in its frame."""

    ELLIPSOID = 0  # whole, between the base planes, seen from outside
    QUADRIC = 1
    QUADRIC_INSIDE = 2  # some rays start inside
    POLYHEDRON = 3
    POLYHEDRON_INSIDE = 4
    PATCH = 5
    REGION = 6
    REGION_INSIDE = 7
    POLYNOMIAL = 8  # any degree, whole or cut, seen from outside or inside
    FORMULA = 9  # any other formula, likewise
    REGION_4 = 10  # tiles see no more of any than four words of one level, all from outside
    REGION_8 = 11  # eight words
    REGION_KNOWN = 12  # tiles see copies of one group alone, whole, whose program the shader knows


# The classes of copies of groups.
REGIONS = frozenset(klass for klass in Class if klass.name.startswith("REGION"))
# Words that programs have at most, by class.
SHORT = {Class.REGION_4: 4, Class.REGION_8: 8}
# Classes whose members of lists have stretches of depth (``contract.stretches``).
STRETCHED = frozenset({Class.POLYNOMIAL, Class.FORMULA})
# Classes whose lists come behind that of REGION, so that its code draws them, too.
BEHIND_REGION = (*SHORT, Class.REGION_KNOWN)
