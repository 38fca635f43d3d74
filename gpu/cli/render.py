"""`halfstep render`: a scene to a picture."""

from __future__ import annotations

import argparse
from typing import Any

from halfstep.cli.options import add_output, add_rendering, add_scene, overrides
from halfstep.cli.output import print_json, say


def add(commands: Any) -> None:
    """Add the command to a parser's commands."""
    render = commands.add_parser("render", help="render a scene to a file")
    render.set_defaults(run=run)
    add_scene(render)
    add_output(render, "FILE", "its ending, .png, .tif, .exr or .npz, decides its type")
    render.add_argument(
        "--outputs",
        metavar="NAMES",
        type=_names,
        help="what to write, as depth,normal; by default what such a file usually has",
    )
    add_rendering(render)
    render.add_argument("--json", action="store_true", help="describe the result on stdout")


def _names(text: str) -> list[str]:
    """Names between commas; whether they are outputs is the file's to say."""
    return [name.strip() for name in text.split(",")]


def run(arguments: argparse.Namespace) -> int:
    """Render; the exit code."""
    from halfstep.api import render
    from halfstep.files import plan, write
    from halfstep.scene import load

    outputs = plan(arguments.output, arguments.outputs)
    frame = render(
        load(arguments.scene),
        **overrides(arguments),
        outputs=outputs,
        backend=arguments.backend,
        adapter=arguments.adapter,
    )
    facts = write(arguments.output, frame, arguments.outputs)
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
