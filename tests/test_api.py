"""What `render` and `Renderer` take and refuse, and that every option does what it says."""

from __future__ import annotations

import math
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfstep
import halfstep.scenes
from halfstep.contract.layout import TILE
from halfstep.device import adapters as device
from halfstep.errors import AdapterError, SceneError, UsageError
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS
from halfstep.frames.renderer import Renderer
from halfstep.run import backend as backends
from halfstep.run import gpu as run_gpu
from halfstep.scene import Camera, Material, Scene, with_overrides
from halfstep.shader.needs import Needs

SIZE = (40, 30)
# Few solids of different classes, so that a shader compiles fast; lit from two sides.
SCENE = Scene.from_dict(
    {
        "format": 1,
        "camera": {"center": (0, -6, 2), "look_at": (0, 0, 0)},
        "image": {"width": SIZE[0], "height": SIZE[1]},
        "accuracy": {"steps": 14},
        "light": [{"direction": (-1, -1, 1)}, {"position": (3, -3, 3), "color": (0.2, 0.2, 0.4)}],
        "material": [{"name": "clay", "color": (0.7, 0.3, 0.2), "specular": 0.3}],
        "solid": [
            {"kind": "sphere", "radius": 1, "origin": (-1, 0, 0), "material": "clay"},
            {"kind": "box", "size": (1, 1, 2), "origin": (1.2, 0, 0), "color": (0.2, 0.5, 0.8)},
        ],
    }
)
CAMERAS: list[Any] = [
    None,
    {"center": (3, -5, 1)},
    {"center": (0, -4, 5), "fov_degrees": 30},
    Camera(center=(-6, -1, 0.5), look_at=(0, 0, 0)),
]


def render(**options: Any) -> Frame:
    return halfstep.render(SCENE, **options)


def assert_equal(frame: Frame, other: Frame) -> None:
    assert frame.outputs == other.outputs
    for name in frame.outputs:
        np.testing.assert_array_equal(getattr(frame, name), getattr(other, name), err_msg=name)


@pytest.fixture
def no_adapter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine without any Vulkan driver, where nothing is expected."""
    monkeypatch.setattr(device, "_handles", lambda: ())
    for name in ("HALFSTEP_EXPECT_LAVAPIPE", "HALFSTEP_ADAPTER", "WGPUPY_WGPU_ADAPTER_NAME"):
        monkeypatch.delenv(name, raising=False)


# -------------------------------------------------------------------------------------- scenes


@pytest.fixture(params=["path", "text", "name", "mapping"])
def given(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """All that stands for the bundled scene "figure", but for the scene itself."""
    text = Path(halfstep.scenes.__path__[0], "figure.toml").read_text(encoding="utf-8")
    path = tmp_path / "mine.toml"
    path.write_text(text)
    forms = {"path": path, "text": str(path), "name": "figure", "mapping": tomllib.loads(text)}
    return forms[request.param]


def test_whatever_stands_for_a_scene_is_rendered(given: Any) -> None:
    scene = halfstep.load("figure")
    options: dict[str, Any] = {"size": SIZE, "outputs": ("image",), "backend": "numpy"}
    expected = halfstep.render(scene, **options)
    frames = [halfstep.render(given, **options)]
    with Renderer(given, **options) as renderer:
        frames.append(renderer.render())
    with Renderer(SCENE, **options) as renderer:
        frames.append(renderer.render(given))
        frames.extend(renderer.render_all([given, scene]))
    for frame in frames:
        assert frame.info["scene_sha256"] == expected.info["scene_sha256"]
        assert_equal(frame, expected)
    [frame] = halfstep.render_frames(given, [7], **options)
    [expected] = halfstep.render_frames(scene, [7], **options)
    assert_equal(frame, expected)


def test_a_mapping_that_is_no_scene_lists_its_faults() -> None:
    faulty: Any = {"format": 1, "camera": {"center": (0, 0, 0)}, "solid": [{"kind": "sphere"}]}
    expected = (
        "scene: camera.look_at: missing",
        "scene: solid[0].radius: missing",
        "scene: solid[0]: has neither material nor color; one must be given",
    )
    for action in (halfstep.render, Renderer, halfstep.render_frames):
        with pytest.raises(SceneError) as caught:
            action(faulty)
        assert set(caught.value.faults) == set(expected)


# ------------------------------------------------------------------------------------- options


def test_everything_is_computed_by_default_and_the_image_by_a_renderer(backend: str) -> None:
    assert render(backend=backend).outputs == tuple(OUTPUTS)
    with Renderer(SCENE, backend=backend) as renderer:
        assert renderer.render().outputs == ("image", "solid")


@pytest.mark.parametrize("name", OUTPUTS)
def test_an_output_does_not_depend_on_the_others(backend: str, name: str) -> None:
    frame = render(outputs=(name,), backend=backend)
    assert set(frame.outputs) == {name, "solid"}
    everything = render(backend=backend)
    for each in frame.outputs:
        np.testing.assert_array_equal(getattr(frame, each), getattr(everything, each))


def test_size_is_width_and_height(backend: str) -> None:
    assert render(backend=backend).solid.shape == (30, 40)
    for size in ((7, 50), (1, 1), (33, 1)):
        frame = render(size=size, backend=backend)
        assert frame.image.shape == (size[1], size[0], 3)
        assert frame.position.shape == (size[1], size[0], 3)


def test_info_tells_the_steps_of_the_arrays_with_samples_too(backend: str) -> None:
    scene = halfstep.load("figure")
    frame = halfstep.render(
        scene, size=(48, 36), samples=3, outputs=("image", "steps"), backend=backend
    )
    told = np.array(frame.info["steps"])
    hit = frame.solid >= 0
    assert len(told) == len(scene.solids)
    np.testing.assert_array_equal(frame.steps[hit], told[frame.solid[hit]])


@pytest.mark.parametrize("steps", [1, 5, 16, 17, 22, 30])
def test_every_solid_gets_the_steps_asked_for(backend: str, steps: int) -> None:
    frame = render(steps=steps, outputs=("steps", "depth"), backend=backend)
    assert frame.info["steps"] == [steps, steps]
    hit = frame.solid >= 0
    np.testing.assert_array_equal(frame.steps, np.where(hit, steps, 0))
    # Both solids are 2 deep, and their intervals at most 4.
    exact = render(steps=24, outputs=("depth",), backend="numpy")
    both = hit & (exact.solid == frame.solid)
    error = np.abs(frame.depth - exact.depth)[both].max()
    assert error <= 2 * (2.0**-steps + 2.0**-21)
    if steps <= 16:
        assert error > 0.2 * 2.0**-steps


def test_methods_agree_on_clear_pixels(backend: str) -> None:
    visible = render(method="visible", backend=backend)
    article = render(method="article", backend=backend)
    assert (visible.info["method"], article.info["method"]) == ("visible", "article")
    same = visible.solid == article.solid
    assert same.mean() > 0.99
    both = same & (visible.solid >= 0)
    np.testing.assert_allclose(visible.depth[both], article.depth[both], atol=4 * 2.0**-14)


@pytest.mark.parametrize("method", ["visible", "article"])
def test_the_device_gives_the_bits_of_the_twin(adapter: device.Adapter, method: str) -> None:
    if not device.is_lavapipe(adapter.summary):
        pytest.skip("other drivers may contract a*b+c")
    assert_equal(render(method=method, backend="gpu"), render(method=method, backend="numpy"))


@pytest.mark.parametrize("camera", CAMERAS[1:])
def test_a_camera_replaces_the_keys_it_has(backend: str, camera: Any) -> None:
    frame = render(camera=camera, backend=backend)
    whole = with_overrides(SCENE, camera=camera)
    assert_equal(frame, halfstep.render(whole, backend=backend))
    assert frame.info["scene_sha256"] == whole.sha256 != SCENE.sha256
    assert not np.array_equal(frame.solid, render(outputs=(), backend=backend).solid)
    if isinstance(camera, dict):
        assert whole.camera.look_at == SCENE.camera.look_at


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"steps": 0}, "steps: 0 is not >= 1"),
        ({"steps": 31}, "steps: 31 is not <= 30"),
        ({"size": (0, 9)}, "size[0]: 0 is not >= 1"),
        ({"size": 9}, "size: 9 is not an array of 2 integers"),
        ({"samples": 9}, "samples: 9 is not <= 8"),
        ({"method": "fast"}, 'method: "fast" is not "visible" or "article"'),
        ({"tolerance": -1.0}, "tolerance: -1 is not > 0"),
        ({"camera": {"fov_degrees": 180.0}}, "camera.fov_degrees: 180 is not < 180"),
        (
            {"camera": {"center": (0, 0, 0)}, "steps": 99},
            "camera.look_at: [0, 0, 0] equals center\nsteps: 99 is not <= 30",
        ),
    ],
)
def test_options_out_of_range_are_faults(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError) as caught:
        render(**options)
    assert str(caught.value) == message
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"backend": "cuda"}, "backend: 'cuda' is not one of auto, gpu, numpy"),
        (
            {"outputs": ("depth", "albedo")},
            f"outputs: 'albedo' unknown; known are {', '.join(OUTPUTS)}",
        ),
        ({"outputs": 3}, "outputs: 3 is not an array of names"),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        render(**options)
    assert str(caught.value) == message
    assert caught.value.exit_code == 2


def test_a_scene_without_lights_is_lit_from_the_camera(backend: str) -> None:
    tables = SCENE.model_dump(by_alias=True, exclude_none=True)
    dark = Scene.from_dict({**tables, "light": []})
    lit = Scene.from_dict({**tables, "light": [{"direction": (0, -6, 2)}]})
    assert_equal(halfstep.render(dark, backend=backend), halfstep.render(lit, backend=backend))
    assert halfstep.render(dark, backend=backend).color.max() > 0.5


# ------------------------------------------------------------------------------------- samples


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_samples_are_averaged_in_linear_light(backend: str, samples: int) -> None:
    width, height = SIZE
    frame = render(samples=samples, backend=backend)
    fine = render(size=(width * samples, height * samples), outputs=("color",), backend=backend)
    blocks = fine.color.reshape(height, samples, width, samples, 3).astype(np.float64)
    mean = blocks.mean(axis=(1, 3))
    np.testing.assert_allclose(frame.color, mean, rtol=1e-6)
    srgb = np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)
    np.testing.assert_array_equal(frame.image, np.rint(255 * srgb.clip(0, 1)))
    # An edge is a mixture, so averaging after sRGB would differ.
    assert len(np.unique(frame.image)) > len(np.unique(render(backend=backend).image))


def test_other_arrays_are_those_of_pixel_centres(backend: str) -> None:
    once, averaged = (render(samples=samples, backend=backend) for samples in (1, 3))
    assert averaged.outputs == once.outputs
    for name in set(OUTPUTS) - {"image", "color"}:
        np.testing.assert_array_equal(getattr(averaged, name), getattr(once, name), err_msg=name)
    assert not np.array_equal(averaged.color, once.color)


@pytest.mark.parametrize("outputs", [("image",), ("color",), ("solid",)])
def test_samples_with_a_single_output(backend: str, outputs: tuple[str, ...]) -> None:
    frame = render(samples=2, outputs=outputs, backend=backend)
    assert set(frame.outputs) == {*outputs, "solid"}
    everything = render(samples=2, backend=backend)
    for name in frame.outputs:
        np.testing.assert_array_equal(getattr(frame, name), getattr(everything, name))


# --------------------------------------------------------------------------------------- bands


@pytest.mark.usefixtures("adapter")
def test_a_picture_in_bands_is_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bands of one row of tiles, as where memory is short; odd sizes leave a part of a band."""
    size = (70, 131)
    whole = [render(size=size, samples=k, backend="gpu") for k in (1, 3)]
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1)
    for samples, frame in zip((1, 3), whole, strict=True):
        calls: list[int] = []
        band = run_gpu.Device.render_band

        def counted(*args: Any, band: Any = band, calls: list[int] = calls) -> Any:
            calls.append(args[4])  # rows
            return band(*args)

        with monkeypatch.context() as patch:
            patch.setattr(run_gpu.Device, "render_band", counted)
            assert_equal(render(size=size, samples=samples, backend="gpu"), frame)
        assert len(calls) > 4
        assert max(calls) == TILE * samples


def test_samples_do_not_need_a_larger_device(adapter: device.Adapter) -> None:
    """The sub-pixels of a band that just fits the device would not."""
    limits = device.open_device(adapter).limits
    smallest = min(limits["max-storage-buffer-binding-size"], 1 << 27)
    samples, width = 8, 2048
    # surface and three of color, four bytes each, for a fine grid eight times as wide and high
    rows = smallest // (16 * samples * width) // samples
    size = (width, rows + 64)
    small = with_overrides(SCENE, size=size, samples=samples, camera={"fov_degrees": 5.0})
    frame = halfstep.render(small, steps=1, outputs=("image",), backend="gpu")
    assert frame.image.shape == (size[1], size[0], 3)


# ------------------------------------------------------------------------------------ Renderer


def test_a_renderer_gives_what_fresh_renders_give(backend: str) -> None:
    with Renderer(SCENE, outputs=OUTPUTS, backend=backend) as renderer:
        for camera in (*CAMERAS, *CAMERAS[:2]):
            assert_equal(renderer.render(camera=camera), render(camera=camera, backend=backend))


def test_a_renderer_takes_its_own_camera_as_default(backend: str) -> None:
    camera = CAMERAS[1]
    with Renderer(SCENE, outputs=OUTPUTS, backend=backend, camera=camera) as renderer:
        assert_equal(renderer.render(), render(camera=camera, backend=backend))
        # Keys replace those of the renderer's camera, not of the scene's.
        frame = renderer.render(camera={"fov_degrees": 20.0})
    both = {**camera, "fov_degrees": 20.0}
    assert_equal(frame, render(camera=both, backend=backend))


def moved(scene: Scene, *places: tuple[float, float, float]) -> Scene:
    """The scene with its solids at other places."""
    pairs = zip(scene.solids, places, strict=True)
    solids = tuple(solid.model_copy(update={"origin": place}) for solid, place in pairs)
    return scene.model_copy(update={"solids": solids})


def test_a_renderer_takes_another_scene(backend: str) -> None:
    others = [
        moved(SCENE, (-1, 0, 0.5), (1.2, -1, 0)),
        with_overrides(SCENE, camera=CAMERAS[1]),
        SCENE.model_copy(update={"materials": (Material(name="clay", color=(0.1, 0.9, 0.1)),)}),
        SCENE.model_copy(update={"solids": SCENE.solids[:1]}),
    ]
    with Renderer(SCENE, outputs=OUTPUTS, backend=backend) as renderer:
        for scene in others:
            assert_equal(renderer.render(scene), halfstep.render(scene, backend=backend))
            # Its own scene is as before.
            assert_equal(renderer.render(), render(backend=backend))


def test_another_scene_gets_the_options_but_its_own_camera(backend: str) -> None:
    options: dict[str, Any] = {"size": (20, 20), "steps": 7, "samples": 2, "backend": backend}
    other = with_overrides(moved(SCENE, (0, 0, 1), (1, 1, 0)), camera=CAMERAS[1], steps=3)
    with Renderer(SCENE, outputs=OUTPUTS, camera=CAMERAS[2], **options) as renderer:
        assert_equal(renderer.render(other), halfstep.render(other, **options))
        frame = renderer.render(other, camera=CAMERAS[3])
    assert_equal(frame, halfstep.render(other, camera=CAMERAS[3], **options))


@pytest.mark.usefixtures("adapter")
def test_solids_that_move_compile_nothing(composed: list[Needs]) -> None:
    with Renderer(SCENE, backend="gpu") as renderer:
        for _ in range(2):
            renderer.render()
            assert composed
        composed.clear()
        for z in (0.0, 0.5, 1.5):
            renderer.render(moved(SCENE, (-1, 0, z), (1.2, z, 0)))
    assert not composed


def test_frames_do_not_share_memory(backend: str) -> None:
    with Renderer(SCENE, outputs=OUTPUTS, backend=backend) as renderer:
        first = renderer.render()
        kept = {name: getattr(first, name).copy() for name in first.outputs}
        renderer.render(camera=CAMERAS[2])
    for name, array in kept.items():
        np.testing.assert_array_equal(getattr(first, name), array, err_msg=name)


def test_a_bad_camera_leaves_the_renderer_usable(backend: str) -> None:
    with Renderer(SCENE, backend=backend) as renderer:
        with pytest.raises(SceneError) as caught:
            renderer.render(camera={"up": (0, -6, 2)})
        assert str(caught.value) == (
            "camera.up: [0, -6, 2] is parallel to the view, look_at - center"
        )
        assert renderer.render().image.any()


@pytest.mark.parametrize(
    "scenes",
    ["figure", Path("figure.toml"), halfstep.load("figure"), {"format": 1}],
    ids=["name", "path", "scene", "mapping"],
)
def test_one_scene_is_not_taken_for_several(scenes: Any) -> None:
    with Renderer(SCENE, backend="numpy") as renderer, pytest.raises(UsageError) as caught:
        next(renderer.render_all(scenes))
    assert str(caught.value) == "scenes: render_all takes several scenes; for one, give [scene]"


def test_a_closed_renderer_says_so(backend: str) -> None:
    with Renderer(SCENE, backend=backend) as renderer:
        renderer.render()
    renderer.close()
    with pytest.raises(UsageError) as caught:
        renderer.render()
    assert str(caught.value) == "the renderer is closed"


# ---------------------------------------------------------------------------------------- info


def test_info_tells_how_a_frame_was_made(backend: str, adapter: device.Adapter) -> None:
    info = render(backend=backend).info
    keys = {"adapter", "driver", "number_format", "method", "steps", "wall_ms", "scene_sha256"}
    keys |= {"scene_title", "version"}
    timed = backend == "gpu" and "timestamp-query" in adapter.handle.features
    assert info.keys() == keys | ({"device_ms"} if timed else set())
    assert info["version"] == halfstep.__version__
    assert info["scene_sha256"] == SCENE.sha256
    assert (info["number_format"], info["method"]) == ("float32", "visible")
    assert info["steps"] == [14, 14]
    assert info["wall_ms"] > 0
    if backend == "gpu":
        assert (info["adapter"], info["driver"]) == (adapter.summary.name, adapter.summary.driver)
        assert not timed or 0 < info["device_ms"] < info["wall_ms"]
    else:
        assert (info["adapter"], info["driver"]) == ("numpy", f"NumPy {np.__version__}")


# ------------------------------------------------------------------------------------- backends


@pytest.mark.usefixtures("no_adapter")
def test_without_an_adapter_the_twin_renders_and_says_so() -> None:
    with pytest.warns(UserWarning, match="NumPy") as caught:
        frame = render()
    assert [str(each.message) for each in caught] == [
        "rendering with NumPy, slowly: no Vulkan adapter found (see `halfstep doctor`)"
    ]
    assert frame.info["adapter"] == "numpy"
    assert_equal(frame, render(backend="numpy"))


@pytest.mark.usefixtures("no_adapter")
def test_a_gpu_that_is_asked_for_must_be_there(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(AdapterError) as caught:
        render(backend="gpu")
    assert str(caught.value) == device.NO_ADAPTER
    assert caught.value.exit_code == 3
    with pytest.raises(AdapterError):
        render(adapter="GeForce")
    monkeypatch.setenv("HALFSTEP_ADAPTER", "GeForce")
    with pytest.raises(AdapterError):
        render()


@pytest.mark.parametrize(
    ("expected", "message"),
    [("1", "no lavapipe;"), ("true", "no lavapipe;"), ("please", "neither a yes (1, true, yes)")],
)
@pytest.mark.usefixtures("no_adapter")
def test_an_expected_lavapipe_is_never_replaced_by_the_twin(
    expected: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HALFSTEP_EXPECT_LAVAPIPE", expected)
    with pytest.raises(AdapterError) as caught:
        render()
    assert str(caught.value).startswith(f"HALFSTEP_EXPECT_LAVAPIPE={expected}: {message}")


def test_the_numpy_backend_never_asks_for_an_adapter(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(backends, "choose_adapter", refuse)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert render(backend="numpy").info["adapter"] == "numpy"


def test_all_frames_in_order_are_those_of_one_after_another(backend: str) -> None:
    scene = halfstep.load("figure")
    eyes = [(12 * math.sin(k), -12 * math.cos(k), 5.0) for k in range(4)]
    scenes = [with_overrides(scene, camera={"center": eye}) for eye in eyes]
    options: dict[str, Any] = {"size": (48, 36), "outputs": ("image", "depth"), "backend": backend}
    with halfstep.Renderer(scene, **options) as renderer:
        single = [renderer.render(one) for one in scenes]
        together = list(renderer.render_all(scenes))
        assert list(renderer.render_all([])) == []
        # Who takes no more than one frame leaves the renderer usable.
        assert next(renderer.render_all(scenes)).image.any()
        assert renderer.render(scenes[0]).image.any()
    assert len(together) == len(single)
    for one, other in zip(single, together, strict=True):
        np.testing.assert_array_equal(one.image, other.image)
        np.testing.assert_array_equal(one.depth, other.depth)
        assert one.info["scene_sha256"] == other.info["scene_sha256"]
    with pytest.raises(UsageError, match="closed"):
        next(renderer.render_all(scenes))
