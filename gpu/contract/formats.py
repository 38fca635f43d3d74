"""Number formats, and everything that differs between them.

The coefficients of a form are those of polynomials in the pixel offset. Its values are those of the
polynomials at a pixel, on which the joint logic and the halvings work. A stage that depends on the
format has one file for each, told apart by the ending of the name.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from halfstep.contract.choices import NumberFormat

# With more steps than this, float32 uses integer coefficients and rounds each value only once.
FLOAT_STEPS = 16
# Fraction bits of integer coefficients.
FRACTION_BITS = 60


@dataclass(frozen=True)
class Format:
    """The types of a number format's numbers, and the stages that work on them."""

    name: NumberFormat
    coefficient: type[np.float32] | type[np.float64] | type[np.int64]
    value: type[np.float32] | type[np.float64] | type[np.int32]
    one: int  # the value that stands for u = 1
    useful_steps: int  # more halvings gain nothing: rounding is as large as the cell
    arithmetic: str  # this and the next four are stage files
    polynomial: str
    forms: str
    halve: str
    beam: str
    run: str  # the roundings of the halvings, by their name in certify.wgsl
    article_run: str  # likewise for the article's sequences

    @property
    def integer(self) -> bool:
        """Whether coefficients are 64-bit integers, which not every device has."""
        return self.coefficient is np.int64

    @property
    def length(self) -> type[np.float32] | type[np.int64]:
        """The type of the record fields ``Length``: parts of positions on the grid of the world."""
        return np.int64 if self.value is np.int32 else np.float32

    @property
    def stages(self) -> tuple[str, ...]:
        """The stage files of the format."""
        return self.arithmetic, self.polynomial, self.forms, self.halve, self.beam


FLOAT32 = Format(
    name="float32",
    coefficient=np.float32,
    value=np.float32,
    one=1,
    useful_steps=22,
    arithmetic="arithmetic",
    polynomial="polynomial",
    forms="forms",
    halve="halve",
    beam="beam",
    run="DIRECT",
    article_run="DIRECT",
)
FLOAT32_EXACT = replace(
    FLOAT32,
    coefficient=np.int64,
    polynomial="polynomial_exact",
    forms="forms_exact",
    halve="halve_incremental",
    run="INCREMENTAL",
)
FIXED32 = Format(
    name="fixed32",
    coefficient=np.int64,
    value=np.int32,
    one=1 << 30,
    useful_steps=26,
    arithmetic="arithmetic_fixed",
    polynomial="polynomial_exact",
    forms="forms_fixed",
    halve="halve_fixed",
    beam="beam_fixed",
    run="INTEGER",
    article_run="INTEGER",
)
