"""The two marks of WGSL files, and loops: what is kept, what is repeated, and where a loop ends."""

from __future__ import annotations

import re

import pytest

from halfstep.shader.expand import expand, marks

TEXT = """\
struct Sight {
  hit: b4,
  left: b4,  // through a surface  //? exit
}

fn visit(
  // each quad
  x_0: i4,
  solid: Solid,  //? !flat & exit
) {
  // each quad
  var sum_0 = x_0 + f(x_0, 10, a_00);
  // each quad
  slope_0 = x_0;  //? normal
  for (var k = 1u; k < solid.count; k++) {
    // each quad
    {
      sum_0 = g(  //? exit
        sum_0,
      );
      sum_0 += 1;
    }
  }
}
"""


def test_without_facts_marked_lines_go() -> None:
    assert (
        expand(TEXT, (), 1)
        == """\
struct Sight {
  hit: b4,
}

fn visit(
  x_0: i4,
) {
  var sum_0 = x_0 + f(x_0, 10, a_00);
  if 1u < solid.count {
    var k = 1u;
    loop {
      {
        sum_0 += 1;
      }
      k++;
      if k >= solid.count {
        break;
      }
    }
  }
}
"""
    )


def test_statements_are_repeated_for_each_quad() -> None:
    assert (
        expand(TEXT, ("exit", "normal"), 2)
        == """\
struct Sight {
  hit: b4,
  left: b4,  // through a surface
}

fn visit(
  x_0: i4,
  x_1: i4,
  solid: Solid,
) {
  var sum_0 = x_0 + f(x_0, 10, a_00);
  var sum_1 = x_1 + f(x_1, 10, a_00);
  slope_0 = x_0;
  slope_1 = x_1;
  if 1u < solid.count {
    var k = 1u;
    loop {
      {
        sum_0 = g(
          sum_0,
        );
        sum_0 += 1;
      }
      {
        sum_1 = g(
          sum_1,
        );
        sum_1 += 1;
      }
      k++;
      if k >= solid.count {
        break;
      }
    }
  }
}
"""
    )


@pytest.mark.parametrize(
    ("facts", "there"),
    [((), False), (("exit",), True), (("flat",), False), (("exit", "flat"), False)],
)
def test_facts_are_joined_and_denied(facts: tuple[str, ...], there: bool) -> None:
    assert ("solid: Solid" in expand(TEXT, facts, 1)) == there


def test_loops_within_loops_end_in_turn() -> None:
    text = """\
for (var i = 0u; i < 2u; i++) {
  for (var j = i; j < n; j++) {
    f(i, j);
  }
}
"""
    found = expand(text, (), 1)
    assert "for" not in found
    words = re.findall(r"loop|break|[ij]\+\+|f\(", found)
    assert words == ["loop", "loop", "f(", "j++", "break", "i++", "break"]
    depth = 0
    for line in found.splitlines():
        depth -= line.strip().startswith("}")
        assert line == "  " * depth + line.strip()
        depth += line.endswith("{")
    assert depth == 0


def test_what_a_text_asks_for() -> None:
    assert marks(TEXT) == {"exit", "flat", "normal"}


def test_loops_are_written_out() -> None:
    text = """\
fn f() {
  // written out
  for (var j = 1u; j < DEGREE; j++) {
    g(j, "jj");
    // written out
    for (var k = j; k < DEGREE + 1u - 2u; k++) {
      h(j + k);
    }
  }
}
"""
    found = expand(text, (), 1, {"DEGREE": 4})
    assert re.findall(r"g\(\du|h\(\du \+ \du", found) == [
        "g(1u", "h(1u + 1u", "h(1u + 2u", "g(2u", "h(2u + 2u", "g(3u",
    ]  # fmt: skip
    assert found.count("{") == found.count("}")
    assert "for" not in found
    assert "written" not in found
    assert '"jj"' in found
