"""Two frames are equal, differ where either answer may be right, or do not match."""

from __future__ import annotations

import io
import json
from typing import Any, cast

import imageio.v3 as imageio
import numpy as np
import pytest

import halfstep
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame, Info
from halfstep.frames.outputs import OUTPUTS
from halfstep.testing import FrameCensus, FrameMismatchError, assert_frames_match
from halfstep.testing.frames import Replay, compare_frames, picture_file

SIZE = (64, 48)
# A device that promises nothing beyond WGSL.
CARD = {"adapter": "A card", "driver": "A driver 1.0"}


@pytest.fixture(scope="module")
def expected() -> Frame:
    return halfstep.render(halfstep.load("figure"), size=SIZE, steps=12, backend="numpy")


def changed(frame: Frame, info: dict[str, Any] | None = None, /, **arrays: Any) -> Frame:
    """A frame with other arrays; ``info`` says where it is from."""
    own = {name: getattr(frame, name).copy() for name in frame.outputs}
    return Frame(own | arrays, cast(Info, frame.info | (info or {})))


def place(frame: Frame, *, sure: bool = True) -> tuple[int, int]:
    """A pixel that shows something, surely."""
    right = (frame.solid >= 0) & (np.isfinite(frame.error) == sure)
    row, column = np.argwhere(right)[0]
    return int(row), int(column)


def altered(frame: Frame, name: str, pixel: tuple[int, int], value: Any) -> Any:
    array = getattr(frame, name).copy()
    array[pixel] = value
    return array


def caught(found: Frame, expected: Frame, **options: Any) -> FrameCensus:
    with pytest.raises(FrameMismatchError) as excinfo:
        assert_frames_match(found, expected, **options)
    assert str(excinfo.value) == str(excinfo.value.census)
    return excinfo.value.census


def counts(census: FrameCensus) -> tuple[int, int]:
    """Pixels that are ambiguous, and that are failures."""
    return int(census.ambiguous.sum()), int(census.failed.sum())


def test_equal_frames_match(expected: Frame) -> None:
    for info in ({}, CARD):
        census = assert_frames_match(changed(expected, info), expected)
        assert census.equal
        assert census.exact == (not info)
        assert census.arrays == {}


@pytest.mark.parametrize("name", OUTPUTS)
def test_a_bit_of_any_array_is_seen(expected: Frame, name: str) -> None:
    pixel = place(expected)
    array = np.ascontiguousarray(getattr(expected, name)).copy()
    if array.dtype.kind == "f" and np.isnan(array[pixel]).all():
        array[pixel] = 0.0  # any bits of it are no number
    array.view(np.uint8).reshape(*array.shape[:2], -1)[(*pixel, 0)] ^= 1
    census = caught(changed(expected, **{name: array}), expected)
    assert (census.failed.sum(), census.arrays) == (1, {name: 1})
    assert census.failed[pixel]
    [first] = census.first
    assert (first.row, first.column, list(first.found)) == (*pixel, [name])
    assert f"1 of {SIZE[0] * SIZE[1]} pixels differ (every bit counts)" in str(census)


def test_a_nan_is_as_good_as_another(expected: Frame) -> None:
    depth = np.where(np.isnan(expected.depth), -expected.depth, expected.depth)
    assert assert_frames_match(changed(expected, depth=depth), expected).equal


def test_elsewhere_a_depth_within_both_bounds_is_ambiguous(expected: Frame) -> None:
    pixel = place(expected)
    room = 2 * expected.error[pixel]
    near = altered(expected, "depth", pixel, expected.depth[pixel] + 0.99 * room)
    far = altered(expected, "depth", pixel, expected.depth[pixel] + 1.01 * room)
    census = assert_frames_match(changed(expected, CARD, depth=near), expected)
    assert counts(census) == (1, 0)
    assert not census.equal
    census = caught(changed(expected, CARD, depth=far), expected)
    assert counts(census) == (0, 1)
    assert "1 of 3072 pixels differ (0 more are within rounding)" in str(census)
    # Where every bit counts, no bound is an excuse.
    caught(changed(expected, depth=near), expected)


def test_integers_have_no_excuse(expected: Frame) -> None:
    pixel = place(expected)
    near = altered(expected, "depth", pixel, expected.depth[pixel] * (1 + 1e-15))
    fixed = {"number_format": "fixed32"}
    assert counts(assert_frames_match(changed(expected, CARD, depth=near), expected)) == (1, 0)
    found = changed(expected, CARD | fixed, depth=near)
    assert counts(caught(found, changed(expected, fixed))) == (0, 1)


def test_elsewhere_what_nobody_is_sure_of_is_ambiguous(expected: Frame) -> None:
    pixel = place(expected)
    gone = {
        "solid": altered(expected, "solid", pixel, -1),
        "depth": altered(expected, "depth", pixel, np.nan),
        "image": altered(expected, "image", pixel, 0),
    }
    caught(changed(expected, CARD, **gone), expected)
    unsure = altered(expected, "error", pixel, np.inf)
    census = assert_frames_match(changed(expected, CARD, error=unsure, **gone), expected)
    assert census.ambiguous.sum() == 1


def test_a_replay_excuses_no_device_that_is_sure_of_nothing(expected: Frame) -> None:
    sure, unsure = place(expected), place(expected, sure=False)
    depth = expected.depth.copy()
    depth[sure] *= 2
    depth[unsure] *= 2
    never = np.full_like(depth, np.inf)
    found = changed(expected, CARD, depth=depth, error=never)
    assert counts(compare_frames(found, expected)) == (2, 0)
    replay = Replay(expected.depth, expected.error)
    census = compare_frames(found, expected, replay=replay)
    assert counts(census) == (1, 1)
    assert census.failed[sure]
    # What is surely a hit and what is surely none are no better as the other.
    for pixel in (sure, tuple(np.argwhere((expected.solid < 0) & (expected.error == 0))[0])):
        other = np.nan if np.isfinite(expected.depth[pixel]) else 1.0
        found = changed(expected, CARD, depth=altered(expected, "depth", pixel, other), error=never)
        assert counts(compare_frames(found, expected, replay=replay)) == (0, 1)


def test_elsewhere_a_level_of_shading_is_no_difference(expected: Frame) -> None:
    pixel = place(expected)
    for name, small, large in (("image", 1, 2), ("color", 0.003, 0.005), ("normal", 0.003, 0.005)):
        value = getattr(expected, name)[pixel]
        near = altered(expected, name, pixel, value - value.dtype.type(small))
        far = altered(expected, name, pixel, value - value.dtype.type(large))
        assert assert_frames_match(changed(expected, CARD, **{name: near}), expected).equal
        census = caught(changed(expected, CARD, **{name: far}), expected)
        assert (census.failed.sum(), census.arrays) == (1, {name: 1})


def test_without_bounds_nothing_is_ambiguous() -> None:
    options: dict[str, Any] = {"size": SIZE, "backend": "numpy", "outputs": ["depth"]}
    plain = halfstep.render(halfstep.load("one_sphere"), **options)
    pixel = tuple(np.argwhere(plain.solid >= 0)[0])
    other = altered(plain, "depth", pixel, plain.depth[pixel] * (1 + 1e-15))
    assert caught(changed(plain, CARD, depth=other), plain).failed.sum() == 1


def test_other_sizes_and_outputs_are_refused(expected: Frame) -> None:
    scene = halfstep.load("figure")
    small = halfstep.render(scene, size=(8, 4), backend="numpy")
    with pytest.raises(UsageError) as caught:
        assert_frames_match(small, expected)
    assert str(caught.value) == "frames of different sizes: 8x4 and 64x48"
    plain = halfstep.render(scene, size=SIZE, backend="numpy", outputs=["depth"])
    with pytest.raises(UsageError) as caught:
        assert_frames_match(plain, changed(plain, normal=expected.normal))
    assert str(caught.value) == "only one of the frames has normal"


def test_a_census_is_json(expected: Frame) -> None:
    pixel = place(expected)
    census = caught(changed(expected, depth=altered(expected, "depth", pixel, np.nan)), expected)
    report = census.as_dict()
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["first"][0]["found"] == {"depth": "nan"}
    assert (report["failed"], report["size"]) == (1, list(SIZE))


def test_the_picture_shows_where(expected: Frame) -> None:
    pixel, unsure = place(expected), place(expected, sure=False)
    depth = altered(expected, "depth", pixel, 0.0)
    depth[unsure] *= 2
    found = changed(expected, CARD, depth=depth)
    census = caught(found, expected)
    picture = imageio.imread(io.BytesIO(picture_file(found, expected, census)))
    assert picture.shape == (SIZE[1], 3 * SIZE[0], 3)
    np.testing.assert_array_equal(picture[:, : SIZE[0]], found.image)
    np.testing.assert_array_equal(picture[:, SIZE[0] : 2 * SIZE[0]], expected.image)
    where = picture[:, 2 * SIZE[0] :]
    assert where[pixel].tolist() == [255, 0, 96]
    assert where[unsure].tolist() == [255, 176, 0]
    assert (where == expected.image // 4).all(axis=-1).sum() == SIZE[0] * SIZE[1] - 2
