"""Draws the curves of a benchmark by Matplotlib."""

from __future__ import annotations

import io
import os
from typing import TYPE_CHECKING, Any

from halfstep.bench.report import Part, Report
from halfstep.errors import UsageError
from halfstep.files.whole import check_output_path, write_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Part, column of the x axis, column of the y axis, whether the axes are logarithmic.
_CURVES = (
    ("steps", "n", "device ms", False),
    ("pixels", "megapixels", "device ms", False),
    ("solids", "solids", "device ms", True),
    ("threads", "threads", "speed-up", False),
)
_COLOR = "#0b5fa5"


def check(path: str | os.PathLike[str]) -> None:
    """Check before measuring that a plot can be written to ``path``.

    Raises:
        UsageError: the path cannot be written, or Matplotlib is not installed.
    """
    check_output_path(path, (".png",))
    try:
        import matplotlib  # noqa: F401 - only to check that it is installed
    except ImportError:
        raise UsageError(f"{path}: needs Matplotlib: pip install 'halfstep[plot]'") from None


def write(report: Report, path: str | os.PathLike[str]) -> None:
    """Write the curves of ``report`` to ``path``, a PNG file.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7.2), dpi=110, layout="constrained")
    parts = {part.name: part for part in report.parts}
    for place, (name, across, upwards, logarithmic) in enumerate(_CURVES, start=1):
        axes = figure.add_subplot(2, 2, place)
        part = parts.get(name)
        if part is None or not part.rows:
            axes.set_axis_off()
            continue
        _draw(axes, part, across, upwards)
        if logarithmic:
            axes.set_xscale("log")
            axes.set_yscale("log")
        else:
            axes.set_xlim(left=0)
            axes.set_ylim(bottom=0)
    machine = report.machine
    figure.suptitle(f"{machine['adapter']}; {machine['processor']}, {machine['threads']} threads")
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    write_file(path, file.getvalue())


def _draw(axes: Axes, part: Part, across: str, upwards: str) -> None:
    """Draw the points of a part, and the lines fitted to them."""
    column = upwards if part.rows[0][upwards] is not None else "wall ms"
    x: list[Any] = [row[across] for row in part.rows]
    y: list[Any] = [row[column] for row in part.rows]
    axes.plot(x, y, "o", color=_COLOR)
    for name, fit in part.fits.items():
        ends = [0.0, max(x)]
        label = f"{name}: R² = {fit.r_squared:.4f}"
        heights = [fit.intercept + fit.slope * end for end in ends]
        axes.plot(ends, heights, "-", color=_COLOR, linewidth=1, label=label)
    if part.fits:
        axes.legend()
    axes.set_title(part.title, fontsize="medium")
    axes.set_xlabel(across)
    axes.set_ylabel(column)
    axes.grid(alpha=0.3)
