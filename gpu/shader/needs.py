"""What the shaders of a frame depend on."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from functools import cached_property

from halfstep.contract.classes import Class
from halfstep.contract.expressions import Program
from halfstep.contract.formats import Format
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.contract.shadows import GROUP

# A tag is the number of a surface, where a scene has no more than this.
MOST_TAGS = 255
# Bytes of what is bound as uniform memory, where a device has so many: WebGPU asks for no less.
UNIFORM_BYTES = 1 << 16
# Above this, code for polynomials is too long to be there for each quad.
MOST_DEGREE_OF_BLOCKS = 4
# Above this, shading takes far longer than fetching, and blocks of one quad leave more rounds.
MOST_LIGHT_ROUNDS = 1 << 12


# Levels of programs that shaders have in variables of their own.
FEW_LEVELS = 6
# Surfaces of regions that have their crossings in variables of their own.
FEW_SURFACES = 8


@dataclass(frozen=True)
class Needs:
    """All that a shader's text depends on; equal needs share one compiled pipeline."""

    classes: tuple[Class, ...]
    outputs: frozenset[str]  # of DEVICE_OUTPUTS and OUTPUT_BYTES
    method: str  # "visible" or "article"
    format: Format
    lights: int
    point_lights: bool
    shininess_bits: int  # of the largest exponent of a highlight, 0 where nothing shines
    short_keys: bool  # depth keys fit a word
    # How many invocations of a subgroup share a load: each loads some words, as 64 bits,
    # and gives them to all.  A device that a processor plays does a load for one invocation after
    # another, and all invocations of a tile want the same record.
    broadcast: int = 1
    # Solids and half-spaces are few enough for uniform memory, of which such a device has less, but
    # where a load takes a third of the time; for records fetched together only.
    uniform: bool = False
    surfaces: int = 0  # the most of a region, or a little more
    levels: int = 0  # the most that a region's program opens at once
    hidden: bool = False  # programs have cells that are not shown
    degree: int = 0  # the highest of a polynomial of the scene
    programs: tuple[Program, ...] = ()  # formulas of the scene that are no polynomials
    numbers: int = 0  # that a record has room for
    balls: bool = False  # a ball bounds a solid with a polynomial or a formula
    conveyor: str = "conveyor"  # the stage that finds where roots are
    parallel: bool = False  # rays are
    shadows: int = 0  # lights that have them
    bounces: int = 0  # between mirrors, 0 where there are none
    far_lights: int = 0  # of these, such as have no place
    curves: bool = False  # a solid before these has a quadric
    encloses: bool = False  # a light may be inside a solid
    many: bool = False  # more than a few solids are before a light
    veils: bool = False  # a copy of a group of cells may be

    @cached_property
    def facts(self) -> frozenset[str]:
        """What the marks of WGSL files may ask for, but for what holds of a class of solids."""
        wanted = {f"store_{name}" for name in self.outputs}
        wanted |= {f"list_{klass.name.lower()}" for klass in self.classes}
        in_words = self.outputs & DEVICE_OUTPUTS.keys()
        wanted |= {"store_words"} if in_words else set()
        wanted = wanted.union(*(DEVICE_OUTPUTS[name].facts for name in in_words))
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
            wanted.add("shadows")
            wanted |= {"lamps"} if self.far_lights < self.shadows else set()
            wanted |= {"encloses"} if self.encloses else set()
            wanted |= {"curves"} if self.curves else set()
            wanted |= {"veils"} if self.veils else set()
            wanted |= {"many_shadows"} if self.many and self.broadcast >= GROUP else set()
        if self.bounces and self.outputs & {"image", "color"}:
            wanted.add("mirrors")
        if wanted & {"shadows", "mirrors"}:
            wanted.add("places")
        if self.broadcast > 1:
            wanted.add("broadcast")
        if self.has_regions:
            wanted |= {"regions", "hidden"} if self.hidden else {"regions"}
            wanted |= {"surfaces_5"} if self.surfaces > 4 else set()
            wanted |= {f"levels_{k}" for k in range(2, min(self.levels, FEW_LEVELS) + 1)}
        if "places" in wanted or wanted >= {"regions", "normal"}:
            wanted.add("position")
        if self.balls:
            wanted.add("ball")
        return frozenset(wanted)

    @property
    def has_regions(self) -> bool:
        """Whether it tries copies of groups, or asks what lights these hide."""
        tried = Class.REGION in self.classes or Class.REGION_INSIDE in self.classes
        shaded = not self.outputs.isdisjoint(("image", "color", "shadow"))
        return tried or (self.veils and shaded)

    @property
    def choices(self) -> frozenset[str]:
        """The files that stand for those that a shader takes else."""
        chosen = {self.conveyor}
        if self.short_keys:
            chosen |= {"keys_short", "near_key_short"}
        if self.broadcast > 1:
            chosen.add("store_words_wide")
        if self.surfaces <= FEW_SURFACES and "error" not in self.outputs:
            chosen.add("crossed_few")
        if self.levels > FEW_LEVELS:
            chosen.add("levels_deep")
        if self.stored > 1:
            chosen.add({2: "store_bytes_two", 4: "store_bytes_four"}[self.stored])
        return frozenset(chosen)

    @property
    def quads(self) -> int:
        """Quads of a block: more of them share what is fetched of a solid, and compile longer.

        That is worth while for the code of one class, on devices where a fetch costs most.
        """
        shades_long = self.light_rounds > MOST_LIGHT_ROUNDS
        is_long = self.method == "article" or "error" in self.outputs or self.has_regions
        walks = Class.POLYNOMIAL in self.classes
        is_long |= walks and self.degree > MOST_DEGREE_OF_BLOCKS
        is_long |= Class.FORMULA in self.classes
        if is_long or shades_long:
            return 1
        is_alone = len(self.classes) <= 1 and not walks
        return 4 if self.broadcast > 1 and is_alone else 2

    @property
    def light_rounds(self) -> int:
        """The most rounds of loops that shading a quad takes."""
        shaded = not self.outputs.isdisjoint(("image", "color"))
        return (self.lights + 1) * (self.shininess_bits + 2) if shaded else 0

    @property
    def stored(self) -> int:
        """Words of 32 bits that are stored at once of outputs of bytes."""
        return self.quads if self.broadcast > 1 else 1


@functools.cache
def plane_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """First plane of each output of words, and the number of planes under ``"total"``."""
    return _offsets({name: one.words for name, one in DEVICE_OUTPUTS.items()}, outputs)


@functools.cache
def byte_offsets(outputs: frozenset[str]) -> dict[str, int]:
    """Bytes a pixel has of outputs of bytes before each one, and of all under ``"total"``."""
    return _offsets(OUTPUT_BYTES, outputs)


def _offsets(sizes: dict[str, int], outputs: frozenset[str]) -> dict[str, int]:
    offsets, end = {}, 0
    for name, size in sizes.items():
        if name in outputs:
            offsets[name] = end
            end += size
    return offsets | {"total": end}
