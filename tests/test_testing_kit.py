"""Functions of WGSL are run for rows of NumPy arrays; what does not fit is named before."""

from __future__ import annotations

import codecs
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from halfstep.errors import AdapterError, UsageError
from halfstep.testing import Kit, MismatchError, unwritten

TEXT = """\
struct Line { c: f32, b: f32 }
alias Lines = array<Line, 3>;
struct Piece { ends: vec2<f32>, empty: bool }
struct Found { piece: Piece, id: i32, far: array<bool, 2> }

const BIAS = 1;
var<private> offset: f32;
@group(0) @binding(4) var<uniform> gain: vec4<f32>;
@group(1) @binding(0) var<storage, read> table: array<u32>;

fn clip(lines: ptr<function, Lines>, count: u32, piece: Piece) -> Found {
  var low = piece.ends.x;
  var number = 0;
  for (var k = 0u; k < count; k++) {
    if (*lines)[k].c > low {
      low = (*lines)[k].c;
      number = i32(k) + BIAS;
    }
    (*lines)[k].c = -1.0;
  }
  let empty = piece.empty || low > piece.ends.y;
  let rest = Piece(vec2<f32>(low, piece.ends.y), empty);
  return Found(rest, number, array<bool, 2>(empty, low > 0.0));
}
fn shifted(x: f32) -> f32 { return x + offset; }
fn looked_up(ix: u32) -> f32 { return f32(table[ix]) * gain.y; }
fn twice(x: f32) -> f32 { return 2.0 * x; }
fn constant() -> f32 { return 1.0; }
"""
WIDE = "fn wide(x: i64) -> i64 { return x * 3li; }"
INT64 = pytest.mark.needs("i64")


class Line(NamedTuple):
    """As the struct of the same name."""

    c: Any
    b: Any


class Piece(NamedTuple):
    """As the struct of the same name."""

    ends: Any
    empty: Any


class Found(NamedTuple):
    """As the struct of the same name."""

    piece: Piece
    id: Any
    far: Any


def clip(lines: Any, count: Any, piece: Any) -> Found:
    low, number = piece["ends"][:, 0], np.zeros(len(count), np.int32)
    for k in range(3):
        later = (k < count) & (lines["c"][:, k] > low)
        low, number = np.where(later, lines["c"][:, k], low), np.where(later, k + 1, number)
    empty = piece["empty"] | (low > piece["ends"][:, 1])
    ends = np.stack([low, piece["ends"][:, 1]], axis=1)
    return Found(Piece(ends, empty), number, np.stack([empty, low > 0], axis=1))


@pytest.fixture
def given(rng: np.random.Generator) -> dict[str, Any]:
    """Arguments of `clip`, each struct in another of its forms."""
    lines = rng.normal(size=(2, 1000, 3)).astype(np.float32)
    ends = rng.normal(size=(1000, 2)).astype(np.float32)
    return {
        "lines": Line(*lines),
        "count": rng.integers(0, 4, 1000, dtype=np.uint32),
        "piece": {"ends": ends, "empty": rng.random(1000) < 0.1},
    }


def test_structs_and_pointers_go_in_and_out(wgsl: Kit, given: dict[str, Any]) -> None:
    census = wgsl.check(TEXT, "clip", clip, given)
    assert (census.rows, census.differing) == (1000, 0)
    found = wgsl.run(TEXT, "clip", given)
    assert found.dtype == wgsl.struct(TEXT, "Found")
    assert set(np.unique(found["id"])) == {0, 1, 2, 3}
    # What a call does to what a pointer points to is its own.
    assert (given["lines"].c != -1).any()


def test_a_struct_has_three_forms(wgsl: Kit, given: dict[str, Any]) -> None:
    as_record = np.zeros((1000, 3), wgsl.struct(TEXT, "Line"))
    as_record["c"], as_record["b"] = given["lines"]
    forms = as_record, {"b": given["lines"].b, "c": given["lines"].c}, given["lines"]
    results = [wgsl.run(TEXT, "clip", given | {"lines": lines}) for lines in forms]
    assert all((result == results[0]).all() for result in results)


def test_one_value_stands_for_all_rows(wgsl: Kit, given: dict[str, Any]) -> None:
    alone = given | {"count": 2}
    full = given | {"count": np.full(1000, 2, np.uint32)}
    np.testing.assert_array_equal(wgsl.run(TEXT, "clip", alone), wgsl.run(TEXT, "clip", full))
    assert wgsl.run(TEXT, "twice", {"x": 1.5}).tolist() == [3.0]
    wgsl.check(TEXT, "twice", lambda _: 3, {"x": np.full(10, 1.5, np.float32)})


def test_a_private_variable_is_set_for_every_row(wgsl: Kit) -> None:
    x, offset = np.arange(10, dtype=np.float32), np.arange(10, dtype=np.float32)[::-1]
    wgsl.check(TEXT, "shifted", lambda x, offset: x + offset, {"x": x, "offset": offset})
    assert wgsl.run(TEXT, "shifted", {"x": x}).tolist() == x.tolist()


def test_bindings_are_the_same_for_all_rows(wgsl: Kit) -> None:
    table = np.arange(100, dtype=np.uint32) ** 2
    gain = np.array([0, 0.5, 0, 0], np.float32)
    ix = np.arange(99, -1, -1, dtype=np.uint32)
    wgsl.check(
        TEXT,
        "looked_up",
        lambda ix: table[ix] * gain[1],
        {"ix": ix},
        bindings={"table": table, "gain": gain},
    )


@INT64
def test_integers_of_64_bits(wgsl: Kit) -> None:
    x = np.array([0, -1, 2**40, -(2**62) + 1, 2**61], np.int64)
    with np.errstate(over="ignore"):
        wgsl.check(WIDE, "wide", lambda x: x * 3, {"x": x})


def test_a_reference_may_compute_in_more_bits(wgsl: Kit, rng: np.random.Generator) -> None:
    x = rng.normal(size=1000).astype(np.float32)
    text = "fn cube(x: f32) -> f32 { return x * x * x; }"
    census = wgsl.check(text, "cube", lambda x: x.astype(np.float64) ** 3, {"x": x}, ulp=1)
    assert census.worst_ulp == 1


def test_a_path_is_a_source(wgsl: Kit, tmp_path: Path) -> None:
    path = tmp_path / "text.wgsl"
    for mark in (b"", codecs.BOM_UTF8):
        path.write_bytes(mark + TEXT.encode())
        for source in (path, str(path)):
            assert wgsl.run(source, "twice", {"x": 2.0}).tolist() == [4.0]
    path.write_bytes(b"// r\xf6t\n" + TEXT.encode())
    with pytest.raises(UsageError) as caught:
        wgsl.run(path, "twice", {"x": 2.0})
    assert str(caught.value) == f"{path}: line 1, column 5: not UTF-8 text"


def test_arrays_given_to_a_reference_are_not_to_be_changed(wgsl: Kit) -> None:
    def careless(x: Any) -> Any:
        x *= 2
        return x

    with pytest.raises(ValueError, match="read-only"):
        wgsl.check(TEXT, "twice", careless, {"x": np.ones(4, np.float32)})


def test_pipelines_are_kept(wgsl: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    kit = Kit(wgsl.device)
    names: list[str] = []
    compile_ = kit._compute.compile

    def noting(code: str, name: str) -> Any:
        names.append(name)
        return compile_(code, name)

    monkeypatch.setattr(kit._compute, "compile", noting)
    for _ in range(3):
        kit.run(TEXT, "twice", {"x": 1.0})
        kit.run(TEXT, "shifted", {"x": 1.0})
    assert names == ["WGSL", "WGSL"]


SHADER = """
@group(0) @binding(0) var<storage, read_write> out: array<u32>;
@compute @workgroup_size(2, 2, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>) {
  out[(id.z * n.y * 2u + id.y) * n.x * 2u + id.x] = id.x + 10u * id.y + 100u * id.z;
}
"""


def test_a_kernel_runs_on_a_grid_of_workgroups(wgsl: Kit) -> None:
    given = {"out": unwritten(3 * 4 * 4, np.uint32)}
    found = wgsl.kernel(SHADER, "main", given, workgroups=(2, 2, 3))["out"]
    z, y, x = np.mgrid[:3, :4, :4]
    wgsl.compare(found, (x + 10 * y + 100 * z).reshape(-1))


def test_a_million_rows_take_no_time(wgsl: Kit, rng: np.random.Generator) -> None:
    a, b = rng.random((2, 1_000_000), np.float32)
    begin = time.perf_counter()
    wgsl.check(
        "fn scale(a: f32, b: f32) -> f32 { return a * b; }", "scale", np.multiply, {"a": a, "b": b}
    )
    # A quarter of a second on two idle cores; the limit is for machines that do other things too.
    assert time.perf_counter() - begin < 8


def test_a_mismatch_shows_the_line_that_asked(wgsl: Kit) -> None:
    with pytest.raises(MismatchError) as excinfo:
        wgsl.check(TEXT, "twice", lambda x: x, {"x": np.array([0, 1.5], np.float32)})
    adapter = wgsl.device.adapter_info["device"]
    lines = str(excinfo.value).splitlines()
    assert lines[:-1] == [
        "twice: 1 of 2 rows differ (exact)",
        "  worst: 8388608 ulp in row 1",
        "  values by distance: 2^23… ulp: 1",
        "  row 1: x = 1.5",
        "    found 3.0",
        "    expected 1.5 (8388608 ulp)",
    ]
    assert lines[-1].startswith(f"  on {adapter}, ")
    assert shown(excinfo) == ["test_a_mismatch_shows_the_line_that_asked"]


@pytest.mark.parametrize(
    ("source", "function", "inputs"),
    [
        ("fn f(x: f32) -> f32 { return x + ; }", "f", {"x": 1}),
        ("fn f(x: f32) -> f32 { return x + 1; ", "f", {"x": 1}),
        ("fn f(x: f32) -> f32 { return x; }", "g", {"x": 1}),
        ("fn f(x: f32) -> f32 { return x; }", "f", {"y": 1}),
        ("fn f(x: f32) -> f32 { return x; }", "f", {"x": np.ones((3, 2), np.bool_)}),
    ],
)
def test_what_is_wrong_shows_the_line_that_asked(
    source: str, function: str, inputs: dict[str, Any], wgsl: Kit
) -> None:
    with pytest.raises(UsageError) as excinfo:
        wgsl.check(source, function, one, inputs)
    assert shown(excinfo) == ["test_what_is_wrong_shows_the_line_that_asked"]
    assert excinfo.value.__suppress_context__ or excinfo.value.__context__ is None


def shown(excinfo: pytest.ExceptionInfo[Exception]) -> list[str]:
    """The functions that pytest shows of a failure."""
    return [entry.name for entry in excinfo.traceback if not entry.ishidden(excinfo)]


X = np.arange(4, dtype=np.float32)


def piece(**changes: Any) -> dict[str, Any]:
    """Arguments of `clip` with another piece."""
    ends, empty = np.zeros((4, 2), np.float32), np.zeros(4, bool)
    lines = Line(np.zeros((4, 3), np.float32), np.zeros((4, 3), np.float32))
    return {"lines": lines, "count": 1, "piece": {"ends": ends, "empty": empty} | changes}


def one(x: Any) -> Any:
    return x


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda k: k.check(TEXT, "thrice", one, {"x": X}),
         "WGSL: there is no function 'thrice'; there are clip, shifted, looked_up, twice, "
         "constant"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X, "y": X}),
         "WGSL: twice has no parameter 'y'; it has x"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X, "offset": X}),
         "WGSL: twice has no parameter 'offset'; it has x"),
        (lambda k: k.check(TEXT, "clip", one, {"count": 1}),
         "WGSL: clip: inputs do not give lines, piece"),
        (lambda k: k.check(TEXT, "clip", one, piece(empty=np.zeros(5, bool))),
         "inputs: piece: members of different lengths: ends (4, 2), empty (5,)"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"count": np.zeros(7, np.uint32)}),
         "inputs: not one number of rows: lines has 4, count has 7, piece has 4"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X[:0]}),
         "inputs: not one number of rows: x has 0"),
        (lambda k: k.check(TEXT, "clip", one, piece(ends=np.zeros((4, 3), np.float32))),
         "inputs: piece.ends: shape (4, 3), not (rows, 2)"),
        (lambda k: k.check(TEXT, "clip", one, piece(full=True)),
         "inputs: piece: full is not a member; the members are ends, empty"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"piece": {"ends": 0}}),
         "inputs: piece: empty is missing; the members are ends, empty"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"piece": (0, 0, 0)}),
         "inputs: piece: 3 members, not 2: ends, empty"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"piece": X}),
         "inputs: piece: not a struct of ends, empty"),
        (lambda k: k.check(TEXT, "clip", one, piece(empty=np.zeros(4, np.uint8))),
         "inputs: piece.empty: uint8 where bool is wanted"),
        (lambda k: k.check(TEXT, "twice", one, {"x": np.array([0.5, 0.1])}),
         "inputs: x: float32 does not hold the float64 0.1 of row 1; convert it first"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"count": np.array([1, 2, -1, 0])}),
         "inputs: count: uint32 does not hold the int64 -1 of row 2; convert it first"),
        (lambda k: k.check(TEXT, "clip", one, piece() | {"count": X}),
         "inputs: count: float32 where uint32 is wanted"),
        pytest.param(
            lambda k: k.check(WIDE, "wide", one, {"x": np.array([2**63], np.uint64)}),
            f"inputs: x: int64 does not hold the uint64 {2**63} of row 0; convert it first",
            marks=INT64),
        (lambda k: k.check(TEXT, "twice", lambda _: X[:3], {"x": X}),
         "reference: 3 rows, not 4"),
        (lambda k: k.check(TEXT, "twice", lambda _: X > 1, {"x": X}),
         "reference: bool where float32 is wanted"),
        pytest.param(
            lambda k: k.check(WIDE, "wide", lambda _: X, {"x": 1}),
            "reference: float32 where int64 is wanted",
            marks=INT64),
        (lambda k: k.check(TEXT, "twice", one, {"x": X}, margin=lambda _: X[:2]),
         "margin: float32 of shape (2,), not a number for each of 4 rows"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X}, ulp=-1),
         "ulp: -1 is not a finite number >= 0"),
        (lambda k: k.check(TEXT, "looked_up", one, {"ix": 1}, bindings={"table": [1]}),
         "WGSL: looked_up uses gain, which bindings do not give"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X}, bindings={"gain": X}),
         "WGSL: twice uses no resource 'gain'; it uses none"),
        (lambda k: k.check(TEXT, "looked_up", one, {"ix": 1},
                           bindings={"table": [1], "gain": [1, 2]}),
         "bindings: gain: shape (2,), not (4,)"),
        (lambda k: k.check(TEXT, "looked_up", one, {"ix": 1}, bindings={"table": 5, "gain": X}),
         "bindings: table: no elements along a first axis: shape ()"),
        (lambda k: k.check(TEXT, "twice", one, {"x": [1, [2]]}),
         "inputs: x: not an array: setting an array element with a sequence. The requested array "
         "has an inhomogeneous shape after 1 dimensions. The detected shape was (2,) + "
         "inhomogeneous part."),
        (lambda k: k.check(TEXT, "twice", one, None), "inputs: NoneType is not a mapping"),
        (lambda k: k.check(TEXT, "twice", one, {"x": X}, bindings=[X]),
         "bindings: list is not a mapping"),
        (lambda k: k.kernel(SHADER, "main", [X]), "bindings: list is not a mapping"),
        (lambda k: k.run(
            "alias A = array<f32, 250000000>;\nfn f(a: A, b: A) -> f32 { return 0; }",
            "f", {"a": X, "b": X},
         ),
         "WGSL: f: a row is larger than a buffer of the device"),
        (lambda k: k.kernel(SHADER, "out", {}),
         "WGSL: there is no function 'out'; there are main"),
        (lambda k: k.kernel(SHADER, "main", {}),
         "WGSL: main uses out, which bindings do not give"),
        (lambda k: k.kernel(SHADER, "main", {"out": [1]}, workgroups=(1, 1, 1, 1)),
         "workgroups: (1, 1, 1, 1) is not 1 to 3 whole numbers of 0 to 65535"),
        (lambda k: k.compare(X, X[:2]), "expected: 2 rows, not 4"),
        (lambda k: k.run("nowhere/there.wgsl", "f", {}),
         "nowhere/there.wgsl: No such file or directory"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    wgsl: Kit, call: Callable[[Kit], object], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Which is learned by running something.
    assert wgsl._loop_limit is None or wgsl._loop_limit > 0
    ran: list[object] = []
    monkeypatch.setattr(wgsl._compute, "run", lambda *arguments, **_: ran.append(arguments))
    with pytest.raises(UsageError) as caught:
        call(wgsl)
    assert str(caught.value) == message
    assert not ran


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ("fn f(x: f32) -> f32 {\n  return y;\n}\n", "2:10",
         "no definition in scope for identifier: `y`"),
        ("fn f(x: f32) -> f32 {\n  return x + 1u;\n}\n", "1:1",
         "Function [0] 'f' is invalid"),
        ("fn f(x: f32 -> f32 {\n  return x;\n}\n", "1:13", 'expected `,`, found "->"'),
        ("fn f(x: number) -> f32 {\n  return x;\n}\n", "1:9",
         "no definition in scope for identifier: `number`"),
    ],
)  # fmt: skip
def test_a_compile_error_shows_the_line_of_the_source(
    wgsl: Kit, tmp_path: Path, text: str, place: str, reason: str
) -> None:
    path = tmp_path / "faulty.wgsl"
    path.write_text(text)
    for source, name in ((text, "WGSL"), (path, str(path))):
        with pytest.raises(UsageError) as caught:
            wgsl.run(source, "f", {"x": X})
        message = str(caught.value)
        assert message.startswith(f"{name}: {reason}\n"), message
        assert f"┌─ {name}:{place}\n" in message
        line = text.splitlines()[int(place.split(":")[0]) - 1]
        assert line in message


def test_a_type_that_the_device_lacks_is_named(wgsl: Kit, monkeypatch: pytest.MonkeyPatch) -> None:
    kit = Kit(wgsl.device)
    poor = type("Poor", (), {"features": frozenset[str](), "limits": wgsl.device.limits})()
    monkeypatch.setattr(kit, "device", poor)
    with pytest.raises(AdapterError) as caught:
        kit.run(WIDE, "wide", {"x": 1})
    adapter = wgsl.device.adapter_info["device"]
    assert str(caught.value) == f"wide uses i64, and the device on {adapter} has no shader-int64"
    assert kit.run(TEXT, "twice", {"x": 1.0}).tolist() == [2.0]
