"""The same picture by POV-Ray, where it is installed."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from halfstep.scene import Ellipsoid, Scene, Sphere

_TRACE = re.compile(r"Trace Time:.*\((\d+\.\d+) seconds\)")


class NoPovrayError(Exception):
    """POV-Ray is not there, or does not render; the message says which."""


def version() -> str:
    """What POV-Ray calls itself.

    Raises:
        NoPovrayError: it is not installed.
    """
    if shutil.which("povray") is None:
        raise NoPovrayError("POV-Ray is not installed")
    done = subprocess.run(["povray", "--version"], capture_output=True, text=True)
    named = re.search(r"^POV-Ray \S+", done.stdout + done.stderr, re.MULTILINE)
    return named[0] if named else "POV-Ray"


def trace_time(
    scene: Scene, size: tuple[int, int], threads: int, picture: Path | None = None
) -> float:
    """Milliseconds that POV-Ray says it traced ``scene``, without parsing and without a file.

    Args:
        scene: as `text`.
        size: (width, height) in pixels.
        threads: how many it may use.
        picture: where to write a PNG file, if one is wanted.

    Raises:
        NoPovrayError: it is not installed, or it fails.
    """
    version()
    width, height = size
    output = "-F" if picture is None else f"+FN +O{picture}"
    with tempfile.TemporaryDirectory(prefix="halfstep-") as folder:
        source = Path(folder) / "scene.pov"
        source.write_text(text(scene, width / height))
        done = subprocess.run(
            [
                *("povray", f"+I{source}", f"+W{width}", f"+H{height}", f"+WT{threads}"),
                *("-D", "-A", *output.split()),
            ],
            cwd=folder,
            capture_output=True,
            text=True,
        )
    found = _TRACE.search(done.stderr)
    if done.returncode or found is None:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise NoPovrayError(f"povray does not render: {last}")
    return float(found[1]) * 1e3


def text(scene: Scene, aspect: float) -> str:
    """A scene of spheres and unturned ellipsoids, one light each way, as POV-Ray reads it.

    Shadows of the lights that have them and no other second ray, so that both programs compute the
    same picture.
    """
    camera, ambient = scene.camera, _vector(scene.ambient.color)
    assert camera.fov_degrees is not None
    lines = [
        "#version 3.7;",
        "global_settings { assumed_gamma 1 max_trace_level 1 ambient_light rgb 1 }",
        f"background {{ rgb {_vector(scene.image.background)} }}",
        # Right-handed: POV-Ray's axes are not, unless its right points the other way.
        f"camera {{ perspective location {_vector(camera.center)} sky {_vector(camera.up)}"
        f" up y right {-aspect:.17g}*x angle {_horizontal(camera.fov_degrees, aspect):.17g}"
        f" look_at {_vector(camera.look_at)} }}",
    ]
    for light in scene.lights:
        assert light.direction is not None
        far = tuple(1e6 * part for part in light.direction)
        lines.append(
            f"light_source {{ {_vector(far)} rgb {_vector(light.color)} parallel point_at 0"
            f"{'' if light.shadows else ' shadowless'} }}"
        )
    for solid in scene.solids:
        assert isinstance(solid, Sphere | Ellipsoid)
        assert solid.color is not None
        shape = (
            f"0, {solid.radius:.17g}"
            if isinstance(solid, Sphere)
            else f"0, 1 scale {_vector(solid.semi_axes)}"
        )
        lines.append(
            f"sphere {{ {shape} translate {_vector(solid.origin)} pigment {{ rgb"
            f" {_vector(solid.color)} }} finish {{ ambient rgb {ambient} diffuse 1 }} }}"
        )
    return "\n".join(lines) + "\n"


def _horizontal(vertical_degrees: float, aspect: float) -> float:
    """The angle of view across, degrees."""
    half = math.tan(math.radians(vertical_degrees) / 2) * aspect
    return 2 * math.degrees(math.atan(half))


def _vector(values: tuple[float, ...]) -> str:
    return f"<{', '.join(f'{value:.17g}' for value in values)}>"
