"""`halfstep bench`: measures times on this machine, each in comparison."""

from __future__ import annotations

import argparse

from halfstep.cli.options import Commands, add_adapter, add_output
from halfstep.cli.output import print_json, print_text, progress_bar, say
from halfstep.errors import UsageError

# The names of the parts. Importing ``bench.parts`` would slow down every command; a test compares.
PARTS = (
    "halving",
    "steps",
    "closed",
    "povray",
    "formulas",
    "twin",
    "frames",
    "regions",
    "shadows",
    "mirrors",
    "cold",
    "solids",
    "setup",
    "pixels",
    "threads",
)


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    bench = commands.add_parser("bench", help="measure the speed of this machine, in some minutes")
    bench.set_defaults(run=run)
    bench.add_argument(
        "--only",
        metavar="PART,…",
        help=f"some of the parts: {', '.join(PARTS)}",
        default=",".join(PARTS),
    )
    bench.add_argument("--rounds", metavar="N", type=int, default=5, help="rounds of all cases")
    add_adapter(bench)
    add_output(bench, "FILE.png", "a plot of the curves", required=False)
    bench.add_argument("--json", action="store_true", help="print the report as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Measure, and return the exit code."""
    names = _names(arguments.only)
    if arguments.rounds < 1:
        raise UsageError(f"rounds: {arguments.rounds} is not >= 1")
    if arguments.output is not None:
        from halfstep.bench.plot import check

        check(arguments.output)

    from halfstep.bench.measure import measure
    from halfstep.device.adapters import choose_adapter

    adapter = choose_adapter(arguments.adapter)
    with progress_bar("measuring") as progress:
        report = measure(adapter, names, arguments.rounds, progress)
    if arguments.json:
        print_json(report.as_dict())
    else:
        print_text(report.as_text())
    if arguments.output is not None:
        from halfstep.bench.plot import write

        write(report, arguments.output)
        say(arguments.output)
    return 0


def _names(only: str) -> tuple[str, ...]:
    """The parts asked for, in the order of the report."""
    asked = only.split(",")
    unknown = [repr(name) for name in asked if name not in PARTS]
    if unknown:
        raise UsageError(f"only: {', '.join(unknown)}: the parts are {', '.join(PARTS)}")
    return tuple(name for name in PARTS if name in asked)
