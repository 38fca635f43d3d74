"""`halfstep shader`: the text of the shader that renders a scene."""

from __future__ import annotations

import argparse
from typing import Any

from halfstep.cli.options import add_conveyor, add_size, add_tolerances, names, overrides
from halfstep.cli.output import print_text


def add(commands: Any) -> None:
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
    accuracy = shader.add_mutually_exclusive_group()
    accuracy.add_argument("--steps", metavar="N", type=int, help="halvings of every ray")
    add_tolerances(accuracy)
    add_conveyor(shader)


def run(arguments: argparse.Namespace) -> int:
    """Print it; the exit code."""
    from halfstep.frames.frame import check_outputs, device_outputs
    from halfstep.host import camera, geometry
    from halfstep.host.pack import pack, surfaces
    from halfstep.host.setup import setup
    from halfstep.host.steps import steps_for
    from halfstep.run.framebuffer import written_for
    from halfstep.scene import load, with_overrides
    from halfstep.shader.needs import needs_of
    from halfstep.shader.source import compose

    scene = with_overrides(load(arguments.scene), **overrides(arguments))
    outputs = device_outputs(check_outputs(arguments.outputs))
    solids = geometry.build(scene)
    view = camera.view(scene.camera, (scene.image.width, scene.image.height))
    base_planes = camera.base_planes(view, *geometry.volume_box(scene, solids))
    constants = setup(solids, view, *base_planes)
    steps = steps_for(scene, constants).count
    packed = pack(scene, solids, surfaces(scene, solids), constants, steps)
    needs = needs_of(packed, scene.accuracy.method, written_for(outputs, packed))
    print_text(compose(needs).rstrip())
    return 0
