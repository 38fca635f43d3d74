"""Twin of ``finish_regions.wgsl``: the numbers, normals and looks of what regions show."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from halfstep.contract.regions import PackedRegions
from halfstep.twin.algebraic import world_slope
from halfstep.twin.cross_higher import higher_surfaces
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import I32, Bools
from halfstep.twin.normal import Vector, either, gradient
from halfstep.twin.region import outward, plane_normal, shows_surface
from halfstep.twin.taylor import slopes_on_rays


def painted(old: Nearest, look: np.void, here: Bools, facts: Collection[str]) -> Nearest:
    """A point with the look of a cell or a surface where it is what is met."""
    new = old._replace(color=either(here, Vector(*look["color"]), old.color))
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
    """Points that a region, a record, shows all of; i and j are their pixels."""
    flat_count, curved_count, cell_count, face_count = (
        int(region[f"{of}_count"]) for of in ("flat", "curved", "cell", "face")
    )
    ends = np.cumsum([region["list_start"], flat_count, curved_count, cell_count, face_count])
    listed = regions.words[ends[0] : ends[4]].astype(np.int64)
    planes, quadrics, cells, faces = np.split(listed, ends[1:4] - ends[0])
    looks = regions.appearances[int(region["looks_start"]) :]
    new = old
    for k, cell in enumerate(cells.tolist()):
        here = old.met.cell == k
        first = np.where(here, np.uint32(cell * int(region["surfaces"])), np.uint32(0))
        new = new._replace(surface=new.surface + first)
        if "color" in facts:
            new = painted(new, looks[cell], here, facts)
    if "color" in facts:
        for face in faces.tolist():
            look = looks[int(region["cells"]) + face]
            new = painted(new, look, shows_surface(old.met, face), facts)
    if "normal" in facts:
        slope = old.slope
        for number in planes.tolist():
            plane = regions.flat[region["flat_start"] + number]
            normal = outward(plane_normal(plane), old.met)
            slope = either(shows_surface(old.met, number), normal, slope)
        x = (i - solid["center_x"]).astype(np.float32)
        y = (j - solid["center_y"]).astype(np.float32)
        u = old.position.astype(np.float32) * solid["last_step"]
        for number in quadrics.tolist():
            quadric = regions.curved[region["curved_start"] + (number - region["planes"])]
            bent = outward(gradient(quadric["gradient"], x, y, u), old.met)
            slope = either(shows_surface(old.met, number), bent, slope)
        for one in higher_surfaces(region, solid, regions):
            right = (i - one.higher["center_x"]).astype(np.float32) * one.form["scale"]
            down = (j - one.higher["center_y"]).astype(np.float32) * one.form["scale"]
            v = u - one.form["middle"]
            slopes = slopes_on_rays(one.form["terms"], right, down, v)
            bent = outward(world_slope(one.form, right, down, v, slopes), old.met)
            slope = either(shows_surface(old.met, one.number), bent, slope)
        new = new._replace(slope=slope)
    own = (old.met.side >> np.int32(1)).astype(np.uint32)
    return new._replace(surface=new.surface + own)
