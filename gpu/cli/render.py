"""`halfstep render`: renders a scene to a picture."""

from __future__ import annotations

import argparse
import sys
from io import BytesIO

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import (
    STDOUT,
    Commands,
    add_output,
    add_rendering,
    add_scene,
    names,
    overrides,
)
from halfstep.cli.output import is_nowhere, print_bytes, print_json, say, telling
from halfstep.errors import UsageError


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    render = commands.add_parser("render", help="render a scene to a file")
    render.set_defaults(run=run)
    add_scene(render)
    add_output(
        render,
        "FILE",
        "the ending, .png, .tif, .exr or .npz, decides the type; - writes a PNG to stdout",
        stdout=True,
    )
    render.add_argument(
        "--outputs",
        metavar="NAMES",
        type=names,
        help="outputs to write, such as depth,normal; by default the usual ones of the file's type",
    )
    add_rendering(render)
    add_look(render)
    render.add_argument("--json", action="store_true", help="describe the result on stdout")


def _check_stdout(arguments: argparse.Namespace) -> None:
    """Check before rendering that a picture can go to stdout.

    Raises:
        UsageError: JSON goes to stdout, or stdout is a terminal or closed.
    """
    if arguments.json:
        raise UsageError("--json: stdout is the picture where -o is -")
    if is_nowhere(sys.stdout):
        raise UsageError("-o -: stdout is closed; name a file")
    if sys.stdout.isatty():
        raise UsageError("-o -: stdout is a terminal, which shows no picture; name a file")


def run(arguments: argparse.Namespace) -> int:
    """Render, and return the exit code."""
    from halfstep.files import File, plan, write
    from halfstep.frames.renderer import render
    from halfstep.models import load

    with telling() as begin:
        scene = load(arguments.scene, look_of(arguments), begin)
        file: File = arguments.output
        format_ = None
        if file == STDOUT:
            _check_stdout(arguments)
            file, format_ = BytesIO(), "png"
        outputs = plan(file, arguments.outputs, format=format_, solids=len(scene.solids))
        begin("rendering")
        frame = render(
            scene,
            **overrides(arguments),
            outputs=outputs,
            backend=arguments.backend,
            adapter=arguments.adapter,
        )
        begin(f"writing {arguments.output}")
        facts = write(file, frame, arguments.outputs, format=format_)
    if (frame.solid < 0).all():
        say("warning: no ray meets anything: only the background is seen")
    if isinstance(file, BytesIO):
        print_bytes(file.getvalue())
    height, width = getattr(frame, outputs[0]).shape[:2]
    info = frame.info
    result = {"path": arguments.output, "size": [width, height], "outputs": facts["outputs"]}
    note = ""
    if "range" in facts:
        result["range"] = facts["range"]
        low, high = facts["range"]
        [name] = outputs
        note = f"; 1…65535 are {name} {low:.6g}…{high:.6g}, 0 is where nothing is hit"
    if arguments.json:
        print_json(result | {"info": info})
    say(
        f"{arguments.output}: {width}x{height} in {info['wall_ms'] / 1000:.2f} s on "
        f"{info['adapter']}{note}"
    )
    return 0
