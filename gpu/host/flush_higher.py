"""Sides of surfaces of an order above two, and which of them coincide.

Polynomials coincide if one is a multiple of the other. Other formulas do if they are the same
operations on the same numbers, in the same place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.geometry import Geometry
from halfstep.host.higher import Higher
from halfstep.host.world import World
from halfstep.scene import Algebraic, Scene


class HigherSides(NamedTuple):
    """Sides of surfaces (N,) behind which solids, or copies of groups, lie or may lie."""

    number: Ints  # of the surface in the scene
    solid: Ints  # row in ``Geometry``
    form: Ints  # place in ``forms``
    is_turned: Bools  # F is the negative of the surface's function
    forms: list[Higher]  # in world coordinates


def higher_sides(scene: Scene, geometry: Geometry, world: World) -> HigherSides:
    """All of a scene's: of sheets and of copies, both sides."""
    number: list[int] = []
    solid: list[int] = []
    forms: list[Higher] = []
    for ix, one in enumerate(scene.solids):
        if isinstance(one, Algebraic) and not geometry.is_empty[ix]:
            number.append(int(world.first_surface[ix]))
            solid.append(ix)
            forms.append(Higher.of(one))
    copies = [] if geometry.regions is None else geometry.regions.of.tolist()
    for ix, which in enumerate(copies, start=geometry.solid_count):
        assert geometry.regions is not None
        program = geometry.regions.programs[which]
        if program.higher and not geometry.is_empty[ix]:
            back = geometry.world_from_local[..., ix].T
            place = np.column_stack([back, -back @ geometry.origin[:, ix]])
            first = int(world.first_surface[ix]) + program.lower
            number += range(first, first + len(program.higher))
            solid += [ix] * len(program.higher)
            forms += [each.moved(place) for each in program.higher]
    own = geometry.solid_count
    both = [ix >= own or getattr(scene.solids[ix], "sheet", False) for ix in solid]
    form = np.concatenate([np.arange(len(forms)), np.flatnonzero(both)])
    is_turned = np.arange(len(form)) >= len(forms)
    return HigherSides(
        np.array(number, np.int64)[form], np.array(solid, np.int64)[form], form, is_turned, forms
    )


def kinds_of(forms: list[Higher]) -> list[Ints]:
    """Places of functions whose `rows_of` compare."""
    found: dict[object, list[int]] = {}
    for place, each in enumerate(forms):
        key = each.polynomial.degree if each.is_polynomial else each.formula
        found.setdefault(key, []).append(place)
    return [np.array(each, np.int64) for each in found.values()]


def rows_of(forms: list[Higher], middle: Floats, half: float) -> Floats:
    """Numbers (N, C) of functions of one kind, which are alike if the functions are.

    They are about ``middle``, in units of ``half``. The largest of a polynomial has magnitude 1.
    """
    rows = []
    for each in forms:
        if each.is_polynomial:
            row = each.coefficients(middle, half)
            rows.append(row / np.abs(row).max())
        else:
            turn, way = each.own_from_group[:, :3], each.own_from_group[:, 3]
            rows.append(np.append(turn, (way + turn @ middle) / half))
    return np.array(rows)
