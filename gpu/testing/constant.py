"""The values of constant expressions of WGSL.

An expression is evaluated only if every compiler must find the same value: whole numbers and truth
values by the rules of their types, and floats if IEEE 754 leaves no choice.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from halfstep.testing.tokens import Tokens, closing, split, written

# Type -> least and largest number. "int" is the type of a number without suffix and fraction.
WHOLE = {
    "int": (-(2**63), 2**63 - 1),
    "i32": (-(2**31), 2**31 - 1),
    "u32": (0, 2**32 - 1),
    "i64": (-(2**63), 2**63 - 1),
    "u64": (0, 2**64 - 1),
}
# "float" is the type of a number without suffix but with a fraction.
_FLOATS: dict[str, Any] = {
    "float": np.float64,
    "f64": np.float64,
    "f32": np.float32,
    "f16": np.float16,
}
_INTEGER = re.compile(r"(0[xX][\da-fA-F]+|0|[1-9]\d*)(i|u|li|lu)?")
_DECIMAL = re.compile(r"(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)(f|h|lf)?")
_HEXADECIMAL = re.compile(r"(0[xX][\da-fA-F]*\.?[\da-fA-F]*(?:[pP][+-]?\d+)?)(f|h)?")
_SUFFIXES = {"i": "i32", "u": "u32", "li": "i64", "lu": "u64", "f": "f32", "h": "f16", "lf": "f64"}

# Operators by level; the first level binds least.
_LEVELS = (
    ("||",),
    ("&&",),
    ("|",),
    ("^",),
    ("&",),
    ("==", "!="),
    ("<", ">", "<=", ">="),
    ("<<", ">>"),
    ("+", "-"),
    ("*", "/", "%"),
)
_SIGNS = {sign for level in _LEVELS for sign in level}


class Constant(NamedTuple):
    """A number or truth value of a type.

    Attributes:
        type: "bool", one of `WHOLE`, "float", "f64", "f32" or "f16".
        value: a bool, an int, or a float of NumPy.
    """

    type: str
    value: Any


# Gives the meaning of a name: a constant, a scalar type, or None if only WGSL declares the name. It
# raises ValueError for any other name.
Names = Callable[[str], Constant | str | None]


def evaluate(tokens: Tokens, names: Names) -> Constant:
    """The value of an expression.

    Raises:
        ValueError, ArithmeticError: it is no constant expression, or cannot be evaluated here.
    """
    reader = _Reader(tokens, names)
    value = reader.binary()
    if reader.left:
        raise ValueError
    return value


def convert(type_: str, constant: Constant) -> Constant:
    """A constant converted to another type, as ``u32(x)`` does.

    Raises:
        ValueError, ArithmeticError: the type does not hold the value, or the type is unknown.
    """
    value = constant.value
    if type_ == "bool":
        return Constant("bool", bool(value))
    if type_ in _FLOATS:
        return _float(type_, value)
    low, high = WHOLE[type_] if type_ in WHOLE else _fail()
    if constant.type in _FLOATS:
        return _whole(type_, int(np.trunc(value)))
    if constant.type not in ("bool", "int"):
        # The conversion keeps the bits.
        value = (value - low) % (high - low + 1) + low
    return _whole(type_, int(value))


def as_declared(type_: str, constant: Constant) -> Constant:
    """A constant converted to the type in its declaration.

    Raises:
        ValueError, ArithmeticError: as `convert`.
    """
    allowed = {constant.type}
    if constant.type in ("int", "float"):
        allowed |= _FLOATS.keys()
    if constant.type == "int":
        allowed |= WHOLE.keys()
    return convert(type_, constant) if type_ in allowed else _fail()


def _fail() -> Any:
    raise ValueError


class _Reader:
    """Reads an expression from left to right."""

    def __init__(self, tokens: Tokens, names: Names) -> None:
        self.left = tokens
        self._names = names

    def binary(self, level: int = 0) -> Constant:
        """An expression with operators of a level and of those that bind more."""
        if level == len(_LEVELS):
            return self._unary()
        left = self.binary(level + 1)
        while (sign := self._sign()) in _LEVELS[level]:
            self.left = self.left[len(sign) :]
            left = _operate(sign, left, self.binary(level + 1))
        return left

    def _sign(self) -> str:
        """The next operator, which may consist of two signs."""
        pair = written(self.left[:2])
        return pair if pair in _SIGNS else "".join(self.left[:1])

    def _unary(self) -> Constant:
        match self.left[:1]:
            case ("-" | "!" | "~" as sign,):
                self.left = self.left[1:]
                return _UNARY[sign](self._unary())
            case ("(",):
                return evaluate(self._arguments(), self._names)
            case ("true" | "false" as word,):
                self.left = self.left[1:]
                return Constant("bool", word == "true")
            case (token,) if token.is_name:
                return self._named(str(token))
            case (token,):
                self.left = self.left[1:]
                return _literal(token)
            case _:
                return _fail()

    def _named(self, name: str) -> Constant:
        """A constant, a conversion or a call."""
        self.left = self.left[1:]
        meant = self._names(name)
        if isinstance(meant, Constant):
            return meant
        arguments = [evaluate(part, self._names) for part in split(self._arguments())]
        if meant is None:
            return _FUNCTIONS[name](arguments) if name in _FUNCTIONS else _fail()
        [argument] = arguments
        return convert(meant, argument)

    def _arguments(self) -> Tokens:
        """The tokens in the next brackets."""
        if self.left[:1] != ("(",):
            raise ValueError
        end = closing(list(self.left), 0)
        if end == len(self.left):
            raise ValueError
        inner, self.left = self.left[1:end], self.left[end + 1 :]
        return inner


def _literal(text: str) -> Constant:
    if match := _INTEGER.fullmatch(text):
        return _whole(_SUFFIXES[match[2]] if match[2] else "int", int(match[1], 0))
    if not text.isdigit() and (match := _DECIMAL.fullmatch(text)):
        return _float(_SUFFIXES[match[2]] if match[2] else "float", float(match[1]))
    if match := _HEXADECIMAL.fullmatch(text):
        return _float(_SUFFIXES[match[2]] if match[2] else "float", float.fromhex(match[1]))
    return _fail()


def _whole(type_: str, value: int) -> Constant:
    low, high = WHOLE[type_]
    if not low <= value <= high:
        raise OverflowError
    return Constant(type_, value)


def _float(type_: str, value: Any) -> Constant:
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        result = _FLOATS[type_](value)
    if not np.isfinite(result):
        raise OverflowError
    return Constant(type_, result)


def _wrapped(type_: str, value: int) -> Constant:
    """A result of arithmetic: unsigned types wrap, others must not overflow."""
    return _whole(type_, value % (WHOLE[type_][1] + 1) if type_[0] == "u" else value)


def _alike(*constants: Constant) -> list[Constant]:
    """The constants in one type; a constant without a type takes that of the others."""
    types = {one.type for one in constants}
    stated = types - {"int", "float"}
    if len(stated) > 1 or (types > stated and "bool" in stated):
        raise ValueError
    target = min(stated or types, key=("float", "int", *stated).index)
    if "float" in types and target in WHOLE:
        raise ValueError
    return [one if one.type == target else convert(target, one) for one in constants]


def _operate(sign: str, a: Constant, b: Constant) -> Constant:
    if sign in ("<<", ">>"):
        return _shifted(sign, a, b)
    a, b = _alike(a, b)
    if sign in _COMPARED:
        if a.type == "bool" and sign not in ("==", "!="):
            raise ValueError
        return Constant("bool", bool(_COMPARED[sign](a.value, b.value)))
    if a.type == "bool":
        return Constant("bool", _JOINED[sign](a.value, b.value) if sign in _JOINED else _fail())
    if a.type in _FLOATS:
        with np.errstate(all="raise", under="ignore"):
            return _float(a.type, _REAL[sign](a.value, b.value) if sign in _REAL else _fail())
    return _wrapped(a.type, _INTEGRAL[sign](a.value, b.value) if sign in _INTEGRAL else _fail())


def _shifted(sign: str, a: Constant, b: Constant) -> Constant:
    bits = 32 if a.type in ("i32", "u32") else 64
    if a.type not in WHOLE or b.type not in WHOLE or not 0 <= b.value < bits:
        raise ValueError
    # A shift that loses bits on the left is an error.
    return _whole(a.type, a.value << b.value if sign == "<<" else a.value >> b.value)


def _quotient(a: int, b: int) -> int:
    """a / b, rounded toward zero."""
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def _remainder(a: int, b: int) -> int:
    """The remainder of a / b, with the sign of a."""
    return a - b * _quotient(a, b)


_COMPARED: dict[str, Callable[[Any, Any], Any]] = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    ">": lambda a, b: a > b,
    "<=": lambda a, b: a <= b,
    ">=": lambda a, b: a >= b,
}
_JOINED: dict[str, Callable[[bool, bool], bool]] = {
    "&&": lambda a, b: a and b,
    "||": lambda a, b: a or b,
    "&": lambda a, b: a and b,
    "|": lambda a, b: a or b,
}
_INTEGRAL: dict[str, Callable[[int, int], int]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _quotient,
    "%": _remainder,
    "&": lambda a, b: a & b,
    "|": lambda a, b: a | b,
    "^": lambda a, b: a ^ b,
}
_REAL: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "%": np.fmod,
}


def _negated(a: Constant) -> Constant:
    if a.type in _FLOATS:
        return Constant(a.type, -a.value)
    return _fail() if a.type == "bool" or a.type[0] == "u" else _whole(a.type, -a.value)


def _inverted(a: Constant) -> Constant:
    return _wrapped(a.type, ~a.value) if a.type in WHOLE else _fail()


def _not(a: Constant) -> Constant:
    return Constant("bool", not a.value) if a.type == "bool" else _fail()


_UNARY: dict[str, Callable[[Constant], Constant]] = {"-": _negated, "~": _inverted, "!": _not}


def _of_numbers(count: int, function: Callable[..., Any]) -> Callable[[list[Constant]], Constant]:
    """A built-in function from ``count`` numbers of one type to a number of that type."""

    def call(arguments: list[Constant]) -> Constant:
        arguments = _alike(*arguments)
        if len(arguments) != count or arguments[0].type == "bool":
            raise ValueError
        type_, result = arguments[0].type, function(*(one.value for one in arguments))
        return _float(type_, result) if type_ in _FLOATS else _whole(type_, int(result))

    return call


def _of_a_float(function: Callable[[Any], Any]) -> Callable[[list[Constant]], Constant]:
    """A built-in function from a float to a float."""

    def call(arguments: list[Constant]) -> Constant:
        [argument] = arguments
        if argument.type == "int":
            argument = convert("float", argument)
        if argument.type not in _FLOATS:
            raise ValueError
        return _float(argument.type, function(argument.value))

    return call


def _of_bits(function: Callable[[int], int]) -> Callable[[list[Constant]], Constant]:
    """A built-in function of the 32 bits of a whole number."""

    def call(arguments: list[Constant]) -> Constant:
        [argument] = arguments
        if argument.type == "int":
            argument = convert("i32", argument)
        if argument.type not in ("i32", "u32"):
            raise ValueError
        return _whole(argument.type, function(argument.value))

    return call


def _select(arguments: list[Constant]) -> Constant:
    no, yes, condition = arguments
    no, yes = _alike(no, yes)
    if condition.type != "bool":
        raise ValueError
    return yes if condition.value else no


_FUNCTIONS: dict[str, Callable[[list[Constant]], Constant]] = {
    "abs": _of_numbers(1, abs),
    "clamp": _of_numbers(3, lambda x, low, high: min(max(x, low), high)),
    "max": _of_numbers(2, max),
    "min": _of_numbers(2, min),
    "sign": _of_numbers(1, np.sign),
    "ceil": _of_a_float(np.ceil),
    "floor": _of_a_float(np.floor),
    "round": _of_a_float(np.rint),
    "sqrt": _of_a_float(np.sqrt),
    "trunc": _of_a_float(np.trunc),
    "countLeadingZeros": _of_bits(lambda x: 32 - (x % 2**32).bit_length()),
    "countOneBits": _of_bits(lambda x: (x % 2**32).bit_count()),
    "countTrailingZeros": _of_bits(lambda x: (x & -x).bit_length() - 1 if x else 32),
    # For 0 it is -1, whose bits are another number in a u32.
    "firstLeadingBit": _of_bits(lambda x: (~x if x < 0 else x).bit_length() - 1),
    "firstTrailingBit": _of_bits(lambda x: (x & -x).bit_length() - 1),
    "select": _select,
}
