"""What is WGSL and what is a path is told apart; a file that cannot be read is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from halfstep.errors import UsageError
from halfstep.testing import Kit
from halfstep.testing.source import named_text

TWICE = "fn twice(x: f32) -> f32 { return x + x; }"


@pytest.mark.parametrize(
    "text",
    [
        f"{TWICE} // from noise.wgsl",
        f"{TWICE} /* noise.wgsl */",
        "// a line\n" * 1000 + f"{TWICE}\n// end of noise.wgsl",
        f"// noise.wgsl\n{TWICE}",
        "const A = 1; // a.wgsl",
        "// a.wgsl",
        "/**/a.wgsl",
        "a\nb.wgsl",
        "",
        "  ",
    ],
)
def test_wgsl_is_no_path(text: str) -> None:
    assert named_text(text) == ("WGSL", text)


@pytest.mark.parametrize("name", ["noise.wgsl", "two words.wgsl", "deep//noise.wgsl", "fn f.wgsl"])
def test_a_string_of_one_line_may_be_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text(TWICE)
    assert named_text(name) == (name, TWICE)
    assert named_text(str(tmp_path / name)) == (str(tmp_path / name), TWICE)


def test_a_path_object_may_have_any_ending(wgsl: Kit, tmp_path: Path) -> None:
    for name in ("f.wesl", "f.wgsl.in", "f {1};.txt"):
        path = tmp_path / name
        path.write_text(TWICE)
        assert wgsl.run(path, "twice", {"x": 2.0}).tolist() == [4.0]


def test_a_mark_of_the_encoding_is_no_text(wgsl: Kit, tmp_path: Path) -> None:
    path = tmp_path / "f.wgsl"
    path.write_text(TWICE, encoding="utf-8-sig")
    for source in (path, str(path), path.read_text(encoding="utf-8")):
        assert wgsl.run(source, "twice", {"x": 2.0}).tolist() == [4.0]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("shaders/f.wesl",
         "'shaders/f.wesl' is not WGSL; the path of a file is a path object, or a string that "
         "ends with .wgsl"),
        ("noise", "'noise' is not WGSL; the path of a file is a path object, or a string that "
         "ends with .wgsl"),
        ("nowhere.wgsl", "nowhere.wgsl: No such file or directory"),
        (f"{'a' * 5000}.wgsl", f"{'a' * 5000}.wgsl: File name too long"),
        ("a\0b.wgsl", "'a\\x00b.wgsl': embedded null byte"),
        (Path(), ".: Is a directory"),
        (5, "source: int is neither WGSL nor a path"),
        (None, "source: NoneType is neither WGSL nor a path"),
        (b"f.wgsl", "source: bytes is neither WGSL nor a path"),
    ],
)  # fmt: skip
def test_what_is_neither_is_named(wgsl: Kit, source: Any, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        wgsl.run(source, "f", {"x": 1.0})
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("encoding", "column"),
    [("latin-1", 7), ("utf-16", 1)],
)
def test_a_file_of_another_encoding_is_named(
    wgsl: Kit, tmp_path: Path, encoding: str, column: int
) -> None:
    path = tmp_path / "f.wgsl"
    path.write_bytes(f"// caf\xe9\n{TWICE}".encode(encoding))
    with pytest.raises(UsageError) as caught:
        wgsl.run(path, "twice", {"x": 2.0})
    assert str(caught.value) == f"{path}: line 1, column {column}: not UTF-8 text"
