"""The command `halfstep`: arguments in, files and exit codes out.

Results for machines go to stdout, messages for people to stderr. Exit codes: 0 done, 1 failed,
2 usage or scene error, 3 no suitable adapter, 4 device lost or driver failure, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from halfstep import __version__
from halfstep.errors import AdapterError, HalfstepError

EXIT_INTERRUPTED = 130  # as a shell reports SIGINT


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with ``argv``, by default the process's arguments; the exit code."""
    try:
        arguments = _parser().parse_args(argv)
    except SystemExit as exit_:
        return int(exit_.code or 0)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: _say(f"warning: {message}")
            code: int = arguments.run(arguments)
        sys.stdout.flush()
    except HalfstepError as error:
        _say(str(error))
        return error.exit_code
    except MemoryError:
        _say("not enough memory for this picture")
        return HalfstepError.exit_code
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of stdout has gone; the interpreter's own flush at exit must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return HalfstepError.exit_code
    return code


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="halfstep",
        description="Images of second-order surfaces and polyhedra, by n halvings per ray.",
    )
    parser.add_argument("--version", action="version", version=f"halfstep {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    render = commands.add_parser("render", help="render a scene to an image file")
    render.set_defaults(run=_render)
    _add_scene(render)
    render.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="image file; its ending is .png"
    )
    accuracy = render.add_mutually_exclusive_group()
    accuracy.add_argument("--steps", metavar="N", type=int, help="halvings of every ray")
    _add_tolerances(accuracy)
    render.add_argument(
        "--format", choices=("float32", "fixed32"), dest="number_format", help="number format"
    )
    render.add_argument(
        "--method", choices=("visible", "article"), help="joint logic first, or the paper's own"
    )
    render.add_argument("--samples", metavar="K", type=int, help="KxK samples in each pixel")
    render.add_argument("--json", action="store_true", help="describe the result on stdout")

    _add_tune(commands)

    doctor = commands.add_parser("doctor", help="list adapters, drivers, and what is chosen")
    doctor.set_defaults(run=_doctor)
    doctor.add_argument("--json", action="store_true", help="the same for machines")

    scenes = commands.add_parser("scenes", help="list the bundled scenes")
    scenes.set_defaults(run=_scenes)
    scenes.add_argument("--json", action="store_true", help="the same for machines")

    schema = commands.add_parser("schema", help="print the JSON Schema of scene files")
    schema.set_defaults(run=_schema)
    return parser


def _add_scene(command: argparse.ArgumentParser) -> None:
    """What every command that renders a scene takes."""
    command.add_argument("scene", metavar="SCENE", help="a scene file, or a name `scenes` lists")
    command.add_argument("--size", metavar="WxH", type=_size, help="pixels, as 640x480")
    command.add_argument(
        "--backend",
        choices=("auto", "gpu", "numpy"),
        default="auto",
        help="auto: a Vulkan adapter if there is one, else NumPy",
    )
    command.add_argument(
        "--adapter", metavar="NAME|INDEX", help="part of an adapter's name, or its number"
    )


def _add_tolerances(accuracy: Any) -> None:
    """The two ways to state a tolerance; ``accuracy`` is a group of options of a command."""
    accuracy.add_argument(
        "--tolerance-pixels", metavar="X", type=float, help="depth error allowed, in pixel widths"
    )
    accuracy.add_argument(
        "--tolerance", metavar="X", type=float, help="depth error allowed, in scene units"
    )


def _add_tune(commands: Any) -> None:
    tune = commands.add_parser("tune", help="measure what accuracy costs, and recommend steps")
    tune.set_defaults(run=_tune)
    _add_scene(tune)
    tune.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        required=True,
        help="folder for tune.csv, tune.json, tune.png and error.png",
    )
    tune.add_argument(
        "--steps", metavar="A:B[:S]", type=_steps, help="numbers of halvings from A to B by S"
    )
    accuracy = tune.add_mutually_exclusive_group()
    _add_tolerances(accuracy)
    tune.add_argument("--method", choices=("visible", "article"), help="by default both")
    tune.add_argument("--json", action="store_true", help="the report for machines on stdout")


def _steps(text: str) -> range:
    """Numbers A, A + S, … up to B of ``A:B:S``; whether they are allowed is the scene's to say."""
    match = re.fullmatch(r"(\d+)(?::(\d+)(?::(\d+))?)?", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B or A:B:S, as 8:20:2")
    first, last, stride = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
    if last < first or stride < 1:
        raise argparse.ArgumentTypeError(f"{text!r} has no number from A up to B by S")
    # Beyond a few thousand none is allowed, and a list of them would fill the memory.
    return range(first, min(last, first + 9999) + 1, stride)


def _size(text: str) -> tuple[int, int]:
    """Width and height of ``WxH``; whether they are allowed is the scene's to say."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not WxH, as 640x480")
    return int(match[1]), int(match[2])


def _render(arguments: argparse.Namespace) -> int:
    from halfstep.api import render
    from halfstep.image import check_output_path, write_png
    from halfstep.scene import load

    check_output_path(arguments.output)
    frame = render(
        load(arguments.scene),
        size=arguments.size,
        steps=arguments.steps,
        tolerance_pixels=arguments.tolerance_pixels,
        tolerance=arguments.tolerance,
        number_format=arguments.number_format,
        method=arguments.method,
        samples=arguments.samples,
        outputs=("image",),
        backend=arguments.backend,
        adapter=arguments.adapter,
    )
    write_png(arguments.output, frame.image)
    height, width, _ = frame.image.shape
    info = frame.info
    if arguments.json:
        _print_json({"path": arguments.output, "size": [width, height], "info": info})
    _say(
        f"{arguments.output}: {width}x{height} in {info['wall_ms'] / 1000:.2f} s on "
        f"{info['adapter']}"
    )
    return 0


def _tune(arguments: argparse.Namespace) -> int:
    from halfstep.image import check_output_folder
    from halfstep.plot import scale_of, write
    from halfstep.scene import load
    from halfstep.tune import METHODS, STEPS, tune

    check_output_folder(arguments.output)
    with _progress_bar("measuring") as progress:
        report = tune(
            load(arguments.scene),
            size=arguments.size,
            steps=arguments.steps or STEPS,
            tolerance_pixels=arguments.tolerance_pixels,
            tolerance=arguments.tolerance,
            methods=(arguments.method,) if arguments.method else METHODS,
            backend=arguments.backend,
            adapter=arguments.adapter,
            progress=progress,
        )
    names = write(report, arguments.output)
    if arguments.json:
        _print_json(report.as_dict())
    else:
        print(report.as_table())
    low, high = scale_of(report)
    _say(
        f"{arguments.output}: {', '.join(names)}; the colours of error.png are errors of {low:g} "
        f"to {high:g} pixel widths"
    )
    if "tune.png" not in names:
        _say("tune.png needs Matplotlib: pip install 'halfstep[plot]'")
    return 0


@contextmanager
def _progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A function that shows a part done, 0…1, on a terminal; elsewhere it is silent."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    width = 40

    def show(part: float) -> None:
        done = round(part * width)
        bar = "#" * done + "." * (width - done)
        sys.stderr.write(f"\r{label} [{bar}] {part:4.0%}")
        sys.stderr.flush()

    show(0.0)
    try:
        yield show
    finally:
        sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()


def _doctor(arguments: argparse.Namespace) -> int:
    import numpy as np

    from halfstep.device import describe

    report = {"halfstep": __version__, "python": platform.python_version(), "numpy": np.__version__}
    report |= describe()
    if arguments.json:
        _print_json(report)
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


def _scenes(arguments: argparse.Namespace) -> int:
    from halfstep.scene import bundled_scenes

    titles = bundled_scenes()
    if arguments.json:
        _print_json([{"name": name, "title": title} for name, title in titles.items()])
        return 0
    width = max(map(len, titles), default=0)
    for name, title in titles.items():
        print(f"{name:{width}}  {title}".rstrip())
    return 0


def _schema(arguments: argparse.Namespace) -> int:  # noqa: ARG001 - every command takes them
    from halfstep.scene import json_schema

    _print_json(json_schema())
    return 0


def _print_json(value: object) -> None:
    # ``info`` may hold NumPy numbers and arrays.
    print(json.dumps(value, indent=2, default=lambda array: array.tolist()))


def _say(message: str) -> None:
    print(message, file=sys.stderr)
