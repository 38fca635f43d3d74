"""Loops that a driver cuts short: told, and never a verdict; what only comes near is judged."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pytest

from halfstep.device import probe
from halfstep.errors import DeviceError
from halfstep.testing.kit import Kit
from halfstep.testing.loops import calls, has_loop
from halfstep.testing.module import Module

COUNT = """
fn f(n: u32) -> u32 {
  var c = 0u;
  loop { if (c >= n) { break; } c += 1u + (n >> 31u); }
  return c;
}
"""
# Two loops, neither of them long: what they take together counts.
TWO = """
fn f(n: u32, m: u32) -> vec2<u32> {
  var h = 0u;
  for (var i = 0u; i < n; i++) { h = h * 1664525u + 1u; }
  var c = 0u;
  for (var i = 0u; i < m; i++) { h = h * 1664525u + 1u; c += 1u; }
  return vec2(c, h);
}
"""
SUM = """
@group(0) @binding(0) var<storage, read> x: array<u32>;
@group(0) @binding(1) var<storage, read_write> total: u32;

@compute @workgroup_size(1)
fn main() {
  var s = 0u;
  for (var i = 0u; i < arrayLength(&x); i++) { s += x[i]; }
  total = s;
  if s > 10u { return; }
  total += 1u;
}
"""
MESSAGE = r"f used up the 65,535 rounds after which the driver of .* ends all loops"


@pytest.fixture
def limited(wgsl: Kit) -> Kit:
    if probe.loop_limit(wgsl._compute) != 65_535:
        pytest.skip("this driver lets loops run")
    return wgsl


def test_a_loop_within_the_limit_is_judged(wgsl: Kit) -> None:
    n = np.array([0, 1, 2, 1000, 65_000], np.uint32)
    wgsl.check(COUNT, "f", lambda n: n, {"n": n})
    found = wgsl.kernel(SUM, "main", {"x": np.ones(60_000, np.uint32), "total": 0})
    assert found == {"total": 60_000}
    assert wgsl.kernel(SUM, "main", {"x": np.ones(9, np.uint32), "total": 0}) == {"total": 10}


@pytest.mark.parametrize("n", [65_536, 70_000, 1 << 20])
def test_a_loop_beyond_it_is_told(limited: Kit, n: int) -> None:
    with pytest.raises(DeviceError, match=MESSAGE):
        limited.check(COUNT, "f", lambda n: n, {"n": np.array([n], np.uint32)})


def test_all_loops_together_are_told(limited: Kit) -> None:
    with pytest.raises(DeviceError, match=MESSAGE):
        limited.run(
            TWO, "f", {"n": np.array([40_000], np.uint32), "m": np.array([40_000], np.uint32)}
        )


def test_a_neighbour_that_pays_is_told(limited: Kit) -> None:
    with pytest.raises(DeviceError, match=MESSAGE):
        limited.run(
            TWO, "f", {"n": np.array([65_535, 10], np.uint32), "m": np.array([0, 10], np.uint32)}
        )


def test_a_whole_kernel_is_told(limited: Kit) -> None:
    with pytest.raises(DeviceError, match="the loops of main used up"):
        limited.kernel(SUM, "main", {"x": np.ones(100_000, np.uint32), "total": 0})


def test_on_a_driver_that_lets_loops_run_nothing_is_watched(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    unlimited = cached_property(lambda _: None)
    unlimited.__set_name__(Kit, "_loop_limit")
    monkeypatch.setattr(Kit, "_loop_limit", unlimited)
    kit = Kit(wgsl.device)
    kit.check(COUNT, "f", lambda n: n, {"n": np.array([5], np.uint32)})
    assert not any(kernel.watched for kernel in kit._kernels.values())


def test_functions_without_loops_are_not_watched(wgsl: Kit) -> None:
    kit = Kit(wgsl.device)
    kit.run("fn f(x: u32) -> u32 { return x; }", "f", {"x": np.array([5], np.uint32)})
    assert not any(kernel.watched for kernel in kit._kernels.values())


def test_where_a_kernel_ends_is_seen() -> None:
    text = (
        "fn g() -> u32 { while true { } return 1u; }\n"
        "@compute @workgroup_size(1) fn a() { if x { return; } y(); }\n"
        "@compute @workgroup_size(1) fn b() { let n = g(); return; }"
    )
    module = Module("WGSL", text)
    assert [text[at:][:6] for at, _ in calls(module, "a")] == ["return", "}\n@com"]
    assert [text[at:][:6] for at, _ in calls(module, "b")] == ["return"]
    assert [has_loop(module, name) for name in "gab"] == [True, False, True]
