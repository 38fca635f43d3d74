"""Several compute shaders run over one state that stays on the device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError, unwritten

# A prefix sum in three dispatches, and a filter that says how many workgroups come next.
TEXT = """
override STEP = 1u;
struct Args { x: u32, y: u32, z: u32, kept: atomic<u32> }
@group(0) @binding(0) var<storage, read_write> data: array<u32>;
@group(0) @binding(1) var<storage, read_write> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> args: Args;
@group(0) @binding(2) var<storage, read> asked: array<u32>;
@group(0) @binding(3) var picture: texture_storage_2d<r32uint, write>;
@group(1) @binding(0) var<uniform> limit: u32;
var<workgroup> row: array<u32, 64>;

@compute @workgroup_size(64) fn within(
  @builtin(workgroup_id) w: vec3<u32>, @builtin(local_invocation_index) i: u32
) {
  row[i] = data[w.x * 64u + i];
  for (var k = 1u; k < 64u; k *= 2u) {
    workgroupBarrier();
    var more = 0u;
    if (i >= k) { more = row[i - k]; }
    workgroupBarrier();
    row[i] += more;
  }
  data[w.x * 64u + i] = row[i];
  if (i == 63u) { sums[w.x] = row[i]; }
}
@compute @workgroup_size(1) fn across() {
  var total = 0u;
  for (var k = 0u; k < arrayLength(&sums); k++) {
    let own = sums[k];
    sums[k] = total;
    total += own;
  }
}
@compute @workgroup_size(64) fn spread(
  @builtin(workgroup_id) w: vec3<u32>, @builtin(global_invocation_id) id: vec3<u32>
) {
  data[id.x] += sums[w.x];
}
@compute @workgroup_size(1) fn ask() { args.x = limit; args.y = 1u; args.z = 1u; }
@compute @workgroup_size(64) fn raise_(@builtin(global_invocation_id) id: vec3<u32>) {
  data[id.x] += STEP;
}
@compute @workgroup_size(64) fn told(@builtin(global_invocation_id) id: vec3<u32>) {
  data[id.x] += asked[0];
}
@compute @workgroup_size(1) fn draw(@builtin(global_invocation_id) id: vec3<u32>) {
  textureStore(picture, id.xy, vec4<u32>(data[id.x + 2u * id.y]));
}
"""
COUNT = 8 * 64


def state(data: Any) -> dict[str, Any]:
    return {
        "data": data,
        "sums": unwritten(8, np.uint32),
        "args": (0, 0, 0, 0),
        "limit": 3,
        "picture": unwritten((2, 2), np.uint32),
    }


@pytest.fixture
def data(rng: np.random.Generator) -> Any:
    return rng.integers(0, 1000, COUNT, np.uint32)


def test_three_dispatches_over_one_buffer(wgsl: Kit, data: Any) -> None:
    program = wgsl.program(TEXT, state(data))
    program.dispatch("within", 8)
    wgsl.compare(program.read("sums"), data.reshape(8, 64).sum(axis=1))
    program.dispatch("across")
    program.dispatch("spread", 8)
    wgsl.compare(program.read("data"), np.cumsum(data))
    # What was given is as it was.
    assert (data < 1000).all()


def test_a_dispatch_too_few_is_found(wgsl: Kit, data: Any) -> None:
    program = wgsl.program(TEXT, state(data))
    program.dispatch("within", 8)
    program.dispatch("spread", 8)
    with pytest.raises(MismatchError) as caught:
        wgsl.compare(program.read("data"), np.cumsum(data))
    # What was never written is a large number.
    assert caught.value.census.failed == COUNT


def test_workgroups_from_a_buffer(wgsl: Kit, data: Any) -> None:
    program = wgsl.program(TEXT, state(data), constants={"STEP": 5})
    program.dispatch("ask")
    program.dispatch("raise_", indirect="args")
    expected = data + 5 * (np.arange(COUNT) < 3 * 64)
    wgsl.compare(program.read("data"), expected)
    assert program.read("args").tolist() == (3, 1, 1, 0)
    # The same buffer may be read by what it starts.
    asked = wgsl.program(TEXT, {"data": data, "asked": [9, 2, 1, 1]})
    asked.dispatch("told", indirect="asked", offset=4)
    wgsl.compare(asked.read("data"), data + 9 * (np.arange(COUNT) < 128))


def test_a_texture_stays_too(wgsl: Kit, data: Any) -> None:
    program = wgsl.program(TEXT, state(data))
    program.dispatch("raise_", 1)
    program.dispatch("draw", (2, 2))
    wgsl.compare(program.read("picture"), data[:4].reshape(2, 2) + 1)


def test_an_entry_point_may_use_some_of_the_bindings(wgsl: Kit) -> None:
    program = wgsl.program(TEXT, {"data": np.zeros(64, np.uint32)})
    for _ in range(10):
        program.dispatch("raise_")
    assert (program.read("data") == 10).all()


def test_workgroup_memory_begins_as_zeros_in_every_dispatch(wgsl: Kit) -> None:
    text = """
var<workgroup> seen: atomic<u32>;
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(64) fn main(@builtin(workgroup_id) w: vec3<u32>) {
  atomicAdd(&seen, 1u);
  workgroupBarrier();
  out[w.x] = atomicLoad(&seen);
}"""
    program = wgsl.program(text, {"out": unwritten(16, np.uint32)})
    for _ in range(3):
        program.dispatch("main", 16)
        wgsl.compare(program.read("out"), 64)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.program(TEXT, {"date": [1]}),
         "WGSL: there is no resource 'date'; there is data, sums, args, asked, picture, limit"),
        (lambda k: k.program(TEXT, {"data": [1.5]}),
         "bindings: data: float64 where uint32 is wanted"),
        (lambda k: k.program(TEXT, [1]), "bindings: list is not a mapping"),
        (lambda k: k.program(TEXT, {"data": [1]}).dispatch("spread"),
         "WGSL: spread uses sums, which bindings do not give"),
        (lambda k: k.program(TEXT, {"data": [1]}).dispatch("spred"),
         "WGSL: there is no function 'spred'; there are within, across, spread, ask, raise_, told, "
         "draw"),
        (lambda k: k.program(TEXT, {"data": [1]}).dispatch("raise_", 1.5),
         "workgroups: 1.5 is not 1 to 3 whole numbers of 0 to 65535"),
        (lambda k: k.program(TEXT, {"data": [1]}).read("sums"),
         "read: nothing that can be written to is called 'sums'; there is data"),
        (lambda k: k.program(TEXT, {"data": [1], "limit": 1}).read("limit"),
         "read: nothing that can be written to is called 'limit'; there is data"),
        (lambda k: k.program(TEXT, {"data": [1], "limit": 1}).dispatch("raise_", indirect="limit"),
         "indirect: 'limit' is no storage buffer of the program"),
        (lambda k: k.program(TEXT, {"data": [1]}).dispatch("raise_", indirect="args"),
         "indirect: 'args' is no storage buffer of the program"),
        (lambda k: k.program(TEXT, {"data": [1, 1, 1]}).dispatch("raise_", indirect="data"),
         "indirect: raise_ may write to data, which holds how many workgroups run"),
        (lambda k: k.program(TEXT, {"data": [1], "asked": [1, 1, 1]}).dispatch(
            "told", indirect="asked", offset=4),
         "offset: 4 is not a multiple of 4 of 0 to 0"),
        (lambda k: k.program(TEXT, {"data": [1]}, constants={"STEPS": 1}),
         "WGSL: there is no override 'STEPS'; there are STEP"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    wgsl: Kit, call: Callable[[Kit], object], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == message
    assert not ran
