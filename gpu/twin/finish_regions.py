"""Twin of ``finish_regions.wgsl``: numbers, normals and appearances of points that regions show."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from halfstep.contract.regions import PackedRegions
from halfstep.twin.cross_higher import higher_slope, higher_surfaces
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import I32, Bools
from halfstep.twin.normal import Vector, either, gradient
from halfstep.twin.region import outward, plane_normal, shows_surface


def painted(old: Nearest, look: np.void, here: Bools, facts: Collection[str]) -> Nearest:
    """A point, with the appearance of a cell or a surface in the pixels `here`."""
    new = old._replace(color=either(here, Vector(*look["color"]), old.color))
    if "mirrors" in facts:
        new = new._replace(reflection=np.where(here, look["reflection"], old.reflection))
    if "gloss" in facts:
        new = new._replace(
            specular=np.where(here, look["specular"], old.specular),
            shininess=np.where(here, look["shininess"], old.shininess),
        )
    return new


def finish_region(
    region: np.void,
    solid: np.void,
    regions: PackedRegions,
    old: Nearest,
    i: I32,
    j: I32,
    facts: Collection[str],
) -> Nearest:
    """The points that a region shows; ``i`` and ``j`` are their pixels."""
    start, *counts = (
        int(region[name]) for name in ("list_start", "flat_count", "curved_count", "cell_count")
    )
    cells = regions.words[start + counts[0] + counts[1] :][: counts[2]].tolist()
    looks = regions.appearances[int(region["looks_start"]) :]
    new = old
    for k in np.unique(old.met.cell).tolist():
        here, cell = old.met.cell == k, cells[k]
        first = np.where(here, np.uint32(cell * int(region["surfaces"])), np.uint32(0))
        new = new._replace(surface=new.surface + first)
        if "color" in facts:
            new = painted(new, looks[cell], here, facts)
    own = (old.met.side >> np.int32(1)).astype(np.uint32)
    if "normal" in facts:
        x = (i - solid["center_x"]).astype(np.float32)
        y = (j - solid["center_y"]).astype(np.float32)
        u = old.position.astype(np.float32) * solid["last_step"]
        higher = {one.number: one for one in higher_surfaces(region, solid, regions)}
        for number in np.unique(own).tolist():
            here = shows_surface(old.met, number)
            if number < region["planes"]:
                normal = plane_normal(regions.flat[int(region["flat_start"]) + number])
            elif number in higher:
                one = higher[number]
                right, down = i - one.higher["center_x"], j - one.higher["center_y"]
                normal = higher_slope(one, right, down, u)
            else:
                row = int(region["curved_start"]) + number - int(region["planes"])
                normal = gradient(regions.curved[row]["gradient"], x, y, u)
            new = new._replace(slope=either(here, outward(normal, old.met), new.slope))
            look = looks[int(region["cells"]) + number]
            if "color" in facts and look["is_own"]:
                new = painted(new, look, here, facts)
    return new._replace(surface=new.surface + own)
