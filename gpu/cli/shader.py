"""`halfstep shader`: prints the shader that renders a scene."""

from __future__ import annotations

import argparse

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import Commands, add_accuracy, add_conveyor, add_size, names, overrides
from halfstep.cli.output import print_text, telling


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    shader = commands.add_parser(
        "shader",
        help="print the shader that renders a scene",
        description="Print the WGSL of the first frame of a scene as a graphics card gets it. On "
        "a processor, invocations fetch and store together, and later frames get shaders of "
        "fewer classes of solids.",
    )
    shader.set_defaults(run=run, samples=None)
    shader.add_argument("scene", metavar="SCENE", help="a scene file, or a name `scenes` lists")
    shader.add_argument(
        "--outputs", metavar="NAMES", type=names, default=["image"], help="by default image"
    )
    add_size(shader)
    add_accuracy(shader, steps=True)
    add_conveyor(shader)
    add_look(shader)


def run(arguments: argparse.Namespace) -> int:
    """Print the shader, and return the exit code."""
    from halfstep.frames.outputs import check_outputs, device_outputs
    from halfstep.host.prepare import prepare
    from halfstep.models import load
    from halfstep.run.framebuffer import written_for
    from halfstep.run.needs import needs_of_frame
    from halfstep.scene import with_overrides
    from halfstep.shader.source import compose

    with telling() as begin:
        scene = load(arguments.scene, look_of(arguments), begin)
    scene = with_overrides(scene, **overrides(arguments))
    outputs = device_outputs(check_outputs(arguments.outputs))
    packed = prepare(scene)
    needs = needs_of_frame(packed, scene.accuracy.method, written_for(outputs, packed))
    print_text(compose(needs).rstrip())
    return 0
