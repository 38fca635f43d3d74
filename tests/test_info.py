"""`halfstep info`: what a file tells, and a clear word where it tells nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import halfstep
from halfstep.cli import main
from halfstep.files import READ
from halfstep.frames.frame import Frame, Info

INFO: Info = {
    "adapter": "a card",
    "driver": "a driver 1.2",
    "number_format": "float32",
    "method": "visible",
    "steps": [14, 0, 9],
    "wall_ms": 12.5,
    "scene_title": "A vase",
    "scene_sha256": "0123abcd",
    "version": "9.9",
}


def frame(title: str = "A vase") -> Frame:
    info = INFO.copy()
    info["scene_title"] = title
    return Frame({"solid": np.array([[0, -1, 2]])}, info)


def test_a_file_tells_how_it_was_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.png"
    halfstep.write(path, frame(), ["solid"])
    assert main(["info", str(path)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out == (
        "version        9.9\n"
        "scene_title    A vase\n"
        "scene_sha256   0123abcd\n"
        "number_format  float32\n"
        "method         visible\n"
        "steps          14, 0, 9\n"
        "adapter        a card\n"
        "driver         a driver 1.2\n"
        "outputs        solid\n"
    )


@pytest.mark.parametrize("ending", [".png", ".tif", ".npz"])
def test_and_for_machines(tmp_path: Path, ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"a{ending}"
    told = halfstep.write(path, frame(), ["solid"])
    assert main(["info", str(path), "--json"]) == 0
    out, err = capsys.readouterr()
    assert (json.loads(out), err) == (told, "")


def test_a_title_cannot_write_over_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.png"
    halfstep.write(path, frame("A\nvase \x1b[2J"), ["solid"])
    assert main(["info", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[1] == r"scene_title    A\nvase \x1b[2J"


def test_a_file_that_tells_nothing_is_said_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.png"
    Image.new("RGB", (3, 2)).save(path)
    for options in ([], ["--json"]):
        assert main(["info", str(path), *options]) == 1
        assert capsys.readouterr() == (
            "",
            f"{path}: does not say how it was made; Halfstep did not write it, or another program "
            "has written it again\n",
        )


@pytest.mark.parametrize(
    ("name", "code", "message"),
    [
        ("none.png", 2, "{path}: there is no such file\n"),
        ("a.txt", 2, "{path}: the ending '.txt' is not one of those read: {endings}\n"),
        ("folder", 2, "{path}: is a folder, not a file\n"),
        ("pipe", 2, "{path}: is a device or a pipe, not a file\n"),
        ("a.png", 1, "{path}: cannot be read as PNG: not a PNG file\n"),
        ("a.tif", 1, "{path}: cannot be read as TIFF: not a TIFF file\n"),
    ],
)
def test_what_cannot_be_read_is_refused(
    tmp_path: Path, name: str, code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.txt").touch()
    (tmp_path / "a.png").write_bytes(b"text")
    (tmp_path / "a.tif").write_bytes(b"text")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / name
    assert main(["info", str(path)]) == code
    assert capsys.readouterr() == ("", message.format(path=path, endings=", ".join(READ)))


def test_what_a_library_logs_of_a_broken_file_is_not_printed(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    halfstep.write(path, frame(), ["solid"])
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    # In a process of its own: here pytest has a handler.
    told = subprocess.run(
        [sys.executable, "-m", "halfstep", "info", str(path)], capture_output=True, text=True
    )
    assert told.returncode == 1
    assert len(told.stderr.splitlines()) == 1
    assert told.stderr.startswith(f"{path}: ")
