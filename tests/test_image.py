"""Writing pictures: exact pixels, and never half a file."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

from halfstep.errors import HalfstepError, UsageError
from halfstep.files.whole import check_output_path, finished_name, replacing, write_file
from halfstep.frames.png import png

ENDINGS = (".png", ".tif")
SHAPES = [(5, 7, 3), (5, 7), (1, 1, 3), (1, 1), (300, 1), (1, 300, 3)]


def noise(rng: np.random.Generator, shape: tuple[int, ...], type_: type[Any]) -> Any:
    return rng.integers(0, np.iinfo(type_).max, shape, type_, endpoint=True)


# ----------------------------------------------------------------------------------------- PNG


@pytest.mark.parametrize("type_", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", SHAPES)
def test_pixels_come_back(
    rng: np.random.Generator, tmp_path: Path, shape: tuple[int, ...], type_: type[Any]
) -> None:
    pixels = noise(rng, shape, type_)
    path = tmp_path / "picture.png"
    path.write_bytes(png(pixels))
    # OpenImageIO, as Pillow has no colours of 16 bits.
    picture = OpenImageIO.ImageBuf(str(path))
    read = picture.get_pixels(picture.spec().format)
    assert read is not None, picture.geterror()
    assert read.dtype == type_
    np.testing.assert_array_equal(read.reshape(shape), pixels)


@pytest.mark.parametrize("type_", [np.uint8, np.uint16])
def test_texts_come_back(type_: type[Any]) -> None:
    texts = {"Software": "a program", "Comment": "Größe; two\nlines " + "long " * 9999}
    with Image.open(io.BytesIO(png(np.zeros((2, 3, 3), type_), texts))) as picture:
        assert picture.info == texts


@pytest.mark.parametrize("shape", [(256, 256), (256, 256, 3)])
def test_smooth_pictures_are_compressed(shape: tuple[int, ...]) -> None:
    ramp = np.indices(shape).sum(axis=0).astype(np.uint16)
    assert len(png(ramp)) < ramp.nbytes / 50


# --------------------------------------------------------------------------------- whole files


def test_content_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for content in (b"one", b"", b"another"):
        write_file(path, content)
        assert path.read_bytes() == content
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("name", ["x" * 251 + ".png", "ä" * 125 + "x.png", "a\nb.png", "-.png"])
def test_any_name_can_be_replaced(tmp_path: Path, name: str) -> None:
    assert len(os.fsencode(name)) in (255, 7, 5)
    with replacing(tmp_path / name) as partial:
        found = finished_name(partial.name)
        assert found is not None
        assert os.fsencode(name).startswith(os.fsencode(found))
        assert (found == name) == (len(name) < 100)
    assert os.listdir(tmp_path) == [name]
    assert finished_name(name) is None


def test_nothing_is_there_before_the_end(tmp_path: Path) -> None:
    with replacing(tmp_path / "file") as partial:
        partial.write_bytes(b"half")
        assert not (tmp_path / "file").exists()
    assert (tmp_path / "file").read_bytes() == b"half"
    assert os.listdir(tmp_path) == ["file"]


def test_everyone_may_read_it(tmp_path: Path) -> None:
    plain, written = tmp_path / "plain", tmp_path / "written"
    plain.touch()
    write_file(written, b"content")
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (plain, written)]
    assert modes[0] == modes[1]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "far" / "file")
    write_file(tmp_path / "link", b"content")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "far" / "file").read_bytes() == b"content"


@pytest.mark.parametrize("exception", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_write_leaves_what_was_there(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    exception: BaseException,
) -> None:
    def fail(_descriptor: int) -> None:
        raise exception

    path = tmp_path / "file"
    path.write_bytes(b"before")
    monkeypatch.setattr(os, "fsync", fail)
    expected = HalfstepError if isinstance(exception, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as caught:
        write_file(path, b"after")
    if expected is HalfstepError:
        assert str(caught.value) == f"{path}: No space left on device"
        assert isinstance(caught.value, HalfstepError)
        assert caught.value.exit_code == 1
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["file"]


# --------------------------------------------------------------------------------------- paths


def test_good_paths_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_output_path(tmp_path / "new.png", ENDINGS)
    (tmp_path / "OLD.PNG").touch()
    check_output_path(tmp_path / "OLD.PNG", ENDINGS)
    monkeypatch.chdir(tmp_path)
    check_output_path("here.a.tif", ENDINGS)
    assert os.listdir(tmp_path) == ["OLD.PNG"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("p.jpg", "{path}: the ending '.jpg' is not one of those written: .png, .tif"),
        ("p", "{path}: the ending '' is not one of those written: .png, .tif"),
        (".png", "{path}: the ending '' is not one of those written: .png, .tif"),
        ("folder.png", "{path}: is a folder"),
        ("none/p.png", "{path}: there is no folder {path.parent}"),
        ("file/p.png", "{path}: there is no folder {path.parent}"),
        ("x" * 300 + "/p.png", "{path}: File name too long"),
        ("a\0.png", "{path}: embedded null byte"),
        ("pipe.png", "{path}: is a device or a pipe, which a file would replace"),
        ("device.png", "{path}: is a device or a pipe, which a file would replace"),
        ("link.png", "{path}: there is no folder /none"),
    ],
)
def test_bad_paths_are_refused_before_rendering(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "device.png").symlink_to("/dev/null")
    (tmp_path / "link.png").symlink_to("/none/p.png")
    path = tmp_path / name
    with pytest.raises(UsageError) as caught:
        check_output_path(path, ENDINGS)
    assert str(caught.value) == message.format(path=path)


def test_a_folder_closed_to_us_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Asked of the system in one place: root, whom CI often is, may write anywhere.
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    with pytest.raises(UsageError) as caught:
        check_output_path(tmp_path / "p.png", ENDINGS)
    assert str(caught.value) == f"{tmp_path / 'p.png'}: the folder {tmp_path} is not writable"
