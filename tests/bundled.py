"""Bundled scenes by what can draw them."""

from __future__ import annotations

import functools

from halfstep.scene import bundled_scenes, load


@functools.cache
def drawn_by_all() -> tuple[str, ...]:
    """Bundled scenes that every number format and method can draw: no torus, no formula."""
    return tuple(name for name in bundled_scenes() if not load(name).has_algebraic)


def drawn_by_the_article() -> list[str]:
    """Scenes of `drawn_by_all` in which the method `article` differs; it draws cells the same."""
    return [name for name in drawn_by_all() if load(name).solids]
