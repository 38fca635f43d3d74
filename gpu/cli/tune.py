"""`halfstep tune`: measures the cost of accuracy in a scene."""

from __future__ import annotations

import argparse
import re

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import Commands, add_accuracy, add_conveyor, add_output, add_scene
from halfstep.cli.output import print_json, print_text, progress_bar, say, telling


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    tune = commands.add_parser("tune", help="measure the cost of accuracy, and recommend steps")
    tune.set_defaults(run=run)
    add_scene(tune)
    add_output(tune, "DIR", "folder for tune.csv, tune.json, tune.png and error.png")
    tune.add_argument(
        "--steps", metavar="A:B[:S]", type=_steps, help="numbers of halvings from A to B by S"
    )
    add_accuracy(tune, steps=False)
    add_conveyor(tune, otherwise="by default both")
    add_look(tune)
    tune.add_argument("--json", action="store_true", help="print the report as JSON")


def _steps(text: str) -> range:
    """The numbers A, A + S, … up to B of ``A:B:S``. The scene decides whether they are allowed."""
    match = re.fullmatch(r"(\d+)(?::(\d+)(?::(\d+))?)?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B or A:B:S, as 8:20:2")
    first, last, stride = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
    if last < first or stride < 1:
        raise argparse.ArgumentTypeError(f"{text!r} has no number from A up to B by S")
    # No scene allows such large numbers, and a long list of them would fill the memory.
    return range(first, min(last, first + 9999) + 1, stride)


def run(arguments: argparse.Namespace) -> int:
    """Measure, and return the exit code."""
    from halfstep.files.whole import check_output_folder
    from halfstep.models import load
    from halfstep.tune.measure import tune
    from halfstep.tune.plot import scale_of, write

    check_output_folder(arguments.output)
    with telling() as begin:
        scene = load(arguments.scene, look_of(arguments), begin)
    with progress_bar("measuring") as progress:
        report = tune(
            scene,
            size=arguments.size,
            steps=arguments.steps,
            tolerance_pixels=arguments.tolerance_pixels,
            tolerance=arguments.tolerance,
            methods=(arguments.method,) if arguments.method else None,
            formats=(arguments.number_format,) if arguments.number_format else None,
            backend=arguments.backend,
            adapter=arguments.adapter,
            progress=progress,
        )
    names = write(report, arguments.output)
    if arguments.json:
        print_json(report.as_dict())
    else:
        print_text(report.as_table())
    low, high = scale_of(report)
    say(
        f"{arguments.output}: {', '.join(names)}; the colours of error.png are errors of {low:g} "
        f"to {high:g} pixel widths"
    )
    if "tune.png" not in names:
        say("tune.png needs Matplotlib: pip install 'halfstep[plot]'")
    return 0
