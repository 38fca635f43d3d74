"""The command line: what is passed on, what is printed where, and every exit code."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import imageio.v3 as imageio
import numpy as np
import pytest

import halfstep
import halfstep.frames.renderer
from halfstep.cli import main
from halfstep.device import adapters as device
from halfstep.errors import AdapterError, DeviceError, HalfstepError, SceneError
from halfstep.files import read_provenance
from halfstep.frames.frame import Frame, Info, Origin
from halfstep.frames.outputs import device_outputs
from halfstep.run import gpu as run_gpu

COMMAND = [sys.executable, "-m", "halfstep"]

SPHERE = """
format = 1
title = "one sphere"
[camera]
center = [0, 0, 5]
look_at = [0, 0, 0]
up = [0, 1, 0]
[image]
width = 24
height = 16
[accuracy]
steps = 12
[[light]]
direction = [1, 1, 1]
color = [1, 1, 1]
[[solid]]
kind = "sphere"
origin = [0, 0, 0]
color = [1, 0, 0]
radius = 1
"""

# The command, with a line on stdout when it begins to render.
TELLS_WHEN_IT_RENDERS = """
import signal
import sys
from halfstep import cli
from halfstep.frames import renderer as api
# What was started in the background, as these tests may be, has it ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
render = api.Renderer.render
def told(*args, **options):
    print("rendering", flush=True)
    return render(*args, **options)
api.Renderer.render = told
sys.exit(cli.main())
"""

Fake = Callable[[Callable[[], object]], list[dict[str, Any]]]


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "sphere.toml"
    path.write_text(SPHERE)
    return path


@pytest.fixture
def fake_render(monkeypatch: pytest.MonkeyPatch) -> Fake:
    """Replaces rendering by a function; returns the list of its calls' arguments."""

    def install(action: Callable[[], object]) -> list[dict[str, Any]]:
        calls: list[dict[str, Any]] = []

        def render(scene: halfstep.Scene, **options: Any) -> object:
            calls.append({"scene": scene, **options})
            return action()

        monkeypatch.setattr(halfstep.frames.renderer, "render", render)
        return calls

    return install


PROVENANCE: Origin = {
    "version": "0.1",
    "scene_title": "one sphere",
    "scene_sha256": "0123",
    "number_format": "float32",
    "method": "visible",
    "steps": [16, 18],
    "adapter": "a card",
    "driver": "a driver",
}


def frame() -> Frame:
    arrays = {
        "image": np.full((2, 3, 3), 7, np.uint8),
        "solid": np.array([[0, 1, -1], [1, 0, -1]]),
        "depth": np.array([[2.5, 3, np.nan], [4, 3, np.nan]]),
    }
    info = cast(Info, PROVENANCE | {"wall_ms": 1234.5})
    return Frame(arrays, info)


def failing(error: BaseException) -> Callable[[], object]:
    def action() -> object:
        raise error

    return action


def last_line(text: str) -> str:
    return text.splitlines()[-1]


# ------------------------------------------------------------------------------------- render


def test_what_is_not_given_comes_from_the_scene(
    scene_file: Path, tmp_path: Path, fake_render: Fake, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = fake_render(frame)
    output = tmp_path / "out.png"
    assert main(["render", str(scene_file), "-o", str(output)]) == 0
    [call] = calls
    assert call.pop("scene").title == "one sphere"
    assert call == {
        "size": None,
        "steps": None,
        "tolerance_pixels": None,
        "tolerance": None,
        "number_format": None,
        "method": None,
        "samples": None,
        "shadows": None,
        "outputs": ("image",),
        "backend": "auto",
        "adapter": None,
    }
    np.testing.assert_array_equal(imageio.imread(output), frame().image)
    assert read_provenance(output) == {**PROVENANCE, "outputs": ["image"]}
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"{output}: 3x2 in 1.23 s on a card\n")


def test_a_picture_without_a_hit_is_told(
    scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sphere is before the camera, and then behind it."""
    text = scene_file.read_text()
    options = ["--backend", "numpy", "--size", "8x8", "-o", str(tmp_path / "out.png")]
    for scene, told in (
        (text, False),
        (text.replace("look_at = [0, 0, 0]", "look_at = [0, 0, 9]"), True),
    ):
        scene_file.write_text(scene)
        assert main(["render", str(scene_file), *options]) == 0
        message = "warning: no ray meets anything: only the background is seen\n"
        assert capsys.readouterr().err.startswith(message) == told


def test_every_option_is_passed_on(scene_file: Path, tmp_path: Path, fake_render: Fake) -> None:
    calls = fake_render(frame)
    options = "--size 320x200 --steps 20 --format fixed32 --method article --samples 2"
    options += " --backend gpu --adapter llvmpipe --no-shadows"
    output = str(tmp_path / "out.png")
    assert main(["render", str(scene_file), "--output", output, *options.split()]) == 0
    [call] = calls
    del call["scene"]
    assert call == {
        "size": (320, 200),
        "steps": 20,
        "tolerance_pixels": None,
        "tolerance": None,
        "number_format": "fixed32",
        "method": "article",
        "samples": 2,
        "shadows": False,
        "outputs": ("image",),
        "backend": "gpu",
        "adapter": "llvmpipe",
    }


@pytest.mark.parametrize("option", ["tolerance", "tolerance_pixels"])
def test_tolerances_are_passed_on(
    scene_file: Path, tmp_path: Path, fake_render: Fake, option: str
) -> None:
    calls = fake_render(frame)
    flag = "--" + option.replace("_", "-")
    assert main(["render", str(scene_file), "-o", str(tmp_path / "o.png"), flag, "0.25"]) == 0
    assert calls[0][option] == 0.25


def test_json_describes_the_result(
    scene_file: Path, tmp_path: Path, fake_render: Fake, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_render(frame)
    output = str(tmp_path / "out.png")
    assert main(["render", str(scene_file), "-o", output, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": output,
        "size": [3, 2],
        "outputs": ["image"],
        "info": {**PROVENANCE, "wall_ms": 1234.5},
    }


def test_outputs_are_chosen_and_their_range_told(
    scene_file: Path, tmp_path: Path, fake_render: Fake, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = fake_render(frame)
    output = tmp_path / "out.png"
    options = ["-o", str(output), "--outputs", "depth", "--json"]
    assert main(["render", str(scene_file), *options]) == 0
    assert calls[0]["outputs"] == ("depth",)
    assert imageio.imread(output).tolist() == [[1, 21846, 0], [65535, 21846, 0]]
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert (result["outputs"], result["range"]) == (["depth"], [2.5, 4])
    assert err == (
        f"{output}: 3x2 in 1.23 s on a card; 1…65535 are depth 2.5…4, 0 is where nothing is hit\n"
    )


@pytest.mark.parametrize(
    ("name", "options", "outputs"),
    [
        ("out.tif", "", ("color",)),
        ("out.exr", "--outputs steps,t", ("color", "solid", "t", "steps")),
        ("out.npz", "--outputs depth", ("solid", "depth")),
    ],
)
def test_what_a_file_holds_is_rendered(
    scene_file: Path,
    tmp_path: Path,
    fake_render: Fake,
    name: str,
    options: str,
    outputs: tuple[str, ...],
) -> None:
    calls = fake_render(failing(HalfstepError("rendered")))
    assert main(["render", str(scene_file), "-o", str(tmp_path / name), *options.split()]) == 1
    assert calls[0]["outputs"] == outputs


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("", "halfstep: error: the following arguments are required: COMMAND"),
        ("render s", "halfstep render: error: the following arguments are required: -o/--output"),
        ("render -o o.png", "halfstep render: error: the following arguments are required: SCENE"),
        (
            "render s -o o.png --size 640",
            "halfstep render: error: argument --size: '640' is not WxH, as 640x480",
        ),
        (
            "render s -o o.png --size 640x-1",
            "halfstep render: error: argument --size: '640x-1' is not WxH, as 640x480",
        ),
        (
            "render s -o o.png --steps 1.5",
            "halfstep render: error: argument --steps: invalid int value: '1.5'",
        ),
        (
            "render s -o o.png --steps 8 --tolerance 1",
            "halfstep render: error: argument --tolerance: not allowed with argument --steps",
        ),
        (
            "animate s -o -",
            "halfstep animate: error: argument -o/--output: only render writes to stdout; ./- is a "
            "file",
        ),
        ("render s -o=", "halfstep render: error: argument -o/--output: is empty"),
        ("animate s --output=", "halfstep animate: error: argument -o/--output: is empty"),
        ("tune s -o=", "halfstep tune: error: argument -o/--output: is empty"),
        ("check s -o=", "halfstep check: error: argument -o/--output: is empty"),
        (
            "check s -o -",
            "halfstep check: error: argument -o/--output: only render writes to stdout; ./- is a "
            "file",
        ),
        ("bench -o=", "halfstep bench: error: argument -o/--output: is empty"),
        ("render s -o o.png --layers z", "halfstep: error: unrecognized arguments: --layers z"),
    ],
)
def test_bad_usage_exits_2(
    arguments: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments.split()) == 2
    out, err = capsys.readouterr()
    assert (out, last_line(err)) == ("", message)


@pytest.mark.parametrize("option", ["--format", "--method", "--backend"])
def test_unknown_choices_exit_2(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["render", "s", "-o", "o.png", option, "best"]) == 2
    expected = f"halfstep render: error: argument {option}: invalid choice: 'best' (choose from "
    assert last_line(capsys.readouterr().err).startswith(expected)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("out.jpg", [], "{path}: the ending '.jpg' is not one of those written: "),
        ("none/out.png", [], "{path}: there is no folder "),
        ("out.npz", ["--outputs", "depth,z"], "outputs: 'z' unknown; known are "),
        ("out.npz", ["--outputs", ""], "outputs: '' unknown; known are "),
        ("out.png", ["--outputs", "depth,t"], "{path}: PNG files hold one output, not t, depth; "),
        ("out.exr", ["--outputs", "image"], "{path}: EXR files do not hold image: "),
    ],
)
def test_a_bad_output_is_refused_before_rendering(
    scene_file: Path,
    tmp_path: Path,
    fake_render: Fake,
    capsys: pytest.CaptureFixture[str],
    name: str,
    options: list[str],
    message: str,
) -> None:
    calls = fake_render(frame)
    path = tmp_path / name
    assert main(["render", str(scene_file), "-o", str(path), *options]) == 2
    assert not calls
    assert capsys.readouterr().err.startswith(message.format(path=path))
    assert os.listdir(tmp_path) == ["sphere.toml"]


def test_a_bad_scene_lists_its_faults(
    scene_file: Path, tmp_path: Path, fake_render: Fake, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = fake_render(frame)
    scene_file.write_text(SPHERE.replace("radius = 1", "radius = -1\nweight = 3"))
    with pytest.raises(SceneError) as caught:
        halfstep.load(scene_file)
    assert len(caught.value.faults) == 2
    assert main(["render", str(scene_file), "-o", str(tmp_path / "out.png")]) == 2
    assert not calls
    out, err = capsys.readouterr()
    assert (out, err) == ("", "\n".join(caught.value.faults) + "\n")
    assert os.listdir(tmp_path) == ["sphere.toml"]


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (HalfstepError("failed"), 1, "failed"),
        (SceneError("a: b", "c: d"), 2, "a: b\nc: d"),
        (AdapterError("none"), 3, "none"),
        (DeviceError("lost"), 4, "lost"),
        (MemoryError(), 1, "not enough memory for this picture"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_failures_exit_with_their_code_and_write_nothing(
    scene_file: Path,
    tmp_path: Path,
    fake_render: Fake,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    code: int,
    message: str,
) -> None:
    fake_render(failing(error))
    output = tmp_path / "out.png"
    output.write_bytes(b"before")
    assert main(["render", str(scene_file), "-o", str(output)]) == code
    out, err = capsys.readouterr()
    assert (out, err) == ("", message + "\n")
    assert output.read_bytes() == b"before"
    assert sorted(os.listdir(tmp_path)) == ["out.png", "sphere.toml"]


def test_warnings_are_one_line(
    scene_file: Path, tmp_path: Path, fake_render: Fake, capsys: pytest.CaptureFixture[str]
) -> None:
    import warnings

    def warn() -> object:
        warnings.simplefilter("always")
        warnings.warn("no adapter", stacklevel=1)
        return frame()

    fake_render(warn)
    assert main(["render", str(scene_file), "-o", str(tmp_path / "out.png")]) == 0
    assert capsys.readouterr().err.splitlines()[0] == "warning: no adapter"


def test_a_scene_becomes_a_picture(
    scene_file: Path, tmp_path: Path, backend: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out.png"
    options = ["-o", str(output), "--backend", backend, "--json"]
    assert main(["render", str(scene_file), *options]) == 0
    image = imageio.imread(output)
    assert image.shape == (16, 24, 3)
    assert image.dtype == np.uint8
    assert image[8, 12, 0] > image[0, 0, 0]
    expected = halfstep.render(halfstep.load(scene_file), backend=backend).image
    np.testing.assert_array_equal(image, expected)
    result = json.loads(capsys.readouterr().out)
    assert result["path"] == str(output)
    assert result["size"] == [24, 16]
    assert result["info"]["version"] == halfstep.__version__


@pytest.mark.parametrize(
    ("options", "name"),
    [("--steps 31", "steps"), ("--size 0x9", "size"), ("--samples 9", "samples")],
)
def test_options_outside_their_range_exit_2(
    scene_file: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: str,
    name: str,
) -> None:
    output = tmp_path / "out.png"
    assert main(["render", str(scene_file), "-o", str(output), *options.split()]) == 2
    assert capsys.readouterr().err.startswith(name)
    assert not output.exists()


def test_an_adapter_that_is_not_there_exits_3(
    scene_file: Path, tmp_path: Path, adapter: device.Adapter, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out.png"
    options = ["-o", str(output), "--backend", "gpu", "--adapter", "no such card"]
    assert main(["render", str(scene_file), *options]) == 3
    err = capsys.readouterr().err
    assert err.startswith("adapter 'no such card': no such adapter; the adapters are\n")
    assert str(adapter.summary) in err
    assert not output.exists()


@pytest.mark.usefixtures("adapter")
def test_a_picture_larger_than_a_band_is_rendered(scene_file: Path, tmp_path: Path) -> None:
    scene_file.write_text(SPHERE.replace("radius = 1", "radius = 2.2"))  # from edge to edge
    output = tmp_path / "out.png"
    width, height = 8192, 2304
    pixel_bytes = 4 * len(device_outputs(("image", "solid")))
    band_rows = run_gpu.BAND_BYTES // (pixel_bytes * width)
    assert band_rows < height - 100
    options = ["-o", str(output), "--size", f"{width}x{height}", "--backend", "gpu"]
    assert main(["render", str(scene_file), *options]) == 0
    image = imageio.imread(output).astype(int)
    assert image.shape == (height, width, 3)
    # The sphere spans the border of the bands, and nothing shows where it is.
    above, below = image[band_rows - 1 : band_rows + 1]
    assert above[:, 0].max() > 100
    assert np.abs(below - above).mean() < 0.2


def test_ctrl_c_leaves_nothing(tmp_path: Path, backend: str) -> None:
    output = tmp_path / "out.png"
    output.write_bytes(b"before")
    options = ["render", "gallery", "-o", str(output), "--size", "8192x8192", "--backend", backend]
    command = [sys.executable, "-c", TELLS_WHEN_IT_RENDERS, *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "rendering\n"
        time.sleep(0.5)
        assert process.poll() is None, "the picture is too small for this test"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "interrupted\n")
    assert os.listdir(tmp_path) == ["out.png"]
    assert output.read_bytes() == b"before"


# ---------------------------------------------------------------------------- the other commands


def test_doctor_tells_what_is_chosen(
    adapter: device.Adapter, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    assert lines[0].startswith(f"halfstep {halfstep.__version__}, Python ")
    assert f"chosen: adapter {adapter.summary.index}, {adapter.reason}" in lines
    assert f"adapter {adapter.summary.index}: {adapter.summary.name}" in out


def test_doctor_for_machines(adapter: device.Adapter, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["chosen"] == adapter.summary.index
    assert report["halfstep"] == halfstep.__version__
    assert {"python", "numpy", "wgpu", "wgpu_native", "adapters", "features"} <= report.keys()


@pytest.mark.usefixtures("adapter")
def test_doctor_tells_of_a_driver_to_be_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "vk_swiftshader_icd.json"
    file.touch()
    monkeypatch.setattr(device, "SWIFTSHADER_FILES", (str(file),))
    monkeypatch.setattr(device, "SWIFTSHADER", "another")
    assert main(["doctor"]) == 0
    line = f"not asked for: SwiftShader; VK_DRIVER_FILES={file} chooses it"
    assert line in capsys.readouterr().out.splitlines()
    file.unlink()
    assert main(["doctor"]) == 0
    assert "SwiftShader;" not in capsys.readouterr().out


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_doctor_without_a_driver_tells_how_to_get_one(options: list[str]) -> None:
    environ = dict(os.environ, VK_DRIVER_FILES="none", VK_ICD_FILENAMES="none")
    environ.pop("HALFSTEP_EXPECT_LAVAPIPE", None)
    result = subprocess.run(
        [*COMMAND, "doctor", *options], env=environ, capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stderr) == (3, device.NO_ADAPTER + "\n")
    if options:
        report = json.loads(result.stdout)
        assert (report["adapters"], report["chosen"]) == ([], None)
        assert report["environment"]["VK_DRIVER_FILES"] == "none"
    else:
        assert "VK_DRIVER_FILES=none\n" in result.stdout
        assert "chosen" not in result.stdout


def test_scenes_lists_names_and_titles(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines]
    assert names == sorted(names)
    assert {"figure", "gallery", "crowd"} <= set(names)
    assert main(["scenes", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in listed] == names
    for entry, line in zip(listed, lines, strict=True):
        assert line == f"{entry['name']:{max(map(len, names))}}  {entry['title']}".rstrip()


def test_shader_prints_what_renders_the_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shader", "figure", "--outputs", "depth, normal", "--method", "article"]) == 0
    text = capsys.readouterr().out
    assert "fn render(" in text
    assert "fn article_quadric(" in text
    assert "fn shade(" not in text
    assert main(["shader", "figure", "--format", "fixed32"]) == 0
    text = capsys.readouterr().out
    assert "fn shade(" in text
    assert "alias Value = i32;" in text
    assert text.count("fn visit_") == 3
    assert "//?" not in text
    assert "// each quad" not in text


def test_shader_knows_the_outputs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shader", "figure", "--outputs", "deph"]) == 2
    assert "'deph' unknown; known are image, " in capsys.readouterr().err


def test_schema_is_a_json_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["type"] == "object"
    assert {"format", "camera", "solid"} <= schema["properties"].keys()


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"halfstep {halfstep.__version__}\n"


@pytest.mark.parametrize("arguments", [["--help"], ["render", "--help"], ["doctor", "--help"]])
def test_help(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 0
    assert capsys.readouterr().out.startswith("usage: halfstep")


# ----------------------------------------------------------------------------- closed streams

RENDER = "render sphere.toml -o out.png --backend numpy"
# Commands that print, and what they say besides.
PRINTING = {
    "scenes": "",
    "scenes --json": "",
    "schema": "",
    "shader sphere.toml": "",
    "doctor": "",
    "doctor --json": "",
    "info before.png": "",
    "info before.png --json": "",
    "--help": "",
    f"{RENDER} --json": "out.png: 24x16 in ",
    "animate sphere.toml -o out.gif --backend numpy --frames 2 --json": "out.gif: 2 frames of ",
    "tune sphere.toml -o out --backend numpy --size 4x4 --steps 4 --format float32": "out: ",
}

Shell = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def shell(scene_file: Path, fake_render: Fake) -> Shell:
    """Runs a command with redirections where a scene and a picture of it are."""
    fake_render(frame)
    folder = scene_file.parent
    assert main(["render", str(scene_file), "-o", str(folder / "before.png")]) == 0
    # What Python keeps for stdout is written when it ends, as in a shell.
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}

    def run(arguments: str, redirections: str = "", stdout: int = subprocess.PIPE) -> Any:
        command = f"{sys.executable} -m halfstep {arguments} {redirections}"
        return subprocess.run(
            command,
            shell=True,
            cwd=folder,
            env=environ,
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )

    return run


def assert_there(folder: Path, arguments: str) -> None:
    """What a command is to write is there."""
    if " -o " in arguments:
        assert folder.joinpath(arguments.split(" -o ")[1].split()[0]).exists()


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("arguments", PRINTING)
def test_whoever_closes_stdout_wants_no_more_of_it(
    shell: Shell, tmp_path: Path, arguments: str
) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    for result in (shell(arguments, ">&-"), shell(arguments, stdout=writer)):
        assert result.returncode == 0, result.stderr
        assert result.stderr.startswith(PRINTING[arguments])
        assert result.stderr.count("\n") <= 1, result.stderr
    os.close(writer)
    assert_there(tmp_path, arguments)


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("arguments", PRINTING)
def test_a_result_that_cannot_be_written_is_a_failure(
    shell: Shell, tmp_path: Path, arguments: str
) -> None:
    full = shell(arguments, ">/dev/full")
    assert (full.returncode, full.stderr) == (1, "stdout: No space left on device\n")
    assert_there(tmp_path, arguments)


@pytest.mark.parametrize("redirections", ["2>&-", "2>/dev/full", "<&- >&- 2>&-"])
@pytest.mark.slow
def test_messages_that_nobody_can_see_are_left_out(
    shell: Shell, tmp_path: Path, redirections: str
) -> None:
    result = shell(RENDER, redirections)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert_there(tmp_path, RENDER)
    result = shell("render none -o a.png", redirections)
    assert (result.returncode, result.stdout, result.stderr) == (2, "", "")


# The command, where a driver writes to stderr while a picture is open.
NOISY = """
import os, sys
from pathlib import Path
from halfstep import cli
def noisy(path, data):
    with path.open("wb") as file:
        os.write(2, b"noise")
        file.write(data)
Path.write_bytes = noisy
sys.exit(cli.main())
"""


@pytest.mark.slow
def test_a_file_does_not_take_the_place_of_a_closed_stream(shell: Shell, tmp_path: Path) -> None:
    assert shell(RENDER.replace("out.png", "plain.png")).returncode == 0
    command = f"{sys.executable} -c {shlex.quote(NOISY)} {RENDER} <&- >&- 2>&-"
    assert subprocess.run(command, shell=True, cwd=tmp_path, check=False).returncode == 0
    assert (tmp_path / "out.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.slow
def test_a_picture_may_go_to_stdout(scene_file: Path, tmp_path: Path, unbuffered: str) -> None:
    options = ["render", str(scene_file), "--backend", "numpy", "-o"]
    # Larger than what a pipe holds.
    options[2:2] = ["--size", "640x480", "--outputs", "position"]
    assert main([*options, str(tmp_path / "a.png")]) == 0
    environ = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    found = subprocess.run([*COMMAND, *options, "-"], env=environ, capture_output=True, check=True)
    assert found.stderr.startswith(b"-: 640x480 in ")
    assert found.stdout == (tmp_path / "a.png").read_bytes()
    assert len(found.stdout) > 1 << 16
    assert sorted(os.listdir(tmp_path)) == ["a.png", "sphere.toml"]
    for redirection, code, said in (
        (">&-", 2, "-o -: stdout is closed; name a file\n"),
        ("| true", 0, "-: "),
        (">/dev/full", 1, "stdout: No space left on device\n"),
    ):
        command = f"({shlex.join([*COMMAND, *options])} -; echo $? > code) {redirection}"
        result = subprocess.run(
            ["/bin/sh", "-c", command], env=environ, cwd=tmp_path, capture_output=True, check=True
        )
        assert int((tmp_path / "code").read_text()) == code
        assert result.stderr.decode().startswith(said)


def test_nothing_else_goes_to_a_stdout_with_a_picture(
    scene_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", str(scene_file), "-o", "-", "--json"]) == 2
    assert capsys.readouterr() == ("", "--json: stdout is the picture where -o is -\n")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main(["render", str(scene_file), "-o", "-"]) == 2
    message = "-o -: stdout is a terminal, which shows no picture; name a file\n"
    assert capsys.readouterr() == ("", message)


def test_a_result_is_printed_whatever_stdout_can_write() -> None:
    environ = {**os.environ, "PYTHONIOENCODING": "ascii", "VK_DRIVER_FILES": "Grafik„\udcff“"}
    environ.pop("HALFSTEP_EXPECT_LAVAPIPE", None)
    result = subprocess.run(
        [*COMMAND, "doctor"], env=environ, capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stderr) == (3, device.NO_ADAPTER + "\n")
    assert "VK_DRIVER_FILES=Grafik\\u201e\\udcff\\u201c\n" in result.stdout


LONG = "x" * 300


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", LONG, "-o", "a.png"], f"{LONG}: no such file or bundled scene; "),
        (["render", f"{LONG}.toml", "-o", "a.png"], f"{LONG}.toml: cannot be read: {{}}\n"),
        (["render", "figure", "-o", f"{LONG}.png"], f"{LONG}.png: {{}}\n"),
        (["render", "figure", "-o", f"{LONG}/a.png"], f"{LONG}/a.png: {{}}\n"),
        (["animate", "figure", "-o", LONG], f"{LONG}: {{}}\n"),
        (["animate", "figure", "-o", f"{LONG}.gif"], f"{LONG}.gif: {{}}\n"),
        (["animate", "figure", "-o", f"{LONG}/a.gif"], f"{LONG}/a.gif: {{}}\n"),
        (["tune", "figure", "-o", LONG], f"{LONG}: {{}}\n"),
        (["check", "figure", "-o", LONG], f"{LONG}: {{}}\n"),
        (["bench", "-o", f"{LONG}.png"], f"{LONG}.png: {{}}\n"),
        (["info", LONG], f"{LONG}: {{}}\n"),
        (["info", f"{LONG}.png"], f"{LONG}.png: {{}}\n"),
    ],
    ids=lambda value: " ".join(value).replace(LONG, "long") if isinstance(value, list) else "",
)
def test_too_long_a_name_is_a_usage_error(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert capsys.readouterr().err.startswith(message.format("File name too long"))
