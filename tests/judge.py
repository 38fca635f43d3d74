"""Frames judged against the oracle, pixel by pixel.

A pixel's solid and surface are *wrong* if they differ from the oracle's there and at four points
`delta` of a pixel away, all of which the oracle sees alike: then no edge passes so near that
rounding could decide it. A pixel that differs beside an edge is a *tie*. If two solids are closer
together than the depth error of the number of halvings, either may be seen, and the pixel is
*unresolved*. A depth may differ from the depths that the oracle sees within `delta` by half a cell
and `FLOOR` over the cosine of incidence.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Bools, Floats
from halfstep.host.camera import view
from halfstep.scene import QuadricSolid, Scene, Volume
from tests.oracle import Oracle, Trace
from tests.scenes_random import intervals

# Coefficients rounded to float32 move an edge by 2^-22 of a solid's rectangle or so: 1e-4 of a
# pixel across the pictures here, more where a surface meets the edge at a small angle.
DELTA = 1e-3
# Where the eye lies on a surface, one root of F is the eye. The other is told from it only beyond
# 2^-11 of the interval, the root of the rounding: a few hundredths of a pixel from tangency.
DELTA_ON_SURFACE = 0.1
# Depth error of float32, in lengths of a solid's interval, where the surface is not grazed.
FLOOR = 2.0**-18
OUTPUTS = ("solid", "surface", "depth", "depth_exit")


@dataclass
class Verdict:
    """Counts over frames; faults in words."""

    rays: int = 0
    hits: int = 0
    starts_inside: int = 0
    ties: int = 0
    unresolved: int = 0
    missed: int = 0
    expected_missed: float = 0.0
    wrong: int = 0
    off: int = 0
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        counts = {k: v for k, v in vars(self).items() if k != "faults"}
        return ", ".join(f"{k.replace('_', ' ')} {v:.4g}" for k, v in counts.items())


class Judge:
    """The truth about one scene at one picture size."""

    def __init__(self, scene: Scene, size: tuple[int, int], delta: float = DELTA) -> None:
        self.scene, self.size, self._delta = scene, size, delta
        near, far, self.length = intervals(scene, size)
        # With a volume, whatever it is, the oracle cuts every solid at the base planes it is given.
        volume = Volume(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))
        self.oracle = Oracle(scene.model_copy(update={"volume": volume}), size, (near, far))
        self.truth = self.oracle.trace()

    def visible(self, frame: Any, steps: int, verdict: Verdict, label: str) -> None:
        """Count the right and wrong pixels of a frame of the method ``visible``."""
        truth = self.truth
        self._count(verdict)
        differ = (frame.solid != truth.solid) | (frame.surface != truth.surface)
        self._judge_ids(frame, differ, steps, verdict, label)
        self._judge_depths(frame, ~differ & (truth.solid >= 0), steps, verdict, label)

    def article(self, frame: Any, steps: int, verdict: Verdict, label: str) -> None:
        """Count those of the method ``article``, which may miss solids between grid points.

        A miss is a pixel that shows nothing or something behind the truth. A chord shorter than a
        cell is expected to be missed with probability 1 - chord/cell.
        """
        truth = self.truth
        self._count(verdict)
        hit = truth.solid >= 0
        with np.errstate(invalid="ignore"):
            behind = hit & ~(frame.depth <= truth.depth + 2 * self._allowed(truth.solid, steps))
        differ = (frame.solid != truth.solid) | (frame.surface != truth.surface)
        verdict.missed += int((behind & differ).sum())
        cell = self._length_of(truth.solid) * 2.0**-steps
        chord = truth.depth_exit - truth.depth
        thin = hit & (chord > 0) & (chord < cell)
        verdict.expected_missed += float((1 - chord[thin] / cell[thin]).sum())
        # A solid that shows through is judged as if the missed solid were not there.
        seen = behind & (frame.solid >= 0)
        for index in np.unique(frame.solid[seen]):
            i, j = self._pixels(seen & (frame.solid == index))
            alone = self.oracle.trace_solid(int(index), (i, j))
            false = (alone.surface != frame.surface[j, i]) & self.oracle.stable_ids(
                self._delta, (i, j), int(index)
            )
            # A solid whose first piece was missed may show its second.
            second = false & (frame.solid[j, i] == truth.solid[j, i])
            self._blame(verdict, frame, (i, j), false & ~second, label)
        self._judge_ids(frame, differ & ~behind, steps, verdict, label)
        self._judge_depths(frame, ~differ & hit & ~behind, steps, verdict, label)

    def _count(self, verdict: Verdict) -> None:
        hit = self.truth.solid >= 0
        verdict.rays += hit.size
        verdict.hits += int(hit.sum())
        verdict.starts_inside += int(np.sum(self.truth.depth == self.truth.depth_exit))

    def _judge_ids(
        self, frame: Any, differ: Bools, steps: int, verdict: Verdict, label: str
    ) -> None:
        i, j = self._pixels(differ)
        if not i.size:
            return
        stable = self.oracle.stable_ids(self._delta, (i, j))
        seen, true = frame.solid[j, i], self.truth.solid[j, i]
        close = stable & self._is_close(frame, i, j, steps) & (seen != true)
        verdict.ties += int((~stable).sum())
        verdict.unresolved += int(close.sum())
        self._blame(verdict, frame, (i, j), stable & ~close, label)

    def _is_close(self, frame: Any, i: NDArray[np.intp], j: NDArray[np.intp], steps: int) -> Bools:
        """Whether the solid shown is there, behind the truth by at most the allowed depth error."""
        seen, true = frame.solid[j, i], self.truth.solid[j, i]
        close = np.zeros(i.shape, bool)
        for index in np.unique(seen[seen >= 0]):
            of = seen == index
            alone = self.oracle.trace_solid(int(index), (i[of], j[of]))
            room = self._allowed(seen[of], steps) + self._allowed(true[of], steps)
            with np.errstate(invalid="ignore"):
                close[of] = (alone.surface == frame.surface[j[of], i[of]]) & (
                    alone.depth - self.truth.depth[j[of], i[of]] <= room
                )
        return close

    def _judge_depths(
        self, frame: Any, same: Bools, steps: int, verdict: Verdict, label: str
    ) -> None:
        allowed = self._allowed(self.truth.solid, steps)
        for name in ("depth", "depth_exit"):
            ours, true = getattr(frame, name), getattr(self.truth, name)
            error = np.where(same, np.abs(ours - true), 0.0)
            i, j = self._pixels(same & ~(error <= allowed))
            if not i.size:
                continue
            # Beside a silhouette a small shift of the ray changes the depth much.
            beside = [
                self.oracle.trace((i + di, j + dj))
                for di in (-self._delta, self._delta)
                for dj in (-self._delta, self._delta)
            ]
            stable = np.all([self._same_ids(trace, i, j) for trace in beside], axis=0)
            near_by = [true[j, i], *(getattr(trace, name) for trace in beside)]
            low, high = np.min(near_by, axis=0), np.max(near_by, axis=0)
            room = allowed[j, i] + self._grazing(i, j, true[j, i])
            good = (ours[j, i] >= low - room) & (ours[j, i] <= high + room)
            bad = stable & ~good
            verdict.off += int(bad.sum())
            for p, q, b in zip(i, j, bad, strict=True):
                if b and len(verdict.faults) < 20:
                    L = self._length_of(self.truth.solid[q, p])
                    verdict.faults.append(
                        f"{label} pixel ({p}, {q}): {name} {ours[q, p]!r}, exact {true[q, p]!r}, "
                        f"off by {error[q, p] / L:.3g} of the interval, n {steps}"
                    )

    def _grazing(self, i: NDArray[np.intp], j: NDArray[np.intp], depth: Floats) -> Floats:
        """`FLOOR` in scene units over the cosine between ray and normal, at points of the truth."""
        length = self._length_of(self.truth.solid[j, i])
        return length * FLOOR * (1 / np.maximum(self._cosine(i, j, depth), FLOOR) - 1)

    def cosine(self, i: NDArray[np.intp], j: NDArray[np.intp]) -> Floats:
        """The cosine between ray and quadric in pixels that show one; 1 for planes."""
        curved = self.truth.surface[j, i] == 0
        cosine = self._cosine(i, j, self.truth.depth[j, i])
        quadric = np.array([isinstance(solid, QuadricSolid) for solid in self.scene.solids])
        return np.where(curved & quadric[self.truth.solid[j, i]], cosine, 1.0)

    def _cosine(self, i: NDArray[np.intp], j: NDArray[np.intp], depth: Floats) -> Floats:
        cosine = np.zeros(i.shape)
        eye = view(self.scene.camera, self.size)
        starts, directions = eye.starts(i, j), eye.directions(i, j)
        for n, (start, ray, s) in enumerate(zip(starts, directions, depth, strict=True)):
            solid = self.scene.solids[self.truth.solid[j[n], i[n]]]
            if not isinstance(solid, QuadricSolid):
                continue
            # About the eye first: the solid may be far from the world's origin.
            point = ((eye.eye - solid.origin) + start + s * ray) @ solid.world_from_local()
            gradient = (solid.quadric() @ [*point, 1.0])[:3] @ solid.world_from_local().T
            size = np.linalg.norm(gradient) * np.linalg.norm(ray)
            cosine[n] = abs(gradient @ ray) / size if size > 0 else 0.0
        return cosine

    def _same_ids(self, trace: Trace, i: Any, j: Any) -> Bools:
        return np.asarray(
            (trace.solid == self.truth.solid[j, i]) & (trace.surface == self.truth.surface[j, i])
        )

    def _blame(
        self, verdict: Verdict, frame: Any, pixels: tuple[Any, Any], bad: Bools, label: str
    ) -> None:
        verdict.wrong += int(bad.sum())
        for i, j in zip(pixels[0][bad], pixels[1][bad], strict=True):
            if len(verdict.faults) < 20:
                verdict.faults.append(
                    f"{label} pixel ({i}, {j}): solid {frame.solid[j, i]} surface "
                    f"{frame.surface[j, i]} at {frame.depth[j, i]!r}, exact "
                    f"{self.truth.solid[j, i]} surface {self.truth.surface[j, i]} at "
                    f"{self.truth.depth[j, i]!r}"
                )

    def _length_of(self, solid: Any) -> Floats:
        return np.where(solid >= 0, self.length[solid], np.nan)

    def _allowed(self, solid: Any, steps: int) -> Floats:
        """Half a cell of the solid hit, plus rounding."""
        return self._length_of(solid) * (2.0 ** -(steps + 1) + FLOOR)

    @staticmethod
    def _pixels(mask: Bools) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        j, i = np.nonzero(mask)
        return i, j
