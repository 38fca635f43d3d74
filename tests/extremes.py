"""Scenes at the ends of every range, and what is wrong in them: the table of tests/README.md.

    python -m tests.extremes

Pixels that show another solid or surface than the oracle sees there and a thousandth of a pixel
around (`tests.judge`; a tenth where the eye lies on the surface) are *wrong*, or *flagged* where
`error` says so.  Errors are those of the other pixels that are certain, in cells, 2^-n of a solid's
depth interval: half of one at best.  *Certain* are the hits with a finite `error`.  The columns are
those of float32, then those of fixed32.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import halfstep
from halfstep.contract.arrays import Floats
from halfstep.scene import Scene
from tests.judge import DELTA, DELTA_ON_SURFACE, Judge, Verdict
from tests.scenes_random import KINDS, random_solid

Table = dict[str, Any]

SIZE = (65, 49)
STEPS = 16
FORMATS = ("float32", "fixed32")
OUTPUTS = ("solid", "surface", "depth", "depth_exit", "error")
_ALL_KINDS = (*KINDS, "sphere")


class View(NamedTuple):
    """A scene to be judged in a number of steps."""

    scene: Scene
    steps: int = STEPS
    delta: float = DELTA


@dataclass
class Row:
    """The results at one extreme."""

    extreme: str
    range: str
    verdict: Verdict
    flagged: int = 0
    certain: int = 0
    violations: int = 0
    most: float = 0.0

    @property
    def certified(self) -> float:
        """Share of the hits that are certain."""
        return self.certain / self.verdict.hits

    def cells(self) -> list[str]:
        """The cells of a line of the table for a number format."""
        most = f"{self.most:.3g}" if self.certain else "–"
        return [str(self.verdict.wrong), f"{self.flagged:,}", most, f"{self.certified:.2%}"]


# ------------------------------------------------------------------------------ scenes


def _scene(
    solids: list[Table],
    eye: Any,
    look_at: Any,
    fov: float,
    size: float | None = None,
    up: Any = (0.0, 0.0, 1.0),
) -> Scene:
    camera = {"center": list(eye), "look_at": list(look_at), "up": list(up), "fov_degrees": fov}
    tables: Table = {
        "format": 1,
        "camera": camera,
        "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
    }
    if size is not None:
        tables["volume"] = {"min": [-size] * 3, "max": [size] * 3}
    return Scene.from_dict(tables)


def _set(size: float, center: Floats, ratio: float, fov: float | None = None) -> Scene:
    """Twelve solids, of every kind, that together reach about ``size`` from a point."""
    rng = np.random.default_rng(12)
    grid = [(x, 0.3 * rng.normal(), z) for x in (-0.75, -0.25, 0.25, 0.75) for z in (-0.6, 0, 0.6)]
    solids = []
    for kind, place in zip(_ALL_KINDS, grid, strict=True):
        solid = random_solid(kind, center + size * np.array(place), 0.25 * size, rng)
        if kind in KINDS[2:8]:
            solid |= {"z_min": -0.2 * size, "z_max": 0.25 * size}
        solids.append(solid)
    volume = {"min": (center - 1.2 * size).tolist(), "max": (center + 1.2 * size).tolist()}
    eye = center + ratio * size * np.array([0.28, -0.96, 0.0])
    if fov is None:
        fov = float(2 * np.degrees(np.arctan(1.0 / ratio)))
    scene = _scene(solids, eye.tolist(), center.tolist(), fov)
    return Scene.from_dict(scene.model_dump(exclude_none=True, by_alias=True) | {"volume": volume})


def _origin() -> Floats:
    return np.zeros(3)


_TOUCHED: list[Table] = [
    {"kind": "sphere", "radius": 1.0},
    {"kind": "ellipsoid", "semi_axes": [1.0, 1.0, 2.0]},
    {"kind": "cylinder", "radius": 1.0, "z_min": -1.0, "z_max": 1.0},
    {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 1.0, "z_min": -1.0, "z_max": 1.0},
    {"kind": "box", "size": [2.0, 2.0, 2.0]},
]


def _touching(gap: float) -> Iterator[View]:
    """The eye ``gap`` in front of the surface at (0, -1, 0), looking in, along, and out."""
    delta = DELTA_ON_SURFACE if abs(gap) < 1e-6 else DELTA
    for solid in _TOUCHED:
        for look in ((0.1, 1.0, 0.2), (1.0, 0.1, 0.1), (0.1, -1.0, 0.1)):
            eye = np.array([0.0, -1.0 - gap, 0.0])
            yield View(_scene([solid], eye, eye + look, 60.0, 4.0), delta=delta)


def _grazing() -> Iterator[View]:
    for power in range(1, 8):
        slope = 10.0**-power
        # Along the top of a block, at this slope.
        block: Table = {"kind": "box", "size": [2.0, 2.0, 2.0]}
        eye, fov = np.array([0.0, -3.0, 1 + 2 * slope]), float(np.degrees(slope))
        yield View(_scene([block], eye, [0.0, 0.0, 1.0], fov))
        # Past a ball: the cosine of incidence is the root of twice the height above the tangent.
        ball: Table = {"kind": "sphere", "radius": 1.0}
        tangent = np.array([0.0, -0.1, np.sqrt(0.99)])
        fov = float(np.degrees(max(slope * slope, 1e-13)))
        yield View(_scene([ball], [0.0, -10.0, 0.0], tangent, fov))


def _thin(solids: list[Table], steps: tuple[int, ...]) -> Iterator[View]:
    for solid in solids:
        for axis in ((0.0, 0.0, 1.0), (0.3, -0.8, 0.5), (0.6, 0.02, 0.8), (1.0, 0.0, 0.0)):
            for n in steps:
                turned = solid | {"axis": list(axis)}
                yield View(_scene([turned], [0.5, -5.0, 2.0], [0.0, 0.0, 0.0], 24.0), n)


_NEEDLES: list[Table] = [
    {"kind": "ellipsoid", "semi_axes": [1e-4, 1e-4, 1.0]},
    {"kind": "ellipsoid", "semi_axes": [1.0, 1.0, 1e-4]},
    {"kind": "cylinder", "radius": 1e-4, "z_min": -1.0, "z_max": 1.0},
    {"kind": "cone", "slope": 1e-4, "z_min": 0.0, "z_max": 1.0},
    {"kind": "hyperboloid_one_sheet", "waist": 1e-4, "c": 1.0, "z_min": -1.0, "z_max": 1.0},
    {"kind": "paraboloid", "a": 1e2, "z_max": 1e-4},
]
_PLATES: list[Table] = [
    {"kind": "box", "size": [1.6, 1.6, 1e-4]},
    {"kind": "cylinder", "radius": 1.0, "z_min": -5e-5, "z_max": 5e-5},
    {"kind": "sphere", "radius": 1.0, "z_min": 0.3, "z_max": 0.3001},
]


def _apex() -> Iterator[View]:
    for cut in ({}, {"z_min": -1.0, "z_max": 0.0}):
        cone: Table = {"kind": "cone", "slope": 0.5, **cut}
        for power in range(6):
            for eye in ([0.0, -3.0, 0.0], [0.2, -3.0, 0.9], [0.1, 0.2, 3.0]):
                yield View(_scene([cone], eye, [0.0, 0.0, 0.0], 60 * 10.0**-power, 1.0))


def _bore() -> Iterator[View]:
    for solid in (
        {"kind": "cylinder", "radius": 1.0},
        {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 2.0},
        {"kind": "cone", "slope": 1.0, "z_min": 0.0, "z_max": 40.0},
    ):
        for eye in ([0.0, 0.0, -30.0], [0.0, 0.0, 1e-3], [0.3, 0.2, 5.0]):
            for fov in (0.5, 60.0):
                ahead = [eye[0], eye[1], eye[2] + 1]
                yield View(_scene([solid], eye, ahead, fov, 50.0, [0.0, 1.0, 0.0]))


def _asymptotic() -> Iterator[View]:
    """The middle ray along the asymptotic cone: forward is (1, 0, 1)/√2, A = 0 to the last bit."""
    for solid in (
        {"kind": "cone", "slope": 1.0},
        {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 1.0},
        {"kind": "hyperboloid_two_sheets", "a": 1.0, "c": 1.0},
    ):
        for start in ([-4.0, 0.0, -5.0], [-4.0, 0.5, -3.0], [-3.0, 0.25, -3.0]):
            ahead = [start[0] + 1, start[1], start[2] + 1]
            for fov in (1e-3, 1.0, 40.0):
                yield View(_scene([solid], start, ahead, fov, 4.0))


def extremes() -> Iterator[tuple[str, str, list[View]]]:
    """Every extreme: its name, its range and its views."""
    powers = range(-6, 7, 2)
    ratios = [2.0, *(10.0**k for k in range(1, 9))]
    yield "distance / size", "2 … 1e8", [View(_set(1.0, _origin(), r)) for r in ratios]
    yield "size", "1e-6 … 1e6", [View(_set(10.0**k, _origin(), 4.0)) for k in powers]
    away = 1e6 * np.array([0.6, -0.64, 0.48])
    yield (
        "off the world's origin",
        "1e6",
        [View(_set(size, away, r)) for size in (1e-2, 1.0, 1e2) for r in (2.0, 1e3)],
    )
    yield "eye before a surface", "1e-9", list(_touching(1e-9))
    yield "eye on a surface", "0", list(_touching(0.0))
    yield "eye inside a surface", "1e-9", list(_touching(-1e-9))
    yield "grazing incidence", "cos 1e-1 … 1e-7", list(_grazing())
    yield "needles and discs", "axes 1e4 : 1", list(_thin(_NEEDLES, (STEPS,)))
    yield "plates", "1e-4 thick, n = 5 … 8", list(_thin(_PLATES, (5, 6, 7, 8)))
    yield "cone apex", "fov 60° … 6e-4°", list(_apex())
    yield "down the bore", "fov 0.5° … 60°", list(_bore())
    yield "along the asymptotic cone", "A = 0", list(_asymptotic())
    fovs = (0.01, 0.1, 1.0, 10.0, 60.0, 120.0, 150.0, 170.0)
    views = [View(_set(1.0, _origin(), 1 / np.tan(np.radians(f) / 2) + 0.5, f)) for f in fovs]
    yield "field of view", "0.01° … 170°", views
    yield "steps", "n = 1 … 30", [View(_set(1.0, _origin(), 4.0), n) for n in range(1, 31)]


# ------------------------------------------------------------------------------ judgement


def judge(
    extreme: str, range_: str, views: list[View], backend: str, number_format: str = "float32"
) -> Row:
    """Render and judge all views of an extreme."""
    row = Row(extreme, range_, Verdict())
    for number, (scene, steps, delta) in enumerate(views):
        truth_of = Judge(scene, SIZE, delta)
        frame = halfstep.render(
            scene,
            size=SIZE,
            steps=steps,
            number_format=number_format,
            backend=backend,
            outputs=OUTPUTS,
        )
        truth = truth_of.truth
        hit, certain = truth.solid >= 0, np.isfinite(frame.error)
        # Each frame is judged twice: as it is, and with the truth wherever `error` is not finite.
        promised = SimpleNamespace(
            **{
                name: np.where(certain, getattr(frame, name), getattr(truth, name))
                for name in OUTPUTS[:4]
            }
        )
        everything = Verdict()
        before = row.verdict.wrong
        truth_of.visible(promised, steps, row.verdict, f"{extreme}, view {number},")
        truth_of.visible(frame, steps, everything, "")
        row.flagged += everything.wrong - (row.verdict.wrong - before)
        same = certain & hit & (frame.solid == truth.solid) & (frame.surface == truth.surface)
        error = np.abs(frame.depth - truth.depth)
        cell = truth_of.length[truth.solid] * 2.0**-steps
        row.most = max(row.most, float((error / cell)[same].max(initial=0.0)))
        row.certain += int((certain & hit).sum())
        shown = frame.solid >= 0
        with np.errstate(invalid="ignore"):
            over = certain & ((hit != shown) | (hit & ~(error <= frame.error)))
        row.violations += int(over.sum())
    return row


def main() -> int:
    """Print the table; 1 if anything in it is wrong."""
    columns = " wrong | flagged | largest error | certain |" * len(FORMATS)
    sys.stdout.write(f"| extreme | range | pixels |{columns}\n")
    sys.stdout.write("|---|---|--:|" + "--:|" * 4 * len(FORMATS) + "\n")
    faults = 0
    for name, range_, views in extremes():
        rows = [judge(name, range_, views, "numpy", form) for form in FORMATS]
        cells = [cell for row in rows for cell in row.cells()]
        pixels = f"{rows[0].verdict.rays:,}"
        sys.stdout.write(f"| {' | '.join([name, range_, pixels, *cells])} |\n")
        sys.stdout.flush()
        for row in rows:
            faults += row.verdict.wrong + row.violations
            if row.verdict.wrong:
                sys.stderr.write("\n".join(row.verdict.faults) + "\n")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
