"""`halfstep import`: converts a file of another program to a scene file."""

from __future__ import annotations

import argparse

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import Commands, add_output
from halfstep.cli.output import say, telling
from halfstep.errors import UsageError


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    command = commands.add_parser("import", help="convert a file of another program to a scene")
    command.set_defaults(run=run)
    command.add_argument(
        "file",
        metavar="FILE",
        help="geometry.xml or model.xml of OpenMC, .csg of OpenSCAD, or .jsurf of SURFER",
    )
    add_output(command, "SCENE", "the scene file, whose name ends in .toml")
    add_look(command)


def run(arguments: argparse.Namespace) -> int:
    """Write the scene file, and return the exit code."""
    from pathlib import Path

    from halfstep.files.whole import check_output_path, write_file
    from halfstep.models import is_model, load

    check_output_path(arguments.output, (".toml",))
    if not is_model(arguments.file):
        raise UsageError(f"{arguments.file}: is no file of another program")
    with telling() as begin:
        scene = load(arguments.file, look_of(arguments), begin)
        begin(f"writing {arguments.output}")
        write_file(Path(arguments.output), scene.to_toml().encode())
    say(f"{arguments.output}: {arguments.file} as a scene")
    return 0
