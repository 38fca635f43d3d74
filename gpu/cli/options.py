"""Options that several commands take."""

from __future__ import annotations

import argparse
import re
from typing import Any


def add_scene(command: argparse.ArgumentParser) -> None:
    """What every command that renders a scene takes."""
    command.add_argument("scene", metavar="SCENE", help="a scene file, or a name `scenes` lists")
    command.add_argument("--size", metavar="WxH", type=size, help="pixels, as 640x480")
    command.add_argument(
        "--backend",
        choices=("auto", "gpu", "numpy"),
        default="auto",
        help="auto: a Vulkan adapter if there is one, else NumPy",
    )
    command.add_argument(
        "--adapter", metavar="NAME|INDEX", help="part of an adapter's name, or its number"
    )


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
