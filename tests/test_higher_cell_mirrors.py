"""Cells of tori and polynomials that mirror and are mirrored: the oracle, device and twin."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.source import compose
from tests.cell_mirrors import count
from tests.cell_mirrors import reflected as far_away
from tests.different import differing
from tests.mirrored import counted, mirroring
from tests.test_higher_veils import groove
from tests.veil_sweeps import random_cells

SMALL = (64, 48)


def test_a_groove_mirrors_and_is_mirrored() -> None:
    total = counted(count, [mirroring(groove(), 3)], SMALL)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 200


def test_a_bundled_scene() -> None:
    total = counted(count, [mirroring(halfstep.load("tokamak"), 2)], (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.hits > 20


def test_random_cells(rng: np.random.Generator) -> None:
    scenes = [mirroring(random_cells(rng, "far", bent=True), 2) for _ in range(2)]
    total = counted(count, scenes, (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.open <= 0.1 * total.hits + 4
    assert total.hits > 40


@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_what_is_mirrored_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    total = counted(count, [far_away(rng, distance, bent=True) for _ in range(2)], (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 40


# ------------------------------------------------------------------------------ device and twin


def chrome() -> Scene:
    """The block with a groove and the hoop over it mirror each other; there are no lights."""
    return with_overrides(mirroring(groove(), 2), shadows=False)


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    assert differing(chrome(), ("color", "error")) == []


# An output, a word of the kernel, and what a slip would make of it.
FAULTS = [
    ("color", "asked_0, on_f, flush)", "asked_0, flush, flush)"),
    ("color", "either(here, bend_at(caster, at_0), caught_0.slope)", "caught_0.slope"),
    ("error", "keeps_side(spot, pairs, into) | is_shown", "b4(false)"),
]


@pytest.mark.parametrize(("output", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    output: str, old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts, outputs = plant(old, new), {"color", output}
    assert output in differing(chrome(), outputs, adapter=adapter.summary.index)
    assert any(old in text for text in texts)


def test_mirrors_of_cells_of_quadrics_hold_no_code_of_them() -> None:
    scene = mirroring(with_overrides(halfstep.load("die"), size=SMALL))
    text = compose(needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"})))
    assert "meet_copy(" in text
    for word in ("Course", "all_crossed", "Caster", "known_0"):
        assert word not in text
