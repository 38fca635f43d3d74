"""Twin of ``shade.wgsl``: Lambert with a Blinn–Phong highlight, linear light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, U32
from halfstep.twin.normal import Vector, dot_product, normalized, or_else, scaled

# Light and cosines below this count as 0. A sum above it has the same bits with and without its
# subnormal terms, which devices may flush to 0.
FAINT = np.float32(1e-18)
# Bits of the largest exponent, 1024.
SHININESS_BITS = 11


class Light(NamedTuple):
    """A light of the frame."""

    vector: F32  # (4,), direction towards it (w = 0) or w times its position from the eye
    color: F32  # (4,), linear RGB
    has_shadow: bool = False  # lights with shadows come first


class Finish(NamedTuple):
    """The material of every pixel."""

    color: Vector
    specular: F32
    shininess: U32


def power(base: F32, exponent: U32) -> F32:
    """base^exponent for a base in [0, 1] by squaring, so that every device gives the same bits."""
    result = np.ones(base.shape, np.float32)
    square = np.maximum(base, FAINT)
    for bit in range(SHININESS_BITS):
        taken = (exponent >> np.uint32(bit)) & np.uint32(1)
        result = np.where(taken == 1, np.maximum(result * square, FAINT), result)
        square = np.maximum(square * square, FAINT)
    return result


def seen(light: F32) -> F32:
    """``light``, or 0 where it is faint. In an image both are black."""
    return np.where(light > FAINT, light, np.float32(0))


def shade(
    normal: Vector,
    direction: Vector,
    point: Vector,
    finish: Finish,
    dark: U32,
    ambient: F32,
    lights: Sequence[Light],
) -> Vector:
    """Linear colour of a point, seen along a direction; both are relative to the eye.

    The normal is turned towards the eye, so that the inside of an opened solid is lit too.
    ``dark`` has a bit for each of the first lights, which have shadows; it is set if the light does
    not reach the point.
    """
    away = dot_product(normal, direction) > FAINT
    sign = np.where(away, np.float32(-1), np.float32(1))
    toward = scaled(normal, sign)
    forward = normalized(direction)
    zero = np.zeros(sign.shape, np.float32)
    diffuse = [zero + ambient[0], zero + ambient[1], zero + ambient[2]]
    glossy = [zero, zero, zero]
    point_lights = any((light.vector[3] > 0).any() for light in lights)
    highlights = (finish.specular > 0).any()
    for ix, light in enumerate(lights):
        to_light = Vector(*(zero + light.vector[axis] for axis in range(3)))
        if point_lights:
            components = zip(light.vector, point, strict=False)
            from_point = Vector(*(at - light.vector[3] * p for at, p in components))
            to_light = normalized(or_else(from_point, toward))
        lambert = np.maximum(dot_product(toward, to_light), np.float32(0))
        if light.has_shadow:
            lambert = np.where((dark >> np.uint32(ix)) & np.uint32(1), np.float32(0), lambert)
        for channel in range(3):
            diffuse[channel] = diffuse[channel] + light.color[channel] * lambert
        if highlights:
            between = Vector(*(a - b for a, b in zip(to_light, forward, strict=True)))
            halfway = normalized(or_else(between, toward))
            shine = power(
                np.minimum(np.maximum(dot_product(toward, halfway), np.float32(0)), np.float32(1)),
                finish.shininess,
            )
            gloss = np.where(lambert > FAINT, finish.specular * shine, np.float32(0))
            for channel in range(3):
                glossy[channel] = glossy[channel] + light.color[channel] * gloss
    return Vector(
        finish.color.x * diffuse[0] + glossy[0],
        finish.color.y * diffuse[1] + glossy[1],
        finish.color.z * diffuse[2] + glossy[2],
    )
