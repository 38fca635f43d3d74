"""The yardstick: the product's own pipeline with a closed form in place of the halvings."""

from __future__ import annotations

from contextlib import AbstractContextManager
from unittest import mock

from halfstep.shader import visits
from halfstep.shader.needs import Needs

# The first crossing from + to - of a v² + g v + c, in the cell of the halvings that holds it.
_ROOT = """\
    let discriminant_ROOT_NTH = ROOT_NTH.g * ROOT_NTH.g - 4.0 * (ROOT_NTH.a * ROOT_NTH.c);
    let distance_ROOT_NTH = sqrt(max(discriminant_ROOT_NTH, f4(0.0))) - ROOT_NTH.g;
    let v_ROOT_NTH = (ROOT_NTH.c + ROOT_NTH.c) / distance_ROOT_NTH;
    let cell_ROOT_NTH = i4(floor(v_ROOT_NTH * f32(1u << (solid.steps - 1u)))) * 2 + 1;
    let last_ROOT_NTH = i32(1u << solid.steps) - 1;
    let inside_ROOT_NTH = clamp(cell_ROOT_NTH, i4(-last_ROOT_NTH), i4(last_ROOT_NTH));
    let ROOT_position_NTH = select(inside_ROOT_NTH, -inside_ROOT_NTH, ROOT_NTH.flipped);
"""


def closed_form() -> AbstractContextManager[object]:
    """Let shaders that are compiled meanwhile find roots by division and square root.

    The positions are those of the halvings, so the accuracy is the same, and all else is too. For
    at most 16 halvings in float32.
    """
    return mock.patch("halfstep.shader.visits.conveyor", conveyor)


def conveyor(needs: Needs, roots: tuple[str, ...]) -> str:
    """As `visits.conveyor`, without its loop."""
    return visits.per_root(needs, roots, _ROOT)
