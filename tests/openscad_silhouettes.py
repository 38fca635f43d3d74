"""Files of OpenSCAD drawn, and every ray judged by what their calls say of points.

    python -m tests.openscad_silhouettes FOLDER

Every ``.csg`` file of a folder that is read is rendered, and each of its rays is sampled. Of a miss
no sample may be inside of the model. Of a hit no sample before it may be inside, and just behind it
a point must be. Which points are inside is asked of the text by a reader of its own, which shares
nothing with Halfstep's.
"""

from __future__ import annotations

import argparse
import ast
import math
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import halfstep
from halfstep.errors import SceneError
from halfstep.models import load

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Inside = Callable[[Floats], Bools]

SIZE = (96, 72)
SAMPLES = 300
# Points so near a face, in parts of the model, are not judged: corners are given in six digits.
NEAR = 2e-5
_TOKEN = re.compile(r"\s*([A-Za-z_$]\w*|[%#!*](?=\s*[A-Za-z_%#!*])|[(){};])")
_WORDS = {"true": "True", "false": "False", "undef": "None", "inf": "1e999", "nan": "None"}


class Reader:
    """The calls of a text as functions of points."""

    def __init__(self, text: str) -> None:
        self._text = re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)
        self._at = 0

    def whole(self) -> Inside:
        """All of it, or the call alone that is marked by ``!``."""
        self._alone: list[Inside] = []
        children = [*self._calls()]
        return self._alone[0] if self._alone else union(children)

    def _token(self) -> str:
        match = _TOKEN.match(self._text, self._at)
        if match is None:
            assert not self._text[self._at :].strip(), self._text[self._at :][:40]
            return ""
        self._at = match.end()
        return match[1]

    def _calls(self) -> Iterator[Inside]:
        while (token := self._token()) not in ("", "}"):
            if token == ";":
                continue
            marks = ""
            while token in "%#!*":
                marks, token = marks + token, self._token()
            found = self._call(token)
            if "!" in marks:
                self._alone.append(found)
            if "%" not in marks and "*" not in marks:
                yield found

    def _call(self, name: str) -> Inside:
        assert self._token() == "("
        start, depth, quoted = self._at, 1, False
        while depth:
            sign = self._text[self._at]
            quoted ^= sign == '"'
            depth += 0 if quoted else (sign in "([") - (sign in ")]")
            self._at += 1
        given, named = arguments(self._text[start : self._at - 1])
        children: list[Inside] = []
        if self._token() == "{":
            children = [*self._calls()]
        return CALLS[name](children, *given, **named)


def arguments(text: str) -> tuple[list[Any], dict[str, Any]]:
    """Values of arguments, without and with names."""
    text = re.sub(r'("(?:[^"\\]|\\.)*")|\b(true|false|undef|inf|nan)\b', _word, text)
    tree = ast.parse(f"f({text.replace('$', 'dollar_')})", mode="eval").body
    assert isinstance(tree, ast.Call)
    named = {each.arg: ast.literal_eval(each.value) for each in tree.keywords if each.arg}
    return [ast.literal_eval(each) for each in tree.args], named


def _word(match: re.Match[str]) -> str:
    return match[1] or _WORDS[match[2]]


def union(children: list[Inside], *_: Any, **__: Any) -> Inside:
    """Points in any of the children."""
    return lambda p: np.any([np.zeros(len(p), bool), *(child(p) for child in children)], axis=0)


def intersection(children: list[Inside], **_: Any) -> Inside:
    """Points in all of them."""
    if not children:
        return union([])
    return lambda p: np.all([child(p) for child in children], axis=0)


def difference(children: list[Inside], **_: Any) -> Inside:
    """Points in the first alone."""
    if not children:
        return union([])
    rest = union(children[1:])
    return lambda p: np.asarray(children[0](p) & ~rest(p))


def multmatrix(children: list[Inside], matrix: Any, **_: Any) -> Inside:
    """The children where a matrix takes them."""
    whole = np.array(matrix, float)
    whole /= whole[3, 3]
    if abs(np.linalg.det(whole[:3, :3])) < 1e-12:
        return union([])
    back, inside = np.linalg.inv(whole), union(children)
    return lambda p: inside(p @ back[:3, :3].T + back[:3, 3])


def cube(_: list[Inside], size: Any = 1, center: bool = False, **__: Any) -> Inside:
    """A box."""
    sides = np.broadcast_to(np.array(size, float), 3)
    low = -sides / 2 if center else 0 * sides
    return lambda p: np.asarray(((p >= low) & (p <= low + sides)).all(axis=1))


def corners_of(dollar_fn: float) -> int:
    """Corners of what is round; 0 where it is round."""
    return max(int(dollar_fn), 3) if 0 < dollar_fn < 9 else 0


def in_circle(x: Floats, y: Floats, radius: Any, corners: int) -> Bools:
    """Points in a circle, or in the polygon with a corner on the x axis."""
    if not corners:
        return np.asarray(x**2 + y**2 <= np.square(np.maximum(radius, 0)))
    apothem = radius * math.cos(math.pi / corners)
    angles = 2 * math.pi * (np.arange(corners) + 0.5) / corners
    sides = [x * math.cos(angle) + y * math.sin(angle) <= apothem for angle in angles]
    return np.all([*sides, np.asarray(radius) * np.ones(x.shape) > 0], axis=0)


def sphere(_: list[Inside], r: float = 1, dollar_fn: float = 0, **__: Any) -> Inside:
    """A ball, or one of flat rings."""
    corners = corners_of(dollar_fn)
    if not corners:
        return lambda p: np.asarray((p**2).sum(axis=1) <= r * r)
    rings = (corners + 1) // 2
    angles = math.pi * (np.arange(rings) + 0.5) / rings
    levels, radii = r * np.cos(angles)[::-1], r * np.sin(angles)[::-1]

    def inside(p: Floats) -> Bools:
        radius = np.interp(p[:, 2], levels, radii, left=-1.0, right=-1.0)
        return in_circle(p[:, 0], p[:, 1], radius, corners)

    return inside


def cylinder(
    _: list[Inside],
    h: float = 1,
    r1: float = 1,
    r2: float = 1,
    center: bool = False,
    dollar_fn: float = 0,
    **__: Any,
) -> Inside:
    """A cylinder, a cone, or a prism or pyramid."""
    low = -h / 2 if center else 0.0

    def inside(p: Floats) -> Bools:
        part = (p[:, 2] - low) / h if h else 2 + 0 * p[:, 2]
        radius = r1 + (r2 - r1) * part
        within = (part >= 0) & (part <= 1)
        return within & in_circle(p[:, 0], p[:, 1], radius, corners_of(dollar_fn))

    return inside


def polyhedron(_: list[Inside], points: Any, faces: Any, **__: Any) -> Inside:
    """A convex polyhedron, in which its middle is."""
    corners = np.array(points, float)
    middle = corners[sorted({ix for face in faces for ix in face})].mean(axis=0)
    planes = []
    for face in faces:
        at = corners[list(face)]
        normal = sum(
            (np.cross(a, b) for a, b in zip(at, np.roll(at, -1, 0), strict=True)), 0 * middle
        )
        outwards = np.sign(normal @ (at[0] - middle))
        planes.append((outwards * normal, outwards * normal @ at[0]))
    return lambda p: np.all([p @ normal <= distance for normal, distance in planes], axis=0)


def square(_: list[Inside], size: Any = 1, center: bool = False, **__: Any) -> Inside:
    """A rectangle."""
    sides = np.broadcast_to(np.array(size, float), 2)
    low = -sides / 2 if center else 0 * sides
    return lambda p: np.asarray(((p[:, :2] >= low) & (p[:, :2] <= low + sides)).all(axis=1))


def circle(_: list[Inside], r: float = 1, dollar_fn: float = 0, **__: Any) -> Inside:
    """A disc."""
    return lambda p: in_circle(p[:, 0], p[:, 1], r, corners_of(dollar_fn))


def polygon(_: list[Inside], points: Any, paths: Any = None, **__: Any) -> Inside:
    """A polygon, by how often its sides cross."""
    order = [*range(len(points))] if paths is None else paths[0]
    corners = np.array([points[ix] for ix in order], float)

    def inside(p: Floats) -> Bools:
        found = np.zeros(len(p), bool)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            if a[1] == b[1]:
                continue
            between = (p[:, 1] < a[1]) != (p[:, 1] < b[1])
            at = a[0] + (p[:, 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
            found ^= between & (p[:, 0] < at)
        return found

    return inside


def linear_extrude(
    children: list[Inside], height: float = 1, center: bool = False, **_: Any
) -> Inside:
    """Flat children, drawn out."""
    flat, low = union(children), -height / 2 if center else 0.0
    return lambda p: flat(p) & (p[:, 2] >= low) & (p[:, 2] <= low + height)


CALLS: dict[str, Callable[..., Inside]] = {
    "union": union,
    "group": union,
    "render": union,
    "color": union,
    "intersection": intersection,
    "difference": difference,
    "multmatrix": multmatrix,
    "cube": cube,
    "sphere": sphere,
    "cylinder": cylinder,
    "polyhedron": polyhedron,
    "square": square,
    "circle": circle,
    "polygon": polygon,
    "linear_extrude": linear_extrude,
}


def rays(camera: Any, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """The eye, and for each pixel the way to depth 1, (H * W, 3)."""
    eye = np.array(camera.center)
    forward = np.subtract(camera.look_at, eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    width, height = size
    half = math.tan(math.radians(camera.fov_degrees) / 2)
    x = (np.arange(width) + 0.5 - width / 2) * 2 * half / height
    y = (np.arange(height) + 0.5 - height / 2) * 2 * half / height
    ways = forward + y[:, None, None] * down + x[:, None] * right
    return eye, ways.reshape(-1, 3)


def judged(path: Path, backend: str = "auto", size: tuple[int, int] = SIZE) -> tuple[int, int, int]:
    """Rays of a file that are judged, hits among them, and those that are wrong."""
    scene = load(path)
    inside = Reader(path.read_text(encoding="utf-8-sig")).whole()
    frame = halfstep.render(scene, size=size, steps=20, backend=backend, outputs=("depth", "error"))
    depth, error = frame.depth.ravel(), frame.error.ravel()
    hit, known = (frame.solid >= 0).ravel(), np.isfinite(frame.error).ravel()
    eye, ways = rays(scene.camera, size)
    assert scene.volume is not None
    volume = np.array([scene.volume.min, scene.volume.max])
    whole = float(np.ptp(volume, axis=0).max())
    near = NEAR * whole
    middle = float(np.linalg.norm(volume.mean(axis=0) - eye))
    low, high = max(middle - whole, 1e-6 * whole), middle + whole
    lengths = np.linalg.norm(ways, axis=1)
    wrong = np.zeros(len(ways), bool)
    seen = np.zeros(len(ways), bool)
    for at in np.linspace(low, high, SAMPLES) / lengths[:, None].min():
        points = eye + at * ways
        sure = inside(points)
        for axis in (*np.eye(3), *-np.eye(3)):  # one that is near a face is not judged
            sure[sure] = inside(points[sure] + near * axis)
        seen |= sure
        wrong |= sure & np.where(hit, at < depth - error - near, True)
    # Somewhere just behind a hit there is a point of the model; a wedge may be thin there.
    behind = np.zeros(len(ways), bool)
    for step in (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 16.0):
        at = np.where(hit, depth + error + step * near, 0.0)
        behind |= inside(eye + at[:, None] * ways)
    wrong |= hit & ~behind
    return int(known.sum()), int((hit & known).sum()), int((wrong & known).sum())


def main() -> int:
    """Judge the files of a folder; 1 if a ray of them is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    total = np.zeros(4, int)
    for path in sorted(parser.parse_args().folder.glob("*.csg")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                load(path)
            except SceneError:
                continue
            found = judged(path)
        total += (1, *found)
        sys.stdout.write(f"{path.name}: {found[0]} rays, {found[1]} hits, {found[2]} wrong\n")
        sys.stdout.flush()
    files, judged_rays, hits, wrong = total
    sys.stdout.write(f"{files} files, {judged_rays} rays, {hits} hits, {wrong} wrong\n")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
