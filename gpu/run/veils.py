"""Frames whose invocations cannot try all veils of lights within the rounds of loops granted.

The shader counts the rounds that it takes for veils, and for cells in mirrors. An invocation that
has too few tries no more of them, and says so in the output ``unfinished``. Then the frame is
rendered again and again, each time with some of the veils, and what those before hide stays in the
frame buffer, also from the points that mirrors show. What hides a light from a point does so
whatever else is tried, so the bits do not depend on the parts. The last rendering has all bits, and
so it has the colours. Doubts are joined here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from halfstep.contract.arrays import Planes
from halfstep.contract.veils import PackedVeils
from halfstep.errors import DeviceError
from halfstep.host.pack import Packed
from halfstep.shader.needs import Needs

# The output that is not 0 where an invocation did not try all veils, or cells in mirrors.
UNFINISHED = "unfinished"
# The outputs that parts of a frame leave to the next one; neighbours in the frame buffer.
CONTINUED = frozenset({"shadow", "mirrored"})
# Planes, and the device time in ms if measured.
Drawn = tuple[Planes, float | None]


def draw_all(
    packed: Packed,
    needs: Needs,
    draw: Callable[[Packed, Needs, bool], Drawn],
    refused: str,
) -> Drawn:
    """Render a frame with all of its veils, at once or in parts.

    Args:
        packed: the frame's records, with veils.
        needs: the needs of a shader that counts rounds.
        draw: renders a frame with some of the veils; the bool tells to empty the output
            `CONTINUED` in the frame buffer before.
        refused: what to say if the driver grants too few rounds for one veil, or for mirrors.

    Raises:
        DeviceError: it does.
    """
    drawn = draw(packed, needs, False)
    if _is_finished(drawn):
        return drawn
    if packed.veils is None:
        raise DeviceError(refused)
    kept = CONTINUED if "mirrors" in needs.facts else CONTINUED - {"mirrored"}
    in_parts = replace(needs, outputs=needs.outputs | kept, continued=True)
    times, waiting = [drawn[1]], halves(0, len(packed.veils.records))
    is_first = True
    doubt = drawn[0].get("doubt")
    while waiting:
        first, end = waiting.pop()
        part = replace(packed, veils=only(packed.veils, first, end))
        drawn = draw(part, in_parts, is_first)
        times.append(drawn[1])
        is_first = False
        if doubt is not None:
            # What one part is not certain of is uncertain, whatever the others say.
            doubt = drawn[0]["doubt"] = np.minimum(doubt, drawn[0]["doubt"])
        if _is_finished(drawn):
            continue
        if end - first == 1:
            raise DeviceError(refused)
        waiting += halves(first, end)
    known = [time for time in times if time is not None]
    return drawn[0], sum(known) if len(known) == len(times) else None


def _is_finished(drawn: Drawn) -> bool:
    """Whether all invocations tried all veils; takes the output that tells from the planes."""
    return not drawn[0].pop(UNFINISHED).any()


def halves(first: int, end: int) -> list[tuple[int, int]]:
    """The halves of a range of veils, the last one first; one veil has no halves."""
    middle = (first + end) // 2
    return [(begin, last) for begin, last in ((middle, end), (first, middle)) if begin < last]


def only(veils: PackedVeils, first: int, end: int) -> PackedVeils:
    """The veils from ``first`` to ``end``, of whichever lights they are."""
    views = veils.views.copy()
    for name in ("first", "end"):
        views[name] = np.clip(views[name], first, end)
    return replace(veils, views=views)
