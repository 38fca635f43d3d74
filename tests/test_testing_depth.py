"""What is nested so deeply that a compiler would end the process is refused; what is not, runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit
from halfstep.testing.tokens import MOST_LEVELS


def _function(value: str) -> str:
    return f"fn f(x: f32) -> f32 {{ return {value}; }}"


DEEP: dict[str, Callable[[int], str]] = {
    "round brackets": lambda n: _function("(" * n + "x" + ")" * n),
    "calls": lambda n: _function("abs(" * n + "x" + ")" * n),
    "square brackets": lambda n: (
        "const a = array(0);\n" + _function("x + f32(" + "a[" * n + "0" + "]" * n + ")")
    ),
    "types": lambda n: f"alias T = {'array<' * n}f32{', 1>' * n};\n" + _function("x"),
    "a constant": lambda n: f"const N = {'(' * n}1{')' * n};\n" + _function("x"),
    "signs": lambda n: _function("- " * n + "x"),
    "pointers": lambda n: f"fn f(x: f32) -> f32 {{ var y = x; return {'*&' * (n // 2)}y; }}",
    "branches": lambda n: (
        "fn f(x: f32) -> f32 { if x < 0 { return 0; } "
        + "else if x == 0 { return 0; } " * (n - 1)
        + "else { return x; } }"
    ),
}


@pytest.mark.parametrize("sort", DEEP)
def test_what_is_nested_too_deeply_is_refused(wgsl: Kit, sort: str) -> None:
    x = np.array([1, 2], np.float32)
    # Half of the levels; of signs that is an even number.
    assert wgsl.run(DEEP[sort](MOST_LEVELS // 2), "f", {"x": x}).tolist() == [1, 2]
    with pytest.raises(UsageError) as caught:
        wgsl.run(DEEP[sort](20 * MOST_LEVELS), "f", {"x": x})
    assert str(caught.value).startswith("WGSL: more than 1,000 levels of ")


def test_what_is_not_nested_may_be_long(wgsl: Kit) -> None:
    many = 3 * MOST_LEVELS
    statements = "if x < 0 { y = 0; } else if x == -1 { y = 1; } " * many
    source = (
        f"fn f(x: f32) -> f32 {{ var y = x; {statements} return y{' + (x - x)' * many}; }}\n"
        + f"fn g(x: f32) -> bool {{ return {' && '.join(['x < 2'] * (MOST_LEVELS // 2))}; }}\n"
    )
    assert wgsl.run(source, "f", {"x": np.array([3], np.float32)}).tolist() == [3]
    assert wgsl.run(source, "g", {"x": np.array([1], np.float32)}).tolist() == [True]


def test_a_chain_of_aliases_that_is_too_long_to_follow_is_refused(wgsl: Kit) -> None:
    aliases = "".join(f"alias T{k + 1} = T{k};\n" for k in range(5000))
    with pytest.raises(UsageError, match="nested too deeply"):
        wgsl.run(
            f"alias T0 = f32;\n{aliases}fn f(x: T5000) -> f32 {{ return x; }}", "f", {"x": 1.0}
        )
