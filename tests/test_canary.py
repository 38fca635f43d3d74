"""A driver that computes wrongly is found out; one that takes liberties is told from others."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, cast

import pytest

from halfstep.cli import main
from halfstep.device import canary
from halfstep.device.adapters import INT64, Adapter, open_device
from halfstep.device.canary import Fingerprint, fingerprint
from halfstep.errors import DeviceError

Plant = Callable[..., None]


@pytest.fixture(scope="module")
def device(adapter: Adapter) -> Iterator[Any]:
    """A device with what the canary looks at."""
    # Doubles stand for what this driver does not do of itself.
    device = open_device(adapter, features={INT64, "shader-f64"} & adapter.handle.features)
    yield device
    device.destroy()


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Plant:
    """Make the driver compute ``new`` where the canary says ``old``."""
    shader = canary.shader

    def plant(old: str, new: str, name: str = "canary") -> None:
        text = shader(name)
        assert text.count(old) == 1
        monkeypatch.setattr(
            canary,
            "shader",
            lambda asked: text.replace(old, new) if asked == name else shader(asked),
        )

    return plant


def test_this_driver_computes_rightly(device: Any) -> None:
    found = fingerprint(device)
    assert found == fingerprint(device)
    assert {"adapter", "driver", "wgpu", "wgpu_native"} <= found.stack.keys()
    if "llvmpipe" in found.stack["adapter"]:
        assert {"mesa", "llvm"} <= found.stack.keys()
        # What Halfstep's promise of equal bits rests on. It does not rest on the order of a dot
        # product, which its shaders do not use, or on subnormal numbers: see test_subnormals.
        assert found.contraction == "separate"
        assert (found.division, found.square_root) == ("correctly rounded", "correctly rounded")
        assert found.int64 == "right"
        # What `testing.Kit` makes up for.
        assert found.workgroup_memory == "not cleared"


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("x.a * x.b,", "x.a * x.b * 1.0000001,", "a * b"),
        ("x.a + x.c", "x.a - x.c", "a + b"),
        ("x.a * x.b + x.c", "x.a * x.b + x.b", "a * b + c"),
        ("x.a * x.b + x.a * x.c", "x.a * x.b + x.c", "a * b + a * c"),
        ("x.c / x.b", "x.c * (1.0000005 / x.b)", "a / b"),
        ("sqrt(x.a)", "x.a * 0.7", "sqrt"),
        ("x.tiny * x.tiny", "x.tiny", "subnormal"),
        ("i32(x.c * 1000.0)", "i32(floor(x.c * 1000.0))", "i32(f32)"),
        ("x.i + x.j", "x.i + x.j + select(0, 1, x.shift == 31u)", "i32 + i32"),
        ("x.i * x.j", "x.i * (x.j & 0xffffff)", "i32 * i32"),
        ("x.i << x.shift", "x.i << (x.shift & 15u)", "i32 << u32"),
        ("x.i >> x.shift", "i32(bitcast<u32>(x.i) >> x.shift)", "i32 >> u32"),
        ("bitcast<u32>(x.i) >> x.shift", "bitcast<u32>(x.i >> x.shift)", "u32 >> u32"),
        ("k < count", "k <= count", "loop"),
        ("continue;", "", "loop"),
        ("break;", "", "loop"),
        ("dot(x.v, x.w)", "dot(x.v.xyz, x.w.xyz)", "dot"),
        ("id.x < arrayLength(&places)", "id.x < 1000u", "buffer of 1025 words"),
        ("(id.x + 1u) *", "id.x *", "buffer of 1 words"),
    ],
)
def test_wrong_answers_are_told(device: Any, plant: Plant, old: str, new: str, name: str) -> None:
    plant(old, new)
    with pytest.raises(DeviceError) as caught:
        fingerprint(device)
    head, *faults = str(caught.value).splitlines()
    assert head.startswith("the driver compiles shaders wrongly (adapter ")
    assert any(fault.startswith(f"  {name}: ") for fault in faults), faults
    assert caught.value.exit_code == 4


@pytest.mark.needs("i64")
@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("x.i + x.j", "x.i - x.j", "i64 + i64"),
        ("x.i * x.j", "i64(i32(x.i)) * x.j", "i64 * i64"),
        ("x.i << x.shift", "x.i << (x.shift & 31u)", "i64 << u32"),
        ("x.i >> x.shift", "x.i >> (x.shift & 31u)", "i64 >> u32"),
        ("select(0u, 1u, x.i < x.j)", "select(0u, 1u, i32(x.i) < i32(x.j))", "i64 < i64"),
        ("i64(bitcast<i32>(x.word))", "i64(x.word) & 0xffffffffli", "i64(i32)"),
        ("i64(x.word)", "i64(x.word & 0xffffu)", "i64(u32)"),
        ("f32(x.i)", "f32(i32(x.i))", "f32(i64)"),
    ],
)
def test_wrong_answers_in_64_bits_are_told(
    device: Any, plant: Plant, old: str, new: str, name: str
) -> None:
    plant(f"{old},", f"{new},", "canary_int64")
    with pytest.raises(DeviceError) as caught:
        fingerprint(device)
    assert f"\n  {name}: " in str(caught.value)


DOUBLES = pytest.mark.needs("f64")
FUSED = "f32(f64(x.a) * f64(x.b) + f64(x.c))"
# No compiler knows that the sum is not below -8, so none takes it apart.
XY = "max(x.v.x * x.w.x + x.v.y * x.w.y, -8.0)"


@pytest.mark.parametrize(
    ("old", "new", "choice"),
    [
        pytest.param("x.a * x.b + x.c", FUSED, {"contraction": "fused"}, marks=DOUBLES),
        pytest.param("x.a * x.b + x.c", f"select({FUSED}, x.a * x.b + x.c, x.shift > 7u)",
                     {"contraction": "mixed"}, marks=DOUBLES),
        ("(x.v.x * x.w.x + x.v.y * x.w.y) + x.c",
         f"{XY} + x.c", {"sums": "as written"}),
        ("(x.v.x * x.w.x + x.v.y * x.w.y) + x.c",
         "max(x.v.x * x.w.x + x.c, -8.0) + x.v.y * x.w.y",
         {"sums": "with the second product last"}),
        ("(x.v.x * x.w.x + x.v.y * x.w.y) + x.c",
         "max(x.v.y * x.w.y + x.c, -8.0) + x.v.x * x.w.x",
         {"sums": "with the first product last"}),
        ("x.a * x.b + x.a * x.c", "max(x.a * x.b, -8.0) + max(x.a * x.c, -8.0)",
         {"common_factor": "kept"}),
        ("x.a * x.b + x.a * x.c", "x.a * max(x.b + x.c, -8.0)", {"common_factor": "taken out"}),
        ("x.tiny * x.tiny", "0.0", {"subnormals": "flushed"}),
        ("dot(x.v, x.w)", f"{XY} + max(x.v.z * x.w.z + x.v.w * x.w.w, -8.0)", {"dot": "pairwise"}),
        ("dot(x.v, x.w)",
         "max(x.v.x * x.w.x + x.v.w * x.w.w, -8.0) + max(x.v.y * x.w.y + x.v.z * x.w.z, -8.0)",
         {"dot": "other"}),
        ("x.c / x.b", "x.c * (1.0 / x.b)", {"division": "within 1.2 ulp"}),
        ("sqrt(x.a)", "x.a * (1.0 / sqrt(x.a))", {"square_root": "within 1.0 ulp"}),
    ],
)  # fmt: skip
def test_what_wgsl_allows_is_a_choice(
    device: Any, plant: Plant, old: str, new: str, choice: dict[str, str]
) -> None:
    expected = fingerprint(device)
    plant(old, new)
    assert fingerprint(device) == replace(expected, **cast(Any, choice))


def test_whether_workgroup_memory_begins_as_zeros_is_told(device: Any, plant: Plant) -> None:
    begin = "atomicAdd(&memory[ix], 1u);"
    plant(begin, f"atomicStore(&memory[ix], 0u); {begin}")
    found = fingerprint(device)
    assert found.workgroup_memory == "zero"
    assert "workgroup memory zero" in str(found)
    # One workgroup that finds something is enough.
    plant(begin, f"atomicStore(&memory[ix], select(0u, 1u, id.x == 999u)); {begin}")
    found = fingerprint(device)
    assert found.workgroup_memory == "not cleared"
    assert "workgroup memory not cleared" in str(found)


@pytest.mark.needs("i64")
def test_a_known_fault_is_told_apart(device: Any, plant: Plant) -> None:
    plant("    i64(x.word),", "    i64(x.word) & 0xffffffffli,", "canary_int64")
    assert fingerprint(device).widening == "right"
    assert "i64(u32)" not in str(fingerprint(device))
    plant("    i64(x.word),", "    i64(bitcast<i32>(x.word)),", "canary_int64")
    assert "i64(u32) extends the sign" in str(fingerprint(device))


def test_without_64_bit_integers_they_are_absent(adapter: Adapter) -> None:
    device = open_device(adapter)
    found = fingerprint(device)
    device.destroy()
    assert (found.int64, found.widening) == ("absent", "absent")
    assert "64-bit integers absent" in str(found)


def test_doctor_tells_the_choices(device: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    expected: Fingerprint = fingerprint(device)
    assert f"canary: right answers; {expected}" in capsys.readouterr().out.splitlines()
    assert main(["doctor", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["canary"] == expected.as_dict()


@pytest.mark.usefixtures("adapter")
def test_doctor_fails_on_wrong_answers(plant: Plant, capsys: pytest.CaptureFixture[str]) -> None:
    plant("x.i + x.j", "x.i - x.j")
    assert main(["doctor"]) == 4
    out, err = capsys.readouterr()
    assert "chosen: adapter " in out
    assert "canary" not in out
    assert err.startswith("the driver compiles shaders wrongly (adapter ")
    assert "\n  i32 + i32: 256 of 256 wrong, first 0: " in err
    assert main(["doctor", "--json"]) == 4
    assert json.loads(capsys.readouterr().out)["canary"] is None
