"""Twin of ``conveyor.wgsl``: n halvings of the roots of a block."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol

from halfstep.twin.lanes import I32
from halfstep.twin.root import Root
from halfstep.twin.sight import Sight


class Halve(Protocol):
    """The halving of one root."""

    def begun(self, root: Root) -> Any:
        """The search for a root before its first halving."""

    def halved(self, old: Any, k: int) -> Any:
        """The search after its halving number k, from 0."""

    def reached(self, search: Any, root: Root, steps: int) -> I32:
        """Position of the root in last steps."""


def conveyor(halve: Halve, root: Root, leaving: Root, steps: int, facts: Collection[str]) -> Sight:
    """The positions of roots, and with the fact ``exit`` of the exits."""
    search = halve.begun(root)
    exit_search = halve.begun(leaving) if "exit" in facts else search
    for k in range(steps):
        search = halve.halved(search, k)
        if "exit" in facts:
            exit_search = halve.halved(exit_search, k)
    position = halve.reached(search, root, steps)
    if "exit" not in facts:
        return Sight(root.hit, root.surface, position, root.hit, position)
    exit_position = halve.reached(exit_search, leaving, steps)
    return Sight(root.hit, root.surface, position, leaving.hit, exit_position)
