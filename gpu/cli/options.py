"""Options that several commands take."""

from __future__ import annotations

import argparse
import re
from typing import Any

# As the path of a file.
STDOUT = "-"


def add_scene(command: argparse.ArgumentParser) -> None:
    """What every command that renders a scene takes."""
    command.add_argument("scene", metavar="SCENE", help="a scene file, or a name `scenes` lists")
    add_size(command)
    command.add_argument(
        "--backend",
        choices=("auto", "gpu", "numpy"),
        default="auto",
        help="auto: a Vulkan adapter if there is one, else NumPy",
    )
    add_adapter(command)


def add_rendering(command: argparse.ArgumentParser) -> None:
    """How a command renders, in place of what the scene says; `overrides` collects it."""
    accuracy = command.add_mutually_exclusive_group()
    accuracy.add_argument("--steps", metavar="N", type=int, help="halvings of every ray")
    add_tolerances(accuracy)
    add_conveyor(command)
    command.add_argument("--samples", metavar="K", type=int, help="KxK samples in each pixel")


def add_output(
    command: argparse.ArgumentParser,
    metavar: str,
    help_: str,
    *,
    stdout: bool = False,
    required: bool = True,
) -> None:
    """Where a command writes to; ``stdout`` says whether that may be ``-``."""

    def path(text: str) -> str:
        # The empty one, as of a variable that is not set, would be the current folder.
        if not text:
            raise argparse.ArgumentTypeError("is empty")
        if text == STDOUT and not stdout:
            raise argparse.ArgumentTypeError("only render writes to stdout; ./- is a file")
        return text

    command.add_argument(
        "-o", "--output", metavar=metavar, type=path, required=required, help=help_
    )


def add_size(command: argparse.ArgumentParser) -> None:
    """The size of a picture, in place of what the scene says."""
    command.add_argument("--size", metavar="WxH", type=size, help="pixels, as 640x480")


def add_adapter(command: argparse.ArgumentParser) -> None:
    """Which adapter to work on."""
    command.add_argument(
        "--adapter", metavar="NAME|INDEX", help="part of an adapter's name, or its number"
    )


def add_conveyor(
    command: argparse.ArgumentParser, otherwise: str = "by default the scene's"
) -> None:
    """Number format and method; ``otherwise`` says what there is without."""
    command.add_argument(
        "--format",
        choices=("float32", "fixed32"),
        dest="number_format",
        help=f"number format, {otherwise}",
    )
    command.add_argument(
        "--method",
        choices=("visible", "article"),
        help=f"joint logic first, or the paper's own, {otherwise}",
    )


def overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """What replaces the scene's own, as keywords of ``render``; None is not given."""
    names = ("size", "steps", "tolerance_pixels", "tolerance", "number_format", "method", "samples")
    return {name: getattr(arguments, name) for name in names}


def add_tolerances(accuracy: Any) -> None:
    """The two ways to state a tolerance; ``accuracy`` is a group of options of a command."""
    accuracy.add_argument(
        "--tolerance-pixels", metavar="X", type=float, help="depth error allowed, in pixel widths"
    )
    accuracy.add_argument(
        "--tolerance", metavar="X", type=float, help="depth error allowed, in scene units"
    )


def size(text: str) -> tuple[int, int]:
    """Width and height of ``WxH``; whether they are allowed is the scene's to say."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not WxH, as 640x480")
    return int(match[1]), int(match[2])
