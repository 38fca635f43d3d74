"""The stages of a frame: their files, their order, and which of them a frame needs.

A stage is a file in ``wgsl/``. Its twin is a module of the same name in ``twin/``. Shaders, twin,
check and tests all read the order and the choice of stages from this module.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

from halfstep.contract.classes import SHORT, Class
from halfstep.contract.formats import FIXED32, Format
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES


class Kind(Enum):
    """The data that the functions of a stage work on."""

    VALUES = "values"  # only arguments, whose types depend on the number format
    NUMBERS = "numbers"  # only arguments, whose types are the same in each number format
    BLOCK = "block"  # the variables of an invocation for its block
    DEVICE = "device"  # memory of a device; such a stage has no twin


@dataclass(frozen=True)
class Stage:
    """A stage: files that define the same names. A shader takes one of them."""

    kind: Kind
    file: str  # the file to take unless one of ``others`` is chosen
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
    Stage(Kind.NUMBERS, "trace"),
    Stage(Kind.NUMBERS, "cast"),
    Stage(Kind.VALUES, "bernstein"),
    Stage(Kind.NUMBERS, "higher"),
    Stage(Kind.NUMBERS, "veil_higher"),
    Stage(Kind.NUMBERS, "elementary"),
    Stage(Kind.NUMBERS, "jets"),
    Stage(Kind.NUMBERS, "climb"),
    Stage(Kind.NUMBERS, "arcs"),
    Stage(Kind.NUMBERS, "grades"),
    Stage(Kind.NUMBERS, "sight"),
    Stage(Kind.NUMBERS, "mirror"),
    Stage(Kind.NUMBERS, "meet"),
    Stage(Kind.NUMBERS, "reflect"),
    Stage(Kind.VALUES, "keep"),
    Stage(Kind.NUMBERS, "verdict"),
    Stage(Kind.NUMBERS, "ray"),
    Stage(Kind.NUMBERS, "shade"),
    Stage(Kind.NUMBERS, "finish"),
    Stage(Kind.NUMBERS, "encode"),
    Stage(Kind.BLOCK, "block"),
    Stage(Kind.BLOCK, "levels", ("levels_deep",)),
    Stage(Kind.BLOCK, "crossed", ("crossed_few",)),
    Stage(Kind.BLOCK, "walks"),
    Stage(Kind.BLOCK, "cross_formula"),
    Stage(Kind.BLOCK, "cross_higher"),
    Stage(Kind.BLOCK, "finish_regions"),
    Stage(Kind.BLOCK, "conveyor", ("closed",)),
    Stage(Kind.BLOCK, "expression"),
    Stage(Kind.BLOCK, "cast_formula"),
    Stage(Kind.BLOCK, "meet_formula"),
    Stage(Kind.BLOCK, "flush"),
    Stage(Kind.BLOCK, "hide"),
    Stage(Kind.BLOCK, "veils"),
    Stage(Kind.BLOCK, "shadows"),
    Stage(Kind.BLOCK, "reflected"),
    Stage(Kind.BLOCK, "bounce"),
    Stage(Kind.DEVICE, "pack"),
    Stage(Kind.DEVICE, "wide"),
    Stage(Kind.DEVICE, "store_words", ("store_words_wide",)),
    Stage(Kind.DEVICE, "store_bytes", ("store_bytes_two", "store_bytes_four")),
    Stage(Kind.DEVICE, "near_key", ("near_key_short",)),
    Stage(Kind.DEVICE, "search", ("search_together",)),
    Stage(Kind.DEVICE, "search_apart"),
    Stage(Kind.DEVICE, "render", ("recheck",)),
)


@dataclass(frozen=True)
class Visit:
    """How to try a solid of a class on a block: a stage, and the facts that hold for the class."""

    file: str
    facts: frozenset[str]
    words: int = 0  # of a short program
    fixed: str = ""  # the stage in integers, if it is another

    @property
    def files(self) -> tuple[str, ...]:
        """The stages of all number formats."""
        return (self.file, self.fixed) if self.fixed else (self.file,)

    def file_in(self, number_format: Format) -> str:
        """The stage in a number format."""
        return self.fixed if self.fixed and number_format is FIXED32 else self.file


def _visit(file: str, *facts: str) -> Visit:
    return Visit(file, frozenset(facts))


# Visits by method and class. In a shader a visit is named after its class.
VISITS = {
    ("visible", Class.ELLIPSOID): _visit("visit_ellipsoid"),
    ("visible", Class.QUADRIC): _visit("visit_cut", "curved"),
    ("visible", Class.QUADRIC_INSIDE): _visit("visit_cut", "curved", "opened", "leaving"),
    ("visible", Class.POLYHEDRON): _visit("visit_cut", "flat"),
    ("visible", Class.POLYHEDRON_INSIDE): _visit("visit_cut", "flat", "opened", "leaving"),
    ("visible", Class.PATCH): _visit("visit_patch"),
    ("visible", Class.POLYNOMIAL): Visit(
        "visit_polynomial", frozenset(), fixed="visit_polynomial_fixed"
    ),
    ("visible", Class.FORMULA): _visit("visit_polynomial", "formula"),
    ("article", Class.QUADRIC): _visit("visit_article", "curved"),
    ("article", Class.POLYHEDRON): _visit("visit_article", "flat"),
    ("article", Class.PATCH): _visit("visit_article", "patch"),
    **{
        (method, klass): _visit("visit_region", *facts)
        for method in ("visible", "article")
        for klass, facts in ((Class.REGION, ()), (Class.REGION_INSIDE, ("opened", "leaving")))
    },
    **{
        (method, klass): Visit("visit_short", frozenset(), words)
        for method in ("visible", "article")
        for klass, words in SHORT.items()
    },
    **{
        (method, Class.REGION_KNOWN): _visit("visit_short", "known")
        for method in ("visible", "article")
    },
}

# The facts that marks in WGSL files and the twin ask for, with their meaning.
FACTS = {
    "exit": "the exit from the solid that a ray hit is requested",
    "leaving": "the root where a ray leaves a solid is needed, for the exit or a view from inside",
    "normal": "normals are needed, for themselves or for colours",
    "color": "colours are needed, for themselves or for an image",
    "position": "the position of a point on its ray is needed, for shadows or normals of regions",
    "gloss": "colours are needed, and a material has highlights",
    "point_lights": "colours are needed, and a light is a lamp",
    "parallel": "normals are needed, and the camera's rays are parallel",
    "error": "error bounds of depths are requested",
    "recheck": "error bounds are requested, and integers are asked where float32 is not certain",
    "overlap": "overlaps of cells in copies are requested, and there are copies",
    "gap": "gaps between cells of copies are requested, and there are copies",
    "claims": "overlaps or gaps are requested, and there are copies",
    "hidden": "programs have cells that are not shown",
    "curved": "the solid has a quadric",
    "flat": "the solid is a polyhedron",
    "patch": "the solid is a bounded plane",
    "ball": "a bounding ball cuts a solid that has a polynomial or a formula",
    "planes": "half-spaces may cut a solid that has a polynomial or a formula",
    "formula": "the solid has a formula that is not a polynomial",
    "stretches": "tiles may see a solid that has a polynomial or a formula",
    "regions": "tiles may see a copy of a group of cells",
    "apart": "each invocation tries copies of its own, because tiles see very many",
    "known": "the shader knows the program of the copy",
    "opened": "rays may start inside the solid",
    "higher": "a copy of a group has a surface of an order above two",
    "higher_polynomial": "such a surface is a polynomial",
    "higher_formula": "such a surface is a formula that is not a polynomial",
    "surfaces_5": "a tile may see five or more surfaces of a copy",
    **{f"levels_{k}": f"programs open {k} or more levels at once" for k in range(2, 7)},
    "broadcast": "invocations of a subgroup fetch records together",
    "places": "positions of points on the grid of the world are needed, for shadows or mirrors",
    "mirrors": "colours are needed, and a material reflects",
    "body_casters": "colours are needed, and mirrors may show a polynomial or a formula",
    "body_higher": "colours are needed, and mirrors may show cells of tori and polynomials",
    "body_polynomials": "colours are needed, and mirrors may show a solid with a polynomial",
    "body_formulas": "colours are needed, and mirrors may show another formula",
    "body_cells": "colours are needed, and mirrors may show cells",
    "placed": "mirrors may show what no conveyor finds: polynomials, formulas or cells",
    "shadows": "lights have shadows, which are needed, for themselves or for colours",
    "lamps": "shadows are needed, and some of their lights are lamps",
    "curves": "shadows are needed, and an occluder has a quadric",
    "round": "shadows are needed, and what is shown may be the quadric of a solid",
    "encloses": "shadows are needed, and a light may be inside an occluder",
    "flush": "shadows or mirrors are needed, and solids share surfaces, see `host.flush`",
    "casters": "shadows are needed, and an occluder has a polynomial or a formula",
    "cast_polynomials": "shadows are needed, and an occluder has a polynomial",
    "cast_formulas": "shadows are needed, and an occluder has a formula that is not a polynomial",
    "veils": "shadows are needed, and a copy of a group of cells may hide a light",
    "veil_higher": "shadows are needed, and such a copy has a surface of an order above two",
    "shadow_doubts": "error bounds are requested, and something of that order may hide a light",
    "counted": "veils are counted in rounds, because all may take more than are left for them",
    "continued": "veils were tried before, and what these hide is in the frame buffer",
    "many_shadows": "shadows are needed, a light has many occluders, and invocations share loads",
    **{f"list_{klass.name.lower()}": f"tiles may see a solid of {klass.name}" for klass in Class},
    "store_words": "the device writes outputs of words",
    **{
        f"store_{name}": f"the device writes the output {name}"
        for name in (*DEVICE_OUTPUTS, *OUTPUT_BYTES)
    },
}


def files_of(number_format: Format, chosen: Collection[str] = ()) -> list[str]:
    """The files of all stages except visits, in order.

    A stage takes the file that belongs to ``number_format`` or is in ``chosen``, else its default.
    """
    wanted = {*number_format.stages, *chosen}
    return [
        next((name for name in (stage.file, *stage.others) if name in wanted), stage.file)
        for stage in STAGES
    ]
