"""The lists of tiles: what touches a tile is listed, and nothing that can be seen is left out."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.contract.classes import Class
from halfstep.contract.layout import TILE, TILE_WORDS
from halfstep.errors import DeviceError
from halfstep.host import excerpts, tiles
from halfstep.host import pack as packing
from halfstep.host.pack import Packed
from halfstep.host.prepare import prepare
from halfstep.host.tiles import frequent_sets, tile_groups, tile_lists
from halfstep.run import gpu as run_gpu
from halfstep.run import needs, parts
from halfstep.run.framebuffer import FrameBuffer
from halfstep.scene import load, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from tests.bundled import drawn_by_all
from tests.scenes_random import PLACES, random_scene

SIZE = (160, 120)
OUTPUTS = ("solid", "surface", "t", "normal")


@pytest.mark.parametrize("count", [0, 1, 50])
def test_lists_hold_what_touches_a_tile(count: int, rng: np.random.Generator) -> None:
    present = (Class.ELLIPSOID, Class.POLYHEDRON, Class.PATCH)
    listed = 0
    for _ in range(40):
        width, height = rng.integers(1, 300, 2).tolist()
        first_row = int(rng.integers(0, height))
        rows = int(rng.integers(1, height - first_row + 1))
        i = np.sort(rng.integers(0, width, (count, 2)), axis=1)
        j = np.sort(rng.integers(0, height, (count, 2)), axis=1)
        classes = np.sort(rng.choice(present, count)).astype(np.int64)
        order = rng.permutation(count)
        constants = SimpleNamespace(
            view=SimpleNamespace(width=width),
            rectangle=np.concatenate([i, j], axis=1),
            count=count,
            is_loose=np.zeros(count, bool),
            covered=None,
        )
        packed: Any = SimpleNamespace(setup=constants, order=order, classes=classes)
        starts, members = tile_lists(packed, present, first_row, rows)

        expected = []
        for top in range(0, rows, TILE):
            for left in range(0, width, TILE):
                for klass in present:
                    expected.append(
                        [
                            row
                            for row, ix in enumerate(order)
                            if classes[row] == klass
                            and i[ix, 0] < left + TILE
                            and i[ix, 1] >= left
                            and j[ix, 0] < min(first_row + top + TILE, first_row + rows)
                            and j[ix, 1] >= first_row + top
                        ]
                    )
        assert starts.dtype == members.dtype == np.uint32
        found = [members[a:b].tolist() for a, b in pairwise(starts.tolist())]
        assert found == expected
        listed += len(members)
    assert listed > 0 or count == 0


def test_every_tile_is_in_the_least_group_that_knows_it(rng: np.random.Generator) -> None:
    classes = Class.ELLIPSOID, Class.QUADRIC, Class.PATCH
    tiles_x, count = 7, 63
    lengths = rng.integers(1, 4, (count, 3)) * rng.integers(0, 2, (count, 3))
    starts = np.append(0, np.cumsum(lengths)).astype(np.uint32)
    lists = np.reshape([*pairwise(starts.tolist())], (count, 3, 2)).tolist()
    expected = [
        {klass: tuple(pair) for klass, pair in zip(classes, row, strict=True) if pair[0] < pair[1]}
        for row in lists
    ]
    for sets in ([classes], [(), (Class.PATCH,), (Class.ELLIPSOID, Class.PATCH), classes]):
        found: dict[int, dict[Class, tuple[int, int]]] = {}
        for group in tile_groups(starts, classes, tiles_x, sets):
            assert group.records.shape[1] == TILE_WORDS
            for place, *words in group.records.tolist():
                tile = (place >> 16) * tiles_x + (place & 0xFFFF)
                assert tile not in found
                pairs = zip(group.classes, pairwise(words[: len(group.classes) + 1]), strict=True)
                found[tile] = {klass: pair for klass, pair in pairs if pair[0] < pair[1]}
                knowing = [known for known in sets if found[tile].keys() <= set(known)]
                assert group.classes == min(knowing, key=len)
        assert [found[tile] for tile in range(count)] == expected


def test_sets_of_classes_that_many_tiles_see_are_frequent() -> None:
    classes = Class.ELLIPSOID, Class.QUADRIC, Class.PATCH
    seen = (
        [(0, 0, 1)] * 60 + [(0, 0, 0)] * 20 + [(1, 1, 1)] * 10 + [(1, 0, 1)] * 8 + [(0, 1, 0)] * 2
    )
    starts = np.append(0, np.cumsum(seen)).astype(np.uint32)
    patch, both = (Class.PATCH,), (Class.ELLIPSOID, Class.PATCH)
    assert frequent_sets(starts, classes, classes) == [patch, (), both]
    # What other shaders draw is not looked at, but counts among the tiles.
    others = np.array([row == (0, 0, 0) for row in seen])
    assert frequent_sets(starts, classes, classes, others) == [patch, both]


def everything(
    packed: Packed, classes: tuple[Class, ...], _first_row: int, rows: int
) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Lists of all solids for every tile."""
    count = -(-packed.setup.view.width // TILE) * -(-rows // TILE)
    of_class = np.searchsorted(packed.classes, [*classes, classes[-1] + 1])
    starts = np.arange(count)[:, None] * of_class[-1] + of_class[:-1]
    members = np.tile(np.arange(of_class[-1], dtype=np.uint32), count)
    return np.append(starts.ravel(), len(members)).astype(np.uint32), members


@pytest.mark.usefixtures("adapter")
def test_frames_without_lists_are_the_same(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all solids tested that have a loose rectangle, and with every solid in every tile."""
    monkeypatch.setattr(tiles, "LEAST_PIXELS", 1)
    monkeypatch.setattr(tiles, "LEAST_PIXELS_IN_ALL", 1)
    # Bands of one row of tiles, and one shader for all scenes.
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1)
    monkeypatch.setattr(packing, "_present", lambda *_: tuple(Class)[: Class.REGION])
    scenes = [load(name) for name in drawn_by_all()]
    scenes = [scene for scene in scenes if not scene.cells and not scene.groups]
    scenes += [random_scene(rng, PLACES[k % len(PLACES)], most=8).scene for k in range(40)]
    struck = hits = 0
    with halfstep.Renderer(
        scenes[0], size=SIZE, steps=12, outputs=OUTPUTS, backend="gpu"
    ) as renderer:
        for number, scene in enumerate(scenes):
            selected = renderer.render(scene)
            with monkeypatch.context() as context:
                context.setattr(excerpts, "tile_lists", everything)
                whole = renderer.render(scene)
            for name in OUTPUTS:
                got, expected = getattr(selected, name), getattr(whole, name)
                assert np.array_equal(got, expected, equal_nan=True), f"scene {number}: {name}"
            packed = prepare(with_overrides(scene, size=SIZE))
            listed = len(tile_lists(packed, packed.present, 0, SIZE[1])[1])
            struck += len(everything(packed, packed.present, 0, SIZE[1])[1]) - listed
            hits += int((selected.solid >= 0).sum())
    assert struck > 1000
    assert hits > 100_000


@pytest.mark.usefixtures("adapter")
def test_what_a_tile_leaves_out_casts_no_doubt(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the device and in NumPy alike: only what is tried can be uncertain."""
    options: dict[str, Any] = {"size": (160, 120), "outputs": ["error"]}
    device, twin = (
        halfstep.render(load("crowd"), backend=backend, **options).error
        for backend in ("gpu", "numpy")
    )
    assert np.array_equal(device, twin)
    monkeypatch.setattr(excerpts, "tile_lists", everything)
    whole = halfstep.render(load("crowd"), backend="gpu", **options).error
    assert (device <= whole).all()
    assert (device < whole).any()


@pytest.mark.usefixtures("adapter")
def test_tiles_that_see_no_highlight_have_shaders_without(
    composed: list[Needs], monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = with_overrides(load("figure"), size=SIZE)
    expected = halfstep.render(figure, backend="numpy", outputs=("color",)).color
    with halfstep.Renderer(figure, outputs=("color",), backend="gpu") as renderer:
        for _ in range(3):
            np.testing.assert_array_equal(renderer.render().color, expected)
        assert composed[0].shininess_bits > 0
        assert {each.shininess_bits > 0 for each in composed} == {False, True}
        # If all tiles went to the shaders without, nothing would shine.
        monkeypatch.setattr(
            parts,
            "_shines",
            lambda _, lists: tiles.blank_tiles(lists.starts, lists.classes) & False,
        )
        assert (renderer.render().color < expected).any()


@pytest.mark.usefixtures("adapter")
def test_what_stays_blank_is_not_rendered_again(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames of a renderer are those of new ones, whatever it showed before or failed to."""
    tiles_rendered: list[int] = []
    groups = tiles.tile_groups

    def counted(*arguments: Any) -> Any:
        found = groups(*arguments)
        tiles_rendered.append(sum(len(group.records) for group in found))
        return found

    def failing(*_: Any) -> Any:
        raise DeviceError("the device is lost")

    figure = with_overrides(load("figure"), size=SIZE)
    aside = {"look_at": (3.0, 0.0, 2.0)}
    green = figure.image.model_copy(update={"background": (0.1, 0.4, 0.2)})
    scenes = [
        figure,
        with_overrides(figure, camera=aside),
        with_overrides(figure, camera={"center": (0.0, 40.0, 6.0)}),
        figure.model_copy(update={"image": green}),
        with_overrides(figure, size=(640, 32)),
        with_overrides(figure, camera=aside, method="article"),
    ]
    outputs = ("image", "normal", "depth")
    expected = [halfstep.render(scene, outputs=outputs, backend="gpu") for scene in scenes]
    whole = -(-SIZE[0] // TILE) * -(-SIZE[1] // TILE)
    monkeypatch.setattr(parts, "tile_groups", counted)
    with halfstep.Renderer(figure, outputs=outputs, backend="gpu") as renderer:
        turns = [0, 0, 0, 1, 2, 3, 0, 4, *rng.integers(0, len(scenes), 80).tolist()]
        for turn, which in enumerate(turns):
            if turn % 7 == 6:
                with monkeypatch.context() as context:
                    context.setattr(FrameBuffer, "copies", failing)
                    with pytest.raises(DeviceError):
                        renderer.render(scenes[1 + turn % 2])
            frame = renderer.render(scenes[which])
            for name in outputs:
                found, wanted = getattr(frame, name), getattr(expected[which], name)
                assert np.array_equal(found, wanted, equal_nan=True), f"{turn}, {which}: {name}"
    # From the second frame on, tiles that see a highlight, then those that see none.
    assert tiles_rendered[0] == sum(tiles_rendered[1:3]) == whole
    assert 0 < sum(tiles_rendered[3:5]) < whole - 20
    assert sum(count < whole for count in tiles_rendered) > 20


@pytest.mark.usefixtures("adapter")
def test_records_in_uniform_memory_or_not_give_the_same_bits(
    rng: np.random.Generator, composed: list[Needs], monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = [load("gallery"), random_scene(rng, PLACES[0], most=8).scene, load("figure")]
    for scene in scenes:
        small = with_overrides(scene, size=SIZE)
        few = halfstep.render(small, outputs=OUTPUTS, backend="gpu")
        assert "var<uniform> solids" in compose(composed[-1])
        with monkeypatch.context() as context:
            context.setattr(needs, "UNIFORM_BYTES", 0)
            many = halfstep.render(small, outputs=OUTPUTS, backend="gpu")
        assert "var solids: texture_2d<u32>" in compose(composed[-1])
        for name in OUTPUTS:
            assert np.array_equal(getattr(few, name), getattr(many, name), equal_nan=True), name


def test_a_loose_rectangle_is_not_what_its_solid_costs() -> None:
    """The crowd's saddles are bounded by F and by cuts together: each could be anywhere."""
    packed = prepare(load("crowd"))
    tested = len(tile_lists(packed, packed.present, 0, 480)[1])
    loose = np.where(packed.setup.is_loose, 0, 1)
    i0, i1, j0, j1 = packed.setup.rectangle.T // TILE
    cells = (i1 - i0 + 1) * (j1 - j0 + 1)
    assert cells.sum() > 25_000
    assert tested < 1.5 * (cells * loose).sum()
