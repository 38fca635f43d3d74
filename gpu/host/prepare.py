"""The way from a scene to the records of a frame, for every program of this project.

`Solids` are computed once for all cameras. For each frame, `frame_setup` computes the view, its
base planes, and the constants of the visible solids. `prepare` adds their numbers of halvings and
makes the records that shaders and twin read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from halfstep.contract.arrays import Floats
from halfstep.host import camera, geometry, regions
from halfstep.host.geometry import Geometry
from halfstep.host.light import Lit
from halfstep.host.pack import Packed, Surfaces, pack, surfaces
from halfstep.host.setup import Setup, setup
from halfstep.host.steps import steps_for
from halfstep.scene import Fragment, Scene

# The fields of a scene that its solids and cells depend on.
_SHARED = ("solids", "materials", "volume", "lights", *Fragment.model_fields)


@dataclass(frozen=True)
class Solids:
    """The data that all frames of a scene share, for any camera."""

    geometry: Geometry
    volume: tuple[Floats, Floats]  # corners (min, max) of the modelled volume, world, (3,) each
    surfaces: Surfaces
    lit: Lit | None  # shadows and mirrors, if there are any

    @staticmethod
    def are_shared(scene: Scene, other: Scene) -> bool:
        """Whether two scenes have the same solids, cells, lights and volume."""
        images = (scene.image, other.image)
        if len({(image.bounces, image.color_by) for image in images}) > 1:
            return False
        return all(getattr(scene, key) == getattr(other, key) for key in _SHARED)

    @classmethod
    def of(cls, scene: Scene, *, hidden: bool = False) -> Self:
        """The solids of ``scene``; with ``hidden`` also the cells that are not shown.

        Raises:
            SceneError: all solids are unbounded and the scene gives no volume; a cell is empty; a
                limit is exceeded; a solid is unbounded, and there are shadows or mirrors.
        """
        built = geometry.build(scene)
        groups = regions.regions_of(scene, hidden=hidden)
        if groups is not None:
            built = geometry.with_regions(built, groups)
        lit = Lit.of(scene, built)
        return cls(built, geometry.volume_box(scene, built), surfaces(scene, built), lit)


def frame_setup(scene: Scene, samples: int = 1, *, solids: Solids | None = None) -> Setup:
    """Constants of the visible solids of a frame; arguments are those of `prepare`."""
    known = Solids.of(scene) if solids is None else solids
    size = scene.image.width * samples, scene.image.height * samples
    view = camera.view(scene.camera, size)
    return setup(known.geometry, view, *camera.base_planes(view, *known.volume))


def prepare(
    scene: Scene,
    samples: int = 1,
    *,
    solids: Solids | None = None,
    most_steps: int | None = None,
) -> Packed:
    """Records of a frame of ``scene``.

    Args:
        scene: the scene with its camera, size and accuracy.
        samples: k, for k x k pixels of the frame in each pixel of the picture.
        solids: the solids of ``scene``, if they are known.
        most_steps: no tolerance gets more halvings; None leaves it to the number format.

    Raises:
        SceneError: as from `Solids.of`.
    """
    known = Solids.of(scene) if solids is None else solids
    constants = frame_setup(scene, samples, solids=known)
    steps = steps_for(scene, constants, samples, most_steps, lit=known.lit is not None)
    return pack(scene, known.geometry, known.surfaces, constants, steps, known.lit)
