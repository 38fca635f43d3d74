"""`halfstep scenes`: lists the bundled scenes."""

from __future__ import annotations

import argparse

from halfstep.cli.options import Commands
from halfstep.cli.output import print_json, print_text


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    scenes = commands.add_parser("scenes", help="list the bundled scenes")
    scenes.set_defaults(run=run)
    scenes.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> int:
    """List the scenes, and return the exit code."""
    from halfstep.scene import bundled_scenes

    titles = bundled_scenes()
    if arguments.json:
        print_json([{"name": name, "title": title} for name, title in titles.items()])
        return 0
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print_text(f"{name:{width}}  {title}".rstrip())
    return 0
