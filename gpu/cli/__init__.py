"""The command `halfstep`: it takes arguments, and gives files and exit codes.

Results for machines go to stdout, messages for people to stderr. Exit codes: 0 done, 1 failed,
2 usage or scene error, 3 no suitable adapter, 4 device lost or driver failure, 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence

from halfstep.cli import (
    animate,
    bench,
    check,
    doctor,
    import_,
    info,
    render,
    scenes,
    schema,
    shader,
    tune,
    view,
)
from halfstep.cli.output import open_closed_streams, say, writing_stdout
from halfstep.errors import HalfstepError
from halfstep.version import __version__

EXIT_INTERRUPTED = 130  # the code by which a shell reports SIGINT
# The commands in the order of the help. Each module adds its command to a parser.
COMMANDS = (
    render,
    animate,
    view,
    import_,
    info,
    tune,
    check,
    bench,
    doctor,
    scenes,
    schema,
    shader,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv``, by default the process's arguments; return the exit code."""
    open_closed_streams()
    try:
        code = _run(argv)
        with writing_stdout():
            sys.stdout.flush()
    except HalfstepError as error:
        say(str(error))
        return error.exit_code
    except MemoryError:
        say("not enough memory for this picture")
        return HalfstepError.exit_code
    except KeyboardInterrupt:
        say("interrupted")
        return EXIT_INTERRUPTED
    except OSError as error:
        say(f"{error.filename}: {error.strerror}" if error.filename else str(error.strerror))
        return HalfstepError.exit_code
    return code


def _run(argv: Sequence[str] | None) -> int:
    """Parse the arguments and run the command; return the exit code."""
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as exit_:
        return int(exit_.code or 0)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: say(f"warning: {message}")
        code: int = arguments.run(arguments)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="halfstep",
        description="Images of second-order surfaces and polyhedra, by n halvings per ray.",
    )
    parser.add_argument("--version", action="version", version=f"halfstep {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add(commands)
    return parser
