"""Twin of ``keep.wgsl``: the nearest visible point so far."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple, Protocol

import numpy as np

from halfstep.twin.certify import Certificate, confirms, least_key
from halfstep.twin.lanes import F32, I32, U32, Bools
from halfstep.twin.nearest import FAR, Key, depth_key, either_key, lesser_key
from halfstep.twin.normal import NO_VECTOR, Vector, either
from halfstep.twin.region import NOTHING_MET, either_met, position_before
from halfstep.twin.sight import Met, Sight
from halfstep.twin.solid import is_rechecked

# The key in the type of the chosen module of keys.
NearestKey = Any


class Keys(Protocol):
    """The comparison of depths."""

    NO_KEY: NearestKey

    def key_at(self, position: I32, solid: np.void) -> NearestKey:
        """The key of a position on a solid."""

    def is_nearer(
        self, key: NearestKey, surface: U32, other: NearestKey, other_surface: U32
    ) -> Bools:
        """Whether a point is nearer than another."""

    def either_nearest(self, some: Bools, chosen: NearestKey, other: NearestKey) -> NearestKey:
        """``chosen`` in some pixels, else ``other``."""


class Nearest(NamedTuple):
    """The nearest visible point so far; members that no fact asks for stay as in `nothing`.

    The surface and the appearance of a region's point are looked up at the end. Until then the
    point has the number of the region's first surface.
    """

    key: NearestKey  # its depth
    surface: U32  # number of the surface in the scene, from 1; 0 for no hit
    leaves: Key  # depth of the exit from the solid
    low: Key  # the least depth that a certain point may have
    doubt: Key  # the depth from which on nothing is certain
    vague: Key  # the same by solids that integers are asked about
    bound: F32  # bound of the distance of the root from the position, in u
    slope: Vector  # along the normal
    color: Vector  # of the material
    specular: F32  # weight of its highlight
    shininess: U32  # exponent of its highlight
    depth: F32  # along the view axis
    met: Met  # the point of a region; none if the solid is no region
    overlap: Key  # depth of a point in two cells of a region
    gap: Key  # depth of a point in no cell, between two cells
    position: I32  # position of the point on its ray
    turned: U32  # which side of the surface is seen, as `other_side` has it
    dark: U32  # bits of the lights that do not reach the point
    reflection: F32  # share of what a point of a region mirrors; 1 of what is no region


def nothing(keys: Keys) -> Nearest:
    """No point yet."""
    none, zero = np.zeros((), np.uint32), np.zeros((), np.float32)
    return Nearest(
        key=keys.NO_KEY,
        surface=none,
        leaves=FAR,
        low=FAR,
        doubt=FAR,
        vague=FAR,
        bound=zero,
        slope=NO_VECTOR,
        color=NO_VECTOR,
        specular=zero,
        shininess=none,
        depth=zero,
        met=NOTHING_MET,
        overlap=FAR,
        gap=FAR,
        position=np.zeros((), np.int32),
        turned=none,
        dark=none,
        reflection=np.ones((), np.float32),
    )


def keep(
    old: Nearest,
    solid: np.void,
    sight: Sight,
    slope: Vector,
    certificate: Certificate,
    met: Met,
    turned: U32,
    keys: Keys,
    facts: Collection[str],
) -> Nearest:
    """The nearer of a sight and the nearest point so far."""
    steps, shift = int(solid["steps"]), int(solid["key_shift"])
    key = keys.key_at(sight.position, solid)
    surface = solid["surface"] + sight.surface.astype(np.uint32)
    nearer = sight.hit & keys.is_nearer(key, surface, old.key, old.surface)
    new = old._replace(
        key=keys.either_nearest(nearer, key, old.key),
        surface=np.where(nearer, surface, old.surface),
    )
    start = Key(*(np.asarray(solid[name]) for name in ("key_high", "key_low")))
    if "exit" in facts:
        left_at = depth_key(sight.exit_position, steps, start, shift)
        leaves = either_key(sight.left, left_at, FAR)
        new = new._replace(leaves=either_key(nearer, leaves, old.leaves))
    if "error" in facts:
        confirmed = confirms(certificate, sight.hit, sight.surface)
        low = least_key(key, certificate.bound, steps, int(solid["spare"]), shift)
        asked = "recheck" in facts and is_rechecked(solid)
        if asked:
            new = new._replace(vague=lesser_key(~confirmed, start, old.vague))
        new = new._replace(
            low=lesser_key(confirmed & sight.hit, low, old.low),
            doubt=lesser_key(~confirmed & (not asked), start, old.doubt),
            bound=np.where(nearer, certificate.bound, old.bound),
        )
    if "normal" in facts:
        new = new._replace(slope=either(nearer, slope, old.slope))
    if "color" in facts:
        new = new._replace(color=either(nearer, Vector(*solid["color"]), old.color))
    if "gloss" in facts:
        new = new._replace(
            specular=np.where(nearer, solid["specular"], old.specular),
            shininess=np.where(nearer, solid["shininess"], old.shininess),
        )
    if "point_lights" in facts:
        u = sight.position.astype(np.float32) * solid["last_step"]
        depth = solid["depth_middle"] + u * solid["depth_half"]
        new = new._replace(depth=np.where(nearer, depth, old.depth))
    if "regions" in facts:
        new = new._replace(met=either_met(nearer, met, old.met))
    if "position" in facts:
        new = new._replace(position=np.where(nearer, sight.position, old.position))
    if "places" in facts:
        new = new._replace(turned=np.where(nearer, turned, old.turned))
    return new


def sooner_key(old: Key, q: I32, region: np.void, solid: np.void) -> Key:
    """The lesser of the old key and that of a grid point of a region, if it is on the ray."""
    steps, shift = int(solid["steps"]), int(solid["key_shift"])
    start = Key(*(np.asarray(solid[name]) for name in ("key_high", "key_low")))
    position = position_before(np.maximum(q, np.int32(1)), steps)
    key = depth_key(position, steps, start, shift)
    return lesser_key(q <= region["last"], key, old)
