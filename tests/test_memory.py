"""Memory that later frames use again, but never while a frame still needs it."""

from __future__ import annotations

import numpy as np

from halfstep.host.memory import FRAMES, Memory

PAIR = np.dtype([("first", np.float32, (3,)), ("second", np.uint32)])


def test_memory_is_used_again() -> None:
    memory = Memory()
    first = memory.records("some", 100, PAIR)
    place = first.ctypes.data
    assert first.shape == (100,)
    del first
    assert memory.records("some", 90, PAIR).ctypes.data == place
    assert memory.records("some", 100, PAIR).ctypes.data == place
    assert memory.records("some", 101, PAIR).shape == (101,)


def test_memory_that_is_needed_is_not_used_again() -> None:
    memory = Memory()
    part = memory.records("some", 100, PAIR)["first"][5:, 1]
    part[:] = 7.0
    for number in range(2 * FRAMES):
        other = memory.records("some", 100, PAIR)
        other["first"] = number
        assert not np.shares_memory(part, other)
    assert (part == 7.0).all()


def test_two_frames_have_their_own_memory_by_turns() -> None:
    memory = Memory()
    places = set()
    before = memory.records("some", 100, PAIR)
    for _ in range(5):
        following = memory.records("some", 100, PAIR)
        assert not np.shares_memory(before, following)
        before = following
        places.add(following.ctypes.data)
    assert len(places) == FRAMES
    assert not np.shares_memory(memory.records("other", 100, PAIR), before)


def test_gaps_between_members_stay_zero() -> None:
    gap = np.dtype({"names": ["only"], "formats": [np.uint32], "offsets": [4], "itemsize": 16})
    memory = Memory()
    for dtype in (PAIR, gap, PAIR, gap):
        found = memory.records("some", 100, dtype)
        for name in dtype.names or ():
            found[name] = 7
        if dtype == gap:
            assert np.count_nonzero(found.view(np.uint32)) == 100
