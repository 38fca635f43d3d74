"""Picture files: what comes back is what the frame has, and every file says how it was made."""

from __future__ import annotations

import itertools
import json
import os
import resource
import struct
import sys
import time
import tomllib
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import av
import imageio.v3 as imageio
import numpy as np
import OpenEXR
import OpenImageIO
import pytest
import tifffile
from PIL import Image

import halfstep
from halfstep import files
from halfstep.contract.arrays import Array
from halfstep.errors import HalfstepError, UsageError
from halfstep.files import ENDINGS, READ, plan, read_provenance, write
from halfstep.frames import png
from halfstep.frames.frame import Frame, Info
from halfstep.frames.outputs import OUTPUTS
from halfstep.scene import Scene

# A sphere behind a box before nothing; the title is no ASCII, and two lines.
SCENE = Scene.from_dict(
    {
        "format": 1,
        "title": "Kugel & Würfel „1“\n\u2028",
        "camera": {"center": (0, -6, 2), "look_at": (0, 0, 0)},
        "image": {"width": 61, "height": 43},
        "accuracy": {"steps": 14},
        "solid": [
            {"kind": "sphere", "radius": 1, "origin": (-1, 0, 0), "color": (0.7, 0.3, 0.2)},
            {"kind": "box", "size": (1, 1, 2), "origin": (1, -0.5, 0), "color": (0.2, 0.5, 0.8)},
        ],
    }
)
CHANNELS = {
    "color": ["R", "G", "B"],
    "solid": ["id"],
    "surface": ["surface"],
    "t": ["t"],
    "depth": ["Z"],
    "depth_exit": ["ZBack"],
    "position": ["P.X", "P.Y", "P.Z"],
    "normal": ["N.X", "N.Y", "N.Z"],
    "error": ["error"],
    "steps": ["steps"],
}
SINGLE = [ending for ending, type_ in ENDINGS.items() if type_.single]
NONE = 0xFFFFFFFF


@pytest.fixture(scope="module")
def frame() -> Frame:
    """All outputs, with every value that they can have."""
    rendered = halfstep.render(SCENE, backend="numpy")
    arrays = {name: getattr(rendered, name).copy() for name in OUTPUTS}
    hit = arrays["solid"] >= 0
    assert 0.1 < hit.mean() < 0.6
    arrays["error"][tuple(np.argwhere(hit)[0])] = np.inf
    arrays["error"][tuple(np.argwhere(~hit)[0])] = np.inf
    # Brighter than white, as a highlight.
    arrays["color"][tuple(np.argwhere(hit)[1])] = 1.75
    return Frame(arrays, rendered.info)


@pytest.fixture(params=ENDINGS)
def ending(request: pytest.FixtureRequest) -> str:
    """Every ending of a file."""
    name: str = request.param
    return name


def openimageio(path: Path) -> tuple[dict[str, Array], str]:
    """Channels (H, W) of a file by name in their own types, and its header as text."""
    file = OpenImageIO.ImageInput.open(str(path))
    assert file is not None, OpenImageIO.geterror()
    spec = file.spec()
    formats = spec.channelformats or [spec.format] * spec.nchannels
    channels = {
        name: np.asarray(file.read_image(k, k + 1, formats[k]))[..., 0]
        for k, name in enumerate(spec.channelnames)
    }
    header = spec.serialize("text")
    file.close()
    return channels, header


def openexr(path: Path) -> tuple[dict[str, Array], str]:
    """The same of an EXR by the OpenEXR package."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        assert len(file.parts) == 1
        return {name: each.pixels for name, each in file.channels().items()}, str(file.header())


def samples(path: Path) -> Array:
    """Pixels of a picture, (H, W) or (H, W, C), in their own type."""
    picture = OpenImageIO.ImageBuf(str(path))
    pixels = picture.get_pixels(picture.spec().format)
    assert pixels is not None, picture.geterror()
    return np.squeeze(pixels)


# ------------------------------------------------------------------------------------ read back


@pytest.mark.parametrize("read", [openexr, openimageio])
def test_an_exr_holds_the_frame(
    tmp_path: Path, frame: Frame, read: Callable[[Path], tuple[dict[str, Array], str]]
) -> None:
    path = tmp_path / "a.exr"
    write(path, frame, CHANNELS)
    channels, header = read(path)
    assert "zip" in header.lower()
    assert sorted(channels) == sorted(itertools.chain(*CHANNELS.values()))
    hit = frame.solid >= 0
    for name, its_channels in CHANNELS.items():
        array = np.atleast_3d(getattr(frame, name))
        for k, channel in enumerate(its_channels):
            values, expected = channels[channel], array[..., k]
            integer = name in ("solid", "surface", "steps")
            assert values.dtype == (np.uint32 if integer else np.float32), channel
            assert np.isfinite(values).all(), channel
            there = np.isfinite(expected) & (expected != -1)
            np.testing.assert_array_equal(
                values[there], expected[there].astype(values.dtype), err_msg=channel
            )
    for channel in ("id", "surface"):
        np.testing.assert_array_equal(channels[channel] == NONE, ~hit)
    for channel in ("Z", "ZBack", "t"):
        np.testing.assert_array_equal(channels[channel] == np.float32(1e30), ~hit)
    for channel in ("N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "steps"):
        assert not channels[channel][~hit].any()
    uncertain = channels["error"] == np.float32(1e30)
    np.testing.assert_array_equal(uncertain, np.isinf(frame.error))
    assert not channels["error"][~hit & ~uncertain].any()


@pytest.mark.parametrize(("layer", "name"), [("", "color"), ("N", "normal"), ("P", "position")])
def test_a_decoder_that_shares_no_code_with_openexr_reads_it(
    tmp_path: Path, frame: Frame, layer: str, name: str
) -> None:
    path = tmp_path / "a.exr"
    write(path, frame, CHANNELS)
    with av.open(str(path)) as file:
        file.streams.video[0].codec_context.options = {"layer": layer}
        pixels = next(file.decode(video=0)).to_ndarray()
    expected = np.nan_to_num(getattr(frame, name)).astype(np.float32)
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, expected)


def test_an_exr_has_the_channels_of_layers_by_default(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.exr", frame)
    channels, _ = openexr(tmp_path / "a.exr")
    assert channels.keys() == {
        *("R", "G", "B", "Z", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z"),
        *("id", "surface", "error"),
    }  # fmt: skip


def test_an_exr_always_has_colors_and_ids(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.exr", frame, ["depth"])
    assert openexr(tmp_path / "a.exr")[0].keys() == {"R", "G", "B", "Z", "id"}


def test_an_npz_holds_the_frame(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.npz", frame)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        assert set(arrays) == {*OUTPUTS, "provenance"}
        for name in OUTPUTS:
            array = getattr(frame, name)
            assert arrays[name].dtype == array.dtype
            np.testing.assert_array_equal(arrays[name], array)
        assert json.loads(str(arrays["provenance"])) == read_provenance(tmp_path / "a.npz")


def test_an_npz_holds_what_is_asked_for(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.npz", frame, ["t", "normal"])
    with np.load(tmp_path / "a.npz") as arrays:
        assert set(arrays) == {"t", "normal", "solid", "provenance"}


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_tiff_holds_an_output(tmp_path: Path, frame: Frame, name: str) -> None:
    path = tmp_path / "a.tif"
    write(path, frame, [name])
    array = getattr(frame, name)
    expected = array
    if np.issubdtype(array.dtype, np.floating):
        missing = 0.0 if array.ndim == 3 else 1e30
        expected = np.where(np.isfinite(array), array, missing).astype(np.float32)
    for read in (tifffile.imread(path), samples(path)):
        assert read.dtype == expected.dtype
        np.testing.assert_array_equal(read, expected)


def test_a_tiff_is_linear_float_color_by_default(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.tiff", frame)
    read = tifffile.imread(tmp_path / "a.tiff")
    assert read.dtype == np.float32
    np.testing.assert_array_equal(read, frame.color)


def test_a_png_is_the_image_by_default(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.png", frame)
    read = imageio.imread(tmp_path / "a.png")
    assert read.dtype == np.uint8
    np.testing.assert_array_equal(read, frame.image)


@pytest.mark.parametrize("name", ["t", "depth", "depth_exit", "error", "position"])
def test_a_png_spreads_numbers_over_their_range(tmp_path: Path, frame: Frame, name: str) -> None:
    path = tmp_path / "a.png"
    facts = write(path, frame, [name])
    pixels, array, hit = samples(path), getattr(frame, name), frame.solid >= 0
    assert pixels.dtype == np.uint16
    assert (pixels.min(), pixels[hit].min(), pixels.max()) == (0, 1, 65535)
    assert not pixels[~hit].any()
    low, high = facts["range"]
    finite = np.isfinite(array) & hit.reshape(hit.shape + (1,) * (array.ndim - 2))
    assert (low, high) == (array[finite].min(), array[finite].max())
    step = (high - low) / 65534
    numbers = low + (pixels.astype(float) - 1) * step
    np.testing.assert_allclose(numbers[finite], array[finite], rtol=0, atol=0.501 * step)
    assert (pixels[hit][~finite[hit]] == 65535).all()


def test_a_png_of_colors_has_16_bits_in_srgb(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.png", frame, ["color"])
    pixels = samples(tmp_path / "a.png")
    assert pixels.dtype == np.uint16
    assert pixels.max() == 65535
    value = pixels / 65535
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(linear, np.minimum(frame.color, 1), rtol=0, atol=2 / 65535)
    # The image is the same to 8 bits.
    dull = frame.color.max(axis=-1) <= 1
    assert np.abs(pixels / 257 - frame.image)[dull].max() <= 0.51


def test_a_png_of_normals_has_16_bits(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.png", frame, ["normal"])
    pixels, hit = samples(tmp_path / "a.png").astype(float), frame.solid >= 0
    assert not pixels[~hit].any()
    decoded = (pixels[hit] - 32768) / 32767
    np.testing.assert_allclose(decoded, frame.normal[hit], rtol=0, atol=0.501 / 32767)


@pytest.mark.parametrize(("name", "first"), [("solid", 1), ("surface", 1), ("steps", 0)])
def test_a_png_of_whole_numbers_has_them(
    tmp_path: Path, frame: Frame, name: str, first: int
) -> None:
    write(tmp_path / "a.png", frame, [name])
    pixels, hit = samples(tmp_path / "a.png").astype(int), frame.solid >= 0
    np.testing.assert_array_equal(pixels - first, getattr(frame, name))
    np.testing.assert_array_equal(pixels > 0, hit)


def test_a_png_of_one_depth_is_white(tmp_path: Path, frame: Frame) -> None:
    flat = Frame({"depth": np.where(frame.solid >= 0, 2.5, np.nan), "solid": frame.solid}, INFO)
    assert write(tmp_path / "a.png", flat, ["depth"])["range"] == [2.5, 2.5]
    np.testing.assert_array_equal(samples(tmp_path / "a.png"), 65535 * (frame.solid >= 0))


def test_a_png_of_nothing_is_black(tmp_path: Path) -> None:
    nothing = Frame({"depth": np.full((3, 4), np.nan), "solid": np.full((3, 4), -1)}, INFO)
    assert write(tmp_path / "a.png", nothing, ["depth"])["range"] == [0, 0]
    assert not samples(tmp_path / "a.png").any()


def test_more_solids_than_16_bits_are_no_png(tmp_path: Path) -> None:
    most = Frame({"solid": np.full((3, 4), 65534)}, INFO)
    write(tmp_path / "a.png", most, ["solid"])
    assert samples(tmp_path / "a.png").min() == 65535
    with pytest.raises(UsageError) as caught:
        write(tmp_path / "b.png", Frame({"solid": np.full((3, 4), 65535)}, INFO), ["solid"])
    assert str(caught.value) == "solid: 65535 does not fit in the 16 bits of a PNG file"
    assert os.listdir(tmp_path) == ["a.png"]


# ----------------------------------------------------------------------------------- provenance

INFO: Info = {
    "adapter": "a card",
    "driver": "a driver 1.2",
    "device_ms": 1.5,
    "number_format": "float32",
    "method": "visible",
    "steps": [14, 14],
    "wall_ms": 12.5,
    "scene_title": "Würfel",
    "scene_sha256": "0123",
    "version": "9.9",
}


def test_every_file_says_how_it_was_made(tmp_path: Path, frame: Frame, ending: str) -> None:
    path = tmp_path / f"a{ending}"
    told = write(path, frame)
    assert read_provenance(path) == told
    assert told == {
        "version": halfstep.__version__,
        "scene_title": SCENE.title,
        "scene_sha256": SCENE.sha256,
        "number_format": "float32",
        "method": "visible",
        "steps": [14, 14],
        "adapter": "numpy",
        "driver": f"NumPy {np.__version__}",
        "outputs": list(ENDINGS[ending].default),
    }


@pytest.mark.parametrize("ending", SINGLE)
def test_programs_show_by_what_it_was_made(tmp_path: Path, frame: Frame, ending: str) -> None:
    path = tmp_path / f"a{ending}"
    write(path, frame)
    software = OpenImageIO.ImageBuf(str(path)).spec().get_string_attribute("Software")
    assert software == f"Halfstep {halfstep.__version__}"


def test_the_range_is_told(tmp_path: Path, frame: Frame) -> None:
    path = tmp_path / "a.png"
    told = write(path, frame, ["depth"])
    assert read_provenance(path) == told
    assert (told["outputs"], len(told["range"])) == (["depth"], 2)


def test_the_same_frame_gives_the_same_bytes_at_any_time(tmp_path: Path, frame: Frame) -> None:
    slower: Info = {**frame.info, "wall_ms": 1e4, "device_ms": 1e3}
    again = Frame({name: getattr(frame, name) for name in OUTPUTS}, slower)
    for ending in ENDINGS:
        write(tmp_path / f"first{ending}", frame)
    time.sleep(2.1)  # NPZ files would hold times to two seconds
    for ending in ENDINGS:
        write(tmp_path / f"later{ending}", again)
        first, later = (tmp_path / f"{name}{ending}" for name in ("first", "later"))
        assert first.read_bytes() == later.read_bytes(), ending


def by_another_program(path: Path) -> None:
    pixels = np.zeros((4, 5, 3), np.uint8)
    if path.suffix == ".npz":
        np.savez(path, pixels=pixels)
    elif path.suffix == ".exr":
        with OpenEXR.File({"comments": "a comment"}, {"RGB": pixels.astype(np.float32)}) as file:
            file.write(str(path))
    else:
        Image.fromarray(pixels).save(path)


def with_a_text_of_another_program(path: Path, text: str) -> None:
    pixels = np.zeros((4, 5, 3), np.uint8)
    if path.suffix == ".npz":
        np.savez(path, provenance=np.array(text))
    elif path.suffix == ".exr":
        with OpenEXR.File({"Halfstep": text}, {"RGB": pixels.astype(np.float32)}) as file:
            file.write(str(path))
    elif path.suffix == ".png":
        path.write_bytes(png.png(pixels, {"Halfstep": text}))
    else:
        tifffile.imwrite(path, pixels, photometric="rgb", description=text)


def test_a_file_of_another_program_says_nothing(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"a{ending}"
    by_another_program(path)
    assert read_provenance(path) is None


@pytest.mark.parametrize("text", ["a picture", '{"version": "1"}', "[1, 2]", "[" * 100_000])
def test_a_text_of_another_program_is_not_taken_for_ours(
    tmp_path: Path, ending: str, text: str
) -> None:
    path = tmp_path / f"a{ending}"
    with_a_text_of_another_program(path, text)
    assert read_provenance(path) is None


@pytest.mark.parametrize("content", ["empty", "other", "half"])
def test_a_broken_file_is_a_failure(
    tmp_path: Path, frame: Frame, ending: str, content: str
) -> None:
    path = tmp_path / f"a{ending}"
    write(path, frame)
    # Half of the header: of the others, the provenance lies before the pixels.
    half = path.stat().st_size // 2 if ending == ".npz" else 60
    path.write_bytes(
        {"empty": b"", "other": b"no picture", "half": path.read_bytes()[:half]}[content]
    )
    with pytest.raises(HalfstepError) as caught:
        read_provenance(path)
    assert str(caught.value).startswith(f"{path}: cannot be read as {ENDINGS[ending].name}: ")
    assert caught.value.exit_code == 1


def test_a_large_picture_is_read(tmp_path: Path) -> None:
    """Pillow takes more than 1.8e8 pixels for an attack; ours may have more."""
    path = tmp_path / "a.png"
    write(path, Frame({"solid": np.zeros((3, 4), np.int32)}, INFO), ["solid"])
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", 1 << 14, 1 << 14)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    with pytest.raises(Image.DecompressionBombError):
        Image.open(path)
    assert read_provenance(path) is not None


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none.png", "{path}: there is no such file"),
        ("folder.png", "{path}: is a folder, not a file"),
        ("a.jpg", "{path}: the ending '.jpg' is not one of those read: " + ", ".join(READ)),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "a.jpg").touch()
    path = tmp_path / name
    with pytest.raises(UsageError) as caught:
        read_provenance(path)
    assert str(caught.value) == message.format(path=path)


# ------------------------------------------------------------------------------- before rendering


def test_a_plan_names_what_to_render(ending: str) -> None:
    type_ = ENDINGS[ending]
    path = f"a{ending.upper()}"
    assert plan(path) == type_.default
    asked = ["depth"] if type_.single else ["depth", "normal", "depth"]
    assert set(plan(path, asked)) == {*asked, *type_.always}
    assert set(plan(path, "depth")) == {"depth", *type_.always}


@pytest.mark.parametrize(
    ("name", "outputs", "message"),
    [
        ("a.jpg", None, "{path}: the ending '.jpg' is not one of those written: .png, .tif, .tiff, "
         ".exr, .npz"),
        ("none/a.exr", None, "{path}: there is no folder {path.parent}"),
        ("a.npz", ["depth", "z", "w"], "outputs: 'w', 'z' unknown; known are "
         + ", ".join(OUTPUTS)),
        ("a.png", ["depth", "solid"], "{path}: PNG files hold one output, not solid, depth; .exr "
         "and .npz hold several"),
        ("a.tif", [], "{path}: TIFF files hold one output, not none; .exr and .npz hold several"),
        ("a.exr", ["image"], "{path}: EXR files do not hold image: its colours are linear; they "
         "are the output color, which is always there"),
    ],
)  # fmt: skip
def test_what_cannot_be_written_is_refused_before_rendering(
    tmp_path: Path, name: str, outputs: list[str] | None, message: str
) -> None:
    path = tmp_path / name
    with pytest.raises(UsageError) as caught:
        plan(path, outputs)
    assert str(caught.value) == message.format(path=path)
    assert caught.value.exit_code == 2
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("file", [None, 3, b"a.png"], ids=str)
def test_what_is_no_file_is_said_to_be_none(file: Any, frame: Frame) -> None:
    for options in ({}, {"format": "png"}):
        with pytest.raises(UsageError) as caught:
            write(file, frame, **options)
        assert str(caught.value) == f"file: {file!r} is neither a path nor a file object"


@pytest.mark.parametrize("given", [None, [], np.zeros((2, 3, 3), np.uint8)], ids=type)
def test_what_is_no_frame_is_said_to_be_none(given: Any, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        write(tmp_path / "a.png", given)
    assert str(caught.value) == f"frame: {type(given).__name__} is not Frame"
    assert os.listdir(tmp_path) == []


def test_more_solids_than_a_file_numbers_are_refused_before_rendering(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    for outputs, solids in ((["solid"], 65535), (["depth"], 65536), (None, 65536)):
        plan(path, outputs, solids=solids)
    plan(tmp_path / "a.tif", ["solid"], solids=65536)
    with pytest.raises(UsageError) as caught:
        plan(path, ["solid"], solids=65536)
    message = f"{path}: PNG files number up to 65535 solids; the scene has 65536"
    assert str(caught.value) == message


def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, frame: Frame
) -> None:
    path = tmp_path / "a.exr"
    write(path, frame)
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    for action in (lambda: plan(path), lambda: read_provenance(path)):
        with pytest.raises(UsageError) as caught:
            action()
        assert str(caught.value) == f"{path}: EXR files need OpenEXR: pip install 'halfstep[exr]'"
    assert plan(tmp_path / "a.png") == ("image",)


def test_extras_bring_their_packages() -> None:
    text = Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8")
    extras = tomllib.loads(text)["project"]["optional-dependencies"]
    for type_ in files.TYPES:
        if type_.package is not None:
            assert any(line.startswith(type_.package) for line in extras[type_.extra])


# ----------------------------------------------------------------------------------- whole files


def test_an_output_that_was_not_computed_leaves_nothing(
    tmp_path: Path, frame: Frame, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    partly = Frame({"solid": frame.solid}, INFO)
    with pytest.raises(AttributeError, match="'depth' was not computed; name it in outputs"):
        write(path, partly, ["depth"])
    assert os.listdir(tmp_path) == []


def part(frame: Frame, *names: str) -> Frame:
    return Frame({name: getattr(frame, name) for name in names}, frame.info)


@pytest.mark.parametrize(
    ("there", "held"),
    [
        (("image", "solid"), {".png": "image", ".tif": "image", ".exr": "solid",
         ".npz": "image solid"}),
        (("solid", "depth"), {".png": "depth", ".tif": "depth", ".exr": "solid depth",
         ".npz": "solid depth"}),
        (("solid",), {".png": "solid", ".tif": "solid", ".exr": "solid", ".npz": "solid"}),
        (("color", "solid", "t"), {".tif": "color", ".exr": "color solid t",
         ".npz": "color solid t"}),
        (("image", "color", "solid"), {".png": "image", ".tif": "color"}),
    ],
)  # fmt: skip
def test_what_there_is_is_written(
    tmp_path: Path, frame: Frame, there: tuple[str, ...], held: dict[str, str]
) -> None:
    for ending, names in held.items():
        path = tmp_path / f"a{ending}"
        assert write(path, part(frame, *there))["outputs"] == names.split()
        told = read_provenance(path)
        assert told is not None
        assert told["outputs"] == names.split()
        if ending == ".npz":
            with np.load(path) as arrays:
                for name in there:
                    np.testing.assert_array_equal(arrays[name], getattr(frame, name))


def test_an_exr_has_the_colors_that_there_are(tmp_path: Path, frame: Frame) -> None:
    write(tmp_path / "a.exr", part(frame, "solid", "depth"), ["depth"])
    assert openexr(tmp_path / "a.exr")[0].keys() == {"Z", "id"}


@pytest.mark.parametrize(
    ("name", "there", "message"),
    [
        ("a.png", ("solid", "depth", "normal"), "PNG files hold one output, by default image; this "
         "frame has solid, depth, normal: name one"),
        ("a.tif", ("image", "solid", "depth"), "TIFF files hold one output, by default color; this "
         "frame has image, solid, depth: name one"),
    ],
)  # fmt: skip
def test_which_of_several_is_to_be_said(
    tmp_path: Path, frame: Frame, name: str, there: tuple[str, ...], message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        write(tmp_path / name, part(frame, *there))
    assert str(caught.value) == f"{tmp_path / name}: {message}"
    assert os.listdir(tmp_path) == []


def test_a_file_object_gets_what_a_path_gets(tmp_path: Path, frame: Frame, ending: str) -> None:
    told = write(tmp_path / f"a{ending}", frame, ["depth"])
    file = BytesIO(b"before")
    file.seek(0, os.SEEK_END)
    assert write(file, frame, ["depth"], format=ending[1:]) == told
    assert file.getvalue() == b"before" + (tmp_path / f"a{ending}").read_bytes()
    assert not file.closed


@pytest.mark.parametrize(
    ("format_", "outputs", "message"),
    [
        (None, None, "format: None is not one of png, tif, tiff, exr, npz"),
        ("jpg", None, "format: 'jpg' is not one of png, tif, tiff, exr, npz"),
        ("png", "t depth", "file: PNG files hold one output, not t, depth; .exr and .npz hold "
         "several"),
    ],
)  # fmt: skip
def test_a_file_object_is_refused_as_a_path_is(
    frame: Frame, format_: str | None, outputs: str | None, message: str
) -> None:
    file = BytesIO()
    for action in (
        lambda: write(file, frame, outputs and outputs.split(), format=format_),
        lambda: plan(file, outputs and outputs.split(), format=format_),
    ):
        with pytest.raises(UsageError) as caught:
            action()
        assert str(caught.value) == message
    assert file.getvalue() == b""


def test_a_path_has_its_format_from_its_ending(tmp_path: Path, frame: Frame) -> None:
    with pytest.raises(UsageError) as caught:
        write(tmp_path / "a.png", frame, format="png")
    assert str(caught.value) == "format: 'png' is given with a path, whose ending decides it"
    assert os.listdir(tmp_path) == []


def test_what_a_file_object_refuses_is_its_own_error(frame: Frame) -> None:
    full = Path("/dev/full")
    with full.open("wb", buffering=0) as file, pytest.raises(OSError, match="No space"):
        write(file, frame, format="png")


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, frame: Frame, ending: str) -> None:
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"before")
    limit, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300, most))
    try:
        with pytest.raises(HalfstepError) as caught:
            write(path, frame)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
    assert str(caught.value).startswith(f"{path}: ")
    assert "File too large" in str(caught.value)
    assert ".partial" not in str(caught.value)
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == [path.name]
