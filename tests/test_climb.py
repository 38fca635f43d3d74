"""What `climbing_jet` and `sinking_jet` say of formulas along rays is true, in 200 bits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from halfstep.twin.climb import climbing_jet, has_slope, lowered_jet, sinking_jet
from halfstep.twin.jets import MEAN, judged_jet
from tests.test_formulas import JETS, cells_of

PLACES = 24


@pytest.mark.parametrize("text", JETS)
def test_what_climbs_is_above_its_beginning(text: str, rng: np.random.Generator) -> None:
    passed = falls = sloped = 0
    for jet, value in cells_of(text, rng):
        with mpmath.workprec(200):
            begin = value(-1)
            level = np.full((1, 1), np.float32(begin))
            off = abs(mpmath.mpf(float(level[0, 0])) - begin)
            error = np.full((1, 1), np.float32(off * mpmath.mpf("1.01")))
            lowered = lowered_jet(jet, level, error)
            judged, plain = climbing_jet(lowered), judged_jet(lowered)
            places = [mpmath.mpf(float(s)) for s in 2 * rng.random(PLACES) ** 3 - 1]
            if (judged.passed & ~plain.passed & judged.defined).all():
                passed += 1
                assert all(value(s) > begin for s in [*places, 1])
            if (judged.ahead & ~plain.ahead & judged.defined).all():
                assert all(value((s - 1) / 2) > begin for s in [*places, 1])
            if sinking_jet(lowered).single.all():
                falls += 1
                assert min(value(s) for s in [*places, 0, 1]) < begin
            if has_slope(jet).all() and int(jet.state[0, 0]) in (0, MEAN):
                sloped += 1
                assert (mpmath.diff(value, 0) > 0) == bool(jet.slope[0, 0] > 0)
    assert passed > 3
    assert falls > 3
    assert sloped > 8
