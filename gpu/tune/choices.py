"""The settings that `tune` tries with a scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any

from halfstep.contract.choices import METHODS, NUMBER_FORMATS
from halfstep.scene import Scene, with_overrides
from halfstep.scene.limits import algebraic_faults

STEPS = range(4, 25)


class Choices:
    """The settings to try with a scene; None for all that it can be drawn with."""

    def __init__(
        self,
        scene: Scene,
        methods: Sequence[str] | None,
        formats: Sequence[str] | None,
        steps: Iterable[int] | None,
    ) -> None:
        """``scene`` with the options of `tune`."""
        self._scene = scene
        self._free = {
            "method": methods is None,
            "number_format": formats is None,
            "steps": steps is None,
        }
        methods = METHODS if methods is None else methods
        formats = NUMBER_FORMATS if formats is None else formats
        self._steps = sorted(set(STEPS if steps is None else steps))
        self._pairs = [
            {"method": method, "number_format": number_format}
            for method, number_format in product(dict.fromkeys(methods), dict.fromkeys(formats))
        ]

    def automatic(self) -> list[Scene]:
        """Every method with every number format, and the steps that `render` chooses."""
        return self._changed(self._pairs)

    def settings(self) -> list[Scene]:
        """All of these with all numbers of steps."""
        return self._changed([pair | {"steps": n} for pair in self._pairs for n in self._steps])

    def _changed(self, changes: Sequence[dict[str, Any]]) -> list[Scene]:
        scene = self._scene
        kept = []
        for change in changes:
            accuracy = scene.accuracy.model_copy(update=change)
            faults = algebraic_faults(scene, scene.solids, accuracy)
            if not any(self._free[str(loc[-1])] for loc, _ in faults):
                kept.append(with_overrides(scene, **change))
        return kept
