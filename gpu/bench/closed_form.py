"""The yardstick: the product's own pipeline with a closed form in place of the halvings."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from unittest import mock

from halfstep import source

# The first crossing from + to - of a v² + g v + c, in the cell of the halvings that holds it.
_ROOT = """\
fn halve(root: Root, steps: u32) -> i4 {
  let discriminant = root.g * root.g - 4.0 * (root.a * root.c);
  let v = (root.c + root.c) / (sqrt(max(discriminant, f4(0.0))) - root.g);
  let cells = i32(1u << steps);
  let cell = i4(floor(v * f32(cells >> 1u))) * 2 + 1;
  let position = clamp(cell, i4(1 - cells), i4(cells - 1));
  return select(position, -position, root.flipped);
}
"""
_HALVE = re.compile(r"^fn halve\([\s\S]*?^\}\n", re.MULTILINE)


def closed_form() -> AbstractContextManager[object]:
    """Let shaders that are compiled meanwhile find roots by division and square root.

    The positions are those of the halvings, so the accuracy is the same, and all else is too.
    """
    return mock.patch("halfstep.run_gpu.compose", compose)


def compose(needs: source.Needs) -> str:
    """As `source.compose`; for at most 16 halvings in float32."""
    text, count = _HALVE.subn(_ROOT, source.compose(needs))
    assert count == 1
    return text
