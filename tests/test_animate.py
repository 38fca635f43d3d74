"""`halfstep animate`: files and folders, and what killing it leaves."""

from __future__ import annotations

import gc
import io
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import halfstep
from halfstep.cli import main, output
from halfstep.files import read_provenance
from halfstep.files.folder import FrameFolder, manifest
from halfstep.files.movie import MOVIES, write_movie
from halfstep.files.provenance import Provenance
from halfstep.frames import sequence
from halfstep.frames.renderer import Renderer
from halfstep.scene import Scene, load, with_animation

Pictures = list[NDArray[np.uint8]]
# What a film says of itself.
FACTS: Provenance = {
    "version": "9.9",
    "scene_title": "a ball that rises",
    "scene_sha256": "0123",
    "number_format": "float32",
    "method": "visible",
    "steps": [10],
    "adapter": "a card",
    "driver": "a driver",
}

MOVING = """
format = 1
title = "a ball that rises"
[camera]
center = [0, -6, 1]
look_at = [0, 0, 0]
[animation]
frames = 5
fps = 30
orbit_degrees = 90
[image]
width = 24
height = 18
[accuracy]
steps = 10
[[solid]]
kind = "sphere"
radius = 1
color = [0.8, 0.3, 0.1]
[[solid.key]]
at = 0
origin = [0, 0, -1]
[[solid.key]]
at = 1
origin = [0, 0, 1]
"""
COMMAND = [sys.executable, "-m", "halfstep", "animate"]
NUMPY = ["--backend", "numpy"]


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "moving.toml"
    path.write_text(MOVING)
    return path


@pytest.fixture
def scene(scene_file: Path) -> Scene:
    return load(scene_file)


def animate(scene_file: Path, output: Path, *options: str) -> int:
    return main(["animate", str(scene_file), "-o", str(output), *NUMPY, *options])


def rendered(scene: Scene, **options: Any) -> Pictures:
    return [frame.image for frame in halfstep.render_frames(scene, backend="numpy", **options)]


def names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def frame_names(count: int) -> list[str]:
    return [f"frame_{k:04}.png" for k in range(count)]


def identities(folder: Path) -> dict[str, tuple[int, int]]:
    """Of each finished frame what would be another if it were written again."""
    stats = ((path.name, path.stat()) for path in folder.glob("frame_*.png"))
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats}


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in names(folder)}


# ------------------------------------------------------------------------------------- files


def read_movie(path: Path) -> Iterator[NDArray[np.uint8]]:
    if path.suffix == ".mp4":
        import av

        with av.open(str(path)) as film:
            for frame in film.decode(video=0):
                rgb = frame.reformat(format="rgb24", src_colorspace="itu709")
                yield np.asarray(rgb.to_ndarray(), np.uint8)
        return
    with Image.open(path) as image:
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            yield np.asarray(image.convert("RGB"))


# Largest mean difference of a frame from the picture: lossless, or as such files are.
LOSS = {".gif": 0.5, ".png": 0.0, ".webp": 0.0, ".mp4": 6.0}


@pytest.mark.parametrize("ending", MOVIES)
def test_a_file_holds_every_frame_in_order(
    scene_file: Path, scene: Scene, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"moving{ending}"
    size = ["--size", "48x36"]
    assert animate(scene_file, path, *size) == 0
    expected = rendered(scene, size=(48, 36))
    found = list(read_movie(path))
    assert len(found) == 5
    for k, picture in enumerate(found):
        losses = [np.abs(picture.astype(int) - other).mean() for other in expected]
        assert losses[k] <= LOSS[ending]
        assert min(losses) == losses[k]
    assert set(names(tmp_path)) == {path.name, "moving.toml"}
    again = tmp_path / f"again{ending}"
    assert animate(scene_file, again, *size) == 0
    assert again.read_bytes() == path.read_bytes()


def times(path: Path) -> list[float]:
    """How many seconds each frame of a file is shown, as FFmpeg and, of WebP, Pillow read it."""
    if path.suffix == ".webp":
        with Image.open(path) as image:
            shown = []
            for k in range(getattr(image, "n_frames", 1)):
                image.seek(k)
                image.load()
                shown.append(image.info["duration"] / 1000)
            return shown
    import av

    with av.open(str(path)) as film:
        frames = film.decode(video=0)
        return [float((frame.duration or 0) * (frame.time_base or 0)) for frame in frames]


@pytest.mark.parametrize("ending", MOVIES)
def test_one_frame_is_an_animation_too(scene_file: Path, tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"still{ending}"
    assert animate(scene_file, path, "--frames-range", "2:2", "--fps", "20") == 0
    assert len(list(read_movie(path))) == 1
    assert times(path) == pytest.approx([0.05])


@pytest.mark.parametrize("ending", MOVIES)
def test_what_stands_still_has_all_its_frames_and_time(
    scene_file: Path, tmp_path: Path, ending: str
) -> None:
    moves = MOVING[MOVING.index("[[solid.key]]") :]
    scene_file.write_text(MOVING.replace(moves, "").replace("degrees = 90", "degrees = 0"))
    path = tmp_path / f"still{ending}"
    assert animate(scene_file, path, "--fps", "25") == 0
    assert times(path) == pytest.approx([0.04] * 5)
    first, *others = read_movie(path)
    for other in others:
        np.testing.assert_array_equal(other, first)


@pytest.mark.parametrize("ending", MOVIES)
def test_a_movie_may_stand_still_for_long(tmp_path: Path, ending: str) -> None:
    """Longer than one frame of a GIF, 655 s, or of a PNG, 66 s, can last."""
    pictures = [np.full((16, 16, 3), 99, np.uint8)] * 70 + [np.full((16, 16, 3), 9, np.uint8)]
    write_movie(tmp_path / f"m{ending}", pictures, 0.1, FACTS)
    assert times(tmp_path / f"m{ending}") == pytest.approx([10] * 71)
    for picture, found in zip(pictures, read_movie(tmp_path / f"m{ending}"), strict=True):
        assert np.abs(found.astype(int) - picture).max() <= 2


@pytest.mark.parametrize("ending", [".gif", ".png", ".webp"])
def test_whatever_changes_comes_back(tmp_path: Path, rng: np.random.Generator, ending: str) -> None:
    """Boxes anywhere, of any size, in few colours, which a GIF has exactly."""
    colors = rng.integers(0, 256, (7, 3), np.uint8)
    numbers = np.zeros((23, 31), int)
    pictures, equal = [], 0
    for _ in range(60):
        rows, columns = (np.sort(rng.integers(0, side + 1, 2)) for side in numbers.shape)
        box = slice(*rows), slice(*columns)
        numbers[box] = rng.integers(0, 7, numbers[box].shape)
        pictures.append(colors[numbers])
        equal += len(pictures) > 1 and np.array_equal(pictures[-1], pictures[-2])
    assert 3 <= equal <= 20
    write_movie(tmp_path / f"m{ending}", pictures, 25, FACTS)
    for picture, found in zip(pictures, read_movie(tmp_path / f"m{ending}"), strict=True):
        np.testing.assert_array_equal(found, picture)


@pytest.mark.parametrize("ending", MOVIES)
def test_a_full_disk_leaves_what_was_there(
    tmp_path: Path, rng: np.random.Generator, ending: str
) -> None:
    path = tmp_path / f"m{ending}"
    path.write_bytes(b"before")
    pictures = rng.integers(0, 256, (6, 64, 64, 3), np.uint8)
    limit, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, most))
    try:
        with pytest.raises(halfstep.HalfstepError) as caught:
            write_movie(path, pictures, 25, FACTS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
    assert str(caught.value) == f"{path}: File too large"
    # What was not let go of is complained of now, and this test fails by it.
    del caught
    gc.collect()
    assert path.read_bytes() == b"before"
    assert names(tmp_path) == [path.name]


def test_a_film_has_the_colours_of_the_pictures(tmp_path: Path) -> None:
    """In ITU-R BT.709, as the film says and players expect."""
    colors = [(200, 60, 30), (30, 200, 60), (60, 30, 200), (240, 240, 240), (5, 5, 7)]
    pictures = [np.full((16, 16, 3), color, np.uint8) for color in colors]
    write_movie(tmp_path / "m.mp4", pictures, 25, FACTS)
    for picture, found in zip(pictures, read_movie(tmp_path / "m.mp4"), strict=True):
        assert np.abs(found.astype(int) - picture).max() <= 3


def test_an_encoder_that_av_lacks_is_named(
    scene_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("halfstep.files.mp4._ENCODER", "nonesuch")
    path = tmp_path / "m.mp4"
    assert animate(scene_file, path) == 1
    message = f"{path}: av has no encoder nonesuch, which MP4 files need"
    assert capsys.readouterr().err.splitlines()[-1] == message
    assert names(tmp_path) == ["moving.toml"]


@pytest.mark.parametrize("ending", MOVIES)
def test_a_file_says_how_it_was_made(
    scene_file: Path, scene: Scene, tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"moving{ending}"
    assert animate(scene_file, path, "--frames-range", "1:3", "--steps", "9") == 0
    facts = read_provenance(path)
    assert facts is not None
    assert (facts["frames_range"], facts["fps"], facts["steps"]) == ([1, 3], 30, [9])
    assert facts["scene_title"] == "a ball that rises"
    shown = halfstep.scene.with_overrides(scene, steps=9)
    assert facts["scene_sha256"] == shown.sha256


@pytest.mark.parametrize("ending", [".gif", ".png", ".webp"])
@pytest.mark.parametrize("fps", ["30", "7"])
def test_rounding_of_durations_does_not_add_up(
    scene_file: Path, tmp_path: Path, ending: str, fps: str
) -> None:
    path = tmp_path / f"moving{ending}"
    options = ["--frames", "40", "--fps", fps, "--size", "12x10"]
    assert animate(scene_file, path, *options) == 0
    unit = 10 if ending == ".gif" else 1
    elapsed, changes = 0.0, []
    with Image.open(path) as image:
        assert image.info["loop"] == 0
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            image.load()
            elapsed += image.info["duration"]
            changes.append(elapsed)
    np.testing.assert_allclose(changes, np.arange(1, 41) * 1000 / float(fps), atol=unit / 2 + 0.01)


def test_mp4_has_the_rate_of_the_scene(scene_file: Path, tmp_path: Path) -> None:
    import av

    assert animate(scene_file, tmp_path / "m.mp4", "--fps", "23.976") == 0
    with av.open(str(tmp_path / "m.mp4")) as film:
        [stream] = film.streams.video
        assert float(stream.average_rate or 0) == pytest.approx(23.976, rel=1e-6)
        assert stream.codec_context.pix_fmt == "yuv420p"


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (
            "m.avi",
            "",
            "{path}: the ending '.avi' is not one of those written: .gif, .png, .webp, .mp4; the "
            "name of a folder for frames may end in /",
        ),
        ("none/m.gif", "", "{path}: there is no folder {path.parent}"),
        ("m.webp", "--size 16384x1", "{path}: sides of WebP files are <= 16383; 16384x1 is not"),
        ("m.mp4", "--size 25x18", "{path}: sides of MP4 files are even; 25x18 is not"),
        (
            "m.gif",
            "--fps 60",
            "{path}: 60 fps is not <= 50; viewers slow a GIF down that is faster",
        ),
        ("m.gif", "--frames 0", "frames: 0 is not >= 1"),
        ("m.gif", "--fps 0", "fps: 0 is not >= 0.1"),
        ("m.gif", "--steps 31", "steps: 31 is not <= 30"),
        ("m.gif", "--frames-range 3:5", "--frames-range 3:5: the frames are 0 to 4"),
        ("folder", "--frames-range 5:5", "--frames-range 5:5: the frames are 0 to 4"),
        ("moving.toml/folder", "", "{path}: {path.parent} is not a folder"),
    ],
)
def test_what_cannot_be_done_is_said_before_rendering(
    scene_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    options: str,
    message: str,
) -> None:
    monkeypatch.setattr(sequence, "render_frames", None)
    path = tmp_path / name
    assert animate(scene_file, path, *options.split()) == 2
    assert capsys.readouterr() == ("", message.format(path=path) + "\n")
    assert names(tmp_path) == ["moving.toml"]


def test_a_missing_package_is_named_with_its_extra(
    scene_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    path = tmp_path / "m.mp4"
    assert animate(scene_file, path) == 2
    message = f"{path}: MP4 files need av: pip install 'halfstep[video]'\n"
    assert capsys.readouterr().err == message
    assert names(tmp_path) == ["moving.toml"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--frames-range 4", "argument --frames-range: '4' is not A:B, as 0:29"),
        ("--frames-range 4:-1", "argument --frames-range: '4:-1' is not A:B, as 0:29"),
        ("--frames-range 4:3", "argument --frames-range: '4:3' has no frame from A up to B"),
        ("--frames x", "argument --frames: invalid int value: 'x'"),
    ],
)
def test_bad_usage_exits_2(option: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["animate", "figure", "-o", "x.gif", *option.split()]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"halfstep animate: error: {message}"


def test_a_fault_on_the_way_is_said_before_rendering(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    through = "[[animation.key]]\nat = 0\ncenter = [0, -6, 0]\n"
    through += "[[animation.key]]\nat = 1\ncenter = [0, 6, 0]\n"
    scene_file.write_text(MOVING.replace("orbit_degrees = 90\n", through))
    assert animate(scene_file, tmp_path / "folder") == 2
    message = "moving: frame 2: camera.look_at: [0, 0, 0] equals center\n"
    assert capsys.readouterr().err == message
    assert names(tmp_path) == ["moving.toml"]


def test_a_failed_film_leaves_what_was_there(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished = Renderer.render_prepared
    calls: list[None] = []

    def failing(self: Any, frame: Any) -> Any:
        calls.append(None)
        if len(calls) == 4:
            raise halfstep.DeviceError("lost")
        return finished(self, frame)

    monkeypatch.setattr(Renderer, "render_prepared", failing)
    for ending in (".gif", ".mp4"):
        calls.clear()
        path = tmp_path / f"m{ending}"
        path.write_bytes(b"before")
        assert animate(scene_file, path) == 4
        assert path.read_bytes() == b"before"
    assert names(tmp_path) == ["m.gif", "m.mp4", "moving.toml"]


# ------------------------------------------------------------------------------------- folders


def test_a_folder_has_every_frame_and_says_of_what(
    scene_file: Path, scene: Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "new" / "frames"
    assert animate(scene_file, folder, "--json") == 0
    assert names(folder) == ["animation.json", *frame_names(5)]
    for name, picture in zip(frame_names(5), rendered(scene), strict=True):
        with Image.open(folder / name) as image:
            np.testing.assert_array_equal(np.asarray(image), picture)
    facts = read_provenance(folder / "frame_0003.png")
    assert facts is not None
    assert facts["scene_sha256"] == halfstep.scene.animation.scene_at(scene, 3).sha256
    assert json.loads((folder / "animation.json").read_text()) == {
        "version": halfstep.__version__,
        "title": "a ball that rises",
        "scene_sha256": scene.sha256,
        "frames": 5,
        "fps": 30.0,
        "size": [24, 18],
        "samples": 1,
        "steps": 10,
        "number_format": "float32",
        "method": "visible",
        "backend": "numpy",
        "adapter": None,
    }
    result = json.loads(capsys.readouterr().out)
    assert result.pop("seconds") > 0
    assert result.pop("info")["adapter"] == "numpy"
    assert result == {
        "path": str(folder),
        "size": [24, 18],
        "frames_range": [0, 4],
        "rendered": 5,
        "kept": 0,
    }


@pytest.mark.parametrize("name", ["name.v2/", "moving.gif/"])
def test_a_name_that_ends_in_a_slash_is_a_folder(
    scene_file: Path, tmp_path: Path, name: str
) -> None:
    for _ in range(2):
        assert main(["animate", str(scene_file), "-o", f"{tmp_path}/{name}", *NUMPY]) == 0
        assert names(tmp_path / name) == ["animation.json", *frame_names(5)]


def test_machines_may_share_a_folder(scene_file: Path, tmp_path: Path) -> None:
    parts, whole = tmp_path / "parts", tmp_path / "whole"
    assert animate(scene_file, parts, "--frames-range", "3:4") == 0
    assert names(parts) == ["animation.json", "frame_0003.png", "frame_0004.png"]
    before = identities(parts)
    assert animate(scene_file, parts, "--frames-range", "0:3") == 0
    assert before.items() <= identities(parts).items()
    assert animate(scene_file, whole) == 0
    assert contents(parts) == contents(whole)


def test_finished_frames_are_kept(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "frames"
    assert animate(scene_file, folder) == 0
    (folder / "frame_0002.png").unlink()
    before = identities(folder)
    capsys.readouterr()
    assert animate(scene_file, folder) == 0
    assert capsys.readouterr().err.startswith(f"{folder}: 1 frame of 24x18 in ")
    assert before.items() <= identities(folder).items()
    before = identities(folder)
    assert animate(scene_file, folder, "--steps", "10", "--size", "24x18") == 0
    err = capsys.readouterr().err
    assert (err.split(" in ")[0], err.split(", ")[-1]) == (
        f"{folder}: 0 frames of 24x18",
        "5 were there\n",
    )
    assert identities(folder) == before


@pytest.mark.parametrize(
    ("change", "options", "reason"),
    [
        ("", "--steps 9", "its frames are others: steps 10 there, 9 here"),
        ("", "--frames 6", "its frames are others: frames 5 there, 6 here"),
        (
            "",
            "--size 25x18 --samples 2",
            "its frames are others: size [24, 18] there, [25, 18] here, samples 1 there, 2 here",
        ),
        ("", "--adapter 7", "its frames are others: adapter None there, 7 here"),
        ("radius = 1.5", "", "its frames are others: the scene has changed"),
        ("half", "", "has frames but no animation.json that says of what"),
        ("[" * 100_000, "", "has frames but no animation.json that says of what"),
    ],
)
def test_frames_of_something_else_are_not_mixed(
    scene_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: str,
    options: str,
    reason: str,
) -> None:
    folder, fresh = tmp_path / "frames", tmp_path / "fresh"
    assert animate(scene_file, folder) == 0
    if change in ("half", "[" * 100_000):
        (folder / "animation.json").write_text(change)
    else:
        scene_file.write_text(MOVING.replace("radius = 1", change or "radius = 1"))
    before = contents(folder)
    capsys.readouterr()
    assert animate(scene_file, folder, *options.split()) == 2
    message = f"{folder}: {reason}; --overwrite renders them again\n"
    assert capsys.readouterr() == ("", message)
    assert contents(folder) == before
    part = [*options.split(), "--frames-range", "0:1"]
    assert animate(scene_file, folder, *part, "--overwrite") == 0
    # Nothing is left of the others, also where this run has no frame.
    assert names(folder) == ["animation.json", *frame_names(2)]
    assert animate(scene_file, fresh, *part) == 0
    assert contents(folder) == contents(fresh)


def test_overwrite_renders_again_what_it_is_asked_for(scene_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    (tmp_path / "frames").mkdir()
    (folder / "notes.txt").write_text("mine")
    assert animate(scene_file, folder) == 0
    before, bytes_before = identities(folder), contents(folder)
    assert animate(scene_file, folder, "--overwrite", "--frames-range", "1:2") == 0
    after = identities(folder)
    changed = {name for name in after if after[name] != before[name]}
    assert changed == {"frame_0001.png", "frame_0002.png"}
    assert contents(folder) == bytes_before


def test_a_failure_before_the_first_frame_touches_nothing(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "frames"
    assert animate(scene_file, folder) == 0
    before = contents(folder)

    def failing(*_: object) -> None:
        raise halfstep.AdapterError("none")

    monkeypatch.setattr(Renderer, "render_prepared", failing)
    assert animate(scene_file, folder, "--overwrite", "--steps", "4") == 3
    assert contents(folder) == before
    assert animate(scene_file, tmp_path / "new") == 3
    assert not (tmp_path / "new").exists()


# ------------------------------------------------------------------------------------- together


def a_folder(path: Path, scene: Scene, *, overwrite: bool = False) -> FrameFolder:
    return FrameFolder(path, manifest(scene, "numpy", None), overwrite=overwrite)


@pytest.mark.slow
def test_equal_runs_at_once_all_succeed(scene_file: Path, tmp_path: Path) -> None:
    folder, whole = tmp_path / "frames", tmp_path / "whole"
    options = [str(scene_file), *NUMPY, "--frames", "30", "-o"]
    runs = [
        subprocess.Popen([*COMMAND, *options, str(folder)], stderr=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    for run in runs:
        _, err = run.communicate()
        assert (run.returncode, err.count("\n")) == (0, 1), err
    assert animate(scene_file, whole, "--frames", "30") == 0
    assert contents(folder) == contents(whole)


def test_a_frame_that_another_run_has_written_and_tidied_is_done(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = list(halfstep.render_frames(scene, backend="numpy"))
    one, other = a_folder(tmp_path / "f", scene), a_folder(tmp_path / "f", scene)
    one.begin(range(5))
    other.begin(range(5))
    fsync = os.fsync

    def meanwhile(_descriptor: int) -> None:
        monkeypatch.setattr(os, "fsync", fsync)
        other.write(2, frames[2])
        other.tidy()
        assert names(tmp_path / "f") == ["animation.json", "frame_0002.png"]

    monkeypatch.setattr(os, "fsync", meanwhile)
    one.write(2, frames[2])
    assert names(tmp_path / "f") == ["animation.json", "frame_0002.png"]


def test_a_run_that_begins_later_keeps_what_is_finished(scene: Scene, tmp_path: Path) -> None:
    frames = list(halfstep.render_frames(scene, backend="numpy"))
    one, other = a_folder(tmp_path / "f", scene), a_folder(tmp_path / "f", scene)
    missing = other.missing(range(5))
    one.begin(one.missing(range(5)))
    one.write(0, frames[0])
    other.begin(missing)
    assert names(tmp_path / "f") == ["animation.json", "frame_0000.png"]


def test_two_animations_at_once_are_not_mixed(scene: Scene, tmp_path: Path) -> None:
    frames = list(halfstep.render_frames(scene, backend="numpy"))
    changed = halfstep.scene.with_overrides(scene, steps=9)
    one, other = a_folder(tmp_path / "f", scene), a_folder(tmp_path / "f", changed)
    one.begin(range(5))
    one.write(0, frames[0])
    reason = f"{tmp_path / 'f'}: its frames are others: steps 10 there, 9 here"
    with pytest.raises(halfstep.UsageError) as refused:
        other.begin(range(5))
    assert str(refused.value) == f"{reason}; --overwrite renders them again"
    a_folder(tmp_path / "f", changed, overwrite=True).begin(range(5))
    with pytest.raises(halfstep.HalfstepError) as late:
        one.write(1, frames[1])
    reason = f"{tmp_path / 'f'}: its frames are others: steps 9 there, 10 here"
    assert str(late.value) == f"{reason}; another run has begun since"
    assert names(tmp_path / "f") == ["animation.json"]


def test_what_others_are_writing_is_left(scene: Scene, scene_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "f"
    assert animate(scene_file, folder) == 0
    others = [".frame_0005.png.0123456789abcdef.partial", ".a.png.0123456789abcdef.partial"]
    for name in [*others, ".frame_0001.png.0123456789abcdef.partial"]:
        (folder / name).touch()
    a_folder(folder, scene).tidy()
    assert names(folder) == sorted([*others, "animation.json", *frame_names(5)])


# ------------------------------------------------------------------------------------- killing

# The command, which kills itself when it has written the sixth frame but not given it its name.
DIES_WHILE_WRITING = """
import os, signal, sys
from halfstep.cli import main
calls = []
fsync = os.fsync
def dying(descriptor):
    fsync(descriptor)
    calls.append(None)
    if len(calls) == 7:
        os.kill(os.getpid(), signal.SIGKILL)
os.fsync = dying
sys.exit(main())
"""


def test_a_half_written_frame_is_none(scene_file: Path, tmp_path: Path) -> None:
    folder, whole = tmp_path / "killed", tmp_path / "whole"
    options = [str(scene_file), *NUMPY, "--frames", "8", "-o"]
    script = [sys.executable, "-c", DIES_WHILE_WRITING, "animate", *options, str(folder)]
    assert subprocess.run(script, check=False).returncode == -signal.SIGKILL
    [partial, *rest] = names(folder)
    assert (partial[-8:], rest) == (".partial", ["animation.json", *frame_names(5)])
    before = identities(folder)
    # Whoever renders the rest may be another, who must not remove what this one writes.
    assert animate(scene_file, folder, "--frames", "8", "--frames-range", "6:7") == 0
    assert names(folder)[0] == partial
    assert animate(scene_file, folder, "--frames", "8") == 0
    assert before.items() <= identities(folder).items()
    assert animate(scene_file, whole, "--frames", "8") == 0
    assert contents(folder) == contents(whole)


@pytest.mark.slow
def test_a_run_killed_five_times_loses_and_repeats_nothing(tmp_path: Path, seed: int) -> None:
    random_ = random.Random(seed)
    folder, whole = tmp_path / "killed", tmp_path / "whole"
    options = ["figure", *NUMPY, "--frames", "40", "--size", "160x120", "-o"]
    done: dict[str, tuple[int, int]] = {}
    for _ in range(5):
        more = len(done) + random_.randint(1, 5)
        with subprocess.Popen([*COMMAND, *options, str(folder)]) as process:
            while len(identities(folder)) < more and process.poll() is None:
                time.sleep(0.001)
            time.sleep(random_.uniform(0, 0.02))
            process.kill()
        assert process.returncode == -signal.SIGKILL, "it was done before it was killed"
        before, done = done, identities(folder)
        assert len(done) >= more
        assert before.items() <= done.items()
    last = subprocess.run(
        [*COMMAND, *options, str(folder)], capture_output=True, text=True, check=True
    )
    assert last.stderr.startswith(f"{folder}: {40 - len(done)} frames of 160x120 in ")
    assert last.stderr.endswith(f", {len(done)} were there\n")
    assert done.items() <= identities(folder).items()
    subprocess.run([*COMMAND, *options, str(whole)], capture_output=True, check=True)
    assert names(whole) == ["animation.json", *frame_names(40)]
    assert contents(folder) == contents(whole)


# ------------------------------------------------------------------------------------- the bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_bar_tells_speed_and_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([100.0, 102.0, 104.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with output.progress_bar("rendering", frames=40) as progress:
        for done in (1, 11, 21):
            progress(done / 40)
    drawn = terminal.getvalue().split("\r")[1:]
    empty, one, eleven, many, cleared = (text.removesuffix("\x1b[K") for text in drawn)
    assert empty == f"rendering [{'.' * 40}]   0%"
    # The first frame's time is mostly that of a shader's compilation.
    assert one == f"rendering [#{'.' * 39}]   2%"
    assert eleven == f"rendering [{'#' * 11}{'.' * 29}]  28%  5 frames/s  0:06 left"
    assert many == f"rendering [{'#' * 21}{'.' * 19}]  52%  5 frames/s  0:04 left"
    assert cleared == ""


def test_messages_are_not_written_into_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with output.progress_bar("rendering") as progress:
        output.say("warning: slow")
        progress(1.0)
    assert "%\x1b[K\r\x1b[Kwarning: slow\n\rrendering [####" in terminal.getvalue()


def test_long_times_have_hours(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([0.0, 36.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with output.progress_bar("measuring") as progress:
        progress(0.0)
        progress(0.01)
    assert "  0:59:24 left" not in terminal.getvalue()
    assert "  59:24 left" in terminal.getvalue()
    assert output._clock(3725) == "1:02:05"


def test_elsewhere_than_on_a_terminal_it_is_silent(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert animate(scene_file, tmp_path / "m.gif") == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"{tmp_path / 'm.gif'}: 5 frames of 24x18 in ")
    assert err.endswith(" s on numpy\n")
    assert err.count("\n") == 1


def test_a_terminal_sees_the_bar(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    assert animate(scene_file, tmp_path / "frames") == 0
    assert "frames/s" in terminal.getvalue()
    assert "] 100%" in terminal.getvalue()


def test_without_an_animation_the_camera_turns_once(
    scene_file: Path, tmp_path: Path, scene: Scene
) -> None:
    table = MOVING[MOVING.index("[animation]") : MOVING.index("[image]")]
    scene_file.write_text(MOVING.replace(table, ""))
    assert animate(scene_file, tmp_path / "frames", "--frames-range", "58:59") == 0
    assert names(tmp_path / "frames") == ["animation.json", "frame_0058.png", "frame_0059.png"]
    still = scene.model_copy(update={"animation": None})
    [picture] = rendered(still, frames=[59])
    with Image.open(tmp_path / "frames" / "frame_0059.png") as image:
        np.testing.assert_array_equal(np.asarray(image), picture)
    assert with_animation(still).animation is not None
