"""Work that threads share out: all of it is done once, and faults are told."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from halfstep.host.sharing import Begun, evenly, in_parts, shared_out


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


def test_each_thread_that_asks_for_begun_work_waits_for_all_of_it() -> None:
    done: list[int] = []

    def work(item: int) -> None:
        time.sleep(0.01)
        done.append(item)

    begun = Begun(work, range(20))

    def finished(_: int) -> list[int]:
        begun.finish()
        return sorted(done)

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(finished, range(3))) == [[*range(20)]] * 3


def test_a_fault_of_begun_work_is_told_whenever_it_is_asked_for() -> None:
    def work(item: int) -> None:
        raise KeyError(item)

    begun = Begun(work, range(3))
    for _ in range(2):
        with pytest.raises(KeyError):
            begun.finish()


@pytest.mark.parametrize("places", [[], [3], [2, 5, 8], [2, 5, 7], [4, 3, 2], [1, 1, 1]])
def test_slices_have_the_same_places(places: list[int]) -> None:
    numbers = np.arange(20)
    found = evenly(np.array(places, np.int64))
    assert numbers[found].tolist() == places
    assert isinstance(found, slice) == (places in [[3], [2, 5, 8]])
