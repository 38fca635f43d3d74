"""A live view without a display: events in, pictures and lines out."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.errors import SceneError
from halfstep.files.inferno import inferno
from halfstep.frames.outputs import OUTPUTS
from halfstep.host.prepare import Solids
from halfstep.scene import Scene
from halfstep.shader.needs import Needs
from halfstep.viewer.clip import Clip, Clipped
from halfstep.viewer.clip import clipped as clipped_in
from halfstep.viewer.picture import NOTHING, UNCERTAIN, picture_of
from halfstep.viewer.session import Session
from halfstep.viewer.state import COARSEST, KEYS, SLOW_MS, State, coarser
from halfstep.viewer.text import NARROWEST
from halfstep.viewer.watch import Source

# Narrower than what has room for text, so that pictures are those of frames.
SIZE = (96, 72)
assert SIZE[0] < NARROWEST
SCENE = """
format = 1
[camera]
center = [0, -8, 2]
look_at = [0, 0, 0]
[[solid]]
name = "ball"
kind = "sphere"
color = [0.8, 0.6, 0.2]
radius = 1
[[solid]]
kind = "box"
color = [0.2, 0.6, 0.8]
size = [1, 1, 1]
origin = [2, 0, 0]
"""


class Driven:
    """A session that a test drives, on NumPy; it rests at once."""

    def __init__(self, scene: Any, backend: str = "numpy") -> None:
        self.told: list[str] = []
        self.source = Source(scene, None, None, {})
        self.session = Session(
            self.source, backend=backend, tell=self.told.append, rest_after=0.0, patience=0.0
        )

    def send(self, event_type: str, **facts: Any) -> None:
        self.session.handle({"event_type": event_type, "modifiers": (), **facts})

    def drag(self, start: tuple[int, int], end: tuple[int, int], **facts: Any) -> None:
        places = np.linspace(start, end, 5).tolist()
        self.send("pointer_down", x=start[0], y=start[1], **{"button": 1, **facts})
        for x, y in places:
            self.send("pointer_move", x=x, y=y, **facts)
        self.send("pointer_up", x=end[0], y=end[1], **facts)

    def click(self, x: int, y: int) -> None:
        self.drag((x, y), (x, y))

    def press(self, *keys: str) -> None:
        for key in keys:
            self.send("key_down", key=key)
            self.settle()

    def settle(self) -> np.ndarray:
        """The picture when nothing is left to draw, RGB."""
        for _ in range(9):
            picture = self.session.draw(SIZE)
            if not self.session.tick():
                assert picture.shape == (SIZE[1], SIZE[0], 4)
                assert (picture[..., 3] == 255).all()
                return picture[..., :3]
        raise AssertionError("it goes on drawing")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A scene file."""
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    return file


@pytest.fixture
def driven(path: Path) -> Iterator[Driven]:
    """A view of it."""
    made = Driven(path)
    yield made
    made.session.close()


def rendered(driven: Driven, **options: Any) -> halfstep.Frame:
    """What `render` makes of what is seen."""
    options = {"backend": "numpy", **options}
    return halfstep.render(driven.source.scene, size=SIZE, camera=driven.session.camera, **options)


def test_it_shows_the_image(driven: Driven) -> None:
    np.testing.assert_array_equal(driven.settle(), rendered(driven).image)
    assert "error at most" in driven.session.lines[-1]
    assert "96x72" in driven.session.lines[-1]


def test_that_shaders_are_compiled_is_said_before(driven: Driven) -> None:
    first = driven.session.draw(SIZE)
    assert driven.session.lines == ["compiling shaders"]
    assert driven.session.wants_draw
    assert len(np.unique(first[..., :3])) == 1


def test_a_drag_turns_and_a_wheel_zooms(driven: Driven) -> None:
    before, camera = driven.settle(), driven.session.camera
    driven.drag((48, 36), (68, 36))
    assert (driven.settle() != before).any()
    assert not driven.told
    turned = driven.session.camera
    # Counter-clockwise from above by a hundredth for each pixel, and to the left: to the right is
    # what is seen.
    np.testing.assert_allclose(turned.center, [8 * math.sin(-0.2), -8 * math.cos(0.2), 2])
    driven.send("key_down", key="r")
    assert driven.session.camera == camera
    driven.settle()
    driven.send("wheel", x=48, y=36, dx=0, dy=-200)
    depth = rendered(driven, outputs=("depth",)).depth[36, 48]
    old = halfstep.render(driven.source.scene, size=SIZE, backend="numpy").depth[36, 48]
    assert depth == pytest.approx(old / 2**0.5, rel=0.01)


@pytest.mark.parametrize("facts", [{"button": 2}, {"button": 1, "modifiers": ("Shift",)}])
def test_what_is_panned_follows_the_pointer(driven: Driven, facts: dict[str, Any]) -> None:
    driven.settle()
    before = rendered(driven).position[36, 48]
    driven.drag((48, 36), (60, 30), **facts)
    driven.settle()
    after = rendered(driven).position[30, 60]
    np.testing.assert_allclose(after, before, atol=0.1)
    assert not driven.told


def test_a_click_tells_what_is_there(driven: Driven) -> None:
    frame = rendered(driven)
    for x, y in ((48, 36), (64, 36), (3, 3)):
        driven.click(x, y)
        driven.settle()
    solids = [frame.solid[36, 48], frame.solid[36, 64], frame.solid[3, 3]]
    assert solids == [0, 1, -1]
    depth, error = frame.depth[36, 48], frame.error[36, 48]
    position = ", ".join(f"{each:.6g}" for each in frame.position[36, 48])
    assert driven.told == [
        f"pixel 48, 36: solid[0] ball, surface 0, depth {depth:.9g} ± {error:.2g}, "
        f"position {position}",
        driven.told[1],
        "pixel 3, 3: nothing",
    ]
    assert driven.told[1].startswith("pixel 64, 36: solid[1], surface ")
    assert driven.session.lines[0] == "pixel 3, 3: nothing"


def test_a_click_before_anything_is_drawn_is_answered(driven: Driven) -> None:
    driven.click(48, 36)
    driven.settle()
    # The size was not known then: there is nothing at the only pixel.
    assert len(driven.told) == 1


def test_a_click_on_a_screen_of_small_pixels(driven: Driven) -> None:
    """Events are in pixels of a common screen."""
    for _ in range(4):
        driven.session.draw(SIZE, 2.0)
    driven.click(24, 18)
    for _ in range(4):
        driven.session.draw(SIZE, 2.0)
    assert driven.told[0].startswith("pixel 48, 36: solid[0]")


def test_every_output_is_a_picture(driven: Driven) -> None:
    for name in OUTPUTS:
        assert driven.session.state.output == name
        picture = driven.settle()
        frame = rendered(driven)
        np.testing.assert_array_equal(picture, picture_of(frame, name))
        shown = (picture[frame.solid >= 0] != picture[0, 0]).any(axis=-1)
        # What is in no cell has neither cell, place nor material.
        assert shown.mean() > 0.5 or name in ("place", "cell", "material"), name
        driven.press("o")
    assert driven.session.state.output == "image"
    driven.press("O")
    assert driven.session.state.output == list(OUTPUTS)[-1]


def test_colours_look_as_the_image_does(driven: Driven) -> None:
    frame = rendered(driven)
    np.testing.assert_array_equal(picture_of(frame, "color"), frame.image)


def test_solids_have_colours_of_their_own(driven: Driven) -> None:
    frame = rendered(driven)
    picture = picture_of(frame, "solid")
    colors = [np.unique(picture[frame.solid == solid], axis=0).tolist() for solid in (-1, 0, 1)]
    assert all(len(each) == 1 for each in colors)
    assert colors[0] == [list(NOTHING)]
    assert len({tuple(each[0]) for each in colors}) == 3


def test_errors_have_the_colours_of_a_scale() -> None:
    """From a ten-thousandth of the largest to that, and other ones of what is not certain."""
    error = np.array([[0.0, np.inf, 2.0, 2e-2, 2e-4, 2e-7]])
    solid = np.array([[-1, 0, 0, 1, 1, 1]], np.int32)
    info = halfstep.render("one_box", size=(2, 2), backend="numpy").info
    [colors] = picture_of(halfstep.Frame({"error": error, "solid": solid}, info), "error").tolist()
    assert colors[0] == list(NOTHING)
    assert colors[1] == list(UNCERTAIN)
    assert colors[2:] == inferno(np.array([1.0, 0.5, 0.0, 0.0])).tolist()


def test_keys_change_what_they_say(driven: Driven) -> None:
    driven.settle()
    n = max(rendered(driven).info["steps"])
    for keys, expected in (
        ("+", State(steps=n + 1)),
        ("+", State(steps=n + 2)),
        ("-", State(steps=n + 1)),
        ("[", State(tolerance_pixels=0.25)),
        ("]", State(tolerance_pixels=0.5)),
        ("0", State()),
        ("f", State(number_format="fixed32")),
        ("f", State(number_format="float32")),
        ("m", State(number_format="float32", method="article")),
        ("0", State()),
        ("s", State(samples=2)),
        ("0", State()),
        ("l", State(shadows=True)),
        ("0", State()),
    ):
        driven.press(keys)
        assert driven.session.state == expected
        overrides = {
            name: getattr(expected, name)
            for name in ("steps", "tolerance_pixels", "number_format", "method", "samples")
        }
        frame = rendered(driven, **overrides, shadows=expected.shadows)
        np.testing.assert_array_equal(driven.settle(), frame.image)
        assert f"{frame.info['number_format']}, {frame.info['method']}" in driven.session.lines[-1]
    driven.send("key_down", key="s", modifiers=("Control",))
    driven.send("key_down", key="F5")
    assert driven.session.state == State()
    driven.press("h")
    assert len(driven.session.lines) > len(KEYS)
    driven.press("q")
    assert driven.session.is_closed


def test_the_file_is_read_anew(driven: Driven, path: Path) -> None:
    old = driven.settle()
    compiles: list[bool] = []

    def edit(text: str) -> np.ndarray:
        path.write_text(text)
        # It is read once it is the same twice.
        for _ in range(3):
            driven.session._look_at = 0.0
            driven.session.tick()
        driven.session.draw(SIZE)
        compiles.append("compiling shaders" in driven.session.lines)
        return driven.settle()

    path.write_text(SCENE.replace("radius = 1", "radius = 0.5"))
    assert [driven.source.poll() for _ in range(3)] == [False, True, False]
    path.write_text(SCENE)
    edit(SCENE)
    new = edit(SCENE.replace("radius = 1", "radius = 0.5"))
    assert (new != old).any()
    np.testing.assert_array_equal(new, rendered(driven).image)
    assert compiles == [True, True]
    same = edit(SCENE.replace("radius = 1", "radius = -1"))
    np.testing.assert_array_equal(same, new)
    assert driven.session.lines[0] == "scene.toml: solid[0].radius: -1 is not > 0"
    # Valid as a file, but nothing bounds it.
    cone = '[[solid]]\nkind = "cone"\nslope = 1\ncolor = [1, 1, 1]'
    np.testing.assert_array_equal(edit(SCENE[: SCENE.index("[[solid]]")] + cone), new)
    assert "volume: missing" in driven.session.lines[0]
    np.testing.assert_array_equal(edit(SCENE), old)
    assert len(driven.session.lines) == 1
    path.unlink()
    np.testing.assert_array_equal(edit_gone(driven), old)
    assert driven.session.lines[0].endswith("scene.toml: no such file")


def edit_gone(driven: Driven) -> np.ndarray:
    for _ in range(3):
        driven.session._look_at = 0.0
        driven.session.tick()
    return driven.settle()


def test_what_a_scene_cannot_have_is_said_and_left() -> None:
    driven = Driven("one_torus")
    before = driven.settle()
    driven.press("m")
    np.testing.assert_array_equal(driven.settle(), before)
    assert driven.session.state == State()
    assert driven.session.lines[0].startswith("method: ")
    driven.press("s")
    assert len(driven.session.lines) == 1
    driven.session.close()


@pytest.mark.usefixtures("adapter")
def test_a_camera_that_moves_compiles_nothing(composed: list[Needs]) -> None:
    driven = Driven("one_box", backend="gpu")
    driven.settle()
    compiled = len(composed)
    assert compiled
    camera = driven.session.camera
    for turn in range(12):
        driven.drag((48, 36), (48 + 30, 36 + 5 * (turn % 3)))
        driven.settle()
        driven.send("wheel", x=40 + turn, y=30, dx=0, dy=-150 + 25 * turn)
        driven.settle()
    assert len(composed) == compiled
    assert driven.session.camera != camera
    driven.session.close()


@pytest.mark.parametrize("name", ["part.csg", "demorgan.xml"])
def test_files_of_other_programs_are_shown(name: str) -> None:
    driven = Driven(Path(__file__).parent / "models" / name)
    frame = rendered(driven)
    np.testing.assert_array_equal(driven.settle(), frame.image)
    row, column = np.argwhere(frame.cell >= 0)[100].tolist()
    driven.click(column, row)
    driven.settle()
    assert f": {' / '.join(frame.cell_path(row, column))}, surface" in driven.told[0]
    driven.press("c")
    assert (driven.settle() != frame.image).any()
    driven.session.close()


@pytest.mark.parametrize(
    "event",
    [
        {"event_type": "pointer_down", "x": 1.0, "y": 1.0, "button": 1},
        {"event_type": "pointer_down", "x": 1.0, "y": 1.0, "button": None, "modifiers": ()},
        {"event_type": "pointer_down", "x": 1.0, "y": 1.0, "button": 1, "modifiers": "Shift"},
        {"event_type": "pointer_move"},
        {"event_type": "pointer_move", "x": "1", "y": 1.0},
        {"event_type": "pointer_up", "x": math.nan, "y": 1.0},
        {"event_type": "wheel", "x": 1.0, "y": 1.0, "dy": 10**400},
        {"event_type": "wheel", "x": 1.0, "y": 1.0, "dy": -math.inf},
        {"event_type": "key_down", "key": None, "modifiers": ()},
        {"event_type": "key_down", "key": "q", "modifiers": [1]},
        {"event_type": "before_draw"},
    ],
    ids=str,
)
def test_what_is_no_event_does_nothing(driven: Driven, event: dict[str, Any]) -> None:
    camera = driven.session.camera
    driven.send("pointer_down", x=48, y=36, button=2)
    driven.session.handle(event)
    assert (driven.session.camera, driven.session.state) == (camera, State())
    assert not driven.session.is_closed
    # With all its facts an event of that place and that button would have moved it.
    driven.send("pointer_move", x=60, y=36)
    assert driven.session.camera != camera


def test_a_canvas_without_measure_gets_a_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("halfstep.viewer.session.LONGEST", 32)
    driven = Driven("one_box")
    for _ in range(4):
        assert driven.session.draw((10**6, 24), 1e9).shape == (24, 32, 4)
    driven.session.close()


def test_pictures_get_coarser_where_they_are_slow() -> None:
    assert [coarser(1, SLOW_MS), coarser(1, SLOW_MS + 1), coarser(2, SLOW_MS + 1)] == [1, 2, 4]
    assert coarser(COARSEST, 10 * SLOW_MS) == COARSEST
    assert [coarser(4, SLOW_MS / 5), coarser(2, SLOW_MS / 5), coarser(1, 0.0)] == [2, 1, 1]
    assert coarser(2, SLOW_MS / 2) == 2


def test_a_coarse_picture_says_so_and_fills_the_canvas(driven: Driven) -> None:
    driven.settle()
    driven.session._factor = 2
    driven.session._rest_after = 1e9
    driven.drag((48, 36), (68, 36))
    picture = driven.settle()
    assert "48x36 in place of 96x72 while it moves" in driven.session.lines[-1]
    np.testing.assert_array_equal(picture[::2, ::2], picture[1::2, 1::2])
    driven.session._rest_after = driven.session._rest_at = 0.0
    np.testing.assert_array_equal(driven.settle(), rendered(driven).image)


def test_lines_are_written_into_the_picture(driven: Driven) -> None:
    size = (NARROWEST, 150)
    for _ in range(4):
        picture = driven.session.draw(size)[..., :3]
    frame = halfstep.render(driven.source.scene, size=size, backend="numpy")
    same = (picture == frame.image).all(axis=(1, 2))
    height = int(np.argmin(same))
    assert same[:height].all()
    assert 50 < height < 140
    assert (picture[height:] > 200).any()


# ---------------------------------------------------------------------------- clips


def clipped(scene: Scene, clip: Clip) -> Clipped:
    return clipped_in(scene, clip, np.array(Solids.of(scene).volume))


PINS = """
format = 1
[camera]
center = [3, -6, 4]
look_at = [0, 0, 0.5]
[[group]]
name = "pin"
[[group.surface]]
id = 1
kind = "cylinder"
radius = 0.4
[[group.part]]
name = "slab"
kind = "box"
size = [2, 2, 2]
[[group.cell]]
region = "-1 slab"
color = [0.8, 0.3, 0.2]
[[lattice]]
kind = "rectangular"
pitch = [1, 1]
groups = { P = "pin" }
rows = ["PP", "PP"]
[[place]]
group = "pin"
origin = [-2, 0, 0]
[[surface]]
id = 7
kind = "sphere"
radius = 0.7
origin = [0, -2, 0]
[[surface]]
id = 8
kind = "sphere"
radius = 3
[[cell]]
region = "-7"
color = [0.3, 0.8, 0.2]
[[cell]]
region = "-8 7"
visible = false
[[solid]]
kind = "box"
color = [0.2, 0.6, 0.8]
size = [1, 1, 1]
origin = [2, 1, 0]
"""


@pytest.mark.parametrize(
    ("name", "clip"),
    [
        ("gallery", Clip(0, -1.5)),
        ("gallery", Clip(1, -0.2, above=True)),
        ("gallery", Clip(2, 0.3)),
        ("linked_rings", Clip(0, 0.6)),
        ("bracket", Clip(0, 0.6)),
        ("pins", Clip(0, 0.6)),
        ("pins", Clip(1, -0.2, above=True)),
        ("pins", Clip(2, 0.3)),
    ],
    ids=str,
)
def test_a_clip_leaves_one_side(name: str, clip: Clip) -> None:
    """What is seen lies on that side, no nearer than before, and is the same where it was there."""
    scene = Scene.from_dict(tomllib.loads(PINS)) if name == "pins" else halfstep.load(name)
    options: dict[str, Any] = {"size": (48, 36), "backend": "numpy", "steps": 20}
    options["outputs"] = ("depth", "position", "error", "cell", "place")
    whole = halfstep.render(scene, **options)
    cut = clipped(scene, clip)
    left = cut.numbered(halfstep.render(cut.scene, **options), scene)
    sign = -1.0 if clip.above else 1.0
    limit = 1e-4 * np.ptp(whole.position[whole.solid >= 0])

    def beyond(frame: halfstep.Frame) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            return sign * (frame.position[..., clip.axis] - clip.at)

    hit, certain = left.solid >= 0, np.isfinite(whole.error) & np.isfinite(left.error)
    was = whole.solid >= 0
    assert (beyond(left)[hit] <= limit).all()
    assert was[hit & certain].all()
    both = hit & was & certain
    assert (left.depth[both] >= whole.depth[both] - limit).all()
    there = was & certain & (beyond(whole) < -limit)
    gone = was & certain & (beyond(whole) > limit)
    assert there.sum() > 50
    assert gone.sum() > 20
    np.testing.assert_allclose(left.depth[there], whole.depth[there], atol=limit)
    for output in ("solid", "cell", "place"):
        np.testing.assert_array_equal(getattr(left, output)[there], getattr(whole, output)[there])
    # Of what was cut through, the cut is seen.
    assert (gone & hit).any()


def test_a_clip_of_a_ball_shows_its_disc() -> None:
    """Closed form: along x from outside, the disc of radius sqrt(1 - 0.3²) at x = 0.3."""
    ball = {"kind": "sphere", "radius": 1, "color": [1, 1, 1]}
    camera = {"center": [5, 0, 0], "look_at": [0, 0, 0], "orthographic_height": 3}
    scene = Scene.from_dict({"format": 1, "camera": camera, "solid": [ball]})
    cut = clipped(scene, Clip(0, 0.3))
    frame = halfstep.render(cut.scene, size=(90, 90), steps=22, backend="numpy")
    y, z = frame.position[..., 1], frame.position[..., 2]
    flat = np.abs(frame.position[..., 0] - 0.3) < 1e-4
    radius = np.hypot(y, z)
    j, i = np.mgrid[:90, :90]
    from_axis = np.hypot((i - 44.5) / 30, (j - 44.5) / 30)
    edge = math.sqrt(1 - 0.3**2)
    np.testing.assert_array_equal(flat, from_axis < edge)
    np.testing.assert_allclose(radius[flat], from_axis[flat], atol=1e-6)
    np.testing.assert_array_equal(frame.solid >= 0, from_axis < 1)


def test_solids_keep_their_numbers_where_others_are_cut_away() -> None:
    boxes = [
        {"kind": "box", "size": [1, 1, 1], "origin": [x, 0, 0], "color": [1, 1, 1]} for x in (-2, 2)
    ]
    camera = {"center": [0, -9, 0], "look_at": [0, 0, 0]}
    scene = Scene.from_dict({"format": 1, "camera": camera, "solid": boxes})
    cut = clipped(scene, Clip(0, 0.0, above=True))
    assert cut.solids == (1,)
    # What ends where the volume does ends there still.
    whole, left = Solids.of(scene).volume, Solids.of(cut.scene).volume
    np.testing.assert_array_equal(whole, left)
    frame = halfstep.render(cut.scene, size=SIZE, backend="numpy")
    assert set(np.unique(frame.solid)) == {-1, 0}
    assert set(np.unique(cut.numbered(frame, scene).solid)) == {-1, 1}
    with pytest.raises(SceneError) as caught:
        clipped(scene, Clip(0, 5.0, above=True))
    assert str(caught.value) == "clip: nothing has x > 5"


def test_keys_move_the_clip(driven: Driven) -> None:
    whole = driven.settle()
    driven.press("c")
    clip = driven.session.state.clip
    assert clip is not None
    # The middle of -1 … 2.5, a margin beside.
    assert (clip.axis, clip.above) == (0, False)
    assert clip.at == pytest.approx(0.75)
    half = driven.settle()
    assert (half != whole).any()
    driven.press("ArrowUp")
    moved = driven.session.state.clip
    assert moved is not None
    assert moved.at == pytest.approx(0.75 + 3.5 / 64, rel=1e-3)
    driven.press("x")
    other = driven.settle()
    assert (other != half).any()
    for _ in range(9):
        driven.press("PageDown")
    assert driven.session.state.clip is not None
    assert driven.session.state.clip.at > -1
    assert str(driven.session.state.clip) in driven.session.lines[-1]
    driven.press("c", "c", "c")
    np.testing.assert_array_equal(driven.settle(), whole)
