"""What is said of testing shaders is so: its example, its calls, and the recipe for CI."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from halfstep import testing
from halfstep.testing import Kit, MismatchError

ROOT = Path(__file__).parents[1]
README = "gpu/testing/README.md"
TEXT = (ROOT / README).read_text(encoding="utf-8")
WORKFLOW = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")


PROGRAMS = re.findall(r"^```python\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def example() -> dict[str, Any]:
    """The names that the first program of the README defines."""
    names: dict[str, Any] = {}
    exec(compile(PROGRAMS[0], README, "exec"), names)
    return names


def test_the_example_passes(wgsl: Kit) -> None:
    example()["test_hypot"](wgsl)


@pytest.mark.parametrize("number", range(1, len(PROGRAMS)))
def test_later_examples_pass(wgsl: Kit, number: int) -> None:
    # They go on where the first left off.
    names = example()
    before = set(names)
    exec(compile(PROGRAMS[number], README, "exec"), names)
    for name in [name for name in names if name.startswith("test_") and name not in before]:
        names[name](wgsl)


def test_over_more_decades_it_fails_as_shown(wgsl: Kit) -> None:
    [shown] = re.findall(r"^```\n(hypot: .*?)^  …\n```$", TEXT, re.MULTILINE | re.DOTALL)
    names = example()
    names["decades"] = partial(testing.decades, high=1e30)
    with pytest.raises(MismatchError) as excinfo:
        names["test_hypot"](wgsl)
    # Another processor's logarithm and hypotenuse may be a unit off: digits do not count.
    text, wanted = (re.sub(r"-?[\d.e+]*\d", "#", part) for part in (str(excinfo.value), shown))
    assert text.startswith(wanted)


def test_the_calls_are_there_as_listed() -> None:
    calls = re.findall(r"^\| `([\w.]+)\((.*?)\)` \|", TEXT, re.MULTILINE)
    assert len(calls) == 9
    for name, arguments in calls:
        owner, _, last = name.rpartition(".")
        assert owner in ("wgsl", "halfstep.testing")
        call: Callable[..., Any] = getattr(Kit if owner == "wgsl" else testing, last)
        parameters = [p for p in inspect.signature(call).parameters.values() if p.name != "self"]
        listed = [part.partition("=") for part in arguments.split(", ") if part != "*"]
        if last == "assert_frames_match":  # its parameters have longer names
            assert len(listed) == 2
            continue
        assert [name for name, _, _ in listed] == [p.name for p in parameters]
        for (_, _, default), parameter in zip(listed, parameters, strict=True):
            assert not default or repr(parameter.default) == default


def test_the_recipe_has_what_the_readme_explains() -> None:
    rows = TEXT[TEXT.index("| | |") :].split("\n\n")[0]
    explained = [
        name for row in rows.splitlines() for name in re.findall(r"`(.+?)`", row.split("|")[1])
    ]
    assert len(explained) == 6
    for name in explained:
        assert name in WORKFLOW, name
    assert 'HALFSTEP_EXPECT_LAVAPIPE: "1"' in WORKFLOW
