"""Options for the view of a model of another program."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from halfstep.cli.options import names

if TYPE_CHECKING:
    from halfstep.models import Look


def add_look(command: argparse.ArgumentParser) -> None:
    """Add the options, which `look_of` collects."""
    group = command.add_argument_group(
        "files of other programs, such as geometry.xml of OpenMC or part.csg of OpenSCAD"
    )
    group.add_argument(
        "--color-by",
        metavar="WHAT",
        help="give each material, cell, group or place its own colour",
    )
    shown = "such as void, material:4, cell:7, or names of the file"
    group.add_argument(
        "--hide", metavar="NAMES", type=names, default=[], help=f"hide these, {shown}"
    )
    group.add_argument(
        "--only", metavar="NAMES", type=names, default=[], help=f"show only these, {shown}"
    )
    group.add_argument(
        "--clip",
        metavar="WHERE",
        action="append",
        default=[],
        help='keep only this part, such as "x > 0" or "x > 0 | y < 2"; several are combined by and',
    )
    group.add_argument(
        "--view", metavar="VIEW", help="iso, from three quarters, or a plane: xy, xz, yz"
    )
    group.add_argument("--eye", metavar="X,Y,Z", type=_point, help="position of the camera")
    group.add_argument(
        "--look-at", metavar="X,Y,Z", type=_point, help="point in the middle of the picture"
    )
    group.add_argument("--fov", metavar="DEGREES", type=float, help="vertical angle of view")
    group.add_argument(
        "--orthographic",
        metavar="HEIGHT",
        type=float,
        help="parallel rays, and the height of the picture in model units",
    )
    group.add_argument("--plot", metavar="N", type=int, help="show the model as plot N of the file")


def look_of(arguments: argparse.Namespace) -> Look:
    """The view of the model that the options describe."""
    from halfstep.models import Look

    return Look(
        color_by=arguments.color_by,
        hide=tuple(arguments.hide),
        only=tuple(arguments.only),
        clip=tuple(arguments.clip),
        view=arguments.view,
        eye=arguments.eye,
        look_at=arguments.look_at,
        fov_degrees=arguments.fov,
        orthographic_height=arguments.orthographic,
        plot=arguments.plot,
    )


def _point(text: str) -> tuple[float, float, float]:
    """Three numbers separated by commas."""
    number = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
    match = re.fullmatch(f"{number},{number},{number}", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,Z, as 10,-20,5")
    return float(match[1]), float(match[2]), float(match[3])
