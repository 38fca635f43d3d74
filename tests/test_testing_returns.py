"""What a function leaves beside its result is compared too: pointers, variables and buffers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.errors import UsageError
from halfstep.testing import Kit, MismatchError

U32 = NDArray[np.uint32]
TEXT = """
struct Seen { lit: bool, at: vec2<f32> }
alias Words = array<u32, 2>;
var<private> seed: u32 = 5u;
var<private> seen: Seen;
@group(0) @binding(0) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read> table: array<u32>;
@group(0) @binding(2) var<storage, read_write> total: atomic<u32>;

fn next(state: ptr<function, u32>) -> u32 {
  *state = *state * 1664525u + 1013904223u;
  return *state >> 16u;
}
fn apart(x: f32, whole: ptr<function, f32>, rest: ptr<private, f32>) {
  *whole = trunc(x);
  *rest = x - *whole;
}
@must_use fn drawn() -> u32 { seed = seed * 3u + table[0]; return seed % 7u; }
fn see(x: f32) { seen.lit = x > 0.0; seen.at = vec2<f32>(x, -x); }
fn swap(words: ptr<function, Words>) -> bool {
  let first = (*words)[0];
  (*words)[0] = (*words)[1];
  (*words)[1] = first;
  return first < (*words)[0];
}
fn count(x: u32) { atomicAdd(&counts[x % 4u], 1u); atomicAdd(&total, x); }
fn three() -> vec3<f32> { return vec3<f32>(1.0, 2.0, f32(table[0])); }
fn pick(k: u32) -> u32 { return table[k]; }
"""


def next_(state: U32) -> dict[str, U32]:
    state = state * np.uint32(1664525) + np.uint32(1013904223)
    return {"result": state >> np.uint32(16), "state": state}


def test_a_result_and_what_a_pointer_points_to(wgsl: Kit, rng: np.random.Generator) -> None:
    state = rng.integers(0, 2**32, 1000, np.uint32)
    census = wgsl.check(TEXT, "next", next_, {"state": state}, returns=("result", "state"))
    assert (census.rows, census.differing) == (1000, 0)
    found = wgsl.run(TEXT, "next", {"state": state}, returns=("state",))
    assert list(found) == ["state"]
    np.testing.assert_array_equal(found["state"], next_(state)["state"])
    # Alone, the result is what it was.
    np.testing.assert_array_equal(wgsl.run(TEXT, "next", {"state": state}), next_(state)["result"])


def test_a_function_that_returns_nothing(wgsl: Kit, rng: np.random.Generator) -> None:
    x = rng.uniform(-9, 9, 100).astype(np.float32)
    given = {"x": x, "whole": 0.0, "rest": 0.0}
    parts = ("whole", "rest")
    wgsl.check(TEXT, "apart", lambda x, *_: (np.trunc(x), x - np.trunc(x)), given, returns=parts)
    found = wgsl.run(TEXT, "see", {"x": x}, returns=("seen",))["seen"]
    np.testing.assert_array_equal(found["lit"], x > 0)
    np.testing.assert_array_equal(found["at"], np.stack([x, -x], 1))


def test_a_private_variable_with_its_own_value_or_a_given_one(wgsl: Kit) -> None:
    table = {"table": [4]}
    found = wgsl.run(TEXT, "drawn", {}, bindings=table, returns=("result", "seed"))
    assert (found["seed"].tolist(), found["result"].tolist()) == ([19], [5])
    assert wgsl.run(TEXT, "drawn", {}, bindings=table, returns=("seed",))["seed"].tolist() == [19]
    seed = np.arange(50, dtype=np.uint32)
    wgsl.check(
        TEXT,
        "drawn",
        lambda seed: {"seed": 3 * seed + 4, "result": (3 * seed + 4) % 7},
        {"seed": seed},
        bindings=table,
        returns=("result", "seed"),
    )


def test_bools_and_arrays(wgsl: Kit, rng: np.random.Generator) -> None:
    words = rng.integers(0, 3, (100, 2), np.uint32)
    wgsl.check(
        TEXT,
        "swap",
        lambda w: (w[:, 0] < w[:, 1], w[:, ::-1]),
        {"words": words},
        returns=("result", "words"),
    )


def test_a_buffer_after_all_rows(wgsl: Kit, rng: np.random.Generator) -> None:
    x = rng.integers(0, 100, 1000, np.uint32)
    bound = {"counts": [1, 0, 0, 0], "total": 7}

    def count(x: U32) -> dict[str, Any]:
        return {"counts": np.bincount(x % 4) + np.eye(4, dtype=int)[0], "total": x.sum() + 7}

    census = wgsl.check(TEXT, "count", count, {"x": x}, bindings=bound, returns=("counts", "total"))
    assert census.rows == 4 + 1
    with pytest.raises(MismatchError) as caught:
        wgsl.check(
            TEXT.replace("x % 4u", "x % 3u"),
            "count", count, {"x": x}, bindings=bound, returns=("counts", "total"),
        )  # fmt: skip
    assert caught.value.census.members == {"counts": 4}


def test_a_buffer_goes_on_through_all_parts_of_the_rows(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    kit = Kit(wgsl.device)
    limits = dict(wgsl.device.limits) | {"max-storage-buffer-binding-size": 4 * 100}
    small = type("Small", (), {"limits": limits, "features": wgsl.device.features})()
    monkeypatch.setattr(kit, "device", small)
    x = np.arange(1001, dtype=np.uint32)
    bound = {"counts": np.zeros(4, np.uint32), "total": 0}
    found = kit.run(TEXT, "count", {"x": x}, bindings=bound, returns=("total", "counts"))
    assert found["total"] == x.sum()
    assert found["counts"].tolist() == np.bincount(x % 4).tolist()


def test_a_function_without_parameters_has_one_row(wgsl: Kit) -> None:
    wgsl.check(TEXT, "three", lambda: [[1, 2, 9]], {}, bindings={"table": [9]})
    assert wgsl.run("fn one() -> f32 { return 1.0; }", "one", {}).tolist() == [1.0]


@pytest.mark.parametrize(
    ("wrong", "member"),
    [
        (("*state >> 16u", "*state >> 15u"), "result"),
        (("* 1664525u", "* 1664523u"), "state"),
    ],
)
def test_the_answer_that_is_wrong_is_named(
    wgsl: Kit, rng: np.random.Generator, wrong: tuple[str, str], member: str
) -> None:
    state = rng.integers(1, 2**32, 1000, np.uint32)
    with pytest.raises(MismatchError) as caught:
        wgsl.check(
            TEXT.replace(*wrong), "next", next_, {"state": state}, returns=("result", "state")
        )
    census = caught.value.census
    assert census.members[member] >= 900
    assert f"\n  in {member}: " in str(census)
    assert f"expected {member} " in str(census)
    assert ("result" in census.members) or member == "state"


def test_the_first_row_that_is_wrong_is_told_with_its_inputs(wgsl: Kit) -> None:
    x = np.arange(-5, 5, dtype=np.float32) + np.float32(0.5)
    given = {"x": x, "whole": 0, "rest": 0}
    with pytest.raises(MismatchError) as caught:
        wgsl.check(
            TEXT.replace("trunc", "floor"), "apart",
            lambda x, *_: {"whole": np.trunc(x), "rest": x - np.trunc(x)},
            given, returns=("whole", "rest"),
        )  # fmt: skip
    census = caught.value.census
    assert (census.failed, census.members) == (5, {"whole": 5, "rest": 5})
    assert census.first[0].inputs == {"x": -4.5, "whole": 0, "rest": 0}


X = np.arange(3, dtype=np.uint32)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.run(TEXT, "see", {"x": 1.0}),
         "WGSL: see returns nothing, so there is nothing to compare"),
        (lambda k: k.run(TEXT, "see", {"x": 1.0}, returns=("result",)),
         "WGSL: see returns nothing, so there is nothing to compare"),
        (lambda k: k.run(TEXT, "next", {"state": X}, returns=("result", "seed")),
         "WGSL: next: returns: there is no 'seed'; there is result, state"),
        (lambda k: k.run(TEXT, "next", {"state": X}, returns="state"),
         "returns: 'state' is not a tuple of names"),
        (lambda k: k.run(TEXT, "next", {"state": X}, returns=()),
         "returns: () is not a tuple of names"),
        (lambda k: k.run(TEXT, "next", {"state": X}, returns=("state", "state")),
         "returns: ('state', 'state') names one twice"),
        (lambda k: k.run(TEXT, "pick", {"k": X}, bindings={"table": X}, returns=("table",)),
         "WGSL: pick: returns: nothing can be written to table"),
        (lambda k: k.check(TEXT, "next", lambda s: s, {"state": X}, returns=("result", "state")),
         "reference: not a struct of result, state"),
        (lambda k: k.check(TEXT, "next", lambda s: (s,), {"state": X}, returns=("result", "state")),
         "reference: 1 members, not 2: result, state"),
        (lambda k: k.check(TEXT, "next", lambda s: (s, s[:2]), {"state": X},
                           returns=("result", "state")),
         "reference: state: 2 rows, not 3"),
        (lambda k: k.check(TEXT, "next", next_, {"state": X}, returns=("state",), rtol=0.1),
         "reference: result is not a member; the members are state"),
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
