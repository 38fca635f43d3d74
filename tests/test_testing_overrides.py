"""Overrides are given values by name; those without one are named before anything runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError

TEXT = """
override GAIN: f32;
override TWICE = 2.0 * GAIN;
override LIFT = 3.0;
override COUNT = 4;
@id(7) override SIZE: u32 = 8u;
override LOUD: bool = false;
override LAST = SIZE - 1u;
var<workgroup> row: array<f32, SIZE>;
@group(0) @binding(0) var<storage, read_write> d: array<f32>;
fn plain(x: f32) -> f32 { return x; }
fn scaled(x: f32) -> f32 {
  var y = x * TWICE + LIFT;
  for (var k = 1; k < COUNT; k++) { y += 1.0; }
  return select(y, -y, LOUD);
}
@compute @workgroup_size(SIZE) fn reversed(@builtin(local_invocation_index) i: u32) {
  row[i] = d[i];
  workgroupBarrier();
  d[i] = row[LAST - i];
}
"""
X = np.arange(9, dtype=np.float32)


@pytest.mark.parametrize(
    ("constants", "expected"),
    [
        ({"GAIN": 1}, 2 * X + 6),
        ({"GAIN": 0.5, "LIFT": 1.5}, X + 4.5),
        ({"GAIN": np.float32(2), "COUNT": 1, "LOUD": True}, -(4 * X + 3)),
        ({"GAIN": 0.1}, (2 * np.float32(0.1) * X + 3) + 3),
    ],
)
def test_a_function_uses_the_values(wgsl: Kit, constants: dict[str, Any], expected: Any) -> None:
    wgsl.check(TEXT, "scaled", lambda _: expected, {"x": X}, constants=constants, ulp=1)


def test_a_kernel_uses_the_values(wgsl: Kit) -> None:
    for size in (8, 4, 1):
        found = wgsl.kernel(TEXT, "reversed", {"d": X}, constants={"SIZE": size})
        wgsl.compare(found["d"], np.concatenate([X[:size][::-1], X[size:]]))


def test_a_value_that_is_not_the_one_is_found(wgsl: Kit) -> None:
    with pytest.raises(MismatchError) as caught:
        wgsl.check(TEXT, "scaled", lambda x: 2 * x + 6, {"x": X}, constants={"GAIN": 1.5})
    assert [row.index for row in caught.value.census.first] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(
    ("function", "constants", "message"),
    [
        ("scaled", {}, "WGSL: scaled uses the override GAIN, which has no value"),
        ("scaled", {"LIFT": 1}, "WGSL: scaled uses the override GAIN, which has no value"),
        ("plain", {"gain": 1},
         "WGSL: there is no override 'gain'; there are GAIN, TWICE, LIFT, COUNT, SIZE, LOUD, LAST"),
        ("plain", {"SIZE": -1}, "constants: SIZE: uint32 does not hold the int64 -1; convert it "
         "first"),
        ("plain", {"SIZE": 2.5}, "constants: SIZE: float64 where uint32 is wanted"),
        ("plain", {"COUNT": 1.5}, "constants: COUNT: float64 where int32 is wanted"),
        ("plain", {"LOUD": 1}, "constants: LOUD: int64 where bool is wanted"),
        ("plain", {"LIFT": True}, "constants: LIFT: bool where float32 is wanted"),
        ("plain", {"GAIN": [1, 2]}, "constants: GAIN: shape (2,), not a number"),
        ("plain", {"GAIN": 1e39}, "constants: GAIN: float32 does not hold the float64 1e+39; "
         "convert it first"),
        ("plain", [2], "constants: list is not a mapping"),
    ],
)  # fmt: skip
def test_a_value_that_does_not_fit_is_named(
    wgsl: Kit, function: str, constants: Any, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        wgsl.run(TEXT, function, {"x": X}, constants=constants)
    assert str(caught.value) == message
    assert not ran
