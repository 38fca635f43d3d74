"""A kernel with known answers shows whether a driver computes rightly, and which choices it makes.

WGSL lets a device contract a·b + c, change the order of sums, flush subnormal numbers and round a
division within 2.5 units in the last place. wgpu-native leaves to the driver whether workgroup
memory begins as zeros. This module reports such choices and does not judge them. Everything else
has one right answer. A driver that gives another compiles shaders wrongly, and no picture of it can
be trusted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from halfstep.contract.arrays import Array, Floats, Records
from halfstep.device.adapters import INT64
from halfstep.device.compute import UNWRITTEN, Bound, Compute
from halfstep.device.handles import GpuDevice
from halfstep.device.probe import loop_limit
from halfstep.errors import DeviceError

ROWS = 256
# Sizes in words of the buffers that are filled and read back: one word, a workgroup, just over a
# page, and more than a driver copies at once.
SIZES = (1, 64, 1025, 1 << 18)
# Largest errors of a quotient and a square root, in units in the last place: WGSL, "Accuracy".
_QUOTIENT_ULP = 2.5
_ROOT_ULP = 5.0


def _record(*members: tuple[str, str]) -> np.dtype[np.void]:
    """A dtype with members in order; each pair is a type and the names that have it."""
    return np.dtype([(name, type_) for type_, names in members for name in names.split()])


# The records of canary.wgsl and canary_int64.wgsl.
_OPERANDS = _record(("4f4", "v w"), ("f4", "a b c tiny"), ("i4", "i j"), ("u4", "shift count"))
_ANSWERS = _record(
    ("f4", "dot product sum product_sum sum_of_three common_factor quotient root subnormal"),
    ("i4", "truncated whole_sum whole_product shifted_left shifted_right"),
    ("u4", "shifted_unsigned looped"),
)
_OPERANDS_64 = _record(("i8", "i j"), ("u4", "word shift"))
_ANSWERS_64 = _record(
    ("i8", "sum product shifted_left shifted_right from_signed from_unsigned"),
    ("u4", "less"),
    ("f4", "rounded"),
)


@dataclass(frozen=True)
class Fingerprint:
    """The choices of a driver that computes rightly, in words.

    Attributes:
        contraction: how a·b + c is computed: "separate", "fused" or "mixed".
        sums: the order of (a·b + c·d) + e: "as written", or which product is added last.
        common_factor: of a·b + a·c: "kept" in both products, "taken out" of the sum, or "fused"
            with one of them.
        subnormals: "kept", "flushed" or "mixed".
        dot: the order of the sum in a dot product of four: "left to right", "pairwise", … or
            "other".
        division: "correctly rounded", or the largest error in units in the last place.
        square_root: likewise.
        int64: "right" or "absent".
        widening: i64(u32): "right", or "extends the sign", a fault that Halfstep's shaders avoid.
        loop_limit: rounds after which the driver ends all loops of an invocation, a fault that
            Halfstep's frames avoid; None if the driver showed no limit.
        workgroup_memory: its content at the start, "zero" or "not cleared". Halfstep's shaders use
            no workgroup memory, and `testing.Kit` clears it.
        stack: adapter, driver and versions; see `stack_of`.
    """

    contraction: str
    sums: str
    common_factor: str
    subnormals: str
    dot: str
    division: str
    square_root: str
    int64: str
    widening: str
    loop_limit: int | None
    workgroup_memory: str
    stack: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """The fingerprint for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """The fingerprint for people."""
        parts = [
            f"a·b + c {self.contraction}",
            f"sums {self.sums}",
            f"common factors {self.common_factor}",
            f"subnormals {self.subnormals}",
            f"dot {self.dot}",
            f"division {self.division}",
            f"square root {self.square_root}",
            f"64-bit integers {self.int64}",
            f"workgroup memory {self.workgroup_memory}",
        ]
        if self.widening not in ("right", "absent"):
            parts.append(f"i64(u32) {self.widening}")
        if self.loop_limit is not None:
            parts.append(f"loops end after {self.loop_limit:,} rounds")
        return ", ".join(parts)


class _Judge:
    """Collects wrong answers as messages in ``faults``."""

    def __init__(self) -> None:
        self.faults: list[str] = []

    def exactly(self, name: str, found: Array, expected: Array) -> None:
        """Record a fault unless ``found`` equals ``expected`` everywhere."""
        self.allow(name, found, {"": expected})

    def allow(self, name: str, found: Array, answers: Mapping[str, Array]) -> str:
        """The name of the answer that all rows have, else "mixed".

        A row that has none of ``answers`` is recorded as a fault.
        """
        same = {word: found == answer for word, answer in answers.items()}
        for word, rows in same.items():
            if rows.all():
                return word
        wrong = np.flatnonzero(~np.logical_or.reduce(list(same.values())))
        if len(wrong):
            first = wrong[0]
            right = " or ".join(f"{answer[first]}" for answer in answers.values())
            self.faults.append(
                f"{name}: {len(wrong)} of {len(found)} wrong, first {first}: {found[first]}, "
                f"not {right}"
            )
        return "mixed"

    def within(self, name: str, found: Array, exact: Floats, ulp: float) -> str:
        """The largest error of float32 numbers, in words. An error above ``ulp`` is a fault."""
        rounded = exact.astype(np.float32)
        if (found == rounded).all():
            return "correctly rounded"
        off = np.abs(found.astype(np.float64) - exact) / np.spacing(np.abs(rounded))
        off = np.where(np.isfinite(off), off, np.inf)
        if off.max() > ulp:
            first = int(off.argmax())
            self.faults.append(f"{name}: {found[first]} in row {first}, not {rounded[first]}")
        return f"within {off.max():.1f} ulp"


def fingerprint(device: GpuDevice) -> Fingerprint:
    """The choices of the driver below a wgpu.GPUDevice.

    Raises:
        DeviceError: the driver gives wrong answers, which the message lists.
    """
    compute = Compute(device)
    judge = _Judge()
    choices = _judge_32(compute, judge)
    has_int64 = INT64 in device.features
    widening = _judge_64(compute, judge) if has_int64 else "absent"
    for words in SIZES:
        _judge_readback(compute, judge, words)
    memory = _told_memory(compute)
    if judge.faults:
        faults = "".join(f"\n  {fault}" for fault in judge.faults)
        told = ", ".join(f"{name} {value}" for name, value in compute.stack.items())
        raise DeviceError(f"the driver compiles shaders wrongly ({told}):{faults}")
    return Fingerprint(
        **choices,
        int64="right" if has_int64 else "absent",
        widening=widening,
        workgroup_memory=memory,
        loop_limit=loop_limit(compute),
        stack=compute.stack,
    )


def _judge_32(compute: Compute, judge: _Judge) -> dict[str, str]:
    """Judge arithmetic of 32 bits, and return the choices by their names in `Fingerprint`."""
    x = _operands()
    found = _run(compute, "canary", x, _ANSWERS)
    a, b, c = x["a"], x["b"], x["c"]
    i, j = x["i"], x["j"]
    with np.errstate(over="ignore"):
        judge.exactly("a * b", found["product"], a * b)
        judge.exactly("a + b", found["sum"], a + c)
        judge.exactly("i32(f32)", found["truncated"], (c * np.float32(1000)).astype(np.int32))
        judge.exactly("i32 + i32", found["whole_sum"], i + j)
        judge.exactly("i32 * i32", found["whole_product"], i * j)
        judge.exactly("i32 << u32", found["shifted_left"], i << x["shift"].astype(np.int32))
        judge.exactly("i32 >> u32", found["shifted_right"], i >> x["shift"].astype(np.int32))
        judge.exactly("u32 >> u32", found["shifted_unsigned"], i.view(np.uint32) >> x["shift"])
        judge.exactly("loop", found["looped"], _looped(x["count"], j.view(np.uint32)))
    # The product has 48 bits and float64 holds the sum exactly, so `fused` is rounded only once.
    fused = (a.astype(np.float64) * b + c).astype(np.float32)
    tiny = x["tiny"] * x["tiny"]
    return {
        "contraction": judge.allow(
            "a * b + c", found["product_sum"], {"separate": a * b + c, "fused": fused}
        ),
        "sums": _judge_sum(judge, found["sum_of_three"], x["v"] * x["w"], c),
        "common_factor": _judge_factor(judge, found["common_factor"], a, b, c),
        "subnormals": judge.allow(
            "subnormal", found["subnormal"], {"kept": tiny, "flushed": np.zeros_like(tiny)}
        ),
        "dot": _judge_dot(judge, found["dot"], x["v"], x["w"]),
        "division": judge.within(
            "a / b", found["quotient"], c.astype(np.float64) / b, _QUOTIENT_ULP
        ),
        "square_root": judge.within(
            "sqrt", found["root"], np.sqrt(a.astype(np.float64)), _ROOT_ULP
        ),
    }


def _judge_sum(judge: _Judge, found: Array, products: Array, c: Array) -> str:
    """The order in which the driver sums two products, which are exact, and a number."""
    p, q, _, _ = products.T
    orders = {
        "as written": (p + q) + c,
        "with the second product last": (p + c) + q,
        "with the first product last": (q + c) + p,
    }
    return judge.allow("(a * b + c * d) + e", found, orders)


def _judge_factor(judge: _Judge, found: Array, a: Array, b: Array, c: Array) -> str:
    """What becomes of the factor that two products have in common."""
    p, q = a.astype(np.float64) * b, a.astype(np.float64) * c  # exact, as is a sum with one rounded
    first, second = p.astype(np.float32), q.astype(np.float32)
    choices = {
        "kept": first + second,
        "taken out": a * (b + c),
        "fused": (p + second).astype(np.float32),
        "fused with the second": (first + q).astype(np.float32),
    }
    return judge.allow("a * b + a * c", found, choices)


def _judge_dot(judge: _Judge, found: Array, v: Array, w: Array) -> str:
    """The order in which the driver sums the four products of a dot product, which are exact."""
    p, q, r, s = (v * w).T
    orders = {
        "left to right": ((p + q) + r) + s,
        "right to left": p + (q + (r + s)),
        "pairwise": (p + q) + (r + s),
        "crosswise": (p + r) + (q + s),
    }
    for order, answer in orders.items():
        if (found == answer).all():
            return order
    exact = (v.astype(np.float64) * w).sum(axis=1)
    room = 4 * 2.0**-24 * np.abs(v.astype(np.float64) * w).sum(axis=1)
    judge.allow("dot", found, {"": np.where(np.abs(found - exact) <= room, found, exact)})
    return "other"


def _judge_64(compute: Compute, judge: _Judge) -> str:
    """Judge integers of 64 bits, and return how the driver converts a u32 to one."""
    x = _operands_64()
    found = _run(compute, "canary_int64", x, _ANSWERS_64)
    i, j, shift = x["i"], x["j"], x["shift"].astype(np.int64)
    with np.errstate(over="ignore"):
        judge.exactly("i64 + i64", found["sum"], i + j)
        judge.exactly("i64 * i64", found["product"], i * j)
        judge.exactly("i64 << u32", found["shifted_left"], i << shift)
        judge.exactly("i64 >> u32", found["shifted_right"], i >> shift)
        judge.exactly("i64 < i64", found["less"], (i < j).astype(np.uint32))
    signed = x["word"].view(np.int32).astype(np.int64)
    judge.exactly("i64(i32)", found["from_signed"], signed)
    rounded = i.astype(np.float32)
    # WGSL lets a conversion round to either neighbour.
    near = np.abs(found["rounded"] - rounded) <= np.spacing(np.abs(rounded))
    judge.exactly("f32(i64)", found["rounded"], np.where(near, found["rounded"], rounded))
    return judge.allow(
        "i64(u32)",
        found["from_unsigned"],
        {"right": x["word"].astype(np.int64), "extends the sign": signed},
    )


def _judge_readback(compute: Compute, judge: _Judge, words: int) -> None:
    """Judge whether each of ``words`` words that a shader writes is read back at its index."""
    raw = np.full(words, UNWRITTEN, np.uint32).view(np.uint8)
    groups = -(-words // 64), 1, 1
    bound = [Bound(0, 0, "storage", raw)]
    [found] = compute.run(shader("canary"), "fill", bound, groups, name="canary.wgsl")
    expected = (np.arange(words, dtype=np.uint32) + np.uint32(1)) * np.uint32(2654435761)
    judge.exactly(f"buffer of {words} words", found.view(np.uint32), expected)


def _told_memory(compute: Compute) -> str:
    """Whether workgroup memory begins as zeros after another kernel has written to it."""
    raw = np.full(ROWS * 64, UNWRITTEN, np.uint32).view(np.uint8)
    for entry_point in ("leave", "count"):
        bound = [Bound(0, 0, "storage", raw)]
        [found] = compute.run(
            shader("canary"), entry_point, bound, (ROWS, 1, 1), name="canary.wgsl"
        )
    return "zero" if (found.view(np.uint32) == 1).all() else "not cleared"


def shader(name: str) -> str:
    """The WGSL of ``canary`` or ``canary_int64``."""
    return files("halfstep.wgsl").joinpath(f"{name}.wgsl").read_text(encoding="utf-8")


def _run(compute: Compute, name: str, operands: Records, answers: np.dtype[np.void]) -> Records:
    """Run the shader ``name`` on ``operands`` (ROWS,), and return its answers (ROWS,)."""
    size = ROWS * answers.itemsize
    raw = np.full(size // 4, UNWRITTEN, np.uint32).view(np.uint8)
    bound = [
        Bound(0, 0, "read-only-storage", operands.view(np.uint8)),
        Bound(0, 1, "storage", raw),
    ]
    [found] = compute.run(
        shader(name), "arithmetic", bound, (ROWS // 64, 1, 1), name=f"{name}.wgsl"
    )
    return found.view(answers)


def _operands() -> Records:
    """Random operands (ROWS,) for which a driver's choices give different results."""
    rng = np.random.default_rng(1998)
    x = np.zeros(ROWS, _OPERANDS)
    for name in ("v", "w"):  # of 12 bits, so that products are exact
        x[name] = rng.integers(-(2**12), 2**12, (ROWS, 4)) / 2**12
    x["a"], x["b"] = 1 + rng.integers(0, 2**23, (2, ROWS)) / 2**23
    x["c"] = -1 - rng.integers(0, 3 * 2**22, ROWS) / 2**22
    x["tiny"] = rng.uniform(1, 2, ROWS) * 2.0**-70
    x["i"], x["j"] = rng.integers(-(2**31), 2**31, (2, ROWS))
    x["shift"], x["count"] = np.arange(ROWS) % 32, np.arange(ROWS) % 73
    return x


def _operands_64() -> Records:
    rng = np.random.default_rng(1998)
    x = np.zeros(ROWS, _OPERANDS_64)
    x["i"], x["j"] = rng.integers(-(2**63), 2**63, (2, ROWS)) >> rng.integers(0, 63, (2, ROWS))
    x["word"] = rng.integers(0, 2**32, ROWS)
    x["shift"] = np.arange(ROWS) % 64
    return x


def _looped(count: Array, seed: Array) -> Array:
    """The results of the function `looped` of canary.wgsl, (ROWS,)."""
    total = seed.copy()
    for k in range(min(int(count.max()), 50)):
        if k & 3 != 1:
            total = np.where(k < count, total * np.uint32(31) + np.uint32(k), total)
    return total
