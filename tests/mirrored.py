"""What tests and sweeps of mirrors share: scenes that mirror, and counts of their frames."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from halfstep.device.adapters import Adapter
from halfstep.scene import Scene
from tests.different import differing
from tests.shadow_sweeps import Count

Size = tuple[int, int]
# Adds what a frame of a scene shows at a size.
Counting = Callable[[Count, Scene, Size], None]

MIRROR = {"name": "mirror", "color": [0.8, 0.8, 0.8], "reflection": 0.9}


def mirroring(scene: Scene, bounces: int = 1) -> Scene:
    """The scene, all solids, cells and parts of which are mirrors."""
    tables = scene.model_dump(by_alias=True, exclude_none=True)

    def shine(table: dict[str, Any]) -> None:
        things = [*table.get("solid", ()), *table.get("part", ()), *table.get("cell", ())]
        for thing in things:
            is_colored = thing.pop("color", None) is not None
            if is_colored or "material" in thing:
                thing["material"] = "mirror"
        for group in table.get("group", ()):
            shine(group)

    shine(tables)
    image = {**tables["image"], "bounces": bounces}
    return Scene.from_dict({**tables, "image": image, "material": [MIRROR]})


def below(wire: dict[str, Any], chrome: dict[str, Any]) -> Scene:
    """A floor of ``chrome``, of which a camera sees a spot that mirrors the way past a wire."""
    floor = {"kind": "plane", "bounds": {"min": [-3, -3, -1], "max": [3, 3, 1]}}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -4, 2], "look_at": [0.5, -2, 0], "fov_degrees": 0.2},
            "material": [chrome],
            "solid": [{**floor, "material": chrome["name"]}, wire],
        }
    )


def counted(count: Counting, scenes: list[Scene], size: Size, what: str = "frames") -> Count:
    """Counts of frames of the twin, which are told, too."""
    total = Count()
    for scene in scenes:
        count(total, scene, size)
    sys.stdout.write(f"{what}: {total}\n")
    sys.stdout.flush()
    return total


class Sweep:
    """Counts of many frames, and how many pixels of all of them are wrong."""

    def __init__(self, count: Counting, size: Size) -> None:
        """``size``: of the frames, where nothing else is said."""
        self._count, self._size = count, size
        self.wrong = 0

    def tell(self, what: str, scenes: list[Scene], size: Size | None = None) -> None:
        """Count frames and tell what they are."""
        self.wrong += counted(self._count, scenes, size or self._size, what).wrong


def assert_slip_is_seen(
    scene: Scene, old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    """``new`` for ``old`` in the kernels changes what the device shows of a scene."""
    texts = plant(old, new)
    assert differing(scene, ("color", "error"), adapter=adapter.summary.index)
    assert any(old in text for text in texts)
