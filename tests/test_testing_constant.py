"""Constant expressions have the values that the compiler gives them, or none at all."""

from __future__ import annotations

import re

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit, constant
from halfstep.testing.constant import Constant, evaluate
from halfstep.testing.module import Module
from halfstep.testing.tokens import tokens_of
from halfstep.testing.types import SCALARS, Array

EXPRESSIONS = 5000


def value_of(text: str) -> Constant | None:
    """The value of an expression of numbers alone, if it can be worked out."""
    try:
        return evaluate(
            tuple(tokens_of(text, text)), lambda name: name if name in SCALARS else None
        )
    except (ArithmeticError, ValueError):
        return None


def verdict(wgsl: Kit, text: str, value: int) -> str:
    """What the compiler says to an expression being a number: "equal", "other" or "refused"."""
    try:
        wgsl._compute.compile(f"const_assert {value} == ({text});", "constant")
    except UsageError as error:
        return "other" if "`const_assert` failure" in str(error) else "refused"
    return "equal"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-7 / 2", -3),
        ("7 / -2", -3),
        ("-7 % 3", -1),
        ("7 % -3", 1),
        ("8 + (3 - 10) / 2", 5),
        ("2 - -3", 5),
        ("2 + 3 * 4 - 20 / 5 % 3", 13),
        ("1 << 3u", 8),
        ("-8 >> 1", -4),
        ("1u << 2u", 4),
        ("max(3u, 4u) & 6u", 4),
        ("5 ^ 3 | 8", 14),
        ("~5", -6),
        ("~0u", 2**32 - 1),
        ("0x10 + 0X0fu", 31),
        ("4294967295u + 2u", 1),
        ("1u - 2u", 2**32 - 1),
        ("65536u * 65537u", 65536),
        ("u32(4)", 4),
        ("i32(4294967295u)", -1),
        ("u32(-1i)", 2**32 - 1),
        ("u32(2.9)", 2),
        ("i32(-2.9f)", -2),
        ("u32(true) + u32(1 > 2)", 1),
        ("u32(1e3) + u32(0x1p4)", 1016),
        ("select(2, 4, 3 >= 3 && 1 != 2)", 4),
        ("select(2u, 4u, !(1 < 2) || false)", 2),
        ("min(1, 2u) + max(5, 4) + clamp(9, 1, 3)", 9),
        ("abs(-3) * sign(-7)", -3),
        ("countOneBits(7u) + countLeadingZeros(1u) + countTrailingZeros(8u)", 37),
        ("firstLeadingBit(64u) + firstTrailingBit(8u)", 9),
        ("firstLeadingBit(-5) + firstLeadingBit(0) + firstTrailingBit(0i)", 0),
        ("u32(floor(2.5) + ceil(2.5) + round(2.5) + round(3.5) + trunc(-2.5))", 9),
        ("u32(sqrt(16.0)) + u32(5 / 2.0) + u32(5.5 % 3)", 8),
        ("u32(16777217.0f) - u32(f32(16777217))", 0),
    ],
)
def test_an_expression_has_its_value_in_the_compiler_too(wgsl: Kit, text: str, value: int) -> None:
    found = value_of(text)
    assert found is not None
    assert found.value == value
    assert verdict(wgsl, text, value) == "equal"
    assert verdict(wgsl, text, value ^ 1) == "other"


@pytest.mark.parametrize(
    "text",
    [
        *("", "1 +", "* 2", "(1", "1 2", "1u + 1i", "1u + 1.5", "true + 1", "1 < true", "-(3u)"),
        *("1 / 0", "1i % 0i", "2147483647i + 1i", "-2147483648i", "9223372036854775807 + 1"),
        *("1u << 32u", "4u << 30u", "1 << -1", "1.5 << 1", "3000000000i", "u32(-1)", "u32(5e9)"),
        *("i32(1e30f)", "u32(-1.5)", "1e999", "012", "0x", "1.0 / 0.0", "f16(1e6)", "!1", "~1.0"),
        *("pow(2.0, 3.0)", "u32(log2(8.0))", "vec2(3, 4).x", "array(1, 2)[0]", "max(1)", "abs()"),
        *("bitcast<u32>(1.0f)", "N", "f(1)", "floor(1i)", "select(1, 2, 3)", "max(true, false)"),
        *("countOneBits(1.5)", "countOneBits(true)", "abs(-9223372036854775807 - 1)"),
        *("firstLeadingBit(0u)", "min(1u, -1)", "u32", "u32()"),
    ],
)  # fmt: skip
def test_what_is_not_sure_has_no_value(text: str) -> None:
    assert value_of(text) is None
    with pytest.raises(UsageError) as caught:
        Module("text", f"var<private> a: array<f32, ({text})>;").variable("a")
    # A text without an end is no declaration at all.
    assert re.search("is not a constant that can be|there is no variable", str(caught.value))


def expression(rng: np.random.Generator, depth: int, kind: str) -> str:
    """A random expression of a kind: whole numbers of "int", "i32" or "u32", or "bool"."""

    def part(of: str = kind) -> str:
        return expression(rng, depth - 1, of)

    def one_of(*words: str) -> str:
        return str(rng.choice(words))

    if kind == "bool":
        if depth == 0:
            return one_of("true", "false")
        match rng.integers(3):
            case 0:
                of = one_of("int", "i32", "u32")
                return f"({part(of)} {one_of('==', '!=', '<', '>', '<=', '>=')} {part(of)})"
            case 1:
                return f"({part()} {one_of('&&', '||', '==', '!=')} {part()})"
            case _:
                return f"!{part()}"
    suffix = {"int": "", "i32": "i", "u32": "u"}[kind]
    if depth == 0:
        number = int(rng.integers(0, rng.choice([3, 10, 100, 2**16, 2**31])))
        sign = "-" if kind != "u32" and rng.random() < 0.3 else ""
        return f"{sign}{number:{one_of('d', 'd', '#x')}}{suffix}"
    match rng.integers(10):
        case 0:
            return f"({part()} {one_of('+', '-', '*', '/', '%')} {part()})"
        case 1 | 2:
            return f"{part()} {one_of('+', '-', '*', '/', '%')} {part()}"
        case 3:
            return f"(({part()}) {one_of('&', '|', '^')} ({part()}))"
        case 4:
            return f"(({part()}) {one_of('<<', '>>')} {rng.integers(0, 34)}u)"
        case 5:
            return f"{one_of('min', 'max')}({part()}, {part()})"
        case 6:
            return f"clamp({part()}, {0 if kind == 'u32' else -9}, 99)"
        case 7:
            return f"select({part()}, {part()}, {part('bool')})"
        case 8:
            return f"{one_of('abs', 'countOneBits', 'firstLeadingBit', '~')}({part()})"
        case _:
            return {
                "int": f"-({part()})",
                "i32": f"i32({part('u32')})",
                "u32": f"u32({part('i32')})",
            }[kind]


def test_random_expressions_have_the_values_that_the_compiler_gives_them(
    wgsl: Kit, rng: np.random.Generator
) -> None:
    verdicts = {"equal": 0, "other": 0, "refused": 0}
    negative = 0
    for _ in range(EXPRESSIONS):
        text = expression(rng, int(rng.integers(1, 5)), str(rng.choice(["int", "i32", "u32"])))
        found = value_of(text)
        if found is not None:
            said = verdict(wgsl, text, found.value)
            assert said != "other", f"{text} is not {found.value}"
            verdicts[said] += 1
            negative += found.value < 0
    # Most have a value, and the compiler refuses few of those, where it sees an overflow.
    assert verdicts["equal"] > EXPRESSIONS / 2, verdicts
    assert verdicts["refused"] < verdicts["equal"] / 20, verdicts
    assert negative > EXPRESSIONS / 20


TEXT = """
alias Count = u32;
alias Number = Count;
const BIG = true;
const A: u32 = 3;
const B = A + Count(2) * Number(1);
const C: f32 = 2;
const D: u32 = 2.0;
const E: vec2<u32> = vec2(1u, 2u);
const F: i32 = A;
const G = max(A, 4u);
override H = 3u;
fn min(a: u32, b: u32) -> u32 { return a + b; }
const I = array(1, 2);
"""


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("A", 3),
        ("B", 5),
        ("u32(C) + 1", 3),
        ("G", 4),
        ("select(2, 4, BIG)", 4),
        ("select(2, 4, A<4)", 4),
        ("select(2, 4, (A<4) == (A>4))", 2),
        ("Number(2.5)", 2),
        ("8 - /* a comment */ -2", 10),
        ("D", None),
        ("E.x", None),
        ("F", None),
        ("H", None),
        ("min(1u, 2u)", None),
        ("I[0]", None),
        ("Count", None),
        ("BIG", None),
        ("2.0", None),
    ],
)
def test_names_stand_for_what_the_text_declares(wgsl: Kit, text: str, count: int | None) -> None:
    module = Module("text", f"{TEXT}var<private> a: array<f32, {text}>;")
    if count is None:
        with pytest.raises(UsageError) as caught:
            module.variable("a")
        message = f"text: variable a: {text} is not a constant that can be worked out here"
        assert str(caught.value) == message
        return
    type_ = module.variable("a")
    assert isinstance(type_, Array)
    assert type_.count == count
    sound = re.sub("const [DFI].*\n", "", module.text)
    wgsl._compute.compile(sound + module.asserted(), "constant")


def test_a_number_that_was_worked_out_otherwise_does_not_compile(
    wgsl: Kit, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A slip: division as Python has it.
    monkeypatch.setitem(constant._INTEGRAL, "/", lambda a, b: a // b)
    text = "const N = 8 - (3 - 10) / 2;\nfn f(a: array<f32, N>) -> f32 { return a[0]; }"
    with pytest.raises(UsageError, match="`const_assert` failure"):
        wgsl.run(text, "f", {"a": np.zeros((3, 12), np.float32)})
    shader = (
        text
        + """
@group(0) @binding(0) var<storage, read_write> a: array<array<f32, N>>;
@compute @workgroup_size(1) fn main() { a[1][0] = 1.0; }"""
    )
    with pytest.raises(UsageError, match="`const_assert` failure"):
        wgsl.kernel(shader, "main", {"a": np.zeros((5, 12), np.float32)})
