"""Reads files of other programs as scenes: OpenMC, OpenSCAD and SURFER."""

from halfstep.models.look import Look
from halfstep.models.reading import as_scene, check, is_geometry, is_model, load

__all__ = ["Look", "as_scene", "check", "is_geometry", "is_model", "load"]
