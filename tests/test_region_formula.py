"""Formulas of regions: what a text means, what Python's operators build, and where a fault is."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

import halfstep
from halfstep.scene.formula import (
    MAX_FORMULA_BYTES,
    AllOf,
    AnyOf,
    Formula,
    Name,
    Not,
    Operand,
    Sense,
    as_formula,
    parse,
)

WORDS = ("a", "b", "key", "_x1", "größe", "not1")
IDS = (1, 2, 10, 2147483647)
Truth = dict[str | int, bool]


def holds(formula: Formula, truth: Truth) -> bool:
    """Whether a formula holds where the functions of some surfaces, and some words, are true."""
    match formula:
        case Sense(int() as surface, positive):
            return truth[surface] == positive
        case Name(str() as word):
            return truth[word]
        case Not(of):
            return not holds(of, truth)
        case AllOf(of):
            return all(holds(each, truth) for each in of)
        case AnyOf(of):
            return any(holds(each, truth) for each in of)
    raise AssertionError(formula)


# ------------------------------------------------------------- an oracle: Python's own precedence


def as_python(tokens: list[str]) -> str:
    """A Python expression of the tokens' meaning: each replaced by itself, with no grammar."""
    words = []
    for before, token in zip(["", *tokens], tokens, strict=False):
        starts = token not in ("&", "|", "-", ")")
        ends = before not in ("", "&", "|", "-", "~", "(")
        if starts and ends:
            words.append("and")
        if re.fullmatch(r"[+-]?\d+", token):
            number = f"truth[{abs(int(token))}]"
            words.append(f"(not {number})" if token[0] == "-" else number)
        else:
            known = {"&": "and", "|": "or", "~": "not", "-": "and not", "(": "(", ")": ")"}
            words.append(known.get(token) or f"truth[{token!r}]")
    return " ".join(words)


def random_tokens(rng: np.random.Generator, depth: int) -> list[str]:
    """Tokens of a formula, every operator and level among them."""
    tokens: list[str] = []
    for term in range(rng.integers(1, 5)):
        if term:
            tokens += [[], ["&"], ["|"], ["-"]][rng.integers(4)]
        tokens += ["~"] * int(rng.choice([0, 0, 0, 1, 2]))
        kind = rng.integers(3 if depth else 2)
        if kind == 0:
            tokens.append(str(rng.choice(["", "-", "+"])) + str(rng.choice(IDS)))
        elif kind == 1:
            tokens.append(str(rng.choice(WORDS)))
        else:
            tokens += ["(", *random_tokens(rng, depth - 1), ")"]
    return tokens


def spelt(tokens: list[str], rng: np.random.Generator) -> str:
    """The tokens as a text, with blanks where they are needed and where they are not."""
    text = tokens[0]
    for before, token in itertools.pairwise(tokens):
        glued = re.fullmatch(r"\w\w", before[-1] + token[0]) is not None
        # A minus that touches digits is their sign.
        glued |= before == "-" and token[0].isdecimal()
        text += ("  ", " ", "\n", "\t")[rng.integers(4)] if glued or rng.random() < 0.5 else ""
        text += token
    return text


def test_a_text_means_what_python_means_by_it(rng: np.random.Generator) -> None:
    decided = {True: 0, False: 0}
    seen: set[type] = set()
    for _ in range(1500):
        tokens = random_tokens(rng, 3)
        text = spelt(tokens, rng)
        formula = parse(text)
        code = compile(as_python(tokens), text, "eval")
        seen |= {type(each) for each in walk(formula)}
        for _ in range(8):
            truth: Truth = {each: bool(rng.integers(2)) for each in (*IDS, *WORDS)}
            expected = bool(eval(code, {"truth": truth}))
            assert holds(formula, truth) == expected, text
            decided[expected] += 1
        assert parse(str(formula)) == formula, text
    assert seen == {Sense, Name, Not, AllOf, AnyOf}
    assert min(decided.values()) > 3000


def walk(formula: Formula) -> list[Formula]:
    inside = {Not: "of", AllOf: "of", AnyOf: "of"}.get(type(formula))
    if inside is None:
        return [formula]
    of = formula.of if isinstance(formula, AllOf | AnyOf) else (formula.of,)  # type: ignore[union-attr]
    return [formula, *(each for part in of for each in walk(part))]  # type: ignore[arg-type]


# ---------------------------------------------------------------------------------- precedence

A, B, C = Name("a"), Name("b"), Name("c")


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("a", A),
        ("-1", Sense(1, positive=False)),
        ("+1", Sense(1, positive=True)),
        ("007", Sense(7, positive=True)),
        ("a b | c", AnyOf((AllOf((A, B)), C))),
        ("a | b & c", AnyOf((A, AllOf((B, C))))),
        ("~a b", AllOf((Not(A), B))),
        ("~(a b)", Not(AllOf((A, B)))),
        ("~~a", Not(Not(A))),
        ("a - b & c", AllOf((A, Not(B), C))),
        ("a - b - c", AllOf((A, Not(B), Not(C)))),
        ("a - (b - c)", AllOf((A, Not(AllOf((B, Not(C))))))),
        ("a - ~b", AllOf((A, Not(Not(B))))),
        ("a - b | c", AnyOf((AllOf((A, Not(B))), C))),
        ("(a b) c", AllOf((A, B, C))),
        ("a | (b | c)", AnyOf((A, B, C))),
        # A sign that touches digits is theirs, whatever stands before it.
        ("a -1", AllOf((A, Sense(1, positive=False)))),
        ("a-1", AllOf((A, Sense(1, positive=False)))),
        ("a - 1", AllOf((A, Not(Sense(1, positive=True))))),
        ("a - -1", AllOf((A, Not(Sense(1, positive=False))))),
        ("a-b", AllOf((A, Not(B)))),
        ("1 -3|~(2 3)", AnyOf((AllOf((Sense(1, positive=True), Sense(3, positive=False))),
                               Not(AllOf((Sense(2, positive=True), Sense(3, positive=True))))))),
    ],
)  # fmt: skip
def test_precedence(text: str, formula: Formula) -> None:
    assert parse(text) == formula


def test_columns_are_those_of_the_text() -> None:
    formula = parse("a - (key | -12)")
    assert isinstance(formula, AllOf)
    columns = [each.column for each in walk(formula) if isinstance(each, Sense | Name)]
    assert columns == [0, 5, 11]


# ------------------------------------------------------------------------------ Python's operators

S1, S2 = (halfstep.Surface(kind="sphere", radius=r, id=i) for i, r in ((1, 1.0), (2, 2.0)))
PARTS = {word: halfstep.Box(size=(1, 1, 1), name=word) for word in ("body", "boss", "bore", "key")}


def test_operators_build_what_the_parser_builds() -> None:
    body, boss, bore, key = PARTS.values()
    cell = halfstep.Cell("c", body, color=(1, 1, 1))
    pairs: list[tuple[Operand, str]] = [
        ((body | boss) - bore & ~key, "(body | boss) - bore & ~key"),
        (body & boss & bore, "body boss bore"),
        (body & (boss - bore), "body & boss - bore"),
        (body | boss | bore & key, "body | boss | bore key"),
        (body - (boss | bore), "body - (boss | bore)"),
        (~(body & boss), "~(body boss)"),
        (-S1 & +S2, "-1 2"),
        (-S1 & ~+S2 | body, "-1 ~2 | body"),
        (~cell & body, "~c & body"),
        (body, "body"),
    ]
    for built, text in pairs:
        scene = halfstep.Scene(
            camera=halfstep.Camera(center=(0, -5, 0), look_at=(0, 0, 0)),
            cells=[cell, halfstep.Cell("x", built, color=(1, 1, 1))],
        )
        assert scene.cells[1].region == parse(text), text


@pytest.mark.parametrize("other", [3, "body", None, S1])
def test_operators_take_nothing_else(other: object) -> None:
    body = PARTS["body"]
    for operation in (body.__and__, body.__or__, body.__sub__, (-S1).__and__):
        assert operation(other) is NotImplemented
    with pytest.raises(TypeError):
        _ = body & other


# ------------------------------------------------------------------------------------- faults

FAULTS = [
    ("", "the formula is empty"),
    (" \n\t", "the formula is empty"),
    ("(a | b", 'column 1: "(" is not closed'),
    ("a & (b | (c d)", 'column 5: "(" is not closed'),
    ("a)", 'column 2: ")" closes nothing'),
    ("(a)) b", 'column 4: ")" closes nothing'),
    (")", 'column 1: nothing stands before ")"'),
    ("| a", 'column 1: nothing stands before "|"'),
    ("- a", 'column 1: nothing stands before "-"'),
    ("(& a)", 'column 2: nothing stands before "&"'),
    ("a |", 'column 3: nothing stands after "|"'),
    ("a | | b", 'column 3: nothing stands after "|"'),
    ("a - & b", 'column 3: nothing stands after "-"'),
    ("a & ~", 'column 5: nothing stands after "~"'),
    ("a & ()", 'column 5: nothing stands after "("'),
    ("~ | a", 'column 1: nothing stands after "~"'),
    ("(", 'column 1: nothing stands after "("'),
    ("a + b", 'column 3: "+" is not followed by the id of a surface'),
    ("a + 1", 'column 3: "+" is not followed by the id of a surface'),
    ("a 2b", 'column 3: "2b" is neither a number nor a word'),
    ("a -2b", 'column 4: "2b" is neither a number nor a word'),
    ("1.5", 'column 2: "." has no meaning here'),
    ("a : b", 'column 3: ":" has no meaning here; write |'),
    ("#a", 'column 1: "#" has no meaning here; write ~'),
    ("!a", 'column 1: "!" has no meaning here; write ~'),
    ("a * b", 'column 3: "*" has no meaning here; write &'),
    ("a, b", 'column 2: "," has no meaning here'),
    ("a ٣", 'column 3: "٣" has no meaning here'),
    ("a \x1b", 'column 3: "\\u001b" has no meaning here'),
    ("a 0", 'column 3: "0" is no side of a surface; ids begin with 1'),
    ("-00", 'column 1: "-00" is no side of a surface; ids begin with 1'),
    ("2147483648", 'column 1: "2147483648" is no side of a surface; ids end with 2147483647'),
    ("9" * 5000, f'column 1: "{"9" * 78}… is no side of a surface; ids end with 2147483647'),
    ("a\n  | | b", 'line 2, column 3: nothing stands after "|"'),
    ("(" * 65 + "a" + ")" * 65, "column 65: more than 64 nested levels"),
    ("~" * 65 + "a", "column 65: more than 64 nested levels"),
    ("a | " + "~(" * 33 + "a" + ")" * 33, "column 69: more than 64 nested levels"),
    ("a " * (MAX_FORMULA_BYTES // 2) + "b", f"longer than {MAX_FORMULA_BYTES} bytes"),
]


@pytest.mark.parametrize(("text", "fault"), FAULTS, ids=[fault for _, fault in FAULTS])
def test_a_fault_and_its_column(text: str, fault: str) -> None:
    with pytest.raises(ValueError) as caught:
        parse(text)
    assert str(caught.value) == fault


def test_limits_are_allowed() -> None:
    parse("(" * 64 + "a" + ")" * 64)
    parse("~" * 64 + "a")
    parse("a " * (MAX_FORMULA_BYTES // 2))
    # Levels are closed again.
    parse("(a)" * 200 + " ~a" * 200)


def test_operators_nest_no_deeper_than_texts() -> None:
    formula = PARTS["body"] | PARTS["key"]
    for _ in range(63):
        formula = ~formula
    assert as_formula(formula) is formula
    assert parse(str(formula)) is not None
    for _ in range(100_000):
        formula = ~formula
    with pytest.raises(ValueError, match="more than 64 nested levels"):
        as_formula(formula)


@pytest.mark.parametrize("given", [3, None])
def test_what_is_no_formula(given: object) -> None:
    with pytest.raises(ValueError) as caught:
        as_formula(given)
    assert str(caught.value) == f"{given} is not a string"
