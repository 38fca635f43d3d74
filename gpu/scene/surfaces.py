"""The kinds of surfaces: functions F without cuts, whose sides regions combine."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, Union

import numpy as np
from pydantic import Field

from halfstep.scene.algebraic import ImplicitShape, TorusShape
from halfstep.scene.formula import MAX_ID, Sense
from halfstep.scene.shapes import Placed, QuadricShape
from halfstep.scene.solids import QUADRIC_SHAPES
from halfstep.scene.values import Array, made_of_kind

SurfaceId = Annotated[int, Field(ge=1, le=MAX_ID)]


class Surface(Placed):
    """A surface with a number by which regions name it; ``-s`` is F <= 0, ``+s`` is F > 0.

    From Python, ``Surface(kind="sphere", radius=2.0)`` makes a `SphereSurface`. A surface without
    ``id`` gets a number from the group that takes it in.
    """

    id: SurfaceId | None = None

    def __new__(cls, *_arguments: Any, **keys: Any) -> Self:  # noqa: D102
        return made_of_kind(cls, Surface, SURFACE_KINDS, keys)

    if TYPE_CHECKING:
        kind: str

        def __init__(self, *, kind: str, **keys: Any) -> None: ...

    def __neg__(self) -> Sense:
        return Sense(self, positive=False)

    def __pos__(self) -> Sense:
        return Sense(self, positive=True)

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ, local coordinates."""
        raise NotImplementedError


class PlaneSurface(Surface):
    """The plane through `origin` across `axis`: F is the local z, n·x - d."""

    kind: Literal["plane"] = "plane"

    def quadric(self) -> Array:
        """F = z: half of it above the diagonal, half below."""
        matrix = np.zeros((4, 4))
        matrix[2, 3] = matrix[3, 2] = 0.5
        return matrix


def _surface_of(name: str, shape: type[QuadricShape]) -> type[Surface]:
    """The kind of surface F = 0 with the F of a kind of solid."""
    doc = inspect.getdoc(shape)
    assert doc is not None
    own = {"__doc__": doc.replace("<=", "="), "__module__": __name__}
    return type(f"{name}Surface", (shape, Surface), own)


class TorusSurface(TorusShape, Surface):
    """((√(x² + y²) - major)/across)² + (z/along)² = 1, minor one number or (across, along)."""


class ImplicitSurface(ImplicitShape, Surface):
    """formula = 0 within the bounds; outside of these formula > 0 is taken to hold."""


SURFACE_KINDS: tuple[type[Surface], ...] = (
    *(_surface_of(name, shape) for name, shape in QUADRIC_SHAPES.items()),
    PlaneSurface,
    TorusSurface,
    ImplicitSurface,
)
# Pickles find a class by its name.
globals().update({kind.__name__: kind for kind in SURFACE_KINDS})
if TYPE_CHECKING:
    AnySurface = Surface
else:
    AnySurface = Annotated[Union[SURFACE_KINDS], Field(discriminator="kind")]  # noqa: UP007
