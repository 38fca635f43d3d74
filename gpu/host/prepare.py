"""The way from a scene to the records of a frame; every program here takes it.

What solids are does not depend on the camera and is computed once (`Solids`). Of each frame come
the view and its base planes, the constants of the visible solids (`frame_setup`), their numbers of
halvings, and the records that shaders and twin read (`prepare`).
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

# What solids and cells are made of.
_SHARED = ("solids", "materials", "volume", "lights", *Fragment.model_fields)


@dataclass(frozen=True)
class Solids:
    """What the frames of a scene share, whatever the camera."""

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
        """The solids of ``scene``; with ``hidden``, cells that are not shown are among them.

        Raises:
            SceneError: nothing bounds what is seen and the scene gives no volume; a cell is empty;
                a limit is exceeded; a solid has no end, and there are shadows or mirrors.
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
        scene: what is seen, by its camera, at its size and accuracy.
        samples: k, for k x k pixels of the frame in each pixel of the picture.
        solids: those of ``scene``, where they are known.
        most_steps: no tolerance gets more halvings; None leaves it to the number format.

    Raises:
        SceneError: as of `Solids.of`.
    """
    known = Solids.of(scene) if solids is None else solids
    constants = frame_setup(scene, samples, solids=known)
    steps = steps_for(scene, constants, samples, most_steps, lit=known.lit is not None)
    return pack(scene, known.geometry, known.surfaces, constants, steps, known.lit)
