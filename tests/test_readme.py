"""The README is true: its programs run, and its tables list what there is."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from halfstep import cli
from halfstep.device import adapters as device
from halfstep.files import ENDINGS
from halfstep.files.exr import CHANNELS, EXR
from halfstep.frames.frame import SOURCES
from halfstep.scene import (
    SOLID_KINDS,
    Accuracy,
    Animation,
    Camera,
    CameraKey,
    Image,
    Light,
    Material,
    Scene,
    SolidKey,
)
from halfstep.scene.animation import scene_at

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def rows(heading: str) -> list[list[str]]:
    """Cells of the table below the line ``heading``."""
    [table] = re.findall(rf"^{re.escape(heading)}\n\|[-|]+\n((?:\|.*\n)+)", README, re.MULTILINE)
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()]


def quoted(text: str) -> list[str]:
    return re.findall(r"`([^`]+)`", text)


@pytest.fixture
def vase(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene of the README, in the folder where its commands run."""
    text, _ = blocks("toml")
    path = tmp_path / "vase.toml"
    path.write_text(text)
    monkeypatch.chdir(tmp_path)
    return path


@pytest.mark.usefixtures("vase", "adapter")
def test_python_programs_run() -> None:
    names: dict[str, Any] = {}
    programs = blocks("python")
    assert len(programs) >= 2
    for program in programs:
        exec(compile(program, "README.md", "exec"), names)
    assert names["frame"].image.any()
    assert 0 < names["nearest"] < 13


@pytest.mark.usefixtures("adapter")
def test_commands_run(vase: Path) -> None:
    commands = [
        shlex.split(line, comments=True)
        for block in blocks("sh")
        for line in block.splitlines()
        if line.startswith("halfstep ")
    ]
    assert {command[1] for command in commands} == {"doctor", "scenes", "render", "info", "animate"}
    for command in commands:
        assert cli.main(command[1:]) == 0, command
    written = {command[4] for command in commands if command[1] in ("render", "animate")}
    assert {path.name for path in vase.parent.iterdir()} == {"vase.toml", *written}


def test_make_has_the_targets() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    named = set(re.findall(r"(?:^|`)make ([a-z]+)", README, re.MULTILINE))
    assert named == {"render", "test", "lint", "bench"}
    assert named <= targets


def test_all_options_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    [usage] = blocks("text")
    names = [command.__name__.rpartition(".")[2] for command in cli.COMMANDS]
    assert sorted(re.findall(r"^halfstep (\w+)", usage, re.MULTILINE)) == sorted(names)
    for command in names:
        assert cli.main([command, "--help"]) == 0
        options = set(re.findall(r"--[a-z-]+", capsys.readouterr().out)) - {"--help", "--output"}
        [own] = re.findall(rf"^halfstep {command}\b(.*?)(?=^halfstep|\Z)", usage, re.M | re.S)
        assert set(re.findall(r"--[a-z-]+", own)) == options


def test_all_kinds_are_listed_with_their_parameters() -> None:
    common = {
        "kind", "name", "origin", "axis", "rotation_degrees", "material", "color", "key",
        "z_min", "z_max", "cut",
    }  # fmt: skip
    expected = {}
    for model in SOLID_KINDS:
        fields = model.model_fields.items()
        [kind] = get_args(model.model_fields["kind"].annotation)
        expected[kind] = {field.alias or name for name, field in fields} - common
    listed = {
        quoted(kind)[0]: {name.partition(".")[0] for name in quoted(parameters)}
        for kind, parameters, _ in rows("| kind | parameters | solid |")
    }
    assert listed == expected


def test_all_tables_are_listed_with_their_defaults() -> None:
    listed = {table.strip("`[]"): keys for table, keys in rows("| table | keys and defaults |")}
    assert set(listed) == {
        "top level", "camera", "animation", "animation.key", "image", "accuracy", "volume",
        "ambient", "light", "material", "solid", "solid.key",
    }  # fmt: skip
    models: dict[str, type[BaseModel]] = {
        "camera": Camera,
        "animation": Animation,
        "animation.key": CameraKey,
        "image": Image,
        "accuracy": Accuracy,
        "light": Light,
        "material": Material,
        "solid.key": SolidKey,
    }
    for name, model in models.items():
        parts = [text.partition(" = ") for text in quoted(listed[name]) if text[0] != '"']
        fields = {field.alias or key: field for key, field in model.model_fields.items()}
        assert {key for key, _, _ in parts} == set(fields)
        for key, _, text in parts:
            default = fields[key].get_default()
            # Of the three accuracies none is the field's default; the table's is the scene's.
            if text and key != "tolerance_pixels":
                value = tomllib.loads(f"x = {text}")["x"]
                assert (tuple(value) if isinstance(value, list) else value) == default


def test_the_example_of_an_animation_can_be_added_to_that_of_a_scene() -> None:
    scene = Scene.from_dict(tomllib.loads("".join(blocks("toml"))))
    assert scene.animation is not None
    first, middle = scene_at(scene, 0), scene_at(scene, 50)
    assert first.camera.center == scene.camera.center != middle.camera.center
    assert first.solids[-1].origin != middle.solids[-1].origin
    # It ends as it begins, so that the last frame is one step before.
    assert scene_at(scene, 99) != first


def test_the_default_accuracy_is_the_one_listed() -> None:
    text, _ = blocks("toml")
    accuracy = Scene.from_dict(tomllib.loads(text)).accuracy
    [keys] = [keys for table, keys in rows("| table | keys and defaults |") if "accuracy" in table]
    assert f"`tolerance_pixels = {accuracy.tolerance_pixels}`" in keys


def test_all_outputs_are_listed() -> None:
    assert [quoted(row[0])[0] for row in rows("| name | type | meaning | nothing hit |")] == list(
        SOURCES
    )


def test_all_files_are_listed() -> None:
    listed: dict[str, tuple[bool, tuple[str, ...]]] = {}
    for endings, outputs, usual, _ in rows("| ending | outputs | usual | numbers |"):
        names = tuple(SOURCES) if usual == "all" else tuple(quoted(usual))
        listed |= dict.fromkeys(quoted(endings), (outputs == "one", names))
    assert listed == {ending: (type_.single, type_.default) for ending, type_ in ENDINGS.items()}


def test_all_channels_are_listed() -> None:
    listed = {}
    for name, _, channels in rows("| output | in a PNG | in an EXR |"):
        listed[quoted(name)[0]] = tuple(quoted(channels))
        assert ("always there" in channels) == (quoted(name)[0] in EXR.always)
    assert listed == CHANNELS


def test_the_variables_are_those_the_device_reads() -> None:
    listed = {
        name.partition("=")[0] for row in rows("| variable | effect |") for name in quoted(row[0])
    }
    # Other back ends of wgpu are refused, so there is nothing to choose.
    assert listed == set(device.VARIABLES) - {"WGPU_BACKEND_TYPE"}
