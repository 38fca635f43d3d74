"""Halfstep: images of second-order surfaces and polyhedra by halving a step, on any Vulkan device.

A scene file describes solids, lights and a camera. Every ray runs from the camera's centre to the
far base plane. Exactly n halvings of a step locate the point where it meets a solid. The sign of
the surface's function decides each halving, so a ray and solid take no division and no square root.
The pipeline exists twice: as WGSL for any Vulkan device, and as a NumPy twin that needs no device
and gives the same bits.

    scene = halfstep.load("figure")
    frame = halfstep.render(scene, size=(1024, 768))
    frame.image                    # (768, 1024, 3) uint8, sRGB

`load` reads and validates a scene (`Scene`). A scene may also be built from its tables (`Camera`,
`Sphere`, `Cell` and so on). `render` renders one `Frame` of it. `Renderer` keeps the device,
shaders and buffers for many frames. `view` shows a scene live. Importing this package touches no
device, and loads names when they are first used.
"""

from typing import TYPE_CHECKING

from halfstep.lazy import lazily
from halfstep.version import __version__

if TYPE_CHECKING:
    from halfstep.errors import AdapterError, DeviceError, HalfstepError, SceneError, UsageError
    from halfstep.files import write
    from halfstep.frames.frame import Frame
    from halfstep.frames.renderer import Renderer, render
    from halfstep.frames.sequence import render_frames
    from halfstep.models import load
    from halfstep.scene import (
        Accuracy,
        Ambient,
        Animation,
        Bounds,
        Box,
        Camera,
        CameraKey,
        Cell,
        Cone,
        Cylinder,
        Ellipsoid,
        Group,
        HyperboloidOneSheet,
        HyperboloidTwoSheets,
        Image,
        Implicit,
        Lattice,
        Light,
        Material,
        Paraboloid,
        Part,
        Place,
        PlanePatch,
        Polyhedron,
        Quadric,
        Scene,
        SolidKey,
        Sphere,
        Surface,
        Torus,
        Volume,
    )
    from halfstep.viewer.show import view

__all__ = [
    "Accuracy",
    "AdapterError",
    "Ambient",
    "Animation",
    "Bounds",
    "Box",
    "Camera",
    "CameraKey",
    "Cell",
    "Cone",
    "Cylinder",
    "DeviceError",
    "Ellipsoid",
    "Frame",
    "Group",
    "HalfstepError",
    "HyperboloidOneSheet",
    "HyperboloidTwoSheets",
    "Image",
    "Implicit",
    "Lattice",
    "Light",
    "Material",
    "Paraboloid",
    "Part",
    "Place",
    "PlanePatch",
    "Polyhedron",
    "Quadric",
    "Renderer",
    "Scene",
    "SceneError",
    "SolidKey",
    "Sphere",
    "Surface",
    "Torus",
    "UsageError",
    "Volume",
    "__version__",
    "load",
    "render",
    "render_frames",
    "view",
    "write",
]

_HOME = {
    "Accuracy": "scene",
    "AdapterError": "errors",
    "Ambient": "scene",
    "Animation": "scene",
    "Bounds": "scene",
    "Box": "scene",
    "Camera": "scene",
    "CameraKey": "scene",
    "Cell": "scene",
    "Cone": "scene",
    "Cylinder": "scene",
    "DeviceError": "errors",
    "Ellipsoid": "scene",
    "Frame": "frames.frame",
    "Group": "scene",
    "HalfstepError": "errors",
    "HyperboloidOneSheet": "scene",
    "HyperboloidTwoSheets": "scene",
    "Image": "scene",
    "Implicit": "scene",
    "Lattice": "scene",
    "Light": "scene",
    "Material": "scene",
    "Paraboloid": "scene",
    "Part": "scene",
    "Place": "scene",
    "PlanePatch": "scene",
    "Polyhedron": "scene",
    "Quadric": "scene",
    "Renderer": "frames.renderer",
    "Scene": "scene",
    "SceneError": "errors",
    "SolidKey": "scene",
    "Sphere": "scene",
    "Surface": "scene",
    "Torus": "scene",
    "UsageError": "errors",
    "Volume": "scene",
    "load": "models",
    "render": "frames.renderer",
    "render_frames": "frames.sequence",
    "view": "viewer.show",
    "write": "files",
}

# Hidden from type checkers, which would otherwise accept every misspelt name.
if not TYPE_CHECKING:
    __getattr__ = lazily(__name__, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
