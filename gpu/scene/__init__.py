"""What a frame shows: scenes, valid by construction, from files or from Python.

A scene is built by `load` (a file or a bundled name) or `Scene.from_dict` (a mapping), of which
`as_scene` chooses; `with_overrides` makes a changed copy.
"""

from halfstep.scene.changes import CameraLike, Overrides, still, with_animation, with_overrides
from halfstep.scene.keys import Animation, CameraKey, SolidKey
from halfstep.scene.model import Scene
from halfstep.scene.reading import SceneLike, as_scene, bundled_scenes, json_schema, load
from halfstep.scene.solids import (
    SOLID_KINDS,
    Bounds,
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HyperboloidOneSheet,
    HyperboloidTwoSheets,
    Paraboloid,
    PlanePatch,
    Polyhedron,
    Quadric,
    QuadricSolid,
    Solid,
    Sphere,
)
from halfstep.scene.tables import Accuracy, Ambient, Camera, Image, Light, Material, Volume
from halfstep.scene.values import MAX_HALF_SPACES

__all__ = [
    "MAX_HALF_SPACES",
    "SOLID_KINDS",
    "Accuracy",
    "Ambient",
    "Animation",
    "Bounds",
    "Box",
    "Camera",
    "CameraKey",
    "CameraLike",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "HyperboloidOneSheet",
    "HyperboloidTwoSheets",
    "Image",
    "Light",
    "Material",
    "Overrides",
    "Paraboloid",
    "PlanePatch",
    "Polyhedron",
    "Quadric",
    "QuadricSolid",
    "Scene",
    "SceneLike",
    "Solid",
    "SolidKey",
    "Sphere",
    "Volume",
    "as_scene",
    "bundled_scenes",
    "json_schema",
    "load",
    "still",
    "with_animation",
    "with_overrides",
]
