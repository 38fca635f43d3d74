"""`halfstep info`: how a picture was made, as its file tells it."""

from __future__ import annotations

import argparse
from typing import Any

from halfstep.cli.options import Commands
from halfstep.cli.output import print_json, print_text
from halfstep.errors import HalfstepError


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    info = commands.add_parser("info", help="tell how a picture was made")
    info.set_defaults(run=run)
    info.add_argument("file", metavar="FILE", help="a file that Halfstep has written")
    info.add_argument("--json", action="store_true", help="the same for machines")


def run(arguments: argparse.Namespace) -> int:
    """Read the file and report; the exit code."""
    from halfstep.files import read_provenance

    facts = read_provenance(arguments.file)
    if facts is None:
        raise HalfstepError(
            f"{arguments.file}: does not say how it was made; Halfstep did not write it, or "
            "another program has written it again"
        )
    if arguments.json:
        print_json(facts)
        return 0
    width = max(map(len, facts))
    for name, value in facts.items():
        print_text(f"{name:{width}}  {_plain(value)}".rstrip())
    return 0


def _plain(value: Any) -> str:
    """``value`` on one line, without signs that would steer a terminal."""
    text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    return text if text.isprintable() else text.encode("unicode_escape").decode()
