"""Boxes of regions hold every point of them, and formulas in normal form mean the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.contract.program import (
    CELL_ENDS,
    CLOSES,
    GROUP,
    LEAF,
    NUMBER,
    OPENS,
    POSITIVE,
    TURN,
)
from halfstep.host.boxes import box_of
from halfstep.host.formulas import Formula, Senses, decided, hoisted, literals, normal_form, truth
from halfstep.host.words import ENDLESS, Tree, excerpts_of
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

POINTS = 20_000


def random_surface(rng: np.random.Generator) -> Floats:
    """A matrix (4, 4) of a sphere, a cylinder, a cone, a plane or any quadric."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    if rng.random() < 0.3:
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
    across = np.eye(3) - np.outer(axis, axis)
    second, level = [
        (np.eye(3), rng.uniform(0.1, 0.6)),
        (across, rng.uniform(0.05, 0.4)),
        (across - rng.uniform(0.1, 1) * np.outer(axis, axis), 0.0),
        (np.diag(rng.uniform(-1, 1, 3)), rng.uniform(-0.5, 0.5)),
        (np.zeros((3, 3)), 0.0),
    ][rng.integers(5)]
    center = rng.uniform(-0.5, 0.5, 3)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = second
    matrix[:3, 3] = matrix[3, :3] = -second @ center if second.any() else axis / 2
    matrix[3, 3] = center @ second @ center - level if second.any() else -axis @ center
    return matrix * rng.choice([1.0, 1e-3, 50.0])


def random_region(rng: np.random.Generator, surfaces: int, depth: int) -> Region:
    """A formula over some surfaces."""
    if depth == 0 or rng.random() < 0.3:
        return Literal(int(rng.integers(surfaces)), bool(rng.random() < 0.35))
    kind = rng.choice(3, p=[0.55, 0.35, 0.1])
    if kind == 2:
        return Complement(random_region(rng, surfaces, depth - 1))
    parts = tuple(random_region(rng, surfaces, depth - 1) for _ in range(rng.integers(2, 4)))
    return Intersection(parts) if kind == 0 else Union(parts)


def holds(region: Region, positive: Bools) -> Bools:
    """Whether a region holds where functions (S, N) are positive or not: by its meaning."""
    if isinstance(region, Literal):
        return positive[region.surface] == region.positive
    if isinstance(region, Complement):
        return ~holds(region.of, positive)
    found = np.full(positive.shape[1], isinstance(region, Intersection))
    for part in region.of:
        other = holds(part, positive)
        found = found & other if isinstance(region, Intersection) else found | other
    return found


def plain(count: int) -> Senses:
    """No surface is merged with another."""
    return Senses(range(count), [False] * count)


def is_normal(region: Region, *, inside: type | None = None) -> bool:
    """Whether complements are at literals alone and no operator is inside its like."""
    if isinstance(region, Literal):
        return True
    if isinstance(region, Complement) or type(region) is inside:
        return False
    if len(region.of) == 1 or (not region.of and inside is not None):
        return False
    own = [part for part in region.of if isinstance(part, Literal)]
    if len({literal.surface for literal in own}) < len(own):
        return False
    return all(is_normal(part, inside=type(region)) for part in region.of)


def test_normal_form_means_the_same() -> None:
    seed = 20261129
    rng = np.random.default_rng(seed)
    constant = 0
    for _ in range(500):
        region = random_region(rng, 6, 4)
        positive = rng.random((6, 64)) < 0.5
        found = normal_form(region, plain(6))
        assert is_normal(found), (seed, region)
        assert (holds(found, positive) == holds(region, positive)).all(), (seed, region)
        constant += found in (Union(()), Intersection(()))
    assert constant > 10, seed


def test_literals_that_members_share_are_hoisted() -> None:
    a, b, c, d = (Literal(ix, positive=False) for ix in range(4))
    both = Intersection((a, Union((b, c))))
    assert hoisted(Union((Intersection((a, b)), Intersection((a, c))))) == both
    assert hoisted(Union((a, Intersection((a, c))))) == a
    assert hoisted(Intersection((Union((a, b)), Union((c, a)), d))) == Intersection(
        (Union((a, Intersection((b, c)))), d)
    )


def test_hoisting_keeps_what_regions_mean() -> None:
    seed = 5
    rng = np.random.default_rng(seed)
    shorter = 0
    for _ in range(500):
        region = normal_form(random_region(rng, 5, 4), plain(5))
        found = hoisted(region)
        positive = rng.random((5, 64)) < 0.5
        assert is_normal(found), (seed, region)
        assert (holds(found, positive) == holds(region, positive)).all(), (seed, region)
        assert len(literals(found)) <= len(literals(region)), (seed, region)
        shorter += len(literals(found)) < len(literals(region))
    assert shorter > 50, seed


def test_merged_surfaces_turn_their_literals() -> None:
    region = Intersection((Literal(0, positive=True), Literal(1, positive=False)))
    assert normal_form(region, Senses([0, 0], [False, False])) == Union(())
    assert normal_form(region, Senses([0, 0], [False, True])) == Literal(0, positive=True)


def test_what_boxes_decide_is_left_out() -> None:
    seed = 7
    rng = np.random.default_rng(seed)
    shorter = 0
    for _ in range(300):
        region = normal_form(random_region(rng, 6, 3), plain(6))
        signs = rng.integers(-1, 2, 6).astype(np.int8)
        positive = np.where(signs[:, None] == 0, rng.random((6, 64)) < 0.5, signs[:, None] > 0)
        left = decided(region, signs.tolist())
        assert (holds(left, positive) == holds(region, positive)).all(), (seed, region, signs)
        assert not {literal.surface for literal in literals(left)} & set(np.flatnonzero(signs))
        known = int(truth(region, signs[:, None])[0])
        if known:
            assert (holds(region, positive) == (known > 0)).all(), (seed, region, signs)
        shorter += len(literals(left)) < len(literals(region))
    assert shorter > 100, seed


def run(words: Sequence[int], positive: Bools) -> Bools:
    """What a program says: AND and OR by turns, no leaps."""
    stack: list[Bools] = []
    nothing = np.zeros(positive.shape[1], bool)
    inner, total, deepest = nothing, nothing, 0
    for word in words:
        if word & OPENS:
            stack.append(inner)
            inner = nothing
        deepest = max(deepest, len(stack))
        if word & LEAF:
            holding = positive[word >> NUMBER] == bool(word & POSITIVE)
            turned = bool(word & TURN) != bool(word & POSITIVE)
            inner = inner | (holding != turned)
        if word & CLOSES:
            inner = stack.pop() | ~inner
        if word & CELL_ENDS:
            total, inner = total | inner, nothing
    assert not stack
    return total


def test_programs_say_what_formulas_say() -> None:
    seed = 3
    rng = np.random.default_rng(seed)
    levels = 0
    for _ in range(300):
        cells = [normal_form(random_region(rng, 6, 5), plain(6)) for _ in range(2)]
        cells = [cell for cell in cells if literals(cell)]
        if not cells:
            continue
        positive = rng.random((6, 64)) < 0.5
        whole = Formula(cells).whole
        words = whole.words.tolist()
        expected = holds(Union(tuple(cells)), positive)
        assert (run(words, positive) == expected).all(), (seed, cells)
        opened, most = 0, 0
        for word in words:
            opened += bool(word & OPENS)
            most = max(most, opened)
            opened -= bool(word & CLOSES)
        assert most == whole.levels
        levels = max(levels, most)
    assert levels >= 4, seed


def words_of_all(formula: Formula, live: Bools, holding: Bools) -> list[list[int]]:
    """The words of all excerpts, written at once; they are those of each one alone."""
    some = np.flatnonzero(live.any(axis=0) | holding.any(axis=0))
    found: list[list[int]] = [[] for _ in range(live.shape[1])]
    if not len(some):
        return found
    tree = Tree.of(formula)
    excerpts = excerpts_of(tree, live[:, some], holding[:, some], 2, 6, lists_higher=False)
    begin = np.cumsum(excerpts.sizes) - excerpts.sizes
    for place, block in enumerate(some.tolist()):
        alone = formula.excerpt(live[:, block], holding[:, block])
        words = alone.words.tolist()
        flat = int((alone.surfaces < 2).sum())
        listed = [*alone.surfaces.tolist(), *alone.cells.tolist()]
        for part in (words, listed):
            part += [0] * (len(part) % GROUP)
        own = excerpts.content[begin[place] :][: excerpts.sizes[place]].tolist()
        assert own == words + listed
        assert excerpts.groups[place] * GROUP == len(words)
        counts = [flat, len(alone.surfaces) - flat, len(alone.cells)]
        assert excerpts.counts[:, place].tolist() == counts
        assert excerpts.crossings[place] == len(alone.surfaces)
        length = len(alone.words) if alone.levels <= 1 else ENDLESS
        assert excerpts.lengths[place] == length
        found[block] = words
    return found


def test_excerpts_say_what_formulas_say_on_what_is_seen() -> None:
    """Signs are known on some pieces of rays; elsewhere a surface may have either."""
    seed = 17
    rng = np.random.default_rng(seed)
    shorter = constant = narrow = 0
    for trial in range(300):
        cells = [normal_form(random_region(rng, 6, 4), plain(6)) for _ in range(2)]
        cells = [cell for cell in cells if literals(cell)]
        if not cells:
            continue
        formula = Formula(cells)
        blocks = 16
        state = rng.choice([-1, 0, 1], (6, blocks, 8), p=[0.4, 0.2, 0.4])
        # Most surfaces keep a sign for several pieces.
        state = np.where(rng.random((6, blocks, 1)) < 0.6, state[..., :1], state)
        inside, outside = (
            np.packbits(state == sign, axis=-1, bitorder="little")[..., 0] for sign in (-1, 1)
        )
        cut, narrowed = rng.random((2, blocks)) < 0.7
        decided = formula.decided(inside, outside, cut & narrowed, narrowed)
        live, holding = formula.live(decided), formula.holds(decided)
        written = words_of_all(formula, live, holding)
        for block in range(blocks):
            shorter += int(live[:, block].sum()) < formula.literal_count
            constant += not live[:, block].any()
            first, last = int(decided.first[block]), int(decided.last[block])
            narrow += last - first < 7
            found = np.zeros((8, 32), bool)
            expected = np.zeros((8, 32), bool)
            for piece in range(8):
                signs = state[:, block, piece, None]
                positive = np.where(signs == 0, rng.random((6, 32)) < 0.5, signs > 0)
                found[piece] = run(written[block], positive)
                expected[piece] = holds(Union(tuple(cells)), positive)
            seen = slice(first, last + 1)
            assert (found[seen] == expected[seen]).all(), (seed, trial, block)
            # Before what is seen no cell holds, behind it none does or one has for a whole piece.
            assert not expected[:first].any(), (seed, trial, block)
            covered = last >= first and expected[last].all()
            assert covered or not expected[last + 1 :].any(), (seed, trial, block)
    assert min(shorter, constant, narrow) > 500, (seed, shorter, constant, narrow)


def test_boxes_hold_every_point() -> None:
    seed = 11
    rng = np.random.default_rng(seed)
    finite = 0
    for _ in range(300):
        matrices = np.array([random_surface(rng) for _ in range(6)])
        region = normal_form(random_region(rng, 6, 3), plain(6))
        points = np.column_stack([rng.uniform(-3, 3, (POINTS, 3)), np.ones(POINTS)])
        positive = np.einsum("pi,sij,pj->sp", points, matrices, points) > 0
        inside = points[holds(region, positive)][:, :3]
        box = box_of(region, matrices)
        if box is None:
            assert not len(inside), (seed, region)
            continue
        assert (inside >= box[0]).all(), (seed, region)
        assert (inside <= box[1]).all(), (seed, region)
        finite += bool(np.isfinite(box).all())
    assert finite > 30, seed


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, 3), (-1, 0.2, 0.1)])
def test_a_cylinder_between_planes_is_bounded(axis: tuple[float, ...]) -> None:
    normal = np.array(axis) / np.linalg.norm(axis)
    cylinder = np.zeros((4, 4))
    cylinder[:3, :3] = np.eye(3) - np.outer(normal, normal)
    cylinder[3, 3] = -0.25
    planes = np.zeros((2, 4, 4))
    for plane, sign in zip(planes, (1, -1), strict=True):
        plane[:3, 3] = plane[3, :3] = sign * normal / 2
        plane[3, 3] = -1
    region = Intersection(tuple(Literal(ix, positive=False) for ix in range(3)))
    box = box_of(region, np.array([cylinder, *planes]))
    assert box is not None
    # The support of the solid along an axis e: |n·e| + sqrt(1 - (n·e)²) / 2.
    reach = np.abs(normal) + np.sqrt(1 - normal**2) / 2
    assert (box[1] >= reach).all()
    assert (box[0] <= -reach).all()
    corner = np.abs(np.linalg.eigh(cylinder[:3, :3])[1]) @ np.array([1.0, 0.5, 0.5])
    assert (box[1] <= 1.0001 * np.maximum(corner, reach)).all()
