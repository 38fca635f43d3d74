"""`halfstep doctor`: lists adapters, explains the choice, and tests whether the driver computes."""

from __future__ import annotations

import argparse
import platform
from typing import TYPE_CHECKING, Any

from halfstep.cli.options import Commands
from halfstep.cli.output import print_json, print_text
from halfstep.errors import AdapterError, DeviceError, HalfstepError
from halfstep.version import __version__

if TYPE_CHECKING:
    from halfstep.device.canary import Fingerprint


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    doctor = commands.add_parser("doctor", help="list adapters and drivers, and test the driver")
    doctor.set_defaults(run=run)
    doctor.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> int:
    """Report, and return the exit code."""
    import numpy as np

    from halfstep.device.adapters import describe

    report: dict[str, Any] = {
        "halfstep": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        **describe(),
        "canary": None,
    }
    found: Fingerprint | None = None
    fault: HalfstepError | None = None
    try:
        if report["chosen"] is None:
            raise AdapterError(report["reason"])
        found = _canary()
        report["canary"] = found.as_dict()
    except (AdapterError, DeviceError) as error:
        fault = error
    if arguments.json:
        print_json(report)
    else:
        _print_report(report, found)
    if fault is not None:
        raise fault
    return 0


def _canary() -> Fingerprint:
    """The result of a kernel with known answers on the chosen adapter.

    Raises:
        DeviceError: the driver gives wrong answers.
    """
    from halfstep.device.adapters import INT64, choose_adapter, close_device, open_device
    from halfstep.device.canary import fingerprint

    adapter = choose_adapter()
    device = open_device(adapter, features={INT64} & adapter.handle.features)
    try:
        return fingerprint(device)
    finally:
        close_device(device)


def _print_report(report: dict[str, Any], found: Fingerprint | None) -> None:
    print_text(
        f"halfstep {report['halfstep']}, Python {report['python']}, NumPy {report['numpy']}, "
        f"wgpu {report['wgpu']}, wgpu-native {report['wgpu_native']}"
    )
    for name, value in report["environment"].items():
        print_text(f"{name}={value}")
    for adapter in report["adapters"]:
        print_text(
            f"adapter {adapter['index']}: {adapter['name']}, {adapter['kind']}, "
            f"{adapter['backend']}, driver {adapter['driver'] or 'unnamed'}, "
            f"vendor {adapter['vendor']}"
        )
    if report["swiftshader"] is not None:
        file = report["swiftshader"]
        print_text(f"not asked for: SwiftShader; VK_DRIVER_FILES={file} chooses it")
    if report["chosen"] is not None:
        print_text(f"chosen: adapter {report['chosen']}, {report['reason']}")
        print_text(f"features: {', '.join(report['features']) or 'none that Halfstep uses'}")
    if found is not None:
        print_text(f"canary: right answers; {found}")
