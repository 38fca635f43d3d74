"""`halfstep check`: compares scenes on the device with NumPy; finds overlaps in OpenMC geometry."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from halfstep.cli.options import (
    Commands,
    add_adapter,
    add_conveyor,
    add_output,
    add_size,
    overrides,
)
from halfstep.cli.output import print_json, print_text, say, telling
from halfstep.errors import HalfstepError, UsageError
from halfstep.version import __version__

if TYPE_CHECKING:
    from halfstep.check.checker import SceneReport


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    check = commands.add_parser("check", help="compare a device with NumPy, scene by scene")
    check.set_defaults(run=run)
    which = check.add_mutually_exclusive_group(required=True)
    which.add_argument(
        "scene", metavar="SCENE", nargs="?", help="a scene file, or a name `scenes` lists"
    )
    which.add_argument("--all", action="store_true", help="all bundled scenes")
    add_size(check)
    add_conveyor(check)
    add_adapter(check)
    add_output(
        check,
        "DIR",
        "folder for check.json, and for a picture of each scene that differs",
        required=False,
    )
    check.add_argument(
        "--points", metavar="N", type=int, help="also test N points, for geometry of OpenMC"
    )
    check.add_argument("--json", action="store_true", help="print the report as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Check, and return the exit code."""
    from halfstep.check.checker import Checker
    from halfstep.files.whole import check_output_folder
    from halfstep.models import is_geometry, load
    from halfstep.scene import bundled_scenes, with_overrides

    if is_geometry(arguments.scene):
        return _check_model(arguments)
    if arguments.points is not None:
        raise UsageError("--points: is of geometry of OpenMC")
    if arguments.output is not None:
        check_output_folder(arguments.output)
    names = bundled_scenes() if arguments.all else [arguments.scene]
    with telling() as begin:
        loaded = [load(name, begin=begin) for name in names]
    scenes = [with_overrides(each, **overrides(arguments)) for each in loaded]
    reports: list[SceneReport] = []
    # Scenes that cannot be rendered. They do not keep the others from being checked.
    refused: dict[str, HalfstepError] = {}
    with Checker(arguments.adapter) as checker:
        fingerprint = checker.fingerprint
        say(f"{fingerprint.stack['adapter']}, {fingerprint.stack['driver']}: {fingerprint}")
        for scene in scenes:
            try:
                reports.append(checker.check(scene))
            except HalfstepError as refusal:
                if not arguments.all:
                    raise
                refused[scene.name] = refusal
            if not arguments.json:
                error = refused.get(scene.name)
                print_text(str(reports[-1]) if error is None else f"{scene.name}: {error}")
    differ = [report.scene.name for report in reports if not report.agrees]
    agree = not (differ or refused)
    result = {
        "halfstep": __version__,
        "agree": agree,
        "canary": fingerprint.as_dict(),
        "scenes": [report.as_dict() for report in reports],
        "refused": {name: str(error) for name, error in refused.items()},
    }
    if arguments.output is not None:
        _write(Path(arguments.output), result, reports)
    if arguments.json:
        print_json(result)
    if arguments.all:
        failed = ", ".join([*differ, *refused])
        count = len(scenes) - len(differ) - len(refused)
        say(f"{count} of {len(scenes)} scenes agree" + (f"; not: {failed}" if failed else ""))
    if refused and not differ:
        return next(iter(refused.values())).exit_code
    return 0 if agree else 1


def _check_model(arguments: argparse.Namespace) -> int:
    """Look for overlaps and gaps in a file of OpenMC, and return the exit code."""
    from halfstep.models import check

    points = arguments.points or 0
    if points < 0:
        raise UsageError(f"--points: {points} is not >= 0")
    with telling() as begin:
        report = check(arguments.scene, points=points, begin=begin)
    if arguments.json:
        print_json(report.as_dict())
    else:
        for line in report.lines():
            print_text(line)
    asked = f" and {report.points} points" if report.points else ""
    found = ", ".join(
        f"{len(each)} {what}{'s' * (len(each) != 1)}"
        for each, what in ((report.overlaps, "overlap"), (report.gaps, "gap"))
    )
    say(f"{report.name}: {found} on {report.rays} rays{asked}")
    return 0 if report.is_sound else 1


def _write(folder: Path, result: dict[str, Any], reports: list[SceneReport]) -> None:
    """Write the report, and a picture for each scene that differs.

    Raises:
        UsageError: the folder cannot be made.
        HalfstepError: the system refuses to write, for example on a full disk.
    """
    from halfstep.files.whole import write_file

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: {error.strerror}") from error
    write_file(folder / "check.json", (json.dumps(result, indent=2) + "\n").encode())
    for report in reports:
        if report.picture is not None:
            write_file(folder / f"{report.scene.name}.png", report.picture)
