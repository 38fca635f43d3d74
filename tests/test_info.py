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
from halfstep.files import READ, read_frame
from halfstep.frames import pick
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


@pytest.fixture(scope="module")
def assembly() -> Frame:
    return halfstep.render("assembly_17x17", size=(48, 36), backend="numpy", outputs=pick.OUTPUTS)


def test_a_pixel_of_a_file_is_told_as_the_frame_knows_it(
    assembly: Frame, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.npz"
    halfstep.write(path, assembly)
    shown = 0
    for row, column in np.ndindex(assembly.solid.shape):
        if (row + column) % 40:
            continue
        assert main(["info", str(path), "--pixel", f"{column},{row}"]) == 0
        out = capsys.readouterr().out
        if assembly.solid[row, column] < 0:
            sure = "" if np.isfinite(assembly.error[row, column]) else ", which is not certain"
            assert out == f"pixel {column}, {row}: nothing{sure}\n"
            continue
        shown += 1
        place = int(assembly.place[row, column])
        if place < 0:
            assert out.startswith(f"pixel {column}, {row}: cell nozzle, surface ")
        else:
            # The lattice has 17 columns, and nothing else has copies.
            where = f"lattice[0], row {place // 17}, column {place % 17} / cell "
            assert where in out
        depth, error = assembly.depth[row, column], assembly.error[row, column]
        limit = f"± {error:.2g}" if np.isfinite(error) else "(not certain)"
        assert f", depth {depth:.9g} {limit}, position " in out
        point = ", ".join(f"{each:.6g}" for each in assembly.position[row, column])
        assert out.endswith(f", position {point}\n")
    assert shown > 10


def test_a_file_keeps_the_paths_of_all_pixels(assembly: Frame, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    halfstep.write(path, assembly, ["depth"])
    with np.load(path, allow_pickle=False) as arrays:
        assert set(arrays) == {"depth", "solid", "provenance", "paths", "path"}
        paths, which = json.loads(str(arrays["paths"])), arrays["path"]
    assert len({tuple(one) for one in paths}) == len(paths) > 20
    for row, column in np.ndindex(which.shape):
        assert paths[which[row, column]] == assembly.cell_path(row, column)
    # What is read and written again still has them.
    again = read_frame(path)
    assert again.outputs == ("solid", "depth")
    halfstep.write(tmp_path / "b.npz", again)
    assert read_frame(tmp_path / "b.npz").cell_path(20, 20) == assembly.cell_path(20, 20)


def test_a_pixel_for_machines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arrays = {
        "solid": np.array([[3, -1]], np.int32),
        "depth": np.array([[1.5, np.inf]]),
        "error": np.array([[np.inf, 0.0]]),
        "position": np.array([[[1, 2, 3], [np.nan] * 3]], np.float64),
    }
    path = tmp_path / "a.npz"
    halfstep.write(path, Frame(arrays, INFO))
    told = []
    for pixel in ("0,0", "1,0"):
        assert main(["info", str(path), "--pixel", pixel, "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out))
    assert told == [
        {"pixel": [0, 0], "path": ["solid[3]"], "solid": 3, "depth": 1.5,
         "position": [1, 2, 3], "error": None},
        {"pixel": [1, 0], "path": [], "solid": -1, "depth": None, "position": [None] * 3,
         "error": 0},
    ]  # fmt: skip
    assert main(["info", str(path), "--pixel", "0,0"]) == 0
    out = capsys.readouterr().out
    assert out == "pixel 0, 0: solid[3], depth 1.5 (not certain), position 1, 2, 3\n"


@pytest.mark.parametrize(
    ("name", "pixel", "message"),
    [
        ("a.npz", "1,0", "--pixel: 1,0 is not in a picture of 1x2"),
        ("a.npz", "0,2", "--pixel: 0,2 is not in a picture of 1x2"),
        ("a.png", "0,0", "{}: only .npz files tell what a pixel shows"),
        ("b.npz", "0,0", "{}: there is no such file"),
        ("not.npz", "0,0", "{}: cannot be read as NPZ: "),
        ("other.npz", "0,0",
         "{}: cannot be read as NPZ: it holds no solids, or does not say how it was made"),
        ("sizes.npz", "0,0",
         "{}: cannot be read as NPZ: depth: float64 of shape (3,) is no such output"),
        ("paths.npz", "0,0",
         "{}: cannot be read as NPZ: its paths are not those of its pixels"),
    ],
)  # fmt: skip
def test_a_pixel_that_cannot_be_told_is_said_to(
    tmp_path: Path, name: str, pixel: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    one = Frame({"solid": np.array([[1], [2]], np.int32)}, INFO)
    halfstep.write(tmp_path / "a.npz", one)
    halfstep.write(tmp_path / "a.png", one)
    (tmp_path / "not.npz").write_bytes(b"PK no zip")
    np.savez(tmp_path / "other.npz", solid=one.solid)
    with np.load(tmp_path / "a.npz") as arrays:
        held = dict(arrays)
    np.savez(tmp_path / "sizes.npz", **held, depth=np.zeros(3))
    np.savez(tmp_path / "paths.npz", **held, paths='[["a"]]', path=np.array([[0], [1]]))
    assert main(["info", str(tmp_path / name), "--pixel", pixel]) in (1, 2)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(message.format(tmp_path / name))


def test_a_pixel_of_a_scene_and_a_place_that_is_none_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["info", "gallery", "--pixel", "1,2"]) == 2
    expected = "gallery: is a scene; --pixel is of a picture of it, an .npz file\n"
    assert capsys.readouterr().err == expected
    for options in (["--hide", "void"], ["--pixel", "0,0", "--view", "xy"]):
        assert main(["info", "a.npz", *options]) == 2
        assert capsys.readouterr().err.endswith("a.npz: is a picture, which keeps its look\n")
    assert main(["info", "a.npz", "--pixel", "1.5,2"]) == 2
    assert "is not X,Y, as 320,240" in capsys.readouterr().err
