"""Which points lights do not reach in scenes of tori and polynomials, in extended precision.

    python -m tests.higher_shadows

Every solid is where all of its functions are <= 0. Along a ray a function is a polynomial, made
term by term from the solid's own exact polynomial in x, y and z. Between two neighbouring real
parts of roots, its sign is that in the middle. A point is a root of its own surface: that
polynomial loses its constant and is divided by the distance.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

import halfstep
from halfstep.host.camera import view
from halfstep.scene import Algebraic, Light, PlanePatch, QuadricSolid, Scene, with_overrides
from tests.shadow_sweeps import Count, Judged

Bools = NDArray[np.bool_]
Ints = NDArray[np.int32]
Wide = NDArray[np.longdouble]
LD = np.longdouble
DISTANCES = (3.0, 1e2, 1e4)
SCENES = ("one_torus", "linked_rings", "torus_knot", "clebsch_cubic", "heart", "dupin_cyclide")


class HigherShadows:
    """Hits and shadows of one scene at one picture size."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self.scene, self._view = scene, view(scene.camera, size)

    def at(self, i: Any, j: Any) -> tuple[Ints, Ints, NDArray[np.uint32]]:
        """Solid, surface and the bits of dark lights at pixels (N,), which may have fractions."""
        start = (self._view.eye.astype(LD) + self._view.starts(i, j)) + np.zeros((len(i), 3), LD)
        along = self._view.directions(i, j).astype(LD) + np.zeros((len(i), 3), LD)
        depth = np.full(len(i), np.inf, LD)
        solid, surface = np.full((2, len(i)), -1, np.int32)
        inside = np.zeros(len(i), bool)
        for ix, each in enumerate(self.scene.solids):
            found, number, within = _first(each, start, along)
            nearer = found < depth
            depth = np.where(nearer, found, depth)
            solid, surface = np.where(nearer, ix, solid), np.where(nearer, number, surface)
            inside = np.where(nearer, within, inside)
        hit = solid >= 0
        points = start + np.where(hit, depth, 0)[:, None] * along
        dark = np.zeros(len(i), np.uint32)
        for bit, light in enumerate(light for light in self.scene.lights if light.shadows):
            hidden = np.zeros(len(i), bool)
            for ix, each in enumerate(self.scene.solids):
                other, own = hit & (solid != ix), hit & (solid == ix)
                if each.casts_shadow:
                    hidden[other] |= _hides(each, points[other], light)
                own_side = inside[own], along[own]
                hidden[own] |= _hides_itself(each, points[own], light, surface[own], *own_side)
            dark |= np.where(hidden, np.uint32(1 << bit), np.uint32(0))
        return solid.astype(np.int32), surface.astype(np.int32), dark


def functions_of(solid: Any) -> list[tuple[int, dict[tuple[int, int, int], Any]]]:
    """Numbers of surfaces with polynomials, as coefficients of powers of x, y and z."""
    rows = solid.half_spaces()
    planes = []
    for row in rows.astype(LD):
        terms = {(0, 0, 0): -row[3]}
        for axis in range(3):
            terms[tuple(int(k == axis) for k in range(3))] = row[axis]  # type: ignore[index]
        planes.append(terms)
    first = 0 if isinstance(solid, PlanePatch) else 1
    found = [(first + k, terms) for k, terms in enumerate(planes)]
    if isinstance(solid, QuadricSolid):
        found.append((0, _quadric(solid.quadric())))
    if isinstance(solid, Algebraic):
        exact = solid.polynomial()
        largest = max(map(abs, exact.values()))
        found.append((0, {powers: _wide(value / largest) for powers, value in exact.items()}))
        if solid.is_in_ball():
            found = [(k + 1 if k else 0, each) for k, each in found]
            found.append((1, _quadric(solid.quadric())))
    return found


def _wide(value: Any) -> Any:
    """A fraction in extended precision."""
    high = float(value)
    return LD(high) + LD(float(value - type(value)(high)))


def _quadric(matrix: Any) -> dict[tuple[int, int, int], Any]:
    q = matrix.astype(LD)
    found: dict[tuple[int, int, int], Any] = {}
    for a in range(4):
        for b in range(4):
            powers = [0, 0, 0]
            for axis in (a, b):
                if axis < 3:
                    powers[axis] += 1
            key = powers[0], powers[1], powers[2]
            found[key] = found.get(key, LD(0)) + q[a, b]
    return found


def along_rays(terms: Any, x: Wide, d: Wide) -> Wide:
    """Coefficients (degree + 1, N) of powers of the distance along rays x + s d."""
    degree = max(map(sum, terms))
    total = np.zeros((degree + 1, len(x)), LD)
    powers: list[list[Wide]] = []
    for axis in range(3):
        line = [np.ones((1, len(x)), LD)]
        for _ in range(degree):
            old = line[-1]
            new = np.zeros((len(old) + 1, len(x)), LD)
            new[:-1] += old * x[:, axis]
            new[1:] += old * d[:, axis]
            line.append(new)
        powers.append(line)
    for exponents, value in terms.items():
        product = np.ones((1, len(x)), LD)
        for axis, k in enumerate(exponents):
            factor = powers[axis][k]
            wide = np.zeros((len(product) + len(factor) - 1, len(x)), LD)
            for m, part in enumerate(factor):
                wide[m : m + len(product)] += product * part
            product = wide
        total[: len(product)] += value * product
    return total


def roots_of(terms: Wide) -> Wide:
    """Real parts (degree, N) of the roots, and some more numbers."""
    degree = len(terms) - 1
    if degree < 1 or not terms.shape[1]:
        return np.zeros((0, terms.shape[1]), LD)
    size = np.abs(terms).max(axis=0)
    scaled = (terms / np.where(size > 0, size, 1)).astype(np.float64)
    # Reversed: the roots are one over the eigenvalues, so a leading 0 gives a root at infinity.
    lead = np.where(np.abs(scaled[-1]) > 1e-14, scaled[-1], 1e-14)
    matrix = np.zeros((terms.shape[1], degree, degree))
    matrix[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    matrix[:, :, -1] = -(scaled[:-1] / lead).T
    found = np.linalg.eigvals(matrix).T.astype(np.clongdouble)
    for _ in range(4):
        value, slope = np.zeros_like(found), np.zeros_like(found)
        for term in terms[::-1]:
            slope = slope * found + value
            value = value * found + term
        step = value / np.where(slope == 0, 1, slope)
        found = found - np.where(np.abs(step) < 0.1 * (1 + np.abs(found)), step, 0)
    return np.asarray(found.real)


def value_at(terms: Wide, s: Wide) -> Wide:
    value = np.zeros_like(s)
    for term in terms[::-1]:
        value = value * s + term
    return value


def _local(solid: Any, points: Wide, vectors: Wide) -> tuple[Wide, Wide]:
    turn = solid.world_from_local().astype(LD)
    return (points - np.array(solid.origin, LD)) @ turn, vectors @ turn


class _Ray:
    """A solid along rays: places between which nothing changes, and what is there."""

    def __init__(self, solid: Any, x: Wide, d: Wide, end: Any, own: Ints | None = None) -> None:
        size = np.sqrt((d * d).sum(axis=1))
        # Distances count from the place nearest to the origin, in units of d.
        middle = -(x * d).sum(axis=1) / (size * size)
        base = x + middle[:, None] * d
        if own is not None:
            middle, base = np.zeros(len(x), LD), x
        self.numbers, self.terms, cuts = [], [], []
        for number, function in functions_of(solid):
            terms = along_rays(function, base, d)
            if own is not None:
                mine = own == number
                lower = np.concatenate([terms[1:], np.zeros((1, len(x)), LD)])
                terms = np.where(mine, lower, terms)
            self.numbers.append(number)
            self.terms.append(terms)
            cuts.append(roots_of(terms))
        places = np.concatenate(cuts)
        last = np.broadcast_to(np.asarray(end, LD), (len(x),)) - middle
        first = -middle
        places = np.where((places > first) & (places < last), places, first)
        far = np.where(np.isinf(last), 2 * np.abs(places).max(axis=0, initial=0) + 1, last)
        self.places = np.sort(np.concatenate([places, first[None], far[None]]), axis=0)
        self.middle = middle
        between = (self.places[1:] + self.places[:-1]) / 2
        self.some = self.places[1:] > self.places[:-1]
        self.signs = [value_at(terms, between) <= 0 for terms in self.terms]

    def within(self, but: int | None = None) -> Bools:
        """Whether each stretch is inside all functions but one."""
        found = np.ones(self.some.shape, bool)
        for number, sign in zip(self.numbers, self.signs, strict=True):
            if number != but:
                found &= sign
        return found

    def crossed(self, number: int) -> Bools:
        """Whether a function changes its sign where each stretch begins, inside the others."""
        sign = self.signs[self.numbers.index(number)]
        free = self.within(but=number)
        found = np.zeros(self.some.shape, bool)
        # Empty stretches have the sign before them.
        was, was_free = sign[0].copy(), free[0].copy()
        known = self.some[0].copy()
        for k in range(1, len(sign)):
            here = self.some[k]
            found[k] = here & known & (sign[k] != was) & free[k] & was_free
            was, was_free = np.where(here, sign[k], was), np.where(here, free[k], was_free)
            known |= here
        return found


def _first(solid: Any, start: Wide, along: Wide) -> tuple[Wide, Ints, Bools]:
    """Depth, surface and whether seen from inside, of the first point of a solid on rays."""
    x, d = _local(solid, start, along)
    ray = _Ray(solid, x, d, np.inf)
    sheet = _sheet(solid)
    if sheet is not None:
        there = ray.crossed(sheet)
    else:
        there = ray.within() & ray.some
    k = there.argmax(axis=0)
    hit = there.any(axis=0)
    if sheet is None:
        # From inside, the ray shows where it leaves the solid.
        first = ray.some.argmax(axis=0)[None]
        within = np.take_along_axis(there, first, axis=0)[0]
        leaves = ray.some & ~there
        k = np.where(within, leaves.argmax(axis=0), k)
    columns = np.arange(len(x))
    place = ray.places[k, columns]
    number = np.zeros(len(x), np.int32)
    least = np.full(len(x), np.inf, LD)
    for each, terms in zip(ray.numbers, ray.terms, strict=True):
        if sheet is not None and each != sheet:
            continue
        slope = value_at(terms[1:] * np.arange(1, len(terms))[:, None], place)
        off = np.abs(value_at(terms, place)) / np.maximum(np.abs(slope), 1e-300)
        number = np.where(off < least, each, number)
        least = np.minimum(off, least)
    inside = within if sheet is None else np.zeros(len(x), bool)
    if sheet is not None and not isinstance(solid, PlanePatch):
        sign = ray.signs[ray.numbers.index(sheet)]
        inside = hit & ~sign[k, columns]  # it comes from where F <= 0
    return np.where(hit, place + ray.middle, np.inf), number, inside


def _sheet(solid: Any) -> int | None:
    """The number of the function of a solid that is a surface alone."""
    is_sheet = isinstance(solid, PlanePatch) or (isinstance(solid, Algebraic) and solid.is_sheet())
    return 0 if is_sheet else None


def _way(points: Wide, light: Light) -> tuple[Wide, Any]:
    """The vectors to a light, and how many of them lead there."""
    if light.position is not None:
        return np.array(light.position, LD) - points, LD(1)
    toward = np.array(light.direction, LD)
    return np.broadcast_to(toward / np.sqrt((toward**2).sum()), points.shape), LD(np.inf)


def _hides(solid: Any, points: Wide, light: Light) -> Bools:
    vectors, end = _way(points, light)
    x, d = _local(solid, points, vectors)
    ray = _Ray(solid, x, d, end)
    sheet = _sheet(solid)
    if sheet is not None:
        return np.asarray(ray.crossed(sheet).any(axis=0))
    there = ray.within()
    return np.asarray((there & ray.some).any(axis=0) & ~(there | ~ray.some).all(axis=0))


def _hides_itself(
    solid: Any, points: Wide, light: Light, surface: Ints, inside: Bools, seen: Wide
) -> Bools:
    vectors, end = _way(points, light)
    x, d = _local(solid, points, vectors)
    sheet = _sheet(solid)
    ray = _Ray(solid, x, d, end, surface)
    slope = np.zeros(len(x), LD)
    for number, terms in zip(ray.numbers, ray.terms, strict=True):
        slope = np.where(surface == number, terms[0], slope)
    if isinstance(solid, PlanePatch):
        normal = solid.half_spaces().astype(LD)[0][:3]
        _, at = _local(solid, points, seen)
        return np.asarray((slope > 0) == ((at @ normal) > 0))
    faces = slope > 0
    away = faces == inside
    if not solid.casts_shadow:
        return np.asarray(away)
    if sheet is not None:
        # The rest of F changes its sign.
        sign, within = ray.signs[ray.numbers.index(sheet)], ray.within(but=sheet)
        bad = (sign != ~faces) & within & ray.some
        return np.asarray(away | bad.any(axis=0))
    there = ray.within()
    meets = (there & ray.some).any(axis=0)
    remains = (there | ~ray.some).all(axis=0)
    return np.asarray(away | np.where(inside, ~remains, meets))


Random = np.random.Generator
Table = dict[str, Any]
# Surfaces in a box or ball of about one unit, with the ends that bound them.
FORMULAS: tuple[tuple[str, Table], ...] = (
    ("x^4 + y^4 + z^4 - x^2 - y^2 - z^2 + 0.4", {"radius": 1.2}),
    ("(x^2 + y^2 + z^2 + 0.3)^2 - 1.6*(x^2 + y^2)", {"min": [-1, -1, -0.4], "max": [1, 0.6, 0.4]}),
    ("x^3 - 2*x*y + z^2 - 0.2", {"radius": 1.0}),
    ("x*y*z - 0.05", {"min": [-0.8, -0.8, -0.8], "max": [0.8, 0.8, 0.8]}),
)


def torus(rng: Random) -> Table:
    """A torus of about one unit, round or oval, whole or cut."""
    minor = float(rng.uniform(0.1, 0.4))
    oval = [minor, float(rng.uniform(0.1, 0.5))]
    solid: Table = {"kind": "torus", "major": 0.7, "minor": oval if rng.random() < 0.4 else minor}
    if rng.random() < 0.4:
        solid["cut"] = [[*rng.normal(size=3).tolist(), float(rng.uniform(-0.2, 0.4))]]
    return solid


def implicit(rng: Random) -> Table:
    """A solid of a polynomial or, at times, the sheet."""
    formula, bounds = FORMULAS[int(rng.integers(len(FORMULAS)))]
    sheet = {"sheet": True} if rng.random() < 0.4 else {}
    return {"kind": "implicit", "formula": formula, "bounds": bounds, **sheet}


def placed(rng: Random, solid: Table, place: Any) -> Table:
    """A solid turned at random, at a place."""
    turn = rng.uniform(-180, 180, 3).tolist()
    return {**solid, "origin": np.asarray(place).tolist(), "rotation_degrees": turn}


def random_lit(rng: Random) -> Scene:
    """Tori, polynomials, a ball and a floor in a light far away and lamps near and far."""
    floor = {
        "kind": "plane",
        "bounds": {"min": [-3, -3, -2], "max": [3, 3, 2]},
        "origin": [0, 0, -1.2],
    }
    ball = {"kind": "sphere", "radius": 0.4, "origin": rng.uniform(-1, 1, 3).tolist()}
    solids = [floor, ball]
    for k in range(3):
        solid = torus(rng) if k % 2 == 0 else implicit(rng)
        solids.append(placed(rng, solid, [1.6 * k - 1.6, *rng.uniform(-0.5, 0.5, 2)]))
    near = rng.normal(size=3) * [1.5, 1.0, 1.0] + [0, 0, 0.5]
    lights = [
        {"direction": [*rng.uniform(-1, 1, 2).tolist(), 1.2]},
        {"position": near.tolist()},
        {"position": [*rng.uniform(-9, 9, 2).tolist(), 7.0]},
    ]
    return scene_of(solids, lights, [*rng.uniform(-4, 4, 1).tolist(), -6.5, 4.0], 38.0)


def scene_of(solids: list[Table], lights: list[Table], eye: list[float], fov: float) -> Scene:
    """A scene whose lights have shadows, seen from ``eye``."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": eye, "look_at": [0, 0, 0], "fov_degrees": fov},
            "light": [{**each, "shadows": True} for each in lights],
            "solid": [{"color": [0.7, 0.7, 0.7], **each} for each in solids],
        }
    )


def occluded(rng: Random, distance: float, *, lamp: bool) -> Scene:
    """A floor, a ball and a torus before them, ``distance`` of its sizes away.

    A lamp is at twice the distance.
    """
    toward = np.array([1.0, -1.0, 2.0]) / np.sqrt(6)
    ring = placed(rng, {"kind": "torus", "major": 0.7, "minor": 0.25}, toward * distance)
    floor = {"kind": "plane", "bounds": {"min": [-1.5, -1.5, -1], "max": [1.5, 1.5, 1]}}
    ball = {"kind": "sphere", "radius": 0.25, "origin": [0.2, 0.1, 0.25]}
    source: Table = (
        {"position": (2 * toward * distance).tolist()} if lamp else {"direction": toward.tolist()}
    )
    return scene_of([floor, ball, ring], [source], [2, -5, 4], 26.0)


def main() -> None:
    """Print counts of bundled scenes, far lights and lamps; the exit code is 1 if one is wrong."""
    wrong = 0
    for name in sys.argv[1:] or SCENES:
        scene = with_overrides(halfstep.load(name), shadows=True)
        total = Count()
        Judged(scene, (96, 72), HigherShadows).count(total, backend="numpy")
        sys.stdout.write(f"{name}: {total}\n")
        sys.stdout.flush()
        wrong += total.wrong
    rng = np.random.default_rng(1998)
    drawn = {"random": [random_lit(rng) for _ in range(20)]}
    for lamp in (False, True):
        for distance in DISTANCES:
            what = f"{'lamp' if lamp else 'far light'}, a ring at {distance:g}"
            drawn[what] = [occluded(rng, distance, lamp=lamp) for _ in range(4)]
    for what, scenes in drawn.items():
        total = Count()
        for each in scenes:
            Judged(each, (64, 48), HigherShadows).count(total, backend="numpy")
        sys.stdout.write(f"{what}: {total}\n")
        sys.stdout.flush()
        wrong += total.wrong
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
