"""Surfaces of formulas that are no polynomials, each as a scene's text and as a Python function.

The function takes intervals with derivatives (`tests.intervals`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests import intervals as iv


@dataclass(frozen=True)
class FormulaSurface:
    """A formula as text and as a function. Its ball or box is ``reach`` wide."""

    formula: str
    function: Callable[..., Any]
    reach: float = 1.5
    parameters: dict[str, float] = field(default_factory=dict)


_S = FormulaSurface


def _gyroid(x: Any, y: Any, z: Any) -> Any:
    a, b, c = 3.0 * x, 3.0 * y, 3.0 * z
    return iv.sin(a) * iv.cos(b) + iv.sin(b) * iv.cos(c) + iv.sin(c) * iv.cos(a)


def _square(a: Any) -> Any:
    return a * a


def _metaballs(x: Any, y: Any, z: Any) -> Any:
    return (
        0.35
        - iv.exp(-3.0 * (_square(x - 0.7) + y * y + z * z))
        - iv.exp(-3.0 * (_square(x + 0.5) + _square(y - 0.4) + z * z))
        - iv.exp(-3.0 * (x * x + _square(y + 0.6) + _square(z - 0.5)))
    )


def _both(a: Any) -> Any:
    return iv.exp(4.0 * a) + iv.exp(-4.0 * a)


def _superellipsoid(x: Any, y: Any, z: Any) -> Any:
    return sum(iv.exp(1.5 * iv.log(a * a + 0.001)) for a in (x, y, z)) - 1.0


FORMULAS = {
    "gyroid": _S(
        "sin(a*x)*cos(a*y) + sin(a*y)*cos(a*z) + sin(a*z)*cos(a*x)", _gyroid, 1.5, {"a": 3.0}
    ),
    "schwarz": _S(
        "cos(3*x) + cos(3*y) + cos(3*z) = 0",
        lambda x, y, z: iv.cos(3.0 * x) + iv.cos(3.0 * y) + iv.cos(3.0 * z),
    ),
    "metaballs": _S(
        "0.35 - exp(-3*((x-0.7)^2+y^2+z^2)) - exp(-3*((x+0.5)^2+(y-0.4)^2+z^2))"
        " - exp(-3*(x^2+(y+0.6)^2+(z-0.5)^2))",
        _metaballs,
        2.0,
    ),
    "sqrt_torus": _S(
        "(sqrt(x^2 + y^2) - 1)^2 + z^2 - 0.16",
        lambda x, y, z: _square(iv.sqrt(x * x + y * y) - 1.0) + z * z - 0.16,
    ),
    "helix": _S(
        "(x - cos(4*z))^2 + (y - sin(4*z))^2 = 0.06",
        lambda x, y, z: _square(x - iv.cos(4.0 * z)) + _square(y - iv.sin(4.0 * z)) - 0.06,
    ),
    "shell": _S(
        "abs(x^2 + y^2 + z^2 - 1) - 0.1",
        lambda x, y, z: iv.absolute(x * x + y * y + z * z - 1.0) - 0.1,
    ),
    "cube": _S(
        "max(max(abs(x), abs(y)), abs(z)) - 1",
        lambda x, y, z: (
            iv.greatest(iv.greatest(iv.absolute(x), iv.absolute(y)), iv.absolute(z)) - 1.0
        ),
    ),
    "joined": _S(
        "min(x^2 + y^2 - 0.2, x^2 + z^2 - 0.1)",
        lambda x, y, z: iv.least(x * x + y * y - 0.2, x * x + z * z - 0.1),
    ),
    "rounded": _S(
        "log(exp(4*x) + exp(4*y) + exp(4*z) + exp(-4*x) + exp(-4*y) + exp(-4*z)) - 4",
        lambda x, y, z: iv.log(_both(x) + _both(y) + _both(z)) - 4.0,
    ),
    "quotient": _S(
        "x^2 + y^2 + z^2 - 1/(1 + x^2)",
        lambda x, y, z: x * x + y * y + z * z - 1.0 / (1.0 + x * x),
    ),
    "tangent": _S(
        "tan(x)/2 - z + y^2",
        lambda x, y, z: 0.5 * iv.tan(x) - z + y * y,
        1.2,
    ),
    "superellipsoid": _S(
        "(x^2+0.001)^1.5 + (y^2+0.001)^1.5 + (z^2+0.001)^1.5 - 1", _superellipsoid
    ),
    "waves": _S(
        "z - sin(5*x)*exp(-y^2)/3",
        lambda x, y, z: z - iv.sin(5.0 * x) * iv.exp(-1.0 * (y * y)) / 3.0,
    ),
    "twelfth": _S(
        "x^12 + y^12 + z^12 + 0*abs(x) - 1",
        lambda x, y, z: iv.power(x, 12) + iv.power(y, 12) + iv.power(z, 12) - 1.0,
    ),
}
# Most hits have a finite error, except on surfaces with kinks all along.
KINKED = {"cube", "shell", "joined"}


def solid_of(name: str, *, ball: bool = False) -> dict[str, Any]:
    """The table of a surface's solid."""
    surface = FORMULAS[name]
    box = {"min": [-surface.reach] * 3, "max": [surface.reach] * 3}
    return {
        "kind": "implicit",
        "formula": surface.formula,
        "bounds": {"radius": surface.reach} if ball else box,
        "color": [0.7, 0.3, 0.15],
        **({"parameters": surface.parameters} if surface.parameters else {}),
    }
