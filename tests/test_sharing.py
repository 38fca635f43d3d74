"""Work that threads share out: all of it is done once, and faults are told."""

from __future__ import annotations

import numpy as np
import pytest

from halfstep.host.sharing import evenly, in_parts, shared_out


@pytest.fixture(autouse=True, params=[1, 2, 4])
def _cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("halfstep.host.sharing._cores", lambda: request.param)


@pytest.mark.parametrize("count", [0, 1, 7, 100])
def test_each_item_is_done_once(count: int) -> None:
    done: list[int] = []
    shared_out(done.append, range(count))
    assert sorted(done) == [*range(count)]


@pytest.mark.parametrize("count", [0, 1, 7, 8, 100])
def test_parts_are_all_places(count: int) -> None:
    found = np.zeros(count, np.int64)

    def add(part: slice) -> None:
        assert len(found[part]) <= 8
        found[part] += 1

    in_parts(add, count, 8)
    assert (found == 1).all()


@pytest.mark.parametrize("bad", [0, 5, 99])
def test_a_fault_of_any_item_is_told(bad: int) -> None:
    def work(item: int) -> None:
        if item == bad:
            raise KeyError(item)

    with pytest.raises(KeyError):
        shared_out(work, range(100))


@pytest.mark.parametrize("places", [[], [3], [2, 5, 8], [2, 5, 7], [4, 3, 2], [1, 1, 1]])
def test_slices_have_the_same_places(places: list[int]) -> None:
    numbers = np.arange(20)
    found = evenly(np.array(places, np.int64))
    assert numbers[found].tolist() == places
    assert isinstance(found, slice) == (places in [[3], [2, 5, 8]])
