"""`halfstep check`: a device that agrees passes, and a fault is found in the place where it is."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest

import halfstep
from halfstep.check import checker as check
from halfstep.check.calls import Calls, noted
from halfstep.check.checker import Checker
from halfstep.cli import main
from halfstep.device import canary
from halfstep.device.adapters import Adapter
from halfstep.errors import AdapterError
from halfstep.frames.outputs import OUTPUTS, device_outputs
from halfstep.host.prepare import prepare
from halfstep.run import rounds
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, bundled_scenes, with_overrides
from halfstep.shader import library, source
from halfstep.shader.needs import Needs
from halfstep.testing import frames
from halfstep.testing.module import Module
from halfstep.twin import halve, piece
from tests.mirrored import mirroring
from tests.test_rounds import barrels

SIZE = (96, 72)
# What the slip in the stage `nearest` is in, and what calls it.
FAULTY = ["keep.keep", "keys.key_at", "nearest.depth_key"]


def small(name: str, **overrides: Any) -> Scene:
    return with_overrides(halfstep.load(name), size=SIZE, **overrides)


@pytest.fixture(scope="module")
def checker(adapter: Adapter) -> Iterator[Checker]:
    with Checker(adapter.summary.index) as checker:
        yield checker


@pytest.mark.parametrize(("scene", "method"), [("figure", "visible"), ("one_box", "article")])
def test_the_device_agrees(checker: Checker, scene: str, method: str) -> None:
    report = checker.check(small(scene, method=method))
    assert report.agrees, str(report)
    assert report.picture is None
    assert report.frame.exact
    assert [census.failed.size for census in report.images] == [SIZE[0] * SIZE[1]] * 3
    # Of every part of the pipeline something was tried, on many pixels.
    files = {name.split(".")[0] for name in report.stages}
    files_of_method = {"article"} if method == "article" else {"piece", "root"}
    assert files >= {"nearest", "certify", "normal", "ray", "shade", "encode"} | files_of_method
    assert all(census.rows >= 100 for census in report.stages.values())


def test_a_material_without_a_highlight_has_no_exponent(checker: Checker) -> None:
    """A shader computes powers up to the largest exponent of the highlights that there are."""
    sphere = {"kind": "sphere", "radius": 1}
    scene = Scene.from_dict(
        {
            "format": 1,
            "image": {"width": SIZE[0], "height": SIZE[1]},
            "camera": {"center": [0, -9, 3], "look_at": [0, 0, 0], "fov_degrees": 30},
            "material": [
                {"name": "matt", "color": [1, 1, 1]},
                {"name": "dull", "color": [1, 1, 1], "specular": 0.3, "shininess": 20},
            ],
            "solid": [
                {**sphere, "origin": [x, 0, 0], "material": name}
                for x, name in ((-1, "matt"), (1, "dull"))
            ],
        }
    )
    assert prepare(scene).shininess_bits == 5
    report = checker.check(scene)
    assert report.agrees, str(report)
    assert report.stages["shade.power"].rows > 100


def test_more_than_16_halvings_are_checked(checker: Checker) -> None:
    report = checker.check(small("one_sphere", steps=20))
    assert report.agrees, str(report)
    assert "halve_incremental.halved" in report.stages


@pytest.fixture
def slip(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slip in a stage function of the shader."""
    stage = library.stage

    def faulty(name: str) -> str:
        text = stage(name)
        if name != "nearest":
            return text
        assert "position + i4(1i << steps)" in text
        return text.replace("position + i4(1i << steps)", "position + i4(2i << steps)")

    monkeypatch.setattr(source, "stage", faulty)


@pytest.mark.usefixtures("slip")
def test_a_fault_in_a_stage_is_found_there(checker: Checker) -> None:
    report = checker.check(small("one_box"))
    assert not report.agrees
    assert report.faulty == FAULTY
    assert report.frame.failed.any()
    text = str(report)
    census = report.stages["nearest.depth_key"]
    assert f"depth_key: {census.failed} of {census.rows} rows differ (exact)" in text
    assert "in low: " in text
    assert "every stage function agrees alone" not in text


@pytest.fixture
def broken_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slip in the kernel that joins the stages."""

    def faulty(needs: Needs) -> str:
        text = source.compose(needs)
        return text.replace("sight_0 = Sight(\n    root_0.hit,", "sight_0 = Sight(\n    b4(true),")

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)


@pytest.mark.usefixtures("broken_kernel")
def test_a_fault_between_the_stages_is_told_from_one_in_them(checker: Checker) -> None:
    report = checker.check(small("one_box"))
    assert (report.agrees, report.faulty) == (False, [])
    assert "every stage function agrees alone" in str(report)
    assert report.picture is not None
    picture = imageio.imread(io.BytesIO(report.picture))
    red = (picture[:, 2 * SIZE[0] :] == (255, 0, 96)).all(axis=-1)
    np.testing.assert_array_equal(red, report.frame.failed)


def plant(
    monkeypatch: pytest.MonkeyPatch, old: str, new: str, where: Callable[[Needs], bool]
) -> None:
    """Plant a slip in the shaders of a certain kind."""

    def faulty(needs: Needs) -> str:
        text = source.compose(needs)
        if where(needs):
            assert old in text
            text = text.replace(old, new)
        return text

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)


def of_two_quads(needs: Needs) -> bool:
    return needs.quads > 1 and len(needs.classes) > 0


def test_a_fault_in_the_shader_of_an_image_alone_is_found(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant(monkeypatch, "offset(x_1, y)", "offset(x_0, y)", of_two_quads)
    report = checker.check(small("one_sphere"))
    assert not report.agrees
    assert report.faulty == []
    assert not report.frame.failed.any()
    # Blocks of the first frame have one quad.
    assert [census.failed.any() for census in report.images] == [False, True, True]
    assert "frame 2 of an image alone: " in str(report)
    assert "every stage function agrees alone" in str(report)
    assert report.picture is not None
    assert len(report.as_dict()["images"]) == 3


def test_a_fault_in_the_shaders_of_second_frames_is_found(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Beside each other, so that most tiles see one class alone.
    solids = [
        {"kind": "sphere", "color": [1, 1, 1], "origin": [-2, 0, 0], "radius": 1},
        {"kind": "box", "color": [1, 1, 1], "origin": [2, 0, 0], "size": [2, 2, 2]},
    ]
    camera = {"center": [0, -9, 3], "look_at": [0, 0, 0], "fov_degrees": 40}
    image = {"width": SIZE[0], "height": SIZE[1]}
    scene = Scene.from_dict({"format": 1, "image": image, "camera": camera, "solid": solids})
    classes = len(prepare(scene).present)
    assert classes == 2
    plant(
        monkeypatch,
        "reached(search_0, root_0, steps)",
        "reached(search_0, root_0, steps) + i4(512)",
        lambda needs: 0 < len(needs.classes) < classes,
    )
    report = checker.check(scene)
    assert [census.failed.any() for census in report.images] == [False, True, True]
    assert not report.frame.failed.any()
    assert not report.agrees
    assert "frame 2 of an image alone: " in str(report)


def test_loops_that_are_cut_short_are_found(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    if checker.fingerprint.loop_limit != 65_535:
        pytest.skip("this driver lets loops run")
    monkeypatch.setattr(rounds, "exceed", lambda *_: np.zeros(1, bool))
    report = checker.check(barrels(12))  # `test_rounds` has it with parts
    assert not report.agrees
    assert report.frame.failed.any()


def test_an_image_of_a_device_that_rounds_otherwise_is_excused_where_decisions_are(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Half a pixel's width, which only what lies within rounding may hide, must be found.
    monkeypatch.setattr(checker, "_exact", False)
    for method in ("visible", "article"):
        assert checker.check(small("figure", method=method)).agrees
    plant(monkeypatch, "offset(x_1, y)", "offset(x_0, y)", of_two_quads)
    assert not checker.check(small("one_sphere")).agrees


@pytest.mark.usefixtures("slip")
def test_where_bits_are_not_promised_stages_only_inform(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    compare = frames.compare_frames
    monkeypatch.setattr(checker, "_exact", False)
    monkeypatch.setattr(check, "compare_frames", lambda found, *_, **__: compare(found, found))
    report = checker.check(small("one_box"))
    assert report.faulty == FAULTY
    assert report.agrees


def test_where_bits_are_not_promised_a_device_is_no_excuse_for_itself(
    checker: Checker, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Of a plane that is met at the wrong place the shader's own certificate says: not certain.
    stage = library.stage
    wrong = "!outside & (piece.id_in > i4(0))", "!outside & (piece.id_in > i4(2))"
    assert wrong[0] in stage("root")
    monkeypatch.setattr(source, "stage", lambda name: stage(name).replace(*wrong))
    monkeypatch.setattr(checker, "_exact", False)
    report = checker.check(small("one_cylinder"))
    assert (report.agrees, report.frame.exact) == (False, False)
    assert report.frame.failed.any()
    monkeypatch.setattr(check, "replay", lambda *_: None)
    assert checker.check(small("one_cylinder")).agrees


def test_scenes_share_the_texts_of_stages_alone() -> None:
    texts: list[dict[str, str]] = []
    for name in ("one_sphere", "one_cylinder"):
        needs = needs_of_frame(prepare(small(name)), "visible", device_outputs(OUTPUTS))
        text = source.compose_stages(needs)
        whole = Module("the shader", text)
        texts.append({each: library.alone(text, each) for each in whole.functions()})
        for function, part in texts[-1].items():
            assert Module("a part", part).declared.keys() == whole.reached(function), function
    both = texts[0].keys() & texts[1].keys()
    assert len(both) > 30
    assert sum(texts[0][name] == texts[1][name] for name in both) > 0.9 * len(both)


def test_the_calls_of_the_twin_are_noted_and_nothing_is_left() -> None:
    before = halve.halved, piece.clip
    with noted() as calls:
        halfstep.render(small("one_box"), backend="numpy")
        assert halve.halved is not before[0]
    assert (halve.halved, piece.clip) == before
    with pytest.raises(ZeroDivisionError), noted():
        _ = 1 // 0
    assert (halve.halved, piece.clip) == before
    assert sum(calls["piece", "clip"].rows) > 0
    assert not calls["article", "article_patch"].rows


def test_shadows_and_mirrors_of_cells_are_noted() -> None:
    """Veils are tried on the pixels of a bundle alone, which are no picture."""
    scene = mirroring(halfstep.load("die"))
    lights = tuple(light.model_copy(update={"shadows": True}) for light in scene.lights)
    scene = with_overrides(scene.model_copy(update={"lights": lights}), size=(32, 24))
    with noted() as calls:
        halfstep.render(scene, backend="numpy", outputs=("color", "error"))
    for file, name in (("veil", "curve_crossed"), ("reflect", "encounter")):
        assert sum(calls[file, name].rows) > 0
    assert ("veils", "draw_veil") not in calls


def test_pixels_are_noted_in_groups_of_four() -> None:
    calls = Calls()
    x = np.arange(2 * 6, dtype=np.float32).reshape(2, 6)
    calls.note({"x": x, "n": 3}, x > 4)
    assert calls.rows == [4]
    # The last group of a row goes on with its last pixel.
    expected = [[0, 1, 2, 3], [4, 5, 5, 5], [6, 7, 8, 9], [10, 11, 11, 11]]
    assert calls.given[0]["x"].tolist() == expected
    assert (calls.returned[0] == (np.array(expected) > 4)).all()
    assert calls.given[0]["n"] == 3


@pytest.mark.usefixtures("adapter")
def test_the_command_says_that_all_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "one_sphere", "--size", "64x48"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("one_sphere, 64x48, visible, float32: 3072 pixels, ")
    assert out.endswith(" stages agree\n")
    assert "a·b + c" in err


@pytest.mark.usefixtures("broken_kernel", "adapter")
def test_the_command_fails_and_leaves_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "deep" / "check"
    assert main(["check", "one_box", "--size", "64x48", "--json", "-o", str(folder)]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((folder / "check.json").read_text())
    assert sorted(path.name for path in folder.iterdir()) == ["check.json", "one_box.png"]
    assert (report["agree"], report["halfstep"]) == (False, halfstep.__version__)
    assert report["canary"]["stack"].keys() >= {"adapter", "driver", "wgpu", "wgpu_native"}
    [scene] = report["scenes"]
    assert (scene["scene"], scene["agrees"]) == ("one_box", False)
    assert scene["frame"]["failed"] > 0
    assert all(stage["failed"] == 0 for stage in scene["stages"].values())


@pytest.mark.usefixtures("adapter")
def test_all_are_the_bundled_scenes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("one_plane", "one_sphere")
    few = {name: title for name, title in bundled_scenes().items() if name in names}
    assert tuple(few) == names
    monkeypatch.setattr(halfstep.scene, "bundled_scenes", lambda: few)
    assert main(["check", "--all", "--size", "32x24"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[0] for line in lines] == list(few)


@pytest.mark.usefixtures("adapter")
def test_all_scenes_are_checked_though_one_cannot_be(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    few = dict.fromkeys(("one_box", "one_plane", "one_sphere"), "")
    monkeypatch.setattr(halfstep.scene, "bundled_scenes", lambda: few)
    render_check = Checker.check

    def refusing(checker: Checker, scene: Scene) -> check.SceneReport:
        if scene.name == "one_plane":
            raise AdapterError("no such integers")
        return render_check(checker, scene)

    monkeypatch.setattr(Checker, "check", refusing)
    assert main(["check", "--all", "--size", "32x24"]) == 3
    out, err = capsys.readouterr()
    assert [line.split(",")[0] for line in out.splitlines()] == [
        "one_box",
        "one_plane: no such integers",
        "one_sphere",
    ]
    assert err.splitlines()[-1] == "2 of 3 scenes agree; not: one_plane"
    assert main(["check", "--all", "--size", "32x24", "--json"]) == 3
    report = json.loads(capsys.readouterr().out)
    assert report["agree"] is False
    assert report["refused"] == {"one_plane": "no such integers"}
    assert main(["check", "one_plane", "--size", "32x24"]) == 3
    assert capsys.readouterr().err.endswith("no such integers\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "one of the arguments SCENE --all is required"),
        (["figure", "--all"], "not allowed with argument"),
        (["nothing"], "nothing"),
        (["figure", "--size", "0x1"], "0 is not"),
        (["figure", "--size", "32x24", "-o", "/dev/null/in"], "/dev/null is not a folder"),
    ],
)
def test_what_cannot_be_checked_is_said(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


@pytest.mark.usefixtures("adapter")
def test_a_driver_with_wrong_answers_checks_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = canary.shader
    monkeypatch.setattr(canary, "shader", lambda name: text(name).replace("x.i * x.j", "x.i"))
    assert main(["check", "figure"]) == 4
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("the driver compiles shaders wrongly")
