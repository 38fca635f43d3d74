"""Twin of ``beam_fixed.wgsl``: forms of occluders along rays to a light, in integers.

A radius is 2^28. Rays that may meet an occluder stay within two radii, those to lamps within three.
Rays to lamps have a scale of their own, which changes no sign, because their forms are homogeneous.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.layout import Shade
from halfstep.twin.forms_fixed import excess_bits, shifted
from halfstep.twin.lanes import I32, I64
from halfstep.twin.place import Beam, Point
from halfstep.twin.rays import Ray

# Bits of a position on a ray: more halvings give no better position on the grid.
PLACE_BITS = 20
RADIUS_BITS = 28
RADIUS = np.int32(1 << RADIUS_BITS)
# An occluder lies behind -1 1/8 radii.
BEFORE = np.int64(-9 << (RADIUS_BITS - 3))
# The least slope of a half-space.
LEAST_SLOPE = np.int32(1)
_MOST = np.int64(2 << RADIUS_BITS)


def in_radii(wide: I64) -> I32:
    """A product in radii, rounded to nearest."""
    half = np.int64(1 << (RADIUS_BITS - 1))
    return ((wide + half) >> np.int64(RADIUS_BITS)).astype(np.int32)


def times(a: I32, b: I32) -> I32:
    """A product in radii."""
    return in_radii(a.astype(np.int64) * b.astype(np.int64))


def radii_of(units: I32, level: int) -> I64:
    """Units of the grid as radii of 2^level units."""
    wide = units.astype(np.int64) << np.int64(RADIUS_BITS)
    return (wide + np.int64((1 << level) >> 1)) >> np.int64(level)


def within(wide: I64, most: I64 | np.int64) -> I64:
    """The number, kept from -most to most."""
    return np.minimum(np.maximum(wide, -most), most)


def start_on(v: I64) -> I32:
    """The start of a ray, moved no further away than the occluder reaches."""
    return np.minimum(np.maximum(v, BEFORE), _MOST).astype(np.int32)


def far_ray(beam: Beam, occluder: np.void) -> Ray:
    """The ray from a point, counted from the occluder's middle, to a far light."""
    x, y, v = (radii_of(part, int(occluder["level"])) for part in beam)
    near = (np.abs(x) <= _MOST) & (np.abs(y) <= _MOST) & (v <= RADIUS)
    radius = np.full(x.shape, RADIUS)
    return Ray(
        within(x, _MOST).astype(np.int32),
        within(y, _MOST).astype(np.int32),
        radius,
        radius,
        start_on(v),
        -radius,
        -radius,
        np.full_like(radius, occluder["end"]),
        near,
    )


def light_ray(beam: Beam, occluder: np.void) -> Ray:
    """The ray to any light. Points are counted from a lamp that is near."""
    at_lamp = bool(int(occluder["flags"]) & Shade.AT_LAMP)
    x, y, v = (radii_of(part, int(occluder["level"])) for part in beam)
    shift = int(occluder["factor_shift"])
    ahead = np.int64(occluder["reach"]) - beam.v.astype(np.int64)
    half = np.int64((1 << shift) >> 1)
    h = (ahead * np.int64(occluder["factor"]) + half) >> np.int64(shift)
    is_far = not at_lamp and occluder["reach"] == 0
    if is_far:
        h = np.full_like(h, 1 << RADIUS_BITS)
    across = np.maximum(np.abs(x), np.abs(y))
    radius = np.full(x.shape, RADIUS)
    size = np.maximum(across, np.abs(v)) if at_lamp else np.maximum(h, np.int64(1))
    # Sheared, a box is two radii wide, and looks at most 4/3 as wide from a lamp four radii away.
    most = size + size if at_lamp or is_far else (size + size) + size
    excess = np.zeros(x.shape, np.uint32) if is_far else excess_bits(most)
    z = shifted(within(v if at_lamp else h, most), excess)
    x, y = within(x, most), within(y, most)
    if at_lamp:
        return Ray(
            shifted(x, excess),
            shifted(y, excess),
            z,
            radius,
            -radius,
            -(radius >> excess.astype(np.int32)),
            np.zeros_like(radius),
            radius,
            np.ones(z.shape, bool),
        )
    near = (h > 0) & (v <= RADIUS) & (across <= most)
    end = np.full(z.shape, occluder["end"])
    return Ray(
        shifted(x, excess), shifted(y, excess), z, z, start_on(v), -radius, -radius, end, near
    )


def second_order(k: I32, ray: Ray, z: I32, t: I32) -> I32:
    """t (k0 z + k1 x + k2 y) + k3 x² + k4 x y + k5 y²"""
    x, y, k = ray.x.astype(np.int64), ray.y.astype(np.int64), k.astype(np.int64)
    first = in_radii(z.astype(np.int64) * k[0] + (x * k[1] + y * k[2]))
    of_x, of_y = in_radii(x * k[3] + y * k[4]), in_radii(y * k[5])
    wide = x * of_x.astype(np.int64) + y * of_y.astype(np.int64)
    return in_radii(t.astype(np.int64) * first.astype(np.int64) + wide)


def first_order(k: I32, ray: Ray, t: I32) -> I32:
    """k0 t + k1 x + k2 y"""
    x, y, k = ray.x.astype(np.int64), ray.y.astype(np.int64), k.astype(np.int64)
    return in_radii(t.astype(np.int64) * k[0] + (x * k[1] + y * k[2]))


def coordinate(anchor: int, level: I64, along: I64, u: I64, shift: int) -> I32:
    """One coordinate of a point: that of the anchor and that from there, times 2^shift."""
    bits = np.int64(PLACE_BITS)
    moved = (along * u + np.int64(1 << (PLACE_BITS - 1))) >> bits
    found = (level + moved + np.int64((1 << shift) >> 1)) >> np.int64(shift)
    return np.int32(anchor) + found.astype(np.int32)


def affine(one: int, by_x: int, by_y: int, x: I32, y: I32) -> I64:
    """An affine function of the pixel offset."""
    rows = np.int64(one) + np.asarray(y).astype(np.int64) * np.int64(by_y)
    return rows + x.astype(np.int64) * np.int64(by_x)


def point_at(location: np.void, x: I32, y: I32, position: I32) -> Point:
    """The point of a solid at a position on its ray."""
    steps, shift = int(location["steps"]), int(location["shift"])
    fewer, more = min(steps, PLACE_BITS), max(steps, PLACE_BITS) - PLACE_BITS
    u = (position.astype(np.int64) << np.int64(PLACE_BITS - fewer)) >> np.int64(more)
    found = []
    for axis in range(3):
        level, along = (
            affine(int(k[axis]), int(k[axis + 3]), int(k[axis + 6]), x, y)
            for k in (location["level"], location["along"])
        )
        found.append(coordinate(int(location["anchor"][axis]), level, along, u, shift))
    return Point(*found)
