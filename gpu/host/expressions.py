"""Formulas that are no polynomials on the rays of a frame, float64, on the host.

The point of a ray is level + u along, both affine in (1, x, y). Shaders compute its coordinates so,
in the solid's own frame, and evaluate the formula there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.expressions import Program
from halfstep.host.forms import Sight, power_of_two
from halfstep.host.polynomials import furthest
from halfstep.scene import Algebraic, Solid
from halfstep.scene.programs import Compiled, compiled
from halfstep.scene.ranges import Range, range_of

# Points may lie as far beyond the interval as it is long, in all directions.
BEYOND = 4.0
# Records have room for this number of constants, or twice as many, and so on.
FEWEST_NUMBERS = 4


@dataclass(frozen=True)
class Expressions:
    """The Q solids of a scene that formulas bound, and the formulas of surfaces of groups."""

    solid: Ints  # (Q,), rows in ``Geometry``
    formulas: tuple[Compiled, ...]  # formula of each solid, then of each surface
    programs: tuple[Program, ...]  # the programs of all formulas, each once
    numbers: int  # constants that a record has room for
    is_sheet: Bools  # (Q,)
    is_in_ball: Bools  # (Q,), a ball bounds the solid; ``Geometry.quadric`` has its matrix
    center: Floats  # (3, Q), middle of the box of each solid, local
    size: Floats  # (3, Q), half of it

    def places(self, solid: Ints) -> Ints:
        """Indices here of those ``solid`` that are among these."""
        return np.searchsorted(self.solid, solid)


@dataclass(frozen=True)
class FormulasOnRays:
    """Formulas of E visible solids, or surfaces of groups, along the rays of a frame."""

    row: Ints  # (E,), rows in ``Setup``; of a surface, which of the visible copies has it
    of: Ints  # (E,), places among the formulas of ``Expressions``
    known: Expressions
    level: Floats  # (3, 3, E), points at u = 0: [axis][1, x, y], local
    along: Floats  # (3, 3, E), their change to u = 1
    error: Floats  # (E,), error of points
    scale: Floats  # (E,), scale that brings pixel offsets to at most 1
    rotation: Floats  # (3, 3, E), world from local


def expressions(solids: Sequence[Solid]) -> Expressions | None:
    """The formulas of ``solids`` that are no polynomials; None if there are none."""
    found = [
        (ix, solid)
        for ix, solid in enumerate(solids)
        if isinstance(solid, Algebraic) and not solid.has_polynomial
    ]
    if not found:
        return None
    formulas = tuple(compiled(solid.expression()) for _, solid in found)
    low, high = np.array([solid.box() for _, solid in found]).transpose(1, 2, 0)
    return Expressions(
        np.array([ix for ix, _ in found]),
        formulas,
        *_shared(formulas),
        np.array([solid.is_sheet() for _, solid in found]),
        np.array([solid.is_in_ball() for _, solid in found]),
        center=(low + high) / 2,
        size=(high - low) / 2,
    )


def with_members(known: Expressions | None, members: Sequence[Compiled]) -> Expressions | None:
    """The formulas of solids, and those of surfaces of groups."""
    if not members:
        return known
    if known is None:
        none = np.zeros(0, bool)
        no_box = np.zeros((3, 0))
        known = Expressions(np.zeros(0, np.int64), (), (), 0, none, none, no_box, no_box)
    formulas = (*known.formulas, *members)
    programs, numbers = _shared(formulas)
    return replace(known, formulas=formulas, programs=programs, numbers=numbers)


def _shared(formulas: Sequence[Compiled]) -> tuple[tuple[Program, ...], int]:
    """The programs of formulas, each once, and the room of a record for numbers."""
    most = max(len(each.numbers) for each in formulas)
    room = FEWEST_NUMBERS
    while room < most:
        room *= 2
    return tuple(dict.fromkeys(each.program for each in formulas)), room


def formulas_on_rays(
    known: Expressions, row: Ints, of: Ints, sight: Sight, rotation: Floats
) -> FormulasOnRays:
    """Formulas along rays.

    Args:
        known: the formulas of the scene.
        row: (E,), row of each in ``Setup``, or which copy has it.
        of: (E,), indices of ``known.formulas``.
        sight: the view of each, (E,).
        rotation: (3, 3, E), world from local.
    """
    rays = sight.rays
    reach = 1.0 / power_of_two(np.maximum(sight.offsets.max(axis=0), 1.0))
    level = rays[1:] * sight.spread
    level[0] = rays[0] + rays[1] * sight.middle
    along = rays[1:] * sight.half
    if sight.parallel:
        along[1:] = 0.0
    level[1:] *= reach
    along[1:] *= reach
    return FormulasOnRays(
        row=row,
        of=of,
        known=known,
        level=level.transpose(1, 0, 2),
        along=along.transpose(1, 0, 2),
        error=BEYOND * sight.error,
        scale=1.0 / reach,
        rotation=rotation,
    )


class FormulaAtEye:
    """Values of formulas at the centre of projection, (E,)."""

    def __init__(self, known: Expressions, of: Ints, sight: Sight, low: Floats) -> None:
        """``of`` has indices in ``known``; ``sight`` is the view of each, (E,).

        ``low`` (E,) is a depth that `nearest` need not tell if it is less.
        """
        self._known, self._of = known, of
        self._eye = sight.rays[0]
        self._error = sight.error
        reach = np.concatenate([np.ones((1, *sight.offsets.shape[1:])), sight.offsets])
        self._steepest = np.einsum("iap,ip->ap", np.abs(sight.rays[1:]), reach)
        # At the eye, and up to the depth.
        low_reach = low * self._steepest
        found = self._ranges(np.stack([np.zeros_like(low_reach), low_reach], axis=1))
        # If a formula has no value there, the eye is outside.
        self.outside: Bools = ~((found.high <= -found.low) & np.isfinite(found.high))[0]
        signed = (found.low > 0) | (found.high < 0)
        self.sure: Bools = signed[0]
        self._is_far = bool(signed[1].any())

    def nearest(self, far: float) -> Floats:
        """A lower bound (E,) of the depth, up to ``far``, at which any ray meets F = 0.

        It is 0 where a search would end at less than the depth that need not be told.
        """
        if not self._is_far:
            return np.zeros(len(self._of))

        def passes(depth: Floats) -> Bools:
            found = self._ranges(depth * self._steepest[:, None])
            return np.asarray((found.low > 0) | (found.high < 0))

        return furthest(passes, len(self._of), far)

    def _ranges(self, reach: Floats) -> Range:
        """Ranges of F within ``reach`` (3, …, E) of the eye."""
        low, high = (np.empty(reach.shape[1:]) for _ in range(2))
        for k, place in enumerate(self._of.tolist()):
            formula = self._known.formulas[place]
            away = zip(self._eye[:, k], reach[..., k], strict=True)
            off = self._error[k]
            box = [Range(at - size - off, at + size + off) for at, size in away]
            low[..., k], high[..., k] = range_of(formula.program, formula.numbers, box)
        return Range(low, high)
