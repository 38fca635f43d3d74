"""Scenes, valid by construction, from files or from Python.

`load` reads a scene from a file or by a bundled name, `Scene.from_dict` takes a mapping, and
`as_scene` chooses between the two. `Scene` takes tables. `with_overrides` makes a changed copy.
"""

from halfstep.scene.algebraic import Algebraic, HigherShape, TorusShape
from halfstep.scene.changes import CameraLike, Overrides, still, with_animation, with_overrides
from halfstep.scene.copies import Copies, Layout, Within
from halfstep.scene.functions import Function, Names
from halfstep.scene.groups import Cell, Fragment, Group, Place
from halfstep.scene.keys import Animation, CameraKey, SolidKey
from halfstep.scene.lattices import Lattice
from halfstep.scene.model import Scene
from halfstep.scene.reading import SceneLike, as_scene, bundled_scenes, json_schema, load
from halfstep.scene.solids import (
    PART_KINDS,
    SOLID_KINDS,
    Bounds,
    Box,
    Cone,
    Cylinder,
    Ellipsoid,
    HyperboloidOneSheet,
    HyperboloidTwoSheets,
    Implicit,
    Paraboloid,
    Part,
    PlanePatch,
    Polyhedron,
    Quadric,
    QuadricSolid,
    Solid,
    Sphere,
    Torus,
)
from halfstep.scene.surfaces import SURFACE_KINDS, Surface
from halfstep.scene.tables import Accuracy, Ambient, Camera, Image, Light, Material, Volume
from halfstep.scene.values import MAX_HALF_SPACES

__all__ = [
    "MAX_HALF_SPACES",
    "PART_KINDS",
    "SOLID_KINDS",
    "SURFACE_KINDS",
    "Accuracy",
    "Algebraic",
    "Ambient",
    "Animation",
    "Bounds",
    "Box",
    "Camera",
    "CameraKey",
    "CameraLike",
    "Cell",
    "Cone",
    "Copies",
    "Cylinder",
    "Ellipsoid",
    "Fragment",
    "Function",
    "Group",
    "HigherShape",
    "HyperboloidOneSheet",
    "HyperboloidTwoSheets",
    "Image",
    "Implicit",
    "Lattice",
    "Layout",
    "Light",
    "Material",
    "Names",
    "Overrides",
    "Paraboloid",
    "Part",
    "Place",
    "PlanePatch",
    "Polyhedron",
    "Quadric",
    "QuadricSolid",
    "Scene",
    "SceneLike",
    "Solid",
    "SolidKey",
    "Sphere",
    "Surface",
    "Torus",
    "TorusShape",
    "Volume",
    "Within",
    "as_scene",
    "bundled_scenes",
    "json_schema",
    "load",
    "still",
    "with_animation",
    "with_overrides",
]
