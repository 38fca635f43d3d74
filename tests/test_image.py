"""Image files: exact pixels, and never half a file."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.errors import HalfstepError, UsageError
from halfstep.image import check_output_path, write_png

PICTURE = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3) * 14


@pytest.fixture
def picture() -> NDArray[np.uint8]:
    return PICTURE.copy()


@pytest.mark.parametrize("name", ["picture.png", "PICTURE.PNG", "a.b.png"])
def test_pixels_come_back(tmp_path: Path, picture: NDArray[np.uint8], name: str) -> None:
    write_png(tmp_path / name, picture)
    np.testing.assert_array_equal(imageio.imread(tmp_path / name), picture)
    assert os.listdir(tmp_path) == [name]


def test_same_pixels_same_bytes(tmp_path: Path, picture: NDArray[np.uint8]) -> None:
    write_png(tmp_path / "a.png", picture)
    write_png(tmp_path / "b.png", picture)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_everyone_may_read_it(tmp_path: Path, picture: NDArray[np.uint8]) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    write_png(tmp_path / "picture.png", picture)
    modes = [stat.S_IMODE(path.stat().st_mode) for path in (plain, tmp_path / "picture.png")]
    assert modes[0] == modes[1]


def test_a_link_stays_a_link(tmp_path: Path, picture: NDArray[np.uint8]) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "link.png").symlink_to(tmp_path / "far" / "picture.png")
    write_png(tmp_path / "link.png", picture)
    assert (tmp_path / "link.png").is_symlink()
    np.testing.assert_array_equal(imageio.imread(tmp_path / "far" / "picture.png"), picture)


@pytest.mark.parametrize("exception", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_write_leaves_what_was_there(
    tmp_path: Path,
    picture: NDArray[np.uint8],
    monkeypatch: pytest.MonkeyPatch,
    exception: BaseException,
) -> None:
    def fail(_descriptor: int) -> None:
        raise exception

    path = tmp_path / "picture.png"
    path.write_bytes(b"before")
    monkeypatch.setattr(os, "fsync", fail)
    expected = HalfstepError if isinstance(exception, OSError) else KeyboardInterrupt
    with pytest.raises(expected) as caught:
        write_png(path, picture)
    if expected is HalfstepError:
        assert str(caught.value) == f"{path}: No space left on device"
        assert isinstance(caught.value, HalfstepError)
        assert caught.value.exit_code == 1
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["picture.png"]


def test_good_paths_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_output_path(tmp_path / "new.png")
    (tmp_path / "old.png").touch()
    check_output_path(tmp_path / "old.png")
    monkeypatch.chdir(tmp_path)
    check_output_path("here.png")
    assert os.listdir(tmp_path) == ["old.png"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("p.jpg", "{path}: the ending '.jpg' is not one of those written: .png"),
        ("p", "{path}: the ending '' is not one of those written: .png"),
        (".png", "{path}: the ending '' is not one of those written: .png"),
        ("folder.png", "{path}: is a folder"),
        ("none/p.png", "{path}: there is no folder {path.parent}"),
        ("file/p.png", "{path}: there is no folder {path.parent}"),
        ("x" * 300 + "/p.png", "{path}: File name too long"),
    ],
)
def test_bad_paths_are_refused_before_rendering(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "file").touch()
    path = tmp_path / name
    with pytest.raises(UsageError) as caught:
        check_output_path(path)
    assert str(caught.value) == message.format(path=path)


def test_a_folder_closed_to_us_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Asked of the system in one place: root, whom CI often is, may write anywhere.
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    with pytest.raises(UsageError) as caught:
        check_output_path(tmp_path / "p.png")
    assert str(caught.value) == f"{tmp_path / 'p.png'}: the folder {tmp_path} is not writable"
