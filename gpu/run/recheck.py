"""Pixels of which float32 is not certain are judged again, in integers.

Where F and its slope vanish together, float32 finds most roots of a polynomial without being able
to prove them: it resolves the sign of F only to about 2^-19 of its terms. The search in integers
(`twin.bernstein`) resolves some 2^34 times as much, with weights that the host computes in
decimals, except for tori (`host.precise`), but takes several times as long. So a frame with the
output `error` asks integers only about the solids with `Flag.RECHECKED`, and only at pixels where
float32 is not certain of them. These solids are kept apart in the plane ``vague``.

Nothing that a pixel shows changes, so pictures do not depend on this. A solid no longer makes a
pixel uncertain in three cases:

* It is what the pixel shows, and integers are certain of a root on the same surface. The error of
  the point is then at most its distance from the place of that root, and the bound of that place.
* It lies behind what the pixel shows, by integers that are certain of its root.
* Integers are certain that the ray misses it.

Where it is not certain whether a light reaches a point, the shadow itself makes the pixel
uncertain, and integers leave that so. Colours with tori, formulas or cells in mirrors ask no
integers: along creases float32 may not know which way the surface at a point faces, and counts on
the uncertainty of the point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import F32, I32, U32, U64, Array, Bools, Floats, Ints, Planes
from halfstep.contract.classes import Class
from halfstep.contract.formats import FIXED32
from halfstep.contract.keys import FAR_KEY
from halfstep.contract.layout import FRAME, LANES, TILE, TILE_WORDS, Flag
from halfstep.contract.stretches import rows_of
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.run.framebuffer import FrameBuffer
from halfstep.run.parts import MOST_WORKGROUPS
from halfstep.twin.certify import LARGEST_BOUND
from halfstep.twin.verdict import MEETS, UNSURE

# Invocations of a workgroup, each with one quad.
GROUP = TILE * TILE // LANES
# The outputs of a frame that are read besides ``error``.
READ = frozenset({"vague", "key"})
# Room for the rounding of a distance in float64.
ROOM = 1 + 2.0**-50


class Asked(NamedTuple):
    """Quads of pixels in groups of `GROUP`, each group with one solid."""

    row: Ints  # (G,), of the solid
    place: U32  # (S,), column among the quads of the band, and row times 2^16
    member: U32  # (S,), of the list of the quad's tile
    real: Bools  # (S,), others only fill up the groups


class Answers(NamedTuple):
    """What integers say of quads, (S, 4) each."""

    verdict: U32
    position: I32
    bound: F32


Judge = Callable[[Packed, Asked], Answers]


def is_possible(packed: Packed, outputs: frozenset[str]) -> bool:
    """Whether a frame with these outputs asks integers."""
    if "error" not in outputs or packed.format is FIXED32:
        return False
    # With tori, formulas or cells in mirrors, `error` tells of these, too: float32 decides on them.
    mirrors = packed.mirrors
    traced = mirrors is not None and (mirrors.casters is not None or mirrors.reflected is not None)
    if traced and not outputs.isdisjoint(("image", "color")):
        return False
    return bool((packed.solids["flags"] & np.uint32(Flag.RECHECKED)).any())


class Job(NamedTuple):
    """A dispatch that asks integers about some of the groups of quads."""

    first: int  # group
    groups: int
    layout: FrameBuffer
    contents: dict[int, Array]  # of bindings, as `run.buffers` numbers them


def jobs(packed: Packed, asked: Asked, first_row: int, outputs: frozenset[str]) -> Iterator[Job]:
    """The dispatches that ask integers about quads of a band.

    Args:
        packed: the records of `host.pack.in_integers`.
        asked: the quads.
        first_row: row of the picture where the band begins.
        outputs: those of the shader.
    """
    assert packed.polynomials is not None
    for first in range(0, len(asked.row), MOST_WORKGROUPS):
        row = asked.row[first : first + MOST_WORKGROUPS]
        own = slice(first * GROUP, (first + len(row)) * GROUP)
        layout = FrameBuffer(outputs, LANES * GROUP, len(row))
        tiles = np.zeros((len(row), TILE_WORDS), np.uint32)
        tiles[:, 0], tiles[:, 1] = row, np.arange(len(row)) * GROUP
        frame = np.zeros(1, FRAME.dtype())
        frame["first_row"] = first_row
        frame["plane_quads"] = np.prod(layout.shape) // LANES
        contents: dict[int, Array] = {
            0: frame,
            1: packed.solids,
            2: packed.half_spaces,
            3: tiles,
            4: np.stack([asked.place[own], asked.member[own]], axis=-1).reshape(-1),
            14: packed.polynomials.records,
        }
        yield Job(first, len(row), layout, contents)


def no_answers(asked: Asked) -> Answers:
    """Answers by which nothing is certain."""
    shape = len(asked.place), LANES
    return Answers(np.zeros(shape, np.uint32), np.zeros(shape, np.int32), np.zeros(shape, "f4"))


def take(answers: Answers, job: Job, planes: Planes) -> None:
    """Take the answers of a job from the planes that its shader has written."""
    own = slice(job.first * GROUP, (job.first + job.groups) * GROUP)
    for answer, name in zip(answers, ("verdict", "place", "within"), strict=True):
        answer[own] = planes[name].view(answer.dtype).reshape(-1, LANES)


def settled(
    planes: Planes, packed: Packed, lists: Lists, exact: Callable[[], Packed], judge: Judge
) -> None:
    """Judge the pixels of a band again, and change its planes to what is certain then.

    Args:
        planes: the planes of the outputs `READ` and ``error``.
        packed: the records of the frame.
        lists: what the tiles of the band try.
        exact: gives `host.pack.in_integers` of the records.
        judge: asks integers.
    """
    shape = planes["vague"].shape
    vague, key, doubt = (planes[name].reshape(-1) for name in ("vague", "key", "doubt"))
    pixel = np.flatnonzero(vague != FAR_KEY)
    # A solid that begins behind the point of a pixel can hardly spoil it.
    behind = vague[pixel] > key[pixel]
    spoiled = pixel[behind]
    doubt[spoiled] = np.minimum(doubt[spoiled], vague[spoiled])
    vague[pixel] = FAR_KEY
    asked = _asked(pixel[~behind], shape, packed, lists)
    if asked is None:
        return
    unclear = np.zeros(shape, bool)
    unclear.reshape(-1)[pixel[~behind]] = True
    answers = judge(exact(), asked)
    place, width = asked.place.astype(np.int64)[:, None], shape[1]
    i, j = (place & 0xFFFF) * LANES + np.arange(LANES), place >> 16
    some = asked.real[:, None] & (i < width) & unclear[j, np.minimum(i, width - 1)]
    row = np.broadcast_to(np.repeat(asked.row, GROUP)[:, None], some.shape)[some]
    own = Answers(*(each[some] for each in answers))
    _settle(planes, packed, (j * width + i)[some], row, own)


def _asked(pixel: Ints, shape: tuple[int, ...], packed: Packed, lists: Lists) -> Asked | None:
    """The quads with pixels of a band, with the solids that their tiles may see; None if none."""
    width = shape[1]
    quads = -(-width // LANES)
    j, quad = np.divmod(np.unique(pixel // width * quads + pixel % width // LANES), quads)
    tile = j // TILE * -(-width // TILE) + quad * LANES // TILE
    list_ = tile * len(lists.classes) + lists.classes.index(Class.POLYNOMIAL)
    first, end = (lists.starts[list_ + k].astype(np.int64) for k in (0, 1))
    of = np.repeat(np.arange(len(j)), end - first)
    entry = np.arange(len(of)) - np.repeat(np.cumsum(end - first) - end, end - first)
    member = lists.members[entry]
    row = rows_of(member).astype(np.int64)
    some = (packed.solids["flags"][row] & np.uint32(Flag.RECHECKED)) != 0
    if not some.any():
        return None
    of, member, row = of[some], member[some], row[some]
    order = np.argsort(row, kind="stable")
    solids, counts = np.unique(row, return_counts=True)
    groups = -(-counts // GROUP)
    # Each solid begins with a new group. Its last quad fills up its last group.
    start, before = np.cumsum(groups) - groups, np.cumsum(counts) - counts
    slot = np.arange(groups.sum() * GROUP)
    which = np.repeat(np.arange(len(solids)), groups * GROUP)
    number = slot - start[which] * GROUP
    chosen = order[before[which] + np.minimum(number, counts[which] - 1)]
    place = (quad | j << 16)[of[chosen]].astype(np.uint32)
    return Asked(np.repeat(solids, groups), place, member[chosen], number < counts[which])


def _settle(planes: Planes, packed: Packed, pixel: Ints, row: Ints, answers: Answers) -> None:
    """Take down what is certain of solids at P pixels, given by their rows and pixels' indices."""
    solids, numbers = packed.solids[row], packed.surfaces.numbers
    steps = solids["steps"].astype(np.int64)
    begin = solids["key_high"].astype(np.uint64) << np.uint64(32) | solids["key_low"]
    count = (answers.position.astype(np.int64) + (1 << steps)).astype(np.uint64)
    place = begin + (count << solids["key_shift"].astype(np.uint64))
    # Units of keys in one of u.
    unit = np.exp2(solids["key_shift"] + steps)
    key, number = (planes[name].reshape(-1)[pixel] for name in ("key", "surface"))
    shown = numbers.rows(number) == packed.setup.solid[packed.order[row]]
    meets = answers.verdict >= MEETS
    bound = answers.bound.astype(np.float64)
    gap = np.where(shown, _gap(key, place), 0.0) / unit
    bound = np.where(shown, ROOM * (gap + bound), bound)
    surface = solids["surface"] + answers.verdict - np.uint32(MEETS)
    agrees = meets & (number == surface) & (bound <= LARGEST_BOUND)
    behind = (answers.verdict != UNSURE) & (~meets | (place >= key))
    known = np.where(shown, agrees, behind)

    nearest = np.where(shown, key, place)
    off = np.minimum(np.ceil(np.minimum(bound, LARGEST_BOUND) * unit), nearest.astype(np.float64))
    low = nearest - np.minimum(off.astype(np.uint64), nearest)
    least = planes["low"].reshape(-1)
    np.minimum.at(least, pixel, np.where(known & meets, low, FAR_KEY))
    doubt = planes["doubt"].reshape(-1)
    np.minimum.at(doubt, pixel, np.where(known, FAR_KEY, begin))
    taken = known & shown
    planes["bound"].reshape(-1)[pixel[taken]] = _rounded_up(bound[taken])


def _gap(key: U64, other: U64) -> Floats:
    """The distance of keys."""
    return (np.maximum(key, other) - np.minimum(key, other)).astype(np.float64)


def _rounded_up(values: Floats) -> F32:
    """Values in float32, none of them less."""
    rounded = values.astype(np.float32)
    return np.where(rounded < values, np.nextafter(rounded, np.float32(np.inf)), rounded)
