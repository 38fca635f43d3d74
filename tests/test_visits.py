"""Every visit alone: the device's bits are the twin's, and a planted fault is seen.

A visit is run as the shader of its class has it, on solids of real frames.
"""

from __future__ import annotations

import functools
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.contract.classes import REGIONS, Class
from halfstep.contract.formats import FIXED32, FLOAT32, Format
from halfstep.contract.stages import FACTS, VISITS
from halfstep.host.prepare import prepare
from halfstep.scene import load, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from halfstep.testing import Kit, MismatchError
from halfstep.testing.module import Module
from halfstep.testing.types import dtype_of
from halfstep.twin.chosen import chosen_for, module
from halfstep.twin.sight import Seen
from tests.bundled import drawn_by_all

Array = NDArray[Any]

FORMATS = (FLOAT32, FIXED32)
SIZE = (96, 72)
STEPS = 11
# Solids of a class, and rows of four pixels that try each.
MOST_SOLIDS = 12
ROWS = 192

# Visits that are run alone: the others read buffers of their own, and are tried in whole frames.
TOGETHER = (*REGIONS, Class.POLYNOMIAL, Class.FORMULA)
ALONE = [key for key in VISITS if key[1] not in TOGETHER]

# Class by method -> a word of its visit, and what a slip would make of it.
FAULTS = [
    ("visible", Class.ELLIPSOID, "ellipsoid_exit(form)", "ellipsoid_entry(form)"),
    ("visible", Class.ELLIPSOID, "slope_at(solid, x_0, y", "slope_at(solid, x_0, y + 1"),
    ("visible", Class.QUADRIC, "!outside", "outside"),
    ("visible", Class.QUADRIC, "i32(k) + 1", "i32(k) + 2"),
    ("visible", Class.QUADRIC, "sight_0.surface == i4(0)", "sight_0.surface == i4(1)"),
    (
        "visible",
        Class.QUADRIC_INSIDE,
        "normal_out_0, normal_in_0);\n  }",
        "normal_in_0, normal_out_0);\n  }",
    ),
    ("visible", Class.QUADRIC_INSIDE, "choose(inside", "choose(!inside"),
    ("visible", Class.QUADRIC_INSIDE, "b4(eye_inside(solid)) | !outside", "b4(eye_inside(solid))"),
    ("visible", Class.POLYHEDRON, "piece_0.id_in == i4(number)", "piece_0.id_out == i4(number)"),
    ("visible", Class.POLYHEDRON, "solid.plane_start + k", "solid.plane_start"),
    ("visible", Class.POLYHEDRON_INSIDE, "if eye_inside(solid)", "if !eye_inside(solid)"),
    ("visible", Class.PATCH, "var k = 1u", "var k = 2u"),
    ("visible", Class.PATCH, "leaving_0 = root_0", "leaving_0 = leaving_0"),
    ("visible", Class.PATCH, "turned(patch_0.away", "turned(!patch_0.away"),
    ("article", Class.QUADRIC, "form.a - form.g", "form.a + form.g"),
    ("article", Class.QUADRIC, "== found.inside", "!= found.inside"),
    ("article", Class.POLYHEDRON, "found.surface == i4(i32(k) + 1)", "found.surface == i4(i32(k))"),
    ("article", Class.POLYHEDRON, "found.exit_position", "found.position"),
    ("article", Class.PATCH, "first = 1u;", "first = 0u;"),
]


def needs_for(method: str, klass: Class, number_format: Format) -> Needs:
    """A shader of one class with all outputs."""
    return Needs(
        classes=(klass,),
        outputs=frozenset({"surface", "key", "exit", "normal", "color", "error", "image"}),
        method=method,
        format=number_format,
        lights=1,
        point_lights=True,
        shininess_bits=4,
        short_keys=False,
    )


def shader(needs: Needs) -> str:
    """The shader with a function that visits a solid and returns what it found."""
    [klass] = needs.classes
    return f"""{compose(needs)}
struct Seen {{
  sight: Sight,
  slope: Vector,
  certificate: Certificate,
}}

fn visited(solid: Solid, x: i4, y: i32) -> Seen {{
  x_0 = x;
  visit_{klass.name.lower()}(solid, y);
  return Seen(sight_0, slope_0, certificate_0);
}}
"""


@functools.cache
def solids_of(method: str, klass: Class, number_format: Format) -> tuple[Array, Array, Array]:
    """Solids of a class from bundled scenes, all half-spaces there, and half sizes in pixels."""
    solids: list[Any] = []
    half_spaces: list[Any] = []
    sizes: list[tuple[int, int]] = []
    for name in sorted(set(drawn_by_all()) - {"crowd"}):
        scene = with_overrides(
            load(name),
            size=SIZE,
            steps=STEPS,
            method=method,
            number_format=number_format.name,
        )
        packed = prepare(scene)
        if packed.regions is not None:
            continue  # cells are tried in whole frames, by tests/test_regions.py
        # A few of a scene, so that there are many scenes.
        for row in np.flatnonzero(packed.classes == klass)[:2]:
            solid = packed.solids[row].copy()
            first, count = int(solid["plane_start"]), int(solid["plane_count"])
            solid["plane_start"] = len(half_spaces)
            half_spaces.extend(packed.half_spaces[first : first + count])
            solids.append(solid)
            i0, i1, j0, j1 = packed.setup.rectangle[packed.order[row]]
            sizes.append(((i1 - i0) // 2 + 2, (j1 - j0) // 2 + 2))
    kept = slice(0, MOST_SOLIDS)
    none = np.zeros(0, packed.half_spaces.dtype)
    planes = np.array(half_spaces, none.dtype) if half_spaces else np.zeros(1, none.dtype)
    return np.array(solids[kept], packed.solids.dtype), planes, np.array(sizes[kept])


def judged(
    kit: Kit,
    rng: np.random.Generator,
    method: str,
    klass: Class,
    number_format: Format,
    fault: tuple[str, str] | None = None,
) -> Array:
    """Compare a visit with its twin; what the twin sees."""
    solids, half_spaces, sizes = solids_of(method, klass, number_format)
    needs = needs_for(method, klass, number_format)
    text = shader(needs)
    if fault is not None:
        body = re.search(rf"^fn visit_{klass.name.lower()}\([\s\S]*?^\}}", text, re.MULTILINE)
        assert body is not None
        assert fault[0] in body[0]
        text = text.replace(body[0], body[0].replace(*fault))
    own = np.repeat(np.arange(len(solids)), ROWS)
    reach = sizes[own]
    x = rng.integers(-reach[:, :1], reach[:, :1] + 1, (len(own), 4)).astype(np.int32)
    y = rng.integers(-reach[:, 1], reach[:, 1] + 1, len(own)).astype(np.int32)
    expected = np.zeros(len(own), dtype_of(Module("visits", text).struct("Seen")))
    visit = VISITS[method, klass]
    run = getattr(module(visit.file), visit.file)
    chosen, facts = chosen_for(number_format, method), needs.facts | visit.facts
    for k, solid in enumerate(solids):
        rows = slice(k * ROWS, (k + 1) * ROWS)
        seen: Seen = run(solid, half_spaces, x[rows], y[rows, None], chosen, facts)
        for name in ("sight", "slope", "certificate"):
            part = getattr(seen, name)
            for member, values in part._asdict().items():
                expected[name][member][rows] = values
    used = "half_spaces" in Module("visits", text).reached("visited")
    kit.check(
        text,
        "visited",
        lambda *_: expected,
        {"solid": solids[own], "x": x, "y": y},
        bindings={"half_spaces": half_spaces} if used else None,
    )
    return expected


@pytest.mark.parametrize("number_format", FORMATS, ids=lambda form: form.name)
@pytest.mark.parametrize(("method", "klass"), ALONE)
def test_the_device_gives_the_bits_of_the_twin(
    method: str, klass: Class, number_format: Format, wgsl: Kit, rng: np.random.Generator
) -> None:
    expected = judged(wgsl, rng, method, klass, number_format)
    hit = expected["sight"]["hit"]
    assert 0.1 < hit.mean() < 0.9
    assert len(np.unique(expected["sight"]["position"][hit])) > 100
    assert len(np.unique(expected["slope"]["x"][hit])) > 1
    assert expected["certificate"]["sure"].mean() > 0.5


@pytest.mark.parametrize(("method", "klass", "old", "new"), FAULTS)
def test_a_fault_is_seen(
    method: str, klass: Class, old: str, new: str, wgsl: Kit, rng: np.random.Generator
) -> None:
    with pytest.raises(MismatchError):
        judged(wgsl, rng, method, klass, FLOAT32, (old, new))


def test_every_visit_has_a_planted_fault() -> None:
    assert {(method, klass) for method, klass, _, _ in FAULTS} == set(ALONE)


def test_visits_know_the_facts_that_they_state() -> None:
    assert {fact for visit in VISITS.values() for fact in visit.facts} <= set(FACTS)
