"""Twin of ``lines.wgsl``: the half-spaces of a solid along the rays."""

from __future__ import annotations

from collections.abc import Sequence

from halfstep.twin.piece import Line


def line_of(lines: Sequence[Line], j: int) -> Line:
    """Half-space number j, from 0."""
    return lines[j]
