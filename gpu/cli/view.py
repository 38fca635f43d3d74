"""`halfstep view`: shows a scene live."""

from __future__ import annotations

import argparse

from halfstep.cli.looking import add_look, look_of
from halfstep.cli.options import Commands, add_rendering, add_scene, overrides
from halfstep.cli.output import print_text, say
from halfstep.contract.choices import CANVASES


def add(commands: Commands) -> None:
    """Add the command to a parser's commands."""
    view = commands.add_parser(
        "view",
        help="show a scene live",
        description="Drag to turn the scene, with the right button or Shift to move it. The wheel "
        "zooms, a click describes the pixel, h lists all keys. The file is read again when it "
        "changes.",
    )
    view.set_defaults(run=run)
    add_scene(view)
    view.add_argument(
        "--canvas",
        choices=CANVASES,
        default="auto",
        help="glfw: a window; http: a page for a browser, whose address goes to stdout; terminal; "
        "auto: a window if there is a display, else a page",
    )
    view.add_argument(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address at which a page is served; by default 127.0.0.1, for this machine only",
    )
    view.add_argument("--port", metavar="N", type=_port, default=0, help="by default a free one")
    add_rendering(view)
    add_look(view)


def _port(text: str) -> int:
    """The number of a port, 0…65535."""
    if not (text.isascii() and text.isdecimal() and int(text) < 1 << 16):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 65535")
    return int(text)


def run(arguments: argparse.Namespace) -> int:
    """Show the scene until the view is closed, and return the exit code."""
    from halfstep.viewer.show import show
    from halfstep.viewer.watch import Source

    show(
        Source(arguments.scene, look_of(arguments), None, overrides(arguments)),
        canvas=arguments.canvas,
        backend=arguments.backend,
        adapter=arguments.adapter,
        tell=print_text,
        say=say,
        host=arguments.host,
        port=arguments.port,
    )
    return 0
