"""`halfstep info`: tells from a file how its picture was made, or what a scene contains."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.output import print_json, print_text, printable, telling
from halfstep.errors import HalfstepError, UsageError

if TYPE_CHECKING:
    from halfstep.models import Look
    from halfstep.scene import Fragment, Scene


def add(commands: Any) -> None:
    """Add the command to a parser's commands."""
    info = commands.add_parser("info", help="tell how a picture was made, or what a scene contains")
    info.set_defaults(run=run)
    info.add_argument("file", metavar="FILE", help="a file that Halfstep has written, or a scene")
    info.add_argument(
        "--pixel", metavar="X,Y", type=_pixel, help="what a pixel of an .npz file shows"
    )
    add_look(info)
    info.add_argument("--json", action="store_true", help="the same for machines")


def run(arguments: argparse.Namespace) -> int:
    """Read the file and report; the exit code."""
    look, is_scene = look_of(arguments), _is_scene(arguments.file)
    if not is_scene and look != type(look)():
        raise UsageError(f"{arguments.file}: is a picture, which keeps its look")
    if arguments.pixel is not None:
        return _tell_pixel(arguments.file, *arguments.pixel, as_json=arguments.json)
    facts = _scene(arguments.file, look) if is_scene else _picture(arguments.file)
    if arguments.json:
        print_json(facts)
        return 0
    width = max(map(len, facts))
    for name, value in facts.items():
        print_text(f"{name:{width}}  {_plain(value)}".rstrip())
    return 0


def _pixel(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"\s*(\d+)\s*,\s*(\d+)\s*", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y, as 320,240")
    return int(match[1]), int(match[2])


def _tell_pixel(file: str, column: int, row: int, *, as_json: bool) -> int:
    from halfstep.files import read_frame
    from halfstep.frames import pick

    if _is_scene(file):
        raise UsageError(f"{file}: is a scene; --pixel is of a picture of it, an .npz file")
    frame = read_frame(file)
    height, width = frame.solid.shape
    if column >= width or row >= height:
        raise UsageError(f"--pixel: {column},{row} is not in a picture of {width}x{height}")
    if as_json:
        facts = pick.found(frame, row, column)
        print_json({"pixel": [column, row], **{name: _finite(one) for name, one in facts.items()}})
    else:
        print_text(printable(pick.told(frame, row, column)))
    return 0


def _finite(value: Any) -> Any:
    """``value`` with None for numbers that are not finite, which JSON has not."""
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _is_scene(file: str) -> bool:
    from halfstep.models import is_model
    from halfstep.scene import bundled_scenes

    suffix = Path(file).suffix
    # A name without an ending is a bundled scene's: picture files have endings.
    return suffix == ".toml" or is_model(file) or (suffix == "" and file in bundled_scenes())


def _picture(file: str) -> dict[str, Any]:
    from halfstep.files import read_provenance

    facts = read_provenance(file)
    if facts is None:
        raise HalfstepError(
            f"{file}: does not say how it was made; Halfstep did not write it, or another program "
            "has written it again"
        )
    return dict(facts)


def _scene(file: str, look: Look) -> dict[str, Any]:
    from halfstep.models import load

    with telling() as begin:
        scene = load(file, look, begin)
    return {"scene_title": scene.title, "scene_sha256": scene.sha256, **_counts(scene)}


def _counts(scene: Scene) -> dict[str, int]:
    """The number of tables of each kind, also inside groups, and of copies of groups."""
    fragments = [*_fragments(scene)]
    return {
        "lights": len(scene.lights),
        "materials": len(scene.materials),
        "solids": len(scene.solids),
        "surfaces": sum(len(each.surfaces) for each in fragments),
        "parts": sum(len(each.parts) for each in fragments),
        "cells": sum(len(each.cells) for each in fragments),
        "groups": len(fragments) - 1,
        "copies": scene.layout().count,
    }


def _fragments(fragment: Fragment) -> Iterator[Fragment]:
    yield fragment
    for group in fragment.groups:
        yield from _fragments(group)


def _plain(value: Any) -> str:
    """``value`` on one line."""
    return printable(", ".join(map(str, value)) if isinstance(value, list) else str(value))
