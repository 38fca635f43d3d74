"""`halfstep render`: a scene to a picture."""

from __future__ import annotations

import argparse
from typing import Any

from halfstep.cli.options import add_scene, add_tolerances
from halfstep.cli.output import print_json, say


def add(commands: Any) -> None:
    """Add the command to a parser's commands."""
    render = commands.add_parser("render", help="render a scene to an image file")
    render.set_defaults(run=run)
    add_scene(render)
    render.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="image file; its ending is .png"
    )
    accuracy = render.add_mutually_exclusive_group()
    accuracy.add_argument("--steps", metavar="N", type=int, help="halvings of every ray")
    add_tolerances(accuracy)
    render.add_argument(
        "--format", choices=("float32", "fixed32"), dest="number_format", help="number format"
    )
    render.add_argument(
        "--method", choices=("visible", "article"), help="joint logic first, or the paper's own"
    )
    render.add_argument("--samples", metavar="K", type=int, help="KxK samples in each pixel")
    render.add_argument("--json", action="store_true", help="describe the result on stdout")


def run(arguments: argparse.Namespace) -> int:
    """Render; the exit code."""
    from halfstep.api import render
    from halfstep.image import check_output_path, write_png
    from halfstep.scene import load

    check_output_path(arguments.output)
    frame = render(
        load(arguments.scene),
        size=arguments.size,
        steps=arguments.steps,
        tolerance_pixels=arguments.tolerance_pixels,
        tolerance=arguments.tolerance,
        number_format=arguments.number_format,
        method=arguments.method,
        samples=arguments.samples,
        outputs=("image",),
        backend=arguments.backend,
        adapter=arguments.adapter,
    )
    write_png(arguments.output, frame.image)
    height, width, _ = frame.image.shape
    info = frame.info
    if arguments.json:
        print_json({"path": arguments.output, "size": [width, height], "info": info})
    say(
        f"{arguments.output}: {width}x{height} in {info['wall_ms'] / 1000:.2f} s on "
        f"{info['adapter']}"
    )
    return 0
