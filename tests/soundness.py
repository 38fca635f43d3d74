"""Tests that `Frame.error` is a bound, with random and adversarial scenes and the oracle.

    python -m tests.soundness --pairs 10000000

A *pair* is a ray and a solid. Each is judged in several frames, with different numbers of steps
and methods. A pixel is a *violation* if its depth is further from the exact one than `error` says.
It is *wrong* if it is certain of a hit or a miss that is none. There must be neither, even at ties.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats
from halfstep.device.adapters import choose_adapter
from halfstep.frames.outputs import Lookup, arrays_of, device_outputs
from halfstep.host.camera import view
from halfstep.host.prepare import Solids, frame_setup, prepare
from halfstep.run import twin as run_twin
from halfstep.run.gpu import Device
from halfstep.scene import Scene, Volume, with_overrides
from tests.oracle import Oracle, Trace
from tests.scenes_random import KINDS, Drawn, random_scene, random_solid

Arrays = dict[str, NDArray[Any]]

SIZE = COARSE = (64, 48)
OUTPUTS = ("solid", "depth", "error")
FLOAT_STEPS = (4, 8, 12, 16)
EXACT_STEPS = (17, 20, 24, 30)
STEPS = FLOAT_STEPS + EXACT_STEPS
FORMATS = ("float32", "fixed32")


class Way(NamedTuple):
    """How a frame is rendered."""

    steps: int
    method: str = "visible"
    number_format: str = "float32"

    def __str__(self) -> str:
        return f"{self.method} {self.number_format} n {self.steps}"


class Shot:
    """A scene at one picture size, and what the oracle sees of it."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self.scene, self.size = scene, size
        self._solids = Solids.of(scene)
        self.setup = frame_setup(with_overrides(scene, size=size), solids=self._solids)

    def oracle(self) -> Oracle:
        """The truth; without a volume, unbounded solids end where the renderer ends them."""
        if self.scene.volume is not None:
            return Oracle(self.scene, self.size)
        volume = Volume(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))
        cut = self.scene.model_copy(update={"volume": volume})
        return Oracle(cut, self.size, (self.setup.near, self.setup.far))

    def render(
        self, way: Way, device: Device | None = None, outputs: tuple[str, ...] = OUTPUTS
    ) -> Arrays:
        """Outputs of a frame, from the twin where there is no device."""
        scene = with_overrides(self.scene, size=self.size, **way._asdict())
        packed = prepare(scene, solids=self._solids)
        job = (scene, packed, 0, self.size[1], device_outputs(outputs))
        planes = run_twin.render_band(*job) if device is None else device.render_band(*job)[0]
        return {
            name: array.found() if isinstance(array, Lookup) else array
            for name, array in arrays_of(outputs, planes, packed).items()
        }


# ------------------------------------------------------------------------------ scenes

Random = np.random.Generator
Family = Callable[[Random, str], Scene]


def ordinary(rng: Random, kind: str) -> Scene:
    return random_scene(rng, "outside", most=1, kinds=(kind,), ratio=(2.0, 1e4)).scene


def far(rng: Random, kind: str) -> Scene:
    return random_scene(rng, "outside", most=1, kinds=(kind,), ratio=(1e4, 1e8)).scene


def near(rng: Random, kind: str) -> Scene:
    place = str(rng.choice(["close", "inside", "beyond a cut"]))
    return random_scene(rng, place, most=1, kinds=(kind,)).scene


def many(rng: Random, kind: str) -> Scene:  # noqa: ARG001 - of every kind
    place = str(rng.choice(["outside", "close", "inside"]))
    return random_scene(rng, place).scene


def touched(rng: Random, kind: str) -> Scene:
    """The eye on a surface, or 1e-9 in front of it or behind it."""
    if rng.random() < 0.3:
        return random_scene(rng, "on the surface", most=1, kinds=(kind,)).scene
    drawn = _drawn(rng, kind, 2.0, 20.0)
    shot = Shot(drawn.scene, COARSE)
    truth = shot.oracle().trace()
    j, i = np.nonzero(truth.solid >= 0)
    if not i.size:
        return drawn.scene
    k = int(rng.integers(i.size))
    ray = shot.setup.view.directions(i[k], j[k])
    off = 1e-9 * drawn.size * float(rng.choice([-1.0, 0.0, 1.0]))
    eye = shot.setup.view.eye + truth.depth[j[k], i[k]] * ray
    eye = eye + off * ray / np.linalg.norm(ray)
    look = ray / np.linalg.norm(ray) + rng.choice([0.0, 1.0]) * rng.normal(size=3)
    return _seen(drawn.scene, eye, eye + drawn.size * look, float(rng.uniform(30, 120)))


def near_cut(rng: Random, kind: str) -> Scene:
    """Base planes through the solid, a hair's breadth from its ends too."""
    drawn = _drawn(rng, kind, 2.0, 1e4)
    sides = drawn.size * rng.uniform(0.05, 0.7, (2, 3))
    if rng.random() < 0.2:
        sides *= 10.0 ** -rng.uniform(1, 4)
    low, high = drawn.center - sides[0], drawn.center + sides[1]
    volume = Volume(min=tuple(low.tolist()), max=tuple(high.tolist()))
    return drawn.scene.model_copy(update={"volume": volume})


def magnified(rng: Random, kind: str) -> Scene:
    """An edge, a rim, a corner or a silhouette, seen through a telescope."""
    for _ in range(20):
        drawn = _drawn(rng, kind, 2.0, 10.0 ** rng.uniform(1, 6))
        shot = Shot(drawn.scene, COARSE)
        oracle = shot.oracle()
        truth = oracle.trace()
        ids = truth.solid * 64 + truth.surface
        j, i = np.nonzero(ids[:, 1:] != ids[:, :-1])
        if i.size:
            break
    else:
        return drawn.scene
    k = int(rng.integers(i.size))
    first, last = float(i[k]), float(i[k] + 1)
    for _ in range(40):
        middle = (first + last) / 2
        here = oracle.trace((np.array([middle]), j[k : k + 1]))
        if here.solid[0] * 64 + here.surface[0] == ids[j[k], i[k]]:
            first = middle
        else:
            last = middle
    ray = shot.setup.view.directions(np.array(first), j[k])
    eye = shot.setup.view.eye
    depth = np.nanmin(truth.depth)
    fov = drawn.scene.camera.fov_degrees * 10.0 ** -rng.uniform(1, 7)
    return _seen(drawn.scene, eye, eye + depth * ray, max(fov, 1e-6))


def skewed(rng: Random, kind: str) -> Scene:
    """A view with an ill-conditioned frame: `up` along it, or almost 180 degrees wide.

    Far away the solid is smaller than a pixel: the ray of one pixel is aimed at it.
    """
    drawn = _drawn(rng, kind, 2.0, 3.0)
    forward = _unit(rng)
    if rng.random() < 0.5:
        up = forward + 10.0 ** rng.uniform(-7.5, -4) * _unit(rng)
        fov = float(rng.uniform(20, 120))
    else:
        up, fov = _unit(rng), 180 - 10.0 ** rng.uniform(-5, 1)
    distance = drawn.size * 10.0 ** rng.uniform(0.5, 8)
    pixel = np.array(0), np.array(0)
    if rng.random() < 0.3:
        pixel = np.array(SIZE[0] // 2), np.array(SIZE[1] // 2)
    scene, eye = drawn.scene, drawn.center
    for _ in range(3):  # the view is rounded where it stands
        look_at = eye + drawn.size * forward
        camera = {"center": eye.tolist(), "look_at": look_at.tolist(), "up": up.tolist()}
        scene = with_overrides(scene, camera=camera | {"fov_degrees": fov})
        ray = view(scene.camera, SIZE).directions(*pixel)
        eye = drawn.center - distance * ray / np.linalg.norm(ray)
    return scene


def shifted(rng: Random, kind: str) -> Scene:  # noqa: ARG001 - quadrics only
    """A quadric written in coordinates whose origin is far away from it."""
    drawn = _drawn(rng, "sphere", 2.0, 1e3)
    solid = random_solid("quadric", np.zeros(3), drawn.size, rng)
    xx, yy, zz, xy, xz, yz, x, y, z, one = solid["coefficients"]
    matrix = np.array([[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, zz]])
    linear = np.array([x, y, z])
    shift = drawn.size * 10.0 ** rng.uniform(0, 7) * _unit(rng)
    one += shift @ matrix @ shift - linear @ shift
    linear = linear - 2 * matrix @ shift
    coefficients = [xx, yy, zz, xy, xz, yz, *linear, one]
    solid = {
        "kind": "quadric",
        "coefficients": [float(c) for c in coefficients],
        "origin": (drawn.center - shift).tolist(),
        "color": [1.0, 1.0, 1.0],
    }
    reach = drawn.size * np.ones(3)
    volume = {
        "min": (drawn.center - reach).tolist(),
        "max": (drawn.center + reach).tolist(),
    }
    camera = drawn.scene.camera.model_dump()
    return Scene.from_dict({"format": 1, "camera": camera, "solid": [solid], "volume": volume})


FAMILIES: dict[str, Family] = {
    "ordinary": ordinary,
    "far": far,
    "near": near,
    "touched": touched,
    "near_cut": near_cut,
    "magnified": magnified,
    "skewed": skewed,
    "shifted": shifted,
    "many": many,
}
# Of any twenty scenes; edges seen through a telescope are where signs are hard to tell.
SHARES = {"ordinary": 5, "magnified": 5, "near_cut": 3, "touched": 2}


def _drawn(rng: Random, kind: str, low: float, high: float) -> Drawn:
    return random_scene(rng, "outside", most=1, kinds=(kind,), ratio=(low, high))


def _unit(rng: Random) -> Floats:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def _seen(scene: Scene, eye: Floats, look_at: Floats, fov: float) -> Scene:
    camera = {"center": eye.tolist(), "look_at": look_at.tolist(), "fov_degrees": fov}
    return with_overrides(scene, camera=camera)


# ------------------------------------------------------------------------------ judgement


@dataclass
class Tally:
    """Counts over frames; faults in words."""

    judged: int = 0
    hits: int = 0
    misses: int = 0
    certain_hits: int = 0
    certain_misses: int = 0
    wrong: int = 0
    violations: int = 0
    faults: list[str] = field(default_factory=list)

    def __add__(self, other: Tally) -> Tally:
        sums = (a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        return Tally(*sums)

    @property
    def certified_hits(self) -> float:
        return self.certain_hits / max(self.hits, 1)

    @property
    def certified_misses(self) -> float:
        return self.certain_misses / max(self.misses, 1)


def judge(frame: Arrays, truth: Trace, tally: Tally, label: str) -> Floats:
    """Add a frame to the tally; the bound over the error of every certain hit."""
    hit, shown, certain = truth.solid >= 0, frame["solid"] >= 0, np.isfinite(frame["error"])
    tally.judged += hit.size
    tally.hits += int(hit.sum())
    tally.misses += int((~hit).sum())
    tally.certain_hits += int((certain & hit).sum())
    tally.certain_misses += int((certain & ~hit).sum())
    wrong = certain & (hit != shown)
    both = certain & hit & shown
    error = np.abs(frame["depth"][both] - truth.depth[both])
    bound = frame["error"][both]
    over = np.zeros(hit.shape, bool)
    over[both] = ~(error <= bound)
    tally.wrong += int(wrong.sum())
    tally.violations += int(over.sum())
    for j, i in np.argwhere(wrong | over):
        tally.faults.append(
            f"{label} pixel ({i}, {j}): depth {frame['depth'][j, i]!r} ± {frame['error'][j, i]:.3g}"
            f", exact {truth.depth[j, i]!r}, margin {truth.margin[j, i]:.3g}"
        )
    return np.asarray(bound[error > 0] / error[error > 0])


class Case(NamedTuple):
    family: str
    kind: str
    scene: Scene


def cases(rng: Random) -> Iterator[Case]:
    """Endless scenes, each kind and family in turn."""
    order = [name for name in FAMILIES for _ in range(SHARES.get(name, 1))]
    count = 0
    while True:
        kind, family = KINDS[count % len(KINDS)], order[count % len(order)]
        count += 1
        label = {"shifted": "quadric", "many": "all"}.get(family, kind)
        yield Case(family, label, FAMILIES[family](rng, kind))


class Report:
    """Tallies by method, number format and family; bound over error by format, kind and steps."""

    def __init__(self) -> None:
        self.tallies: dict[tuple[str, str, str], Tally] = defaultdict(Tally)
        self.ratios: dict[tuple[str, str, int], list[Floats]] = defaultdict(list)
        self.pairs = self.scenes = 0

    def add(self, case: Case, frames: Iterable[Way], device: Device | None) -> None:
        """Judge frames of a scene."""
        shot = Shot(case.scene, SIZE)
        truth = shot.oracle().trace()
        self.scenes += 1
        self.pairs += truth.solid.size * len(case.scene.solids)
        for way in frames:
            label = f"{case.family} {case.kind} scene {self.scenes} {way}"
            frame = shot.render(way, device)
            tally = self.tallies[way.method, way.number_format, case.family]
            ratios = judge(frame, truth, tally, label)
            if case.family == "ordinary" and way.method == "visible":
                key = way.number_format, case.kind, way.steps
                self.ratios[key].append(ratios[:: len(ratios) // 500 + 1])

    def total(self, method: str | None = None, number_format: str | None = None) -> Tally:
        """Sum of the tallies, of one method or of both, in one number format or in both."""
        chosen = (
            tally
            for (m, f, _), tally in self.tallies.items()
            if method in (None, m) and number_format in (None, f)
        )
        return sum(chosen, Tally())

    def median(self, steps: int, kind: str | None = None, number_format: str = "float32") -> float:
        """Median of bound over error in ordinary scenes, method ``visible``; NaN if there is none.

        It is within ordinary scenes that a cell dominates the error, up to n = 16 or so.
        """
        kinds = KINDS if kind is None else (kind,)
        found = [r for k in kinds for r in self.ratios.get((number_format, k, steps), [])]
        values = np.concatenate([np.empty(0), *found])
        return float(np.median(values)) if values.size else np.nan

    def table(self) -> str:
        """The report as text."""
        columns = "judged", "hits", "violations", "wrong"
        lines = [f"{self.pairs} ray-solid pairs in {self.scenes} scenes"]
        for method, number_format in product(("visible", "article"), FORMATS):
            lines.append(f"\n{method}, {number_format}")
            lines.append(f"{'':10}" + "".join(f"{name:>12}" for name in columns))
            lines[-1] += f"{'hits sure':>12}{'misses sure':>13}"
            of = method, number_format
            rows = [(key[2], tally) for key, tally in self.tallies.items() if key[:2] == of]
            for family, tally in [*rows, ("all", self.total(*of))]:
                counts = "".join(f"{getattr(tally, column):12d}" for column in columns)
                shares = f"{tally.certified_hits:12.3%}{tally.certified_misses:13.3%}"
                lines.append(f"{family:10}{counts}{shares}")
        for number_format in FORMATS:
            lines.append(f"\nmedian of bound/error, ordinary scenes, visible, {number_format}")
            lines.append(f"{'n':24}" + "".join(f"{steps:8d}" for steps in STEPS))
            for kind in (*KINDS, None):
                medians = (self.median(steps, kind, number_format) for steps in STEPS)
                lines.append(f"{kind or 'all':24}" + "".join(f"{m:8.2f}" for m in medians))
        return "\n".join(lines)


def draw_frames(rng: Random) -> list[Way]:
    """The ways in which a scene is rendered to be judged."""
    return [
        Way(int(rng.choice(FLOAT_STEPS))),
        Way(int(rng.choice(EXACT_STEPS))),
        Way(int(rng.choice(STEPS)), number_format="fixed32"),
        Way(int(rng.choice(STEPS)), "article", str(rng.choice(FORMATS))),
    ]


def survey(pairs: int, seed: int, device: Device | None) -> Report:
    """Judge scenes until there are that many pairs."""
    rng = np.random.default_rng(seed)
    report = Report()
    begin = last = time.perf_counter()
    for case in cases(rng):
        if report.pairs >= pairs:
            return report
        report.add(case, draw_frames(rng), device)
        if sys.stderr.isatty() and time.perf_counter() > last + 1:
            last = time.perf_counter()
            sys.stderr.write(f"\r{report.pairs / pairs:.0%}, {last - begin:.0f} s ")
    raise AssertionError("cases() never ends")


def main() -> int:
    """Print the report of a survey; 1 if anything that was certain is not so."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=1_000_000, help="ray-solid pairs")
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--backend", choices=("gpu", "numpy"), default="gpu")
    options = parser.parse_args()
    device = Device(choose_adapter()) if options.backend == "gpu" else None
    report = survey(options.pairs, options.seed, device)
    sys.stdout.write(report.table() + "\n")
    for fault in report.total().faults[:50]:
        sys.stdout.write(fault + "\n")
    return int(bool(report.total().faults))


if __name__ == "__main__":
    sys.exit(main())
