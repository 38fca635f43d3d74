"""What the shader of a frame must hold, from the frame's records."""

from __future__ import annotations

from halfstep.contract.regions import PackedRegions
from halfstep.host.excerpts import lists_of
from halfstep.host.pack import Packed
from halfstep.shader.needs import UNIFORM_BYTES, Needs


def needs_of(
    packed: Packed,
    regions: PackedRegions | None,
    method: str,
    outputs: frozenset[str],
    *,
    broadcast: int = 1,
    uniform: bool = False,
) -> Needs:
    """What the shader of a frame must hold.

    Args:
        packed: the frame.
        regions: what its tiles see of copies of groups.
        method: of the scene.
        outputs: of the device.
        broadcast: as in `Needs`.
        uniform: if its solids are few enough for it.
    """
    shadows, veils = packed.shadows, packed.veils
    before_lights = 0 if veils is None else veils.most_surfaces
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
        surfaces=0 if regions is None else _enough(max(regions.most_surfaces, before_lights)),
        levels=0 if regions is None else max(regions.levels, 0 if veils is None else veils.levels),
        hidden=regions is not None and regions.has_hidden,
        degree=0 if packed.polynomials is None else packed.polynomials.degree,
        shadows=0 if shadows is None else len(shadows.views),
        bounces=0 if packed.mirrors is None else packed.mirrors.bounces,
        far_lights=0 if shadows is None else shadows.far_lights,
        curves=shadows is not None and shadows.curves,
        encloses=(shadows is not None and shadows.encloses)
        or (veils is not None and veils.encloses),
        many=shadows is not None and shadows.many,
        veils=veils is not None,
        parallel=packed.setup.view.parallel,
        programs=() if packed.expressions is None else packed.expressions.programs,
        numbers=0 if packed.expressions is None else packed.expressions.numbers,
        balls=any(
            each is not None and each.has_balls for each in (packed.polynomials, packed.expressions)
        ),
        short_keys=packed.key_bits < 32 and not outputs & {"key", "exit", "error"},
    )


def needs_of_frame(packed: Packed, method: str, outputs: frozenset[str]) -> Needs:
    """What the shader of a whole frame must hold; arguments are those of `needs_of`."""
    lists = lists_of(packed, 0, packed.setup.view.height, outputs)
    return needs_of(packed, lists.regions, method, outputs)


def _enough(count: int) -> int:
    """Room for so many: a power of two, so that scenes share shaders."""
    return max(4, 1 << (count - 1).bit_length())


def _fits_uniform(packed: Packed) -> bool:
    """Whether the scene's solids and half-spaces fit uniform memory, whatever the camera sees."""
    solids = packed.solid_count * packed.solids.itemsize
    half_spaces = (packed.surface_count - packed.solid_count) * packed.half_spaces.itemsize
    return max(solids, half_spaces) <= UNIFORM_BYTES
