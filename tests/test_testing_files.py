"""A source of several files, or of what a preprocessor makes: errors keep file and line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit

CONSTANTS = "const SCALE = 3.0;\nstruct Pair { a: f32, b: f32 }\n"
HELPERS = """\
// Helpers.
fn scaled(x: f32) -> f32 {
  return x * SCALE;
}
"""
MAIN = """\
fn both(x: f32) -> f32 {
#ifdef LOUD
  return scaled(x) + 1.0;
#else
  return scaled(x);
#endif
}
"""
X = np.arange(4, dtype=np.float32)


def ifdef(text: str) -> str:
    """The lines for which LOUD is not defined."""
    lines, keeps = [], True
    for line in text.split("\n"):
        if line.startswith("#"):
            keeps = line != "#ifdef LOUD"
        elif keeps:
            lines.append(line)
    return "\n".join(lines)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    paths = []
    for name, text in (("constants", CONSTANTS), ("helpers", HELPERS), ("main", MAIN)):
        paths.append(tmp_path / f"{name}.wgsl")
        paths[-1].write_text(text)
    return paths


def test_files_one_after_another(wgsl: Kit, files: list[Path]) -> None:
    wgsl.check(files, "both", lambda x: 3 * x, {"x": X}, preprocess=ifdef)
    found = wgsl.run([CONSTANTS, files[1]], "scaled", {"x": X})
    np.testing.assert_array_equal(found, 3 * X)
    assert wgsl.struct(tuple(files), "Pair", preprocess=ifdef).names == ("a", "b")


def test_a_preprocessor_sees_every_file_alone(wgsl: Kit, files: list[Path]) -> None:
    seen: list[str] = []

    def noting(text: str) -> str:
        seen.append(text)
        return ifdef(text)

    wgsl.run(files, "both", {"x": X}, preprocess=noting)
    assert seen == [CONSTANTS, HELPERS, MAIN]


def test_what_a_preprocessor_makes_is_what_runs(wgsl: Kit) -> None:
    template = "fn f(x: f32) -> f32 { return x * {{GAIN}}; }"
    for gain in ("2.0", "5.0"):

        def filled(text: str, gain: str = gain) -> str:
            return text.replace("{{GAIN}}", gain)

        found = wgsl.run(template, "f", {"x": X}, preprocess=filled)
        np.testing.assert_array_equal(found, float(gain) * X)


def test_kernels_and_programs_too(wgsl: Kit) -> None:
    parts = [
        "@group(0) @binding(0) var<storage, read_write> d: array<f32>;",
        "#define N 4\n@compute @workgroup_size(N) fn main(@builtin(local_invocation_index) i: u32)"
        "\n{ d[i] *= 2.0; }",
    ]

    def define(text: str) -> str:
        return text.replace("#define N 4", "").replace("(N)", "(4)")

    wgsl.compare(wgsl.kernel(parts, "main", {"d": X}, preprocess=define), {"d": 2 * X})
    program = wgsl.program(parts, {"d": X}, preprocess=define)
    program.dispatch("main")
    wgsl.compare(program.read("d"), 2 * X)


def shown(call: Callable[[], object]) -> str:
    with pytest.raises(UsageError) as caught:
        call()
    return str(caught.value)


def test_an_error_has_the_line_of_its_file(wgsl: Kit, files: list[Path]) -> None:
    files[1].write_text(HELPERS.replace("x * SCALE", "x * SIZE"))
    message = shown(lambda: wgsl.run(files[:2], "scaled", {"x": X}))
    assert f"┌─ {files[1]}:3:14\n" in message
    assert ("\n3 │" in message) == wgsl._compute.is_naga
    assert "  return x * SIZE;\n" in message
    assert "SIZE" in message.split("\n", maxsplit=1)[0]


def test_an_error_has_the_line_before_the_preprocessor(wgsl: Kit, files: list[Path]) -> None:
    files[2].write_text(MAIN.replace("return scaled(x);", "return scald(x);"))
    message = shown(lambda: wgsl.run(files, "both", {"x": X}, preprocess=ifdef))
    assert f"┌─ {files[2]}:5:10\n" in message
    assert ("\n 5 │" in message) == wgsl._compute.is_naga
    assert "  return scald(x);\n" in message


def test_a_line_that_the_preprocessor_wrote_is_told_as_such(wgsl: Kit, tmp_path: Path) -> None:
    path = tmp_path / "made.wgsl"
    path.write_text("#include more\nfn f(x: f32) -> f32 { return x; }\n")
    made = "// first\nconst A: f32 = 1u;\n"
    message = shown(
        lambda: wgsl.run(path, "f", {"x": X}, preprocess=lambda t: t.replace("#include more", made))
    )
    assert f"┌─ {path} preprocessed:2:" in message
    assert "const A: f32 = 1u;" in message


def test_a_long_file_keeps_the_column_of_its_line_numbers(wgsl: Kit, tmp_path: Path) -> None:
    path = tmp_path / "short.wgsl"
    path.write_text("fn f(x: f32) -> f32 {\n  return y;\n}\n")
    message = shown(lambda: wgsl.run(["// a line\n" * 200, path], "f", {"x": X}))
    assert f"┌─ {path}:2:10\n" in message
    assert ("\n  2 │" in message) == wgsl._compute.is_naga
    assert "  return y;\n" in message


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        ([], {}, "source: an empty list"),
        ([5], {}, "source: int is neither WGSL nor a path"),
        (["fn f() {}", "nowhere.wgsl"], {}, "nowhere.wgsl: No such file or directory"),
        (["fn f() {}", "/* open"], {}, "WGSL 2: the comment that begins in line 1 is not closed"),
        (["fn g() {}", "fn f() {}"], {"function": "h"},
         "WGSL 1, WGSL 2: there is no function 'h'; there are g, f"),
        ("fn f(x: f32) -> f32 { return x; }", {"preprocess": lambda _: None},
         "preprocess: gave NoneType for WGSL, not a text"),
    ],
)  # fmt: skip
def test_what_is_no_source_is_named(
    wgsl: Kit, source: Any, options: dict[str, Any], message: str
) -> None:
    options = {"function": "f", "inputs": {"x": X}} | options
    assert shown(lambda: wgsl.run(source, **options)) == message


def test_a_string_is_a_path_from_the_folder_of_the_test(
    wgsl: Kit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Wherever pytest runs: this file of another project lies beside this test.
    monkeypatch.chdir(tmp_path)
    wgsl.run("outside/tone.wgsl", "level", {"light": X})
    (tmp_path / "here.wgsl").write_text("fn f(x: f32) -> f32 { return x; }")
    wgsl.run("here.wgsl", "f", {"x": X})
    assert shown(lambda: wgsl.run(Path("outside/tone.wgsl"), "level", {"light": X})) == (
        "outside/tone.wgsl: No such file or directory"
    )
