"""`needs_of` reads from a frame's records what the frame's shader must contain."""

from __future__ import annotations

import numpy as np

from halfstep.contract.classes import Class
from halfstep.host.excerpts import Lists, lists_of
from halfstep.host.pack import Packed
from halfstep.host.regions import MANY
from halfstep.shader.needs import UNIFORM_BYTES, Needs

# If tiles see as many copies as this, on average, each invocation tries copies of its own.
LEAST_DENSE = 32


def needs_of(
    packed: Packed,
    lists: Lists,
    method: str,
    outputs: frozenset[str],
    *,
    broadcast: int = 1,
    uniform: bool = False,
) -> Needs:
    """What the shader of a frame must contain.

    Args:
        packed: the frame's records.
        lists: what the tiles of the frame try.
        method: the scene's method.
        outputs: the device outputs.
        broadcast: see `Needs`.
        uniform: put solids and half-spaces in uniform memory if they fit.
    """
    shadows, veils, regions = packed.shadows, packed.veils, lists.regions
    copies = packed.setup.copies
    is_formula = np.empty(0)
    if regions is not None and regions.higher is not None:
        is_formula = regions.higher["is_formula"]
    casters = np.empty(0)
    if shadows is not None and shadows.casters is not None:
        casters = shadows.casters["formula"]
    bodies = np.empty(0)
    if packed.mirrors is not None and packed.mirrors.casters is not None:
        rows = packed.mirrors.bodies["caster"]
        bodies = packed.mirrors.casters["formula"][rows[rows > 0] - 1]
    algebraic = [each for each in (packed.polynomials, packed.expressions) if each is not None]
    reflected = None if packed.mirrors is None else packed.mirrors.reflected
    others = [each for each in (veils, reflected) if each is not None]
    most_surfaces = max(
        0 if veils is None else veils.most_crossings,
        0 if reflected is None else reflected.most_crossings,
    )
    levels = max((each.levels for each in others), default=0)
    return Needs(
        classes=packed.present,
        outputs=outputs,
        method=method,
        format=packed.format,
        lights=len(packed.lights),
        point_lights=bool((packed.lights["vector"][:, 3] > 0).any()),
        shininess_bits=packed.shininess_bits,
        broadcast=broadcast,
        uniform=uniform and _fits_uniform(packed),
        surfaces=0 if regions is None else _enough(max(regions.most_surfaces, most_surfaces)),
        levels=0 if regions is None else max(regions.levels, levels),
        hidden=(regions is not None and regions.has_hidden)
        or (veils is not None and veils.has_hidden),
        known=lists.known,
        crowded=copies is not None and copies.regions.count >= MANY,
        dense=_is_dense(lists),
        pairs=0 if regions is None else regions.pairs,
        higher_polynomials=bool((is_formula == 0).any()),
        higher_formulas=bool((is_formula == 1).any()),
        degree=max([each.degree for each in (packed.polynomials, *others) if each], default=0),
        shadows=0 if shadows is None else len(shadows.views),
        bounces=0 if packed.mirrors is None else packed.mirrors.bounces,
        far_lights=0 if shadows is None else shadows.far_lights,
        curves=shadows is not None and shadows.curves,
        body_polynomials=bool((bodies == 0).any()),
        body_formulas=bool((bodies > 0).any()),
        body_cells=reflected is not None,
        body_pairs=0 if reflected is None else reflected.pairs,
        cast_polynomials=bool((casters == 0).any()),
        cast_formulas=bool((casters > 0).any()),
        encloses=(shadows is not None and shadows.encloses)
        or (veils is not None and veils.encloses),
        flush=packed.shared is not None,
        many=shadows is not None and shadows.many,
        veils=veils is not None,
        veil_pairs=0 if veils is None else veils.pairs,
        parallel=packed.setup.view.parallel,
        programs=() if packed.expressions is None else packed.expressions.programs,
        numbers=0 if packed.expressions is None else packed.expressions.numbers,
        balls=any(each.has_balls for each in algebraic),
        planes=bool(algebraic) and packed.most_half_spaces > 0,
        short_keys=packed.key_bits < 32 and not outputs & {"key", "exit", "error"},
    )


def needs_of_frame(packed: Packed, method: str, outputs: frozenset[str]) -> Needs:
    """What the shader of a whole frame must contain; `needs_of` describes the arguments."""
    lists = lists_of(packed, 0, packed.setup.view.height, outputs)
    return needs_of(packed, lists, method, outputs)


def needs_of_judge(packed: Packed, *, broadcast: int = 1, uniform: bool = False) -> Needs:
    """What the shader that asks integers must contain (`run.recheck`); see `needs_of`.

    ``packed``: the records of `host.pack.in_integers`.
    """
    known = packed.polynomials
    assert known is not None
    return Needs(
        classes=(Class.POLYNOMIAL,),
        outputs=frozenset({"verdict"}),
        method="visible",
        format=packed.format,
        lights=0,
        point_lights=False,
        shininess_bits=0,
        short_keys=False,
        broadcast=broadcast,
        uniform=uniform and _fits_uniform(packed),
        degree=known.degree,
        balls=known.has_balls,
        planes=packed.most_half_spaces > 0,
        judges=True,
    )


def _is_dense(lists: Lists) -> bool:
    """Whether tiles that see the known program alone see very many copies."""
    if lists.known is None:
        return False
    counts = np.diff(lists.starts)[lists.classes.index(Class.REGION_KNOWN) :: len(lists.classes)]
    return bool(counts.sum() >= LEAST_DENSE * np.count_nonzero(counts) > 0)


def _enough(count: int) -> int:
    """Room for ``count`` surfaces: a power of two, so that scenes share shaders."""
    return max(4, 1 << (count - 1).bit_length())


def _fits_uniform(packed: Packed) -> bool:
    """Whether all solids and half-spaces of the scene, seen or not, fit uniform memory."""
    solids = packed.solid_count * packed.solids.itemsize
    half_spaces = (packed.surface_count - packed.solid_count) * packed.half_spaces.itemsize
    return max(solids, half_spaces) <= UNIFORM_BYTES
