"""`halfstep animate`: renders a scene to an animated file or a folder of frames."""

from __future__ import annotations

import argparse
import itertools
import os
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import Commands, add_output, add_rendering, add_scene, overrides
from halfstep.cli.output import print_json, progress_bar, say, telling
from halfstep.errors import UsageError

if TYPE_CHECKING:
    from halfstep.frames.frame import Frame, Info
    from halfstep.scene import Scene

# The number of rendered frames, and the info of the first one.
Result = tuple[int, "Info | None"]


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    animate = commands.add_parser("animate", help="render a scene's animation")
    animate.set_defaults(run=run)
    add_scene(animate)
    add_output(
        animate,
        "FILE|DIR",
        "a file that ends in .gif, .png, .webp or .mp4, or a folder for a PNG of each frame",
    )
    animate.add_argument("--frames", metavar="N", type=int, help="number of frames")
    animate.add_argument("--fps", metavar="X", type=float, help="frames in a second")
    animate.add_argument(
        "--frames-range",
        metavar="A:B",
        type=_range,
        help="render only frames A to B of 0 to N-1, for example on one of several machines",
    )
    animate.add_argument(
        "--overwrite", action="store_true", help="render frames in the folder again"
    )
    add_rendering(animate)
    add_look(animate)
    animate.add_argument("--json", action="store_true", help="describe the result on stdout")


def _range(text: str) -> range:
    """The numbers A, A + 1, … B of ``A:B``. The scene decides whether such frames exist."""
    match = re.fullmatch(r"(\d+):(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B, as 0:29")
    first, last = int(match[1]), int(match[2])
    if last < first:
        raise argparse.ArgumentTypeError(f"{text!r} has no frame from A up to B")
    return range(first, last + 1)


def _is_folder(path: Path) -> bool:
    """Whether ``path`` is a folder. `check_movie` reports a faulty path."""
    with suppress(OSError):  # up to Python 3.13, for example for too long a name
        return path.is_dir()
    return False


def run(arguments: argparse.Namespace) -> int:
    """Render, and return the exit code."""
    from halfstep.models import load
    from halfstep.scene import with_animation, with_overrides

    with telling() as tell:
        scene = load(arguments.scene, look_of(arguments), tell)
    scene = with_animation(scene, frames=arguments.frames, fps=arguments.fps)
    scene = with_overrides(scene, **overrides(arguments))
    numbers = _numbers(scene, arguments.frames_range)
    path = Path(arguments.output)
    begin = time.monotonic()
    # A path without an ending is a folder, whether it exists or not.
    if arguments.output.endswith(os.sep) or not path.suffix or _is_folder(path):
        rendered, info = _to_folder(arguments, scene, numbers)
    else:
        rendered, info = _to_file(arguments, scene, numbers)
    seconds = time.monotonic() - begin
    width, height = scene.image.width, scene.image.height
    kept = len(numbers) - rendered
    if arguments.json:
        print_json(
            {
                "path": arguments.output,
                "size": [width, height],
                "frames_range": [numbers[0], numbers[-1]],
                "rendered": rendered,
                "kept": kept,
                "seconds": seconds,
                "info": info,
            }
        )
    told = f"{rendered} frame{'s' * (rendered != 1)} of {width}x{height} in {seconds:.2f} s"
    if info is not None:
        told += f" on {info['adapter']}"
    if kept:
        told += f", {kept} were there"
    say(f"{arguments.output}: {told}")
    return 0


def _numbers(scene: Scene, asked: range | None) -> range:
    """The numbers of the requested frames, by default all."""
    count = scene.effective_animation().frames
    if asked is None:
        return range(count)
    if asked[-1] >= count:
        raise UsageError(f"--frames-range {asked[0]}:{asked[-1]}: the frames are 0 to {count - 1}")
    return asked


def _to_folder(arguments: argparse.Namespace, scene: Scene, numbers: range) -> Result:
    from halfstep.files.folder import FrameFolder, manifest

    facts = manifest(scene, arguments.backend, arguments.adapter)
    folder = FrameFolder(arguments.output, facts, overwrite=arguments.overwrite)
    missing = folder.missing(numbers)
    info = None
    if missing:
        with _rendering(arguments, scene, missing) as (first, frames):
            folder.begin(missing)
            for number, frame in zip(missing, frames, strict=True):
                folder.write(number, frame)
        info = first.info
    folder.tidy()
    return len(missing), info


def _to_file(arguments: argparse.Namespace, scene: Scene, numbers: range) -> Result:
    from halfstep.files.movie import check_movie, write_movie
    from halfstep.files.provenance import Provenance, provenance

    fps = scene.effective_animation().fps
    check_movie(arguments.output, (scene.image.width, scene.image.height), fps)
    with _rendering(arguments, scene, numbers) as (first, frames):
        # The facts are those of the first frame, except the hash, which is the animated scene's.
        facts: Provenance = {
            **provenance(first.info),
            "scene_sha256": scene.sha256,
            "frames_range": [numbers[0], numbers[-1]],
            "fps": fps,
        }
        write_movie(arguments.output, (frame.image for frame in frames), fps, facts)
    return len(numbers), first.info


@contextmanager
def _rendering(
    arguments: argparse.Namespace, scene: Scene, numbers: Sequence[int]
) -> Iterator[tuple[Frame, Iterator[Frame]]]:
    """The first frame, and an iterator over all frames that moves a progress bar.

    The first frame shows most faults, so it is rendered before any file is touched.
    """
    from halfstep.frames.sequence import render_frames

    frames = render_frames(scene, numbers, backend=arguments.backend, adapter=arguments.adapter)
    with progress_bar("rendering", frames=len(numbers)) as progress:

        def counted() -> Iterator[Frame]:
            for done, frame in enumerate(itertools.chain([first], frames), 1):
                yield frame
                progress(done / len(numbers))

        first = next(frames)
        yield first, counted()
