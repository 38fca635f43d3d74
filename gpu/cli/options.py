"""Options that several commands share."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING, Protocol, cast

from halfstep.contract.choices import BACKENDS, METHODS, NUMBER_FORMATS

if TYPE_CHECKING:
    from halfstep.scene import Overrides

# The path that means stdout.
STDOUT = "-"


class Commands(Protocol):
    """The parser's collection of commands, to which a command adds itself."""

    def add_parser(
        self,
        name: str,
        *,
        help: str,  # noqa: A002 - argparse's name
        description: str | None = None,
    ) -> argparse.ArgumentParser:
        """Add a command, and return its parser."""


def add_scene(command: argparse.ArgumentParser) -> None:
    """Add the options of every command that renders a scene."""
    command.add_argument("scene", metavar="SCENE", help="a scene file, or a name `scenes` lists")
    add_size(command)
    command.add_argument(
        "--backend",
        choices=BACKENDS,
        default="auto",
        help="auto takes a Vulkan adapter if there is one, else NumPy",
    )
    add_adapter(command)


def add_rendering(command: argparse.ArgumentParser) -> None:
    """Add the options that replace the scene's render settings; `overrides` collects them."""
    add_accuracy(command, steps=True)
    add_conveyor(command)
    command.add_argument("--samples", metavar="K", type=int, help="KxK samples in each pixel")
    command.add_argument(
        "--shadows",
        action=argparse.BooleanOptionalAction,
        help="give all lights shadows, or none; by default the scene decides",
    )


def add_output(
    command: argparse.ArgumentParser,
    metavar: str,
    help_: str,
    *,
    stdout: bool = False,
    required: bool = True,
) -> None:
    """Add the option for the path to write; with ``stdout`` it may be ``-``."""

    def path(text: str) -> str:
        # An empty path, for example from an unset variable, would mean the current folder.
        if not text:
            raise argparse.ArgumentTypeError("is empty")
        if text == STDOUT and not stdout:
            raise argparse.ArgumentTypeError("only render writes to stdout; ./- is a file")
        return text

    command.add_argument(
        "-o", "--output", metavar=metavar, type=path, required=required, help=help_
    )


def add_size(command: argparse.ArgumentParser) -> None:
    """Add the option for the picture's size."""
    command.add_argument("--size", metavar="WxH", type=size, help="pixels, such as 640x480")


def add_adapter(command: argparse.ArgumentParser) -> None:
    """Add the option for the adapter."""
    command.add_argument(
        "--adapter", metavar="NAME|INDEX", help="part of an adapter's name, or its number"
    )


def add_conveyor(
    command: argparse.ArgumentParser, otherwise: str = "by default the scene's"
) -> None:
    """Add the options for number format and method; ``otherwise`` describes their default."""
    command.add_argument(
        "--format",
        choices=NUMBER_FORMATS,
        dest="number_format",
        help=f"number format, {otherwise}",
    )
    command.add_argument(
        "--method",
        choices=METHODS,
        help=f"visible: joint logic first; article: the paper's method; {otherwise}",
    )


def overrides(arguments: argparse.Namespace) -> Overrides:
    """The options that replace settings of the scene; None for those that are not given."""
    from halfstep.scene import Overrides

    names = Overrides.__annotations__
    return cast(Overrides, {name: getattr(arguments, name, None) for name in names})


def add_accuracy(command: argparse.ArgumentParser, *, steps: bool) -> None:
    """Add the two options for a tolerance and, with ``steps``, one for a number of halvings."""
    accuracy = command.add_mutually_exclusive_group()
    if steps:
        accuracy.add_argument("--steps", metavar="N", type=int, help="number of halvings")
    accuracy.add_argument(
        "--tolerance-pixels", metavar="X", type=float, help="depth error allowed, in pixel widths"
    )
    accuracy.add_argument(
        "--tolerance", metavar="X", type=float, help="depth error allowed, in scene units"
    )


def size(text: str) -> tuple[int, int]:
    """Width and height of ``WxH``. The scene decides whether they are allowed."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not WxH, as 640x480")
    return int(match[1]), int(match[2])


def names(text: str) -> list[str]:
    """Names separated by commas. The file or the frame decides whether they are outputs."""
    return [name.strip() for name in text.split(",")]
