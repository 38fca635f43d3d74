"""`halfstep schema`: prints the JSON Schema of scene files."""

from __future__ import annotations

import argparse

from halfstep.cli.options import Commands
from halfstep.cli.output import print_json


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    schema = commands.add_parser("schema", help="print the JSON Schema of scene files")
    schema.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:  # noqa: ARG001 - every command takes them
    """Print the schema, and return the exit code."""
    from halfstep.scene import json_schema

    print_json(json_schema())
    return 0
