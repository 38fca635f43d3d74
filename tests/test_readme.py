"""The READMEs are true: their programs run, and their tables list what there is."""

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
from halfstep.files.movie import MOVIES
from halfstep.frames.outputs import OUTPUTS
from halfstep.host.prepare import prepare
from halfstep.scene import (
    SOLID_KINDS,
    SURFACE_KINDS,
    Accuracy,
    Animation,
    Camera,
    CameraKey,
    Cell,
    Group,
    Image,
    Light,
    Material,
    Overrides,
    Place,
    QuadricSolid,
    Scene,
    SolidKey,
)
from halfstep.scene.animation import scene_at
from halfstep.scene.formula import MAX_FORMULA_BYTES, MAX_LEVELS
from halfstep.scene.lattices import LATTICE_KINDS, MAX_PLACES
from halfstep.scene.limits import MAX_LITERALS, MAX_SURFACES
from tests.tables import TABLES, written
from tests.test_layering import ROOMS, imports, modules, room

ROOT = Path(__file__).parents[1]
README = "README.md"
SCENES = "scenes/README.md"
FILES = "gpu/files/README.md"
WGSL = "wgsl/README.md"
CONTRIBUTING = ".github/CONTRIBUTING.md"
# All that people read, but for the changelog.
PAGES = [
    CONTRIBUTING,
    *(
        path.relative_to(ROOT).as_posix()
        for pattern in ("README.md", "[!.]*/README.md", "gpu/*/README.md")
        for path in sorted(ROOT.glob(pattern))
    ),
]


def text_of(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


def blocks(file: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text_of(file), re.MULTILINE | re.DOTALL)


def rows(file: str, heading: str) -> list[list[str]]:
    """Cells of the table of ``file`` below the line ``heading``, which stands there once."""
    [table] = tables(file, heading)
    return table


def tables(file: str, heading: str) -> list[list[list[str]]]:
    """Cells of all tables of ``file`` below a line ``heading``."""
    pattern = rf"^{re.escape(heading)}\n\|[-|]+\n((?:\|.*\n)+)"
    return [
        [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()]
        for table in re.findall(pattern, text_of(file), re.MULTILINE)
    ]


[VASE] = blocks(README, "toml")
FUEL, PINS, ANIMATION = blocks(SCENES, "toml")
ANIMATED_VASE = VASE + ANIMATION


def quoted(text: str) -> list[str]:
    return re.findall(r"`([^`]+)`", text)


@pytest.fixture
def vase(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scene of the README and its animation, in the folder where the commands run."""
    path = tmp_path / "vase.toml"
    path.write_text(ANIMATED_VASE)
    monkeypatch.chdir(tmp_path)
    return path


def test_the_readme_is_short() -> None:
    assert len(text_of(README).splitlines()) <= 200


def test_links_lead_somewhere() -> None:
    for file in PAGES:
        for target in re.findall(r"\]\(([^)]+)\)", text_of(file)):
            assert not target.startswith("http"), f"{file}: {target} is not looked up"
            name, _, section = target.partition("#")
            path = (ROOT / file).parent / name if name else ROOT / file
            assert path.is_file(), f"{file}: {target}"
            if section:
                headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
                anchors = [re.sub(r"[^\w -]", "", heading).lower() for heading in headings]
                assert section.replace("-", " ") in anchors, f"{file}: {target}"


def test_paths_that_are_named_are_there() -> None:
    pattern = r"`((?:gpu|wgsl|scenes|tests|\.github|\.ci)/[^`\s]*)`"
    found = 0
    for file in PAGES:
        for name in re.findall(pattern, text_of(file)):
            assert (ROOT / name).exists(), f"{file}: {name}"
            found += 1
    assert found > 10


def test_every_page_is_found_from_the_readme() -> None:
    linked = set(re.findall(r"\]\(([^)#]+\.md)\)", text_of(README)))
    assert linked == {*PAGES, "CHANGELOG.md"} - {README}


def test_the_map_has_all_rooms_each_below_those_it_rests_on() -> None:
    listed = [quoted(row[0])[0] for row in rows(README, "| room of `gpu/` | what it is for |")]
    assert sorted(listed) == ROOMS
    for module in modules():
        for target, _ in imports(module):
            if room(module) in listed and room(target) in listed:
                assert listed.index(room(target)) <= listed.index(room(module)), (module, target)


@pytest.mark.usefixtures("vase", "adapter")
def test_python_programs_run() -> None:
    names: dict[str, Any] = {}
    programs = [(file, program) for file in (README, SCENES) for program in blocks(file, "python")]
    assert [file for file, _ in programs] == [README, SCENES, SCENES]
    for file, program in programs:
        exec(compile(program, file, "exec"), names)
    assert names["frame"].image.any()
    assert 0 < names["nearest"] < 13


@pytest.mark.usefixtures("adapter")
def test_commands_run(vase: Path) -> None:
    commands = [
        shlex.split(line, comments=True)
        for file in (README, SCENES)
        for block in blocks(file, "sh")
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
    for file, names in (
        (README, {"render", "test", "lint", "bench"}),
        (CONTRIBUTING, set(targets) - {"adapter", "lavapipe", "swiftshader"}),
    ):
        assert set(re.findall(r"(?:^|`)make ([a-z]+)", text_of(file), re.MULTILINE)) == names
        assert names <= targets


def test_all_options_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    [usage] = blocks(README, "text")
    names = [command.__name__.rpartition(".")[2].rstrip("_") for command in cli.COMMANDS]
    usage, _, look = usage.partition("\nLOOK ")
    usage, _, how = usage.partition("\nHOW: ")
    assert sorted(re.findall(r"^halfstep (\w+)", usage, re.MULTILINE)) == sorted(names)
    for command in names:
        assert cli.main([command, "--help"]) == 0
        options = set(re.findall(r"--[a-z-]+", capsys.readouterr().out)) - {"--help", "--output"}
        [own] = re.findall(rf"^halfstep {command}\b(.*?)(?=^halfstep|\Z)", usage, re.M | re.S)
        own += look if "[LOOK]" in own else ""
        own += how if "[HOW]" in own else ""
        assert set(re.findall(r"--[a-z-]+", own)) == options


def test_all_kinds_are_listed_with_their_parameters() -> None:
    common = {
        "kind", "name", "origin", "axis", "rotation_degrees", "material", "color", "key",
        "z_min", "z_max", "cut", "casts_shadow",
    }  # fmt: skip
    expected = {}
    for model in SOLID_KINDS:
        fields = model.model_fields.items()
        [kind] = get_args(model.model_fields["kind"].annotation)
        expected[kind] = {field.alias or name for name, field in fields} - common
    listed = {
        quoted(kind)[0]: {name.partition(".")[0] for name in quoted(parameters)}
        for kind, parameters, _ in rows(SCENES, "| kind | parameters | solid |")
    }
    assert listed == expected


def test_all_tables_are_listed_with_their_defaults() -> None:
    listed = {
        table.strip("`[]"): keys for table, keys in rows(SCENES, "| table | keys and defaults |")
    }
    assert set(listed) == {
        "top level", "camera", "animation", "animation.key", "image", "accuracy", "volume",
        "ambient", "light", "material", "solid", "solid.key", "surface", "part", "cell", "group",
        "place", "lattice",
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


def test_kinds_of_surfaces_are_those_of_solids_listed_a_plane_and_those_of_higher_order() -> None:
    quadrics = {kind.model_fields["kind"].default for kind in get_args(QuadricSolid)}
    kinds = {kind.model_fields["kind"].default for kind in SURFACE_KINDS}
    assert kinds == {*quadrics, "plane", "torus", "implicit"}


def test_kinds_of_lattices_are_listed_with_their_parameters() -> None:
    common = {"kind", "origin", "groups", "group"}
    heading = "| kind of lattice | parameters | elements |"
    assert {
        quoted(kind)[0]: {name.partition(" =")[0] for name in quoted(parameters)}
        for kind, parameters, _ in rows(SCENES, heading)
    } == {
        kind.model_fields["kind"].default: set(kind.model_fields) - common for kind in LATTICE_KINDS
    }


def test_keys_of_cells_and_places_are_listed() -> None:
    listed = {
        table.strip("`[]"): {name.partition(" =")[0] for name in quoted(keys)}
        for table, keys in rows(SCENES, "| table | keys and defaults |")
    }
    for name, model in (("cell", Cell), ("place", Place), ("group", Group)):
        assert listed[name] == {field.alias or key for key, field in model.model_fields.items()}


def test_the_examples_of_regions_are_scenes() -> None:
    """They show what the text says: where a point is in a cell, and how many copies there are."""
    camera = "[camera]\ncenter = [0, -8, 3]\nlook_at = [0, 0, 0]\n"
    fuel = Scene.from_dict(tomllib.loads("format = 1\n" + camera + FUEL))
    assert [str(cell.region) for cell in fuel.cells] == ["-1 & -2 & 3", "body - bore"]
    prepare(fuel)  # no cell lacks an end
    assert Scene.from_dict(tomllib.loads("format = 1\n" + camera + PINS)).layout().count == 8


def test_the_limits_are_those_listed() -> None:
    text = text_of(SCENES)
    for number, what in (
        (MAX_SURFACES, "surfaces"),
        (MAX_LITERALS, "sides of surfaces"),
        (MAX_PLACES, "copies"),
        (MAX_LEVELS, "nested levels"),
        (MAX_FORMULA_BYTES >> 10, "KiB"),
    ):
        assert f"{number:,} {what}" in " ".join(text.split())


def test_the_example_of_an_animation_can_be_added_to_that_of_a_scene() -> None:
    scene = Scene.from_dict(tomllib.loads(ANIMATED_VASE))
    assert scene.animation is not None
    first, middle = scene_at(scene, 0), scene_at(scene, 50)
    assert first.camera.center == scene.camera.center != middle.camera.center
    assert first.solids[-1].origin != middle.solids[-1].origin
    # It ends as it begins, so that the last frame is one step before.
    assert scene_at(scene, 99) != first


def test_the_default_accuracy_is_the_one_listed() -> None:
    accuracy = Scene.from_dict(tomllib.loads(VASE)).accuracy
    [keys] = [
        keys for table, keys in rows(SCENES, "| table | keys and defaults |") if "accuracy" in table
    ]
    assert f"`tolerance_pixels = {accuracy.tolerance_pixels}`" in keys


@pytest.mark.parametrize("page", TABLES)
def test_tables_are_those_that_the_code_prints(page: str) -> None:
    text = text_of(page)
    for table in TABLES[page]:
        assert written(text, table) == text, "make tables"


def test_all_overrides_are_listed() -> None:
    text = " ".join(text_of(README).split())
    [listed] = re.findall(r"`render` and `Renderer` take (.*?); the rest comes", text)
    own = {"outputs", "backend", "adapter", "camera"}
    assert set(quoted(listed)) - own == set(Overrides.__annotations__)


def test_all_files_are_listed() -> None:
    listed: dict[str, tuple[bool, tuple[str, ...]]] = {}
    for endings, outputs, usual, _ in rows(FILES, "| ending | outputs | usual | numbers |"):
        names = tuple(OUTPUTS) if usual == "all" else tuple(quoted(usual))
        listed |= dict.fromkeys(quoted(endings), (outputs == "one", names))
    assert listed == {ending: (type_.single, type_.default) for ending, type_ in ENDINGS.items()}


def test_all_animated_files_are_listed() -> None:
    endings = [quoted(row[0])[0] for row in rows(FILES, "| `-o` | what is written | limits |")]
    assert set(endings[:-1]) == set(MOVIES)


def test_all_shader_files_are_listed() -> None:
    listed = [
        name
        for table in tables(WGSL, "| file | what it does |")
        for row in table
        for name in quoted(row[0])
    ]
    assert sorted(listed) == sorted(path.name for path in (ROOT / "wgsl").glob("*.wgsl"))


def test_the_variables_are_those_the_device_reads() -> None:
    listed = {
        name.partition("=")[0]
        for row in rows(README, "| variable | effect |")
        for name in quoted(row[0])
    }
    # Other back ends of wgpu are refused, so there is nothing to choose.
    assert listed == set(device.VARIABLES) - {"WGPU_BACKEND_TYPE"}
