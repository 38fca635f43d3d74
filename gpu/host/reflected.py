"""Copies of groups of cells as bodies that rays from mirrors may meet, float64, once for a scene.

A copy has the coordinates of its body. Its planes are half-spaces of the body; its quadrics are F
of a body each, and its other surfaces have forms of bodies. Rays from mirrors go anywhere, so a
copy has its whole program.
"""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import U32, Floats, Ints, Records, never_change
from halfstep.contract.mirrors import PackedReflected
from halfstep.errors import SceneError
from halfstep.host.casters import Caster, caster_of_surface
from halfstep.host.pack_veils import WRITTEN, Programs
from halfstep.host.regions import Regions
from halfstep.scene import Scene

# Limit of the surfaces of a group that rays from mirrors may meet, because shaders keep the
# crossings of each.
MOST_REFLECTED = 255
# What rounding adds to F of a quadric along a ray, as a part of the sum of its coefficients; see
# `twin.reflect`.
BY_ROUNDING = 2.0**-18


class Reflected:
    """The records of copies of groups, which do not depend on the camera."""

    def __init__(self, regions: Regions, degree: int, start: int) -> None:
        """The copies of a scene, without their surfaces.

        Args:
            regions: the programs of the copies.
            degree: the highest one of the scene's polynomials.
            start: how many words of other programs are before those of these.
        """
        self._regions, self._degree = regions, degree
        self.casters: list[Caster] = []  # of surfaces of an order above two
        self._copies = np.zeros(regions.count, layout.REFLECTED.dtype())
        self._bowls: list[Floats] = [np.zeros((4, 4, 0))]
        self._start = 0  # of the next copy's quadrics
        self._programs = Programs(start)
        self._written = [
            self._programs.add(program.formula.whole, program.planes, program.lower)
            for program in regions.programs
        ]

    @functools.cached_property
    def words(self) -> U32:
        """The lists and programs of all copies."""
        return self._programs.words

    def add(self, copy: int, to_local: Floats, face_start: int) -> Floats:
        """Fill the record of a copy. Returns its planes (P, 4), with unit normals.

        Args:
            copy: its number among all copies.
            to_local: (4, 4), takes the coordinates of its body to those of its program.
            face_start: its first plane among the half-spaces of bodies.
        """
        which = self._regions.of[copy]
        program, record = self._regions.programs[which], self._copies[copy]
        matrices = np.einsum("ai,abs,bj->ijs", to_local, program.matrices, to_local)
        sides = 2 * matrices[3, :, : program.planes].T
        bent = matrices[..., program.planes : program.lower]
        sides[:, 3] /= 2
        record["count"] = len(program.cells) * program.count
        record["surfaces"], record["planes"] = program.count, program.planes
        record["flat_start"], record["curved_start"] = face_start, self._start
        record["cells"] = len(program.cells)
        for name, value in zip(WRITTEN, self._written[which], strict=True):
            record[name] = value
        record["lower"], record["higher_start"] = program.lower, len(self.casters)
        self.casters += [
            caster_of_surface(each, self._degree, to_local, 0.0) for each in program.higher
        ]
        self._bowls.append(bent / np.abs(bent).max(axis=(0, 1), initial=1e-300))
        self._start += bent.shape[-1]
        return np.asarray(sides / np.linalg.norm(sides[:, :3], axis=1, keepdims=True))

    @functools.cached_property
    def _records(self) -> Records:
        """Those of the quadrics of all copies."""
        found = np.concatenate(self._bowls, axis=-1)
        bowls = np.zeros(found.shape[-1], layout.BOWL.dtype())
        bowls["second"] = found[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].T
        bowls["slope"], bowls["value"] = found[3, :3].T, found[3, 3]
        bowls["error"] = BY_ROUNDING * np.abs(found).sum(axis=(0, 1))
        never_change([bowls])
        return bowls

    def packed(self, looks: Ints, before: int) -> PackedReflected:
        """The records.

        Args:
            looks: the first appearance of each copy (I,).
            before: how many other forms are before those of surfaces of copies.
        """
        copies = self._copies.copy()
        copies["looks_start"] = looks
        copies["higher_start"] += np.uint32(before)
        wholes = [program.formula.whole for program in self._regions.programs]
        return PackedReflected(
            copies=copies,
            bowls=self._records,
            words=self.words,
            most_crossings=max(whole.crossings for whole in wholes),
            levels=max(whole.levels for whole in wholes),
            degree=self._degree if self.casters else 0,
            pairs=max((each.pairs for each in self.casters), default=0),
        )


def reflected_of(
    scene: Scene, regions: Regions | None, degree: int, start: int
) -> Reflected | None:
    """The copies of a scene; None if it has none. Arguments are those of `Reflected`.

    Raises:
        SceneError: a group has too many surfaces.
    """
    if regions is None:
        return None
    most = max(len(program.formula.whole.surfaces) for program in regions.programs)
    if most > MOST_REFLECTED:
        raise SceneError(
            f"{scene.name}: mirrors: a group has {most:,} surfaces, more than {MOST_REFLECTED}"
        )
    return Reflected(regions, degree, start)
