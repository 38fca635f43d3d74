"""`halfstep doctor`: adapters and drivers, what is chosen and why."""

from __future__ import annotations

import argparse
import platform
from typing import Any

from halfstep import __version__
from halfstep.cli.output import print_json
from halfstep.errors import AdapterError


def add(commands: Any) -> None:
    """Add the command to a parser's commands."""
    doctor = commands.add_parser("doctor", help="list adapters, drivers, and what is chosen")
    doctor.set_defaults(run=run)
    doctor.add_argument("--json", action="store_true", help="the same for machines")


def run(arguments: argparse.Namespace) -> int:
    """Report; the exit code."""
    import numpy as np

    from halfstep.device import describe

    report = {"halfstep": __version__, "python": platform.python_version(), "numpy": np.__version__}
    report |= describe()
    if arguments.json:
        print_json(report)
    else:
        _print_report(report)
    if report["chosen"] is None:
        raise AdapterError(report["reason"])
    return 0


def _print_report(report: dict[str, Any]) -> None:
    print(
        f"halfstep {report['halfstep']}, Python {report['python']}, NumPy {report['numpy']}, "
        f"wgpu {report['wgpu']}, wgpu-native {report['wgpu_native']}"
    )
    for name, value in report["environment"].items():
        print(f"{name}={value}")
    for adapter in report["adapters"]:
        print(
            f"adapter {adapter['index']}: {adapter['name']}, {adapter['kind']}, "
            f"{adapter['backend']}, driver {adapter['driver'] or 'unnamed'}, "
            f"vendor {adapter['vendor']}"
        )
    if report["chosen"] is not None:
        print(f"chosen: adapter {report['chosen']}, {report['reason']}")
        print(f"features: {', '.join(report['features']) or 'none that Halfstep uses'}")
