"""The stages of a frame: which files they are in, and what of them a frame needs.

A stage is a file in ``wgsl/``.  Its twin is a module of the same name in ``twin/``.  What shaders,
twin, check and tests know of the order and the choice of stages stands here.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

from halfstep.contract.classes import Class
from halfstep.contract.formats import Format
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES


class Kind(Enum):
    """What the functions of a stage work on."""

    VALUES = "values"  # numbers alone, in each number format
    NUMBERS = "numbers"  # numbers alone, the same in each number format
    BLOCK = "block"  # what an invocation holds of its block
    DEVICE = "device"  # memory of a device: there is no twin


@dataclass(frozen=True)
class Stage:
    """A stage: files that define the same names, of which a shader takes one."""

    kind: Kind
    file: str  # unless another is chosen
    others: tuple[str, ...] = ()


# In the order in which a shader may take code from them.
STAGES = (
    Stage(Kind.NUMBERS, "lanes"),
    Stage(Kind.VALUES, "arithmetic", ("arithmetic_fixed",)),
    Stage(Kind.VALUES, "polynomial", ("polynomial_exact",)),
    Stage(Kind.VALUES, "forms", ("forms_exact", "forms_fixed")),
    Stage(Kind.VALUES, "halve", ("halve_incremental", "halve_fixed")),
    Stage(Kind.NUMBERS, "layout"),
    Stage(Kind.NUMBERS, "place"),
    Stage(Kind.VALUES, "piece"),
    Stage(Kind.VALUES, "root"),
    Stage(Kind.VALUES, "patch"),
    Stage(Kind.VALUES, "beam", ("beam_fixed",)),
    Stage(Kind.VALUES, "shadow"),
    Stage(Kind.VALUES, "lines_fetched", ("lines",)),
    Stage(Kind.VALUES, "article"),
    Stage(Kind.NUMBERS, "nearest"),
    Stage(Kind.NUMBERS, "keys", ("keys_short",)),
    Stage(Kind.VALUES, "certify"),
    Stage(Kind.NUMBERS, "normal"),
    Stage(Kind.VALUES, "crossings"),
    Stage(Kind.NUMBERS, "walk"),
    Stage(Kind.VALUES, "certify_region"),
    Stage(Kind.VALUES, "solid"),
    Stage(Kind.VALUES, "certificate"),
    Stage(Kind.VALUES, "cross"),
    Stage(Kind.VALUES, "region"),
    Stage(Kind.NUMBERS, "veil"),
    Stage(Kind.NUMBERS, "taylor"),
    Stage(Kind.NUMBERS, "cells"),
    Stage(Kind.NUMBERS, "algebraic"),
    Stage(Kind.NUMBERS, "elementary"),
    Stage(Kind.NUMBERS, "jets"),
    Stage(Kind.NUMBERS, "sight"),
    Stage(Kind.NUMBERS, "mirror"),
    Stage(Kind.VALUES, "keep"),
    Stage(Kind.NUMBERS, "ray"),
    Stage(Kind.NUMBERS, "shade"),
    Stage(Kind.NUMBERS, "finish"),
    Stage(Kind.NUMBERS, "encode"),
    Stage(Kind.BLOCK, "block"),
    Stage(Kind.BLOCK, "levels", ("levels_deep",)),
    Stage(Kind.BLOCK, "crossed", ("crossed_few",)),
    Stage(Kind.BLOCK, "walks"),
    Stage(Kind.BLOCK, "finish_regions"),
    Stage(Kind.BLOCK, "conveyor", ("closed",)),
    Stage(Kind.BLOCK, "expression"),
    Stage(Kind.BLOCK, "hide"),
    Stage(Kind.BLOCK, "veils"),
    Stage(Kind.BLOCK, "shadows"),
    Stage(Kind.BLOCK, "bounce"),
    Stage(Kind.DEVICE, "pack"),
    Stage(Kind.DEVICE, "wide"),
    Stage(Kind.DEVICE, "store_words", ("store_words_wide",)),
    Stage(Kind.DEVICE, "store_bytes", ("store_bytes_two", "store_bytes_four")),
    Stage(Kind.DEVICE, "near_key", ("near_key_short",)),
    Stage(Kind.DEVICE, "render"),
)


@dataclass(frozen=True)
class Visit:
    """How a solid of a class is tried on a block: a stage, and what holds of the class."""

    file: str
    facts: frozenset[str]


def _visit(file: str, *facts: str) -> Visit:
    return Visit(file, frozenset(facts))


# By method and class. In a shader a visit has the name of its class.
VISITS = {
    ("visible", Class.ELLIPSOID): _visit("visit_ellipsoid"),
    ("visible", Class.QUADRIC): _visit("visit_cut", "curved"),
    ("visible", Class.QUADRIC_INSIDE): _visit("visit_cut", "curved", "opened", "leaving"),
    ("visible", Class.POLYHEDRON): _visit("visit_cut", "flat"),
    ("visible", Class.POLYHEDRON_INSIDE): _visit("visit_cut", "flat", "opened", "leaving"),
    ("visible", Class.PATCH): _visit("visit_patch"),
    ("visible", Class.POLYNOMIAL): _visit("visit_polynomial"),
    ("visible", Class.FORMULA): _visit("visit_polynomial", "formula"),
    ("article", Class.QUADRIC): _visit("visit_article", "curved"),
    ("article", Class.POLYHEDRON): _visit("visit_article", "flat"),
    ("article", Class.PATCH): _visit("visit_article", "patch"),
    **{
        (method, klass): _visit("visit_region", *facts)
        for method in ("visible", "article")
        for klass, facts in ((Class.REGION, ()), (Class.REGION_INSIDE, ("opened", "leaving")))
    },
}

# What the marks of WGSL files ask for. A twin asks the same.
FACTS = {
    "exit": "it is asked where a ray leaves the solid that it hit",
    "leaving": "the root where a ray leaves a solid is needed, for that or to be seen from inside",
    "normal": "normals are needed, for themselves or for colours",
    "color": "colours are needed, for themselves or for an image",
    "position": "it is asked where on its ray a point is, for shadows or normals of regions",
    "gloss": "colours are needed, and a material shines",
    "point_lights": "colours are needed, and a light has a place",
    "parallel": "colours are needed, and rays are parallel",
    "error": "it is asked how far a depth may be off",
    "overlap": "it is asked where two cells of a copy overlap, and there are copies",
    "gap": "the same of gaps between cells",
    "claims": "one of the two is asked",
    "hidden": "programs have cells that are not shown",
    "curved": "the solid has a quadric",
    "flat": "the solid is a polyhedron",
    "patch": "the solid is a bounded plane",
    "ball": "a ball bounds a solid that has a polynomial or a formula",
    "formula": "the solid has a formula that is no polynomial",
    "regions": "tiles may see a copy of a group of cells",
    "opened": "rays may start inside the solid",
    "surfaces_5": "a tile may see five surfaces of a copy or more",
    **{f"levels_{k}": f"programs open {k} levels at once or more" for k in range(2, 7)},
    "broadcast": "invocations of a subgroup fetch records together",
    "places": "the places of points are needed, for shadows or mirrors",
    "mirrors": "colours are needed, and a material reflects",
    "shadows": "lights have shadows, and these are needed, for themselves or for colours",
    "lamps": "the same, and some of these lights have a place",
    "curves": "a solid before a light with shadows has a quadric",
    "encloses": "a light with shadows may be inside a solid",
    "veils": "the same, and a copy of a group of cells may hide these lights",
    "many_shadows": "solids before a light are many, and invocations look at boxes together",
    **{f"list_{klass.name.lower()}": f"tiles may see a solid of {klass.name}" for klass in Class},
    "store_words": "the device writes outputs of words",
    **{
        f"store_{name}": f"the device writes the output {name}"
        for name in (*DEVICE_OUTPUTS, *OUTPUT_BYTES)
    },
}


def files_of(number_format: Format, chosen: Collection[str] = ()) -> list[str]:
    """The files of the stages but for visits, in order: those of the format and the chosen."""
    wanted = {*number_format.stages, *chosen}
    return [
        next((name for name in (stage.file, *stage.others) if name in wanted), stage.file)
        for stage in STAGES
    ]
