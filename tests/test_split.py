"""Frames whose solids do not fit a binding: the same bits as in one piece."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Planes
from halfstep.contract.classes import Class
from halfstep.contract.layout import SOLID, TILE
from halfstep.device.adapters import Adapter
from halfstep.errors import DeviceError
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.run import gpu as run_gpu
from halfstep.run import split
from halfstep.run.gpu import Device
from halfstep.scene import load

SIZE = (160, 120)
OUTPUTS = ("surface", "t", "depth_exit", "normal", "error", "steps")


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize(
    ("outputs", "number_format"),
    [(("image",), "float32"), (OUTPUTS, "float32"), (("t",), "fixed32")],
)
def test_a_frame_in_parts_is_that_of_one_piece(
    outputs: tuple[str, ...], number_format: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    halves, parts = split.halves, []

    def counted(packed: Packed) -> tuple[Packed, Packed]:
        parts.append(len(packed.order))
        return halves(packed)

    monkeypatch.setattr(split, "halves", counted)
    with halfstep.Renderer(
        load("gallery"), size=SIZE, outputs=outputs, number_format=number_format, backend="gpu"
    ) as renderer:
        whole = renderer.render()
        assert not parts
        device = renderer._backend
        assert isinstance(device, Device)
        device.largest_binding = 6 * SOLID.dtype().itemsize
        joined = renderer.render()
    assert len(parts) > 3
    assert (whole.solid >= 0).sum() > 5000
    for name in whole.outputs:
        expected, got = getattr(whole, name), getattr(joined, name)
        assert np.array_equal(got, expected, equal_nan=expected.dtype.kind == "f"), name


def test_the_nearer_of_two_parts_is_seen_and_the_earlier_of_the_equally_near() -> None:
    far = np.uint64(0xFFFFFFFFFFFFFFFF)

    def planes(keys: list[np.uint64], surfaces: list[int], low: list[int]) -> Planes:
        surface = np.array([surfaces], np.uint32)
        return {
            "key": np.array([keys], np.uint64),
            "surface": surface,
            "normal": np.stack([surface] * 3, axis=-1).astype(np.float32),
            "low": np.array([low], np.uint64),
        }

    first = planes([np.uint64(5), np.uint64(7), far, np.uint64(4), far], [1, 2, 0, 9, 0], [5] * 5)
    second = planes(
        [np.uint64(6), np.uint64(3), np.uint64(8), np.uint64(4), far],
        [3, 4, 5, 6, 0],
        [3, 9, 9, 9, 9],
    )
    joined = split.nearest(first, second)
    assert joined["surface"].tolist() == [[1, 4, 5, 6, 0]]
    assert joined["normal"][0, :, 1].tolist() == [1, 4, 5, 6, 0]
    assert joined["key"][0, :4].tolist() == [5, 3, 8, 4]
    assert joined["low"].tolist() == [[3, 5, 5, 5, 5]]


def test_tiles_set_apart_have_their_members_and_are_put_back() -> None:
    # Three columns and four rows of tiles, of two classes; the picture is 40 by 60 pixels.
    counts = np.array(
        [[1, 0, 2, 0, 3, 1], [0, 0, 4, 2, 1, 1], [2, 2, 0, 0, 0, 5], [1, 1, 1, 1, 0, 3]]
    )
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
    members = np.arange(starts[-1], dtype=np.uint32)
    lists = Lists((Class.QUADRIC, Class.POLYHEDRON), starts, members, None)
    tiles = np.zeros((4, 3), bool)
    tiles[1, 1] = tiles[2, 0] = tiles[2, 2] = True

    def listed(of: Lists) -> list[list[int]]:
        edges = of.starts.tolist()
        return [of.members[a:b].tolist() for a, b in pairwise(edges)]

    apart = split.Apart.of(lists, tiles.ravel(), 3)
    assert apart is not None
    assert (apart.first, apart.tiles.tolist()) == (TILE, tiles[1:3].tolist())
    every = listed(lists)
    is_apart = tiles.ravel().repeat(2)
    assert listed(apart.rest) == [
        [] if set_apart else each for each, set_apart in zip(every, is_apart, strict=True)
    ]
    assert (
        listed(apart.lists)
        == [each if set_apart else [] for each, set_apart in zip(every, is_apart, strict=True)][
            6:18
        ]
    )
    # They have nothing beside them.
    assert split.Apart.of(apart.lists, tiles[1:3].ravel(), 3) is None

    planes = {"depth": np.zeros((60, 40)), "normal": np.zeros((60, 40, 3))}
    apart.put(planes, {"depth": np.ones((32, 40)), "normal": np.ones((32, 40, 3))})
    j, i = np.mgrid[:60, :40] // TILE
    for plane in planes.values():
        expected = tiles[j, i] if plane.ndim == 2 else tiles[j, i][..., None].repeat(3, axis=2)
        assert np.array_equal(plane, expected)


def test_memory_that_cannot_be_had_is_told(adapter: Adapter) -> None:
    device = run_gpu.Device(adapter)
    try:
        with pytest.raises(DeviceError) as caught:
            device._buffers.written("picture", 2**45, mapped=False)
        assert str(caught.value).startswith(
            f"adapter {adapter.summary}: 35,184,372,088,832 bytes for the picture: "
        )
        # The next frame may ask for less.
        assert device._buffers.written("picture", 100, mapped=False).size == 112
        with pytest.raises(DeviceError):
            device._buffers.written("picture", 2**45, mapped=False)
        assert device._buffers.written("picture", 100, mapped=False).size == 112
    finally:
        device.close()
