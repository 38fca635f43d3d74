"""Nothing is wrong at the ends of the ranges, unless `error` says that it may be."""

from __future__ import annotations

import pytest

from tests.extremes import FORMATS, View, extremes, judge

# Where either format tells every hit from a miss: nothing there is left to `error` to excuse.
RESOLVED = {
    "distance / size": 0.99,
    "size": 0.99,
    "off the world's origin": 0.99,
    "eye before a surface": 0.7,
    "eye on a surface": 0.0,
    "eye inside a surface": 0.7,
    "plates": 0.99,
    "down the bore": 0.99,
    "along the asymptotic cone": 0.99,
    "field of view": 0.99,
    "steps": 0.99,
}
# 29 bits do not tell four rays along the cone beside its apex from its wall.
FLAGGED = {("down the bore", "fixed32"): 4}

EXTREMES = list(extremes())


@pytest.mark.parametrize("number_format", FORMATS)
@pytest.mark.parametrize(("extreme", "range_", "views"), EXTREMES, ids=[e[0] for e in EXTREMES])
@pytest.mark.slow
def test_nothing_is_silently_wrong(
    extreme: str, range_: str, views: list[View], number_format: str
) -> None:
    row = judge(extreme, range_, views, "numpy", number_format)
    assert row.verdict.hits > 1000
    assert (row.verdict.wrong, row.violations) == (0, 0), row.verdict.faults
    if extreme in RESOLVED:
        assert row.flagged == FLAGGED.get((extreme, number_format), 0)
        assert row.certified >= RESOLVED[extreme]
    assert row.certified > 0.4 or extreme == "eye on a surface"


def test_plates_lose_no_pixel() -> None:
    (views,) = (views for name, _, views in EXTREMES if name == "plates")
    row = judge("plates", "", views, "numpy")
    assert row.verdict.ties + row.flagged + row.verdict.wrong <= 1e-4 * row.verdict.rays
    assert row.most <= 0.5 + 1e-3
