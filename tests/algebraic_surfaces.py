"""Algebraic surfaces, each as a scene's text and as a Python function for the oracle.

Most are those of the galleries of H. Hauser and of the program SURFER, from their equations; Barth,
Chmutov, Clebsch, Kummer, Cayley and Dupin from the literature. Each is seen in a box of half the
width ``reach``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

GOLDEN = Fraction((1 + math.sqrt(5)) / 2)
ROOT_2 = Fraction(math.sqrt(2))
# Numbers of any ring: rationals, or polynomials along rays.
Number = Any


@dataclass(frozen=True)
class AlgebraicSurface:
    """A formula as text and as a function."""

    formula: str
    function: Callable[[Number, Number, Number], Number]
    reach: float = 1.5


def _clebsch(x: Number, y: Number, z: Number) -> Number:
    cubes, squares, mixed = x**3 + y**3 + z**3, x * x + y * y + z * z, x * y + x * z + y * z
    edges = x * x * (y + z) + y * y * (x + z) + z * z * (x + y)
    return (
        cubes * 81 - edges * 189 + x * y * z * 54 + mixed * 126 - squares * 9 - (x + y + z) * 9 + 1
    )


def _kummer(x: Number, y: Number, z: Number) -> Number:
    mu = Fraction(1.69)
    planes = (
        (1 - z - x * ROOT_2) * (1 - z + x * ROOT_2) * (1 + z + y * ROOT_2) * (1 + z - y * ROOT_2)
    )
    return planes * ((3 * mu - 1) / (3 - mu)) - (x * x + y * y + z * z - mu) ** 2


def _barth_sextic(x: Number, y: Number, z: Number) -> Number:
    g = GOLDEN**2
    planes = (x * x * g - y * y) * (y * y * g - z * z) * (z * z * g - x * x)
    return (x * x + y * y + z * z - 1) ** 2 * (1 + 2 * GOLDEN) - planes * 4


def _barth_decic(x: Number, y: Number, z: Number) -> Number:
    g = GOLDEN**4
    a, b, c = x * x, y * y, z * z
    quartic = a * a + b * b + c * c - (a * b + a * c + b * c) * 2
    planes = (a - b * g) * (b - c * g) * (c - a * g) * quartic * 8
    r = a + b + c
    return planes + (r - 1) ** 2 * (r - (2 - GOLDEN)) ** 2 * (3 + 5 * GOLDEN)


def _dupin(x: Number, y: Number, z: Number) -> Number:
    b, d, c = Fraction(9, 10), Fraction(3, 5), Fraction(436, 1000)
    r = x * x + y * y + z * z
    return (r + b * b - d * d) ** 2 - (x - c * d) ** 2 * 4 - y * y * (4 * b * b)


def _torus(major: Fraction, minor: Fraction) -> Callable[[Number, Number, Number], Number]:
    def function(x: Number, y: Number, z: Number) -> Number:
        around = x * x + y * y
        return (around + z * z + (major**2 - minor**2)) ** 2 - around * (4 * major**2)

    return function


def _quaste(x: Number, y: Number, z: Number) -> Number:
    a, b = x * x, y * y
    return (
        z**9 * 8
        - z**6 * (a + b) * 24
        + z**8 * 36
        + z**3 * (a * a + b * b) * 24
        - z**3 * a * b * 168
        - z**5 * (a + b) * 72
        + z**7 * 54
        - (a**3 + b**3) * 8
        - (a * a * b + a * b * b) * 24
        + z**2 * (a * a + b * b) * 36
        - z**2 * a * b * 252
        - z**4 * a * 54
        - z**4 * b * 108
        + z**6 * 27
        - z * a * b * 108
        + z * b * b * 54
        - z**3 * b * 54
        + b * b * 27
    )


_R2 = "(x^2 + y^2 + z^2)"
_S = AlgebraicSurface
SURFACES = {
    "sphere": _S(f"{_R2} - 1", lambda x, y, z: x * x + y * y + z * z - 1),
    "clebsch": _S(
        "81*(x^3+y^3+z^3) - 189*(x^2*y+x^2*z+y^2*x+y^2*z+z^2*x+z^2*y) + 54*x*y*z"
        " + 126*(x*y+x*z+y*z) - 9*(x^2+y^2+z^2) - 9*(x+y+z) + 1",
        _clebsch,
        1.0,
    ),
    "cayley": _S(
        f"{_R2} + 2*x*y*z - 1", lambda x, y, z: x * x + y * y + z * z + x * y * z * 2 - 1, 1.3
    ),
    "kummer": _S(
        "(3*m-1)/(3-m)*(1-z-x*w)*(1-z+x*w)*(1+z+y*w)*(1+z-y*w) - (x^2+y^2+z^2-m)^2", _kummer
    ),
    "barth_sextic": _S(
        f"({_R2}-1)^2*(1+2*g) - 4*(g^2*x^2-y^2)*(g^2*y^2-z^2)*(g^2*z^2-x^2)", _barth_sextic
    ),
    "barth_decic": _S(
        "8*(x^2-g^4*y^2)*(y^2-g^4*z^2)*(z^2-g^4*x^2)*(x^4+y^4+z^4-2*x^2*y^2-2*x^2*z^2-2*y^2*z^2)"
        f" + (3+5*g)*({_R2}-1)^2*({_R2}-(2-g))^2",
        _barth_decic,
        1.2,
    ),
    "dupin": _S(f"({_R2} + 0.81 - 0.36)^2 - 4*(x - 0.436*0.6)^2 - 4*0.81*y^2", _dupin, 2.0),
    "steiner": _S(
        "x^2*y^2 + y^2*z^2 + z^2*x^2 + x*y*z",
        lambda x, y, z: x * x * y * y + y * y * z * z + z * z * x * x + x * y * z,
        0.7,
    ),
    "heart": _S(
        "(x^2 + 9/4*y^2 + z^2 - 1)^3 - x^2*z^3 - 9/80*y^2*z^3",
        lambda x, y, z: (
            (x * x + y * y * Fraction(9, 4) + z * z - 1) ** 3
            - x * x * z**3
            - y * y * z**3 * Fraction(9, 80)
        ),
    ),
    "tangle": _S(
        "x^4-5*x^2 + y^4-5*y^2 + z^4-5*z^2 + 11.8",
        lambda x, y, z: x**4 + y**4 + z**4 - (x * x + y * y + z * z) * 5 + Fraction(59, 5),
        2.5,
    ),
    "chmutov_quartic": _S(
        "8*(x^4+y^4+z^4) - 8*(x^2+y^2+z^2) + 2",
        lambda x, y, z: (x**4 + y**4 + z**4) * 8 - (x * x + y * y + z * z) * 8 + 2,
        1.2,
    ),
    "chmutov_sextic": _S(
        "32*(x^6+y^6+z^6) - 48*(x^4+y^4+z^4) + 18*(x^2+y^2+z^2) - 3",
        lambda x, y, z: (
            (x**6 + y**6 + z**6) * 32 - (x**4 + y**4 + z**4) * 48 + (x * x + y * y + z * z) * 18 - 3
        ),
        1.2,
    ),
    "ding_dong": _S("x^2 + y^2 - (1-z)*z^2", lambda x, y, z: x * x + y * y - (1 - z) * z * z),
    "whitney": _S("x^2 - y^2*z", lambda x, y, z: x * x - y * y * z),
    "zitrus": _S(
        "x^2 + z^2 - (y+0.5)^3*(0.5-y)^3",
        lambda x, y, z: x * x + z * z - (y + Fraction(1, 2)) ** 3 * (Fraction(1, 2) - y) ** 3,
        0.6,
    ),
    "kolibri": _S("x^3 + x^2*z^2 - y^2", lambda x, y, z: x**3 + x * x * z * z - y * y),
    "helix": _S("6*x^2 - 2*x^4 - y^2*z^2", lambda x, y, z: x * x * 6 - x**4 * 2 - y * y * z * z, 2),
    "daisy": _S(
        "(x^2-y^3)^2 - (z^2-y^2)^3", lambda x, y, z: (x * x - y**3) ** 2 - (z * z - y * y) ** 3, 1.2
    ),
    "vis_a_vis": _S(
        "x^2 - x^3 + y^2 + y^4 + z^3 - z^4",
        lambda x, y, z: x * x - x**3 + y * y + y**4 + z**3 - z**4,
    ),
    "seepferdchen": _S(
        "(x^2-y^3)^2 - (x+y^2)*z^3", lambda x, y, z: (x * x - y**3) ** 2 - (x + y * y) * z**3, 1.2
    ),
    "xano": _S("x^4 + z^3 - y*z^2", lambda x, y, z: x**4 + z**3 - y * z * z),
    "tuelle": _S("y*z*(x^2+y-z)", lambda x, y, z: y * z * (x * x + y - z)),
    "limao": _S("x^2 - y^3*z^3", lambda x, y, z: x * x - y**3 * z**3),
    "calypso": _S("x^2 + y^2*z - z^2", lambda x, y, z: x * x + y * y * z - z * z),
    "dattel": _S("3*x^2 + 3*y^2 + z^2 - 1", lambda x, y, z: x * x * 3 + y * y * 3 + z * z - 1),
    "dromedar": _S("x^4 - 3*x^2 + y^2 + z^3", lambda x, y, z: x**4 - x * x * 3 + y * y + z**3, 2),
    "eistuete": _S(
        "(x^2+y^2)^3 - 4*x^2*y^2*(z^2+1)",
        lambda x, y, z: (x * x + y * y) ** 3 - x * x * y * y * 4 * (z * z + 1),
    ),
    "geisha": _S(
        "x^2*y*z + x^2*z^2 - y^3*z - y^3",
        lambda x, y, z: x * x * y * z + x * x * z * z - y**3 * z - y**3,
    ),
    "harlekin": _S(
        "x^3*z + 10*x^2*y + x*y^2 + y*z^2 - z^3",
        lambda x, y, z: x**3 * z + x * x * y * 10 + x * y * y + y * z * z - z**3,
    ),
    "herz": _S("y^2 + z^3 - z^4 - x^2*z^2", lambda x, y, z: y * y + z**3 - z**4 - x * x * z * z),
    "leopold": _S(
        "100*x^2*y^2*z^2 + 3*x^2 + 3*y^2 + z^2 - 1",
        lambda x, y, z: x * x * y * y * z * z * 100 + x * x * 3 + y * y * 3 + z * z - 1,
    ),
    "nepali": _S(
        "(x*y - z^3 - 1)^2 - (1 - x^2 - y^2)^3",
        lambda x, y, z: (x * y - z**3 - 1) ** 2 - (1 - x * x - y * y) ** 3,
    ),
    "octdong": _S("x^2 + y^2 + z^4 - z^2", lambda x, y, z: x * x + y * y + z**4 - z * z),
    "plop": _S("x^2 + (z+y^2)^3", lambda x, y, z: x * x + (z + y * y) ** 3),
    "polsterzipf": _S(
        "(x^3-1)^2 + (y^3-1)^2 + (z^3-1)^2 - 2",
        lambda x, y, z: (x**3 - 1) ** 2 + (y**3 - 1) ** 2 + (z**3 - 1) ** 2 - 2,
    ),
    "quaste": _S(
        "8*z^9 - 24*z^6*(x^2+y^2) + 36*z^8 + 24*z^3*(x^4+y^4) - 168*x^2*y^2*z^3 - 72*z^5*(x^2+y^2)"
        " + 54*z^7 - 8*x^6 - 24*x^4*y^2 - 24*x^2*y^4 - 8*y^6 + 36*z^2*(x^4+y^4) - 252*x^2*y^2*z^2"
        " - 54*x^2*z^4 - 108*y^2*z^4 + 27*z^6 - 108*x^2*y^2*z + 54*y^4*z - 54*y^2*z^3 + 27*y^4",
        _quaste,
    ),
    "sattel": _S("x^2 + y^2*z + z^3", lambda x, y, z: x * x + y * y * z + z**3),
    "schneeflocke": _S("x^3 + y^2*z^3 + y*z^4", lambda x, y, z: x**3 + y * y * z**3 + y * z**4),
    "solitude": _S(
        "x^2*y*z + x*y^2 + y^3 + y^3*z - x^2*z^2",
        lambda x, y, z: x * x * y * z + x * y * y + y**3 + y**3 * z - x * x * z * z,
    ),
    "stern": _S(
        f"400*(x^2*y^2 + y^2*z^2 + x^2*z^2) - (1 - {_R2})^3",
        lambda x, y, z: (
            (x * x * y * y + y * y * z * z + x * x * z * z) * 400 - (1 - x * x - y * y - z * z) ** 3
        ),
        1.2,
    ),
    "subway": _S("x^2*y^2 + (z^2-1)^3", lambda x, y, z: x * x * y * y + (z * z - 1) ** 3),
    "taube": _S(
        "256*z^3 - 128*x^2*z^2 + 16*x^4*z + 144*x*y^2*z - 4*x^3*y^2 - 27*y^4",
        lambda x, y, z: (
            z**3 * 256
            - x * x * z * z * 128
            + x**4 * z * 16
            + x * y * y * z * 144
            - x**3 * y * y * 4
            - y**4 * 27
        ),
    ),
    "tobel": _S("x^3*z + x^2 + y*z^3 + z^4", lambda x, y, z: x**3 * z + x * x + y * z**3 + z**4),
    "trichter": _S("x^2 + z^3 - y^2*z^2", lambda x, y, z: x * x + z**3 - y * y * z * z),
    "wigwam": _S("x^2 + y^2*z^3", lambda x, y, z: x * x + y * y * z**3),
    "windkanal": _S("x*y*z - x^2 + y^4 + z^4", lambda x, y, z: x * y * z - x * x + y**4 + z**4),
    "zeck": _S("x^2 + y^2 - z^3*(1-z)", lambda x, y, z: x * x + y * y - z**3 * (1 - z)),
    "columpius": _S(
        "x^3*y + x*z^3 + y^3*z + z^3 + 7*z^2 + 5*z",
        lambda x, y, z: x**3 * y + x * z**3 + y**3 * z + z**3 + z * z * 7 + z * 5,
    ),
    "sofa": _S("x^2 + y^3 + z^5", lambda x, y, z: x * x + y**3 + z**5),
    "distel": _S(
        "x^2 + y^2 + z^2 + 1000*(x^2+y^2)*(x^2+z^2)*(y^2+z^2) - 1",
        lambda x, y, z: (
            x * x + y * y + z * z + (x * x + y * y) * (x * x + z * z) * (y * y + z * z) * 1000 - 1
        ),
        1.1,
    ),
    "buggle": _S(
        "x^4*y^2 + y^4*x^2 - x^2*y^2 + z^6",
        lambda x, y, z: x**4 * y * y + y**4 * x * x - x * x * y * y + z**6,
    ),
    "diabolo": _S("x^2 - (y^2+z^2)^2", lambda x, y, z: x * x - (y * y + z * z) ** 2),
    "crixxi": _S(
        "(y^2+z^2-1)^2 + (x^2+y^2-1)^3",
        lambda x, y, z: (y * y + z * z - 1) ** 2 + (x * x + y * y - 1) ** 3,
    ),
}
PARAMETERS = {"g": float(GOLDEN), "w": float(ROOT_2), "m": 1.69}


def solid_of(name: str) -> dict[str, Any]:
    """The table of a surface's solid."""
    surface = SURFACES[name]
    used = {key: value for key, value in PARAMETERS.items() if name in _USES[key]}
    return {
        "kind": "implicit",
        "formula": surface.formula,
        "bounds": {"min": [-surface.reach] * 3, "max": [surface.reach] * 3},
        "color": [0.7, 0.3, 0.15],
        **({"parameters": used} if used else {}),
    }


_USES = {"g": ("barth_sextic", "barth_decic"), "w": ("kummer",), "m": ("kummer",)}


def torus_of(major: float, minor: float) -> tuple[dict[str, Any], AlgebraicSurface]:
    """The table of a torus, and its surface."""
    table = {"kind": "torus", "major": major, "minor": minor, "color": [0.7, 0.3, 0.15]}
    return table, AlgebraicSurface("", _torus(Fraction(major), Fraction(minor)), math.inf)
