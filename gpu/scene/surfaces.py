"""The kinds of surfaces: functions F without cuts, which regions take the sides of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import Field

from halfstep.scene import shapes
from halfstep.scene.formula import MAX_ID, Sense
from halfstep.scene.shapes import Placed
from halfstep.scene.values import Array, made_of_kind

SurfaceId = Annotated[int, Field(ge=1, le=MAX_ID)]


class Surface(Placed):
    """A surface with a number by which regions name it; ``-s`` is F <= 0, ``+s`` is F > 0.

    From Python, ``Surface(kind="sphere", radius=2.0)`` makes one of the kind; without ``id`` the
    group that it gets into numbers it.
    """

    id: SurfaceId | None = None

    def __new__(cls, *_arguments: Any, **keys: Any) -> Self:  # noqa: D102
        return made_of_kind(cls, Surface, SURFACE_KINDS, keys)

    if TYPE_CHECKING:

        def __init__(self, *, kind: str, **keys: Any) -> None: ...

    def __neg__(self) -> Sense:
        return Sense(self, positive=False)

    def __pos__(self) -> Sense:
        return Sense(self, positive=True)

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ, local coordinates."""
        raise NotImplementedError


class SphereSurface(shapes.Sphere, Surface):
    """x² + y² + z² = radius²."""


class EllipsoidSurface(shapes.Ellipsoid, Surface):
    """x²/a² + y²/b² + z²/c² = 1 with semi_axes (a, b, c)."""


class CylinderSurface(shapes.Cylinder, Surface):
    """x² + y² = radius²."""


class ConeSurface(shapes.Cone, Surface):
    """x² + y² = slope² z², both nappes."""


class HyperboloidOneSheetSurface(shapes.HyperboloidOneSheet, Surface):
    """(x² + y²)/waist² - z²/c² = 1."""


class HyperboloidTwoSheetsSurface(shapes.HyperboloidTwoSheets, Surface):
    """(x² + y²)/a² - z²/c² = -1."""


class ParaboloidSurface(shapes.Paraboloid, Surface):
    """(x² + y²)/a² = z."""


class QuadricSurface(shapes.Quadric, Surface):
    """F = 0 with coefficients of (x², y², z², xy, xz, yz, x, y, z, 1)."""


class PlaneSurface(Surface):
    """The plane through `origin` across `axis`: F is z of its own coordinates, n·x - d."""

    kind: Literal["plane"] = "plane"

    def quadric(self) -> Array:
        """F is linear: half of it in each of two places."""
        matrix = np.zeros((4, 4))
        matrix[2, 3] = matrix[3, 2] = 0.5
        return matrix


AnySurface = Annotated[
    SphereSurface
    | EllipsoidSurface
    | CylinderSurface
    | ConeSurface
    | HyperboloidOneSheetSurface
    | HyperboloidTwoSheetsSurface
    | ParaboloidSurface
    | QuadricSurface
    | PlaneSurface,
    Field(discriminator="kind"),
]
SURFACE_KINDS: tuple[type[Surface], ...] = get_args(get_args(AnySurface)[0])
