"""`Needs`: everything that the shaders of a frame depend on."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from functools import cached_property

from halfstep.contract.classes import REGIONS, STRETCHED, Class
from halfstep.contract.expressions import Program
from halfstep.contract.formats import Format
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.contract.program import Known
from halfstep.contract.shadows import GROUP

# If a scene has at most this many surfaces, a surface number fits a byte, the tag.
MOST_TAGS = 255
# Bytes of a uniform binding. WebGPU requires every device to allow this size.
UNIFORM_BYTES = 1 << 16
# Above this degree, the code for a polynomial is too long to repeat for each quad.
MOST_DEGREE_OF_BLOCKS = 4
# Above this, shading takes far longer than fetching. Blocks of one quad then leave more of the
# rounds that a driver grants an invocation.
MOST_LIGHT_ROUNDS = 1 << 12


# The most levels of programs for which shaders use separate variables.
FEW_LEVELS = 6
# The most surfaces of regions for whose crossings shaders use separate variables.
FEW_SURFACES = 8


# What is shown of solids of these classes, or of copies of groups, is no quadric of a solid.
_FLAT_CLASSES = REGIONS | {Class.POLYHEDRON, Class.POLYHEDRON_INSIDE, Class.PATCH}


@dataclass(frozen=True)
class Needs:
    """Everything that a shader's text depends on. Equal needs share one compiled pipeline."""

    classes: tuple[Class, ...]
    outputs: frozenset[str]  # of DEVICE_OUTPUTS and OUTPUT_BYTES
    method: str  # "visible" or "article"
    format: Format
    lights: int
    point_lights: bool
    shininess_bits: int  # bits of the largest exponent of a highlight; 0 if nothing shines
    short_keys: bool  # depth keys fit one word
    # How many invocations of a subgroup share a load: each loads some words as 64-bit integers and
    # broadcasts them. A software adapter loads for one invocation after another, and all
    # invocations of a tile need the same record.
    broadcast: int = 1
    # Solids and half-spaces are in uniform memory, because they are few enough. A software adapter
    # has less of it, but loads from it in a third of the time. Needs broadcast above 1.
    uniform: bool = False
    surfaces: int = 0  # the most surfaces of a region, or a little more
    levels: int = 0  # the most levels that a region's program opens at once
    known: Known | None = None  # the program that a shader of the class REGION_KNOWN knows
    crowded: bool = False  # there are so many copies that it pays to look at several at once
    # Tiles see so many copies of the known program that each invocation tries copies of its own.
    dense: bool = False
    hidden: bool = False  # programs have cells that are not shown
    degree: int = 0  # the highest degree of a polynomial in the scene
    pairs: int = 0  # the most pairs of ends of a surface of a region of an order above two
    higher_polynomials: bool = False  # one of these is a polynomial
    higher_formulas: bool = False  # one of these is another formula
    programs: tuple[Program, ...] = ()  # the scene's formulas that are not polynomials
    numbers: int = 0  # the constants that a formula's record has room for
    balls: bool = False  # a bounding ball cuts a solid with a polynomial or a formula
    planes: bool = False  # half-spaces may cut a solid with a polynomial or a formula
    conveyor: str = "conveyor"  # the stage that locates roots
    parallel: bool = False  # the camera's rays are parallel
    shadows: int = 0  # number of lights with shadows
    bounces: int = 0  # the most reflections of a ray; 0 if nothing reflects
    far_lights: int = 0  # how many of the lights with shadows are far away
    curves: bool = False  # an occluder has a quadric
    encloses: bool = False  # a light may be inside an occluder
    flush: bool = False  # solids share surfaces that a light reaches or that mirror
    body_polynomials: bool = False  # a body has a polynomial
    body_formulas: bool = False  # a body has a formula that is not a polynomial
    body_cells: bool = False  # a body is a copy of a group of cells
    body_pairs: int = 0  # the most pairs of ends of a surface of such a copy of an order above two
    cast_polynomials: bool = False  # an occluder has a polynomial
    cast_formulas: bool = False  # an occluder has a formula that is not a polynomial
    many: bool = False  # a light has so many occluders that groups of boxes pay
    veils: bool = False  # a copy of a group of cells may hide a light
    veil_pairs: int = 0  # the most pairs of ends of a surface of such a copy of an order above two
    # Loop rounds after which no more veils, and no cells in mirrors, are tried; 0: all are tried.
    counted_rounds: int = 0
    judges: bool = False  # the shader asks integers about listed quads, and draws nothing
    continued: bool = False  # the frame buffer has what other veils hide
    quick: bool = False  # blocks have one quad, so that the shader compiles in half the time

    @cached_property
    def facts(self) -> frozenset[str]:
        """The facts of `FACTS` that hold for the frame; visits add those of a class of solids."""
        wanted = {f"store_{name}" for name in self.outputs}
        wanted |= {f"list_{klass.name.lower()}" for klass in self.classes}
        in_words = self.outputs & DEVICE_OUTPUTS.keys()
        wanted |= {"store_words"} if in_words else set()
        wanted = wanted.union(*(DEVICE_OUTPUTS[name].facts for name in in_words))
        wanted |= {"error"} if self.judges else set()
        wanted |= {"normal", "color"} if "image" in self.outputs else set()
        if self.surfaces:
            asked = self.outputs & {"overlap", "gap"}
            wanted |= {*asked, "claims"} if asked else set()
        if "normal" in wanted:
            wanted |= {"parallel"} if self.parallel else set()
        if "color" in wanted:
            wanted |= {"gloss"} if self.shininess_bits else set()
            wanted |= {"point_lights"} if self.point_lights else set()
        if self.shadows and self.outputs & {"image", "color", "shadow"}:
            wanted |= self._facts_of_shadows
        if self.bounces and self.outputs & {"image", "color"}:
            wanted.add("mirrors")
            casters = {"placed", "body_casters"}
            wanted |= {*casters, "body_polynomials"} if self.body_polynomials else set()
            wanted |= {*casters, "body_formulas"} if self.body_formulas else set()
            wanted |= {"placed", "body_cells"} if self.body_cells else set()
            wanted |= {"body_casters", "body_higher"} if self.body_pairs else set()
        if wanted & {"shadows", "mirrors"}:
            wanted |= {"places", "flush"} if self.flush else {"places"}
        # Shaders for tiles that see no mirror tell that they finish.
        wanted |= {"counted"} if self.counted_rounds else set()
        if self.broadcast > 1:
            wanted.add("broadcast")
        if self.has_regions:
            wanted |= {"regions", "hidden"} if self.hidden else {"regions"}
            wanted |= {"higher"} if self.pairs else set()
            wanted |= {"higher_polynomial"} if self.higher_polynomials else set()
            wanted |= {"higher_formula"} if self.higher_formulas else set()
            wanted |= {"surfaces_5"} if self.surfaces > 4 else set()
            wanted |= {f"levels_{k}" for k in range(2, min(self.levels, FEW_LEVELS) + 1)}
        if "places" in wanted or wanted >= {"regions", "normal"}:
            wanted.add("position")
        if self.broadcast > 1 and self.dense and self.classes == (Class.REGION_KNOWN,):
            wanted |= {"apart"} if "places" not in wanted else set()
        wanted |= {"ball"} if self.balls else set()
        wanted |= {"planes"} if self.planes else set()
        if not STRETCHED.isdisjoint(self.classes):
            wanted.add("stretches")
        return frozenset(wanted)

    @property
    def _facts_of_shadows(self) -> set[str]:
        """The facts about lights with shadows, where these are needed."""
        wanted = {"shadows"}
        wanted |= {"lamps"} if self.far_lights < self.shadows else set()
        wanted |= {"encloses"} if self.encloses else set()
        wanted |= {"curves"} if self.curves else set()
        wanted |= {"round"} if self.curves and self._shows_quadrics else set()
        wanted |= {"casters", "cast_polynomials"} if self.cast_polynomials else set()
        wanted |= {"casters", "cast_formulas"} if self.cast_formulas else set()
        wanted |= {"veils"} if self.veils else set()
        wanted |= {"veil_higher"} if self.veil_pairs else set()
        if "error" in self.outputs and wanted & {"casters", "veil_higher"}:
            wanted.add("shadow_doubts")
        wanted |= {"continued"} if self.continued else set()
        wanted |= {"many_shadows"} if self.many and self.broadcast >= GROUP else set()
        return wanted

    @property
    def _shows_quadrics(self) -> bool:
        """Whether a block may show the quadric of a solid, or the ball that bounds one."""
        return self.bounces > 0 or not _FLAT_CLASSES.issuperset(self.classes)

    @property
    def has_regions(self) -> bool:
        """Whether the shader tries copies of groups: solids to see, veils of lights, or bodies."""
        colored = not self.outputs.isdisjoint(("image", "color"))
        is_lit = self.veils and (colored or "shadow" in self.outputs)
        is_mirrored = self.body_cells and bool(self.bounces) and colored
        return not REGIONS.isdisjoint(self.classes) or is_lit or is_mirrored

    @property
    def has_polynomials(self) -> bool:
        """Whether the shader reads records of polynomials."""
        return Class.POLYNOMIAL in self.classes or "higher_polynomial" in self.facts

    @property
    def has_formulas(self) -> bool:
        """Whether the shader reads records of formulas that are not polynomials."""
        return Class.FORMULA in self.classes or "higher_formula" in self.facts

    @property
    def choices(self) -> frozenset[str]:
        """The stage files that replace a stage's default file."""
        chosen = {self.conveyor}
        if self.short_keys:
            chosen |= {"keys_short", "near_key_short"}
        if self.judges:
            chosen.add("recheck")
        if self.broadcast > 1:
            chosen.add("store_words_wide")
            chosen |= {"search_together"} if self.crowded else set()
        if self.surfaces <= FEW_SURFACES and "error" not in self.outputs:
            chosen.add("crossed_few")
        if self.levels > FEW_LEVELS:
            chosen.add("levels_deep")
        if self.stored > 1:
            chosen.add({2: "store_bytes_two", 4: "store_bytes_four"}[self.stored])
        return frozenset(chosen)

    @cached_property
    def quads(self) -> int:
        """Quads of a block. They share a fetched record, but more quads compile longer.

        Four quads pay only in a shader for one class, on devices where fetching costs most.
        """
        shades_long = self.light_rounds > MOST_LIGHT_ROUNDS
        is_long = self.method == "article" or "error" in self.outputs or self.has_regions
        walks = Class.POLYNOMIAL in self.classes
        is_long |= (walks and self.degree > MOST_DEGREE_OF_BLOCKS) or self.judges
        is_long |= Class.FORMULA in self.classes
        is_long |= not self.facts.isdisjoint({"casters", "body_casters"})
        if is_long or shades_long or self.quick:
            return 1
        is_alone = len(self.classes) <= 1 and not walks
        return 4 if self.broadcast > 1 and is_alone else 2

    @cached_property
    def light_rounds(self) -> int:
        """The most loop rounds that shading a quad takes."""
        shaded = not self.outputs.isdisjoint(("image", "color"))
        return (self.lights + 1) * (self.shininess_bits + 2) if shaded else 0

    @property
    def stored(self) -> int:
        """The 32-bit words of an output of bytes that are stored at once."""
        return self.quads if self.broadcast > 1 else 1


@functools.cache
def plane_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """The first plane of each output of words; ``"total"`` gives the number of planes."""
    return _offsets({name: one.words for name, one in DEVICE_OUTPUTS.items()}, outputs)


@functools.cache
def byte_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """The first byte of a pixel for each output of bytes; ``"total"`` gives the bytes of all."""
    return _offsets(OUTPUT_BYTES, outputs)


def _offsets(sizes: dict[str, int], outputs: frozenset[str]) -> dict[str, int]:
    offsets, end = {}, 0
    for name, size in sizes.items():
        if name in outputs:
            offsets[name] = end
            end += size
    return offsets | {"total": end}
